use std::f64::consts::PI;

use thetahat_core::nalgebra::ComplexField;

use super::*;
use crate::model::{Orders, PolynomialModel};
use crate::tests::{assert_refused, matrix};

fn model() -> ContinuousStateSpace {
    ContinuousStateSpace {
        a: matrix(&[&[-0.5, 2.0, 0.0], &[-2.0, -0.5, 1.0], &[0.0, 0.0, -3.0]]),
        b: matrix(&[&[1.0, 0.0], &[0.0, 0.5], &[-1.0, 2.0]]),
        c: matrix(&[&[1.0, 0.0, 1.0]]),
        d: matrix(&[&[0.0, 0.25]]),
        k: matrix(&[&[0.7], &[0.2], &[-0.1]]),
        noise_intensity: matrix(&[&[0.04]]),
    }
}

/// The largest difference of any entry.
fn apart(one: &DMatrix<f64>, other: &DMatrix<f64>) -> f64 {
    (one - other).amax()
}

fn apart_in_time(one: &ContinuousStateSpace, other: &ContinuousStateSpace) -> f64 {
    let pairs = [
        (&one.a, &other.a),
        (&one.b, &other.b),
        (&one.c, &other.c),
        (&one.d, &other.d),
        (&one.k, &other.k),
        (&one.noise_intensity, &other.noise_intensity),
    ];
    pairs.iter().map(|(one, other)| apart(one, other)).fold(0.0, f64::max)
}

fn apart_in_samples(one: &StateSpace, other: &StateSpace) -> f64 {
    assert!((one.sample_time - other.sample_time).abs() < 1e-15);
    let pairs = [
        (&one.f, &other.f),
        (&one.g, &other.g),
        (&one.h, &other.h),
        (&one.d, &other.d),
        (&one.k, &other.k),
        (&one.noise_covariance, &other.noise_covariance),
    ];
    pairs.iter().map(|(one, other)| apart(one, other)).fold(0.0, f64::max)
}

#[test]
fn sampled_models_are_those_of_scipy() {
    // scipy 1.17.1: scipy.signal.cont2discrete((A, B, C, D), 0.2, method), with zoh, foh and bilinear.
    let f = matrix(&[
        &[0.833410451667205, 0.3523602873904028, 0.030410057300453652],
        &[-0.35236028739040287, 0.833410451667205, 0.13816757206963434],
        &[0.0, 0.0, 0.5488116360940264],
    ]);
    let zero = model().sampled(0.2, Hold::Zero).unwrap();
    assert!(apart(&zero.f, &f) < 1e-14);
    let g = matrix(&[
        &[0.18323841861946266, 0.022824380262157204],
        &[-0.05269019816175869, 0.12420622421359366],
        &[-0.1503961213019912, 0.3007922426039824],
    ]);
    assert!(apart(&zero.g, &g) < 1e-14);
    assert_eq!((zero.h, zero.d, zero.sample_time), (model().c, model().d, 0.2));

    let first = model().sampled(0.2, Hold::First).unwrap();
    assert!(apart(&first.f, &f) < 1e-14);
    let g = matrix(&[
        &[0.1585069470960436, 0.04737548230465309],
        &[-0.09453599679730408, 0.13461923806078577],
        &[-0.11309496651341625, 0.2261899330268325],
    ]);
    assert!(apart(&first.g, &g) < 1e-14);
    assert!(apart(&first.d, &matrix(&[&[0.012258556540707038, 0.42277434041188733]])) < 1e-14);

    let tustin = model().sampled(0.2, Hold::Tustin).unwrap();
    let f = matrix(&[
        &[0.838074398249453, 0.350109409190372, 0.026931493014644002],
        &[-0.3501094091903719, 0.8380743982494528, 0.141390338326881],
        &[0.0, 0.0, 0.5384615384615383],
    ]);
    assert!(apart(&tustin.f, &f) < 1e-14);
    let g = matrix(&[
        &[0.18111429052348088, 0.022891769062447397],
        &[-0.0491499747517253, 0.12018178757784884],
        &[-0.15384615384615385, 0.3076923076923077],
    ]);
    assert!(apart(&tustin.g, &g) < 1e-14);
    assert!(
        apart(&tustin.h, &matrix(&[&[0.9190371991247264, 0.17505470459518596, 0.7826965157380912]])) < 1e-14
    );
    assert!(apart(&tustin.d, &matrix(&[&[0.013634068338663513, 0.41529203837737755]])) < 1e-14);
}

#[test]
fn there_and_back_nothing_changes() {
    for hold in Hold::all() {
        for seconds in [0.02, 0.7] {
            let sampled = model().sampled(seconds, hold).unwrap();
            let continuous = sampled.to_continuous(hold).unwrap();
            assert!(apart_in_time(&continuous, &model()) < 1e-11, "{hold} {seconds}");
            let again = continuous.sampled(seconds, hold).unwrap();
            assert!(apart_in_samples(&again, &sampled) < 1e-12, "{hold} {seconds}");
        }
    }
}

#[test]
fn one_sample_time_becomes_another() {
    for hold in Hold::all() {
        let slow = model().sampled(0.6, hold).unwrap();
        let fast = model().sampled(0.2, hold).unwrap();
        assert!(apart_in_samples(&slow.resampled(0.2, hold).unwrap(), &fast) < 1e-11, "{hold}");
        assert!(apart_in_samples(&fast.resampled(0.6, hold).unwrap(), &slow) < 1e-11, "{hold}");
    }
    // Three steps with a held input are one of three times the length.
    let fast = model().sampled(0.2, Hold::Zero).unwrap();
    let slow = fast.resampled(0.6, Hold::Zero).unwrap();
    let square = &fast.f * &fast.f;
    assert!(apart(&slow.f, &(&square * &fast.f)) < 1e-13);
    assert!(apart(&slow.g, &(&square * &fast.g + &fast.f * &fast.g + &fast.g)) < 1e-13);
    // The mean of three samples of white noise has a third of the variance of one.
    assert!(apart(&slow.noise_covariance, &(&fast.noise_covariance / 3.0)) < 1e-15);
}

#[test]
fn a_ramp_is_exact_with_a_first_order_hold() {
    // dy/dt = -y + u, u = t from rest: y = t - 1 + e^-t.
    let lag = ContinuousStateSpace {
        a: matrix(&[&[-1.0]]),
        b: matrix(&[&[1.0]]),
        c: matrix(&[&[1.0]]),
        d: matrix(&[&[0.0]]),
        k: matrix(&[&[0.0]]),
        noise_intensity: matrix(&[&[1.0]]),
    };
    let sampled = lag.sampled(0.5, Hold::First).unwrap();
    let mut state = 0.0;
    for sample in 0..20 {
        let time = 0.5 * f64::from(sample);
        let output = sampled.h[(0, 0)] * state + sampled.d[(0, 0)] * time;
        assert!((output - (time - 1.0 + (-time).exp())).abs() < 1e-14);
        state = sampled.f[(0, 0)] * state + sampled.g[(0, 0)] * time;
    }
}

#[test]
fn tustin_moves_frequencies_and_keeps_responses() {
    let sampled = model().sampled(0.3, Hold::Tustin).unwrap();
    let identity = DMatrix::<Complex<f64>>::identity(3, 3);
    let complex = |matrix: &DMatrix<f64>| matrix.map(|value| Complex::new(value, 0.0));
    for frequency in [0.1, 1.0, 5.0] {
        let z = Complex::from_polar(1.0, frequency * 0.3);
        let s = Complex::new(0.0, 2.0 / 0.3 * (frequency * 0.15).tan());
        let inside = (&identity * z - complex(&sampled.f)).try_inverse().unwrap();
        let one = complex(&sampled.h) * &inside * complex(&sampled.g) + complex(&sampled.d);
        let noise =
            complex(&sampled.h) * inside * complex(&sampled.k) + DMatrix::<Complex<f64>>::identity(1, 1);
        let inside = (&identity * s - complex(&model().a)).try_inverse().unwrap();
        let other = complex(&model().c) * &inside * complex(&model().b) + complex(&model().d);
        let intensity =
            complex(&model().c) * inside * complex(&model().k) + DMatrix::<Complex<f64>>::identity(1, 1);
        assert!((one - other).norm() < 1e-13);
        // The spectrum of the noise too: covariance T is a density.
        let density = noise[(0, 0)].norm_sqr() * sampled.noise_covariance[(0, 0)] * 0.3;
        assert!((density - intensity[(0, 0)].norm_sqr() * 0.04).abs() < 1e-14);
    }
    let is_inside = |matrix: DMatrix<f64>| eigen::eigenvalues(&matrix).unwrap()[0].modulus() < 1.0;
    assert!(is_inside(&sampled.f - &sampled.k * &sampled.h));
}

#[test]
fn integrators_and_multiple_poles_come_back() {
    let chain = ContinuousStateSpace {
        a: matrix(&[&[0.0, 1.0, 0.0], &[0.0, 0.0, 1.0], &[0.0, 0.0, 0.0]]),
        b: matrix(&[&[0.0], &[0.0], &[2.0]]),
        c: matrix(&[&[1.0, 0.0, 0.0]]),
        d: matrix(&[&[0.0]]),
        k: matrix(&[&[0.3], &[0.1], &[0.0]]),
        noise_intensity: matrix(&[&[2.0]]),
    };
    let slow = ContinuousStateSpace { a: &chain.a - DMatrix::identity(3, 3) * 0.7, ..chain.clone() };
    for expected in [chain, slow] {
        for hold in Hold::all() {
            let found = expected.sampled(0.4, hold).unwrap().to_continuous(hold).unwrap();
            assert!(apart_in_time(&found, &expected) < 1e-10, "{hold}");
        }
    }
}

#[test]
fn oscillations_come_back_slower_than_the_samples() {
    let oscillator = |frequency: f64| ContinuousStateSpace {
        a: matrix(&[&[-0.1, frequency], &[-frequency, -0.1]]),
        b: matrix(&[&[0.0], &[1.0]]),
        c: matrix(&[&[1.0, 0.0]]),
        d: matrix(&[&[0.0]]),
        k: matrix(&[&[0.0], &[0.0]]),
        noise_intensity: matrix(&[&[1.0]]),
    };
    // Just below half a turn in a sample.
    let near = oscillator(0.999 * PI);
    let found = near.sampled(1.0, Hold::Zero).unwrap().to_continuous(Hold::Zero).unwrap();
    assert!(apart_in_time(&found, &near) < 1e-10);
    // 1.6 half turns forwards look like 0.4 backwards.
    let found = oscillator(1.6 * PI).sampled(1.0, Hold::Zero).unwrap().to_continuous(Hold::Zero).unwrap();
    assert!((found.poles().unwrap()[0] - Complex::new(-0.1, 0.4 * PI)).modulus() < 1e-12);
}

#[test]
fn poles_without_a_logarithm_are_named() {
    let space = |orders: Orders, parameters: &[f64]| {
        PolynomialModel::from_parameters(&orders, parameters, None, 1.0, 1.0).unwrap().state_space()
    };
    // (z - 0.5)(z + 0.25) and one more sample of delay.
    let late = space(Orders::arx(2, &[1], &[3]).unwrap(), &[-0.25, -0.125, 1.0]);
    for hold in [Hold::Zero, Hold::First] {
        assert_eq!(
            late.to_continuous(hold).unwrap_err().to_string(),
            "the model has no counterpart in continuous time with a held input: it has one pole at 0, a delay of one sample, which \
                 no finite state is in continuous time: strip the delay first; the pole -0.25 on the negative real axis has no real \
                 logarithm: take a shorter sample time, or a lower order; `tustin` takes any pole but -1"
        );
    }
    let back = late.to_continuous(Hold::Tustin).unwrap().sampled(1.0, Hold::Tustin).unwrap();
    assert!(apart_in_samples(&back, &late) < 1e-13);
    let delays = space(Orders::arx(1, &[1], &[4]).unwrap(), &[-0.5, 1.0]);
    assert_refused(delays.to_continuous(Hold::Zero), "it has 3 poles at 0, delays of samples");
    let alternating = space(Orders::arx(1, &[1], &[1]).unwrap(), &[1.0, 1.0]);
    let error = alternating.to_continuous(Hold::Tustin).unwrap_err().to_string();
    assert!(error.starts_with("the model has a pole at -1, which `tustin` maps to infinity"), "{error}");
    let noise = space(Orders::armax(1, &[1], 1, &[1]).unwrap(), &[-0.5, 1.0, 1.0]);
    let error = noise.to_continuous(Hold::Tustin).unwrap_err().to_string();
    assert!(error.starts_with("the predictor F - K H has an eigenvalue at -1"), "{error}");
}

#[test]
fn what_cannot_be_sampled_is_refused() {
    assert!(model().sampled(0.0, Hold::Zero).unwrap_err().to_string().starts_with("sample_time: it is 0 s"));
    assert!(model().sampled(f64::NAN, Hold::Tustin).is_err());
    let growing = ContinuousStateSpace { a: DMatrix::identity(3, 3) * 1000.0, ..model() };
    let error = growing.sampled(1.0, Hold::First).unwrap_err().to_string();
    assert!(error.starts_with("over 1 s the model grows, or decays, beyond"), "{error}");
    let error = growing.sampled(2e-3, Hold::Tustin).unwrap_err().to_string();
    assert!(error.starts_with("the model has a pole at 2/T = 1000 a second"), "{error}");
    let odd = ContinuousStateSpace { b: DMatrix::zeros(2, 2), ..model() };
    let error = odd.sampled(1.0, Hold::Zero).unwrap_err().to_string();
    assert_eq!(error, "model: B is 2 x 2, not 3 x 2: A has 3 rows, and D is 1 x 2");
}

#[test]
fn a_gain_without_states_stays_one() {
    let orders = Orders::arx(0, &[1], &[0]).unwrap();
    let gain = PolynomialModel::from_parameters(&orders, &[2.0], None, 3.0, 0.5).unwrap().state_space();
    for hold in Hold::all() {
        let continuous = gain.to_continuous(hold).unwrap();
        assert_eq!(
            (continuous.d.clone(), continuous.noise_intensity.clone()),
            (matrix(&[&[2.0]]), matrix(&[&[1.5]]))
        );
        assert_eq!(continuous.sampled(0.5, hold).unwrap(), gain);
    }
}

#[test]
fn holds_have_words() {
    for hold in Hold::all() {
        assert_eq!(hold.to_string().parse::<Hold>().unwrap(), hold);
        assert_eq!(serde_json::to_string(&hold).unwrap(), format!("\"{hold}\""));
    }
    let error = "ramp".parse::<Hold>().unwrap_err().to_string();
    assert_eq!(error, "hold: 'ramp' is none of zoh, foh and tustin");
}
