//! What `tests/c/steps.c` does, in Rust.

use std::cmp::Ordering;
use std::fmt::Write;

use thetahat_core::nalgebra::{Complex, Const, Matrix2, SMatrix, SVector, Vector1, Vector2, Vector4};
use thetahat_core::*;

const SAMPLES: usize = 120;
const MISSING: usize = 60;

/// A number of either precision: from what is exact in both, and its bits.
pub(crate) trait Number: Real + From<f32> {
    fn bits(self) -> String;
}

impl Number for f32 {
    fn bits(self) -> String {
        format!("{:08x}", self.to_bits())
    }
}

impl Number for f64 {
    fn bits(self) -> String {
        format!("{:016x}", self.to_bits())
    }
}

/// u and y.
fn record<T: Number>() -> Vec<(T, T)> {
    let (mut seed, mut u, mut y) = (1_u32, 0_i32, 0_i32);
    let number = |whole: i32| T::from(whole as f32 / 1024.0);
    let sample = |k| {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        y = 3 * y / 4 + u / 2 + (seed >> 8 & 63) as i32 - 32;
        y += if k == 80 { 1024 } else { 0 };
        u = if seed >> 31 == 1 { 1024 } else { -1024 };
        (number(u), if k == MISSING { T::NAN } else { number(y) })
    };
    (0..SAMPLES).map(sample).collect()
}

struct Lines<T> {
    text: String,
    record: Vec<(T, T)>,
}

impl<T: Number> Lines<T> {
    /// What was k samples before, or 0.
    fn before(&self, k: usize, lag: usize) -> (T, T) {
        k.checked_sub(lag).map_or((T::zero(), T::zero()), |k| self.record[k])
    }

    fn line(&mut self, name: &str, k: usize, innovation: Option<&Told<T>>, numbers: &[&[T]]) {
        write!(self.text, "{name} {k}").expect("text");
        if let Some(Told { numbers, action }) = innovation {
            self.numbers(numbers);
            write!(self.text, " {}", action.word()).expect("text");
        }
        numbers.iter().for_each(|numbers| self.numbers(numbers));
        self.text.push('\n');
    }

    fn numbers(&mut self, numbers: &[T]) {
        for &number in numbers {
            let bits = if number.is_finite() { number.bits() } else { "nan".to_owned() };
            write!(self.text, " {bits}").expect("text");
        }
    }
}

/// An innovation of any number of outputs.
struct Told<T> {
    numbers: Vec<T>,
    action: Action,
}

impl<T: Number> From<Innovation<T>> for Told<T> {
    fn from(Innovation { error, variance, nis, action, .. }: Innovation<T>) -> Self {
        Told { numbers: vec![error, variance, nis], action }
    }
}

impl<T: Number, const M: usize> From<Innovation<T, SVector<T, M>>> for Told<T> {
    fn from(Innovation { error, variance, nis, action, .. }: Innovation<T, SVector<T, M>>) -> Self {
        Told { numbers: error.iter().chain(&variance).copied().chain([nis]).collect(), action }
    }
}

/// All lines.
pub(crate) fn lines<T: Number>() -> Result<String, Error> {
    let mut lines = Lines { text: String::new(), record: record::<T>() };
    step_rls(&mut lines)?;
    step_arx(&mut lines, "arx", Ok)?;
    step_arx(&mut lines, "arx_warm", |arx| {
        let (parameters, covariance, variance) = fit()?;
        arx.with_parameters(parameters)?
            .with_covariance(covariance)?
            .with_noise_variance(variance, 50)?
            .with_outliers(Outliers::Gate { nis: T::from(2.0), release: 1 })
    })?;
    step_armax(&mut lines, "armax", Ok)?;
    step_armax(&mut lines, "armax_warm", |armax| {
        let (parameters, covariance, variance) = fit()?;
        armax
            .with_parameters(parameters)?
            .with_covariance(covariance)?
            .with_noise_variance(variance, 50)?
            .with_outliers(Outliers::Gate { nis: T::from(2.0), release: 1 })
    })?;
    step_kalman(&mut lines)?;
    step_ekf(&mut lines)?;
    step_ukf(&mut lines)?;
    step_luenberger(&mut lines)?;
    step_rst(&mut lines)?;
    step_indirect(&mut lines)?;
    step_direct(&mut lines)?;
    Ok(lines.text)
}

fn step_rls<T: Number>(lines: &mut Lines<T>) -> Result<(), Error> {
    let forgetting = Forgetting::Exponential { factor: T::from(0.96875) };
    let mut rls: RecursiveLeastSquares<T, Const<4>> =
        RecursiveLeastSquares::new(&Vector4::repeat(T::one()), forgetting)?
            .with_outliers(Outliers::Huber { threshold: T::one() })?;
    for k in 0..SAMPLES {
        let [(u1, y1), (u2, y2)] = [1, 2].map(|lag| lines.before(k, lag));
        let innovation = rls.update(&Vector4::new(-y1, -y2, u1, u2), lines.record[k].1)?;
        let mut errors = [T::NAN; 4];
        rls.write_standard_errors(&mut errors)?;
        let variance = rls.noise_variance().unwrap_or(T::NAN);
        let covariance = rls.covariance().matrix();
        let numbers = [rls.parameters().as_slice(), &errors, &[variance], covariance.as_slice()];
        lines.line("rls", k, Some(&innovation.into()), &numbers);
    }
    Ok(())
}

/// What a detector says of an innovation: its statistic, and the end of a line.
fn watched<T: Number>(detector: &mut ChangeDetector<T>, innovation: &Innovation<T>) -> (T, String) {
    let Some(Alarm { chart, statistic, samples }) = detector.update(innovation) else {
        return (T::zero(), " 0 0\n".to_owned());
    };
    let chart = 1 + Chart::ALL.iter().position(|other| *other == chart).expect("a chart");
    (statistic, format!(" {chart} {samples}\n"))
}

const INPUTS: &[InputOrders] = &[InputOrders { nb: 2, nk: 1 }];

/// What a fit knows: its parameters, P, and the noise variance.
type Fit<T, const N: usize> = (SVector<T, N>, Covariance<T, Const<N>>, T);

fn fit<T: Number, const N: usize>() -> Result<Fit<T, N>, Error> {
    let parameters = SVector::from_fn(|index, _| T::from([-0.5, -0.125, 0.125, 0.25, -0.25][index]));
    let factor = SMatrix::from_fn(|row, column| match row.cmp(&column) {
        Ordering::Equal => T::from(0.015625),
        Ordering::Less => T::from(0.25),
        Ordering::Greater => T::zero(),
    });
    Ok((parameters, Covariance::from_factor(factor)?, T::from(0.015625)))
}

type Arx<T> = RecursiveArx<T, Const<4>>;
type Armax<T> = RecursiveArmax<T, Const<5>>;

fn step_arx<T: Number>(
    lines: &mut Lines<T>,
    name: &str,
    start: impl FnOnce(Arx<T>) -> Result<Arx<T>, Error>,
) -> Result<(), Error> {
    let orders = ArxOrders { na: 2, inputs: INPUTS, constant: false };
    let forgetting = Forgetting::default();
    let mut arx = start(RecursiveArx::new(&orders, T::one(), &[T::one()], forgetting)?)?;
    let mut detector = ChangeDetector::new(T::from(2.0), T::from(3.0))?;
    for k in 0..SAMPLES {
        let innovation = arx.measured(lines.record[k].1)?;
        let mut ahead = [T::zero(); 3];
        arx.predict(&[1.0, 0.0, -1.0].map(T::from), &mut ahead)?;
        arx.applied(&[lines.record[k].0])?;
        let (statistic, end) = watched(&mut detector, &innovation);
        let parameters = arx.estimator().parameters().as_slice();
        lines.line(name, k, Some(&innovation.into()), &[parameters, &ahead, &[statistic]]);
        lines.text.pop();
        lines.text += &end;
    }
    Ok(())
}

fn step_armax<T: Number>(
    lines: &mut Lines<T>,
    name: &str,
    start: impl FnOnce(Armax<T>) -> Result<Armax<T>, Error>,
) -> Result<(), Error> {
    let orders = ArmaxOrders { na: 2, inputs: INPUTS, nc: 1, constant: false };
    let (method, noise) = (ArmaxMethod::PredictionError, T::from(0.125));
    let forgetting = Forgetting::default();
    let mut armax = start(RecursiveArmax::new(&orders, method, T::one(), &[T::one()], noise, forgetting)?)?;
    let mut detector = ChangeDetector::new(T::from(2.0), T::from(3.0))?;
    for k in 0..SAMPLES {
        let innovation = armax.measured(lines.record[k].1)?;
        let mut ahead = [T::zero(); 3];
        armax.predict(&[1.0, 0.0, -1.0].map(T::from), &mut ahead)?;
        armax.applied(&[lines.record[k].0])?;
        let (statistic, end) = watched(&mut detector, &innovation);
        let parameters = armax.estimator().parameters().as_slice();
        lines.line(name, k, Some(&innovation.into()), &[parameters, &ahead, &[statistic]]);
        lines.text.pop();
        lines.text += &end;
    }
    Ok(())
}

fn state_matrix<T: Number>() -> Matrix2<T> {
    Matrix2::new(1.0, 0.125, -0.25, 0.75).map(T::from)
}

fn transition<T: Number>(
    noise: Covariance<T, Const<2>>,
) -> Result<LinearTransition<T, Const<2>, Const<1>>, Error> {
    LinearTransition::new(state_matrix(), noise)?.with_input(Vector2::new(0.0, 0.5).map(T::from))
}

fn step_kalman<T: Number>(lines: &mut Lines<T>) -> Result<(), Error> {
    let transition = transition(Covariance::new(&Matrix2::new(0.25, 0.0, 0.0, 0.5).map(T::from))?)?;
    let noise = Covariance::new(&Matrix2::new(0.5, 0.0, 0.0, 1.0).map(T::from))?;
    let observation = LinearObservation::new(Matrix2::new(1.0, 0.0, 1.0, 0.5).map(T::from), noise)?
        .with_input(Vector2::repeat(T::zero()))?;
    let prior = Covariance::new(&Matrix2::new(4.0, 1.0, 1.0, 2.0).map(T::from))?;
    let kalman = KalmanFilter::new(Vector2::repeat(T::zero()), prior)?;
    let mut kalman = kalman.with_gate(T::from(2.0))?.with_release(2);
    for k in 0..SAMPLES {
        let (u, y) = lines.record[k];
        let measurement = Vector2::new(y, lines.before(k, 1).1);
        if k == 5 {
            kalman.set_state(if y > T::zero() { measurement } else { Vector2::repeat(T::zero()) })?;
            kalman.widen(T::from(4.0))?;
        }
        let innovation = kalman.correct(&observation, &Vector1::new(u), &measurement)?;
        kalman.predict(&transition, &Vector1::new(u))?;
        let covariance = kalman.covariance().matrix();
        let numbers = [kalman.state().as_slice(), covariance.as_slice()];
        lines.line("kalman", k, Some(&innovation.into()), &numbers);
    }
    Ok(())
}

/// A spring that hardens, and a gauge that bends.
struct Spring<T: Number> {
    process_noise: Covariance<T, Const<2>>,
    noise: Covariance<T, Const<1>>,
}

impl<T: Number> Transition<T, Const<2>, Const<1>> for Spring<T> {
    fn next(&self, x: &Vector2<T>, u: &Vector1<T>) -> Vector2<T> {
        let eight = T::from(8.0);
        Vector2::new(x.x + x.y / eight, x.y + (u.x - x.y - x.x - x.x * x.x * x.x) / eight)
    }

    fn next_jacobian(&self, x: &Vector2<T>, _: &Vector1<T>) -> Matrix2<T> {
        let stiffness = T::one() + T::from(3.0) * x.x * x.x;
        Matrix2::new(T::one(), T::from(0.125), -stiffness / T::from(8.0), T::from(0.875))
    }

    fn process_noise(&self, _: &Vector2<T>, _: &Vector1<T>) -> Covariance<T, Const<2>> {
        self.process_noise.clone()
    }
}

impl<T: Number> Observation<T, Const<2>, Const<1>, Const<1>> for Spring<T> {
    fn output(&self, x: &Vector2<T>, _: &Vector1<T>) -> Vector1<T> {
        Vector1::new(x.x + x.x * x.x / T::from(8.0))
    }

    fn output_jacobian(&self, x: &Vector2<T>, _: &Vector1<T>) -> SMatrix<T, 1, 2> {
        SMatrix::<T, 1, 2>::new(T::one() + x.x / T::from(4.0), T::zero())
    }

    fn measurement_noise(&self, _: &Vector2<T>, _: &Vector1<T>) -> Covariance<T, Const<1>> {
        self.noise.clone()
    }
}

/// The spring with its noises, and the covariance of its first state.
fn spring<T: Number>() -> Result<(Spring<T>, Covariance<T, Const<2>>), Error> {
    let spring = Spring {
        process_noise: Covariance::new(&Matrix2::new(0.25, 0.0, 0.0, 0.5).map(T::from))?,
        noise: Covariance::from_diagonal(&Vector1::new(T::from(0.5)))?,
    };
    Ok((spring, Covariance::new(&Matrix2::new(4.0, 1.0, 1.0, 2.0).map(T::from))?))
}

fn step_ekf<T: Number>(lines: &mut Lines<T>) -> Result<(), Error> {
    let (spring, prior) = spring()?;
    let mut ekf = ExtendedKalmanFilter::new(Vector2::repeat(T::zero()), prior)?.with_iterations(2)?;
    for k in 0..SAMPLES {
        let (u, y) = lines.record[k];
        let innovation = ekf.correct(&spring, &Vector1::new(u), &Vector1::new(y))?;
        ekf.predict(&spring, &Vector1::new(u))?;
        let covariance = ekf.covariance().matrix();
        lines.line("ekf", k, Some(&innovation.into()), &[ekf.state().as_slice(), covariance.as_slice()]);
    }
    Ok(())
}

fn step_ukf<T: Number>(lines: &mut Lines<T>) -> Result<(), Error> {
    let (spring, prior) = spring()?;
    let mut ukf = UnscentedKalmanFilter::new(Vector2::repeat(T::zero()), prior)?.with_spread(T::from(1.5))?;
    for k in 0..SAMPLES {
        let (u, y) = lines.record[k];
        let innovation = ukf.correct(&spring, &Vector1::new(u), &Vector1::new(y))?;
        ukf.predict(&spring, &Vector1::new(u))?;
        let covariance = ukf.covariance().matrix();
        lines.line("ukf", k, Some(&innovation.into()), &[ukf.state().as_slice(), covariance.as_slice()]);
    }
    Ok(())
}

fn step_luenberger<T: Number>(lines: &mut Lines<T>) -> Result<(), Error> {
    let transition = transition(Covariance::zero(Const))?;
    let noise: Covariance<T, Const<1>> = Covariance::zero(Const);
    let observation = LinearObservation::new(SMatrix::<T, 1, 2>::new(T::one(), T::zero()), noise)?
        .with_input(Vector1::new(T::zero()))?;
    let mut observer = LuenbergerObserver::new(Vector2::repeat(T::zero()), Vector2::repeat(T::zero()))?;
    let pole = |imaginary: f32| Complex::new(T::from(0.25), T::from(imaginary));
    let (none, one, poles) =
        (Vector1::new(T::zero()), Vector1::new(T::one()), Vector2::new(pole(0.125), pole(-0.125)));
    observer.place(&transition, &observation, &none, &one, &poles)?;
    for k in 0..SAMPLES {
        let (u, y) = lines.record[k];
        let innovation = observer.update(&transition, &observation, &Vector1::new(u), &Vector1::new(y))?;
        let numbers = [observer.gain().as_slice(), observer.state().as_slice()];
        lines.line("luenberger", k, Some(&innovation.into()), &numbers);
    }
    Ok(())
}

fn step_rst<T: Number>(lines: &mut Lines<T>) -> Result<(), Error> {
    let ([a, b], [response, observer]) = (
        [[1.0, -0.75], [0.0, 0.5]].map(|p| p.map(T::from)),
        [[1.0, -0.5], [1.0, -0.25]].map(|p| p.map(T::from)),
    );
    let wanted = WantedPoles::new(&response, &observer).with_integrator(true);
    let rst: RstController<T, Const<2>> = RstController::pole_placement(&a, &b, &wanted)?;
    let mut rst = rst.with_limits(-T::one()..=T::one())?;
    rst.start(T::from(0.5), lines.record[0].1, lines.record[0].0);
    for k in 0..SAMPLES {
        let (set_point, measurement) = lines.record[k];
        let input = rst.control(set_point, measurement);
        rst.applied(input / T::from(2.0));
        lines.line("rst", k, None, &[&[input], rst.r().as_slice(), rst.s().as_slice()]);
    }
    Ok(())
}

fn settings<T: Number>() -> TunerSettings<T> {
    // As C says them: the nearest numbers of each precision.
    let nearest = |tenths: usize| T::from_count(tenths) / T::from_count(10);
    let response = ResponseWanted { frequency: T::from(0.5), damping: nearest(9), observer: T::from(0.5) };
    TunerSettings::new(response, -T::from(4.0)..=T::from(4.0), T::one())
}

/// Steps a tuner in a closed loop with a plant of first order.
fn step_tuner<T: Number>(
    lines: &mut Lines<T>,
    name: &str,
    mut control: impl FnMut(T, T) -> (T, Vec<T>, TunerState),
) {
    let (mut input, mut output) = (T::zero(), T::zero());
    for k in 0..SAMPLES {
        let (set_point, noise) = lines.record[k];
        output = T::from(0.75) * output + input / T::from(2.0);
        let (next, found, state) = control(set_point, output + noise / T::from(64.0));
        input = next;
        lines.line(name, k, None, &[&[input], &found]);
        lines.text.pop();
        let state = match state {
            TunerState::Probing => 0,
            TunerState::Controlling => 1,
            TunerState::Bridging => 2,
            _ => 3,
        };
        writeln!(lines.text, " {state}").expect("text");
    }
}

fn step_indirect<T: Number>(lines: &mut Lines<T>) -> Result<(), Error> {
    let orders = TunerOrders { na: 1, nb: 1, nc: 0, constant: true, integrator: true };
    let (settings, one) = (settings::<T>(), T::one());
    let mut tuner: IndirectSelfTuner<T, Const<3>, Const<2>> =
        IndirectSelfTuner::new(&orders, &settings, one, one, Forgetting::default())?;
    step_tuner(lines, "indirect", |set_point, measurement| {
        let input = tuner.control(set_point, measurement);
        (input, tuner.plant().estimator().parameters().as_slice().to_vec(), tuner.state())
    });
    Ok(())
}

fn step_direct<T: Number>(lines: &mut Lines<T>) -> Result<(), Error> {
    let orders = DirectOrders { na: 1, nb: 1, delay: 1, constant: true };
    let (settings, one) = (settings::<T>(), T::one());
    let mut tuner: DirectSelfTuner<T, Const<3>, Const<1>, Const<2>> =
        DirectSelfTuner::new(&orders, &settings, one, one, Forgetting::default())?;
    step_tuner(lines, "direct", |set_point, measurement| {
        let input = tuner.control(set_point, measurement);
        (input, tuner.parameters().to_vec(), tuner.state())
    });
    Ok(())
}
