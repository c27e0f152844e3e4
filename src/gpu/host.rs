//! How much memory the host has left for this process, as Linux tells it; other systems are trusted.

use crate::{Error, Result};
use std::{fs, path::Path};

/// What a driver on the processor takes to compile and run kernels: bytes of memory, and of address space. Measured
/// with Mesa 22.3.6 on two cores: 90 MB and 320 MB. It crashes where it gets less.
const DRIVER: [u64; 2] = [128 << 20, 400 << 20];

/// What this process may still take.
#[derive(Clone, Copy, Debug)]
pub struct Left {
    pub bytes: u64,
    /// What sets that limit, in words.
    pub limit: &'static str,
}

/// What is left for us; beside what the driver of the device needs, where that is the `processor`. As much as one may
/// ask for where nothing is known.
pub fn left(processor: bool) -> Left {
    let limits = fs::read_to_string("/proc/self/limits").unwrap_or_default();
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let meminfo = fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let kib = |text: &str, name: &str| number(text, name).map(|kib| kib * 1024);
    let of_limit = |limit: &str, taken: &str| Some(number(&limits, limit)?.saturating_sub(kib(&status, taken)?));
    let free = kib(&meminfo, "MemAvailable:").map(|bytes| bytes + kib(&meminfo, "SwapFree:").unwrap_or(0));
    let [memory, addresses] = if processor { DRIVER } else { [0; 2] };
    [
        (free, memory, "what is free of the machine's memory"),
        (control_group(), memory, "the memory limit of the control group"),
        (of_limit("Max address space", "VmSize:"), addresses, "the limit of address space (ulimit -v)"),
        (of_limit("Max data size", "VmData:"), addresses, "the limit of data (ulimit -d)"),
    ]
    .into_iter()
    .filter_map(|(bytes, driver, limit)| Some(Left { bytes: bytes?.saturating_sub(driver), limit }))
    .min_by_key(|left| left.bytes)
    .unwrap_or(Left { bytes: u64::MAX, limit: "nothing" })
}

/// # Errors
/// [`Error::Memory`] if not even the driver of a device that is the processor has what it needs.
pub fn check_driver() -> Result<()> {
    let Left { bytes, limit } = left(true);
    if bytes > 0 {
        return Ok(());
    }
    let [memory, addresses] = DRIVER.map(|bytes| bytes >> 20);
    let problem = format!(
        "a driver on the processor needs {memory} MiB of memory and {addresses} MiB of address space, and less is left \
         by {limit}; raise that limit or end other programs"
    );
    Err(Error::Memory { step: "open the device".into(), problem })
}

/// Gives memory that was freed back to the system: glibc keeps it in the heap of each thread that made it.
pub fn give_back_freed() {
    // SAFETY: it touches nothing that is in use.
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    unsafe {
        libc::malloc_trim(0);
    }
}

/// The number after `name`, at the start of a line; none for "unlimited".
fn number(text: &str, name: &str) -> Option<u64> {
    let rest = text.lines().find_map(|line| line.strip_prefix(name))?;
    rest.split_whitespace().next()?.parse().ok()
}

/// What the tightest control group around this process leaves, of either version.
fn control_group() -> Option<u64> {
    let groups = fs::read_to_string("/proc/self/cgroup").ok()?;
    groups.lines().filter_map(of_group).min()
}

/// What the groups in a line of /proc/self/cgroup leave.
fn of_group(line: &str) -> Option<u64> {
    let [_, controllers, path] = line.splitn(3, ':').collect::<Vec<_>>().try_into().ok()?;
    let (root, limit, taken, cached) = match controllers {
        "" => ("/sys/fs/cgroup", "memory.max", "memory.current", "inactive_file "),
        "memory" => ("/sys/fs/cgroup/memory", "memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file "),
        _ => return None,
    };
    // A container may see its own group as the root, or by the name that it has outside.
    let groups = Path::new(path.trim_start_matches('/')).ancestors().map(|group| Path::new(root).join(group));
    let left = groups.filter_map(|group| {
        let read = |name: &str| fs::read_to_string(group.join(name)).ok();
        let bytes = |name: &str| read(name)?.trim().parse::<u64>().ok();
        // Files that were read are dropped when memory is short.
        let files = number(&read("memory.stat")?, cached).unwrap_or(0);
        Some(bytes(limit)?.saturating_sub(bytes(taken)?.saturating_sub(files)))
    });
    left.min()
}
