use thetahat_core::Action;

/// Some numbers, and how certain they are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StateValues<'a> {
    /// The estimates.
    pub values: &'a [f64],
    /// Their standard deviations; none from an observer, which knows no noise, and where noise is bounded.
    pub standard_deviations: Option<&'a [f64]>,
    /// How far at most the numbers are from the estimates, where noise is bounded.
    pub bounds: Option<&'a [f64]>,
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
    pub predicted: StateValues<'a>,
    /// The state given this row too. None from an observer: in predictor form a measurement corrects the state of the
    /// next row.
    pub filtered: Option<StateValues<'a>>,
    /// The unknown parameters, in their own units, given this row too. Empty if there are none. Their standard
    /// deviations are those to first order, |dp/dz| times that of z.
    pub parameters: StateValues<'a>,
    /// The outputs as predicted, with the standard deviations or the bounds of the innovations.
    pub outputs: StateValues<'a>,
    /// The outputs less their predictions; NaN where one is missing.
    pub innovations: &'a [f64],
    /// How many outputs of this row are there.
    pub measured: usize,
    /// The normalised innovation squared: chi-square with `measured` degrees of freedom if the model is right. None if
    /// nothing was measured, and from an observer.
    pub nis: Option<f64>,
    /// Between which it lies in 95 % of the rows if the model is right.
    pub nis_bounds: Option<(f64, f64)>,
    /// The log-likelihood of this row given those before. 0 if nothing was measured; none from an observer.
    pub log_likelihood: Option<f64>,
    /// Where noise is bounded, the output, from 0, that no state of the set explains: a noise has left its bound, a
    /// sensor has failed, or the model is wrong. The measurement of this row was not used then.
    pub contradiction: Option<usize>,
    /// What was done with the measurement.
    pub action: Action,
    /// Which inputs are missing in this row, so that their last value was held.
    pub held: &'a [bool],
}
