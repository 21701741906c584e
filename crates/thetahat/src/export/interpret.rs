//! A program as it runs: the numbers that every language must give.

use std::sync::Arc;

use thetahat_core::Real;

use super::Precision;
use super::program::{
    Array, Condition, Entry, Evaluated, Function, Index, Operation, Program, Statement, Value, Variable,
};
use crate::model::Evaluator;

/// A program with what it remembers.
#[derive(Debug)]
pub(super) struct Machine {
    precision: Precision,
    arrays: Vec<Vec<f64>>,
    variables: Vec<f64>,
    counters: Vec<usize>,
    maps: Vec<Arc<Evaluation>>,
    missed: usize,
}

/// A map that can be evaluated.
#[derive(Debug)]
struct Evaluation {
    own: Evaluated,
    evaluator: Evaluator,
}

impl Machine {
    /// At its start. In single precision every number and every result of an operation is rounded: that of two of these
    /// in double precision has digits enough that rounding it twice is rounding it once (Figueroa 1995).
    pub(super) fn new(program: &Program, precision: Precision) -> Self {
        let values = |values: &Vec<f64>| values.iter().map(|value| precision.rounded(*value)).collect();
        Self {
            arrays: program.arrays.iter().map(|array| values(&array.values)).collect(),
            variables: vec![0.0; program.variables.len()],
            counters: vec![0; program.counters],
            maps: program.maps.iter().map(evaluation).collect(),
            missed: 0,
            precision,
        }
    }

    /// Runs a function on its arguments, and gives its result.
    pub(super) fn run(&mut self, entry: &Entry, arguments: &[&[f64]]) -> &[f64] {
        for (array, values) in entry.arguments.iter().zip(arguments) {
            if let Some(own) = self.arrays.get_mut(array.0) {
                let precision = self.precision;
                own.iter_mut().zip(*values).for_each(|(own, value)| *own = precision.rounded(*value));
            }
        }
        self.execute(&entry.body);
        let result = entry.result.and_then(|array| self.arrays.get(array.0));
        result.map_or(&[], Vec::as_slice)
    }

    /// How many numbers were missing until now.
    pub(super) fn missed(&self) -> usize {
        self.missed
    }

    /// What stands in an array.
    #[cfg(test)]
    pub(super) fn array(&self, program: &Program, name: &str) -> &[f64] {
        let place = program.arrays.iter().position(|array| array.name == name);
        place.and_then(|place| self.arrays.get(place)).map_or(&[], Vec::as_slice)
    }

    fn execute(&mut self, statements: &[Statement]) {
        for statement in statements {
            match statement {
                Statement::Let(Variable(place), value) | Statement::Set(Variable(place), value) => {
                    self.variables[*place] = self.value(value);
                }
                Statement::Store(Array(array), index, value) => {
                    let (value, place) = (self.value(value), self.place(index));
                    self.arrays[*array][place] = value;
                }
                Statement::Repeat { counter, times, body } => {
                    for turn in 0..*times {
                        self.counters[counter.0] = turn;
                        self.execute(body);
                    }
                }
                Statement::Choose { condition, then, otherwise } => {
                    let holds = match condition {
                        Condition::Missing(value) => !self.value(value).is_finite(),
                        Condition::Less(one, other) => self.value(one) < self.value(other),
                        Condition::AtMost(one, other) => self.value(one) <= self.value(other),
                    };
                    self.execute(if holds { then } else { otherwise });
                }
                Statement::Miss => self.missed += 1,
                Statement::Evaluate { map, into } => self.variables[into.0] = self.evaluate(*map),
            }
        }
    }

    /// What a map makes of its regressors: in double precision the core says it.
    fn evaluate(&mut self, map: usize) -> f64 {
        let map = Arc::clone(&self.maps[map]);
        if let (Precision::F32, Some((statements, value))) = (self.precision, &map.own.statements) {
            self.execute(statements);
            return self.variables[value.0];
        }
        self.precision.rounded(map.evaluator.value(&self.arrays[map.own.z.0]))
    }

    fn place(&self, index: &Index) -> usize {
        let terms = index.terms.iter().map(|(counter, factor)| self.counters[counter.0] as isize * factor);
        index.constant.saturating_add_signed(terms.sum())
    }

    fn value(&self, value: &Value) -> f64 {
        let exact = match value {
            Value::Number(number) => *number,
            Value::Variable(variable) => return self.variables[variable.0],
            Value::At(array, index) => return self.arrays[array.0][self.place(index)],
            Value::Negative(value) => return -self.value(value),
            Value::Binary(operation, one, other) => {
                let (one, other) = (self.value(one), self.value(other));
                match operation {
                    Operation::Add => one + other,
                    Operation::Subtract => one - other,
                    Operation::Multiply => one * other,
                    Operation::Divide => one / other,
                }
            }
            Value::Call(function, arguments) => {
                let value = |place: usize| arguments.get(place).map_or(f64::NAN, |value| self.value(value));
                return match self.precision {
                    Precision::F64 => call(*function, [value(0), value(1)]),
                    Precision::F32 => f64::from(call(*function, [value(0) as f32, value(1) as f32])),
                };
            }
        };
        self.precision.rounded(exact)
    }
}

fn evaluation(map: &Evaluated) -> Arc<Evaluation> {
    Arc::new(Evaluation { own: map.clone(), evaluator: Evaluator::new(&map.functions, map.theta.clone()) })
}

fn call<T: Real>(function: Function, [x, other]: [T; 2]) -> T {
    match function {
        Function::Exponential => x.exponential(),
        Function::HyperbolicTangent => x.hyperbolic_tangent(),
        Function::SquareRoot => x.sqrt(),
        Function::Logarithm => x.ln(),
        Function::Sine => x.sin(),
        Function::Cosine => x.cos(),
        Function::Tangent => x.tan(),
        Function::ArcSine => x.asin(),
        Function::ArcCosine => x.acos(),
        Function::ArcTangent => x.atan(),
        Function::HyperbolicSine => x.sinh(),
        Function::HyperbolicCosine => x.cosh(),
        Function::Absolute => x.abs(),
        Function::Angle => x.atan2(other),
        Function::Power => x.powf(other),
    }
}
