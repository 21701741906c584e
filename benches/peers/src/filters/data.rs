//! The models and the recorded data: the same for every filter.

use std::f64::consts::TAU;
use std::fs;
use std::path::Path;

use nalgebra::SVector;

use crate::Result;
use crate::signals::signals;

/// Samples of each record.
pub(crate) const SAMPLES: usize = 2000;

/// The time between samples of a motion, in s.
pub(crate) const DT: f64 = 0.1;

/// The drag of a motion that is not linear, in s/m².
pub(crate) const DRAG: f64 = 1e-3;

/// The forgetting factor of recursive least squares.
pub(crate) const FORGETTING: f64 = 0.99;

/// The variance of each parameter before the first sample.
pub(crate) const PRIOR: f64 = 100.0;

/// x(k+1) = F x + w, y = H x + v, with covariances Q of w, R of v and P of the first x, which is 0. Rows of
/// numbers.
#[derive(Clone, Debug)]
pub(crate) struct Model<T, const N: usize, const M: usize> {
    pub(crate) f: [[T; N]; N],
    pub(crate) q: [[T; N]; N],
    pub(crate) h: [[T; N]; M],
    pub(crate) r: [[T; M]; M],
    pub(crate) p: [[T; N]; N],
}

/// A rows by columns matrix from its elements.
fn matrix<const R: usize, const C: usize>(element: impl Fn(usize, usize) -> f64) -> [[f64; C]; R] {
    std::array::from_fn(|i| std::array::from_fn(|j| element(i, j)))
}

/// Constant velocity in M dimensions, 0.1 s between samples: N = 2 M states, first the positions, which are
/// measured with a standard deviation of 0.5 m, then the velocities, driven by white acceleration of density
/// 1 m²/s³.
pub(crate) fn constant_velocity<const N: usize, const M: usize>() -> Model<f64, N, M> {
    let dt = DT;
    // The element of a matrix that holds [a b; b c] for each dimension and nothing between two of them.
    let blocks = |i: usize, j: usize, [a, b, c]: [f64; 3]| match (i / M, j / M) {
        _ if i % M != j % M => 0.0,
        (0, 0) => a,
        (1, 1) => c,
        _ => b,
    };
    Model {
        f: matrix(|i, j| if i > j { 0.0 } else { blocks(i, j, [1.0, dt, 1.0]) }),
        q: matrix(|i, j| blocks(i, j, [dt * dt * dt / 3.0, dt * dt / 2.0, dt])),
        h: matrix(|i, j| blocks(i, j, [1.0, 0.0, 0.0])),
        r: matrix(|i, j| blocks(i, j, [0.25, 0.0, 0.0])),
        p: matrix(|i, j| blocks(i, j, [100.0, 0.0, 100.0])),
    }
}

/// Noisy positions on a closed track, so that one pass over the record can follow another.
pub(crate) fn positions<const M: usize>() -> Vec<[f64; M]> {
    let noise = signals(M * SAMPLES).0;
    let turn = |k: usize| TAU * k as f64 / SAMPLES as f64;
    let position = |k: usize, axis: usize| 100.0 * (turn(k) * (axis + 1) as f64).sin();
    (0..SAMPLES).map(|k| std::array::from_fn(|axis| position(k, axis) + 0.5 * noise[M * k + axis])).collect()
}

/// Constant acceleration, 0.1 s between samples: position, velocity and acceleration, driven by white jerk of
/// density 1e-4 m²/s⁵; the position is measured. Three settings: prior variances of 1 and a measurement with
/// a standard deviation of 1 m; prior variances of 1e6 and 1e8, and 1 cm.
pub(crate) fn constant_acceleration() -> [Model<f32, 3, 1>; 3] {
    let (dt, density) = (0.1_f32, 1e-4);
    let power = |exponent| density * dt.powi(exponent);
    [(1.0, 1.0), (1e6, 1e-4), (1e8, 1e-4)].map(|(prior, r)| Model {
        f: [[1.0, dt, dt * dt / 2.0], [0.0, 1.0, dt], [0.0, 0.0, 1.0]],
        q: [
            [power(5) / 20.0, power(4) / 8.0, power(3) / 6.0],
            [power(4) / 8.0, power(3) / 3.0, power(2) / 2.0],
            [power(3) / 6.0, power(2) / 2.0, power(1)],
        ],
        h: [[1.0, 0.0, 0.0]],
        r: [[r]],
        p: [[prior, 0.0, 0.0], [0.0, prior, 0.0], [0.0, 0.0, prior]],
    })
}

/// Measured positions of what stands still.
pub(crate) fn still() -> Vec<[f32; 1]> {
    signals(SAMPLES).0.iter().map(|&noise| [noise as f32]).collect()
}

/// Regressors and targets of y(k) = sum over i of 0.8^i u(k-i), i < N, with noise of standard deviation 0.1.
pub(crate) fn regressions<const N: usize>() -> Vec<(SVector<f64, N>, f64)> {
    let white = signals(N + 2 * SAMPLES).0;
    let (input, noise) = white.split_at(N + SAMPLES);
    let row = |k: usize| {
        let regressor = SVector::from_fn(|i, _| input[N + k - i]);
        let response: f64 = (0..N).map(|i| 0.8_f64.powi(i as i32) * regressor[i]).sum();
        (regressor, response + 0.1 * noise[k])
    };
    (0..SAMPLES).map(row).collect()
}

/// Writes all of it for Python. The numbers are written with as many digits as give them back exactly.
pub(crate) fn write(folder: &Path) -> Result<()> {
    write_kalman::<4, 2>(folder, "4x2")?;
    write_kalman::<6, 3>(folder, "6x3")?;
    write_regressions::<4>(folder)?;
    write_regressions::<8>(folder)?;
    write_regressions::<16>(folder)
}

fn write_kalman<const N: usize, const M: usize>(folder: &Path, size: &str) -> Result<()> {
    let Model { f, q, h, r, p } = constant_velocity::<N, M>();
    let positions = positions::<M>();
    let text =
        format!(r#"{{"F": {f:?}, "Q": {q:?}, "H": {h:?}, "R": {r:?}, "P": {p:?}, "record": {positions:?}}}"#);
    Ok(fs::write(folder.join(format!("kalman-{size}.json")), text)?)
}

fn write_regressions<const N: usize>(folder: &Path) -> Result<()> {
    let record = regressions::<N>();
    let regressors: Vec<&[f64]> = record.iter().map(|(regressor, _)| regressor.as_slice()).collect();
    let targets: Vec<f64> = record.iter().map(|&(_, target)| target).collect();
    let text = format!(
        r#"{{"forgetting": {FORGETTING:?}, "prior": {PRIOR:?}, "regressors": {regressors:?}, "targets": {targets:?}}}"#
    );
    Ok(fs::write(folder.join(format!("rls-{N}.json")), text)?)
}
