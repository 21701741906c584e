//! How uncertain the matrices of a state-space model are, and with them what follows from them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::{Complex, ComplexField, DMatrix, DVector};

use super::StateSpace;
use super::eigen::{faer_of, nalgebra_of, solved, symmetric_eigen};
use crate::model::{Gradient, Quantity, Root, covariance, is_simple, standard_error};

/// Slopes are differences over such a part of a standard deviation to either side: exact to a part in a million.
pub(in crate::model) const STEP: f64 = 1e-3;
/// A direction of less variance than this, those of all being 1 on the average, is rounding.
const CERTAIN: f64 = 1e-13;

/// A matrix of a state-space model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum StateSpaceMatrix {
    /// F.
    F,
    /// G.
    G,
    /// H.
    H,
    /// D.
    D,
    /// K.
    K,
}

/// An entry of a matrix of a state-space model, rows and columns counted from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Entry {
    /// Of which matrix.
    pub matrix: StateSpaceMatrix,
    /// Its row.
    pub row: usize,
    /// Its column.
    pub column: usize,
}

/// How uncertain the matrices of a state-space model are.
///
/// In other coordinates T x of the state the matrices are T F T^-1, T G, H T^-1, D and T K, and nothing that can be
/// measured changes. So of all entries n^2 can be held, and what is estimated is how the others vary: as the free
/// entries of a canonical form do. Which entries are held is chosen so that the covariance of the others is well
/// conditioned. Poles, gains and responses have the errors that follow from it, whatever the choice; an entry by itself
/// has none (McKelvey, Helmersson and Ribarits, Automatica 40, 2004, section 2).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct EntryCovariance {
    /// The entries that vary, all others being held: n (m + 2 l), and those of D where it was estimated.
    pub entries: Vec<Entry>,
    /// Their covariance, a row and a column for each.
    pub values: Vec<Vec<f64>>,
}

/// How large signals and states are, by which entries are compared.
#[derive(Debug, Clone)]
pub(crate) struct Sizes {
    pub(crate) inputs: Vec<f64>,
    pub(crate) outputs: Vec<f64>,
    pub(crate) states: Vec<f64>,
}

impl Sizes {
    /// Those at which inputs move states of size one, and these the outputs, by one.
    fn of(model: &StateSpace) -> Self {
        let size = |norm: f64| if norm > 0.0 { norm } else { 1.0 };
        Self {
            inputs: model.g.column_iter().map(|column| 1.0 / size(column.norm())).collect(),
            outputs: model.h.row_iter().map(|row| size(row.norm())).collect(),
            states: vec![1.0; model.f.nrows()],
        }
    }
}

/// The entries of a model of n states, m inputs and l outputs, matrix by matrix, in the order of [`flat`].
fn entries(model: &StateSpace) -> impl Iterator<Item = Entry> {
    let StateSpace { f, g, h, d, k, .. } = model;
    let shapes = [
        (StateSpaceMatrix::F, f.shape()),
        (StateSpaceMatrix::G, g.shape()),
        (StateSpaceMatrix::H, h.shape()),
        (StateSpaceMatrix::D, d.shape()),
        (StateSpaceMatrix::K, k.shape()),
    ];
    shapes.into_iter().flat_map(|(matrix, (rows, columns))| {
        (0..columns).flat_map(move |column| (0..rows).map(move |row| Entry { matrix, row, column }))
    })
}

/// All entries of a model, or how they vary.
pub(crate) fn flat(model: &StateSpace) -> DVector<f64> {
    let StateSpace { f, g, h, d, k, .. } = model;
    let all = [f, g, h, d, k].into_iter().flat_map(|matrix| matrix.iter().copied());
    DVector::from_iterator(f.len() + g.len() + h.len() + d.len() + k.len(), all)
}

/// An orthonormal basis of the variations of [f, g, h, k] that are orthogonal to all changes of coordinates,
///
/// ```text
/// T f - f T,   T g,   -h T,   T k
/// ```
///
/// a column for each of the n (m + 2 l). None where singular values do not converge.
pub(crate) fn across_coordinates(
    f: &DMatrix<f64>,
    driven: &[&DMatrix<f64>],
    h: &DMatrix<f64>,
) -> Option<DMatrix<f64>> {
    let (n, l) = (f.nrows(), h.nrows());
    let columns: usize = driven.iter().map(|matrix| matrix.ncols()).sum();
    let size = n * (n + columns + l);
    let mut tangent = DMatrix::zeros(size, n * n);
    for row in 0..n {
        for column in 0..n {
            // T has one entry, that of a row and a column.
            let mut moved = tangent.column_mut(row + n * column);
            for other in 0..n {
                moved[row + n * other] += f[(column, other)];
                moved[other + n * column] -= f[(other, row)];
            }
            let mut first = n * n;
            for matrix in driven {
                for (place, entry) in matrix.row(column).iter().enumerate() {
                    moved[first + row + n * place] = *entry;
                }
                first += matrix.len();
            }
            for output in 0..l {
                moved[first + output + l * column] = -h[(output, row)];
            }
        }
    }
    let decomposed = faer_of(&tangent).svd().ok()?;
    Some(nalgebra_of(decomposed.U().subcols(n * n, size - n * n)))
}

/// From a source to an output: an input, or with a single output its noise.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Path {
    pub(crate) output: usize,
    pub(crate) input: Option<usize>,
}

impl Path {
    /// How the response h (q I - F)^-1 g + d moves with an entry, with weights w' = h (q I - F)^-1 and states v = (q
    /// I - F)^-1 g:
    ///
    /// ```text
    /// dh v + w' dF v + w' dg + dd
    /// ```
    pub(crate) fn slope(
        self,
        &Entry { matrix, row, column }: &Entry,
        weights: &DVector<Complex<f64>>,
        states: &DVector<Complex<f64>>,
    ) -> Complex<f64> {
        let is_source = match self.input {
            Some(input) => matches!(matrix, StateSpaceMatrix::G | StateSpaceMatrix::D) && column == input,
            None => matrix == StateSpaceMatrix::K,
        };
        match matrix {
            StateSpaceMatrix::F => weights[row] * states[column],
            StateSpaceMatrix::H if row == self.output => states[column],
            StateSpaceMatrix::G | StateSpaceMatrix::K if is_source => weights[row],
            StateSpaceMatrix::D if is_source && row == self.output => Complex::new(1.0, 0.0),
            _ => Complex::new(0.0, 0.0),
        }
    }
}

impl EntryCovariance {
    /// The covariance of a model's entries from `factor`, all of whose columns are variations of the [`flat`] entries:
    /// their covariance is the product of it with its transpose, along changes of coordinates whatever it may be. With
    /// N the basis that is [across coordinates](across_coordinates), N' is the same for a variation and for one of the
    /// free entries alone,
    ///
    /// ```text
    /// N_S' b = N' d
    /// ```
    ///
    /// N_S being its rows of the free entries: those that a QR factor of N' with pivots takes first. None where that
    /// fails.
    pub(crate) fn new(
        model: &StateSpace,
        feedthrough: bool,
        sizes: &Sizes,
        factor: &DMatrix<f64>,
    ) -> Option<Self> {
        let (n, l) = (model.f.nrows(), model.h.nrows());
        // Of the size that an entry has in units in which signals and states are of size one.
        let unit = |entry: &Entry| {
            let (to, from) = match entry.matrix {
                StateSpaceMatrix::F => (&sizes.states, &sizes.states),
                StateSpaceMatrix::G => (&sizes.states, &sizes.inputs),
                StateSpaceMatrix::H => (&sizes.outputs, &sizes.states),
                StateSpaceMatrix::D => (&sizes.outputs, &sizes.inputs),
                StateSpaceMatrix::K => (&sizes.states, &sizes.outputs),
            };
            to[entry.row] / from[entry.column]
        };
        let all: Vec<Entry> = entries(model).collect();
        let units: Vec<f64> = all.iter().map(unit).collect();
        let scaled = flat(model).component_div(&DVector::from_column_slice(&units));
        let part = |first: usize, like: &DMatrix<f64>| {
            DMatrix::from_column_slice(
                like.nrows(),
                like.ncols(),
                &scaled.as_slice()[first..first + like.len()],
            )
        };
        let StateSpace { f, g, h, d, k, .. } = model;
        let first_h = f.len() + g.len();
        let first_d = first_h + h.len();
        let first_k = first_d + d.len();
        let (scaled_f, scaled_g) = (part(0, f), part(f.len(), g));
        let (scaled_h, scaled_k) = (part(first_h, h), part(first_k, k));
        let across = across_coordinates(&scaled_f, &[&scaled_g, &scaled_k], &scaled_h)?;
        // There K comes before H, and D is not there.
        let (first_of_k, first_of_h) = (first_h, first_h + n * l);
        let row_of = |entry: usize| match all[entry].matrix {
            StateSpaceMatrix::F | StateSpaceMatrix::G => Some(entry),
            StateSpaceMatrix::H => Some(first_of_h + entry - first_h),
            StateSpaceMatrix::K => Some(first_of_k + entry - first_k),
            StateSpaceMatrix::D => None,
        };
        let direct = if feedthrough { d.len() } else { 0 };
        let rank = across.ncols() + direct;
        // The rows of the basis in the order of the entries; each entry of D is a direction of its own.
        let mut basis = DMatrix::zeros(all.len(), rank);
        for entry in 0..all.len() {
            match row_of(entry) {
                Some(row) => basis.view_mut((entry, 0), (1, across.ncols())).copy_from(&across.row(row)),
                None if feedthrough => basis[(entry, across.ncols() + entry - first_d)] = 1.0,
                None => {}
            }
        }
        let mut free = pivots(&basis, rank)?;
        free.sort_unstable();
        let mut varied = factor.clone();
        varied.row_iter_mut().zip(&units).for_each(|(mut row, unit)| row /= *unit);
        let mut moved = solved(basis.select_rows(&free).transpose(), &basis.tr_mul(&varied))?;
        moved.row_iter_mut().zip(&free).for_each(|(mut row, entry)| row *= units[*entry]);
        let covariance = &moved * moved.transpose();
        if !covariance.iter().all(|value| value.is_finite()) {
            return None;
        }
        Some(Self {
            entries: free.iter().map(|entry| all[*entry]).collect(),
            values: covariance.row_iter().map(|row| row.iter().copied().collect()).collect(),
        })
    }

    /// The same of a model whose inputs wait: see [`StateSpace::delayed`]. What an input does is then what the last of
    /// its states does.
    pub(super) fn delayed(mut self, states: usize, delays: &[usize]) -> Self {
        for entry in &mut self.entries {
            let waits = |matrix| matches!(matrix, StateSpaceMatrix::G | StateSpaceMatrix::D);
            if waits(entry.matrix) && delays[entry.column] > 0 {
                let seen = states + delays[..=entry.column].iter().sum::<usize>() - 1;
                let matrix = if entry.matrix == StateSpaceMatrix::G {
                    StateSpaceMatrix::F
                } else {
                    StateSpaceMatrix::H
                };
                *entry = Entry { matrix, column: seen, ..*entry };
            }
        }
        self
    }

    /// The model to either side along each of as many independent directions as it varies in, [`STEP`] standard
    /// deviations away.
    pub(in crate::model) fn varied(&self, model: &StateSpace) -> Option<Vec<[StateSpace; 2]>> {
        let moved = |direction: &DVector<f64>, sign: f64| {
            let mut moved = model.clone();
            for (entry, by) in self.entries.iter().zip(direction.iter()) {
                let matrix = match entry.matrix {
                    StateSpaceMatrix::F => &mut moved.f,
                    StateSpaceMatrix::G => &mut moved.g,
                    StateSpaceMatrix::H => &mut moved.h,
                    StateSpaceMatrix::D => &mut moved.d,
                    StateSpaceMatrix::K => &mut moved.k,
                };
                matrix[(entry.row, entry.column)] += sign * STEP * by;
            }
            moved
        };
        let directions = independent(&self.values)?;
        Some(directions.iter().map(|direction| [1.0, -1.0].map(|sign| moved(direction, sign))).collect())
    }

    /// The covariance of the entries of a model that such pairs have become.
    pub(in crate::model) fn of_pairs(model: &StateSpace, pairs: &[[StateSpace; 2]]) -> Option<Self> {
        let moved = |[plus, minus]: &[StateSpace; 2]| (flat(plus) - flat(minus)) / (2.0 * STEP);
        let columns: Vec<DVector<f64>> = pairs.iter().map(moved).collect();
        if columns.is_empty() {
            return None;
        }
        let factor = DMatrix::from_columns(&columns);
        let first = model.f.len() + model.g.len() + model.h.len();
        let feedthrough = factor.rows(first, model.d.len()).iter().any(|slope| *slope != 0.0);
        Self::new(model, feedthrough, &Sizes::of(model), &factor)
    }

    /// How something varies with the free entries.
    pub(crate) fn gradient(&self, of: impl Fn(&Entry) -> Complex<f64>) -> Gradient {
        self.entries.iter().map(of).enumerate().collect()
    }

    /// Gives static gains h M^-1 g + d, a list of those of all inputs for each output, the standard errors that follow:
    /// M is I - F of a sampled model and -A in continuous time. None are given where M is singular.
    pub(super) fn spread_gains(
        &self,
        gains: &mut [Vec<Option<Quantity>>],
        still: &DMatrix<f64>,
        g: &DMatrix<f64>,
        h: &DMatrix<f64>,
    ) {
        let complex = |matrix: DMatrix<f64>| matrix.map(|entry| Complex::new(entry, 0.0));
        let (states, weights) = (solved(still.clone(), g), solved(still.transpose(), &h.transpose()));
        let (Some(states), Some(weights)) = (states.map(complex), weights.map(complex)) else { return };
        for (output, gains) in gains.iter_mut().enumerate() {
            for (input, gain) in gains.iter_mut().enumerate() {
                let path = Path { output, input: Some(input) };
                let (weights, states) =
                    (weights.column(output).into_owned(), states.column(input).into_owned());
                let gradient = self.gradient(|entry| path.slope(entry, &weights, &states));
                if let Some(gain) = gain {
                    gain.standard_error = standard_error(Some(&self.values), &gradient);
                }
            }
        }
    }

    /// Whether it is one of a model of these sizes.
    pub(super) fn fits(&self, model: &StateSpace) -> bool {
        let shape = |matrix| match matrix {
            StateSpaceMatrix::F => model.f.shape(),
            StateSpaceMatrix::G => model.g.shape(),
            StateSpaceMatrix::H => model.h.shape(),
            StateSpaceMatrix::D => model.d.shape(),
            StateSpaceMatrix::K => model.k.shape(),
        };
        let inside = |entry: &Entry| {
            let (rows, columns) = shape(entry.matrix);
            entry.row < rows && entry.column < columns
        };
        let size = self.entries.len();
        let square = self.values.len() == size && self.values.iter().all(|row| row.len() == size);
        square
            && self.entries.iter().all(inside)
            && self.values.iter().flatten().all(|value| value.is_finite())
    }
}

/// Directions, the sum of whose products with themselves is a covariance.
pub(in crate::model) fn independent(covariance: &[Vec<f64>]) -> Option<Vec<DVector<f64>>> {
    let size = covariance.len();
    let scale = |row: usize| covariance[row][row].max(0.0).sqrt();
    let scaled = DMatrix::from_fn(size, size, |row, column| {
        let product = scale(row) * scale(column);
        if product > 0.0 { covariance[row][column] / product } else { 0.0 }
    });
    let (values, vectors) = symmetric_eigen(&scaled)?;
    let seen = values.iter().enumerate().filter(|(_, value)| **value > CERTAIN);
    let direction = |(place, value): (usize, &f64)| {
        DVector::from_fn(size, |row, _| vectors[(row, place)] * scale(row) * value.sqrt())
    };
    Some(seen.map(direction).collect())
}

/// The rows that a QR factor of the transpose takes first, as many as there are columns: of what the rows taken before
/// leave, each time the largest. None if those of the basis depend on one another.
fn pivots(basis: &DMatrix<f64>, rank: usize) -> Option<Vec<usize>> {
    let mut left = basis.transpose();
    let mut taken = Vec::with_capacity(rank);
    for _ in 0..rank {
        let norms = left.column_iter().map(|column| column.norm_squared()).enumerate();
        // The first of equal ones.
        let (place, _) = norms.fold((0, 0.0), |best, next| if next.1 > best.1 { next } else { best });
        let direction = left.column(place).into_owned().try_normalize(f64::EPSILON)?;
        let along = left.tr_mul(&direction);
        left.ger(-1.0, &direction, &along, 1.0);
        // Nothing but rounding is left of it.
        left.column_mut(place).fill(0.0);
        taken.push(place);
    }
    Some(taken)
}

/// Gives the roots that are eigenvalues of `matrix` the covariances that follow, `slope` saying how an entry of the
/// model moves it: for a simple eigenvalue with right and left eigenvectors v and w
///
/// ```text
/// d lambda = w' dM v/(w' v)
/// ```
///
/// (Stewart and Sun, Matrix Perturbation Theory, 1990, theorem IV.2.3). Those that have another one within four of
/// their standard deviations have none, and those of states that wait. O(n^3) for each.
pub(super) fn spread(
    roots: &mut [Root],
    matrix: &DMatrix<f64>,
    known: &EntryCovariance,
    slope: impl Fn(&Entry, &DVector<Complex<f64>>, &DVector<Complex<f64>>) -> Complex<f64>,
) {
    let all: Vec<Complex<f64>> = roots.iter().map(|root| Complex::new(root.re, root.im)).collect();
    for (place, root) in roots.iter_mut().enumerate() {
        let value = all[place];
        let Some([left, right]) = eigenvectors(matrix, value) else { continue };
        let gradient = known.gradient(|entry| slope(entry, &left, &right));
        let found = covariance(&known.values, &gradient).filter(|_| value != Complex::new(0.0, 0.0));
        root.covariance = found.filter(|found| is_simple(place, &all, found));
    }
}

/// The left and the right eigenvector of an eigenvalue, so that w' v = 1; none where it is not simple.
fn eigenvectors(matrix: &DMatrix<f64>, value: Complex<f64>) -> Option<[DVector<Complex<f64>>; 2]> {
    let n = matrix.nrows();
    let shifted = faer::Mat::from_fn(n, n, |row, column| {
        let diagonal = if row == column { value } else { Complex::new(0.0, 0.0) };
        faer::c64::new(matrix[(row, column)] - diagonal.re, -diagonal.im)
    });
    let decomposed = shifted.svd().ok()?;
    let (left, right) = (decomposed.U().col(n - 1), decomposed.V().col(n - 1));
    let right = DVector::from_fn(n, |row, _| Complex::new(right[row].re, right[row].im));
    // w' is the conjugate of u'.
    let left = DVector::from_fn(n, |row, _| Complex::new(left[row].re, -left[row].im));
    let product = left.dot(&right);
    (product.modulus() > f64::EPSILON * n as f64).then(|| [left / product, right])
}

#[cfg(test)]
mod tests {
    use super::super::StateSpaceModel;
    use super::*;
    use crate::Error;
    use crate::data::Offset;
    use crate::model::Signal;
    use thetahat_numerics::random::Random;

    fn plant() -> StateSpace {
        StateSpace {
            f: DMatrix::from_row_slice(3, 3, &[0.8, 0.3, 0.0, -0.3, 0.8, 0.1, 0.0, 0.0, 0.5]),
            g: DMatrix::from_row_slice(3, 2, &[1.0, 0.2, 0.5, -1.0, 0.3, 0.4]),
            h: DMatrix::from_row_slice(2, 3, &[1.0, 0.0, 0.5, 0.2, 1.0, 1.0]),
            d: DMatrix::from_row_slice(2, 2, &[0.1, 0.0, 0.3, 0.2]),
            k: DMatrix::from_row_slice(3, 2, &[0.2, 0.1, 0.0, 0.3, 0.1, 0.1]),
            noise_covariance: DMatrix::identity(2, 2),
            sample_time: 0.5,
        }
    }

    fn like(model: &StateSpace, entry: &mut impl FnMut() -> f64) -> StateSpace {
        let mut matrix = |like: &DMatrix<f64>| DMatrix::from_fn(like.nrows(), like.ncols(), |_, _| entry());
        StateSpace {
            f: matrix(&model.f),
            g: matrix(&model.g),
            h: matrix(&model.h),
            d: matrix(&model.d),
            k: matrix(&model.k),
            ..model.clone()
        }
    }

    /// The same in coordinates T x; how a model varies changes as the model does.
    fn turned(model: &StateSpace, t: &DMatrix<f64>, back: &DMatrix<f64>) -> StateSpace {
        StateSpace {
            f: t * &model.f * back,
            g: t * &model.g,
            h: &model.h * back,
            k: t * &model.k,
            ..model.clone()
        }
    }

    fn sizes() -> Sizes {
        Sizes { inputs: vec![1.0, 3.0], outputs: vec![2.0, 1.0], states: vec![1.0, 2.0, 0.5] }
    }

    fn known(model: &StateSpace, delays: &[usize], varied: &[StateSpace]) -> Result<StateSpaceModel, Error> {
        let signal = |name: &str| Signal { name: name.to_owned(), offset: Offset::default() };
        let signals = (["u", "v"].map(signal).to_vec(), ["y", "z"].map(signal).to_vec());
        let factor = DMatrix::from_columns(&varied.iter().map(flat).collect::<Vec<_>>());
        let covariance = EntryCovariance::new(model, true, &sizes(), &factor);
        let covariance = covariance.ok_or_else(|| Error::data("no covariance"))?;
        Ok(StateSpaceModel::new(signals, delays.to_vec(), model, 25, None)?.with_covariance(covariance))
    }

    /// Variances of the parts of poles, and standard errors of static gains.
    fn errors(model: &StateSpaceModel) -> Vec<f64> {
        let roots = model.poles.iter().chain(&model.predictor_poles).filter_map(|root| root.covariance);
        let gains = model.dc_gain.iter().flatten().flatten().filter_map(|gain| gain.standard_error);
        roots.flat_map(|rows| [rows[0][0], rows[0][1], rows[1][1]]).chain(gains).collect()
    }

    fn assert_near(found: &[f64], expected: &[f64]) {
        assert_eq!(found.len(), expected.len());
        let largest = expected.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-9 * largest, "{found} {expected}");
        }
    }

    #[test]
    fn errors_do_not_depend_on_coordinates() -> Result<(), Error> {
        let mut random = Random::of(3, 0);
        let model = plant();
        let varied: Vec<StateSpace> = (0..30).map(|_| like(&model, &mut || 1e-3 * random.normal())).collect();
        let own = known(&model, &[0, 0], &varied)?;
        let entries = own.covariance.as_ref().map(|covariance| covariance.entries.len());
        assert_eq!(entries, Some(3 * (2 + 4) + 4));
        let found = errors(&own);
        assert_eq!(found.len(), 3 * (3 + 3) + 4);
        // To first order they are those of variations themselves.
        let spread: f64 = varied
            .iter()
            .map(|by| {
                let gain = |sign: f64| {
                    let f = &model.f + &by.f * sign;
                    let inside = solved(DMatrix::identity(3, 3) - f, &(&model.g + &by.g * sign));
                    inside.map_or(f64::NAN, |inside| {
                        ((&model.h + &by.h * sign) * inside + &model.d + &by.d * sign)[(1, 0)]
                    })
                };
                (0.5 * (gain(1.0) - gain(-1.0))).powi(2)
            })
            .sum();
        let gain = own.dc_gain[1][0].and_then(|gain| gain.standard_error).unwrap_or(f64::NAN);
        assert!((gain / spread.sqrt() - 1.0).abs() < 1e-3, "{gain} {}", spread.sqrt());

        let t = DMatrix::from_row_slice(3, 3, &[2.0, 0.3, 0.0, -1.0, 0.7, 0.2, 0.5, 0.0, 1.5]);
        let back = solved(t.clone(), &DMatrix::identity(3, 3)).ok_or_else(|| Error::data("singular"))?;
        let turned_variations: Vec<StateSpace> = varied.iter().map(|by| turned(by, &t, &back)).collect();
        assert_near(&errors(&known(&turned(&model, &t, &back), &[0, 0], &turned_variations)?), &found);
        Ok(())
    }

    #[test]
    fn a_change_of_coordinates_is_no_error() -> Result<(), Error> {
        let model = plant();
        let t = DMatrix::from_row_slice(3, 3, &[0.2, 0.3, 0.0, -1.0, 0.7, 0.2, 0.5, 0.0, 0.4]);
        let moved = StateSpace {
            f: &t * &model.f - &model.f * &t,
            g: &t * &model.g,
            h: -&model.h * &t,
            d: DMatrix::zeros(2, 2),
            k: &t * &model.k,
            ..model.clone()
        };
        let found = known(&model, &[0, 0], &[moved])?;
        let values = found.covariance.iter().flat_map(|covariance| covariance.values.iter().flatten());
        assert!(values.fold(0.0_f64, |largest, value| largest.max(value.abs())) < 1e-24);
        Ok(())
    }

    #[test]
    fn inputs_that_wait_have_the_same_errors() -> Result<(), Error> {
        let mut random = Random::of(4, 0);
        let model = plant();
        let varied: Vec<StateSpace> = (0..30).map(|_| like(&model, &mut || 1e-3 * random.normal())).collect();
        let (own, waits) = (known(&model, &[0, 0], &varied)?, known(&model, &[2, 1], &varied)?);
        assert_near(&errors(&waits), &errors(&own));
        Ok(())
    }
}
