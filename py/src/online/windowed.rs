//! Least squares on a finite window of samples.

use numpy::{PyArray1, PyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use thetahat_core::nalgebra::{DVector, Dyn};
use thetahat_core::{Window, WindowedLeastSquares as Stepper};

use super::argument::{self, Whole, failed};
use super::innovation::{Innovation, list};
use super::recursive::{self, RecursiveTrajectory};
use super::{Reduced, Stop, snapshot};
use crate::array;
use crate::work::Pulse;

/// The most numbers that a window keeps.
const LARGEST_WINDOW: usize = 100_000_000;

/// Least squares on the last samples, all with the same weight, and on none before them.
///
/// What has left the window has left without trace: nothing is ever subtracted, so that rounding does not stay either.
/// There is no prior.
///
/// Parameters
/// ----------
/// n : int
///     The number of regressors, 1 to 4096.
/// blocks : int
///     How many blocks the window has, 2 or more.
/// block : int, default 1
///     How many samples a block has. The window slides by whole blocks: with 1 it holds exactly the last `blocks`
///     samples, with more between (blocks - 1) * block + 1 and blocks * block. Memory grows with the number of blocks
///     only.
///
/// Raises
/// ------
/// ValueError
///     If a window without its oldest block has fewer samples than parameters.
///
/// Notes
/// -----
/// ::
///
///     theta(k) = arg min sum over the window of (y(i) - phi(i)' theta)^2
///
/// Where the regressors of the window do not determine the parameters, as in a silence of its length, the last estimate
/// that was one is kept, and the action is "collecting".
///
/// References ---------- Björck, Numerical Methods for Least Squares Problems, 1996, chapter 3. Tangwongsan, Hirzel,
/// Schneider and Wu, General incremental sliding-window aggregation, 2015.
///
/// Examples
/// --------
/// >>> from thetahat import WindowedLeastSquares
/// >>> line = WindowedLeastSquares(2, blocks=10)
/// >>> for k in range(40):
/// ...     x = k % 3
/// ...     innovation = line.update([x, 1.0], 3.0 * x + 20.0 if k < 20 else x + 20.0)
/// >>> line.parameters.round(9)
/// array([ 1., 20.])
#[pyclass(module = "thetahat")]
pub(crate) struct WindowedLeastSquares {
    windowed: Stepper<f64, Dyn, Dyn>,
    regressor: DVector<f64>,
}

impl WindowedLeastSquares {
    pub(super) fn of(windowed: Stepper<f64, Dyn, Dyn>) -> Self {
        WindowedLeastSquares { regressor: windowed.parameters().clone(), windowed }
    }
}

#[pymethods]
#[pyo3(crate = "crate::in_use")]
impl WindowedLeastSquares {
    #[new]
    #[pyo3(signature = (n, blocks, block = Whole(1)), text_signature = "(n, blocks, block=1)")]
    fn new(py: Python<'_>, n: Whole, blocks: Whole, block: Whole) -> PyResult<Self> {
        let n = argument::size("n", n)?;
        let most = LARGEST_WINDOW / Window { blocks: 1, block: 1 }.numbers(n);
        let blocks = argument::count("blocks", blocks, 2, most)?;
        let block = argument::count("block", block, 1, 1_000_000_000)?;
        Stepper::new(Dyn(n), Window { blocks, block }).map(Self::of).map_err(|error| failed(py, error))
    }

    /// Take one sample: it enters the window, and what it takes the place of leaves.
    ///
    /// Parameters
    /// ----------
    /// phi : array_like, shape (n,)
    ///     The regressor. NaN is a missing sample: nothing changes.
    /// y : float
    ///     The output. NaN is a missing sample.
    ///
    /// Returns
    /// -------
    /// Innovation
    ///     What was not predicted, and what was done.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     If a shape is wrong, a number infinite or too large. Nothing has changed then.
    fn update(
        &mut self,
        py: Python<'_>,
        phi: &Bound<'_, PyAny>,
        y: &Bound<'_, PyAny>,
    ) -> PyResult<Innovation> {
        let phi = array::vector("phi", phi, Some(self.regressor.len()))?;
        self.regressor.as_mut_slice().copy_from_slice(phi.as_slice()?);
        let y = argument::number("y", y)?;
        Ok(self.windowed.update(&self.regressor, y).map_err(|error| failed(py, error))?.into())
    }

    /// Take many samples: the same as `update` in a loop, to the bit.
    ///
    /// The interpreter lock is released meanwhile.
    ///
    /// Parameters
    /// ----------
    /// phi : array_like, shape (N, n)
    ///     A regressor in each row.
    /// y : array_like, shape (N,)
    ///     The outputs.
    ///
    /// Returns
    /// -------
    /// RecursiveTrajectory
    ///     Parameters and innovations, row by row.
    ///
    /// Raises
    /// ------
    /// ValueError
    ///     As for `update`; the message names the row, from 1. Nothing has changed then.
    fn run(
        &mut self,
        py: Python<'_>,
        phi: &Bound<'_, PyAny>,
        y: &Bound<'_, PyAny>,
    ) -> PyResult<RecursiveTrajectory> {
        let n = self.regressor.len();
        let regressors = array::matrix("phi", phi, [None, Some(n)])?;
        let rows = regressors.shape()[0];
        let (regressors, outputs) = (regressors.as_slice()?, array::vector("y", y, Some(rows))?);
        let outputs = outputs.as_slice()?;
        let (mut windowed, mut regressor) = (self.windowed.clone(), self.regressor.clone());
        let unknown = vec![f64::NAN; n];
        let (windowed, trajectory) = recursive::run(py, [rows, n, 1], |record| {
            let mut pulse = Pulse::new(10 * n.pow(3));
            for (row, &output) in outputs.iter().enumerate() {
                pulse.check()?;
                regressor.as_mut_slice().copy_from_slice(argument::row(regressors, row, n));
                record.take(&windowed.update(&regressor, output).map_err(|error| Stop::Refused(row, error))?);
                let errors = windowed.standard_errors();
                let errors = errors.as_ref().map_or(unknown.as_slice(), |errors| errors.as_slice());
                record.found(windowed.parameters().as_slice(), errors);
            }
            Ok(windowed)
        })?;
        self.windowed = windowed;
        Ok(trajectory)
    }

    /// What a regressor predicts: phi' theta.
    ///
    /// Parameters
    /// ----------
    /// phi : array_like, shape (n,)
    ///     The regressor; all of it is finite.
    fn predict(&self, py: Python<'_>, phi: &Bound<'_, PyAny>) -> PyResult<f64> {
        let regressor = array::finite_vector("phi", phi, Some(self.regressor.len()))?;
        self.windowed.predict(&regressor).map_err(|error| failed(py, error))
    }

    /// Forget all samples. The estimate stays, until new ones determine another.
    fn clear(&mut self) {
        self.windowed.clear();
    }

    /// The parameters, shape (n,): those of the window, or of the last one that determined them; 0 before there was
    /// one.
    #[getter]
    fn parameters<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        argument::from_vector(py, self.windowed.parameters())
    }

    /// The covariance of the parameters, shape (n, n); None where the noise variance is.
    #[getter]
    fn parameter_covariance<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray2<f64>>>> {
        let solution = if self.windowed.is_determined() { self.windowed.solution().ok() } else { None };
        let covariance = solution.and_then(|solution| solution.covariance());
        covariance.map(|covariance| array::from_matrix(py, &covariance)).transpose()
    }

    /// The standard errors, shape (n,); None where the noise variance is.
    #[getter]
    fn standard_errors<'py>(&self, py: Python<'py>) -> Option<Bound<'py, PyArray1<f64>>> {
        self.windowed.standard_errors().map(|errors| argument::from_vector(py, &errors))
    }

    /// The variance of the residuals of the window; None while it has no more samples than parameters, or does not
    /// determine them.
    #[getter]
    fn noise_variance(&self) -> Option<f64> {
        self.windowed.noise_variance()
    }

    /// Whether the samples of the window determine the parameters.
    #[getter]
    fn determined(&self) -> bool {
        self.windowed.is_determined()
    }

    /// The number of samples in the window.
    #[getter]
    fn rows(&self) -> usize {
        self.windowed.rows()
    }

    /// How many blocks the window has.
    #[getter]
    fn blocks(&self) -> usize {
        self.windowed.window().blocks
    }

    /// How many samples a block has.
    #[getter]
    fn block(&self) -> usize {
        self.windowed.window().block
    }

    fn __repr__(&self) -> String {
        let Window { blocks, block } = self.windowed.window();
        let parameters = list(self.windowed.parameters().as_slice());
        let n = self.regressor.len();
        format!("WindowedLeastSquares(n={n}, blocks={blocks}, block={block}, parameters={parameters})")
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Reduced<'py>> {
        snapshot(py, "WindowedLeastSquares", &self.windowed)
    }
}
