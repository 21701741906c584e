//! Expressions as one graph in which nothing is written twice, and their derivatives as further nodes of it.
//!
//! A node is an operation on earlier nodes. Before one is added, an equal one is searched for (hash-consing), so common
//! subexpressions are computed once, those of derivatives too. Nodes that a rule of algebra makes superfluous are not
//! added: x + 0, 1 x, 0 x, and constants of constants.

use std::collections::HashMap;
use std::sync::Arc;

use thetahat_core::Number;

use super::drive::Drive;
use super::table::Table;

/// A node, by its place in the [`Graph`].
pub(crate) type Node = usize;

/// A function of one argument.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Function {
    /// -x.
    Negative,
    Sqrt,
    Exp,
    Ln,
    Sin,
    Cos,
    Tan,
    Asin,
    Acos,
    Atan,
    Sinh,
    Cosh,
    Tanh,
    Abs,
    /// -1, 0 or 1.
    Sign,
}

/// What a node does. Floating-point numbers are kept as their bits, so that nodes can be compared and hashed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub(crate) enum Operation {
    Constant(u64),
    State(usize),
    /// An unknown parameter after its change of variable: z.
    Parameter(usize),
    Input(usize),
    /// t, seconds since the first row.
    Time,
    /// dt, the seconds of the step.
    Step,
    Apply(Function, Node),
    Add(Node, Node),
    Subtract(Node, Node),
    Multiply(Node, Node),
    Divide(Node, Node),
    /// x^n with an integer n.
    Integer(Node, i32),
    /// x^a with a constant a.
    Real(Node, u64),
    /// The angle of the point (second, first).
    Atan2(Node, Node),
    /// c if a <= b, else d; NaN if a or b is.
    Choose([Node; 4]),
    /// A table, by its place among those of the graph, or its derivative of this order.
    Table(usize, u8, Node),
    /// An input a delay ago, by its place, or how fast it rises with the delay: the derivative of order 1.
    Delayed(usize, u8, Node),
}

impl Operation {
    /// The nodes that it takes, some of them perhaps twice.
    pub(crate) fn arguments(self) -> [Option<Node>; 4] {
        match self {
            Self::Constant(_)
            | Self::State(_)
            | Self::Parameter(_)
            | Self::Input(_)
            | Self::Time
            | Self::Step => [None; 4],
            Self::Apply(_, x)
            | Self::Integer(x, _)
            | Self::Real(x, _)
            | Self::Table(_, _, x)
            | Self::Delayed(_, _, x) => [Some(x), None, None, None],
            Self::Add(a, b)
            | Self::Subtract(a, b)
            | Self::Multiply(a, b)
            | Self::Divide(a, b)
            | Self::Atan2(a, b) => [Some(a), Some(b), None, None],
            Self::Choose(nodes) => nodes.map(Some),
        }
    }

    /// Whether it is another number from row to row.
    pub(super) fn moves(self) -> bool {
        matches!(self, Self::State(_) | Self::Input(_) | Self::Delayed(..) | Self::Time)
    }

    /// The same with its arguments elsewhere.
    pub(super) fn moved(self, place: impl Fn(Node) -> Node) -> Self {
        match self {
            Self::Apply(function, x) => Self::Apply(function, place(x)),
            Self::Integer(x, n) => Self::Integer(place(x), n),
            Self::Real(x, a) => Self::Real(place(x), a),
            Self::Add(a, b) => Self::Add(place(a), place(b)),
            Self::Subtract(a, b) => Self::Subtract(place(a), place(b)),
            Self::Multiply(a, b) => Self::Multiply(place(a), place(b)),
            Self::Divide(a, b) => Self::Divide(place(a), place(b)),
            Self::Atan2(a, b) => Self::Atan2(place(a), place(b)),
            Self::Choose(nodes) => Self::Choose(nodes.map(place)),
            Self::Table(table, order, x) => Self::Table(table, order, place(x)),
            Self::Delayed(input, order, x) => Self::Delayed(input, order, place(x)),
            leaf => leaf,
        }
    }
}

/// What the leaves of a graph stand for, in one evaluation.
#[derive(Debug, Clone, Copy)]
pub(super) struct Leaves<'a, S> {
    pub(super) states: &'a [S],
    pub(super) parameters: &'a [S],
    pub(super) inputs: Drive<'a>,
    pub(super) time: f64,
    pub(super) step: f64,
    /// When the step began that the time is in, and its seconds: delayed inputs are means over it.
    pub(super) span: (f64, f64),
}

impl<'a, S> Leaves<'a, S> {
    /// Of what knows parameters alone.
    pub(super) fn of_parameters(parameters: &'a [S]) -> Self {
        let inputs = Drive::held(&[]);
        Self { states: &[], parameters, inputs, time: 0.0, step: 0.0, span: (0.0, 0.0) }
    }
}

/// The value of one operation, given those before it.
#[inline]
pub(super) fn value<S: Number<f64>>(
    operation: Operation,
    tables: &[Arc<Table>],
    leaves: &Leaves<'_, S>,
    values: &[S],
) -> S {
    let at = |node: Node| values[node];
    match operation {
        Operation::Constant(bits) => f64::from_bits(bits).into(),
        Operation::State(index) => leaves.states[index],
        Operation::Parameter(index) => leaves.parameters[index],
        Operation::Input(index) => leaves.inputs.value(index, leaves.time).into(),
        Operation::Time => leaves.time.into(),
        Operation::Step => leaves.step.into(),
        Operation::Apply(function, x) => applied(function, at(x)),
        Operation::Add(a, b) => at(a) + at(b),
        Operation::Subtract(a, b) => at(a) - at(b),
        Operation::Multiply(a, b) => at(a) * at(b),
        Operation::Divide(a, b) => at(a) / at(b),
        Operation::Integer(x, 2) => at(x) * at(x),
        Operation::Integer(x, n) => at(x).powi(n),
        Operation::Real(x, bits) => at(x).powf(f64::from_bits(bits)),
        Operation::Atan2(y, x) => at(y).atan2(at(x)),
        Operation::Choose([a, b, c, d]) => match at(a).partial_cmp(&at(b)) {
            None => f64::NAN.into(),
            Some(order) if order.is_le() => at(c),
            Some(_) => at(d),
        },
        Operation::Table(table, order, x) => tables[table].value(order, at(x)),
        Operation::Delayed(input, order, delay) => {
            let delay = at(delay);
            let (value, slope) = leaves.inputs.delayed(input, leaves.time, leaves.span, delay.value());
            if order == 0 { (delay - delay.value()) * slope + value } else { slope.into() }
        }
    }
}

fn applied<S: Number<f64>>(function: Function, x: S) -> S {
    match function {
        Function::Negative => -x,
        Function::Sqrt => x.sqrt(),
        Function::Exp => x.exp(),
        Function::Ln => x.ln(),
        Function::Sin => x.sin(),
        Function::Cos => x.cos(),
        Function::Tan => x.tan(),
        Function::Asin => x.asin(),
        Function::Acos => x.acos(),
        Function::Atan => x.atan(),
        Function::Sinh => x.sinh(),
        Function::Cosh => x.cosh(),
        Function::Tanh => x.tanh(),
        Function::Abs => x.abs(),
        Function::Sign => {
            let value = x.value();
            // Not `signum`, which is 1 at 0.
            if value == 0.0 { 0.0.into() } else { (value / value.abs()).into() }
        }
    }
}

/// Nodes in the order in which they can be computed.
#[derive(Debug)]
pub(super) struct Graph {
    operations: Vec<Operation>,
    known: HashMap<Operation, Node>,
    tables: Vec<Arc<Table>>,
}

impl Graph {
    /// The node 0, which every graph has.
    pub(super) const ZERO: Node = 0;

    pub(super) fn new() -> Self {
        let mut graph = Self { operations: Vec::new(), known: HashMap::new(), tables: Vec::new() };
        graph.constant(0.0);
        graph
    }

    pub(super) fn operations(&self) -> &[Operation] {
        &self.operations
    }

    pub(super) fn operation(&self, node: Node) -> Operation {
        self.operations[node]
    }

    pub(super) fn tables(&self) -> &[Arc<Table>] {
        &self.tables
    }

    fn add_node(&mut self, operation: Operation) -> Node {
        if let Some(&node) = self.known.get(&operation) {
            return node;
        }
        self.operations.push(operation);
        self.known.insert(operation, self.operations.len() - 1);
        self.operations.len() - 1
    }

    /// A node without arguments.
    pub(super) fn leaf(&mut self, operation: Operation) -> Node {
        self.add_node(operation)
    }

    pub(super) fn constant(&mut self, value: f64) -> Node {
        // Both zeros are one node.
        self.add_node(Operation::Constant(if value == 0.0 { 0.0_f64 } else { value }.to_bits()))
    }

    /// The number that a node is, if it is a constant.
    pub(super) fn known(&self, node: Node) -> Option<f64> {
        match self.operations[node] {
            Operation::Constant(bits) => Some(f64::from_bits(bits)),
            _ => None,
        }
    }

    /// An operation that no rule makes superfluous, computed at once if all its arguments are constants.
    fn combined(&mut self, operation: Operation) -> Node {
        let arguments = operation.arguments();
        let numbers = arguments.map(|node| node.map_or(Some(0.0), |node| self.known(node)));
        let [Some(a), Some(b), Some(c), Some(d)] = numbers else {
            return self.add_node(operation);
        };
        let places = |node| arguments.iter().position(|argument| *argument == Some(node)).unwrap_or(0);
        let none = Leaves::of_parameters(&[]);
        let value = value::<f64>(operation.moved(places), &self.tables, &none, &[a, b, c, d]);
        self.constant(value)
    }

    pub(super) fn add(&mut self, a: Node, b: Node) -> Node {
        match (self.known(a), self.known(b)) {
            (Some(0.0), _) => b,
            (_, Some(0.0)) => a,
            _ => self.combined(Operation::Add(a.min(b), a.max(b))),
        }
    }

    pub(super) fn subtract(&mut self, a: Node, b: Node) -> Node {
        match (self.known(a), self.known(b)) {
            (_, Some(0.0)) => a,
            (Some(0.0), _) => self.apply(Function::Negative, b),
            _ if a == b => Self::ZERO,
            _ => self.combined(Operation::Subtract(a, b)),
        }
    }

    pub(super) fn multiply(&mut self, a: Node, b: Node) -> Node {
        match (self.known(a), self.known(b)) {
            (Some(0.0), _) | (_, Some(0.0)) => Self::ZERO,
            (Some(1.0), _) => b,
            (_, Some(1.0)) => a,
            (Some(-1.0), _) => self.apply(Function::Negative, b),
            (_, Some(-1.0)) => self.apply(Function::Negative, a),
            _ if a == b => self.power(a, 2),
            _ => self.combined(Operation::Multiply(a.min(b), a.max(b))),
        }
    }

    pub(super) fn divide(&mut self, a: Node, b: Node) -> Node {
        match (self.known(a), self.known(b)) {
            (_, Some(1.0)) => a,
            (Some(0.0), None) => Self::ZERO,
            _ => self.combined(Operation::Divide(a, b)),
        }
    }

    /// x^n.
    fn power(&mut self, x: Node, n: i32) -> Node {
        match n {
            0 => self.constant(1.0),
            1 => x,
            _ => self.combined(Operation::Integer(x, n)),
        }
    }

    /// x^y: by multiplication if y is an integer, and as exp(y ln x) if it is not constant.
    pub(super) fn raise(&mut self, x: Node, y: Node) -> Node {
        match self.known(y) {
            Some(exponent) if exponent.fract() == 0.0 && exponent.abs() <= f64::from(i32::MAX) => {
                self.power(x, exponent as i32)
            }
            Some(0.5) => self.apply(Function::Sqrt, x),
            Some(exponent) => self.combined(Operation::Real(x, exponent.to_bits())),
            None => {
                let logarithm = self.apply(Function::Ln, x);
                let product = self.multiply(y, logarithm);
                self.apply(Function::Exp, product)
            }
        }
    }

    pub(super) fn apply(&mut self, function: Function, x: Node) -> Node {
        match (function, self.operations[x]) {
            (Function::Negative, Operation::Apply(Function::Negative, inner)) => inner,
            _ => self.combined(Operation::Apply(function, x)),
        }
    }

    pub(super) fn atan2(&mut self, y: Node, x: Node) -> Node {
        self.combined(Operation::Atan2(y, x))
    }

    /// c if a <= b, else d.
    pub(super) fn choose(&mut self, a: Node, b: Node, c: Node, d: Node) -> Node {
        match (self.known(a), self.known(b)) {
            _ if c == d => c,
            (Some(a), Some(b)) if a <= b => c,
            (Some(a), Some(b)) if a > b => d,
            _ => self.combined(Operation::Choose([a, b, c, d])),
        }
    }

    /// A table at x.
    pub(super) fn table(&mut self, table: Table, x: Node) -> Node {
        if let Some(value) = table.constant() {
            return self.constant(value);
        }
        let place = self.tables.iter().position(|own| **own == table).unwrap_or_else(|| {
            self.tables.push(Arc::new(table));
            self.tables.len() - 1
        });
        self.combined(Operation::Table(place, 0, x))
    }

    /// An input a delay ago.
    pub(super) fn delayed(&mut self, input: usize, delay: Node) -> Node {
        match self.known(delay) {
            Some(0.0) => self.leaf(Operation::Input(input)),
            _ => self.add_node(Operation::Delayed(input, 0, delay)),
        }
    }

    /// How long ago a time is that is written as t - delay; none if it is something else.
    pub(super) fn delay_of(&mut self, time: Node) -> Option<Node> {
        let of_time = |operation| operation == Operation::Time;
        match self.operations[time] {
            Operation::Time => Some(Self::ZERO),
            Operation::Subtract(from, less) if !self.depends(&[less], of_time) => {
                let delay = self.delay_of(from)?;
                Some(self.add(delay, less))
            }
            Operation::Add(one, other) => {
                let (from, more) = if self.depends(&[one], of_time) { (one, other) } else { (other, one) };
                let delay = self.delay_of(from).filter(|_| !self.depends(&[more], of_time))?;
                Some(self.subtract(delay, more))
            }
            _ => None,
        }
    }

    /// All inputs, now and a delay ago.
    pub(super) fn drives(&self) -> Vec<Operation> {
        let is_drive =
            |operation: &&Operation| matches!(operation, Operation::Input(_) | Operation::Delayed(_, 0, _));
        self.operations.iter().filter(is_drive).copied().collect()
    }

    /// Whether these are made of any node of this kind.
    pub(super) fn depends(&self, roots: &[Node], on: impl Fn(Operation) -> bool) -> bool {
        let alive = self.alive(roots);
        self.operations.iter().zip(&alive).any(|(operation, alive)| *alive && on(*operation))
    }

    /// Whether these are made of a branch or a sign that any node of this kind decides: of a jump derivatives say
    /// nothing.
    pub(super) fn jumps(&self, roots: &[Node], on: impl Fn(Operation) -> bool) -> bool {
        let alive = self.alive(roots);
        let decided = self.operations.iter().zip(&alive).filter(|(_, alive)| **alive);
        let deciding = decided.filter_map(|(operation, _)| match operation {
            Operation::Choose([a, b, ..]) => Some([*a, *b]),
            Operation::Apply(Function::Sign, x) => Some([*x; 2]),
            _ => None,
        });
        self.depends(&deciding.flatten().collect::<Vec<_>>(), on)
    }

    /// The nodes that these are made of.
    pub(super) fn alive(&self, roots: &[Node]) -> Vec<bool> {
        let mut alive = vec![false; self.operations.len()];
        roots.iter().for_each(|&root| alive[root] = true);
        for node in (0..alive.len()).rev() {
            if alive[node] {
                for argument in self.operations[node].arguments().into_iter().flatten() {
                    alive[argument] = true;
                }
            }
        }
        alive
    }

    /// The derivatives of some nodes with respect to a leaf, by the rules of calculus, node after node.
    pub(super) fn derivatives(&mut self, roots: &[Node], variable: Operation) -> Vec<Node> {
        let alive = self.alive(roots);
        let mut slopes = vec![Self::ZERO; alive.len()];
        for node in 0..alive.len() {
            let operation = self.operations[node];
            if !alive[node] {
                continue;
            }
            slopes[node] = if operation == variable {
                self.constant(1.0)
            } else if operation.arguments().iter().flatten().all(|&argument| slopes[argument] == Self::ZERO) {
                Self::ZERO
            } else {
                self.slope(node, operation, &slopes)
            };
        }
        roots.iter().map(|&root| slopes[root]).collect()
    }

    /// The derivative of a node, given those of its arguments.
    fn slope(&mut self, node: Node, operation: Operation, slopes: &[Node]) -> Node {
        match operation {
            Operation::Constant(_)
            | Operation::State(_)
            | Operation::Parameter(_)
            | Operation::Input(_)
            | Operation::Time
            | Operation::Step => Self::ZERO,
            Operation::Apply(function, x) => {
                let outer = self.slope_of(function, x, node);
                self.multiply(outer, slopes[x])
            }
            Operation::Add(a, b) => self.add(slopes[a], slopes[b]),
            Operation::Subtract(a, b) => self.subtract(slopes[a], slopes[b]),
            Operation::Multiply(a, b) => {
                let (first, second) = (self.multiply(slopes[a], b), self.multiply(a, slopes[b]));
                self.add(first, second)
            }
            Operation::Divide(a, b) => {
                // (a' - (a/b) b') / b
                let product = self.multiply(node, slopes[b]);
                let difference = self.subtract(slopes[a], product);
                self.divide(difference, b)
            }
            Operation::Integer(x, n) => {
                let (factor, power) = (self.constant(f64::from(n)), self.power(x, n.saturating_sub(1)));
                let outer = self.multiply(factor, power);
                self.multiply(outer, slopes[x])
            }
            Operation::Real(x, bits) => {
                let exponent = f64::from_bits(bits);
                let (factor, less) = (self.constant(exponent), self.constant(exponent - 1.0));
                let power = self.raise(x, less);
                let outer = self.multiply(factor, power);
                self.multiply(outer, slopes[x])
            }
            Operation::Atan2(y, x) => {
                // (x y' - y x') / (x² + y²)
                let (first, second) = (self.multiply(x, slopes[y]), self.multiply(y, slopes[x]));
                let numerator = self.subtract(first, second);
                let (first, second) = (self.power(x, 2), self.power(y, 2));
                let denominator = self.add(first, second);
                self.divide(numerator, denominator)
            }
            Operation::Choose([a, b, c, d]) => self.choose(a, b, slopes[c], slopes[d]),
            Operation::Table(table, order, x) => {
                if self.tables[table].ends_before(order + 1) {
                    return Self::ZERO;
                }
                let outer = self.combined(Operation::Table(table, order + 1, x));
                self.multiply(outer, slopes[x])
            }
            // Of an input that is held or goes in lines nothing more is known.
            Operation::Delayed(_, 1.., _) => Self::ZERO,
            Operation::Delayed(input, 0, delay) => {
                let outer = self.add_node(Operation::Delayed(input, 1, delay));
                self.multiply(outer, slopes[delay])
            }
        }
    }

    /// The derivative of a function at x, where it is `node`.
    fn slope_of(&mut self, function: Function, x: Node, node: Node) -> Node {
        let one = self.constant(1.0);
        match function {
            Function::Negative => self.constant(-1.0),
            Function::Sqrt => {
                let twice = self.add(node, node);
                self.divide(one, twice)
            }
            Function::Exp => node,
            Function::Ln => self.divide(one, x),
            Function::Sin => self.apply(Function::Cos, x),
            Function::Cos => {
                let sine = self.apply(Function::Sin, x);
                self.apply(Function::Negative, sine)
            }
            Function::Tan => {
                let square = self.power(node, 2);
                self.add(one, square)
            }
            Function::Asin | Function::Acos => {
                // 1/√((1 - x)(1 + x))
                let (less, more) = (self.subtract(one, x), self.add(one, x));
                let product = self.multiply(less, more);
                let root = self.apply(Function::Sqrt, product);
                let slope = self.divide(one, root);
                if function == Function::Asin { slope } else { self.apply(Function::Negative, slope) }
            }
            Function::Atan => {
                let square = self.power(x, 2);
                let sum = self.add(one, square);
                self.divide(one, sum)
            }
            Function::Sinh => self.apply(Function::Cosh, x),
            Function::Cosh => self.apply(Function::Sinh, x),
            Function::Tanh => {
                // 1/cosh² x: where tanh x rounds to 1, 1 - tanh² x is 0 and tells nothing.
                let cosine = self.apply(Function::Cosh, x);
                let square = self.power(cosine, 2);
                self.divide(one, square)
            }
            Function::Abs => self.apply(Function::Sign, x),
            Function::Sign => Self::ZERO,
        }
    }
}
