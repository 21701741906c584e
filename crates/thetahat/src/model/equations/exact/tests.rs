use thetahat_core::Dual;

use super::{ExactStep, product};

fn close(found: &[f64], expected: &[f64], tolerance: f64) {
    for (found, expected) in found.iter().zip(expected) {
        assert!((found - expected).abs() <= tolerance * expected.abs().max(1e-3), "{found} {expected}");
    }
}

/// Q, column after column.
fn noise(step: &ExactStep<f64>) -> Vec<f64> {
    let n = step.noise_variances.len();
    let mut scaled = step.noise_factor.clone();
    for (column, variance) in scaled.chunks_exact_mut(n).zip(&step.noise_variances) {
        column.iter_mut().for_each(|entry| *entry *= variance);
    }
    let transposed: Vec<f64> = (0..n * n).map(|place| step.noise_factor[place % n * n + place / n]).collect();
    product(&scaled, &transposed, n)
}

#[test]
fn an_integrator_of_an_integrator_is_known() {
    for h in [1e-3, 0.2, 7.0, 5000.0] {
        let step = ExactStep::new(&[0.0, 0.0, 1.0, 0.0], &[0.0, 3.0], h);
        close(&step.transition, &[1.0, 0.0, h, 1.0], 1e-14);
        close(&step.integral, &[h, 0.0, h * h / 2.0, h], 1e-14);
        close(&step.second_integral, &[h * h / 2.0, 0.0, h * h * h / 6.0, h * h / 2.0], 1e-14);
        let [a, b, c] = [h * h * h / 3.0, h * h / 2.0, h].map(|entry| 3.0 * entry);
        close(&noise(&step), &[a, b, b, c], 1e-13);
    }
}

#[test]
fn what_dies_out_within_a_step_is_at_rest_after_it() {
    let step = ExactStep::new(&[-1000.0], &[4.0], 1.0);
    assert!(step.transition[0].abs() < 1e-300);
    close(&step.integral, &[1e-3], 1e-13);
    // ∫ (1 - e^(-1000 s))/1000 ds = 1/1000 - 1/1e6.
    close(&step.second_integral, &[1e-3 - 1e-6], 1e-13);
    close(&step.noise_variances, &[4.0 / 2000.0], 1e-13);
}

/// Of three coupled states, and its derivatives by a number in A.
#[test]
fn one_step_is_two_halves_and_its_derivatives_are_exact() {
    let a = |p: f64| [-1.0, p, 0.3, 2.0, -4.0, 0.0, -0.7, 1.5, 0.2];
    let intensities = [0.5, 0.0, 0.2];
    let step = |p: f64, h: f64| ExactStep::new(&a(p), &intensities, h);
    let (whole, half) = (step(1.1, 0.8), step(1.1, 0.4));
    close(&whole.transition, &product(&half.transition, &half.transition, 3), 1e-13);
    let moved = product(
        &product(&half.transition, &noise(&half), 3),
        &{
            let t = &half.transition;
            (0..9).map(|place| t[place % 3 * 3 + place / 3]).collect::<Vec<f64>>()
        },
        3,
    );
    let expected: Vec<f64> = moved.iter().zip(noise(&half)).map(|(moved, own)| moved + own).collect();
    close(&noise(&whole), &expected, 1e-13);
    // Phi = I + A Psi, Psi = h I + A X.
    let identity = |h: f64| (0..9).map(move |place| if place % 4 == 0 { h } else { 0.0 });
    let sum =
        |by: Vec<f64>, h: f64| by.iter().zip(identity(h)).map(|(by, own)| by + own).collect::<Vec<f64>>();
    close(&whole.transition, &sum(product(&a(1.1), &whole.integral, 3), 1.0), 1e-12);
    close(&whole.integral, &sum(product(&a(1.1), &whole.second_integral, 3), 0.8), 1e-12);

    let mut open: Vec<Dual<f64, 1>> = a(1.1).map(Dual::from).to_vec();
    open[1].derivatives[0] = 1.0;
    let found = ExactStep::new(&open, &intensities.map(Dual::from), 0.8);
    let (up, down) = (step(1.1 + 1e-5, 0.8), step(1.1 - 1e-5, 0.8));
    let slopes = |of: &[Dual<f64, 1>]| of.iter().map(|entry| entry.derivatives[0]).collect::<Vec<f64>>();
    let differences = |up: &[f64], down: &[f64]| -> Vec<f64> {
        up.iter().zip(down).map(|(up, down)| (up - down) / 2e-5).collect()
    };
    close(&slopes(&found.transition), &differences(&up.transition, &down.transition), 1e-6);
    close(&slopes(&found.noise_factor), &differences(&up.noise_factor, &down.noise_factor), 1e-6);
    close(&slopes(&found.noise_variances), &differences(&up.noise_variances, &down.noise_variances), 1e-6);
}
