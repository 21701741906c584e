use crate::data::{Detrend, Log, Offset, Record, Rows, checked};
use crate::respond::{Start, simulate};
use crate::validate::{Fit, Horizon};
use crate::{Error, Model};

/// What a model says of a log, in the log's own units.
#[derive(Debug, Clone, PartialEq)]
pub struct Applied {
    /// The measured output, one value for each row of the log; NaN where it is missing. None if the log has no output.
    pub measured: Option<Vec<f64>>,
    /// The response, one value for each row of the log; NaN outside the rows asked for, in gaps, and before a start.
    pub predicted: Vec<f64>,
    /// The rows asked for, in rising order.
    pub rows: Vec<Rows>,
    /// How close they are. None if the log has no output.
    pub fit: Option<Fit>,
}

/// Predicts or simulates a log with a model.
///
/// `rows` are those to respond to; none: all. The model's own offsets are used unless `detrend` says how to find others on
/// these rows. A free run also works on a log without the model's output, from [`Start::Zero`].
///
/// # Errors
/// [`Error::Data`] for channels or rows that are not there, or a sample time that differs from the model's by more than
/// 1 %; and as for [`predict`](crate::predict) and [`simulate`](crate::simulate).
pub fn apply(
    model: &Model,
    mut log: Log,
    rows: &[Rows],
    detrend: Option<Detrend>,
    horizon: Horizon,
    initial: Start,
) -> Result<Applied, Error> {
    if (log.sample_time() / model.sample_time - 1.0).abs() > 0.01 {
        return Err(Error::data(format!(
            "the log's sample time is {} s, the model's {} s; resample the log, or fit a model to it",
            log.sample_time(),
            model.sample_time
        )));
    }
    let all = vec![Rows::new(1, log.rows())?];
    let rows = checked("--rows", if rows.is_empty() { &all } else { rows }, log.rows())?;
    let names: Vec<String> = model.inputs.iter().map(|input| input.name.clone()).collect();
    let output = &model.output.name;
    // A copy, as what is taken off and put back on again is no longer the same to the bit.
    let measured = log.channel(output).ok().map(|channel| channel.values.clone());
    let has_output = measured.is_some();
    if !has_output && (horizon != Horizon::FreeRun || initial != Start::Zero) {
        return Err(Error::data(format!(
            "the log has no output '{output}': only a free run from zero can do without it"
        )));
    }
    let used: Vec<&str> = names.iter().chain(has_output.then_some(output)).map(String::as_str).collect();
    let segments = log.segments(&used, &rows)?;
    let mut level = model.output.offset;
    for signal in
        model.inputs.iter().chain([&model.output]).filter(|signal| used.contains(&signal.name.as_str()))
    {
        let offset = match detrend {
            None => signal.offset,
            Some(_) if segments.is_empty() => Offset::default(),
            Some(detrend) => Offset::estimate(detrend, &log, &signal.name, &segments)?,
        };
        log.remove(&signal.name, &offset);
        if signal.name == *output {
            level = offset;
        }
    }

    let absent;
    let record = if has_output {
        log.record(&names, output, &rows)?
    } else {
        absent = vec![0.0; log.rows()];
        let inputs = names.iter().map(|name| Ok(log.channel(name)?.values.as_slice()));
        let past = vec![0; segments.len()];
        Record { output: &absent, inputs: inputs.collect::<Result<_, Error>>()?, segments, past }
    };
    let (fit, response) = if has_output {
        let (fit, response) = Fit::of(model, &record, &rows, None, horizon, initial)?;
        (Some(fit), response)
    } else {
        (None, simulate(model, &record, initial)?)
    };
    let mut predicted = response.values;
    for (row, value) in predicted.iter_mut().enumerate() {
        *value += level.at(log.elapsed(row));
    }
    Ok(Applied { measured, predicted, rows, fit })
}
