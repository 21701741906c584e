//! The extended Kalman filter of a model in equations (Jazwinski, Stochastic Processes and Filtering Theory, 1970,
//! section 8.3):
//!
//! ```text
//! S = H P H' + R_j,  K = P H'/S,  x <- x + K (y_j - h_j - H (x - x^-)),  P <- (I - K H) P (I - K H)' + K R_j K'      for each output
//! x <- f(x, u),      P <- M P M' + Q
//! ```
//!
//! around one linearisation a sample, with noises that are independent of one another, the last output first, as the
//! filters of thetahat-core have it. The covariance is in the form of Bucy and Joseph (Filtering for Stochastic
//! Processes, 1968), which rounding leaves positive.

use super::super::program::{Array, Condition, Entry, Index, Kind, Program, Statement, Value};
use super::super::signals::{Innovations, PREDICTION, Signals};
use super::translation::translated;
use super::{Compiled, Run, multiplied, stored};
use crate::model::equations::GreyBox;

/// The filter, and its memory.
pub(super) struct Kalman<'e> {
    run: Run<'e>,
    p: Array,
    work: Array,
    /// h(x) and its Jacobian, row by row.
    said: Array,
    h: Array,
    /// P H', then K.
    gain: Array,
    /// How far the outputs of the sample have moved the state.
    moved: Array,
    q: Variances<'e>,
    r: Variances<'e>,
}

/// Variances: numbers, or what is computed in each sample, after it is known at what state and inputs.
#[derive(Clone, Copy)]
struct Variances<'e> {
    array: Array,
    computed: Option<&'e Compiled>,
}

impl<'e> Variances<'e> {
    fn new(
        program: &mut Program,
        (compiled, is_constant): (&'e Compiled, bool),
        count: usize,
        [name, doc]: [&str; 2],
    ) -> Self {
        if is_constant {
            let array = program.table(&name.to_uppercase(), doc, compiled.constants());
            return Self { array, computed: None };
        }
        Self { array: program.memory(name, doc, vec![0.0; count]), computed: Some(compiled) }
    }

    fn at(&self, index: Index) -> Value {
        self.array.at(index)
    }

    /// Computes what is not the same in all samples.
    fn computed(&self, program: &mut Program, run: &Run<'_>) -> Vec<Statement> {
        let Some(compiled) = self.computed else { return Vec::new() };
        let leaves = run.leaves(run.x, None, None, 0.0);
        let (mut statements, results) = translated(program, compiled, compiled.results(), &leaves);
        statements.extend(stored(self.array, results));
        statements
    }
}

impl<'e> Kalman<'e> {
    pub(super) fn new(program: &mut Program, equations: &'e GreyBox, run: Run<'e>) -> Self {
        let (n, m) = (run.states, run.outputs);
        let (_, variances, _) = equations.started();
        let mut p = vec![0.0; n * n];
        p.iter_mut().step_by(n + 1).zip(variances).for_each(|(own, variance)| *own = variance);
        let [q, r] = equations.compiled_variances();
        let mut zeros = |name: &str, doc: &str, size: usize| program.memory(name, doc, vec![0.0; size]);
        let work = zeros("work", "What is half of a product.", n * n);
        let said = zeros("said", "The outputs as predicted.", m);
        let h = zeros("h", "Their derivatives by the state, row by row.", m * n);
        let gain = zeros("gain", "The gain of an output.", n);
        let moved = zeros("moved", "How far the outputs have moved the state.", n);
        Self {
            p: program.memory("p", "The covariance of the state, row by row.", p),
            work,
            said,
            h,
            gain,
            moved,
            q: match equations.exact_matrices() {
                Some([.., q]) => {
                    let doc = "What noise adds to the covariance of the state in a sample, row by row.";
                    Variances { array: program.table("Q", doc, q), computed: None }
                }
                None => {
                    let doc = "What noise adds to the variances of the states in a sample.";
                    Variances::new(program, q, n, ["q", doc])
                }
            },
            r: Variances::new(program, r, m, ["r", "The variances of the outputs."]),
            run,
        }
    }

    /// Takes the inputs, and keeps what the outputs should be.
    fn predicted(&self, program: &mut Program, signals: &Signals) -> Vec<Statement> {
        let (n, m) = (self.run.states, self.run.outputs);
        let mut body = self.run.begin(program, signals, |program| self.advanced(program));
        let (statements, mut results) = self.run.observed(program, m + m * n);
        let columns = results.split_off(m);
        body.extend(statements);
        let said = results.into_iter().enumerate();
        body.extend(said.map(|(place, value)| Statement::Store(self.said, place.into(), value)));
        let places = (0..m * n).map(|place| place % m * n + place / m);
        body.extend(places.zip(columns).map(|(place, value)| Statement::Store(self.h, place.into(), value)));
        body
    }

    /// Corrects the state by each output that was measured.
    fn corrected(
        &self,
        program: &mut Program,
        signals: &Signals,
        told: Option<Innovations>,
    ) -> Vec<Statement> {
        let Self { ref run, p, work, said, h, gain, moved, r, .. } = *self;
        let (n, x) = (run.states, run.x);
        let mut body = r.computed(program, run);
        body.extend(program.repeat(n, |_, i| vec![Statement::Store(moved, i, 0.0.into())]));
        let [error, variance, sum, share] =
            ["error", "variance", "total", "share"].map(|name| program.variable(name));
        body.extend(told.map(|told| told.begin()));
        body.extend(program.repeat(run.outputs, |program, place| {
            let j = place.mirrored(run.outputs);
            let measured = signals.output(&j) - said.at(j.clone());
            let of_h = |i: &Index| h.at(j.entry(n, i));
            let mut own = vec![Statement::Let(error, measured)];
            own.extend(told.map(|told| Statement::Store(told.errors, j.clone(), error.into())));
            own.extend(program.repeat(n, |_, i| vec![Statement::Set(error, error - of_h(&i) * moved.at(i))]));
            own.extend(program.repeat(n, |program, i| {
                let mut row = vec![Statement::Let(sum, 0.0.into())];
                row.extend(
                    program
                        .repeat(n, |_, k| vec![Statement::Set(sum, sum + p.at(i.entry(n, &k)) * of_h(&k))]),
                );
                row.push(Statement::Store(gain, i, sum.into()));
                row
            }));
            own.push(Statement::Let(variance, r.at(j.clone())));
            own.extend(
                program.repeat(n, |_, i| vec![Statement::Set(variance, variance + of_h(&i) * gain.at(i))]),
            );
            own.extend(told.map(|told| told.count(&j, error, variance.into())).into_iter().flatten());
            // (I - K H) P
            own.extend(program.repeat(n, |program, i| {
                program.repeat(n, |_, k| {
                    let entry = i.entry(n, &k);
                    let less = gain.at(i.clone()) * gain.at(k) / variance;
                    vec![Statement::Store(work, entry.clone(), p.at(entry) - less)]
                })
            }));
            own.extend(program.repeat(n, |_, i| {
                vec![
                    Statement::Store(gain, i.clone(), gain.at(i.clone()) / variance),
                    Statement::Store(moved, i.clone(), moved.at(i.clone()) + gain.at(i) * error),
                ]
            }));
            own.extend(program.repeat(n, |program, i| {
                let mut row = vec![Statement::Let(share, -(gain.at(i.clone()) * r.at(j.clone())))];
                row.extend(program.repeat(n, |_, k| {
                    vec![Statement::Set(share, share + work.at(i.entry(n, &k)) * of_h(&k))]
                }));
                row.extend(program.repeat(n, |_, k| {
                    let entry = i.entry(n, &k);
                    vec![Statement::Store(p, entry.clone(), work.at(entry) - Value::from(share) * gain.at(k))]
                }));
                row
            }));
            let mut missed = vec![Statement::Miss];
            missed.extend(told.map(|told| told.miss(&j)).into_iter().flatten());
            let condition = Condition::Missing(signals.measured.at(j));
            vec![Statement::Choose { condition, then: missed, otherwise: own }]
        }));
        body.extend(
            program.repeat(n, |_, i| vec![Statement::Store(x, i.clone(), x.at(i.clone()) + moved.at(i))]),
        );
        body
    }

    /// Goes on to the next sample.
    fn advanced(&self, program: &mut Program) -> Vec<Statement> {
        let Self { run, p, work, q, .. } = self;
        let n = run.states;
        let mut body = q.computed(program, run);
        body.extend(run.advance(program));
        if let Some(derivatives) = run.derivatives {
            body.extend(multiplied(program, n, [derivatives.m, *p, *work], false));
            body.extend(multiplied(program, n, [*work, derivatives.m, *p], true));
        }
        body.extend(program.repeat(n * n, |_, i| vec![Statement::Store(*work, i.clone(), p.at(i))]));
        // Rounding leaves both triangles a little apart.
        body.extend(program.repeat(n, |program, i| {
            program.repeat(n, |_, k| {
                let both = work.at(i.entry(n, &k)) + work.at(k.entry(n, &i));
                vec![Statement::Store(*p, i.entry(n, &k), both * 0.5)]
            })
        }));
        if run.exact.is_some() {
            body.extend(
                program
                    .repeat(n * n, |_, i| vec![Statement::Store(*p, i.clone(), p.at(i.clone()) + q.at(i))]),
            );
        } else {
            body.extend(program.repeat(n, |_, i| {
                let own = i.entry(n, &i);
                vec![Statement::Store(*p, own.clone(), p.at(own) + q.at(i))]
            }));
        }
        body
    }

    pub(super) fn predictor(&self, program: &mut Program, signals: &Signals) -> Vec<Entry> {
        let mut predict = self.predicted(program, signals);
        predict
            .extend(program.repeat(self.run.outputs, |_, j| vec![signals.say(&j, self.said.at(j.clone()))]));
        let mut update = self.corrected(program, signals, None);
        update.extend(self.run.end(program, |program| self.advanced(program)));
        let doc =
            "What was measured in this sample, after its prediction. What is missing (NaN) corrects nothing.";
        vec![signals.responds("predict", PREDICTION, predict), signals.updates(doc, update)]
    }

    pub(super) fn observer(&self, program: &mut Program, signals: &Signals) -> Entry {
        let (n, x) = (self.run.states, self.run.x);
        let mut body = self.predicted(program, signals);
        let told = Innovations::new(program, self.run.outputs);
        body.extend(self.corrected(program, signals, Some(told)));
        let state = program.array(Kind::Result, "state", "The state.", vec![0.0; n]);
        body.extend(program.repeat(n, |_, i| vec![Statement::Store(state, i.clone(), x.at(i))]));
        body.extend(self.run.end(program, |program| self.advanced(program)));
        let doc = "A sample: takes u(k) and y(k), and gives the estimate of the state x(k) from all measurements up to them. What is missing (NaN) corrects nothing.";
        signals.observes(doc, Some(state), body)
    }
}
