//! A step of a model as a small program: numbers, arrays and loops of fixed length, from which every language is
//! written.

use std::ops::{Add, Div, Mul, Neg, Sub};

use crate::model::Map;

/// Numbers that never change, that the step remembers, that go in, or that come out.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Array(pub(super) usize);

/// A number that lives in one step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Variable(pub(super) usize);

/// What counts the turns of a loop, from 0 on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Counter(pub(super) usize);

/// A place in an array: `constant + sum factor counter`.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Index {
    pub(super) constant: usize,
    pub(super) terms: Vec<(Counter, isize)>,
}

impl From<usize> for Index {
    fn from(constant: usize) -> Self {
        Self { constant, terms: Vec::new() }
    }
}

impl From<Counter> for Index {
    fn from(counter: Counter) -> Self {
        Self { constant: 0, terms: vec![(counter, 1)] }
    }
}

impl Index {
    /// The place as far from the end of so many places as this one is from their start.
    pub(super) fn mirrored(self, places: usize) -> Self {
        let terms = self.terms.into_iter().map(|(counter, factor)| (counter, -factor));
        Self { constant: places.saturating_sub(self.constant + 1), terms: terms.collect() }
    }

    /// The same so many places on.
    pub(super) fn plus(mut self, places: usize) -> Self {
        self.constant += places;
        self
    }

    /// The place of an entry of a matrix that is stored row by row, of so many columns.
    pub(super) fn entry(&self, columns: usize, column: &Self) -> Self {
        let times = |(counter, factor): &(Counter, isize)| (*counter, factor * columns as isize);
        let terms = self.terms.iter().map(times).chain(column.terms.iter().copied());
        Self { constant: self.constant * columns + column.constant, terms: terms.collect() }
    }
}

/// What an array is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// Constants.
    Table,
    /// Numbers that a step leaves to the next one.
    Memory,
    /// Numbers that a step leaves to who reads them.
    Told,
    /// What a function is given, or gives.
    Argument,
    Result,
}

/// An array with its name.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Declared {
    pub(super) name: String,
    pub(super) kind: Kind,
    /// What it holds; of a memory what it starts with, of arguments and results zeros.
    pub(super) values: Vec<f64>,
    /// Of a table that the core reads in groups, how many numbers are one.
    pub(super) group: usize,
    pub(super) doc: String,
}

impl Declared {
    /// Whether it stays from one step to the next.
    pub(super) fn is_kept(&self) -> bool {
        matches!(self.kind, Kind::Memory | Kind::Told)
    }
}

/// The four operations.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Operation {
    Add,
    Subtract,
    Multiply,
    Divide,
}

/// Functions that languages have.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Function {
    Exponential,
    HyperbolicTangent,
    SquareRoot,
    Logarithm,
    Sine,
    Cosine,
    Tangent,
    ArcSine,
    ArcCosine,
    ArcTangent,
    HyperbolicSine,
    HyperbolicCosine,
    Absolute,
    /// The angle of the point (second, first).
    Angle,
    /// The first to the power of the second.
    Power,
}

/// A number as it is computed. No language may change the order of operations.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Value {
    Number(f64),
    Variable(Variable),
    At(Array, Index),
    Negative(Box<Value>),
    Binary(Operation, Box<Value>, Box<Value>),
    Call(Function, Vec<Value>),
}

impl From<f64> for Value {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}

impl From<Variable> for Value {
    fn from(variable: Variable) -> Self {
        Self::Variable(variable)
    }
}

impl Array {
    pub(super) fn at(self, index: impl Into<Index>) -> Value {
        Value::At(self, index.into())
    }
}

macro_rules! operation {
    ($trait:ident, $method:ident, $operation:ident) => {
        impl<V: Into<Value>> $trait<V> for Value {
            type Output = Self;

            fn $method(self, other: V) -> Self {
                Self::Binary(Operation::$operation, Box::new(self), Box::new(other.into()))
            }
        }

        impl<V: Into<Value>> $trait<V> for Variable {
            type Output = Value;

            fn $method(self, other: V) -> Value {
                Value::Variable(self).$method(other)
            }
        }
    };
}

operation!(Add, add, Add);
operation!(Sub, sub, Subtract);
operation!(Mul, mul, Multiply);
operation!(Div, div, Divide);

impl Neg for Value {
    type Output = Self;

    fn neg(self) -> Self {
        Self::Negative(Box::new(self))
    }
}

/// What a branch is taken for.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Condition {
    /// The number is not finite.
    Missing(Value),
    Less(Value, Value),
    AtMost(Value, Value),
}

#[derive(Debug, Clone, PartialEq)]
pub(super) enum Statement {
    /// A variable of which this is the first value.
    Let(Variable, Value),
    Set(Variable, Value),
    Store(Array, Index, Value),
    Repeat {
        counter: Counter,
        times: usize,
        body: Vec<Statement>,
    },
    Choose {
        condition: Condition,
        then: Vec<Statement>,
        otherwise: Vec<Statement>,
    },
    /// Counts a number that the function was given and takes for missing.
    Miss,
    /// A variable of which this is the first value: what a map makes of its regressors.
    Evaluate {
        map: usize,
        into: Variable,
    },
}

impl Statement {
    /// What is done unless a number is missing.
    pub(super) fn unless_missing(number: Value, done: Vec<Self>) -> Self {
        Self::Choose { condition: Condition::Missing(number), then: Vec::new(), otherwise: done }
    }

    /// The same of a number that the function was given, which counts if it is missing.
    pub(super) fn unless_missed(given: Value, done: Vec<Self>) -> Self {
        Self::Choose { condition: Condition::Missing(given), then: vec![Self::Miss], otherwise: done }
    }

    fn misses(&self) -> bool {
        match self {
            Self::Miss => true,
            Self::Repeat { body, .. } => body.iter().any(Self::misses),
            Self::Choose { then, otherwise, .. } => then.iter().chain(otherwise).any(Self::misses),
            Self::Let(..) | Self::Set(..) | Self::Store(..) | Self::Evaluate { .. } => false,
        }
    }
}

/// A map of a program.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Evaluated {
    pub(super) functions: Map,
    pub(super) theta: Vec<f64>,
    pub(super) z: Array,
    pub(super) parameters: Array,
    pub(super) basis: Basis,
    /// Statements that leave g(z) in a variable; none where only the core has it.
    pub(super) statements: Option<(Vec<Statement>, Variable)>,
}

/// A constant of the core: its type and its fields.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Basis {
    pub(super) name: &'static str,
    /// Whether the type has that of numbers.
    pub(super) generic: bool,
    pub(super) fields: Vec<(&'static str, Field)>,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) enum Field {
    /// A table, which Rust reads in groups of so many.
    Table(Array),
    Integers(Vec<usize>),
    Count(usize),
    Flag(bool),
    /// A variant of an enumeration of the core.
    Word(&'static str, &'static str),
}

/// A function of the program. It has at most one array for each kind of argument.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Entry {
    pub(super) name: &'static str,
    pub(super) doc: Vec<String>,
    pub(super) arguments: Vec<Array>,
    pub(super) result: Option<Array>,
    pub(super) body: Vec<Statement>,
}

impl Entry {
    /// Whether it counts the numbers that are missing, and gives how many there are.
    pub(super) fn misses(&self) -> bool {
        self.body.iter().any(Statement::misses)
    }

    /// What is said of it, and of that count.
    pub(super) fn comments(&self) -> impl Iterator<Item = &str> {
        let count =
            "It gives how many of the numbers that it takes are missing, as they are not finite: 0 if none.";
        self.doc.iter().map(String::as_str).chain(self.misses().then_some(count))
    }
}

/// How the count of numbers that are missing is called, so that no variable is.
pub(super) const MISSING: &str = "missing";

/// A model as it steps.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Program {
    pub(super) arrays: Vec<Declared>,
    pub(super) variables: Vec<String>,
    pub(super) counters: usize,
    pub(super) entries: Vec<Entry>,
    pub(super) maps: Vec<Evaluated>,
    /// Whether a function of the mathematical library is called.
    pub(super) calls: bool,
}

impl Program {
    /// An array; of arguments and results so many zeros.
    pub(super) fn array(&mut self, kind: Kind, name: &str, doc: &str, values: Vec<f64>) -> Array {
        self.arrays.push(Declared { name: name.to_owned(), kind, values, group: 1, doc: doc.to_owned() });
        Array(self.arrays.len() - 1)
    }

    pub(super) fn table(&mut self, name: &str, doc: &str, values: Vec<f64>) -> Array {
        self.array(Kind::Table, name, doc, values)
    }

    pub(super) fn memory(&mut self, name: &str, doc: &str, values: Vec<f64>) -> Array {
        self.array(Kind::Memory, name, doc, values)
    }

    /// So many numbers that a step leaves to who reads them, 0 at first.
    pub(super) fn told(&mut self, name: &str, doc: &str, size: usize) -> Array {
        self.array(Kind::Told, name, doc, vec![0.0; size])
    }

    /// A variable with a name of its own.
    pub(super) fn variable(&mut self, name: &str) -> Variable {
        let is_signal = |array: &&Declared| matches!(array.kind, Kind::Argument | Kind::Result);
        let signals = self.arrays.iter().filter(is_signal).map(|array| &array.name);
        let taken: Vec<&String> = self.variables.iter().chain(signals).collect();
        let mut own = name.to_owned();
        let mut number = 2;
        while taken.contains(&&own) || own == MISSING {
            own = format!("{name}_{number}");
            number += 1;
        }
        self.variables.push(own);
        Variable(self.variables.len() - 1)
    }

    /// Says that the core reads a table in groups of so many.
    pub(super) fn group(&mut self, table: Array, group: usize) {
        if let Some(table) = self.arrays.get_mut(table.0) {
            table.group = group;
        }
    }

    /// The numbers that it holds, by the names of their arrays.
    pub(super) fn constants(&self) -> impl Iterator<Item = (&str, &[f64])> {
        self.arrays.iter().map(|array| (array.name.as_str(), array.values.as_slice()))
    }

    pub(super) fn length(&self, array: Array) -> usize {
        self.arrays.get(array.0).map_or(0, |array| array.values.len())
    }

    /// A call of a function of the mathematical library.
    pub(super) fn call(&mut self, function: Function, arguments: Vec<Value>) -> Value {
        self.calls = true;
        Value::Call(function, arguments)
    }

    /// So many turns of what `body` makes of the counter; nothing for none, and no loop for one.
    pub(super) fn repeat(
        &mut self,
        times: usize,
        body: impl FnOnce(&mut Self, Index) -> Vec<Statement>,
    ) -> Vec<Statement> {
        match times {
            0 => Vec::new(),
            1 => body(self, Index::from(0)),
            _ => {
                let counter = Counter(self.counters);
                self.counters += 1;
                let body = body(self, counter.into());
                vec![Statement::Repeat { counter, times, body }]
            }
        }
    }

    /// Everything in a memory moves one place towards its start; the last place is free.
    pub(super) fn shift(&mut self, line: Array) -> Vec<Statement> {
        let places = self.length(line).saturating_sub(1);
        self.repeat(places, |_, i| vec![Statement::Store(line, i.clone(), line.at(i.plus(1)))])
    }

    /// The same, and a value in the last place.
    pub(super) fn push(&mut self, line: Array, value: impl Into<Value>) -> Vec<Statement> {
        let Some(last) = self.length(line).checked_sub(1) else { return Vec::new() };
        let mut statements = self.shift(line);
        statements.push(Statement::Store(line, last.into(), value.into()));
        statements
    }
}
