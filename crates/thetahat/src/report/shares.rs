//! Which rows a fit is made to, and which it is evaluated on.

use super::schema::Parts;
use crate::Error;
use crate::data::{Rows, Split, between, checked};

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
}
