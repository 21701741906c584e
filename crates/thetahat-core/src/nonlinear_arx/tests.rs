extern crate std;
use std::vec;

use nalgebra::Const;

use crate::{ArxOrders, Basis, Error, InputOrders, NonlinearArx, Polynomial, Radial, Scaling, Spline};

/// y(k-1), y(k-2), u1(k-1), u2(k), u2(k-1).
pub(crate) const ORDERS: ArxOrders<'_> = ArxOrders {
    na: 2,
    inputs: &[InputOrders { nb: 1, nk: 1 }, InputOrders { nb: 2, nk: 0 }],
    constant: false,
};
/// 1, y(k-1), u1(k-1), u2(k-1), y(k-2)^2, y(k-1) u2(k).
pub(crate) const BASIS: Polynomial<'_> =
    Polynomial { factors: &[0, 2, 4, 1, 1, 0, 3], ends: &[0, 1, 2, 3, 5, 7] };
pub(crate) const OUTPUT: Scaling<f64> = Scaling { offset: 20.0, scale: 5.0 };
pub(crate) const INPUTS: [Scaling<f64>; 2] =
    [Scaling { offset: 1.0, scale: 2.0 }, Scaling { offset: -3.0, scale: 0.5 }];

type Plant<B> = NonlinearArx<f64, B, Const<5>>;

#[test]
fn a_run_is_the_equation() {
    let theta = [0.1, 0.6, 0.3, -0.2, -0.1, 0.15];
    let mut plant: Plant<Polynomial<'_>> = NonlinearArx::new(BASIS, &ORDERS, OUTPUT, &INPUTS).unwrap();
    let (mut y, mut u) = (vec![], vec![]);
    for k in 0..10_i32 {
        let k = f64::from(k);
        y.push(20.0 + 3.0 * (1.7 * k).sin());
        u.push([1.0 + (0.9 * k).cos(), -3.0 + 0.4 * (2.3 * k).sin()]);
        plant.log_row(y[y.len() - 1], &u[u.len() - 1]).unwrap();
    }
    let future = [[0.5, -2.9], [2.0, -3.3], [1.5, -3.0]];
    let mut ahead = [0.0; 3];
    plant.predict(&theta, &future.concat(), &mut ahead).unwrap();
    for (future, said) in future.iter().zip(ahead) {
        u.push(*future);
        let k = y.len();
        let z = |value: f64, Scaling { offset, scale }: Scaling<f64>| (value - offset) / scale;
        let (y1, y2) = (z(y[k - 1], OUTPUT), z(y[k - 2], OUTPUT));
        let (u1, now, before) = (z(u[k - 1][0], INPUTS[0]), z(u[k][1], INPUTS[1]), z(u[k - 1][1], INPUTS[1]));
        let g = 0.1 + 0.6 * y1 + 0.3 * u1 - 0.2 * before - 0.1 * y2 * y2 + 0.15 * y1 * now;
        y.push(20.0 + 5.0 * g);
        assert!((y[k] - said).abs() < 1e-13, "{said} {}", y[k]);
    }
}

#[test]
fn slopes_are_differences_of_outputs() {
    let centres: vec::Vec<f64> = (0..10).map(|i| (1.3 * f64::from(i)).sin()).collect();
    let radial = |linear| Radial { regressors: 5, centres: &centres, inverse_squares: &[0.25, 0.6], linear };
    let x = [22.0, 17.0, 2.5, -3.4, -2.8];
    let theta: vec::Vec<f64> = (0..8).map(|j| 0.4 - 0.13 * f64::from(j)).collect();
    fn check<B: Basis<f64>>(basis: B, theta: &[f64], x: [f64; 5]) {
        let plant: Plant<B> = NonlinearArx::new(basis, &ORDERS, OUTPUT, &INPUTS).unwrap();
        let theta = &theta[..plant.basis().functions()];
        let mut slopes = [0.0; 5];
        plant.slopes_at(theta, &x, &mut slopes).unwrap();
        for i in 0..5 {
            let moved = |by: f64| {
                let mut x = x;
                x[i] += by;
                plant.output_at(theta, &x).unwrap()
            };
            let difference = (moved(1e-5) - moved(-1e-5)) / 2e-5;
            assert!((difference - slopes[i]).abs() < 1e-8, "{i}: {difference} {slopes:?}");
        }
    }
    let knots = [[-2.0, 0.3, 1.5], [-1.0, -0.5, 0.0]];
    check(Spline { regressors: 5, bent: &[0, 3], knots: &knots }, &theta, x);
    check(BASIS, &theta, x);
    check(radial(false), &theta, x);
    check(radial(true), &theta, x);
}

#[test]
fn wrong_parts_are_told() {
    let new = |basis: Polynomial<'static>, output, inputs: &[Scaling<f64>]| {
        NonlinearArx::<f64, _, Const<5>>::new(basis, &ORDERS, output, inputs).map(|_| ()).unwrap_err()
    };
    let far = Polynomial { factors: &[5], ends: &[1] };
    assert_eq!(new(far, OUTPUT, &INPUTS), Error::Length { argument: "factors", expected: 5, found: 6 });
    let short = Polynomial { factors: &[0, 1], ends: &[1] };
    assert_eq!(new(short, OUTPUT, &INPUTS), Error::Length { argument: "ends", expected: 2, found: 1 });
    let falling = Polynomial { factors: &[0, 1], ends: &[2, 1, 2] };
    assert!(matches!(new(falling, OUTPUT, &INPUTS), Error::OutOfRange { argument: "ends", .. }));
    assert_eq!(new(BASIS, OUTPUT, &INPUTS[..1]), Error::Length { argument: "inputs", expected: 2, found: 1 });
    let zero = Scaling { offset: 0.0, scale: 0.0 };
    assert!(matches!(new(BASIS, zero, &INPUTS), Error::OutOfRange { argument: "scale", .. }));
    let nan = Scaling { offset: f64::NAN, scale: 1.0 };
    assert_eq!(new(BASIS, nan, &INPUTS), Error::NotFinite { argument: "offset" });
    let few = ArxOrders { na: 1, inputs: &[], constant: false };
    let error = NonlinearArx::<f64, _, Const<5>>::new(BASIS, &few, OUTPUT, &[]).map(|_| ()).unwrap_err();
    assert_eq!(error, Error::Orders { needed: 1, available: 5 });
    let falling = Spline { regressors: 5, bent: &[0], knots: &[[0.0, 1.0, 1.0]] };
    assert!(matches!(Basis::<f64>::check(&falling, 5), Err(Error::OutOfRange { argument: "knots", .. })));
    let far = Spline { regressors: 5, bent: &[5], knots: &[[0.0, 1.0, 2.0]] };
    assert!(matches!(Basis::<f64>::check(&far, 5), Err(Error::Length { argument: "bent", .. })));
    let centres = Radial { regressors: 5, centres: &[0.0; 9], inverse_squares: &[1.0; 2], linear: true };
    assert_eq!(
        Basis::<f64>::check(&centres, 5),
        Err(Error::Length { argument: "centres", expected: 10, found: 9 })
    );
}

#[test]
fn wrong_samples_change_nothing() {
    let mut plant: Plant<Polynomial<'_>> = NonlinearArx::new(BASIS, &ORDERS, OUTPUT, &INPUTS).unwrap();
    for k in 0..4_i32 {
        plant.log_row(20.0 + f64::from(k), &[1.0, -3.0]).unwrap();
    }
    let before = std::format!("{plant:?}");
    assert_eq!(plant.measured(1.0), Err(Error::InputFirst { input: 1 }));
    assert_eq!(plant.log_row(f64::INFINITY, &[0.0; 2]), Err(Error::Infinite { argument: "output" }));
    assert_eq!(plant.log_row(1e200, &[0.0; 2]), Err(Error::TooLarge { argument: "output" }));
    assert_eq!(plant.log_row(1.0, &[1e200, 0.0]), Err(Error::TooLarge { argument: "inputs" }));
    assert_eq!(plant.log_row(1.0, &[0.0]), Err(Error::Length { argument: "inputs", expected: 2, found: 1 }));
    assert_eq!(before, std::format!("{plant:?}"));
    let (theta, mut ahead) = ([0.0; 6], [7.0; 2]);
    let parameters = Error::Length { argument: "parameters", expected: 6, found: 5 };
    assert_eq!(plant.predict(&theta[..5], &[0.0; 4], &mut ahead), Err(parameters));
    assert!(plant.predict(&theta, &[0.0; 3], &mut ahead).is_err());
    assert!(plant.slopes_at(&theta, &[0.0; 4], &mut [0.0; 5]).is_err());
    assert_eq!(ahead, [7.0; 2]);
    // What grows out of the range of numbers is told, with the outputs before that.
    let mut ahead = [0.0; 40];
    let grown = plant.predict(&[0.0, 0.0, 0.0, 0.0, 1e9, 0.0], &[0.0; 80], &mut ahead);
    assert_eq!(grown, Err(Error::Overflow));
    assert!(ahead[0].is_finite() && ahead[39].is_nan());
}
