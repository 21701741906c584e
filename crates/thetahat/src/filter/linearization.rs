//! A model that is not linear, evaluated at an estimate: what a filter asks of it there.

use std::cell::RefCell;

use thetahat_core::nalgebra::{DMatrix, DVector, Dyn};
use thetahat_core::{Covariance, Error, Observation, Transition};

use crate::model::{GreyBox, equations, equations::Drive};

/// A function of states and unknown parameters with its Jacobian and its noise, all at one estimate.
///
/// The estimate is [x; z], z being the unknown parameters after the change of variable, and the model that of
/// [`Augmented`](thetahat_core::Augmented):
///
/// ```text
/// F = [ ∂f/∂x  ∂f/∂z ]        H = [ ∂h/∂x  ∂h/∂z ]        Q = [ Q_x   0  ]
///     [   0      I   ]                                        [  0   Q_z ]
/// ```
///
/// A filter asks for function, Jacobian and noise one by one, each time at the same estimate. Computed together they
/// share what they have in common.
#[derive(Debug, Clone)]
pub(super) struct Linearization {
    pub(super) values: DVector<f64>,
    pub(super) jacobian: DMatrix<f64>,
    pub(super) noise: Covariance<f64, Dyn>,
}

/// Numbers to work in.
#[derive(Debug, Clone)]
pub(super) struct Work {
    jacobian: Vec<f64>,
    program: equations::Work<f64>,
}

impl Work {
    pub(super) const fn new() -> Self {
        Self { jacobian: Vec::new(), program: equations::Work::new() }
    }
}

impl Linearization {
    /// The step of `dt` seconds from time `t`.
    pub(super) fn ahead(
        model: &GreyBox,
        estimate: &[f64],
        inputs: Drive<'_>,
        t: f64,
        dt: f64,
        work: &mut Work,
    ) -> Result<Self, Error> {
        let (n, size) = (model.states().len(), estimate.len());
        let (x, z) = estimate.split_at(n);
        let mut values = DVector::from_column_slice(estimate);
        let mut jacobian = DMatrix::identity(size, size);
        work.jacobian.resize(n * size, 0.0);
        let next = &mut values.as_mut_slice()[..n];
        model.advance(x, z, inputs, t, dt, next, &mut work.jacobian, &mut work.program);
        let columns = jacobian.as_mut_slice().chunks_exact_mut(size);
        for (target, column) in columns.zip(work.jacobian.chunks_exact(n)) {
            target[..n].copy_from_slice(column);
        }
        let share = dt / model.sample_time();
        let mut noise = DVector::zeros(size);
        let (of_states, of_parameters) = noise.as_mut_slice().split_at_mut(n);
        if z.is_empty() {
            let mut factor = DMatrix::zeros(n, n);
            let entries = factor.as_mut_slice();
            model.process_noise(x, z, inputs, t, dt, entries, of_states, &mut work.program);
            let noise = Covariance::from_diagonal(&noise)?;
            let is_diagonal = factor.is_identity(0.0);
            let noise = if is_diagonal { noise } else { noise.transformed(&factor)? };
            return Ok(Self { values, jacobian, noise });
        }
        model.added_variances(x, z, inputs, t, dt, of_states, &mut work.program);
        for (variance, parameter) in of_parameters.iter_mut().zip(model.parameters()) {
            if parameter.walk != 0.0 {
                *variance = parameter.walk_variable().powi(2) * share;
            }
        }
        Ok(Self { values, jacobian, noise: Covariance::from_diagonal(&noise)? })
    }

    /// The outputs at time `t`.
    pub(super) fn seen(
        model: &GreyBox,
        estimate: &[f64],
        inputs: Drive<'_>,
        t: f64,
        work: &mut Work,
    ) -> Result<Self, Error> {
        let (x, z) = estimate.split_at(model.states().len());
        let outputs = model.outputs().len();
        let (mut values, mut noise) = (DVector::zeros(outputs), DVector::zeros(outputs));
        let mut jacobian = DMatrix::zeros(outputs, estimate.len());
        model.observe(x, z, inputs, t, values.as_mut_slice(), jacobian.as_mut_slice(), &mut work.program);
        model.measurement_variances(x, z, inputs, t, noise.as_mut_slice(), &mut work.program);
        Ok(Self { values, jacobian, noise: Covariance::from_diagonal(&noise)? })
    }
}

/// A model wherever a filter asks, such as at the points of an unscented one: function, slopes and noise of one place
/// are computed together, and kept for the next question.
pub(super) struct Function<E> {
    evaluate: RefCell<E>,
    latest: RefCell<(DVector<f64>, Linearization)>,
}

impl<E: FnMut(&[f64]) -> Result<Linearization, Error>> Function<E> {
    /// A function that is evaluated here first.
    pub(super) fn at(estimate: &DVector<f64>, mut evaluate: E) -> Result<Self, Error> {
        let first = evaluate(estimate.as_slice())?;
        Ok(Self { evaluate: RefCell::new(evaluate), latest: RefCell::new((estimate.clone(), first)) })
    }

    /// What `take` takes of it at this place; where the model has no answer there, all its numbers are NaN, which a
    /// filter refuses.
    fn taken<A>(&self, place: &DVector<f64>, take: impl FnOnce(&Linearization) -> A) -> A {
        let latest = &mut *self.latest.borrow_mut();
        if latest.0 != *place {
            match (self.evaluate.borrow_mut())(place.as_slice()) {
                Ok(found) => latest.1 = found,
                Err(_) => latest.1.values.fill(f64::NAN),
            }
            latest.0.copy_from(place);
        }
        take(&latest.1)
    }

    /// All of it here.
    pub(super) fn linear(&self, place: &DVector<f64>) -> Linearization {
        self.taken(place, Linearization::clone)
    }
}

impl<E: FnMut(&[f64]) -> Result<Linearization, Error>> Transition<f64, Dyn, Dyn> for Function<E> {
    fn next(&self, x: &DVector<f64>, _: &DVector<f64>) -> DVector<f64> {
        self.taken(x, |found| found.values.clone())
    }

    fn next_jacobian(&self, x: &DVector<f64>, _: &DVector<f64>) -> DMatrix<f64> {
        self.taken(x, |found| found.jacobian.clone())
    }

    fn process_noise(&self, x: &DVector<f64>, _: &DVector<f64>) -> Covariance<f64, Dyn> {
        self.taken(x, |found| found.noise.clone())
    }
}

impl<E: FnMut(&[f64]) -> Result<Linearization, Error>> Observation<f64, Dyn, Dyn, Dyn> for Function<E> {
    fn output(&self, x: &DVector<f64>, _: &DVector<f64>) -> DVector<f64> {
        self.taken(x, |found| found.values.clone())
    }

    fn output_jacobian(&self, x: &DVector<f64>, _: &DVector<f64>) -> DMatrix<f64> {
        self.taken(x, |found| found.jacobian.clone())
    }

    fn measurement_noise(&self, x: &DVector<f64>, _: &DVector<f64>) -> Covariance<f64, Dyn> {
        self.taken(x, |found| found.noise.clone())
    }
}
impl Transition<f64, Dyn, Dyn> for Linearization {
    fn next(&self, _: &DVector<f64>, _: &DVector<f64>) -> DVector<f64> {
        self.values.clone()
    }

    fn next_jacobian(&self, _: &DVector<f64>, _: &DVector<f64>) -> DMatrix<f64> {
        self.jacobian.clone()
    }

    fn process_noise(&self, _: &DVector<f64>, _: &DVector<f64>) -> Covariance<f64, Dyn> {
        self.noise.clone()
    }
}

impl Observation<f64, Dyn, Dyn, Dyn> for Linearization {
    fn output(&self, _: &DVector<f64>, _: &DVector<f64>) -> DVector<f64> {
        self.values.clone()
    }

    fn output_jacobian(&self, _: &DVector<f64>, _: &DVector<f64>) -> DMatrix<f64> {
        self.jacobian.clone()
    }

    fn measurement_noise(&self, _: &DVector<f64>, _: &DVector<f64>) -> Covariance<f64, Dyn> {
        self.noise.clone()
    }
}
