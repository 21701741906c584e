//! Models in matrices.

use std::borrow::Cow;

use thetahat_core::nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use thetahat_core::{Covariance, LinearTransition};

use super::frame::{Frame, InitialState, Names, check_noise};
use crate::Error;
use crate::data::Offset;
use crate::estimate::noises::Covariances;
use crate::model::{Signal, StateSpace};

/// The largest magnitudes of noises, and of what is not known of the state at the first row.
#[derive(Debug, Clone)]
pub(super) struct Bounds {
    pub(super) process: DVector<f64>,
    pub(super) measurement: DVector<f64>,
    pub(super) initial: DVector<f64>,
}

type Transition = LinearTransition<f64, Dyn, Dyn>;

/// Prior variance of an unknown state, in units of the variance of e where it is seen. One row leaves a millionth of
/// it: a smoother loses six digits, a filter none.
const UNKNOWN: f64 = 1e6;

/// x(k+1) = F x(k) + G u(k) + w(k), with w ~ (0, Q) and cov(w, v) = S.
#[derive(Debug, Clone)]
pub(super) struct Linear {
    /// F, G and Q.
    pub(super) transition: Transition,
    correlation: Option<Correlation>,
    /// How large the noises are at most, where that is said.
    pub(super) bounds: Option<Bounds>,
}

/// How the noises are correlated, if they are.
#[derive(Debug, Clone)]
struct Correlation {
    /// S, n x m.
    cross: DMatrix<f64>,
    /// Q.
    noise: DMatrix<f64>,
    /// K and R of a model in innovations form, in which Q - S R⁻¹ S' = 0.
    innovations: Option<(DMatrix<f64>, Covariance<f64, Dyn>)>,
    /// The transition after a row of which all outputs are there.
    full: Transition,
}

/// The matrices of a model; S is zero if it is not there.
#[derive(Debug, Clone)]
pub(super) struct Matrices {
    pub(super) f: DMatrix<f64>,
    pub(super) g: DMatrix<f64>,
    pub(super) h: DMatrix<f64>,
    pub(super) d: DMatrix<f64>,
    pub(super) q: Covariance<f64, Dyn>,
    pub(super) r: Covariance<f64, Dyn>,
    pub(super) s: Option<DMatrix<f64>>,
    pub(super) x0: DVector<f64>,
    pub(super) p0: Covariance<f64, Dyn>,
    pub(super) bounds: Option<Bounds>,
}

impl Linear {
    /// A model of matrices whose sizes fit. `gain`: the K of Q = K R K' and S = K R.
    ///
    /// # Errors
    /// If no noises have these covariances, or a number overflows.
    pub(super) fn of_matrices(
        names: Names,
        matrices: Matrices,
        gain: Option<DMatrix<f64>>,
    ) -> Result<(Frame, Self), thetahat_core::Error> {
        let Matrices { f, g, h, d, q, r, s, x0, p0, bounds } = matrices;
        let noise = q.matrix();
        let innovations = gain.map(|gain| (gain, r.clone()));
        let transition = LinearTransition::new(f, q)?.with_input(g)?;
        let frame = Frame::new(names, (x0, p0), (h, d, r))?;
        let Some(cross) = s.filter(|cross| cross.iter().any(|entry| *entry != 0.0)) else {
            return Ok((frame, Self { transition, correlation: None, bounds }));
        };
        let mut correlation = Correlation { cross, noise, innovations, full: transition.clone() };
        let all = vec![true; frame.names.outputs.len()];
        correlation.full = decorrelated(&transition, &correlation, &frame, &all)?;
        Ok((frame, Self { transition, correlation: Some(correlation), bounds }))
    }

    /// A fitted model in innovations form: Q = K R K', S = K R, R = cov e.
    pub(super) fn of_innovations(
        space: StateSpace,
        (inputs, outputs): (&[Signal], &[Signal]),
        start: InitialState,
    ) -> Result<(Frame, Self), Error> {
        let noise = &space.noise_covariance;
        noise.diagonal().iter().try_for_each(|variance| check_noise(*variance))?;
        let n = space.f.nrows();
        let name = |signal: &Signal| signal.name.clone();
        // Of the output of which the least is seen in a state.
        let seen = |output: usize| noise[(output, output)] / space.h.row(output).amax().powi(2);
        let scale = (0..noise.nrows()).map(seen).filter(|scale| scale.is_finite()).fold(0.0, f64::max);
        let build = || -> Result<(Frame, Linear), thetahat_core::Error> {
            let r: Covariance<f64, Dyn> = match noise.nrows() {
                1 => Covariance::from_diagonal(&noise.diagonal())?,
                _ => Covariance::new(noise)?,
            };
            let names = Names {
                states: (1..=n).map(|state| format!("x{state}")).collect(),
                inputs: inputs.iter().map(name).collect(),
                outputs: outputs.iter().map(name).collect(),
                sample_time: space.sample_time,
            };
            let q = r.transformed(&space.k)?;
            let s = Some(&space.k * noise);
            let p0 = match start {
                InitialState::Zero => Covariance::zero(Dyn(n)),
                InitialState::Unknown => Covariance::from_diagonal(&DVector::repeat(n, UNKNOWN * scale))?,
            };
            let x0 = DVector::zeros(n);
            let StateSpace { f, g, h, d, .. } = space.clone();
            let matrices = Matrices { f, g, h, d, q, r, s, x0, p0, bounds: None };
            Linear::of_matrices(names, matrices, Some(space.k.clone()))
        };
        let (frame, linear) =
            build().map_err(|error| Error::report(format!("its model has no filter: {error}")))?;
        let offsets = |signals: &[Signal]| signals.iter().map(|signal| signal.offset).collect();
        Ok((Frame { input_offsets: offsets(inputs), output_offsets: offsets(outputs), ..frame }, linear))
    }

    /// Q, R and S as they were given; none of a fitted model in innovations form, or with offsets.
    pub(super) fn covariances(&self, frame: &Frame) -> Option<Covariances> {
        let (n, m) = (frame.start.len(), frame.names.outputs.len());
        let zero = Offset::default();
        let offsets = frame.input_offsets.iter().chain(&frame.output_offsets);
        if offsets.into_iter().any(|offset| *offset != zero) {
            return None;
        }
        let r = frame.output_noise.clone();
        Some(match &self.correlation {
            None => Covariances { q: self.transition.noise().matrix(), r, s: DMatrix::zeros(n, m) },
            Some(Correlation { innovations: Some(_), .. }) => return None,
            Some(Correlation { cross, noise, .. }) => Covariances { q: noise.clone(), r, s: cross.clone() },
        })
    }

    /// Whether S is not zero.
    pub(super) fn is_correlated(&self) -> bool {
        self.correlation.is_some()
    }

    /// The transition after a row with these outputs there, and what drives it.
    ///
    /// Where the noises are correlated, what is measured of v tells of w too. With S_M, R_M and H_M of the outputs that
    /// are there and W = S_M R_M⁻¹,
    ///
    /// ```text
    /// x(k+1) = (F - W H_M) x(k) + (G - W D_M) u(k) + W y_M(k) + w̄(k),      var w̄ = Q - W S_M'
    /// ```
    ///
    /// in which w̄ and v_M are not correlated (Anderson and Moore, Optimal Filtering, 1979, section 5.5): so the time
    /// update and the smoother are those of uncorrelated noises. The inputs of this transition are u and y one after
    /// the other. None if the noises are not correlated, or nothing is there.
    pub(super) fn after(
        &self,
        frame: &Frame,
        there: &[bool],
    ) -> Result<Option<Cow<'_, Transition>>, thetahat_core::Error> {
        match &self.correlation {
            Some(correlation) if there.iter().all(|there| *there) => {
                Ok(Some(Cow::Borrowed(&correlation.full)))
            }
            Some(correlation) if there.iter().any(|there| *there) => {
                Ok(Some(Cow::Owned(decorrelated(&self.transition, correlation, frame, there)?)))
            }
            _ => Ok(None),
        }
    }
}

/// The transition after a row with these outputs there.
fn decorrelated(
    transition: &Transition,
    correlation: &Correlation,
    frame: &Frame,
    there: &[bool],
) -> Result<Transition, thetahat_core::Error> {
    let used: Vec<usize> = (0..there.len()).filter(|&output| there[output]).collect();
    let cross = correlation.cross.select_columns(&used);
    let noise = frame.output_noise.select_rows(&used).select_columns(&used);
    let singular = thetahat_core::Error::NotPositive {
        argument: "R, which must be regular where S is not zero,",
        index: 0,
    };
    // W' = R_M⁻¹ S_M'.
    let weights = Cholesky::new(noise).ok_or(singular)?.solve(&cross.transpose()).transpose();
    let (f, g) = (transition.state_matrix(), transition.input_matrix());
    let (h, d) = (&frame.output_matrix, frame.observation.input_matrix());
    let state_matrix = f - &weights * h.select_rows(&used);
    let by_input = g - &weights * d.select_rows(&used);
    let (n, inputs) = by_input.shape();
    let mut input_matrix = DMatrix::zeros(n, inputs + there.len());
    input_matrix.columns_mut(0, inputs).copy_from(&by_input);
    for (column, &output) in used.iter().enumerate() {
        input_matrix.set_column(inputs + output, &weights.column(column));
    }
    let rest = match &correlation.innovations {
        // Q - W S' = (K - W E) R (K - W E)', E picking the outputs that are there from all: zero if these are all.
        Some(_) if used.len() == there.len() => Covariance::zero(Dyn(n)),
        Some((gain, covariance)) => {
            let mut unexplained = gain.clone();
            for (column, &output) in used.iter().enumerate() {
                let mut own = unexplained.column_mut(output);
                own -= weights.column(column);
            }
            covariance.transformed(&unexplained)?
        }
        None => remaining(&correlation.noise, &weights, &cross)?,
    };
    LinearTransition::new(state_matrix, rest)?.with_input(input_matrix)
}

/// Q - W S': a state of which nothing but rounding is left has no noise.
fn remaining(
    noise: &DMatrix<f64>,
    weights: &DMatrix<f64>,
    cross: &DMatrix<f64>,
) -> Result<Covariance<f64, Dyn>, thetahat_core::Error> {
    let n = noise.nrows();
    let explained = weights * cross.transpose();
    let mut rest = noise - (&explained + explained.transpose()) * 0.5;
    let rounding = 8.0 * (n + 1) as f64 * f64::EPSILON;
    for state in 0..n {
        if rest[(state, state)].abs() <= rounding * noise[(state, state)] {
            rest.row_mut(state).fill(0.0);
            rest.column_mut(state).fill(0.0);
        }
    }
    Covariance::new(&rest)
}
