//! Correlations with their bands.

use thetahat_numerics::distribution::two_sided;

use super::decimate::{Curve, rounded};
use super::figure::{COLOURS, Drawn, NEUTRAL, axis, band, chart, layout, line, significant};
use super::object::{self, Object};
use super::text;
use crate::figures;
use crate::inspect::DelayEstimate;
use crate::validate::{Independence, Residuals};

const HEIGHT: usize = 320;
const BAND: &str = "95 % band";

/// Bars, with another colour and name where they are outside of the band.
fn bars(lags: &[f64], values: &[f64], half: &[f64]) -> Vec<Object> {
    let low: Vec<f64> = half.iter().map(|half| -half).collect();
    // As wide as the bars.
    let wide = |values: &[f64]| -> Vec<f64> { values.iter().flat_map(|value| [*value; 2]).collect() };
    let edges: Vec<f64> = lags.iter().flat_map(|lag| [lag - 0.5, lag + 0.5]).collect();
    let mut traces: Vec<Object> = vec![band(BAND, &edges, &wide(&low), &wide(half), NEUTRAL)];
    let outside = |k: usize| values[k].abs() > half[k];
    for (name, wanted, colour) in [("inside", false, COLOURS[0]), ("outside", true, COLOURS[1])] {
        let there = (0..lags.len()).filter(|&k| values[k].is_finite() && outside(k) == wanted);
        let (x, y): (Vec<f64>, Vec<f64>) = there.map(|k| (lags[k], significant(values[k]))).unzip();
        if !x.is_empty() {
            let filled = Object::default().with("color", colour);
            traces.push(object::bars(name, x, y).with("width", 0.35).with("marker", filled));
        }
    }
    traces
}

/// The autocorrelation of the residuals at lags from 1 on.
pub(crate) fn autocorrelation(residuals: &Residuals, white_expected: bool) -> Drawn {
    let values = residuals.autocorrelation.get(1..).unwrap_or_default();
    if !values.iter().any(|value| value.is_finite()) {
        return Err("The residuals have no autocorrelation: they are constant, or too few.".to_owned());
    }
    let lags: Vec<f64> = (1..=values.len()).map(|lag| lag as f64).collect();
    let traces = bars(&lags, values, &vec![residuals.band; values.len()]);
    let layout = layout()
        .with("xaxis", axis("lag [samples]"))
        .with("yaxis", axis("autocorrelation"))
        .with("barmode", "overlay");
    let asked = if white_expected { "" } else { " The model does not say that they are white." };
    let words = format!(
        "Correlation of the errors one step ahead with themselves, lags 1 to {}. White errors stay inside the band, ± {}, at \
         95 of 100 lags.{asked}",
        values.len(),
        figures::three(residuals.band)
    );
    chart("Autocorrelation of the residuals", words, HEIGHT, traces, layout)
}

/// The correlation of residuals and an input at lags from -M to M.
pub(crate) fn cross_correlation(independence: &Independence) -> Drawn {
    let count = independence.correlation.len();
    if count == 0
        || independence.band.len() != count
        || !independence.correlation.iter().any(|r| r.is_finite())
    {
        return Err(format!("There is no correlation of the residuals with {}.", independence.input));
    }
    let most = (count / 2) as f64;
    let lags: Vec<f64> = (0..count).map(|k| k as f64 - most).collect();
    let traces = bars(&lags, &independence.correlation, &independence.band);
    let layout = layout()
        .with("xaxis", axis("lag [samples]"))
        .with("yaxis", axis("correlation"))
        .with("barmode", "overlay");
    let words = "Correlation of e(t) with u(t − lag). Outside of the band at positive lags: past inputs are still in the \
                 errors, the model lacks dynamics or delay. At negative lags: the input follows the output.";
    chart(format!("Residuals and {}", independence.input), words, HEIGHT, traces, layout)
}

/// The autocorrelations of several models' residuals.
pub(crate) fn compared_autocorrelations(models: &[(String, &Residuals)]) -> Drawn {
    let usable =
        |residuals: &Residuals| residuals.autocorrelation.iter().skip(1).any(|value| value.is_finite());
    let models: Vec<_> = models.iter().enumerate().filter(|(_, (_, residuals))| usable(residuals)).collect();
    let longest = models.iter().map(|(_, (_, residuals))| residuals.autocorrelation.len()).max().unwrap_or(0);
    if longest < 2 {
        return Err("No model has residuals enough for their autocorrelation.".to_owned());
    }
    let widest = models.iter().map(|(_, (_, residuals))| residuals.band).fold(0.0, f64::max);
    let mut traces: Vec<Object> =
        vec![band(BAND, &[0.5, longest as f64 - 0.5], &[-widest; 2], &[widest; 2], NEUTRAL)];
    for (position, (name, residuals)) in models {
        let values = &residuals.autocorrelation[1..];
        let lags = (1..=values.len()).map(|lag| lag as f64).collect();
        traces.push(line(&text::plain(name), Curve { x: lags, y: rounded(values) }, position));
    }
    let layout = layout().with("xaxis", axis("lag [samples]")).with("yaxis", axis("autocorrelation"));
    let words = "Correlation of each model's errors one step ahead with themselves, from lag 1 on. White errors stay inside \
                 the band at 95 of 100 lags.";
    chart("Autocorrelation of the residuals", words, HEIGHT, traces, layout)
}

/// The prewhitened correlation of an input with the output.
pub(crate) fn prewhitened(delay: &DelayEstimate) -> Drawn {
    if !delay.correlation.iter().any(|value| value.is_finite()) {
        return Err(format!("There is no correlation of {} with the output.", delay.input));
    }
    let before = delay.following.len();
    let values: Vec<f64> = delay.following.iter().rev().chain(&delay.correlation).copied().collect();
    let lags: Vec<f64> = (0..values.len()).map(|place| place as f64 - before as f64).collect();
    let traces = bars(&lags, &values, &vec![delay.band; lags.len()]);
    let layout = layout()
        .with("xaxis", axis("lag [samples]"))
        .with("yaxis", axis("correlation"))
        .with("barmode", "overlay");
    let found = match delay.nk {
        Some(nk) => format!("Delay found, in samples: {nk}."),
        None => "No delay was found: at no lag the output surely follows the input.".to_owned(),
    };
    let words = format!(
        "Correlation of the output with the input so many samples before, after filters that make each of them white. {found} Outside \
         of the band at negative lags, where the input comes after the output: it follows the output, so there is feedback."
    );
    chart(format!("From {} to the output", delay.input), words, HEIGHT, traces, layout)
}

/// The impulse response of an input with its band.
pub(crate) fn impulse_response(delay: &DelayEstimate) -> Option<Drawn> {
    let values = &delay.impulse_response;
    if values.is_empty() || values.len() != delay.impulse_response_errors.len() {
        return None;
    }
    let lags: Vec<f64> = (0..values.len()).map(|lag| lag as f64).collect();
    let half = two_sided(0.05);
    let edge = |sign: f64| -> Vec<f64> {
        let of = |(value, error): (&f64, &f64)| value + sign * half * error;
        values.iter().zip(&delay.impulse_response_errors).map(of).collect()
    };
    let curve = Curve { x: lags.clone(), y: rounded(values) };
    let name = text::plain(&delay.input);
    let traces = vec![
        band(BAND, &lags, &edge(-1.0), &edge(1.0), NEUTRAL),
        line(&name, curve, 0).with("mode", "lines+markers"),
    ];
    let layout = layout().with("xaxis", axis("lag [samples]")).with("yaxis", axis("output per input"));
    let words = "What one sample of the input does to the output, by regularised least squares (DC kernel). The band is for white noise: \
                 in coloured noise it is too narrow.";
    Some(chart(format!("Impulse response from {}", delay.input), words, HEIGHT, traces, layout))
}
