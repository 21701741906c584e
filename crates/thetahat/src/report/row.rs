//! What a report and a validation say in one line of a table of many.

use super::{Report, Validation};
use crate::Row;
use crate::model::{Model, Quantity};
use crate::respond::Horizon;
use crate::validate::{Fit, Part};

/// A model with more parameters than this has none of them in a table: its report has them.
const MOST: usize = 64;

impl Report {
    /// What a table of many models says of this one: what it is called and was fitted to, how well it fits, static
    /// gains and the longest time constant with their standard errors, and then the parameters with theirs, unless
    /// there are more than 64. Cells without a value are left out. A figure of one output among several, or of one
    /// input, ends with its name.
    ///
    /// ```
    /// use thetahat::Cell;
    /// use thetahat::data::{Channel, Log};
    /// use thetahat::model::Orders;
    /// use thetahat::report::{Plan, identify};
    ///
    /// let u: Vec<f64> = (0..200).map(|t| f64::from(t * t % 7)).collect();
    /// let y = [vec![0.0], u[..199].to_vec()].concat();
    /// let channel = |name: &str, values| Channel { name: name.into(), values };
    /// let log = Log::new(vec![channel("u", u), channel("y", y)], 0.1)?;
    /// let row = identify(log, &[], &Plan::new(&["u"], "y", Orders::arx(0, &[1], &[1])?))?.row();
    /// assert_eq!(row.get("model"), Some(&Cell::Text("ARX(0, 1, 1)".into())));
    /// assert_eq!(row.get("rows"), Some(&Cell::Count(200)));
    /// assert!(matches!(row.get("b1"), Some(Cell::Number(b1)) if (b1 - 1.0).abs() < 1e-9));
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn row(&self) -> Row {
        let mut row = Row::default();
        row.text("model", self.model.name());
        row.count("rows", self.data.rows);
        row.count("samples", self.estimation.samples);
        row.number("sample_time", self.model.sample_time());
        row.count("missing", self.data.missing.iter().map(|missing| missing.rows).sum());
        row.number("mse", self.estimation.mse);
        row.number("condition", self.estimation.condition);
        fits(&mut row, &self.fit, self.model.outputs().len() > 1);
        dynamics(&mut row, &self.model);
        let parameters = self.model.parameters();
        for parameter in parameters.iter().filter(|_| parameters.len() <= MOST) {
            let found = Quantity::new(parameter.value, parameter.standard_error);
            quantity(&mut row, &parameter.name, Some(&found));
        }
        row
    }
}

impl Validation {
    /// What a table of many validations says of this one: how well the model fits, one step ahead, some steps ahead and
    /// in a free run, the p-values of the tests of its residuals, its errors over those it expects, and how often its
    /// 95 % intervals hold one step ahead. Cells without a value are left out. A figure of one output among several, or
    /// of one input, ends with its name.
    pub fn row(&self) -> Row {
        let mut row = Row::default();
        row.text("model", &self.model);
        row.count("rows", self.logs.last().map_or(0, |log| log.rows.last()));
        let several = self.noise.len() > 1;
        fits(&mut row, &self.fit, several);
        for noise in &self.noise {
            row.number(&of("noise_ratio", several, &noise.output), noise.ratio);
        }
        for coverage in self.coverage.iter().filter(|coverage| (coverage.steps, coverage.level) == (1, 0.95))
        {
            row.number(&of("coverage", several, &coverage.output), coverage.actual);
        }
        for residuals in &self.residuals {
            row.number(&of("whiteness_p_value", several, &residuals.output), residuals.ljung_box.p_value);
            for independence in &residuals.independence {
                let name = of("independence_p_value", several, &residuals.output);
                row.number(&of(&name, true, &independence.input), independence.past.p_value);
            }
        }
        row
    }
}

/// A name, with that of the channel that it is about behind it.
fn of(figure: &str, ends_with_it: bool, channel: &str) -> String {
    if ends_with_it { format!("{figure}_{channel}") } else { figure.to_owned() }
}

/// How well a model fits, in percent, and its root mean square errors.
fn fits(row: &mut Row, fits: &[Fit], several: bool) {
    for fit in fits {
        let part = match fit.part {
            Some(Part::Validation) => "validation_",
            Some(Part::Test) => "test_",
            Some(Part::Estimation) | None => "",
        };
        let horizon = match fit.horizon {
            Horizon::Steps { steps } => steps.to_string(),
            Horizon::FreeRun => "free_run".to_owned(),
        };
        row.number(&of(&format!("{part}fit_{horizon}"), several, &fit.output), fit.percent);
        row.number(&of(&format!("{part}rmse_{horizon}"), several, &fit.output), fit.rmse);
    }
}

/// Whether a model is stable, its static gains and its longest time constant.
fn dynamics(row: &mut Row, model: &Model) {
    if let Some(stable) = model.stability() {
        row.add("stable", crate::Cell::Flag(stable));
    }
    for (gains, output) in model.static_gains().unwrap_or_default().into_iter().zip(model.outputs()) {
        for (gain, input) in gains.iter().zip(model.inputs()) {
            let name = of("dc_gain", model.inputs().len() > 1, &input.name);
            quantity(row, &of(&name, model.outputs().len() > 1, &output.name), gain.as_ref());
        }
    }
    let constants = model.time_constants().unwrap_or_default();
    let longest = constants.iter().flatten().max_by(|one, other| one.value.total_cmp(&other.value));
    quantity(row, "time_constant", longest);
}

/// A figure and its standard error.
fn quantity(row: &mut Row, name: &str, quantity: Option<&Quantity>) {
    if let Some(Quantity { value, standard_error, .. }) = quantity {
        row.number(name, *value);
        row.number(&format!("{name}_error"), *standard_error);
    }
}
