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

    /// The values of a signal at these samples, and none elsewhere.
    pub(super) fn of_signal(signal: &[f64], counted: Vec<Range<usize>>) -> Self {
        let mut values = signal.to_vec();
        let mut ordered: Vec<&Range<usize>> = counted.iter().collect();
        ordered.sort_unstable_by_key(|rows| rows.start);
        let mut end = 0;
        for rows in ordered {
            values[end..rows.start.max(end)].fill(f64::NAN);
            end = end.max(rows.end);
        }
        values[end..].fill(f64::NAN);
        Self { values, counted }
    }

    /// The response that has these values at these samples.
    pub(super) fn of_runs(
        samples: usize,
        mut runs: Vec<(Range<usize>, Vec<f64>)>,
        counted: Vec<Range<usize>>,
    ) -> Self {
        // Over all samples it is the values as they are: new memory takes longer to get than to fill.
        if let Some((_, values)) = runs.pop_if(|(rows, _)| *rows == (0..samples)) {
            return Self { values, counted };
        }
        let mut response = Self { counted, ..Self::empty(samples) };
        runs.into_iter().for_each(|(rows, values)| response.values[rows].copy_from_slice(&values));
        response
    }
}
