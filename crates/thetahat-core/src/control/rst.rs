//! A linear controller with two degrees of freedom.

use core::ops::RangeInclusive;

use nalgebra::OVector;

use crate::{Dimension, Error, Real};

/// A linear controller of a measurement and a set point, in polynomials of the delay:
///
/// ```text
/// R(q) u(k) = T(q) u_c(k) - S(q) y(k)
///
/// R = 1 + r_1 q⁻¹ + …,   S = s_0 + s_1 q⁻¹ + …,   T = t_0 A_o,   A_o = 1 + a_1 q⁻¹ + …: the observer polynomial
/// ```
///
/// What it asks for beyond its limits, the actuator does not do. So that it does not go on integrating then, it
/// observes itself with the input that acted, u = v within the limits, through A_o:
///
/// ```text
/// A_o v(k) = T u_c(k) - S y(k) + (A_o - R) u(k)
/// ```
///
/// which is the equation above while v is within the limits, and stable beyond them as A_o is (Åström and Wittenmark,
/// Computer-Controlled Systems, 3rd ed. 1997, section 9.4; Adaptive Control, 2nd ed. 1995, section 11.2).
///
/// y, u and u_c are deviations from a working point at which they belong together: with an integrator in R any, else
/// that of the model.
///
/// # Time
///
/// [`control`](RstController::control) is called once a sample, and gives the input that acts from now on. Where the
/// actuator reports that it did something else, [`applied`](RstController::applied) says so before the next sample. A
/// measurement that is NaN is missing: the input stays as it was, and the controller goes on as if nothing had been
/// measured.
///
/// `N` is the number of coefficients of S, and of R and A_o without their leading 1: shorter ones are filled up with
/// zeros. Memory: 4 N + 4 numbers. A step: 4 N multiply-adds.
///
/// ```
/// use thetahat_core::nalgebra::Const;
/// use thetahat_core::{Error, RstController};
///
/// // A PI controller, u = K (u_c - y) + I: R = 1 - q⁻¹, S = K (1 + h/T_i) - K q⁻¹; here K = 2, h/T_i = 0.1.
/// let (r, s, observer) = ([-1.0, 0.0].into(), [2.2, -2.0].into(), [-2.0 / 2.2, 0.0].into());
/// let heater: RstController<f64, Const<2>> = RstController::new(2.2, r, s, observer)?;
/// let mut heater = heater.with_limits(0.0..=10.0)?;
/// let mut level = 0.0;
/// let mut power = 0.0;
/// for _ in 0..200 {
///     power = heater.control(5.0, level);
///     assert!((0.0..=10.0).contains(&power));
///     level = 0.9 * level + 0.2 * power;
/// }
/// assert!((level - 5.0).abs() < 1e-3 && (power - 2.5).abs() < 1e-3);
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "", into = "super::snapshot::Snapshot<T, N>"))]
#[cfg_attr(feature = "serde", serde(try_from = "super::snapshot::Snapshot<T, N>"))]
pub struct RstController<T: Real, N: Dimension> {
    pub(super) r: OVector<T, N>,
    pub(super) s: OVector<T, N>,
    pub(super) observer: OVector<T, N>,
    /// t_0.
    pub(super) gain: T,
    pub(super) lowest: T,
    pub(super) highest: T,
    /// What of the past acts on the next output: z of the transposed form.
    pub(super) state: OVector<T, N>,
    pub(super) input: T,
}

impl<T: Real, N: Dimension> RstController<T, N> {
    /// The controller with t_0, r_1 …, s_0 … and the coefficients of A_o after its 1, at rest.
    ///
    /// Errors: [`Error::Length`] (only with `Dyn`); [`Error::NotFinite`].
    pub fn new(gain: T, r: OVector<T, N>, s: OVector<T, N>, observer: OVector<T, N>) -> Result<Self, Error> {
        let size = s.shape_generic().0;
        for (argument, coefficients) in [("r", &r), ("s", &s), ("observer", &observer)] {
            crate::error::check_length(argument, size.value(), coefficients.len())?;
            if !coefficients.iter().all(T::is_finite) {
                return Err(Error::NotFinite { argument });
            }
        }
        if !gain.is_finite() {
            return Err(Error::NotFinite { argument: "gain" });
        }
        let state = size.vector(T::zero());
        let (lowest, highest) = (-T::INFINITY, T::INFINITY);
        Ok(RstController { r, s, observer, gain, lowest, highest, state, input: T::zero() })
    }

    /// The same with limits of the input.
    ///
    /// Errors: [`Error::OutOfRange`] if they are NaN, or the lower one is above the upper one.
    pub fn with_limits(mut self, limits: RangeInclusive<T>) -> Result<Self, Error> {
        self.set_limits(limits)?;
        Ok(self)
    }

    /// Sets the limits of the input: the next [`control`](RstController::control) keeps them.
    ///
    /// Errors, after which nothing has changed: those of [`with_limits`](RstController::with_limits).
    pub fn set_limits(&mut self, limits: RangeInclusive<T>) -> Result<(), Error> {
        // Not so with a NaN either.
        if limits.is_empty() {
            return Err(Error::OutOfRange { argument: "limits", range: "in order, the lower one first" });
        }
        (self.lowest, self.highest) = (*limits.start(), *limits.end());
        Ok(())
    }

    /// Takes over from a hand: if the measurement and the set point stay as they are, the input stays at this one
    /// first, and then goes where the controller wants it.
    pub fn start(&mut self, input: T, measurement: T, set_point: T) {
        self.input = input;
        // As if all had been so for ever.
        self.advance(set_point, measurement, input, input, true);
        let first = at_first(&self.s);
        if let Some(next) = self.state.as_mut_slice().first_mut() {
            *next = input - self.gain * set_point + first * measurement;
        }
    }

    /// The input from now on, within the limits. With a measurement that is not finite, or a set point that is not, it
    /// stays as it was, and the state too.
    pub fn control(&mut self, set_point: T, measurement: T) -> T {
        let wanted = self.gain * set_point - at_first(&self.s) * measurement + at_first(&self.state);
        if !wanted.is_finite() {
            // Numbers too large for `T` have come into it: it would never get rid of them.
            if !at_first(&self.state).is_finite() {
                self.state.as_mut_slice().fill(T::zero());
            }
            return self.input;
        }
        let input = wanted.max(self.lowest).min(self.highest);
        self.advance(set_point, measurement, input, wanted, false);
        self.input = input;
        input
    }

    /// Tells that the actuator did something else than the latest [`control`](RstController::control) asked for. A
    /// number that is not finite is not taken.
    pub fn applied(&mut self, input: T) {
        let change = input - self.input;
        if !change.is_finite() {
            return;
        }
        let each = self.state.as_mut_slice().iter_mut().zip(self.observer.as_slice()).zip(self.r.as_slice());
        for ((state, observer), r) in each {
            *state += (*observer - *r) * change;
        }
        self.input = input;
    }

    /// z_i(k+1) = z_(i+1)(k) + a_i (t_0 u_c - v) + (a_i - r_i) u - s_i y; or where it settles to with these for ever.
    fn advance(&mut self, set_point: T, measurement: T, input: T, wanted: T, settles: bool) {
        let ahead = self.gain * set_point - wanted;
        let coefficients = self.observer.as_slice().iter().zip(self.r.as_slice()).zip(self.s.as_slice());
        let (mut next, mut next_s) = (T::zero(), T::zero());
        for (state, ((observer, r), s)) in self.state.as_mut_slice().iter_mut().zip(coefficients).rev() {
            let before = *state;
            *state = next + *observer * ahead + (*observer - *r) * input - next_s * measurement;
            next = if settles { *state } else { before };
            next_s = *s;
        }
    }

    /// As if nothing had been before.
    pub(super) fn forget(&mut self) {
        self.state.as_mut_slice().fill(T::zero());
        self.input = T::zero();
    }

    /// Goes on by a sample in which something else controlled: it wanted one input, and this one acted.
    pub(super) fn follow(&mut self, set_point: T, measurement: T, input: T, wanted: T) {
        self.advance(set_point, measurement, input, wanted, false);
        self.input = input;
    }

    /// R without its leading 1.
    pub fn r(&self) -> &OVector<T, N> {
        &self.r
    }

    /// S.
    pub fn s(&self) -> &OVector<T, N> {
        &self.s
    }

    /// A_o without its leading 1.
    pub fn observer(&self) -> &OVector<T, N> {
        &self.observer
    }

    /// The lowest and the highest input.
    pub fn limits(&self) -> (T, T) {
        (self.lowest, self.highest)
    }

    /// t_0, so that T = t_0 A_o.
    pub fn gain(&self) -> T {
        self.gain
    }
}

fn at_first<T: Real, N: Dimension>(values: &OVector<T, N>) -> T {
    values.as_slice().first().copied().unwrap_or(T::zero())
}
