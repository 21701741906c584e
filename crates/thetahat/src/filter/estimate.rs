use thetahat_core::Action;

/// Some numbers, and how certain they are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Values<'a> {
    /// The estimates.
    pub values: &'a [f64],
    /// Their standard deviations; none from an observer, which knows no noise.
    pub standard_deviations: Option<&'a [f64]>,
}

/// What a filter knows after a row.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct StateEstimate<'a> {
    /// The row, counted from 1.
    pub row: usize,
    /// Seconds since the first row.
    pub time: f64,
    /// The state given all rows before.
    pub predicted: Values<'a>,
    /// The state given this row too. None from an observer: in predictor form a measurement corrects the state of the next
    /// row.
    pub filtered: Option<Values<'a>>,
    /// The unknown parameters, in their own units, given this row too. Empty if there are none. Their standard deviations are
    /// those to first order, |dp/dz| times that of z.
    pub parameters: Values<'a>,
    /// The outputs as predicted, with the standard deviations of the innovations.
    pub outputs: Values<'a>,
    /// The outputs less their predictions; NaN where one is missing.
    pub innovations: &'a [f64],
    /// How many outputs of this row are there.
    pub measured: usize,
    /// The normalised innovation squared: chi-square with `measured` degrees of freedom if the model is right. None if nothing
    /// was measured, and from an observer.
    pub nis: Option<f64>,
    /// Between which it lies in 95 % of the rows if the model is right.
    pub nis_bounds: Option<(f64, f64)>,
    /// The log-likelihood of this row given those before. 0 if nothing was measured; none from an observer.
    pub log_likelihood: Option<f64>,
    /// What was done with the measurement.
    pub action: Action,
    /// Which inputs are missing in this row, so that their last value was held.
    pub held: &'a [bool],
}

/// What a filter has seen so far.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Totals {
    /// The rows.
    pub rows: usize,
    /// The elements of measurements that were there.
    pub measured: usize,
    /// The sum of the log-likelihoods; 0 from an observer.
    pub log_likelihood: f64,
    /// How many rows have a normalised innovation squared.
    pub nis_rows: usize,
    /// How many of these lie below the bounds that hold 95 %: 2.5 % of a right model.
    pub nis_below: usize,
    /// How many lie above: 2.5 % of a right model.
    pub nis_above: usize,
    /// The mean of the normalised innovation squared over these rows, which a right model has near `measured / nis_rows`.
    /// NaN without rows.
    pub mean_nis: f64,
}

impl Totals {
    /// Before the first row.
    pub(super) fn none() -> Self {
        Self {
            rows: 0,
            measured: 0,
            log_likelihood: 0.0,
            nis_rows: 0,
            nis_below: 0,
            nis_above: 0,
            mean_nis: f64::NAN,
        }
    }

    /// One more row.
    pub(super) fn add(&mut self, row: &StateEstimate<'_>) {
        self.rows += 1;
        self.measured += row.measured;
        self.log_likelihood += row.log_likelihood.unwrap_or(0.0);
        if let (Some(nis), Some((low, high))) = (row.nis, row.nis_bounds) {
            self.nis_rows += 1;
            self.nis_below += usize::from(nis < low);
            self.nis_above += usize::from(nis > high);
            let mean = if self.nis_rows == 1 { 0.0 } else { self.mean_nis };
            self.mean_nis = mean + (nis - mean) / self.nis_rows as f64;
        }
    }
}
