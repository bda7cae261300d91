//! How much memory may be used: asked before anything large is allocated, so that a limit ends in a message.

use crate::error::{Error, Place, Result};
use crate::open::system_text;
use rustix::process::{Resource, getrlimit};

/// What inference, threads and the allocator take besides what is counted, bytes.
const RESERVE: u64 = 16 << 20;

/// What limits the memory of this process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Available {
    /// Bytes that can still be allocated.
    pub bytes: u64,
    /// Who says so.
    pub limit: &'static str,
}

/// The tightest of the address-space limit, the control group's limit and the machine's free memory; `None` where
/// none of them can be read.
pub fn available() -> Option<Available> {
    let address_space = address_space_limit().map(|limit| Available {
        bytes: limit.saturating_sub(statm_field(0).unwrap_or(0)),
        limit: "the address-space limit (ulimit -v)",
    });
    let group = cgroup_headroom().map(|bytes| Available {
        bytes,
        limit: "the control group's memory limit",
    });
    let machine = machine_free().map(|bytes| Available {
        bytes,
        limit: "the machine's free memory",
    });
    [address_space, group, machine]
        .into_iter()
        .flatten()
        .min_by_key(|available| available.bytes)
}

/// Bytes that work may take: what is available less what inference, threads and the allocator take besides.
pub fn spare() -> Option<u64> {
    available().map(|available| available.bytes.saturating_sub(RESERVE))
}

/// The address-space limit (`ulimit -v`), bytes; `None` where there is none.
pub fn address_space_limit() -> Option<u64> {
    getrlimit(Resource::As).current
}

/// Refuses work that needs more memory than there is.
///
/// # Errors
/// [`Error::Content`] about `subject` with both numbers.
pub fn require(subject: &str, bytes: u64, remedy: &str) -> Result<()> {
    let bytes = bytes.saturating_add(RESERVE);
    match available() {
        Some(available) if bytes > available.bytes => Err(Error::content(
            Place::file(subject),
            format!(
                "needs about {} MB of memory, {} leaves {} MB",
                bytes.div_ceil(1_000_000),
                available.limit,
                available.bytes / 1_000_000
            ),
            remedy,
        )),
        _ => Ok(()),
    }
}

/// Field of `/proc/self/statm`, in bytes (pages × page size); field 0 is the size of the address space.
fn statm_field(field: usize) -> Option<u64> {
    let text = system_text("/proc/self/statm")?;
    let pages: u64 = text.split_whitespace().nth(field)?.parse().ok()?;
    Some(pages * rustix::param::page_size() as u64)
}

/// Limit minus use of the tightest control group (version 2, or the memory controller of version 1).
fn cgroup_headroom() -> Option<u64> {
    let groups = system_text("/proc/self/cgroup")?;
    let number = |path: &str| system_text(path)?.trim().parse::<u64>().ok();
    let mut tightest = None;
    for line in groups.lines() {
        let mut parts = line.splitn(3, ':').skip(1);
        let (controllers, path) = (parts.next()?, parts.next()?);
        let (root, limit, used) = match controllers {
            "" => ("/sys/fs/cgroup", "memory.max", "memory.current"),
            _ if controllers.split(',').any(|c| c == "memory") => (
                "/sys/fs/cgroup/memory",
                "memory.limit_in_bytes",
                "memory.usage_in_bytes",
            ),
            _ => continue,
        };
        // A limit may stand at any ancestor; inside a container the path may not exist below the mount.
        let mut folder = path.trim_end_matches('/');
        loop {
            let read = |name: &str| number(&format!("{root}{folder}/{name}"));
            if let (Some(limit), Some(used)) = (read(limit), read(used)) {
                let headroom = limit
                    .saturating_sub(used.saturating_sub(file_cache(&format!("{root}{folder}"))));
                tightest = Some(tightest.map_or(headroom, |t: u64| t.min(headroom)));
            }
            match folder.rfind('/') {
                Some(cut) => folder = &folder[..cut],
                None => break,
            }
        }
    }
    tightest
}

/// Cached file pages of a control group: they count as used and are given back on demand, bytes.
fn file_cache(group: &str) -> u64 {
    let text = system_text(&format!("{group}/memory.stat")).unwrap_or_default();
    let value = |key: String| -> Option<u64> {
        let field = text
            .lines()
            .find_map(|line| line.strip_prefix(&key)?.strip_prefix(' '))?;
        field.parse::<u64>().ok()
    };
    let sum = |prefix: &str| -> Option<u64> {
        Some(value(format!("{prefix}inactive_file"))? + value(format!("{prefix}active_file"))?)
    };
    sum("total_").or_else(|| sum("")).unwrap_or(0)
}

/// `MemAvailable`, bytes.
fn machine_free() -> Option<u64> {
    let text = system_text("/proc/meminfo")?;
    let line = text
        .lines()
        .find(|line| line.starts_with("MemAvailable:"))?;
    line.split_whitespace()
        .nth(1)?
        .parse::<u64>()
        .ok()
        .map(|kib| kib * 1024)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn there_is_some_memory_and_not_all_of_it() {
        let available = available().expect("Linux tells");
        assert!(available.bytes > 1 << 20 && available.bytes < 1 << 60);
        assert!(require("x.csv", 1, "-").is_ok());
        let error = require("x.csv", 1 << 61, "use a shorter log")
            .unwrap_err()
            .to_string();
        assert!(
            error.starts_with("x.csv: needs about 2305843009231 MB of memory, "),
            "{error}"
        );
    }
}
