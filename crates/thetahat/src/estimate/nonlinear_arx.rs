//! Nonlinear ARX models that are linear in their parameters: which functions, and one solve.

pub(crate) mod centres;

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_core::Error as CoreError;
use thetahat_core::nalgebra::DVector;

use super::{Criteria, InformationCriterion};
use crate::Error;
use crate::data::{Log, Rows};
use crate::model::{Evaluator, Map, NonlinearArxModel, Parameter};
use crate::regression::{Moments, Monomials, Path, factor_rows, forward, product, sum_of_squares};
use crate::respond::nonlinear_arx::NonlinearArxOnLog;
use crate::respond::{Horizon, OnLog, Start};

/// Rows whose functions are in memory at once.
const ROWS: usize = 512;
/// Blocks that the estimation rows are cut into, each held out in its turn.
const BLOCKS: usize = 5;
/// A choice prefers models whose free run stays within so many times the range of the estimation rows, about its middle.
const RANGE: f64 = 1.1;

/// How the functions of a nonlinear ARX model were chosen.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TermsOutcome {
    /// The functions to choose from.
    pub candidates: usize,
    /// What said how many to take: `given`, the word of an information criterion, `validation` (the free run on the validation rows) or
    /// `cv` (that on five blocks, each by a model of the others).
    pub selected_by: String,
    /// What was added to the squares of the functions, in samples; none: nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub ridge: Option<f64>,
    /// The functions in the order of their choice, those that were not taken too.
    pub path: Vec<TermStep>,
}

/// A step of the choice: the model with this term and those before.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct TermStep {
    /// The function that is added.
    pub term: String,
    /// Its error reduction ratio: the share of the sum of squared outputs that it explains beside those before.
    pub error_reduction: f64,
    /// Functions that can no longer be told from sums of those chosen.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub aliases: Vec<String>,
    /// The root mean square of the errors one step ahead on the estimation rows, in units of the output.
    pub rmse: f64,
    /// The free run on the estimation rows; none of a step after which functions that are always there are still to come.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub free_run: Option<RunFigures>,
    /// The free run on the rows that the choice looked at, where there are some; one step ahead where there are no inputs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub held_out: Option<RunFigures>,
}

/// What a run of a model misses.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RunFigures {
    /// The root mean square error, in units of the output; none where the run leaves the range of numbers.
    pub rmse: Option<f64>,
    /// The largest absolute error; none likewise.
    pub largest_error: Option<f64>,
    /// Whether the run stays within 1.1 times the range of the estimation rows, about its middle.
    pub in_range: bool,
}

impl RunFigures {
    fn of(model: &NonlinearArxModel, log: &Log, rows: &[Rows]) -> Result<Self, Error> {
        run(model, log, rows).map(Sums::figures)
    }

    /// Smaller is better: those out of range come last, and those without a figure after them.
    fn rank(self) -> (bool, f64) {
        (!self.in_range, self.rmse.unwrap_or(f64::INFINITY))
    }
}

/// What a model misses on some rows of a log: in its free run, or one step ahead where nothing drives it.
fn run(model: &NonlinearArxModel, log: &Log, rows: &[Rows]) -> Result<Sums, Error> {
    let [low, high] = model.output_range;
    let (middle, half) = (f64::midpoint(low, high), RANGE * (high - low) / 2.0);
    let on_log = NonlinearArxOnLog::new(model, log, rows)?;
    let horizon = if on_log.is_driven() { Horizon::FreeRun } else { Horizon::Steps { steps: 1 } };
    let mut sums = Sums::default();
    for response in on_log.respond(horizon, Start::Drop)? {
        let measured = on_log.measured(0);
        for t in response.counted.iter().cloned().flatten() {
            let (said, error) = (response.values[t], (measured[t] - response.values[t]).abs());
            sums.count += 1;
            sums.squares += error * error;
            // One that is not a number stays one.
            sums.largest = if error > sums.largest || error.is_nan() { error } else { sums.largest };
            sums.strays |= said.is_nan() || (said - middle).abs() > half;
        }
    }
    Ok(sums)
}

/// What figures are made of.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    count: usize,
    squares: f64,
    largest: f64,
    strays: bool,
}

impl Sums {
    fn add(&mut self, other: Self) {
        self.count += other.count;
        self.squares += other.squares;
        let largest = other.largest;
        self.largest = if largest > self.largest || largest.is_nan() { largest } else { self.largest };
        self.strays |= other.strays;
    }

    fn figures(self) -> RunFigures {
        let known = |value: f64| Some(value).filter(|value| self.count > 0 && value.is_finite());
        RunFigures {
            rmse: known((self.squares / self.count as f64).sqrt()),
            largest_error: known(self.largest),
            in_range: self.count > 0 && !self.strays,
        }
    }
}

/// Functions to choose from.
#[derive(Debug, Clone)]
pub(crate) enum Candidates {
    /// Products of regressors.
    Products(Monomials),
    /// The functions of a map, of which so many are always taken, the first ones.
    Functions { map: Map, always: usize },
}

impl Candidates {
    pub(crate) fn count(&self, regressors: usize) -> usize {
        match self {
            Self::Products(monomials) => monomials.count(),
            Self::Functions { map, .. } => map.parameters(regressors),
        }
    }

    /// The map of some of them, in this order.
    fn map(&self, places: &[usize]) -> Map {
        match self {
            Self::Products(monomials) => {
                Map::Polynomial { terms: places.iter().map(|place| monomials.factors(*place)).collect() }
            }
            Self::Functions { map, .. } => map.some(places),
        }
    }

    /// A rank for each: of tied ones that of the lowest degree comes first, then that of the smallest lags.
    fn preferred(&self, lags: &[usize]) -> Vec<usize> {
        let key = |place: usize| match self {
            Self::Products(monomials) => {
                let factors = monomials.factors(place);
                (factors.len(), factors.iter().map(|factor| lags[*factor]).sum::<usize>(), place)
            }
            Self::Functions { .. } => (0, 0, place),
        };
        let mut order: Vec<usize> = (0..self.count(lags.len())).collect();
        order.sort_by_key(|place| key(*place));
        let mut ranks = vec![0; order.len()];
        order.iter().enumerate().for_each(|(rank, place)| ranks[*place] = rank);
        ranks
    }
}

/// Sums of products of candidates, and of candidates and outputs.
#[derive(Debug, Clone)]
enum Products {
    Moments(Moments),
    Gram { gram: Mat<f64>, cross: Vec<f64>, energy: f64, rows: usize },
}

impl Products {
    fn merge(&mut self, other: &Self) {
        match (self, other) {
            (Self::Moments(own), Self::Moments(other)) => own.merge(other),
            (
                Self::Gram { gram, cross, energy, rows },
                Self::Gram { gram: others, cross: products, energy: more, rows: further },
            ) => {
                *gram += others;
                cross.iter_mut().zip(products).for_each(|(sum, value)| *sum += value);
                *energy += more;
                *rows += further;
            }
            // Sums of one set of candidates are of one kind.
            _ => {}
        }
    }

    fn energy(&self) -> f64 {
        match self {
            Self::Moments(moments) => moments.energy,
            Self::Gram { energy, .. } => *energy,
        }
    }

    fn rows(&self) -> usize {
        match self {
            Self::Moments(moments) => moments.rows,
            Self::Gram { rows, .. } => *rows,
        }
    }

    fn is_finite(&self) -> bool {
        match self {
            Self::Moments(moments) => moments.is_finite(),
            Self::Gram { gram, cross, energy, .. } => {
                energy.is_finite()
                    && cross.iter().all(|value| value.is_finite())
                    && gram.col_iter().all(|column| column.iter().all(|value| value.is_finite()))
            }
        }
    }
}

/// What says how many functions are taken.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Count {
    /// As many as are given.
    Given(usize),
    /// The least of a criterion.
    Least(InformationCriterion),
    /// The least error of the free run on rows that the functions were not fitted to.
    HeldOut(Vec<Rows>),
    /// The same on blocks of the estimation rows, each by a model of the others.
    Blocks,
}

/// The samples of a fit, and all of the model but its functions.
#[derive(Debug)]
pub(crate) struct Samples<'l> {
    /// Deviations from the offsets.
    log: &'l Log,
    head: NonlinearArxModel,
    /// The output and the inputs, each divided by its scale.
    signals: Vec<Vec<f64>>,
    /// For each regressor the signal and the lag.
    taps: Vec<(usize, usize)>,
    /// The samples with all regressors and an output.
    rows: Vec<usize>,
    ridge: f64,
}

/// What a choice found: a path, and how many of it to take.
#[derive(Debug)]
pub(crate) struct Chosen {
    pub(crate) map: Map,
    pub(crate) steps: Vec<TermStep>,
}

/// A solved regression.
#[derive(Debug)]
pub(crate) struct Solved {
    pub(crate) model: NonlinearArxModel,
    pub(crate) mse: f64,
    pub(crate) condition: Option<f64>,
}

impl<'l> Samples<'l> {
    /// The samples in `segments`, each with the number of measured ones before it; `log` has deviations.
    pub(crate) fn new(
        log: &'l Log,
        mut head: NonlinearArxModel,
        segments: &[(std::ops::Range<usize>, usize)],
        ridge: f64,
    ) -> Result<Self, Error> {
        let scale = |channel: &str| {
            let own = head.regressors.iter().find(|regressor| regressor.channel == channel);
            own.map_or(1.0, |regressor| regressor.scale)
        };
        let mut signals = Vec::new();
        for (place, signal) in std::iter::once(&head.output).chain(&head.inputs).enumerate() {
            let scale = if place == 0 { head.output_scale } else { scale(&signal.name) };
            signals.push(log.channel(&signal.name)?.values.iter().map(|value| value / scale).collect());
        }
        let taps: Vec<(usize, usize)> =
            head.sources().into_iter().zip(&head.regressors).map(|(source, one)| (source, one.lag)).collect();
        let lags = head.lags();
        let each = segments.iter().map(|(rows, past)| rows.start + lags.saturating_sub(*past)..rows.end);
        let rows: Vec<usize> = each.flatten().collect();
        let mut samples = Self { log, signals, taps, rows, ridge, head: head.clone() };
        for (place, regressor) in head.regressors.iter_mut().enumerate() {
            regressor.range = samples.range(samples.taps[place], regressor.scale);
        }
        head.output_range = samples.range((0, 0), head.output_scale);
        samples.head = head;
        Ok(samples)
    }

    fn range(&self, (source, lag): (usize, usize), scale: f64) -> [f64; 2] {
        let values = || self.rows.iter().map(|t| self.signals[source][t - lag] * scale);
        [values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max)]
    }

    pub(crate) fn count(&self) -> usize {
        self.rows.len()
    }

    pub(crate) fn regressors(&self) -> usize {
        self.taps.len()
    }

    /// z of all samples.
    pub(crate) fn points(&self) -> Vec<Vec<f64>> {
        let point =
            |t: &usize| self.taps.iter().map(|(source, lag)| self.signals[*source][t - lag]).collect();
        self.rows.iter().map(point).collect()
    }

    fn fill(&self, (source, lag): (usize, usize), rows: &[usize], into: &mut [f64]) {
        let signal = &self.signals[source];
        into.iter_mut().zip(rows).for_each(|(into, t)| *into = signal[t - lag]);
    }

    fn products(&self, candidates: &Candidates, rows: &[usize]) -> Products {
        match candidates {
            Candidates::Products(monomials) => {
                let mut moments = Moments::zero(monomials);
                moments.add(
                    monomials,
                    rows.len(),
                    |index, first, into| self.fill(self.taps[index], &rows[first..], into),
                    |first, into| self.fill((0, 0), &rows[first..], into),
                );
                Products::Moments(moments)
            }
            Candidates::Functions { map, .. } => {
                let count = map.parameters(self.taps.len());
                let evaluator = Evaluator::new(map, vec![0.0; count]);
                let (mut gram, mut cross, mut energy) = (Mat::zeros(count, count), vec![0.0; count], 0.0);
                let (mut z, mut functions) = (vec![0.0; self.taps.len()], vec![0.0; count]);
                for some in rows.chunks(ROWS) {
                    let mut values = Mat::zeros(some.len(), count);
                    let mut y = vec![0.0; some.len()];
                    self.fill((0, 0), some, &mut y);
                    for (at, t) in some.iter().enumerate() {
                        for (z, (source, lag)) in z.iter_mut().zip(&self.taps) {
                            *z = self.signals[*source][t - lag];
                        }
                        evaluator.functions(&z, &mut functions);
                        functions.iter().enumerate().for_each(|(j, f)| values[(at, j)] = *f);
                    }
                    let columns = values.as_ref();
                    matmul(gram.as_mut(), Accum::Add, columns.transpose(), columns, 1.0, Par::Seq);
                    for (j, cross) in cross.iter_mut().enumerate() {
                        *cross += product(values.col_as_slice(j), &y);
                    }
                    energy += sum_of_squares(&y);
                }
                Products::Gram { gram, cross, energy, rows: rows.len() }
            }
        }
    }

    /// The path of a choice among candidates, `most` steps at most. Those of `first` are taken first.
    fn path(&self, candidates: &Candidates, products: &Products, first: &[usize], most: usize) -> Path {
        let lags: Vec<usize> = self.taps.iter().map(|(_, lag)| *lag).collect();
        let preferred = candidates.preferred(&lags);
        // A ridge of so many samples: of each function its mean square is added as often.
        let part = 1.0 + self.ridge / products.rows().max(1) as f64;
        let more = |one: usize, other: usize| if one == other { part } else { 1.0 };
        let energy = products.energy();
        match (products, candidates) {
            (Products::Moments(moments), Candidates::Products(monomials)) => {
                let gram = |one, other| moments.gram(monomials, one, other) * more(one, other);
                forward(gram, &moments.cross, energy, first, &preferred, most)
            }
            (Products::Gram { gram, cross, .. }, _) => {
                let gram = |one, other| gram[(one, other)] * more(one, other);
                forward(gram, cross, energy, first, &preferred, most)
            }
            // Sums of one set of candidates are of one kind.
            _ => Path::default(),
        }
    }

    /// The model of the first steps of a path, with the coefficients that the path knows.
    fn on_path(&self, candidates: &Candidates, path: &Path, count: usize) -> NonlinearArxModel {
        let named = |value: f64| Parameter { name: String::new(), value, standard_error: None };
        let mut places = path.places(count);
        let mut theta: Vec<f64> = path.coefficients(count);
        if let Candidates::Functions { .. } = candidates {
            // A map has its functions in their own order.
            let mut order: Vec<usize> = (0..places.len()).collect();
            order.sort_by_key(|at| places[*at]);
            theta = order.iter().map(|at| theta[*at]).collect();
            places.sort_unstable();
        }
        let map = candidates.map(&places);
        NonlinearArxModel { map, parameters: theta.into_iter().map(named).collect(), ..self.head.clone() }
    }

    /// Chooses functions, `most` at most. `rows` are those of the fit, as the log counts them; `refit` whether the model is fitted to
    /// others too, and the path is that of all.
    ///
    /// # Errors
    /// [`Error::Undetermined`] where nothing can be chosen; [`Error::Data`] where sums leave the range of numbers.
    pub(crate) fn choose(
        &self,
        candidates: &Candidates,
        first: &[usize],
        most: usize,
        count: &Count,
        chosen_on: Option<&Self>,
    ) -> Result<Chosen, Error> {
        let always = if let Candidates::Functions { always, .. } = candidates { *always } else { 0 };
        let most = most.max(always).min(self.rows.len().saturating_sub(1));
        let regressors: Vec<String> = self.head.regressors.iter().map(|one| one.name()).collect();
        let name = |place: usize| match candidates {
            Candidates::Products(_) => candidates.map(&[place]).names(&regressors).pop().unwrap_or_default(),
            Candidates::Functions { map, .. } => {
                map.names(&regressors).get(place).cloned().unwrap_or_default()
            }
        };
        let first: Vec<usize> = if always > 0 { (0..always).collect() } else { first.to_vec() };
        let mut blocks = Vec::new();
        let products = if *count == Count::Blocks {
            let size = self.rows.len().div_ceil(BLOCKS).max(1);
            blocks = self.rows.chunks(size).map(|rows| (rows, self.products(candidates, rows))).collect();
            let mut whole: Option<Products> = None;
            for (_, products) in &blocks {
                match &mut whole {
                    Some(whole) => whole.merge(products),
                    None => whole = Some(products.clone()),
                }
            }
            whole.unwrap_or_else(|| self.products(candidates, &[]))
        } else {
            self.products(candidates, &self.rows)
        };
        if !products.is_finite() {
            return Err(Error::data(
                "sums of products of the regressors leave the range of numbers; take a lower degree, or leave out `raw-terms`, so that                  signals are divided by their scale",
            ));
        }
        let path = self.path(candidates, &products, &first, most);
        if path.chosen.is_empty() {
            return Err(Error::undetermined(
                Vec::new(),
                "no function explains anything of the output on the estimation rows; name rows in which it changes, or other lags",
            ));
        }
        if path.places(always) != first[..always.min(first.len())] {
            let missing = first.iter().take(always).find(|place| !path.places(always).contains(place));
            let name = missing.map_or_else(String::new, |place| name(*place));
            return Err(Error::undetermined(
                vec![name.clone()],
                format!(
                    "{name} is a sum of the other functions on the estimation rows; take other lags, other centres or other rows"
                ),
            ));
        }
        if let Count::Given(wanted) = count
            && *wanted > path.chosen.len()
        {
            return Err(Error::undetermined(
                Vec::new(),
                format!(
                    "{wanted} functions are asked for, and {} samples tell {} of {} apart; take fewer `terms`, or more rows",
                    self.rows.len(),
                    path.chosen.len(),
                    candidates.count(self.taps.len())
                ),
            ));
        }
        // What held-out rows say of each length of the path.
        let lengths = path.chosen.len();
        let held_out: Vec<Option<RunFigures>> = match count {
            Count::HeldOut(rows) => {
                let own = match chosen_on {
                    Some(others) => {
                        let products = others.products(candidates, &others.rows);
                        Some((others, others.path(candidates, &products, &first, most)))
                    }
                    None => None,
                };
                let (samples, path) = own.as_ref().map_or((self, &path), |(samples, path)| (*samples, path));
                let each = (1..=lengths).map(|count| {
                    if count > path.chosen.len() || count < always {
                        return Ok(None);
                    }
                    let model = samples.on_path(candidates, path, count);
                    RunFigures::of(&model, self.log, rows).map(Some)
                });
                each.collect::<Result<_, Error>>()?
            }
            Count::Blocks => self.on_blocks(candidates, &blocks, &first, lengths)?,
            Count::Given(_) | Count::Least(_) => vec![None; lengths],
        };
        let energy = products.energy();
        let variance = energy * self.head.output_scale.powi(2) / products.rows().max(1) as f64;
        let rows = as_rows(&self.rows);
        let mut steps = Vec::new();
        for (at, chosen) in path.chosen.iter().enumerate() {
            steps.push(TermStep {
                term: name(chosen.place),
                error_reduction: chosen.reduction,
                aliases: chosen.aliases.iter().map(|place| name(*place)).collect(),
                rmse: (path.left(at + 1).max(0.0) * variance).sqrt(),
                free_run: (at + 1 >= always)
                    .then(|| RunFigures::of(&self.on_path(candidates, &path, at + 1), self.log, &rows))
                    .transpose()?,
                held_out: held_out[at],
            });
        }
        let least = always.clamp(1, lengths);
        let best = match count {
            Count::Given(count) => (*count).min(lengths),
            Count::Least(criterion) => {
                let value = |count: &usize| {
                    let mse = steps[*count - 1].rmse.powi(2);
                    Criteria::new(mse, *count, products.rows()).of(*criterion).unwrap_or(f64::INFINITY)
                };
                (least..=lengths).min_by(|one, other| value(one).total_cmp(&value(other))).unwrap_or(1)
            }
            Count::HeldOut(_) | Count::Blocks => {
                let rank =
                    |count: &usize| held_out[*count - 1].map_or((true, f64::INFINITY), RunFigures::rank);
                let better = |one: &usize, other: &usize| {
                    let ((strays, rmse), (others, worse)) = (rank(one), rank(other));
                    strays.cmp(&others).then(rmse.total_cmp(&worse))
                };
                (least..=lengths).min_by(better).unwrap_or(1)
            }
        };
        let mut places = path.places(best);
        if let Candidates::Functions { .. } = candidates {
            places.sort_unstable();
        }
        Ok(Chosen { map: candidates.map(&places), steps })
    }

    /// The figures of each length of the paths on blocks that these did not see, over all blocks.
    fn on_blocks(
        &self,
        candidates: &Candidates,
        blocks: &[(&[usize], Products)],
        first: &[usize],
        lengths: usize,
    ) -> Result<Vec<Option<RunFigures>>, Error> {
        let mut sums = vec![Some(Sums::default()); lengths];
        for (place, (rows, _)) in blocks.iter().enumerate() {
            let mut others =
                blocks.iter().enumerate().filter(|(other, _)| *other != place).map(|(_, (_, sum))| sum);
            let Some(mut products) = others.next().cloned() else { return Ok(vec![None; lengths]) };
            others.for_each(|other| products.merge(other));
            let path = self.path(candidates, &products, first, lengths);
            let rows = as_rows(rows);
            for (at, sum) in sums.iter_mut().enumerate() {
                let own = (at < path.chosen.len() && at + 1 >= first.len().min(lengths))
                    .then(|| self.on_path(candidates, &path, at + 1));
                *sum = match (sum.take(), own) {
                    (Some(mut sum), Some(model)) => {
                        sum.add(run(&model, self.log, &rows)?);
                        Some(sum)
                    }
                    _ => None,
                };
            }
        }
        Ok(sums.into_iter().map(|sums| sums.map(Sums::figures)).collect())
    }

    /// The least-squares solution for the functions of a map, by QR of their values.
    ///
    /// # Errors
    /// [`Error::Undetermined`] if there are not more samples than functions, or these depend on one another.
    pub(crate) fn solve(&self, map: Map) -> Result<Solved, Error> {
        let count = map.parameters(self.taps.len());
        let names: Vec<String> = self.head.regressors.iter().map(|one| one.name()).collect();
        let names = map.names(&names);
        if self.rows.len() <= count {
            return Err(Error::undetermined(
                Vec::new(),
                format!(
                    "{count} functions need more than {count} samples with all regressors, there are {}; take fewer functions, or more \
                     rows",
                    self.rows.len()
                ),
            ));
        }
        let evaluator = Evaluator::new(&map, vec![0.0; count]);
        let mut values = vec![0.0; (count + 1) * self.rows.len()];
        let mut z = vec![0.0; self.taps.len()];
        for (row, t) in values.chunks_exact_mut(count + 1).zip(&self.rows) {
            for (z, (source, lag)) in z.iter_mut().zip(&self.taps) {
                *z = self.signals[*source][t - lag];
            }
            evaluator.functions(&z, row);
            row[count] = self.signals[0][*t];
        }
        let squares: Vec<f64> = (0..count)
            .map(|j| values.chunks_exact(count + 1).map(|row| row[j] * row[j]).sum::<f64>())
            .collect();
        // Columns of one size: a rank is seen, a condition number says something.
        let sizes: Vec<f64> = squares.iter().map(|square| square.sqrt()).collect();
        if let Some(place) = sizes.iter().position(|size| !(*size > 0.0 && size.is_finite())) {
            return Err(Error::undetermined(
                vec![names[place].clone()],
                format!(
                    "{} is zero, or no number, in all estimation rows; leave it out, or name other rows",
                    names[place]
                ),
            ));
        }
        let entry = |row: usize, column: usize| {
            let value = values[row * (count + 1) + column];
            if column < count { value / sizes[column] } else { value }
        };
        let failed = |error: CoreError| match error {
            CoreError::RankDeficient { column } => Error::undetermined(
                vec![names[column].clone()],
                format!(
                    "{} is a sum of the other functions on the estimation rows; leave one of them out",
                    names[column]
                ),
            ),
            error => Error::data(format!(
                "the regression cannot be solved: {error}; take a lower degree or fewer functions"
            )),
        };
        let mut factor = factor_rows(0..self.rows.len(), entry, count + 1).map_err(failed)?;
        let condition = factor.condition();
        if self.ridge > 0.0 {
            let weight = (self.ridge / self.rows.len() as f64).sqrt();
            for place in 0..count {
                let row = DVector::from_fn(count, |j, _| if j == place { weight } else { 0.0 });
                factor.add(&row, 0.0).map_err(failed)?;
            }
        }
        let solution = factor.solve().map_err(failed)?;
        let scale = self.head.output_scale;
        let theta: Vec<f64> =
            solution.parameters().iter().zip(&sizes).map(|(value, size)| value / size).collect();
        let left: f64 = values
            .chunks_exact(count + 1)
            .map(|row| (row[count] - product(&row[..count], &theta)).powi(2))
            .sum::<f64>();
        let degrees = self.rows.len() - count;
        let variance = left / degrees as f64;
        // solve() counts the rows of a ridge among the samples: the shape of its covariance holds, its variance is that of the samples.
        let own = solution.residual_variance().filter(|own| *own > 0.0);
        let covariance = solution.covariance().zip(own).map(|(covariance, own)| {
            let entry = |i: usize, j: usize| covariance[(i, j)] * variance / own / (sizes[i] * sizes[j]);
            (0..count).map(|i| (0..count).map(|j| entry(i, j)).collect()).collect::<Vec<Vec<f64>>>()
        });
        let error = |place: usize| covariance.as_ref().map(|rows| rows[place][place].sqrt());
        let parameters = names.into_iter().zip(&theta).enumerate().map(|(place, (name, value))| Parameter {
            name,
            value: *value,
            standard_error: error(place),
        });
        let parameters = parameters.collect();
        Ok(Solved {
            mse: left * scale * scale / self.rows.len() as f64,
            condition: Some(condition).filter(|condition| condition.is_finite()),
            model: NonlinearArxModel {
                map,
                parameters,
                noise_variance: variance * scale * scale,
                degrees_of_freedom: Some(degrees),
                covariance,
                ..self.head.clone()
            },
        })
    }
}

/// Samples as rows of a log.
fn as_rows(samples: &[usize]) -> Vec<Rows> {
    let mut rows = Vec::new();
    let mut rest = samples;
    while let Some(first) = rest.first() {
        let length = rest.iter().enumerate().take_while(|(at, t)| **t == first + at).count();
        rows.push(Rows::from_positions(&(*first..first + length)));
        rest = &rest[length..];
    }
    rows
}
