//! The free memory, checked before it is allocated.

use std::fs::read_to_string;
use std::path::Path;

use crate::error::{Error, Result};

/// Less than this is allocated without a check.
const UNASKED: usize = 1 << 20;

/// Bytes that this process can still allocate, if the system tells (Linux): the least of what the machine has left, what the process's
/// control groups leave, and its own limits.
pub fn available() -> Option<u64> {
    available_by(Path::new("/proc"), Path::new("/sys/fs/cgroup"))
}

/// Refuses work on `bodies` bodies that needs more memory than is free.
///
/// # Errors
///
/// [`Error::TooManyBodies`].
pub fn require(bodies: usize, bytes: usize, purpose: &'static str) -> Result<()> {
    if bytes < UNASKED {
        return Ok(());
    }
    match available() {
        Some(available) if (bytes as u64) > available => {
            Err(Error::TooManyBodies { bodies, purpose, needed: bytes as u64, available })
        }
        _ => Ok(()),
    }
}

/// The error for an allocation that failed.
pub(crate) fn refusal(bodies: usize, bytes: usize, purpose: &'static str) -> Error {
    Error::TooManyBodies { bodies, purpose, needed: bytes as u64, available: available().unwrap_or(0) }
}

/// As [`available`], from these folders.
fn available_by(proc: &Path, cgroup: &Path) -> Option<u64> {
    let machine = kibibytes(&read_to_string(proc.join("meminfo")).ok()?, "MemAvailable:");
    [machine, group_rest(proc, cgroup), own_rest(proc)].into_iter().flatten().min()
}

/// The number of kibibytes after `name` in one of the system's tables, in bytes.
fn kibibytes(table: &str, name: &str) -> Option<u64> {
    let line = table.lines().find(|line| line.starts_with(name))?;
    line.split_whitespace().nth(1)?.parse().ok().map(|kibibytes: u64| kibibytes * 1024)
}

/// What the limits of this process (`ulimit -v`, `ulimit -d`) leave.
fn own_rest(proc: &Path) -> Option<u64> {
    let limits = read_to_string(proc.join("self/limits")).ok()?;
    let status = read_to_string(proc.join("self/status")).ok()?;
    let rest = |limit: &str, used: &str| {
        let line = limits.lines().find_map(|line| line.strip_prefix(limit))?;
        // "unlimited" is not a number.
        let limit: u64 = line.split_whitespace().next()?.parse().ok()?;
        Some(limit.saturating_sub(kibibytes(&status, used)?))
    };
    let rests = [rest("Max address space", "VmSize:"), rest("Max data size", "VmData:")];
    rests.into_iter().flatten().min()
}

/// The files of a control group: its limit, its usage, and the name in `memory.stat` of the part of the usage that can be reclaimed.
type GroupFiles = [&'static str; 3];

/// What the control groups of this process leave, version 1 or 2: each group limits those within it.
fn group_rest(proc: &Path, cgroup: &Path) -> Option<u64> {
    const FIRST: GroupFiles = ["memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"];
    const SECOND: GroupFiles = ["memory.max", "memory.current", "inactive_file"];
    let groups = read_to_string(proc.join("self/cgroup")).ok()?;
    let rests = groups.lines().filter_map(|line| {
        // Number, controllers, path; version 2 has one line, without controllers.
        let mut fields = line.splitn(3, ':');
        let (number, controllers, path) = (fields.next()?, fields.next()?, fields.next()?);
        let (root, files) = match controllers {
            "" if number == "0" => (cgroup.to_owned(), SECOND),
            _ if controllers.split(',').any(|controller| controller == "memory") => (cgroup.join("memory"), FIRST),
            _ => return None,
        };
        // In a container the path may be the one outside of it: then only the root is found.
        let path = Path::new(path.trim_start_matches('/'));
        path.ancestors().filter_map(|group| rest_of_group(&root.join(group), files)).min()
    });
    rests.min()
}

fn rest_of_group(group: &Path, [limit, used, droppable]: GroupFiles) -> Option<u64> {
    let number = |name: &str| read_to_string(group.join(name)).ok()?.trim().parse::<u64>().ok();
    let (limit, used) = (number(limit)?, number(used)?);
    let statistics = read_to_string(group.join("memory.stat")).unwrap_or_default();
    let cached = statistics.lines().find_map(|line| line.strip_prefix(droppable)?.trim().parse().ok());
    Some(limit.saturating_sub(used.saturating_sub(cached.unwrap_or(0))))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The available memory of a machine with 8 GB left, according to these files.
    fn machine(files: &[(&str, &str)]) -> Option<u64> {
        let folder = tempfile::tempdir().expect("a folder");
        let unlimited = "Max data size unlimited unlimited bytes\nMax address space unlimited unlimited bytes\n";
        let standard = [
            ("proc/meminfo", "MemTotal: 9000000 kB\nMemAvailable:    8000000 kB\n"),
            ("proc/self/limits", unlimited),
            ("proc/self/status", "VmSize:\t  100000 kB\nVmData:\t  50000 kB\n"),
        ];
        for (name, text) in standard.iter().chain(files) {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().expect("a folder")).expect("made");
            std::fs::write(path, text).expect("written");
        }
        available_by(&folder.path().join("proc"), &folder.path().join("cgroup"))
    }

    #[test]
    fn the_least_of_machine_groups_and_limits_counts() {
        assert_eq!(machine(&[]), Some(8_000_000 * 1024));
        let address_space = "Max address space         1000000000           unlimited            bytes\n";
        assert_eq!(machine(&[("proc/self/limits", address_space)]), Some(1_000_000_000 - 100_000 * 1024));
        let data = "Max data size             1000000000           unlimited            bytes\n";
        assert_eq!(machine(&[("proc/self/limits", data)]), Some(1_000_000_000 - 50_000 * 1024));
    }

    #[test]
    fn control_groups_of_version_2_limit_those_within_them() {
        let groups = [
            ("proc/self/cgroup", "0::/jobs/run\n"),
            ("cgroup/jobs/run/memory.max", "max\n"),
            ("cgroup/jobs/run/memory.current", "5000\n"),
            ("cgroup/jobs/memory.max", "3000000\n"),
            ("cgroup/jobs/memory.current", "1000000\n"),
            ("cgroup/jobs/memory.stat", "anon 600000\ninactive_file 400000\n"),
        ];
        assert_eq!(machine(&groups), Some(2_400_000));
    }

    #[test]
    fn control_groups_of_version_1_are_found_from_within_a_container() {
        let groups = [
            ("proc/self/cgroup", "5:cpu:/docker/1234\n4:hugetlb,memory:/docker/1234\n0::/\n"),
            ("cgroup/memory/memory.limit_in_bytes", "2000000\n"),
            ("cgroup/memory/memory.usage_in_bytes", "2500000\n"),
            ("cgroup/memory/memory.stat", "inactive_file 1\ntotal_inactive_file 700000\n"),
        ];
        assert_eq!(machine(&groups), Some(200_000));
    }
}
