//! Models written by hand, and logs of them.

use thetahat_core::Number;

use crate::greybox::dynamics::Dynamics;
use crate::greybox::fit::experiment::Experiment;
use crate::regression::noise::Noise;
use crate::{Channel, Recording, Times};

/// A pendulum with unknown z = (ln of damping, stiffness, gain of the input, sine in the output, unused…): two states, an
/// input, and outputs of angle and rate.
///
/// ```text
/// angle' = angle + dt rate,   rate' = rate + dt (u gain - exp(z0) rate - z1 sin(angle))
/// y = (sin(angle) + z3 angle^2, rate)
/// ```
#[derive(Debug, Clone)]
pub(super) struct Pendulum {
    pub(super) start: [f64; 2],
    pub(super) deviations: [f64; 2],
    pub(super) process: f64,
    pub(super) measurement: Vec<f64>,
    pub(super) parameters: usize,
}

pub(super) const TRUTH: [f64; 5] = [-0.5, 2.0, 1.5, 0.1, 0.3];

impl Pendulum {
    pub(super) fn new(outputs: usize, parameters: usize) -> Self {
        Self {
            start: [0.2, -0.1],
            deviations: [0.3, 0.2],
            process: 1e-4,
            measurement: vec![4e-4, 1e-3][..outputs].to_vec(),
            parameters,
        }
    }

    pub(super) fn truth(&self) -> Vec<f64> {
        TRUTH[..self.parameters].to_vec()
    }

    fn all<S: Number<f64>>(&self, z: &[S]) -> [S; 5] {
        std::array::from_fn(|index| z.get(index).copied().unwrap_or(S::from(TRUTH[index])))
    }

    /// A log of so many rows every 0.05 s, with the noises that the model tells of times `noise`.
    pub(super) fn log(&self, rows: usize, seed: u64, noise: f64) -> Recording {
        let mut random = Noise(seed);
        let mut normal = || (0..12).map(|_| random.next()).sum::<f64>() / 2.0 * noise;
        let mut x: Vec<f64> = (0..2).map(|i| self.start[i] + self.deviations[i] * normal()).collect();
        let (mut u, mut channels) = (Vec::new(), vec![Vec::new(); self.outputs()]);
        let z = self.truth();
        let mut work = Vec::new();
        for row in 0..rows {
            let input = [if (row / 20) % 3 == 0 { 1.0 } else { -0.7 }];
            let mut y = vec![0.0; self.outputs()];
            self.observe(&x, &z, &input, 0.0, &mut y, &mut vec![0.0; 2 * self.outputs()], &mut work);
            for ((channel, y), variance) in channels.iter_mut().zip(&y).zip(&self.measurement) {
                channel.push(y + variance.sqrt() * normal());
            }
            u.push(input[0]);
            let mut next = [0.0; 2];
            self.advance(&x, &z, &input, 0.0, 0.05, &mut next, &mut [0.0; 4], &mut work);
            x = next.to_vec();
            x[1] += (self.process * 0.05).sqrt() * normal();
        }
        let channel = |name: &str, values| Channel { name: name.into(), values };
        let mut all = vec![channel("u", u)];
        all.extend(channels.into_iter().zip(["y1", "y2"]).map(|(values, name)| channel(name, values)));
        Recording { channels: all, times: Times::Uniform(0.05) }
    }

    pub(super) fn experiment(&self, recording: &Recording) -> Experiment {
        Experiment::new(recording, &["u".to_owned()], &self.channels(), |step| Ok((1, step))).unwrap()
    }

    pub(super) fn channels(&self) -> Vec<String> {
        (1..=self.outputs()).map(|number| format!("y{number}")).collect()
    }
}

impl Dynamics for Pendulum {
    fn states(&self) -> usize {
        2
    }
    fn parameters(&self) -> usize {
        self.parameters
    }
    fn inputs(&self) -> usize {
        1
    }
    fn outputs(&self) -> usize {
        self.measurement.len()
    }
    fn advance<S: Number<f64>>(
        &self,
        x: &[S],
        z: &[S],
        u: &[f64],
        _: f64,
        dt: f64,
        next: &mut [S],
        jacobian: &mut [S],
        _: &mut Vec<S>,
    ) {
        let [damping, stiffness, gain, _, drive] = self.all(z);
        let (sine, cosine) = x[0].sin_cos();
        next[0] = x[0] + x[1] * dt;
        next[1] = x[1] + (gain * u[0] + drive - damping.exp() * x[1] - stiffness * sine) * dt;
        jacobian[0] = S::from(1.0);
        jacobian[1] = -(stiffness * cosine * dt);
        jacobian[2] = S::from(dt);
        jacobian[3] = -(damping.exp() * dt) + 1.0;
    }
    fn observe<S: Number<f64>>(
        &self,
        x: &[S],
        z: &[S],
        _: &[f64],
        _: f64,
        y: &mut [S],
        jacobian: &mut [S],
        _: &mut Vec<S>,
    ) {
        let m = self.outputs();
        let square = self.all(z)[3];
        y[0] = x[0].sin() + square * x[0] * x[0];
        jacobian[0] = x[0].cos() + square * x[0] * 2.0;
        jacobian[m] = S::from(0.0);
        if m > 1 {
            y[1] = x[1];
            jacobian[1] = S::from(0.0);
            jacobian[m + 1] = S::from(1.0);
        }
    }
    fn start(&self) -> (&[f64], &[f64]) {
        (&self.start, &self.deviations)
    }
    fn process_variances(&self, dt: f64) -> impl Iterator<Item = f64> {
        [0.0, self.process * dt].into_iter()
    }
    fn measurement_variances(&self) -> &[f64] {
        &self.measurement
    }
}
