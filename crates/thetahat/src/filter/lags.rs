//! Nonlinear ARX models: their state is the lags.

use thetahat_core::Covariance;
use thetahat_core::nalgebra::{DMatrix, DVector, Dyn};

use super::frame::{Frame, InitialState, Names, check_noise};
use super::linearization::Linearization;
use crate::Error;
use crate::model::{
    ChannelExpression, Evaluator, ExpressionBuffer, NonlinearArxModel, Regressor, Signal, lag_name,
};

/// The longest state: a step costs its cube.
const LARGEST: usize = 500;

/// The state of a nonlinear ARX model, as deviations from the offsets of its channels:
///
/// ```text
/// x(k)   = [ y(k) ... y(k-n+1)  u(k-1) ... u(k-m+1) ]'     for each output and each input, as far back as g reads
/// x(k+1) = [ s g(z(k+1)) + e(k+1)  y(k) ...  u(k) ... ]'   e ~ (0, noise covariance of the report)
/// y_m(k) = y(k) + v(k)                                     v ~ (0, R)
/// ```
///
/// The slopes of g are those of its map (Chen, Billings and Grant 1990 of networks), so that an extended Kalman filter
/// has its F. Without v what is measured is the state, and the prediction is that one step ahead; where an output is
/// missing it is the run from there on, with the covariance that grows with it.
#[derive(Debug, Clone)]
pub(super) struct Lags {
    /// Q: that of e where y(k) stands, else 0.
    noise: Covariance<f64, Dyn>,
    /// g of each output, and what it is multiplied by.
    maps: Vec<(Evaluator, f64)>,
    /// How many regressors there are, and those that are read.
    regressors: usize,
    taps: Vec<Tap>,
    expressions: Vec<(ChannelExpression, f64)>,
    /// What outputs and inputs are measured from.
    levels: Vec<f64>,
    /// For each output and input where its values stand in the state, and how many.
    places: Vec<(usize, usize)>,
}

/// A regressor: what it reads (outputs, inputs, expressions), how many samples before, and what it is divided by.
#[derive(Debug, Clone, Copy)]
struct Tap {
    regressor: usize,
    source: usize,
    lag: usize,
    scale: f64,
}

impl Lags {
    /// A fitted model, which starts at its offsets, or anywhere within the range of the rows that it was fitted to.
    ///
    /// # Errors
    /// [`Error::Report`] where it has no noise, or too many lags, or its numbers overflow.
    pub(super) fn of_model(model: &NonlinearArxModel, start: InitialState) -> Result<(Frame, Self), Error> {
        let refused = |why: String| Error::report(format!("its model has no filter: {why}"));
        model.noise_covariance.iter().enumerate().try_for_each(|(place, row)| check_noise(row[place]))?;
        let expressions = model.read_expressions().map_err(refused)?;
        let maps = model.maps.iter().zip(model.places()).map(|(map, places)| {
            let theta = model.parameters.get(places).unwrap_or_default().iter();
            (Evaluator::new(&map.functions, theta.map(|one| one.value).collect()), map.scale)
        });
        let maps: Vec<(Evaluator, f64)> = maps.collect();
        let is_read = |regressor: usize| maps.iter().any(|(map, _)| map.reads(regressor));
        let taps: Vec<Tap> = (model.sources().into_iter().zip(&model.regressors).enumerate())
            .filter(|(place, _)| is_read(*place))
            .map(|(regressor, (source, Regressor { lag, scale, .. }))| Tap {
                regressor,
                source,
                lag: *lag,
                scale: *scale,
            })
            .collect();
        let (outputs, channels) = (model.outputs.len(), model.outputs.len() + model.inputs.len());
        let mut longest = vec![0; channels];
        for Tap { source, lag, .. } in &taps {
            let read = match source.checked_sub(channels) {
                Some(place) => expressions[place].channels().to_vec(),
                None => vec![*source],
            };
            read.into_iter().for_each(|channel| longest[channel] = longest[channel].max(*lag));
        }
        let (mut states, mut places, mut ranges) = (Vec::new(), Vec::new(), Vec::new());
        for (channel, (signal, longest)) in model.outputs.iter().chain(&model.inputs).zip(longest).enumerate()
        {
            // Of an output its value now is a state, of an input the values before.
            let (first, count) =
                if channel < outputs { (0, longest.max(1)) } else { (1, longest.saturating_sub(1)) };
            places.push((states.len(), count));
            let of_regressor = || model.regressors.iter().find(|regressor| regressor.channel == signal.name);
            let range = model.maps.get(channel).map(|map| map.range);
            let range = range.or_else(|| of_regressor().map(|regressor| regressor.range));
            ranges.extend(std::iter::repeat_n(range.unwrap_or([0.0; 2]), count));
            states.extend((first..first + count).map(|lag| lag_name(&signal.name, lag)));
        }
        let n = states.len();
        if n > LARGEST {
            return Err(refused(format!("it reads {n} lags, of which a filter takes {LARGEST}")));
        }
        let mut noise = DMatrix::zeros(n, n);
        for (row, of_row) in model.noise_covariance.iter().enumerate() {
            for (column, value) in of_row.iter().enumerate() {
                noise[(places[row].0, places[column].0)] = *value;
            }
        }
        let noise = Covariance::new(&noise).map_err(|error| refused(error.to_string()))?;
        let start = match start {
            InitialState::Zero => (DVector::zeros(n), noise.clone()),
            InitialState::Unknown => {
                let half = ranges.iter().map(|[low, high]| (high - low) / 2.0);
                let variances: Vec<f64> = half.map(|half| half * half).collect();
                let middle = ranges.iter().map(|[low, high]| f64::midpoint(*low, *high));
                let covariance = Covariance::from_diagonal(&variances.into());
                (DVector::from_iterator(n, middle), covariance.map_err(|error| refused(error.to_string()))?)
            }
        };
        let mut output_matrix = DMatrix::zeros(outputs, n);
        (0..outputs).for_each(|output| output_matrix[(output, places[output].0)] = 1.0);
        let seen =
            (output_matrix, DMatrix::zeros(outputs, model.inputs.len()), Covariance::zero(Dyn(outputs)));
        let names = |signals: &[Signal]| signals.iter().map(|signal| signal.name.clone()).collect();
        let offsets = |signals: &[Signal]| signals.iter().map(|signal| signal.offset).collect();
        let levels = model.outputs.iter().chain(&model.inputs).map(|signal| signal.offset.level);
        let expressions = expressions.into_iter().zip(&model.expressions);
        let lags = Self {
            noise,
            maps,
            regressors: model.regressors.len(),
            taps,
            expressions: expressions.map(|(own, signal)| (own, signal.offset.level)).collect(),
            levels: levels.collect(),
            places,
        };
        let names = Names {
            states,
            inputs: names(&model.inputs),
            outputs: names(&model.outputs),
            sample_time: model.sample_time,
        };
        let frame = Frame::new(names, start, seen).map_err(|error| refused(error.to_string()))?;
        let (input_offsets, output_offsets) = (offsets(&model.inputs), offsets(&model.outputs));
        Ok((Frame { input_offsets, output_offsets, ..frame }, lags))
    }

    /// The step to the next sample, with the inputs now and those there.
    pub(super) fn ahead(
        &self,
        state: &DVector<f64>,
        now: &DVector<f64>,
        there: &DVector<f64>,
    ) -> Linearization {
        let (n, outputs) = (state.len(), self.maps.len());
        // Where the value of a channel stands that is read so many samples before the next one.
        let at = |channel: usize, lag: usize| match channel.checked_sub(outputs) {
            None => (Some(self.places[channel].0 + lag - 1), 0.0),
            Some(input) if lag == 0 => (None, there[input]),
            Some(input) if lag == 1 => (None, now[input]),
            Some(_) => (Some(self.places[channel].0 + lag - 2), 0.0),
        };
        let value = |channel: usize, lag: usize| match at(channel, lag) {
            (Some(place), _) => state[place],
            (None, value) => value,
        };
        // z, and its slopes by the states.
        let (mut z, mut slopes) = (vec![0.0; self.regressors], Vec::new());
        let (mut channels, mut buffer) = (self.levels.clone(), ExpressionBuffer::default());
        for Tap { regressor, source, lag, scale } in self.taps.iter().copied() {
            let mut slope = |channel: usize, by: f64| {
                if let (Some(place), _) = at(channel, lag) {
                    slopes.push((regressor, place, by / scale));
                }
            };
            match source.checked_sub(self.levels.len()) {
                None => {
                    z[regressor] = value(source, lag) / scale;
                    slope(source, 1.0);
                }
                Some(place) => {
                    let (expression, level) = &self.expressions[place];
                    for channel in expression.channels() {
                        channels[*channel] = value(*channel, lag) + self.levels[*channel];
                    }
                    z[regressor] = (expression.value(&channels, &mut buffer) - level) / scale;
                    let each = expression.channels().iter().zip(expression.slopes(&channels, &mut buffer));
                    each.for_each(|(channel, by)| slope(*channel, by));
                }
            }
        }
        let (mut values, mut jacobian) = (DVector::zeros(n), DMatrix::zeros(n, n));
        let mut by_regressor = vec![0.0; z.len()];
        for ((evaluator, scale), (place, _)) in self.maps.iter().zip(&self.places) {
            values[*place] = scale * evaluator.value(&z);
            evaluator.slopes(&z, &mut by_regressor);
            for (regressor, column, by) in &slopes {
                jacobian[(*place, *column)] += scale * by_regressor[*regressor] * by;
            }
        }
        for (channel, (place, count)) in self.places.iter().enumerate() {
            if let Some(input) = channel.checked_sub(outputs)
                && *count > 0
            {
                values[*place] = now[input];
            }
            for row in place + 1..place + count {
                values[row] = state[row - 1];
                jacobian[(row, row - 1)] = 1.0;
            }
        }
        Linearization { values, jacobian, noise: self.noise.clone() }
    }
}
