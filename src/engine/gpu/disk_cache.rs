//! What is kept of a device between runs, in a folder that the caller names: the pipelines that its driver has compiled, and its speed
//! and the way to it as measured.
//!
//! One file an adapter and driver. It holds what the driver gives out (`vkGetPipelineCacheData`, which tells pipelines apart by their
//! shaders itself) and is read where all of it is as it was written: the adapter, the driver, this library's version and a checksum.
//! Whatever else lies there counts as nothing kept, and is replaced.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::device::driver_of;
use crate::engine::Link;
use crate::error::{Error, FileAction, Result};

/// First bytes of a file; a change of the layout changes the number.
const MAGIC: &[u8; 24] = b"polhode device cache  2\n";

/// How the files' names begin and end, which nobody else's do; and the end of one that is being written.
const BEGINNING: &str = "polhode-";
const ENDING: &str = ".device";
const UNFINISHED: &str = ".part";

/// A file that has grown past this many bytes is begun anew: drivers never forget a pipeline.
const MOST_BYTES: usize = 64 << 20;

/// What a file holds.
#[derive(Clone, Debug, Default, PartialEq)]
struct Contents {
    figures: Figures,
    /// What the driver has compiled, in the form that wgpu gives it.
    pipelines: Vec<u8>,
}

/// What was measured of a device: [`crate::engine::Backend::speed`] in `f32` and `f64`, then the figures of a [`Link`]. In a file not a
/// number where none was measured.
type Figures = [Option<f64>; 5];

/// The place of a link's first figure.
const LINK: usize = 2;

/// The file of an adapter.
#[derive(Debug)]
pub(crate) struct DiskCache {
    file: PathBuf,
    key: String,
    /// What the file holds; `None` where that is nothing that can be used.
    stored: Option<Contents>,
    figures: Mutex<Figures>,
}

/// What tells adapters, drivers and versions of the library apart.
fn key_of(info: &wgpu::AdapterInfo) -> String {
    let wgpu::AdapterInfo { name, vendor, device, backend, .. } = info;
    format!("{name}|{vendor:x}|{device:x}|{backend}|{}|{}", driver_of(info), env!("CARGO_PKG_VERSION"))
}

/// A file's name, the same for the same key.
fn name_of(info: &wgpu::AdapterInfo, key: &str) -> String {
    let wgpu::AdapterInfo { vendor, device, backend, .. } = info;
    format!("{BEGINNING}{backend}-{vendor:x}-{device:x}-{:08x}{ENDING}", crc32fast::hash(key.as_bytes()))
}

impl Contents {
    /// The bytes of a file: magic, checksum of the rest, key, figures, pipelines.
    fn to_bytes(&self, key: &str) -> Vec<u8> {
        let mut rest = (key.len() as u64).to_le_bytes().to_vec();
        rest.extend_from_slice(key.as_bytes());
        for figure in self.figures {
            rest.extend_from_slice(&figure.unwrap_or(f64::NAN).to_le_bytes());
        }
        rest.extend_from_slice(&self.pipelines);
        [MAGIC.as_slice(), &crc32fast::hash(&rest).to_le_bytes(), &rest].concat()
    }

    /// What bytes hold; `None` where they are not as [`Contents::to_bytes`] has made them for the same key.
    fn from_bytes(bytes: &[u8], key: &str) -> Option<Self> {
        let (sum, rest) = bytes.strip_prefix(MAGIC)?.split_first_chunk::<4>()?;
        if crc32fast::hash(rest) != u32::from_le_bytes(*sum) {
            return None;
        }
        let (length, rest) = rest.split_first_chunk::<8>()?;
        let (found, rest) = rest.split_at_checked(usize::try_from(u64::from_le_bytes(*length)).ok()?)?;
        if found != key.as_bytes() {
            return None;
        }
        let mut figures = Figures::default();
        let mut rest = rest;
        for figure in &mut figures {
            let (bytes, others) = rest.split_first_chunk::<8>()?;
            *figure = Some(f64::from_le_bytes(*bytes)).filter(|&figure| figure > 0.0);
            rest = others;
        }
        Some(Self { figures, pipelines: rest.to_vec() })
    }
}

impl DiskCache {
    /// Reads what is kept of an adapter in `folder`, which need not be there.
    pub fn read(folder: &Path, info: &wgpu::AdapterInfo) -> Self {
        let key = key_of(info);
        let file = folder.join(name_of(info, &key));
        let stored = fs::read(&file).ok().and_then(|bytes| Contents::from_bytes(&bytes, &key));
        let figures = Mutex::new(stored.as_ref().map(|stored| stored.figures).unwrap_or_default());
        Self { file, key, stored, figures }
    }

    /// A cache of pipelines that holds what is kept.
    pub fn pipelines(&self, device: &wgpu::Device) -> wgpu::PipelineCache {
        let data = self.stored.as_ref().map(|stored| stored.pipelines.as_slice()).filter(|data| !data.is_empty());
        cache_of(device, data)
    }

    /// A speed that is known; `place`: 0 for `f32`, 1 for `f64`.
    pub fn speed(&self, place: usize) -> Option<f64> {
        self.figures()[place]
    }

    /// Keeps a speed that was measured.
    pub fn set_speed(&self, place: usize, speed: f64) {
        self.figures()[place] = Some(speed);
    }

    /// What is known of the way to the device.
    pub fn link(&self) -> Option<Link> {
        let figures = *self.figures();
        Some(Link { wait: figures[LINK]?, to_device: figures[LINK + 1]?, to_host: figures[LINK + 2]? })
    }

    /// Keeps what was measured of it.
    pub fn set_link(&self, link: Link) {
        self.figures()[LINK..].copy_from_slice(&[link.wait, link.to_device, link.to_host].map(Some));
    }

    fn figures(&self) -> MutexGuard<'_, Figures> {
        self.figures.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Writes what there is now, where that is something new. Nothing depends on it, so that what cannot be written is passed over.
    pub fn write(&self, pipelines: Option<Vec<u8>>) {
        let figures = *self.figures();
        let pipelines = pipelines.filter(|pipelines| pipelines.len() <= MOST_BYTES).unwrap_or_default();
        let contents = Contents { figures, pipelines };
        if self.stored.as_ref() != Some(&contents) {
            let _ = replace(&self.file, &contents.to_bytes(&self.key));
        }
    }
}

/// A cache of pipelines with what such a cache has given out before.
#[allow(unsafe_code, reason = "what the driver is given back is what it gave, as far as a checksum tells")]
fn cache_of(device: &wgpu::Device, data: Option<&[u8]>) -> wgpu::PipelineCache {
    let descriptor = wgpu::PipelineCacheDescriptor { label: Some("kept"), data, fallback: true };
    // SAFETY: the data is what `PipelineCache::get_data` gave for an adapter and driver of the same name and version: `Contents` has
    // compared both and a checksum, and wgpu and the driver compare their own headers. Whoever else may write to the caller's folder
    // may as well replace the program.
    unsafe { device.create_pipeline_cache(&descriptor) }
}

/// Writes a file so that readers find the former one or all of the new one.
fn replace(file: &Path, bytes: &[u8]) -> std::io::Result<()> {
    if let Some(folder) = file.parent() {
        fs::create_dir_all(folder)?;
    }
    // Another process may write the same file now.
    let beside = file.with_extension(format!("{}{ENDING}{UNFINISHED}", std::process::id()));
    let written = fs::File::create(&beside).and_then(|mut file| file.write_all(bytes));
    written.and_then(|()| fs::rename(&beside, file)).inspect_err(|_| {
        // Another run replaces what is left.
        let _ = fs::remove_file(&beside);
    })
}

/// Whether a file's name is one of [`name_of`], or of one that a process which was killed has left half written.
fn is_ours(file: &Path) -> bool {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    name.starts_with(BEGINNING) && name.strip_suffix(UNFINISHED).unwrap_or(&name).ends_with(ENDING)
}

/// Removes what is kept of all devices in a folder, and no other files; gives the number of files and their bytes. A folder that is not there holds none.
///
/// # Errors
///
/// [`Error::File`] where the folder cannot be read or a file not be removed.
pub fn clear_cache(folder: &Path) -> Result<(usize, u64)> {
    let failed = |path: &Path, action, error: std::io::Error| Error::file(path, action, &error);
    let entries = match fs::read_dir(folder) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok((0, 0)),
        entries => entries.map_err(|error| failed(folder, FileAction::Read, error))?,
    };
    let (mut files, mut bytes) = (0, 0);
    for entry in entries {
        let path = entry.map_err(|error| failed(folder, FileAction::Read, error))?.path();
        if is_ours(&path) {
            bytes += path.metadata().map_or(0, |metadata| metadata.len());
            fs::remove_file(&path).map_err(|error| failed(&path, FileAction::Remove, error))?;
            files += 1;
        }
    }
    Ok((files, bytes))
}

#[cfg(test)]
mod tests {
    use super::super::{Gpu, GpuOptions};
    use super::*;
    use crate::engine::Backend as _;
    use crate::engine::batch::{AnyBatch, Batch};
    use crate::kernel::method::Method;
    use crate::math::Precision;

    fn contents() -> Contents {
        Contents { figures: [Some(12.5), None, Some(5e-5), Some(8e9), Some(6e9)], pipelines: (0..200).collect() }
    }

    #[test]
    fn what_is_kept_reads_back() {
        for contents in [
            contents(),
            Contents::default(),
            Contents { figures: [None, Some(1e-3), None, None, None], pipelines: vec![] },
        ] {
            assert_eq!(Contents::from_bytes(&contents.to_bytes("a key"), "a key"), Some(contents));
        }
    }

    #[test]
    fn what_is_damaged_or_of_another_device_is_not_read() {
        let bytes = contents().to_bytes("a key");
        for key in ["another", "a kex", "", "a key "] {
            assert_eq!(Contents::from_bytes(&bytes, key), None, "{key}");
        }
        for length in 0..bytes.len() {
            assert_eq!(Contents::from_bytes(&bytes[..length], "a key"), None, "{length} bytes");
        }
        for place in 0..8 * bytes.len() {
            let mut damaged = bytes.clone();
            damaged[place / 8] ^= 1 << (place % 8);
            assert_eq!(Contents::from_bytes(&damaged, "a key"), None, "bit {place}");
        }
    }

    #[test]
    fn a_device_is_kept_and_found_again() {
        let folder = tempfile::tempdir().expect("a folder");
        // Not there yet.
        let cache = folder.path().join("polhode");
        let open = || {
            let options = GpuOptions { software: true, cache: Some(cache.clone()), ..GpuOptions::default() };
            pollster::block_on(Gpu::open(options)).expect("tests need a Vulkan driver")
        };
        let files = || -> Vec<PathBuf> {
            let entries = fs::read_dir(&cache).expect("a folder").map(|entry| entry.expect("an entry").path());
            entries.collect()
        };
        let first = open();
        let batch = AnyBatch::F32(Batch::at_rest(3));
        first.start(batch, Method::Rk4).expect("started").ready().expect("compiled");
        let speed = first.speed(Precision::F32).expect("measured");
        let link = first.link().expect("measured");
        assert!(link.wait > 0.0 && link.wait < 1.0 && link.to_device > 1e7 && link.to_host > 1e7, "{link:?}");
        drop(first);
        let [file] = files().try_into().expect("one file");
        let written = fs::read(&file).expect("a file");

        // A speed that no measurement gives is taken from the file.
        let key = open().device.disk_cache().expect("a folder is named").key.clone();
        let stored = Contents::from_bytes(&written, &key).expect("as written");
        assert_eq!(stored.figures[..LINK], [Some(speed), None]);
        assert!(!stored.pipelines.is_empty(), "Vulkan gives out what it has compiled");
        let mut figures = stored.figures;
        figures[0] = Some(1e6);
        fs::write(&file, Contents { figures, ..stored }.to_bytes(&key)).expect("written");
        let second = open();
        assert_eq!(second.link(), Some(link), "not measured again");
        assert_eq!(second.speed(Precision::F32), Some(1e6));
        drop(second);

        // What is damaged counts as nothing, and is replaced.
        fs::write(&file, &written[..written.len() - 1]).expect("written");
        let third = open();
        assert!(third.speed(Precision::F32).is_some_and(|speed| speed < 1e5));
        drop(third);
        let replaced = fs::read(&file).expect("a file");
        assert!(Contents::from_bytes(&replaced, &key).is_some_and(|contents| contents.figures[0].is_some()));
        assert_eq!(files(), std::slice::from_ref(&file));

        // Of a process that was killed, and of others.
        fs::write(file.with_extension("77.device.part"), "half").expect("written");
        let others = ["film.part", "usb.device", "polhode-notes.txt"].map(|name| cache.join(name));
        others.iter().for_each(|other| fs::write(other, "not ours").expect("written"));
        assert_eq!(clear_cache(&cache).expect("cleared"), (2, replaced.len() as u64 + 4));
        let mut left = files();
        left.sort();
        assert_eq!(left, ["film.part", "polhode-notes.txt", "usb.device"].map(|name| cache.join(name)));
        assert_eq!(clear_cache(&cache.join("nowhere")).expect("nothing to do"), (0, 0));
    }

    #[test]
    fn a_folder_that_cannot_be_made_keeps_nothing_and_stops_nobody() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("a file");
        fs::write(&file, "in the way").expect("written");
        let options = GpuOptions { software: true, cache: Some(file.join("below")), ..GpuOptions::default() };
        let gpu = pollster::block_on(Gpu::open(options)).expect("tests need a Vulkan driver");
        assert!(gpu.speed(Precision::F32).is_some());
        drop(gpu);
        assert_eq!(fs::read(&file).expect("as it was"), b"in the way");
        assert!(clear_cache(&file).is_err());
    }
}
