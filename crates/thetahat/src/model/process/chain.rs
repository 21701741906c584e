//! The lags of a process in state space, and how they move while the input is held.
//!
//! ```text
//! x' = A x + B u,   x(t + h) = e^(A h) x(t) + int_0^h e^(A s) ds B u,   exp([A B; 0 0] h) = [e^(A h)  int; 0 1]
//! ```
//!
//! (Van Loan, Computing integrals involving the matrix exponential, IEEE Trans. Automatic Control 23 (1978)). One lag
//! has it in closed form; several by a Taylor series of the matrix divided by 2^k, which is then squared k times (Moler
//! and Van Loan, Nineteen dubious ways to compute the exponential of a matrix, 1978, method 3). It is exact for equal
//! time constants too, where a sum of exponentials is not.

use thetahat_core::Number;

/// Six poles of a transfer function, and an integrator.
pub(crate) const MOST_STATES: usize = 7;
/// The same and the input.
const SIZE: usize = MOST_STATES + 1;
/// Columns of an output at most: those of as many zeros as poles.
pub(crate) const MOST_COLUMNS: usize = 7;
/// Terms of the Taylor series: 0.5^17/17! is below the rounding of 1.
const TERMS: usize = 16;

/// A value for each state.
pub(crate) type State<S> = [S; MOST_STATES];
/// A value for each column.
pub(crate) type Columns<S> = [S; MOST_COLUMNS];

/// The lags of a process, x' = A x + B u.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Chain<S> {
    states: usize,
    /// [A B], and zeros.
    matrix: [[S; SIZE]; SIZE],
    outputs: Outputs,
    /// Whether the first two are a pair, the first of which is the velocity of the second.
    pair: bool,
    integrates: bool,
}

/// What is seen of the states.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Outputs {
    /// The last, and perhaps its derivative.
    Last { derivative: bool },
    /// The input and all.
    All,
    /// So many derivatives of what comes out of 1/A(s), from that itself on. The states are these, each times a power
    /// of a frequency.
    Derivatives { count: usize, frequency: f64, scales: Columns<f64> },
}

/// How the states move in so many seconds of held input.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Transition<S> {
    states: usize,
    matrix: [[S; SIZE]; SIZE],
}

impl<S: Number<f64>> Chain<S> {
    /// One lag after the other; each has what comes out of the one before. A pair comes first, the integrator last.
    pub(super) fn series(shape: &[S], pair: bool, derivative: bool, integrator: bool) -> Self {
        let mut matrix = [[S::from(0.0); SIZE]; SIZE];
        let states = shape.len() + usize::from(integrator);
        let mut row = 0;
        // Where what goes into a lag stands: the input at first.
        let mut source = states;
        let mut lags = shape;
        if let (true, [omega, zeta, rest @ ..]) = (pair, shape) {
            let square = *omega * *omega;
            matrix[0][0] = -(*omega * *zeta * 2.0);
            matrix[0][1] = -square;
            matrix[0][states] = square;
            matrix[1][0] = 1.0.into();
            (row, source, lags) = (2, 1, rest);
        }
        for tau in lags {
            let rate = S::from(1.0) / *tau;
            matrix[row][row] = -rate;
            matrix[row][source] = rate;
            source = row;
            row += 1;
        }
        if integrator {
            matrix[row][source] = 1.0.into();
        }
        Self { states, matrix, outputs: Outputs::Last { derivative }, pair, integrates: integrator }
    }

    /// Lags side by side.
    pub(super) fn parallel(shape: &[S]) -> Self {
        let mut matrix = [[S::from(0.0); SIZE]; SIZE];
        for (row, tau) in shape.iter().enumerate() {
            let rate = S::from(1.0) / *tau;
            matrix[row][row] = -rate;
            matrix[row][shape.len()] = rate;
        }
        Self { states: shape.len(), matrix, outputs: Outputs::All, pair: false, integrates: false }
    }

    /// 1/A(s) with A(s) = s^n + a_(n-1) s^(n-1) + … + a_0, of which `shape` holds the coefficients from a_(n-1) on,
    /// behind an integrator if there is one, and `count` derivatives of it. With v the input of 1/A(s) and w =
    /// a_0^(1/n), the states are
    ///
    /// ```text
    /// x_k = w^(n-k) s^k/A(s) v,   x_k' = w x_(k+1),   x_(n-1)' = w (v - sum a_k w^(k-n) x_k)
    /// ```
    ///
    /// so that all are of the size of v, however fast the poles are.
    pub(super) fn rational(shape: &[S], count: usize, integrator: bool) -> Self {
        let n = shape.len();
        let mut matrix = [[S::from(0.0); SIZE]; SIZE];
        let frequency = shape.last().map_or(1.0, |last| last.value().powf(1.0 / n as f64));
        let power = |k: usize| frequency.powi(k as i32 - n as i32);
        for row in 0..n.saturating_sub(1) {
            matrix[row][row + 1] = frequency.into();
        }
        if let Some(last) = n.checked_sub(1) {
            for (k, coefficient) in shape.iter().rev().enumerate() {
                matrix[last][k] = -(*coefficient * (frequency * power(k)));
            }
            matrix[last][n] = frequency.into();
        }
        if integrator {
            matrix[n][n + 1] = 1.0.into();
        }
        let mut scales = [0.0; MOST_COLUMNS];
        scales.iter_mut().enumerate().take(n).for_each(|(k, scale)| *scale = power(k));
        Self {
            states: n + usize::from(integrator),
            matrix,
            outputs: Outputs::Derivatives { count, frequency, scales },
            pair: false,
            integrates: integrator,
        }
    }

    pub(crate) fn states(&self) -> usize {
        self.states
    }

    /// The state in which an input that was always `u` leaves the lags, `since` seconds after an integrator stood at 0.
    pub(crate) fn at_rest(&self, u: f64, since: f64) -> State<S> {
        let mut state = [S::from(0.0); MOST_STATES];
        if let Outputs::Derivatives { frequency, .. } = self.outputs {
            return self.derivatives_at_rest(frequency, u, since);
        }
        state[..self.states].fill(u.into());
        if self.pair {
            // A velocity.
            state[0] = 0.0.into();
        }
        if self.integrates {
            state[self.states - 1] = (u * since).into();
        }
        state
    }

    /// The same of derivatives: 1/A(s) settles at gain u; behind an integrator it rises with gain u a second, and all
    /// that is after it rests.
    fn derivatives_at_rest(&self, frequency: f64, u: f64, since: f64) -> State<S> {
        let mut state = [S::from(0.0); MOST_STATES];
        let n = self.states - usize::from(self.integrates);
        let Some(last) = n.checked_sub(1) else { return state };
        let row = &self.matrix[last];
        let rate = -(S::from(u * frequency) / row[0]);
        if !self.integrates {
            state[0] = rate;
            return state;
        }
        state[0] = rate * since;
        let mut left = S::from(0.0);
        if n > 1 {
            state[1] = rate * (1.0 / frequency);
        } else {
            left = rate;
        }
        for (value, weight) in state.iter().zip(row).take(n) {
            left -= *weight * *value;
        }
        state[n] = left * (1.0 / frequency);
        state
    }

    /// How the states move in `h` seconds.
    pub(crate) fn transition(&self, h: S) -> Transition<S> {
        let n = self.states;
        let (zero, one): (S, S) = (0.0.into(), 1.0.into());
        let mut result = [[zero; SIZE]; SIZE];
        let lag = !matches!(self.outputs, Outputs::Derivatives { .. });
        if n == 1 && lag && !self.integrates {
            let decay = (self.matrix[0][0] * h).exp();
            result[0][0] = decay;
            result[0][1] = one - decay;
            return Transition { states: n, matrix: result };
        }
        let norm = self.matrix[..n]
            .iter()
            .map(|row| row[..=n].iter().map(|value| (*value * h).value().abs()).sum::<f64>())
            .fold(0.0, f64::max);
        // A norm that is no number gives no halvings, and a result that is none.
        let halvings = if norm > 0.5 { (2.0 * norm).log2().ceil().clamp(0.0, 1000.0) as i32 } else { 0 };
        let scaled = h * 0.5_f64.powi(halvings);
        let step = self.matrix.map(|row| row.map(|value| value * scaled));
        // Horner: I + X (I + X/2 (I + X/3 (…))), without the last row, which is that of the identity.
        for (row, values) in result.iter_mut().enumerate().take(n + 1) {
            values[row] = one;
        }
        let identity = result;
        for term in (1..=TERMS).rev() {
            let product = times(&step, &result, n);
            for row in 0..n {
                for column in 0..=n {
                    result[row][column] = identity[row][column] + product[row][column] * (1.0 / term as f64);
                }
            }
        }
        for _ in 0..halvings {
            let square = times(&result, &result, n);
            result[..n].copy_from_slice(&square[..n]);
        }
        Transition { states: n, matrix: result }
    }

    /// The columns in a state, with this input.
    pub(crate) fn columns(&self, state: &State<S>, u: f64) -> Columns<S> {
        let mut columns = [S::from(0.0); MOST_COLUMNS];
        match self.outputs {
            Outputs::All => {
                columns[0] = u.into();
                columns[1..=self.states].copy_from_slice(&state[..self.states]);
            }
            Outputs::Last { derivative } => {
                columns[0] = state[self.states - 1];
                if derivative {
                    columns[1] = self.slope(state, u)[self.states - 1];
                }
            }
            Outputs::Derivatives { count, frequency, scales } => {
                let n = self.states - usize::from(self.integrates);
                for ((column, value), scale) in columns.iter_mut().zip(state).zip(scales).take(count.min(n)) {
                    *column = *value * scale;
                }
                if count > n {
                    columns[n] = self.slope(state, u)[n - 1] * (1.0 / frequency);
                }
            }
        }
        columns
    }

    /// What is seen of a state without its input, all weights being 1.
    pub(crate) fn end(&self, state: &State<S>) -> S {
        match self.outputs {
            Outputs::All => state[..self.states].iter().fold(S::from(0.0), |sum, value| sum + *value),
            Outputs::Last { .. } => state[self.states - 1],
            Outputs::Derivatives { .. } => state[0],
        }
    }

    /// How fast the columns move.
    pub(crate) fn rates(&self, state: &State<S>, u: f64) -> Columns<S> {
        let slope = self.slope(state, u);
        self.columns(&slope, 0.0)
    }

    /// An entry of [A B].
    pub(crate) fn entry(&self, row: usize, column: usize) -> S {
        self.matrix[row][column]
    }

    /// A x + B u.
    pub(crate) fn slope(&self, state: &State<S>, u: f64) -> State<S> {
        let mut slope = [S::from(0.0); MOST_STATES];
        for (slope, row) in slope.iter_mut().zip(&self.matrix).take(self.states) {
            *slope = row[self.states] * u;
            for (value, weight) in state.iter().zip(row).take(self.states) {
                *slope += *weight * *value;
            }
        }
        slope
    }
}

impl<S: Number<f64>> Transition<S> {
    /// The state after it. Inlined, so that loops over samples do not call it.
    #[inline]
    pub(crate) fn apply(&self, state: &State<S>, u: f64) -> State<S> {
        let n = self.states;
        let mut next = [S::from(0.0); MOST_STATES];
        for (next, row) in next.iter_mut().zip(&self.matrix).take(n) {
            *next = row[n] * u;
            for (value, weight) in state.iter().zip(row).take(n) {
                *next += *weight * *value;
            }
        }
        next
    }

    /// What it makes of one state, without an input; and of the input.
    #[inline]
    pub(crate) fn entry(&self, row: usize, column: usize) -> S {
        self.matrix[row][column]
    }
}

/// The first n rows of a product of matrices of n + 1 rows.
fn times<S: Number<f64>>(left: &[[S; SIZE]; SIZE], right: &[[S; SIZE]; SIZE], n: usize) -> [[S; SIZE]; SIZE] {
    let mut product = [[S::from(0.0); SIZE]; SIZE];
    for row in 0..n {
        for k in 0..=n {
            let weight = left[row][k];
            for column in 0..=n {
                product[row][column] += weight * right[k][column];
            }
        }
    }
    product
}
