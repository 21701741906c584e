//! Nonlinear ARX models that are linear in their parameters: which functions, and one solve.

mod candidates;
pub(crate) mod centres;
mod figures;
mod joint;
mod local;
mod neighbours;
pub(crate) mod splines;
mod sums;
mod training;

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, Par};
use rayon::prelude::*;
use thetahat_core::Error as CoreError;
use thetahat_core::nalgebra::DVector;
use thetahat_numerics::regression::{Moments, Path, factor_rows, forward, product, sum_of_squares};

pub(crate) use candidates::Candidates;
use candidates::Products;
pub use figures::{MapsOutcome, RunFigures, TermStep, TermsOutcome, TrainingOutcome};
use figures::{Sums, run};
pub(crate) use joint::{Joint, joint};
pub(crate) use local::Growth;
pub(crate) use sums::of_sums;
pub(crate) use training::{Training, Units};

use super::{Criteria, InformationCriterion};
use crate::Error;
use crate::data::{Log, Rows};
use crate::model::{Evaluator, Map, NonlinearArxModel, OutputMap, Parameter};

/// Rows whose functions are in memory at once.
const ROWS: usize = 512;
/// Parts of the rows that are summed by themselves, at once: the same ones for any number of threads.
const PARTS: usize = 8;
/// Fewer rows are one part.
const LEAST_PART: usize = 1024;
/// Numbers in the sums of all parts, at most: 64 MB.
const MOST_SUMS: usize = 8_000_000;
/// Blocks that the estimation rows are cut into, each held out in its turn.
const BLOCKS: usize = 5;

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

/// The samples of a fit, and all of the model of one output but its functions.
#[derive(Debug)]
pub(crate) struct Samples<'l> {
    /// Deviations from the offsets.
    log: &'l Log,
    head: NonlinearArxModel,
    /// What the output is divided by.
    scale: f64,
    /// The output, the inputs and the expressions, each divided by its scale.
    signals: Vec<Vec<f64>>,
    /// For each regressor the signal and the lag.
    taps: Vec<(usize, usize)>,
    /// The samples with all regressors and an output.
    rows: Vec<usize>,
    ridge: f64,
}

/// What a choice found: a path, and how many steps of it to take.
#[derive(Debug)]
pub(crate) struct Chosen {
    pub(crate) map: Map,
    pub(crate) steps: Vec<TermStep>,
    pub(crate) taken: usize,
}

impl Count {
    /// The best step, `least` or a later one, counted from 1.
    fn best(&self, steps: &[TermStep], least: usize, samples: usize) -> usize {
        let all = least..=steps.len();
        match self {
            Self::Given(count) => *count,
            Self::Least(criterion) => {
                let value = |count: &usize| {
                    let step = &steps[*count - 1];
                    let criteria = Criteria::new(step.rmse.powi(2), step.parameters, samples);
                    criteria.of(*criterion).unwrap_or(f64::INFINITY)
                };
                all.min_by(|one, other| value(one).total_cmp(&value(other))).unwrap_or(1)
            }
            Self::HeldOut(_) | Self::Blocks => {
                let rank = |count: &usize| {
                    steps[*count - 1].held_out.map_or((true, f64::INFINITY), RunFigures::rank)
                };
                let better = |one: &usize, other: &usize| {
                    let ((strays, rmse), (others, worse)) = (rank(one), rank(other));
                    strays.cmp(&others).then(rmse.total_cmp(&worse))
                };
                all.min_by(better).unwrap_or(1)
            }
        }
    }
}

/// A solved regression.
#[derive(Debug)]
pub(crate) struct Solved {
    pub(crate) model: NonlinearArxModel,
    pub(crate) mse: f64,
    pub(crate) condition: Option<f64>,
}

impl<'l> Samples<'l> {
    /// The samples in `segments`, each with the number of measured ones before it; `log` has deviations, and `head` one
    /// output.
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
        let own = head.maps.first().map_or(1.0, |map| map.scale);
        let mut signals = Vec::new();
        for (place, signal) in head.signals().enumerate() {
            let scale = if place == 0 { own } else { scale(&signal.name) };
            signals.push(log.channel(&signal.name)?.values.iter().map(|value| value / scale).collect());
        }
        let taps: Vec<(usize, usize)> =
            head.sources().into_iter().zip(&head.regressors).map(|(source, one)| (source, one.lag)).collect();
        let lags = head.lags();
        let each = segments.iter().map(|(rows, past)| rows.start + lags.saturating_sub(*past)..rows.end);
        let rows: Vec<usize> = each.flatten().collect();
        if rows.len() < 2 {
            return Err(Error::undetermined(
                Vec::new(),
                format!(
                    "too few rows for the lags: two samples at least need all regressors (reaching back {lags}), and {} have them; \
                     name more rows, or fewer lags",
                    rows.len()
                ),
            ));
        }
        let mut samples = Self { log, scale: own, signals, taps, rows, ridge, head: head.clone() };
        head.regressors.par_iter_mut().zip(&samples.taps).for_each(|(regressor, tap)| {
            regressor.range = samples.range(*tap, regressor.scale);
        });
        for map in &mut head.maps {
            map.range = samples.range((0, 0), map.scale);
        }
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

    /// Whether an expression of an output is among the regressors.
    pub(crate) fn reads_expressions_of_outputs(&self) -> bool {
        let read = self.head.read_expressions().unwrap_or_default();
        read.iter().any(|expression| expression.channels().contains(&0))
    }

    /// The model with these functions and parameters.
    fn model(&self, functions: Map, parameters: Vec<Parameter>) -> NonlinearArxModel {
        let own = |map: &OutputMap| OutputMap { functions: functions.clone(), ..map.clone() };
        NonlinearArxModel { maps: self.head.maps.iter().map(own).collect(), parameters, ..self.head.clone() }
    }

    pub(crate) fn regressors(&self) -> usize {
        self.taps.len()
    }

    /// The least and the largest value of each z.
    pub(crate) fn ranges(&self) -> Vec<[f64; 2]> {
        self.head.regressors.iter().map(|one| one.range.map(|end| end / one.scale)).collect()
    }

    /// z of all samples.
    pub(crate) fn points(&self) -> Vec<Vec<f64>> {
        self.rows.iter().map(|t| self.point(*t)).collect()
    }

    fn point(&self, t: usize) -> Vec<f64> {
        self.taps.iter().map(|(source, lag)| self.signals[*source][t - lag]).collect()
    }

    /// The estimation rows in blocks, each held out in its turn.
    fn blocks(&self) -> impl Iterator<Item = &[usize]> {
        self.rows.chunks(self.rows.len().div_ceil(BLOCKS).max(1))
    }

    /// The samples outside of a block.
    fn others(&self, block: &[usize]) -> Vec<usize> {
        self.rows.iter().copied().filter(|t| *t < block[0] || *t > block[block.len() - 1]).collect()
    }

    /// The mean square of the output, in its units.
    fn mean_square(&self, rows: &[usize]) -> f64 {
        let values = rows.iter().map(|t| self.signals[0][*t] * self.scale);
        values.map(|value| value * value).sum::<f64>() / rows.len().max(1) as f64
    }

    fn fill(&self, (source, lag): (usize, usize), rows: &[usize], into: &mut [f64]) {
        let signal = &self.signals[source];
        into.iter_mut().zip(rows).for_each(|(into, t)| *into = signal[t - lag]);
    }

    /// Sums over rows: parts of them at once, and these in their order.
    fn products(&self, candidates: &Candidates, rows: &[usize]) -> Products {
        let parts = if candidates.sums(self.taps.len()) * PARTS > MOST_SUMS { 1 } else { PARTS };
        let part = rows.len().div_ceil(parts).max(LEAST_PART);
        let sums: Vec<Products> =
            rows.par_chunks(part).map(|rows| self.products_of_part(candidates, rows)).collect();
        merged(sums.iter()).unwrap_or_else(|| self.products_of_part(candidates, &[]))
    }

    fn products_of_part(&self, candidates: &Candidates, rows: &[usize]) -> Products {
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

    /// The path of a choice among candidates, `most` steps at most. Those that are always there come first.
    fn path(&self, candidates: &Candidates, products: &Products, most: usize) -> Path {
        let first: Vec<usize> = (0..candidates.always()).collect();
        let lags: Vec<usize> = self.taps.iter().map(|(_, lag)| *lag).collect();
        let preferred = candidates.preferred(&lags);
        // The ridge adds the mean square of each function this many times.
        let part = 1.0 + self.ridge / products.rows().max(1) as f64;
        let more = |one: usize, other: usize| if one == other { part } else { 1.0 };
        let energy = products.energy();
        match (products, candidates) {
            (Products::Moments(moments), Candidates::Products(monomials)) => {
                let gram = |one, other| moments.gram(monomials, one, other) * more(one, other);
                forward(gram, &moments.cross, energy, &first, &preferred, most)
            }
            (Products::Gram { gram, cross, .. }, _) => {
                let gram = |one, other| gram[(one, other)] * more(one, other);
                forward(gram, cross, energy, &first, &preferred, most)
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
        let map = candidates.map(&places, self.taps.len());
        self.model(map, theta.into_iter().map(named).collect())
    }

    /// Chooses functions, `most` at most. Where `chosen_on` has other samples, such as the first part of a split,
    /// held-out rows are asked of models that were fitted to those.
    ///
    /// # Errors
    /// [`Error::Undetermined`] where nothing can be chosen, or less than is asked for; [`Error::Data`] where sums leave
    /// the range of numbers.
    pub(crate) fn choose(
        &self,
        candidates: &Candidates,
        most: usize,
        count: &Count,
        chosen_on: Option<&Self>,
    ) -> Result<Chosen, Error> {
        let always = candidates.always();
        let most = most.max(always).min(self.rows.len().saturating_sub(1));
        let blocks: Vec<(&[usize], Products)> = match count {
            Count::Blocks => self.blocks().map(|rows| (rows, self.products(candidates, rows))).collect(),
            _ => Vec::new(),
        };
        let products = merged(blocks.iter().map(|(_, products)| products))
            .unwrap_or_else(|| self.products(candidates, &self.rows));
        let path = self.path(candidates, &products, most);
        if !products.is_finite() {
            return Err(Error::data(match candidates {
                Candidates::Products(_) => {
                    "sums of products of the regressors leave the range of numbers; take a lower degree, or leave out `raw-terms`, so \
                     that signals are divided by their scale"
                }
                Candidates::Functions { .. } => {
                    "sums of the functions leave the range of numbers; leave out `raw-terms`, so that signals are divided by their scale"
                }
            }));
        }
        check(candidates, &self.names(), self.rows.len(), &path, count)?;
        let lengths = path.chosen.len();
        let held_out = match count {
            Count::HeldOut(rows) => {
                let samples = chosen_on.unwrap_or(self);
                let own = chosen_on
                    .map(|others| others.path(candidates, &others.products(candidates, &others.rows), most));
                samples.on_rows(candidates, own.as_ref().unwrap_or(&path), rows, lengths)?
            }
            Count::Blocks => self.on_blocks(candidates, &blocks, lengths)?,
            Count::Given(_) | Count::Least(_) => vec![None; lengths],
        };
        let steps = self.steps(candidates, &products, &path, &held_out)?;
        let taken = count.best(&steps, always.clamp(1, lengths), products.rows());
        let places = candidates.ordered(path.places(taken));
        Ok(Chosen { map: candidates.map(&places, self.taps.len()), steps, taken })
    }

    /// The names of the regressors.
    pub(crate) fn names(&self) -> Vec<String> {
        self.head.regressors.iter().map(|one| one.name()).collect()
    }

    /// The path as documents have it.
    fn steps(
        &self,
        candidates: &Candidates,
        products: &Products,
        path: &Path,
        held_out: &[Option<RunFigures>],
    ) -> Result<Vec<TermStep>, Error> {
        let variance = products.energy() * self.scale.powi(2) / products.rows().max(1) as f64;
        let (rows, names) = (as_rows(&self.rows), self.names());
        let each = path.chosen.par_iter().zip(held_out).enumerate().map(|(at, (chosen, held_out))| {
            let run = || RunFigures::of(&self.on_path(candidates, path, at + 1), self.log, &rows);
            Ok(TermStep {
                free_run: (at + 1 >= candidates.always()).then(run).transpose()?,
                held_out: *held_out,
                ..TermStep::of(candidates, &names, chosen, at + 1, path.left(at + 1) * variance)
            })
        });
        each.collect()
    }

    /// What rows say of the models of each length of a path; nothing of lengths that the path does not have.
    fn on_rows(
        &self,
        candidates: &Candidates,
        path: &Path,
        rows: &[Rows],
        lengths: usize,
    ) -> Result<Vec<Option<RunFigures>>, Error> {
        let there = |count: &usize| (candidates.always()..=path.chosen.len()).contains(count);
        let figures = |count: usize| RunFigures::of(&self.on_path(candidates, path, count), self.log, rows);
        (1..=lengths).into_par_iter().map(|count| there(&count).then(|| figures(count)).transpose()).collect()
    }

    /// The figures of each length of the paths on blocks that these did not see, over all blocks.
    fn on_blocks(
        &self,
        candidates: &Candidates,
        blocks: &[(&[usize], Products)],
        lengths: usize,
    ) -> Result<Vec<Option<RunFigures>>, Error> {
        let mut sums = vec![Some(Sums::default()); lengths];
        for (place, (rows, _)) in blocks.iter().enumerate() {
            let others =
                blocks.iter().enumerate().filter(|(other, _)| *other != place).map(|(_, (_, sum))| sum);
            let Some(products) = merged(others) else { return Ok(vec![None; lengths]) };
            let path = self.path(candidates, &products, lengths);
            let rows = as_rows(rows);
            for (at, sum) in sums.iter_mut().enumerate() {
                let own = (candidates.always()..=path.chosen.len())
                    .contains(&(at + 1))
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
            return Err(too_few(count, self.rows.len()));
        }
        let evaluator = Evaluator::new(&map, vec![0.0; count]);
        let mut values = vec![0.0; (count + 1) * self.rows.len()];
        let each = values.par_chunks_exact_mut(count + 1).zip(&self.rows).with_min_len(ROWS);
        each.for_each_init(
            || vec![0.0; self.taps.len()],
            |z, (row, t)| {
                for (z, (source, lag)) in z.iter_mut().zip(&self.taps) {
                    *z = self.signals[*source][t - lag];
                }
                evaluator.functions(z, row);
                row[count] = self.signals[0][*t];
            },
        );
        let mut squares = vec![0.0; count];
        for row in values.chunks_exact(count + 1) {
            squares.iter_mut().zip(row).for_each(|(sum, f)| *sum += f * f);
        }
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
            CoreError::RankDeficient { column } => is_dependent(&names[column]),
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
        let scale = self.scale;
        let theta: Vec<f64> =
            solution.parameters().iter().zip(&sizes).map(|(value, size)| value / size).collect();
        let left: f64 = values
            .chunks_exact(count + 1)
            .map(|row| (row[count] - product(&row[..count], &theta)).powi(2))
            .sum::<f64>();
        let degrees = self.rows.len() - count;
        let variance = left / degrees as f64;
        // solve() counts the rows of a ridge among the samples: the shape of its covariance holds, its variance is that
        // of the samples.
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
                noise_covariance: vec![vec![variance * scale * scale]],
                degrees_of_freedom: Some(degrees),
                covariance,
                ..self.model(map, parameters)
            },
        })
    }
}

/// Refuses a path of a choice from so many samples that does not have what is asked for.
fn check(
    candidates: &Candidates,
    regressors: &[String],
    samples: usize,
    path: &Path,
    count: &Count,
) -> Result<(), Error> {
    let always = candidates.always();
    let undetermined = |message: String| Err(Error::undetermined(Vec::new(), message));
    if path.chosen.is_empty() {
        return undetermined(
            "no function explains anything of the output on the estimation rows; name rows in which it changes, other lags, or a \
             smaller `ridge` where there is one"
                .to_owned(),
        );
    }
    let taken = path.places(always);
    if let Some(missing) = (0..always).find(|place| !taken.contains(place)) {
        let name = candidates.name(missing, regressors);
        return Err(Error::undetermined(
            vec![name.clone()],
            format!(
                "{name} is a sum of the other functions on the estimation rows; take fewer lags or centres, or other rows"
            ),
        ));
    }
    let Count::Given(wanted) = *count else { return Ok(()) };
    if wanted < always {
        return Err(Error::argument(
            "terms",
            format!("{wanted} functions are asked for, and {always} are always there; ask for more"),
        ));
    }
    if wanted > path.chosen.len() {
        return undetermined(format!(
            "{wanted} functions are asked for, and {samples} samples tell {} of {} apart; take fewer `terms`, or more rows",
            path.chosen.len(),
            candidates.count(regressors.len())
        ));
    }
    Ok(())
}

/// There are not more samples than functions.
fn too_few(functions: usize, samples: usize) -> Error {
    Error::undetermined(
        Vec::new(),
        format!(
            "{functions} functions need more than {functions} samples with all regressors, there are {samples}; take fewer functions, or more \
             rows"
        ),
    )
}

/// A function that the others tell.
fn is_dependent(name: &str) -> Error {
    Error::undetermined(
        vec![name.to_owned()],
        format!("{name} is a sum of the other functions on the estimation rows; leave one of them out"),
    )
}

/// The sums of several sets of rows together; none of none.
fn merged<'p>(mut parts: impl Iterator<Item = &'p Products>) -> Option<Products> {
    let mut whole = parts.next()?.clone();
    parts.for_each(|part| whole.merge(part));
    Some(whole)
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
