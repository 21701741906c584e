use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// What a model's cost says when it also pays for its parameters.
///
/// With J = (1/N) sum e^2 over N samples and p parameters:
///
/// ```text
/// FPE  = J (N + p)/(N - p)                    Akaike 1969, Annals of the Institute of Statistical Mathematics 21
/// AIC  = 2 p/N + ln J                         Akaike 1974, IEEE Transactions on Automatic Control 19
/// AICc = AIC + 2 p (p + 1)/(N (N - p - 1))    Hurvich and Tsai 1989, Biometrika 76
/// MDL  = p ln(N)/N + ln J                     Rissanen 1978, Automatica 14
/// ```
///
/// FPE has the units of y squared. A value is `None` where it is not defined: the logarithms at J = 0, AICc at
/// N <= p + 1.
///
/// ```
/// let criteria = thetahat::Criteria::new(1.6575, 6, 300);
/// assert!((criteria.fpe - 1.7252).abs() < 5e-5);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Criteria {
    /// Akaike's final prediction error.
    pub fpe: f64,
    /// Akaike's information criterion, for each sample.
    pub aic: Option<f64>,
    /// AIC corrected for few samples.
    pub aicc: Option<f64>,
    /// Rissanen's minimum description length, for each sample.
    pub mdl: Option<f64>,
}

impl Criteria {
    /// The criteria of a model with `parameters` parameters and mean square error `mse` over `samples` samples,
    /// which must be more than the parameters for FPE to be positive.
    pub fn new(mse: f64, parameters: usize, samples: usize) -> Self {
        let (p, n) = (parameters as f64, samples as f64);
        let logarithm = (mse > 0.0).then(|| mse.ln());
        let aic = logarithm.map(|ln| 2.0 * p / n + ln);
        Self {
            fpe: mse * (n + p) / (n - p),
            aic,
            aicc: aic.filter(|_| n > p + 1.0).map(|aic| aic + 2.0 * p * (p + 1.0) / (n * (n - p - 1.0))),
            mdl: logarithm.map(|ln| p * n.ln() / n + ln),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn criteria_equal_what_another_tool_prints() {
        let (mse, p, n) = (1.6575, 6, 300);
        let criteria = Criteria::new(mse, p, n);
        let n = f64::from(n as u32);
        let printed = n * (2.0 * std::f64::consts::PI).ln() + n + n * criteria.aic.unwrap();
        assert!((printed - 1014.96).abs() < 0.01, "{printed}");
    }

    #[test]
    fn undefined_values_are_none() {
        let exact = Criteria::new(0.0, 2, 10);
        assert_eq!((exact.fpe, exact.aic, exact.aicc, exact.mdl), (0.0, None, None, None));
        assert_eq!(Criteria::new(1.0, 2, 3).aicc, None);
    }
}
