//! Reports of models that nobody estimated.

use super::Report;
use super::schema::{Data, Estimation};
use crate::estimate::{Criteria, Procedure};
use crate::model::Model;

impl Report {
    /// A report of a model whose numbers were given: it has no data and no figures of a fit. All verbs take it, as they
    /// take the report of a fit.
    ///
    /// ```
    /// use thetahat::model::{ChannelNames, Model, Polynomials};
    /// use thetahat::report::Report;
    ///
    /// let known = Polynomials { b: vec![vec![0.0, 1.0]], f: vec![vec![1.0, -0.9]], ..Polynomials::default() };
    /// let channels = ChannelNames { inputs: vec!["u".into()], outputs: vec!["y".into()] };
    /// let report = Report::of_known(Model::from_polynomials(&known, &channels, 0.0, 1.0)?);
    /// assert!(report.estimation.procedure.is_given() && report.fit.is_empty());
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn of_known(model: Model) -> Self {
        let data = Data {
            logs: Vec::new(),
            digests: Default::default(),
            rows: 0,
            sample_time: model.sample_time(),
            detrend: "none".to_owned(),
            prefilter: None,
            estimation: Vec::new(),
            validation: Vec::new(),
            split: None,
            segments: Vec::new(),
            missing: Vec::new(),
            time_gaps: 0,
        };
        let estimation = Estimation {
            procedure: Procedure::given(),
            initial: None,
            level: None,
            slope: None,
            samples: 0,
            mse: 0.0,
            criteria: Criteria::new(f64::NAN, 0, 0),
            condition: None,
        };
        Self::new(data, model, estimation)
    }
}
