//! Where a filter stands, taken out of it and put back.

use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::DVector;

use super::StateFilter;
use super::bounded::StateSet;
use super::estimator::Engine;
use super::kind::{Filter, Observer, Sample, Unscented};
use super::row::{Row, Told};
use super::totals::Totals;
use crate::Error;

/// Where a [`StateFilter`] stands, without its model: plain data, to be kept with serde.
///
/// A filter of the same model and estimator that [resumes](StateFilter::resumed) from it goes on to the bit. Rows that
/// are [recorded](StateFilter::recording) are not part of it.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct FilterSnapshot {
    estimator: String,
    origin: f64,
    engine: EngineSnapshot,
    previous: Option<SampleSnapshot>,
    totals: Totals,
    row: Row,
    told: Option<Told>,
    /// The times and inputs of rows before, where the model needs them.
    #[serde(default)]
    past: (Vec<f64>, Vec<f64>),
}

#[derive(Debug, Clone, Serialize, Deserialize)]
enum EngineSnapshot {
    Filter(Filter),
    Unscented(Unscented),
    Bounded(StateSet),
    Observer(Observer),
}

#[derive(Debug, Clone, Serialize, Deserialize)]
struct SampleSnapshot {
    time: f64,
    inputs: Vec<f64>,
    #[serde(with = "numbers")]
    outputs: Vec<f64>,
}

impl StateFilter {
    /// Where it stands.
    ///
    /// ```
    /// use thetahat::filter::{Estimator, StateFilter, StateModel};
    ///
    /// let text = "sample_time = 1\noutputs = ['y']\nF = [[1]]\nH = [[1]]\nQ = [[1]]\nR = [[1]]\nP0 = [[1]]";
    /// let fresh = || StateFilter::new(StateModel::from_toml(text)?, Estimator::Kalman);
    /// let mut filter = fresh()?;
    /// filter.step(None, &[], &[2.0])?;
    /// let mut again = fresh()?.resumed(filter.snapshot())?;
    /// assert_eq!(again.step(None, &[], &[3.0])?, filter.step(None, &[], &[3.0])?);
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn snapshot(&self) -> FilterSnapshot {
        FilterSnapshot {
            estimator: self.estimator.to_owned(),
            origin: self.origin,
            engine: match &self.engine {
                Engine::Filter(filter) => EngineSnapshot::Filter(filter.clone()),
                Engine::Unscented(filter) => EngineSnapshot::Unscented(filter.clone()),
                Engine::Bounded(bounded) => EngineSnapshot::Bounded(bounded.set.clone()),
                Engine::Observer { observer, .. } => EngineSnapshot::Observer(observer.clone()),
            },
            previous: self.previous.as_ref().map(|Sample { time, inputs, outputs }| SampleSnapshot {
                time: *time,
                inputs: inputs.as_slice().to_vec(),
                outputs: outputs.as_slice().to_vec(),
            }),
            totals: self.totals,
            row: self.row.clone(),
            told: self.told,
            past: (self.past.rows().0.to_vec(), self.past.rows().1.to_vec()),
        }
    }

    /// The same filter at the place of a snapshot.
    ///
    /// # Errors
    /// [`Error::Data`] if the snapshot is of a filter of another size or estimator.
    pub fn resumed(mut self, snapshot: FilterSnapshot) -> Result<Self, Error> {
        let FilterSnapshot { estimator, origin, engine, previous, totals, row, told, past } = snapshot;
        let (states, inputs, outputs) =
            (self.row.predicted.len(), self.model.inputs().len(), self.model.outputs().len());
        let previous = previous.map(|SampleSnapshot { time, inputs, outputs }| Sample {
            time,
            inputs: DVector::from_vec(inputs),
            outputs: DVector::from_vec(outputs),
        });
        let has_size = |sample: &Sample| (sample.inputs.len(), sample.outputs.len()) == (inputs, outputs);
        let fits = match (&engine, &self.engine) {
            (EngineSnapshot::Filter(filter), Engine::Filter(_)) => filter.state().len() == states,
            (EngineSnapshot::Unscented(filter), Engine::Unscented(_)) => filter.state().len() == states,
            (EngineSnapshot::Bounded(set), Engine::Bounded(bounded)) => {
                set.centre().len() == states && set.capacity() == bounded.set.capacity()
            }
            (EngineSnapshot::Observer(observer), Engine::Observer { .. }) => {
                observer.state().len() == states && observer.gain().ncols() == outputs
            }
            _ => false,
        };
        let fits = fits
            && estimator == self.estimator
            && previous.as_ref().is_none_or(has_size)
            && previous.is_some() == told.is_some()
            && previous.is_some() == (totals.rows > 0)
            && row.is_like(&self.row);
        let past = self.model.kind.past().with_rows(past.0, past.1, inputs);
        let Some(past) = past.filter(|_| fits) else {
            return Err(Error::data("the snapshot is of a filter of another model or estimator"));
        };
        match (engine, &mut self.engine) {
            (EngineSnapshot::Filter(kept), Engine::Filter(filter)) => *filter = kept,
            (EngineSnapshot::Unscented(kept), Engine::Unscented(filter)) => *filter = kept,
            (EngineSnapshot::Bounded(kept), Engine::Bounded(bounded)) => bounded.set = kept,
            (EngineSnapshot::Observer(kept), Engine::Observer { observer, .. }) => *observer = kept,
            // Seen above.
            _ => {}
        }
        (self.history, self.past) = (None, past);
        self.row.clone_from(&row);
        self.next = row;
        (self.origin, self.previous, self.totals, self.told) = (origin, previous, totals, told);
        Ok(self)
    }
}

/// How numbers are written of which some may be missing: NaN as `null`, as JSON has none.
pub(super) mod numbers {
    use serde::{Deserialize, Deserializer, Serializer};

    pub(in crate::filter) fn serialize<S: Serializer>(
        numbers: &[f64],
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(numbers.iter().map(|number| (!number.is_nan()).then_some(number)))
    }

    pub(in crate::filter) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Vec<f64>, D::Error> {
        let numbers = Vec::<Option<f64>>::deserialize(deserializer)?;
        Ok(numbers.into_iter().map(|number| number.unwrap_or(f64::NAN)).collect())
    }
}
