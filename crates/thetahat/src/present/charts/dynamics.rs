//! What models are to frequencies, steps and impulses, and their roots.

use std::f64::consts::{PI, TAU};

use serde_json::json;

use super::decimate::{Curve, rounded};
use super::figure::{
    COLOURS, Drawn, NEUTRAL, NORMAL_95, axis, band, chart, layout, line, logarithmic, plain_line,
    positive_range, significant, style,
};
use super::object::{Object, marker, scatter, stroke};
use super::text;
use crate::model::{LinearModel, PolynomialModel, Quantity, Root, StateSpaceModel};
use crate::present::words::complex;
use crate::respond::{FrequencyResponse, TransientResponse, logarithmic_frequencies};
use crate::{Error, figures};

/// Frequencies of a Bode plot.
const FREQUENCIES: usize = 200;
/// A step or impulse response is drawn with no more samples.
const TRANSIENT_POINTS: usize = 400;
/// 95 % of chi-square for two degrees of freedom.
const CHI_SQUARE: f64 = 5.991_465;
/// Roots farther out than this are named, not shown.
const FARTHEST: f64 = 3.0;
/// Points of an ellipse and of the unit circle.
const ROUND: usize = 60;

/// What happens at the input of a model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Transient {
    /// A step by one unit.
    Step,
    /// An impulse of one unit that lasts one sample.
    Impulse,
}

impl Transient {
    /// The response of a model to it.
    fn of(
        self,
        model: &LinearModel<'_>,
        input: usize,
        samples: Option<usize>,
    ) -> Result<TransientResponse, Error> {
        match self {
            Self::Step => model.step_response(input, samples),
            Self::Impulse => model.impulse_response(input, samples),
        }
    }
}

/// Magnitude and phase of several models from one input, or from the noise where that is none.
pub(crate) fn bode(models: &[(String, &LinearModel<'_>)], input: Option<&str>) -> Drawn {
    let mut found: Vec<(usize, &String, FrequencyResponse)> = Vec::new();
    let mut refused = Vec::new();
    for (position, (name, model)) in models.iter().enumerate() {
        match response(model, input) {
            Ok(Some(response)) => found.push((position, name, response)),
            Ok(None) => {}
            Err(reason) => refused.push(reason),
        }
    }
    let title = match input {
        Some(input) => format!("Bode plot from {input}"),
        None => "Bode plot of the noise model".to_owned(),
    };
    if found.is_empty() {
        let reason = if refused.is_empty() { "no model has it".to_owned() } else { refused.join("; ") };
        return Err(format!("{title}: none, {reason}."));
    }

    if input.is_none() && models.iter().all(|(_, model)| is_white(model)) {
        return Err(format!("{title}: none, the noise is taken as white."));
    }

    let points = || found.iter().flat_map(|(_, _, response)| &response.points);
    let (least, largest) = positive_range(points().map(|point| point.magnitude.value));
    let (first, last) = positive_range(points().map(|point| point.frequency));
    let single = models.len() == 1;
    let mut traces: Vec<Object> = Vec::new();
    let mut certain = true;
    for (position, name, response) in &found {
        let (colour, _) = style(*position);
        let name = if single { "estimate".to_owned() } else { text::plain(name) };
        let x: Vec<f64> = response.points.iter().map(|point| significant(point.frequency)).collect();
        for (axis, turn) in [("y", false), ("y2", true)] {
            let of = |point: &crate::respond::FrequencyPoint| {
                if turn { degrees(point.phase) } else { point.magnitude }
            };
            let values: Vec<Quantity> = response.points.iter().map(of).collect();
            // The logarithm of what is not above zero has no place.
            let lowest = if turn { f64::NEG_INFINITY } else { least / 10.0 };
            if let Some((low, high)) = interval(&values, lowest) {
                certain = false;
                let shown = band("95 % band", &x, &low, &high, colour).with("yaxis", axis);
                traces.push(grouped(shown, &name, single).with("showlegend", single && !turn));
            }
            let y = values.iter().map(|value| significant(value.value)).collect();
            let curve = line(&name, Curve { x: x.clone(), y }, *position);
            traces.push(grouped(curve.with("yaxis", axis), &name, single).with("showlegend", !turn));
        }
    }
    let layout = layout()
        .with("xaxis", logarithmic("frequency [rad/s]", first, last).with("anchor", "y2"))
        .with("yaxis", logarithmic("magnitude", least, largest).with("domain", json!([0.47, 1.0])))
        .with("yaxis2", axis("phase [°]").with("domain", json!([0.0, 0.43])));
    let source = if input.is_some() { "unit of the input" } else { "unit of e" };
    let mut words = format!(
        "How much of a sine of each frequency arrives at the output, in units of the output for each {source}, and by how many \
         degrees it is turned, up to half the sampling frequency."
    );
    words.push_str(if certain {
        " The uncertainty is not known."
    } else {
        " Shaded: 95 % intervals, from the covariance of the parameters."
    });
    for reason in refused {
        words.push_str(&format!(" Left out: {reason}."));
    }
    chart(title, words, 460, traces, layout)
}

/// Whether the model adds e to the output as it is.
fn is_white(model: &LinearModel<'_>) -> bool {
    match model {
        LinearModel::Polynomial(model) => (model.orders.na, model.orders.nc, model.orders.nd) == (0, 0, 0),
        LinearModel::Transfer(_) | LinearModel::Continuous(..) => true,
        LinearModel::StateSpace(model, _) => model.k.iter().flatten().all(|gain| *gain == 0.0),
    }
}

/// The response from one source; none if the model does not have it.
fn response(model: &LinearModel<'_>, input: Option<&str>) -> Result<Option<FrequencyResponse>, String> {
    let highest = PI / model.sample_time();
    let lowest = (model.slowest() / model.sample_time() / 10.0).clamp(highest / 1e6, highest / 1e3);
    let said = |error: crate::Error| error.to_string();
    let frequencies = logarithmic_frequencies(lowest, highest, FREQUENCIES).map_err(said)?;
    let responses = model.frequency_response(&frequencies).map_err(said)?;
    Ok(responses.into_iter().find(|response| response.input.as_deref() == input))
}

/// A curve that comes and goes with the others of its model, where there are several.
fn grouped(curve: Object, name: &str, single: bool) -> Object {
    if single { curve } else { curve.with("legendgroup", name) }
}

fn degrees(radians: Quantity) -> Quantity {
    Quantity {
        value: radians.value.to_degrees(),
        standard_error: radians.standard_error.map(f64::to_degrees),
        interval: None,
    }
}

/// The ends of the 95 % intervals, not below `lowest`; NaN where there is none. None if there is none at all.
fn interval(values: &[Quantity], lowest: f64) -> Option<(Vec<f64>, Vec<f64>)> {
    let end = |sign: f64| -> Vec<f64> {
        let end = |value: &Quantity| {
            value.standard_error.map_or(f64::NAN, |error| value.value + sign * NORMAL_95 * error)
        };
        values.iter().map(end).map(|end| if end < lowest { lowest } else { end }).collect()
    };
    let (low, high) = (end(-1.0), end(1.0));
    high.iter().any(|end| end.is_finite()).then_some((low, high))
}

/// What a unit step of an input does in several models, and what an impulse that lasts one sample does.
pub(crate) fn transients(models: &[(String, &LinearModel<'_>)], input: &str) -> [Drawn; 2] {
    [Transient::Step, Transient::Impulse].map(|what| transient(models, input, what, None))
}

/// One of the two, of this many samples or until it has settled.
pub(crate) fn transient(
    models: &[(String, &LinearModel<'_>)],
    input: &str,
    what: Transient,
    samples: Option<usize>,
) -> Drawn {
    let (title, happens) = match what {
        Transient::Step => {
            ("Step response", "The output after a step of the input by one unit at time 0, from rest.")
        }
        Transient::Impulse => (
            "Impulse response",
            "The output after an input of one unit in the sample at time 0 alone, from rest.",
        ),
    };
    let single = models.len() == 1;
    let mut traces: Vec<Object> = Vec::new();
    let mut unstable = false;
    let mut certain = true;
    let title = format!("{title} from {input}");
    for (position, (name, model)) in models.iter().enumerate() {
        let Some(number) = model.inputs().iter().position(|signal| signal.name == input) else { continue };
        let response = what.of(model, number, samples).map_err(|error| format!("{title}: none, {error}."))?;
        unstable |= !model.stable();
        let width = response.time.len().div_ceil(TRANSIENT_POINTS);
        let thin = |values: &[f64]| -> Vec<f64> { values.iter().step_by(width.max(1)).copied().collect() };
        let x = rounded(&thin(&response.time));
        let name = if single { "estimate".to_owned() } else { text::plain(name) };
        let (colour, _) = style(position);
        if let Some((low, high)) = interval(&response.values, f64::NEG_INFINITY) {
            certain = false;
            let shown = band("95 % band", &x, &thin(&low), &thin(&high), colour);
            traces.push(grouped(shown, &name, single).with("showlegend", single));
        }
        let values: Vec<f64> = response.values.iter().map(|value| value.value).collect();
        let shape = if x.len() > 80 { "lines" } else { "lines+markers" };
        let curve = line(&name, Curve { x, y: rounded(&thin(&values)) }, position);
        let curve = curve.with("mode", shape).with("marker", Object::default().with("size", 4));
        traces.push(grouped(curve, &name, single));
    }
    if traces.is_empty() {
        return Err(format!("{title}: none, no model has this input."));
    }
    let mut words = happens.to_owned();
    words.push_str(if certain { " The uncertainty is not known." } else { " Shaded: 95 % intervals." });
    if unstable {
        words.push_str(" An unstable model grows without bound: only its beginning is shown.");
    }
    let layout = layout().with("xaxis", axis("time [s]")).with("yaxis", axis("output per unit of input"));
    chart(title, words, 340, traces, layout)
}

/// Roots with what they are, a symbol and the place of their colour.
type Group<'m> = (&'m str, Vec<&'m Root>, &'m str, usize);

/// Poles and zeros in the z plane.
pub(crate) fn roots(model: &PolynomialModel) -> Drawn {
    let groups = [
        ("poles", model.poles.iter().collect(), "x-thin", 0),
        ("zeros", model.zeros.iter().flatten().collect(), "circle-open", 1),
        ("noise poles", model.noise_poles.iter().collect(), "cross-thin", 2),
        ("noise zeros", model.noise_zeros.iter().collect(), "diamond-open", 3),
    ];
    z_plane(&groups, model.sample_time)
}

/// The poles of a state-space model, and those of its predictor.
pub(crate) fn eigenvalues(model: &StateSpaceModel) -> Drawn {
    let groups = [
        ("poles", model.poles.iter().collect(), "x-thin", 0),
        ("poles of the predictor", model.predictor_poles.iter().collect(), "diamond-open", 3),
    ];
    z_plane(&groups, model.sample_time)
}

fn z_plane(groups: &[Group<'_>], sample_time: f64) -> Drawn {
    let all = || groups.iter().flat_map(|(_, roots, _, _)| roots.iter());
    if all().next().is_none() {
        return Err("The model has neither poles nor zeros.".to_owned());
    }
    let far = |root: &Root| root.re.hypot(root.im) > FARTHEST;
    let reach =
        all().filter(|root| !far(root)).map(|root| root.re.abs().max(root.im.abs())).fold(1.0, f64::max);

    let circle = (0..=ROUND).map(|k| TAU * k as f64 / ROUND as f64).map(|angle| (angle.cos(), angle.sin()));
    let (x, y): (Vec<f64>, Vec<f64>) = circle.map(|(x, y)| (significant(x), significant(y))).unzip();
    let circle = plain_line("unit circle", Curve { x, y }, NEUTRAL).with("hoverinfo", "skip");
    let mut traces: Vec<Object> = vec![circle];
    let mut certain = true;
    for (name, roots, symbol, position) in groups {
        if roots.is_empty() {
            continue;
        }
        let colour = COLOURS[*position];
        let outlines: Vec<(f64, f64)> = roots.iter().flat_map(|root| outline(root)).collect();
        if !outlines.is_empty() {
            certain = false;
            let (x, y) = outlines.into_iter().map(|(x, y)| (significant(x), significant(y))).unzip();
            let trace = plain_line("95 % region", Curve { x, y }, colour).with("line", stroke(colour, 1.2));
            let trace = trace.with("legendgroup", *name).with("showlegend", false);
            traces.push(trace.with("hoverinfo", "skip"));
        }
        let (x, y): (Vec<f64>, Vec<f64>) =
            roots.iter().map(|root| (significant(root.re), significant(root.im))).unzip();
        let words = roots.iter().map(|root| {
            let (modulus, angle) = (root.re.hypot(root.im), root.im.atan2(root.re).abs());
            let frequency = angle / sample_time;
            format!(
                "{} of {}<br>modulus {}<br>angle {} rad, {} rad/s",
                complex(root),
                root.polynomial.to_uppercase(),
                figures::short(modulus),
                figures::three(angle),
                figures::three(frequency)
            )
        });
        let marker = marker(colour, 11).with("symbol", *symbol).with("line", stroke(colour, 2.0));
        let trace = scatter(name, x, y, "markers").with("marker", marker).with("legendgroup", *name);
        traces.push(trace.with("text", words.collect::<Vec<_>>()).with("hoverinfo", "text"));
    }
    let reach = 1.12 * reach;
    let range = |axis: Object| axis.with("range", json!([-reach, reach])).with("constrain", "domain");
    let layout = layout()
        .with("xaxis", range(axis("real part")))
        .with("yaxis", range(axis("imaginary part")).with("scaleanchor", "x").with("scaleratio", 1))
        .with("hovermode", "closest");
    let mut words =
        "Poles inside the unit circle decay, outside they grow; the nearer to the circle, the more slowly."
            .to_owned();
    words.push_str(if certain {
        " Their uncertainty is not known."
    } else {
        " Outlined: regions that hold the root in 95 of 100 cases, to first order; of real roots an interval. Roots too near to \
         one another for that have none."
    });
    let away: Vec<String> = all().filter(|root| far(root)).map(|root| complex(root)).collect();
    if !away.is_empty() {
        words.push_str(&format!(" Outside of the picture: {}.", away.join(", ")));
    }
    chart("In the z plane", words, 520, traces, layout)
}

/// The boundary of a root's 95 % region, and a break of the line.
///
/// With the covariance matrix S = L L' of (re, im): z + sqrt(5.99) L (cos, sin). A real root has an interval.
fn outline(root: &Root) -> Vec<(f64, f64)> {
    let Some([[rr, ri], [_, ii]]) = root.covariance else { return Vec::new() };
    let (re, im) = (root.re, root.im);
    if im == 0.0 {
        let half = NORMAL_95 * rr.sqrt();
        return vec![(re - half, 0.0), (re + half, 0.0), (f64::NAN, f64::NAN)];
    }
    let first = rr.sqrt();
    let across = if first > 0.0 { ri / first } else { 0.0 };
    // Of parts that move together rounding is left.
    let second = (ii - across * across).max(0.0).sqrt();
    let radius = CHI_SQUARE.sqrt();
    let at = |k: usize| {
        let (sine, cosine) = (TAU * k as f64 / ROUND as f64).sin_cos();
        (re + radius * first * cosine, im + radius * (across * cosine + second * sine))
    };
    (0..=ROUND).map(at).chain([(f64::NAN, f64::NAN)]).collect()
}
