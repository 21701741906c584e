//! Expressions of a model, read into a graph.
//!
//! ```text
//! sum        = product (("+" | "-") product)*
//! product    = sign (("*" | "/") sign)*
//! sign       = ("+" | "-") sign | power
//! power      = operand ("^" sign)?              so that -x^2 = -(x^2) and x^y^z = x^(y^z)
//! operand    = number | name | function "(" sum ("," sum)* within? ")" | table | branch | delayed | "(" sum ")"
//! table      = ("table" | "lines") "(" sum ";" sum ":" sum ("," sum ":" sum)* ")"
//! branch     = "if" either "then" sum "else" sum | "if" comparison within "then" sum "else" sum
//! either     = both ("or" both)*
//! both       = condition ("and" condition)*
//! condition  = "not" condition | "(" either ")" | comparison
//! comparison = sum ("<" | "<=" | ">" | ">=") sum
//! within     = "within" sum
//! delayed    = input "(" sum ")"                where the sum is t less what parameters say
//! ```
//!
//! Nothing is stored between text and graph: an operator combines two nodes as soon as both are read. What is nested is
//! counted, so that no text can use up the stack.

mod forms;

use winnow::Parser;
use winnow::combinator::{Infix, Prefix, expression};
use winnow::error::{ErrMode, ParserError};
use winnow::stream::{LocatingSlice, Location, Stateful, Stream};

use super::document::{quoted, suggestion};
use super::graph::{Function, Graph, Node, Operation};
use super::interpolation::Shape;

/// How deep an expression may be nested.
const DEEPEST: usize = 100;

/// Every function with the numbers of its arguments.
const FUNCTIONS: [(&str, usize); 23] = [
    ("sin", 1),
    ("cos", 1),
    ("tan", 1),
    ("asin", 1),
    ("acos", 1),
    ("atan", 1),
    ("atan2", 2),
    ("sinh", 1),
    ("cosh", 1),
    ("tanh", 1),
    ("exp", 1),
    ("ln", 1),
    ("log10", 1),
    ("sqrt", 1),
    ("abs", 1),
    ("sign", 1),
    ("min", 2),
    ("max", 2),
    ("sat", 3),
    ("dead", 3),
    // Of tables what stands before their knots.
    ("table", 1),
    ("lines", 1),
    // Refused in words, as it is the natural logarithm in some languages and the decimal one in others.
    ("log", 1),
];

/// Names that mean something already.
pub(super) const CONSTANTS: [&str; 3] = ["pi", "t", "dt"];

/// Words of a branch.
const WORDS: [&str; 7] = ["if", "then", "else", "within", "and", "or", "not"];

/// Whether a name may not be given to a state, an input or a parameter.
pub(super) fn is_reserved(name: &str) -> bool {
    CONSTANTS.contains(&name)
        || WORDS.contains(&name)
        || FUNCTIONS.iter().any(|(function, _)| *function == name)
}

/// Whether a text can stand in an expression as a name.
pub(super) fn is_name(name: &str) -> bool {
    name.chars().next().is_some_and(starts_name) && name.chars().all(continues_name)
}

fn starts_name(letter: char) -> bool {
    letter.is_alphabetic() || letter == '_'
}

fn continues_name(letter: char) -> bool {
    letter.is_alphanumeric() || letter == '_'
}

/// What the names of an expression stand for.
pub(super) trait Names {
    /// The node of a name; `Err` in words if it may not stand here, `Ok(None)` if it is unknown.
    fn node(&self, name: &str) -> Result<Option<Node>, String>;
    /// All that are known here.
    fn all(&self) -> Vec<&str>;
}

/// What is wrong with an expression, and where.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Fault {
    /// In bytes from its beginning.
    pub(super) offset: usize,
    pub(super) message: String,
}

/// Reads an expression into a graph.
pub(super) fn read(text: &str, graph: &mut Graph, names: &dyn Names) -> Result<Node, Fault> {
    let state = Scope { graph, names, depth: 0 };
    let mut input = Stateful { input: LocatingSlice::new(text), state };
    let node = sum(&mut input).map_err(|mode| match mode {
        ErrMode::Backtrack(fault) | ErrMode::Cut(fault) => fault,
        ErrMode::Incomplete(_) => {
            Fault { offset: text.len(), message: "the expression ends too early".to_owned() }
        }
    })?;
    blanks(&mut input);
    match rest(&input).chars().next() {
        None => Ok(node),
        Some(')') => {
            Err(fault(&input, "this ')' closes nothing: '(' is missing before it, or it is one too many"))
        }
        Some(',') => Err(fault(&input, "this ',' stands outside of a function's arguments")),
        Some(';' | ':') => Err(fault(&input, "this stands outside of a table's knots")),
        Some('<' | '>') => Err(fault(&input, forms::STRAY_COMPARISON)),
        Some('=') => {
            Err(fault(&input, "an expression has no '=': the name to its left is the key of the TOML file"))
        }
        Some(_) => Err(fault(
            &input,
            format!("an operator (+ - * / ^) is missing before {}", quoted(word(rest(&input)))),
        )),
    }
}

struct Scope<'g> {
    graph: &'g mut Graph,
    names: &'g dyn Names,
    depth: usize,
}

impl std::fmt::Debug for Scope<'_> {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("Scope").field("depth", &self.depth).finish_non_exhaustive()
    }
}

type Input<'t, 'g> = Stateful<LocatingSlice<&'t str>, Scope<'g>>;
type Answer<T> = Result<T, ErrMode<Fault>>;

impl ParserError<Input<'_, '_>> for Fault {
    type Inner = Self;

    fn from_input(input: &Input<'_, '_>) -> Self {
        fault(input, unexpected(rest(input)))
    }

    fn into_inner(self) -> Result<Self::Inner, Self> {
        Ok(self)
    }
}

/// What to say where an operand is missing.
fn unexpected(rest: &str) -> String {
    match rest.chars().next() {
        None => "the expression ends where a number, a name or '(' must follow".to_owned(),
        Some('"' | '\'') => "a text cannot stand in an expression".to_owned(),
        Some(_) => format!("a number, a name or '(' must stand here, not {}", quoted(word(rest))),
    }
}

/// A fault where the input stands.
fn fault(input: &Input<'_, '_>, message: impl Into<String>) -> Fault {
    Fault { offset: input.input.current_token_start(), message: message.into() }
}

fn rest<'t>(input: &Input<'t, '_>) -> &'t str {
    input.input.peek_slice(input.input.eof_offset())
}

/// The first word: a name, a number, or a single character.
fn word(text: &str) -> &str {
    let end = text.find(|letter| !continues_name(letter)).unwrap_or(text.len());
    let single = text.chars().next().map_or(0, char::len_utf8);
    text.get(..end.max(single)).unwrap_or(text)
}

fn blanks(input: &mut Input<'_, '_>) {
    let text = rest(input);
    let blank = text.len() - text.trim_start().len();
    input.input.next_slice(blank);
}

/// Takes a character, and the blanks before it, if it comes next.
fn taken(input: &mut Input<'_, '_>, letter: char) -> bool {
    blanks(input);
    let comes = rest(input).starts_with(letter);
    if comes {
        input.input.next_slice(letter.len_utf8());
    }
    comes
}

/// Takes a word, and the blanks before it, if it comes next.
fn word_taken(input: &mut Input<'_, '_>, wanted: &str) -> bool {
    blanks(input);
    let comes = word(rest(input)) == wanted;
    if comes {
        input.input.next_slice(wanted.len());
    }
    comes
}

/// One level deeper.
fn descend(input: &mut Input<'_, '_>) -> Answer<()> {
    input.state.depth += 1;
    if input.state.depth > DEEPEST {
        let message = format!("the expression is nested more than {DEEPEST} deep here; split it up");
        return Err(ErrMode::Cut(fault(input, message)));
    }
    Ok(())
}

fn ascend<T>(input: &mut Input<'_, '_>, node: T) -> Answer<T> {
    input.state.depth -= 1;
    Ok(node)
}

/// Precedence climbing (Pratt 1973). What recurs, a sign and a power, is counted when its operator is read, and again
/// when its operands are.
fn sum(input: &mut Input<'_, '_>) -> Answer<Node> {
    expression(operand)
        .prefix(|input: &mut Input<'_, '_>| {
            blanks(input);
            let prefix = match rest(input).chars().next() {
                Some('-') => Prefix(15, |input: &mut Input<'_, '_>, x| {
                    let negative = input.state.graph.apply(Function::Negative, x);
                    ascend(input, negative)
                }),
                Some('+') => Prefix(15, |input: &mut Input<'_, '_>, x| ascend(input, x)),
                _ => return Err(ErrMode::Backtrack(fault(input, unexpected(rest(input))))),
            };
            input.input.next_slice(1);
            descend(input)?;
            Ok(prefix)
        })
        .infix(|input: &mut Input<'_, '_>| {
            blanks(input);
            let operator = rest(input).chars().next();
            let infix = match operator {
                Some('+') => {
                    Infix::Left(5, |input: &mut Input<'_, '_>, a, b| Ok(input.state.graph.add(a, b)))
                }
                Some('-') => {
                    Infix::Left(5, |input: &mut Input<'_, '_>, a, b| Ok(input.state.graph.subtract(a, b)))
                }
                Some('*') => {
                    Infix::Left(10, |input: &mut Input<'_, '_>, a, b| Ok(input.state.graph.multiply(a, b)))
                }
                Some('/') => {
                    Infix::Left(10, |input: &mut Input<'_, '_>, a, b| Ok(input.state.graph.divide(a, b)))
                }
                Some('^') => Infix::Right(20, |input: &mut Input<'_, '_>, a, b| {
                    let power = input.state.graph.raise(a, b);
                    ascend(input, power)
                }),
                _ => return Err(ErrMode::Backtrack(fault(input, ""))),
            };
            input.input.next_slice(1);
            if rest(input).starts_with('*') && operator == Some('*') {
                return Err(ErrMode::Cut(fault(input, "a power is written with '^', not '**'")));
            }
            if operator == Some('^') {
                descend(input)?;
            }
            Ok(infix)
        })
        .parse_next(input)
}

/// A number, a name, a function, or what is in parentheses.
fn operand(input: &mut Input<'_, '_>) -> Answer<Node> {
    blanks(input);
    let text = rest(input);
    match text.chars().next() {
        Some('(') => {
            let opened = input.input.current_token_start();
            input.input.next_slice(1);
            descend(input)?;
            let node = sum(input).map_err(cut)?;
            close(input, opened)?;
            ascend(input, node)
        }
        Some(letter) if letter.is_ascii_digit() || letter == '.' => number(input),
        Some(letter) if starts_name(letter) => name(input),
        _ => Err(ErrMode::Backtrack(fault(input, unexpected(text)))),
    }
}

fn cut(mode: ErrMode<Fault>) -> ErrMode<Fault> {
    match mode {
        ErrMode::Backtrack(fault) => ErrMode::Cut(fault),
        other => other,
    }
}

/// Takes a ')'.
fn close(input: &mut Input<'_, '_>, opened: usize) -> Answer<()> {
    if taken(input, ')') {
        return Ok(());
    }
    let text = rest(input);
    Err(ErrMode::Cut(if text.is_empty() {
        Fault { offset: opened, message: "this '(' is not closed: ')' is missing".to_owned() }
    } else if text.starts_with(['<', '>']) {
        fault(input, forms::STRAY_COMPARISON)
    } else {
        fault(input, format!("an operator or ')' is missing before {}", quoted(word(text))))
    }))
}

/// Such as 12, 0.5, .5, 1e-3.
fn number(input: &mut Input<'_, '_>) -> Answer<Node> {
    let text = rest(input);
    let digits =
        |text: &str| text.len() - text.trim_start_matches(|letter: char| letter.is_ascii_digit()).len();
    let after = |end: usize| text.get(end..).unwrap_or_default();
    let mut end = digits(text);
    if after(end).starts_with('.') {
        end += 1 + digits(after(end + 1));
    }
    if after(end).starts_with(['e', 'E']) {
        let sign = usize::from(after(end + 1).starts_with(['+', '-']));
        let exponent = digits(after(end + 1 + sign));
        end += if exponent > 0 { 1 + sign + exponent } else { 0 };
    }
    let written = text.get(..end).unwrap_or_default();
    let refused = |message: String| Err(ErrMode::Cut(fault(input, message)));
    let Some(value) = written.parse::<f64>().ok().filter(|value| value.is_finite()) else {
        return refused(format!("{} is no number that can be used", quoted(written)));
    };
    if after(end).starts_with(continues_name) || after(end).starts_with('.') {
        let all = text.find(|letter| !continues_name(letter) && letter != '.').unwrap_or(text.len());
        let all = quoted(text.get(..all).unwrap_or(text));
        return refused(format!("{all} is neither a number nor a name; a product is written with '*'"));
    }
    input.input.next_slice(end);
    Ok(input.state.graph.constant(value))
}

/// The place of the input that a name stands for.
fn input_of(input: &Input<'_, '_>, name: &str) -> Option<usize> {
    // Where there is no time, there are no delays.
    input.state.names.node("t").ok()??;
    match input.state.graph.operation(input.state.names.node(name).ok()??) {
        Operation::Input(place) => Some(place),
        _ => None,
    }
}

/// A name, or a function with its arguments.
fn name(input: &mut Input<'_, '_>) -> Answer<Node> {
    let name = word(rest(input));
    let start = input.input.current_token_start();
    let refused = |message: String| Err(ErrMode::Cut(Fault { offset: start, message }));
    if WORDS.contains(&name) && name != "if" {
        return refused(unexpected(name));
    }
    input.input.next_slice(name.len());
    if name == "if" {
        return forms::branch(input);
    }
    blanks(input);
    let called = rest(input).starts_with('(');
    let function = FUNCTIONS.iter().find(|(function, _)| *function == name);
    if name == "log" {
        return refused("'log' is ambiguous: write 'ln' for the natural logarithm, or 'log10'".to_owned());
    }
    if let Some(place) = input_of(input, name).filter(|_| called && function.is_none()) {
        return forms::delayed(input, name, place);
    }
    match (function, called) {
        (Some(("table", _)), true) => forms::table(input, name, Shape::Monotone, start),
        (Some(("lines", _)), true) => forms::table(input, name, Shape::Lines, start),
        (Some((_, arguments)), true) => forms::function(input, name, *arguments, start),
        (Some(_), false) => refused(format!("'{name}' is a function: its argument follows in parentheses")),
        (None, true) => {
            let near = suggestion(name, FUNCTIONS.iter().map(|(function, _)| *function));
            refused(format!("there is no function {}{near}; a product is written with '*'", quoted(name)))
        }
        (None, false) => match input.state.names.node(name) {
            Ok(Some(node)) => Ok(node),
            Ok(None) if name == "pi" => Ok(input.state.graph.constant(std::f64::consts::PI)),
            Ok(None) => {
                let known = input.state.names.all();
                let near = suggestion(name, known.iter().copied());
                refused(format!("unknown name {}{near} (known here: {})", quoted(name), known.join(", ")))
            }
            Err(message) => refused(message),
        },
    }
}
