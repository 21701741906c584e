use std::fmt;
use std::ops::Range;
use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Error;

/// Rows of a log, 1-based, both ends included: what a person writes as `1..300`.
///
/// ```
/// use thetahat::Rows;
///
/// let rows: Rows = "1..300".parse()?;
/// assert_eq!(rows.len(), 300);
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "(usize, usize)", into = "(usize, usize)")]
pub struct Rows {
    first: usize,
    last: usize,
}

impl Rows {
    /// Rows `first` to `last`.
    ///
    /// # Errors
    /// [`Error::Argument`] if `first` is 0 or above `last`.
    pub fn new(first: usize, last: usize) -> Result<Self, Error> {
        if first == 0 {
            return Err(Error::argument("rows", format!("{first}..{last}: rows are counted from 1")));
        }
        if last < first {
            return Err(Error::argument(
                "rows",
                format!("{first}..{last}: the last row comes before the first; write {last}..{first}"),
            ));
        }
        Ok(Self { first, last })
    }

    /// The first row.
    pub fn first(&self) -> usize {
        self.first
    }

    /// The last row, included.
    pub fn last(&self) -> usize {
        self.last
    }

    /// The number of rows, at least 1.
    #[expect(clippy::len_without_is_empty, reason = "there is always a row")]
    pub fn len(&self) -> usize {
        self.last - self.first + 1
    }

    /// As 0-based positions.
    pub(crate) fn positions(&self) -> Range<usize> {
        self.first - 1..self.last
    }

    /// From 0-based positions that are not empty.
    pub(crate) fn from_positions(positions: &Range<usize>) -> Self {
        Self { first: positions.start + 1, last: positions.end }
    }
}

/// Checks that ranges lie inside a log of `rows` rows and do not overlap; gives them in rising order.
pub(crate) fn checked(argument: &str, ranges: &[Rows], rows: usize) -> Result<Vec<Rows>, Error> {
    let mut sorted = ranges.to_vec();
    sorted.sort_unstable();
    for range in &sorted {
        if range.last > rows {
            return Err(Error::data(format!(
                "{argument} {range}: the log has {rows} rows; name rows up to that"
            )));
        }
    }
    for pair in sorted.windows(2) {
        if let [a, b] = pair
            && b.first <= a.last
        {
            return Err(Error::argument(argument, format!("{a} and {b} overlap; name each row once")));
        }
    }
    Ok(sorted)
}

impl fmt::Display for Rows {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}..{}", self.first, self.last)
    }
}

impl FromStr for Rows {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let wrong =
            || Error::argument("rows", format!("'{text}' is not a range of rows; write it as 1..300"));
        let (first, last) = text.split_once("..").ok_or_else(wrong)?;
        let number = |text: &str| text.trim().parse().map_err(|_| wrong());
        Self::new(number(first)?, number(last)?)
    }
}

impl TryFrom<(usize, usize)> for Rows {
    type Error = Error;

    fn try_from((first, last): (usize, usize)) -> Result<Self, Error> {
        Self::new(first, last)
    }
}

impl From<Rows> for (usize, usize) {
    fn from(rows: Rows) -> Self {
        (rows.first, rows.last)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranges_are_read_and_refused() {
        assert_eq!("7..9".parse::<Rows>().unwrap(), Rows::new(7, 9).unwrap());
        for wrong in ["", "7", "..", "0..3", "9..7", "a..b", "1..2..3", "-1..4", "1..99999999999999999999"] {
            assert!(wrong.parse::<Rows>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn ranges_lie_inside_and_apart() {
        let rows = |text: &str| text.parse::<Rows>().unwrap();
        assert_eq!(
            checked("estimate", &[rows("5..9"), rows("1..4")], 9).unwrap(),
            [rows("1..4"), rows("5..9")]
        );
        assert!(checked("estimate", &[rows("1..10")], 9).is_err());
        assert!(checked("estimate", &[rows("1..4"), rows("4..5")], 9).is_err());
    }
}
