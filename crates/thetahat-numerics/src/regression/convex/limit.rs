use thetahat_core::nalgebra::DVector;

/// A limit is met where rounding explains the rest.
const LIMIT_ROUNDING: f64 = 1e-13;

/// `low <= coefficients' theta <= high`; an infinite end is open, equal ends are an equation.
#[derive(Debug, Clone, PartialEq)]
pub struct Limit {
    /// What each parameter is multiplied by.
    pub coefficients: DVector<f64>,
    /// The least value of the sum.
    pub low: f64,
    /// The largest.
    pub high: f64,
}

impl Limit {
    pub(super) fn is_equation(&self) -> bool {
        self.low == self.high
    }

    pub(super) fn end(&self, upper: bool) -> f64 {
        if upper { self.high } else { self.low }
    }

    pub(super) fn value(&self, parameters: &DVector<f64>) -> f64 {
        self.coefficients.dot(parameters)
    }

    /// What rounding may do to the distance from an end.
    pub(super) fn rounding(&self, parameters: &DVector<f64>, upper: bool) -> f64 {
        let terms = self.coefficients.iter().zip(parameters).map(|(c, theta)| (c * theta).abs());
        LIMIT_ROUNDING * (self.end(upper).abs() + terms.sum::<f64>())
    }
}
