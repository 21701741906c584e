//! Sizes: in the type, or known only at run time.

#[cfg(feature = "alloc")]
use alloc::vec;
#[cfg(feature = "alloc")]
use alloc::vec::Vec;
use core::fmt::Debug;

use nalgebra::allocator::Allocator;
use nalgebra::{ArrayStorage, Const, DefaultAllocator, Dim, OMatrix, OVector, Scalar};
#[cfg(feature = "alloc")]
use nalgebra::{Dyn, U1};

use crate::{Real, ud};

/// What a size does differently when it is a type and when it is a value.
///
/// The trait is public because [`Dimension`] names it, and out of reach because its module is private: that
/// seals `Dimension`.
pub trait Workspace: Dim {
    /// What `with_scratch` keeps between calls: nothing for a static size, a buffer for a run-time size.
    type Scratch<T: Real>: Clone + Debug + Default;
    /// The size, if it is in the type.
    const SIZE: Option<usize>;

    /// The dimension of exactly `size`, or the only size this type has.
    fn exactly(size: usize) -> Result<Self, usize>;
    /// The smallest dimension of at least `size`, or the only size this type has.
    fn at_least(size: usize) -> Result<Self, usize>;
    /// A vector filled with `value`.
    ///
    /// (nalgebra's own constructors count the elements of an iterator and panic if they are too few.)
    fn vector<V: Scalar + Copy>(self, value: V) -> OVector<V, Self>
    where
        DefaultAllocator: Allocator<Self>;
    /// A square matrix filled with `value`.
    fn square<V: Scalar + Copy>(self, value: V) -> OMatrix<V, Self, Self>
    where
        DefaultAllocator: Allocator<Self, Self>;
    /// What this size keeps for [`with_scratch`](Workspace::with_scratch) of `V` vectors and `S` square
    /// matrices.
    fn scratch<T: Real, const V: usize, const S: usize>(self) -> Self::Scratch<T>;
    /// Calls `work` with `V` vectors and `S` square matrices of this size, of any content: on the stack, or
    /// from `kept`. What is too short, as after reading a snapshot, grows first.
    fn with_scratch<T: Real, const V: usize, const S: usize, A>(
        self,
        kept: &mut Self::Scratch<T>,
        work: impl FnOnce([&mut [T]; V], [&mut [T]; S]) -> A,
    ) -> A
    where
        for<'a> [&'a mut [T]; V]: Parts<'a, T>,
        for<'a> [&'a mut [T]; S]: Parts<'a, T>;
}

/// The first parts of a buffer, all of one length. (A loop in their place would hide the length from the compiler where
/// it optimises for size, and what copies or checks them would grow.)
pub trait Parts<'a, T>: Sized {
    /// The parts, and the rest.
    fn take(buffer: &'a mut [T], length: usize) -> (Self, &'a mut [T]);
}

impl<'a, T> Parts<'a, T> for [&'a mut [T]; 0] {
    #[inline(always)]
    fn take(buffer: &'a mut [T], _: usize) -> (Self, &'a mut [T]) {
        ([], buffer)
    }
}

impl<'a, T> Parts<'a, T> for [&'a mut [T]; 1] {
    #[inline(always)]
    fn take(buffer: &'a mut [T], length: usize) -> (Self, &'a mut [T]) {
        let (first, rest) = buffer.split_at_mut_checked(length).unwrap_or_default();
        ([first], rest)
    }
}

impl<'a, T> Parts<'a, T> for [&'a mut [T]; 2] {
    #[inline(always)]
    fn take(buffer: &'a mut [T], length: usize) -> (Self, &'a mut [T]) {
        let (first, rest) = buffer.split_at_mut_checked(length).unwrap_or_default();
        let ([second], rest) = Parts::take(rest, length);
        ([first, second], rest)
    }
}

impl<'a, T> Parts<'a, T> for [&'a mut [T]; 3] {
    #[inline(always)]
    fn take(buffer: &'a mut [T], length: usize) -> (Self, &'a mut [T]) {
        let (first, rest) = buffer.split_at_mut_checked(length).unwrap_or_default();
        let ([second, third], rest) = Parts::take(rest, length);
        ([first, second, third], rest)
    }
}

impl<'a, T> Parts<'a, T> for [&'a mut [T]; 4] {
    #[inline(always)]
    fn take(buffer: &'a mut [T], length: usize) -> (Self, &'a mut [T]) {
        let (first, rest) = buffer.split_at_mut_checked(length).unwrap_or_default();
        let ([second, third, fourth], rest) = Parts::take(rest, length);
        ([first, second, third, fourth], rest)
    }
}

impl<const N: usize> Workspace for Const<N> {
    type Scratch<T: Real> = ();
    const SIZE: Option<usize> = Some(N);

    fn exactly(size: usize) -> Result<Self, usize> {
        (size == N).then_some(Const).ok_or(N)
    }

    fn at_least(size: usize) -> Result<Self, usize> {
        (size <= N).then_some(Const).ok_or(N)
    }

    fn vector<V: Scalar + Copy>(self, value: V) -> OVector<V, Self> {
        OVector::from_data(ArrayStorage([[value; N]]))
    }

    fn square<V: Scalar + Copy>(self, value: V) -> OMatrix<V, Self, Self> {
        OMatrix::from_data(ArrayStorage([[value; N]; N]))
    }

    fn scratch<T: Real, const V: usize, const S: usize>(self) {}

    fn with_scratch<T: Real, const V: usize, const S: usize, A>(
        self,
        (): &mut (),
        work: impl FnOnce([&mut [T]; V], [&mut [T]; S]) -> A,
    ) -> A
    where
        for<'a> [&'a mut [T]; V]: Parts<'a, T>,
        for<'a> [&'a mut [T]; S]: Parts<'a, T>,
    {
        // Not 0: where it optimises for size, a compiler would call memset for it.
        let mut vectors = [[T::NAN; N]; V];
        let mut squares = [[[T::NAN; N]; N]; S];
        let (vectors, _) = Parts::take(vectors.as_flattened_mut(), N);
        let (squares, _) = Parts::take(squares.as_flattened_mut().as_flattened_mut(), N * N);
        work(vectors, squares)
    }
}

#[cfg(feature = "alloc")]
impl Workspace for Dyn {
    type Scratch<T: Real> = Vec<T>;
    const SIZE: Option<usize> = None;

    fn exactly(size: usize) -> Result<Self, usize> {
        Ok(Dyn(size))
    }

    fn at_least(size: usize) -> Result<Self, usize> {
        Ok(Dyn(size))
    }

    fn vector<V: Scalar + Copy>(self, value: V) -> OVector<V, Self> {
        OVector::from_element_generic(self, U1, value)
    }

    fn square<V: Scalar + Copy>(self, value: V) -> OMatrix<V, Self, Self> {
        OMatrix::from_element_generic(self, self, value)
    }

    fn scratch<T: Real, const V: usize, const S: usize>(self) -> Vec<T> {
        vec![T::zero(); self.value() * (V + S * self.value())]
    }

    fn with_scratch<T: Real, const V: usize, const S: usize, A>(
        self,
        kept: &mut Vec<T>,
        work: impl FnOnce([&mut [T]; V], [&mut [T]; S]) -> A,
    ) -> A
    where
        for<'a> [&'a mut [T]; V]: Parts<'a, T>,
        for<'a> [&'a mut [T]; S]: Parts<'a, T>,
    {
        let size = self.value();
        if kept.len() < size * (V + S * size) {
            *kept = self.scratch::<T, V, S>();
        }
        let (vectors, rest) = Parts::take(kept.as_mut_slice(), size);
        let (squares, _) = Parts::take(rest, size * size);
        work(vectors, squares)
    }
}

/// This matrix with these entries, which are as many.
pub(crate) fn filled<T: Scalar + Copy, R: Dim, C: Dim>(
    mut matrix: OMatrix<T, R, C>,
    entries: &[T],
) -> OMatrix<T, R, C>
where
    DefaultAllocator: Allocator<R, C>,
{
    ud::copy(entries, matrix.as_mut_slice());
    matrix
}

mod imply {
    /// A bound on `T` that holds wherever `Self: Imply<T>` does: a `where` clause on another type is not
    /// implied by a trait, but a bound on an associated type is.
    pub trait Imply<T>: Is<T, Type = T> {}
    pub trait Is<T> {
        type Type;
    }
    impl<S, T> Is<T> for S {
        type Type = T;
    }
    impl<S, T> Imply<T> for S {}
}

/// A size: nalgebra's `Const<N>`, or `Dyn` with the feature `alloc`.
///
/// It collapses nalgebra's allocator bounds into one name, so that a signature over any size reads
/// `impl<T: Real, N: Dimension>`. Where there are matrices of two sizes, `N: Dimension<M>` says that they can
/// be N x M and M x N. The trait is sealed.
///
/// ```
/// use thetahat_core::nalgebra::{Const, OMatrix, OVector};
/// use thetahat_core::{Dimension, Real};
///
/// fn sum<T: Real, N: Dimension>(values: &OVector<T, N>) -> T {
///     values.iter().fold(T::zero(), |sum, &value| sum + value)
/// }
/// assert_eq!(sum(&OVector::<f64, Const<3>>::new(1.0, 2.0, 4.0)), 7.0);
///
/// fn total<T: Real, N: Dimension<M>, M: Dimension>(values: &OMatrix<T, N, M>) -> T {
///     values.iter().fold(T::zero(), |sum, &value| sum + value)
/// }
/// assert_eq!(total(&OMatrix::<f64, Const<1>, Const<2>>::new(1.0, 2.0)), 3.0);
/// ```
pub trait Dimension<C: Dim = Self>:
    Workspace
    + imply::Imply<
        DefaultAllocator,
        Type: Allocator<Self> + Allocator<Self, Self> + Allocator<Self, C> + Allocator<C, Self>,
    >
{
    /// A matrix of this many rows, filled with `value`.
    #[doc(hidden)]
    fn rows_by<V: Scalar + Copy>(self, columns: C, value: V) -> OMatrix<V, Self, C>;
}

impl<const N: usize, const C: usize> Dimension<Const<C>> for Const<N> {
    fn rows_by<V: Scalar + Copy>(self, _columns: Const<C>, value: V) -> OMatrix<V, Self, Const<C>> {
        OMatrix::from_data(ArrayStorage([[value; N]; C]))
    }
}

#[cfg(feature = "alloc")]
impl<const N: usize> Dimension<Dyn> for Const<N> {
    fn rows_by<V: Scalar + Copy>(self, columns: Dyn, value: V) -> OMatrix<V, Self, Dyn> {
        OMatrix::from_element_generic(self, columns, value)
    }
}

#[cfg(feature = "alloc")]
impl<C: Dim> Dimension<C> for Dyn
where
    DefaultAllocator: Allocator<Dyn, C> + Allocator<C, Dyn>,
{
    fn rows_by<V: Scalar + Copy>(self, columns: C, value: V) -> OMatrix<V, Self, C> {
        OMatrix::from_element_generic(self, columns, value)
    }
}
