use std::borrow::Cow;
use std::fmt;
use std::str::FromStr;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::Error;
use crate::estimate::InformationCriterion;
use crate::model::{LARGEST, Orders, Structure};

/// Which orders a model may have.
#[derive(Debug, Clone, PartialEq)]
pub enum Choice {
    /// These orders.
    Known(Orders),
    /// Orders chosen from a grid.
    Grid(Grid),
    /// Structure and orders decided from the data.
    Automatic(Automatic),
}

impl From<Orders> for Choice {
    fn from(orders: Orders) -> Self {
        Self::Known(orders)
    }
}

/// Ranges of orders: all models of a grid, or a path through it.
///
/// `nb`, `nf` and `nk` have one range for all inputs, which then have the same order, or one for each.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Grid {
    /// Coefficients of A.
    pub na: OrderRange,
    /// Coefficients of B.
    pub nb: Vec<OrderRange>,
    /// Coefficients of C.
    pub nc: OrderRange,
    /// Coefficients of D.
    pub nd: OrderRange,
    /// Coefficients of F.
    pub nf: Vec<OrderRange>,
    /// Samples from an input's change to its first effect.
    pub nk: Vec<OrderRange>,
    /// Which of its models are tried.
    pub path: Path,
}

/// Delay, structure and orders from the data: delays first, then the least MDL among ARX up to order 10, and ARMAX,
/// output error and Box-Jenkins up to order 3, on common samples.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Automatic {
    /// The structure, if it is known.
    pub structure: Option<Structure>,
    /// The delays, one for each input, if they are known.
    pub nk: Option<Vec<usize>>,
    /// Whether nonlinear models are left out.
    pub linear: bool,
}

/// Orders from a first to a last one, both included: what a person writes as `1..10`, or `2`.
///
/// ```
/// use thetahat::select::OrderRange;
///
/// let range: OrderRange = "1..10".parse()?;
/// assert_eq!((range.first(), range.last()), (1, 10));
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OrderRange {
    first: usize,
    last: usize,
}

/// Which models of a grid are tried.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Path {
    /// All of them.
    #[default]
    All,
    /// From the smallest on, one order up at a time, each in its turn (A, B, C, D, F), for each delay.
    Alternate,
}

/// What makes one model better than another.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Select {
    /// The least of a criterion on the rows that models are fitted to.
    Criterion(InformationCriterion),
    /// The mean of e^2 on the validation rows: the smallest model within 1 % of the least.
    Validation,
    /// Cross-validation: the mean of e^2 over five blocks in time, each predicted by a model of the others; the
    /// smallest model within 1 % of the least.
    Cv,
}

impl Select {
    /// Rissanen's minimum description length.
    pub const MDL: Self = Self::Criterion(InformationCriterion::MDL);

    /// All of them.
    pub fn all() -> impl Iterator<Item = Self> + Clone {
        InformationCriterion::all().map(Self::Criterion).chain([Self::Validation, Self::Cv])
    }

    /// The word for it in options and documents.
    pub fn word(self) -> &'static str {
        match self {
            Self::Criterion(criterion) => criterion.word(),
            Self::Validation => "validation",
            Self::Cv => "cv",
        }
    }

    /// What it is, in a few words.
    pub fn says(self) -> &'static str {
        match self {
            Self::Criterion(criterion) => criterion.says(),
            Self::Validation => "The smallest model within 1 % of the least cost on the validation rows",
            Self::Cv => "The same by cross-validation over five blocks in time",
        }
    }

    /// Whether it evaluates samples that models are not fitted to.
    pub(crate) fn is_held_out(self) -> bool {
        !matches!(self, Self::Criterion(_))
    }
}

/// MDL.
impl Default for Select {
    fn default() -> Self {
        Self::MDL
    }
}

impl fmt::Display for Select {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

impl FromStr for Select {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        Self::all().find(|select| select.word() == text).ok_or_else(|| {
            let words: Vec<&str> = Self::all().map(Self::word).collect();
            Error::argument("select", format!("'{text}' is none; there are {}", words.join(", ")))
        })
    }
}

impl Serialize for Select {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.word())
    }
}

impl<'de> Deserialize<'de> for Select {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(serde::de::Error::custom)
    }
}

impl JsonSchema for Select {
    fn schema_name() -> Cow<'static, str> {
        "Select".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let of = |select: Select| json_schema!({ "const": select.word(), "description": select.says() });
        json_schema!({ "oneOf": Self::all().map(of).collect::<Vec<_>>() })
    }
}

impl OrderRange {
    /// From `first` to `last`.
    ///
    /// # Errors
    /// [`Error::Argument`] if `first` is above `last`.
    pub fn new(first: usize, last: usize) -> Result<Self, Error> {
        if first > last {
            return Err(Error::argument(
                "orders",
                format!("{first}..{last}: the last order is below the first; write {last}..{first}"),
            ));
        }
        Ok(Self { first, last })
    }

    /// The first order.
    pub fn first(&self) -> usize {
        self.first
    }

    /// The last order, included.
    pub fn last(&self) -> usize {
        self.last
    }

    /// The only order, if there is but one.
    pub fn single(&self) -> Option<usize> {
        (self.first == self.last).then_some(self.first)
    }
}

impl From<usize> for OrderRange {
    fn from(order: usize) -> Self {
        Self { first: order, last: order }
    }
}

impl fmt::Display for OrderRange {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.single() {
            Some(order) => write!(f, "{order}"),
            None => write!(f, "{}..{}", self.first, self.last),
        }
    }
}

impl FromStr for OrderRange {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let wrong =
            || Error::argument("orders", format!("'{text}' is not an order; write 2, or a range as 1..10"));
        let number = |text: &str| {
            let order = text.trim().parse().map_err(|_| wrong())?;
            if order > LARGEST {
                let message = format!("{order} is above {LARGEST}, the largest order");
                return Err(Error::argument("orders", message));
            }
            Ok(order)
        };
        match text.split_once("..") {
            Some((first, last)) => Self::new(number(first)?, number(last)?),
            None => number(text).map(Self::from),
        }
    }
}
