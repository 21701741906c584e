//! The map from the past to the future that the states are read off, and how it is weighted.

#[cfg(test)]
mod tests;

use std::fmt;
use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::{Cholesky, DMatrix};

use super::data::SubspaceData;
use super::lagged_products::{Factor, LaggedProducts, ROUNDING, divided};
use crate::Error;

/// What a subspace method takes the singular values of.
///
/// SSARX is described at [`subspace`](super::subspace()). The classical methods regress s future outputs on the future
/// inputs and on p samples of the past, z = [u; y]. With the lower Cholesky factor L of the products of these three, in
/// this order,
///
/// ```text
/// Y_f = (…) U_f + Theta Z_p + …,   Theta = L32 L22^-1
///
/// moesp: diag(sigma) L32                          = W Theta R,   W = diag(sigma),                  R = L22
/// n4sid: diag(sigma) L32 L22^-1 [L21 L22]         = W Theta R,   W = diag(sigma),                  R R' = L21 L21' + L22 L22'
/// cva:   (root of L32 L32' + L33 L33')^-1 L32     = W Theta R,   W^-1 W'^-1 = L32 L32' + L33 L33',  R = L22
/// ```
///
/// The sigma are the scales of the outputs, which L is without. The state of order n is x = S^½ V' R^-1 z_past with its
/// first n rows, of W Theta R = U S V' (Van Overschee and De Moor, Subspace Identification for Linear Systems, 1996,
/// chapter 4; MOESP: Verhaegen, Automatica 30, 1994; CVA: Larimore, American Control Conference 1983, and Conference on
/// Decision and Control 1990). Without inputs there is no U_f.
///
/// Where inputs are fed back, U_f tells of the noise, and the classical methods are biased: with N = 1000 samples of a
/// plant of order 2 in a loop, the median relative error of the impulse response of 100 runs was 0.10 for SSARX and
/// CVA, 0.22 for N4SID and 0.23 for MOESP. In open loop all four are alike.
///
/// F and H follow by least squares from the states for all of them. Those that the classical methods read off the rows
/// of Gamma = W^-1 U S^½, F = Gamma_up^+ Gamma_down, predict no better: on the evaporator of DaISy (order 8, p = s =
/// 26) MOESP has a mean fit of 78.5 % one step ahead and 74.1 % five steps ahead against 78.4 and 73.9 % with these; on
/// its CD player arm, which moves in a loop, 90.4 and 82.4 % (order 20) against 12 % and none at all.
///
/// ```
/// use thetahat::data::JointRecord;
/// use thetahat::estimate::{SubspaceOptions, Weighting, subspace};
///
/// // y(t+1) = 0.8 y(t) + u(t), seen with noise.
/// let (mut random, mut x, mut u, mut y) = (1_u32, 0.0, vec![], vec![]);
/// let mut sample = || {
///     random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
///     f64::from(random >> 16) / 32_768.0 - 1.0
/// };
/// for _ in 0..1000 {
///     u.push(sample());
///     y.push(x + 0.3 * sample());
///     x = 0.8 * x + u[u.len() - 1];
/// }
/// let record = JointRecord::new(vec![&u], vec![&y])?;
/// let weighting: Weighting = "cva".parse()?;
/// let found = subspace(&record, &SubspaceOptions { weighting, ..SubspaceOptions::default() })?;
/// // The correlations of a state with the past and the future: one state is seen.
/// let correlations = found.singular_values();
/// assert!(correlations[0] > 0.9 && correlations[0] < 1.0 && correlations[1] < 0.3);
/// assert!((found.state_space(1, 1.0)?.f[(0, 0)] - 0.8).abs() < 0.05);
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Weighting {
    /// What a long ARX model of several outputs predicts, in units of its errors: consistent where inputs are fed back.
    #[default]
    Ssarx,
    /// What the past says of the outputs beyond the future inputs, in their units. These singular values, times the
    /// root of the number of samples, are those that SLICOT's IB01AD prints.
    Moesp,
    /// What the past says of the outputs, without what the future inputs do, in their units.
    N4sid,
    /// The canonical correlations of the past and the future beyond the future inputs: singular values from 0 to 1,
    /// whatever the units.
    Cva,
}

impl Weighting {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Ssarx, Self::Moesp, Self::N4sid, Self::Cva];

    /// The word for it in options and documents.
    pub fn word(self) -> &'static str {
        match self {
            Self::Ssarx => "ssarx",
            Self::Moesp => "moesp",
            Self::N4sid => "n4sid",
            Self::Cva => "cva",
        }
    }

    /// The longest future that it has with a past: rows of SSARX's map beyond p are zero.
    pub(super) fn longest_future(self, past: usize) -> usize {
        if self == Self::Ssarx { past } else { usize::MAX }
    }

    /// What the past says of `future` samples of the outputs, weighted.
    ///
    /// # Errors
    /// [`Error::Undetermined`] where the outputs depend on one another.
    pub(super) fn weighted(
        self,
        data: &impl SubspaceData,
        regression: &LaggedProducts,
        future: usize,
        feedthrough: bool,
    ) -> Result<Weighted, Error> {
        let found = match self {
            Self::Ssarx => Weighted::shifted(regression, future, feedthrough),
            Self::Moesp | Self::N4sid => {
                let Projected { mut map, products, factor, past, .. } =
                    Projected::new(data, regression, future);
                let scales = regression.scales[regression.inputs..].iter().cycle();
                map.row_iter_mut().zip(scales).for_each(|(mut row, scale)| row *= *scale);
                let factor = if self == Self::Moesp {
                    factor
                } else {
                    let places: Vec<usize> = past.collect();
                    Factor::new(&products, &places).block(0..places.len(), 0..places.len())
                };
                Some(Weighted { map, factor })
            }
            Self::Cva => {
                let Projected { mut map, factor, covariance, .. } = Projected::new(data, regression, future);
                // Outputs without noise have a singular covariance; what rounding leaves of it must not look like
                // correlation.
                let rounding = DMatrix::identity(map.nrows(), map.nrows()) * ROUNDING;
                let left = Cholesky::new(covariance + rounding);
                left.filter(|left| left.l_dirty().solve_lower_triangular_mut(&mut map))
                    .map(|_| Weighted { map, factor })
            }
        };
        found.ok_or_else(|| {
            Error::undetermined(Vec::new(), "the outputs depend on one another; leave one out")
        })
    }
}

impl fmt::Display for Weighting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

impl FromStr for Weighting {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        Self::ALL.into_iter().find(|weighting| weighting.word() == text).ok_or_else(|| {
            let words = Self::ALL.map(Self::word).join(", ");
            Error::argument("weighting", format!("'{text}' is none; there are {words}"))
        })
    }
}

/// A map from z_past to the future, weighted on the left, and R: the singular values are those of `map` R.
#[derive(Debug)]
pub(super) struct Weighted {
    /// W Theta.
    pub(super) map: DMatrix<f64>,
    /// R, lower triangular, with zeros in the columns of what depends on others.
    pub(super) factor: DMatrix<f64>,
}

impl Weighted {
    /// W Gamma K_p of SSARX: its rows are the coefficients of a long ARX model, moved by one lag each.
    fn shifted(regression: &LaggedProducts, future: usize, feedthrough: bool) -> Option<Self> {
        let LaggedProducts { outputs, past, .. } = *regression;
        let width = regression.width();
        let (coefficients, covariance) = regression.coefficients(feedthrough);
        let rounding = DMatrix::identity(outputs, outputs) * ROUNDING;
        let whitened = Cholesky::new(covariance + rounding)?.l().solve_lower_triangular(&coefficients)?;
        let mut map = DMatrix::zeros(outputs * future, width * past);
        for block in 0..future {
            let known = width * (past - block);
            let from = whitened.columns(width * block, known);
            map.view_mut((outputs * block, 0), (outputs, known)).copy_from(&from);
        }
        Some(Self { map, factor: regression.past_factor() })
    }
}

/// What a regression of the future outputs on the future inputs and the past leaves, all signals divided by their
/// scales.
#[derive(Debug)]
struct Projected {
    /// Theta.
    map: DMatrix<f64>,
    /// L22.
    factor: DMatrix<f64>,
    /// L32 L32' + L33 L33', the covariance of the future outputs beyond the future inputs.
    covariance: DMatrix<f64>,
    /// The products that all this is of, and the places of the past in them.
    products: DMatrix<f64>,
    past: std::ops::Range<usize>,
}

impl Projected {
    fn new(data: &impl SubspaceData, regression: &LaggedProducts, future: usize) -> Self {
        let LaggedProducts { inputs, past, .. } = *regression;
        let width = regression.width();
        let products = regression.longer(data, past + future - 1);
        // The latest sample of the future has lag 0.
        let coming = |first: usize, last: usize| {
            (0..future).rev().flat_map(move |lag| width * lag + first..width * lag + last)
        };
        let past = width * future..width * (future + past);
        let places: Vec<usize> = coming(0, inputs).chain(past.clone()).chain(coming(inputs, width)).collect();
        let factor = Factor::new(&products, &places);
        let first = inputs * future;
        let last = first + past.len();
        let (before, after) = (first..last, last..places.len());
        let explained = factor.block(after.clone(), before.clone());
        let rest = factor.block(after.clone(), after);
        let covariance = &explained * explained.transpose() + &rest * rest.transpose();
        let factor = factor.block(before.clone(), before);
        Self { map: divided(explained, &factor), factor, covariance, products, past }
    }
}
