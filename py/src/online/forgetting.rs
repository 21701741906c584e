//! Forgetting policies.

use pyo3::Borrowed;
use pyo3::exceptions::{PyTypeError, PyValueError};
use pyo3::prelude::*;
use thetahat_core::Forgetting as Policy;

use super::{Reduced, argument, snapshot};

/// How a recursive estimator forgets old samples.
///
/// Wherever an argument is called ``forgetting``, a float is exponential forgetting with that factor, and None is
/// no forgetting.
///
/// Notes
/// -----
/// The memory of a policy with a factor is 1 / (1 - factor) samples. The factor lies in n / (n + 1) to 1, for n
/// parameters.
///
/// References
/// ----------
/// Ljung and Söderström, Theory and Practice of Recursive Identification, 1983, section 2.6.
///
/// Examples
/// --------
/// >>> from thetahat import Forgetting, RecursiveLeastSquares
/// >>> Forgetting.exponential(0.98)
/// Forgetting.exponential(factor=0.98)
/// >>> RecursiveLeastSquares(2, 0.98).forgetting == Forgetting.exponential(0.98)
/// True
#[pyclass(module = "thetahat", frozen, eq)]
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct Forgetting {
    pub(crate) policy: Policy<f64>,
}

impl Forgetting {
    /// A policy that was read back, checked as a new one is.
    pub(crate) fn restore(policy: Policy<f64>) -> PyResult<Self> {
        match policy {
            Policy::Exponential { factor } => Self::exponential(factor),
            Policy::Selective { factor } => Self::selective(factor),
            Policy::RandomWalk { variance } => Self::random_walk(variance),
            Policy::Variable { factor, minimum, noise_variance } => {
                Self::variable(factor, minimum, noise_variance)
            }
            _ => Ok(Forgetting { policy }),
        }
    }
}

#[pymethods]
impl Forgetting {
    /// Nothing is forgotten: all samples weigh the same.
    #[staticmethod]
    fn none() -> Self {
        Forgetting { policy: Policy::None }
    }

    /// A sample that is k samples old weighs factor ** k.
    ///
    /// In a silence of many times the memory the estimate bursts: noise in the regressors drives it away from what
    /// was known, and the standard errors say so. See ``selective``.
    ///
    /// Parameters
    /// ----------
    /// factor : float
    ///     Above 0, at most 1.
    #[staticmethod]
    #[pyo3(signature = (factor = 0.99))]
    fn exponential(factor: f64) -> PyResult<Self> {
        check_factor("factor", factor, 1.0)?;
        Ok(Forgetting { policy: Policy::Exponential { factor } })
    }

    /// Forgets only what a sample tells of: what is not excited is kept. For plants with long silences.
    ///
    /// An excitation that falls below a tenth of what it was counts as silence.
    ///
    /// Parameters
    /// ----------
    /// factor : float
    ///     Above 0, at most 1.
    ///
    /// References
    /// ----------
    /// A relative: Goel, Bruce and Bernstein, Recursive least squares with variable-direction forgetting, 2020.
    #[staticmethod]
    fn selective(factor: f64) -> PyResult<Self> {
        check_factor("factor", factor, 1.0)?;
        Ok(Forgetting { policy: Policy::Selective { factor } })
    }

    /// The parameters do a random walk.
    ///
    /// Parameters
    /// ----------
    /// variance : float
    ///     How much the variance of a parameter grows each sample, in 1 / scale ** 2 times the noise variance: 0 to
    ///     100.
    #[staticmethod]
    fn random_walk(variance: f64) -> PyResult<Self> {
        if !(0.0..=100.0).contains(&variance) {
            return Err(PyValueError::new_err(format!("variance: expected 0 to 100, found {variance}")));
        }
        Ok(Forgetting { policy: Policy::RandomWalk { variance } })
    }

    /// Forgets where an innovation is larger than the noise makes it.
    ///
    /// Parameters
    /// ----------
    /// factor : float
    ///     The factor where the innovation is as large as the noise makes it.
    /// minimum : float
    ///     The least factor, at most ``factor``.
    /// noise_variance : float
    ///     The variance of the noise, in the unit of y squared; above 0.
    ///
    /// References
    /// ----------
    /// Fortescue, Kershenbaum and Ydstie, Implementation of self-tuning regulators with variable forgetting factors,
    /// 1981.
    #[staticmethod]
    fn variable(factor: f64, minimum: f64, noise_variance: f64) -> PyResult<Self> {
        check_factor("factor", factor, 1.0)?;
        check_factor("minimum", minimum, factor)?;
        if !(noise_variance >= f64::MIN_POSITIVE && noise_variance.is_finite()) {
            let message = format!("noise_variance: expected a finite number above 0, found {noise_variance}");
            return Err(PyValueError::new_err(message));
        }
        Ok(Forgetting { policy: Policy::Variable { factor, minimum, noise_variance } })
    }

    fn __repr__(&self) -> String {
        match self.policy {
            Policy::None => "Forgetting.none()".to_owned(),
            Policy::Exponential { factor } => format!("Forgetting.exponential(factor={factor:?})"),
            Policy::Selective { factor } => format!("Forgetting.selective(factor={factor:?})"),
            Policy::RandomWalk { variance } => format!("Forgetting.random_walk(variance={variance:?})"),
            Policy::Variable { factor, minimum, noise_variance } => format!(
                "Forgetting.variable(factor={factor:?}, minimum={minimum:?}, noise_variance={noise_variance:?})"
            ),
            _ => "Forgetting".to_owned(),
        }
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        snapshot(py, "Forgetting", &self.policy)
    }
}

fn check_factor(argument: &str, factor: f64, most: f64) -> PyResult<()> {
    if factor > 0.0 && factor <= most {
        return Ok(());
    }
    Err(PyValueError::new_err(format!(
        "{argument}: expected a number above 0, at most {most}, found {factor}"
    )))
}

/// The argument `forgetting`: a float, None, or a policy.
pub(crate) struct Memory(pub(crate) Policy<f64>);

/// What it is where nothing is given.
pub(crate) const STANDARD: Memory = Memory(Policy::Exponential { factor: 0.99 });

impl<'a, 'py> FromPyObject<'a, 'py> for Memory {
    type Error = PyErr;

    fn extract(value: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
        if value.is_none() {
            return Ok(Memory(Policy::None));
        }
        if let Ok(forgetting) = value.cast::<Forgetting>() {
            return Ok(Memory(forgetting.get().policy));
        }
        if !argument::is_number(&value) {
            return Err(PyTypeError::new_err(format!(
                "forgetting: expected a float, a Forgetting or None, found {}",
                argument::kind(&value)
            )));
        }
        Ok(Memory(Policy::Exponential { factor: argument::number("forgetting", &value)? }))
    }
}
