//! Judges the firmware: the bits it printed, what the bare image holds, what each step cost.
//!
//! `check FOLDER` reads, for each level of optimisation, the images and the output of the reporting one. It
//! prints the table of costs, and compares it with `budgets.md` and with the README. `--write` renews the
//! README's table instead. `--bits` compares the bits alone: for this program in its other build.

mod image;
mod log;
mod table;

use std::error::Error;
use std::path::Path;
use std::process::ExitCode;
use std::{env, fs};

use crate::image::Image;
use crate::log::Log;
use crate::table::{Costs, Table};

/// The profiles the firmware was built with, and the levels of optimisation they stand for.
const LEVELS: [(&str, &str); 2] = [("fast", "3"), ("small", "s")];

const BUDGETS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/budgets.md");
const README: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../README.md");

/// By how much the README may differ from what is measured: another compiler counts a little differently.
const MARGIN_PERCENT: u64 = 10;

fn main() -> ExitCode {
    let mut arguments: Vec<String> = env::args().skip(1).collect();
    let option = arguments.pop_if(|argument| argument.starts_with("--"));
    let checked = match (&arguments[..], option.as_deref()) {
        ([folder], None) => costs(Path::new(folder), false),
        ([folder], Some("--write")) => costs(Path::new(folder), true),
        ([folder], Some("--bits")) => bits(Path::new(folder)).map(|_| Vec::new()),
        _ => Err("usage: check FOLDER [--bits | --write]".into()),
    };
    match checked {
        Ok(faults) if faults.is_empty() => ExitCode::SUCCESS,
        Ok(faults) => {
            faults.iter().for_each(|fault| eprintln!("error: {fault}"));
            ExitCode::FAILURE
        }
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Compares what the firmware printed with what the same steps give here.
fn bits(folder: &Path) -> Result<Vec<Log>, Box<dyn Error>> {
    let expected = log::expected()?;
    let mut logs = Vec::new();
    for (profile, level) in LEVELS {
        let log = Log::read(&folder.join(profile).join("report.log"))?;
        if let Some(difference) = log.first_difference(&expected) {
            return Err(format!("opt-level {level}: {difference}").into());
        }
        logs.push(log);
    }
    Ok(logs)
}

/// Checks everything. Returns what is wrong with the table.
fn costs(folder: &Path, write: bool) -> Result<Vec<String>, Box<dyn Error>> {
    let mut measured = Table::default();
    for ((profile, level), log) in LEVELS.into_iter().zip(bits(folder)?) {
        let [bare, report] = ["bare", "report"].map(|name| Image::read(&folder.join(profile).join(name)));
        let (bare, report) = (bare?, report?);
        check_bare(&bare, &report, log.steps.len()).map_err(|error| format!("opt-level {level}: {error}"))?;
        for step in &log.steps {
            let code =
                report.reach(step.address).ok_or_else(|| format!("{}: not in the image", step.name))?;
            let (typical, worst) = step.instructions()?;
            measured.add(&step.name, step.ram, Costs { code, stack: step.stack, typical, worst });
        }
    }
    println!("{measured}");

    let mut faults = measured.above(&Table::read(&fs::read_to_string(BUDGETS)?)?);
    let readme = fs::read_to_string(README)?;
    if write {
        fs::write(README, table::replace(&readme, &measured)?)?;
    } else {
        match table::find(&readme).and_then(Table::read) {
            Ok(written) => faults.extend(measured.apart(&written, MARGIN_PERCENT)),
            Err(error) => faults.push(error.to_string()),
        }
    }
    Ok(faults)
}

/// The bare image steps everything, and holds neither panics nor an allocator. The reporting image does hold
/// panics: it proves that they would be seen.
fn check_bare(bare: &Image, report: &Image, steps: usize) -> Result<(), String> {
    if report.unwanted().is_empty() {
        return Err("nothing was found in the reporting image, which can panic: the search is blind".into());
    }
    if let [first, ..] = &bare.unwanted()[..] {
        return Err(format!("the bare image holds {first}"));
    }
    let found = bare.functions_named("step");
    if found != steps { Err(format!("the bare image has {found} steps of {steps}")) } else { Ok(()) }
}
