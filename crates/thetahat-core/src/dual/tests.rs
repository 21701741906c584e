use core::cmp::Ordering;

use num_dual::{Dual64, DualNum};

use crate::noise::Noise;
use crate::{Dual, Number, Real};

type Of = Dual<f64, 1>;

/// A function of one number: ours, that of num-dual, and where it is defined.
type Function = (fn(Of) -> Of, fn(Dual64) -> Dual64, [f64; 2]);

fn functions() -> [Function; 22] {
    [
        (|x| -x, |x| -x, [-3.0, 3.0]),
        (|x| x.sqrt(), |x| x.sqrt(), [0.01, 9.0]),
        (|x| x.exp(), |x| x.exp(), [-3.0, 3.0]),
        (|x| x.ln(), |x| x.ln(), [0.01, 9.0]),
        (|x| x.powi(0), |x| x.powi(0), [-3.0, 3.0]),
        (|x| x.powi(1), |x| x.powi(1), [-3.0, 3.0]),
        (|x| x.powi(5), |x| x.powi(5), [-3.0, 3.0]),
        (|x| x.powi(-3), |x| x.powi(-3), [0.5, 3.0]),
        (|x| x.powf(2.7), |x| x.powf(2.7), [0.01, 3.0]),
        (|x| x.powf(0.0), |x| x.powf(0.0), [0.01, 3.0]),
        (|x| x.sin(), |x| x.sin(), [-9.0, 9.0]),
        (|x| x.cos(), |x| x.cos(), [-9.0, 9.0]),
        (|x| x.sin_cos().0, |x| x.sin_cos().0, [-9.0, 9.0]),
        (|x| x.sin_cos().1, |x| x.sin_cos().1, [-9.0, 9.0]),
        (|x| x.tan(), |x| x.tan(), [-1.4, 1.4]),
        (|x| x.asin(), |x| x.asin(), [-0.99, 0.99]),
        (|x| x.acos(), |x| x.acos(), [-0.99, 0.99]),
        (|x| x.atan(), |x| x.atan(), [-9.0, 9.0]),
        (|x| x.sinh(), |x| x.sinh(), [-3.0, 3.0]),
        (|x| x.cosh(), |x| x.cosh(), [-3.0, 3.0]),
        (|x| x.tanh(), |x| x.tanh(), [-3.0, 3.0]),
        (|x| x.abs(), |x| if x.re < 0.0 { -x } else { x }, [-3.0, 3.0]),
    ]
}

#[test]
fn functions_of_one_number_are_those_of_num_dual_and_of_differences() {
    let mut noise = Noise(1);
    for (index, (ours, theirs, [low, high])) in functions().into_iter().enumerate() {
        for _ in 0..100 {
            let x = low + (high - low) * (0.5 + 0.5 * noise.next());
            let slope = 2.0 * noise.next();
            let found = ours(Dual { value: x, derivatives: [slope] });
            let expected = theirs(Dual64::new(x, slope));
            let near = |a: f64, b: f64, tolerance: f64| (a - b).abs() <= tolerance * (1.0 + a.abs());
            assert!(near(found.value, expected.re, 1e-14), "{index} {x}");
            assert!(near(found.derivatives[0], expected.eps, 1e-13), "{index} {x}");
            let at = |x: f64| ours(x.into()).value;
            let difference = (at(x + 1e-6) - at(x - 1e-6)) / 2e-6 * slope;
            assert!(x.abs() < 1e-5 || near(found.derivatives[0], difference, 1e-4), "{index} {x}");
        }
    }
}

fn everything<S: Number<f64>>(a: S, b: S) -> [S; 14] {
    let (mut sum, mut difference, mut product, mut quotient) = (a, a, a, a);
    sum += b;
    difference -= b;
    product *= b;
    quotient /= b;
    [
        a + b,
        a - b,
        a * b,
        a / b,
        a + 3.0,
        a - 3.0,
        a * 3.0,
        a / 3.0,
        a.atan2(b),
        sum,
        difference,
        product,
        quotient,
        S::from(2.0) / (a * a + b.sin() * b) - a,
    ]
}

#[test]
fn functions_of_two_numbers_are_those_of_num_dual() {
    let mut noise = Noise(2);
    for _ in 0..200 {
        let (a, b) = (3.0 * noise.next(), 3.0 * noise.next());
        let [x, y] = Dual::variables([a, b]);
        let found = everything(x, y);
        for variable in 0..2 {
            let (a, b) = (Dual64::new(a, 1.0 - variable as f64), Dual64::new(b, variable as f64));
            let expected = [
                a + b,
                a - b,
                a * b,
                a / b,
                a + 3.0,
                a - 3.0,
                a * 3.0,
                a / 3.0,
                a.atan2(b),
                a + b,
                a - b,
                a * b,
                a / b,
                Dual64::from(2.0) / (a * a + b.sin() * b) - a,
            ];
            for (index, (found, expected)) in found.iter().zip(expected).enumerate() {
                let scale = 1e-14 * (1.0 + expected.re.abs() + expected.eps.abs());
                assert!((found.value - expected.re).abs() < scale, "{index}");
                assert!((found.derivatives[variable] - expected.eps).abs() < 10.0 * scale, "{index}");
            }
        }
        // And the same functions of plain numbers.
        for (plain, found) in everything(a, b).into_iter().zip(found) {
            assert!((plain - found.value).abs() <= 1e-15 * plain.abs());
        }
    }
}

#[test]
fn plain_numbers_are_numbers_too() {
    fn all<T: Real, S: Number<T>>(x: S) -> [S; 19] {
        let (sine, cosine) = x.sin_cos();
        [
            x.sqrt(),
            x.exp(),
            x.ln(),
            x.powi(3),
            x.powf(nalgebra::convert(0.3)),
            sine,
            cosine,
            x.sin(),
            x.cos(),
            x.tan(),
            x.asin(),
            x.acos(),
            x.atan(),
            x.atan2(x * x),
            x.sinh(),
            x.cosh(),
            x.tanh(),
            x.abs(),
            S::from(x.value()),
        ]
    }
    let [x] = Dual::variables([0.3_f32]);
    for (plain, dual) in all::<f32, _>(0.3_f32).into_iter().zip(all::<f32, _>(x)) {
        assert_eq!(plain.to_bits(), dual.value.to_bits());
        assert!(dual.derivatives[0].is_finite());
    }
}

#[test]
fn comparisons_look_at_values() {
    let [x, y] = Dual::variables([1.0, 1.0]);
    assert!(x == y && x <= y && x.partial_cmp(&y) == Some(Ordering::Equal));
    assert!(x < y + 1.0 && x - 2.0 < y && x * f64::NAN != y);
    let clipped = |x: Dual<f64, 2>| if x > 0.5.into() { Dual::from(0.5) } else { x };
    assert_eq!(clipped(x).derivatives, [0.0, 0.0]);
    assert_eq!(clipped(x * 0.25).derivatives, [0.25, 0.0]);
}

#[test]
fn constants_have_no_derivative_where_a_function_has_none() {
    let zero = Dual::<f64, 2>::from(0.0);
    for root in [zero.sqrt(), zero.powf(0.5), (zero + 1.0).acos(), zero.powi(0), zero.powi(1)] {
        assert_eq!(root.derivatives, [0.0, 0.0]);
    }
    let [x, _] = Dual::variables([0.0, 0.0]);
    assert_eq!(x.sqrt().derivatives, [f64::INFINITY, 0.0]);
    assert_eq!(x.abs().derivatives, [1.0, 0.0]);
    assert_eq!((-x).abs().derivatives, [1.0, 0.0]);
    assert_eq!(x.powi(0).derivatives, [0.0, 0.0]);
    assert_eq!(x.powi(1).derivatives, [1.0, 0.0]);
}

#[test]
fn constants_stay_constant_beside_what_has_no_derivative() {
    let [y, _] = Dual::variables([0.0, 1.0]);
    let zero = Dual::<f64, 2>::from(0.0);
    for constant in [zero.atan2(zero), zero / zero, zero / 0.0, zero * f64::INFINITY, zero * (zero / 0.0)] {
        assert_eq!(constant.derivatives, [0.0, 0.0]);
    }
    for found in [y.atan2(zero), Dual::from(1.0) / y, y / 0.0, y * f64::INFINITY, y / zero] {
        assert!(!found.derivatives[0].is_finite());
        assert_eq!(found.derivatives[1], 0.0);
    }
}

#[test]
fn the_angle_of_a_large_or_small_point() {
    for scale in [1e19_f32, 1.0, 1e-23, 1e-36, 5e37] {
        let [y, x] = Dual::variables([3.0 * scale, 4.0 * scale]);
        let [by_y, by_x] = y.atan2(x).derivatives;
        assert!((by_y * scale - 0.16).abs() < 1e-7 && (by_x * scale + 0.12).abs() < 1e-7, "{scale:e}");
    }
}
