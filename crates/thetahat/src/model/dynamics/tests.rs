//! What follows from polynomials, against finite differences and against the spread of sampled models.

use thetahat_numerics::distribution::two_sided;
use thetahat_numerics::noise::Noise;

use super::*;
use crate::model::{Orders, polynomial::product};

/// A square root of a covariance matrix, and the matrix.
struct Spread {
    factor: Vec<Vec<f64>>,
    covariance: Vec<Vec<f64>>,
}

impl Spread {
    /// Well conditioned and not diagonal.
    fn random(count: usize, size: f64, noise: &mut Noise) -> Self {
        let row = |noise: &mut Noise| noise.take(count).iter().map(|value| size * value).collect();
        Self::of((0..count).map(|_| row(noise)).collect())
    }

    fn of(factor: Vec<Vec<f64>>) -> Self {
        let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum();
        let row = |a: &Vec<f64>| factor.iter().map(|b| product(a, b)).collect();
        Self { covariance: factor.iter().map(row).collect(), factor }
    }

    /// Normal parameters around some, nearly: sums of twelve uniform numbers.
    fn sample(&self, around: &[f64], noise: &mut Noise) -> Vec<f64> {
        let columns = self.factor.first().map_or(0, Vec::len);
        let normal: Vec<f64> = (0..columns).map(|_| noise.take(12).iter().sum::<f64>() / 2.0).collect();
        let moved = |row: &Vec<f64>| row.iter().zip(&normal).map(|(a, b)| a * b).sum::<f64>();
        around.iter().zip(&self.factor).map(|(value, row)| value + moved(row)).collect()
    }
}

/// A of two real poles, an input with F of a pair and one without F, C and D.
fn orders() -> Orders {
    Orders::new(2, &[3, 2], 1, 2, &[2, 0], &[1, 0]).unwrap()
}

fn parameters() -> Vec<f64> {
    let a = product(&[1.0, -0.9], &[1.0, -0.4]);
    let d = product(&[1.0, -0.5], &[1.0, 0.7]);
    // The zeros of the first B lie at -3 and 0.6.
    let first = product(&[0.5, 1.5], &[1.0, -0.6]);
    [&a[1..], &first, &[2.0, 1.0], &[0.3], &d[1..], &[-1.4, 0.8]].concat()
}

fn model(parameters: &[f64], covariance: Option<&[Vec<f64>]>) -> PolynomialModel {
    PolynomialModel::from_parameters(&orders(), parameters, covariance, 1.0, 0.5).unwrap()
}

/// All figures of a model in one list: the parts of each root, time constants, gains.
fn figures(model: &PolynomialModel) -> Vec<f64> {
    let roots = model.poles.iter().chain(model.zeros.iter().flatten());
    let roots = roots.chain(&model.noise_poles).chain(&model.noise_zeros);
    let mut figures: Vec<f64> = roots.flat_map(|root| [root.re, root.im]).collect();
    figures.extend(model.time_constants.iter().chain(&model.dc_gain).map(|q| q.unwrap().value));
    figures
}

/// Their standard errors in the same order.
fn errors(model: &PolynomialModel) -> Vec<f64> {
    let roots = model.poles.iter().chain(model.zeros.iter().flatten());
    let roots = roots.chain(&model.noise_poles).chain(&model.noise_zeros);
    let mut errors: Vec<f64> = roots
        .flat_map(|root| {
            let [[rr, _], [_, ii]] = root.covariance.unwrap();
            [rr.sqrt(), ii.sqrt()]
        })
        .collect();
    let quantities = model.time_constants.iter().chain(&model.dc_gain);
    errors.extend(quantities.map(|quantity| quantity.unwrap().standard_error.unwrap()));
    errors
}

#[test]
fn roots_are_named_and_in_their_places() {
    let model = model(&parameters(), None);
    let names = |roots: &[Root]| roots.iter().map(|root| root.polynomial.clone()).collect::<Vec<_>>();
    assert_eq!(names(&model.poles), ["a", "a", "f1", "f1"]);
    assert_eq!(names(&model.zeros[0]), ["b1", "b1"]);
    assert_eq!(names(&model.zeros[1]), ["b2"]);
    assert_eq!(
        (names(&model.noise_poles), names(&model.noise_zeros)),
        (vec!["d".into(); 2], vec!["c".into()])
    );
    let near = |root: &Root, re: f64, im: f64| (root.re - re).hypot(root.im - im) < 1e-13;
    assert!(near(&model.poles[0], 0.9, 0.0) && near(&model.poles[1], 0.4, 0.0));
    assert!(near(&model.poles[2], 0.7, 0.31_f64.sqrt()) && near(&model.poles[3], 0.7, -0.31_f64.sqrt()));
    assert!(near(&model.zeros[0][0], -3.0, 0.0) && near(&model.zeros[0][1], 0.6, 0.0));
    assert!(near(&model.noise_poles[0], -0.7, 0.0) && near(&model.noise_zeros[0], -0.3, 0.0));
    let value = |quantity: Option<Quantity>| quantity.unwrap().value;
    // B(1)/(A(1) F(1)) = 4 0.4 0.5/(0.1 0.6 0.4), and 3/(0.1 0.6) without F.
    assert!((value(model.dc_gain[0]) / (0.8 / 0.024) - 1.0).abs() < 1e-12);
    assert!((value(model.dc_gain[1]) / 50.0 - 1.0).abs() < 1e-12);
    assert!((value(model.time_constants[2]) + 0.5 / 0.8_f64.sqrt().ln()).abs() < 1e-12);
    assert!(model.poles.iter().all(|root| root.covariance.is_none()));
    let quantities = model.dc_gain.iter().chain(&model.time_constants);
    assert!(quantities.flatten().all(|quantity| quantity.standard_error.is_none()));
    // With one input the letters stand alone.
    let oe = Orders::oe(&[2], &[1], &[1]).unwrap();
    let oe = PolynomialModel::from_parameters(&oe, &[1.0, 0.5, -0.9], None, 1.0, 1.0).unwrap();
    assert_eq!((names(&oe.poles), names(&oe.zeros[0])), (vec!["f".into()], vec!["b".into()]));
}

#[test]
fn covariances_are_those_of_finite_differences() {
    let mut noise = Noise(1);
    let center = parameters();
    let spread = Spread::random(center.len(), 1e-3, &mut noise);
    let described = model(&center, Some(&spread.covariance));
    let step = 1e-6;
    let moved = |k: usize, by: f64| {
        let mut moved = center.clone();
        moved[k] += by;
        figures(&model(&moved, None))
    };
    let sides: Vec<_> = (0..center.len()).map(|k| (moved(k, step), moved(k, -step))).collect();
    // J times the square root of the covariance.
    let slopes = |figure: usize| -> Vec<f64> {
        let slope = |column: usize| {
            let moved = sides.iter().zip(&spread.factor);
            moved
                .map(|((up, down), row)| (up[figure] - down[figure]) / (2.0 * step) * row[column])
                .sum::<f64>()
        };
        (0..center.len()).map(slope).collect()
    };
    let inner = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    for (figure, error) in errors(&described).iter().enumerate() {
        let expected = inner(&slopes(figure), &slopes(figure)).sqrt();
        assert!((error - expected).abs() <= 1e-7 * expected.max(1e-3), "{figure} {error} {expected}");
    }
    // The pair of F: all of its covariance.
    let [[_, across], [again, _]] = described.poles[2].covariance.unwrap();
    let expected = inner(&slopes(4), &slopes(5));
    assert!((across - expected).abs() < 1e-7 * expected.abs() && again == across);
}

#[test]
fn standard_errors_are_the_spread_of_sampled_models() {
    let mut noise = Noise(2);
    let center = parameters();
    let spread = Spread::random(center.len(), 3e-4, &mut noise);
    let described = model(&center, Some(&spread.covariance));
    let middle = figures(&described);
    let runs = 4000;
    let mut squares = vec![0.0; middle.len()];
    for _ in 0..runs {
        let sample = figures(&model(&spread.sample(&center, &mut noise), None));
        let figures = sample.iter().zip(&middle).zip(&mut squares);
        figures.for_each(|((sample, middle), square)| *square += (sample - middle).powi(2));
    }
    for (figure, (error, square)) in errors(&described).iter().zip(&squares).enumerate() {
        let found = (square / f64::from(runs)).sqrt();
        // 1.1 % from this many samples, four times, and 1 % for what is not of first order.
        assert!((found - error).abs() <= 0.055 * error, "{figure} {found} {error}");
    }
}

/// An AR model of some poles, and the same standard error for each coefficient.
fn autoregression(poles: &[f64], error: f64) -> PolynomialModel {
    let a = poles.iter().fold(vec![1.0], |a, pole| product(&a, &[1.0, -pole]));
    let orders = Orders::arx(poles.len(), &[], &[]).unwrap();
    let factor =
        (0..poles.len()).map(|i| (0..poles.len()).map(|j| if i == j { error } else { 0.0 }).collect());
    let spread = Spread::of(factor.collect());
    PolynomialModel::from_parameters(&orders, &a[1..], Some(&spread.covariance), 1.0, 1.0).unwrap()
}

#[test]
fn roots_that_may_meet_have_no_covariance() {
    // dz/da_k of a pole at 0.5 beside one at 0.6: -z^(2-k)/0.1.
    let deviation = |error: f64| error * (0.25 + 1.0_f64).sqrt() / 0.1;
    let limit = 0.1 / APART / deviation(1.0);
    let apart = autoregression(&[0.5, 0.6], 0.9 * limit);
    assert!(apart.poles[1].covariance.is_some() && apart.time_constants[1].unwrap().standard_error.is_some());
    let close = autoregression(&[0.5, 0.6], 1.1 * limit);
    assert!(close.poles[1].covariance.is_none() && close.time_constants[1].unwrap().standard_error.is_none());
    assert_eq!(autoregression(&[0.5, 0.5], 0.01).poles[0].covariance, None);
    assert_eq!(autoregression(&[0.0, 0.0], 0.01).poles[0].covariance, None);
    // A single pole at the origin has one; its time constant, 0, has not.
    let origin = autoregression(&[0.0], 0.01);
    assert!((origin.poles[0].covariance.unwrap()[0][0] - 1e-4).abs() < 1e-18);
    assert_eq!(origin.time_constants[0], Some(Quantity::new(0.0, None)));
}

#[test]
fn large_roots_do_not_overflow() {
    // B = 1e-3 + q^-1 + … with zeros at -1e3, and one of 1e100.
    for (b, size) in [(vec![1e-3, 1.0], 1e3), (vec![1e-100, 1.0, 0.5, 0.1], 1e100)] {
        let orders = Orders::arx(0, &[b.len()], &[2]).unwrap();
        let spread = Spread::of((0..b.len()).map(|i| vec![if i == 0 { 1e-6 * b[0] } else { 0.0 }]).collect());
        let model =
            PolynomialModel::from_parameters(&orders, &b, Some(&spread.covariance), 1.0, 1.0).unwrap();
        let zero = &model.zeros[0][0];
        // z = -b1/b0 there: its relative error is that of b0.
        assert!((zero.re / size + 1.0).abs() < 1e-12, "{zero:?}");
        let error = zero.covariance.unwrap()[0][0].sqrt() / size;
        assert!((error / 1e-6 - 1.0).abs() < 1e-6, "{zero:?}");
    }
    // A variance beyond the range of numbers is none.
    let orders = Orders::arx(0, &[2], &[0]).unwrap();
    let covariance = vec![vec![1.0, 0.0], vec![0.0, 1.0]];
    let model =
        PolynomialModel::from_parameters(&orders, &[1e-200, 1.0], Some(&covariance), 1.0, 1.0).unwrap();
    assert_eq!(model.zeros[0][0].covariance, None);
}

#[test]
fn a_variance_below_zero_is_unknown_and_one_within_rounding_is_zero() {
    let one = |slope: f64| Complex::new(slope, 0.0);
    let gradient: Gradient = vec![(0, one(1.0)), (1, one(-1.0))];
    let found = |correlation: f64| {
        let rows = [vec![2.0, 2.0 * correlation], vec![2.0 * correlation, 2.0]];
        covariance(&rows, &gradient).map(|rows| rows[0][0])
    };
    // 4 - 4 rho; the sum of sizes is 8, and two terms have 64 eps.
    assert_eq!(found(1.0), Some(0.0));
    assert_eq!(found(1.0 + 4.0 * f64::EPSILON), Some(0.0));
    assert_eq!(found(1.0 + 1e-12), None);
    assert!(found(1.0 - 1e-12).is_some_and(|variance| variance > 0.0));
    assert_eq!(covariance(&[vec![-1e-30]], &vec![(0, one(1.0))]), None);
}

#[test]
fn integrators_in_a_and_in_f_have_no_gain() {
    for (na, nf, pole) in [(1, 0, -1.0), (0, 1, -1.0), (1, 0, -1.0 + 1e-16), (0, 1, -1.0 + 1e-16)] {
        let orders = Orders::new(na, &[1], 0, 0, &[nf], &[1]).unwrap();
        let parameters = if na == 1 { [pole, 1.0] } else { [1.0, pole] };
        let model = PolynomialModel::from_parameters(&orders, &parameters, None, 1.0, 1.0).unwrap();
        assert_eq!(model.dc_gain, [None]);
    }
    // An input without B has the gain 0.
    let orders = Orders::new(1, &[0], 0, 0, &[0], &[1]).unwrap();
    let model = PolynomialModel::from_parameters(&orders, &[-0.5], Some(&[vec![1.0]]), 1.0, 1.0).unwrap();
    assert_eq!(model.dc_gain, [Some(Quantity::new(0.0, Some(0.0)))]);
    assert!(model.zeros == [vec![]]);
}

#[test]
fn stability_is_that_of_a_and_f() {
    let stable = |na, nd, nf, parameters: &[f64]| {
        let orders = Orders::new(na, &[1], 0, nd, &[nf], &[1]).unwrap();
        PolynomialModel::from_parameters(&orders, parameters, None, 1.0, 1.0).unwrap().stable
    };
    assert!(stable(0, 0, 1, &[1.0, -0.9]) && !stable(0, 0, 1, &[1.0, -1.1]));
    assert!(!stable(1, 0, 0, &[1.1, 1.0]));
    // The noise may wander off by itself.
    assert!(stable(0, 1, 0, &[1.0, -1.1]));
}

/// An output-error model with this F and B from nk = 1 on.
fn output_error(b: &[f64], f: &[f64], covariance: Option<&[Vec<f64>]>) -> PolynomialModel {
    let orders = Orders::oe(&[b.len()], &[f.len() - 1], &[1]).unwrap();
    PolynomialModel::from_parameters(&orders, &[b, &f[1..]].concat(), covariance, 1.0, 1.0).unwrap()
}

#[test]
fn a_pole_and_a_zero_that_nearly_cancel_are_named() {
    // (1 - 0.5 q^-1)(1 - r q^-1) below and (1 - (r + 0.01) q^-1) above, r = 0.8.
    let (f, b) = (product(&[1.0, -0.5], &[1.0, -0.8]), [1.0, -0.81]);
    let diagonal = |error: f64| -> Vec<Vec<f64>> {
        (0..4).map(|i| (0..4).map(|j| if i == j { error * error } else { 0.0 }).collect()).collect()
    };
    let pair = |covariance: Option<&[Vec<f64>]>| near_cancellation(&output_error(&b, &f, covariance));
    let (pole, zero) = pair(Some(&diagonal(0.01))).unwrap();
    assert_eq!((pole.polynomial.as_str(), zero.polynomial.as_str()), ("f", "b"));
    assert!((pole.re - 0.8).abs() < 1e-12 && (zero.re - 0.81).abs() < 1e-12);
    // Parameters so exact tell them apart.
    assert_eq!(pair(Some(&diagonal(1e-4))), None);
    // Nothing is known: the distance alone.
    assert!(pair(None).is_some());
    assert_eq!(near_cancellation(&output_error(&[1.0, -0.95], &f, None)), None);
    // 0.9 is farther than 0.1 from both, however uncertain.
    assert_eq!(near_cancellation(&output_error(&[1.0, -0.95], &f, Some(&diagonal(10.0)))), None);
}

#[test]
fn a_common_factor_that_may_lie_anywhere_is_named() {
    // The parameters are known up to the place r of the common factor: d(f, b)/dr, and a little more.
    let (f, b) = (product(&[1.0, -0.5], &[1.0, -0.8]), [1.0, -0.8]);
    let direction = [0.0, -1.0, -1.0, 0.5];
    for (wide, little) in [(1.0, 1e-4), (1e3, 1e-4)] {
        let factor = (0..4).map(|i| {
            let own = |j: usize| if i == j { little } else { 0.0 };
            [vec![wide * direction[i]], (0..4).map(own).collect()].concat()
        });
        let spread = Spread::of(factor.collect());
        let model = output_error(&b, &f, Some(&spread.covariance));
        // By itself this pole may be anywhere.
        assert!(model.poles[0].covariance.is_none() && model.poles[1].covariance.is_some());
        let (pole, zero) = near_cancellation(&model).unwrap();
        assert!((pole.re - 0.8).abs() < 1e-12 && (zero.re - 0.8).abs() < 1e-12);
        // The zero 0.05 beside it does not cancel it, as they move together.
        let model = output_error(&[1.0, -0.75], &f, Some(&spread.covariance));
        assert_eq!(near_cancellation(&model), None, "{wide}");
    }
}

#[test]
fn noise_zeros_are_compared_with_noise_poles_and_pairs_with_pairs() {
    let small: Vec<Vec<f64>> =
        (0..5).map(|i| (0..5).map(|j| if i == j { 1e-4 } else { 0.0 }).collect()).collect();
    // ARMA(2, 1) and C/D of pairs.
    let arma = Orders::armax(2, &[], 1, &[]).unwrap();
    let a = product(&[1.0, -0.9], &[1.0, -0.4]);
    let cut: Vec<Vec<f64>> = small.iter().take(3).map(|row| row[..3].to_vec()).collect();
    let model = PolynomialModel::from_parameters(&arma, &[a[1], a[2], -0.41], Some(&cut), 1.0, 1.0).unwrap();
    let (pole, zero) = near_cancellation(&model).unwrap();
    assert_eq!((pole.polynomial.as_str(), zero.polynomial.as_str()), ("a", "c"));
    assert!((pole.re - 0.4).abs() < 1e-12);
    let bj = Orders::bj(&[1], 2, 2, &[0], &[1]).unwrap();
    let with = |c: [f64; 2], d: [f64; 2]| {
        PolynomialModel::from_parameters(&bj, &[1.0, c[0], c[1], d[0], d[1]], Some(&small), 1.0, 1.0).unwrap()
    };
    let (pole, zero) = near_cancellation(&with([-1.2, 0.72], [-1.21, 0.725])).unwrap();
    assert_eq!((pole.polynomial.as_str(), zero.polynomial.as_str()), ("d", "c"));
    assert!(pole.im > 0.0 && zero.im > 0.0);
    assert_eq!(near_cancellation(&with([-1.2, 0.72], [-1.2, 0.82])), None);
    assert_eq!(near_cancellation(&with([0.0; 2], [-1.2, 0.72])), None);
}

/// A model of first order, y = b/(1 + a q^-1) u(t - 1), and the covariance of (a, b).
fn first_order(pole: f64, b: f64, covariance: [[f64; 2]; 2]) -> PolynomialModel {
    let rows: Vec<Vec<f64>> = covariance.iter().map(|row| row.to_vec()).collect();
    let orders = Orders::arx(1, &[1], &[1]).unwrap();
    PolynomialModel::from_parameters(&orders, &[-pole, b], Some(&rows), 1.0, 2.0).unwrap()
}

#[test]
fn gains_lie_where_fieller_says() {
    let covariance = [[1e-4, 4e-5], [4e-5, 9e-4]];
    let square = two_sided(0.05).powi(2);
    // (n - g d)^2 = q^2 var(n - g d), with n = b and d = 1 + a.
    let on_boundary = |d: f64, n: f64, g: f64| {
        let variance = covariance[1][1] - 2.0 * g * covariance[0][1] + g * g * covariance[0][0];
        let distance = (n - g * d).powi(2) / (square * variance);
        assert!((distance - 1.0).abs() < 1e-9, "{d} {n} {g}: {distance}");
    };
    for b in [0.5, -0.5] {
        let gain = first_order(0.9, b, covariance).dc_gain[0].unwrap();
        let Interval { lower: Some(lower), upper: Some(upper) } = gain.interval.unwrap() else {
            unreachable!("it has both")
        };
        assert!(lower < gain.value && gain.value < upper);
        on_boundary(0.1, b, lower);
        on_boundary(0.1, b, upper);
    }
    // The gain 0 is not certain of its sign, and bounded.
    let interval = first_order(0.9, 0.0, covariance).dc_gain[0].unwrap().interval.unwrap();
    assert!(interval.lower.unwrap() < 0.0 && interval.upper.unwrap() > 0.0);
    // Near an integrator the end that is there has the sign of b, and there is no other.
    let near = |pole, b| first_order(pole, b, covariance).dc_gain[0].unwrap().interval.unwrap();
    let Interval { lower: Some(lower), upper: None } = near(0.99, 0.5) else { unreachable!("it has one") };
    on_boundary(0.01, 0.5, lower);
    assert!(lower > 0.0 && lower < 50.0);
    let Interval { lower: None, upper: Some(upper) } = near(0.99, -0.5) else { unreachable!("it has one") };
    on_boundary(0.01, -0.5, upper);
    // Nothing is known of a gain of which neither part is, and of that of an unstable model.
    let nothing = Interval { lower: None, upper: None };
    assert_eq!([near(0.99, 0.01), near(1.001, 0.5)], [nothing; 2]);
    // Far from an integrator it is what the standard error says.
    let exact = [[1e-10, 0.0], [0.0, 1e-10]];
    let gain = first_order(0.5, 1.0, exact).dc_gain[0].unwrap();
    let half = two_sided(0.05) * gain.standard_error.unwrap();
    assert!((gain.interval.unwrap().upper.unwrap() - gain.value - half).abs() < 1e-3 * half);
}

#[test]
fn time_constants_lie_where_their_poles_do() {
    let covariance = |deviation: f64| [[deviation * deviation, 0.0], [0.0, 1e-4]];
    let interval = |pole, deviation| {
        first_order(pole, 1.0, covariance(deviation)).time_constants[0].unwrap().interval.unwrap()
    };
    let quantile = two_sided(0.05);
    let Interval { lower: Some(lower), upper: Some(upper) } = interval(0.9, 0.01) else {
        unreachable!("it has both")
    };
    assert!((lower + 2.0 / (0.9 - 0.01 * quantile).ln()).abs() < 1e-9);
    assert!((upper + 2.0 / (0.9 + 0.01 * quantile).ln()).abs() < 1e-9);
    // It may be an integrator, and it may be no pole at all.
    let open = interval(0.99, 0.01);
    assert!(open.lower.is_some() && open.upper.is_none());
    assert_eq!(interval(0.1, 0.1).lower, Some(0.0));
}
