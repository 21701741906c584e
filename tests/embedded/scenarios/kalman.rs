//! The Kalman filters: one step is a time update and a measurement update.

use thetahat_core::nalgebra::{Complex, Const, Matrix3, RowVector3, SMatrix, SVector, Vector1, Vector3};
use thetahat_core::{
    Action, Covariance, Error, ExtendedKalmanFilter, Innovation, KalmanFilter, LinearObservation,
    LinearTransition, LuenbergerObserver, Observation, SetInnovation, Transition, UnscentedKalmanFilter,
    ZonotopeFilter,
};

use crate::record::{Sample, sample};
use crate::{Case, Scenario};

/// N states, M elements in a measurement with independent noises, dense matrices.
pub(crate) struct Kalman<const N: usize, const M: usize> {
    filter: KalmanFilter<f32, Const<N>>,
    transition: LinearTransition<f32, Const<N>>,
    observation: LinearObservation<f32, Const<N>, Const<M>>,
}

impl<const N: usize, const M: usize> Scenario for Kalman<N, M> {
    const NAME: &'static str = match (N, M) {
        (2, 1) => "KalmanFilter, 2 x 1",
        (4, 2) => "KalmanFilter, 4 x 2",
        _ => "KalmanFilter, 6 x 3",
    };
    const DETOUR: bool = true;
    type Input = SVector<f32, M>;
    type Output = Innovation<f32, SVector<f32, M>>;

    /// In the hard case the prior is poor and the sensors are accurate: then the quick time update fails.
    fn start(case: Case) -> Result<Self, Error> {
        let (prior, noise) = match case {
            Case::Typical => (1.0, 0.1),
            Case::Hard => (1e6, 1e-4),
        };
        let (state_matrix, output_matrix) = (matrix::<N, N>(0.5, 0.3), matrix::<M, N>(1.0, 0.1));
        Ok(Kalman {
            filter: KalmanFilter::new(SVector::zeros(), variances(prior)?)?,
            transition: LinearTransition::new(state_matrix, variances(0.01)?)?,
            observation: LinearObservation::new(output_matrix, variances(noise)?)?,
        })
    }

    fn input(case: Case, k: usize) -> SVector<f32, M> {
        let mut measurement = SVector::<f32, M>::zeros();
        for (index, element) in measurement.as_mut_slice().iter_mut().enumerate() {
            *element = sample(case, k, index).y;
        }
        measurement
    }

    #[inline(never)]
    fn step(&mut self, measurement: &SVector<f32, M>) -> Result<Self::Output, Error> {
        self.filter.predict(&self.transition, &SVector::zeros())?;
        self.filter.correct(&self.observation, &SVector::zeros(), measurement)
    }

    fn numbers(&self, innovation: &Self::Output, number: &mut impl FnMut(f32)) {
        filter_numbers(innovation, self.filter.state(), self.filter.covariance(), number);
    }
}

fn filter_numbers<const N: usize, const M: usize>(
    innovation: &Innovation<f32, SVector<f32, M>>,
    state: &SVector<f32, N>,
    covariance: &Covariance<f32, Const<N>>,
    mut number: &mut impl FnMut(f32),
) {
    number(innovation.nis);
    number(if innovation.action == Action::Updated { 1.0 } else { 0.0 });
    for vector in [innovation.error, innovation.variance] {
        vector.iter().copied().for_each(&mut number);
    }
    state.iter().copied().for_each(&mut number);
    covariance.matrix().iter().copied().for_each(number);
}

/// An extended Kalman filter: a spring that hardens, and its unknown stiffness. Position, rate, stiffness.
pub(crate) struct Extended {
    filter: ExtendedKalmanFilter<f32, Const<3>>,
    spring: Spring,
}

struct Spring {
    process_noise: Covariance<f32, Const<3>>,
    measurement_noise: Covariance<f32, Const<1>>,
}

/// The sample time.
const STEP: f32 = 0.1;
/// The damping, and how the spring hardens.
const DAMPING: f32 = 0.4;
const HARDENING: f32 = 0.05;

impl Transition<f32, Const<3>, Const<1>> for Spring {
    fn next(&self, x: &Vector3<f32>, u: &Vector1<f32>) -> Vector3<f32> {
        let force = u.x - DAMPING * x.y - x.z * x.x - HARDENING * x.x * x.x * x.x;
        Vector3::new(x.x + STEP * x.y, x.y + STEP * force, x.z)
    }

    fn next_jacobian(&self, x: &Vector3<f32>, _: &Vector1<f32>) -> Matrix3<f32> {
        let stiffness = x.z + 3.0 * HARDENING * x.x * x.x;
        Matrix3::new(1.0, STEP, 0.0, -STEP * stiffness, 1.0 - STEP * DAMPING, -STEP * x.x, 0.0, 0.0, 1.0)
    }

    fn process_noise(&self, _: &Vector3<f32>, _: &Vector1<f32>) -> Covariance<f32, Const<3>> {
        self.process_noise.clone()
    }
}

/// The sensor is not linear either: y = x + 0.1 x².
impl Observation<f32, Const<3>, Const<1>, Const<1>> for Spring {
    fn output(&self, x: &Vector3<f32>, _: &Vector1<f32>) -> Vector1<f32> {
        Vector1::new(x.x + 0.1 * x.x * x.x)
    }

    fn output_jacobian(&self, x: &Vector3<f32>, _: &Vector1<f32>) -> RowVector3<f32> {
        RowVector3::new(1.0 + 0.2 * x.x, 0.0, 0.0)
    }

    fn measurement_noise(&self, _: &Vector3<f32>, _: &Vector1<f32>) -> Covariance<f32, Const<1>> {
        self.measurement_noise.clone()
    }
}

impl Scenario for Extended {
    const NAME: &'static str = "ExtendedKalmanFilter, 3 x 1";
    const DETOUR: bool = true;
    type Input = Sample;
    type Output = Innovation<f32, Vector1<f32>>;

    fn start(case: Case) -> Result<Self, Error> {
        let (prior, noise) = match case {
            Case::Typical => (1.0, 0.1),
            Case::Hard => (1e4, 1e-4),
        };
        Ok(Extended {
            filter: ExtendedKalmanFilter::new(Vector3::new(0.0, 0.0, 1.0), variances(prior)?)?,
            spring: Spring { process_noise: variances(0.01)?, measurement_noise: variances(noise)? },
        })
    }

    fn input(case: Case, k: usize) -> Sample {
        sample(case, k, 0)
    }

    #[inline(never)]
    fn step(&mut self, sample: &Sample) -> Result<Self::Output, Error> {
        let input = Vector1::new(sample.u);
        self.filter.predict(&self.spring, &input)?;
        self.filter.correct(&self.spring, &input, &Vector1::new(sample.y))
    }

    fn numbers(&self, innovation: &Self::Output, number: &mut impl FnMut(f32)) {
        filter_numbers(innovation, self.filter.state(), self.filter.covariance(), number);
    }
}

/// The unscented Kalman filter of the same spring.
pub(crate) struct Unscented {
    filter: UnscentedKalmanFilter<f32, Const<3>>,
    spring: Spring,
}

impl Scenario for Unscented {
    const NAME: &'static str = "UnscentedKalmanFilter, 3 x 1";
    type Input = Sample;
    type Output = Innovation<f32, Vector1<f32>>;

    fn start(case: Case) -> Result<Self, Error> {
        let Extended { filter, spring } = Extended::start(case)?;
        let filter = UnscentedKalmanFilter::new(*filter.state(), filter.covariance().clone())?;
        Ok(Unscented { filter, spring })
    }

    fn input(case: Case, k: usize) -> Sample {
        sample(case, k, 0)
    }

    #[inline(never)]
    fn step(&mut self, sample: &Sample) -> Result<Self::Output, Error> {
        let input = Vector1::new(sample.u);
        self.filter.predict(&self.spring, &input)?;
        self.filter.correct(&self.spring, &input, &Vector1::new(sample.y))
    }

    fn numbers(&self, innovation: &Self::Output, number: &mut impl FnMut(f32)) {
        filter_numbers(innovation, self.filter.state(), self.filter.covariance(), number);
    }
}

/// The set of a position and a rate, of twenty generators.
pub(crate) struct Set {
    filter: ZonotopeFilter<f32, Const<2>, Const<20>>,
    transition: LinearTransition<f32, Const<2>>,
    observation: LinearObservation<f32, Const<2>, Const<1>>,
}

impl Scenario for Set {
    const NAME: &'static str = "ZonotopeFilter, 2 x 1, 20";
    type Input = Vector1<f32>;
    type Output = SetInnovation<Vector1<f32>>;

    fn start(case: Case) -> Result<Self, Error> {
        let reach = if case == Case::Hard { 1e6 } else { 10.0 };
        Ok(Set {
            filter: ZonotopeFilter::new(SVector::zeros(), &SVector::repeat(reach), Const)?,
            transition: LinearTransition::new(matrix::<2, 2>(0.5, 0.3), Covariance::zero(Const))?,
            observation: LinearObservation::new(matrix::<1, 2>(1.0, 0.1), Covariance::zero(Const))?,
        })
    }

    fn input(case: Case, k: usize) -> Vector1<f32> {
        Vector1::new(sample(case, k, 0).y)
    }

    #[inline(never)]
    fn step(&mut self, measurement: &Vector1<f32>) -> Result<Self::Output, Error> {
        self.filter.predict(&self.transition, &SVector::repeat(1.0), &SVector::zeros())?;
        self.filter.correct(&self.observation, &Vector1::new(2.0), &SVector::zeros(), measurement)
    }

    fn numbers(&self, told: &Self::Output, number: &mut impl FnMut(f32)) {
        number(told.error.x);
        number(told.bound.x);
        number(if told.contradiction.is_some() { 1.0 } else { 0.0 });
        self.filter.centre().iter().chain(&self.filter.reaches()).copied().for_each(number);
    }
}

/// An observer of two states with one output and a fixed gain.
pub(crate) struct Observer {
    observer: LuenbergerObserver<f32, Const<2>, Const<1>>,
    transition: LinearTransition<f32, Const<2>>,
    observation: LinearObservation<f32, Const<2>, Const<1>>,
}

impl Scenario for Observer {
    const NAME: &'static str = "LuenbergerObserver, 2 x 1";
    type Input = Vector1<f32>;
    type Output = Innovation<f32, Vector1<f32>>;

    fn start(_: Case) -> Result<Self, Error> {
        let transition = LinearTransition::new(matrix::<2, 2>(0.5, 0.3), Covariance::zero(Const))?;
        let observation = LinearObservation::new(matrix::<1, 2>(1.0, 0.1), Covariance::zero(Const))?;
        let mut observer = LuenbergerObserver::new(SVector::zeros(), SVector::zeros())?;
        let (none, poles) = (SVector::zeros(), SVector::repeat(Complex::new(0.2, 0.0)));
        observer.place(&transition, &observation, &none, &Vector1::repeat(1.0), &poles)?;
        Ok(Observer { observer, transition, observation })
    }

    fn input(case: Case, k: usize) -> Vector1<f32> {
        Vector1::new(sample(case, k, 0).y)
    }

    #[inline(never)]
    fn step(&mut self, measurement: &Vector1<f32>) -> Result<Self::Output, Error> {
        self.observer.update(&self.transition, &self.observation, &SVector::zeros(), measurement)
    }

    fn numbers(&self, innovation: &Self::Output, mut number: &mut impl FnMut(f32)) {
        number(innovation.error.x);
        self.observer.gain().iter().chain(self.observer.state()).copied().for_each(&mut number);
    }
}

fn variances<const N: usize>(variance: f32) -> Result<Covariance<f32, Const<N>>, Error> {
    Covariance::from_diagonal(&SVector::repeat(variance))
}

/// `diagonal` on the diagonal, and `rest` shared by the other entries of a row, unequally.
fn matrix<const R: usize, const C: usize>(diagonal: f32, rest: f32) -> SMatrix<f32, R, C> {
    let mut matrix = SMatrix::<f32, R, C>::repeat(0.0);
    for (index, entry) in matrix.as_mut_slice().iter_mut().enumerate() {
        let (row, column) = (index % R, index / R);
        let share = (1 + (row + 2 * column) % 3) as f32 / (2 * C) as f32;
        *entry = if row == column { diagonal } else { rest * share };
    }
    matrix
}
