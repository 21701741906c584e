//! What a model leaves of an output one step ahead, for the tests of residuals.

use std::borrow::Cow;
use std::ops::Range;

use super::{Innovations, Regressors, Response};
use crate::data::Record;
use crate::model::{PolynomialModel, Signal};

/// The one-step residuals of an output, with what the tests need of its model.
#[derive(Debug)]
pub(crate) struct Tested<'a> {
    /// Its name.
    pub(crate) output: &'a str,
    /// The inputs.
    pub(crate) inputs: Vec<TestedInput<'a>>,
    pub(crate) record: Record<'a>,
    pub(crate) innovations: Cow<'a, [Innovations]>,
    /// The model, where it knows how the errors depend on its parameters.
    pub(crate) model: Option<&'a dyn Regressors>,
}

/// An input of the model whose residuals are tested.
#[derive(Debug, Clone, Copy)]
pub(crate) struct TestedInput<'a> {
    pub(crate) name: &'a str,
    /// Its position among the inputs of the record.
    pub(crate) place: usize,
    /// The number of its lags in the model, delay included; 0 for an input that does not act in the model.
    pub(crate) lags: usize,
}

impl<'a> Tested<'a> {
    /// The residuals of a polynomial model.
    pub(crate) fn of_polynomials(
        model: &'a PolynomialModel,
        record: Record<'a>,
        innovations: &'a [Innovations],
    ) -> Self {
        let orders = &model.orders;
        let lags = |input: usize| match orders.nb[input] {
            0 => 0,
            nb => orders.nk[input] + orders.na + nb + orders.nf[input],
        };
        let inputs = model.inputs.iter().enumerate();
        let inputs = inputs.map(|(place, input)| TestedInput { name: &input.name, place, lags: lags(place) });
        Self {
            output: &model.output.name,
            inputs: inputs.collect(),
            record,
            innovations: Cow::Borrowed(innovations),
            model: Some(model),
        }
    }

    /// Errors of a model that does not know how they depend on its parameters; all inputs act on them.
    pub(super) fn errors(
        output: &'a Signal,
        inputs: &'a [Signal],
        record: Record<'a>,
        innovations: Vec<Innovations>,
    ) -> Self {
        let inputs = inputs.iter().enumerate();
        let inputs = inputs.map(|(place, input)| TestedInput { name: &input.name, place, lags: 1 });
        Self {
            output: &output.name,
            inputs: inputs.collect(),
            record,
            innovations: Cow::Owned(innovations),
            model: None,
        }
    }

    /// The same for the errors of a response where it counts.
    pub(super) fn of_response(
        output: &'a Signal,
        inputs: &'a [Signal],
        measured: &'a [f64],
        driving: Vec<&'a [f64]>,
        response: &Response,
    ) -> Self {
        let of = |rows: &Range<usize>| {
            let errors = rows.clone().map(|row| measured[row] - response.values[row]).collect();
            Innovations::alone(rows.clone(), vec![rows.clone()], errors)
        };
        let innovations = response.counted.iter().map(of).collect();
        Self::errors(output, inputs, record_of(measured, driving, response.counted.clone()), innovations)
    }
}

/// The record of segments that nothing is known before.
pub(super) fn record_of<'a>(
    output: &'a [f64],
    inputs: Vec<&'a [f64]>,
    segments: Vec<Range<usize>>,
) -> Record<'a> {
    Record { output, inputs, past: vec![0; segments.len()], segments }
}
