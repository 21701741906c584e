use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::{Complex, DMatrix};
use thetahat_numerics::distribution::{student_factor, student_two_sided};

use super::eigen::{eigenvalues, solved};
use super::uncertainty::spread;
use super::{Entry, EntryCovariance, StateSpace, StateSpaceMatrix};
use crate::Error;
use crate::model::dynamics::{LEVEL, time_constant};
use crate::model::{Quantity, Root, Signal};

/// Eigenvalues closer to 1 than this are an integrator.
const INTEGRATOR: f64 = 1e-9;

/// An estimated state-space model with any number of inputs and outputs:
///
/// ```text
/// x(t+1) = F x(t) + G u(t) + K e(t)
/// y(t)   = H x(t) + D u(t) + e(t),   cov e = noise_covariance
/// ```
///
/// y and u are deviations from the signals' offsets. The coordinates of x are a matter of choice, so that entries of
/// the matrices have no errors of their own; see [`EntryCovariance`].
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct StateSpaceModel {
    /// Seconds from one sample to the next.
    pub sample_time: f64,
    /// The inputs, the columns of G and D.
    pub inputs: Vec<Signal>,
    /// The outputs, the rows of H and D.
    pub outputs: Vec<Signal>,
    /// For each input the samples that it waits before the plant sees it: the last states are those that wait.
    pub delays: Vec<usize>,
    /// F, n x n, row by row.
    pub f: Vec<Vec<f64>>,
    /// G, n x inputs.
    pub g: Vec<Vec<f64>>,
    /// H, outputs x n.
    pub h: Vec<Vec<f64>>,
    /// D, outputs x inputs.
    pub d: Vec<Vec<f64>>,
    /// K, n x outputs.
    pub k: Vec<Vec<f64>>,
    /// The covariance of e: the sum of its products over the degrees of freedom.
    pub noise_covariance: Vec<Vec<f64>>,
    /// How uncertain the matrices are; none where no theory says it, as after a subspace method.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub covariance: Option<EntryCovariance>,
    /// N - p/l for N samples of l outputs and p free parameters, states at the start of segments among them where these
    /// were estimated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub degrees_of_freedom: Option<usize>,
    /// p, the free parameters of a canonical form: n (inputs + 2 outputs), and those of D where it was estimated.
    pub free_parameters: usize,
    /// The eigenvalues of F, the largest first.
    pub poles: Vec<Root>,
    /// The eigenvalues of F - K H: how fast a prediction forgets what it started from.
    pub predictor_poles: Vec<Root>,
    /// H (I - F)^-1 G + D, for each output one for each input; none at an integrator.
    pub dc_gain: Vec<Vec<Option<Quantity>>>,
    /// Whether all poles lie inside the unit circle.
    pub stable: bool,
    /// -T/ln|p| in seconds for each pole p, T being the sample time; none for |p| >= 1.
    pub time_constants: Vec<Option<Quantity>>,
}

impl StateSpaceModel {
    /// A model of signals whose inputs wait so many samples, with what follows from its matrices.
    ///
    /// # Errors
    /// [`Error::Undetermined`] if the eigenvalues do not converge.
    pub(crate) fn new(
        (inputs, outputs): (Vec<Signal>, Vec<Signal>),
        delays: Vec<usize>,
        matrices: &StateSpace,
        free_parameters: usize,
        degrees_of_freedom: Option<usize>,
    ) -> Result<Self, Error> {
        let matrices = &matrices.delayed(&delays);
        let rows = |matrix: &DMatrix<f64>| -> Vec<Vec<f64>> {
            matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
        };
        let StateSpace { f, g, h, d, k, noise_covariance, sample_time } = matrices;
        let poles = eigenvalues(f)?;
        let predictor_poles = eigenvalues(&(f - k * h))?;
        let roots = |of: &str, values: &[Complex<f64>]| -> Vec<Root> {
            let root = |value: &Complex<f64>| Root {
                polynomial: of.to_owned(),
                re: value.re,
                im: value.im,
                covariance: None,
            };
            values.iter().map(root).collect()
        };
        let mut model = Self {
            sample_time: *sample_time,
            delays,
            f: rows(f),
            g: rows(g),
            h: rows(h),
            d: rows(d),
            k: rows(k),
            noise_covariance: rows(noise_covariance),
            covariance: None,
            degrees_of_freedom,
            free_parameters,
            dc_gain: static_gain(matrices, &poles, inputs.len()),
            stable: poles.iter().all(|pole| pole.re.hypot(pole.im) < 1.0),
            time_constants: Vec::new(),
            poles: roots("f", &poles),
            predictor_poles: roots("f - k h", &predictor_poles),
            inputs,
            outputs,
        };
        model.time_constants = model.times();
        Ok(model)
    }

    /// The same with the covariance of the entries of the plant, without the states that wait, and the errors of what
    /// follows from them.
    pub(crate) fn with_covariance(mut self, covariance: EntryCovariance) -> Self {
        let covariance = covariance.delayed(self.order(), &self.delays);
        let matrices = self.matrices();
        let StateSpace { f, g, h, k, .. } = &matrices;
        let zero = Complex::new(0.0, 0.0);
        spread(&mut self.poles, f, &covariance, |entry, left, right| match entry.matrix {
            StateSpaceMatrix::F => left[entry.row] * right[entry.column],
            _ => zero,
        });
        // dA = dF - dK H - K dH.
        spread(
            &mut self.predictor_poles,
            &(f - k * h),
            &covariance,
            |&Entry { matrix, row, column }, left, right| {
                let seen = |output: usize| {
                    h.row(output).iter().zip(right).map(|(h, v)| v * *h).sum::<Complex<f64>>()
                };
                let back = |output: usize| {
                    k.column(output).iter().zip(left).map(|(k, w)| w * *k).sum::<Complex<f64>>()
                };
                match matrix {
                    StateSpaceMatrix::F => left[row] * right[column],
                    StateSpaceMatrix::K => -left[row] * seen(column),
                    StateSpaceMatrix::H => -back(row) * right[column],
                    StateSpaceMatrix::G | StateSpaceMatrix::D => zero,
                }
            },
        );
        let still = DMatrix::identity(f.nrows(), f.nrows()) - f;
        covariance.spread_gains(&mut self.dc_gain, &still, g, h);
        self.covariance = Some(covariance);
        self.time_constants = self.times();
        self
    }

    fn times(&self) -> Vec<Option<Quantity>> {
        let quantile = self.quantile(LEVEL);
        self.poles.iter().map(|pole| time_constant(pole, self.sample_time, quantile)).collect()
    }

    /// The matrices.
    pub fn matrices(&self) -> StateSpace {
        let (n, m, l) = (self.f.len(), self.inputs.len(), self.outputs.len());
        let matrix = |rows: &[Vec<f64>], count: usize, columns: usize| {
            DMatrix::from_fn(count, columns, |row, column| rows[row][column])
        };
        StateSpace {
            f: matrix(&self.f, n, n),
            g: matrix(&self.g, n, m),
            h: matrix(&self.h, l, n),
            d: matrix(&self.d, l, m),
            k: matrix(&self.k, n, l),
            noise_covariance: matrix(&self.noise_covariance, l, l),
            sample_time: self.sample_time,
        }
    }

    /// The states of the plant, without those that wait.
    pub fn order(&self) -> usize {
        self.f.len().saturating_sub(self.delays.iter().sum())
    }

    /// What it is called, such as `state space of order 4`.
    pub fn name(&self) -> String {
        let waiting: usize = self.delays.iter().sum();
        let delays: Vec<String> = self.delays.iter().map(ToString::to_string).collect();
        let delays = if waiting > 0 { format!(", delays {}", delays.join(", ")) } else { String::new() };
        format!("state space of order {}{delays}", self.order())
    }

    /// How much larger the standard deviation of Student's distribution is than its scale: see [`Self::quantile`].
    pub(crate) fn student_factor(&self) -> f64 {
        student_factor(self.degrees_of_freedom)
    }

    /// How many standard errors from an estimate an interval ends that has this probability.
    pub(crate) fn quantile(&self, level: f64) -> f64 {
        student_two_sided(1.0 - level, self.degrees_of_freedom)
    }

    /// Checks a model that was read: that its parts fit together, so that it can be computed with.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let wrong =
            |what: String| Err(Error::report(format!("model.{what}; the report was edited or damaged")));
        let (n, m, l) = (self.f.len(), self.inputs.len(), self.outputs.len());
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
            ("f", &self.f, n, n),
            ("g", &self.g, n, m),
            ("h", &self.h, l, n),
            ("d", &self.d, l, m),
            ("k", &self.k, n, l),
            ("noise_covariance", &self.noise_covariance, l, l),
        ];
        for (name, rows, count, columns) in sizes {
            if rows.len() != count || rows.iter().any(|row| row.len() != columns) {
                return wrong(format!("{name} is not {count} x {columns}"));
            }
            if rows.iter().flatten().any(|value| !value.is_finite()) {
                return wrong(format!("{name} has a value that is not finite"));
            }
        }
        let offsets = self.inputs.iter().chain(&self.outputs).flat_map(|s| [s.offset.level, s.offset.slope]);
        if offsets.into_iter().any(|value| !value.is_finite()) {
            return wrong("an offset is not finite".to_owned());
        }
        if self.covariance.as_ref().is_some_and(|covariance| !covariance.fits(&self.matrices())) {
            return wrong("covariance is not one of entries of the matrices".to_owned());
        }
        let waiting = self.delays.iter().try_fold(0_usize, |sum, delay| sum.checked_add(*delay));
        if self.delays.len() != m || waiting.is_none_or(|waiting| waiting > n) {
            return wrong("delays are not one for each input, and states for their samples".to_owned());
        }
        let noise = &self.noise_covariance;
        let symmetric = (0..l).all(|i| (0..l).all(|j| noise[i][j] == noise[j][i]));
        if !symmetric || (0..l).any(|i| noise[i][i] < 0.0) {
            return wrong("noise_covariance is not that of a noise".to_owned());
        }
        let gains = self.dc_gain.len() == l && self.dc_gain.iter().all(|row| row.len() == m);
        if self.poles.len() != n
            || self.time_constants.len() != n
            || self.predictor_poles.len() != n
            || !gains
        {
            return wrong("poles, time_constants and dc_gain are not those of the matrices".to_owned());
        }
        Ok(())
    }
}

impl StateSpace {
    /// The same plant whose inputs wait so many samples before it sees them: the samples that wait are further states.
    pub(crate) fn delayed(&self, delays: &[usize]) -> Self {
        let waiting: usize = delays.iter().sum();
        if waiting == 0 {
            return self.clone();
        }
        let (n, m) = self.g.shape();
        let l = self.h.nrows();
        let mut f = DMatrix::zeros(n + waiting, n + waiting);
        let mut g = DMatrix::zeros(n + waiting, m);
        let mut h = DMatrix::zeros(l, n + waiting);
        let mut k = DMatrix::zeros(n + waiting, l);
        let mut d = self.d.clone();
        f.view_mut((0, 0), (n, n)).copy_from(&self.f);
        h.columns_mut(0, n).copy_from(&self.h);
        k.rows_mut(0, n).copy_from(&self.k);
        let mut first = n;
        for (input, &delay) in delays.iter().enumerate() {
            if delay == 0 {
                g.view_mut((0, input), (n, 1)).copy_from(&self.g.column(input));
                continue;
            }
            // The newest sample stands first, that which the plant sees last.
            g[(first, input)] = 1.0;
            (1..delay).for_each(|place| f[(first + place, first + place - 1)] = 1.0);
            let seen = first + delay - 1;
            f.view_mut((0, seen), (n, 1)).copy_from(&self.g.column(input));
            h.set_column(seen, &self.d.column(input));
            d.column_mut(input).fill(0.0);
            first += delay;
        }
        Self { f, g, h, d, k, noise_covariance: self.noise_covariance.clone(), sample_time: self.sample_time }
    }
}

/// H (I - F)^-1 G + D; none where F has an eigenvalue of 1.
fn static_gain(matrices: &StateSpace, poles: &[Complex<f64>], inputs: usize) -> Vec<Vec<Option<Quantity>>> {
    let n = matrices.f.nrows();
    let integrates = poles.iter().any(|pole| (pole.re - 1.0).hypot(pole.im) < INTEGRATOR);
    let solved = if integrates { None } else { solved(DMatrix::identity(n, n) - &matrices.f, &matrices.g) };
    let gain = solved.map(|x| &matrices.h * x + &matrices.d);
    let entry = |output: usize, input: usize| {
        let value = gain.as_ref().map(|gain| gain[(output, input)]).filter(|value| value.is_finite());
        value.map(|value| Quantity::new(value, None))
    };
    (0..matrices.h.nrows()).map(|output| (0..inputs).map(|input| entry(output, input)).collect()).collect()
}
