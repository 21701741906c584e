//! The equation of one of several outputs, as its estimator has it.

use crate::model::Orders;

/// The orders of one equation as its estimator has them. With several outputs na samples of each, its own among them,
/// come before the inputs, as inputs that act at once: what they were a row before.
pub(super) fn equation(orders: &Orders, outputs: usize) -> Orders {
    if outputs == 0 {
        return orders.clone();
    }
    let first = |value: usize, of_inputs: &[usize]| [&vec![value; outputs], of_inputs].concat();
    Orders {
        na: 0,
        nb: first(orders.na, &orders.nb),
        nf: first(0, &orders.nf),
        nk: first(0, &orders.nk),
        ..orders.clone()
    }
}

/// The names of its parameters.
pub(super) fn names(orders: &Orders, outputs: usize) -> Vec<String> {
    let past = (1..=outputs).flat_map(|output| (1..=orders.na).map(move |lag| format!("a{output}_{lag}")));
    let of_inputs = orders.names();
    match outputs {
        0 => of_inputs,
        _ => past.chain(of_inputs.into_iter().skip(orders.na)).collect(),
    }
}
