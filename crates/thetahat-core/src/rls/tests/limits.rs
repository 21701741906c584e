use std::ops::RangeInclusive;

use super::*;

const FREE: RangeInclusive<f64> = f64::NEG_INFINITY..=f64::INFINITY;

/// The least of (θ - θ̂)'P⁻¹(θ - θ̂) within the limits, by all choices of what is at which end: at the solution the
/// multipliers P⁻¹(θ - θ̂) push inwards.
fn by_all_choices(
    estimate: &Vector3<f64>,
    p: &SMatrix<f64, 3, 3>,
    limits: &[RangeInclusive<f64>],
) -> Vector3<f64> {
    let information = crate::textbook::inverse(p);
    let (mut best, mut least) = (*estimate, f64::INFINITY);
    for choice in 0..27 {
        let at = |index: usize| match choice / 3_usize.pow(index as u32) % 3 {
            0 => None,
            1 => Some(*limits[index].start()),
            _ => Some(*limits[index].end()),
        };
        if (0..3).any(|index| at(index).is_some_and(|end| !end.is_finite())) {
            continue;
        }
        // The rows of those at an end say so; the others, that the gradient is 0.
        let mut rows = information;
        let mut right = information * estimate;
        for index in 0..3 {
            if let Some(end) = at(index) {
                rows.row_mut(index).fill(0.0);
                rows[(index, index)] = 1.0;
                right[index] = end;
            }
        }
        let point = crate::textbook::inverse(&rows) * right;
        let inside = (0..3).all(|index| {
            at(index).is_some()
                || point[index] >= limits[index].start() - 1e-9 && point[index] <= limits[index].end() + 1e-9
        });
        let cost = (point - estimate).dot(&(information * (point - estimate)));
        if inside && cost < least {
            (best, least) = (point, cost);
        }
    }
    best
}

#[test]
fn it_is_the_constrained_least_squares_estimate() {
    let mut noise = Noise(70);
    let (mut out, mut several, mut worst) = (0, 0, 0.0_f64);
    for trial in 0..2000 {
        let truth: Vector3<f64> = random(&mut noise);
        let mut estimator = estimator::<f64, 3>(Forgetting::Exponential { factor: 0.95 });
        for (mut phi, y) in samples(100 + trial, &truth, 0.5, 6) {
            // Regressors that are alike: parameters that correlate.
            phi[1] = phi[0] + 0.5 * phi[1];
            estimator.update(&phi, y).unwrap();
        }
        let limits: Vec<RangeInclusive<f64>> = (0..3)
            .map(|_| {
                let (middle, half) = (noise.next(), 0.3 * (noise.next() + 1.0));
                match (noise.next() * 2.0) as i32 {
                    0 => middle - half..=middle + half,
                    1 => middle..=f64::INFINITY,
                    _ => FREE,
                }
            })
            .collect();
        let before = estimator.clone();
        let moved = estimator.keep_within(&limits).unwrap();
        let expected = by_all_choices(before.parameters(), &before.covariance().matrix(), &limits);
        let information = crate::textbook::inverse(&before.covariance().matrix());
        let cost = |theta: &Vector3<f64>| {
            let away = theta - before.parameters();
            away.dot(&(information * away))
        };
        let excess = cost(estimator.parameters()) / cost(&expected).max(1e-300) - 1.0;
        worst = worst.max(excess);
        assert!(limits.iter().zip(estimator.parameters().iter()).all(|(limit, theta)| limit.contains(theta)));
        assert_eq!(moved, estimator.parameters() != before.parameters());
        assert_eq!(estimator.covariance(), before.covariance());
        assert!(!estimator.keep_within(&limits).unwrap());
        out += usize::from(moved);
        let at_end =
            |(limit, theta): (&RangeInclusive<f64>, &f64)| theta == limit.start() || theta == limit.end();
        several += usize::from(
            limits.iter().zip(estimator.parameters().iter()).filter(|&pair| at_end(pair)).count() > 1,
        );
    }
    assert!(worst < 1e-9, "{worst}");
    assert!(out > 1000 && several > 250, "{out} {several}");
}

#[test]
fn one_limit_is_the_formula() {
    let mut estimator = estimator::<f64, 2>(Forgetting::None);
    for (phi, y) in samples(71, &Vector2::new(1.0, -2.0), 0.1, 20) {
        estimator.update(&phi, y).unwrap();
    }
    let (theta, p) = (*estimator.parameters(), estimator.covariance().matrix());
    let expected = theta - p.column(1) * ((theta[1] - 0.5) / p[(1, 1)]);
    assert!(estimator.keep_within(&[FREE, 0.5..=f64::INFINITY]).unwrap());
    assert!((estimator.parameters() - expected).amax() < 1e-14);
    assert_eq!(estimator.parameters()[1], 0.5);
}

#[test]
fn limits_hold_in_single_precision_where_parameters_can_hardly_be_told_apart() {
    let mut estimator = estimator::<f32, 4>(Forgetting::Exponential { factor: 0.98 });
    let limits = [-1.0..=1.0, 0.0..=0.1, 0.2..=0.2, f32::NEG_INFINITY..=-0.3_f32];
    let mut noise = Noise(72);
    let mut moved = 0;
    for k in 0..5000 {
        let common = noise.next() as f32;
        let phi = Vector4::from_fn(|_, _| common + 1e-3 * noise.next() as f32);
        let y = if k % 500 == 0 { 1e6 } else { common + noise.next() as f32 };
        estimator.update(&phi, y).unwrap();
        moved += usize::from(estimator.keep_within(&limits).unwrap());
        assert!(limits.iter().zip(estimator.parameters().iter()).all(|(limit, theta)| limit.contains(theta)));
        check_sound(&estimator, true);
    }
    assert!(moved > 4000);
    // Numbers at the end of what is accepted, and a parameter that is held outside.
    let covariance = Covariance::from_diagonal(&Vector4::new(1.0, 0.0, 1e-30, 1e10)).unwrap();
    let mut estimator = estimator.with_covariance(covariance).unwrap();
    estimator = estimator.with_parameters(Vector4::new(1e15, 5.0, -1e15, 7e15)).unwrap();
    assert!(estimator.keep_within(&limits).unwrap());
    assert!(limits.iter().zip(estimator.parameters().iter()).all(|(limit, theta)| limit.contains(theta)));
}

#[test]
fn a_sign_that_is_known_keeps_a_self_tuner_going() {
    // The gain of the plant is small and positive; at first the data say otherwise.
    let mut wrong = [0, 0];
    for (index, kept) in [false, true].into_iter().enumerate() {
        for seed in 0..20 {
            let mut noise = Noise(seed);
            let mut estimator = estimator::<f64, 2>(Forgetting::Exponential { factor: 0.95 });
            let (mut y, mut u) = (0.0, 1.0);
            for _ in 0..400 {
                let next = 0.7 * y + 0.1 * u + 0.6 * noise.next();
                estimator.update(&Vector2::new(y, u), next).unwrap();
                if kept {
                    estimator.keep_within(&[0.0..=0.99, 0.02..=f64::INFINITY]).unwrap();
                }
                y = next;
                let [a, b] = (*estimator.parameters()).into();
                wrong[index] += usize::from(b <= 0.0);
                u = ((1.0 - a * y) / b).clamp(-5.0, 5.0);
            }
        }
    }
    assert!(wrong[0] > 0 && wrong[1] == 0, "{wrong:?}");
}

#[test]
fn limits_are_checked() {
    let mut estimator = estimator::<f64, 2>(Forgetting::None);
    let range = Error::OutOfRange { argument: "limits", range: "from a lower end to an upper one" };
    let before = format!("{estimator:?}");
    for limits in [
        [FREE, 1.0..=0.0],
        [f64::NAN..=1.0, FREE],
        [0.0..=f64::NAN, FREE],
        [f64::INFINITY..=f64::INFINITY, FREE],
        [FREE, f64::NEG_INFINITY..=f64::NEG_INFINITY],
    ] {
        assert_eq!(estimator.keep_within(&limits).unwrap_err(), range, "{limits:?}");
    }
    let length = Error::Length { argument: "limits", expected: 2, found: 1 };
    assert_eq!(estimator.keep_within(&[FREE]).unwrap_err(), length);
    assert_eq!(format!("{estimator:?}"), before);
    assert!(!estimator.keep_within(&[FREE, FREE]).unwrap());
    assert!(estimator.keep_within(&[FREE, 1.0..=1.0]).unwrap());
}
