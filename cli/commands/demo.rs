//! `thetahat demo`: the main job on a log carried inside the program.

use std::fs;
use thetahat::Document;
use thetahat::present::tables;

use clap::Parser;

use super::fit;
use crate::args::{Arguments, Command, DemoArguments};
use crate::failure::Failure;
use crate::messages::warn;
use crate::output;
use crate::wrap::stdout_layout;

/// A log of a DC motor: its columns are t, u and y. Made by the program beside it.
pub const LOG: &str = include_str!("../demo/dc_motor.csv");
const OPTIONS: [&str; 10] =
    ["--time", "t", "--estimate", "1..700", "--validate", "701..1000", "--na", "2", "--nb", "2"];

pub(crate) fn demo(arguments: &DemoArguments) -> Result<(), Failure> {
    let folder = &arguments.folder;
    fs::create_dir_all(folder).map_err(|error| Failure::io(folder, "cannot be created", &error))?;
    let (log, report) = (folder.join("dc_motor.csv"), folder.join("dc_motor.json"));
    output::write(&log, |file| file.write_all(LOG.as_bytes()))?;

    // The same way as for anybody's log.
    let words = ["thetahat", "fit"].map(Into::into).into_iter().chain([log.clone().into_os_string()]);
    let words = words.chain(OPTIONS.map(Into::into));
    let parsed = Arguments::try_parse_from(words).map_err(|error| Failure::usage(error.to_string()))?;
    let Command::Fit(fit) = parsed.command else {
        return Err(Failure::usage("the demo is a fit"));
    };
    let found = fit::fitted(&fit)?;
    let json = found.to_json().map_err(|error| Failure::data(error.to_string()))?;
    output::write(&report, |file| file.write_all(json.as_bytes()))?;
    for warning in &found.warnings {
        warn(warning);
    }
    output::print(&format!(
        "thetahat fit {} {} --report {}\n\n{}",
        log.display(),
        OPTIONS.join(" "),
        report.display(),
        tables::report(&found, stdout_layout())
    ))
}
