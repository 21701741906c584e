//! Local models: each has a say where its box of the regressors is.

use super::Basis;
use crate::error::check_length;
use crate::{Error, Real};

/// How the weight of a local model depends on where a point lies.
///
/// ```
/// use thetahat_core::{Basis, Local, Membership};
///
/// // Two constants, left and right of 0: how far one goes over into the other.
/// let (sides, domain) = ([[-1.0, 0.0], [0.0, 1.0]], [[-1.0, 1.0]]);
/// let at = |membership| {
///     let basis = Local { membership, planes: false, sides: &sides, domain: &domain };
///     basis.value(&[0.0, 1.0], &[0.125])
/// };
/// assert_eq!((at(Membership::Rectangle), at(Membership::Trapezoid)), (1.0, 0.75));
/// assert!(at(Membership::Gaussian) > 0.5 && at(Membership::Gaussian) < 1.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Membership {
    /// 1 in its box, 0 outside.
    Rectangle,
    /// The product, over the regressors, of a trapezoid: 1 in the middle half of the side of its box, and from there a
    /// line down to 0, a quarter of the side outside of it; over the sum of all.
    Trapezoid,
    /// The product of Gaussians about the middle of its box, with a third of each side for their standard deviations;
    /// over the sum of all.
    Gaussian,
}

/// Local models, planes or constants, each weighted by the membership of z in its box:
///
/// ```text
/// g(z) = Σ_i w_i(z) (θ_i0 + θ_i1 z_1 + …),     w_i = m_i(z) / Σ_l m_l(z)
/// ```
///
/// Boxes divide the domain, as those of the tree of LOLIMOT do (Nelles and Isermann 1996; Nelles, Nonlinear System
/// Identification, 2001, section 13.3). Outside of the domain weights are those of its nearest point: so the outer
/// planes reach without end, and none that is wide wins far away (section 13.2.3 there).
///
/// Cost: twice the memberships of all boxes, with an exponential for each of a Gaussian.
///
/// ```
/// use thetahat_core::{Basis, Local, Membership};
///
/// // |z|: two planes, left and right of 0.
/// let sides = [[-1.0, 0.0], [0.0, 1.0]];
/// let basis = Local { membership: Membership::Rectangle, planes: true, sides: &sides, domain: &[[-1.0, 1.0]] };
/// assert_eq!(basis.value(&[0.0, -1.0, 0.0, 1.0], &[-0.3]), 0.3);
/// assert_eq!(basis.value(&[0.0, -1.0, 0.0, 1.0], &[5.0]), 5.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Local<'a, T> {
    /// What makes weights of boxes.
    pub membership: Membership,
    /// Whether each local model is a plane: else it is a constant.
    pub planes: bool,
    /// The boxes one after the other: for each regressor where its side begins and ends.
    pub sides: &'a [[T; 2]],
    /// For each regressor its range, which the boxes divide.
    pub domain: &'a [[T; 2]],
}

impl<'a, T: Real> Local<'a, T> {
    fn boxes(&self) -> impl Iterator<Item = &'a [[T; 2]]> {
        self.sides.chunks_exact(self.domain.len().max(1))
    }

    /// Functions of each box.
    fn each_box(&self) -> usize {
        if self.planes { self.domain.len() + 1 } else { 1 }
    }

    /// m_i(z) of a box, before it is divided by the sum of all.
    pub fn member(&self, own: &[[T; 2]], z: &[T]) -> T {
        let mut each = own.iter().zip(z).zip(self.domain);
        match self.membership {
            Membership::Rectangle => {
                let inside = |((side, &z), domain): ((&[T; 2], &T), &[T; 2])| {
                    let z = nearest(z, *domain);
                    z >= side[0] && (z < side[1] || side[1] == domain[1])
                };
                if each.all(inside) { T::one() } else { T::zero() }
            }
            Membership::Trapezoid => {
                let height = |((side, &z), domain): ((&[T; 2], &T), &[T; 2])| trapezoid(*side, *domain, z).0;
                each.map(height).fold(T::one(), |product, height| product * height)
            }
            Membership::Gaussian => {
                let square = |((side, &z), domain): ((&[T; 2], &T), &[T; 2])| {
                    let from = (nearest(z, *domain) - middle(*side)) / deviation(*side);
                    from * from
                };
                (-half::<T>() * each.map(square).fold(T::zero(), |sum, square| sum + square)).exponential()
            }
        }
    }

    /// 1 over the sum of all memberships. Where no box is, it is no number.
    fn share(&self, z: &[T]) -> T {
        let total = self.boxes().map(|own| self.member(own, z)).fold(T::zero(), |sum, member| sum + member);
        if total > T::zero() { T::one() / total } else { T::NAN }
    }

    /// The slope of the logarithm of a membership along a regressor.
    fn logarithmic_slope(&self, own: &[[T; 2]], z: T, regressor: usize) -> T {
        let (Some(&side), Some(&domain)) = (own.get(regressor), self.domain.get(regressor)) else {
            return T::zero();
        };
        if z < domain[0] || z > domain[1] {
            return T::zero();
        }
        match self.membership {
            Membership::Rectangle => T::zero(),
            Membership::Trapezoid => {
                let (value, slope) = trapezoid(side, domain, z);
                if value > T::zero() { slope / value } else { T::zero() }
            }
            Membership::Gaussian => (middle(side) - z) / (deviation(side) * deviation(side)),
        }
    }

    /// θ_i0 + θ_i1 z_1 + …
    fn plane(&self, parameters: &[T], z: &[T]) -> T {
        let (level, slopes) =
            parameters.split_first().map_or((T::NAN, parameters), |(level, rest)| (*level, rest));
        slopes.iter().zip(z).fold(level, |sum, (&slope, &z)| sum + slope * z)
    }
}

impl<T: Real> Basis<T> for Local<'_, T> {
    fn functions(&self) -> usize {
        self.boxes().count() * self.each_box()
    }

    fn check(&self, regressors: usize) -> Result<(), Error> {
        check_length("domain", regressors, self.domain.len())?;
        check_length("sides", self.boxes().count() * regressors, self.sides.len())?;
        let rising = |[low, high]: &[T; 2]| low.is_finite() && low < high && high.is_finite();
        for (argument, each) in [("domain", self.domain), ("sides", self.sides)] {
            if !each.iter().all(rising) {
                return Err(Error::OutOfRange { argument, range: "two rising numbers each" });
            }
        }
        Ok(())
    }

    fn each(&self, z: &[T], mut take: impl FnMut(usize, T)) {
        let share = self.share(z);
        let mut place = 0;
        for own in self.boxes() {
            let weight = self.member(own, z) * share;
            take(place, weight);
            place += 1;
            if self.planes {
                for &z in z {
                    take(place, weight * z);
                    place += 1;
                }
            }
        }
    }

    fn add_slopes(&self, parameters: &[T], z: &[T], slopes: &mut [T]) {
        let share = self.share(z);
        // At least one: the compiler sees it here, and leaves no panic.
        let models = || self.boxes().zip(parameters.chunks_exact(self.each_box().max(1)));
        let value = models()
            .map(|(own, parameters)| self.member(own, z) * share * self.plane(parameters, z))
            .fold(T::zero(), |sum, value| sum + value);
        for (own, parameters) in models() {
            let weight = self.member(own, z) * share;
            if weight == T::zero() {
                continue;
            }
            // dw_i/dz = w_i (s_i - Σ_l w_l s_l) for the slopes s of the logarithms: Σ_i L_i dw_i = Σ_i w_i s_i (L_i -
            // g).
            let above = self.plane(parameters, z) - value;
            for (regressor, (slope, &z)) in slopes.iter_mut().zip(z).enumerate() {
                let own_slope = parameters.get(regressor + 1).copied().unwrap_or_else(T::zero);
                *slope += weight * (own_slope + above * self.logarithmic_slope(own, z, regressor));
            }
        }
    }
}

fn half<T: Real>() -> T {
    T::one() / T::from_count(2)
}

fn middle<T: Real>([low, high]: [T; 2]) -> T {
    half::<T>() * (low + high)
}

/// The standard deviation of a Gaussian.
fn deviation<T: Real>([low, high]: [T; 2]) -> T {
    (high - low) / T::from_count(3)
}

/// The point of a range that is nearest to z.
fn nearest<T: Real>(z: T, [low, high]: [T; 2]) -> T {
    if z < low {
        low
    } else if z > high {
        high
    } else {
        z
    }
}

/// A trapezoid and its slope; it does not fall at the ends of the domain.
fn trapezoid<T: Real>(side: [T; 2], domain: [T; 2], z: T) -> (T, T) {
    let z = nearest(z, domain);
    let quarter = (side[1] - side[0]) / T::from_count(4);
    let width = quarter + quarter;
    let (rise, fall) = ((z - side[0] + quarter) / width, (side[1] + quarter - z) / width);
    if side[0] > domain[0] && rise < T::one() {
        if rise <= T::zero() { (T::zero(), T::zero()) } else { (rise, T::one() / width) }
    } else if side[1] < domain[1] && fall < T::one() {
        if fall <= T::zero() { (T::zero(), T::zero()) } else { (fall, -T::one() / width) }
    } else {
        (T::one(), T::zero())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_not_negative_and_have_the_sum_one() {
        let sides = [[0.0, 1.0], [0.0, 2.0], [1.0, 2.0], [0.0, 1.0], [1.0, 2.0], [1.0, 2.0]];
        let domain = [[0.0, 2.0]; 2];
        for membership in [Membership::Rectangle, Membership::Trapezoid, Membership::Gaussian] {
            let local = Local { membership, planes: false, sides: &sides, domain: &domain };
            assert_eq!(local.check(2), Ok(()));
            for i in -10..=30 {
                for k in -10..=30 {
                    let (mut sum, mut largest) = (0.0, 0.0_f64);
                    local.each(&[f64::from(i) * 0.1, f64::from(k) * 0.1], |_, weight| {
                        assert!((0.0..=1.0).contains(&weight));
                        sum += weight;
                        largest = largest.max(weight);
                    });
                    assert!((sum - 1.0_f64).abs() < 1e-14, "{membership:?} {i} {k}: {sum}");
                    assert!(membership != Membership::Rectangle || largest == 1.0);
                }
            }
            let (mut far, mut near) = ([0.0; 3], [0.0; 3]);
            local.evaluate(&[1e6, 0.5], &mut far);
            local.evaluate(&[2.0, 0.5], &mut near);
            assert_eq!(far, near, "outside of the domain weights are those of its edge");
        }
    }

    #[test]
    fn parts_that_do_not_fit_are_told() {
        let local = |sides, domain| Local { membership: Membership::Gaussian, planes: true, sides, domain };
        assert!(local(&[[0.0, 1.0]; 3], &[[0.0, 1.0]; 2]).check(2).is_err());
        assert!(local(&[[0.0, 1.0]; 2], &[[0.0, 1.0]; 2]).check(1).is_err());
        assert!(local(&[[0.0, 1.0], [1.0, 1.0]], &[[0.0, 1.0]; 2]).check(2).is_err());
        assert!(local(&[[0.0, f64::INFINITY]], &[[0.0, 1.0]]).check(1).is_err());
    }
}
