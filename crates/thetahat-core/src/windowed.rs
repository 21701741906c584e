//! Least squares on a finite window of samples.

use nalgebra::OVector;

use crate::error::check_length;
use crate::lags::is_infinite;
use crate::least_squares::packed_numbers;
use crate::ud::dot;
use crate::{Action, Dimension, Error, Innovation, LeastSquares, Real, Solution};

/// How long a window is: so many blocks of so many samples.
///
/// It slides by whole blocks: with blocks of one sample it holds exactly the last `blocks` samples; with longer ones
/// between (`blocks` - 1) `block` + 1 and `blocks` `block`, as the oldest block leaves when a new one begins.
///
/// ```
/// use thetahat_core::Window;
///
/// // 200 samples, in steps of 10, of four parameters: 300 numbers are kept.
/// const WINDOW: Window = Window { blocks: 20, block: 10 };
/// assert_eq!((WINDOW.samples(), WINDOW.numbers(4)), (200, 300));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Window {
    /// The number of blocks, 2 or more.
    pub blocks: usize,
    /// The number of samples in each, 1 or more.
    pub block: usize,
}

impl Window {
    /// The number of samples, when the window is full.
    pub const fn samples(&self) -> usize {
        self.blocks.saturating_mul(self.block)
    }

    /// How many numbers are kept of the blocks, with n parameters: (n + 1) (n + 2)/2 of each.
    pub const fn numbers(&self, parameters: usize) -> usize {
        self.blocks.saturating_mul(packed_numbers(parameters))
    }
}

/// Least squares on the last samples, all with the same weight, and on none before them.
///
/// ```text
/// θ̂(k) = arg min Σ over the window (y(i) - φ(i)'θ)²,      i = k - W + 1 … k
/// ```
///
/// What has left the window has left without trace, where a forgetting factor leaves a tail: after a change of the
/// plant the estimate is that of the new one W samples later. There is no prior, no offset and no sign convention: what
/// φ means is the caller's, and [`Lags`](crate::Lags) makes it of inputs and outputs. [`Window`] says how long it is.
///
/// # How it forgets
///
/// Nothing is ever subtracted. Each block of samples is kept as the triangle of [`LeastSquares`], \[R z; 0 ρ\]. The
/// older blocks have been merged from the newest of them backwards, so that the triangle of "this block and all older
/// ones after it" is at hand for each; the newer ones are merged as they come. A step rotates its sample in, and merges
/// the two parts. When the last of the older blocks has left, the newer ones become the older ones, by one merge each.
/// (Two stacks, as in aggregation over sliding windows: Tangwongsan, Hirzel, Schneider and Wu, General incremental
/// sliding-window aggregation, 2015.)
///
/// To take a sample back out of a triangle (downdating) would cost no memory, but the result is a difference: what is
/// left may be small beside what was taken out, and rounding stays. The relative error of the parameters against the
/// batch in double precision, at most in 10^6 steps (10^5 where the scale changes), with four regressors in `f32`,
/// noise-free outputs and a window of 100 samples:
///
/// | | steady | rich, silent, held | scale changes by 10^3 |
/// |---|---|---|---|
/// | hyperbolic downdating | 6e-4, and growing | 0.8 | no digit |
/// | the same, with a fresh triangle every 100 samples | 4e-6 | 3e-6 | no digit |
/// | this | 3e-7 | 3e-7 | 1e-5 |
///
/// Through 10^7 steps of all three at once, with noise, it stays within 8 κ ε of the batch, κ the condition number of
/// the window in units of the columns' norms (measured by `make soak`).
///
/// # What is not excited
///
/// Where the regressors of the window do not determine the parameters, as in a silence of its length, there is no such
/// minimum. Then the last estimate that was one is kept, [`Action::Collecting`] says so, and
/// [`solution`](WindowedLeastSquares::solution) is the error that names a column. They determine the parameters if more
/// than 100 n ε of each column is left once those before it are projected out: with less, rounding alone would make up
/// a good part of the estimate.
///
/// # Size and cost
///
/// `B` is the buffer for the blocks, at least [`Window::numbers`]. Memory: B + 6 n² + 7 n + 6 numbers, and some
/// counters. A step costs some 13 n² + 5/3 n³ flops and n²/2 + 7 n/2 square roots; once in `blocks` `block` samples,
/// when the newer blocks become the older ones, `blocks` merges of 5/3 n³ flops and n²/2 square roots come on top:
/// where each step has its deadline, take few long blocks.
///
/// Source: Björck, Numerical Methods for Least Squares Problems, 1996, chapter 3 (updating, and what downdating costs
/// in digits).
///
/// ```
/// use thetahat_core::nalgebra::{Const, Vector2};
/// use thetahat_core::{Action, Error, Window, WindowedLeastSquares};
///
/// const WINDOW: Window = Window { blocks: 10, block: 1 };
/// type Line = WindowedLeastSquares<f64, Const<2>, Const<{ WINDOW.numbers(2) }>>;
///
/// // y = 3 u + 20; later the gain is 1.
/// let mut line = Line::new(Const, WINDOW)?;
/// for k in 0..40 {
///     let u = f64::from(k % 3);
///     line.update(&Vector2::new(u, 1.0), if k < 20 { 3.0 * u + 20.0 } else { u + 20.0 })?;
/// }
/// assert!((line.parameters() - Vector2::new(1.0, 20.0)).amax() < 1e-12);
///
/// // The input is held: after ten samples a gain cannot be told from an offset, and the estimate stays.
/// for _ in 0..10 {
///     line.update(&Vector2::new(2.0, 1.0), 22.0)?;
/// }
/// assert_eq!(line.update(&Vector2::new(2.0, 1.0), 22.0)?.action, Action::Collecting);
/// assert!((line.parameters() - Vector2::new(1.0, 20.0)).amax() < 1e-12);
/// assert_eq!(line.solution().err(), Some(Error::RankDeficient { column: 1 }));
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "", into = "snapshot::Snapshot<T, N, B>"))]
#[cfg_attr(feature = "serde", serde(try_from = "snapshot::Snapshot<T, N, B>"))]
pub struct WindowedLeastSquares<T: Real, N: Dimension, B: Dimension> {
    window: Window,
    /// Places for the triangles of blocks: the newer ones from the front; the older ones at the end, each merged with
    /// those after it.
    stored: OVector<T, B>,
    /// All samples of the newer blocks and of the one that is not complete.
    newer: LeastSquares<T, N>,
    /// Those of the one that is not complete.
    current: LeastSquares<T, N>,
    /// All samples of the window.
    all: LeastSquares<T, N>,
    parameters: OVector<T, N>,
    older_blocks: usize,
    newer_blocks: usize,
    determined: bool,
    scratch: N::Scratch<T>,
}

impl<T: Real, N: Dimension, B: Dimension> WindowedLeastSquares<T, N, B> {
    /// An empty window for `size` parameters: `Const::<4>`, or `Dyn(4)` with the feature `alloc`.
    ///
    /// Errors: [`Error::OutOfRange`] if a window without its oldest block has fewer samples than parameters, or a
    /// number does not fit; [`Error::Length`] if `B` is too small.
    pub fn new(size: N, window: Window) -> Result<Self, Error> {
        let n = size.value();
        let shortest = window.blocks.checked_sub(1).and_then(|blocks| blocks.checked_mul(window.block));
        let range =
            "two blocks of one sample or more, and all but one of them as many samples as parameters or more";
        if window.samples() == usize::MAX || shortest.is_none_or(|shortest| shortest < n.max(1)) {
            return Err(Error::OutOfRange { argument: "window", range });
        }
        let expected = window.numbers(n);
        let buffer =
            B::at_least(expected).map_err(|found| Error::Length { argument: "B", expected, found })?;
        let empty = LeastSquares::with_size(size);
        Ok(WindowedLeastSquares {
            window,
            stored: buffer.vector(T::zero()),
            newer: empty.clone(),
            current: empty.clone(),
            all: empty,
            parameters: size.vector(T::zero()),
            older_blocks: 0,
            newer_blocks: 0,
            determined: false,
            scratch: size.scratch::<T, 1, 0>(),
        })
    }

    /// One sample: it enters the window, and what it takes the place of leaves.
    ///
    /// NaN in φ or y is a missing sample: nothing changes, and nothing leaves. The innovation is y - φ'θ̂ with the
    /// estimate before, its variance σ̂² (1 + φ'(R'R)⁻¹φ) from the window before; NaN, and `nis` 0, while that has no
    /// more samples than parameters or does not determine them.
    ///
    /// [`Action`] tells what was done: `Updated`; `Collecting`, where the window does not determine the parameters,
    /// which stay; `Missing`.
    ///
    /// Errors, after which nothing has changed: [`Error::Infinite`]; [`Error::TooLarge`], as for [`LeastSquares::add`];
    /// [`Error::Length`] (only with `Dyn`).
    pub fn update(&mut self, regressor: &OVector<T, N>, output: T) -> Result<Innovation<T>, Error> {
        check_length("regressor", self.parameters.len(), regressor.len())?;
        for (argument, values) in [("regressor", regressor.as_slice()), ("output", &[output])] {
            if values.iter().any(is_infinite) {
                return Err(Error::Infinite { argument });
            }
        }
        let mut innovation =
            Innovation { error: T::NAN, variance: T::NAN, nis: T::zero(), action: Action::Missing };
        if !(output.is_finite() && regressor.as_slice().iter().all(T::is_finite)) {
            return Ok(innovation);
        }
        self.newer.check(regressor, output)?;
        innovation.error = output - dot(regressor.as_slice(), self.parameters.as_slice());
        if !innovation.error.is_finite() {
            return Err(Error::TooLarge { argument: "regressor" });
        }
        if let Some(noise) = self.noise_variance() {
            let size = self.parameters.shape_generic().0;
            let all = &self.all;
            let leverage =
                size.with_scratch(&mut self.scratch, |[work], []| all.leverage(regressor.as_slice(), work));
            let variance = noise * (T::one() + leverage);
            if variance >= T::MIN_POSITIVE && variance.is_finite() {
                innovation.variance = variance;
                innovation.nis = (innovation.error / variance * innovation.error).min(T::LARGEST_ENTRY);
            }
        }
        self.take(regressor, output);
        innovation.action = if self.determined { Action::Updated } else { Action::Collecting };
        Ok(innovation)
    }

    /// Takes a sample that is checked.
    fn take(&mut self, regressor: &OVector<T, N>, output: T) {
        let Window { blocks, block } = self.window;
        if self.current.rows() == 0 && self.older_blocks + self.newer_blocks == blocks {
            if self.older_blocks == 0 {
                self.turn();
            }
            self.older_blocks -= 1;
        }
        self.newer.add_checked(regressor, output);
        self.current.add_checked(regressor, output);
        if self.current.rows() == block {
            let place = self.parameters.len();
            self.current.pack(slot_mut(self.stored.as_mut_slice(), place, self.newer_blocks));
            self.current.clear();
            self.newer_blocks += 1;
        }
        self.merge();
        let size = self.parameters.shape_generic().0;
        let (all, parameters) = (&self.all, self.parameters.as_mut_slice());
        if self.determined {
            self.determined = size.with_scratch(&mut self.scratch, |[found], []| {
                let solved = all.solve_into(found);
                if solved {
                    crate::ud::copy(found, parameters);
                }
                solved
            });
        }
    }

    /// The newer blocks become the older ones: each is merged with those after it.
    fn turn(&mut self) {
        let (n, block) = (self.parameters.len(), self.window.block);
        self.all.clear();
        for index in (0..self.newer_blocks).rev() {
            let slot = slot_mut(self.stored.as_mut_slice(), n, index);
            self.all.merge_packed(slot, block);
            self.all.pack(slot);
        }
        (self.older_blocks, self.newer_blocks) = (self.newer_blocks, 0);
        self.newer.clear();
    }

    /// Makes the triangle of the whole window.
    fn merge(&mut self) {
        let (n, Window { blocks, block }) = (self.parameters.len(), self.window);
        self.all.copy_from(&self.newer);
        if self.older_blocks > 0 {
            let slot = slot_mut(self.stored.as_mut_slice(), n, blocks - self.older_blocks);
            self.all.merge_packed(slot, self.older_blocks * block);
        }
        self.determined = self.all.is_determined(T::from_count(100) * T::from_count(n) * T::EPSILON);
    }

    /// The parameters θ̂: those of the window, or, where it does not determine them, those of the last one that did; 0
    /// before there was one.
    pub fn parameters(&self) -> &OVector<T, N> {
        &self.parameters
    }

    /// φ'θ̂: the output this regressor predicts, in the unit of y. n multiply-adds.
    ///
    /// Errors: [`Error::Length`] (only with `Dyn`); [`Error::NotFinite`] if the regressor holds NaN or infinity;
    /// [`Error::Overflow`] if the prediction does not fit `T`.
    pub fn predict(&self, regressor: &OVector<T, N>) -> Result<T, Error> {
        crate::error::check_entries("regressor", regressor.as_slice(), self.parameters.len())?;
        let predicted = dot(regressor.as_slice(), self.parameters.as_slice());
        if predicted.is_finite() { Ok(predicted) } else { Err(Error::Overflow) }
    }

    /// Whether the samples of the window determine the parameters.
    pub fn is_determined(&self) -> bool {
        self.determined
    }

    /// The number of samples in the window.
    pub fn rows(&self) -> usize {
        self.all.rows()
    }

    /// How long the window is.
    pub fn window(&self) -> Window {
        self.window
    }

    /// σ̂² = ρ²/(m - n), the variance of the residuals of the window, in the unit of y²; `None` while it has no more
    /// samples than parameters, or does not determine them.
    pub fn noise_variance(&self) -> Option<T> {
        if self.determined { self.all.residual_variance() } else { None }
    }

    /// The standard errors of the parameters, and `None` where [`noise_variance`](WindowedLeastSquares::noise_variance)
    /// is. About 6 n³ flops.
    pub fn standard_errors(&self) -> Option<OVector<T, N>> {
        if self.determined { self.solution().ok()?.standard_errors() } else { None }
    }

    /// The solution of the window, with its covariance. About 6 n³ flops.
    ///
    /// Errors: those of [`LeastSquares::solve`].
    pub fn solution(&self) -> Result<Solution<T, N>, Error> {
        self.all.solve()
    }

    /// Forgets all samples. The estimate stays, until new ones determine another.
    pub fn clear(&mut self) {
        for problem in [&mut self.newer, &mut self.current, &mut self.all] {
            problem.clear();
        }
        (self.older_blocks, self.newer_blocks, self.determined) = (0, 0, false);
    }
}

/// The place of a block.
fn slot_mut<T>(stored: &mut [T], parameters: usize, index: usize) -> &mut [T] {
    let length = packed_numbers(parameters);
    stored.get_mut(index * length..(index + 1) * length).unwrap_or_default()
}

#[cfg(feature = "serde")]
mod snapshot;
#[cfg(test)]
mod tests;
