extern crate std;

use nalgebra::{Const, Matrix2, RowVector2, SMatrix, SVector, Vector1, Vector2, Vector3};

use crate::noise::Noise;
use crate::textbook::{difference, inverse, random, random_covariance, stable};
use crate::{
    Action, Covariance, Error, ExtendedKalmanFilter, KalmanFilter, LinearObservation, LinearTransition,
    Observation, Real, Transition, UnscentedKalmanFilter,
};

type None = SVector<f64, 0>;

fn variances<T: Real, const N: usize>(values: [f64; N]) -> Covariance<T, Const<N>> {
    Covariance::from_diagonal(&SVector::from(values).map(nalgebra::convert)).unwrap()
}

fn check_linear_model<T: Real, const N: usize, const M: usize>(seed: u64, tolerance: f64) {
    let mut noise = Noise(seed);
    let matrix = |noise: &mut Noise| -> SMatrix<T, N, N> { nalgebra::convert(random_covariance::<N>(noise)) };
    let f: SMatrix<T, N, N> = nalgebra::convert(stable::<N>(&mut noise, 1.0));
    let g: SMatrix<T, N, 2> = nalgebra::convert(random::<N, 2>(&mut noise));
    let h: SMatrix<T, M, N> = nalgebra::convert(random::<M, N>(&mut noise));
    let d: SMatrix<T, M, 2> = nalgebra::convert(random::<M, 2>(&mut noise));
    let r: SMatrix<T, M, M> = nalgebra::convert(random_covariance::<M>(&mut noise));
    let q = Covariance::new(&matrix(&mut noise)).unwrap();
    let model = LinearTransition::new(f, q).unwrap().with_input(g).unwrap();
    let sensor = LinearObservation::new(h, Covariance::new(&r).unwrap()).unwrap().with_input(d).unwrap();
    let start: SVector<T, N> = nalgebra::convert(random::<N, 1>(&mut noise));
    let prior = Covariance::new(&(matrix(&mut noise) * nalgebra::convert::<f64, T>(100.0))).unwrap();
    let gate = nalgebra::convert(20.0);

    let mut filter =
        KalmanFilter::new(start, prior.clone()).unwrap().with_gate(gate).unwrap().with_release(1);
    let mut unscented =
        UnscentedKalmanFilter::new(start, prior).unwrap().with_gate(gate).unwrap().with_release(1);
    let (mut gated, mut released) = (0, 0);
    for k in 0..60 {
        let u: SVector<T, 2> = nalgebra::convert(random::<2, 1>(&mut noise));
        let mut y: SVector<T, M> = nalgebra::convert(random::<M, 1>(&mut noise));
        match k % 15 {
            1 | 6 | 11 => y[k % M] = T::NAN,
            2 | 7 | 8 | 9 => y *= nalgebra::convert::<f64, T>(60.0),
            _ => (),
        }
        filter.predict(&model, &u).unwrap();
        unscented.predict(&model, &u).unwrap();
        let (expected, covariance) = unscented.expected(&sensor, &u).unwrap();
        let double = |value: T| -> f64 { nalgebra::try_convert(value).unwrap() };
        let size = 1.0 + double(filter.state().amax());
        let s = filter.innovation_covariance(&sensor).unwrap();
        assert!(difference(&covariance.matrix().map(double), &s.matrix().map(double)) < tolerance);
        let innovation = filter.correct(&sensor, &u, &y).unwrap();
        let found = unscented.correct(&sensor, &u, &y).unwrap();
        assert_eq!(innovation.action, found.action);
        assert!(double((innovation.nis - found.nis).abs()) < tolerance * (10.0 + double(found.nis)));
        for i in (0..M).filter(|&i| y[i].partial_cmp(&y[i]).is_some()) {
            assert!(double((innovation.error[i] - found.error[i]).abs()) < tolerance * size);
            assert!(double((y[i] - expected[i] - found.error[i]).abs()) < tolerance * size);
        }
        assert!(double((filter.state() - unscented.state()).amax()) < tolerance * size);
        let (p, found_p) = (filter.covariance().matrix(), unscented.covariance().matrix());
        assert!(difference(&p.map(double), &found_p.map(double)) < tolerance);
        assert_eq!(filter.gated_in_a_row(), unscented.gated_in_a_row());
        gated += usize::from(found.action == Action::Gated);
        released += usize::from(found.action == Action::Released);
    }
    assert!(gated > 0 && released > 0, "{gated} {released}");
}

#[test]
fn on_a_linear_model_it_is_the_kalman_filter_to_rounding() {
    check_linear_model::<f64, 3, 2>(1, 1e-12);
    check_linear_model::<f64, 5, 1>(2, 1e-12);
    check_linear_model::<f64, 8, 3>(4, 1e-12);
    check_linear_model::<f32, 2, 3>(3, 1e-3);
}

/// A plant that bends in all of its states: three tanks that drain by the root of their levels, of which the first is
/// seen by the square and the sum by an exponential.
struct Tanks;

impl Transition<f64, Const<3>, Const<1>> for Tanks {
    fn next(&self, x: &Vector3<f64>, u: &Vector1<f64>) -> Vector3<f64> {
        let flow = x.map(|level| 0.3 * level.abs().sqrt() * level.signum());
        Vector3::new(
            x[0] - flow[0] + u[0],
            x[1] + flow[0] - flow[1] + 0.02 * x[0] * x[2],
            x[2] + flow[1] - flow[2],
        )
    }
    fn process_noise(&self, x: &Vector3<f64>, _: &Vector1<f64>) -> Covariance<f64, Const<3>> {
        variances([0.01, 0.02 * (1.0 + x[0].abs()), 0.01])
    }
}

impl Observation<f64, Const<3>, Const<2>, Const<1>> for Tanks {
    fn output(&self, x: &Vector3<f64>, u: &Vector1<f64>) -> Vector2<f64> {
        Vector2::new(x[0] * x[0] + 0.1 * u[0], (0.2 * (x[0] + x[1] + x[2])).exp())
    }
    fn measurement_noise(&self, _: &Vector3<f64>, _: &Vector1<f64>) -> Covariance<f64, Const<2>> {
        Covariance::new(&Matrix2::new(0.2, 0.05, 0.05, 0.1)).unwrap()
    }
}

/// The same filter written out on whole matrices: points along the columns of U √D, their sums of weighted products,
/// K = C S⁻¹, and P - K S K'.
struct Dense {
    x: Vector3<f64>,
    p: SMatrix<f64, 3, 3>,
    c: f64,
}

/// Mean, covariance and cross covariance of a function.
type Moments<const R: usize> = (SVector<f64, R>, SMatrix<f64, R, R>, SMatrix<f64, 3, R>);

impl Dense {
    fn moments<const R: usize>(&self, g: impl Fn(&Vector3<f64>) -> SVector<f64, R>) -> Moments<R> {
        let c2 = self.c * self.c;
        // U √D by elimination from the last element: P = L L', L upper triangular.
        let (mut rest, mut root) = (self.p, SMatrix::<f64, 3, 3>::zeros());
        for k in (0..3).rev() {
            let deviation = rest[(k, k)].sqrt();
            let column = rest.column(k) / deviation;
            root.set_column(k, &column);
            rest -= column * column.transpose();
        }
        let centre = g(&self.x);
        let (mut mean, mut covariance, mut cross) = (centre, SMatrix::zeros(), SMatrix::zeros());
        for k in 0..3 {
            let column: Vector3<f64> = root.column(k).into();
            let (ahead, behind) = (g(&(self.x + self.c * column)), g(&(self.x - self.c * column)));
            mean += (ahead + behind - 2.0 * centre) / (2.0 * c2);
            let (first, second) = (ahead - behind, ahead + behind - 2.0 * centre);
            covariance += first * first.transpose() / (4.0 * c2)
                + second * second.transpose() * (c2 - 1.0) / (4.0 * c2 * c2);
            cross += column * first.transpose() / (2.0 * self.c);
        }
        (mean, covariance, cross)
    }

    fn predict(&mut self, u: &Vector1<f64>) {
        let (mean, covariance, _) = self.moments(|x| Tanks.next(x, u));
        self.p = covariance + Tanks.process_noise(&self.x, u).matrix();
        self.x = mean;
    }

    fn correct(&mut self, u: &Vector1<f64>, y: &Vector2<f64>) -> f64 {
        let (mean, covariance, cross) = self.moments(|x| Tanks.output(x, u));
        let s = covariance + Tanks.measurement_noise(&self.x, u).matrix();
        let (e, gain) = (y - mean, cross * inverse(&s));
        self.x += gain * e;
        self.p -= gain * s * gain.transpose();
        (e.transpose() * inverse(&s) * e)[0]
    }
}

#[test]
fn it_is_the_filter_written_out_on_whole_matrices() {
    for spread in [3.0_f64.sqrt(), 1.0, 2.5] {
        let mut noise = Noise(11);
        let p = random_covariance::<3>(&mut noise) * 0.1;
        let start = Vector3::new(2.0, 1.5, 1.0);
        let mut dense = Dense { x: start, p, c: spread };
        let filter = UnscentedKalmanFilter::new(start, Covariance::new(&p).unwrap()).unwrap();
        let mut filter = filter.with_spread(spread).unwrap();
        assert_eq!(filter.spread(), spread);
        let mut truth = Vector3::new(2.2, 1.2, 1.1);
        for k in 0..100 {
            let u = Vector1::new(0.35 + 0.1 * noise.next());
            truth = Tanks.next(&truth, &u);
            let y = Tanks.output(&truth, &u) + 0.3 * random::<2, 1>(&mut noise);
            filter.predict(&Tanks, &u).unwrap();
            dense.predict(&u);
            let innovation = filter.correct(&Tanks, &u, &y).unwrap();
            let nis = dense.correct(&u, &y);
            assert!((innovation.nis - nis).abs() < 1e-9 * (1.0 + nis), "{k}: {} {nis}", innovation.nis);
            assert!((filter.state() - dense.x).amax() < 1e-9, "{k}");
            assert!(difference(&filter.covariance().matrix(), &dense.p) < 1e-9, "{k}");
        }
    }
}

/// A point in the plane, from polar coordinates: distance and angle.
struct Polar;

impl Transition<f64, Const<2>> for Polar {
    fn next(&self, x: &Vector2<f64>, _: &None) -> Vector2<f64> {
        Vector2::new(x[0] * x[1].cos(), x[0] * x[1].sin())
    }
    fn next_jacobian(&self, x: &Vector2<f64>, _: &None) -> Matrix2<f64> {
        Matrix2::new(x[1].cos(), -x[0] * x[1].sin(), x[1].sin(), x[0] * x[1].cos())
    }
    fn process_noise(&self, _: &Vector2<f64>, _: &None) -> Covariance<f64, Const<2>> {
        Covariance::zero(Const)
    }
}

/// Julier and Uhlmann 2004, section III: a sonar sees a target at (0, 1), 2 cm and 15 degrees off.
#[test]
fn a_polar_measurement_has_its_mean_inside_the_arc() {
    let (distance, angle) = (0.02, 15.0_f64.to_radians());
    let start = Vector2::new(1.0, std::f64::consts::FRAC_PI_2);
    let prior = variances([distance * distance, angle * angle]);
    let mut unscented = UnscentedKalmanFilter::new(start, prior.clone()).unwrap();
    let mut extended = ExtendedKalmanFilter::new(start, prior).unwrap();
    unscented.predict(&Polar, &None::zeros()).unwrap();
    extended.predict(&Polar, &None::zeros()).unwrap();
    // r and theta are independent and Gaussian: E cos θ = exp(-σ²/2) around the middle, and so on.
    let (e1, e2) = ((-angle * angle / 2.0).exp(), (-2.0 * angle * angle).exp());
    let square = 1.0 + distance * distance;
    let variance = [square * (1.0 - e2) / 2.0, square * f64::midpoint(1.0, e2) - e1 * e1];
    let (found, p) = (unscented.state(), unscented.covariance().matrix());
    assert!(found[0].abs() < 1e-12 && (found[1] - e1).abs() < 1e-4, "{found} {e1}");
    assert!((p[(0, 0)] / variance[0] - 1.0).abs() < 0.01, "{p} {variance:?}");
    assert!((p[(1, 1)] / variance[1] - 1.0).abs() < 0.2, "{p} {variance:?}");
    // The extended filter is off by 1.7 deviations of the distance, and thinks it is sure.
    let (biased, p) = (extended.state(), extended.covariance().matrix());
    assert!((biased[1] - e1) / distance > 1.6 && p[(1, 1)] < 0.3 * variance[1], "{biased} {p}");
}

/// The distance of a point in the plane from the origin.
struct Range(f64);

impl Observation<f64, Const<2>, Const<1>> for Range {
    fn output(&self, x: &Vector2<f64>, _: &None) -> Vector1<f64> {
        Vector1::new(x.norm())
    }
    fn output_jacobian(&self, x: &Vector2<f64>, _: &None) -> RowVector2<f64> {
        x.transpose() / x.norm()
    }
    fn measurement_noise(&self, _: &Vector2<f64>, _: &None) -> Covariance<f64, Const<1>> {
        variances([self.0])
    }
}

/// The exponential of a number.
struct Exponential(f64);

impl Observation<f64, Const<1>, Const<1>> for Exponential {
    fn output(&self, x: &Vector1<f64>, _: &None) -> Vector1<f64> {
        x.map(f64::exp)
    }
    fn output_jacobian(&self, x: &Vector1<f64>, _: &None) -> Vector1<f64> {
        x.map(f64::exp)
    }
    fn measurement_noise(&self, _: &Vector1<f64>, _: &None) -> Covariance<f64, Const<1>> {
        variances([self.0])
    }
}

/// Of one measurement each of many states drawn from the prior: the mean normalised estimation error squared, divided
/// by the number of states, the mean normalised innovation squared (1 if the filter is honest), and the mean squared
/// error, of the unscented, the extended and the iterated extended filter.
fn consistency<const N: usize>(
    (mean, deviation): (SVector<f64, N>, f64),
    (sensor, sd): (&impl Observation<f64, Const<N>, Const<1>>, f64),
) -> [[f64; 3]; 3] {
    const RUNS: usize = 4000;
    let prior: Covariance<f64, Const<N>> = variances([deviation * deviation; N]);
    let (mut noise, mut sums) = (Noise(21), [[0.0; 3]; 3]);
    for _ in 0..RUNS {
        let truth = SVector::from_fn(|state, _| mean[state] + deviation * noise.normal());
        let y = sensor.output(&truth, &None::zeros()).add_scalar(sd * noise.normal());
        let mut unscented = UnscentedKalmanFilter::new(mean, prior.clone()).unwrap();
        let nis = unscented.correct(sensor, &None::zeros(), &y).unwrap().nis;
        let extended = [1, 20].map(|iterations| {
            let filter = ExtendedKalmanFilter::new(mean, prior.clone()).unwrap();
            let mut filter = filter.with_iterations(iterations).unwrap();
            let nis = filter.correct(sensor, &None::zeros(), &y).unwrap().nis;
            (*filter.state(), filter.covariance().matrix(), nis)
        });
        let all = [(*unscented.state(), unscented.covariance().matrix(), nis)].into_iter().chain(extended);
        for (sums, (x, p, nis)) in sums.iter_mut().zip(all) {
            let error = truth - x;
            sums[0] += (error.transpose() * inverse(&p) * error)[0] / N as f64;
            sums[1] += nis;
            sums[2] += error.norm_squared();
        }
    }
    sums.map(|sums| sums.map(|sum| sum / RUNS as f64))
}

#[test]
fn it_is_honest_where_linearisation_promises_too_much() {
    // A distance bends across the line of sight, where it says nothing: iterations do not help.
    let [unscented, extended, iterated] = consistency((Vector2::new(2.0, 0.0), 0.6), (&Range(0.0025), 0.05));
    std::println!("range: {unscented:?} {extended:?} {iterated:?}");
    // Within a seventh: four deviations of a mean of 4000 are 9 % of a chi-square of one degree of freedom.
    assert!((unscented[0] - 1.0).abs() < 0.14 && (unscented[1] - 1.0).abs() < 0.14, "{unscented:?}");
    assert!(extended[0] > 4.0 && iterated[0] > 4.0, "{extended:?} {iterated:?}");
    assert!(unscented[2] < extended[2], "{unscented:?} {extended:?}");
    // An exponential bends along what it measures: there iterations find the state, and P is right about it.
    let [unscented, extended, iterated] = consistency((Vector1::new(1.0), 0.4), (&Exponential(0.0025), 0.05));
    std::println!("exponential: {unscented:?} {extended:?} {iterated:?}");
    assert!((iterated[0] - 1.0).abs() < 0.14, "{iterated:?}");
    assert!(unscented[0] < 1.5 && extended[0] > 10.0, "{unscented:?} {extended:?}");
    assert!(
        unscented[2] < 0.8 * extended[2] && iterated[2] < 0.1 * extended[2],
        "{unscented:?} {extended:?}"
    );
}

/// What is wrong with a model, at which point it shows.
struct Wrong(&'static str);

impl Transition<f64, Const<2>> for Wrong {
    fn next(&self, x: &Vector2<f64>, _: &None) -> Vector2<f64> {
        // The logarithm of a negative number, at a point only.
        if self.0 == "value" { Vector2::new((x[0] - 0.1).ln(), x[1]) } else { *x }
    }
    fn process_noise(&self, _: &Vector2<f64>, _: &None) -> Covariance<f64, Const<2>> {
        if self.0 == "noise" { Covariance::unknown(Const) } else { Covariance::zero(Const) }
    }
}

impl Observation<f64, Const<2>, Const<1>> for Wrong {
    fn output(&self, x: &Vector2<f64>, none: &None) -> Vector1<f64> {
        Vector1::new(self.next(x, none)[0])
    }
    fn measurement_noise(&self, _: &Vector2<f64>, _: &None) -> Covariance<f64, Const<1>> {
        if self.0 == "noise" { Covariance::unknown(Const) } else { variances([1.0]) }
    }
}

#[test]
fn errors_change_nothing() {
    let mut filter = UnscentedKalmanFilter::new(Vector2::new(1.0, 2.0), variances([1.0, 1.0])).unwrap();
    let (before, none, y) = (filter.clone(), None::zeros(), Vector1::new(1.0));
    for (fault, ahead, seen) in
        [("value", "next state", "predicted measurement"), ("noise", "transition noise", "observation noise")]
    {
        let wrong = Wrong(fault);
        assert_eq!(filter.predict(&wrong, &none), Err(Error::NotFinite { argument: ahead }));
        assert_eq!(filter.correct(&wrong, &none, &y), Err(Error::NotFinite { argument: seen }));
        assert_eq!(filter.expected(&wrong, &none).unwrap_err(), Error::NotFinite { argument: seen });
    }
    let right = Wrong("nothing");
    let infinite = Vector1::new(f64::INFINITY);
    let error = filter.correct(&right, &none, &infinite).unwrap_err();
    assert_eq!(error, Error::Infinite { argument: "measurement" });
    assert_eq!(filter.correct(&right, &none, &Vector1::new(f64::NAN)).unwrap().action, Action::Missing);
    assert_eq!(filter, before);
    for spread in [0.9, 11.0, f64::NAN, f64::INFINITY] {
        let error = filter.set_spread(spread).unwrap_err();
        assert_eq!(error, Error::OutOfRange { argument: "spread", range: "1 to 10" });
    }
    // An extended filter asks for the Jacobian that this model has not.
    let mut extended = ExtendedKalmanFilter::new(Vector2::new(1.0, 2.0), variances([1.0, 1.0])).unwrap();
    let error = extended.predict(&right, &none).unwrap_err();
    assert_eq!(error, Error::NotFinite { argument: "transition Jacobian" });
    let error = extended.correct(&right, &none, &y).unwrap_err();
    assert_eq!(error, Error::NotFinite { argument: "observation Jacobian" });
}

#[test]
fn what_is_known_stays_known() {
    // Of three states two are known; a state at 0 with no variance has no points at all.
    let mut filter =
        UnscentedKalmanFilter::new(Vector3::new(2.0, 0.0, 1.0), variances([0.3, 0.0, 0.0])).unwrap();
    let u = Vector1::new(0.4);
    struct Still;
    impl Transition<f64, Const<3>, Const<1>> for Still {
        fn next(&self, x: &Vector3<f64>, u: &Vector1<f64>) -> Vector3<f64> {
            Vector3::new(0.9 * x[0] + u[0] + x[2] * x[2], x[1], x[2])
        }
        fn process_noise(&self, _: &Vector3<f64>, _: &Vector1<f64>) -> Covariance<f64, Const<3>> {
            Covariance::zero(Const)
        }
    }
    for _ in 0..20 {
        filter.predict(&Still, &u).unwrap();
        filter.correct(&Tanks, &u, &Vector2::new(4.0, f64::NAN)).unwrap();
    }
    assert!(filter.state().iter().all(|x| x.is_finite()));
    assert_eq!((filter.state()[1], filter.state()[2]), (0.0, 1.0));
    assert_eq!(filter.covariance().variances().as_slice()[1..], [0.0, 0.0]);
}

/// Two numbers near 3000 that are known to a thousandth: single precision resolves a quarter of that.
#[test]
fn points_are_far_enough_for_single_precision() {
    let model = LinearTransition::new(Matrix2::new(1.0_f32, 0.0, 0.0, 0.9), variances([1e-8, 1e-8])).unwrap();
    let sensor = LinearObservation::new(RowVector2::new(1.0_f32, 1.0), variances([1e-6])).unwrap();
    let start = Vector2::new(3000.0, 2900.0);
    let mut filter = KalmanFilter::new(start, variances([1e-6, 4e-6])).unwrap();
    let mut unscented = UnscentedKalmanFilter::new(start, variances([1e-6, 4e-6])).unwrap();
    for _ in 0..50 {
        filter.predict(&model, &SVector::zeros()).unwrap();
        unscented.predict(&model, &SVector::zeros()).unwrap();
        let y = Vector1::new(filter.state().sum());
        filter.correct(&sensor, &SVector::zeros(), &y).unwrap();
        unscented.correct(&sensor, &SVector::zeros(), &y).unwrap();
    }
    let (p, found) = (filter.covariance().matrix(), unscented.covariance().matrix());
    assert!(difference(&p.map(f64::from), &found.map(f64::from)) < 0.02, "{p} {found}");
}

#[cfg(feature = "alloc")]
#[test]
fn its_smoother_is_the_unscented_one() {
    use crate::Smoother;
    use std::vec::Vec;

    let mut noise = Noise(5);
    let (p, start) = (random_covariance::<3>(&mut noise) * 0.1, Vector3::new(2.0, 1.5, 1.0));
    let mut dense = Dense { x: start, p, c: 3.0_f64.sqrt() };
    let filter = UnscentedKalmanFilter::new(start, Covariance::new(&p).unwrap()).unwrap();
    let mut smoother = Smoother::from(filter);
    let (mut truth, mut kept) = (start, Vec::new());
    for _ in 0..40 {
        let u = Vector1::new(0.35 + 0.1 * noise.next());
        truth = Tanks.next(&truth, &u);
        let y = Tanks.output(&truth, &u) + 0.3 * random::<2, 1>(&mut noise);
        smoother.predict(&Tanks, &u).unwrap();
        smoother.correct(&Tanks, &u, &y).unwrap();
        let (before, cross) = ((dense.x, dense.p), dense.moments(|x| Tanks.next(x, &u)).2);
        dense.predict(&u);
        kept.push((before, cross, dense.x, dense.p));
        dense.correct(&u, &y);
    }
    assert_eq!(smoother.filter().spread(), 3.0_f64.sqrt());
    // Särkkä 2008: G = C P⁻¹ back from the predicted state.
    let (mut x, mut p) = (dense.x, dense.p);
    let smoothed = smoother.smooth().unwrap();
    for (sample, ((filtered, covariance), cross, ahead, wide)) in
        smoothed.iter().rev().skip(1).zip(kept.iter().rev())
    {
        let gain = cross * inverse(wide);
        x = filtered + gain * (x - ahead);
        p = covariance + gain * (p - wide) * gain.transpose();
        assert!((sample.state - x).amax() < 1e-8, "{} {x}", sample.state);
        assert!(difference(&sample.covariance, &p) < 1e-8);
    }
}
