use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::{Complex, DMatrix};
use thetahat_numerics::distribution::student_two_sided;

use super::eigen::solved;
use super::spot_noise::{Steps, WHOLE};
use super::uncertainty::spread;
use super::{
    ContinuousStateSpace, EntryCovariance, Hold, StateSpace, StateSpaceMatrix, StateSpaceModel,
    ZerosPolesGain,
};
use crate::model::dynamics::LEVEL;
use crate::model::{Interval, Quantity, Root, Signal};
use crate::{Error, figures};

/// Poles slower than this fraction of a radian a sample are an integrator.
const INTEGRATOR: f64 = 1e-9;
/// No input waits for more samples than this: beyond it a number was mistyped.
const MOST_WAITING: f64 = 1000.0;

/// A model in continuous time with any number of inputs and outputs, of which each input may act some seconds late:
///
/// ```text
/// dx/dt = A x + B u(t - delay) + K e
/// y     = C x + D u(t - delay) + e
/// ```
///
/// y and u are deviations from the signals' offsets, time is in seconds, and between two samples an input does what
/// `hold` says.
///
/// It was made from a model with the sample time `sample_time`, and of the noise it says what that one said: e is what
/// a sensor adds to each sample and what moves the state until the next one. Over `sample_time` its mean has the
/// covariance noise_intensity/sample_time.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ContinuousStateSpaceModel {
    /// The sample time in seconds of the model that it was made from.
    pub sample_time: f64,
    /// What inputs do between samples.
    pub hold: Hold,
    /// The inputs, the columns of B and D.
    pub inputs: Vec<Signal>,
    /// The outputs, the rows of C and D.
    pub outputs: Vec<Signal>,
    /// For each input the seconds after which the plant sees it.
    pub delays: Vec<f64>,
    /// A, n x n, row by row, a second.
    pub a: Vec<Vec<f64>>,
    /// B, n x inputs.
    pub b: Vec<Vec<f64>>,
    /// C, outputs x n.
    pub c: Vec<Vec<f64>>,
    /// D, outputs x inputs.
    pub d: Vec<Vec<f64>>,
    /// K, n x outputs.
    pub k: Vec<Vec<f64>>,
    /// The covariance of e at samples times `sample_time`, in units of the outputs squared times seconds.
    pub noise_intensity: Vec<Vec<f64>>,
    /// How uncertain the matrices are: A stands as f, B as g and C as h. None where that is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub covariance: Option<EntryCovariance>,
    /// N - p/l for N samples of l outputs and p free parameters of the model that it was made from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub degrees_of_freedom: Option<usize>,
    /// The number of free parameters of the model that it was made from.
    pub free_parameters: usize,
    /// The eigenvalues of A in radians a second, the largest first.
    pub poles: Vec<Root>,
    /// |p| in radians a second for each pole p.
    pub natural_frequencies: Vec<f64>,
    /// -Re p/|p| for each pole p; none for one at 0.
    pub damping: Vec<Option<f64>>,
    /// -1/Re p in seconds for each pole p; none where it does not decay.
    pub time_constants: Vec<Option<Quantity>>,
    /// D - C A^-1 B, for each output one for each input; none at an integrator.
    pub dc_gain: Vec<Vec<Option<Quantity>>>,
    /// Whether all poles lie left of the imaginary axis.
    pub stable: bool,
}

/// What a model in continuous time has beside its matrices.
#[derive(Debug)]
pub(in crate::model) struct Head {
    pub(in crate::model) inputs: Vec<Signal>,
    pub(in crate::model) outputs: Vec<Signal>,
    /// Seconds.
    pub(in crate::model) delays: Vec<f64>,
    pub(in crate::model) sample_time: f64,
    pub(in crate::model) hold: Hold,
    pub(in crate::model) free_parameters: usize,
    pub(in crate::model) degrees_of_freedom: Option<usize>,
}

impl ContinuousStateSpaceModel {
    /// A model with what follows from its matrices.
    ///
    /// # Errors
    /// [`Error::Argument`] for matrices that do not fit or are not finite; [`Error::Undetermined`] if the eigenvalues
    /// do not converge.
    pub(in crate::model) fn new(head: Head, matrices: &ContinuousStateSpace) -> Result<Self, Error> {
        let rows = |matrix: &DMatrix<f64>| -> Vec<Vec<f64>> {
            matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
        };
        let poles = matrices.poles()?;
        let ContinuousStateSpace { a, b, c, d, k, noise_intensity } = matrices;
        let Head { inputs, outputs, delays, sample_time, hold, free_parameters, degrees_of_freedom } = head;
        let slow = INTEGRATOR / sample_time;
        let integrates = poles.iter().any(|pole| pole.norm() < slow);
        let solved = if integrates { None } else { solved(a.clone(), b) };
        let gain = solved.map(|x| d - c * x);
        let entry = |output: usize, input: usize| {
            let value = gain.as_ref().map(|gain| gain[(output, input)]).filter(|value| value.is_finite());
            value.map(|value| Quantity::new(value, None))
        };
        let time_constant = |pole: &Complex<f64>| {
            let time = -1.0 / pole.re;
            (time > 0.0 && time.is_finite()).then(|| Quantity::new(time, None))
        };
        let root = |value: &Complex<f64>| Root {
            polynomial: "a".to_owned(),
            re: value.re,
            im: value.im,
            covariance: None,
        };
        Ok(Self {
            sample_time,
            hold,
            delays,
            a: rows(a),
            b: rows(b),
            c: rows(c),
            d: rows(d),
            k: rows(k),
            noise_intensity: rows(noise_intensity),
            covariance: None,
            degrees_of_freedom,
            free_parameters,
            natural_frequencies: poles.iter().map(|pole| pole.norm()).collect(),
            damping: (poles.iter())
                .map(|pole| Some(-pole.re / pole.norm()).filter(|damping| damping.is_finite()))
                .collect(),
            time_constants: poles.iter().map(time_constant).collect(),
            dc_gain: (0..outputs.len())
                .map(|output| (0..inputs.len()).map(|input| entry(output, input)).collect())
                .collect(),
            stable: poles.iter().all(|pole| pole.re < 0.0),
            poles: poles.iter().map(root).collect(),
            inputs,
            outputs,
        })
    }

    /// A model without noise that was found from sines: A, B, C and D stand as F, G, H and D.
    ///
    /// # Errors
    /// As for other matrices.
    pub(crate) fn of_sines(
        (inputs, outputs): (Vec<Signal>, Vec<Signal>),
        matrices: &StateSpace,
        free_parameters: usize,
        covariance: Option<EntryCovariance>,
    ) -> Result<Self, Error> {
        let StateSpace { f, g, h, d, k, noise_covariance, sample_time } = matrices;
        let head = Head {
            delays: vec![0.0; inputs.len()],
            inputs,
            outputs,
            sample_time: *sample_time,
            hold: Hold::Zero,
            free_parameters,
            degrees_of_freedom: None,
        };
        let [a, b, c, d, k] = [f, g, h, d, k].map(Clone::clone);
        let matrices = ContinuousStateSpace { a, b, c, d, k, noise_intensity: noise_covariance.clone() };
        let model = Self::new(head, &matrices)?;
        Ok(match covariance {
            Some(covariance) => model.with_covariance(covariance),
            None => model,
        })
    }

    /// The same with the covariance of the entries of the matrices, and the errors that follow.
    pub(in crate::model) fn with_covariance(mut self, covariance: EntryCovariance) -> Self {
        let ContinuousStateSpace { a, b, c, .. } = self.matrices();
        let zero = Complex::new(0.0, 0.0);
        spread(&mut self.poles, &a, &covariance, |entry, left, right| match entry.matrix {
            StateSpaceMatrix::F => left[entry.row] * right[entry.column],
            _ => zero,
        });
        covariance.spread_gains(&mut self.dc_gain, &-&a, &b, &c);
        let quantile = student_two_sided(1.0 - LEVEL, self.degrees_of_freedom);
        for (pole, time) in self.poles.iter().zip(&mut self.time_constants) {
            let (Some([[variance, _], _]), Some(time)) = (pole.covariance, time.as_mut()) else { continue };
            let deviation = variance.sqrt();
            let end = |rate: f64| (rate < 0.0).then(|| -1.0 / rate);
            time.standard_error = Some(deviation / (pole.re * pole.re));
            time.interval = Some(Interval {
                lower: end(pole.re - quantile * deviation),
                upper: end(pole.re + quantile * deviation),
            });
        }
        self.covariance = Some(covariance);
        self
    }

    /// The matrices, delays apart.
    pub fn matrices(&self) -> ContinuousStateSpace {
        let (n, m, l) = (self.a.len(), self.inputs.len(), self.outputs.len());
        let matrix = |rows: &[Vec<f64>], count: usize, columns: usize| {
            DMatrix::from_fn(count, columns, |row, column| rows[row][column])
        };
        ContinuousStateSpace {
            a: matrix(&self.a, n, n),
            b: matrix(&self.b, n, m),
            c: matrix(&self.c, l, n),
            d: matrix(&self.d, l, m),
            k: matrix(&self.k, n, l),
            noise_intensity: matrix(&self.noise_intensity, l, l),
        }
    }

    /// What it is called, such as `continuous state space of order 4`.
    pub fn name(&self) -> String {
        let delays: Vec<String> = self.delays.iter().map(|delay| figures::short(*delay)).collect();
        let waits = self.delays.iter().any(|delay| *delay > 0.0);
        let delays = if waits { format!(", delays {} s", delays.join(", ")) } else { String::new() };
        format!("continuous state space of order {}{delays}", self.a.len())
    }

    /// Zeros, poles and gain from an input to an output in the s plane, without the delay.
    ///
    /// # Errors
    /// [`Error::Argument`] if there is no such input or output; [`Error::Undetermined`] where the eigenvalues do not
    /// converge.
    pub fn transfer(&self, output: usize, input: usize) -> Result<ZerosPolesGain, Error> {
        // Zeros and poles of a quotient are those of it in s as in z.
        self.matrices().renamed().transfer(output, input)
    }

    /// The model as samples every so many seconds see it, between which inputs do what `hold` says.
    ///
    /// The plant is that of [`ContinuousStateSpace::sampled`]. A delay of d samples and a part is d samples that wait;
    /// for the part, with a zero-order hold, the sample before the newest acts on for that long (Åström and Wittenmark,
    /// Computer-Controlled Systems, 3rd ed. 1997, section 2.3), exactly, and is a further state.
    ///
    /// The noise is that of single measurements. With T the sample time of the model that this one was made from, F and
    /// K its matrices, R the covariance of its e, and m new samples in the place of each of its samples, m above 1:
    ///
    /// ```text
    /// R' = R,   S' = F^(m-1) K R,   W' = sum over i < m of F^i K R K' F'^i
    /// ```
    ///
    /// are the covariances of what the outputs see, of the two together, and of what moves the state; the innovations
    /// are those of the stationary Kalman filter for them. That is exact for whole m: e is added to every m-th sample
    /// as to the others. The last part of an m that is not whole has the noise of a sample held over it, which is an
    /// assumption. With `tustin` the noise is mapped as inputs are, its intensity being kept. O(n^3 log m).
    ///
    /// # Errors
    /// [`Error::Argument`] for a time that is not above 0 or leaves an input waiting for more than 1000 samples, and
    /// for holds but `zoh` where a delay is no whole number of samples; those of [`ContinuousStateSpace::sampled`];
    /// [`Error::Undetermined`] where no predictor is stable, and where the state moves by less than rounding within a
    /// sample.
    ///
    /// Errors of the matrices go through by differences to either side along each direction in which they vary.
    ///
    /// ```
    /// use thetahat::data::{Channel, Log};
    /// use thetahat::model::Hold;
    /// use thetahat::report::{StateSpacePlan, fit_state_space};
    ///
    /// let (mut u, mut y, mut x, mut random) = (vec![], vec![], 0.0, 1_u32);
    /// for _ in 0..500 {
    ///     random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    ///     u.push(f64::from(random >> 16) / 32_768.0 - 1.0);
    ///     y.push(x);
    ///     x = 0.9 * x + u[u.len() - 1];
    /// }
    /// let channel = |name: &str, values| Channel { name: name.into(), values };
    /// let log = Log::new(vec![channel("u", u), channel("y", y)], 0.1)?;
    /// let plan = StateSpacePlan { orders: Some(1..=1), ..StateSpacePlan::new(&["u"], &["y"]) };
    /// let model = fit_state_space(&log, &[], &plan)?.model;
    ///
    /// let continuous = model.to_continuous(Hold::Zero)?;
    /// assert!((continuous.poles[0].re - 0.9_f64.ln() / 0.1).abs() < 1e-3);
    /// let slower = continuous.sampled(0.3, Hold::Zero)?;
    /// assert!((slower.f[0][0] - 0.9_f64.powi(3)).abs() < 1e-3);
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn sampled(&self, seconds: f64, hold: Hold) -> Result<StateSpaceModel, Error> {
        let continuous = self.matrices();
        let fastest = continuous.a.amax();
        if fastest > 0.0 && seconds > 0.0 && fastest * seconds < f64::EPSILON {
            return Err(Error::undetermined(
                Vec::new(),
                format!(
                    "within {} s the state moves by less than rounding; take a longer sample time",
                    figures::short(seconds)
                ),
            ));
        }
        let noisy = |continuous: &ContinuousStateSpace| {
            let plain = continuous.sampled(seconds, hold)?;
            self.with_noise(continuous, plain, hold)
        };
        let with_noise = noisy(&continuous)?;
        let (waiting, parts) = self.waiting(seconds, hold)?;
        let plant = late(&continuous, with_noise, &parts)?;
        let signals = (self.inputs.clone(), self.outputs.clone());
        let model =
            StateSpaceModel::new(signals, waiting, &plant, self.free_parameters, self.degrees_of_freedom)?;
        let known = self.covariance.as_ref().and_then(|known| {
            let sampled = |moved: StateSpace| {
                let moved = ContinuousStateSpace::of_renamed(moved);
                late(&moved, noisy(&moved).ok()?, &parts).ok()
            };
            let pair = |[plus, minus]: [StateSpace; 2]| Some([sampled(plus)?, sampled(minus)?]);
            let pairs = known.varied(&continuous.renamed())?.into_iter().map(pair);
            EntryCovariance::of_pairs(&plant, &pairs.collect::<Option<Vec<_>>>()?)
        });
        Ok(match known {
            Some(known) => model.with_covariance(known),
            None => model,
        })
    }

    /// For each input the whole samples that it waits, and the seconds that are left.
    fn waiting(&self, seconds: f64, hold: Hold) -> Result<(Vec<usize>, Vec<f64>), Error> {
        let (mut waiting, mut parts) = (Vec::new(), Vec::new());
        for (input, &delay) in self.inputs.iter().zip(&self.delays) {
            let samples = delay / seconds;
            let (name, shown) = (&input.name, figures::short);
            if samples > MOST_WAITING {
                return Err(Error::argument(
                    "to",
                    format!(
                        "the delay of '{name}', {} s, is more than {MOST_WAITING} samples of {} s; take a longer sample time",
                        shown(delay),
                        shown(seconds)
                    ),
                ));
            }
            let nearest = samples.round();
            if (samples - nearest).abs() <= WHOLE * nearest.max(1.0) {
                waiting.push(nearest as usize);
                parts.push(0.0);
                continue;
            }
            if hold != Hold::Zero {
                let above = delay / samples.floor();
                let above = if above.is_finite() { format!(" or {} s", shown(above)) } else { String::new() };
                return Err(Error::argument(
                    "to",
                    format!(
                        "the delay of '{name}', {} s, is {} samples of {} s, no whole number, which only `zoh` can have; take it, or a time \
                         that divides the delay, such as {} s{above}",
                        shown(delay),
                        shown(samples),
                        shown(seconds),
                        shown(delay / samples.ceil())
                    ),
                ));
            }
            waiting.push(samples.floor() as usize);
            parts.push(delay - samples.floor() * seconds);
        }
        Ok((waiting, parts))
    }

    /// The sampled plant with the noise of single measurements.
    fn with_noise(
        &self,
        continuous: &ContinuousStateSpace,
        plain: StateSpace,
        hold: Hold,
    ) -> Result<StateSpace, Error> {
        let (from, to) = (self.sample_time, plain.sample_time);
        let ratio = to / from;
        if hold == Hold::Tustin || (ratio - 1.0).abs() <= WHOLE {
            return Ok(plain);
        }
        let noise_covariance = &continuous.noise_intensity / from;
        if continuous.k.iter().all(|gain| *gain == 0.0) {
            return Ok(StateSpace { noise_covariance, ..plain });
        }
        let own = continuous.sampled(from, Hold::Zero)?;
        let nearest = ratio.round();
        let is_whole = (ratio - nearest).abs() <= WHOLE * nearest;
        let whole = if is_whole { nearest } else { ratio.floor() };
        let mut steps = Steps::repeated(&Steps::one(&own), whole as u64);
        // What e does at first lasts until the next sample.
        let mut k = own.k.clone();
        if whole > 1.0 {
            k = continuous.sampled((whole - 1.0) * from, Hold::Zero)?.f * k;
        }
        if !is_whole {
            let part = continuous.sampled(to - whole * from, Hold::Zero)?;
            let share = ratio - whole;
            k = if whole >= 1.0 { &part.f * k } else { part.k.clone() };
            // A mean over that part of a sample has as much more variance.
            let held = &part.k * &noise_covariance * part.k.transpose() / share;
            steps = steps.then(&Steps { f: part.f, g: part.g, covariance: held });
        }
        StateSpace { k, noise_covariance, ..plain }.innovations_form(&steps.covariance)
    }

    /// Checks a model that was read: that its parts fit together, so that it can be computed with.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let wrong =
            |what: String| Err(Error::report(format!("model.{what}; the report was edited or damaged")));
        let (n, m, l) = (self.a.len(), self.inputs.len(), self.outputs.len());
        if l == 0 {
            return wrong("outputs has none".to_owned());
        }
        let mut names: Vec<&str> =
            self.inputs.iter().chain(&self.outputs).map(|signal| signal.name.as_str()).collect();
        names.sort_unstable();
        if let Some(pair) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return wrong(format!("inputs and outputs have '{}' twice", pair[0]));
        }
        if !(self.sample_time.is_finite() && self.sample_time > 0.0) {
            return wrong("sample_time is not positive".to_owned());
        }
        let sizes: [(&str, &Vec<Vec<f64>>, usize, usize); 6] = [
            ("a", &self.a, n, n),
            ("b", &self.b, n, m),
            ("c", &self.c, l, n),
            ("d", &self.d, l, m),
            ("k", &self.k, n, l),
            ("noise_intensity", &self.noise_intensity, l, l),
        ];
        for (name, rows, count, columns) in sizes {
            if rows.len() != count || rows.iter().any(|row| row.len() != columns) {
                return wrong(format!("{name} is not {count} x {columns}"));
            }
            if rows.iter().flatten().any(|value| !value.is_finite()) {
                return wrong(format!("{name} has a value that is not finite"));
            }
        }
        if self.covariance.as_ref().is_some_and(|covariance| !covariance.fits(&self.matrices().renamed())) {
            return wrong("covariance is not one of entries of the matrices".to_owned());
        }
        let offsets = self.inputs.iter().chain(&self.outputs).flat_map(|s| [s.offset.level, s.offset.slope]);
        if offsets.into_iter().any(|value| !value.is_finite()) {
            return wrong("an offset is not finite".to_owned());
        }
        if self.delays.len() != m || !self.delays.iter().all(|delay| *delay >= 0.0 && delay.is_finite()) {
            return wrong("delays are not one for each input, from 0 on".to_owned());
        }
        let noise = &self.noise_intensity;
        let symmetric = (0..l).all(|i| (0..l).all(|j| noise[i][j] == noise[j][i]));
        if !symmetric || (0..l).any(|i| noise[i][i] < 0.0) {
            return wrong("noise_intensity is not that of a noise".to_owned());
        }
        let lengths = [self.poles.len(), self.natural_frequencies.len(), self.damping.len()];
        let gains = self.dc_gain.len() == l && self.dc_gain.iter().all(|row| row.len() == m);
        if lengths != [n; 3] || self.time_constants.len() != n || !gains {
            return wrong(
                "poles, natural_frequencies, damping, time_constants and dc_gain are not those of the matrices"
                    .to_owned(),
            );
        }
        Ok(())
    }
}

/// The plant whose inputs each act so many seconds late, less than a sample, after a zero-order hold: G is then split
/// into what the newest sample does and what the one before it does, which is a state more.
fn late(continuous: &ContinuousStateSpace, sampled: StateSpace, parts: &[f64]) -> Result<StateSpace, Error> {
    let late: Vec<usize> = (0..parts.len()).filter(|input| parts[*input] > 0.0).collect();
    if late.is_empty() {
        return Ok(sampled);
    }
    let (n, m) = sampled.g.shape();
    let (l, all) = (sampled.h.nrows(), n + late.len());
    let StateSpace { f, g, h, d, k, noise_covariance, sample_time } = sampled;
    let wider = |matrix: &DMatrix<f64>, rows: usize, columns: usize| {
        let mut wider = DMatrix::zeros(rows, columns);
        wider.view_mut((0, 0), matrix.shape()).copy_from(matrix);
        wider
    };
    let mut found = StateSpace {
        f: wider(&f, all, all),
        g: wider(&g, all, m),
        h: wider(&h, l, all),
        k: wider(&k, all, l),
        d,
        noise_covariance,
        sample_time,
    };
    for (place, &input) in (n..).zip(&late) {
        let newest = continuous.sampled(sample_time - parts[input], Hold::Zero)?.g.column(input).into_owned();
        let before = g.column(input) - &newest;
        found.f.view_mut((0, place), (n, 1)).copy_from(&before);
        found.g.view_mut((0, input), (n, 1)).copy_from(&newest);
        found.g[(place, input)] = 1.0;
        let direct = found.d.column(input).into_owned();
        found.h.set_column(place, &direct);
        found.d.column_mut(input).fill(0.0);
    }
    Ok(found)
}
