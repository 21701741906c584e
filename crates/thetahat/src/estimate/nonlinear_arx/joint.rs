//! One model of several outputs, of which each was fitted alone.

use thetahat_core::nalgebra::DMatrix;
use thetahat_numerics::regression::product;

use super::{Samples, Solved};
use crate::model::{Evaluator, NonlinearArxModel, Signal};

/// The model of all outputs, and what its errors are.
#[derive(Debug)]
pub(crate) struct Joint {
    pub(crate) model: NonlinearArxModel,
    /// The mean of e^2 over all values of all outputs.
    pub(crate) mse: f64,
    /// The determinant of the matrix of the mean products of e; of one output the mean square.
    pub(crate) determinant: f64,
    pub(crate) condition: Option<f64>,
}

/// Joins models of single outputs that were fitted to the same samples of the same regressors. Each is a regression of
/// its own,
///
/// ```text
/// y_i = F_i theta_i + e_i,   cov(theta_i, theta_j) = sigma_ij (F_i' F_i)^-1 F_i' F_j (F_j' F_j)^-1
/// ```
///
/// with sigma_ij the covariance of the errors (Zellner, J. Am. Stat. Assoc. 57, 1962). Cost: O(N p^2).
pub(crate) fn joint(inputs: &[Signal], parts: Vec<(Samples<'_>, Solved)>) -> Option<Joint> {
    let outputs: Vec<Signal> = parts.iter().map(|(samples, _)| samples.head.outputs[0].clone()).collect();
    let mse = parts.iter().map(|(_, solved)| solved.mse).sum::<f64>() / parts.len() as f64;
    let conditions = parts.iter().filter_map(|(_, solved)| solved.condition);
    let condition = conditions.reduce(f64::max);
    if parts.len() == 1 {
        let (_, Solved { model, mse, .. }) = parts.into_iter().next()?;
        return Some(Joint { model, mse, determinant: mse, condition });
    }
    let errors: Vec<Vec<f64>> = parts.iter().map(|(samples, solved)| samples.errors(&solved.model)).collect();
    let known = |place: usize| parts[place].1.model.covariance.is_some();
    let correlation = DMatrix::from_fn(parts.len(), parts.len(), |i, j| {
        let squares = |k: usize| product(&errors[k], &errors[k]);
        match i == j {
            true => 1.0,
            // Errors at the samples that a map keeps say nothing.
            false if !known(i) || !known(j) || squares(i) * squares(j) <= 0.0 => 0.0,
            false => product(&errors[i], &errors[j]) / (squares(i) * squares(j)).sqrt(),
        }
    });
    let deviation = |place: usize| parts[place].1.model.noise_covariance[0][0].sqrt();
    let noise = |i: usize, j: usize| correlation[(i, j)] * deviation(i) * deviation(j);
    let all = 0..parts.len();
    let noise_covariance = all.clone().map(|i| all.clone().map(|j| noise(i, j)).collect()).collect();
    let determinant = correlation.determinant() * parts.iter().map(|(_, solved)| solved.mse).product::<f64>();
    // Of trained numbers only those of one map are known.
    let trained = parts.iter().any(|(_, solved)| {
        solved.model.covariance.as_ref().is_some_and(|rows| rows.len() > solved.model.parameters.len())
    });
    let covariance = if trained { None } else { covariance(&parts, &correlation) };
    let degrees_of_freedom = parts.iter().filter_map(|(_, solved)| solved.model.degrees_of_freedom).min();
    let head = parts.first()?.1.model.clone();
    let (mut maps, mut parameters) = (Vec::new(), Vec::new());
    for ((_, solved), output) in parts.into_iter().zip(&outputs) {
        maps.extend(solved.model.maps);
        parameters.extend(solved.model.parameters.into_iter().map(|mut parameter| {
            parameter.name = format!("{}: {}", output.name, parameter.name);
            parameter
        }));
    }
    let inputs = inputs.to_vec();
    let model = NonlinearArxModel {
        inputs,
        outputs,
        maps,
        noise_covariance,
        degrees_of_freedom,
        parameters,
        covariance,
        ..head
    };
    Some(Joint { model, mse, determinant, condition })
}

/// The covariance of all parameters; none where that of a map is not known.
fn covariance(parts: &[(Samples<'_>, Solved)], correlation: &DMatrix<f64>) -> Option<Vec<Vec<f64>>> {
    let matrix = |rows: &Vec<Vec<f64>>| DMatrix::from_fn(rows.len(), rows.len(), |i, j| rows[i][j]);
    let own: Vec<DMatrix<f64>> = parts
        .iter()
        .map(|(_, solved)| solved.model.covariance.as_ref().map(matrix))
        .collect::<Option<_>>()?;
    let starts: Vec<usize> = own
        .iter()
        .scan(0, |end, own| {
            *end += own.nrows();
            Some(*end - own.nrows())
        })
        .collect();
    let size = own.iter().map(DMatrix::nrows).sum();
    let mut whole = DMatrix::<f64>::zeros(size, size);
    for i in 0..parts.len() {
        whole.view_mut((starts[i], starts[i]), own[i].shape()).copy_from(&own[i]);
        for j in 0..i {
            // sigma_ii (F_i' F_i)^-1 is known, in units of the scaled output.
            let deviation = |k: usize| parts[k].1.model.noise_covariance[0][0].sqrt() / parts[k].0.scale;
            let share = correlation[(i, j)] / (deviation(i) * deviation(j));
            if !share.is_finite() || share == 0.0 {
                continue;
            }
            let block = &own[i] * crossed(&parts[i], &parts[j]) * &own[j] * share;
            whole.view_mut((starts[i], starts[j]), block.shape()).copy_from(&block);
            let transposed = block.transpose();
            whole.view_mut((starts[j], starts[i]), transposed.shape()).copy_from(&transposed);
        }
    }
    Some((0..size).map(|i| (0..size).map(|j| whole[(i, j)]).collect()).collect())
}

/// F_i' F_j.
fn crossed(one: &(Samples<'_>, Solved), other: &(Samples<'_>, Solved)) -> DMatrix<f64> {
    let evaluator = |(_, solved): &(Samples<'_>, Solved)| {
        Evaluator::new(&solved.model.maps[0].functions, vec![0.0; solved.model.parameters.len()])
    };
    let (first, second) = (evaluator(one), evaluator(other));
    let (mut f, mut g) = (vec![0.0; first.parameters()], vec![0.0; second.parameters()]);
    let mut sums = DMatrix::<f64>::zeros(f.len(), g.len());
    for t in &one.0.rows {
        let z = one.0.point(*t);
        first.functions(&z, &mut f);
        second.functions(&z, &mut g);
        for (j, g) in g.iter().enumerate() {
            for (i, f) in f.iter().enumerate() {
                sums[(i, j)] += f * g;
            }
        }
    }
    sums
}

impl Samples<'_> {
    /// The errors of a model one step ahead at the samples, in units of the scaled output.
    fn errors(&self, model: &NonlinearArxModel) -> Vec<f64> {
        let theta = model.parameters.iter().map(|parameter| parameter.value).collect();
        let evaluator = Evaluator::new(&model.maps[0].functions, theta);
        self.rows.iter().map(|t| self.signals[0][*t] - evaluator.value(&self.point(*t))).collect()
    }
}
