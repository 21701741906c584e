use std::ops::Range;

/// A response to a record.
#[derive(Debug, Clone, PartialEq)]
pub struct Response {
    /// One value for each sample, in deviations like the record; NaN where there is none.
    pub values: Vec<f64>,
    /// The samples that the response covers and that have a measured output, as 0-based ranges.
    pub counted: Vec<Range<usize>>,
}

impl Response {
    pub(super) fn empty(samples: usize) -> Self {
        Self { values: vec![f64::NAN; samples], counted: Vec::new() }
    }
}
