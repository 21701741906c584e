//! Models written by hand, and logs of them.

use std::ops::ControlFlow;

use thetahat_numerics::noise::Noise;

use crate::Error;
use crate::data::{Channel, Log, Recording, Rows, Times};
use crate::estimate::{EquationsOutcome, Procedure};
use crate::model::equations::{Drive, Work};
use crate::model::{EquationsModel, GreyBox, Model};
use crate::report::{EquationsPlan, Report, fit_equations};
use crate::respond::{
    Horizon,
    equations::{Experiment, experiments},
};
use crate::validate::Fit;

/// Of the pendulum's parameters, in their order. None has bounds, so that z is the parameter.
pub(super) const TRUTH: [f64; 5] = [-0.5, 2.0, 1.5, 0.1, 0.3];

/// A pendulum with this process noise and 1 or 2 outputs, of which the first parameters, this many, are unknown; a
/// search for them starts at 0.6 truth + 0.1.
pub(super) fn pendulum_text(process: f64, outputs: usize, unknown: usize) -> String {
    let names = ["damping", "stiffness", "gain", "square", "drive"];
    let parameters = names.iter().zip(TRUTH).enumerate().map(|(index, (name, truth))| {
        let start = 0.6 * truth + 0.1;
        if index < unknown {
            format!("{name} = {{ start = {start}, sd = 1, unknown = true }}\n")
        } else {
            format!("{name} = {truth}\n")
        }
    });
    let outputs = [("y1 = 'sin(angle) + square * angle^2'\n", "y1 = 0.02"), ("y2 = 'rate'\n", "y2 = 0.03")]
        .into_iter()
        .take(outputs);
    let (outputs, noises): (String, Vec<&str>) = outputs.unzip();
    format!(
        "sample_time = 0.05\n\
         [states]\nangle = {{ start = 0.2, sd = 0.3 }}\nrate = {{ start = -0.1, sd = 0.2 }}\n\
         [inputs]\ntorque = 'u'\n\
         [parameters]\n{}\
         [next]\nangle = 'angle + dt * rate'\n\
         rate = 'rate + dt * (gain * torque + drive - exp(damping) * rate - stiffness * sin(angle))'\n\
         [outputs]\n{outputs}\
         [noise]\nprocess = {{ rate = {process} }}\nmeasurement = {{ {} }}\n",
        parameters.collect::<String>(),
        noises.join(", ")
    )
}

pub(super) fn pendulum(outputs: usize, unknown: usize) -> GreyBox {
    GreyBox::from_toml(&pendulum_text(0.002, outputs, unknown)).unwrap()
}

/// A log of this many rows of a model with these z and one input, with the noises that it tells of times `noise`.
pub(super) fn log(model: &GreyBox, z: &[f64], rows: usize, seed: u64, noise: f64) -> Recording {
    let (n, m) = (model.states().len(), model.outputs().len());
    let mut random = Noise(seed);
    let mut normal = |deviation: f64| deviation * noise * random.normal();
    let (mut start, mut variances, mut work) = (vec![0.0; n], vec![0.0; n.max(m)], Work::new());
    model.start(z, &mut start, &mut variances, &mut work);
    let mut x: Vec<f64> =
        start.iter().zip(&variances).map(|(start, variance)| start + normal(variance.sqrt())).collect();
    let (mut u, mut y) = (Vec::new(), vec![Vec::new(); m]);
    let (mut outputs, mut next, mut jacobian) = (vec![0.0; m], vec![0.0; n], vec![0.0; n * n.max(m)]);
    let dt = model.sample_time();
    for row in 0..rows {
        let input = [if (row / 20) % 3 == 0 { 1.0 } else { -0.7 }];
        let time = row as f64 * dt;
        model.observe(&x, z, Drive::held(&input), time, &mut outputs, &mut jacobian[..m * n], &mut work);
        model.measurement_variances(&x, z, Drive::held(&input), time, &mut variances[..m], &mut work);
        for ((channel, output), variance) in y.iter_mut().zip(&outputs).zip(&variances) {
            channel.push(output + normal(variance.sqrt()));
        }
        u.push(input[0]);
        model.advance(&x, z, Drive::held(&input), time, dt, &mut next, &mut jacobian[..n * n], &mut work);
        let drive = Drive::held(&input);
        let mut factor = vec![0.0; n * n];
        model.process_noise(&x, z, drive, time, dt, &mut factor, &mut variances[..n], &mut work);
        x.copy_from_slice(&next);
        for (column, variance) in factor.chunks_exact(n).zip(&variances) {
            let drawn = normal(variance.sqrt());
            x.iter_mut().zip(column).for_each(|(x, entry)| *x += entry * drawn);
        }
    }
    let channel = |(name, values): (&String, Vec<f64>)| Channel { name: name.clone(), values };
    let channels = model.inputs().iter().zip([u]).chain(model.outputs().iter().zip(y)).map(channel);
    Recording { channels: channels.collect(), times: Times::Uniform(dt) }
}

/// With missing values: single ones, and whole rows.
pub(super) fn holed(mut recording: Recording) -> Recording {
    for channel in recording.channels.iter_mut().skip(1) {
        let length = channel.values.len();
        channel.values[length / 2..length / 2 + 7].fill(f64::NAN);
    }
    recording.channels[1].values[13] = f64::NAN;
    recording
}

/// What was recorded, as one log.
pub(super) fn joined(logs: &[Recording]) -> Result<Log, Error> {
    let log = |recording: &Recording| match &recording.times {
        Times::Uniform(step) => Log::new(recording.channels.clone(), *step),
        Times::Measured(time) => Log::recorded(recording.channels.clone(), time.clone()),
    };
    Log::join(logs.iter().map(log).collect::<Result<_, Error>>()?)
}

pub(super) fn experiment(model: &GreyBox, recording: &Recording) -> Experiment {
    let log = joined(std::slice::from_ref(recording)).unwrap();
    let all = [Rows::new(1, log.rows()).unwrap()];
    experiments(model, &log, &all, &[]).unwrap().remove(0)
}

/// What a fit found.
#[derive(Debug)]
pub(super) struct Found {
    pub(super) report: Report,
    pub(super) model: EquationsModel,
    pub(super) outcome: EquationsOutcome,
}

impl Found {
    /// The value of a parameter, and its standard error.
    pub(super) fn parameter(&self, index: usize) -> (f64, f64) {
        let parameter = &self.model.parameters[index];
        (parameter.value, parameter.standard_error.unwrap())
    }

    /// The figure of an output.
    pub(super) fn fit(&self, output: &str, horizon: Horizon) -> &Fit {
        let fits = &mut self.report.fit.iter();
        fits.find(|fit| (fit.output.as_str(), fit.horizon) == (output, horizon)).unwrap()
    }
}

pub(super) fn fitted(model: &GreyBox, logs: &[Recording]) -> Result<Found, Error> {
    fitted_with(model, logs, &EquationsPlan::default())
}

pub(super) fn fitted_with(model: &GreyBox, logs: &[Recording], plan: &EquationsPlan) -> Result<Found, Error> {
    let report = fit_equations(model, &joined(logs)?, &[], plan, &|_| ControlFlow::Continue(()))?;
    let Model::Equations(model) = report.model.clone() else { panic!("other kind") };
    let Procedure::InnovationsLikelihood(outcome) = report.estimation.procedure.clone() else {
        panic!("other procedure")
    };
    Ok(Found { report, model: *model, outcome })
}
