//! What has more in it than an operator: functions with their arguments, tables, and branches.

use winnow::error::ErrMode;
use winnow::stream::{Location, Stream};

use super::super::branch::{self, Above, Condition};
use super::super::document::quoted;
use super::super::graph::{Function, Node, Operation};
use super::super::interpolation::{Shape, interpolated};
use super::{
    Answer, Fault, Input, ascend, blanks, close, cut, descend, fault, rest, sum, taken, word, word_taken,
};

/// What to say of a comparison that is no condition.
pub(super) const STRAY_COMPARISON: &str = "a comparison stands only after 'if': if a > b then c else d";

fn wrong(offset: usize, message: impl Into<String>) -> ErrMode<Fault> {
    ErrMode::Cut(Fault { offset, message: message.into() })
}

/// Where the next word begins.
fn place(input: &mut Input<'_, '_>) -> usize {
    blanks(input);
    input.input.current_token_start()
}

/// A width, if it comes next, and where it stands.
fn within(input: &mut Input<'_, '_>) -> Answer<Option<(usize, Node)>> {
    let start = place(input);
    if !word_taken(input, "within") {
        return Ok(None);
    }
    let at = place(input);
    let width = sum(input).map_err(cut)?;
    let graph = &*input.state.graph;
    if graph.known(width).is_some_and(|width| !(width > 0.0 && width.is_finite())) {
        return Err(wrong(at, "a width must be above 0; without 'within' the branch is a hard one"));
    }
    if !is_of_parameters(input, width) {
        return Err(wrong(
            at,
            "a width is a number or made of parameters, not of states, inputs or the time",
        ));
    }
    Ok(Some((start, width)))
}

/// Whether nothing that changes along a log is in a node.
fn is_of_parameters(input: &Input<'_, '_>, node: Node) -> bool {
    let graph = &*input.state.graph;
    graph.known(node).is_some()
        || !graph.depends(&[node], |operation| operation.moves() || operation == Operation::Step)
}

/// An input a delay ago, from its '(' on.
pub(super) fn delayed(input: &mut Input<'_, '_>, name: &str, place: usize) -> Answer<Node> {
    let opened = input.input.current_token_start();
    input.input.next_slice(1);
    descend(input)?;
    let time = sum(input).map_err(cut)?;
    close(input, opened)?;
    let form = format!("an input some seconds ago is written {name}(t - delay)");
    let Some(delay) = input.state.graph.delay_of(time) else {
        return Err(wrong(opened, format!("{form}; a product is written with '*'")));
    };
    if !is_of_parameters(input, delay) {
        let message = "the delay is a number or made of parameters, not of states, inputs or the time";
        return Err(wrong(opened, format!("{form}: {message}")));
    }
    if input.state.graph.known(delay).is_some_and(|delay| delay < 0.0) {
        return Err(wrong(opened, format!("{form}: what {} will be is not known", quoted(name))));
    }
    let node = input.state.graph.delayed(place, delay);
    ascend(input, node)
}

/// A branch after its `if`.
pub(super) fn branch(input: &mut Input<'_, '_>) -> Answer<Node> {
    descend(input)?;
    let condition = either(input)?;
    let width = within(input)?;
    if let (Some((start, _)), Condition::Not(_) | Condition::Both(_) | Condition::Either(_)) =
        (width, &condition)
    {
        let message = "'within' goes with a single comparison: with 'and', 'or' and 'not' there is no one distance from the \
                       border; nest branches that have a width each, or leave it out";
        return Err(wrong(start, message));
    }
    expect(input, "then")?;
    let yes = sum(input).map_err(cut)?;
    expect(input, "else")?;
    let no = sum(input).map_err(cut)?;
    let graph = &mut *input.state.graph;
    let node = match (&condition, width) {
        (Condition::Above(above), Some((_, width))) => branch::branched(graph, *above, Some(width), yes, no),
        _ => branch::chosen(graph, &condition, yes, no),
    };
    ascend(input, node)
}

/// Such as a > b or c > d and not e > f: 'not' binds closest, then 'and'.
fn either(input: &mut Input<'_, '_>) -> Answer<Condition> {
    joined(input, "or", Condition::Either, |input| joined(input, "and", Condition::Both, condition))
}

/// One condition, or several with a word between them.
fn joined(
    input: &mut Input<'_, '_>,
    between: &str,
    of: fn(Vec<Condition>) -> Condition,
    each: fn(&mut Input<'_, '_>) -> Answer<Condition>,
) -> Answer<Condition> {
    let first = each(input)?;
    if !word_taken(input, between) {
        return Ok(first);
    }
    let mut all = vec![first, each(input)?];
    while word_taken(input, between) {
        all.push(each(input)?);
    }
    Ok(of(all))
}

/// A comparison, what is in parentheses, or what does not hold.
fn condition(input: &mut Input<'_, '_>) -> Answer<Condition> {
    if word_taken(input, "not") {
        descend(input)?;
        let inner = condition(input)?;
        return ascend(input, Condition::Not(Box::new(inner)));
    }
    let opened = place(input);
    if !holds_a_condition(rest(input)) {
        return comparison(input).map(Condition::Above);
    }
    input.input.next_slice(1);
    descend(input)?;
    let inner = either(input)?;
    close(input, opened)?;
    ascend(input, inner)
}

/// Whether a '(' begins a condition and not a sum: by what follows its ')'.
fn holds_a_condition(text: &str) -> bool {
    if !text.starts_with('(') {
        return false;
    }
    let mut depth = 0_usize;
    let end = text.char_indices().find(|(_, letter)| {
        depth = depth + usize::from(*letter == '(') - usize::from(*letter == ')');
        depth == 0
    });
    let after = end.and_then(|(end, _)| text.get(end + 1..)).map(str::trim_start);
    after
        .is_some_and(|after| after.starts_with(')') || ["and", "or", "then", "within"].contains(&word(after)))
}

/// Such as a > b.
fn comparison(input: &mut Input<'_, '_>) -> Answer<Above> {
    let one = sum(input).map_err(cut)?;
    let at = place(input);
    let sign = rest(input).chars().next();
    let Some(sign @ ('<' | '>')) = sign else {
        let equal = if matches!(sign, Some('=' | '!')) {
            "; numbers that are computed are hardly ever equal"
        } else {
            ""
        };
        return Err(wrong(at, format!("a comparison must stand here, one of < <= > >={equal}")));
    };
    input.input.next_slice(1);
    let or_equal = rest(input).starts_with('=');
    if or_equal {
        input.input.next_slice(1);
    }
    let other = sum(input).map_err(cut)?;
    let (a, b) = if sign == '>' { (one, other) } else { (other, one) };
    Ok(Above { a, b, or_equal })
}

/// Takes a word of a branch.
fn expect(input: &mut Input<'_, '_>, wanted: &str) -> Answer<()> {
    if word_taken(input, wanted) {
        return Ok(());
    }
    let text = rest(input);
    let found = match text.chars().next() {
        None => "the expression ends".to_owned(),
        Some('<' | '>' | '=') => {
            "one comparison follows another: join them, as in a < b and b < c".to_owned()
        }
        Some(_) => format!("here is {}", quoted(word(text))),
    };
    let form = "if a > b then c else d";
    Err(ErrMode::Cut(fault(input, format!("'{wanted}' is missing, {found}: a branch is written {form}"))))
}

/// A table with its knots in parentheses.
pub(super) fn table(input: &mut Input<'_, '_>, name: &str, shape: Shape, start: usize) -> Answer<Node> {
    let opened = input.input.current_token_start();
    input.input.next_slice(1);
    descend(input)?;
    let x = sum(input).map_err(cut)?;
    let form = format!("a table is written {name}(x; 0:3.2, 0.5:3.65, 1:4.1)");
    if !taken(input, ';') {
        return Err(ErrMode::Cut(fault(input, format!("';' is missing after what the table is of: {form}"))));
    }
    let (mut knots, mut values): (Vec<f64>, Vec<Node>) = (Vec::new(), Vec::new());
    loop {
        let at = place(input);
        let knot = sum(input).map_err(cut)?;
        let Some(knot) = input.state.graph.known(knot).filter(|knot| knot.is_finite()) else {
            return Err(wrong(at, "a knot must be a number, or a parameter that is known"));
        };
        if let Some(last) = knots.last().filter(|last| **last >= knot) {
            return Err(wrong(at, format!("the knots of a table must rise, but {knot} follows {last}")));
        }
        if !taken(input, ':') {
            return Err(ErrMode::Cut(fault(
                input,
                format!("':' and a value are missing after the knot {knot}: {form}"),
            )));
        }
        let at = place(input);
        let value = sum(input).map_err(cut)?;
        if !is_of_parameters(input, value) {
            let message =
                "a value of a table is a number or made of parameters, not of states, inputs or the time";
            return Err(wrong(at, message));
        }
        if input.state.graph.known(value).is_some_and(|value| !value.is_finite()) {
            return Err(wrong(at, "a value of a table must be finite"));
        }
        knots.push(knot);
        values.push(value);
        if !taken(input, ',') {
            break;
        }
    }
    close(input, opened)?;
    if knots.len() < 2 {
        return Err(wrong(start, format!("a table has at least two knots: {form}")));
    }
    let node = interpolated(input.state.graph, shape, x, &knots, &values);
    ascend(input, node)
}

/// The arguments of a function in parentheses, and the function of them.
pub(super) fn function(input: &mut Input<'_, '_>, name: &str, wanted: usize, start: usize) -> Answer<Node> {
    let opened = input.input.current_token_start();
    input.input.next_slice(1);
    descend(input)?;
    let (mut arguments, mut width) = (Vec::new(), None);
    if !taken(input, ')') {
        arguments.push(sum(input).map_err(cut)?);
        while taken(input, ',') {
            arguments.push(sum(input).map_err(cut)?);
        }
        width = within(input)?.map(|(at, width)| match name {
            "abs" | "min" | "max" | "sat" | "dead" => Ok(width),
            _ => Err(wrong(
                at,
                format!("'{name}' has no width: 'within' goes with abs, min, max, sat, dead and if"),
            )),
        });
        close(input, opened)?;
    }
    let width = width.transpose()?;
    let graph = &mut *input.state.graph;
    let node = match *arguments.as_slice() {
        [x] if wanted == 1 => match name {
            "sin" => graph.apply(Function::Sin, x),
            "cos" => graph.apply(Function::Cos, x),
            "tan" => graph.apply(Function::Tan, x),
            "asin" => graph.apply(Function::Asin, x),
            "acos" => graph.apply(Function::Acos, x),
            "atan" => graph.apply(Function::Atan, x),
            "sinh" => graph.apply(Function::Sinh, x),
            "cosh" => graph.apply(Function::Cosh, x),
            "tanh" => graph.apply(Function::Tanh, x),
            "exp" => graph.apply(Function::Exp, x),
            "sqrt" => graph.apply(Function::Sqrt, x),
            "abs" => branch::size(graph, x, width),
            "sign" => graph.apply(Function::Sign, x),
            "log10" => {
                let (logarithm, ten) =
                    (graph.apply(Function::Ln, x), graph.constant(std::f64::consts::LN_10));
                graph.divide(logarithm, ten)
            }
            _ => graph.apply(Function::Ln, x),
        },
        [a, b] if wanted == 2 => match name {
            "atan2" => graph.atan2(a, b),
            "min" => branch::smaller(graph, a, b, width),
            _ => branch::larger(graph, a, b, width),
        },
        [x, low, high] if wanted == 3 => {
            if let (Some(from), Some(to)) = (graph.known(low), graph.known(high))
                && from > to
            {
                return Err(wrong(
                    start,
                    format!("'{name}' is from {from} to {to}: the first limit must be the lower one"),
                ));
            }
            match name {
                "sat" => branch::saturated(graph, x, low, high, width),
                _ => branch::dead(graph, x, low, high, width),
            }
        }
        _ => {
            let (plural, found) = (if wanted == 1 { "" } else { "s" }, arguments.len());
            let message = format!("'{name}' takes {wanted} argument{plural}, here it has {found}");
            return Err(wrong(start, message));
        }
    };
    ascend(input, node)
}
