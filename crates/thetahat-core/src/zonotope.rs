//! The set of states that noise known by its bound alone leaves open.

use nalgebra::{OMatrix, OVector};

use crate::error::{check_entries, check_length};
use crate::kalman::{is_missing, prediction_error};
use crate::triangle::{column, column_mut};
use crate::ud::{add_multiple, copy, dot};
use crate::{Action, Dimension, Error, LinearObservation, LinearTransition, Real, Transition};

/// A state estimator for noise of which nothing but a bound is known: it keeps a set in which the state is for certain,
/// as long as the noises keep their bounds.
///
/// ```text
/// x(k+1) = F x(k) + G u(k) + w(k),   |w_i| <= w̄_i          y(k) = H x(k) + D u(k) + v(k),   |v_i| <= v̄_i
///
/// set        Z = { c + Σ b_j g_j : -1 <= b_j <= 1 }         a zonotope: centre c, generators g_1 … g_g
/// predict    c <- F c + G u,   g_j <- F g_j,   and a generator w̄_i e_i for each state
/// correct    for each output, s_j = h'g_j, reach r = Σ |s_j|, e = y - h'c - d'u:
///            the strip |e - h'(x - c)| <= v̄ and the set's own |h'(x - c)| <= r leave h'(x - c) in [a, b];
///            with m = (a + b)/2, q = (b - a)/2, and a gain l:
///            c <- c + l m,   g_j <- g_j - l s_j,   and a generator q l
/// ```
///
/// The result holds the intersection of set and strip, for any l. Here l_i is the one for which the interval of state i
/// is shortest: it minimises Σ |g_ij - l_i s_j| + q |l_i|, and is the median of the ratios g_ij/s_j, weighted by |s_j|,
/// and of 0, weighted by q. With one state this is the intersection of two intervals. (The usual gain, for which the
/// sum of squares of all g_ij is least, left intervals two to four times as long in the tests, where the noise takes
/// its extremes.) Where [a, b] is empty no state explains the measurement: a noise has left its bound, a sensor has
/// failed, or the model is wrong. [`SetInnovation::contradiction`] tells it, with the output. The measurement is not
/// used then, and the set stays as it is predicted; it grows with the bounds of w until measurements meet it again, if
/// ever.
///
/// A zonotope has at most `G` generators. Where there would be more, those that are nearest to an axis, in units of the
/// interval of each state, give way to one for each axis that holds their sum. Rounding is added to the bounds of w: so
/// single precision keeps the promise too.
///
/// Beside a Kalman filter: no distribution is assumed, errors need not be independent in time, and the promise is for
/// every sample, not for 95 % of them. The price is a wider interval where noise is Gaussian after all, since a bound
/// must hold its extremes.
///
/// N is the number of states, n. `G` holds the generators: at least 2 n + 1; 10 n is plenty. Units: those of the model.
/// Memory: n (G + 1) numbers.
///
/// Source: Combastel, A state bounding observer based on zonotopes, 2003 (the set); Girard, Reachability of uncertain
/// linear systems using zonotopes, 2005, section 3.4 (how it is reduced); Alamo, Bravo and Camacho, Guaranteed state
/// estimation by zonotopes, 2005, section 4 (the strip, for any gain); Bravo, Alamo and Camacho, Bounded error
/// identification of systems with time-varying parameters, 2006 (the strip that the set tightens first).
///
/// ```
/// use thetahat_core::nalgebra::{Const, Matrix2, RowVector2, SVector, Vector1, Vector2};
/// use thetahat_core::{Covariance, Error, LinearObservation, LinearTransition, ZonotopeFilter};
///
/// // Position and velocity; the velocity changes by at most 0.01 in a sample, the gauge is off by at most 0.5.
/// let motion = LinearTransition::new(Matrix2::new(1.0, 1.0, 0.0, 1.0), Covariance::<f64, Const<2>>::zero(Const))?;
/// let gauge = LinearObservation::new(RowVector2::new(1.0, 0.0), Covariance::<f64, Const<1>>::zero(Const))?;
/// let none = SVector::zeros(); // no inputs
/// let mut filter = ZonotopeFilter::<f64, Const<2>, Const<20>>::new(Vector2::zeros(), &Vector2::new(100.0, 10.0), Const)?;
/// for k in 0..50 {
///     filter.predict(&motion, &Vector2::new(0.0, 0.01), &none)?;
///     let position = 2.0 * f64::from(k + 1);
///     let off = if k % 2 == 0 { 0.4 } else { -0.4 };
///     let told = filter.correct(&gauge, &Vector1::new(0.5), &none, &Vector1::new(position + off))?;
///     assert_eq!(told.contradiction, None);
///     let (state, reach) = (filter.centre(), filter.reaches());
///     assert!((position - state[0]).abs() <= reach[0] && (2.0 - state[1]).abs() <= reach[1]);
/// }
/// assert!(filter.reaches()[0] < 0.3); // the gauge alone tells it within 0.5
/// let told = filter.correct(&gauge, &Vector1::new(0.5), &none, &Vector1::new(200.0))?;
/// assert_eq!(told.contradiction, Some(0));
/// # Ok::<(), Error>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(bound = "", into = "snapshot::Snapshot<T, N, G>"))]
#[cfg_attr(feature = "serde", serde(try_from = "snapshot::Snapshot<T, N, G>"))]
pub struct ZonotopeFilter<T: Real, N: Dimension + Dimension<G>, G: Dimension> {
    centre: OVector<T, N>,
    /// A column for each generator; those that are not in use are 0.
    generators: OMatrix<T, N, G>,
    /// How many are in use.
    used: usize,
}

/// What a measurement told a [`ZonotopeFilter`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SetInnovation<E> {
    /// The measurement less that of the centre, before it is used. NaN where it is missing.
    pub error: E,
    /// How large its magnitude may be at most: the reach of the set along the output, and the bound of the noise.
    pub bound: E,
    /// The output, from 0, that no state of the set explains, given those before it: then nothing was used.
    pub contradiction: Option<usize>,
    /// Updated, missing, or gated where there is a contradiction.
    pub action: Action,
}

impl<T: Real, N: Dimension + Dimension<G>, G: Dimension> ZonotopeFilter<T, N, G> {
    /// A filter that starts from a box: this centre, and how far the state may be from it.
    ///
    /// Errors: [`Error::NotFinite`]; [`Error::Negative`]; [`Error::OutOfRange`] if `generators` is not at least
    /// 2 n + 1; [`Error::Length`] (only with `Dyn`).
    pub fn new(centre: OVector<T, N>, reaches: &OVector<T, N>, generators: G) -> Result<Self, Error> {
        let (size, n) = (centre.shape_generic().0, centre.len());
        check_entries("centre", centre.as_slice(), n)?;
        check_bound("reaches", reaches.as_slice(), n)?;
        if generators.value() < 2 * n + 1 {
            return Err(Error::OutOfRange { argument: "generators", range: "2 n + 1 or more" });
        }
        let generators = size.rows_by(generators, T::zero());
        let mut filter = ZonotopeFilter { centre, generators, used: 0 };
        filter.add_box(reaches.as_slice());
        Ok(filter)
    }

    /// The centre of the set, c.
    pub fn centre(&self) -> &OVector<T, N> {
        &self.centre
    }

    /// How far each state may be from the centre: Σ |g_ij|.
    pub fn reaches(&self) -> OVector<T, N> {
        let mut reaches = self.centre.shape_generic().0.vector(T::zero());
        for index in 0..self.used {
            for (reach, &entry) in reaches.as_mut_slice().iter_mut().zip(self.generator(index)) {
                *reach += entry.abs();
            }
        }
        reaches
    }

    /// How many generators it holds at most.
    pub fn capacity(&self) -> usize {
        self.generators.ncols()
    }

    /// The generators in use, one after the other, n numbers each.
    pub fn generators(&self) -> &[T] {
        self.generators.as_slice().get(..self.used * self.centre.len()).unwrap_or_default()
    }

    /// Generator `index`.
    fn generator(&self, index: usize) -> &[T] {
        column(self.generators.as_slice(), self.centre.len(), index)
    }

    /// The time update: one sample ahead, with the input u(k) and the bounds of w(k). The covariance of the transition
    /// plays no part.
    ///
    /// Errors, after which nothing has changed: [`Error::NotFinite`] if an input or a bound is NaN or infinite;
    /// [`Error::Negative`]; [`Error::Overflow`]; [`Error::Length`] (only with `Dyn`). n² multiply-adds for each
    /// generator.
    pub fn predict<U: Dimension>(
        &mut self,
        transition: &LinearTransition<T, N, U>,
        bounds: &OVector<T, N>,
        input: &OVector<T, U>,
    ) -> Result<(), Error>
    where
        N: Dimension<U>,
    {
        let (size, n) = (self.centre.shape_generic().0, self.centre.len());
        check_entries("input", input.as_slice(), transition.input_matrix().ncols())?;
        check_length("transition", n, transition.state_matrix().ncols())?;
        check_bound("bounds", bounds.as_slice(), n)?;
        let mut next = self.clone();
        next.centre = transition.next(&self.centre, input);
        for index in 0..self.used {
            let mut moved = size.vector(T::zero());
            let matrix = transition.state_matrix().as_slice();
            crate::state_space::add_product(matrix, self.generator(index), moved.as_mut_slice());
            copy(moved.as_slice(), column_mut(next.generators.as_mut_slice(), n, index));
        }
        let (mut wide, reaches) = (bounds.clone(), next.reaches());
        let share = T::EPSILON * T::from_count(4 + 2 * n);
        let each = wide.as_mut_slice().iter_mut().zip(next.centre.as_slice()).zip(reaches.as_slice());
        for ((wide, centre), &reach) in each {
            *wide += share * (centre.abs() + reach);
        }
        next.make_room(n);
        next.add_box(wide.as_slice());
        self.take(next)
    }

    /// The measurement update, with y(k), u(k) and the bounds of v(k). NaN is a missing element. The covariance of the
    /// observation plays no part.
    ///
    /// Errors, after which nothing has changed: [`Error::Infinite`] if the measurement is; [`Error::NotFinite`] if an
    /// input or a bound is NaN or infinite; [`Error::Negative`]; [`Error::Overflow`]; [`Error::Length`] (only with
    /// `Dyn`). 3 n multiply-adds for each output and generator, and the n medians of as many numbers.
    pub fn correct<M: Dimension + Dimension<U> + Dimension<N>, U: Dimension>(
        &mut self,
        observation: &LinearObservation<T, N, M, U>,
        bounds: &OVector<T, M>,
        input: &OVector<T, U>,
        measurement: &OVector<T, M>,
    ) -> Result<SetInnovation<OVector<T, M>>, Error>
    where
        N: Dimension<M>,
    {
        let n = self.centre.len();
        check_entries("input", input.as_slice(), observation.input_matrix().ncols())?;
        check_length("observation", n, observation.output_rows().nrows())?;
        let expected = crate::Observation::output(observation, &self.centre, input);
        check_bound("bounds", bounds.as_slice(), expected.len())?;
        let error = prediction_error(measurement, expected)?;
        let mut next = self.clone();
        let (mut bound, mut action, mut contradiction) = (error.clone(), Action::Missing, None);
        let outputs = error.as_slice().iter().zip(bounds.as_slice()).zip(bound.as_mut_slice());
        for (output, ((error, &noise), bound)) in outputs.enumerate() {
            let row = column(observation.output_rows().as_slice(), n, output);
            *bound = self.reach(row) + noise;
            if is_missing(error) {
                continue;
            }
            if action != Action::Gated {
                let moved = row.iter().zip(next.centre.as_slice()).zip(self.centre.as_slice());
                let moved = moved.fold(T::zero(), |sum, ((&h, &now), &before)| sum + h * (now - before));
                let fits = next.cut(row, *error - moved, noise);
                action = if fits { Action::Updated } else { Action::Gated };
                contradiction = (!fits).then_some(output);
            }
        }
        if action == Action::Updated {
            self.take(next)?;
        }
        Ok(SetInnovation { error, bound, contradiction, action })
    }

    /// Σ |h'g_j|.
    fn reach(&self, row: &[T]) -> T {
        (0..self.used).fold(T::zero(), |sum, index| sum + dot(row, self.generator(index)).abs())
    }

    /// Cuts the set by a strip |error - h'(x - c)| <= noise; false where nothing would be left.
    fn cut(&mut self, row: &[T], error: T, noise: T) -> bool {
        let n = self.centre.len();
        let reach = self.reach(row);
        // What rounding of the sums may be beside the numbers in them.
        let size = row
            .iter()
            .zip(self.centre.as_slice())
            .fold(reach + error.abs(), |sum, (&h, &c)| sum + (h * c).abs());
        let rounding = T::EPSILON * T::from_count(4 + n) * size;
        let (low, high) = ((error - noise).max(-reach) - rounding, (error + noise).min(reach) + rounding);
        if low > high {
            return false;
        }
        // A strip that holds all of the set tells nothing.
        if low <= -reach && high >= reach {
            return true;
        }
        self.make_room(1);
        let half = nalgebra::convert::<f64, T>(0.5);
        let (middle, width) = ((low + high) * half, (high - low) * half);
        let capacity = self.generators.shape_generic().1;
        let (mut along, mut ratios) = (capacity.vector(T::zero()), capacity.vector(T::zero()));
        for (index, along) in along.as_mut_slice().iter_mut().enumerate().take(self.used) {
            *along = dot(row, self.generator(index));
        }
        let along = along.as_slice().get(..self.used).unwrap_or_default();
        let mut gain = self.centre.shape_generic().0.vector(T::zero());
        for (state, gain) in gain.as_mut_slice().iter_mut().enumerate() {
            for (index, (ratio, &along)) in ratios.as_mut_slice().iter_mut().zip(along).enumerate() {
                let entry = self.generator(index).get(state).copied().unwrap_or(T::zero());
                *ratio = entry / along;
            }
            *gain = weighted_median(ratios.as_slice(), along, width);
        }
        add_multiple(self.centre.as_mut_slice(), middle, gain.as_slice());
        for index in 0..self.used {
            let generator = column_mut(self.generators.as_mut_slice(), n, index);
            let along = dot(row, generator);
            add_multiple(generator, -along, gain.as_slice());
        }
        let last = column_mut(self.generators.as_mut_slice(), n, self.used);
        last.fill(T::zero());
        add_multiple(last, width, gain.as_slice());
        self.used += 1;
        true
    }

    /// Adds a generator for each axis with a number that is not 0. There is room.
    fn add_box(&mut self, numbers: &[T]) {
        let n = self.centre.len();
        for (axis, &number) in numbers.iter().enumerate() {
            if number.is_zero() {
                continue;
            }
            let target = column_mut(self.generators.as_mut_slice(), n, self.used);
            target.fill(T::zero());
            if let Some(entry) = target.get_mut(axis) {
                *entry = number;
            }
            self.used += 1;
        }
    }

    /// Makes room for some more generators, at most n: those nearest to an axis give way to a box that
    /// holds their sum.
    fn make_room(&mut self, wanted: usize) {
        let (n, most) = (self.centre.len(), self.generators.ncols());
        if self.used + wanted <= most {
            return;
        }
        let reaches = self.reaches();
        // Of an axis itself nothing is lost.
        let lost = |generator: &[T]| {
            let each = generator.iter().zip(reaches.as_slice());
            let shares =
                each.map(|(entry, &reach)| if reach > T::zero() { entry.abs() / reach } else { T::zero() });
            let (sum, largest) =
                shares.fold((T::zero(), T::zero()), |(sum, most), share| (sum + share, share.max(most)));
            sum - largest
        };
        let mut held = self.centre.shape_generic().0.vector(T::zero());
        while self.used + wanted + n > most && self.used > 0 {
            let mut nearest = (0, T::INFINITY);
            for index in 0..self.used {
                let found = lost(self.generator(index));
                if found < nearest.1 {
                    nearest = (index, found);
                }
            }
            for (held, &entry) in held.as_mut_slice().iter_mut().zip(self.generator(nearest.0)) {
                *held += entry.abs();
            }
            let mut last = held.clone();
            copy(self.generator(self.used - 1), last.as_mut_slice());
            copy(last.as_slice(), column_mut(self.generators.as_mut_slice(), n, nearest.0));
            self.used -= 1;
        }
        let more = T::one() + T::EPSILON * T::from_count(most);
        for held in held.as_mut_slice() {
            *held *= more;
        }
        self.add_box(held.as_slice());
    }

    /// Becomes another one if all of its numbers are finite.
    fn take(&mut self, mut next: Self) -> Result<(), Error> {
        let n = next.centre.len();
        next.generators.as_mut_slice().iter_mut().skip(next.used * n).for_each(|entry| *entry = T::zero());
        let finite = next.centre.iter().chain(next.generators.iter()).all(T::is_finite);
        if !(finite && next.reaches().iter().all(T::is_finite)) {
            return Err(Error::Overflow);
        }
        *self = next;
        Ok(())
    }
}

/// The median of these ratios with the magnitudes of `weights`, and of 0 with the weight `at_zero`. Ratios whose weight
/// is 0 do not count. Each pass over them leaves out those on one side of one of them.
fn weighted_median<T: Real>(ratios: &[T], weights: &[T], at_zero: T) -> T {
    let all = || {
        let each = ratios.iter().copied().zip(weights.iter().map(|weight| weight.abs()));
        each.filter(|(ratio, _)| ratio.is_finite()).chain([(T::zero(), at_zero)])
    };
    let half = all().fold(T::zero(), |sum, (_, weight)| sum + weight) / T::from_count(2);
    let (mut low, mut high) = (-T::INFINITY, T::INFINITY);
    while let Some((pivot, _)) = all().find(|(ratio, _)| low < *ratio && *ratio < high) {
        let (below, upto) = all().fold((T::zero(), T::zero()), |(below, upto), (ratio, weight)| {
            let (less, equal) = (ratio < pivot, ratio <= pivot);
            (if less { below + weight } else { below }, if equal { upto + weight } else { upto })
        });
        if below > half {
            high = pivot;
        } else if upto < half {
            low = pivot;
        } else {
            return pivot;
        }
    }
    T::zero()
}

/// That there are so many bounds, finite and not negative.
fn check_bound<T: Real>(argument: &'static str, bounds: &[T], length: usize) -> Result<(), Error> {
    check_entries(argument, bounds, length)?;
    if bounds.iter().any(|&bound| bound < T::zero()) {
        return Err(Error::Negative { argument });
    }
    Ok(())
}

#[cfg(feature = "serde")]
mod snapshot;
#[cfg(test)]
mod tests;
