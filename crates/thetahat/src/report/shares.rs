//! Which rows a fit is made to, and which it is evaluated on.

use super::schema::{Data, Missing, Parts};
use crate::Error;
use crate::data::{Log, Rows, Source, Split, between, checked, digests};

/// What rows serve for.
pub(super) struct Shares {
    /// For the fit.
    pub(super) estimation: Vec<Rows>,
    /// For figures.
    pub(super) validation: Vec<Rows>,
    pub(super) parts: Option<Parts>,
}

impl Shares {
    pub(super) fn of(
        estimate: &[Rows],
        validate: &[Rows],
        split: Option<Split>,
        rows: usize,
    ) -> Result<Self, Error> {
        let all = [Rows::new(1, rows)?];
        let estimation = checked("estimate", if estimate.is_empty() { &all } else { estimate }, rows)?;
        let validation = checked("validate", validate, rows)?;
        let Some(split) = split else { return Ok(Self { estimation, validation, parts: None }) };
        if !validation.is_empty() {
            return Err(Error::argument(
                "split",
                "it has a validation part of its own; leave out one of `split` and `validate`",
            ));
        }
        let [first, second, test] = split.cut(&estimation)?;
        let count = |part: &[Rows]| part.iter().map(Rows::len).sum::<usize>();
        let fitted = between(&estimation, 0, count(&first) + count(&second));
        let parts = Parts { estimation: first, validation: second, test };
        Ok(Self { estimation: fitted, validation, parts: Some(parts) })
    }

    /// What a fit to these rows of a log was made to: `segments` are the rows of it without a gap, `detrend` says how
    /// offsets were found.
    ///
    /// # Errors
    /// [`Error::Data`] for a channel that is not there.
    pub(super) fn into_data(
        self,
        (log, sources): (&Log, &[Source]),
        names: &[&str],
        detrend: String,
        segments: Vec<Rows>,
    ) -> Result<Data, Error> {
        let missing =
            names.iter().map(|name| Ok(Missing { channel: (*name).to_owned(), rows: log.missing(name)? }));
        Ok(Data {
            logs: sources.to_vec(),
            digests: digests(log, names, &self.estimation)?,
            rows: log.rows(),
            sample_time: log.sample_time(),
            detrend,
            prefilter: None,
            validation: self.validation,
            split: self.parts,
            segments,
            missing: missing.collect::<Result<_, Error>>()?,
            time_gaps: log.gaps(),
            estimation: self.estimation,
        })
    }
}
