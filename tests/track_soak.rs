//! A stream without end: memory does not grow, and the estimate stays near the truth. `make soak-track` takes 10^8
//! rows.
#![cfg(target_os = "linux")]

use std::fs;
use std::io::{BufRead, BufReader, BufWriter, Write};
use std::process::Stdio;

use serde_json::Value;

use crate::harness::{Folder, number};
use crate::signals::Random;

/// The resident memory of a process, in KiB.
fn memory(id: u32) -> f64 {
    let status = fs::read_to_string(format!("/proc/{id}/status")).expect("the program runs");
    let line = status.lines().find(|line| line.starts_with("VmRSS")).expect("it has memory");
    line.split_whitespace().nth(1).and_then(|number| number.parse().ok()).expect("it is a number")
}

#[test]
fn memory_and_estimate_stay_in_their_bounds() {
    let rows: u64 =
        std::env::var("SOAK_STEPS").map_or(40_000, |steps| steps.parse().expect("a number of rows"));
    let every = rows / 20;
    let folder = Folder::new();
    let mut command = folder.command(&format!(
        "track - --na 2 --nb 2 --forgetting 0.999,1 --alarm 1e9 --every {every} --state state.json --save-every {every}"
    ));
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().expect("the program starts");
    let mut input = BufWriter::with_capacity(1 << 20, child.stdin.take().expect("it is a pipe"));
    let mut lines = BufReader::new(child.stdout.take().expect("it is a pipe")).lines();

    // y(t) = 1.2 y(t-1) - 0.5 y(t-2) + u(t-1) + 0.4 u(t-2) + e(t), with silences and held inputs of a thousand rows.
    let truth = [("a1", -1.2), ("a2", 0.5), ("b1", 1.0), ("b2", 0.4)];
    let (mut random, mut past, mut before) = (Random::new(1), [0.0; 2], [0.0; 2]);
    writeln!(input, "u,y").expect("the program reads");
    let (mut first, mut worst, mut told) = (None, 0.0_f64, 0);
    for row in 1..=rows {
        let u = match row / 1000 % 8 {
            3 => 0.0,
            5 => before[0],
            _ => random.uniform(),
        };
        let y = 1.2 * past[0] - 0.5 * past[1] + before[0] + 0.4 * before[1] + 0.2 * random.uniform();
        (past, before) = ([y, past[0]], [u, before[0]]);
        writeln!(input, "{u:.6},{y:.6}").expect("the program reads");
        if row % every == 0 {
            input.flush().expect("the program reads");
            for _ in 0..2 {
                let line = lines.next().expect("a line comes").expect("it can be read");
                let line: Value = serde_json::from_str(&line).expect("it is JSON");
                assert_eq!((number(&line, "/row"), &line["event"]), (row as f64, &"sample".into()), "{line}");
                for (name, value) in truth {
                    let error = number(&line, &format!("/{name}_se"));
                    worst = worst.max((number(&line, &format!("/{name}")) - value).abs() / error);
                }
                told += 1;
            }
            let now = memory(child.id());
            let start = *first.get_or_insert(now);
            assert!(
                (now / start - 1.0).abs() < 0.05,
                "{start} KiB after {every} rows, {now} KiB after {row}"
            );
        }
    }
    drop(input);
    assert!(child.wait().expect("the program ends").success());
    println!("{rows} rows, {told} estimates: at most {worst:.2} standard errors from the truth");
    // 160 numbers, of which half share their past: none of 160 independent ones is beyond 4.5 in 99.9 % of all cases.
    assert!(worst < 4.5, "{worst}");
}
