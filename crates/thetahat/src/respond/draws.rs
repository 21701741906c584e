//! Free runs of what a model leaves open: its noise, and its parameters within their covariance.

use std::ops::Range;

use rayon::prelude::*;
use thetahat_core::nalgebra::{DMatrix, DVector, SymmetricEigen};
use thetahat_numerics::random::Random;
use thetahat_numerics::regression::{add_filtered, divide};

use super::{InitialCondition, Response, check_inputs, simulate};
use crate::Error;
use crate::data::Record;
use crate::model::PolynomialModel;

/// The most draws.
const MOST: usize = 100_000;
/// Draws and samples together: 1 GiB of values.
const MOST_VALUES: usize = 1 << 27;
/// So often in a row parameters may be unstable.
const PATIENCE: usize = 1000;
/// What is left of the noise's slowest mode before the first sample, and the most samples that are run for it.
const LEFT: f64 = 0.01;
const LONGEST: f64 = 20_000.0;

/// How many free runs to draw.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Draws {
    /// 1 … 100000.
    pub count: usize,
    /// Which ones: the same seed gives the same ones, whatever the number of threads.
    pub seed: u64,
}

/// Free runs with noise.
#[derive(Debug, Clone, PartialEq)]
pub struct Drawn {
    /// A run for each draw, with a value for each sample of the record that it covers, and NaN elsewhere.
    pub values: Vec<Vec<f64>>,
    /// The samples that the runs cover and that have a measured output, as 0-based ranges.
    pub counted: Vec<Range<usize>>,
    /// How often parameters were drawn again, as those drawn were of an unstable model.
    pub unstable: usize,
    /// Whether parameters vary: they do where their covariance is known.
    pub varied: bool,
}

/// Free runs of models drawn from what the estimate knows, each with noise of its own:
///
/// ```text
/// y = sum_j B_j/(A F_j) u_j + C/(A D) e,   theta ~ N(theta-hat, P),   e ~ N(0, sigma^2)
/// ```
///
/// in deviations, those of the output from an offset that is drawn with theta, and from a [start](simulate) that is
/// found for each draw. The spread of the runs is that of outputs that the plant may give to these inputs, as far as
/// the estimate knows, to all orders in the parameters (Ljung, System Identification, 2nd ed. 1999, section 9.6, gives
/// the first). Parameters stay where P is unknown. Those of an unstable model, where the estimate is stable, are drawn
/// again: the normal distribution, cut off where it says what cannot be.
///
/// The noise has run before the first sample of each segment until 1 % of its slowest mode is left, at most 20000
/// samples; with [`InitialCondition::Zero`], and where its mode lasts, it begins there from rest.
///
/// Cost: that of [`simulate`] for each draw, on all threads; one number for each draw and sample stays in memory.
///
/// # Errors
/// As for [`simulate`]; [`Error::Argument`] for no draw or more than 100000, or more than 2^27 values; [`Error::Data`]
/// if the estimate is so uncertain that hardly any drawn parameters are those of a stable model.
///
/// ```
/// use thetahat::data::Record;
/// use thetahat::estimate::{Initial, arx};
/// use thetahat::model::{Orders, PolynomialModel, Signal};
/// use thetahat::respond::{Draws, InitialCondition, draw};
///
/// let u: Vec<f64> = (0..200).map(|t| f64::from(t * t % 7)).collect();
/// let mut y = vec![1.0];
/// for t in 1..200 {
///     y.push(0.8 * y[t - 1] + 0.5 * u[t - 1] + 0.01 * f64::from((t * t * t) as u32 % 11));
/// }
/// let record = Record::new(&y, vec![&u])?;
/// let orders = Orders::arx(1, &[1], &[1])?;
/// let estimate = arx(&record, &orders, Initial::Drop)?;
/// let model = estimate.to_model(&orders, 1.0, vec![Signal::default()], Signal::default())?;
/// let runs = draw(&model, &record, InitialCondition::Zero, &Draws { count: 50, seed: 1 })?;
/// assert_eq!((runs.values.len(), runs.values[0].len(), runs.unstable), (50, 200, 0));
/// assert_eq!(runs, draw(&model, &record, InitialCondition::Zero, &Draws { count: 50, seed: 1 })?);
/// # Ok::<(), thetahat::Error>(())
/// ```
pub fn draw(
    model: &PolynomialModel,
    record: &Record<'_>,
    start: InitialCondition,
    draws: &Draws,
) -> Result<Drawn, Error> {
    check_inputs(model, record)?;
    let Draws { count, seed } = *draws;
    if !(1..=MOST).contains(&count) {
        return Err(Error::argument("draws", format!("{count} is outside 1..{MOST}")));
    }
    let samples = record.output.len();
    if count.saturating_mul(samples) > MOST_VALUES {
        return Err(Error::argument(
            "draws",
            format!(
                "{count} of {samples} rows are more than {MOST_VALUES} values; ask for fewer, or for fewer rows"
            ),
        ));
    }
    if let Some((model, signals)) = model.with_open_offset(samples) {
        return draw(&model, &record.with_inputs(&signals), start, draws);
    }
    let spread = Spread::of(model);
    let runs = (0..count).into_par_iter().map(|number| {
        let mut random = Random::of(seed, number as u64);
        let (own, unstable) = spread.draw(model, &mut random)?;
        let own = own.as_ref().unwrap_or(model);
        let Response { mut values, counted } = simulate(own, record, start)?;
        for segment in &record.segments {
            // Through missing outputs as well.
            let first = segment.clone().find(|row| !values[*row].is_nan());
            let rows = first.unwrap_or(segment.end)..segment.end;
            let noise = noise(own, rows.len(), start, &mut random);
            values[rows.clone()].iter_mut().zip(noise).for_each(|(value, noise)| *value += noise);
        }
        Ok((values, counted, unstable))
    });
    let runs = runs.collect::<Result<Vec<_>, Error>>()?;
    let unstable = runs.iter().map(|(_, _, unstable)| unstable).sum();
    let counted = runs.first().map_or_else(Vec::new, |(_, counted, _)| counted.clone());
    let values = runs.into_iter().map(|(values, _, _)| values).collect();
    Ok(Drawn { values, counted, unstable, varied: spread.root.is_some() })
}

impl Drawn {
    /// The mean of the runs at each sample, and their quantiles for each of the `levels`, such as 0.025: between the
    /// two neighbours in rank on a straight line (Hyndman and Fan 1996, definition 7). NaN where there is no run, and
    /// where one overflows. O(N n log n) for n draws.
    pub fn bands(&self, levels: &[f64]) -> (Vec<f64>, Vec<Vec<f64>>) {
        let samples = self.values.first().map_or(0, Vec::len);
        let at = |row: usize| -> Vec<f64> {
            let mut values: Vec<f64> = self.values.iter().map(|run| run[row]).collect();
            if !values.iter().all(|value| value.is_finite()) {
                return vec![f64::NAN; levels.len() + 1];
            }
            values.sort_unstable_by(f64::total_cmp);
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let quantile = |level: &f64| {
                let place = level.clamp(0.0, 1.0) * (values.len() - 1) as f64;
                let below = place.floor() as usize;
                let above = (below + 1).min(values.len() - 1);
                values[below] + (place - below as f64) * (values[above] - values[below])
            };
            std::iter::once(mean).chain(levels.iter().map(quantile)).collect()
        };
        let rows: Vec<Vec<f64>> = (0..samples).into_par_iter().map(at).collect();
        let column = |index: usize| rows.iter().map(|row| row[index]).collect();
        (column(0), (1..=levels.len()).map(column).collect())
    }
}

/// How the parameters of a model vary.
pub(crate) struct Spread {
    /// R with P = R R'.
    root: Option<DMatrix<f64>>,
    /// Whether unstable ones are drawn again.
    stable: bool,
}

impl Spread {
    pub(crate) fn of(model: &PolynomialModel) -> Self {
        let root = model.covariance.as_ref().map(|rows| {
            let size = rows.len();
            let scales = DVector::from_fn(size, |k, _| rows[k][k].sqrt());
            // On a common scale, what is below zero is rounding.
            let entry = |i: usize, j: usize| {
                let scale = scales[i] * scales[j];
                if scale > 0.0 { rows[i][j] / scale } else { 0.0 }
            };
            let SymmetricEigen { eigenvectors, eigenvalues } =
                SymmetricEigen::new(DMatrix::from_fn(size, size, entry));
            let lengths = eigenvalues.map(|value| value.max(0.0).sqrt());
            DMatrix::from_fn(size, size, |i, j| scales[i] * eigenvectors[(i, j)] * lengths[j])
        });
        Self { root, stable: is_stable(model) }
    }

    /// A model of drawn parameters, stable or not; none where parameters do not vary.
    pub(crate) fn any(
        &self,
        model: &PolynomialModel,
        random: &mut Random,
    ) -> Result<Option<PolynomialModel>, Error> {
        let Some(root) = &self.root else { return Ok(None) };
        let normal = DVector::from_fn(root.ncols(), |_, _| random.normal());
        let moved = root * normal;
        let each = model.parameters.iter().zip(&moved);
        let values: Vec<f64> = each.map(|(parameter, moved)| parameter.value + moved).collect();
        let (orders, variance) = (&model.orders, model.noise_variance);
        PolynomialModel::from_parameters(orders, &values, None, variance, model.sample_time).map(Some)
    }

    /// A model of drawn parameters, and how many before it were unstable; none where parameters do not vary.
    fn draw(
        &self,
        model: &PolynomialModel,
        random: &mut Random,
    ) -> Result<(Option<PolynomialModel>, usize), Error> {
        for unstable in 0..PATIENCE {
            let Some(drawn) = self.any(model, random)? else { return Ok((None, 0)) };
            if !self.stable || is_stable(&drawn) {
                return Ok((Some(drawn), unstable));
            }
        }
        Err(Error::data(format!(
            "{PATIENCE} times in a row the parameters drawn were those of an unstable model: the estimate is too uncertain to draw \
             from; lower its orders, or fit it to more rows"
        )))
    }
}

/// Whether free runs and noise are bounded.
fn is_stable(model: &PolynomialModel) -> bool {
    model.stable && model.noise_poles.iter().all(|pole| pole.re.hypot(pole.im) < 1.0)
}

/// C/(A D) e over this many samples.
fn noise(model: &PolynomialModel, samples: usize, start: InitialCondition, random: &mut Random) -> Vec<f64> {
    let own = (model.orders.na > 0).then_some(&model.poles);
    let all = own.into_iter().flatten().filter(|pole| pole.polynomial == "a").chain(&model.noise_poles);
    let slowest = all.map(|pole| pole.re.hypot(pole.im)).fold(0.0, f64::max);
    let memory = (LEFT.ln() / slowest.ln()).ceil() + model.orders.nc as f64;
    let before = if start == InitialCondition::Zero || slowest >= 1.0 { 0.0 } else { memory.min(LONGEST) };
    let before = before as usize;
    let deviation = model.noise_variance.sqrt();
    let e: Vec<f64> = (0..before + samples).map(|_| deviation * random.normal()).collect();
    let mut noise = vec![0.0; e.len()];
    add_filtered(&mut noise, &(0..e.len()), &model.c, &e, 0);
    divide(&model.d, &mut noise);
    divide(&model.a, &mut noise);
    noise.split_off(before)
}
