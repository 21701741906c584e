//! A model as a filter sees it: the next state and the outputs, with their exact derivatives.

use thetahat_core::Number;

use super::GreyBox;
use super::drive::Drive;
use super::exact::ExactStep;
use super::graph::Leaves;
use super::program::{Kept, Program};

/// Some functions of state, parameters, inputs and time, with their derivatives.
///
/// The results of a program are the functions, then their derivatives by the states, column after column, and in `full`
/// then those by the parameters too.
#[derive(Debug, Clone)]
pub(super) struct Functions {
    pub(super) by_state: Program,
    pub(super) full: Program,
}

impl Functions {
    /// The program with as many columns of derivatives as fit into `jacobian`.
    fn with_columns(&self, columns: usize, states: usize) -> &Program {
        if columns > states { &self.full } else { &self.by_state }
    }

    /// The functions and the first columns of their Jacobian.
    fn run<S: Number<f64>>(
        &self,
        leaves: &Leaves<'_, S>,
        values: &mut [S],
        jacobian: &mut [S],
        kept: &mut Kept<S>,
    ) {
        let columns = jacobian.len() / values.len().max(1);
        let results = self.with_columns(columns, leaves.states.len()).run_on(leaves, kept);
        for (place, result) in values.iter_mut().chain(jacobian).zip(results) {
            *place = result;
        }
    }
}

/// How the equations of the states lead from one row to the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Step {
    /// They are the next state.
    Next,
    /// They are the derivative of the state, integrated by this number of steps of the classical Runge-Kutta method.
    Integrated(usize),
    /// They are the derivative of the state, linear in states and inputs, and its noise is always the same: the step is
    /// exact. Where the derivatives by parameters are asked for, it is integrated in this number of steps.
    Exact(usize),
}

/// Numbers to work in, and what is the same from row to row: the last exact step, and of the programs of one model what
/// is made of parameters. It is for one model and, in dual numbers, for derivatives by the same variables.
#[derive(Debug, Clone, Default)]
pub(crate) struct Work<S> {
    numbers: Vec<S>,
    exact: Option<KeptStep<S>>,
    transition: Kept<S>,
    observation: Kept<S>,
    pub(super) process: Kept<S>,
    pub(super) measurement: Kept<S>,
}

/// The exact step of some parameters and seconds.
#[derive(Debug, Clone)]
struct KeptStep<S> {
    parameters: Vec<S>,
    seconds: f64,
    step: ExactStep<S>,
}

impl<S: Number<f64>> Work<S> {
    pub(crate) const fn new() -> Self {
        Self {
            numbers: Vec::new(),
            exact: None,
            transition: Kept::new(),
            observation: Kept::new(),
            process: Kept::new(),
            measurement: Kept::new(),
        }
    }

    /// At least this many numbers to work in.
    pub(super) fn reserve(&mut self, size: usize) -> &mut [S] {
        self.split(size).0
    }

    /// The same, and what is kept of the equations of the states.
    fn split(&mut self, size: usize) -> (&mut [S], &mut Kept<S>) {
        if self.numbers.len() < size {
            self.numbers.resize(size, 0.0.into());
        }
        (&mut self.numbers, &mut self.transition)
    }
}

/// The model for any kind of number, with exact derivatives. `z` are the unknown parameters after the change of
/// variable.
///
/// Matrices are column-major. Time is in seconds since the first row. A Jacobian has a column for each state, and after
/// these one for each parameter if the slice has room for them: there are then n + p of them, else n. The slices'
/// lengths must fit; nothing is allocated once `work` has grown.
impl GreyBox {
    /// x(k+1) and its Jacobian, of n rows, over a step of `dt` seconds from time `t`.
    ///
    /// In continuous time a step of h seconds is one of the classical method of order four (Kutta 1901; Hairer, Nørsett
    /// and Wanner, Solving Ordinary Differential Equations I, 2nd ed. 1993, table 1.2), and its Jacobian the exact
    /// derivative of that step, by the chain rule through its stages. With M_j = ∂x_j/∂(x, z), and A = ∂f/∂x, B = ∂f/∂z
    /// at stage j:
    ///
    /// ```text
    /// x_j = x + a_j h k_(j-1)       k_j = f(x_j)               a = 0, 1/2, 1/2, 1
    /// M_j = M + a_j h K_(j-1)       K_j = A M_j + [0 B]
    /// x <- x + h sum b_j k_j        M <- M + h sum b_j K_j     b = 1/6, 1/3, 1/3, 1/6
    /// ```
    ///
    /// Linear equations with noise that is always the same take the [exact](ExactStep) step instead, where the Jacobian
    /// has no columns for parameters: an estimate of these moves from row to row, and the exact step with it.
    #[expect(clippy::too_many_arguments, reason = "the arguments of f, and where its answers go")]
    pub(crate) fn advance<S: Number<f64>>(
        &self,
        x: &[S],
        z: &[S],
        u: Drive<'_>,
        t: f64,
        dt: f64,
        next: &mut [S],
        jacobian: &mut [S],
        work: &mut Work<S>,
    ) {
        let (n, size) = (next.len(), jacobian.len());
        let leaves = Leaves { states: x, parameters: z, inputs: u, time: t, step: dt, span: (t, dt) };
        let count = match self.step {
            Step::Next => return self.transition.run(&leaves, next, jacobian, &mut work.transition),
            Step::Exact(_) if size == n * n => return self.exactly(&leaves, next, jacobian, work),
            Step::Integrated(count) | Step::Exact(count) => count,
        };
        let zero: S = 0.0.into();
        let (rest, kept) = work.split(3 * n + 4 * size);
        let (stage, rest) = rest.split_at_mut(n);
        let (rate, rest) = rest.split_at_mut(n);
        let (sum, rest) = rest.split_at_mut(n);
        let (stage_jacobian, rest) = rest.split_at_mut(size);
        let (rate_jacobian, rest) = rest.split_at_mut(size);
        let (sum_jacobian, rest) = rest.split_at_mut(size);
        let partial = &mut rest[..size];

        next.copy_from_slice(x);
        jacobian.fill(zero);
        jacobian.iter_mut().step_by(n + 1).take(n).for_each(|diagonal| *diagonal = 1.0.into());
        let h = dt / count as f64;
        for index in 0..count {
            sum.fill(zero);
            sum_jacobian.fill(zero);
            for (a, b) in [(0.0, 1.0 / 6.0), (0.5, 1.0 / 3.0), (0.5, 1.0 / 3.0), (1.0, 1.0 / 6.0)] {
                if a == 0.0 {
                    stage.copy_from_slice(next);
                    stage_jacobian.copy_from_slice(jacobian);
                } else {
                    moved(stage, next, rate, a * h);
                    moved(stage_jacobian, jacobian, rate_jacobian, a * h);
                }
                let time = t + (index as f64 + a) * h;
                let leaves = Leaves { states: stage, time, step: h, ..leaves };
                self.transition.run(&leaves, rate, partial, kept);
                multiply(&partial[..n * n], stage_jacobian, rate_jacobian);
                for (entry, &by_parameter) in rate_jacobian.iter_mut().zip(&*partial).skip(n * n) {
                    *entry += by_parameter;
                }
                sum.iter_mut().zip(&*rate).for_each(|(sum, &k)| *sum += k * b);
                sum_jacobian.iter_mut().zip(&*rate_jacobian).for_each(|(sum, &k)| *sum += k * b);
            }
            next.iter_mut().zip(&*sum).for_each(|(x, &k)| *x += k * h);
            jacobian.iter_mut().zip(&*sum_jacobian).for_each(|(m, &k)| *m += k * h);
        }
    }

    /// x + Psi f(x, 0) + X (f(x, dt) - f(x, 0))/dt, and Phi.
    fn exactly<S: Number<f64>>(
        &self,
        leaves: &Leaves<'_, S>,
        next: &mut [S],
        jacobian: &mut [S],
        work: &mut Work<S>,
    ) {
        let (n, dt) = (next.len(), leaves.step);
        self.keep_exact(leaves, dt, work);
        let program = &self.transition.by_state;
        let (numbers, kept) = work.split(2 * n);
        let (rates, rest) = numbers.split_at_mut(n);
        let bends = &mut rest[..n];
        for (rate, result) in rates.iter_mut().zip(program.run_on(leaves, kept)) {
            *rate = result;
        }
        let is_bent = self.bends;
        if is_bent {
            let end = Leaves { time: leaves.time + dt, ..*leaves };
            for ((bend, result), &rate) in bends.iter_mut().zip(program.run_on(&end, kept)).zip(&*rates) {
                *bend = (result - rate) * (1.0 / dt);
            }
        }
        let Some(KeptStep { step, .. }) = &work.exact else { return };
        let (rates, bends) = (&work.numbers[..n], &work.numbers[n..2 * n]);
        next.copy_from_slice(leaves.states);
        for (column, &rate) in step.integral.chunks_exact(n).zip(rates) {
            next.iter_mut().zip(column).for_each(|(next, &entry)| *next += entry * rate);
        }
        for (column, &bend) in step.second_integral.chunks_exact(n).zip(bends).filter(|_| is_bent) {
            next.iter_mut().zip(column).for_each(|(next, &entry)| *next += entry * bend);
        }
        jacobian.copy_from_slice(&step.transition);
    }

    /// Computes the exact step unless it is the last one.
    fn keep_exact<S: Number<f64>>(&self, leaves: &Leaves<'_, S>, dt: f64, work: &mut Work<S>) {
        let is_kept = |kept: &KeptStep<S>| kept.seconds == dt && kept.parameters == leaves.parameters;
        if work.exact.as_ref().is_some_and(is_kept) {
            return;
        }
        let n = self.states.len();
        let a: Vec<S> = self.transition.by_state.run_on(leaves, &mut work.transition).skip(n).collect();
        let mut intensities = vec![S::from(0.0); n];
        self.process_variances(leaves, self.sample_time, &mut intensities, work);
        intensities.iter_mut().for_each(|variance| *variance = *variance * (1.0 / self.sample_time));
        let step = ExactStep::new(&a, &intensities, dt);
        work.exact = Some(KeptStep { parameters: leaves.parameters.to_vec(), seconds: dt, step });
    }

    /// The covariance U diag(d) U' that noise adds to the state over the same step: U, unit upper triangular, column
    /// after column, and d. Noise that is added at the end of the step has U = I.
    #[expect(clippy::too_many_arguments, reason = "what the noise may depend on, and where the answers go")]
    pub(crate) fn process_noise<S: Number<f64>>(
        &self,
        x: &[S],
        z: &[S],
        u: Drive<'_>,
        t: f64,
        dt: f64,
        factor: &mut [S],
        variances: &mut [S],
        work: &mut Work<S>,
    ) {
        let leaves = Leaves { states: x, parameters: z, inputs: u, time: t, step: dt, span: (t, dt) };
        if let Step::Exact(_) = self.step {
            self.keep_exact(&leaves, dt, work);
            if let Some(KeptStep { step, .. }) = &work.exact {
                factor.copy_from_slice(&step.noise_factor);
                variances.copy_from_slice(&step.noise_variances);
            }
            return;
        }
        factor.fill(0.0.into());
        factor.iter_mut().step_by(variances.len() + 1).for_each(|diagonal| *diagonal = 1.0.into());
        self.process_variances(&leaves, dt, variances, work);
    }

    /// The same for a Jacobian with columns for parameters: the variance of each state.
    #[expect(clippy::too_many_arguments, reason = "what the noise may depend on, and where the answer goes")]
    pub(crate) fn added_variances<S: Number<f64>>(
        &self,
        x: &[S],
        z: &[S],
        u: Drive<'_>,
        t: f64,
        dt: f64,
        variances: &mut [S],
        work: &mut Work<S>,
    ) {
        let leaves = Leaves { states: x, parameters: z, inputs: u, time: t, step: dt, span: (t, dt) };
        self.process_variances(&leaves, dt, variances, work);
    }

    /// The exact step of a sample, where there is one and nothing is unknown: Phi, Psi and X, and Q, column after
    /// column.
    pub(crate) fn exact_matrices(&self) -> Option<[Vec<f64>; 4]> {
        let Step::Exact(_) = self.step else { return None };
        let (n, mut work) = (self.states.len(), Work::new());
        let (x, u) = (vec![0.0; n], vec![0.0; self.inputs.len()]);
        let leaves = self.at(&x, &[], Drive::held(&u), 0.0);
        self.keep_exact(&leaves, self.sample_time, &mut work);
        let ExactStep { transition, integral, second_integral, noise_factor, noise_variances } =
            work.exact?.step;
        let entry = |place: usize| -> f64 {
            let (row, column) = (place % n, place / n);
            let of = |k: usize| noise_factor[k * n + row] * noise_variances[k] * noise_factor[k * n + column];
            (0..n).map(of).sum()
        };
        let noise = (0..n * n).map(entry).collect();
        Some([transition, integral, second_integral, noise])
    }

    /// The equations of the next state, or of its derivative with the steps of the integration in a row; and those of
    /// the outputs.
    pub(crate) fn compiled(&self) -> (&Program, Step, &Program) {
        (&self.transition.by_state, self.step, &self.observation.by_state)
    }

    /// What the outputs are made of at a time.
    pub(super) fn at<'a, S>(&self, x: &'a [S], z: &'a [S], u: Drive<'a>, t: f64) -> Leaves<'a, S> {
        Leaves { states: x, parameters: z, inputs: u, time: t, step: 0.0, span: (t, self.sample_time) }
    }

    /// y and its Jacobian, of m rows.
    #[expect(clippy::too_many_arguments, reason = "the arguments of h, and where its answers go")]
    pub(crate) fn observe<S: Number<f64>>(
        &self,
        x: &[S],
        z: &[S],
        u: Drive<'_>,
        t: f64,
        y: &mut [S],
        jacobian: &mut [S],
        work: &mut Work<S>,
    ) {
        let leaves = self.at(x, z, u, t);
        self.observation.run(&leaves, y, jacobian, &mut work.observation);
    }
}

/// target <- base + h k.
fn moved<S: Number<f64>>(target: &mut [S], base: &[S], rate: &[S], h: f64) {
    for ((target, &base), &rate) in target.iter_mut().zip(base).zip(rate) {
        *target = base + rate * h;
    }
}

/// product <- A M, A being n x n.
fn multiply<S: Number<f64>>(a: &[S], m: &[S], product: &mut [S]) {
    let n = a.len().isqrt().max(1);
    for (target, column) in product.chunks_exact_mut(n).zip(m.chunks_exact(n)) {
        target.fill(0.0.into());
        for (a, &weight) in a.chunks_exact(n).zip(column) {
            target.iter_mut().zip(a).for_each(|(target, &a)| *target += a * weight);
        }
    }
}
