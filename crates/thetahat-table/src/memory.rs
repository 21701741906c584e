//! How much memory there is: a log that takes more is refused with the number, before the system ends the program.

use std::fs;
use std::path::Path;

/// A bound for what is read: a log that takes more memory than is free is an error.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Bound {
    /// The bytes that a value takes.
    per_value: u64,
    /// The bytes that are free; none where nothing says so.
    free: Option<u64>,
}

impl Bound {
    /// What is free now, for values that take `per_value` bytes each: the value itself, and the work on it.
    pub fn now(per_value: u64) -> Self {
        Self { per_value, free: free() }
    }

    #[cfg(all(test, any(feature = "columnar", feature = "flight-logs")))]
    pub(crate) fn of(per_value: u64, free: u64) -> Self {
        Self { per_value, free: Some(free) }
    }

    /// What this many values take, in words, if it is more than there is.
    pub(crate) fn passed_by(&self, values: usize) -> Option<String> {
        let taken = (values as u64).saturating_mul(self.per_value);
        let free = self.free.filter(|free| taken > *free)?;
        Some(format!(
            "{values} values take {} at {} bytes each, and {} are free",
            said(taken),
            self.per_value,
            said(free)
        ))
    }

    /// What this many bytes are that are held at once while rows are read, in words, if it is more than there is.
    #[cfg(any(feature = "columnar", feature = "spreadsheets"))]
    pub(crate) fn passed_by_bytes(&self, bytes: u64) -> Option<String> {
        let free = self.free.filter(|free| bytes > *free)?;
        Some(format!("one of its batches takes {} unpacked, and {} are free", said(bytes), said(free)))
    }

    /// What a file of this many bytes takes that is held while it is read, in words, if it is more than there is.
    #[cfg(any(feature = "flight-logs", feature = "matlab"))]
    pub(crate) fn passed_by_file(&self, bytes: u64) -> Option<String> {
        let free = self.free.filter(|free| bytes > *free)?;
        Some(format!("the file has more than {} unpacked, and {} are free", said(bytes), said(free)))
    }
}

/// The bytes that this process can still have: of the machine, of its control group, and of its own limit. None where
/// nothing says so.
fn free() -> Option<u64> {
    [machine(), group(), own()].into_iter().flatten().min()
}

/// What the machine has without swapping.
fn machine() -> Option<u64> {
    kibibytes(&fs::read_to_string("/proc/meminfo").ok()?, "MemAvailable:")
}

/// What is left of the limit of the control group (version 2). Files that are held in memory can go.
fn group() -> Option<u64> {
    let own = fs::read_to_string("/proc/self/cgroup").ok()?;
    let path = own.lines().find_map(|line| line.strip_prefix("0::"))?;
    let of = |folder: &Path| {
        let read = |file: &str| fs::read_to_string(folder.join(file)).ok();
        let number = |file: &str| read(file)?.trim().parse::<u64>().ok();
        let files = || number_after(&read("memory.stat")?, "inactive_file");
        let most = number("memory.max")?.saturating_add(files().unwrap_or(0));
        Some(most.saturating_sub(number("memory.current")?))
    };
    // Limits of the groups above hold as well. In a container the path may be that outside of it.
    let root = Path::new("/sys/fs/cgroup");
    let folder = root.join(path.trim_start_matches('/'));
    folder.ancestors().take_while(|folder| folder.starts_with(root)).filter_map(of).min()
}

/// What is left of the address space that the process may have (`ulimit -v`).
fn own() -> Option<u64> {
    let limits = fs::read_to_string("/proc/self/limits").ok()?;
    let most = number_after(&limits, "Max address space")?;
    let used = kibibytes(&fs::read_to_string("/proc/self/status").ok()?, "VmSize:")?;
    Some(most.saturating_sub(used))
}

/// The number after a word at the beginning of a line; none if there is another word.
fn number_after(text: &str, word: &str) -> Option<u64> {
    let rest = text.lines().find_map(|line| line.strip_prefix(word))?;
    rest.split_whitespace().next()?.parse().ok()
}

fn kibibytes(text: &str, word: &str) -> Option<u64> {
    number_after(text, word)?.checked_mul(1024)
}

/// Bytes as people say them.
fn said(bytes: u64) -> String {
    let (gigabyte, megabyte) = (1e9, 1e6);
    let bytes = bytes as f64;
    if bytes < gigabyte {
        format!("{:.0} MB", bytes / megabyte)
    } else {
        format!("{:.1} GB", bytes / gigabyte)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_stand_behind_their_words() {
        let limits = "Limit                     Soft Limit           Hard Limit           Units\n\
                      Max address space         2048000              unlimited            bytes\n\
                      Max data size             unlimited            unlimited            bytes\n";
        assert_eq!(number_after(limits, "Max address space"), Some(2_048_000));
        assert_eq!(number_after(limits, "Max data size"), None);
        assert_eq!(number_after(limits, "Max locked memory"), None);
        assert_eq!(kibibytes("MemAvailable:    1024 kB\n", "MemAvailable:"), Some(1 << 20));
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn the_machine_says_what_it_has() {
        assert!(free().is_some_and(|bytes| bytes > 1 << 20));
    }

    #[test]
    fn a_bound_says_what_passes_it() {
        let bound = Bound { per_value: 128, free: Some(1_000_000) };
        assert_eq!(bound.passed_by(7000), None);
        let words = "10000 values take 1 MB at 128 bytes each, and 1 MB are free";
        assert_eq!(bound.passed_by(10_000).as_deref(), Some(words));
        assert_eq!(Bound { free: None, ..bound }.passed_by(usize::MAX), None);
        // More than 64 bits hold is more than there is.
        for per_value in [128, u64::MAX] {
            assert!(Bound { per_value, ..bound }.passed_by(usize::MAX).is_some());
            assert!(Bound { per_value, ..bound }.passed_by(1 << 57).is_some());
        }
    }

    #[test]
    fn bytes_are_said_in_short() {
        assert_eq!([said(12_800_000_000), said(640_000_000)], ["12.8 GB", "640 MB"]);
    }
}
