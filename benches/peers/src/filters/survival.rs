//! What single precision does to the covariance of a Kalman filter.

use nalgebra::SMatrix;

use crate::data::{self, Model};
use crate::kalman::Kalman;
use crate::peers::{Visit, visit_all};

/// Until this step the covariance is examined after every step, then after every thousandth.
const EXAMINED: usize = 1_000_000;

/// Prints a row for each filter: its name, the covariance, whether that is positive definite, its worst
/// relative error.
pub(crate) fn potter() {
    visit_all::<f32, 2, 1>(&mut Potter);
}

/// Prints a row for each filter: its name, and for each setting of `data::constant_acceleration` the step at
/// which the covariance was no longer positive definite.
pub(crate) fn endurance(steps: usize) {
    visit_all::<f32, 3, 1>(&mut Endurance(steps));
}

/// Potter's case: a poor prior, I / eps², and two accurate measurements, by the almost parallel rows [1, eps]
/// and [1, 1] of H.
struct Potter;

impl Visit<f32, 2, 1> for Potter {
    fn visit<K: Kalman<f32, 2, 1>>(&mut self) {
        let eps = (-13.0_f32).exp2();
        let prior = eps.powi(-2);
        let model = Model {
            f: [[1.0, 0.0], [0.0, 1.0]],
            q: [[0.0; 2]; 2],
            h: [[1.0, eps]],
            r: [[1.0]],
            p: [[prior, 0.0], [0.0, prior]],
        };
        let run = || {
            let mut filter = K::new(&model)?;
            filter.correct(&[0.0])?;
            filter.observe(&[[1.0, 1.0]])?;
            filter.correct(&[0.0])?;
            Ok(filter.covariance())
        };
        let covariance: [[f64; 2]; 2] = match run() {
            Ok(covariance) => covariance,
            Err::<_, K::Error>(error) => return println!("{}\t{error:?}\t\t", K::NAME),
        };
        let definite = if is_definite(&covariance) { "yes" } else { "no" };
        let [a, b, c, d] = [0, 1, 2, 3].map(|k| covariance[k / 2][k % 2]);
        let pairs = [a, b, c, d].into_iter().zip(potter_exact(f64::from(eps)));
        let error = pairs.map(|(found, exact)| ((found - exact) / exact).abs()).fold(0.0, f64::max);
        println!("{}\t[[{a:.6}, {b:.6}], [{c:.6}, {d:.6}]]\t{definite}\t{error:.0e}", K::NAME);
    }
}

/// The exact covariance: the inverse of eps² I + [1 eps]' [1 eps] + [1 1]' [1 1], which is well conditioned.
fn potter_exact(eps: f64) -> [f64; 4] {
    let [a, b, d] = [2.0 + eps * eps, 1.0 + eps, 1.0 + 2.0 * eps * eps];
    [d, -b, -b, a].map(|element| element / (a * d - b * b))
}

/// An ordinary filter for this many steps.
struct Endurance(usize);

impl Visit<f32, 3, 1> for Endurance {
    fn visit<K: Kalman<f32, 3, 1>>(&mut self) {
        let record = data::still();
        let failure = |model: &Model<f32, 3, 1>| {
            let mut filter = match K::new(model) {
                Ok(filter) => filter,
                Err(error) => return format!("{error:?}"),
            };
            for (step, measurement) in (1..=self.0).zip(record.iter().cycle()) {
                if let Err(error) = filter.step(measurement) {
                    return format!("{step}: {error:?}");
                }
                if (step <= EXAMINED || step % 1000 == 0) && !is_definite(&filter.covariance()) {
                    return step.to_string();
                }
            }
            "none".to_owned()
        };
        println!("{}\t{}", K::NAME, data::constant_acceleration().each_ref().map(failure).join("\t"));
    }
}

/// Whether the symmetric part of a matrix is finite and positive definite, by its L D L' factors in double
/// precision.
///
/// There the product of two numbers of single precision is exact.
fn is_definite<const N: usize>(rows: &[[f64; N]; N]) -> bool {
    let mut a = SMatrix::<f64, N, N>::from_fn(|i, j| (rows[i][j] + rows[j][i]) / 2.0);
    for k in 0..N {
        let pivot = a[(k, k)];
        if !pivot.is_finite() || pivot <= 0.0 {
            return false;
        }
        for i in k + 1..N {
            let factor = a[(i, k)] / pivot;
            for j in k + 1..=i {
                a[(i, j)] -= factor * a[(j, k)];
            }
        }
    }
    true
}
