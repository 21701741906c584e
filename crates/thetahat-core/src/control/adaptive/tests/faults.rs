use super::{Simulated, settings, tuner};
use crate::noise::Noise;
use crate::{Error, Sensor, TunerSettings, TunerState};

fn oven() -> Simulated {
    Simulated::new([1.0, -1.5, 0.56], &[0.0, 0.04, 0.02])
}

/// A working loop at the set point 1, and its plant.
fn settled(settings: &TunerSettings<f32>) -> Result<(super::Tuner, Simulated, Noise), Error> {
    let (mut tuner, mut plant, mut noise) = (tuner(settings, 0.98)?, oven(), Noise(11));
    for k in 0..1000 {
        let y = plant.output(0.005 * noise.normal());
        let set_point = if k / 100 % 2 == 0 { -1.0 } else { 1.0 };
        plant.input(tuner.control(set_point, y as f32).into());
    }
    Ok((tuner, plant, noise))
}

/// Runs on with what the sensor makes of each output; returns how far the true output strays at most.
fn strays(
    (tuner, plant, noise): &mut (super::Tuner, Simulated, Noise),
    samples: usize,
    mut measured: impl FnMut(usize, f32) -> f32,
) -> f64 {
    let mut farthest = 0.0_f64;
    for k in 0..samples {
        let y = plant.output(0.005 * noise.normal());
        farthest = farthest.max((y - 1.0).abs());
        plant.input(tuner.control(1.0, measured(k, y as f32)).into());
    }
    farthest
}

#[test]
fn a_sensor_that_is_silent_is_bridged_by_the_model_and_then_the_input_is_held() -> Result<(), Error> {
    let mut run = settled(&settings())?;
    let before = *run.0.plant().estimator().parameters();
    assert!(strays(&mut run, 80, |_, _| f32::NAN) < 0.15);
    assert_eq!(run.0.state(), TunerState::Bridging);
    let held = {
        strays(&mut run, 30, |_, _| f32::NAN);
        run.0.input()
    };
    strays(&mut run, 100, |_, _| f32::NAN);
    assert_eq!(run.0.state(), TunerState::Holding);
    assert_eq!(run.0.input(), held);
    // Nothing was learnt, and it goes on.
    assert_eq!(*run.0.plant().estimator().parameters(), before);
    assert!(strays(&mut run, 300, |_, y| y) < 0.3);
    assert_eq!(run.0.state(), TunerState::Controlling);
    assert!(strays(&mut run, 300, |_, y| y) < 0.1);
    Ok(())
}

#[test]
fn a_sensor_that_is_stuck_is_silent() -> Result<(), Error> {
    let with = TunerSettings { sensor: Sensor { stuck_after: 4, ..Sensor::default() }, ..settings() };
    let mut run = settled(&with)?;
    assert!(strays(&mut run, 60, |_, _| 0.97) < 0.2);
    assert_eq!(run.0.state(), TunerState::Bridging);
    assert!(strays(&mut run, 300, |_, y| y) < 0.2);
    Ok(())
}

#[test]
fn a_measurement_out_of_range_is_taken_as_the_end_of_the_range() -> Result<(), Error> {
    let with = TunerSettings { sensor: Sensor { range: -3.0..=3.0, ..Sensor::default() }, ..settings() };
    for spike in [1e6, f32::INFINITY, -1e6, f32::NEG_INFINITY, f32::MAX] {
        let mut run = settled(&with)?;
        let before = *run.0.plant().estimator().parameters();
        strays(&mut run, 1, |_, _| spike);
        assert_eq!(*run.0.plant().estimator().parameters(), before);
        assert!(strays(&mut run, 300, |_, y| y) < 1.5);
        assert!(strays(&mut run, 300, |_, y| y) < 0.1, "{spike}");
    }
    // Where the range has no end, what is too large for a regressor is missing.
    for spike in [f32::INFINITY, f32::MAX, 1e20] {
        let mut run = settled(&settings())?;
        strays(&mut run, 1, |_, _| spike);
        assert!(strays(&mut run, 300, |_, y| y) < 0.2);
        assert!(run.0.input().is_finite());
    }
    Ok(())
}

#[test]
fn a_set_point_that_cannot_be_reached_saturates_the_actuator_and_nothing_winds_up() -> Result<(), Error> {
    let (mut tuner, mut plant, mut noise) = settled(&settings())?;
    for _ in 0..500 {
        let y = plant.output(0.005 * noise.normal());
        let u = tuner.control(30.0, y as f32);
        assert!(u <= 10.0);
        plant.input(u.into());
    }
    assert_eq!(tuner.input(), 10.0);
    let mut run = (tuner, plant, noise);
    strays(&mut run, 60, |_, y| y);
    assert!(strays(&mut run, 300, |_, y| y) < 0.1);
    assert_eq!(run.0.control(f32::NAN, 1.0), run.0.input());
    Ok(())
}

/// The actuator does half of what it is asked for, and says so.
#[test]
fn it_knows_what_the_actuator_did() -> Result<(), Error> {
    let (mut tuner, mut plant, mut noise) = settled(&settings())?;
    for k in 0..600 {
        let y = plant.output(0.005 * noise.normal());
        let u = (tuner.control(1.0, y as f32)).min(0.8);
        tuner.applied(u);
        tuner.applied(f32::NAN);
        plant.input(u.into());
        if k > 500 {
            assert!((y - 0.8).abs() < 0.1, "{k} {y}");
        }
    }
    let mut run = (tuner, plant, noise);
    strays(&mut run, 100, |_, y| y);
    assert!(strays(&mut run, 100, |_, y| y) < 0.1);
    Ok(())
}

/// Twice the gain, half the time constant, two samples more of dead time, an integrator: back within 300 samples.
#[test]
fn a_plant_that_changes_is_learnt_again() -> Result<(), Error> {
    let plants = [
        Simulated::new([1.0, -1.5, 0.56], &[0.0, 0.08, 0.04]),
        Simulated::new([1.0, -1.13, 0.3136], &[0.0, 0.12, 0.0636]),
        Simulated::new([1.0, -1.5, 0.56], &[0.0, 0.0, 0.0, 0.03, 0.01]),
        Simulated::new([1.0, -1.8, 0.8], &[0.0, 0.03, 0.02]),
        Simulated::new([1.0, -1.4, 0.74], &[0.0, 0.2, 0.14]),
        oven(),
    ];
    let mut run = settled(&settings())?;
    for (index, next) in plants.iter().enumerate() {
        run.1.becomes(next);
        for k in 0..300 {
            let y = run.1.output(0.005 * run.2.normal());
            let set_point = if k / 50 % 2 == 0 { -1.0 } else { 1.0 };
            run.1.input(run.0.control(set_point, y as f32).into());
        }
        strays(&mut run, 60, |_, y| y);
        let farthest = strays(&mut run, 1000, |_, y| y);
        assert!(farthest < 0.15, "{index}: {farthest}");
    }
    Ok(())
}
