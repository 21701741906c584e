//! Recursive least squares, and their extension by C, that go on from a fit: types of the core, and what is theirs in
//! its interface in C, started from the fit's parameters, its covariance over its noise variance, its noise variance
//! and number of samples, as [`Tracker::from_report`](crate::track::Tracker::from_report) has it.

mod c;
mod rust;

use thetahat_core::nalgebra::{DMatrix, DVector, Dyn, convert};
use thetahat_core::{
    ArmaxMethod, ArmaxOrders, ArxOrders, Covariance, Forgetting, InputOrders, Real, RecursiveArmax,
    RecursiveArx,
};

use super::head::Head;
use super::signals::levels;
use super::vector::Columns;
use super::{Exported, Language, Plan, Precision};
use crate::Error;
use crate::data::{Log, Rows};
use crate::model::Orders;
use crate::report::Report;
use crate::track::{PerChannel, polynomials, relative, scales};

/// What an estimator starts from.
struct Start {
    orders: Orders,
    offsets: PerChannel,
    scales: PerChannel,
    parameters: Vec<f64>,
    /// P, factored.
    factor: DMatrix<f64>,
    noise_variance: f64,
    samples: usize,
}

impl Start {
    fn new(report: &Report) -> Result<Self, Error> {
        let model = polynomials(report)?;
        let unusable = |error| Error::report(format!("the report cannot be tracked: {error}"));
        let relative = relative(model)?;
        let output = levels(std::slice::from_ref(&model.output))?;
        Ok(Self {
            orders: model.orders.clone(),
            offsets: PerChannel { inputs: levels(&model.inputs)?, output: output.into_iter().sum() },
            scales: scales(&model.orders, &relative, report.estimation.samples),
            parameters: model.parameters.iter().map(|parameter| parameter.value).collect(),
            factor: Covariance::new(&relative).map_err(unusable)?.factor(),
            noise_variance: model.noise_variance,
            samples: report.estimation.samples,
        })
    }

    /// Its numbers, with what they are.
    fn constants(&self) -> [(&str, &[f64]); 7] {
        [
            ("the parameters", &self.parameters),
            ("their covariance", self.factor.as_slice()),
            ("the noise variance", std::slice::from_ref(&self.noise_variance)),
            ("the scale of an input", &self.scales.inputs),
            ("the scale of the output", std::slice::from_ref(&self.scales.output)),
            ("the offset of an input", &self.offsets.inputs),
            ("the offset of the output", std::slice::from_ref(&self.offsets.output)),
        ]
    }

    fn input_orders(&self) -> Vec<InputOrders> {
        self.orders.nb.iter().zip(&self.orders.nk).map(|(&nb, &nk)| InputOrders { nb, nk }).collect()
    }

    fn delays(&self) -> usize {
        let inputs = self.input_orders();
        ArxOrders { na: self.orders.na, inputs: &inputs, constant: false }.delays().max(1)
    }

    /// The errors of the estimator along rows without forgetting, NaN where there is none.
    fn errors<T: Real>(&self, columns: &Columns) -> Result<Vec<f64>, thetahat_core::Error> {
        let real = |value: f64| -> T { convert(value) };
        let inputs = self.input_orders();
        let scales: Vec<T> = self.scales.inputs.iter().map(|scale| real(*scale)).collect();
        let output = real(self.scales.output);
        let covariance = Covariance::from_factor(self.factor.map(real))?;
        let parameters =
            DVector::from_iterator(self.parameters.len(), self.parameters.iter().map(|one| real(*one)));
        let (na, nc, variance) = (self.orders.na, self.orders.nc, real(self.noise_variance));
        let offsets: Vec<T> = self.offsets.inputs.iter().map(|level| real(*level)).collect();
        let level = real(self.offsets.output);
        let row = |row: usize| -> (T, Vec<T>) {
            let deviation = |(column, offset): (&Vec<f64>, &T)| real(column[row]) - *offset;
            (
                real(columns.measured[0][row]) - level,
                columns.inputs.iter().zip(&offsets).map(deviation).collect(),
            )
        };
        let number = |error: T| error.to_subset().unwrap_or(f64::NAN);
        let rows = 0..columns.rows();
        if nc == 0 {
            let orders = ArxOrders { na, inputs: &inputs, constant: false };
            let mut estimator = RecursiveArx::<T, Dyn, Dyn>::new(&orders, output, &scales, Forgetting::None)?
                .with_parameters(parameters)?
                .with_covariance(covariance)?
                .with_noise_variance(variance, self.samples)?;
            return rows.map(row).map(|(y, u)| Ok(number(estimator.log_row(y, &u)?.error))).collect();
        }
        let orders = ArmaxOrders { na, inputs: &inputs, nc, constant: false };
        let (method, noise) = (ArmaxMethod::PredictionError, real(self.noise_variance.sqrt()));
        let mut estimator =
            RecursiveArmax::<T, Dyn, Dyn>::new(&orders, method, output, &scales, noise, Forgetting::None)?
                .with_parameters(parameters)?
                .with_covariance(covariance)?
                .with_noise_variance(variance, self.samples)?;
        rows.map(row).map(|(y, u)| Ok(number(estimator.log_row(y, &u)?.error))).collect()
    }
}

/// The source, and with rows of a log what its errors are along them if nothing is forgotten.
///
/// # Errors
/// [`Error::Report`] for a model that cannot be tracked; [`Error::Argument`] for one that is larger than those of C;
/// those of rows and channels.
pub(super) fn exported(
    report: &Report,
    plan: &Plan,
    log: Option<(&Log, &[Rows])>,
) -> Result<Exported, Error> {
    let start = Start::new(report)?;
    plan.precision.check(start.constants())?;
    if plan.language == Language::C {
        c::check_sizes(&start)?;
    }
    let equations = [format!("{}, {}", start.orders, start.orders.equation())];
    let head = Head::new(report, plan, &equations, "from what the fit knows, with empty delay lines")?;
    let mut files = match plan.language {
        Language::C => c::files(&start, plan, &head),
        Language::Rust => vec![rust::file(&start, plan, &head)],
    };
    if let Some((log, rows)) = log {
        crate::report::check_sample_time(&report.model, log)?;
        let columns = Columns::new(&report.model, log, rows, true)?;
        let errors = match plan.precision {
            Precision::F64 => start.errors::<f64>(&columns),
            Precision::F32 => start.errors::<f32>(&columns),
        };
        let errors = errors
            .map_err(|error| Error::data(format!("no test vector can be made along these rows: {error}")))?;
        files.push(columns.csv(&plan.name, std::slice::from_ref(&errors)));
        files.push(match plan.language {
            Language::C => c::check(&start, plan, &columns, errors),
            Language::Rust => rust::check(plan, &columns, &errors),
        });
    }
    Ok(Exported { files, warnings: Vec::new() })
}
