//! Controllers by pole placement.

use super::RstController;
use super::polynomial::{at, product};
use crate::stability::is_stable;
use crate::{Dimension, Error, LeastSquares, Real};

/// How large a controller of a model is: `N` of [`RstController`].
///
/// ```
/// use thetahat_core::PlacementOrders;
///
/// // A = 1 + a_1 q⁻¹ + a_2 q⁻², B = b_1 q⁻¹ + b_2 q⁻²: R and S have 1 and 2 coefficients.
/// assert_eq!(PlacementOrders { na: 2, nb: 2, integrator: false }.size(), 3);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PlacementOrders {
    /// The highest power of q⁻¹ in A.
    pub na: usize,
    /// The highest power of q⁻¹ in B, delays included.
    pub nb: usize,
    /// Whether the controller integrates.
    pub integrator: bool,
}

impl PlacementOrders {
    /// The coefficients of R and S together: na + nb - 1, and one more with an integrator.
    pub const fn size(&self) -> usize {
        (self.na + self.integrator as usize + self.nb).saturating_sub(1)
    }
}

/// Where the poles of the closed loop shall be. Polynomials begin with their 1.
///
/// ```
/// use thetahat_core::nalgebra::Const;
/// use thetahat_core::{Error, RstController, WantedPoles};
///
/// // The loop of y(k) = 0.9 y(k-1) + 0.1 u(k-1) shall have its pole at 0.5: R = 1, S = 4.
/// let wanted = WantedPoles::new(&[1.0, -0.5], &[1.0]);
/// let heater: RstController<f64, Const<1>> = RstController::pole_placement(&[1.0, -0.9], &[0.0, 0.1], &wanted)?;
/// assert!((heater.s()[0] - 4.0).abs() < 1e-12);
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct WantedPoles<'a, T> {
    /// A_m: how the output answers the set point.
    pub response: &'a [T],
    /// A_o: how an error of the model or the start is forgotten. `[1]` is at once.
    pub observer: &'a [T],
    /// Whether the controller integrates, so that a constant load leaves no error.
    pub integrator: bool,
    /// Whether the zeros of B are cancelled: then the response has none, but those in B⁺ show in the input.
    pub cancel_zeros: bool,
}

impl<'a, T> WantedPoles<'a, T> {
    /// A_m and A_o, without an integrator and with the zeros of B.
    pub const fn new(response: &'a [T], observer: &'a [T]) -> Self {
        WantedPoles { response, observer, integrator: false, cancel_zeros: false }
    }

    /// The same with an integrator, or without.
    pub const fn with_integrator(mut self, integrator: bool) -> Self {
        self.integrator = integrator;
        self
    }

    /// The same with the zeros of B cancelled, or not.
    pub const fn with_cancelled_zeros(mut self, cancel_zeros: bool) -> Self {
        self.cancel_zeros = cancel_zeros;
        self
    }
}

impl<T: Real, N: Dimension> RstController<T, N> {
    /// The controller of lowest order that places the poles of the closed loop with a model A(q) y = B(q) u:
    ///
    /// ```text
    /// A R + B S = A_m A_o,   T = A_o A_m(1)/B(1),   then y = (B T)/(A_m A_o) u_c = B A_m(1)/(B(1) A_m) u_c
    /// ```
    ///
    /// With zeros cancelled B = B⁺ B⁻ with B⁻ = b q⁻ᵈ, R = R' B⁺ and A R' + B⁻ S = A_m A_o, T = A_o A_m(1)/b; with an
    /// integrator R has the factor 1 - q⁻¹. The equation is linear in the coefficients, and solved by a QR
    /// factorisation ([`LeastSquares`]). `a` and `b` are as [`RecursiveArx::a`](crate::RecursiveArx::a) and
    /// [`b`](crate::RecursiveArx::b) give them: from the power 0 on, b with its leading zeros.
    ///
    /// Errors: [`Error::NotFinite`]; [`Error::OutOfRange`] if a, the response or the observer does not begin with 1, b
    /// not with 0 (an input that acts at once makes a loop without time), b is all zeros or B(1) is 0, a zero that
    /// shall be cancelled is not inside the radius 1 - 1/1024, or A and B have a common factor, nearly, so that poles
    /// cannot be placed; [`Error::Orders`] if `N` is not [`PlacementOrders::size`]; [`Error::Length`] if A_m A_o has
    /// more than `N` coefficients after its 1; [`Error::TooLarge`] and [`Error::Overflow`] for numbers at the ends of
    /// `T`.
    ///
    /// About 10 N³ flops.
    ///
    /// Source: Åström and Wittenmark, Adaptive Control, 2nd ed. 1995, section 3.2.
    ///
    /// ```
    /// use thetahat_core::nalgebra::Const;
    /// use thetahat_core::{Error, PlacementOrders, RstController, WantedPoles};
    ///
    /// // A motor, 1/(s (s + 1)) every 0.5 s; poles of frequency 1 and damping 0.7.
    /// let (a, b) = ([1.0, -1.606531, 0.606531], [0.0, 0.106531, 0.090204]);
    /// let wanted = WantedPoles::new(&[1.0, -1.320535, 0.496585], &[1.0]);
    /// const SIZE: usize = PlacementOrders { na: 2, nb: 2, integrator: false }.size();
    /// let motor: RstController<f64, Const<SIZE>> = RstController::pole_placement(&a, &b, &wanted)?;
    /// assert!((motor.r()[0] - 0.111).abs() < 1e-3 && (motor.s()[0] - 1.642).abs() < 1e-3);
    /// # Ok::<(), Error>(())
    /// ```
    pub fn pole_placement(a: &[T], b: &[T], wanted: &WantedPoles<'_, T>) -> Result<Self, Error> {
        let exactly = |needed| N::exactly(needed).map_err(|available| Error::Orders { needed, available });
        Self::pole_placement_with(a, b, wanted, exactly)
    }

    /// The same with the `N` that is made of [`PlacementOrders::size`]. A larger one has more coefficients of R, for an
    /// A_m A_o of a higher degree.
    pub(super) fn pole_placement_with(
        a: &[T],
        b: &[T],
        wanted: &WantedPoles<'_, T>,
        size: impl FnOnce(usize) -> Result<N, Error>,
    ) -> Result<Self, Error> {
        let WantedPoles { response, observer, integrator, cancel_zeros } = *wanted;
        for (argument, values) in [("a", a), ("b", b), ("response", response), ("observer", observer)] {
            if !values.iter().all(T::is_finite) {
                return Err(Error::NotFinite { argument });
            }
        }
        for (argument, values) in [("a", a), ("response", response), ("observer", observer)] {
            if values.first() != Some(&T::one()) {
                return Err(Error::OutOfRange { argument, range: "a polynomial that begins with 1" });
            }
        }
        let delay = b.iter().take_while(|value| **value == T::zero()).count();
        if delay == 0 || delay == b.len() {
            return Err(Error::OutOfRange {
                argument: "b",
                range: "a polynomial that begins with 0 and is not all 0",
            });
        }
        let (na, nb) = (a.len() - 1, b.len() - 1);
        let needed = PlacementOrders { na, nb, integrator }.size();
        let size = size(needed)?;
        let spare = size.value().saturating_sub(needed);
        let poles = response.len() + observer.len() - 2;
        // Zeros that are cancelled take no part in the equation.
        let gain = at(b, delay);
        let (b_minus, last) = if cancel_zeros { (gain, delay) } else { (T::zero(), nb) };
        let plant = |power: usize| match cancel_zeros {
            true if power == last => b_minus,
            true => T::zero(),
            false => at(b, power),
        };
        let denominator = |power: usize| {
            let before = power.checked_sub(1).map_or(T::zero(), |before| at(a, before));
            at(a, power) - if integrator { before } else { T::zero() }
        };
        let (of_r, of_s) = (last - 1 + spare, na + usize::from(integrator));
        let unknown = of_r + of_s;
        if poles > unknown {
            return Err(Error::Length {
                argument: "observer",
                expected: unknown + 2 - response.len(),
                found: observer.len(),
            });
        }
        let mut zeros = size.vector(T::zero());
        for (place, zero) in zeros.iter_mut().enumerate() {
            *zero = at(b, delay + 1 + place) / gain;
        }
        if cancel_zeros && !is_stable(zeros.as_mut_slice()) {
            return Err(Error::OutOfRange {
                argument: "b",
                range: "a polynomial with its zeros inside the unit circle, as they are cancelled",
            });
        }
        let mut equations = LeastSquares::with_size(size);
        for power in 1..=size.value() {
            let mut row = size.vector(T::zero());
            let mut right = T::zero();
            if power <= unknown {
                for (place, entry) in row.iter_mut().enumerate() {
                    // r_1 … r_of_r, then s_0 ….
                    *entry = match place.checked_sub(of_r) {
                        None if power > place => denominator(power - place - 1),
                        Some(place) if place < of_s && power >= place => plant(power - place),
                        _ => T::zero(),
                    };
                }
                right = product(response, observer, power) - denominator(power);
            } else if let Some(entry) = row.iter_mut().nth(power - 1) {
                *entry = T::one();
            }
            equations.add(&row, right)?;
        }
        let solution = equations.solve().map_err(|error| match error {
            Error::RankDeficient { .. } => {
                Error::OutOfRange { argument: "b", range: "a polynomial without a factor in common with a" }
            }
            other => other,
        })?;
        let found = solution.parameters().as_slice();
        let sum = |values: &[T]| values.iter().fold(T::zero(), |sum, value| sum + *value);
        let static_gain = if cancel_zeros { gain } else { sum(b) };
        if static_gain == T::zero() {
            return Err(Error::OutOfRange {
                argument: "b",
                range: "a polynomial whose coefficients do not add up to 0",
            });
        }
        let coefficient = |place: Option<usize>| match place {
            Some(0) => T::one(),
            Some(place) if place <= of_r => at(found, place - 1),
            _ => T::zero(),
        };
        // R' times what of B is cancelled, then times 1 - q⁻¹.
        let times_zeros = |power: usize| match cancel_zeros {
            false => coefficient(Some(power)),
            true => (0..=power).fold(T::zero(), |sum, place| {
                sum + coefficient(Some(place)) * at(b, delay + power - place) / gain
            }),
        };
        let (mut r, mut s, mut forgets) =
            (size.vector(T::zero()), size.vector(T::zero()), size.vector(T::zero()));
        for (place, entry) in r.iter_mut().enumerate() {
            let before = if integrator { times_zeros(place) } else { T::zero() };
            *entry = times_zeros(place + 1) - before;
        }
        for (place, entry) in s.iter_mut().enumerate().take(of_s) {
            *entry = at(found, of_r + place);
        }
        for (place, entry) in forgets.iter_mut().enumerate() {
            *entry = at(observer, place + 1);
        }
        RstController::new(sum(response) / static_gain, r, s, forgets)
    }

    /// How far the loop with a model A(q) y = B(q) u is from instability: the largest |1/(1 + L)| and |L/(1 + L)| with
    /// L = B S/(A R), over this many frequencies from 0 to that of half the sampling, closer to one another towards 0.
    /// 2 is a usual limit of both; a loop whose poles were placed inside the unit circle is stable, but near to
    /// instability where they are above 3 or so.
    ///
    /// About 10 N multiply-adds for each frequency.
    pub fn peaks(&self, a: &[T], b: &[T], frequencies: usize) -> (T, T) {
        let mut turns = Turns::new(frequencies);
        (0..frequencies).fold((T::zero(), T::zero()), |(sensitivity, complementary), place| {
            let turn = turns.at(place);
            // R = 1 + q⁻¹ (r_1 + …).
            let later = times(value(self.r().as_slice().iter(), turn), turn);
            let open = times(value(a.iter(), turn), (T::one() + later.0, later.1));
            let back = times(value(b.iter(), turn), value(self.s().as_slice().iter(), turn));
            let closed = length((open.0 + back.0, open.1 + back.1));
            (sensitivity.max(length(open) / closed), complementary.max(length(back) / closed))
        })
    }
}

/// e^(-iω) of the frequencies ω = π ((k + 1/2)/n)² in their order, each from the one before: sines are dear where there
/// is no unit for double precision.
///
/// ```text
/// ω(k+1) - ω(k) = 2π (k+1)/n²
/// ```
struct Turns<T> {
    count: T,
    turn: (T, T),
    step: (T, T),
    growth: (T, T),
}

/// Rounding grows with the square of so many products.
const PRODUCTS: usize = 16;

impl<T: Real> Turns<T> {
    fn new(count: usize) -> Self {
        let still = (T::one(), T::zero());
        let count = T::from_count(count.max(1));
        Turns { count, turn: still, step: still, growth: clockwise(T::two_pi() / count / count) }
    }

    fn at(&mut self, place: usize) -> (T, T) {
        if place.is_multiple_of(PRODUCTS) {
            let part = (T::from_count(place) + T::from_count(1) / T::from_count(2)) / self.count;
            self.turn = clockwise(T::pi() * part * part);
            self.step = clockwise(T::two_pi() * T::from_count(place + 1) / self.count / self.count);
        } else {
            self.turn = times(self.turn, self.step);
            self.step = times(self.step, self.growth);
        }
        self.turn
    }
}

/// e^(-i angle).
fn clockwise<T: Real>(angle: T) -> (T, T) {
    let (sine, cosine) = angle.sine_and_cosine();
    (cosine, -sine)
}

/// A polynomial at a number of length 1, by Horner.
fn value<'a, T: Real>(coefficients: impl DoubleEndedIterator<Item = &'a T>, turn: (T, T)) -> (T, T) {
    coefficients.rev().fold((T::zero(), T::zero()), |sum, coefficient| {
        let turned = times(sum, turn);
        (turned.0 + *coefficient, turned.1)
    })
}

fn times<T: Real>(first: (T, T), second: (T, T)) -> (T, T) {
    (first.0 * second.0 - first.1 * second.1, first.0 * second.1 + first.1 * second.0)
}

fn length<T: Real>(number: (T, T)) -> T {
    (number.0 * number.0 + number.1 * number.1).sqrt()
}
