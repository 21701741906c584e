//! Checks the firmware: the bits it printed, what the bare image holds, what each step cost, how large images are.
//!
//! `check FOLDER` reads, in Cargo's target folder, the images for each processor and level of optimisation and the
//! output of the reporting one. It prints the table of costs, with `--images` also that of the sizes of images with one
//! estimator, and compares them with `budgets.md` and with `docs/firmware.md`. `--write` renews the tables of that page
//! instead. `--bits` compares the bits alone: for this program in its other build. `--c` is for what is written in C:
//! the bits that it printed, and the costs of exported models.

#[path = "../../../crates/thetahat-c/tests/interface/steps.rs"]
mod c_steps;
mod image;
mod log;
mod table;

use std::error::Error;
use std::path::Path;
use std::process::ExitCode;
use std::{env, fs};

use crate::image::Image;
use crate::log::Log;
use crate::table::{Costs, EXPORTS, IMAGES, Kind, STEPS, Table};

/// The profiles the firmware was built with, and the levels of optimisation they stand for.
const LEVELS: [(&str, &str); 2] = [("fast", "3"), ("small", "s")];

/// The processor on which the steps are run.
const FIRMWARE: &str = "thumbv7em-none-eabihf";

/// The processors for which images are measured, and the profiles they are built with.
const PROCESSORS: [&str; 3] = [FIRMWARE, "thumbv6m-none-eabi", "riscv32imc-unknown-none-elf"];
const SMALL: [&str; 2] = ["small", "tiny"];

/// The images with one estimator.
const ALONE: [(&str, &str); 3] = [
    ("KalmanFilter, 2 x 1", "alone-kalman"),
    ("RecursiveLeastSquares, n = 4", "alone-least-squares"),
    ("RecursiveArx, ARX(2, 2)", "alone-arx"),
];

const BUDGETS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/budgets.md");
const PAGE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/firmware.md");

/// By how much the page may differ from what is measured: another compiler counts a little differently.
const MARGIN_PERCENT: u64 = 10;

fn main() -> ExitCode {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let checked = match &arguments[..] {
        [folder] => costs(Path::new(folder), false),
        [folder, "--images"] => every_cost(Path::new(folder), false),
        [folder, "--images", "--write"] => every_cost(Path::new(folder), true),
        [folder, "--bits"] => bits(Path::new(folder)).map(|_| Vec::new()),
        [folder, "--c"] => written_in_c(Path::new(folder), false),
        [folder, "--c", "--write"] => written_in_c(Path::new(folder), true),
        _ => Err("usage: check FOLDER [--bits | --images [--write] | --c [--write]]".into()),
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
        let log = Log::read(&folder.join(FIRMWARE).join(profile).join("report.log"))?;
        if let Some(difference) = log.first_difference(&expected) {
            return Err(format!("opt-level {level}: {difference}").into());
        }
        logs.push(log);
    }
    Ok(logs)
}

/// Checks what is written in C. Returns what is wrong with the costs of exported models.
fn written_in_c(folder: &Path, write: bool) -> Result<Vec<String>, Box<dyn Error>> {
    c_bits(folder)?;
    let mut measured = Table::new(&EXPORTS);
    for line in fs::read_to_string(folder.join("exported/costs"))?.lines() {
        let (name, figures) = line.split_once(": ").ok_or_else(|| format!("no costs: {line}"))?;
        for figure in figures.split_whitespace() {
            measured.add(name, figure.parse().map_err(|error| format!("{error}: {line}"))?);
        }
    }
    check(&EXPORTS, &measured, write)
}

/// Compares what the firmware in C printed with what the same steps give here, in Rust.
fn c_bits(folder: &Path) -> Result<(), Box<dyn Error>> {
    let printed = fs::read_to_string(folder.join("c/steps.log"))?;
    let expected = c_steps::lines::<f32>()?;
    if let Some((firmware, host)) =
        printed.lines().zip(expected.lines()).find(|(firmware, host)| firmware != host)
    {
        return Err(format!("the bits differ.\nfirmware in C: {firmware}\nhost:          {host}").into());
    }
    let (firmware, host) = (printed.lines().count(), expected.lines().count());
    let message = || format!("the firmware in C printed {firmware} lines, the host {host}").into();
    if firmware == host { Ok(()) } else { Err(message()) }
}

/// Checks the costs of steps and the sizes of images. Returns what is wrong with their tables.
fn every_cost(folder: &Path, write: bool) -> Result<Vec<String>, Box<dyn Error>> {
    let mut faults = costs(folder, write)?;
    faults.extend(check(&IMAGES, &images(folder)?, write)?);
    Ok(faults)
}

/// Checks what the firmware printed and what its steps cost. Returns what is wrong with the table of costs.
fn costs(folder: &Path, write: bool) -> Result<Vec<String>, Box<dyn Error>> {
    let mut measured = Table::new(&STEPS);
    for ((profile, level), log) in LEVELS.into_iter().zip(bits(folder)?) {
        let path = |name| folder.join(FIRMWARE).join(profile).join(name);
        let [bare, report] = ["bare", "report"].map(|name| Image::read(&path(name)));
        let (bare, report) = (bare?, report?);
        check_bare(&bare, &report, log.steps.len()).map_err(|error| format!("opt-level {level}: {error}"))?;
        for step in &log.steps {
            let code =
                report.reach(step.address).ok_or_else(|| format!("{}: not in the image", step.name))?;
            let (typical, worst) = step.instructions()?;
            measured.add_costs(&step.name, step.ram, Costs { code, stack: step.stack, typical, worst });
        }
    }
    check(&STEPS, &measured, write)
}

/// How large the images with one estimator are. They hold neither panics nor an allocator.
fn images(folder: &Path) -> Result<Table, Box<dyn Error>> {
    let mut measured = Table::new(&IMAGES);
    for (estimator, name) in ALONE {
        for (processor, profile) in
            PROCESSORS.iter().flat_map(|processor| SMALL.map(|small| (processor, small)))
        {
            let image = Image::read(&folder.join(processor).join(profile).join(name))?;
            if let [first, ..] = &image.unwanted()[..] {
                return Err(format!("{name} for {processor}, {profile}: the image holds {first}").into());
            }
            measured.add(estimator, image.size);
        }
    }
    Ok(measured)
}

/// Prints what was measured. Returns what is above its budget, or not as the page says; or renews the page.
fn check(kind: &'static Kind, measured: &Table, write: bool) -> Result<Vec<String>, Box<dyn Error>> {
    println!("{measured}");
    let mut faults = measured.above(&Table::read(kind, &fs::read_to_string(BUDGETS)?)?);
    let page = fs::read_to_string(PAGE)?;
    if write {
        fs::write(PAGE, table::replace(&page, measured)?)?;
    } else {
        match table::find(kind, &page).and_then(|text| Table::read(kind, text)) {
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
