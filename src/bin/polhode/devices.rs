//! `polhode devices`.

use std::path::Path;

use polhode::engine::gpu::{Probe, clear_cache};
use polhode::engine::{Adapter, Devices, devices as list_devices};
use serde_json::{Value, json};

use crate::arguments::DevicesArguments;
use crate::engine;
use crate::output::{self, Failure};

/// Lists the engines of this machine, or clears their cache.
pub fn devices(arguments: &DevicesArguments) -> Result<(), Failure> {
    if arguments.clear_cache {
        return output::show(&match engine::cache_folder(&arguments.cache) {
            None => "there is no device cache\n".to_owned(),
            Some(folder) => {
                let (files, bytes) = clear_cache(&folder)?;
                let files = if files == 1 { "1 file".to_owned() } else { format!("{files} files") };
                format!("removed {files} of {bytes} bytes from {}\n", folder.display())
            }
        });
    }
    let devices = list_devices();
    let cache = engine::cache_folder(&arguments.cache);
    if arguments.json {
        return output::print(&format!("{:#}\n", json_value(&devices, cache.as_deref())));
    }
    output::show(&table(&devices, cache.as_deref()))
}

fn table(devices: &Devices, cache: Option<&Path>) -> String {
    let mut text = String::new();
    for adapter in &devices.adapters {
        text += &adapter_lines(adapter);
    }
    if devices.adapters.is_empty() {
        text += "no GPU adapter\n";
    }
    text += &format!("cpu  {}\n", devices.cpu.name);
    text += &format!("\n--engine auto takes: {}\n", devices.auto);
    text += &format!("--device-cache: {}\n", cache.unwrap_or(Path::new("none")).display());
    text
}

fn adapter_lines(adapter: &Adapter) -> String {
    const MEBIBYTE: u64 = 1 << 20;
    let limits = &adapter.limits;
    let mut text = format!("{:<4} {} ({}, {})\n", adapter.index, adapter.name, adapter.kind, adapter.backend);
    text += &format!("       driver   {}\n", adapter.driver);
    text += &format!(
        "       limits   {} MiB per binding, {} MiB per buffer, {} workgroups of {} invocations\n",
        limits.binding_bytes / MEBIBYTE,
        limits.buffer_bytes / MEBIBYTE,
        limits.workgroups,
        limits.workgroup_invocations
    );
    let yes_no = |flag: bool| if flag { "yes" } else { "no" };
    text += &format!("       f64 {}, 64-bit integers {}\n", yes_no(adapter.float64), yes_no(adapter.int64));
    match &adapter.arithmetic {
        Err(error) => text += &format!("       unusable {error}\n"),
        Ok(arithmetic) => {
            text += &format!("       f32      {}\n", probe_words(&arithmetic.f32));
            if let Some(probe) = &arithmetic.f64 {
                text += &format!("       f64      {}\n", probe_words(probe));
            }
            let precisions: Vec<_> = adapter.precisions().iter().map(|precision| precision.name()).collect();
            text += &format!("       usable   {}\n", precisions.join(", "));
        }
    }
    text
}

/// A probe described in one line.
fn probe_words(probe: &Probe) -> String {
    let two_sum = match (probe.two_sum_plain, probe.two_sum_barrier) {
        (true, _) => "two-sum exact",
        (false, true) => "two-sum exact only with the barrier",
        (false, false) => "two-sum lost",
    };
    let ulps = |ulps: u64| if ulps == u64::MAX { "not a number".to_owned() } else { format!("{ulps} ulp") };
    let rounding = if probe.correctly_rounded { "sums and products exact to rounding" } else { "ROUNDING WRONG" };
    format!(
        "{rounding}, {two_sum}, division {}, square root {}, subnormals {}, fma {}",
        ulps(probe.division_ulps),
        ulps(probe.square_root_ulps),
        if probe.subnormals { "kept" } else { "flushed" },
        probe.fma
    )
}

fn json_value(devices: &Devices, cache: Option<&Path>) -> Value {
    let adapters: Vec<_> = devices.adapters.iter().map(adapter_value).collect();
    json!({
        "adapters": adapters,
        "cpu": devices.cpu.name,
        "auto": devices.auto.to_string(),
        "device_cache": cache.map(Path::to_string_lossy),
    })
}

fn adapter_value(adapter: &Adapter) -> Value {
    let precisions: Vec<_> = adapter.precisions().iter().map(|precision| precision.name()).collect();
    let (probes, unusable) = match &adapter.arithmetic {
        Ok(arithmetic) => (json!(arithmetic), None),
        Err(error) => (Value::Null, Some(error.to_string())),
    };
    json!({
        "index": adapter.index,
        "name": adapter.name,
        "kind": adapter.kind.to_string(),
        "backend": adapter.backend,
        "driver": adapter.driver,
        "limits": adapter.limits,
        "float64": adapter.float64,
        "int64": adapter.int64,
        "probes": probes,
        "unusable": unusable,
        "precisions": precisions,
    })
}
