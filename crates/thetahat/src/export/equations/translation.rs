//! Equations that were compiled, as statements of a program.

use std::collections::HashMap;
use std::sync::Arc;

use super::super::program::{Array, Condition, Function, Program, Statement, Value, Variable};
use crate::model::equations::{Function as Named, Operation, Program as Compiled, Table};

/// Powers up to this one are products.
const PRODUCTS: i32 = 8;

/// What the leaves of equations stand for.
pub(super) struct Leaves<'a> {
    pub(super) states: Array,
    pub(super) inputs: Option<Array>,
    /// The inputs of the next sample and how much of the way there has gone by, for those that go in lines.
    pub(super) ahead: Option<(Array, Value)>,
    pub(super) lines: &'a [bool],
    /// Of each input that acts later, what it was in the latest samples.
    pub(super) pasts: &'a [Option<Array>],
    pub(super) time: Option<Value>,
    pub(super) step: f64,
    pub(super) sample_time: f64,
}

/// The statements that the first `count` results of a program need, and these results. What is used once stands where
/// it is used.
pub(super) fn translated(
    program: &mut Program,
    compiled: &Compiled,
    count: usize,
    leaves: &Leaves<'_>,
) -> (Vec<Statement>, Vec<Value>) {
    let (operations, results) = compiled.first(count);
    let mut uses: HashMap<usize, usize> = HashMap::new();
    let arguments = operations.iter().flat_map(|(_, operation)| operation.arguments().into_iter().flatten());
    arguments.chain(results.iter().copied()).for_each(|place| *uses.entry(place).or_default() += 1);
    let tables = compiled.tables();
    let mut translation =
        Translation { program, leaves, tables, values: HashMap::new(), statements: Vec::new() };
    for (place, operation) in &operations {
        let value = translation.value(*operation);
        let is_leaf = matches!(value, Value::Number(_) | Value::Variable(_) | Value::At(..));
        let value = match uses.get(place) {
            Some(1) => value,
            _ if is_leaf => value,
            _ => translation.named(value).into(),
        };
        translation.values.insert(*place, value);
    }
    let results = results.iter().map(|place| translation.at(*place)).collect();
    (translation.statements, results)
}

struct Translation<'a> {
    program: &'a mut Program,
    leaves: &'a Leaves<'a>,
    tables: &'a [Arc<Table>],
    values: HashMap<usize, Value>,
    statements: Vec<Statement>,
}

impl Translation<'_> {
    fn at(&self, place: usize) -> Value {
        self.values.get(&place).cloned().unwrap_or(Value::Number(f64::NAN))
    }

    /// A variable with this value.
    fn named(&mut self, value: Value) -> Variable {
        let variable = self.program.variable("v");
        self.statements.push(Statement::Let(variable, value));
        variable
    }

    fn choose(&mut self, variable: Variable, cases: [(Condition, Value); 2]) {
        let mut otherwise = Vec::new();
        for (condition, value) in cases.into_iter().rev() {
            otherwise =
                vec![Statement::Choose { condition, then: vec![Statement::Set(variable, value)], otherwise }];
        }
        self.statements.extend(otherwise);
    }

    fn value(&mut self, operation: Operation) -> Value {
        match operation {
            Operation::Constant(bits) => f64::from_bits(bits).into(),
            Operation::State(state) => self.leaves.states.at(state),
            Operation::Input(input) => {
                let Some(now) = self.leaves.inputs.map(|inputs| inputs.at(input)) else {
                    return f64::NAN.into();
                };
                let is_line = self.leaves.lines.get(input).copied().unwrap_or(false);
                match self.leaves.ahead.clone().filter(|_| is_line) {
                    Some((ahead, share)) => now.clone() + (ahead.at(input) - now) * share,
                    None => now,
                }
            }
            Operation::Delayed(input, order, delay) => self.delayed(input, order, delay),
            // The parameters of a fitted model are constants.
            Operation::Parameter(_) => f64::NAN.into(),
            Operation::Time => self.leaves.time.clone().unwrap_or(Value::Number(f64::NAN)),
            Operation::Step => self.leaves.step.into(),
            Operation::Add(a, b) => self.at(a) + self.at(b),
            Operation::Subtract(a, b) => self.at(a) - self.at(b),
            Operation::Multiply(a, b) => self.at(a) * self.at(b),
            Operation::Divide(a, b) => self.at(a) / self.at(b),
            Operation::Integer(x, power) if power != 0 && power.abs() <= PRODUCTS => {
                let own = self.at(x);
                let x = Value::from(self.named(own));
                let product = (1..power.abs()).fold(x.clone(), |product, _| product * x.clone());
                if power > 0 { product } else { Value::from(1.0) / product }
            }
            Operation::Integer(x, power) => {
                let x = self.at(x);
                self.program.call(Function::Power, vec![x, f64::from(power).into()])
            }
            Operation::Real(x, bits) => {
                let x = self.at(x);
                self.program.call(Function::Power, vec![x, f64::from_bits(bits).into()])
            }
            Operation::Atan2(y, x) => {
                let arguments = vec![self.at(y), self.at(x)];
                self.program.call(Function::Angle, arguments)
            }
            Operation::Choose([a, b, c, d]) => {
                let [a, b, c, d] = [a, b, c, d].map(|place| self.at(place));
                let chosen = self.named(f64::NAN.into());
                self.choose(
                    chosen,
                    [(Condition::AtMost(a.clone(), b.clone()), c), (Condition::Less(b, a), d)],
                );
                chosen.into()
            }
            Operation::Table(table, order, x) => {
                let x = self.at(x);
                match self.tables.get(table).cloned() {
                    Some(table) => self.looked_up(&table, order, x),
                    None => f64::NAN.into(),
                }
            }
            Operation::Apply(function, x) => {
                let x = self.at(x);
                self.applied(function, x)
            }
        }
    }

    /// An input that is held, as its mean over the sample a delay ago: (1 - phi) u(k - d) + phi u(k - d - 1), the delay
    /// being d + phi samples.
    fn delayed(&mut self, input: usize, order: u8, delay: usize) -> Value {
        let (Some(Some(past)), Value::Number(delay)) = (self.leaves.pasts.get(input), self.at(delay)) else {
            return f64::NAN.into();
        };
        let samples = delay / self.leaves.sample_time;
        let (whole, part) = (samples.floor(), samples.fract());
        let last = self.program.length(*past).saturating_sub(1);
        let [now, before] = [0, 1].map(|more| past.at(last.saturating_sub(whole as usize + more)));
        match order {
            0 if part == 0.0 => now,
            0 => now * (1.0 - part) + before * part,
            _ => (before - now) / self.leaves.sample_time,
        }
    }

    /// A table, or its derivative of some order, as a binary search that is written out: NaN stays NaN.
    fn looked_up(&mut self, table: &Table, order: u8, x: Value) -> Value {
        let x = self.named(x);
        let found = self.named(f64::NAN.into());
        let ([first, last], knots) = (table.ends(order), table.knots());
        let (Some(low), Some(high)) = (knots.first(), knots.last()) else { return found.into() };
        let pieces: Vec<(f64, [f64; 4])> = knots.iter().copied().zip(table.pieces(order)).collect();
        let set = |value: f64| vec![Statement::Set(found, value.into())];
        let after = Statement::Choose {
            condition: Condition::Less((*high).into(), x.into()),
            then: set(last),
            otherwise: Vec::new(),
        };
        let inside = Statement::Choose {
            condition: Condition::AtMost(x.into(), (*high).into()),
            then: searched(&pieces, x, found),
            otherwise: vec![after],
        };
        self.statements.push(Statement::Choose {
            condition: Condition::Less(x.into(), (*low).into()),
            then: set(first),
            otherwise: vec![inside],
        });
        found.into()
    }

    fn applied(&mut self, function: Named, x: Value) -> Value {
        let function = match function {
            Named::Negative => return -x,
            Named::Sign => {
                let x = self.named(x);
                let sign = self.named(x.into());
                let (below, above) =
                    (Condition::Less(x.into(), 0.0.into()), Condition::Less(0.0.into(), x.into()));
                self.choose(sign, [(below, (-1.0).into()), (above, 1.0.into())]);
                return sign.into();
            }
            Named::Sqrt => Function::SquareRoot,
            Named::Exp => Function::Exponential,
            Named::Ln => Function::Logarithm,
            Named::Sin => Function::Sine,
            Named::Cos => Function::Cosine,
            Named::Tan => Function::Tangent,
            Named::Asin => Function::ArcSine,
            Named::Acos => Function::ArcCosine,
            Named::Atan => Function::ArcTangent,
            Named::Sinh => Function::HyperbolicSine,
            Named::Cosh => Function::HyperbolicCosine,
            Named::Tanh => Function::HyperbolicTangent,
            Named::Abs => Function::Absolute,
        };
        self.program.call(function, vec![x])
    }
}

/// Finds the piece of x among some, each with the knot that it begins at, and sets a variable to its polynomial.
fn searched(pieces: &[(f64, [f64; 4])], x: Variable, found: Variable) -> Vec<Statement> {
    let (before, after) = pieces.split_at(pieces.len() / 2);
    match (before, after) {
        (_, []) => Vec::new(),
        ([], [(knot, [a, b, c, d]), ..]) => {
            let s = x - *knot;
            let value = match [*b, *c, *d] {
                [0.0, 0.0, 0.0] => (*a).into(),
                [_, 0.0, 0.0] => s * *b + *a,
                [_, _, 0.0] => (s.clone() * *c + *b) * s + *a,
                _ => ((s.clone() * *d + *c) * s.clone() + *b) * s + *a,
            };
            vec![Statement::Set(found, value)]
        }
        (_, [(knot, _), ..]) => vec![Statement::Choose {
            condition: Condition::Less(x.into(), (*knot).into()),
            then: searched(before, x, found),
            otherwise: searched(after, x, found),
        }],
    }
}
