use thetahat_core::{Dual, Number};

use super::expressions::Three;
use super::{CART, PENDULUM};
use crate::model::equations::{Drive, Work};
use crate::model::{
    GreyBox,
    equations::{
        expression::read,
        graph::{Graph, Leaves, Operation},
        program::Program,
    },
};

/// The value of an expression and its derivatives by x, y and a.
pub(super) fn evaluated(text: &str, at: [f64; 3]) -> (f64, [f64; 3], [f64; 3]) {
    let mut graph = Graph::new();
    let names = Three::new(&mut graph);
    let node = read(text, &mut graph, &names).unwrap();
    let mut roots = vec![node];
    for variable in [Operation::State(0), Operation::State(1), Operation::Parameter(0)] {
        roots.extend(graph.derivatives(&[node], variable));
    }
    let program = Program::new(&graph, &roots);
    let leaves = Leaves { states: &at[..2], ..Leaves::of_parameters(&at[2..]) };
    let mut work = vec![0.0; program.size()];
    let found: Vec<f64> = program.run(&leaves, &mut work).collect();

    let variables = Dual::variables(at);
    let leaves = Leaves { states: &variables[..2], ..Leaves::of_parameters(&variables[2..]) };
    let mut work = vec![Dual::from(0.0); program.size()];
    let dual = program.run(&leaves, &mut work).next().unwrap();
    (found[0], [found[1], found[2], found[3]], dual.derivatives)
}

#[test]
fn derivatives_of_all_functions_are_exact() {
    let texts = [
        "x + 2*y - a",
        "x * y * a * x",
        "(x - y) / (a + x * y)",
        "x^3 + y^-2 + a^0.3",
        "x^y",
        "(x*y)^a",
        "sqrt(x + y*y)",
        "exp(-x * y) + exp(a)",
        "ln(x + y) + log10(a)",
        "sin(x*y) * cos(a*x) + tan(a)",
        "asin(a * 0.5) + acos(a*a) + atan(x - y)",
        "atan2(x - y, a * y)",
        "sinh(x) * cosh(y) - tanh(a * x)",
        "abs(x - y) * abs(y)",
        "sign(y - x) * x",
        "min(x * a, y) + max(x * a, y * x)",
        "min(y, x * a) * max(sin(x), cos(y))",
        "-(-x)^3 - -y",
    ];
    for text in texts {
        let at = [0.7, 1.3, 0.4];
        let (_, symbolic, dual) = evaluated(text, at);
        for variable in 0..3 {
            // Two exact ways that round differently.
            let scale = 1.0 + dual[variable].abs();
            assert!(
                (symbolic[variable] - dual[variable]).abs() < 1e-13 * scale,
                "{text}: {symbolic:?} {dual:?}"
            );
            let h = 1e-6;
            let moved = |by: f64| {
                let mut at = at;
                at[variable] += by;
                evaluated(text, at).0
            };
            let difference = (moved(h) - moved(-h)) / (2.0 * h);
            // A central difference is good to h² and to eps/h.
            assert!((symbolic[variable] - difference).abs() < 1e-8 * scale, "{text}: {difference}");
        }
    }
}

/// Values and Jacobian of a step and of what is seen after it, by states and parameters.
fn step<S: Number<f64>>(model: &GreyBox, x: &[S], z: &[S], t: f64, dt: f64) -> [Vec<S>; 4] {
    let (n, p, m) = (model.states().len(), z.len(), model.outputs().len());
    let zeros = |size| vec![S::from(0.0); size];
    let (mut next, mut by) = (zeros(n), zeros(n * (n + p)));
    let (mut y, mut seen_by) = (zeros(m), zeros(m * (n + p)));
    let mut work = Work::new();
    model.advance(x, z, Drive::held(&[0.3]), t, dt, &mut next, &mut by, &mut work);
    model.observe(x, z, Drive::held(&[0.3]), t, &mut y, &mut seen_by, &mut work);
    [next, by, y, seen_by]
}

#[test]
fn jacobians_of_a_step_are_those_of_dual_numbers() {
    let substeps = format!("substeps = 3\n{PENDULUM}");
    for text in [CART, PENDULUM, &substeps] {
        let model = GreyBox::from_toml(text).unwrap();
        let n = model.states().len();
        let z: Vec<f64> = model.parameters().iter().map(|parameter| parameter.start_variable().0).collect();
        let x = [0.9, 0.7];
        let [next, by, y, seen_by] = step(&model, &x, &z, 1.7, 0.2);
        // Two states and up to four parameters.
        let mut all = [x[0], x[1], 0.0, 0.0, 0.0, 0.0];
        all[2..2 + z.len()].copy_from_slice(&z);
        let variables = Dual::variables(all);
        let [dual_next, dual_by, dual_y, _] =
            step(&model, &variables[..2], &variables[2..2 + z.len()], 1.7, 0.2);
        let compare = |values: &[f64], jacobian: &[f64], dual: &[Dual<f64, 6>]| {
            let rows = values.len();
            for (row, dual) in dual.iter().enumerate() {
                assert_eq!(values[row], dual.value);
                for column in 0..n + z.len() {
                    let (found, expected) = (jacobian[row + column * rows], dual.derivatives[column]);
                    assert!((found - expected).abs() < 1e-14, "{row}, {column}: {found} {expected}");
                }
            }
        };
        compare(&next, &by, &dual_next);
        compare(&y, &seen_by, &dual_y);
        // With room for the states only, these columns are the same; and duals carry second derivatives.
        let (mut short, mut short_next) = (vec![0.0; n * n], vec![0.0; n]);
        model.advance(&x, &z, Drive::held(&[0.3]), 1.7, 0.2, &mut short_next, &mut short, &mut Work::new());
        assert_eq!((short.as_slice(), &short_next), (&by[..n * n], &next));
        let h = 1e-5;
        let slope = |place: usize| {
            let at = |by: f64| step(&model, &[x[0] + by, x[1]], &z, 1.7, 0.2)[1][place];
            (at(h) - at(-h)) / (2.0 * h)
        };
        for (place, dual) in dual_by.iter().enumerate() {
            // A central difference of first derivatives near 1.
            assert!((dual.derivatives[0] - slope(place)).abs() < 1e-7);
        }
    }
}

#[test]
fn steps_of_a_differential_equation_are_of_order_four() {
    let text = "sample_time = 1\nsubsteps = COUNT\n[states]\nx = { start = 1, sd = 1 }\ny = { start = 0, sd = 1 }\n\
                [derivative]\nx = 'y'\ny = '-x * (1 + 0.5 * t) - y * t'\n\
                [outputs]\nout = 'x'\n[noise]\nmeasurement = { out = 1 }";
    let end = |count: usize| {
        let model = GreyBox::from_toml(&text.replace("COUNT", &count.to_string())).unwrap();
        let (mut next, mut by) = ([0.0; 2], [0.0; 4]);
        model.advance(&[1.0, 0.0], &[], Drive::held(&[]), 0.5, 1.0, &mut next, &mut by, &mut Work::new());
        (next, by)
    };
    let (exact, exact_by) = end(800);
    let error = |count| {
        let (next, by) = end(count);
        let off = |found: &[f64], exact: &[f64]| {
            found.iter().zip(exact).map(|(found, exact)| (found - exact).abs()).fold(0.0, f64::max)
        };
        (off(&next, &exact), off(&by, &exact_by))
    };
    let (coarse, fine) = (error(10), error(20));
    // 16, up to the next order.
    for ratio in [coarse.0 / fine.0, coarse.1 / fine.1] {
        assert!((14.0..18.0).contains(&ratio), "{ratio}");
    }
    assert!(fine.0 < 1e-6);
}

#[test]
fn a_step_allocates_nothing() {
    for text in [CART, PENDULUM] {
        let model = GreyBox::from_toml(text).unwrap();
        let z: Vec<f64> = model.parameters().iter().map(|parameter| parameter.start_variable().0).collect();
        let (mut next, mut by, mut work) = ([0.0; 2], vec![0.0; 4 + 2 * z.len()], Work::new());
        let mut advance =
            || model.advance(&[0.1, 0.2], &z, Drive::held(&[1.0]), 0.0, 0.1, &mut next, &mut by, &mut work);
        advance();
        assert_eq!(allocation_counter::measure(advance).count_total, 0);
    }
}
