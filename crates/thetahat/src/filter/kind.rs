//! The kinds of models, and the steps of filters and observers over them.

use std::borrow::Cow;

use thetahat_core::nalgebra::{Complex, DMatrix, DVector, Dyn};
use thetahat_core::{
    Covariance, Error, ExtendedKalmanFilter, Innovation, LuenbergerObserver, Observation, Smoother,
    Transition, UnscentedKalmanFilter,
};

use super::frame::Frame;
use super::lags::Lags;
use super::linear::Linear;
use super::linearization::{Function, Linearization, Work};
use super::past::Past;
pub(super) use super::past::Sample;
use crate::data::Offset;
use crate::model::{GreyBox, equations::whole_steps};

pub(super) type Filter = ExtendedKalmanFilter<f64, Dyn>;
pub(super) type Unscented = UnscentedKalmanFilter<f64, Dyn>;
pub(super) type Observer = LuenbergerObserver<f64, Dyn, Dyn>;

/// How the time from one row to the next is taken: how many steps, and the seconds of each.
pub(super) type Division = (usize, f64);

/// The outputs that a filter expects, and how certain they are.
pub(super) enum Expected<'a> {
    /// By H, which has a column for each state and each unknown parameter, and R.
    Linear(DVector<f64>, Cow<'a, DMatrix<f64>>, Cow<'a, DMatrix<f64>>),
    /// With the variances of the innovations.
    Known(DVector<f64>, DVector<f64>),
}

/// A filter, or a smoother around one.
pub(super) trait Recursion {
    fn state(&self) -> &DVector<f64>;
    fn predict(
        &mut self,
        transition: &impl Transition<f64, Dyn, Dyn>,
        input: &DVector<f64>,
    ) -> Result<(), Error>;
    /// Expected outputs with the variances of their innovations; none where these follow from H.
    fn expected(
        &self,
        _observation: &impl Observation<f64, Dyn, Dyn, Dyn>,
        _input: &DVector<f64>,
    ) -> Result<Option<Expected<'static>>, Error> {
        Ok(None)
    }
    fn correct(
        &mut self,
        observation: &impl Observation<f64, Dyn, Dyn, Dyn>,
        input: &DVector<f64>,
        measurement: &DVector<f64>,
    ) -> Result<Innovation<f64, DVector<f64>>, Error>;
}

/// A filter that tells what a row of a [`StateFilter`](super::StateFilter) needs.
pub(super) trait Gaussian: Recursion {
    fn covariance(&self) -> &Covariance<f64, Dyn>;
}

/// The recursion of a filter of the core, or of the smoother around it.
macro_rules! recursion {
    ($type:ty, $filter:ident, $state:expr, $($expected:tt)*) => {
        impl Recursion for $type {
            fn state(&self) -> &DVector<f64> {
                let $filter = self;
                $state
            }

            fn predict(
                &mut self,
                transition: &impl Transition<f64, Dyn, Dyn>,
                input: &DVector<f64>,
            ) -> Result<(), Error> {
                <$type>::predict(self, transition, input)
            }

            $($expected)*

            fn correct(
                &mut self,
                observation: &impl Observation<f64, Dyn, Dyn, Dyn>,
                input: &DVector<f64>,
                measurement: &DVector<f64>,
            ) -> Result<Innovation<f64, DVector<f64>>, Error> {
                <$type>::correct(self, observation, input, measurement)
            }
        }
    };
}

recursion!(Filter, filter, filter.state(),);
recursion!(Smoother<f64, Dyn>, smoother, smoother.filter().state(),);
recursion!(Smoother<f64, Dyn, Unscented>, smoother, smoother.filter().state(),);
recursion!(
    Unscented,
    filter,
    filter.state(),
    fn expected(
        &self,
        observation: &impl Observation<f64, Dyn, Dyn, Dyn>,
        input: &DVector<f64>,
    ) -> Result<Option<Expected<'static>>, Error> {
        let (outputs, covariance) = Unscented::expected(self, observation, input)?;
        Ok(Some(Expected::Known(outputs, covariance.variances())))
    }
);

impl Gaussian for Filter {
    fn covariance(&self) -> &Covariance<f64, Dyn> {
        Filter::covariance(self)
    }
}

impl Gaussian for Unscented {
    fn covariance(&self) -> &Covariance<f64, Dyn> {
        Unscented::covariance(self)
    }
}

/// A model that goes from sample to sample, or in equations.
#[derive(Debug, Clone)]
pub(super) enum Kind {
    Sampled(Box<Frame>, Motion),
    Grey(Box<GreyBox>),
}

/// How the state of a model goes on that goes from sample to sample.
#[derive(Debug, Clone)]
pub(super) enum Motion {
    Linear(Box<Linear>),
    Lags(Box<Lags>),
}

impl Kind {
    /// What it has to remember of its inputs, before the first row.
    pub(super) fn past(&self) -> Past {
        match self {
            Kind::Grey(grey) => Past::new(grey),
            Kind::Sampled(..) => Past::default(),
        }
    }

    /// The filter that stands where the model starts.
    pub(super) fn started(&self) -> Result<Filter, Error> {
        match self {
            Kind::Sampled(frame, _) => Filter::new(frame.start.clone(), frame.start_covariance.clone()),
            Kind::Grey(grey) => {
                // [x; z] = [x0(z) + e; z] with e and z independent of each other.
                let (mut mean, mut variances, slopes) = grey.started();
                let n = mean.len();
                for parameter in grey.parameters() {
                    let (z, deviation) = parameter.start_variable();
                    mean.push(z);
                    variances.push(deviation * deviation);
                }
                let mut joint = DMatrix::identity(mean.len(), mean.len());
                joint.view_mut((0, n), slopes.shape()).copy_from(&slopes);
                Filter::new(mean.into(), Covariance::from_diagonal(&variances.into())?.transformed(&joint)?)
            }
        }
    }

    /// How a step of `dt` seconds is taken.
    pub(super) fn division(&self, dt: f64) -> Result<Division, crate::Error> {
        match self {
            Kind::Sampled(frame, _) => {
                let sample_time = frame.names.sample_time;
                Ok((whole_steps(dt, sample_time)?, sample_time))
            }
            Kind::Grey(grey) => grey.division(dt),
        }
    }

    /// From one row to the next, which is the latest of the past: inputs are held between them, or go in lines.
    pub(super) fn predict(
        &self,
        filter: &mut impl Recursion,
        from: &Sample,
        to: &Sample,
        (count, dt): Division,
        (past, work): (&Past, &mut Work),
    ) -> Result<(), Error> {
        match self {
            Kind::Sampled(frame, motion) => match motion {
                Motion::Linear(linear) => {
                    let there: Vec<bool> = from.outputs.iter().map(|output| !output.is_nan()).collect();
                    let mut left = count;
                    if let Some(transition) = linear.after(frame, &there)? {
                        filter.predict(transition.as_ref(), &from.drives())?;
                        left -= 1;
                    }
                    for _ in 0..left {
                        filter.predict(&linear.transition, &from.inputs)?;
                    }
                }
                Motion::Lags(lags) => {
                    for index in 1..=count {
                        let next = if index == count { &to.inputs } else { &from.inputs };
                        let transition = Function::at(filter.state(), |x: &[f64]| {
                            Ok(lags.ahead(&DVector::from_column_slice(x), &from.inputs, next))
                        })?;
                        filter.predict(&transition, &from.inputs)?;
                    }
                }
            },
            Kind::Grey(grey) => {
                for index in 0..count {
                    let (time, inputs) = (from.time + index as f64 * dt, past.drive(from, 1));
                    let transition = Function::at(filter.state(), |x: &[f64]| {
                        Linearization::ahead(grey, x, inputs, time, dt, work)
                    })?;
                    filter.predict(&transition, &from.inputs)?;
                }
            }
        }
        Ok(())
    }

    /// What the measurement of a row says. Before it is used, `show` is told the outputs that are expected.
    pub(super) fn correct(
        &self,
        filter: &mut impl Recursion,
        at: &Sample,
        (past, work): (&Past, &mut Work),
        show: impl FnOnce(&Expected<'_>),
    ) -> Result<Innovation<f64, DVector<f64>>, Error> {
        match self {
            Kind::Sampled(frame, _) => {
                let seen = &frame.observation;
                let linear = || {
                    let outputs = seen.output(filter.state(), &at.inputs);
                    let noise = Cow::Borrowed(&frame.output_noise);
                    Expected::Linear(outputs, Cow::Borrowed(&frame.output_matrix), noise)
                };
                show(&filter.expected(seen, &at.inputs)?.unwrap_or_else(linear));
                filter.correct(seen, &at.inputs, &at.outputs)
            }
            Kind::Grey(grey) => {
                let inputs = past.drive(at, 0);
                let seen = Function::at(filter.state(), |x: &[f64]| {
                    Linearization::seen(grey, x, inputs, at.time, work)
                })?;
                let linear = || {
                    let Linearization { values, jacobian, noise } = seen.linear(filter.state());
                    Expected::Linear(values, Cow::Owned(jacobian), Cow::Owned(noise.matrix()))
                };
                show(&filter.expected(&seen, &at.inputs)?.unwrap_or_else(linear));
                filter.correct(&seen, &at.inputs, &at.outputs)
            }
        }
    }

    /// From one row to the next, as an observer goes. With poles its gain is placed anew where the model bends.
    pub(super) fn observe(
        &self,
        observer: &mut Observer,
        poles: Option<&DVector<Complex<f64>>>,
        from: &Sample,
        to: &Sample,
        (count, dt): Division,
        (past, work): (&Past, &mut Work),
    ) -> Result<(), Error> {
        let missing = DVector::repeat(from.outputs.len(), f64::NAN);
        for index in 0..count {
            let outputs = if index == 0 { &from.outputs } else { &missing };
            let place = poles.filter(|_| index == 0);
            match self {
                Kind::Sampled(frame, motion) => {
                    let seen = &frame.observation;
                    match motion {
                        Motion::Linear(linear) => {
                            observer.update(&linear.transition, seen, &from.inputs, outputs)?;
                        }
                        Motion::Lags(lags) => {
                            let next = if index + 1 == count { &to.inputs } else { &from.inputs };
                            let transition = lags.ahead(observer.state(), &from.inputs, next);
                            if let Some(poles) = place {
                                observer.place(&transition, seen, &from.inputs, &self.weights(), poles)?;
                            }
                            observer.update(&transition, seen, &from.inputs, outputs)?;
                        }
                    }
                }
                Kind::Grey(grey) => {
                    let (time, estimate) = (from.time + index as f64 * dt, observer.state().as_slice());
                    let drive = past.drive(from, 1);
                    let transition = Linearization::ahead(grey, estimate, drive, time, dt, work)?;
                    let observation = Linearization::seen(grey, estimate, drive, time, work)?;
                    if let Some(poles) = place {
                        observer.place(&transition, &observation, &from.inputs, &self.weights(), poles)?;
                    }
                    observer.update(&transition, &observation, &from.inputs, outputs)?;
                }
            }
        }
        Ok(())
    }

    /// The outputs that an observer expects in a row.
    pub(super) fn outputs(
        &self,
        estimate: &DVector<f64>,
        at: &Sample,
        (past, work): (&Past, &mut Work),
    ) -> Result<DVector<f64>, Error> {
        Ok(match self {
            Kind::Sampled(frame, _) => frame.observation.output(estimate, &at.inputs),
            Kind::Grey(grey) => {
                Linearization::seen(grey, estimate.as_slice(), past.drive(at, 0), at.time, work)?.values
            }
        })
    }

    /// How the outputs are weighed where an observer needs one number of them: by their noise, that of the start where
    /// it is not the same in all rows.
    pub(super) fn weights(&self) -> DVector<f64> {
        let variances: Vec<f64> = match self {
            Kind::Sampled(frame, _) => frame.output_noise.diagonal().iter().copied().collect(),
            Kind::Grey(grey) => grey.measurement_variances_at_start(),
        };
        let noisy = variances.len() > 1 && variances.iter().all(|variance| *variance > 0.0);
        let each = variances.iter().map(|variance| if noisy { variance.sqrt().recip() } else { 1.0 });
        DVector::from_iterator(variances.len(), each)
    }

    /// What is taken from the channels; nothing where there is no offset.
    pub(super) fn offsets(&self) -> (&[Offset], &[Offset]) {
        match self {
            Kind::Sampled(frame, _) => (&frame.input_offsets, &frame.output_offsets),
            Kind::Grey(_) => (&[], &[]),
        }
    }
}
