//! Which logs are meant, and what the document of each is called.

use std::collections::{HashMap, HashSet};
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};

use super::super::stored;
use crate::failure::Failure;

/// A log, and where its document goes in the folder of all.
#[derive(Debug, PartialEq)]
pub(super) struct Named {
    pub(super) path: PathBuf,
    pub(super) report: PathBuf,
}

/// The logs that names and patterns stand for, and those that a file lists: in this order, those of a pattern in
/// alphabetical order, each once. With `stored` their documents need names that differ.
///
/// # Errors
/// A pattern that cannot be read or matches nothing; a list that cannot be read; no log at all; two logs with one
/// document.
pub(super) fn named(patterns: &[PathBuf], list: Option<&Path>, stored: bool) -> Result<Vec<Named>, Failure> {
    let listed = match list {
        Some(path) => {
            stored::text(path)?.lines().filter(|line| !line.is_empty()).map(PathBuf::from).collect()
        }
        None => Vec::new(),
    };
    let (mut paths, mut known) = (Vec::new(), HashSet::new());
    for pattern in patterns.iter().chain(&listed) {
        for path in matching(pattern)? {
            if known.insert(path.clone()) {
                paths.push(path);
            }
        }
    }
    let Some(first) = paths.first() else {
        return Err(Failure::usage(
            "--each: no log is named; give logs, a pattern such as 'logs/*.csv', or --list",
        ));
    };
    let shared =
        paths.iter().skip(1).fold(first.parent().unwrap_or(Path::new("")).to_owned(), |shared, path| {
            let same = shared.components().zip(path.parent().unwrap_or(Path::new("")).components());
            same.take_while(|(one, other)| one == other).map(|(one, _)| one).collect()
        });
    let named = paths.into_iter().map(|path| Named { report: document(&path, &shared), path });
    let named: Vec<Named> = named.collect();
    if stored {
        let mut by_report: HashMap<&Path, &Path> = HashMap::with_capacity(named.len());
        for Named { path, report } in &named {
            if let Some(other) = by_report.insert(report, path) {
                return Err(Failure::usage(format!(
                    "the documents of {} and {} would both be {}; rename one of the logs",
                    other.display(),
                    path.display(),
                    report.display()
                )));
            }
        }
    }
    Ok(named)
}

/// The files that a pattern stands for; a name without `*`, `?` and `[`, and one that is there, stands for itself.
fn matching(pattern: &Path) -> Result<Vec<PathBuf>, Failure> {
    if pattern == Path::new("-") {
        return Err(Failure::usage("standard input (-) is one log; leave --each out, or name files"));
    }
    let text = pattern.to_str().filter(|text| text.contains(['*', '?', '[']) && !pattern.exists());
    let Some(text) = text else { return Ok(vec![pattern.to_owned()]) };
    let found = glob::glob(text).map_err(|error| {
        Failure::usage(format!("{text}: this is no pattern: {error}; write it as 'logs/*.csv'"))
    })?;
    let mut paths = Vec::new();
    for path in found {
        let path = path.map_err(|error| Failure::io(error.path(), "cannot be read", error.error()))?;
        if !path.is_dir() {
            paths.push(path);
        }
    }
    let others = not_text(text);
    if !others.is_empty() {
        paths.extend(others);
        paths.sort_unstable();
    }
    if paths.is_empty() {
        return Err(Failure::usage(format!(
            "{text}: no file matches this pattern; check it, and the folder"
        )));
    }
    Ok(paths)
}

/// The files that a pattern stands for whose names are not UTF-8, which the library leaves out: each such letter is one
/// that `*` and `?` stand for.
fn not_text(pattern: &str) -> Vec<PathBuf> {
    let (folder, name) = pattern.rsplit_once('/').map_or((".", pattern), |(folder, name)| (folder, name));
    let (Ok(folders), Ok(name)) =
        (glob::glob(if folder.is_empty() { "/" } else { folder }), glob::Pattern::new(name))
    else {
        return Vec::new();
    };
    let entries = folders.filter_map(Result::ok).filter_map(|folder| fs::read_dir(folder).ok()).flatten();
    let files = entries.filter_map(Result::ok).filter(|entry| {
        let own = entry.file_name();
        own.to_str().is_none() && name.matches(&own.to_string_lossy()) && !entry.path().is_dir()
    });
    let path =
        |entry: fs::DirEntry| if pattern.contains('/') { entry.path() } else { entry.file_name().into() };
    files.map(path).collect()
}

/// The log's name below the folder that all logs share, with the ending .json.
fn document(path: &Path, shared: &Path) -> PathBuf {
    const ENDINGS: [&str; 7] = ["gz", "csv", "tsv", "txt", "parquet", "arrow", "feather"];
    let own = path.strip_prefix(shared).unwrap_or(path);
    // Never out of the folder.
    let mut own: PathBuf =
        own.components().filter(|part| matches!(part, std::path::Component::Normal(_))).collect();
    while own.extension().is_some_and(|ending| ENDINGS.iter().any(|known| ending.eq_ignore_ascii_case(known)))
    {
        own.set_extension("");
    }
    let mut name = own.file_name().map_or_else(OsString::new, OsString::from);
    name.push(".json");
    own.with_file_name(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_os = "linux")]
    fn names_that_are_not_text_are_taken() {
        use std::os::unix::ffi::OsStringExt;

        let folder = tempfile::tempdir().expect("a folder");
        let own = folder.path().join(OsString::from_vec(b"M\xfcller.csv".to_vec()));
        for path in [own.clone(), folder.path().join("Zeta.csv"), folder.path().join("Abel.csv")] {
            fs::write(path, "u,y\n").expect("a file");
        }
        let found =
            |name: &str| matching(&folder.path().join(name)).map(|paths| paths.len()).unwrap_or_default();
        assert_eq!(matching(&folder.path().join("*.csv")).expect("logs")[1], own);
        assert_eq!([found("*.csv"), found("M*.csv"), found("M?ller.csv"), found("[A-M]*")], [3, 1, 1, 2]);
        assert_eq!(found("*.txt"), 0);
    }

    #[test]
    fn documents_are_named_below_what_the_logs_share() {
        let names = |paths: &[&str]| {
            let paths: Vec<PathBuf> = paths.iter().map(PathBuf::from).collect();
            named(&paths, None, true).map(|logs| logs.into_iter().map(|log| log.report).collect::<Vec<_>>())
        };
        let expected = |reports: &[&str]| reports.iter().map(PathBuf::from).collect::<Vec<_>>();
        assert_eq!(names(&["a/b/x.csv"]).ok(), Some(expected(&["x.json"])));
        assert_eq!(names(&["a/b/x.csv", "a/c/x.csv.gz"]).ok(), Some(expected(&["b/x.json", "c/x.json"])));
        assert_eq!(names(&["/a/x.1.csv", "/a/y"]).ok(), Some(expected(&["x.1.json", "y.json"])));
        assert_eq!(names(&["../a/x.csv", "b/x.csv"]).ok(), Some(expected(&["a/x.json", "b/x.json"])));
        // The same log twice is one; two logs with one document are refused.
        assert_eq!(names(&["x.csv", "x.csv"]).ok(), Some(expected(&["x.json"])));
        for refused in [&["x.csv", "x.csv.gz"][..], &[], &["-"], &["no/such/*.csv"], &["[.csv"]] {
            assert!(names(refused).is_err(), "{refused:?}");
        }
    }
}
