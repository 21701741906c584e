//! What has been done with which log, so that a run goes on where another one was interrupted.
//!
//! A file of lines in the folder of documents, one for each log that is done: the digest of the log and of all that its
//! row depends on, that of its document, and the row. A line is written once its document is on the disk. A line that
//! was cut, one of another digest, and one whose document is another by now, is as if it were not there.

use std::collections::HashMap;
use std::fs::{self, File, OpenOptions};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use serde::{Deserialize, Serialize};
use thetahat::{Cell, Row};
use twox_hash::XxHash3_128;

use crate::failure::Failure;
use crate::replace;

const NAME: &str = "journal.jsonl";
/// What is read of a log at once.
const PIECE: usize = 1 << 18;

/// The journal of a folder; this run has it for itself.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: Mutex<File>,
    /// What earlier runs noted, by log.
    known: HashMap<String, Line>,
    common: String,
    reused: AtomicUsize,
}

#[derive(Debug, Serialize, Deserialize)]
struct Line {
    digest: String,
    /// The digest of the document, where there is one.
    #[serde(default)]
    document: Option<String>,
    row: Row,
}

impl Line {
    fn report(&self) -> Option<&Path> {
        match self.row.get("report") {
            Some(Cell::Text(report)) => Some(Path::new(report)),
            _ => None,
        }
    }
}

impl Journal {
    /// That of a folder, which is made if it is not there. `common` is what all rows depend on beside their logs, in
    /// words that differ where it does.
    ///
    /// # Errors
    /// That it cannot be read or written, or that another run has it.
    pub fn open(folder: &Path, common: &str) -> Result<Self, Failure> {
        fs::create_dir_all(folder).map_err(|error| Failure::io(folder, "cannot be made", &error))?;
        replace::sweep(folder);
        let path = folder.join(NAME);
        let failed = |error: io::Error| Failure::io(&path, "cannot be read", &error);
        let mut file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(&path)
            .map_err(failed)?;
        replace::lock(&path, &file)?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(failed)?;
        let mut known = HashMap::new();
        for line in bytes.split(|byte| *byte == b'\n') {
            if let Ok(line) = serde_json::from_slice::<Line>(line)
                && let Some(Cell::Text(log)) = line.row.get("log")
            {
                known.insert(log.clone(), line);
            }
        }
        // What was cut is a line of its own.
        if bytes.last().is_some_and(|byte| *byte != b'\n') {
            file.write_all(b"\n").map_err(failed)?;
        }
        file.seek(SeekFrom::End(0)).map_err(failed)?;
        let common = format!("{} {common}", env!("CARGO_PKG_VERSION"));
        Ok(Self { path, file: Mutex::new(file), known, common, reused: AtomicUsize::new(0) })
    }

    /// The digest of a log and of all that its row depends on: 32 hexadecimal digits of XXH3. None if the log cannot be
    /// read, or is a pipe.
    pub fn digest(&self, log: &Path) -> Option<String> {
        digest(self.common.as_bytes(), log)
    }

    /// What an earlier run found of a log, if neither it nor its document has changed since.
    pub fn row(&self, log: &str, digest: &str) -> Option<Row> {
        let line = self.known.get(log)?;
        let is_there = || line.report().is_none_or(|report| document(report) == line.document);
        (line.digest == digest && is_there()).then(|| {
            self.reused.fetch_add(1, Ordering::Relaxed);
            line.row.clone()
        })
    }

    /// The documents that earlier runs wrote, each with its log.
    pub(super) fn documents(&self) -> HashMap<&Path, &str> {
        self.known.iter().filter_map(|(log, line)| Some((line.report()?, log.as_str()))).collect()
    }

    /// The file itself.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Notes what was found of a log.
    ///
    /// # Errors
    /// That it cannot be written.
    pub fn note(&self, digest: &str, row: &Row) -> Result<(), Failure> {
        let failed = |error: io::Error| Failure::io(&self.path, "cannot be written", &error);
        let mut line = Line { digest: digest.to_owned(), document: None, row: row.clone() };
        line.document = line.report().and_then(document);
        let mut line = serde_json::to_vec(&line).map_err(|error| failed(error.into()))?;
        line.push(b'\n');
        self.file.lock().unwrap_or_else(PoisonError::into_inner).write_all(&line).map_err(failed)
    }

    /// How many rows were taken from earlier runs.
    pub(super) fn reused(&self) -> usize {
        self.reused.load(Ordering::Relaxed)
    }
}

/// The digest of a document; none if it cannot be read.
fn document(path: &Path) -> Option<String> {
    digest(b"", path)
}

/// The digest of some bytes and of a file.
fn digest(before: &[u8], path: &Path) -> Option<String> {
    // What a pipe holds can be read once, and is read for the work.
    if !fs::metadata(path).ok()?.is_file() {
        return None;
    }
    let mut hasher = XxHash3_128::new();
    hasher.write(before);
    hasher.write(&[0]);
    let mut file = File::open(path).ok()?;
    let mut piece = vec![0; PIECE];
    loop {
        match file.read(&mut piece) {
            Ok(0) => return Some(format!("{:032x}", hasher.finish_128())),
            Ok(count) => hasher.write(&piece[..count]),
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            Err(_) => return None,
        }
    }
}
