//! Numbers of a model as options.

use thetahat_core::nalgebra::DMatrix;

use super::{ChannelNames, Polynomials, TransferFunction};
use crate::Error;
use crate::model::{ContinuousStateSpace, Hold, Model, StateSpace, TimeBase};
use crate::options::{ColumnName, Form, Kind, NamedValue, OptionText, Options, options};

const POLYNOMIALS: &str = "Polynomials in rising powers of q^-1: A y = B/F u + C/D e";
const TRANSFER: &str = "Transfer functions in falling powers of z, or without `sample-time` of s";
const MATRICES: &str = "State space, sampled or without `sample-time` in continuous time";
const SHARED: &str = "Model";

const P: Kind = Kind::new("polynomials (`b`, `f`, …)");
const T: Kind = Kind::new("transfer functions (`num`, `den`)");
const S: Kind = Kind::new("matrices (`state-matrix`, …)");

/// The coefficients of a polynomial, written with commas between them.
#[derive(Debug, Clone, PartialEq)]
pub struct Coefficients(pub Vec<f64>);

impl OptionText for Coefficients {
    const PYTHON: &'static str = "Sequence[float]";
    const PYTHON_LIST: &'static str = "Sequence[Sequence[float]]";
    const SIGNED: bool = true;

    fn of(text: &str) -> Result<Self, String> {
        let each = text.split(',').map(|one| one.trim().parse().ok().filter(|value: &f64| value.is_finite()));
        let values: Option<Vec<f64>> = each.collect();
        values
            .map(Self)
            .ok_or_else(|| format!("'{text}': write numbers with commas between them, such as 1,-0.9"))
    }

    fn text(&self) -> String {
        self.0.iter().map(f64::to_string).collect::<Vec<_>>().join(",")
    }
}

/// A matrix, written with commas between the numbers of a row, and semicolons between rows.
#[derive(Debug, Clone, PartialEq)]
pub struct Matrix(pub DMatrix<f64>);

impl OptionText for Matrix {
    const LIST: Form = Form::Repeated;
    const PYTHON: &'static str = "Sequence[Sequence[float]]";
    const SIGNED: bool = true;

    fn of(text: &str) -> Result<Self, String> {
        let rows: Result<Vec<Vec<f64>>, String> =
            text.split(';').map(|row| Coefficients::of(row).map(|row| row.0)).collect();
        let wrong = || format!("'{text}': write rows with semicolons between them, such as 0.9,0.1;0,0.8");
        let rows = rows.map_err(|_| wrong())?;
        let columns = rows[0].len();
        if rows.iter().any(|row| row.len() != columns) {
            return Err(wrong());
        }
        Ok(Self(DMatrix::from_fn(rows.len(), columns, |row, column| rows[row][column])))
    }

    fn text(&self) -> String {
        let row = |row: usize| self.0.row(row).iter().map(f64::to_string).collect::<Vec<_>>().join(",");
        (0..self.0.nrows()).map(row).collect::<Vec<_>>().join(";")
    }
}

options! {
    /// The numbers of a model that is known, as they were given.
    ///
    /// ```
    /// use thetahat::model::KnownOptions;
    ///
    /// let options: KnownOptions = serde_json::from_str(r#"{"b": ["0,1"], "f": ["1,-0.9"], "sample_time": 1}"#)?;
    /// assert_eq!(options.model()?.name(), "OE(1, 1, 1)");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    KnownOptions of "a model" {
        /// A, monic, such as 1,-0.9
        a: Option<Coefficients>, "1,A1[,…]", "1", POLYNOMIALS, [P];
        /// B, such as 0,0,0.5: zeros at its beginning are samples that the input waits; once for each input
        b: Vec<Coefficients>, "B0,B1[,…]", "", POLYNOMIALS, [P];
        /// C, monic
        c: Option<Coefficients>, "1,C1[,…]", "1", POLYNOMIALS, [P];
        /// D, monic
        d: Option<Coefficients>, "1,D1[,…]", "1", POLYNOMIALS, [P];
        /// F, monic; once for each input, or once for all
        f: Vec<Coefficients>, "1,F1[,…]", "1", POLYNOMIALS, [P];
        /// The numerator; once for each input, and for several outputs all of the first output before those of the next
        num: Vec<Coefficients>, "B[,…]", "", TRANSFER, [T];
        /// The denominator; once for each numerator, or once for all
        den: Vec<Coefficients>, "A[,…]", "", TRANSFER, [T];
        /// The dead time in seconds; one for each numerator, or one for all
        delay: Vec<f64>, "SECONDS[,…]", "0", TRANSFER, [T];
        /// F of x(t+1) = F x + G u + K e, or A of dx/dt = A x + B u + K e: rows with semicolons between them, such as
        /// 0.9,0.1;0,0.8
        state_matrix: Option<Matrix>, "MATRIX", "", MATRICES, [S];
        /// G, or B: a column for each input
        input_matrix: Option<Matrix>, "MATRIX", "no inputs", MATRICES, [S];
        /// H of y = H x + D u + e, or C: a row for each output
        output_matrix: Option<Matrix>, "MATRIX", "", MATRICES, [S];
        /// D: what inputs do at once
        feedthrough_matrix: Option<Matrix>, "MATRIX", "0", MATRICES, [S];
        /// K: what the innovations do to the state
        noise_gain: Option<Matrix>, "MATRIX", "0", MATRICES, [S];
        /// The variance of e, or of several outputs its covariance matrix, in samples
        noise_covariance: Option<Matrix>, "MATRIX", "0", SHARED;
        /// Seconds from one sample to the next; without it transfer functions and matrices are in continuous time
        sample_time: Option<f64>, "SECONDS", "", SHARED;
        /// What inputs do between samples, of a model in continuous time: zoh (they keep their values), foh (they
        /// follow straight lines) or tustin (the bilinear transformation)
        hold: Option<Hold>, "HOLD", "zoh", SHARED, [T S];
        /// The names of the inputs
        input: Vec<ColumnName>, "NAME[,NAME…]", "u, or u1, u2, …", SHARED;
        /// The names of the outputs
        output: Vec<ColumnName>, "NAME[,NAME…]", "y, or y1, y2, …", SHARED;
        /// What a channel is measured from, such as where the plant works: models are of deviations from it
        offset: Vec<NamedValue>, "NAME=VALUE", "0", SHARED;
    }
}

crate::options::texts! {
    Hold, Repeated, "Literal[\"zoh\", \"foh\", \"tustin\"]", "Sequence[str]";
}

impl KnownOptions {
    /// The model.
    ///
    /// # Errors
    /// [`Error::Argument`] for options that do not go together or are missing, and as for the constructors of
    /// [`Model`].
    pub fn model(&self) -> Result<Model, Error> {
        let given = self.given();
        let is_given = |kind: Kind| given.iter().any(|(option, _)| option.kinds == [kind]);
        let mut model = match (is_given(P), is_given(T), is_given(S)) {
            (true, _, _) => {
                self.check_kind(P, None)?;
                self.of_polynomials()?
            }
            (_, true, _) => {
                self.check_kind(T, None)?;
                self.of_transfer_functions()?
            }
            (_, _, true) => {
                self.check_kind(S, None)?;
                self.of_matrices()?
            }
            _ => {
                return Err(Error::argument(
                    "b",
                    "there are no numbers: give polynomials (`b`, `f`, …), a transfer function (`num`, `den`) or matrices \
                     (`state-matrix`, …)",
                ));
            }
        };
        self.offset.iter().try_for_each(|own| model.set_offset(&own.name, own.value))?;
        Ok(model)
    }

    fn of_polynomials(&self) -> Result<Model, Error> {
        let Some(sample_time) = self.sample_time else {
            return Err(Error::argument("sample-time", "polynomials in q^-1 are of sampled models; give it"));
        };
        let one = |given: &Option<Coefficients>| given.as_ref().map_or_else(Vec::new, |own| own.0.clone());
        let each = |given: &[Coefficients]| given.iter().map(|own| own.0.clone()).collect();
        let known = Polynomials {
            a: one(&self.a),
            b: each(&self.b),
            c: one(&self.c),
            d: one(&self.d),
            f: each(&self.f),
        };
        let noise = self.noise(1)?;
        Model::from_polynomials(&known, &self.channels(known.b.len(), 1), noise[(0, 0)], sample_time)
    }

    fn of_transfer_functions(&self) -> Result<Model, Error> {
        let count = self.num.len();
        let outputs = self.output.len().max(1);
        if count == 0 || !count.is_multiple_of(outputs) {
            let message =
                format!("there are {count} for {outputs} outputs; give one from each input to each output");
            return Err(Error::argument("num", message));
        }
        let of = |option: &str, length: usize, place: usize| match length {
            1 => Ok(0),
            _ if length == count => Ok(place),
            _ => Err(Error::argument(
                option,
                format!("there are {length} for {count} numerators; give one for each, or one for all"),
            )),
        };
        let function = |place: usize| {
            let delay = match self.delay.as_slice() {
                [] => 0.0,
                all => all[of("delay", all.len(), place)?],
            };
            Ok(TransferFunction {
                numerator: self.num[place].0.clone(),
                denominator: self
                    .den
                    .get(of("den", self.den.len(), place)?)
                    .map_or_else(Vec::new, |own| own.0.clone()),
                delay,
            })
        };
        let functions: Vec<TransferFunction> = (0..count).map(function).collect::<Result<_, Error>>()?;
        let inputs = count / outputs;
        let rows: Vec<Vec<TransferFunction>> = functions.chunks(inputs).map(<[_]>::to_vec).collect();
        let time = self.sample_time.map_or(TimeBase::Continuous, TimeBase::Sampled);
        let time = (time, self.hold.unwrap_or_default());
        Model::from_transfer_functions(
            &rows,
            &self.channels(inputs, outputs),
            Some(&self.noise(outputs)?),
            time,
        )
    }

    fn of_matrices(&self) -> Result<Model, Error> {
        let (Some(Matrix(f)), Some(Matrix(h))) = (&self.state_matrix, &self.output_matrix) else {
            let missing = if self.state_matrix.is_none() { "state-matrix" } else { "output-matrix" };
            return Err(Error::argument(missing, "missing: give it"));
        };
        let (n, l) = (f.nrows(), h.nrows());
        let or_zero = |given: &Option<Matrix>, rows: usize, columns: usize| {
            given.as_ref().map_or_else(|| DMatrix::zeros(rows, columns), |own| own.0.clone())
        };
        let m = self.input_matrix.as_ref().map_or(0, |own| own.0.ncols());
        let (g, d) = (or_zero(&self.input_matrix, n, m), or_zero(&self.feedthrough_matrix, l, m));
        let (k, noise) = (or_zero(&self.noise_gain, n, l), self.noise(l)?);
        let (f, h, channels) = (f.clone(), h.clone(), self.channels(m, l));
        match self.sample_time {
            Some(sample_time) => {
                let matrices = StateSpace { f, g, h, d, k, noise_covariance: noise, sample_time };
                Model::from_state_space(&matrices, &channels)
            }
            None => {
                let mut matrices = ContinuousStateSpace { a: f, b: g, c: h, d, k, noise_intensity: noise };
                matrices.renamed().check()?;
                let seconds = super::step(&matrices)?;
                matrices.noise_intensity *= seconds;
                let time = (Some(seconds), self.hold.unwrap_or_default());
                Model::from_continuous_state_space(&matrices, &channels, &vec![0.0; m], time)
            }
        }
    }

    /// The covariance of the noise of so many outputs.
    fn noise(&self, outputs: usize) -> Result<DMatrix<f64>, Error> {
        match &self.noise_covariance {
            None => Ok(DMatrix::zeros(outputs, outputs)),
            Some(Matrix(own)) if own.shape() == (outputs, outputs) => Ok(own.clone()),
            Some(Matrix(own)) => {
                let (rows, columns) = own.shape();
                let message = format!("it is {rows} x {columns}, and there are {outputs} outputs");
                Err(Error::argument("noise-covariance", message))
            }
        }
    }

    fn channels(&self, inputs: usize, outputs: usize) -> ChannelNames {
        let usual = |letter: &str, count: usize| match count {
            1 => vec![letter.to_owned()],
            _ => (1..=count).map(|place| format!("{letter}{place}")).collect(),
        };
        ChannelNames {
            inputs: ColumnName::all(&self.input).unwrap_or_else(|| usual("u", inputs)),
            outputs: ColumnName::all(&self.output).unwrap_or_else(|| usual("y", outputs)),
        }
    }
}
