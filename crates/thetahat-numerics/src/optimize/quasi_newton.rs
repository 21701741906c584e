//! The least value of a smooth function of few variables.

use thetahat_core::nalgebra::{DMatrix, DVector};

/// Halvings of a step, at most.
const MOST_HALVINGS: usize = 40;
/// The decrease that a step must reach, as a fraction of that which the gradient promises (Armijo 1966).
const SUFFICIENT: f64 = 1e-4;
/// The longest step of any variable at first.
const FIRST: f64 = 0.5;

/// Goes down from `start` by the method of Broyden, Fletcher, Goldfarb and Shanno (1970), with steps that are halved
/// until the function falls enough (Nocedal and Wright, Numerical Optimization, 2nd ed. 2006, section 6.1):
///
/// ```text
/// x <- x + a p,  p = -H g,   H <- (I - r s y') H (I - r y s') + r s s',   s = a p, y the change of g, r = 1/(s'y)
/// ```
///
/// It ends where the decrease that the gradient promises falls below `tolerance`, or no step goes down. `function`
/// gives the value and writes the gradient; a value that is no number is no way to go. Gives the variables and the
/// value.
pub fn least(
    start: &[f64],
    tolerance: f64,
    iterations: usize,
    mut function: impl FnMut(&[f64], &mut [f64]) -> f64,
) -> (Vec<f64>, f64) {
    let count = start.len();
    let mut x = DVector::from_column_slice(start);
    let (mut gradient, mut next) = (DVector::zeros(count), DVector::zeros(count));
    let mut value = function(x.as_slice(), gradient.as_mut_slice());
    if !value.is_finite() {
        return (start.to_vec(), f64::INFINITY);
    }
    // The first step is short: nothing is known of the curvature yet.
    let scale = FIRST / gradient.amax().max(FIRST);
    let mut inverse = DMatrix::identity(count, count) * scale;
    for _ in 0..iterations {
        let mut direction = -(&inverse * &gradient);
        let mut slope = direction.dot(&gradient);
        if slope >= 0.0 || !slope.is_finite() {
            inverse = DMatrix::identity(count, count) * scale;
            direction = -(&gradient * scale);
            slope = direction.dot(&gradient);
        }
        if -slope <= tolerance {
            break;
        }
        let mut length = 1.0;
        let mut moved = None;
        for _ in 0..MOST_HALVINGS {
            let candidate = &x + &direction * length;
            let found = function(candidate.as_slice(), next.as_mut_slice());
            let falls = found <= value + SUFFICIENT * length * slope;
            if falls && next.iter().all(|entry| entry.is_finite()) {
                moved = Some((candidate, found));
                break;
            }
            length /= 2.0;
        }
        let Some((candidate, found)) = moved else { break };
        let (step, change) = (&candidate - &x, &next - &gradient);
        let curvature = step.dot(&change);
        if curvature > f64::EPSILON * step.norm() * change.norm() {
            let image = &inverse * &change;
            let weight = (1.0 + change.dot(&image) / curvature) / curvature;
            inverse += &step * step.transpose() * weight;
            let crossed = &image * step.transpose() / curvature;
            inverse -= &crossed + crossed.transpose();
        }
        (x, value) = (candidate, found);
        gradient.copy_from(&next);
    }
    (x.as_slice().to_vec(), value)
}

#[cfg(test)]
mod tests {
    use super::least;

    /// Rosenbrock's valley (1960): the least value is 0 at (1, 1).
    #[test]
    fn a_narrow_valley_is_followed_to_its_end() {
        let (x, value) = least(&[-1.2, 1.0], 1e-20, 200, |x, gradient| {
            let (a, b) = (1.0 - x[0], x[1] - x[0] * x[0]);
            gradient[0] = -2.0 * a - 400.0 * x[0] * b;
            gradient[1] = 200.0 * b;
            a * a + 100.0 * b * b
        });
        assert!((x[0] - 1.0).abs() < 1e-8 && (x[1] - 1.0).abs() < 1e-8 && value < 1e-16, "{x:?} {value}");
    }

    #[test]
    fn what_is_no_number_is_no_way_to_go() {
        // ln is not below 0: steps are halved until they stay above.
        let (x, value) = least(&[0.1], 1e-16, 100, |x, gradient| {
            gradient[0] = 1.0 - 1.0 / x[0];
            x[0] - x[0].ln()
        });
        assert!((x[0] - 1.0).abs() < 1e-7 && (value - 1.0).abs() < 1e-12, "{x:?} {value}");
        assert_eq!(least(&[-1.0], 1e-9, 10, |_, _| f64::NAN).1, f64::INFINITY);
    }
}
