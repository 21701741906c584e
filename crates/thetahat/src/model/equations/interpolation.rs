//! Tables of an expression as nodes of a graph, of which some values may be unknown.
//!
//! With the basis functions H_i and G_i of Hermite, which have value 1 or slope 1 at the knot k_i and neither at the
//! others, a table of cubics with values v_i and slopes m_i is
//!
//! ```text
//! f(x) = sum_i v_i H_i(x) + m_i G_i(x)
//! ```
//!
//! and one of straight lines sum_i v_i H_i(x) with hats H_i. Whatever of v and m is known goes into one table of
//! numbers; the others are factors of a basis function each, which has up to four knots. As slopes are nodes like
//! others, derivatives by unknown values are exact, those through the slopes too.

use super::graph::{Graph, Node};
use super::table::Table;

/// How a table goes from knot to knot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Shape {
    Lines,
    /// By cubics that rise and fall where the values do.
    Monotone,
}

/// The node of a table at x, through these values at knots that rise; there are as many of each, and at least two.
pub(super) fn interpolated(graph: &mut Graph, shape: Shape, x: Node, knots: &[f64], values: &[Node]) -> Node {
    let slopes = match shape {
        Shape::Lines => Vec::new(),
        Shape::Monotone => slopes(graph, knots, values),
    };
    let made = |values: &[f64], slopes: &[f64], knots: &[f64]| match shape {
        Shape::Lines => Table::lines(knots, values),
        Shape::Monotone => Table::cubics(knots, values, slopes),
    };
    let known = |graph: &Graph, nodes: &[Node]| -> Vec<f64> {
        nodes.iter().map(|node| graph.known(*node).unwrap_or(0.0)).collect()
    };
    let table = made(&known(graph, values), &known(graph, &slopes), knots);
    let mut sum = graph.table(table, x);
    for (nodes, is_slope) in [(values, false), (slopes.as_slice(), true)] {
        for (place, node) in nodes.iter().enumerate() {
            if graph.known(*node).is_some() {
                continue;
            }
            // With a piece of zeros after it, whose derivative is that at the next knot.
            let near = place.saturating_sub(1)..(place + 3).min(knots.len());
            let one: Vec<f64> = near.clone().map(|other| f64::from(u8::from(other == place))).collect();
            let none = vec![0.0; one.len()];
            let (values, slopes) = if is_slope { (&none, &one) } else { (&one, &none) };
            let basis = graph.table(made(values, slopes, &knots[near]), x);
            let part = graph.multiply(*node, basis);
            sum = graph.add(sum, part);
        }
    }
    sum
}

/// The slopes at the knots with which cubics are monotone wherever the values are (conditions: Fritsch and Carlson,
/// Monotone piecewise cubic interpolation, SIAM J. Numer. Anal. 17, 1980; these slopes: Fritsch and Butland, A method
/// for constructing local monotone piecewise cubic interpolants, SIAM J. Sci. Stat. Comput. 5, 1984), as PCHIP programs
/// take them. With the chords d_i over steps h_i, between two of them
///
/// ```text
/// m_i = (w + w') / (w/d_(i-1) + w'/d_i)     w = 2 h_i + h_(i-1), w' = h_i + 2 h_(i-1)      if d_(i-1) d_i > 0, else 0
/// ```
///
/// and at an end the slope of the parabola through three points, e = ((2 h_0 + h_1) d_0 - h_0 d_1)/(h_0 + h_1): 0 if
/// its sign is not that of d_0, and no steeper than 3 d_0 where d_0 and d_1 have different signs.
fn slopes(graph: &mut Graph, knots: &[f64], values: &[Node]) -> Vec<Node> {
    let h: Vec<f64> = knots.windows(2).map(|knots| knots[1] - knots[0]).collect();
    let d: Vec<Node> = values
        .windows(2)
        .zip(&h)
        .map(|(values, h)| {
            let (rise, h) = (graph.subtract(values[1], values[0]), graph.constant(*h));
            graph.divide(rise, h)
        })
        .collect();
    if let [only] = *d {
        return vec![only; 2];
    }
    let mut slopes = vec![at_end(graph, [h[0], h[1]], [d[0], d[1]])];
    for (h, d) in h.windows(2).zip(d.windows(2)) {
        slopes.push(between(graph, [h[0], h[1]], [d[0], d[1]]));
    }
    let last = h.len() - 1;
    slopes.push(at_end(graph, [h[last], h[last - 1]], [d[last], d[last - 1]]));
    slopes
}

fn between(graph: &mut Graph, h: [f64; 2], d: [Node; 2]) -> Node {
    let zero = graph.constant(0.0);
    let product = graph.multiply(d[0], d[1]);
    let weights = [2.0 * h[1] + h[0], h[1] + 2.0 * h[0]];
    let both = graph.constant(weights[0] + weights[1]);
    let [left, right] = weights.map(|weight| graph.constant(weight));
    let (left, right) = (graph.multiply(left, d[1]), graph.multiply(right, d[0]));
    let (numerator, denominator) = (graph.multiply(both, product), graph.add(left, right));
    let mean = graph.divide(numerator, denominator);
    graph.choose(product, zero, zero, mean)
}

fn at_end(graph: &mut Graph, h: [f64; 2], d: [Node; 2]) -> Node {
    let zero = graph.constant(0.0);
    let (own, other) =
        (graph.constant((2.0 * h[0] + h[1]) / (h[0] + h[1])), graph.constant(h[0] / (h[0] + h[1])));
    let (own, other) = (graph.multiply(own, d[0]), graph.multiply(other, d[1]));
    let slope = graph.subtract(own, other);
    let (three, square) = (graph.constant(3.0), graph.multiply(d[0], d[0]));
    let (steepest, limit) = (graph.multiply(three, d[0]), graph.multiply(three, square));
    let (along, turns) = (graph.multiply(slope, d[0]), graph.multiply(d[0], d[1]));
    let limited = graph.choose(along, limit, slope, steepest);
    let right = graph.choose(turns, zero, limited, slope);
    graph.choose(along, zero, zero, right)
}
