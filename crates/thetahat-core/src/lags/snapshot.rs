//! What is written, and how it is checked when it is read back.

use nalgebra::OVector;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::{Line, Source, is_infinite};
use crate::error::check_length;
use crate::snapshot::{Entry, snapshot, vector};
use crate::{Dimension, Error, Lags, Real};

impl Entry for Line {
    const BLANK: Line = Line { index: 0, nb: 0, nk: 0 };

    fn write<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        (self.index, self.nb, self.nk).serialize(serializer)
    }

    fn read<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Line, D::Error> {
        let (index, nb, nk) = Deserialize::deserialize(deserializer)?;
        Ok(Line { index, nb, nk })
    }
}

snapshot! {
    Snapshot<T, N, D> of Lags<T, N, D> where [T: Real, N: Dimension, D: Dimension] {
        #[serde(with = "vector")]
        regressor: OVector<T, N>;
        #[serde(with = "vector")]
        delayed: OVector<T, D>;
        #[serde(with = "vector")]
        lines: OVector<Line, N>;
        na: u16;
        outputs: u16;
        inputs: usize;
        awaiting_inputs: bool;
    }
}

impl<T: Real, N: Dimension, D: Dimension> Lags<T, N, D> {
    /// That they are of this many outputs, and make this many parameters, of which the last `residuals` are those of
    /// past residuals.
    pub(crate) fn check_counts(
        &self,
        parameters: usize,
        outputs: usize,
        residuals: usize,
    ) -> Result<(), Error> {
        check_length("lags", parameters, self.regressor.len())?;
        check_length("outputs", outputs, self.outputs())?;
        let of_residuals = |line: &&Line| line.nb > 0 && line.source(self.inputs) == Source::Residual;
        let line = self.lines.as_slice().iter().find(of_residuals);
        check_length("residuals", residuals, line.map_or(0, |line| line.nb.into()))
    }
}

impl<T: Real, N: Dimension, D: Dimension> TryFrom<Snapshot<T, N, D>> for Lags<T, N, D> {
    type Error = Error;

    fn try_from(read: Snapshot<T, N, D>) -> Result<Self, Error> {
        let Snapshot { version: _, regressor, delayed, lines, na, outputs, inputs, awaiting_inputs } = read;
        check_length("lines", regressor.len(), lines.len())?;
        for (argument, samples) in [("regressor", regressor.as_slice()), ("delayed", delayed.as_slice())] {
            if samples.iter().any(is_infinite) {
                return Err(Error::Infinite { argument });
            }
        }
        // Those in use come first, in the order of their indices.
        let (mut parameters, mut delays, mut next) =
            (usize::from(na).saturating_mul(outputs.into()), 0_usize, Some(0));
        for line in lines.as_slice() {
            let fits = match next {
                Some(least) if line.nb > 0 => {
                    line.index >= least
                        && match line.source(inputs) {
                            Source::Input(_) => true,
                            Source::Constant => (line.nb, line.nk) == (1, 0),
                            Source::Residual => usize::from(line.index) - inputs == 1 && line.nk == 0,
                        }
                }
                _ => *line == Line { index: 0, nb: 0, nk: 0 },
            };
            fits.then_some(()).ok_or(Error::OutOfRange { argument: "lines", range: "one for each input" })?;
            next = next.filter(|_| line.nb > 0).map(|_| line.index.saturating_add(1));
            parameters = parameters.saturating_add(line.nb.into());
            delays = delays.saturating_add(line.nk.into());
        }
        let available = regressor.len();
        if parameters != available {
            return Err(Error::Orders { needed: parameters, available });
        }
        if delays > delayed.len() {
            return Err(Error::Delays { needed: delays, available: delayed.len() });
        }
        let lags = Lags { regressor, delayed, lines, na, outputs, inputs, awaiting_inputs };
        if awaiting_inputs {
            lags.check_delays()?;
        }
        Ok(lags)
    }
}
