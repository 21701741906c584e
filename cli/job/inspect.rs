use std::path::PathBuf;

use thetahat::data::Interpolation;
use thetahat::inspect::Inspection;

use super::{Clock, LogJob, only};
use crate::args::{InspectArguments, Names};
use crate::failure::Failure;
use crate::shell::quoted;

/// A log to inspect.
#[derive(Debug)]
pub(crate) struct InspectJob {
    pub(crate) path: PathBuf,
    pub(crate) log: LogJob,
    /// Named inputs; none: those called u, u1, u2, … if there are any.
    pub(crate) inputs: Option<Vec<String>>,
    /// The named output; none: y if it is there.
    pub(crate) output: Option<String>,
}

impl InspectJob {
    pub(crate) fn resolve(arguments: &InspectArguments) -> Result<Self, Failure> {
        Ok(Self {
            path: only("inspect", &arguments.logs)?.to_owned(),
            log: LogJob::resolve(&arguments.log, &arguments.clock)?,
            inputs: Names::all(&arguments.input),
            output: arguments.output.clone(),
        })
    }

    /// Whether columns were named: others are then not inspected.
    pub(crate) fn is_named(&self) -> bool {
        self.inputs.is_some() || self.output.is_some()
    }

    /// The line of `thetahat fit` that goes with what was found, ready for a POSIX shell. It names the log as it was
    /// named here, how it is read, its channels without inputs that excite nothing or repeat another, and a resampling
    /// where the clock needs one. For a step test that begins at rest it takes the offsets from there, and asks for a
    /// time constant, a gain and a delay from each input: what steps show, by the whole of each response. None where a
    /// fit would refuse: without an output that changes, or a clock that can be used.
    pub(crate) fn command(&self, arguments: &InspectArguments, inspection: &Inspection) -> Option<String> {
        let output = inspection.channels.iter().find(|channel| channel.role.as_deref() == Some("output"))?;
        if output.minimum == output.maximum {
            return None;
        }
        let path = self.path.to_str()?;
        // A name that begins with a hyphen would be taken for an option.
        let path = if path.starts_with('-') && path != "-" { format!("./{path}") } else { path.to_owned() };
        let mut words = vec!["thetahat".to_owned(), "fit".to_owned(), quoted(&path)];
        let mut option = |name: &str, value: &str| words.push(assigned(name, value));
        match (&self.log.clock, &inspection.log.time) {
            (Clock::Fixed(seconds), _) => option("--sample-time", &seconds.to_string()),
            // The clock of a topic has no name.
            (_, name) if inspection.clock.measured => {
                if let Some(name) = name {
                    option("--time", name);
                }
                let clock = &inspection.clock;
                match (&arguments.clock.resample, &inspection.log.resampled) {
                    (Some(asked), _) => option("--resample", asked),
                    // A fit puts a log of two rates on this clock by itself.
                    (None, Some(done)) if done.interpolation == Interpolation::Auto => {}
                    (None, Some(done)) => option("--resample", &format!("{}:linear", done.step)),
                    (None, None) if clock.irregular => return None,
                    (None, None) => {}
                }
            }
            _ => {}
        }
        if let Some(format) = &arguments.clock.time_format {
            option("--time-format", format);
        }
        if let Some(unit) = &arguments.clock.time_unit {
            option("--time-unit", unit);
        }
        if let Some(zone) = &arguments.clock.time_zone {
            option("--time-zone", zone);
        }
        let idle = |name: &str| {
            let mut excitations = inspection.excitation.iter();
            excitations.any(|of| of.input == name && (of.order == 0 || of.same_as.is_some()))
        };
        let inputs: Vec<&str> = inspection
            .channels
            .iter()
            .filter(|channel| channel.role.as_deref() == Some("input"))
            .map(|channel| channel.name.as_str())
            .filter(|name| !idle(name))
            .collect();
        if inputs.is_empty() {
            option("--nb", "0");
        } else {
            option("-u", &thetahat_table::list(&inputs));
        }
        option("-y", &output.name);
        let log = &arguments.log;
        for (name, value) in [
            ("--delimiter", &log.delimiter),
            ("--comment", &log.comment),
            ("--encoding", &log.encoding),
            ("--sheet", &log.sheet),
        ] {
            if let Some(value) = value {
                option(name, value);
            }
        }
        log.missing.iter().for_each(|token| option("--missing", token));
        log.value.iter().for_each(|value| option("--value", value));
        if let Some(line) = log.header_row {
            option("--header-row", &line.to_string());
        }
        if log.skip_rows > 0 {
            option("--skip-rows", &log.skip_rows.to_string());
        }
        option("--report", "model.json");
        let flags = [
            ("--decimal-comma", log.decimal_comma == Some(true)),
            ("--decimal-comma=no", log.decimal_comma == Some(false)),
            ("--no-header", log.no_header),
        ];
        words.extend(flags.iter().filter(|(_, given)| *given).map(|(name, _)| (*name).to_owned()));
        Some(words.join(" "))
    }
}

/// An option and its value; joined where the value looks like an option.
fn assigned(name: &str, value: &str) -> String {
    match (value.starts_with('-'), name) {
        (false, _) => format!("{name} {}", quoted(value)),
        (true, "-u") => format!("--input={}", quoted(value)),
        (true, "-y") => format!("--output={}", quoted(value)),
        (true, _) => format!("{name}={}", quoted(value)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_that_look_like_options_are_joined() {
        assert_eq!(assigned("-u", "-x"), "--input=-x");
        assert_eq!(assigned("--missing", "-999"), "--missing=-999");
        assert_eq!(assigned("--delimiter", "|"), "--delimiter '|'");
    }
}
