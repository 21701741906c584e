//! The files of `fuzz/seeds` and mutations of them, through what is fuzzed there: on any Rust, and the same ones in
//! each run.
//!
//! `FUZZ=100` makes a hundred times as many.

use std::collections::BTreeMap;
use std::env;
use std::fs;
use std::panic::{self, AssertUnwindSafe};
use std::path::Path;
use std::process;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread;

use crate::harness::HANGS;
use crate::signals::Random;

#[path = "../fuzz/src/lib.rs"]
#[expect(unreachable_pub, reason = "to the fuzzer it is a crate")]
mod targets;

/// What a number is made.
const NUMBERS: [&str; 14] = [
    "0",
    "1",
    "-1",
    "2",
    "1e308",
    "-1e308",
    "1e-308",
    "5e-324",
    "1e16",
    "18446744073709551615",
    "null",
    "[]",
    "\"x\"",
    "NaN",
];
/// What eight bytes are made.
const WORDS: [i64; 8] = [0, 1, -1, i64::MAX, i64::MIN, i32::MAX as i64, 1 << 40, 0xffff];
/// More failures than these are not told.
const MOST_TOLD: usize = 5;

impl Random {
    /// A place in some bytes, and one after it that is not far.
    fn range(&mut self, bytes: &[u8], most: usize) -> std::ops::Range<usize> {
        let start = self.below(bytes.len());
        start..(start + 1 + self.below(most)).min(bytes.len())
    }

    fn mutate(&mut self, bytes: &mut Vec<u8>) {
        if bytes.is_empty() {
            return;
        }
        match self.below(8) {
            0 => {
                let place = self.below(bytes.len());
                bytes[place] = self.below(256) as u8;
            }
            1 => {
                let range = self.range(bytes, 16);
                drop(bytes.drain(range));
            }
            2 => {
                let range = self.range(bytes, 64);
                let copy = bytes[range].to_vec();
                let place = self.below(bytes.len());
                drop(bytes.splice(place..place, copy));
            }
            3 => {
                let word = WORDS[self.below(WORDS.len())].to_le_bytes();
                let range = self.range(bytes, 8);
                let length = range.len();
                bytes[range].copy_from_slice(&word[..length]);
            }
            // An element of a list.
            4 => {
                let start = self.below(bytes.len());
                let mut commas = (start..bytes.len()).filter(|place| bytes[*place] == b',');
                if let (Some(from), Some(to)) = (commas.next(), commas.next()) {
                    drop(bytes.drain(from..to));
                }
            }
            // Texts are mostly numbers: there another one gets further than other bytes.
            _ => {
                let start = self.below(bytes.len());
                let is_digit = |place: &usize| bytes[*place].is_ascii_digit();
                let is_part = |place: &usize| b"0123456789+-.eE".contains(&bytes[*place]);
                if let Some(from) = (start..bytes.len()).find(is_digit) {
                    let to = (from..bytes.len()).find(|place| !is_part(place)).unwrap_or(bytes.len());
                    let number = NUMBERS[self.below(NUMBERS.len())];
                    drop(bytes.splice(from..to, number.bytes()));
                }
            }
        }
    }
}

/// Each seed as it is, then so many mutations of it.
fn fuzzed(target: &str, mutations: usize, work: fn(&[u8])) {
    let more: usize = env::var("FUZZ").map_or(1, |more| more.parse().expect("FUZZ is a number"));
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/seeds").join(target);
    let mut seeds: BTreeMap<String, Vec<u8>> = BTreeMap::new();
    for entry in fs::read_dir(&folder).expect("seeds") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        seeds.insert(name, fs::read(&path).expect("a seed"));
    }
    assert!(seeds.len() > 3, "{}", seeds.len());
    // Whatever goes on for ever is told by its name.
    let (tell, told) = channel::<String>();
    let watch = thread::spawn(move || {
        let mut last = String::new();
        loop {
            match told.recv_timeout(HANGS) {
                Ok(name) => last = name,
                Err(RecvTimeoutError::Disconnected) => return,
                Err(RecvTimeoutError::Timeout) => {
                    eprintln!("{last} goes on for ever");
                    process::abort();
                }
            }
        }
    });
    let mut failed = Vec::new();
    for (name, seed) in &seeds {
        let mut dice = Random::new(1);
        for number in 0..=mutations * more {
            let mut bytes = seed.clone();
            if number > 0 {
                (0..1 + dice.below(3)).for_each(|_| dice.mutate(&mut bytes));
            }
            let path = env::temp_dir().join(format!("thetahat-fuzz-{target}-{number}-{name}"));
            let said = path.display().to_string();
            tell.send(said.clone()).expect("somebody watches");
            if panic::catch_unwind(AssertUnwindSafe(|| work(&bytes))).is_err() {
                fs::write(&path, &bytes).expect("a place for temporary files");
                failed.push(said);
            }
        }
    }
    drop(tell);
    watch.join().expect("it ends");
    failed.truncate(MOST_TOLD);
    assert!(failed.is_empty(), "these make it panic, among others: {}", failed.join(", "));
}

#[test]
fn no_table_makes_it_panic() {
    fuzzed("table", 100, targets::table);
}

#[test]
fn no_document_makes_it_panic() {
    fuzzed("document", 20, targets::document);
}

#[test]
fn no_model_in_equations_makes_it_panic() {
    fuzzed("equations", 200, targets::equations);
}
