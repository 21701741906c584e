//! How samples are written where NaN is a missing one: as `null`, as JSON has no NaN.

/// For `#[serde(with)]` on one sample.
pub(super) mod number {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(in crate::track) fn serialize<S: Serializer>(sample: &f64, serializer: S) -> Result<S::Ok, S::Error> {
        (!sample.is_nan()).then_some(sample).serialize(serializer)
    }

    pub(in crate::track) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
        Ok(Option::deserialize(deserializer)?.unwrap_or(f64::NAN))
    }
}

/// For `#[serde(with)]` on several.
pub(super) mod vector {
    use serde::{Deserialize, Deserializer, Serializer};

    pub(in crate::track) fn serialize<S: Serializer>(
        samples: &[f64],
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(samples.iter().map(|sample| (!sample.is_nan()).then_some(sample)))
    }

    pub(in crate::track) fn deserialize<'de, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<Vec<f64>, D::Error> {
        let samples = Vec::<Option<f64>>::deserialize(deserializer)?;
        Ok(samples.into_iter().map(|sample| sample.unwrap_or(f64::NAN)).collect())
    }
}
