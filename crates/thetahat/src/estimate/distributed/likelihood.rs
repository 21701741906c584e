//! The likelihood of a model in equations over experiments that others hold too: its value and its slopes are sums over
//! them.

use super::Holders;
use super::message::{Asked, Found, LikelihoodSums};
use crate::estimate::equations::{Likelihood, LikelihoodObjective, Slopes};
use crate::model::GreyBox;
use crate::respond::equations::{Experiment, Failure};

impl LikelihoodSums {
    pub(super) fn new(model: &GreyBox, experiments: &[Experiment], z: &[f64], slopes: bool) -> Self {
        let mut criterion = LikelihoodObjective::new(model, experiments);
        let found = if slopes {
            criterion.linearize(z).map(|()| Self::Slopes(criterion.slopes().clone()))
        } else {
            criterion.evaluate(z).map(Self::Value)
        };
        found.unwrap_or_else(|Failure { log, row }| Self::Failure { log, row })
    }
}

/// The likelihood over experiments of which each holder has some that follow one another.
pub(crate) struct DistributedLikelihood<'h> {
    holders: &'h Holders<'h>,
    /// How many experiments there are before those of each holder.
    before: Vec<usize>,
    measurements: usize,
    slopes: Slopes,
}

impl<'h> DistributedLikelihood<'h> {
    /// `counts` are the experiments of each holder.
    pub(crate) fn new(
        holders: &'h Holders<'h>,
        counts: &[usize],
        model: &GreyBox,
        experiments: &[Experiment],
    ) -> Self {
        let before = counts.iter().scan(0, |all, count| {
            *all += count;
            Some(*all - count)
        });
        let measurements = LikelihoodObjective::new(model, experiments).measurements();
        let slopes = Slopes::zero(model.parameters().len());
        Self { holders, before: before.collect(), measurements, slopes }
    }

    /// What all holders say of a point, or the first failure. That of an answer is the holders'.
    fn asked<T>(
        &self,
        z: &[f64],
        slopes: bool,
        read: impl Fn(LikelihoodSums) -> Option<T>,
    ) -> Result<Vec<T>, Failure> {
        let lost = Failure { log: 0, row: 0 };
        let found = self.holders.answers(
            |_| Asked::Likelihood { z: z.to_vec(), slopes },
            |found| match found {
                Found::Likelihood(LikelihoodSums::Failure { log, row }) => Some(Err(Failure { log, row })),
                Found::Likelihood(sums) => read(sums).map(Ok),
                _ => None,
            },
        );
        let each = found.ok_or(lost)?.into_iter().zip(&self.before);
        each.map(|(found, before)| found.map_err(|own| Failure { log: own.log + before, ..own })).collect()
    }
}

impl Likelihood for DistributedLikelihood<'_> {
    fn measurements(&self) -> usize {
        self.measurements
    }

    fn evaluate(&mut self, z: &[f64]) -> Result<f64, Failure> {
        let value = |sums| if let LikelihoodSums::Value(value) = sums { Some(value) } else { None };
        Ok(self.asked(z, false, value)?.into_iter().sum())
    }

    fn linearize(&mut self, z: &[f64]) -> Result<(), Failure> {
        let (size, squares) = (self.slopes.gradient.len(), self.slopes.information.len());
        let own = |sums| match sums {
            LikelihoodSums::Slopes(own) if own.gradient.len() == size && own.information.len() == squares => {
                Some(own)
            }
            _ => None,
        };
        let found = self.asked(z, true, own)?;
        self.slopes = Slopes::zero(size);
        found.iter().for_each(|own| self.slopes.add(own));
        Ok(())
    }

    fn slopes(&self) -> &Slopes {
        &self.slopes
    }
}
