//! Conditions, branches, limits and dead zones as nodes of a graph, hard or smooth over a width.

use super::graph::{Function, Graph, Node};

/// A comparison a > b.
#[derive(Debug, Clone, Copy)]
pub(super) struct Above {
    pub(super) a: Node,
    pub(super) b: Node,
    /// Whether a = b counts.
    pub(super) or_equal: bool,
}

/// What a branch asks.
#[derive(Debug, Clone)]
pub(super) enum Condition {
    Above(Above),
    Not(Box<Condition>),
    /// All of them hold.
    Both(Vec<Condition>),
    /// One of them holds, or more.
    Either(Vec<Condition>),
}

/// c where the condition holds, else d: a branch for each comparison,
///
/// ```text
/// if not A then c else d       = if A then d else c
/// if A and B then c else d     = if A then (if B then c else d) else d
/// if A or B then c else d      = if A then c else (if B then c else d)
/// ```
pub(super) fn chosen(graph: &mut Graph, condition: &Condition, c: Node, d: Node) -> Node {
    match condition {
        Condition::Above(above) => branched(graph, *above, None, c, d),
        Condition::Not(condition) => chosen(graph, condition, d, c),
        Condition::Both(all) => all.iter().rev().fold(c, |rest, one| chosen(graph, one, rest, d)),
        Condition::Either(all) => all.iter().rev().fold(d, |rest, one| chosen(graph, one, c, rest)),
    }
}

/// c where the comparison holds, else d; with a width w a blend of both,
///
/// ```text
/// (c + d)/2 + (c - d)/2 tanh((a - b)/w)
/// ```
///
/// whose weight of c is 1/(1 + exp(-2 (a - b)/w)): 1/2 where a = b, 88 % where a = b + w.
pub(super) fn branched(
    graph: &mut Graph,
    Above { a, b, or_equal }: Above,
    width: Option<Node>,
    c: Node,
    d: Node,
) -> Node {
    let Some(width) = width else {
        return if or_equal { graph.choose(b, a, c, d) } else { graph.choose(a, b, d, c) };
    };
    let half = graph.constant(0.5);
    let distance = graph.subtract(a, b);
    let ratio = graph.divide(distance, width);
    let weight = graph.apply(Function::Tanh, ratio);
    let (sum, difference) = (graph.add(c, d), graph.subtract(c, d));
    let (middle, away) = (graph.multiply(half, sum), graph.multiply(half, difference));
    let away = graph.multiply(away, weight);
    graph.add(middle, away)
}

/// max(x, 0); with a width w its smooth form (x + √(x² + w²))/2, which is w/2 where x = 0.
fn positive(graph: &mut Graph, x: Node, width: Option<Node>) -> Node {
    let Some(_) = width else {
        let zero = graph.constant(0.0);
        return graph.choose(x, zero, zero, x);
    };
    let size = size(graph, x, width);
    let (half, sum) = (graph.constant(0.5), graph.add(x, size));
    graph.multiply(half, sum)
}

/// |x|; with a width w its smooth form √(x² + w²).
pub(super) fn size(graph: &mut Graph, x: Node, width: Option<Node>) -> Node {
    let Some(width) = width else { return graph.apply(Function::Abs, x) };
    let (square, other) = (graph.multiply(x, x), graph.multiply(width, width));
    let sum = graph.add(square, other);
    graph.apply(Function::Sqrt, sum)
}

/// The larger of two; with a width b + max(a - b, 0) in its smooth form.
pub(super) fn larger(graph: &mut Graph, a: Node, b: Node, width: Option<Node>) -> Node {
    if width.is_none() {
        return graph.choose(a, b, b, a);
    }
    let distance = graph.subtract(a, b);
    let above = positive(graph, distance, width);
    graph.add(b, above)
}

/// The smaller of two; with a width a - max(a - b, 0) in its smooth form.
pub(super) fn smaller(graph: &mut Graph, a: Node, b: Node, width: Option<Node>) -> Node {
    if width.is_none() {
        return graph.choose(a, b, a, b);
    }
    let distance = graph.subtract(a, b);
    let above = positive(graph, distance, width);
    graph.subtract(a, above)
}

/// x between `low` and `high`; with a width low + max(x - low, 0) - max(x - high, 0) in their smooth form.
pub(super) fn saturated(graph: &mut Graph, x: Node, low: Node, high: Node, width: Option<Node>) -> Node {
    if width.is_none() {
        let below = graph.choose(x, high, x, high);
        return graph.choose(x, low, low, below);
    }
    let (over, past) = (graph.subtract(x, low), graph.subtract(x, high));
    let (over, past) = (positive(graph, over, width), positive(graph, past, width));
    let sum = graph.add(low, over);
    graph.subtract(sum, past)
}

/// 0 from `low` to `high`, x - low below and x - high above: x less what a saturation lets through.
pub(super) fn dead(graph: &mut Graph, x: Node, low: Node, high: Node, width: Option<Node>) -> Node {
    if width.is_some() {
        let through = saturated(graph, x, low, high, width);
        return graph.subtract(x, through);
    }
    let zero = graph.constant(0.0);
    let (below, above) = (graph.subtract(x, low), graph.subtract(x, high));
    let upper = graph.choose(x, high, zero, above);
    graph.choose(x, low, below, upper)
}
