//! Test signals, and what they are worth.

use crate::design::{ExperimentDesign, SignalFigures, SignalPlan, SignalWorth, TestSignal};
use crate::figures::{error, fixed, number, seconds, short, three};
use crate::present::Layout;

use super::tree::{Cell, Medium, Sections, columns, figure, known, word};
use super::words::{ROUNDING, or_dash};

/// The longest length that is thought of, in words.
const TOO_LONG: &str = "not with a million samples, or not with this signal";

/// What a signal is, in lines: the whole, then each channel.
pub fn test_signal(
    plan: &SignalPlan,
    signal: &TestSignal,
    names: &[String],
    figures: &[SignalFigures],
) -> Vec<String> {
    let mut about = vec![format!("{}: {} samples", plan.waveform, plan.length)];
    if let Some(period) = signal.period() {
        about.push(format!("period {period}"));
    }
    let frequencies = signal.frequencies();
    if let [first, .., last] = frequencies {
        about.push(format!(
            "{} frequencies from {} to {} rad/s",
            frequencies.len(),
            short(*first),
            short(*last)
        ));
    }
    let channel = |(name, figures): (&String, &SignalFigures)| {
        let order = if figures.order == figures.highest { " or more" } else { "" };
        // What is left of a mean of zero is rounding.
        let mean = if figures.mean.abs() < ROUNDING * figures.rms { 0.0 } else { figures.mean };
        let mut about = vec![
            format!("mean {}", short(mean)),
            format!("RMS {}", short(figures.rms)),
            format!("crest factor {}", or_dash(figures.crest_factor, |crest| fixed(crest, 3))),
            format!("order of persistent excitation {}{order}", figures.order),
        ];
        if let Some([low, high]) = figures.main_band() {
            about.push(format!("90 % of its power from {} to {} rad/s", short(low), short(high)));
        }
        format!("{name}: {}", about.join(", "))
    };
    std::iter::once(about.join(", ")).chain(names.iter().zip(figures).map(channel)).collect()
}

/// The errors that signals would give, side by side.
pub fn experiment_design(found: &ExperimentDesign, layout: Layout) -> String {
    let on = &mut Sections::new(Medium::Text);
    on.line(format!(
        "{}, sample time {}: standard errors after {} samples",
        found.model,
        seconds(found.sample_time),
        found.length
    ));
    on.gap();
    let wanted = !found.wants.is_empty();
    let mut names = vec!["signal", "RMS", "crest", "order"];
    names.extend(found.figures.iter().map(|figure| figure.name.as_str()));
    names.extend(wanted.then_some("samples needed"));
    let none = if wanted { TOO_LONG } else { "the signal leaves it open" };
    let mut table = columns("Standard errors", names).none(none);
    let mut row = |name: &str, own: [Cell; 3], cells: Vec<Cell>, last: Cell| {
        table.row([word(name)].into_iter().chain(own).chain(cells).chain(wanted.then_some(last)));
    };
    let blank = || [(); 3].map(|()| word(""));
    let values = found.figures.iter().map(|of| figure(of.value, number));
    row("(value)", blank(), values.collect(), word(""));
    if wanted {
        let limits = found.figures.iter().map(|of| of.limit.map_or(word(""), |limit| figure(limit, error)));
        row("(wanted)", blank(), limits.collect(), word(""));
    }
    for signal in &found.signals {
        let own = [
            listed(&signal.rms, |rms| three(*rms)),
            listed(&signal.crest_factor, |crest| or_dash(*crest, three)),
            listed(&signal.order, usize::to_string),
        ];
        let errors = (0..found.figures.len()).map(|place| standard_error(found, signal, place));
        row(&signal.signal, own, errors.collect(), known(signal.needed, |needed| needed.to_string()));
    }
    table.legend("*: the least of its column");
    on.table(table);
    super::text::written(on, layout)
}

/// A standard error, with a star where no signal has a smaller one.
fn standard_error(found: &ExperimentDesign, signal: &SignalWorth, place: usize) -> Cell {
    let of = |signal: &SignalWorth| signal.standard_errors.get(place).copied().flatten();
    let least = found.signals.iter().filter_map(of).fold(f64::INFINITY, f64::min);
    let star = if found.signals.len() > 1 && of(signal) == Some(least) { "*" } else { "" };
    known(of(signal), |value| format!("{}{star}", error(value)))
}

/// What all channels have once, else each of them.
fn listed<T: PartialEq>(values: &[T], shown: impl Fn(&T) -> String) -> Cell {
    match values {
        // One that no channel has is not known.
        [first, rest @ ..] if rest.iter().all(|value| value == first) => match shown(first) {
            none if none == "-" => Cell::Unknown,
            shown => word(shown),
        },
        _ => word(values.iter().map(shown).collect::<Vec<_>>().join(" ")),
    }
}
