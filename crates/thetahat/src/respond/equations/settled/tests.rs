use thetahat_core::Dual;

use crate::data::{Log, Rows};
use crate::model::GreyBox;
use crate::respond::equations::predictor::Predictor;
use crate::respond::equations::walk::{reach, step};
use crate::respond::equations::{Experiment, experiments};
use crate::tests::channel;

/// Two tanks; the noise of the second one's level depends on what is said here.
fn tanks(deviation: &str) -> GreyBox {
    let text = format!(
        "sample_time = 0.1
         [states]
         a = {{ start = 1, sd = 2 }}
         b = {{ start = 0, sd = 2 }}
         [inputs]
         flow = {{ channel = 'u', hold = 'linear' }}
         [parameters]
         first = {{ start = 0.7, sd = 1, unknown = true, min = 0 }}
         second = {{ start = 0.4, sd = 1, unknown = true }}
         [derivative]
         a = 'flow - first * a'
         b = 'first * a - second * b'
         [outputs]
         y = 'b'
         z = 'a + second * b'
         [noise]
         process = {{ a = {{ start = 0.2, sd = 1, unknown = true }}, b = '{deviation}' }}
         measurement = {{ y = 0.1, z = {{ start = 0.5, sd = 1, unknown = true }} }}"
    );
    GreyBox::from_toml(&text).unwrap()
}

const ROWS: usize = 3000;

/// Rows of a tenth of a second, whose times are rounded; one step is longer, and outputs are missing here and there.
fn experiment(model: &GreyBox) -> Experiment {
    let times = (0..ROWS).map(|row| 0.1 * row as f64 + if row < 1400 { 0.0 } else { 0.3 }).collect();
    let wave = |speed: f64| move |row: usize| (speed * row as f64).sin() + (0.31 * speed * row as f64).cos();
    let values = |speed: f64| (0..ROWS).map(wave(speed)).collect::<Vec<f64>>();
    let (mut y, mut z) = (values(0.2), values(0.05));
    y[900] = f64::NAN;
    z[2100..2110].fill(f64::NAN);
    y[2105..2120].fill(f64::NAN);
    let log =
        Log::recorded(vec![channel("u", values(0.11)), channel("y", y), channel("z", z)], times).unwrap();
    experiments(model, &log, &[Rows::new(1, ROWS).unwrap()], &[]).unwrap().remove(0)
}

#[test]
fn a_settled_covariance_is_that_of_the_full_recursion() {
    let model = tanks("0.3");
    let experiment = experiment(&model);
    let starts = model.parameters().iter().map(|unknown| unknown.start_variable().0);
    let z: Vec<Dual<f64, 4>> = Dual::variables(starts.collect::<Vec<_>>().try_into().unwrap()).to_vec();
    let (mut own, mut full) = (Predictor::new(&model), Predictor::new(&model));
    own.restart(&model, &z);
    full.restart(&model, &z);
    let mut settled = Vec::new();
    // The sizes of e and S and of their derivatives, and how far they are apart.
    let (mut sizes, mut apart) = ([[0.0_f64; 5]; 2], [[0.0_f64; 5]; 2]);
    for row in 0..ROWS {
        let mut found = Vec::new();
        step(&model, &experiment, &mut own, &z, row, |_, _, innovation| found.push(innovation)).unwrap();
        reach(&model, &experiment, &mut full, &z, row);
        for (output, measured) in experiment.output(row).iter().enumerate().filter(|(_, y)| !y.is_nan()) {
            let (own, full) = (found.remove(0), full.absorb(output, *measured).unwrap());
            for (which, (own, full)) in
                [(own.error, full.error), (own.variance, full.variance)].into_iter().enumerate()
            {
                let parts =
                    |of: &Dual<f64, 4>| std::iter::once(of.value).chain(of.derivatives).collect::<Vec<_>>();
                for (part, (own, full)) in parts(&own).into_iter().zip(parts(&full)).enumerate() {
                    sizes[which][part] = sizes[which][part].max(full.abs());
                    apart[which][part] = apart[which][part].max((own - full).abs());
                }
            }
        }
        if own.has_settled() {
            settled.push(row);
        }
    }
    for (apart, size) in apart.iter().flatten().zip(sizes.iter().flatten()) {
        assert!(*apart < 1e-12 * size, "{apart} of {size}");
    }
    // After a hole and a longer step the limit is known, and nothing is there in the rows between.
    let first = settled[0];
    assert!(first < 600, "{first}");
    for (unlike, back) in [(900, 1100), (1400, 1600), (2100, 2400)] {
        assert!(settled.contains(&(unlike - 1)) && !settled.contains(&unlike), "{unlike}");
        assert!(settled.contains(&back), "{unlike}");
    }
    assert!(settled.len() > ROWS - 1300, "{}", settled.len());
}

#[test]
fn noise_that_moves_with_an_input_never_settles() {
    assert!(
        tanks("0.3").has_constant_covariances() && !tanks("0.3 + 0.01 * flow").has_constant_covariances()
    );
    let model = tanks("0.3 + 0.01 * flow");
    let z: Vec<f64> = model.parameters().iter().map(|unknown| unknown.start_variable().0).collect();
    let (experiment, mut predictor) = (experiment(&model), Predictor::new(&model));
    predictor.restart(&model, &z);
    for row in 0..ROWS {
        step(&model, &experiment, &mut predictor, &z, row, |_, _, _| {}).unwrap();
        assert!(!predictor.has_settled(), "{row}");
    }
}
