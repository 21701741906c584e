use std::fmt;

use super::Rows;
use crate::Error;

/// This many rows at the end that repeat one value in all channels are told.
const PADDING: usize = 20;

/// Rows at the end of which all channels repeat one value.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Padding {
    pub(crate) rows: Rows,
}

impl Padding {
    /// Whether the last of some rows, in which all channels repeat one value, are that.
    ///
    /// # Errors
    /// [`Error::Argument`] if there are more of them than rows.
    pub(crate) fn of(rows: usize, last: usize) -> Result<Option<Self>, Error> {
        if last < PADDING.max(rows / 100) || last == rows {
            return Ok(None);
        }
        Ok(Some(Self { rows: Rows::new((rows + 1).saturating_sub(last), rows)? }))
    }

    /// What is seen of it.
    pub(crate) fn seen(&self) -> String {
        let (first, rows) = (self.rows.first(), self.rows.len());
        format!("from row {first} to the end ({rows} rows) no channel changes, as in a log that was padded")
    }

    /// What to do about it.
    pub(crate) fn advice(&self) -> String {
        format!("leave these rows out (`estimate` 1..{}) unless the plant rested", self.rows.first() - 1)
    }
}

impl fmt::Display for Padding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.seen(), self.advice())
    }
}
