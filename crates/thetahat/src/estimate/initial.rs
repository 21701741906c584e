use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The initial condition of each segment in a fit: what is assumed of the samples before its first one.
///
/// Samples that were measured directly before it ([`Record::past`](crate::data::Record::past)) are past inputs and
/// outputs, r = max(na, nb + nk - 1) + nd of them at most; only zeros do without. With r of them every sample of the
/// segment counts. Where there are fewer, the errors begin where A, D, and B of inputs without F reach back to measured
/// samples only:
///
/// | | without F | with F |
/// |---|---|---|
/// | drop | past samples, or the first r do not count | refused |
/// | estimate | refused | past samples; nf initial-condition responses of each 1/F, and max(nf, nb + nk - 1) without a past where that is worth it |
/// | zero | zeros | zeros |
/// | auto | drop | estimate with a past, or where it is worth it; else zero |
///
/// n more initial conditions are worth it if N ln(V_without/V_with) > n ln N. C begins with e = 0.
///
/// [`Method::ExactLikelihood`](crate::estimate::Method::ExactLikelihood) takes no past output and leaves no sample out:
/// drop is refused, and the response to the inputs is treated as with F, A standing for F.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Initial {
    /// [`Initial::Drop`] where no F is estimated; else [`Initial::Estimate`] if a segment has a past or that is worth
    /// its parameters, and [`Initial::Zero`] if not.
    #[default]
    Auto,
    /// Nothing: samples without a full regressor are left out, and e = 0 there. For models without F.
    Drop,
    /// Zeros: all samples count.
    Zero,
    /// Initial-condition responses of 1/F, found with the parameters; the other polynomials begin as for
    /// [`Initial::Drop`]. For models with F: what unknown samples do to the errors of others ends after r samples.
    Estimate,
}
