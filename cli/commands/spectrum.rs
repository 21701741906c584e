//! `thetahat spectrum`: the frequency response that logs show, without a model.

use std::path::Path;

use thetahat::Document;
use thetahat::model::Quantity;
use thetahat::present::{response_page, tables};
use thetahat::spectrum::{MeasuredResponse, spectrum as estimated};

use super::experiments::{Experiments, Wanted, read};
use crate::args::{ResponseFormatArgument, SpectrumArguments};
use crate::failure::Failure;
use crate::job::SpectrumJob;
use crate::messages::warn;
use crate::wrap::layout_of;
use crate::{log, output};

pub(crate) fn spectrum(arguments: &SpectrumArguments, line: &str) -> Result<(), Failure> {
    let found = measured(&SpectrumJob::resolve(arguments)?)?;
    let json = found.to_json().map_err(|error| Failure::data(error.to_string()))?;
    if let Some(path) = &arguments.html {
        output::page(path, &response_page(&found, &[], line))?;
    }
    // What goes into a file does not depend on the terminal.
    let layout = layout_of(&arguments.out);
    match arguments.format {
        ResponseFormatArgument::Csv => {
            // A table and a document have their warnings in them.
            found.warnings.iter().for_each(|warning| warn(warning));
            write_csv(&arguments.out, &found)
        }
        ResponseFormatArgument::Json => output::write(&arguments.out, |file| file.write_all(json.as_bytes())),
        ResponseFormatArgument::Table => {
            let table = tables::response(&found, layout);
            output::write(&arguments.out, |file| file.write_all(table.as_bytes()))
        }
    }
}

/// Reads the logs and estimates the response.
fn measured(job: &SpectrumJob) -> Result<MeasuredResponse, Failure> {
    let wanted = Wanted {
        inputs: job.options.inputs(),
        outputs: job.options.output().into_iter().collect(),
        driven: true,
        none: "no inputs",
    };
    let Experiments { log, sources, channels, warnings } =
        read(&job.paths, &job.log, &wanted, false, |_| Ok(()))?;
    let (inputs, output) = channels.single();
    let plan = job.plan(inputs, output)?;
    let mut found = estimated(&log, &sources, &plan).map_err(log::failure(&sources))?;
    found.warnings.splice(0..0, warnings);
    Ok(found)
}

/// A row for each input and frequency.
fn write_csv(path: &Path, found: &MeasuredResponse) -> Result<(), Failure> {
    output::write_csv(path, |csv| {
        csv.write_record([
            "input",
            "frequency",
            "magnitude",
            "magnitude_standard_error",
            "phase",
            "phase_standard_error",
            "coherence",
            "noise",
        ])?;
        for response in &found.responses {
            let name = output::cell(response.input.as_deref().unwrap_or_default());
            let mut noise = found.noise.iter();
            for point in &response.points {
                let of = noise.find(|noise| noise.frequency == point.frequency);
                let (coherence, density) = of.map_or((None, None), |noise| (noise.coherence, noise.density));
                let Quantity { value: magnitude, standard_error, .. } = point.magnitude;
                let (phase, turn) =
                    (point.phase.value.to_degrees(), point.phase.standard_error.map(f64::to_degrees));
                csv.serialize((
                    &name,
                    point.frequency,
                    magnitude,
                    standard_error,
                    phase,
                    turn,
                    coherence,
                    density,
                ))?;
            }
        }
        Ok(())
    })
}
