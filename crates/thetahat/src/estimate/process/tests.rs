use std::ops::ControlFlow;

use thetahat_numerics::noise::Noise;
use thetahat_numerics::optimize::Search;

use super::{Background, least_free_run};
use crate::Error;
use crate::model::ProcessStructure;
use crate::respond::process::{HeldLog, run, sensitivities};

/// A clock that no step fits twice, and an input that moves with it.
fn experiment() -> (Vec<f64>, Vec<f64>) {
    let times: Vec<f64> = (0..60).map(|k| f64::from(k) * 0.5 + 0.2 * (f64::from(k) * 1.7).sin()).collect();
    let input = (0..60).map(|k| f64::from(k / 7 * 5 % 3) - 0.5).collect();
    (times, input)
}

#[test]
fn slopes_by_all_parameters_are_those_of_differences() {
    let cases: [(&str, &[f64]); 18] = [
        ("p1d", &[2.0, 3.0, 0.83]),
        ("p2d", &[1.0, 4.0, 0.3, 0.21]),
        ("p2d", &[1.0, 2.0, 2.0, 0.21]),
        ("p3d", &[1.0, 4.0, 2.0, 0.3, 1.93]),
        ("p2du", &[1.0, 2.0, 0.2, 0.73]),
        ("p3dzu", &[1.0, 2.0, 0.2, 1.5, -0.4, 0.73]),
        ("p1dz", &[1.0, 2.0, -0.6, 0.71]),
        ("p1di", &[0.5, 2.0, 0.33]),
        ("p0di", &[0.5, 1.13]),
        ("p2dzi", &[0.5, 2.0, 0.7, 0.4, 0.33]),
        ("rc1", &[0.1, 1.0, 0.5]),
        ("rc3", &[0.1, 1.0, 0.5, 2.0, 8.0, 0.3, 30.0]),
        ("tf10", &[2.0, 0.4]),
        ("tf11d", &[0.5, 2.0, 0.4, 0.71]),
        ("tf21d", &[1.0, 0.3, 0.9, 0.5, 0.83]),
        ("tf32i", &[0.2, 1.0, 0.3, 0.9, 0.5]),
        ("tf20i", &[0.3, 0.5]),
        ("tf64d", &[0.1, 0.3, 1.0, 2.0, 3.0, 3.0, 6.0, 9.0, 8.0, 4.0, 1.0, 0.21]),
    ];
    let (times, input) = experiment();
    for (word, values) in cases {
        let structure: ProcessStructure = word.parse().unwrap();
        let response = |values: &[f64]| {
            let parts = structure.taken_apart(values);
            let mut found = Vec::new();
            run(&structure, &parts.shape, parts.dead_time, (&times, &input), |_, columns| {
                let each = parts.weights.iter().zip(columns);
                found.push(each.map(|(weight, column)| weight * column).sum::<f64>());
            });
            found
        };
        let parts = structure.taken_apart(values);
        let mut slopes = vec![vec![0.0; values.len()]; times.len()];
        sensitivities(&structure, &parts, (&times, &input), |row, columns, shape, dead_time| {
            structure.own_slopes(&parts, columns, shape, dead_time, &mut slopes[row]);
        });
        for place in 0..values.len() {
            let by = 1e-5 * values[place].abs();
            let moved = |by: f64| {
                let mut values = values.to_vec();
                values[place] += by;
                response(&values)
            };
            let (up, down) = (moved(by), moved(-by));
            let size = slopes.iter().map(|row| row[place].abs()).fold(0.0, f64::max);
            assert!(size > 0.0, "{word} {place}");
            for (row, slopes) in slopes.iter().enumerate() {
                let difference = (up[row] - down[row]) / (2.0 * by);
                assert!(
                    (slopes[place] - difference).abs() < 1e-6 * size,
                    "{word} {place} {row}: {} {difference}",
                    slopes[place]
                );
            }
        }
    }
}

/// The output of a structure with these parameters.
fn output(word: &str, values: &[f64], signals: (&[f64], &[f64])) -> Result<Vec<f64>, Error> {
    let structure: ProcessStructure = word.parse()?;
    let parts = structure.taken_apart(values);
    let mut found = Vec::new();
    run(&structure, &parts.shape, parts.dead_time, signals, |_, columns| {
        found.push(parts.weights.iter().zip(columns).map(|(weight, column)| weight * column).sum());
    });
    Ok(found)
}

#[test]
fn transfer_functions_are_the_processes_that_they_equal() -> Result<(), Error> {
    let (times, input) = experiment();
    let (fast, slow) = (0.3, 4.0);
    let cases: [(&str, Vec<f64>, &str, Vec<f64>); 5] = [
        ("p1d", vec![2.0, slow, 0.83], "tf10d", vec![2.0 / slow, 1.0 / slow, 0.83]),
        ("p1z", vec![2.0, slow, 0.5], "tf11", vec![1.0 / slow, 2.0 / slow, 1.0 / slow]),
        (
            "p2dz",
            vec![2.0, slow, fast, -0.7, 1.3],
            "tf21d",
            vec![
                -1.4 / (slow * fast),
                2.0 / (slow * fast),
                1.0 / slow + 1.0 / fast,
                1.0 / (slow * fast),
                1.3,
            ],
        ),
        ("p2du", vec![2.0, 3.0, 0.1, 0.2], "tf20d", vec![18.0, 0.6, 9.0, 0.2]),
        ("p1di", vec![2.0, slow, 0.3], "tf20di", vec![2.0 / slow, 1.0 / slow, 0.3]),
    ];
    for (lags, of_lags, word, values) in cases {
        let (one, other) =
            (output(lags, &of_lags, (&times, &input))?, output(word, &values, (&times, &input))?);
        let size = one.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
        for (one, other) in one.iter().zip(&other) {
            assert!((one - other).abs() < 1e-9 * size, "{lags} {word}: {one} {other}");
        }
    }
    Ok(())
}

#[test]
fn transfer_functions_are_found_on_any_clock() -> Result<(), Error> {
    let mut noise = Noise(5);
    let times: Vec<f64> = (0..600).map(|k| f64::from(k) * 0.1 + 0.03 * (f64::from(k) * 1.7).sin()).collect();
    let mut level = 0.0;
    let input: Vec<f64> = (0..600)
        .map(|k| {
            if k % 9 == 0 {
                level = noise.uniform();
            }
            level
        })
        .collect();
    let cases: [(&str, Vec<f64>); 5] = [
        ("tf10", vec![2.0, 0.7]),
        ("tf21d", vec![-1.0, 3.0, 1.2, 4.0, 0.37]),
        ("tf22", vec![0.3, -1.0, 3.0, 1.2, 4.0]),
        ("tf41", vec![-12.0, 20.0, 3.0, 28.0, 20.0, 30.0]),
        ("tf31i", vec![1.0, 2.0, 1.5, 3.0]),
    ];
    // From the first row on, at rest; and from the middle of a run.
    for (word, values, begin) in
        cases.iter().flat_map(|(word, values)| [(word, values, 0), (word, values, 101)])
    {
        let structure: ProcessStructure = word.parse()?;
        if begin > 0 && structure.has_dead_time() {
            // What its input was before is not known.
            continue;
        }
        let y = output(word, values, (&times, &input))?;
        let rows = begin..times.len();
        let held = [HeldLog {
            rows: rows.clone(),
            counted: vec![rows.clone()],
            after_pause: false,
            begins: times[begin],
            times: times[begin..].iter().map(|time| time - times[begin]).collect(),
            inputs: vec![input[begin..].to_vec()],
            held: 0,
        }];
        let background = Background { level: true, slope: false, free: begin > 0 };
        let names = structure.names();
        let found =
            least_free_run(&[structure], &names, (&held, &y), background, &Search::default(), &|_| {
                ControlFlow::Continue(())
            })?;
        for ((name, expected), found) in names.iter().zip(values).zip(&found.run.parameters) {
            assert!((found - expected).abs() < 1e-5 * expected.abs(), "{word} {name}: {found} {expected}");
        }
        assert!(found.outcome.iterations < 40, "{word}: {} iterations", found.outcome.iterations);
    }
    Ok(())
}
