//! `thetahat track` from a file to lines, reading and writing included.

use std::error::Error;
use std::ffi::OsString;
use std::fmt::Write as _;
use std::fs;

use criterion::{Criterion, Throughput};

mod signals;

const ROWS: usize = 1_000_000;

fn main() -> Result<(), Box<dyn Error>> {
    let folder = tempfile::tempdir()?;
    let (log, out) = (folder.path().join("log.csv"), folder.path().join("lines.jsonl"));
    let (u, y) = signals::signals(ROWS);
    let mut text = String::from("u,y\n");
    for (u, y) in u.iter().zip(&y) {
        writeln!(text, "{u:.5},{y:.5}")?;
    }
    fs::write(&log, text)?;

    let mut criterion = Criterion::default().sample_size(10).configure_from_args();
    let mut group = criterion.benchmark_group("track, ARX(4, 4), 10^6 rows of a file");
    group.throughput(Throughput::Elements(ROWS as u64));
    for (name, options) in [
        ("a line in 1000", "--every 1000"),
        ("a line in 1000, three policies", "--every 1000 --forgetting 1,0.99,0.95"),
        ("every line", "--every 1"),
    ] {
        let words: Vec<OsString> = ["thetahat", "track", "--quiet", "--na", "4", "--nb", "4", "-o"]
            .into_iter()
            .map(OsString::from)
            .chain([out.clone().into_os_string(), log.clone().into_os_string()])
            .chain(options.split(' ').map(OsString::from))
            .collect();
        group.bench_function(name, |bencher| {
            bencher.iter(|| assert_eq!(thetahat_cli::run(words.clone()), 0));
        });
    }
    group.finish();
    criterion.final_summary();
    Ok(())
}
