//! The charts, one function each. What cannot be drawn becomes a sentence.

mod correlation;
mod decimate;
mod dynamics;
mod figure;
mod object;
mod response;
mod search;
mod signals;
mod spectrum;
mod states;
mod step;
mod terms;
mod text;
mod tuning;

pub(super) use correlation::{
    autocorrelation, compared_autocorrelations, cross_correlation, impulse_response, prewhitened,
};
pub use dynamics::Transient;
pub(super) use dynamics::{bode, eigenvalues, roots, transient, transients};
pub(super) use figure::{Chart, Drawn};
pub(super) use response::{measured, measured_noise};
pub(super) use search::{delays, score, search};
pub(super) use signals::{Shade, Stack, outputs};
pub(super) use spectrum::spectrum;
pub(super) use states::{orders, singular_values};
pub(super) use step::step_response;
pub(super) use terms::{complexity, slices};
pub(super) use tuning::closed_loops;
