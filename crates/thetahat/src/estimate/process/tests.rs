use crate::model::ProcessStructure;
use crate::respond::process::{run, sensitivities};

/// A clock that no step fits twice, and an input that moves with it.
fn experiment() -> (Vec<f64>, Vec<f64>) {
    let times: Vec<f64> = (0..60).map(|k| f64::from(k) * 0.5 + 0.2 * (f64::from(k) * 1.7).sin()).collect();
    let input = (0..60).map(|k| f64::from(k / 7 * 5 % 3) - 0.5).collect();
    (times, input)
}

#[test]
fn slopes_by_all_parameters_are_those_of_differences() {
    let cases: [(&str, &[f64]); 12] = [
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
