//! ARX models with several outputs, by least squares from one Gram matrix.

mod sums;
#[cfg(test)]
mod tests;

use std::fmt;
use std::ops::RangeInclusive;
use std::str::FromStr;

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::{DMatrix, DVector};

use super::subspace::{Factor, LaggedProducts, ROUNDING, SubspaceData, divided, log_determinant};
use crate::Error;
use crate::data::JointRecord;
use crate::model::{Entry, EntryCovariance, Quantity, StateSpace, StateSpaceMatrix, lag_name};
pub(crate) use sums::vector_arx_of_sums;

/// More models of more coefficients are not compared: these are a minute or two.
const MOST_WORK: f64 = 2e12;
/// Of more entries a report does not keep the covariance, a number for each two.
const MOST_ENTRIES: usize = 300;

/// Which past outputs an output depends on.
///
/// ```
/// use thetahat::estimate::Coupling;
///
/// assert_eq!("none".parse::<Coupling>()?, Coupling::None);
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Coupling {
    /// On those of all: A_1, A_2, … are full.
    Full,
    /// On its own: A_1, A_2, … are diagonal.
    None,
}

impl Coupling {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Full, Self::None];

    /// The word for it in options and documents.
    pub fn word(self) -> &'static str {
        match self {
            Self::Full => "full",
            Self::None => "none",
        }
    }
}

impl fmt::Display for Coupling {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.pad(self.word())
    }
}

impl FromStr for Coupling {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        Self::ALL.into_iter().find(|coupling| coupling.word() == text).ok_or_else(|| {
            Error::argument(
                "couple",
                format!("'{text}' is neither full nor none; take one of these, or auto"),
            )
        })
    }
}

/// Among which ARX models with several outputs the least MDL chooses.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct VectorArxOptions {
    /// The number of past samples of the outputs, chosen from this range.
    pub na: RangeInclusive<usize>,
    /// How many past samples of the inputs: a range for all of them, or a number for each.
    pub nb: VectorArxInputs,
    /// Which past outputs an output depends on; none: decided from the data.
    pub coupling: Option<Coupling>,
    /// The additional delay of all inputs in samples, chosen from this range.
    pub delay: RangeInclusive<usize>,
    /// Whether inputs act in the same sample, so that the first of their coefficients is that of u(t).
    pub direct: bool,
    /// Whether there is a constant in each equation; in a [`StateSpacePlan`](crate::report::StateSpacePlan) its own
    /// field `constant` decides.
    pub constant: bool,
}

/// How many past samples of its inputs an ARX model has.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum VectorArxInputs {
    /// The same number for all inputs, chosen from this range.
    Alike(RangeInclusive<usize>),
    /// A number for each input.
    Each(Vec<usize>),
}

/// How well a model predicts, of those that were compared.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct VectorArxScore {
    /// How many past samples of the outputs it has.
    pub na: usize,
    /// How many of each input.
    pub nb: Vec<usize>,
    /// Samples from each input to its first effect.
    #[serde(default)]
    pub nk: Vec<usize>,
    /// Which past outputs an output depends on.
    pub coupling: Coupling,
    /// MDL of its errors.
    pub mdl: f64,
}

/// An ARX model with several outputs as it was found.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct VectorArxOutcome {
    /// How many past samples of the outputs it has.
    pub na: usize,
    /// How many of each input.
    pub nb: Vec<usize>,
    /// Samples from each input to its first effect.
    pub nk: Vec<usize>,
    /// Which past outputs an output depends on.
    pub coupling: Coupling,
    /// Whether the levels of the outputs were estimated with the coefficients; they are part of the outputs' offsets.
    pub constant: bool,
    /// A_1, A_2, …, each with a row and a column for each output, with standard errors; without coupling, what is off
    /// the diagonal is zero and has none.
    pub a: Vec<Vec<Vec<Quantity>>>,
    /// For each input its coefficients, from its first effect on, each a list for the outputs.
    pub b: Vec<Vec<Vec<Quantity>>>,
    /// The models that were compared, in the order in which they were evaluated; empty if there was but one.
    pub tried: Vec<VectorArxScore>,
}

/// What was estimated: coefficients, and the model in state space that has them.
#[derive(Debug, Clone)]
pub(crate) struct VectorArxEstimate {
    pub(crate) outcome: VectorArxOutcome,
    pub(crate) space: StateSpace,
    /// None where there are too many entries for a report.
    pub(crate) covariance: Option<EntryCovariance>,
    pub(crate) levels: Vec<f64>,
    pub(crate) free_parameters: usize,
    /// Of the model that was taken.
    pub(crate) mdl: f64,
    /// The samples that have errors.
    pub(crate) samples: usize,
    /// By how many samples more all inputs are late.
    pub(crate) delay: usize,
}

/// Fits
///
/// ```text
/// y(t) + A_1 y(t-1) + … + A_na y(t-na) = B_0 u(t) + B_1 u(t-1) + … + c + e(t)
/// ```
///
/// with any number of outputs by least squares. The lagged products of all signals are the normal equations of every
/// order and coupling; a Cholesky factor of some of them, with y(t) last, solves those of all outputs at once where
/// these have the same regressors, and one after the other where each has its own past. Of several models that of the
/// least
///
/// ```text
/// MDL = N ln det cov e + k ln N,   k coefficients
/// ```
///
/// is taken, all on the same rows; where inputs are later than asked, it is solved once more with them moved. With
/// coupling the covariance of the coefficients is cov e (x) (Phi' Phi)^-1, without it of each output alone with e of
/// outputs correlated as cov e says (Lütkepohl, New Introduction to Multiple Time Series Analysis, 2005, section 3.2).
/// cov e has N less the regressors of an output in its denominator.
///
/// The state space is the block observer form, y(t) = x_1(t) + B_0 u(t) + e(t) and
///
/// ```text
/// x_i(t+1) = x_{i+1}(t) - A_i x_1(t) + (B_i - A_i B_0) u(t) - A_i e(t)
/// ```
///
/// (Kailath, Linear Systems, 1980, section 6.4), which predicts as the regression does; its states are in units of the
/// outputs' sizes.
///
/// Cost: O(N q^2 p) for q signals and p lags once, then O((q p)^3) for each model.
///
/// # Errors
/// [`Error::Undetermined`] where there are too few samples, a signal is zero, or regressors depend on one another.
pub(crate) fn vector_arx(
    record: &JointRecord<'_>,
    options: &VectorArxOptions,
    sample_time: f64,
) -> Result<VectorArxEstimate, Error> {
    let products = |delay: usize, longest: usize| {
        let later = record.clone().delayed(&vec![delay; record.inputs.len()]);
        let products = LaggedProducts::new(&later, longest, options.constant);
        products.ok_or_else(|| later.silent(longest))
    };
    of_products(products, |longest| record.samples(longest), record.channels(), options, sample_time)
}

/// The same where `products` gives those of so many lags of a record whose inputs are so many samples late, and
/// `samples` how many of them have so many lags, of so many inputs and outputs.
fn of_products(
    products: impl Fn(usize, usize) -> Result<LaggedProducts, Error>,
    samples: impl Fn(usize) -> usize,
    (inputs, outputs): (usize, usize),
    options: &VectorArxOptions,
    sample_time: f64,
) -> Result<VectorArxEstimate, Error> {
    let models = options.models(inputs);
    if models.is_empty() {
        return Err(Error::argument("na", "the models have no coefficients; ask for one at least"));
    }
    let longest = options.longest(inputs);
    let samples = samples(longest);
    let most = models.iter().map(|model| model.regressors(outputs)).max().unwrap_or(0);
    if samples <= most + 1 {
        return Err(Error::undetermined(
            Vec::new(),
            format!(
                "the largest model has {most} coefficients for each output, and {samples} samples have its {longest} lags before them in \
                 their segment; there must be more: give more rows, or lower orders"
            ),
        ));
    }
    let work = (models.len() as f64) * (most as f64).powi(3);
    if work > MOST_WORK {
        return Err(Error::argument(
            "na",
            format!(
                "there are {} models with up to {most} coefficients for each output to compare, which takes too long; give narrower ranges",
                models.len()
            ),
        ));
    }
    let compared = products(0, longest)?;
    let mut best: Option<(Solved, Orders)> = None;
    let mut tried = Vec::new();
    let mut refusal = None;
    let solved: Vec<(Orders, Result<Solved, Error>)> = models
        .into_par_iter()
        .map(|orders| {
            let solved = Solved::new(&compared, &orders, options.direct);
            (orders, solved)
        })
        .collect();
    for (orders, solved) in solved {
        let solved = match solved {
            Ok(solved) => solved,
            Err(error) => {
                refusal.get_or_insert(error);
                continue;
            }
        };
        let Orders { na, nb, delay, coupling } = orders.clone();
        let nk = vec![delay + usize::from(!options.direct); nb.len()];
        tried.push(VectorArxScore { na, nb, nk, coupling, mdl: solved.mdl });
        if best.as_ref().is_none_or(|(best, _)| solved.mdl < best.mdl) {
            best = Some((solved, orders));
        }
    }
    let nothing = || Error::undetermined(Vec::new(), "there is no model to choose");
    let Some((solved, orders)) = best else { return Err(refusal.unwrap_or_else(nothing)) };
    if tried.len() == 1 {
        tried.clear();
    }
    let (delay, mdl) = (orders.delay, solved.mdl);
    if delay == 0 {
        return Ok(solved.estimate(&compared, &orders, options, (sample_time, tried)));
    }
    let orders = Orders { delay: 0, ..orders };
    let later = products(delay, orders.lags(options.direct))?;
    let solved = Solved::new(&later, &orders, options.direct)?;
    let mut estimate = solved.estimate(&later, &orders, options, (sample_time, tried));
    estimate.outcome.nk.iter_mut().for_each(|nk| *nk += delay);
    Ok(VectorArxEstimate { delay, mdl, ..estimate })
}

/// Of one model.
#[derive(Debug, Clone)]
struct Orders {
    na: usize,
    nb: Vec<usize>,
    /// By how many samples more all inputs are late.
    delay: usize,
    coupling: Coupling,
}

impl Orders {
    /// The longest lag.
    fn lags(&self, direct: bool) -> usize {
        let late = self.delay + usize::from(!direct);
        let inputs = self.nb.iter().map(|nb| if *nb == 0 { 0 } else { nb + late - 1 });
        inputs.chain([self.na]).max().unwrap_or(0)
    }

    /// The coefficients of an output.
    fn regressors(&self, outputs: usize) -> usize {
        self.na * if self.coupling == Coupling::Full { outputs } else { 1 } + self.nb.iter().sum::<usize>()
    }
}

impl VectorArxOptions {
    /// The longest lag of all models with so many inputs.
    pub(crate) fn longest(&self, inputs: usize) -> usize {
        let most = match &self.nb {
            VectorArxInputs::Alike(range) if inputs > 0 => *range.end(),
            VectorArxInputs::Alike(_) => 0,
            VectorArxInputs::Each(each) => each.iter().copied().max().unwrap_or(0),
        };
        let first = self.delay.end().saturating_add(usize::from(!self.direct));
        let of_inputs = most.checked_sub(1).map_or(0, |later| first.saturating_add(later));
        of_inputs.max(*self.na.end())
    }

    fn models(&self, inputs: usize) -> Vec<Orders> {
        let nb: Vec<Vec<usize>> = match &self.nb {
            VectorArxInputs::Alike(range) if inputs > 0 => range.clone().map(|nb| vec![nb; inputs]).collect(),
            VectorArxInputs::Alike(_) => vec![Vec::new()],
            VectorArxInputs::Each(each) => vec![each.clone()],
        };
        let couplings = match self.coupling {
            Some(coupling) => vec![coupling],
            None => Coupling::ALL.to_vec(),
        };
        let mut models = Vec::new();
        for na in self.na.clone() {
            // Without A there is nothing to couple.
            let couplings = if na == 0 { &couplings[..1] } else { &couplings[..] };
            for nb in &nb {
                // Without B there is nothing to be late.
                let delays = if nb.iter().all(|nb| *nb == 0) { 0..=0 } else { self.delay.clone() };
                for delay in delays {
                    let orders = |&coupling| Orders { na, nb: nb.clone(), delay, coupling };
                    models.extend(couplings.iter().map(orders));
                }
            }
        }
        models.retain(|model| model.regressors(1) > 0);
        models
    }
}

/// The equation of an output.
struct Equation {
    /// The places of its regressors among the products.
    places: Vec<usize>,
    /// Their coefficients.
    coefficients: DVector<f64>,
}

impl Equation {
    /// The inverse of the mean products of the regressors.
    fn inverse(&self, products: &LaggedProducts) -> DMatrix<f64> {
        let known = self.places.len();
        let factor = Factor::new(&products.products, &self.places).block(0..known, 0..known);
        let root = divided(DMatrix::identity(known, known), &factor);
        root.tr_mul(&root)
    }
}

/// The entries that a coefficient of an equation moves, with their slopes.
struct Moved {
    output: usize,
    /// Which of its regressors.
    row: usize,
    entries: Vec<(usize, f64)>,
}

/// A model in scaled signals.
struct Solved {
    equations: Vec<Equation>,
    /// The mean products of the errors.
    errors: DMatrix<f64>,
    mdl: f64,
}

impl Solved {
    /// # Errors
    /// [`Error::Undetermined`] where regressors depend on one another.
    fn new(products: &LaggedProducts, orders: &Orders, direct: bool) -> Result<Self, Error> {
        let (m, l, width) = (products.inputs, products.outputs, products.width());
        let first = orders.delay + usize::from(!direct);
        let inputs = orders.nb.iter().enumerate();
        let inputs: Vec<usize> =
            inputs.flat_map(|(input, nb)| (first..first + nb).map(move |lag| lag * width + input)).collect();
        let past = |outputs: std::ops::Range<usize>| {
            (1..=orders.na).flat_map(move |lag| outputs.clone().map(move |output| lag * width + m + output))
        };
        let groups = match orders.coupling {
            Coupling::Full => std::iter::once(0..l).collect::<Vec<_>>(),
            Coupling::None => (0..l).map(|output| output..output + 1).collect(),
        };
        let mut equations: Vec<Equation> = Vec::with_capacity(l);
        for group in groups {
            let places: Vec<usize> = past(group.clone()).chain(inputs.iter().copied()).collect();
            let known = places.len();
            let now = group.clone().map(|output| m + output);
            let all: Vec<usize> = places.iter().copied().chain(now).collect();
            let factor = Factor::new(&products.products, &all);
            let own = factor.block(0..known, 0..known);
            if let Some(column) = (0..known).find(|column| own[(*column, *column)] <= 0.0) {
                let (signal, lag) = (places[column] % width, places[column] / width);
                let name = if signal < m {
                    format!("input {}", signal + 1)
                } else {
                    format!("output {}", signal - m + 1)
                };
                return Err(Error::undetermined(
                    vec![lag_name(&name, lag)],
                    format!(
                        "{} follows from the regressors before it; lower the orders, or leave a channel out",
                        lag_name(&name, lag)
                    ),
                ));
            }
            let coefficients = divided(factor.block(known..all.len(), 0..known), &own);
            equations.extend(
                coefficients
                    .row_iter()
                    .map(|row| Equation { places: places.clone(), coefficients: row.transpose() }),
            );
        }
        // e is y less what the regressors tell.
        let size = products.products.nrows();
        let mut rows = DMatrix::zeros(l, size);
        for (output, equation) in equations.iter().enumerate() {
            rows[(output, m + output)] = 1.0;
            for (place, coefficient) in equation.places.iter().zip(equation.coefficients.iter()) {
                rows[(output, *place)] -= coefficient;
            }
        }
        let mut errors = &rows * &products.products * rows.transpose();
        // Of what is explained exactly, rounding is left.
        for output in 0..l {
            if errors[(output, output)] <= ROUNDING {
                errors.row_mut(output).fill(0.0);
                errors.column_mut(output).fill(0.0);
            }
        }
        let (samples, count) = (products.samples as f64, equations.iter().map(|one| one.places.len()));
        let levels = if products.means.is_some() { l } else { 0 };
        let free = count.sum::<usize>() + levels;
        let mdl = samples * log_determinant(&errors) + free as f64 * samples.ln();
        Ok(Self { equations, errors, mdl })
    }

    fn estimate(
        self,
        products: &LaggedProducts,
        orders: &Orders,
        options: &VectorArxOptions,
        (sample_time, tried): (f64, Vec<VectorArxScore>),
    ) -> VectorArxEstimate {
        let (m, l, width) = (products.inputs, products.outputs, products.width());
        let samples = products.samples as f64;
        let scales = &products.scales;
        let first = usize::from(!options.direct);
        // Coefficients by lag, and where each stands: A_i y(t-i) is on the left, with the other sign.
        let lags = orders.lags(options.direct);
        let mut a = vec![DMatrix::<f64>::zeros(l, l); lags + 1];
        let mut b = vec![DMatrix::<f64>::zeros(l, m); lags + 1];
        let mut errors = (a.clone(), b.clone());
        let degrees = |equation: &Equation| samples - equation.places.len() as f64;
        // With coupling all equations have the same.
        let inverses: Vec<DMatrix<f64>> = match orders.coupling {
            Coupling::Full => self.equations.iter().take(1).map(|one| one.inverse(products)).collect(),
            Coupling::None => self.equations.iter().map(|one| one.inverse(products)).collect(),
        };
        let inverse = |output: usize| &inverses[output.min(inverses.len() - 1)];
        for (output, equation) in self.equations.iter().enumerate() {
            let variance = self.errors[(output, output)] / degrees(equation);
            for (row, place) in equation.places.iter().enumerate() {
                let (lag, signal) = (place / width, place % width);
                let unit = scales[m + output] / scales[signal];
                let value = equation.coefficients[row] * unit;
                let error = (variance * inverse(output)[(row, row)]).max(0.0).sqrt() * unit;
                if signal < m {
                    (b[lag][(output, signal)], errors.1[lag][(output, signal)]) = (value, error);
                } else {
                    (a[lag][(output, signal - m)], errors.0[lag][(output, signal - m)]) = (-value, error);
                }
            }
        }
        let coupled = |row: usize, column: usize| orders.coupling == Coupling::Full || row == column;
        let matrices = (1..=orders.na).map(|lag| {
            let entry = |row: usize, column: usize| {
                Quantity::new(
                    a[lag][(row, column)],
                    coupled(row, column).then(|| errors.0[lag][(row, column)]),
                )
            };
            (0..l).map(|row| (0..l).map(|column| entry(row, column)).collect()).collect()
        });
        let of_inputs = orders.nb.iter().enumerate().map(|(input, nb)| {
            let at = |lag: usize, output: usize| {
                Quantity::new(b[lag][(output, input)], Some(errors.1[lag][(output, input)]))
            };
            (first..first + nb).map(|lag| (0..l).map(|output| at(lag, output)).collect()).collect()
        });
        let outcome = VectorArxOutcome {
            na: orders.na,
            nb: orders.nb.clone(),
            nk: vec![first; m],
            coupling: orders.coupling,
            constant: products.means.is_some(),
            a: matrices.collect(),
            b: of_inputs.collect(),
            tried,
        };
        let levels = self.levels(products, &a, &b);
        let units = DMatrix::from_diagonal(&DVector::from_column_slice(&scales[m..]));
        let covariance = &units * &self.errors * &units;
        let space = observer_form(&a, &b, &scales[m..], covariance, sample_time);
        let free: usize = self.equations.iter().map(|equation| equation.places.len()).sum();
        VectorArxEstimate {
            outcome,
            covariance: self.covariance(products, &b[0], &a, inverse),
            space,
            free_parameters: free + if levels.is_some() { l } else { 0 },
            levels: levels.unwrap_or_else(|| vec![0.0; l]),
            mdl: self.mdl,
            samples: products.samples,
            delay: 0,
        }
    }

    /// Where outputs stay while inputs stay at zero: c of A(1) c = mean of A(q) y - B(q) u; none without a constant.
    /// Not finite where A(1) is singular.
    fn levels(&self, products: &LaggedProducts, a: &[DMatrix<f64>], b: &[DMatrix<f64>]) -> Option<Vec<f64>> {
        let means = products.means.as_ref()?;
        let (m, l, width) = (products.inputs, products.outputs, products.width());
        let at = |lag: usize, signals: std::ops::Range<usize>| {
            let each = signals.map(|signal| means[lag * width + signal] * products.scales[signal]);
            DVector::from_iterator(each.len(), each)
        };
        let mut sum = DMatrix::identity(l, l);
        let mut constant = at(0, m..width);
        for (lag, (a, b)) in a.iter().zip(b).enumerate() {
            constant += a * at(lag, m..width) - b * at(lag, 0..m);
            sum += a;
        }
        let levels = sum.lu().solve(&constant);
        Some(levels.map_or_else(|| vec![f64::NAN; l], |levels| levels.iter().copied().collect()))
    }

    /// The covariance of the entries of the block observer form, those of A in F and K, those of B in G and D.
    fn covariance<'i>(
        &self,
        products: &LaggedProducts,
        direct: &DMatrix<f64>,
        a: &[DMatrix<f64>],
        inverse: impl Fn(usize) -> &'i DMatrix<f64>,
    ) -> Option<EntryCovariance> {
        let (m, l, width) = (products.inputs, products.outputs, products.width());
        let samples = products.samples as f64;
        // Each coefficient moves some entries, with these slopes.
        let mut entries: Vec<Entry> = Vec::new();
        let mut place_of = |entry: Entry| {
            entries.iter().position(|other| *other == entry).unwrap_or_else(|| {
                entries.push(entry);
                entries.len() - 1
            })
        };
        let mut slopes: Vec<Moved> = Vec::new();
        for (output, equation) in self.equations.iter().enumerate() {
            for (row, place) in equation.places.iter().enumerate() {
                let (lag, signal) = (place / width, place % width);
                let (own, scale) = (products.scales[m + output], products.scales[signal]);
                let state = |lag: usize, row: usize| (lag - 1) * l + row;
                let mut moved = Vec::new();
                let mut add = |matrix, row, column, slope: f64| {
                    if slope != 0.0 {
                        moved.push((place_of(Entry { matrix, row, column }), slope));
                    }
                };
                if signal >= m {
                    // The coefficient is an entry of -A_lag.
                    let column = signal - m;
                    add(StateSpaceMatrix::F, state(lag, output), column, 1.0);
                    add(StateSpaceMatrix::K, state(lag, output), column, 1.0 / scale);
                    for input in 0..m {
                        add(StateSpaceMatrix::G, state(lag, output), input, direct[(column, input)] / scale);
                    }
                } else if lag > 0 {
                    add(StateSpaceMatrix::G, state(lag, output), signal, 1.0 / scale);
                } else {
                    add(StateSpaceMatrix::D, output, signal, own / scale);
                    for (lag, a) in a.iter().enumerate().skip(1) {
                        for other in 0..l {
                            let slope = -a[(other, output)] * own / scale / products.scales[m + other];
                            add(StateSpaceMatrix::G, state(lag, other), signal, slope);
                        }
                    }
                }
                slopes.push(Moved { output, row, entries: moved });
            }
        }
        let size = entries.len();
        if size > MOST_ENTRIES {
            return None;
        }
        let mut values = vec![vec![0.0; size]; size];
        let factors = self.cross_inverses(products, inverse);
        for one in &slopes {
            for other in &slopes {
                let (first, second) = (&self.equations[one.output], &self.equations[other.output]);
                let degrees =
                    ((samples - first.places.len() as f64) * (samples - second.places.len() as f64)).sqrt();
                let joint = factors[one.output * l + other.output][(one.row, other.row)];
                let covariance = self.errors[(one.output, other.output)] / degrees * joint;
                for (entry, slope) in &one.entries {
                    for (also, second) in &other.entries {
                        values[*entry][*also] += slope * second * covariance;
                    }
                }
            }
        }
        Some(EntryCovariance { entries, values })
    }

    /// For each pair of equations (Phi_i' Phi_i)^-1 Phi_i' Phi_j (Phi_j' Phi_j)^-1, times N.
    fn cross_inverses<'i>(
        &self,
        products: &LaggedProducts,
        inverse: impl Fn(usize) -> &'i DMatrix<f64>,
    ) -> Vec<DMatrix<f64>> {
        let mut all = Vec::new();
        for (output, first) in self.equations.iter().enumerate() {
            for (other, second) in self.equations.iter().enumerate() {
                all.push(if first.places == second.places {
                    inverse(output).clone()
                } else {
                    let between = products.products.select_rows(&first.places).select_columns(&second.places);
                    inverse(output) * between * inverse(other)
                });
            }
        }
        all
    }
}

/// The block observer form of coefficients by lag, from lag 0 on, states in units of the sizes of the outputs: else
/// eigenvalues of signals of very different sizes lose their digits.
fn observer_form(
    a: &[DMatrix<f64>],
    b: &[DMatrix<f64>],
    sizes: &[f64],
    noise_covariance: DMatrix<f64>,
    sample_time: f64,
) -> StateSpace {
    let (l, m) = b[0].shape();
    let blocks = a.len() - 1;
    let n = blocks * l;
    let (mut f, mut g) = (DMatrix::zeros(n, n), DMatrix::zeros(n, m));
    let (mut h, mut k) = (DMatrix::zeros(l, n), DMatrix::zeros(n, l));
    let units = DMatrix::from_diagonal(&DVector::from_column_slice(sizes));
    let inverses = DMatrix::from_diagonal(&DVector::from_iterator(l, sizes.iter().map(|size| 1.0 / size)));
    for block in 0..blocks {
        let (a_own, b_own) = (&inverses * &a[block + 1], &b[block + 1]);
        f.view_mut((block * l, 0), (l, l)).copy_from(&(-&a_own * &units));
        g.rows_mut(block * l, l).copy_from(&(&inverses * b_own - &a_own * &b[0]));
        k.rows_mut(block * l, l).copy_from(&-a_own);
        if block + 1 < blocks {
            f.view_mut((block * l, (block + 1) * l), (l, l)).fill_with_identity();
        }
    }
    if blocks > 0 {
        h.columns_mut(0, l).copy_from(&units);
    }
    StateSpace { f, g, h, d: b[0].clone(), k, noise_covariance, sample_time }
}
