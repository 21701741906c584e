//! What each state of a model is worth,.

use crate::figures::number;
use crate::present::Layout;

use super::tree::{Medium, Sections, columns, figure, word};

/// Why a state has no figure.
const KEPT: &str = "its pole does not decay, and it is always kept";

/// The Hankel singular values of a model, and the bounds of the errors where only so many states are kept.
pub fn hankel_singular_values(values: &[f64], layout: Layout) -> String {
    let on = &mut Sections::new(Medium::Text);
    let mut table = columns("States", ["states", "Hankel singular value", "error at most"]).none(KEPT);
    for (place, value) in values.iter().enumerate() {
        let known = Some(*value).filter(|value| value.is_finite());
        // Small ones first.
        let left: f64 = values[place + 1..].iter().rev().sum();
        let bound = Some(2.0 * left).filter(|bound| bound.is_finite());
        table.row([word(place + 1), figure(known, number), figure(bound, number)]);
    }
    on.table(table);
    on.line(
        "error: of the frequency response from the inputs, and the noise in units of its deviation, to the outputs, where so many states are \
         kept (the largest singular value at any frequency)",
    );
    super::text::written(on, layout)
}
