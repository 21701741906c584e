//! How often 95 % bands hold, and whether the document says so.

use rayon::prelude::*;

use super::*;

/// Poles of radius 0.97 at 0.6 radians per row.
const RESONANT: Plant = Plant { b: [0.0, 1.0], a: [-1.601_150_2, 0.940_9] };

/// What share of points in the band 0.1 … 3 rad a magnitude's interval holds, in how many of the runs bands are called
/// honest, and the root mean square of the relative error.
fn measured(method: Method, runs: u64) -> (f64, f64, f64) {
    let of = |run: u64| {
        let u = noise(1000 + run, 4096);
        let y: Vec<f64> =
            RESONANT.output(&u).iter().zip(noise(100_000 + run, 4096)).map(|(y, e)| y + e).collect();
        let frequencies = match method {
            Method::Welch { .. } => Frequencies::Between { low: 0.2, high: 6.0, points: None },
            _ => Frequencies::At((1..=60).map(|k| 0.1 * f64::from(k)).collect()),
        };
        let found =
            spectrum(&log(&[("u", &u), ("y", &y)]), &[], &SpectrumPlan { frequencies, ..plan(method) })
                .unwrap();
        let points = &found.responses[0].points;
        let (mut inside, mut banded, mut square) = (0, 0, 0.0);
        for point in points {
            let truth = RESONANT.at(0.5 * point.frequency);
            square += (value(point) / truth - 1.0).norm_sqr();
            // A lag window may take more from a spectrum than there is: such a point has no band.
            let Some(interval) = point.magnitude.interval else { continue };
            let holds = (interval.lower.unwrap()..=interval.upper.unwrap()).contains(&truth.norm());
            inside += i32::from(holds);
            banded += 1;
        }
        let count = points.len() as f64;
        assert!(f64::from(banded) > 0.9 * count, "{method:?} {banded} of {count}");
        (
            f64::from(inside) / f64::from(banded),
            f64::from(u8::from(found.bands.honest == Some(true))),
            square / count,
        )
    };
    let all: Vec<(f64, f64, f64)> = (0..runs).into_par_iter().map(of).collect();
    let mean = |of: fn(&(f64, f64, f64)) -> f64| all.iter().map(of).sum::<f64>() / runs as f64;
    (mean(|all| all.0), mean(|all| all.1), mean(|all| all.2).sqrt())
}

/// Over 300 runs the intervals held in 95.4 % (lpm of 6 lines), 95.6 % (12), 74.5 % (spa of 30 lags), 92.6 % (100),
/// 95.9 % (300), 90.4 % (welch of 128 rows) and 95.5 % (512), with errors of 1.08, 0.68, 0.25, 0.28, 0.49, 0.28 and
/// 0.56.
#[test]
fn bands_hold_what_the_document_says() {
    const RUNS: u64 = 12;
    // 60 points in each of 12 runs: a standard deviation of less than 1 % for what is independent.
    for (method, least) in [
        (Method::Lpm { half_width: Some(6) }, 0.92),
        (Method::Lpm { half_width: Some(12) }, 0.92),
        (Method::Spa { lags: Some(300) }, 0.92),
        (Method::Welch { window: Some(512), estimator: Estimator::H1 }, 0.92),
        (Method::Spa { lags: None }, 0.88),
    ] {
        let (held, honest, _) = measured(method, RUNS);
        assert!(held > least && honest > 0.9, "{method:?} {held} {honest}");
    }
    let (held, honest, _) = measured(Method::Spa { lags: Some(30) }, RUNS);
    assert!(held < 0.85 && honest == 0.0, "{held} {honest}");
}
