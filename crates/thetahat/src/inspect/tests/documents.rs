//! The whole inspection: what it takes, what it refuses, and its document.

use super::*;
use crate::Document;

/// A log of a plant with a delay of 3, a closed loop being far away.
fn log() -> (Vec<f64>, Vec<f64>) {
    let u = telegraph(1, 600, 0.3);
    let y = sum_of(&divided(&[-0.8], &late(&u, 3)), 0.1, &normal(2, 600));
    (u, y)
}

pub(super) fn inspected(recording: Recording, plan: &InspectionPlan) -> Inspection {
    let inspection = inspect(recording, &source(), plan).unwrap();
    // Written and read back it is the same: nothing in it is not a number.
    let back: Inspection = serde_json::from_str(&inspection.to_json().unwrap()).unwrap();
    assert_eq!(back, inspection);
    inspection
}

fn says(inspection: &Inspection, what: &str) -> bool {
    inspection.warnings().iter().any(|warning| warning.contains(what))
}

#[test]
fn a_good_log_gets_no_warning() {
    let (u, y) = log();
    let found = inspected(
        recording(&[("u", &u), ("y", &y), ("other", &y)], Times::Uniform(0.5)),
        &plan(&["u"], Some("y")),
    );
    assert_eq!(found.schema, "thetahat.inspection/1");
    assert_eq!((found.rows, found.log.rows), (600, "1..600".parse().unwrap()));
    assert_eq!(found.warnings(), [""; 0]);
    let roles: Vec<Option<&str>> = found.channels.iter().map(|channel| channel.role.as_deref()).collect();
    assert_eq!(roles, [Some("input"), Some("output"), None]);
    assert_eq!((found.excitation[0].order, found.delays[0].nk), (50, Some(3)));
    assert!(!found.feedback[0].found && found.feedback[0].p_value.is_some());
}

#[test]
fn without_inputs_or_output_the_rest_is_there() {
    let (u, y) = log();
    let both = || recording(&[("u", &u), ("y", &y)], Times::Uniform(0.5));
    let found = inspected(both(), &plan(&["u"], None));
    assert_eq!((found.excitation.len(), found.delays.len(), found.feedback.len()), (1, 0, 0));
    assert!(says(&found, "there is no output"));
    let found = inspected(both(), &plan(&[], Some("y")));
    assert!(found.excitation.is_empty() && says(&found, "there is no input"));
    let found = inspected(both(), &plan(&[], None));
    assert_eq!(found.channels.len(), 2);
    assert!(says(&found, "no column is an input or the output"));
}

#[test]
fn an_irregular_clock_is_resampled() {
    let (u, y) = log();
    let mut noise = Noise(5);
    let mut now = 100.0;
    let time: Vec<f64> = u
        .iter()
        .map(|_| {
            now += 0.5 * (1.01 + 0.3 * noise.uniform());
            now
        })
        .collect();
    let record = || recording(&[("u", &u), ("y", &y)], Times::Measured(time.clone()));
    let found = inspected(record(), &plan(&["u"], Some("y")));
    assert!(found.clock.irregular && says(&found, "irregular") && says(&found, "`resample` 0.5:linear"));
    let resampled = found.log.resampled.clone().unwrap();
    assert_eq!((resampled.step, resampled.interpolation, resampled.rows), (0.5, Interpolation::Linear, 600));
    assert_eq!((found.rows, found.channels[0].repeated), (600, quality(u.clone()).repeated));
    assert!((600..620).contains(&found.log.rows.len()));
    // As it was asked for.
    let asked =
        InspectionPlan { resample: Some(Resample::new(1.0, Interpolation::Hold)), ..plan(&["u"], Some("y")) };
    let found = inspected(record(), &asked);
    assert_eq!(found.log.resampled.as_ref().map(|resampled| resampled.step), Some(1.0));
    assert!(!says(&found, "irregular") && (300..310).contains(&found.log.rows.len()));
    // The same as inspecting what it was resampled to.
    let log = Log::resampled(record().channels, &time, &Resample::new(1.0, Interpolation::Hold)).unwrap();
    let again = inspected(
        Recording { channels: log.channels().to_vec(), times: Times::Uniform(1.0) },
        &plan(&["u"], Some("y")),
    );
    assert_eq!(
        (&found.excitation, &found.delays, &found.feedback),
        (&again.excitation, &again.delays, &again.feedback)
    );
}

#[test]
fn a_clock_that_cannot_be_used_leaves_the_dynamics_out() {
    let (u, y) = log();
    let mut time: Vec<f64> = (0..600).map(f64::from).collect();
    time[300] = 5.0;
    let found = inspected(
        recording(&[("u", &u), ("y", &y)], Times::Measured(time.clone())),
        &plan(&["u"], Some("y")),
    );
    assert!(found.excitation.is_empty() && found.channels.len() == 2);
    assert!(says(&found, "goes back at row 301") && says(&found, "left out"));
    time[300] = time[299];
    time[301] = time[299];
    let found = inspected(recording(&[("u", &u)], Times::Measured(time.clone())), &plan(&["u"], None));
    assert!(says(&found, "repeats at row 301 (2 such rows)"));
    // A pause of years in a log of minutes, and an irregular step.
    let time: Vec<f64> =
        (0..600).map(|t| if t < 300 { 1.2 * f64::from(t) } else { 1e9 + f64::from(t) }).collect();
    let found = inspected(recording(&[("u", &u)], Times::Measured(time)), &plan(&["u"], None));
    assert!(found.excitation.is_empty() && says(&found, "pauses"));
}

#[test]
fn every_fault_has_its_word() {
    let (u, mut y) = log();
    y[10] = f64::NAN;
    y[20] = 500.0;
    let time: Vec<f64> = (0..600).map(|t| if t < 400 { f64::from(t) } else { 30.0 + f64::from(t) }).collect();
    let found =
        inspected(recording(&[("u", &u), ("y", &y)], Times::Measured(time)), &plan(&["u"], Some("y")));
    for word in ["misses 1 of 600", "at row 21:", "1 gap "] {
        assert!(says(&found, word), "{word}: {:?}", found.warnings());
    }
    assert_eq!((found.clock.gaps, found.clock.irregular), (1, false));

    let y: Vec<f64> = (0..600).map(|t| 0.01 * f64::from(t) + f64::from(t % 2)).collect();
    let coarse: Vec<f64> = normal(3, 600).iter().map(|x| (1.5 * x).round()).collect();
    let clipped: Vec<f64> = (0..600).map(|t| (f64::from(t) / 20.0).sin().min(0.5)).collect();
    let step: Vec<f64> = (0..600).map(|t| f64::from(u8::from(t > 100))).collect();
    let sine: Vec<f64> = (0..600).map(|t| (0.3 * f64::from(t)).sin()).collect();
    let dead = vec![7.0; 600];
    let empty = vec![f64::NAN; 600];
    let channels: [(&str, &[f64]); 7] = [
        ("y", &y),
        ("coarse", &coarse),
        ("clipped", &clipped),
        ("step", &step),
        ("sine", &sine),
        ("dead", &dead),
        ("empty", &empty),
    ];
    let found =
        inspected(recording(&channels, Times::Uniform(1.0)), &plan(&["step", "sine", "dead"], Some("y")));
    for word in [
        "'y' has a trend that explains 9",
        "'coarse' is rounded to multiples of 1,",
        "'clipped' rests at its largest value in",
        "'step' changes 1 time only",
        "'sine' excites order 2 only",
        "'dead' excites nothing",
        "'dead' is constant",
        "'empty' has no values",
        "no effect of input 'sine'",
    ] {
        assert!(says(&found, word), "{word}: {:?}", found.warnings());
    }
    assert!(!says(&found, "no effect of input 'dead'"));

    let other: Vec<f64> = coarse.iter().map(|x| 3.0 - 2.0 * x).collect();
    // Without noise nothing can be said of feedback.
    let noisy = sum_of(&y, 0.1, &normal(4, 600));
    let both = recording(&[("u1", &coarse), ("u2", &other), ("y", &noisy)], Times::Uniform(1.0));
    let found = inspected(both, &plan(&["u1", "u2"], Some("y")));
    assert!(says(&found, "'u1' and 'u2' are the same"));
    assert_eq!((&found.excitation[0].same_as, found.excitation[1].same_as.as_deref()), (&None, Some("u1")));
    assert!(found.feedback[0].p_value.is_some() && found.feedback[1].p_value.is_none());

    // A loop, closed in the same row.
    let e = normal(9, 1000);
    let (mut u, mut y) = (vec![0.0], vec![0.0]);
    for t in 1..1000 {
        y.push(0.9 * y[t - 1] + 0.5 * u[t - 1] + 0.3 * e[t]);
        u.push(0.8 * (telegraph(8, 1000, 0.3)[t] - y[t]));
    }
    let found = inspected(recording(&[("u", &u), ("y", &y)], Times::Uniform(1.0)), &plan(&["u"], Some("y")));
    assert!(found.feedback[0].found);
    assert!(says(&found, "'u' follows past errors of the output") && !says(&found, "within the same row"));
    assert_eq!(found.delays[0].nk, Some(1));
}

#[test]
fn odd_values_do_no_harm() {
    let u = normal(1, 100);
    let scaled = |size: f64| u.iter().map(|x| size * x).collect::<Vec<f64>>();
    let alternating: Vec<f64> = (0..100).map(|t| if t % 2 == 0 { f64::MAX } else { -f64::MAX }).collect();
    let mut sparse = vec![f64::NAN; 100];
    sparse[50] = 1.0;
    for (name, x) in [
        ("huge", scaled(1e300)),
        ("tiny", scaled(1e-300)),
        ("denormal", scaled(1e-315)),
        ("extreme", alternating),
        ("constant", vec![1e300; 100]),
        ("zero", vec![0.0; 100]),
        ("missing", vec![f64::NAN; 100]),
        ("sparse", sparse),
        ("every other", (0..100).map(|t| if t % 2 == 0 { 1.0 + f64::from(t) } else { f64::NAN }).collect()),
    ] {
        for times in [Times::Uniform(1e-300), Times::Uniform(1.0), Times::Uniform(1e300)] {
            for channels in [[("u", &x), ("y", &u)], [("u", &u), ("y", &x)], [("u", &x), ("y", &x)]] {
                let channels = channels.map(|(name, values)| (name, values.as_slice()));
                let found = inspected(recording(&channels, times.clone()), &plan(&["u"], Some("y")));
                assert_eq!(found.delays.len(), 1, "{name}");
            }
        }
    }
    let found =
        inspected(recording(&[("u", &[1.0]), ("y", &[2.0])], Times::Uniform(1.0)), &plan(&["u"], Some("y")));
    assert!(says(&found, "1 row only"));
    for rows in 2..40 {
        inspected(
            recording(&[("u", &u[..rows]), ("y", &u[50..50 + rows])], Times::Uniform(1.0)),
            &plan(&["u"], Some("y")),
        );
    }
}

#[test]
fn what_is_no_log_is_refused() {
    let ok = [1.0, 2.0, 4.0];
    let refused = |channels: &[(&str, &[f64])], times: Times, plan: &InspectionPlan| {
        inspect(recording(channels, times), &source(), plan).unwrap_err().to_string()
    };
    let step = || Times::Uniform(1.0);
    for (channels, times, plan, word) in [
        (vec![], step(), plan(&[], None), "no rows"),
        (vec![("u", &ok[..0])], step(), plan(&["u"], None), "no rows"),
        (vec![("u", &ok[..]), ("y", &ok[..2])], step(), plan(&["u"], None), "rows"),
        (vec![("u", &ok[..]), ("u", &ok[..])], step(), plan(&["u"], None), "two channels"),
        (vec![("u", &[1.0, f64::INFINITY][..])], step(), plan(&["u"], None), "infinite in row 2"),
        (vec![("u", &ok[..])], step(), plan(&["x"], None), "no channel 'x'"),
        (vec![("u", &ok[..])], step(), plan(&["u"], Some("u")), "named twice"),
        (vec![("u", &ok[..])], Times::Uniform(0.0), plan(&["u"], None), "positive"),
        (vec![("u", &ok[..])], Times::Measured(vec![1.0; 3]), plan(&["u"], None), "never advances"),
        (
            vec![("u", &ok[..])],
            Times::Measured(vec![0.0, 1.0, 2.0]),
            InspectionPlan { resample: Some(Resample::new(-1.0, Interpolation::Hold)), ..plan(&["u"], None) },
            "positive",
        ),
    ] {
        let message = refused(&channels, times, &plan);
        assert!(message.contains(word), "{word}: {message}");
    }
}
