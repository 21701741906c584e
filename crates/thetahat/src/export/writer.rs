//! Statements in the words of a language: what C and Rust have in common, and where they differ.

use std::fmt::Write;

use super::program::{
    Condition, Counter, Function, Index, MISSING, Operation, Program, Statement, Value, Variable,
};
use super::{Language, Precision};

/// Numbers of a table in one line.
const IN_A_LINE: usize = 4;
/// The names of counters, from the outer loop to the inner one.
const COUNTERS: [&str; 4] = ["i", "j", "k", "n"];

/// Writes the statements of a program.
#[derive(Debug)]
pub(super) struct Writer<'p> {
    program: &'p Program,
    language: Language,
    precision: Precision,
    /// The counters of the loops that are open.
    open: Vec<Counter>,
    /// The variables that the blocks around the next statement have declared, each block its own.
    declared: Vec<Vec<Variable>>,
}

impl<'p> Writer<'p> {
    pub(super) fn new(program: &'p Program, language: Language, precision: Precision) -> Self {
        Self { program, language, precision, open: Vec::new(), declared: Vec::new() }
    }

    /// The type of numbers.
    pub(super) fn real(&self) -> &'static str {
        match (self.language, self.precision) {
            (Language::C, Precision::F64) => "double",
            (Language::C, Precision::F32) => "float",
            (Language::Rust, Precision::F64) => "f64",
            (Language::Rust, Precision::F32) => "f32",
        }
    }

    /// A number that is read back to the bit: the shortest decimal that is nearest to it.
    pub(super) fn number(&self, value: f64) -> String {
        let value = self.precision.rounded(value);
        match (self.language, self.precision) {
            (Language::C, _) if value.is_nan() => "NAN".to_owned(),
            (Language::C, _) if value.is_infinite() => {
                format!("{}INFINITY", if value < 0.0 { "-" } else { "" })
            }
            (Language::Rust, _) if value.is_nan() => format!("{}::NAN", self.real()),
            (Language::Rust, _) if value.is_infinite() => {
                format!("{}::{}INFINITY", self.real(), if value < 0.0 { "NEG_" } else { "" })
            }
            (_, Precision::F64) => format!("{value:?}"),
            (Language::C, Precision::F32) => format!("{:?}F", value as f32),
            (Language::Rust, Precision::F32) => format!("{:?}", value as f32),
        }
    }

    /// Numbers between brackets, a few in a line if they are many.
    pub(super) fn numbers(&self, values: &[f64], indent: &str) -> String {
        let (open, close) = match self.language {
            Language::C => ('{', '}'),
            Language::Rust => ('[', ']'),
        };
        let each: Vec<String> = values.iter().map(|value| self.number(*value)).collect();
        if each.len() <= IN_A_LINE {
            return format!("{open}{}{close}", each.join(", "));
        }
        let lines: Vec<String> =
            each.chunks(IN_A_LINE).map(|chunk| format!("{indent}    {},\n", chunk.join(", "))).collect();
        format!("{open}\n{}{indent}{close}", lines.concat())
    }

    /// A block of statements, indented.
    pub(super) fn block(&mut self, statements: &[Statement], indent: &str) -> String {
        self.declared.push(Vec::new());
        let text = self.statements(statements, indent);
        self.declared.pop();
        text
    }

    /// Statements of the block that is open.
    fn statements(&mut self, statements: &[Statement], indent: &str) -> String {
        let mut text = String::new();
        for statement in statements {
            self.statement(statement, statements, indent, &mut text);
        }
        text
    }

    fn statement(&mut self, statement: &Statement, block: &[Statement], indent: &str, text: &mut String) {
        let inner = format!("{indent}    ");
        let c = self.language == Language::C;
        // Writing to a string cannot fail.
        let _ = match statement {
            Statement::Let(variable, value) if self.declares_again(*variable) => {
                writeln!(text, "{indent}{}", self.assigned(self.name(*variable), value))
            }
            Statement::Let(variable, value) => {
                let (name, value) = (self.name(*variable), self.value(value));
                let real = self.real();
                match self.language {
                    Language::C => writeln!(text, "{indent}{real} {name} = {value};"),
                    Language::Rust => {
                        let changes = if sets(block, *variable) { "mut " } else { "" };
                        writeln!(text, "{indent}let {changes}{name}: {real} = {value};")
                    }
                }
            }
            Statement::Set(variable, value) => {
                writeln!(text, "{indent}{}", self.assigned(self.name(*variable), value))
            }
            Statement::Store(array, index, value) => {
                let place = self.value(&Value::At(*array, index.clone()));
                writeln!(text, "{indent}{}", self.assigned(&place, value))
            }
            Statement::Repeat { counter, times, body } => {
                self.open.push(*counter);
                let name = self.counter(*counter);
                let written = self.block(body, &inner);
                self.open.pop();
                let head = match self.language {
                    Language::C => format!("for (size_t {name} = 0U; {name} < {times}U; {name} += 1U)"),
                    Language::Rust if counts(body, *counter) => format!("for {name} in 0..{times}"),
                    Language::Rust => format!("for _ in 0..{times}"),
                };
                writeln!(text, "{indent}{head} {{\n{written}{indent}}}")
            }
            Statement::Choose { condition, then, otherwise } => {
                let (mut holds, mut then, mut otherwise) = (true, then, otherwise);
                if then.is_empty() {
                    (holds, then, otherwise) = (false, otherwise, then);
                }
                let condition = self.condition(condition, holds);
                let head = if c { format!("if ({condition})") } else { format!("if {condition}") };
                let body = self.block(then, &inner);
                let mut tail = String::new();
                if !otherwise.is_empty() {
                    tail = format!(" else {{\n{}{indent}}}", self.block(otherwise, &inner));
                }
                writeln!(text, "{indent}{head} {{\n{body}{indent}}}{tail}")
            }
            Statement::Miss => {
                writeln!(text, "{indent}{MISSING} += 1{};", if c { "U" } else { "" })
            }
            Statement::Evaluate { map, into } => {
                let (program, name, real) = (self.program, self.name(*into).to_owned(), self.real());
                let Some(own) = program.maps.get(*map) else { return };
                match (self.language, &own.statements) {
                    (Language::C, Some((statements, value))) => {
                        *text += &self.statements(statements, indent);
                        writeln!(text, "{indent}{real} {name} = {};", self.name(*value))
                    }
                    _ => {
                        let [parameters, z] =
                            [own.parameters, own.z].map(|array| &program.arrays[array.0].name);
                        writeln!(
                            text,
                            "{indent}let {name}: {real} = MAP{}.value(&{parameters}, &self.{z});",
                            map + 1
                        )
                    }
                }
            }
        };
    }

    /// Gives a place a value: by `+=` and its like where it is made of what stands there.
    fn assigned(&self, place: &str, value: &Value) -> String {
        if let Value::Binary(operation, one, other) = value {
            let sign = sign(*operation);
            if self.value(one) == place {
                return format!("{place} {sign}= {};", self.value(other));
            }
            let commutes = matches!(operation, Operation::Add | Operation::Multiply);
            if commutes && self.value(other) == place {
                return format!("{place} {sign}= {};", self.value(one));
            }
        }
        format!("{place} = {};", self.value(value))
    }

    fn condition(&self, condition: &Condition, holds: bool) -> String {
        let is = if holds { "!" } else { "" };
        match (condition, self.language) {
            (Condition::Missing(value), Language::C) => format!("{is}isfinite({})", self.value(value)),
            (Condition::Missing(value), Language::Rust) => format!("{is}{}.is_finite()", self.nested(value)),
            (Condition::Less(one, other), _) => self.comparison(one, "<", other, holds),
            (Condition::AtMost(one, other), _) => self.comparison(one, "<=", other, holds),
        }
    }

    fn comparison(&self, one: &Value, sign: &str, other: &Value, holds: bool) -> String {
        let plain = format!("{} {sign} {}", self.nested(one), self.nested(other));
        if holds { plain } else { format!("!({plain})") }
    }

    fn name(&self, variable: Variable) -> &str {
        self.program.variables.get(variable.0).map_or("", String::as_str)
    }

    /// Whether the open block has this variable already: a loop of one turn stands in the block around it. Notes it
    /// else.
    fn declares_again(&mut self, variable: Variable) -> bool {
        let Some(own) = self.declared.last_mut() else { return false };
        let again = own.contains(&variable);
        if !again {
            own.push(variable);
        }
        again
    }

    /// The name of a counter by the depth of its loop: i, j, k, n, n2, n3 …
    fn counter(&self, counter: Counter) -> String {
        let depth = self.open.iter().position(|open| *open == counter).unwrap_or(self.open.len());
        let last = COUNTERS.len() - 1;
        let number = if depth > last { (depth - last + 1).to_string() } else { String::new() };
        format!("{}{number}", COUNTERS[depth.min(last)])
    }

    fn index(&self, Index { constant, terms }: &Index) -> String {
        let suffix = if self.language == Language::C { "U" } else { "" };
        let mut text = String::new();
        for (counter, factor) in terms.iter().filter(|(_, factor)| *factor > 0) {
            let times = if *factor == 1 { String::new() } else { format!("{factor}{suffix} * ") };
            let plus = if text.is_empty() { "" } else { " + " };
            let term = format!("{times}{}", self.counter(*counter));
            text += &if *factor == 1 { format!("{plus}{term}") } else { format!("{plus}({term})") };
        }
        if *constant > 0 || text.is_empty() {
            text = if text.is_empty() {
                format!("{constant}{suffix}")
            } else {
                format!("{text} + {constant}{suffix}")
            };
        }
        for (counter, factor) in terms.iter().filter(|(_, factor)| *factor < 0) {
            let times = if *factor == -1 { String::new() } else { format!("{}{suffix} * ", -factor) };
            text += &format!(" - {times}{}", self.counter(*counter));
        }
        text
    }

    pub(super) fn value(&self, value: &Value) -> String {
        match value {
            Value::Number(number) => self.number(*number),
            Value::Variable(variable) => self.name(*variable).to_owned(),
            Value::At(array, index) => {
                let Some(own) = self.program.arrays.get(array.0) else { return String::new() };
                let of = match (own.is_kept(), self.language) {
                    (true, Language::C) => "self->",
                    (true, Language::Rust) => "self.",
                    (false, _) => "",
                };
                format!("{of}{}[{}]", own.name, self.index(index))
            }
            Value::Negative(value) => format!("-{}", self.nested(value)),
            Value::Binary(operation, one, other) => {
                format!("{} {} {}", self.nested(one), sign(*operation), self.nested(other))
            }
            Value::Call(function, arguments) => {
                let single = self.precision == Precision::F32;
                let (c, rust) = names(*function);
                let arguments: Vec<String> = arguments.iter().map(|value| self.value(value)).collect();
                let arguments = arguments.join(", ");
                match self.language {
                    Language::C => format!("{c}{}({arguments})", if single { "f" } else { "" }),
                    Language::Rust => format!("{rust}({arguments})"),
                }
            }
        }
    }

    /// A value as a part of another.
    fn nested(&self, value: &Value) -> String {
        let alone = match value {
            Value::Number(number) => *number >= 0.0,
            Value::Variable(_) | Value::At(..) | Value::Call(..) => true,
            Value::Negative(_) | Value::Binary(..) => false,
        };
        if alone { self.value(value) } else { format!("({})", self.value(value)) }
    }
}

/// Whether statements give a variable another value.
fn sets(statements: &[Statement], variable: Variable) -> bool {
    let is_first = |statement: &&Statement| matches!(statement, Statement::Let(own, _) if *own == variable);
    statements.iter().filter(is_first).count() > 1
        || statements.iter().any(|statement| match statement {
            Statement::Set(own, _) => *own == variable,
            Statement::Repeat { body, .. } => sets(body, variable),
            Statement::Choose { then, otherwise, .. } => sets(then, variable) || sets(otherwise, variable),
            Statement::Let(..) | Statement::Store(..) | Statement::Miss | Statement::Evaluate { .. } => false,
        })
}

/// Whether statements say which turn it is.
fn counts(statements: &[Statement], counter: Counter) -> bool {
    let of = |index: &Index| index.terms.iter().any(|(own, _)| *own == counter);
    statements.iter().any(|statement| match statement {
        Statement::Let(_, value) | Statement::Set(_, value) => reads(value, &of),
        Statement::Store(_, index, value) => of(index) || reads(value, &of),
        Statement::Repeat { body, .. } => counts(body, counter),
        Statement::Choose { condition, then, otherwise } => {
            let chosen = match condition {
                Condition::Missing(value) => reads(value, &of),
                Condition::Less(one, other) | Condition::AtMost(one, other) => {
                    reads(one, &of) || reads(other, &of)
                }
            };
            chosen || counts(then, counter) || counts(otherwise, counter)
        }
        Statement::Miss | Statement::Evaluate { .. } => false,
    })
}

/// Whether a number is one of a place in an array for which `of` holds, or is made of one.
fn reads(value: &Value, of: &impl Fn(&Index) -> bool) -> bool {
    match value {
        Value::Number(_) | Value::Variable(_) => false,
        Value::At(_, index) => of(index),
        Value::Negative(own) => reads(own, of),
        Value::Binary(_, one, other) => reads(one, of) || reads(other, of),
        Value::Call(_, arguments) => arguments.iter().any(|own| reads(own, of)),
    }
}

fn sign(operation: Operation) -> char {
    match operation {
        Operation::Add => '+',
        Operation::Subtract => '-',
        Operation::Multiply => '*',
        Operation::Divide => '/',
    }
}

/// What C and Rust call a function.
fn names(function: Function) -> (&'static str, &'static str) {
    match function {
        Function::Exponential => ("exp", "ComplexField::exp"),
        Function::HyperbolicTangent => ("tanh", "ComplexField::tanh"),
        Function::SquareRoot => ("sqrt", "ComplexField::sqrt"),
        Function::Logarithm => ("log", "ComplexField::ln"),
        Function::Sine => ("sin", "ComplexField::sin"),
        Function::Cosine => ("cos", "ComplexField::cos"),
        Function::Tangent => ("tan", "ComplexField::tan"),
        Function::ArcSine => ("asin", "ComplexField::asin"),
        Function::ArcCosine => ("acos", "ComplexField::acos"),
        Function::ArcTangent => ("atan", "ComplexField::atan"),
        Function::HyperbolicSine => ("sinh", "ComplexField::sinh"),
        Function::HyperbolicCosine => ("cosh", "ComplexField::cosh"),
        Function::Absolute => ("fabs", "ComplexField::abs"),
        Function::Angle => ("atan2", "RealField::atan2"),
        Function::Power => ("pow", "ComplexField::powf"),
    }
}
