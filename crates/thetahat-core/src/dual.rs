//! Dual numbers: a value and its derivatives, computed together.

use core::cmp::Ordering;
use core::ops::{Add, AddAssign, Div, DivAssign, Mul, MulAssign, Neg, Sub, SubAssign};

use crate::Real;

/// A number that a function can be computed with: a scalar `T`, or a [`Dual`] of it.
///
/// A model that is written once for any `Number<T>` can be evaluated, and differentiated exactly. Constants of
/// type `T` stand on the right: `x * 2.0`, `x - 1.0`; where only a number will do, `S::from(2.0)` makes one.
///
/// ```
/// use thetahat_core::{Dual, Number};
///
/// fn range<S: Number<f64>>([x, y]: [S; 2]) -> S {
///     (x * x + y * y).sqrt()
/// }
/// assert_eq!(range([6.0, 8.0]), 10.0);
/// let [by_x, by_y] = range(Dual::variables([6.0, 8.0])).derivatives;
/// assert!((by_x - 0.6).abs() < 1e-15 && (by_y - 0.8).abs() < 1e-15);
/// ```
pub trait Number<T: Real>:
    Copy
    + PartialOrd
    + From<T>
    + Neg<Output = Self>
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Add<T, Output = Self>
    + Sub<T, Output = Self>
    + Mul<T, Output = Self>
    + Div<T, Output = Self>
    + AddAssign
    + SubAssign
    + MulAssign
    + DivAssign
{
    /// The value, without derivatives: to decide by, or to look up in a table.
    fn value(self) -> T;
    /// The derivatives: none of a plain number.
    fn derivatives(&self) -> &[T];
    /// √x.
    fn sqrt(self) -> Self;
    /// eˣ.
    fn exp(self) -> Self;
    /// The natural logarithm.
    fn ln(self) -> Self;
    /// xⁿ.
    fn powi(self, exponent: i32) -> Self;
    /// xᵃ.
    fn powf(self, exponent: T) -> Self;
    /// The sine and the cosine of an angle in rad. One call costs less than two: on a microcontroller they may be
    /// most of a step.
    fn sin_cos(self) -> (Self, Self);
    /// The sine of an angle in rad.
    fn sin(self) -> Self;
    /// The cosine of an angle in rad.
    fn cos(self) -> Self;
    /// The tangent of an angle in rad.
    fn tan(self) -> Self;
    /// The angle in rad, -π/2 … π/2, with this sine.
    fn asin(self) -> Self;
    /// The angle in rad, 0 … π, with this cosine.
    fn acos(self) -> Self;
    /// The angle in rad, -π/2 … π/2, with this tangent.
    fn atan(self) -> Self;
    /// The angle in rad, -π … π, of the point at (`x`, `self`).
    fn atan2(self, x: Self) -> Self;
    /// The hyperbolic sine.
    fn sinh(self) -> Self;
    /// The hyperbolic cosine.
    fn cosh(self) -> Self;
    /// The hyperbolic tangent.
    fn tanh(self) -> Self;
    /// |x|. Its derivative at 0 is that on the side of the zero's sign.
    fn abs(self) -> Self;
}

impl<T: Real> Number<T> for T {
    fn value(self) -> T {
        self
    }
    fn derivatives(&self) -> &[T] {
        &[]
    }
    fn sqrt(self) -> T {
        nalgebra::ComplexField::sqrt(self)
    }
    fn exp(self) -> T {
        nalgebra::ComplexField::exp(self)
    }
    fn ln(self) -> T {
        nalgebra::ComplexField::ln(self)
    }
    fn powi(self, exponent: i32) -> T {
        nalgebra::ComplexField::powi(self, exponent)
    }
    fn powf(self, exponent: T) -> T {
        nalgebra::ComplexField::powf(self, exponent)
    }
    fn sin_cos(self) -> (T, T) {
        nalgebra::ComplexField::sin_cos(self)
    }
    fn sin(self) -> T {
        nalgebra::ComplexField::sin(self)
    }
    fn cos(self) -> T {
        nalgebra::ComplexField::cos(self)
    }
    fn tan(self) -> T {
        nalgebra::ComplexField::tan(self)
    }
    fn asin(self) -> T {
        nalgebra::ComplexField::asin(self)
    }
    fn acos(self) -> T {
        nalgebra::ComplexField::acos(self)
    }
    fn atan(self) -> T {
        nalgebra::ComplexField::atan(self)
    }
    fn atan2(self, x: T) -> T {
        nalgebra::RealField::atan2(self, x)
    }
    fn sinh(self) -> T {
        nalgebra::ComplexField::sinh(self)
    }
    fn cosh(self) -> T {
        nalgebra::ComplexField::cosh(self)
    }
    fn tanh(self) -> T {
        nalgebra::ComplexField::tanh(self)
    }
    fn abs(self) -> T {
        nalgebra::ComplexField::abs(self)
    }
}

/// A value and its derivatives with respect to D variables: a dual number.
///
/// ```text
/// (a, a') + (b, b') = (a + b, a' + b'),     (a, a') (b, b') = (a b, a' b + a b'),     f(a, a') = (f(a), f'(a) a')
/// ```
///
/// What is computed with such numbers gets its derivatives with it, exact but for rounding: nothing is
/// approximated by differences, and nothing derived by hand. Comparisons look at values only, so that a function
/// branches as it does for plain numbers. Where a function has no finite derivative (√x at 0), what does not
/// depend on a variable still has the derivative 0 with respect to it.
///
/// Memory: D + 1 numbers. A product takes 2 D + 1 multiplications, a function D beside itself and its derivative.
///
/// Source: Wengert, A simple automatic derivative evaluation program, 1964; Griewank and Walther, Evaluating
/// Derivatives, 2nd ed., 2008, section 3.1 (the forward mode).
///
/// ```
/// use thetahat_core::{Dual, Number};
///
/// // d/dx (x² sin x) = 2 x sin x + x² cos x
/// let [x] = Dual::variables([2.0_f64]);
/// let y = x * x * x.sin();
/// assert!((y.derivatives[0] - (4.0 * 2.0_f64.sin() + 4.0 * 2.0_f64.cos())).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Dual<T, const D: usize> {
    /// The value.
    pub value: T,
    /// The derivatives with respect to each variable.
    pub derivatives: [T; D],
}

impl<T: Real, const D: usize> Dual<T, D> {
    /// The variables themselves: each has the derivative 1 with respect to itself, and 0 else.
    pub fn variables(values: [T; D]) -> [Self; D] {
        let mut index = 0;
        values.map(|value| {
            let mut derivatives = [T::zero(); D];
            if let Some(own) = derivatives.get_mut(index) {
                *own = T::one();
            }
            index += 1;
            Dual { value, derivatives }
        })
    }

    /// Of a function with this value and slope at the number: f(a, a') = (f(a), f'(a) a').
    #[inline]
    fn chain(self, value: T, slope: T) -> Self {
        Dual { value, derivatives: self.derivatives.map(|derivative| scaled(slope, derivative)) }
    }

    /// With this value, and a times the derivatives here plus b times those there.
    #[inline]
    fn combine(mut self, value: T, a: T, other: &Self, b: T) -> Self {
        for (mine, &others) in self.derivatives.iter_mut().zip(&other.derivatives) {
            *mine = scaled(a, *mine) + scaled(b, others);
        }
        Dual { value, ..self }
    }
}

/// A slope times a derivative: 0 if that is 0, even if the slope is not finite.
#[inline(always)]
fn scaled<T: Real>(slope: T, derivative: T) -> T {
    if derivative.is_zero() { derivative } else { slope * derivative }
}

impl<T: Real, const D: usize> From<T> for Dual<T, D> {
    /// A constant: its derivatives are 0.
    fn from(value: T) -> Self {
        Dual { value, derivatives: [T::zero(); D] }
    }
}

/// Of the values.
impl<T: PartialEq, const D: usize> PartialEq for Dual<T, D> {
    fn eq(&self, other: &Self) -> bool {
        self.value == other.value
    }
}

/// Of the values.
impl<T: PartialOrd, const D: usize> PartialOrd for Dual<T, D> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        self.value.partial_cmp(&other.value)
    }
}

impl<T: Real, const D: usize> Neg for Dual<T, D> {
    type Output = Self;
    fn neg(self) -> Self {
        Dual { value: -self.value, derivatives: self.derivatives.map(|derivative| -derivative) }
    }
}

impl<T: Real, const D: usize> Add for Dual<T, D> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        self.combine(self.value + other.value, T::one(), &other, T::one())
    }
}

impl<T: Real, const D: usize> Sub for Dual<T, D> {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        self.combine(self.value - other.value, T::one(), &other, -T::one())
    }
}

impl<T: Real, const D: usize> Mul for Dual<T, D> {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        self.combine(self.value * other.value, other.value, &other, self.value)
    }
}

impl<T: Real, const D: usize> Div for Dual<T, D> {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        let (quotient, inverse) = (self.value / other.value, T::one() / other.value);
        self.combine(quotient, inverse, &other, -(quotient * inverse))
    }
}

impl<T: Real, const D: usize> Add<T> for Dual<T, D> {
    type Output = Self;
    fn add(self, other: T) -> Self {
        Dual { value: self.value + other, ..self }
    }
}

impl<T: Real, const D: usize> Sub<T> for Dual<T, D> {
    type Output = Self;
    fn sub(self, other: T) -> Self {
        Dual { value: self.value - other, ..self }
    }
}

impl<T: Real, const D: usize> Mul<T> for Dual<T, D> {
    type Output = Self;
    fn mul(self, other: T) -> Self {
        self.chain(self.value * other, other)
    }
}

impl<T: Real, const D: usize> Div<T> for Dual<T, D> {
    type Output = Self;
    fn div(self, other: T) -> Self {
        let divided = |derivative: T| if derivative.is_zero() { derivative } else { derivative / other };
        Dual { value: self.value / other, derivatives: self.derivatives.map(divided) }
    }
}

impl<T: Real, const D: usize> AddAssign for Dual<T, D> {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl<T: Real, const D: usize> SubAssign for Dual<T, D> {
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl<T: Real, const D: usize> MulAssign for Dual<T, D> {
    fn mul_assign(&mut self, other: Self) {
        *self = *self * other;
    }
}

impl<T: Real, const D: usize> DivAssign for Dual<T, D> {
    fn div_assign(&mut self, other: Self) {
        *self = *self / other;
    }
}

impl<T: Real, const D: usize> Number<T> for Dual<T, D> {
    fn value(self) -> T {
        self.value
    }
    fn derivatives(&self) -> &[T] {
        &self.derivatives
    }
    fn sqrt(self) -> Self {
        let root = Number::sqrt(self.value);
        self.chain(root, T::one() / (root + root))
    }
    fn exp(self) -> Self {
        let power = Number::exp(self.value);
        self.chain(power, power)
    }
    fn ln(self) -> Self {
        self.chain(Number::ln(self.value), T::one() / self.value)
    }
    fn powi(self, exponent: i32) -> Self {
        if exponent == 0 {
            return T::one().into();
        }
        let slope = Number::powi(self.value, exponent.saturating_sub(1));
        self.chain(Number::powi(self.value, exponent), slope * nalgebra::convert(f64::from(exponent)))
    }
    fn powf(self, exponent: T) -> Self {
        if exponent.is_zero() {
            return T::one().into();
        }
        let slope = Number::powf(self.value, exponent - T::one());
        self.chain(Number::powf(self.value, exponent), slope * exponent)
    }
    fn sin_cos(self) -> (Self, Self) {
        let (sine, cosine) = Number::sin_cos(self.value);
        (self.chain(sine, cosine), self.chain(cosine, -sine))
    }
    fn sin(self) -> Self {
        let (sine, cosine) = Number::sin_cos(self.value);
        self.chain(sine, cosine)
    }
    fn cos(self) -> Self {
        let (sine, cosine) = Number::sin_cos(self.value);
        self.chain(cosine, -sine)
    }
    fn tan(self) -> Self {
        let tangent = Number::tan(self.value);
        self.chain(tangent, T::one() + tangent * tangent)
    }
    fn asin(self) -> Self {
        let cosine = Number::sqrt((T::one() - self.value) * (T::one() + self.value));
        self.chain(Number::asin(self.value), T::one() / cosine)
    }
    fn acos(self) -> Self {
        let sine = Number::sqrt((T::one() - self.value) * (T::one() + self.value));
        self.chain(Number::acos(self.value), -T::one() / sine)
    }
    fn atan(self) -> Self {
        self.chain(Number::atan(self.value), T::one() / (T::one() + self.value * self.value))
    }
    fn atan2(self, x: Self) -> Self {
        // Only ratios are squared, so that nothing overflows or vanishes.
        let largest = Number::abs(self.value).max(Number::abs(x.value));
        let (sine, cosine) = (self.value / largest, x.value / largest);
        let squared = sine * sine + cosine * cosine;
        let (by_y, by_x) = (cosine / squared / largest, -(sine / squared / largest));
        self.combine(Number::atan2(self.value, x.value), by_y, &x, by_x)
    }
    fn sinh(self) -> Self {
        self.chain(Number::sinh(self.value), Number::cosh(self.value))
    }
    fn cosh(self) -> Self {
        self.chain(Number::cosh(self.value), Number::sinh(self.value))
    }
    fn tanh(self) -> Self {
        // 1/cosh²: where the tangent rounds to 1, 1 - tanh² is 0, which the slope is not.
        let cosine = Number::cosh(self.value);
        self.chain(Number::tanh(self.value), T::one() / (cosine * cosine))
    }
    fn abs(self) -> Self {
        self.chain(Number::abs(self.value), T::one().copysign(self.value))
    }
}

#[cfg(test)]
mod tests;
