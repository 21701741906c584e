//! `thetahat bode`: what a stored model is to each frequency, alone or over a measured response.

mod over;

use std::f64::consts::PI;

use thetahat::model::Quantity;
use thetahat::respond::logarithmic_frequencies;

use super::stored;
use crate::args::BodeArguments;
use crate::failure::Failure;
use crate::output;

pub(crate) fn bode(arguments: &BodeArguments, line: &str) -> Result<(), Failure> {
    if let Some(path) = &arguments.over {
        return over::over(arguments, path, line);
    }
    let [report] = arguments.reports.as_slice() else {
        return Err(Failure::usage("several reports need --over, which has the frequencies that they share"));
    };
    let asked = arguments.frequencies.as_deref().map(range).transpose()?;
    let model = stored::model(report)?;
    let models = stored::linear(report, &model, "a frequency response")?;
    let nyquist = PI / model.sample_time();
    let (low, high) = asked.unwrap_or((nyquist / 1000.0, nyquist));
    // The ends first: an error then says them as they were given.
    let responses = models.iter().map(|model| {
        let found = (model.frequency_response(&[low, high]))
            .and_then(|_| logarithmic_frequencies(low, high, arguments.points as usize))
            .and_then(|frequencies| model.frequency_response(&frequencies));
        let failed = |error| match asked {
            Some(_) => Failure::option(&error),
            // The frequencies are those of the report.
            None => Failure::data(format!("{}: {error}", report.display())),
        };
        Ok((&model.output().name, found.map_err(failed)?))
    });
    let responses = responses.collect::<Result<Vec<_>, Failure>>()?;
    let several = models.len() > 1;
    output::write_csv(&arguments.out, |csv| {
        let output = several.then_some("output").into_iter();
        csv.write_record(output.chain([
            "input",
            "frequency",
            "magnitude",
            "magnitude_standard_error",
            "phase",
            "phase_standard_error",
        ]))?;
        let all = responses.iter().flat_map(|(output, each)| each.iter().map(move |one| (output, one)));
        for (output, response) in all {
            let output = several.then(|| output::cell(output));
            let name = output::cell(response.input.as_deref().unwrap_or("noise"));
            for point in &response.points {
                // What is not a number is left empty.
                let known = |value: f64| Some(value).filter(|value| value.is_finite());
                let degrees = |radians: f64| known(radians.to_degrees());
                let Quantity { value: magnitude, standard_error, .. } = point.magnitude;
                let (magnitude, spread) = (known(magnitude), standard_error.and_then(known));
                let (phase, turn) =
                    (degrees(point.phase.value), point.phase.standard_error.and_then(degrees));
                match &output {
                    Some(output) => {
                        csv.serialize((output, &name, point.frequency, magnitude, spread, phase, turn))?
                    }
                    None => csv.serialize((&name, point.frequency, magnitude, spread, phase, turn))?,
                }
            }
        }
        Ok(())
    })
}

/// LOW..HIGH.
fn range(text: &str) -> Result<(f64, f64), Failure> {
    text.split_once("..")
        .and_then(|(low, high)| Some((low.trim().parse::<f64>().ok()?, high.trim().parse::<f64>().ok()?)))
        .filter(|(low, high)| *low > 0.0 && low < high && high.is_finite())
        .ok_or_else(|| {
            Failure::usage(format!(
                "--frequencies {text}: write it as LOW..HIGH in radians per second, both above 0, such as 0.01..3"
            ))
        })
}
