//! What stored samples say of a point: the mean of those nearest to it, or a plane through them.

use super::Basis;
use crate::error::check_length;
use crate::{Error, Real};

/// Samples that are asked of a point, at most.
pub const MOST_NEIGHBOURS: usize = 64;
/// Regressors of which a plane is fitted, at most.
pub const MOST_SLOPES: usize = 32;

/// Stored samples, of which those nearest to z say what g is: their mean, or a plane through them.
///
/// ```text
/// g(z) = Σ_i w_i(z) θ_i,     w_i = 1/k + (z - z̄)'(S + ρ I)^-1 (z_i - z̄)  of the k nearest, 0 of all others
/// ```
///
/// The parameters θ are the outputs of the samples. z̄ is the mean of the nearest, S the sum of (z_i - z̄)(z_i - z̄)',
/// and ρ a hundredth of the mean of its diagonal: so that a plane is decided where neighbours lie on a line. Without
/// `planes` the second part is left out (Stone 1977; Hastie, Tibshirani and Friedman, The Elements of Statistical
/// Learning, 2nd ed. 2009, sections 13.3 and 6.1.1).
///
/// Cost: a distance to each of the samples, and with n regressors k n²/2 + n³/6 multiplications of a plane. On the
/// stack are [`MOST_NEIGHBOURS`] places and distances, and [`MOST_SLOPES`] (`MOST_SLOPES` + 5)/2 numbers: some 4 kB in
/// `f32`.
///
/// ```
/// use thetahat_core::{Basis, Neighbours};
///
/// let basis = Neighbours { regressors: 1, points: &[0.0, 1.0, 2.0, 3.0], count: 2, planes: false };
/// assert_eq!(basis.value(&[10.0, 20.0, 30.0, 40.0], &[1.9]), 25.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neighbours<'a, T> {
    /// The number of regressors.
    pub regressors: usize,
    /// The samples, point after point.
    pub points: &'a [T],
    /// How many are asked.
    pub count: usize,
    /// Whether they give a plane: else their mean.
    pub planes: bool,
}

/// The places of the nearest, in rising order, and what is known of a plane through them. It is large: it is filled
/// where it stands.
struct Around<T> {
    places: [usize; MOST_NEIGHBOURS],
    count: usize,
    /// z̄.
    mean: [T; MOST_SLOPES],
    /// The Cholesky factor of S + ρ I, row by row; only where there is a plane.
    factor: [T; MOST_SLOPES * (MOST_SLOPES + 1) / 2],
    has_plane: bool,
}

impl<T: Real> Around<T> {
    fn nothing() -> Self {
        Around {
            places: [usize::MAX; MOST_NEIGHBOURS],
            count: 0,
            mean: [T::zero(); MOST_SLOPES],
            factor: [T::zero(); MOST_SLOPES * (MOST_SLOPES + 1) / 2],
            has_plane: false,
        }
    }

    fn places(&self) -> impl Iterator<Item = usize> {
        self.places.iter().copied().take(self.count)
    }
}

/// Where a row of a triangle begins.
fn start(row: usize) -> usize {
    row * (row + 1) / 2
}

/// A row of a lower triangle, with the diagonal last. Every access is total: with indexing, panics stay in the
/// firmware.
fn row<T>(triangle: &[T], index: usize) -> &[T] {
    triangle.get(start(index)..start(index + 1)).unwrap_or_default()
}

/// The sum of products.
fn product<T: Real>(one: &[T], other: &[T]) -> T {
    one.iter().zip(other).fold(T::zero(), |sum, (&one, &other)| sum + one * other)
}

/// A point from the mean.
fn from_mean<T: Real>(point: &[T], mean: &[T]) -> [T; MOST_SLOPES] {
    let mut away = [T::zero(); MOST_SLOPES];
    away.iter_mut().zip(point).zip(mean).for_each(|((away, &z), &mean)| *away = z - mean);
    away
}

/// Puts a value before the first one that it precedes; the last one falls out.
fn insert<'l, V: 'l>(list: impl Iterator<Item = &'l mut V>, mut value: V, precedes: impl Fn(&V, &V) -> bool) {
    let mut found = false;
    for own in list {
        found = found || precedes(&value, own);
        if found {
            core::mem::swap(own, &mut value);
        }
    }
}

impl<T: Real> Neighbours<'_, T> {
    fn point(&self, place: usize) -> &[T] {
        let first = place.saturating_mul(self.regressors);
        self.points.get(first..first.saturating_add(self.regressors)).unwrap_or_default()
    }

    /// Finds the nearest. Of points at the same distance the one that is stored first is nearer.
    fn look_around(&self, z: &[T], around: &mut Around<T>) {
        let wanted = self.count.clamp(1, MOST_NEIGHBOURS);
        let mut found = [(T::INFINITY, usize::MAX); MOST_NEIGHBOURS];
        for (place, point) in self.points.chunks_exact(self.regressors.max(1)).enumerate() {
            let limit = found.get(wanted - 1).map_or(T::INFINITY, |(square, _)| *square);
            let mut square = T::zero();
            for (&z, &point) in z.iter().zip(point) {
                square += (z - point) * (z - point);
                if square >= limit {
                    break;
                }
            }
            // One that is not a number is near to nothing.
            if square < limit {
                insert(found.iter_mut().take(wanted), (square, place), |one, other| one.0 < other.0);
            }
        }
        for (_, place) in found.into_iter().take_while(|(square, _)| *square < T::INFINITY) {
            around.count += 1;
            insert(around.places.iter_mut().take(around.count), place, |one, other| one < other);
        }
        if self.planes && around.count > 0 && self.regressors <= MOST_SLOPES {
            around.has_plane = self.plane(around).is_some();
        }
    }

    /// Finds the mean of the nearest, and the factor of S + ρ I; none where all of them are at one point.
    fn plane(&self, around: &mut Around<T>) -> Option<()> {
        let Around { places, count, mean, factor, .. } = around;
        let regressors = self.regressors;
        let (places, share) = (|| places.iter().take(*count), T::one() / T::from_count(*count));
        for &place in places() {
            mean.iter_mut().zip(self.point(place)).for_each(|(mean, &z)| *mean += share * z);
        }
        for &place in places() {
            let away = from_mean(self.point(place), mean);
            for (i, &own) in away.iter().take(regressors).enumerate() {
                let sums = factor.get_mut(start(i)..start(i + 1))?;
                sums.iter_mut().zip(&away).for_each(|(sum, &other)| *sum += own * other);
            }
        }
        let diagonal = (0..regressors).filter_map(|i| row(factor, i).last());
        let trace = diagonal.fold(T::zero(), |sum, &own| sum + own);
        // Squares that are lost in rounding, or no numbers, say nothing of a plane.
        if !(trace >= T::MIN_POSITIVE * T::from_count(100 * regressors) && trace.is_finite()) {
            return None;
        }
        let ridge = trace / T::from_count(100 * regressors);
        for i in 0..regressors {
            let (above, below) = factor.split_at_mut_checked(start(i))?;
            let own = below.get_mut(..=i)?;
            for k in 0..i {
                let (pivot, before) = row(above, k).split_last()?;
                let explained = product(own, before);
                let entry = own.get_mut(k)?;
                *entry = (*entry - explained) / *pivot;
            }
            let (pivot, before) = own.split_last_mut()?;
            *pivot = (*pivot + ridge - product(before, before)).sqrt();
        }
        Some(())
    }

    /// (S + ρ I)^-1 times a vector, in its place.
    fn solve(&self, factor: &[T], vector: &mut [T]) {
        for i in 0..self.regressors {
            let (known, rest) = vector.split_at_mut_checked(i).unwrap_or_default();
            if let (Some(own), Some((&pivot, before))) = (rest.first_mut(), row(factor, i).split_last()) {
                *own = (*own - product(before, known)) / pivot;
            }
        }
        for i in (0..self.regressors).rev() {
            let (rest, known) = vector.split_at_mut_checked(i + 1).unwrap_or_default();
            let column = (i + 1..self.regressors).filter_map(|k| row(factor, k).get(i));
            let explained = column.zip(known).fold(T::zero(), |sum, (&entry, known)| sum + entry * *known);
            if let (Some(own), Some(&pivot)) = (rest.last_mut(), row(factor, i).last()) {
                *own = (*own - explained) / pivot;
            }
        }
    }

    /// Calls `take` with the place and the weight of each of the nearest, in rising order.
    fn weights(&self, z: &[T], mut take: impl FnMut(usize, T)) {
        let mut around = Around::nothing();
        self.look_around(z, &mut around);
        let share = T::one() / T::from_count(around.count);
        let mut away = [T::zero(); MOST_SLOPES];
        if around.has_plane {
            away = from_mean(z, &around.mean);
            self.solve(&around.factor, &mut away);
        }
        for place in around.places() {
            let own = self.point(place).iter().zip(&around.mean).zip(&away);
            let more = own.map(|((&z, &mean), &away)| (z - mean) * away);
            take(place, more.fold(share, |sum, more| sum + more));
        }
    }
}

impl<T: Real> Basis<T> for Neighbours<'_, T> {
    fn functions(&self) -> usize {
        self.points.len() / self.regressors.max(1)
    }

    fn check(&self, regressors: usize) -> Result<(), Error> {
        check_length("regressors", regressors, self.regressors)?;
        let samples = Basis::<T>::functions(self);
        check_length("points", samples * regressors, self.points.len())?;
        if self.count == 0 || self.count > MOST_NEIGHBOURS || self.count > samples {
            return Err(Error::OutOfRange {
                argument: "count",
                range: "from 1 to 64, and not above the number of samples",
            });
        }
        if self.planes && regressors > MOST_SLOPES {
            return Err(Error::Length { argument: "regressors", expected: MOST_SLOPES, found: regressors });
        }
        Ok(())
    }

    fn each(&self, z: &[T], mut take: impl FnMut(usize, T)) {
        let mut next = 0;
        self.weights(z, |place, weight| {
            (next..place).for_each(|other| take(other, T::zero()));
            take(place, weight);
            next = place + 1;
        });
        // Where no sample is near, as of what is not a number, nothing is known.
        let rest = if next == 0 { T::NAN } else { T::zero() };
        (next..Basis::<T>::functions(self)).for_each(|other| take(other, rest));
    }

    fn value(&self, parameters: &[T], z: &[T]) -> T {
        let mut sum = None;
        self.weights(z, |place, weight| {
            let own = parameters.get(place).map_or(T::NAN, |&parameter| weight * parameter);
            sum = Some(sum.map_or(own, |sum: T| sum + own));
        });
        sum.unwrap_or(T::NAN)
    }

    /// Those of the plane: which samples are nearest is taken as it is.
    fn add_slopes(&self, parameters: &[T], z: &[T], slopes: &mut [T]) {
        let mut around = Around::nothing();
        self.look_around(z, &mut around);
        if !around.has_plane {
            return;
        }
        let mut plane = [T::zero(); MOST_SLOPES];
        for place in around.places() {
            let output = parameters.get(place).copied().unwrap_or(T::NAN);
            for ((plane, &z), &mean) in plane.iter_mut().zip(self.point(place)).zip(&around.mean) {
                *plane += output * (z - mean);
            }
        }
        self.solve(&around.factor, &mut plane);
        slopes.iter_mut().zip(plane).for_each(|(slope, own)| *slope += own);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_nearest_are_found_and_ties_go_to_the_first() {
        let (points, outputs) = ([0.0, 1.0, 2.0, 3.0, 2.0], [10.0, 20.0, 30.0, 40.0, 50.0]);
        let ask = |count| Neighbours { regressors: 1, points: &points, count, planes: false };
        assert_eq!(ask(1).value(&outputs, &[2.1]), 30.0);
        assert_eq!(ask(2).value(&outputs, &[0.4]), 15.0);
        assert!((ask(5).value(&outputs, &[0.4]) - 30.0_f64).abs() < 1e-14);
        assert!(ask(1).value(&outputs, &[f64::NAN]).is_nan());
        assert!(ask(0).check(1).is_err() && ask(6).check(1).is_err());
        let mut weights = [0.0; 5];
        ask(2).evaluate(&[2.1], &mut weights);
        assert_eq!(weights, [0.0, 0.0, 0.5, 0.0, 0.5]);
    }

    #[test]
    fn planes_are_those_of_ridge_regression() {
        // On a plane, up to what the ridge takes: a hundredth of the mean square.
        let mut points = [0.0; 100];
        let mut outputs = [0.0; 50];
        for (k, (point, output)) in points.chunks_mut(2).zip(&mut outputs).enumerate() {
            point.copy_from_slice(&[(k % 7) as f64 - 3.0, (k % 5) as f64 - 2.0]);
            *output = 1.0 + 2.0 * point[0] - 3.0 * point[1];
        }
        let all = Neighbours { regressors: 2, points: &points, count: 50, planes: true };
        let z = [0.5, -0.5];
        let value = all.value(&outputs, &z);
        let mut slopes = [0.0; 2];
        all.add_slopes(&outputs, &z, &mut slopes);
        assert!(
            (value - 3.5).abs() < 0.05 && (slopes[0] - 2.0).abs() < 0.03 && (slopes[1] + 3.0).abs() < 0.06
        );
        let mut weights = [0.0; 50];
        all.evaluate(&z, &mut weights);
        let sum: f64 = weights.iter().zip(&outputs).map(|(weight, output)| weight * output).sum();
        assert!((sum - value).abs() < 1e-13 && (weights.iter().sum::<f64>() - 1.0).abs() < 1e-13);
        let one = Neighbours { count: 1, ..all };
        assert_eq!(one.value(&outputs, &[-2.9, -2.0]), 1.0);
    }
}
