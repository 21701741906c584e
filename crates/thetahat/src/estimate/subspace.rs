//! State-space models of any number of outputs by a subspace method.

mod data;
mod innovations;
mod joint;
mod lagged_products;
mod ordered;
mod sums;
#[cfg(test)]
pub(super) mod tests;
mod weighting;

use std::ops::RangeInclusive;

use rayon::prelude::*;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::{DMatrix, DVector};
use thetahat_numerics::optimize::normal;

use super::refinement::RefinementOutcome;
use super::thinning::thinned_joint;
use crate::Error;
use crate::data::JointRecord;
use crate::model::{StateSpace, is_stable, riccati};
pub(super) use data::SubspaceData;
pub(crate) use innovations::products as products_of_innovations;
pub(super) use joint::joint_columns;
pub(crate) use joint::{joint_products, joint_taps};
pub(super) use lagged_products::{Factor, LaggedProducts, ROUNDING, divided, log_determinant};
pub(crate) use ordered::{Ordered, with_levels};
pub(crate) use sums::{SegmentStart, SubspaceErrors, SubspaceSums};
use weighting::Weighted;
pub use weighting::Weighting;

/// The largest past horizon that the data may choose.
const LONGEST_PAST: usize = 40;
/// Samples for each lagged signal of the longest past that the data may choose.
const SAMPLES_A_LAG: usize = 5;
/// The variance of e, in squares of the outputs, below which nothing is left of them.
const NOTHING_LEFT: f64 = 1e-16;
/// A level this many root mean squares away says that the outputs integrate.
const FARTHEST: f64 = 1e4;
/// The largest order that is offered by itself.
const HIGHEST_ORDER: usize = 20;

/// The options of a subspace method. By default all are decided from the data.
///
/// ```
/// use thetahat::estimate::SubspaceOptions;
///
/// let options = SubspaceOptions { feedthrough: Some(false), ..SubspaceOptions::default() };
/// assert_eq!(options.past, None);
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
pub struct SubspaceOptions {
    /// What the singular values are of. By default SSARX.
    pub weighting: Weighting,
    /// p, the number of past samples from which the state is computed. By default that of the least AIC, 40 at most.
    pub past: Option<usize>,
    /// s, the number of future samples that the state predicts. By default p. For SSARX at most p: more would change
    /// nothing.
    pub future: Option<usize>,
    /// Whether the inputs act on the outputs in the same sample, so that D is estimated. By default if that lowers MDL,
    /// but not if past outputs predict the inputs, which means feedback: with a controller that acts in the same
    /// sample, u(t) depends on y(t) whatever D is.
    pub feedthrough: Option<bool>,
    /// Whether there is a constant in each equation, from which the [levels](Subspace::levels) of the outputs follow;
    /// in a [`StateSpacePlan`](crate::report::StateSpacePlan) its own field `constant` decides.
    pub constant: bool,
}

/// The state of a record at all orders: what a [`StateSpace`] of each is read off.
#[derive(Debug, Clone)]
pub struct Subspace {
    weighting: Weighting,
    past: usize,
    future: usize,
    feedthrough: bool,
    inputs: usize,
    outputs: usize,
    scales: Vec<f64>,
    singular_values: Vec<f64>,
    highest: usize,
    /// The rows that make x(t) of z(t-1), …, z(t-p), x of the highest order.
    states: DMatrix<f64>,
    /// The mean products of x(t), x(t+1), u(t) and y(t), x of the highest order; with a constant those of deviations
    /// from the means.
    moments: DMatrix<f64>,
    /// These means.
    means: Option<DVector<f64>>,
}

/// How a state-space model was found by a subspace method.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct SubspaceOutcome {
    /// What the singular values are of.
    pub weighting: Weighting,
    /// p, the past samples that the state is made of.
    pub past: usize,
    /// s, the samples of the future that it tells of.
    pub future: usize,
    /// Whether the inputs act on the outputs at once, so that D was estimated.
    pub feedthrough: bool,
    /// Whether that was asked for; else the data said it.
    pub feedthrough_given: bool,
    /// Whether the levels of the outputs were estimated with the matrices; they are part of the outputs' offsets.
    pub constant: bool,
    /// The largest singular values of what the past says of the outputs to come: see [`Subspace::singular_values`].
    pub singular_values: Vec<f64>,
    /// What the order was chosen among; empty if it was given.
    pub orders: Vec<OrderScore>,
    /// The search that followed, if there was one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub refinement: Option<RefinementOutcome>,
}

/// How well a model of some order predicts.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct OrderScore {
    /// n.
    pub order: usize,
    /// MDL of the prediction errors; none where the model has no stable predictor.
    pub mdl: Option<f64>,
}

/// Finds the states of a record by a subspace method: SSARX unless the options name another [`Weighting`].
///
/// Signals are divided by their root mean squares. For SSARX a long vector ARX model with z = [u; y],
///
/// ```text
/// y(t) = D u(t) + M_1 z(t-1) + … + M_p z(t-p) + e(t)
/// ```
///
/// is fitted by least squares. As M_j = H (F - K H)^(j-1) [G - K D, K], what the past says of the next s outputs, less
/// what later samples add, is
///
/// ```text
/// Gamma x(t) = | M_1  M_2  …  M_p |
///              | M_2  M_3  …  0   | z_past(t),   Gamma = [H; H (F - K H); H (F - K H)^2; …]
///              | …                |
/// ```
///
/// Weighted by the root W of the inverse covariance of e, and by the root L of the products of the past, its singular
/// values are those of W Gamma K_p L = U S V', and the state of order n is x = S^½ V' L^-1 z_past with its first n
/// rows. (Jansson, Subspace identification and ARX modeling, IFAC SYSID 2003; Chiuso, Automatica 43, 2007.) Other than
/// with MOESP, N4SID and CVA, whose equations are at [`Weighting`], nothing is projected on future inputs, so that it
/// is consistent where the inputs are fed back.
///
/// The matrices follow by least squares, H and D from y on [x; u], and F, G and K from x(t+1) on [x; u; e] with the
/// residuals e of the former. Where a controller feeds y(t) back to u(t), u(t) and e(t) are correlated: without e
/// beside them, G and F would be biased.
///
/// Everything comes from the lagged products of all signals: O(N q^2 p) for q signals, then O((q p)^3); for the
/// classical weightings with p + s in the place of p. Where p is not given, those of the longest past come first.
/// Singular values below a millionth of the largest have few exact digits.
///
/// # Errors
/// [`Error::Argument`] for a past or a future of 0; [`Error::Data`] for a record without outputs;
/// [`Error::Undetermined`] where there are too few samples for the lagged signals, or a signal is zero.
///
/// ```
/// use thetahat::data::JointRecord;
/// use thetahat::estimate::{SubspaceOptions, subspace};
///
/// // x(t+1) = 0.8 x(t) + u1(t) + 0.5 u2(t) of which two sensors see once and twice as much, the second the second input too.
/// let mut random = 1_u32;
/// let mut sample = || {
///     random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
///     f64::from(random >> 16) / 32_768.0 - 1.0
/// };
/// let (mut u, mut y, mut x) = ([vec![], vec![]], [vec![], vec![]], 0.0);
/// for _ in 0..2000 {
///     let (u1, u2) = (sample(), sample());
///     y[0].push(x + 0.1 * sample());
///     y[1].push(2.0 * x + u2 + 0.1 * sample());
///     u[0].push(u1);
///     u[1].push(u2);
///     x = 0.8 * x + u1 + 0.5 * u2;
/// }
/// let record = JointRecord::new(vec![&u[0], &u[1]], vec![&y[0], &y[1]])?;
/// let found = subspace(&record, &SubspaceOptions::default())?;
/// assert!(found.feedthrough());
/// let order = found.order(&record, 1..=6)?;
/// assert_eq!(order, 1);
/// let model = found.state_space(order, 1.0)?;
/// assert!((model.f[(0, 0)] - 0.8).abs() < 0.01);
/// assert!((model.d[(1, 1)] - 1.0).abs() < 0.02);
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn subspace(record: &JointRecord<'_>, options: &SubspaceOptions) -> Result<Subspace, Error> {
    if record.outputs.is_empty() {
        return Err(Error::data("the record has no outputs; it needs at least one"));
    }
    subspace_of(record, options)
}

/// The same of a record, or of sums over parts of one.
fn subspace_of(data: &impl SubspaceData, options: &SubspaceOptions) -> Result<Subspace, Error> {
    for (name, horizon) in [("past", options.past), ("future", options.future)] {
        if horizon == Some(0) {
            return Err(Error::argument(
                name,
                "it is 0, and a state is what past samples say of future ones; take 1 or more",
            ));
        }
    }
    let past = options.past.map_or_else(|| longest_past(data, LONGEST_PAST), Ok)?;
    enough(data, past, None)?;
    let products = |past| LaggedProducts::new(data, past, options.constant).ok_or_else(|| data.silent(past));
    let mut regression = products(past)?;
    if options.past.is_none() {
        let past = regression.akaike(options.feedthrough != Some(false));
        if past < regression.past {
            regression = products(past)?;
        }
    }
    let future = options.future.unwrap_or(regression.past);
    if options.weighting != Weighting::Ssarx {
        enough(data, regression.past, Some(future))?;
    }
    let driven = regression.inputs > 0;
    let feedthrough = driven && options.feedthrough.unwrap_or_else(|| regression.has_feedthrough());
    Subspace::new(data, &regression, options.weighting, future, feedthrough)
}

/// The signals of a regression with such a past: z(t-1), …, z(t-p), u(t) and y(t).
fn signals(data: &impl SubspaceData, past: usize) -> usize {
    let (inputs, outputs) = data.channels();
    (inputs + outputs).saturating_mul(past.saturating_add(1))
}

/// The longest past that the data may choose, of so many.
///
/// # Errors
/// If there are too few samples for any.
fn longest_past(data: &impl SubspaceData, most: usize) -> Result<usize, Error> {
    let fits = |past: &usize| data.samples(*past) >= SAMPLES_A_LAG * signals(data, *past);
    if let Some(past) = (1..=most).rev().find(fits) {
        return Ok(past);
    }
    enough(data, 1, None).map(|()| 1)
}

/// # Errors
/// [`Error::Undetermined`] if there are not more samples than lagged signals of a past, and of a future where one is
/// projected on.
fn enough(data: &impl SubspaceData, past: usize, future: Option<usize>) -> Result<(), Error> {
    let lags = past.saturating_add(future.map_or(0, |future| future - 1));
    let (samples, signals) = (data.samples(lags), signals(data, lags));
    if samples > signals {
        return Ok(());
    }
    let (horizons, make, have) = match future {
        Some(future) => (format!("a past of {past} and a future of {future}"), "make", "have both in"),
        None => (format!("a past of {past}"), "makes", "have it before them in"),
    };
    Err(Error::undetermined(
        Vec::new(),
        format!(
            "{horizons} {make} {signals} lagged signals, and {samples} samples {have} their segment; there must be more samples than \
             signals: give more rows, or fewer channels"
        ),
    ))
}

impl Subspace {
    fn new(
        data: &impl SubspaceData,
        regression: &LaggedProducts,
        weighting: Weighting,
        future: usize,
        feedthrough: bool,
    ) -> Result<Self, Error> {
        let LaggedProducts { inputs, outputs, past, .. } = *regression;
        let width = regression.width();
        let future = future.min(weighting.longest_future(past));
        let Weighted { map, factor } = weighting.weighted(data, regression, future, feedthrough)?;
        let weighted = map * &factor;
        let (rows, columns) = weighted.shape();
        let same = faer::Mat::from_fn(rows, columns, |row, column| weighted[(row, column)]);
        let decomposed = same.thin_svd().map_err(|_| {
            Error::undetermined(Vec::new(), "the singular values of the past do not converge")
        })?;
        let singular_values: Vec<f64> = decomposed.S().column_vector().iter().copied().collect();
        let seen = |value: &&f64| **value > f64::EPSILON * singular_values[0];
        let highest = singular_values.iter().take_while(seen).count();
        if highest == 0 {
            return Err(Error::undetermined(
                Vec::new(),
                "the past says nothing of the outputs: there are no states to be found",
            ));
        }
        // T R = S^½ V'.
        let right = decomposed.V();
        let roots = DMatrix::from_fn(highest, columns, |state, column| {
            singular_values[state].sqrt() * right[(column, state)]
        });
        let states = divided(roots, &factor);
        let mut rows = DMatrix::zeros(2 * highest + width, width * (past + 1));
        rows.view_mut((0, width), (highest, columns)).copy_from(&states);
        rows.view_mut((highest, 0), (highest, columns)).copy_from(&states);
        rows.view_mut((2 * highest, 0), (width, width)).fill_with_identity();
        let moments = &rows * &regression.products * rows.transpose();
        let means = regression.means.as_ref().map(|means| &rows * means);
        Ok(Self {
            weighting,
            past,
            future,
            feedthrough,
            inputs,
            outputs,
            scales: regression.scales.clone(),
            singular_values,
            highest,
            states,
            moments,
            means,
        })
    }

    /// What the singular values are of.
    pub fn weighting(&self) -> Weighting {
        self.weighting
    }

    /// p, the past samples that the states are made of.
    pub fn past(&self) -> usize {
        self.past
    }

    /// s, the samples of the future that the states tell of.
    pub fn future(&self) -> usize {
        self.future
    }

    /// Whether the inputs act on the outputs at once.
    pub fn feedthrough(&self) -> bool {
        self.feedthrough
    }

    /// Whether there is a constant in each equation.
    pub fn has_constant(&self) -> bool {
        self.means.is_some()
    }

    /// The singular values of what the past says of the outputs to come, falling: for SSARX in units of the deviation
    /// of e, for MOESP and N4SID in those of the outputs, and for CVA correlations.
    pub fn singular_values(&self) -> &[f64] {
        &self.singular_values
    }

    /// The highest order of which there is a model.
    pub fn highest_order(&self) -> usize {
        self.highest
    }

    /// The model of an order, one sample every `sample_time` seconds. Over the samples its states are uncorrelated, and
    /// the variance of each is its singular value.
    ///
    /// What the least squares leave of x(t+1) and y(t) is a noise of the states and one of the outputs. K and the
    /// covariance of e are those of the stationary Kalman filter of these (Van Overschee and De Moor, Subspace
    /// Identification for Linear Systems, 1996, section 4.4): below the order of the plant it predicts better than the
    /// K of the regression, which has all past samples at hand where the model has its states only. At the plant's own
    /// order both are the same. Where no stationary filter exists, K is that of the regression. O(n^3).
    ///
    /// # Errors
    /// [`Error::Argument`] for an order that is 0 or above the highest; [`Error::Undetermined`] where no gain gives a
    /// stable predictor.
    pub fn state_space(&self, order: usize, sample_time: f64) -> Result<StateSpace, Error> {
        if order == 0 || order > self.highest {
            return Err(Error::argument(
                "order",
                format!("it is {order}; the data tell of orders from 1 to {}", self.highest),
            ));
        }
        self.scaled(order, sample_time).map(|model| self.in_units(model)).ok_or_else(|| {
            Error::undetermined(
                Vec::new(),
                format!("the model of order {order} has no stable predictor; take another order"),
            )
        })
    }

    /// Where the outputs of the model of an order stay while the inputs stay at zero, in units of the outputs: zero
    /// without a constant. With it, of y = H x + D u + c_y + e and x(t+1) = F x + G u + K e + c_x,
    ///
    /// ```text
    /// H (I - F)^-1 c_x + c_y
    /// ```
    ///
    /// None for an order without a model, and where F has an eigenvalue of 1: outputs that integrate stay nowhere.
    /// O(n^3).
    pub fn levels(&self, order: usize) -> Option<Vec<f64>> {
        let Some(means) = &self.means else { return Some(vec![0.0; self.outputs]) };
        let model = if (1..=self.highest).contains(&order) { self.scaled(order, 1.0) } else { None }?;
        let (next, inputs) = (self.highest, 2 * self.highest);
        let (x, after) = (means.rows(0, order), means.rows(next, order));
        let (u, y) = (means.rows(inputs, self.inputs), means.rows(inputs + self.inputs, self.outputs));
        let of_outputs = y - &model.h * x - &model.d * u;
        let of_states = after - &model.f * x - &model.g * u;
        let at_rest = (DMatrix::identity(order, order) - &model.f).lu().solve(&of_states)?;
        let levels = &model.h * at_rest + of_outputs;
        // Farther away than any sample has been is nowhere.
        let near = levels.iter().all(|level| level.abs() < FARTHEST);
        near.then(|| {
            levels.iter().zip(&self.scales[self.inputs..]).map(|(level, scale)| level * scale).collect()
        })
    }

    /// The model of scaled signals; none where it has no stable predictor.
    fn scaled(&self, order: usize, sample_time: f64) -> Option<StateSpace> {
        let (m, l) = (self.inputs, self.outputs);
        let direct = if self.feedthrough { m } else { 0 };
        let (next, inputs) = (self.highest, 2 * self.highest);
        let outputs = inputs + m;
        let size = self.moments.nrows();

        // y = H x + D u + e.
        let regressors: Vec<usize> = (0..order).chain(inputs..inputs + direct).collect();
        let products = self.moments.select_rows(&regressors).select_columns(&regressors);
        let right = self.moments.select_rows(&regressors).columns(outputs, l).into_owned();
        let seen = solved(&products, right).transpose();
        let mut d = DMatrix::zeros(l, m);
        d.columns_mut(0, direct).copy_from(&seen.columns(order, direct));

        // x(t+1) = F x + G u + K e, e as rows of the moments.
        let mut rows = DMatrix::zeros(order + m + l, size);
        rows.view_mut((0, 0), (order, order)).fill_with_identity();
        rows.view_mut((order, inputs), (m + l, m + l)).fill_with_identity();
        for (place, regressor) in regressors.iter().enumerate() {
            rows.view_mut((order + m, *regressor), (l, 1)).copy_from(&(-seen.column(place)));
        }
        let through = &rows * &self.moments;
        let products = &through * rows.transpose();
        let right = through.columns(next, order).into_owned();
        let after = self.moments.view((next, next), (order, order));
        let moved = solved(&products, right.clone()).transpose();
        let rest = after - &moved * right;
        let model = StateSpace {
            f: moved.columns(0, order).into_owned(),
            g: moved.columns(order, m).into_owned(),
            h: seen.columns(0, order).into_owned(),
            d,
            k: moved.columns(order + m, l).into_owned(),
            noise_covariance: products.view((order + m, order + m), (l, l)).into_owned(),
            sample_time,
        };
        let is_predictor = |model: &StateSpace| is_stable(&(&model.f - &model.k * &model.h));
        let rounding = |size: usize, scale: f64| DMatrix::identity(size, size) * (ROUNDING * scale);
        let rest = (&rest + rest.transpose()) * 0.5 + rounding(order, after.trace());
        let noise_covariance = &model.noise_covariance + rounding(l, 1.0);
        let uncertain = StateSpace { noise_covariance, ..model.clone() };
        let filtered = riccati::stationary(&uncertain, &rest).filter(is_predictor);
        filtered.or_else(|| is_predictor(&model).then_some(model))
    }

    /// A model of the signals in their own units.
    fn in_units(&self, mut model: StateSpace) -> StateSpace {
        let (inputs, outputs) = self.scales.split_at(self.inputs);
        for (column, scale) in inputs.iter().enumerate() {
            model.g.column_mut(column).unscale_mut(*scale);
            model.d.column_mut(column).unscale_mut(*scale);
        }
        for (output, scale) in outputs.iter().enumerate() {
            model.h.row_mut(output).scale_mut(*scale);
            model.d.row_mut(output).scale_mut(*scale);
            model.k.column_mut(output).unscale_mut(*scale);
            model.noise_covariance.row_mut(output).scale_mut(*scale);
            model.noise_covariance.column_mut(output).scale_mut(*scale);
        }
        model
    }

    /// How well the models of some orders predict the record, each segment from the state that fits it best:
    ///
    /// ```text
    /// MDL = N ln det cov e + k ln N,   k = n (m + 2 l) + l m with feedthrough
    /// ```
    ///
    /// with e in units of the root mean squares of the outputs (Rissanen 1978; k is the number of free parameters of a
    /// canonical form, Ljung, System Identification, 2nd ed. 1999, section 4A). Of what the last states still leave of
    /// noise-free outputs, 1e-8 of their root mean squares is nothing. Of records of 2^18 samples and more
    /// eight segments of 2^14 are used. O(N (n + l) (n + m + l)) for each order.
    ///
    /// # Errors
    /// [`Error::Data`] for a record with other numbers of inputs and outputs; [`Error::Argument`] for an order that is
    /// 0 or above the highest.
    pub fn scores(
        &self,
        record: &JointRecord<'_>,
        orders: impl IntoIterator<Item = usize>,
    ) -> Result<Vec<OrderScore>, Error> {
        let (m, l) = (self.inputs, self.outputs);
        if record.channels() != (m, l) {
            return Err(Error::data(format!(
                "the record has {} inputs and {} outputs, the model {m} and {l}",
                record.inputs.len(),
                record.outputs.len()
            )));
        }
        let thinned = thinned_joint(record);
        let used = thinned.as_ref().unwrap_or(record);
        self.scored(record.samples(0) as f64, orders, |_, model, levels| {
            let mut products = innovations::products(model, used, levels)?;
            for (output, scale) in self.scales[m..].iter().enumerate() {
                products.row_mut(output).unscale_mut(*scale);
                products.column_mut(output).unscale_mut(*scale);
            }
            Some(products / used.samples(0) as f64)
        })
    }

    /// The same with so many samples, where `mean` gives the mean products of the errors of the model of an order with
    /// these levels, in units of the scales.
    fn scored(
        &self,
        samples: f64,
        orders: impl IntoIterator<Item = usize>,
        mean: impl Fn(usize, &StateSpace, &[f64]) -> Option<DMatrix<f64>> + Sync,
    ) -> Result<Vec<OrderScore>, Error> {
        let score = |order: usize| {
            let model = match self.state_space(order, 1.0) {
                Ok(model) => model,
                Err(Error::Undetermined { .. }) => return Ok(OrderScore { order, mdl: None }),
                Err(error) => return Err(error),
            };
            let mean = self.levels(order).and_then(|levels| mean(order, &model, &levels));
            let mdl = mean.map(|mean| {
                let mean = mean + DMatrix::identity(self.outputs, self.outputs) * NOTHING_LEFT;
                samples * log_determinant(&mean) + self.free_parameters(order) as f64 * samples.ln()
            });
            Ok(OrderScore { order, mdl: mdl.filter(|mdl| mdl.is_finite()) })
        };
        let orders: Vec<usize> = orders.into_iter().collect();
        orders.into_par_iter().map(score).collect()
    }

    /// The rows that make e(t), one step ahead of the model of an order, of z(t), …, z(t-lags), all divided by their
    /// scales: its predictor starts at the state `past` samples before the last of these. None where there is no model.
    fn errors_of_lags(&self, order: usize, lags: usize) -> Option<DMatrix<f64>> {
        let model = self.scaled(order, 1.0)?;
        let (m, width) = (self.inputs, self.inputs + self.outputs);
        let mut rows = DMatrix::zeros(self.outputs, width * (lags + 1));
        rows.columns_mut(0, m).copy_from(&-&model.d);
        rows.columns_mut(m, self.outputs).fill_with_identity();
        let moved = &model.f - &model.k * &model.h;
        let mut driven = DMatrix::zeros(order, width);
        driven.columns_mut(0, m).copy_from(&(&model.g - &model.k * &model.d));
        driven.columns_mut(m, self.outputs).copy_from(&model.k);
        // H (F - K H)^(j-1).
        let mut seen = model.h;
        let ran = lags.checked_sub(self.past)?;
        for lag in 1..=ran {
            rows.columns_mut(width * lag, width).copy_from(&(-(&seen * &driven)));
            seen *= &moved;
        }
        let start = -(seen * self.states.rows(0, order));
        rows.columns_mut(width * (ran + 1), start.ncols()).copy_from(&start);
        Some(rows)
    }

    /// k, the free parameters of a canonical form: n (m + 2 l), l m with feedthrough, and l levels.
    pub fn free_parameters(&self, order: usize) -> usize {
        let (m, l) = (self.inputs, self.outputs);
        let levels = if self.means.is_some() { l } else { 0 };
        order * (m + 2 * l) + if self.feedthrough { l * m } else { 0 } + levels
    }

    /// The order of the least MDL among some, those above the highest left out.
    ///
    /// # Errors
    /// [`Error::Argument`] if there is none in the range; [`Error::Undetermined`] where no model of them has a stable
    /// predictor.
    pub fn order(&self, record: &JointRecord<'_>, orders: RangeInclusive<usize>) -> Result<usize, Error> {
        let orders = *orders.start()..=(*orders.end()).min(self.highest);
        if orders.is_empty() {
            return Err(Error::argument(
                "order",
                format!("the range is empty; the data tell of orders from 1 to {}", self.highest),
            ));
        }
        best(&self.scores(record, orders)?)
    }

    /// The orders that are offered where none are asked for.
    pub fn orders(&self) -> RangeInclusive<usize> {
        1..=self.highest.min(HIGHEST_ORDER)
    }
}

/// The order of the least MDL.
///
/// # Errors
/// [`Error::Undetermined`] where no model has one.
fn best(scores: &[OrderScore]) -> Result<usize, Error> {
    let known = scores.iter().filter_map(|score| Some((score.order, score.mdl?)));
    known.min_by(|a, b| a.1.total_cmp(&b.1)).map(|(order, _)| order).ok_or_else(|| {
        Error::undetermined(Vec::new(), "no model of these orders has a stable predictor; take others")
    })
}

/// X of the symmetric `products` X = right; zero for what depends on others.
fn solved(products: &DMatrix<f64>, mut right: DMatrix<f64>) -> DMatrix<f64> {
    let size = products.nrows();
    let mut factor = products.as_slice().to_vec();
    normal::factor(&mut factor, size);
    for mut column in right.column_iter_mut() {
        normal::solve(&factor, size, column.as_mut_slice());
    }
    right
}
