use std::f64::consts::PI;

use super::*;
use crate::data::Offset;
use crate::model::{Orders, Signal};

fn signal(name: &str) -> Signal {
    Signal { name: name.to_owned(), offset: Offset::default() }
}

/// Two inputs and two outputs of three states, one of them slow, sampled every 0.1 s.
fn plant() -> StateSpace {
    let matrix = |rows: usize, columns: usize, values: &[f64]| DMatrix::from_row_slice(rows, columns, values);
    StateSpace {
        f: matrix(3, 3, &[0.8, 0.3, 0.0, -0.3, 0.8, 0.1, 0.0, 0.0, 0.97]),
        g: matrix(3, 2, &[1.0, 0.0, 0.5, 1.0, 0.1, 0.2]),
        h: matrix(2, 3, &[1.0, 0.0, 1.0, 0.0, 1.0, -0.5]),
        d: matrix(2, 2, &[0.0, 0.3, 0.0, 0.0]),
        k: matrix(3, 2, &[0.3, 0.1, 0.0, 0.4, 0.2, -0.1]),
        noise_covariance: matrix(2, 2, &[0.4, 0.1, 0.1, 0.2]),
        sample_time: 0.1,
    }
}

fn model(delays: &[usize]) -> Result<Model, Error> {
    let signals = (vec![signal("u1"), signal("u2")], vec![signal("y1"), signal("y2")]);
    Ok(StateSpaceModel::new(signals, delays.to_vec(), &plant(), 17, Some(80))?.into())
}

fn polynomial(orders: &Orders, parameters: &[f64]) -> Result<Model, Error> {
    let model = PolynomialModel::from_parameters(orders, parameters, None, 0.25, 0.1)?;
    let inputs = (1..=model.inputs.len()).map(|place| signal(&format!("u{place}"))).collect();
    Ok(PolynomialModel { inputs, output: signal("y"), ..model }.into())
}

fn apart(one: &StateSpace, other: &StateSpace) -> f64 {
    let pairs = [
        (&one.f, &other.f),
        (&one.g, &other.g),
        (&one.h, &other.h),
        (&one.d, &other.d),
        (&one.k, &other.k),
        (&one.noise_covariance, &other.noise_covariance),
    ];
    let each = pairs
        .iter()
        .map(|(one, other)| if one.shape() == other.shape() { (*one - *other).amax() } else { 1e9 });
    each.fold((one.sample_time - other.sample_time).abs(), f64::max)
}

/// The steps of all inputs as all outputs see them, one list after the other.
fn steps(model: &Model, samples: usize) -> Result<Vec<Vec<f64>>, Error> {
    let mut all = Vec::new();
    for own in model.linear("a step")? {
        for input in 0..own.inputs().len() {
            let found = own.step_response(input, Some(samples))?;
            all.push(found.values.iter().map(|value| value.value).collect());
        }
    }
    Ok(all)
}

fn farthest(one: &[Vec<f64>], other: &[Vec<f64>]) -> f64 {
    let same = one.len() == other.len() && one.iter().zip(other).all(|(one, other)| one.len() == other.len());
    let pairs = one.iter().flatten().zip(other.iter().flatten());
    if same { pairs.map(|(one, other)| (one - other).abs()).fold(0.0, f64::max) } else { f64::INFINITY }
}

#[test]
fn there_and_back_nothing_changes() -> Result<(), Error> {
    for hold in Hold::all() {
        for delays in [[0, 0], [3, 0], [2, 5]] {
            let sampled = model(&delays)?;
            let continuous = sampled.to_continuous(hold)?;
            assert_eq!(
                (continuous.hold, continuous.sample_time, continuous.degrees_of_freedom),
                (hold, 0.1, Some(80))
            );
            let late: Vec<f64> = delays.iter().map(|delay| 0.1 * *delay as f64).collect();
            assert_eq!(continuous.delays, late);
            let back = continuous.sampled(0.1, hold)?;
            assert_eq!(back.delays, delays);
            let Model::StateSpace(own) = &sampled else { return Err(Error::argument("model", "other kind")) };
            let found = apart(&back.matrices(), &own.matrices());
            assert!(found < 1e-12, "{hold} {delays:?} {found}");
            // It is the same through a document.
            let text = serde_json::to_string(&Model::from(continuous.clone()))
                .map_err(|e| Error::report(e.to_string()))?;
            let read: Model = serde_json::from_str(&text).map_err(|e| Error::report(e.to_string()))?;
            read.check()?;
            assert_eq!(read, continuous.into());
        }
    }
    Ok(())
}

#[test]
fn steps_agree_at_the_samples() -> Result<(), Error> {
    let sampled = model(&[3, 0])?;
    let continuous = sampled.to_continuous(Hold::Zero)?;
    assert!(farthest(&steps(&sampled, 60)?, &steps(&continuous.clone().into(), 60)?) < 1e-11);
    // Slower and faster, with delays of 1.5, 0.5 and 4.5 of the new samples.
    for (seconds, every) in [(0.2, 2), (0.6, 6)] {
        let slow = continuous.sampled(seconds, Hold::Zero)?;
        let slow = steps(&slow.into(), 60 / every)?;
        let known: Vec<Vec<f64>> = steps(&sampled, 60)?
            .iter()
            .map(|values| values.iter().copied().step_by(every).collect())
            .collect();
        assert!(farthest(&slow, &known) < 1e-11, "{seconds}");
    }
    let fast = steps(&continuous.sampled(0.3 / 4.5, Hold::Zero)?.into(), 90)?;
    let slow = steps(&continuous.sampled(0.2, Hold::Zero)?.into(), 30)?;
    let known: Vec<Vec<f64>> =
        fast.iter().map(|values| values.iter().copied().step_by(3).collect()).collect();
    assert!(farthest(&slow, &known) < 1e-10);
    Ok(())
}

#[test]
fn sampled_frequencies_are_those_of_continuous_time_after_the_hold() -> Result<(), Error> {
    // 3/(s^2 + 2 s + 5), sampled fast: what is folded from above half the sampling frequency is small.
    let matrix = |rows: usize, columns: usize, values: &[f64]| DMatrix::from_row_slice(rows, columns, values);
    let continuous = ContinuousStateSpace {
        a: matrix(2, 2, &[0.0, 1.0, -5.0, -2.0]),
        b: matrix(2, 1, &[0.0, 3.0]),
        c: matrix(1, 2, &[1.0, 0.0]),
        d: matrix(1, 1, &[0.0]),
        k: matrix(2, 1, &[0.0, 0.0]),
        noise_intensity: matrix(1, 1, &[0.01]),
    };
    let head = Head {
        inputs: vec![signal("u")],
        outputs: vec![signal("y")],
        delays: vec![0.02],
        sample_time: 0.001,
        hold: Hold::Zero,
        free_parameters: 4,
        degrees_of_freedom: None,
    };
    let model = ContinuousStateSpaceModel::new(head, &continuous)?;
    assert!((model.natural_frequencies[0] - 5.0_f64.sqrt()).abs() < 1e-12);
    assert!(model.damping[0].is_some_and(|damping| (damping - 1.0 / 5.0_f64.sqrt()).abs() < 1e-12));
    assert!(model.time_constants[0].is_some_and(|time| (time.value - 1.0).abs() < 1e-12));
    assert!(model.dc_gain[0][0].is_some_and(|gain| (gain.value - 0.6).abs() < 1e-12) && model.stable);
    let transfer = model.transfer(0, 0)?;
    assert!(transfer.zeros.is_empty() && (transfer.gain - 3.0).abs() < 1e-12);

    let frequencies = [0.0, 0.1, 1.0, 2.0, 10.0, 50.0];
    let own = Model::from(model.clone());
    let of = |model: &Model| -> Result<_, Error> {
        Ok(model.linear("a response")?[0].frequency_response(&frequencies)?[0].points.clone())
    };
    let sampled = of(&model.sampled(0.001, Hold::Zero)?.into())?;
    for (point, held) in of(&own)?.iter().zip(&sampled) {
        let w = point.frequency;
        let (re, im) = (5.0 - w * w, 2.0 * w);
        let magnitude = 3.0 / re.hypot(im);
        let phase = -(im.atan2(re)) - 0.02 * w;
        assert!(
            (point.magnitude.value - magnitude).abs() < 1e-13 && (point.phase.value - phase).abs() < 1e-12
        );
        // The hold: sin(w T/2)/(w T/2), half a sample late.
        let half = 0.5 * w * 0.001;
        let gain = if half > 0.0 { half.sin() / half } else { 1.0 };
        assert!((held.magnitude.value / (magnitude * gain) - 1.0).abs() < 1e-4, "{w}");
        assert!((held.phase.value - (phase - half)).abs() < 1e-4, "{w}");
    }
    // The impulse response is the derivative of that to a step.
    let linear = own.linear("a response")?;
    let (impulse, step) =
        (linear[0].impulse_response(0, Some(3000))?, linear[0].step_response(0, Some(3000))?);
    for k in (25..2900).step_by(97) {
        let slope = (step.values[k + 1].value - step.values[k - 1].value) / 0.002;
        assert!((impulse.values[k].value - slope).abs() < 1e-5, "{k}");
    }
    assert!(
        linear[0].frequency_response(&[-1.0]).is_err() && linear[0].frequency_response(&[f64::NAN]).is_err()
    );
    Ok(())
}

#[test]
fn processes_are_what_their_polynomials_are_at_the_samples() -> Result<(), Error> {
    let cases: [(&[&str], &[f64]); 8] = [
        (&["p1d"], &[2.0, 3.0, 1.3]),
        (&["p2"], &[2.0, 3.0, 3.0]),
        (&["p3d"], &[1.0, 2.0, 0.7, 4.0, 0.5]),
        (&["p2du"], &[1.5, 1.2, 0.3, 0.8]),
        (&["p2zd"], &[2.0, 3.0, 1.0, -0.5, 0.25]),
        (&["p1di"], &[0.4, 2.0, 0.75]),
        (&["rc2"], &[0.1, 1.0, 0.5, 2.0, 8.0]),
        (&["p1d", "p2"], &[2.0, 3.0, 1.3, -1.0, 2.0, 5.0]),
    ];
    for (words, values) in cases {
        let process = crate::model::process::tests::model(words, values);
        let continuous = process.in_state_space(Hold::Zero)?;
        assert_eq!(continuous.noise_intensity, [[0.04 * 0.5]]);
        let own = Model::from(process);
        let known = steps(&own, 80)?;
        assert!(farthest(&steps(&continuous.clone().into(), 80)?, &known) < 1e-9, "{words:?}");
        // Three samples of 0.5 s each.
        let slow = steps(&own.at_sample_time(1.5, None)?.into(), 26)?;
        let known: Vec<Vec<f64>> =
            known.iter().map(|values| values.iter().copied().step_by(3).take(26).collect()).collect();
        assert!(farthest(&slow, &known) < 1e-9, "{words:?}");
        let Model::StateSpace(sampled) = Model::from(own.at_sample_time(0.3, None)?) else { continue };
        assert!(sampled.noise_covariance[0][0] == 0.04 && sampled.k.iter().flatten().all(|k| *k == 0.0));
    }
    Ok(())
}

/// The covariances of the noise of the outputs so many samples apart.
fn covariances(model: &StateSpace, lags: &[u32]) -> Vec<DMatrix<f64>> {
    let one = Steps::one(model);
    let state = Steps::repeated(&one, 1 << 20).covariance;
    let StateSpace { f, h, k, noise_covariance, .. } = model;
    let next = f * &state * h.transpose() + k * noise_covariance;
    let of = |lag: &u32| match lag {
        0 => h * &state * h.transpose() + noise_covariance,
        lag => h * f.pow(lag - 1) * &next,
    };
    lags.iter().map(of).collect()
}

#[test]
fn noise_of_every_third_sample_is_what_it_was() -> Result<(), Error> {
    let own = plant();
    let slow = model(&[0, 0])?.at_sample_time(0.3, None)?.matrices();
    for (found, known) in covariances(&slow, &[0, 1, 2, 5]).iter().zip(covariances(&own, &[0, 3, 6, 15])) {
        assert!((found - known).amax() < 1e-10, "{found}");
    }
    // Predictions over a longer time are worse, and the predictor stable.
    assert!(slow.noise_covariance[(0, 0)] > own.noise_covariance[(0, 0)]);
    assert!(crate::model::is_stable(&(&slow.f - &slow.k * &slow.h)));
    // Times between and shorter ones pass on smoothly.
    let near = model(&[0, 0])?.at_sample_time(0.3 * (1.0 - 1e-6), None)?.matrices();
    assert!(apart(&slow, &near) < 1e-4);
    let near = model(&[0, 0])?.at_sample_time(0.1 * (1.0 - 1e-6), None)?.matrices();
    assert!(apart(&own, &near) < 1e-4, "{}", apart(&own, &near));
    let fast = model(&[0, 0])?.at_sample_time(0.04, None)?.matrices();
    assert!(crate::model::is_stable(&(&fast.f - &fast.k * &fast.h)));
    Ok(())
}

#[test]
fn poles_without_a_logarithm_go_to_multiples_of_the_sample_time() -> Result<(), Error> {
    // Poles at 0.9 and -0.5, two more samples of delay.
    let model = polynomial(&Orders::arx(2, &[2], &[3])?, &[-0.4, -0.45, 1.0, 0.5])?;
    let error =
        model.to_continuous(Hold::Zero).map(|_| ()).err().map(|error| error.to_string()).unwrap_or_default();
    assert!(error.contains("the pole -0.5 on the negative real axis has no real logarithm"), "{error}");
    assert!(matches!(model.at_sample_time(0.25, None), Err(Error::Undetermined { .. })));
    assert!(matches!(model.at_sample_time(0.05, None), Err(Error::Undetermined { .. })));
    let slow = Model::from(model.at_sample_time(0.3, None)?);
    let known: Vec<Vec<f64>> =
        steps(&model, 90)?.iter().map(|values| values.iter().copied().step_by(3).collect()).collect();
    assert!(farthest(&steps(&slow, 30)?, &known) < 1e-12);
    assert!(model.to_continuous(Hold::Tustin)?.poles.len() == 2);
    // Where both ways are open they are one.
    let one = self::model(&[0, 0])?.at_sample_time(0.5, None)?.matrices();
    assert!(apart(&one, &plant().every(5, 0.5)?) < 1e-10);
    // The own sample time needs no logarithm.
    assert_eq!(model.at_sample_time(0.1, None)?.delays, [2]);
    Ok(())
}

#[test]
fn an_arx_model_goes_through_continuous_time() -> Result<(), Error> {
    let model = polynomial(&Orders::arx(2, &[2, 1], &[1, 4])?, &[-1.5, 0.56, 0.2, 0.1, 0.3])?;
    let continuous = model.to_continuous(Hold::Zero)?;
    assert!(continuous.delays[0] == 0.0 && (continuous.delays[1] - 0.3).abs() < 1e-15);
    // The poles of z^2 - 1.5 z + 0.56.
    let known = [0.7_f64.ln() / 0.1, 0.8_f64.ln() / 0.1];
    for (pole, known) in continuous.poles.iter().zip(known) {
        assert!((pole.re - known).abs() < 1e-10 && pole.im == 0.0, "{pole:?}");
    }
    let known = steps(&model, 50)?;
    assert!(farthest(&steps(&continuous.into(), 50)?, &known) < 1e-12);
    Ok(())
}

#[test]
fn what_cannot_be_converted_is_refused() -> Result<(), Error> {
    let sampled = model(&[3, 0])?;
    let message = |result: Result<StateSpaceModel, Error>| {
        result.err().map(|error| error.to_string()).unwrap_or_default()
    };
    let error = message(sampled.at_sample_time(0.2, Some(Hold::First)));
    assert_eq!(
        error,
        "to: the delay of 'u1', 0.3 s, is 1.5 samples of 0.2 s, no whole number, which only `zoh` can have; take it, or a time that divides \
         the delay, such as 0.15 s or 0.3 s"
    );
    assert!(sampled.at_sample_time(0.15, Some(Hold::Tustin)).is_ok());
    for wrong in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(message(sampled.at_sample_time(wrong, None)).starts_with("to: it is"), "{wrong}");
    }
    assert!(message(sampled.at_sample_time(1e-9, None)).contains("is more than 1000 samples"));
    for absurd in [1e-300, 1e300] {
        assert!(sampled.at_sample_time(absurd, None).is_err(), "{absurd}");
    }
    let continuous = Model::from(sampled.to_continuous(Hold::Zero)?);
    let error = continuous
        .to_continuous(Hold::Zero)
        .map(|_| ())
        .err()
        .map(|error| error.to_string())
        .unwrap_or_default();
    assert!(error.contains("in continuous time already"), "{error}");
    // An input that acts at once makes the response to an impulse infinite.
    assert!(continuous.linear("a response")?[0].impulse_response(1, None).is_err());
    assert!(continuous.linear("a response")?[1].impulse_response(1, None).is_ok());
    for (text, known) in [("continuous", Some(TimeBase::Continuous)), ("0.5", Some(TimeBase::Sampled(0.5)))] {
        assert_eq!(text.parse::<TimeBase>().ok(), known);
    }
    for wrong in ["", "0", "-1", "NaN", "inf", "1e999", "slow"] {
        assert!(matches!(wrong.parse::<TimeBase>(), Err(Error::Argument { .. })), "{wrong}");
    }
    Ok(())
}

#[test]
fn phases_turn_by_zeros_and_poles_on_either_side() -> Result<(), Error> {
    // (1 - s)/((1 + s) s) and 1/(s - 1), whose phases go from -90 to -270 and from -180 to -90 degrees.
    let matrix = |rows: usize, columns: usize, values: &[f64]| DMatrix::from_row_slice(rows, columns, values);
    let of = |a: DMatrix<f64>, b: DMatrix<f64>, c: DMatrix<f64>| -> Result<Vec<f64>, Error> {
        let n = a.nrows();
        let (k, d) = (DMatrix::zeros(n, 1), DMatrix::zeros(1, 1));
        let continuous = ContinuousStateSpace { a, b, c, d, k, noise_intensity: matrix(1, 1, &[1.0]) };
        let head = Head {
            inputs: vec![signal("u")],
            outputs: vec![signal("y")],
            delays: vec![0.0],
            sample_time: 0.1,
            hold: Hold::Zero,
            free_parameters: 3,
            degrees_of_freedom: None,
        };
        let model = Model::from(ContinuousStateSpaceModel::new(head, &continuous)?);
        let found = model.linear("a response")?[0].frequency_response(&[1e-4, 1.0, 1e4])?;
        Ok(found[0].points.iter().map(|point| point.phase.value / PI).collect())
    };
    let found =
        of(matrix(2, 2, &[0.0, 1.0, 0.0, -1.0]), matrix(2, 1, &[0.0, 1.0]), matrix(1, 2, &[1.0, -1.0]))?;
    for (found, known) in found.iter().zip([-0.5, -1.0, -1.5]) {
        assert!((found - known).abs() < 1e-3, "{found}");
    }
    let found = of(matrix(1, 1, &[1.0]), matrix(1, 1, &[1.0]), matrix(1, 1, &[1.0]))?;
    for (found, known) in found.iter().zip([-1.0, -0.75, -0.5]) {
        assert!((found - known).abs() < 1e-3, "{found}");
    }
    Ok(())
}
