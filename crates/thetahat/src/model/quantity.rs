//! Numbers that follow from parameters, with their errors.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::Complex;

/// A root of one of a model's polynomials in the z plane; a pole of a model in continuous time in the s plane, in
/// radians a second.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Root {
    /// The polynomial, such as `a` or `f`; with several inputs `f2` and `b2` are those of the second.
    pub polynomial: String,
    /// Real part.
    pub re: f64,
    /// Imaginary part.
    pub im: f64,
    /// The covariance matrix of (re, im) to first order; none where that of the parameters is unknown, and for a root
    /// with another one of its polynomial within four of its standard deviations, sqrt(var re + var im): there the
    /// first order says little, as two roots that meet move like square roots.
    pub covariance: Option<[[f64; 2]; 2]>,
}

impl Root {
    pub(super) fn value(&self) -> Complex<f64> {
        Complex::new(self.re, self.im)
    }
}

/// A figure that follows from estimated parameters.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Quantity {
    /// The estimate.
    pub value: f64,
    /// The square root of its variance to first order; none where that of the parameters is unknown, or of a pole
    /// whose own is.
    pub standard_error: Option<f64>,
    /// An interval that holds it with a probability of 95 %. Of a time constant it comes from the interval of the
    /// pole's modulus, of a static gain from Fieller's theorem: near an integrator it is right where plus or minus two
    /// standard errors is not. None where the standard error is none, and for figures of which the standard error says
    /// enough.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub interval: Option<Interval>,
}

impl Quantity {
    /// A figure without an interval of its own.
    pub(crate) fn new(value: f64, standard_error: Option<f64>) -> Self {
        Self { value, standard_error, interval: None }
    }
}

/// Between which values a figure lies; none where it has no end.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Interval {
    /// The least value; none where there is none.
    pub lower: Option<f64>,
    /// The largest value; none where there is none.
    pub upper: Option<f64>,
}

impl Interval {
    /// The whole line: the data do not determine the figure.
    pub const OPEN: Self = Self { lower: None, upper: None };

    /// In words, the ends written by a function: `1.2 to 3.4`, `at least 1.2`, `at most 3.4`, `not determined`.
    ///
    /// ```
    /// use thetahat::model::Interval;
    ///
    /// let shown = |lower, upper| Interval { lower, upper }.shown(|value| value.to_string());
    /// assert_eq!(shown(Some(1.5), Some(2.5)), "1.5 to 2.5");
    /// assert_eq!(shown(Some(1.5), None), "at least 1.5");
    /// assert_eq!([shown(None, Some(2.5)), shown(None, None)], ["at most 2.5", "not determined"]);
    /// ```
    pub fn shown(&self, number: impl Fn(f64) -> String) -> String {
        match (self.lower, self.upper) {
            (Some(lower), Some(upper)) => format!("{} to {}", number(lower), number(upper)),
            (Some(lower), None) => format!("at least {}", number(lower)),
            (None, Some(upper)) => format!("at most {}", number(upper)),
            (None, None) => "not determined".to_owned(),
        }
    }
}
