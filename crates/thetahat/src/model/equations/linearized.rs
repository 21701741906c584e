//! Equations near one point: the matrices of a linear system, and by which ways inputs come in.
//!
//! ```text
//! x' = A x + sum_e B_e u_j(e)(t - theta_e),   y = C x + sum_e D_e u_j(e)(t - theta_e)
//! ```
//!
//! with x' the derivative, or the next value, of the state. An input comes in once for each delay with which it stands
//! in the equations. In samples of T seconds the derivative becomes the next value, see [`ExactStep`]:
//!
//! ```text
//! x(k+1) = Phi x(k) + sum_e Psi B_e u(k) + X B_e (u(k+1) - u(k))/T
//! ```
//!
//! with the last term where an input goes in lines.

use thetahat_core::Number;

use super::GreyBox;
use super::drive::Drive;
use super::dynamics::{Step, Work};
use super::exact::ExactStep;
use super::graph::{Graph, Leaves, Node, Operation};
use super::program::Program;
use crate::Error;

/// What equations are to each input, now and some seconds ago: the derivatives of states and outputs, and the delay.
#[derive(Debug, Clone)]
pub(super) struct Entrances {
    inputs: Vec<usize>,
    program: Program,
}

impl Entrances {
    pub(super) fn new(graph: &mut Graph, drives: &[Operation], rates: &[Node], seen: &[Node]) -> Self {
        let functions = [rates, seen].concat();
        let (mut inputs, mut nodes) = (Vec::new(), Vec::new());
        for &drive in drives {
            let (input, delay) = match drive {
                Operation::Input(input) => (input, Graph::ZERO),
                Operation::Delayed(input, _, delay) => (input, delay),
                _ => continue,
            };
            inputs.push(input);
            nodes.extend(graph.derivatives(&functions, drive));
            nodes.push(delay);
        }
        Self { inputs, program: Program::new(graph, &nodes) }
    }
}

/// A linear system. Matrices are column after column.
#[derive(Debug, Clone)]
pub(crate) struct Linearized<S> {
    /// n x n.
    pub(crate) a: Vec<S>,
    /// m x n.
    pub(crate) c: Vec<S>,
    pub(crate) entrances: Vec<Entrance<S>>,
}

/// A way by which an input comes in.
#[derive(Debug, Clone)]
pub(crate) struct Entrance<S> {
    /// Which input.
    pub(crate) input: usize,
    /// A column of B, and of D.
    pub(crate) b: Vec<S>,
    pub(crate) d: Vec<S>,
    /// What the state gets of u(k+1) - u(k), where the input goes in lines from sample to sample; else empty.
    pub(crate) bend: Vec<S>,
    /// In seconds.
    pub(crate) delay: S,
}

impl<S: Number<f64>> Entrance<S> {
    /// The delay in samples of so many seconds, m - f: m, which is whole, and f, which is below 1.
    pub(crate) fn late(&self, seconds: f64) -> (usize, S) {
        let samples = (self.delay.value() / seconds).ceil();
        (samples as usize, -(self.delay * (1.0 / seconds)) + samples)
    }
}

impl<S: Number<f64>> Linearized<S> {
    /// The same in samples of so many seconds, of inputs that are held or go `in_lines`.
    fn sampled(self, seconds: f64, in_lines: &[bool]) -> Self {
        let n = self.a.len().isqrt();
        let step = ExactStep::new(&self.a, &vec![S::from(0.0); n], seconds);
        let times = |matrix: &[S], column: &[S], factor: f64| -> Vec<S> {
            let mut product = vec![S::from(0.0); n];
            for (column_of, &weight) in matrix.chunks_exact(n).zip(column) {
                product.iter_mut().zip(column_of).for_each(|(sum, &entry)| *sum += entry * weight * factor);
            }
            product
        };
        let entrances = self.entrances.into_iter().map(|own| {
            let in_line = in_lines.get(own.input).copied().unwrap_or(false);
            let bend = if in_line { times(&step.second_integral, &own.b, 1.0 / seconds) } else { Vec::new() };
            Entrance { b: times(&step.integral, &own.b, 1.0), bend, ..own }
        });
        Self { entrances: entrances.collect(), a: step.transition, ..self }
    }
}

impl GreyBox {
    /// The equations near the state in which they start, inputs being 0, at time 0: for the derivative, or for the next
    /// state after so many seconds. `z` are the unknown parameters after the change of variable.
    pub(crate) fn linearized<S: Number<f64>>(
        &self,
        z: &[S],
        held: Option<f64>,
        work: &mut Work<S>,
    ) -> Linearized<S> {
        let step = held.unwrap_or(self.sample_time);
        let (n, m) = (self.states.len(), self.outputs.len());
        let zero = S::from(0.0);
        let (mut x, mut variances) = (vec![zero; n], vec![zero; n]);
        self.start(z, &mut x, &mut variances, work);
        let u = vec![0.0; self.inputs.len()];
        let inputs = Drive::held(&u);
        let leaves = Leaves { states: &x, parameters: z, inputs, time: 0.0, step, span: (0.0, step) };
        let run = |program: &Program, work: &mut Work<S>| -> Vec<S> {
            program.run(&leaves, work.reserve(program.size())).collect()
        };
        let a = run(&self.transition.by_state, work).split_off(n);
        let c = run(&self.observation.by_state, work).split_off(m);
        let slopes = run(&self.entrances.program, work);
        let each = self.entrances.inputs.iter().zip(slopes.chunks_exact(n + m + 1));
        let entrances = each.map(|(&input, slopes)| Entrance {
            input,
            b: slopes[..n].to_vec(),
            d: slopes[n..n + m].to_vec(),
            bend: Vec::new(),
            delay: slopes[n + m],
        });
        let linearized = Linearized { a, c, entrances: entrances.collect() };
        match (held, self.step) {
            (None, _) | (_, Step::Next) => linearized,
            (Some(seconds), _) => linearized.sampled(seconds, &self.linear_holds),
        }
    }

    /// That a frequency response of an input that is held so many seconds can be computed; or of a sine in continuous
    /// time.
    ///
    /// # Errors
    /// [`Error::Argument`] for equations of the next state, of which there is no response in continuous time, and to
    /// inputs that are held otherwise than they say only where they know `dt`; and for a delay of an input that goes in
    /// lines.
    pub(crate) fn check_response(&self, held: Option<f64>) -> Result<(), Error> {
        let wrong = |message: String| Err(Error::argument("model", message));
        let Some(seconds) = held else {
            return match self.step {
                Step::Next => wrong(
                    "the response is of sines in continuous time, and [next] says what happens from sample to sample: \
                     write the equations as [derivative]"
                        .to_owned(),
                ),
                _ => Ok(()),
            };
        };
        if !self.any_step && (seconds / self.sample_time - 1.0).abs() > 0.01 {
            return wrong(format!(
                "its sample time is {} s, that of the response {seconds} s; write the equations with dt or [derivative]",
                self.sample_time
            ));
        }
        let lines = self.linear_holds.iter().zip(&self.delays).zip(&self.inputs);
        match lines.into_iter().find(|((line, delay), _)| **line && delay.is_some()) {
            Some((_, input)) => wrong(format!(
                "'{input}' goes in lines and acts later: of sampled responses there is one or the other; fit the log itself"
            )),
            None => Ok(()),
        }
    }
}
