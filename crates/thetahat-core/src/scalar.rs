//! The scalar type: `f32` or `f64`.

use nalgebra::RealField;

mod sealed {
    /// What [`Real`](super::Real) promises beside its own methods.
    #[cfg(not(feature = "serde"))]
    pub trait Sealed {}
    /// What [`Real`](super::Real) promises beside its own methods.
    #[cfg(feature = "serde")]
    pub trait Sealed: serde::Serialize + serde::de::DeserializeOwned {}
    impl Sealed for f32 {}
    impl Sealed for f64 {}
}

/// A real scalar: `f32` or `f64`.
///
/// It collapses the bounds this crate needs into one name. The trait is sealed: the limits below are what the
/// promises about overflow rest on.
///
/// ```
/// use thetahat_core::Real;
///
/// fn mean<T: Real>(values: &[T]) -> T {
///     values.iter().fold(T::zero(), |sum, &value| sum + value) / T::from_count(values.len())
/// }
/// assert_eq!(mean(&[1.0_f32, 2.0, 6.0]), 3.0);
/// assert_eq!(<f32 as Real>::SQRT_EPSILON, f32::EPSILON.sqrt());
/// assert_eq!(<f64 as Real>::SQRT_EPSILON, f64::EPSILON.sqrt());
/// ```
pub trait Real: RealField + Copy + sealed::Sealed {
    /// The distance from 1 to the next larger number.
    const EPSILON: Self;
    /// Its square root, as a constant: a processor without an instruction for it takes 200 bytes of code.
    const SQRT_EPSILON: Self;
    /// The smallest positive number of full precision. Its reciprocal is finite.
    const MIN_POSITIVE: Self;
    /// Not a number: a missing sample.
    const NAN: Self;
    /// Infinity: the condition number of a singular matrix.
    const INFINITY: Self;
    /// The largest entry that [`LeastSquares`](crate::LeastSquares) takes: the largest finite number divided
    /// by 2^36, which is 5e27 in `f32` and 3e297 in `f64`.
    ///
    /// The norm of 2^64 such entries is a sixteenth of the largest finite number. So no number of rows
    /// overflows.
    const LARGEST_ENTRY: Self;

    /// The number nearest to `count`.
    fn from_count(count: usize) -> Self;

    /// e to this power, with the same bits on every machine.
    fn exponential(self) -> Self;

    /// The hyperbolic tangent, likewise.
    fn hyperbolic_tangent(self) -> Self;

    /// The sine and the cosine, likewise.
    fn sine_and_cosine(self) -> (Self, Self);
}

impl Real for f32 {
    const EPSILON: f32 = f32::EPSILON;
    const SQRT_EPSILON: f32 = 3.452_669_8e-4;
    const MIN_POSITIVE: f32 = f32::MIN_POSITIVE;
    const NAN: f32 = f32::NAN;
    const INFINITY: f32 = f32::INFINITY;
    const LARGEST_ENTRY: f32 = f32::MAX / (1_u64 << 36) as f32;

    fn from_count(count: usize) -> f32 {
        count as f32
    }

    fn exponential(self) -> f32 {
        libm::expf(self)
    }

    fn hyperbolic_tangent(self) -> f32 {
        libm::tanhf(self)
    }

    fn sine_and_cosine(self) -> (f32, f32) {
        libm::sincosf(self)
    }
}

impl Real for f64 {
    const EPSILON: f64 = f64::EPSILON;
    const SQRT_EPSILON: f64 = 1.0 / (1_u32 << 26) as f64;
    const MIN_POSITIVE: f64 = f64::MIN_POSITIVE;
    const NAN: f64 = f64::NAN;
    const INFINITY: f64 = f64::INFINITY;
    const LARGEST_ENTRY: f64 = f64::MAX / (1_u64 << 36) as f64;

    fn from_count(count: usize) -> f64 {
        count as f64
    }

    fn exponential(self) -> f64 {
        libm::exp(self)
    }

    fn hyperbolic_tangent(self) -> f64 {
        libm::tanh(self)
    }

    fn sine_and_cosine(self) -> (f64, f64) {
        libm::sincos(self)
    }
}
