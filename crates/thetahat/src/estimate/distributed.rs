//! Prediction errors of experiments that others hold, in other processes or on other machines.
//!
//! A search asks of the data, at each point, J = sum e^2, half its gradient, and the Gram matrix of psi = -de/dtheta:
//! sums over all samples, and so sums of what each holder of experiments finds in its own. The weights of the
//! initial-condition responses of an experiment are its own affair but for the steps that the search takes: where they
//! stand goes out with the parameters, and how they follow a step comes back with the sums. So a holder keeps nothing
//! from one question to the next: who is lost is replaced, and the same questions have the same answers. p^2 + n (p
//! + 1) numbers for p parameters and n initial conditions go back.
//!
//! An answer has the normal equations at once, as nearly all points that a search tries are taken.

mod answer;
mod errors;
mod likelihood;
mod message;

use std::cell::RefCell;
use std::collections::VecDeque;
use std::ops::Range;

use super::experiment_data::ExperimentData;
use super::predictor::InitialCondition;
use super::thinning::Packed;
use crate::Error;
use crate::data::Record;
use crate::model::Orders;
use errors::DistributedErrors;
pub(crate) use likelihood::DistributedLikelihood;
use message::{AboutErrors, Asked, Found, ModelErrors};
pub use message::{Answer, Question};

/// How many answers are kept.
const LATEST: usize = 16;

/// Asks every holder its question: an answer for each, in their order.
pub type Ask<'a> = &'a dyn Fn(&[Question]) -> Result<Vec<Answer>, Error>;

/// Those who hold the data, and why one of them has no answer.
pub(crate) struct Holders<'a> {
    ask: Ask<'a>,
    count: usize,
    failed: RefCell<Option<Error>>,
    /// The latest questions with their answers: a search comes back to where it was.
    latest: RefCell<VecDeque<(Vec<Question>, Vec<Answer>)>>,
}

impl<'a> Holders<'a> {
    /// So many.
    pub(crate) fn new(ask: Ask<'a>, count: usize) -> Self {
        Self { ask, count, failed: RefCell::new(None), latest: RefCell::default() }
    }

    /// What made an answer fail, if one did: nothing that was found since then is of any worth. Whoever takes it gives
    /// it on.
    pub(crate) fn failure(&self) -> Option<Error> {
        self.failed.take()
    }

    /// The answers; none once one has failed.
    fn answers<T>(
        &self,
        question: impl Fn(usize) -> Asked,
        read: impl Fn(Found) -> Option<T>,
    ) -> Option<Vec<T>> {
        if self.failed.borrow().is_some() {
            return None;
        }
        let questions: Vec<Question> = (0..self.count).map(|holder| Question(question(holder))).collect();
        let other =
            || Error::data("an answer is to another question; ask with one version of thetahat alone");
        let known = self
            .latest
            .borrow()
            .iter()
            .find(|(asked, _)| *asked == questions)
            .map(|(_, found)| found.clone());
        let found = known.map_or_else(
            || {
                let found = (self.ask)(&questions)?;
                let mut latest = self.latest.borrow_mut();
                latest.truncate(LATEST - 1);
                latest.push_front((questions, found.clone()));
                Ok(found)
            },
            Ok,
        );
        let found = found.and_then(|answers| {
            let right = answers.len() == self.count;
            let read: Option<Vec<T>> = answers.into_iter().map(|answer| read(answer.0)).collect();
            read.filter(|_| right).ok_or_else(other)
        });
        match found {
            Ok(found) => Some(found),
            Err(error) => {
                *self.failed.borrow_mut() = Some(error);
                None
            }
        }
    }

    /// The root of the sum of squares of the output about its mean, over the samples that count.
    ///
    /// # Errors
    /// What made an answer fail.
    pub(crate) fn output_spread(&self, orders: &Orders, at_rest: bool) -> Result<f64, Error> {
        let begin = if at_rest { InitialCondition::Zero } else { InitialCondition::Unknown };
        let model = ModelErrors { orders: orders.clone(), begin, constants: 0 };
        let found = self.answers(
            |_| Asked::Errors(model.clone(), AboutErrors::Size),
            |found| {
                if let Found::Size { samples, output, .. } = found { Some((samples, output)) } else { None }
            },
        );
        let found = found.ok_or_else(|| self.failure().unwrap_or(Error::Interrupted))?;
        let [mut count, mut sum, mut squares] = [0.0; 3];
        for (samples, [own, own_squares]) in found {
            count += samples as f64;
            sum += own;
            squares += own_squares;
        }
        Ok((squares - sum * sum / count).max(0.0).sqrt())
    }

    /// Some rows of each holder, one channel after the other, the output last; and the energy of the output in all
    /// rows.
    ///
    /// # Errors
    /// What made an answer fail.
    pub(crate) fn rows(
        &self,
        rows: &[Vec<Range<usize>>],
        channels: usize,
    ) -> Result<(Vec<Vec<f64>>, f64), Error> {
        let question = |holder: usize| Asked::Rows(rows.get(holder).cloned().unwrap_or_default());
        let found = self.answers(question, |found| match found {
            Found::Rows { channels: own, energy } if own.len() == channels => Some((own, energy)),
            _ => None,
        });
        let found = found.ok_or_else(|| self.failure().unwrap_or(Error::Interrupted))?;
        let (mut joined, mut energy) = (vec![Vec::new(); channels], 0.0);
        for (own, more) in found {
            joined.iter_mut().zip(own).for_each(|(all, mut own)| all.append(&mut own));
            energy += more;
        }
        Ok((joined, energy))
    }
}

/// The data of experiments that others hold.
pub(crate) struct Distributed<'a> {
    holders: &'a Holders<'a>,
    /// Rows that are at hand, enough for starts.
    thin: Record<'a>,
    energy: f64,
    constants: usize,
}

impl<'a> Distributed<'a> {
    pub(crate) fn new(holders: &'a Holders<'a>, thin: Record<'a>, energy: f64) -> Self {
        Self { holders, thin, energy, constants: 0 }
    }
}

impl ExperimentData for Distributed<'_> {
    type Errors<'e>
        = DistributedErrors<'e>
    where
        Self: 'e;
    type Wider<'e>
        = Distributed<'e>
    where
        Self: 'e;

    fn record(&self) -> Option<&Record<'_>> {
        None
    }

    fn thinned(&self) -> Option<Packed> {
        Some(Packed::of(&self.thin))
    }

    fn with_inputs<'e>(&'e self, signals: &'e [Vec<f64>]) -> Distributed<'e> {
        let Self { holders, energy, constants, .. } = *self;
        let thin = Record::with_inputs(&self.thin, signals);
        Distributed { holders, thin, energy, constants: constants + signals.len() }
    }

    fn check(&self, orders: &Orders) -> Result<(), Error> {
        self.thin.check(orders)
    }

    fn errors<'e>(&'e self, orders: &Orders, begin: InitialCondition) -> DistributedErrors<'e> {
        DistributedErrors::new(self, orders, begin)
    }

    fn energy(&self) -> f64 {
        self.energy
    }

    /// Nothing: all rows of the experiments are of the fit.
    fn past(&self) -> &[usize] {
        &[0]
    }
}
