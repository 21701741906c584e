//! Information criteria: one table of them, from which every list of them is made.

use std::fmt;
use std::str::FromStr;

use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde::de::{IgnoredAny, MapAccess, Visitor};
use serde::ser::SerializeMap;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::Error;

/// A criterion: the word for it, its name, what it is, whether it is the logarithm of the cost and a penalty, and its
/// value for J, p and N.
struct Entry {
    word: &'static str,
    name: &'static str,
    says: &'static str,
    logarithmic: bool,
    value: fn(f64, f64, f64) -> Option<f64>,
}

/// All of them, in the order of documents. Another one is another line.
const TABLE: &[Entry] = &[
    Entry {
        word: "fpe",
        name: "FPE",
        says: "Akaike's final prediction error",
        logarithmic: false,
        value: |j, p, n| Some(j * (n + p) / (n - p)),
    },
    Entry {
        word: "aic",
        name: "AIC",
        says: "Akaike's information criterion",
        logarithmic: true,
        value: |j, p, n| Some(2.0 * p / n + logarithm(j)?),
    },
    Entry {
        word: "aicc",
        name: "AICc",
        says: "The same, corrected for few samples",
        logarithmic: true,
        value: |j, p, n| {
            let correction = 2.0 * p * (p + 1.0) / (n * (n - p - 1.0));
            Some(2.0 * p / n + logarithm(j)? + correction).filter(|_| n > p + 1.0)
        },
    },
    Entry {
        word: "mdl",
        name: "MDL",
        says: "Rissanen's minimum description length",
        logarithmic: true,
        value: |j, p, n| Some(p * n.ln() / n + logarithm(j)?),
    },
    Entry {
        word: "hqc",
        name: "HQC",
        says: "Hannan and Quinn's criterion, between AIC and MDL",
        logarithmic: true,
        value: |j, p, n| Some(2.0 * p * n.ln().ln() / n + logarithm(j)?).filter(|_| n > 1.0),
    },
];

fn logarithm(cost: f64) -> Option<f64> {
    (cost > 0.0).then(|| cost.ln())
}

/// What a model's cost says when it also pays for its parameters: the smaller, the better.
///
/// With J = (1/N) sum e^2 over N samples and p parameters:
///
/// ```text
/// FPE  = J (N + p)/(N - p)                    Akaike 1969, Annals of the Institute of Statistical Mathematics 21
/// AIC  = 2 p/N + ln J                         Akaike 1974, IEEE Transactions on Automatic Control 19
/// AICc = AIC + 2 p (p + 1)/(N (N - p - 1))    Hurvich and Tsai 1989, Biometrika 76
/// MDL  = p ln(N)/N + ln J                     Rissanen 1978, Automatica 14
/// HQC  = 2 p ln(ln N)/N + ln J                Hannan and Quinn 1979, J. Royal Statistical Society B 41
/// ```
///
/// FPE has the units of y squared. A value is none where it is not defined: the logarithms at J = 0, AICc at N <= p
/// + 1.
///
/// ```
/// use thetahat::estimate::InformationCriterion;
///
/// let criterion: InformationCriterion = "hqc".parse()?;
/// assert_eq!((criterion.word(), criterion.name()), ("hqc", "HQC"));
/// assert!(criterion.value(1.0, 3, 200) < InformationCriterion::MDL.value(1.0, 3, 200));
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct InformationCriterion(usize);

impl InformationCriterion {
    /// Akaike's final prediction error.
    pub const FPE: Self = Self(0);
    /// Akaike's information criterion.
    pub const AIC: Self = Self(1);
    /// Rissanen's minimum description length.
    pub const MDL: Self = Self(3);

    /// All of them.
    pub fn all() -> impl Iterator<Item = Self> + Clone {
        (0..TABLE.len()).map(Self)
    }

    fn entry(self) -> &'static Entry {
        &TABLE[self.0]
    }

    /// The word for it in options and documents.
    pub fn word(self) -> &'static str {
        self.entry().word
    }

    /// Its name for people.
    pub fn name(self) -> &'static str {
        self.entry().name
    }

    /// What it is, in a few words.
    pub fn says(self) -> &'static str {
        self.entry().says
    }

    /// Whether it is the logarithm of the cost with a penalty; else it has the units of the cost.
    pub fn is_logarithmic(self) -> bool {
        self.entry().logarithmic
    }

    /// That of a model with `parameters` parameters and mean square error `mse` over `samples` samples, which must be
    /// more than the parameters for FPE to be positive.
    pub fn value(self, mse: f64, parameters: usize, samples: usize) -> Option<f64> {
        (self.entry().value)(mse, parameters as f64, samples as f64)
    }
}

impl fmt::Display for InformationCriterion {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.word())
    }
}

impl FromStr for InformationCriterion {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        Self::all().find(|criterion| criterion.word() == text).ok_or_else(|| {
            let words: Vec<&str> = Self::all().map(Self::word).collect();
            Error::argument("criterion", format!("'{text}' is none; there are {}", words.join(", ")))
        })
    }
}

/// All information criteria of a model. A document has them by their words, with null where one is not defined.
///
/// ```
/// use thetahat::estimate::{Criteria, InformationCriterion};
///
/// let criteria = Criteria::new(1.6575, 6, 300);
/// assert!((criteria.of(InformationCriterion::FPE).unwrap() - 1.7252).abs() < 5e-5);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Criteria([Option<f64>; TABLE.len()]);

impl Criteria {
    /// Those of a model with `parameters` parameters and mean square error `mse` over `samples` samples.
    pub fn new(mse: f64, parameters: usize, samples: usize) -> Self {
        Self(std::array::from_fn(|k| InformationCriterion(k).value(mse, parameters, samples)))
    }

    /// The value of one; none where it is not defined.
    pub fn of(&self, criterion: InformationCriterion) -> Option<f64> {
        self.0[criterion.0]
    }
}

impl Serialize for Criteria {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(TABLE.len()))?;
        for criterion in InformationCriterion::all() {
            map.serialize_entry(criterion.word(), &self.of(criterion))?;
        }
        map.end()
    }
}

impl<'de> Deserialize<'de> for Criteria {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Values;

        impl<'de> Visitor<'de> for Values {
            type Value = Criteria;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("information criteria by their words")
            }

            /// Other keys are those of others, where it stands among them.
            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Criteria, A::Error> {
                let mut values = [None; TABLE.len()];
                while let Some(key) = map.next_key::<String>()? {
                    match TABLE.iter().position(|entry| entry.word == key) {
                        Some(place) => values[place] = map.next_value()?,
                        None => drop(map.next_value::<IgnoredAny>()?),
                    }
                }
                Ok(Criteria(values))
            }
        }

        deserializer.deserialize_map(Values)
    }
}

impl JsonSchema for Criteria {
    fn inline_schema() -> bool {
        true
    }

    fn schema_name() -> std::borrow::Cow<'static, str> {
        "Criteria".into()
    }

    fn json_schema(_: &mut SchemaGenerator) -> Schema {
        let of = |entry: &Entry| {
            let schema = json_schema!({
                "description": format!("{}: {}; null where it is not defined.", entry.name, entry.says),
                "type": ["number", "null"],
            });
            (entry.word.to_owned(), schema.to_value())
        };
        let properties: serde_json::Map<String, serde_json::Value> = TABLE.iter().map(of).collect();
        json_schema!({ "type": "object", "properties": properties })
    }
}

#[cfg(test)]
mod tests;
