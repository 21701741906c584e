use crate::model::equations::expression::{Fault, Names, read};
use crate::model::equations::graph::{Graph, Leaves, Node, Operation};
use crate::model::equations::program::Program;

/// x and y are states, a is an unknown parameter.
pub(super) struct Three(pub(super) [Node; 3]);

impl Three {
    pub(super) fn new(graph: &mut Graph) -> Self {
        Self([Operation::State(0), Operation::State(1), Operation::Parameter(0)].map(|leaf| graph.leaf(leaf)))
    }
}

impl Names for Three {
    fn node(&self, name: &str) -> Result<Option<Node>, String> {
        Ok(["x", "y", "a"].iter().position(|known| *known == name).map(|place| self.0[place]))
    }

    fn all(&self) -> Vec<&str> {
        vec!["x", "y", "a"]
    }
}

/// The value of an expression at x = 2, y = 3, a = 0.5.
pub(super) fn value(text: &str) -> Result<f64, Fault> {
    let mut graph = Graph::new();
    let names = Three::new(&mut graph);
    let node = read(text, &mut graph, &names)?;
    let program = Program::new(&graph, &[node]);
    let leaves = Leaves { states: &[2.0, 3.0], ..Leaves::of_parameters(&[0.5]) };
    let mut work = vec![f64::NAN; program.size()];
    Ok(program.run(&leaves, &mut work).next().unwrap())
}

pub(super) fn fault(text: &str) -> (usize, String) {
    let fault = value(text).expect_err(text);
    (fault.offset, fault.message)
}

#[test]
fn operators_bind_as_in_mathematics() {
    let cases = [
        ("1 + 2 * 3", 7.0),
        ("(1 + 2) * 3", 9.0),
        ("7 - 2 - 1", 4.0),
        ("8 / 4 / 2", 1.0),
        ("8 / 4 * 2", 4.0),
        ("2^3^2", 512.0),
        ("-2^2", -4.0),
        ("(-2)^2", 4.0),
        ("2^-2", 0.25),
        ("2^-2 * 4", 1.0),
        ("2 * -3", -6.0),
        ("- - 3", 3.0),
        ("+x - -y", 5.0),
        ("-x * y", -6.0),
        ("-x + y", 1.0),
        ("x*y^2", 18.0),
        (" x\n + y\t", 5.0),
        ("1e3 + 1E-1 + .5 + 2.", 1002.6),
        ("x^a", 2.0_f64.sqrt()),
        ("x^0.5", 2.0_f64.sqrt()),
        ("x^y", 8.0),
        ("a^1.5", 0.5_f64.powf(1.5)),
        ("pi", std::f64::consts::PI),
        ("sin(x) + cos(y)", 2.0_f64.sin() + 3.0_f64.cos()),
        ("tan(a)", 0.5_f64.tan()),
        ("asin(a) - acos(a) + atan(a)", 0.5_f64.asin() - 0.5_f64.acos() + 0.5_f64.atan()),
        ("atan2(x, -y)", 2.0_f64.atan2(-3.0)),
        ("sinh(a) + cosh(a) + tanh(a)", 0.5_f64.sinh() + 0.5_f64.cosh() + 0.5_f64.tanh()),
        ("exp(ln(x))", 2.0),
        ("log10(1000 * x / x)", 3.0),
        ("sqrt(x * x)", 2.0),
        ("abs(-x) + sign(-y) + sign(x - x) + sign(x - 2)", 1.0),
        ("min(x, y) + 10 * max(x, y)", 32.0),
        ("min(y, x) + 10 * max(y, x)", 32.0),
        ("x - x", 0.0),
        ("0 / x", 0.0),
    ];
    for (text, expected) in cases {
        let found = value(text).unwrap();
        assert!((found - expected).abs() < 1e-13 * expected.abs().max(1.0), "{text}: {found}");
    }
}

#[test]
fn what_is_wrong_is_said_at_its_place() {
    let cases = [
        ("x + ", 4, "the expression ends where a number, a name or '(' must follow"),
        ("", 0, "the expression ends where"),
        ("x + * y", 4, "a number, a name or '(' must stand here, not '*'"),
        ("(x + y", 0, "this '(' is not closed"),
        ("sin(x", 3, "this '(' is not closed"),
        ("(x + y))", 7, "this ')' closes nothing"),
        ("(x y)", 3, "an operator or ')' is missing before 'y'"),
        ("x y", 2, "an operator (+ - * / ^) is missing before 'y'"),
        ("x (y)", 0, "there is no function 'x'"),
        ("2 x", 2, "is missing before 'x'"),
        ("2x", 0, "'2x' is neither a number nor a name"),
        ("1.2.3", 0, "'1.2.3' is neither"),
        ("1e999", 0, "'1e999' is no number that can be used"),
        ("x ** 2", 3, "a power is written with '^', not '**'"),
        ("x, y", 1, "this ',' stands outside"),
        ("x = y", 2, "an expression has no '='"),
        ("log(x)", 0, "'log' is ambiguous: write 'ln' for the natural logarithm, or 'log10'"),
        ("x + sine(y)", 4, "there is no function 'sine'; did you mean 'sin'?"),
        ("sin", 0, "'sin' is a function: its argument follows in parentheses"),
        ("1 + atan2(x)", 4, "'atan2' takes 2 arguments, here it has 1"),
        ("sin()", 0, "'sin' takes 1 argument, here it has 0"),
        ("max(x, y, a)", 0, "'max' takes 2 arguments, here it has 3"),
        ("x + z9", 4, "unknown name 'z9' (known here: x, y, a)"),
        ("xx", 0, "unknown name 'xx'; did you mean 'x'?"),
        ("x + 'y'", 4, "a text cannot stand in an expression"),
        ("x + µ", 4, "unknown name 'µ'"),
        ("x & y", 2, "is missing before '&'"),
        ("max(x, )", 7, "a number, a name or '(' must stand here, not ')'"),
    ];
    for (text, offset, expected) in cases {
        let (found, message) = fault(text);
        assert!(message.contains(expected), "{text}: {message}");
        assert_eq!(found, offset, "{text}: {message}");
    }
}

#[test]
fn nothing_that_is_nested_uses_up_the_stack() {
    let many = 100_000;
    for (open, close) in [("(", ")"), ("-", ""), ("+", ""), ("2^", ""), ("sin(", ")"), ("2^-(", ")")] {
        let deep = format!("{}x{}", open.repeat(many), close.repeat(many));
        assert!(fault(&deep).1.contains("nested more than 100 deep"), "{open}");
        let shallow = format!("{}x{}", open.repeat(30), close.repeat(30));
        assert!(value(&shallow).is_ok(), "{open}");
    }
    assert!(fault(&"(".repeat(many)).1.contains("nested"));
    // Side by side they are not nested.
    let long = "x^2 - (y + -1) + ".repeat(many);
    assert_eq!(value(&format!("{long}0")).unwrap(), many as f64 * 2.0);
}

#[test]
fn what_is_written_twice_is_computed_once() {
    let mut graph = Graph::new();
    let names = Three::new(&mut graph);
    let first = read("sin(x + y) * a", &mut graph, &names).unwrap();
    let size = graph.operations().len();
    assert_eq!(read("a * sin(y + x)", &mut graph, &names).unwrap(), first);
    assert_eq!(read("0 * exp(x) + 1 * (a * sin(y + x)) / 1 - 0", &mut graph, &names).unwrap(), first + 1 - 1);
    // Only the constant 1 and exp(x), which nothing needs, are new.
    assert_eq!(graph.operations().len(), size + 2);
    // Two sums, a sine, a product, and three leaves.
    assert_eq!(Program::new(&graph, &[first]).size(), 6);
    assert_eq!(read("2 * 3 + sqrt(16)", &mut graph, &names).map(|node| graph.known(node)), Ok(Some(10.0)));
}
