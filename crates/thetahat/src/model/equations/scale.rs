//! Changes of variable that keep a parameter within its bounds.

use super::graph::{Function, Graph, Node};

/// How a parameter p is made of a number z that may be anything.
///
/// ```text
/// no bounds     p = z                                     dp/dz = 1
/// min           p = min + exp(z)                          dp/dz = p - min
/// max           p = max - exp(z)                          dp/dz = p - max
/// min, max      p = min + (max - min) / (1 + exp(-z))     dp/dz = (p - min)(max - p)/(max - min)
/// ```
///
/// The last one is computed as (min + max)/2 + (max - min)/2 tanh(z/2), which is the same and never overflows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Scale {
    Free,
    Above(f64),
    Below(f64),
    Between(f64, f64),
}

impl Scale {
    pub(crate) fn new(min: Option<f64>, max: Option<f64>) -> Self {
        match (min, max) {
            (None, None) => Self::Free,
            (Some(min), None) => Self::Above(min),
            (None, Some(max)) => Self::Below(max),
            (Some(min), Some(max)) => Self::Between(min, max),
        }
    }

    /// Whether a value lies strictly inside the bounds.
    pub(crate) fn contains(self, p: f64) -> bool {
        p.is_finite()
            && match self {
                Self::Free => true,
                Self::Above(min) => p > min,
                Self::Below(max) => p < max,
                Self::Between(min, max) => p > min && p < max,
            }
    }

    /// p(z).
    pub(crate) fn value(self, z: f64) -> f64 {
        match self {
            Self::Free => z,
            Self::Above(min) => min + z.exp(),
            Self::Below(max) => max - z.exp(),
            Self::Between(min, max) => 0.5 * (min + max) + 0.5 * (max - min) * (0.5 * z).tanh(),
        }
    }

    /// dp/dz at z.
    pub(crate) fn slope(self, z: f64) -> f64 {
        match self {
            Self::Free => 1.0,
            Self::Above(_) => z.exp(),
            Self::Below(_) => -z.exp(),
            Self::Between(min, max) => {
                // Exact where p rounds to its bound, too.
                let small = (-z.abs()).exp();
                (max - min) * small / ((1.0 + small) * (1.0 + small))
            }
        }
    }

    /// z of a p that lies inside the bounds.
    pub(crate) fn variable(self, p: f64) -> f64 {
        match self {
            Self::Free => p,
            Self::Above(min) => (p - min).ln(),
            Self::Below(max) => (max - p).ln(),
            Self::Between(min, max) => ((p - min) / (max - p)).ln(),
        }
    }

    /// p(z) as a node of a graph, so that derivatives are by z.
    pub(super) fn node(self, graph: &mut Graph, z: Node) -> Node {
        match self {
            Self::Free => z,
            Self::Above(min) => {
                let (power, min) = (graph.apply(Function::Exp, z), graph.constant(min));
                graph.add(min, power)
            }
            Self::Below(max) => {
                let (power, max) = (graph.apply(Function::Exp, z), graph.constant(max));
                graph.subtract(max, power)
            }
            Self::Between(min, max) => {
                let (half, middle) = (graph.constant(0.5), graph.constant(0.5 * (min + max)));
                let width = graph.constant(0.5 * (max - min));
                let halved = graph.multiply(half, z);
                let tangent = graph.apply(Function::Tanh, halved);
                let away = graph.multiply(width, tangent);
                graph.add(middle, away)
            }
        }
    }

    /// The change of variable in words, such as `mass = 0.1 + exp(z)`; none without bounds.
    pub(crate) fn words(self, name: &str) -> Option<String> {
        match self {
            Self::Free => None,
            Self::Above(0.0) => Some(format!("{name} = exp(z)")),
            Self::Above(min) => Some(format!("{name} = {min} + exp(z)")),
            Self::Below(max) => Some(format!("{name} = {max} - exp(z)")),
            Self::Between(min, max) => {
                let width = max - min;
                Some(format!("{name} = {min} + {width} / (1 + exp(-z))"))
            }
        }
    }
}
