//! The models that an indirect self-tuner can estimate.

use nalgebra::Const;

use crate::{
    ArmaxMethod, ArmaxOrders, ArxOrders, Dimension, Error, Forgetting, Innovation, InputOrders, Lags,
    PlacementOrders, Real, RecursiveArmax, RecursiveArx, RecursiveLeastSquares, RlsStart,
};

/// How large the model and the controller of an [`IndirectSelfTuner`](crate::IndirectSelfTuner) are.
///
/// ```
/// use thetahat_core::TunerOrders;
///
/// // A plant of second order with up to two samples of dead time, loads, and a controller that integrates.
/// const ORDERS: TunerOrders = TunerOrders { na: 2, nb: 4, nc: 0, constant: true, integrator: true };
/// assert_eq!((ORDERS.parameters(), ORDERS.size()), (7, 6));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TunerOrders {
    /// The order of A(q).
    pub na: usize,
    /// The coefficients of B(q) = b_1 q⁻¹ + …: 2 for a plant of second order, and one more for each sample of dead time
    /// that there may be.
    pub nb: usize,
    /// The order of C(q): 0 with a [`RecursiveArx`], the noise of which is white.
    pub nc: usize,
    /// Whether the model has a constant: where the signals are not deviations from a working point, and where loads
    /// come.
    pub constant: bool,
    /// Whether the controller integrates.
    pub integrator: bool,
}

impl TunerOrders {
    /// `P` of [`IndirectSelfTuner`](crate::IndirectSelfTuner).
    pub const fn parameters(&self) -> usize {
        self.na + self.nb + self.nc + self.constant as usize
    }

    /// `N` of [`IndirectSelfTuner`](crate::IndirectSelfTuner).
    pub const fn size(&self) -> usize {
        let placed = PlacementOrders { na: self.na, nb: self.nb, integrator: self.integrator }.size();
        // A_m is of degree 2, or A; A_o = C (1 - p q⁻¹).
        let response = if self.na > 2 { self.na } else { 2 };
        let poles = response + self.nc + 1;
        if self.nc > 0 && poles > placed { poles } else { placed }
    }
}

/// A model that an [`IndirectSelfTuner`](crate::IndirectSelfTuner) can estimate: [`RecursiveArx`], or
/// [`RecursiveArmax`] where the noise is not white. The trait is sealed.
pub trait TunerModel<T: Real, P: Dimension + Dimension<Const<1>>>: Estimated<T, P> {}

impl<T: Real, P: Dimension + Dimension<Const<1>>, M: Estimated<T, P>> TunerModel<T, P> for M {}

/// What a tuner does with its model.
pub trait Estimated<T: Real, P: Dimension + Dimension<Const<1>>>: Clone {
    fn new(orders: &TunerOrders, scales: [T; 2], forgetting: Forgetting<T>) -> Result<Self, Error>;
    fn with_start(self, start: RlsStart) -> Result<Self, Error>;
    fn measured(&mut self, output: T) -> Result<Innovation<T>, Error>;
    fn applied(&mut self, input: T) -> Result<(), Error>;
    fn predict(&self, input: T, output: &mut [T]) -> Result<(), Error>;
    fn set_adaptation(&mut self, on: bool);
    fn lags(&self) -> &Lags<T, P>;
    fn estimator(&self) -> &RecursiveLeastSquares<T, P>;
    /// C, from its 1 on.
    fn c(&self) -> impl Iterator<Item = T> + Clone;

    /// A, from its 1 on.
    fn a(&self) -> impl Iterator<Item = T> + Clone {
        self.lags().output_coefficients(self.estimator().parameters().as_slice())
    }

    /// B of an input, from its zero on.
    fn b(&self, input: usize) -> Option<impl Iterator<Item = T> + Clone> {
        self.lags().input_coefficients(self.estimator().parameters().as_slice(), input)
    }

    fn has_constant(&self) -> bool {
        self.lags().constant(self.estimator().parameters().as_slice()).is_some()
    }

    /// The orders that it has, in a loop that integrates or not; `None` if it is no model of one input that acts on the
    /// next sample.
    fn orders(&self, integrator: bool) -> Option<TunerOrders> {
        let count = |coefficients: usize| coefficients.checked_sub(1);
        let (na, nb) = (count(self.a().count())?, count(self.b(0)?.count())?);
        let orders =
            TunerOrders { na, nb, nc: count(self.c().count())?, constant: self.has_constant(), integrator };
        let is_whole =
            nb > 0 && self.b(1).is_none() && self.estimator().parameters().len() == orders.parameters();
        is_whole.then_some(orders)
    }
}

/// What both models call by the same names.
macro_rules! steps {
    () => {
        fn with_start(self, start: RlsStart) -> Result<Self, Error> {
            self.with_start(start)
        }

        fn measured(&mut self, output: T) -> Result<Innovation<T>, Error> {
            self.measured(output)
        }

        fn applied(&mut self, input: T) -> Result<(), Error> {
            self.applied(&[input])
        }

        fn predict(&self, input: T, output: &mut [T]) -> Result<(), Error> {
            self.predict(&[input], output)
        }

        fn set_adaptation(&mut self, on: bool) {
            self.set_adaptation(on);
        }

        fn lags(&self) -> &Lags<T, P> {
            self.lags()
        }

        fn estimator(&self) -> &RecursiveLeastSquares<T, P> {
            self.estimator()
        }
    };
}

impl<T: Real, P: Dimension + Dimension<Const<1>>> Estimated<T, P> for RecursiveArx<T, P> {
    fn new(orders: &TunerOrders, scales: [T; 2], forgetting: Forgetting<T>) -> Result<Self, Error> {
        let TunerOrders { na, nb, nc, constant, .. } = *orders;
        if nc > 0 {
            return Err(Error::OutOfRange { argument: "nc", range: "0 with a RecursiveArx" });
        }
        let orders = ArxOrders { na, inputs: &[InputOrders { nb, nk: 1 }], constant };
        let [output, input] = scales;
        RecursiveArx::new(&orders, output, &[input], forgetting)
    }

    steps!();

    fn c(&self) -> impl Iterator<Item = T> + Clone {
        core::iter::once(T::one())
    }
}

impl<T: Real, P: Dimension + Dimension<Const<1>>> Estimated<T, P> for RecursiveArmax<T, P> {
    fn new(orders: &TunerOrders, scales: [T; 2], forgetting: Forgetting<T>) -> Result<Self, Error> {
        let TunerOrders { na, nb, nc, constant, .. } = *orders;
        let orders = ArmaxOrders { na, inputs: &[InputOrders { nb, nk: 1 }], nc, constant };
        let [output, input] = scales;
        // A guess that does not matter much: it bounds P of C.
        let noise = output / T::from_count(10);
        RecursiveArmax::new(&orders, ArmaxMethod::PredictionError, output, &[input], noise, forgetting)
    }

    steps!();

    fn c(&self) -> impl Iterator<Item = T> + Clone {
        self.c()
    }
}
