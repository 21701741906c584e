//! Models over a measured response.

use std::path::Path;

use thetahat::model::{LinearModel, Model, Signal};
use thetahat::present::response_page;
use thetahat::respond::{FrequencyPoint, FrequencyResponse};
use thetahat::spectrum::MeasuredResponse;

use crate::args::BodeArguments;
use crate::commands::{response, stored};
use crate::failure::Failure;
use crate::messages::warn;
use crate::output;

/// A row for each model, input and point of the measured response at `path`.
pub(super) fn over(arguments: &BodeArguments, path: &Path, line: &str) -> Result<(), Failure> {
    let read = arguments.reports.iter().map(|report| report.as_path()).chain([path]);
    if read.filter(|path| *path == Path::new("-")).count() > 1 {
        return Err(Failure::usage(
            "only one of the reports and the response can come from standard input (-)",
        ));
    }
    let stored: Vec<(&Path, Model)> = arguments
        .reports
        .iter()
        .map(|report| Ok((report.as_path(), stored::model(report)?)))
        .collect::<Result<_, Failure>>()?;
    // A table of points has no names of channels: those of the first model serve.
    let name = |signals: &[Signal], otherwise: &str| {
        signals.first().map_or(otherwise.to_owned(), |own| own.name.clone())
    };
    let [input, output] = stored.first().map_or(["u".to_owned(), "y".to_owned()], |(_, model)| {
        [name(model.inputs(), "u"), name(model.outputs(), "y")]
    });
    let found = response::read(path, None, &[], [&input, &output])?;
    let mut models = Vec::new();
    for (report, model) in &stored {
        models.push((report.display().to_string(), of_output(report, model, &found)?));
    }
    let mut overlaid = Vec::new();
    for ((report, _), (name, model)) in stored.iter().zip(&models) {
        let failed = |error: thetahat::Error| Failure::data(format!("{}: {error}", report.display()));
        let agreement = found.agreement(model).map_err(failed)?;
        if agreement.is_empty() {
            return Err(Failure::data(format!(
                "{name}: the model has none of the inputs of {}; give a model of the same channels",
                path.display()
            )));
        }
        overlaid.push((name, found.overlaid(model).map_err(failed)?));
    }
    let models: Vec<(String, &LinearModel<'_>)> =
        models.iter().map(|(name, model)| (name.clone(), model)).collect();
    if let Some(html) = &arguments.html {
        output::page(html, &response_page(&found, &models, line))?;
    }
    found.warnings.iter().for_each(|warning| warn(&format!("{}: {warning}", path.display())));
    write(&arguments.out, &found, &overlaid)
}

/// What the model is from its inputs to the measured output.
fn of_output<'m>(
    report: &Path,
    model: &'m Model,
    found: &MeasuredResponse,
) -> Result<LinearModel<'m>, Failure> {
    let all = stored::linear(report, model, "a frequency response")?;
    all.into_iter().find(|model| model.output().name == found.output).ok_or_else(|| {
        Failure::data(format!(
            "{}: the model has no output '{}', of which the response is; give a model of the same channels",
            report.display(),
            found.output
        ))
    })
}

fn write(
    path: &Path,
    found: &MeasuredResponse,
    models: &[(&String, Vec<FrequencyResponse>)],
) -> Result<(), Failure> {
    output::write_csv(path, |csv| {
        csv.write_record([
            "model",
            "input",
            "frequency",
            "magnitude",
            "magnitude_standard_error",
            "phase",
            "phase_standard_error",
            "measured_magnitude",
            "measured_magnitude_standard_error",
            "measured_phase",
            "measured_phase_standard_error",
            "outside",
        ])?;
        let each = |point: &FrequencyPoint| {
            let known = |value: f64| Some(value).filter(|value| value.is_finite());
            (
                known(point.magnitude.value),
                point.magnitude.standard_error.and_then(known),
                known(point.phase.value.to_degrees()),
                point.phase.standard_error.map(f64::to_degrees).and_then(known),
            )
        };
        for (name, responses) in models {
            for response in responses {
                let Some(input) = response.input.as_deref() else { continue };
                let Some(measured) = found.from_input(input) else { continue };
                for (model, measured) in response.points.iter().zip(&measured.points) {
                    csv.serialize((
                        output::cell(name),
                        output::cell(input),
                        measured.frequency,
                        each(model),
                        each(measured),
                        measured.excludes(model).map(u8::from),
                    ))?;
                }
            }
        }
        Ok(())
    })
}
