//! Equations that were compiled, as statements of a program.

use std::collections::HashMap;

use super::super::program::{Array, Condition, Function, Program, Statement, Value, Variable};
use crate::model::equations::{Function as Named, Operation, Program as Compiled};

/// Powers up to this one are products.
const PRODUCTS: i32 = 8;

/// What the leaves of equations stand for.
pub(super) struct Leaves {
    pub(super) states: Array,
    pub(super) inputs: Option<Array>,
    pub(super) time: Option<Value>,
    pub(super) step: f64,
}

/// The statements that the first `count` results of a program need, and these results. What is used once stands where
/// it is used.
pub(super) fn translated(
    program: &mut Program,
    compiled: &Compiled,
    count: usize,
    leaves: &Leaves,
) -> (Vec<Statement>, Vec<Value>) {
    let (operations, results) = compiled.first(count);
    let mut uses: HashMap<usize, usize> = HashMap::new();
    let arguments = operations.iter().flat_map(|(_, operation)| operation.arguments().into_iter().flatten());
    arguments.chain(results.iter().copied()).for_each(|place| *uses.entry(place).or_default() += 1);
    let mut translation = Translation { program, leaves, values: HashMap::new(), statements: Vec::new() };
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
    leaves: &'a Leaves,
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
            Operation::Input(input) => self.leaves.inputs.map_or(f64::NAN.into(), |inputs| inputs.at(input)),
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
            Operation::Apply(function, x) => {
                let x = self.at(x);
                self.applied(function, x)
            }
        }
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
