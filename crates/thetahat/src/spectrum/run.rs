use std::f64::consts::PI;
use std::ops::Range;

use thetahat_numerics::distribution::student_two_sided;

use super::estimate::{Bands, Empty, Estimate, Line, LineEstimate};
use super::honesty::{self, Outside};
use super::plan::{Method, SpectrumPlan, given};
use super::response::{BandQuality, MeasuredResponse, NoisePoint};
use super::signals::Signals;
use super::{etfe, lpm, sines, spa, welch};
use crate::data::{Log, Rows, Source};
use crate::document::GENERATOR;
use crate::figures::{fixed, short};
use crate::respond::{FrequencyPoint, FrequencyResponse};
use crate::validate::feedback::feedback;
use crate::{Document, Error, text};

/// Feedback is looked for in so many of the first rows: it shows in few, and costs more than the spectra.
const FEEDBACK_ROWS: usize = 10_000;

/// The frequency response from the inputs of a log to its output, without a model.
///
/// | [`Method`] | what it is | bands |
/// |---|---|---|
/// | `lpm` | local polynomials for response and transient (Pintelon, Schoukens, Vandersteen and Barbe 2010) | 95 % |
/// | `spa` | transforms of covariances through Hann's lag window (Blackman and Tukey 1958) | too narrow where the window is short |
/// | `welch` | averages over windows (Welch 1967), H1 or H2 | too narrow where the windows are short |
/// | `etfe` | Y/U at each line (Ljung 1999, section 6.3) | none |
/// | `sines` | correlation over whole periods, once the transient is over | 95 %, from the spread between periods |
///
/// Segments are cut at gaps of the clock, at missing values and where another log begins; nothing reaches from one into
/// the next. Frequencies at which an input has no power, or inputs cannot be told apart, are left out, and a warning
/// names them. Where an input follows the output the response is biased, and a warning says so.
/// [`MeasuredResponse::bands`] says whether bands are honest: `spa` and `welch` are compared with themselves at twice
/// the resolution.
///
/// Cost: O(N log N) for each channel.
///
/// # Errors
/// [`Error::Argument`] for a plan that does not make sense, or frequencies above half the sampling frequency;
/// [`Error::Data`] for channels or rows that are not there, too few rows, a clock that is not uniform, or sines that
/// are not whole periods; [`Error::Undetermined`] for an input that is constant or has no power at any frequency asked
/// for.
///
/// ```
/// use thetahat::data::{Channel, Log};
/// use thetahat::spectrum::{SpectrumPlan, spectrum};
///
/// // y(t) = 0.8 y(t-1) + 0.5 u(t-1)
/// let (mut u, mut y, mut random) = (vec![0.0], vec![0.0], 1_u32);
/// for t in 1..2000 {
///     random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
///     y.push(0.8 * y[t - 1] + 0.5 * u[t - 1]);
///     u.push(f64::from(random >> 16) / 32_768.0 - 1.0);
/// }
/// let channel = |name: &str, values| Channel { name: name.into(), values };
/// let log = Log::new(vec![channel("u", u), channel("y", y)], 0.1)?;
/// let found = spectrum(&log, &[], &SpectrumPlan::new(&["u"], "y"))?;
/// let last = found.responses[0].points.last().unwrap();
/// assert!((last.frequency - std::f64::consts::PI / 0.1).abs() < 1e-9);
/// assert!((last.re + 0.5 / 1.8).abs() < 1e-3); // 0.5 q^-1/(1 - 0.8 q^-1) at q = -1
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn spectrum(log: &Log, sources: &[Source], plan: &SpectrumPlan) -> Result<MeasuredResponse, Error> {
    plan.check()?;
    let sample_time = log.sample_time();
    let band = plan.band(sample_time)?;
    let rows = if plan.rows.is_empty() { vec![Rows::new(1, log.rows())?] } else { plan.rows.clone() };
    let segments = log.record(&plan.inputs, &plan.output, &rows)?.segments;
    if segments.is_empty() {
        return Err(Error::data("no row has a value of every channel: there is nothing to transform"));
    }
    let signals = Signals::new(log, &plan.inputs, &plan.output, segments, plan.detrend)?;
    let angles = || plan.angles(sample_time, 2.0 * PI / signals.longest().max(3) as f64);
    let mut used = signals.segments.clone();
    let estimate = match plan.method {
        Method::Lpm { half_width } => lpm::lpm(&signals, half_width, &angles()?)?,
        Method::Spa { lags } => spa::spa(&signals, lags, &angles()?)?,
        Method::Welch { window, estimator } => welch::welch(&signals, window, estimator, band)?,
        Method::Etfe => {
            used.retain(|segment| segment.len() == signals.longest());
            used.truncate(1);
            etfe::etfe(&signals, band)?
        }
        Method::Sines { period, discard } => {
            let (estimate, rows) = sines::sines(&signals, &plan.inputs, period, discard, band)?;
            used = rows;
            estimate
        }
        Method::Given => return Err(given()),
    };
    if estimate.lines.is_empty() {
        return Err(Error::argument(
            "frequencies",
            format!("{} has no line in this band; give a wider one, or take lpm or spa", plan.method),
        ));
    }
    document(log, sources, plan, &signals, &used, estimate)
}

/// The document of an estimate.
fn document(
    log: &Log,
    sources: &[Source],
    plan: &SpectrumPlan,
    signals: &Signals,
    used: &[Range<usize>],
    Estimate { method, lines, bands, mut words }: Estimate,
) -> Result<MeasuredResponse, Error> {
    let sample_time = log.sample_time();
    let unit = signals.units[signals.inputs()];
    let found = || lines.iter().filter_map(|line| Some((line.angle, line.found.as_ref().ok()?)));
    words.extend(missing(&lines, plan, sample_time));
    if found().next().is_none() {
        return Err(Error::undetermined(Vec::new(), words.join("; ")));
    }
    let response = |(input, name): (usize, &String)| {
        let scale = unit / signals.units[input];
        let mut turned = 0.0;
        let point = |(angle, found): (f64, &LineEstimate)| {
            let (response, variance) = found.of(input)?;
            let variance = variance.map(|variance| variance * scale * scale).filter(|of| of.is_finite());
            let covariance = variance.map(|variance| [[variance, 0.0], [0.0, variance]]);
            let point = FrequencyPoint::new(angle / sample_time, response.scale(scale), covariance, turned);
            turned = point.phase.value;
            Some(point.with_intervals(student_two_sided(0.05, Some(found.degrees))))
        };
        FrequencyResponse { input: Some(name.clone()), points: found().filter_map(point).collect() }
    };
    let responses: Vec<FrequencyResponse> = plan.inputs.iter().enumerate().map(response).collect();
    if !responses.iter().flat_map(|of| &of.points).all(|point| point.re.is_finite() && point.im.is_finite()) {
        return Err(Error::data(
            "the response leaves the range of numbers: give the channels in other units",
        ));
    }
    let noise = |(angle, found): (f64, &LineEstimate)| NoisePoint {
        frequency: angle / sample_time,
        density: found
            .noise
            .map(|noise| noise * unit * unit * (sample_time / PI))
            .filter(|of| of.is_finite()),
        coherence: found.coherence,
    };
    let noise = found().map(noise).collect();
    let bands = quality(&bands, &lines, &mut words, sample_time);
    words.extend(following(signals, plan));
    Ok(MeasuredResponse {
        schema: MeasuredResponse::SCHEMA.to_owned(),
        generator: GENERATOR.to_owned(),
        logs: sources.to_vec(),
        rows: used.iter().map(|rows| Rows::new(rows.start + 1, rows.end)).collect::<Result<_, _>>()?,
        sample_time,
        continuous: false,
        detrend: plan.detrend.to_string(),
        method,
        output: plan.output.clone(),
        responses,
        noise,
        bands,
        warnings: words,
    })
}

/// Which frequencies tell nothing, and why.
fn missing(lines: &[Line], plan: &SpectrumPlan, sample_time: f64) -> Vec<String> {
    let mut kinds: Vec<Empty> = Vec::new();
    for empty in lines.iter().filter_map(|line| line.found.as_ref().err()) {
        if !kinds.contains(empty) {
            kinds.push(*empty);
        }
    }
    let frequencies: Vec<f64> = lines.iter().map(|line| line.angle / sample_time).collect();
    let of_kind = |kind: Empty| {
        let own: Vec<bool> = lines.iter().map(|line| line.found.as_ref().err() == Some(&kind)).collect();
        let places = ranges(&frequencies, &own);
        match kind {
            Empty::Input(input) => {
                format!("the input '{}' has no power at {places}: nothing is known there", plan.inputs[input])
            }
            Empty::Together if plan.inputs.len() > 1 => {
                format!(
                    "the inputs cannot be told apart at {places}, where they move together or have no power"
                )
            }
            Empty::Together => {
                format!(
                    "the input '{}' has power at too few lines around {places}: nothing is known there",
                    plan.inputs[0]
                )
            }
        }
    };
    kinds.into_iter().map(of_kind).collect()
}

/// The frequencies of some lines as ranges: `12 of 200 frequencies (0.5 to 0.8 and 3 rad/s)`.
fn ranges(frequencies: &[f64], own: &[bool]) -> String {
    const MOST: usize = 4;
    let mut runs: Vec<(f64, f64)> = Vec::new();
    for (k, (frequency, _)) in frequencies.iter().zip(own).enumerate().filter(|(_, (_, own))| **own) {
        match runs.last_mut() {
            Some((_, last)) if k > 0 && own[k - 1] => *last = *frequency,
            _ => runs.push((*frequency, *frequency)),
        }
    }
    let shown: Vec<String> = runs
        .iter()
        .take(MOST)
        .map(
            |(first, last)| {
                if first == last { short(*first) } else { format!("{} to {}", short(*first), short(*last)) }
            },
        )
        .collect();
    let more = if runs.len() > MOST { ", …" } else { "" };
    let count = own.iter().filter(|own| **own).count();
    format!("{count} of {} frequencies ({}{more} rad/s)", own.len(), shown.join(", "))
}

/// What is to be said of the bands; warns where they are not honest.
fn quality(bands: &Bands, lines: &[Line], words: &mut Vec<String>, sample_time: f64) -> BandQuality {
    let said = |honest, reason: &str| BandQuality { honest, outside: None, reason: reason.to_owned() };
    match bands {
        Bands::None(reason) => said(None, reason),
        Bands::Honest(reason) => said(Some(true), reason),
        Bands::Unknown(reason) => {
            words.push(format!("whether the 95 % bands are honest is not known: {reason}"));
            said(None, reason)
        }
        Bands::Against(finer) => {
            let Some(outside) = honesty::outside(lines, finer) else {
                return said(None, "there are no bands to compare");
            };
            let honest = outside.is_chance();
            let Outside { compared, moved } = outside;
            let share = moved.len() as f64 / compared as f64;
            let reason = format!(
                "{} % of the points leave their 95 % region when the resolution is doubled, where chance makes it 5 %",
                fixed(100.0 * share, 1)
            );
            if !honest {
                let frequencies: Vec<f64> = lines.iter().map(|line| line.angle / sample_time).collect();
                let own: Vec<bool> = lines.iter().map(|line| moved.contains(&line.angle)).collect();
                words.push(format!(
                    "the 95 % bands are not honest: {reason}, at {}; smoothing hides more than noise does: take more (`lags`, \
                     `window`), or lpm",
                    ranges(&frequencies, &own)
                ));
            }
            BandQuality { honest: Some(honest), outside: Some(share), reason }
        }
    }
}

/// Warns of inputs that follow the output.
fn following(signals: &Signals, plan: &SpectrumPlan) -> Vec<String> {
    let mut left = FEEDBACK_ROWS;
    let mut segments = Vec::new();
    for segment in &signals.segments {
        let taken = left.min(segment.len());
        segments.push(segment.start..segment.start + taken);
        left -= taken;
        if left == 0 {
            break;
        }
    }
    let end = segments.last().map_or(0, |segment| segment.end);
    let channels: Vec<&[f64]> = signals.channels.iter().map(|channel| &channel[..end]).collect();
    let Some((output, inputs)) = channels.split_last() else { return Vec::new() };
    let found = feedback(inputs, output, &segments);
    let unstable = found.unstable().map(|words| {
        format!(
            "{words}, and a loop biases this response toward the negative inverse of the controller's; fit a model with noise that may \
             be unstable (arx, armax)"
        )
    });
    let suspected =
        plan.inputs.iter().zip(found.inputs).filter(|(_, found)| found.is_some_and(|of| of.is_suspected()));
    let words = suspected
        .map(|(input, _)| {
            format!(
                "input '{}' follows past errors of the output: feedback is suspected, and biases this response toward the negative \
                 inverse of the controller's; fit a model with noise (arx, armax, bj), or record the log with the loop open",
                text::brief(input, 40)
            )
        });
    words.chain(unstable).collect()
}
