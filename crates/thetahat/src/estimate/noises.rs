//! Linear models in matrices: the noises of the largest likelihood.
//!
//! The covariance of the noises is made of a factor, [v; w] = L e with unit variances of e, so that it is positive
//! semidefinite whatever L is:
//!
//! ```text
//! [ R   S' ]
//! [ S   Q  ] = L L'
//! ```
//!
//! Which entries of L are unknown says a [`NoiseStructure`]. Their likelihood is that of the innovations of the Kalman
//! filter, which the search of models in equations makes as large as it can: see
//! [`largest_likelihood_of`](super::equations::largest_likelihood_of).

mod array;
mod likelihood;

use thetahat_core::nalgebra::DMatrix;
use thetahat_numerics::optimize::{Monitor, Search};

use super::equations::{EquationsEstimate, Likelihood, largest_likelihood_of, listed};
use crate::Error;
use crate::model::equations::{Scale, Unknown};
use crate::respond::equations::Failure;
pub(crate) use array::Plant;
use likelihood::NoiseLikelihood;

/// Of the noises of a linear model, what is unknown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum NoiseStructure {
    /// The variances of Q and R, which have no other entries. One that is 0 stays 0. The log tells them apart more
    /// often than those of the others, which is why it is what is taken unless another is asked for.
    #[default]
    Diagonal,
    /// All entries of Q and R, of states and outputs whose variances are not 0. Of Q there must be no more than n m, n
    /// states and m outputs: so many of them the innovations tell (Mehra, On the identification of variances and
    /// adaptive Kalman filtering, IEEE Transactions on Automatic Control 15, 1970, section III).
    Full,
    /// Two numbers, which Q and R are multiplied by.
    Scaled,
    /// w = K v, so that S = K R and Q = K R K': all entries of R and K. Whatever Q, R and S are, their predictions are
    /// those of such noises once the start is forgotten (Anderson and Moore, Optimal Filtering, 1979, section 9.4), so
    /// that no more of the three together can be told.
    Innovations,
}

/// An entry of L: a parameter times a number.
#[derive(Debug, Clone)]
struct Entry {
    row: usize,
    column: usize,
    parameter: usize,
    weight: f64,
}

/// L as a function of unknown parameters. Rows: the outputs, then the states.
#[derive(Debug, Clone)]
pub(crate) struct Noises {
    rows: usize,
    columns: usize,
    entries: Vec<Entry>,
    unknown: Vec<Unknown>,
}

/// A log: rows, and how many sample times there are from the row before to each. NaN is a missing output.
#[derive(Debug, Clone)]
pub(crate) struct Rows {
    pub(crate) steps: Vec<usize>,
    /// Row after row.
    pub(crate) inputs: Vec<f64>,
    pub(crate) outputs: Vec<f64>,
    /// A row in which nothing was measured.
    pub(crate) nothing: Vec<f64>,
}

impl Rows {
    fn input(&self, row: usize, width: usize) -> &[f64] {
        &self.inputs[row * width..(row + 1) * width]
    }

    fn output(&self, row: usize, width: usize) -> &[f64] {
        &self.outputs[row * width..(row + 1) * width]
    }
}

/// The covariances of the noises of a model, n x n, m x m and n x m.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Covariances {
    pub(crate) q: DMatrix<f64>,
    pub(crate) r: DMatrix<f64>,
    pub(crate) s: DMatrix<f64>,
}

/// What was found.
pub(crate) struct NoisesEstimate {
    pub(crate) covariances: Covariances,
    /// The standard errors of their entries: 0 of what is known, NaN of a variance that came out 0.
    pub(crate) errors: Covariances,
    /// The noises that came out 0.
    pub(crate) vanishing: Vec<String>,
    pub(crate) found: EquationsEstimate,
}

/// The noises of the largest likelihood, from those that are given. States and outputs have these names.
///
/// # Errors
/// [`Error::Argument`] if the structure is not for these noises; [`Error::Undetermined`] with the names of entries that
/// the logs do not tell apart; those of a search; and what `failed` says where the filter ceases to work.
pub(crate) fn likeliest_noises(
    plant: &Plant,
    (given, names): (&Covariances, (&[String], &[String])),
    structure: NoiseStructure,
    logs: &[Rows],
    failed: impl Fn(Failure) -> Error,
    (options, monitor): (&Search, Monitor<'_>),
) -> Result<NoisesEstimate, Error> {
    let noises = Noises::new(plant, given, names, structure)?;
    let mut criterion = NoiseLikelihood::new(plant, &noises, logs);
    noises.check_seen(&mut criterion, &failed)?;
    let found = largest_likelihood_of(criterion, &noises.unknown, failed, options, monitor)?;
    let (covariances, errors) = noises.covariances(&found, plant.h.nrows());
    let vanishing = noises.vanishing(&found);
    Ok(NoisesEstimate { covariances, errors, vanishing, found })
}

impl Noises {
    fn new(
        plant: &Plant,
        given: &Covariances,
        (states, outputs): (&[String], &[String]),
        structure: NoiseStructure,
    ) -> Result<Self, Error> {
        let (m, n) = plant.h.shape();
        let refused = |message: &str| Error::argument("structure", message);
        if structure != NoiseStructure::Innovations && given.s.iter().any(|entry| *entry != 0.0) {
            return Err(refused(
                "S of the model is not 0, and Q, R and S together cannot be told apart: take 'innovations', or leave S out",
            ));
        }
        let columns = if structure == NoiseStructure::Innovations { m } else { m + n };
        let mut noises = Self { rows: m + n, columns, entries: Vec::new(), unknown: Vec::new() };
        let blocks = [(&given.r, "R", outputs, 0), (&given.q, "Q", states, m)];
        match structure {
            NoiseStructure::Diagonal => {
                for (matrix, name, names, first) in blocks {
                    let is_diagonal = (0..matrix.nrows())
                        .all(|i| (0..matrix.nrows()).all(|j| i == j || matrix[(i, j)] == 0.0));
                    if !is_diagonal {
                        return Err(refused(&format!(
                            "{name} of the model is not diagonal: take 'full' to find all entries, or 'scaled' to keep their ratios"
                        )));
                    }
                    for (index, own) in names.iter().enumerate() {
                        let deviation = matrix[(index, index)].sqrt();
                        if deviation > 0.0 {
                            let entry = (first + index, first + index);
                            noises.push(
                                entry,
                                format!("{name}[{own}]"),
                                Scale::Above(0.0),
                                deviation,
                                deviation,
                            );
                        }
                    }
                }
            }
            NoiseStructure::Full => {
                let noisy = (0..n).filter(|&state| given.q[(state, state)] > 0.0).count();
                if noisy * (noisy + 1) / 2 > n * m {
                    let names: Vec<String> = states
                        .iter()
                        .enumerate()
                        .filter(|(state, _)| given.q[(*state, *state)] > 0.0)
                        .map(|(_, name)| format!("Q[{name}]"))
                        .collect();
                    let message = format!(
                        "of Q, {} numbers are unknown, but {m} outputs of {n} states tell no more than {} of them: {} and \
                         what they have in common; take 'diagonal', 'scaled' or 'innovations', or write 0 where a state has no noise",
                        noisy * (noisy + 1) / 2,
                        n * m,
                        listed(&names)
                    );
                    return Err(Error::undetermined(names, message));
                }
                for (matrix, name, names, first) in blocks {
                    noises.push_block(&root(matrix), (matrix, name, names), first);
                }
            }
            NoiseStructure::Scaled => {
                for (matrix, name, _, first) in blocks {
                    let factor = root(matrix);
                    let parameter = noises.unknown.len();
                    let entries =
                        (0..factor.nrows()).flat_map(|row| (0..=row).map(move |column| (row, column)));
                    for (row, column) in entries.filter(|entry| factor[*entry] != 0.0) {
                        let weight = factor[(row, column)];
                        noises.entries.push(Entry {
                            row: first + row,
                            column: first + column,
                            parameter,
                            weight,
                        });
                    }
                    if noises.entries.last().is_some_and(|entry| entry.parameter == parameter) {
                        noises.unknown.push(unknown(name.to_owned(), Scale::Above(0.0), 1.0, 1.0));
                    }
                }
            }
            NoiseStructure::Innovations => {
                let (r, s) = innovations_form(plant, given).ok_or_else(|| {
                    refused(
                        "the Kalman filter of the model's own Q and R has no innovations: give an R above 0",
                    )
                })?;
                let factor = root(&r);
                noises.push_block(&factor, (&r, "R", outputs), 0);
                // S = L_S L_R'.
                let by_noise = factor.solve_lower_triangular(&s.transpose()).unwrap_or_else(|| s.transpose());
                for (state, state_name) in states.iter().enumerate() {
                    for (output, output_name) in outputs.iter().enumerate() {
                        let start = by_noise[(output, state)];
                        let deviation = by_noise.column(state).norm().max(r[(output, output)].sqrt());
                        let name = format!("S[{state_name}, {output_name}]");
                        noises.push((m + state, output), name, Scale::Free, start, deviation);
                    }
                }
            }
        }
        if noises.unknown.is_empty() {
            return Err(refused("all variances of the model are 0, and stay so: give others to start from"));
        }
        Ok(noises)
    }

    /// Refuses a noise on which nothing depends: a search would find it to be 0.
    fn check_seen(
        &self,
        criterion: &mut NoiseLikelihood<'_>,
        failed: impl Fn(Failure) -> Error,
    ) -> Result<(), Error> {
        let start: Vec<f64> = self.unknown.iter().map(|unknown| unknown.start_variable().0).collect();
        criterion.linearize(&start).map_err(failed)?;
        let (size, information) = (start.len(), &criterion.slopes().information);
        let unseen = |(index, unknown): (usize, &Unknown)| {
            (information[index * size + index] <= 0.0).then(|| unknown.name.clone())
        };
        let unseen: Vec<String> = self.unknown.iter().enumerate().filter_map(unseen).collect();
        if unseen.is_empty() || criterion.measurements() <= size {
            return Ok(());
        }
        let message = format!(
            "nothing that was measured depends on {}: write 0 there, or measure an output that it acts on",
            listed(&unseen)
        );
        Err(Error::undetermined(unseen, message))
    }

    /// The names of variances that came out 0: of entries of the factor, all that is left of a variance where those
    /// before it are known.
    fn vanishing(&self, found: &EquationsEstimate) -> Vec<String> {
        let left = |entry: &&Entry| found.z[entry.parameter] == f64::NEG_INFINITY;
        let others = |entry: &Entry| {
            let same = |other: &&Entry| other.row == entry.row && found.values[other.parameter] != 0.0;
            self.entries.iter().any(|other| same(&other))
        };
        let name = |entry: &Entry| {
            let name = &self.unknown[entry.parameter].name;
            match name.strip_suffix(']').filter(|_| others(entry)) {
                Some(name) => format!("{name} given the others]"),
                None => name.clone(),
            }
        };
        let mut names: Vec<String> = self.entries.iter().filter(left).map(name).collect();
        names.dedup();
        names
    }

    fn push(
        &mut self,
        (row, column): (usize, usize),
        name: String,
        scale: Scale,
        start: f64,
        deviation: f64,
    ) {
        self.entries.push(Entry { row, column, parameter: self.unknown.len(), weight: 1.0 });
        self.unknown.push(unknown(name, scale, start, deviation));
    }

    /// All entries of a triangular block that belong to variances above 0.
    fn push_block(
        &mut self,
        factor: &DMatrix<f64>,
        (matrix, name, names): (&DMatrix<f64>, &str, &[String]),
        first: usize,
    ) {
        for (row, row_name) in names.iter().enumerate() {
            let deviation = matrix[(row, row)].sqrt();
            for (column, column_name) in names.iter().enumerate().take(row + 1) {
                if matrix[(row, row)] <= 0.0 || matrix[(column, column)] <= 0.0 {
                    continue;
                }
                let entry = (first + row, first + column);
                if row == column {
                    // A search from a singular matrix leaves it.
                    let start = factor[(row, row)].max(LEAST * deviation);
                    self.push(entry, format!("{name}[{row_name}]"), Scale::Above(0.0), start, deviation);
                } else {
                    let name = format!("{name}[{row_name}, {column_name}]");
                    self.push(entry, name, Scale::Free, factor[(row, column)], deviation);
                }
            }
        }
    }

    /// The covariances and the standard errors of their entries, by the delta method: with C = L L',
    /// dC_ij/dp = Σ_k (dL_ik/dp L_jk + L_ik dL_jk/dp).
    fn covariances(&self, found: &EquationsEstimate, outputs: usize) -> (Covariances, Covariances) {
        let (rows, size) = (self.rows, self.unknown.len());
        let mut factor = DMatrix::<f64>::zeros(rows, self.columns);
        for entry in &self.entries {
            factor[(entry.row, entry.column)] += entry.weight * found.values[entry.parameter];
        }
        let joint = &factor * factor.transpose();
        let mut slopes = vec![DMatrix::<f64>::zeros(rows, rows); size];
        let mut vanishes = DMatrix::from_element(rows, rows, false);
        for entry in &self.entries {
            for other in 0..rows {
                let slope = entry.weight * factor[(other, entry.column)];
                slopes[entry.parameter][(entry.row, other)] += slope;
                slopes[entry.parameter][(other, entry.row)] += slope;
            }
            if found.z[entry.parameter] == f64::NEG_INFINITY && joint[(entry.row, entry.row)] == 0.0 {
                vanishes[(entry.row, entry.row)] = true;
            }
        }
        let errors = DMatrix::from_fn(rows, rows, |i, j| {
            if vanishes[(i, j)] {
                return f64::NAN;
            }
            let pairs = (0..size).flat_map(|a| (0..size).map(move |b| (a, b)));
            let variance: f64 =
                pairs.map(|(a, b)| slopes[a][(i, j)] * found.covariance[(a, b)] * slopes[b][(i, j)]).sum();
            variance.max(0.0).sqrt()
        });
        let split = |joint: &DMatrix<f64>| {
            let (m, n) = (outputs, rows - outputs);
            Covariances {
                q: joint.view((m, m), (n, n)).into_owned(),
                r: joint.view((0, 0), (m, m)).into_owned(),
                s: joint.view((m, 0), (n, m)).into_owned(),
            }
        };
        (split(&joint), split(&errors))
    }
}

/// A search begins at no pivot that is smaller than this fraction of its standard deviation.
const LEAST: f64 = 1e-3;

fn unknown(name: String, scale: Scale, start: f64, deviation: f64) -> Unknown {
    Unknown { name, scale, start, deviation, walk: 0.0, unit: None, of_noise: true }
}

/// The lower triangular L of a positive semidefinite matrix L L', with columns of zeros where nothing is left.
pub(crate) fn root(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let size = matrix.nrows();
    let mut root = DMatrix::<f64>::zeros(size, size);
    for column in 0..size {
        let left = |row: usize| -> f64 {
            matrix[(row, column)] - (0..column).map(|k| root[(row, k)] * root[(column, k)]).sum::<f64>()
        };
        let pivot = left(column);
        if pivot <= f64::EPSILON * size as f64 * matrix[(column, column)] {
            continue;
        }
        let below: Vec<f64> = (column..size).map(|row| left(row) / pivot.sqrt()).collect();
        for (offset, entry) in below.into_iter().enumerate() {
            root[(column + offset, column)] = entry;
        }
    }
    root
}

/// Samples after which a filter is taken to have settled.
const SETTLED: usize = 1000;

/// R and S of the innovations that the Kalman filter of these noises has after many samples; none if it has none.
fn innovations_form(plant: &Plant, given: &Covariances) -> Option<(DMatrix<f64>, DMatrix<f64>)> {
    let Plant { f, h, start, .. } = plant;
    let mut p = start * start.transpose();
    let mut step = || -> Option<(DMatrix<f64>, DMatrix<f64>)> {
        let innovation = h * &p * h.transpose() + &given.r;
        let cross = f * &p * h.transpose() + &given.s;
        let gain = innovation.clone().cholesky()?.solve(&cross.transpose()).transpose();
        p = f * &p * f.transpose() + &given.q - &gain * cross.transpose();
        p = (&p + p.transpose()) * 0.5;
        Some((innovation, cross))
    };
    for _ in 1..SETTLED {
        step()?;
    }
    step().filter(|(r, s)| r.iter().chain(s).all(|entry| entry.is_finite()))
}
