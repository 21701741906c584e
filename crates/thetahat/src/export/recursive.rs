//! Recursive least squares, and their extension by C, that go on from a fit: types of the core, started from the fit's parameters, its
//! covariance over its noise variance, its noise variance and number of samples, as [`Tracker::from_report`](crate::track::Tracker::from_report)
//! has it.

use thetahat_core::nalgebra::{DMatrix, DVector, Dyn, convert};
use thetahat_core::{
    ArmaxMethod, ArmaxOrders, ArxOrders, Covariance, Forgetting, InputOrders, Real, RecursiveArmax,
    RecursiveArx,
};

use super::head::Head;
use super::program::Program;
use super::rust::type_name;
use super::signals::levels;
use super::vector::Columns;
use super::writer::Writer;
use super::{Exported, ExportedFile, Language, Plan, Precision};
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

    /// The module.
    fn file(&self, plan: &Plan, head: &Head) -> ExportedFile {
        let program = Program::default();
        let writer = Writer::new(&program, Language::Rust, plan.precision);
        let (real, name) = (writer.real(), type_name(&plan.name));
        let armax = self.orders.nc > 0;
        let (kind, orders, of_c, imports) = match armax {
            true => (
                "RecursiveArmax",
                "ArmaxOrders",
                format!("nc: {}, ", self.orders.nc),
                "ArmaxMethod, ArmaxOrders",
            ),
            false => ("RecursiveArx", "ArxOrders", String::new(), "ArxOrders"),
        };
        let (count, inputs, delays) = (self.parameters.len(), self.offsets.inputs.len(), self.delays());
        let input_orders: Vec<String> = self
            .input_orders()
            .iter()
            .map(|own| format!("InputOrders {{ nb: {}, nk: {} }}", own.nb, own.nk))
            .collect();
        let input_orders_used = if inputs > 0 { "InputOrders, " } else { "" };
        let numbers = |values: &[f64]| writer.numbers(values, "");
        let rows: Vec<String> = self
            .factor
            .row_iter()
            .map(|row| {
                format!("    {},\n", numbers(&row.iter().copied().collect::<Vec<_>>()).replace('\n', " "))
            })
            .collect();
        let (method, noise) = match armax {
            true => {
                ("ArmaxMethod::PredictionError, ", format!("{}, ", writer.number(self.noise_variance.sqrt())))
            }
            false => ("", String::new()),
        };
        let mut text = head.comments();
        text += &format!(
            "\nuse thetahat_core::nalgebra::{{Const, SMatrix, SVector}};\nuse thetahat_core::{{{imports}, Covariance, Error, Forgetting, {input_orders_used}Innovation, {kind}}};\n\n"
        );
        text += &format!(
            "/// The orders.\npub const ORDERS: {orders}<'static> = {orders} {{ na: {}, inputs: &[{}], {of_c}constant: false }};\n\n",
            self.orders.na,
            input_orders.join(", ")
        );
        text += &format!(
            "/// What the inputs are measured from.\npub const U_OFFSET: [{real}; {inputs}] = {};\n\n",
            numbers(&self.offsets.inputs)
        );
        text += &format!(
            "/// What the output is measured from.\npub const Y_OFFSET: {real} = {};\n\n",
            writer.number(self.offsets.output)
        );
        text += &format!(
            "/// The typical magnitudes of the inputs.\nconst U_SCALE: [{real}; {inputs}] = {};\n\n",
            numbers(&self.scales.inputs)
        );
        text += &format!(
            "/// That of the output.\nconst Y_SCALE: {real} = {};\n\n",
            writer.number(self.scales.output)
        );
        text += &format!(
            "/// The parameters of the fit.\npub const PARAMETERS: [{real}; {count}] = {};\n\n",
            numbers(&self.parameters)
        );
        text += &format!(
            "/// Their covariance over the noise variance, factored as `Covariance::factor` has it.\nconst FACTOR: [[{real}; {count}]; {count}] = [\n{}];\n\n",
            rows.concat()
        );
        text += &format!(
            "/// The estimator of the core, of deviations from the offsets.\npub type Estimator = {kind}<{real}, Const<{count}>, Const<{delays}>>;\n\n"
        );
        text += &format!(
            "/// The estimator, of signals in their own units.\n#[derive(Clone, Debug)]\npub struct {name} {{\n    /// Of deviations from the offsets.\n    pub estimator: Estimator,\n}}\n\n\
             impl {name} {{\n    /// Goes on from the fit.\n    ///\n    /// Errors: those of the core for a way to forget.\n    \
             pub fn new(forgetting: Forgetting<{real}>) -> Result<Self, Error> {{\n        \
             let factor = SMatrix::<{real}, {count}, {count}>::from_fn(|row, column| FACTOR[row][column]);\n        \
             let estimator = Estimator::new(&ORDERS, {method}Y_SCALE, &U_SCALE, {noise}forgetting)?\n            \
             .with_parameters(SVector::from(PARAMETERS))?\n            \
             .with_covariance(Covariance::from_factor(factor)?)?\n            \
             .with_noise_variance({}, {})?;\n        Ok(Self {{ estimator }})\n    }}\n\n",
            writer.number(self.noise_variance),
            self.samples
        );
        text += &format!(
            "    /// y(k) arrives: see `measured` of the estimator.\n    pub fn measured(&mut self, y: {real}) -> Result<Innovation<{real}>, Error> {{\n        \
             self.estimator.measured(y - Y_OFFSET)\n    }}\n\n    \
             /// u(k) acts from now on: see `applied` of the estimator.\n    pub fn applied(&mut self, u: &[{real}; {inputs}]) -> Result<(), Error> {{\n        \
             self.estimator.applied(&deviations(u))\n    }}\n\n    \
             /// One row of a log, y(k) and u(k) at the same instant: see `log_row` of the estimator.\n    \
             pub fn log_row(&mut self, y: {real}, u: &[{real}; {inputs}]) -> Result<Innovation<{real}>, Error> {{\n        \
             self.estimator.log_row(y - Y_OFFSET, &deviations(u))\n    }}\n}}\n\n\
             fn deviations(u: &[{real}; {inputs}]) -> [{real}; {inputs}] {{\n    core::array::from_fn(|input| u[input] - U_OFFSET[input])\n}}\n"
        );
        ExportedFile { name: format!("{}.rs", plan.name), text }
    }
}

/// The module, and with rows of a log what its errors are along them if nothing is forgotten.
///
/// # Errors
/// [`Error::Report`] for a model that cannot be tracked; [`Error::Argument`] for C; those of rows and channels.
pub(super) fn exported(
    report: &Report,
    plan: &Plan,
    log: Option<(&Log, &[Rows])>,
) -> Result<Exported, Error> {
    let start = Start::new(report)?;
    if plan.language == Language::C {
        return Err(Error::argument("to", "recursive estimators are types of thetahat-core; take rust"));
    }
    let equations = [format!("{}, {}", start.orders, start.orders.equation())];
    let head = Head::new(report, plan, &equations, "from what the fit knows, with empty delay lines")?;
    let mut files = vec![start.file(plan, &head)];
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
        files.push(check(plan, &columns, &errors));
    }
    Ok(Exported { files, warnings: Vec::new() })
}

/// A program that steps along the rows, and panics where an error is another.
fn check(plan: &Plan, columns: &Columns, errors: &[f64]) -> ExportedFile {
    let program = Program::default();
    let writer = Writer::new(&program, Language::Rust, plan.precision);
    let (real, name, rows, inputs) = (writer.real(), &plan.name, columns.rows(), columns.inputs.len());
    let mut text = format!(
        "// Steps {name}.rs along the rows of {name}.csv, where expected1 is the error of each, and panics if one is wrong.\n\n\
         #[path = \"{name}.rs\"]\nmod {name};\n\nuse thetahat_core::{{Error, Forgetting}};\n\n\
         /// u(k), y(k) and the error.\nstatic ROWS: [([{real}; {inputs}], {real}, {real}); {rows}] = [\n"
    );
    for (row, error) in errors.iter().enumerate() {
        let u: Vec<f64> = columns.inputs.iter().map(|column| column[row]).collect();
        let u: Vec<String> = u.iter().map(|value| writer.number(*value)).collect();
        text += &format!(
            "    ([{}], {}, {}),\n",
            u.join(", "),
            writer.number(columns.measured[0][row]),
            writer.number(*error)
        );
    }
    text += &format!(
        "];\n\n/// Whether two errors are the same; none is known as long as the delay lines are not full.\n\
         fn same(found: {real}, expected: {real}) -> bool {{\n    found == expected || found.is_nan() && expected.is_nan()\n}}\n\n\
         fn main() -> Result<(), Error> {{\n    let mut model = {name}::{}::new(Forgetting::None)?;\n    let mut online = model.clone();\n    \
         for (row, (u, y, expected)) in ROWS.iter().enumerate() {{\n        \
         let found = model.log_row(*y, u)?.error;\n        \
         assert!(same(found, *expected), \"row {{}}: {{found}} is not {{expected}}\", row + 1);\n        \
         // As a controller calls it, where no input acts in its own sample.\n        \
         if let Ok(innovation) = online.measured(*y) {{\n            \
         assert!(same(innovation.error, *expected), \"row {{}}: measured, {{}}\", row + 1, innovation.error);\n            \
         online.applied(u)?;\n        }}\n    }}\n    Ok(())\n}}\n",
        type_name(name)
    );
    ExportedFile { name: format!("{name}_test.rs"), text }
}
