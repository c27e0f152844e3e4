//! How much memory the host has left for this process, as Linux tells it; other systems are trusted.

use std::{fs, path::Path};

/// Bytes that this process may still take, and what sets that limit. As much as one may ask for where nothing is known.
pub fn left() -> (u64, &'static str) {
    let limits = fs::read_to_string("/proc/self/limits").unwrap_or_default();
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let meminfo = fs::read_to_string("/proc/meminfo").unwrap_or_default();
    let kib = |text: &str, name: &str| number(text, name).map(|kib| kib * 1024);
    let of_limit = |limit: &str, taken: &str| Some(number(&limits, limit)?.saturating_sub(kib(&status, taken)?));
    let free = kib(&meminfo, "MemAvailable:").map(|bytes| bytes + kib(&meminfo, "SwapFree:").unwrap_or(0));
    [
        (free, "free memory and swap space"),
        (of_limit("Max address space", "VmSize:"), "the limit of address space (ulimit -v)"),
        (of_limit("Max data size", "VmData:"), "the limit of data (ulimit -d)"),
        (control_group(), "the memory limit of the control group"),
    ]
    .into_iter()
    .filter_map(|(bytes, limit)| Some((bytes?, limit)))
    .min_by_key(|(bytes, _)| *bytes)
    .unwrap_or((u64::MAX, "nothing"))
}

/// The number after `name`, at the start of a line; none for "unlimited".
fn number(text: &str, name: &str) -> Option<u64> {
    let rest = text.lines().find_map(|line| line.strip_prefix(name))?;
    rest.split_whitespace().next()?.parse().ok()
}

/// What the tightest control group around this process leaves, of either version.
fn control_group() -> Option<u64> {
    let groups = fs::read_to_string("/proc/self/cgroup").ok()?;
    groups
        .lines()
        .filter_map(|line| {
            let [_, controllers, path] = line.splitn(3, ':').collect::<Vec<_>>().try_into().ok()?;
            let (root, [limit, taken]) = match controllers {
                "" => ("/sys/fs/cgroup", ["memory.max", "memory.current"]),
                "memory" => ("/sys/fs/cgroup/memory", ["memory.limit_in_bytes", "memory.usage_in_bytes"]),
                _ => return None,
            };
            // A container may see its own group as the root, or by the name that it has outside.
            let folders = Path::new(path.trim_start_matches('/')).ancestors().map(|group| Path::new(root).join(group));
            folders
                .filter_map(|folder| {
                    let read = |name: &str| fs::read_to_string(folder.join(name)).ok();
                    let bytes = |name: &str| read(name)?.trim().parse::<u64>().ok();
                    // Files that were read are dropped when memory is short.
                    let cached = number(&read("memory.stat")?, "inactive_file ").unwrap_or(0);
                    Some(bytes(limit)?.saturating_sub(bytes(taken)?.saturating_sub(cached)))
                })
                .min()
        })
        .min()
}
