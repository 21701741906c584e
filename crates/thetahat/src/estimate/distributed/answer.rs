//! What those who hold experiments answer.

use thetahat_core::nalgebra::DMatrix;

use super::message::{
    AboutErrors, Answer, Asked, Factor, Found, LikelihoodSums, ModelErrors, Point, Question, Sums,
};
use crate::Error;
use crate::data::Record;
use crate::estimate::arx::rows;
use crate::estimate::predictor::Predictor;
use crate::estimate::thinning::energy;
use crate::estimate::uncertainty::{ErrorProducts, HIGHEST};
use crate::model::{GreyBox, Orders};
use crate::respond::equations::Experiment;

impl Question {
    /// The answer from experiments, each of them a segment or some of a record. As long as an iteration of a search.
    ///
    /// # Errors
    /// [`Error::Argument`] if it is about rows, inputs or parameters that there are not.
    pub(crate) fn answered_by(&self, record: &Record<'_>) -> Result<Answer, Error> {
        match &self.0 {
            Asked::Rows(asked) => {
                if asked.iter().any(|rows| rows.start > rows.end || rows.end > record.output.len()) {
                    return Err(foreign());
                }
                let part = |signal: &&[f64]| -> Vec<f64> {
                    asked.iter().flat_map(|rows| &signal[rows.clone()]).copied().collect()
                };
                let channels = record.inputs.iter().chain([&record.output]).map(part).collect();
                Ok(Answer(Found::Rows { channels, energy: energy(record) }))
            }
            Asked::Errors(model, about) => {
                // What indexes anything is checked here.
                let Orders { na, nb, nc, nd, nf, nk } = &model.orders;
                let valid = Orders::new(*na, nb, *nc, *nd, nf, nk).is_ok();
                let ones = vec![vec![1.0; record.output.len()]; model.constants.min(1)];
                let record = record.with_inputs(&ones);
                let fits = valid && record.inputs.len() == model.orders.inputs();
                let found = fits.then(|| about.answered_by(model, &record)).flatten();
                found.map(Answer).ok_or_else(foreign)
            }
            Asked::Likelihood { .. } => Err(foreign()),
        }
    }

    /// The answer from experiments that a model in equations describes. As long as an iteration of its search.
    ///
    /// # Errors
    /// [`Error::Argument`] if it is about another model.
    pub(crate) fn answered_by_equations(
        &self,
        model: &GreyBox,
        experiments: &[Experiment],
    ) -> Result<Answer, Error> {
        match &self.0 {
            Asked::Likelihood { z, slopes } if z.len() == model.parameters().len() => {
                Ok(Answer(Found::Likelihood(LikelihoodSums::new(model, experiments, z, *slopes))))
            }
            _ => Err(foreign()),
        }
    }
}

fn foreign() -> Error {
    Error::argument("question", "it is about other experiments; ask those that were described before")
}

impl AboutErrors {
    /// None if the question does not fit the data.
    fn answered_by(&self, model: &ModelErrors, record: &Record<'_>) -> Option<Found> {
        if matches!(self, Self::Autoregression(_, order) if *order > HIGHEST) {
            return None;
        }
        let mut errors = Predictor::new(record, &model.orders, model.begin);
        let size = model.orders.parameters();
        let free: Vec<usize> = errors.free_counts().collect();
        let fits = |at: &Point| at.parameters.len() == size && at.free.len() == free.iter().sum::<usize>();
        Some(match self {
            Self::Size => Found::Size { samples: errors.samples(), free, output: errors.output_sums() },
            Self::Sums(at) => Found::Sums(fits(at).then(|| {
                let cost = errors.stand_at(at)?;
                let sums = Sums {
                    cost,
                    diagonal: (0..size).map(|column| errors.square_of(column)).collect(),
                    free_gain: errors.free_gain(),
                    free_steps: errors.free_steps(),
                    matrix: errors.matrix,
                    right: errors.right,
                };
                Some(sums).filter(Sums::is_finite)
            })?),
            Self::Factor(at) => Found::Factor(fits(at).then(|| {
                errors.stand_at(at)?;
                let factor = errors.factor().ok()?;
                Some(Factor {
                    triangle: factor.factor().transpose().as_slice().to_vec(),
                    rotated: factor.rotated_output().as_slice().to_vec(),
                    residual_norm: factor.residual_norm(),
                    rows: factor.rows(),
                })
            })?),
            Self::Autoregression(at, order) => Found::Autoregression(fits(at).then(|| {
                errors.stand_at(at)?;
                let (residuals, segments) = errors.residuals();
                Some(ErrorProducts::new(&residuals, &segments, *order))
            })?),
            Self::Filtered { at, weights, monic } => {
                Found::Filtered((fits(at) && weights.iter().all(|row| row.len() == size)).then(|| {
                    errors.stand_at(at)?;
                    let weights = DMatrix::from_fn(weights.len(), size, |i, j| weights[i][j]);
                    Some(rows(&errors.backward_filtered_products(&weights, monic)))
                })?)
            }
        })
    }
}

impl Sums {
    /// A document has no other numbers.
    fn is_finite(&self) -> bool {
        let vectors = [&self.matrix, &self.right, &self.diagonal, &self.free_steps];
        let mut all = vectors.into_iter().flatten().chain([&self.cost, &self.free_gain]);
        all.all(|value| value.is_finite())
    }
}

impl Predictor<'_> {
    /// At a point; none where the errors overflow.
    fn stand_at(&mut self, at: &Point) -> Option<f64> {
        self.set_free(&at.free);
        let cost = self.evaluate(&at.parameters).ok()?;
        self.linearize();
        Some(cost)
    }
}
