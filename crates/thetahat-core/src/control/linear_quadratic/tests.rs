use nalgebra::{Const, Matrix2, Vector1, Vector2};

use super::LinearQuadratic;
use crate::control::tests::motor;
use crate::{Covariance, Error};

/// The motor in controllable form, output weight 1, input weight 0.1 (figures of an independent program).
#[test]
fn the_motor_has_the_reference_gains() -> Result<(), Error> {
    let (a, b) = motor();
    let (state, input) = (Matrix2::new(-a[1], -a[2], 1.0, 0.0), Vector2::new(1.0, 0.0));
    let output = Vector2::new(b[1], b[2]);
    let weight = Covariance::from_diagonal(&Vector1::new(1.0))?.transformed(&output)?;
    let price = Covariance::from_diagonal(&Vector1::new(0.1))?;
    let found = LinearQuadratic::<f64, _, Const<1>>::solve(&state, &input, weight.clone(), price, 1000)?;
    assert!((found.gain[0] - 0.753177).abs() < 1e-6 && (found.gain[1] + 0.343431).abs() < 1e-6, "{found:?}");
    // P is what the sum comes to, and the equation holds.
    let p = found.cost.matrix();
    let mut x = Vector2::new(1.0, -2.0);
    let expected = (x.transpose() * p * x)[0];
    let mut sum = 0.0;
    for _ in 0..400 {
        let u = -(found.gain * x)[0];
        sum += (x.transpose() * weight.matrix() * x)[0] + 0.1 * u * u;
        x = state * x + input * u;
    }
    assert!((sum / expected - 1.0).abs() < 1e-10, "{sum} {expected}");
    let single = LinearQuadratic::<f32, _, Const<1>>::solve(
        &state.map(|value| value as f32),
        &input.map(|value| value as f32),
        Covariance::from_diagonal(&Vector1::new(1.0))?.transformed(&output.map(|value| value as f32))?,
        Covariance::from_diagonal(&Vector1::new(0.1))?,
        1000,
    )?;
    assert!((single.gain[0] - 0.753177).abs() < 1e-3);
    Ok(())
}

#[test]
fn what_is_unstable_is_held_though_it_has_no_weight_and_what_cannot_be_held_is_refused() -> Result<(), Error>
{
    let price = || Covariance::<f64, _>::from_diagonal(&Vector1::new(1.0));
    let none = || Covariance::zero(Const::<1>);
    let one = Vector1::new(1.0);
    // The least energy that holds x(k+1) = 2 x + u reflects the pole: u = -1.5 x.
    let found = LinearQuadratic::solve(&Vector1::new(2.0), &one, none(), price()?, 1000)?;
    assert!((found.gain[0] - 1.5).abs() < 1e-12, "{found:?}");
    let adrift = LinearQuadratic::solve(&Vector1::new(2.0), &Vector1::new(0.0), none(), price()?, 1000);
    assert!(adrift.is_err());
    let idle = LinearQuadratic::solve(&Vector1::new(0.5), &Vector1::new(0.0), none(), none(), 1000);
    assert!(matches!(idle, Err(Error::NoVariance { .. })), "{idle:?}");
    let broken = LinearQuadratic::solve(&Vector1::new(f64::NAN), &one, none(), price()?, 1000);
    assert!(matches!(broken, Err(Error::NotFinite { .. })));
    Ok(())
}
