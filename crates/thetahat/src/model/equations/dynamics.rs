//! A model as a filter sees it: the next state and the outputs, with their exact derivatives.

use thetahat_core::Number;

use super::GreyBox;
use super::graph::Leaves;
use super::program::Program;

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
        work: &mut [S],
    ) {
        let columns = jacobian.len() / values.len().max(1);
        let results = self.with_columns(columns, leaves.states.len()).run(leaves, work);
        for (place, result) in values.iter_mut().chain(jacobian).zip(results) {
            *place = result;
        }
    }
}

/// How the equations of the states lead from one row to the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Step {
    /// They are the next state.
    Next,
    /// They are the derivative of the state, integrated by this number of steps of the classical Runge-Kutta method.
    Integrated(usize),
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
    #[expect(clippy::too_many_arguments, reason = "the arguments of f, and where its answers go")]
    pub(crate) fn advance<S: Number<f64>>(
        &self,
        x: &[S],
        z: &[S],
        u: &[f64],
        t: f64,
        dt: f64,
        next: &mut [S],
        jacobian: &mut [S],
        work: &mut Vec<S>,
    ) {
        let (n, size) = (next.len(), jacobian.len());
        let leaves = Leaves { states: x, parameters: z, inputs: u, time: t, step: dt };
        let count = match self.step {
            Step::Next => {
                let program = reserve(work, self.transition.full.size());
                return self.transition.run(&leaves, next, jacobian, program);
            }
            Step::Integrated(count) => count,
        };
        let zero: S = 0.0.into();
        let rest = reserve(work, self.transition.full.size() + 3 * n + 4 * size);
        let (stage, rest) = rest.split_at_mut(n);
        let (rate, rest) = rest.split_at_mut(n);
        let (sum, rest) = rest.split_at_mut(n);
        let (stage_jacobian, rest) = rest.split_at_mut(size);
        let (rate_jacobian, rest) = rest.split_at_mut(size);
        let (sum_jacobian, rest) = rest.split_at_mut(size);
        let (partial, program) = rest.split_at_mut(size);

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
                self.transition.run(&leaves, rate, partial, program);
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

    /// The equations of the next state, or of its derivative with the steps of the integration in a row; and those of
    /// the outputs.
    pub(crate) fn compiled(&self) -> (&Program, Option<usize>, &Program) {
        let steps = match self.step {
            Step::Next => None,
            Step::Integrated(count) => Some(count),
        };
        (&self.transition.by_state, steps, &self.observation.by_state)
    }

    /// y and its Jacobian, of m rows.
    #[expect(clippy::too_many_arguments, reason = "the arguments of h, and where its answers go")]
    pub(crate) fn observe<S: Number<f64>>(
        &self,
        x: &[S],
        z: &[S],
        u: &[f64],
        t: f64,
        y: &mut [S],
        jacobian: &mut [S],
        work: &mut Vec<S>,
    ) {
        let leaves = Leaves { states: x, parameters: z, inputs: u, time: t, step: 0.0 };
        let program = reserve(work, self.observation.full.size());
        self.observation.run(&leaves, y, jacobian, program);
    }

    /// The state at the first row, and the standard deviations of what is known of it.
    pub(crate) fn start(&self) -> (&[f64], &[f64]) {
        (&self.start, &self.start_deviations)
    }

    /// What noise adds to the variance of each state over a step of `dt` seconds.
    pub(crate) fn process_variances(&self, dt: f64) -> impl Iterator<Item = f64> {
        let share = dt / self.sample_time;
        self.process_variances.iter().map(move |variance| variance * share)
    }

    /// The variance of the noise of each output.
    pub(crate) fn measurement_variances(&self) -> &[f64] {
        &self.measurement_variances
    }
}

/// At least this many numbers to work in.
fn reserve<S: Number<f64>>(work: &mut Vec<S>, size: usize) -> &mut [S] {
    if work.len() < size {
        work.resize(size, 0.0.into());
    }
    work
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
