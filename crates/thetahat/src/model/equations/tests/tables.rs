//! Tables and branches: their values, their derivatives, and what is refused.

use super::CART;
use super::derivatives::evaluated;
use super::expressions::{fault, value};
use crate::model::GreyBox;
use crate::model::equations::{Drive, Work};

/// The value of an expression where x is this, y is 3 and a is 0.5, and its derivative by x.
fn at(text: &str, x: f64) -> (f64, f64) {
    let (value, [by_x, ..], _) = evaluated(text, [x, 3.0, 0.5]);
    (value, by_x)
}

fn near(found: f64, expected: f64) {
    assert!((found - expected).abs() < 1e-12 * (1.0 + expected.abs()), "{found} {expected}");
}

#[test]
fn lines_go_through_their_values_and_are_held_beyond_the_ends() {
    let text = "lines(x; -1:2, 0:3, 2:-1)";
    let cases = [
        (-2.0, 2.0, 0.0),
        (-1.0, 2.0, 1.0),
        (-0.5, 2.5, 1.0),
        (0.0, 3.0, -2.0),
        (0.5, 2.0, -2.0),
        (2.0, -1.0, -2.0),
        (3.0, -1.0, 0.0),
    ];
    for (x, y, slope) in cases {
        assert_eq!(at(text, x), (y, slope), "{x}");
    }
    assert!(at(text, f64::NAN).0.is_nan());
    assert_eq!(value("lines(2; 0:x - x, 3:6)").unwrap(), 4.0);
    // With a name that is known as a value, and blanks.
    assert_eq!(value(" 2 * lines( 1 ;0 : 1, 1/4:2 ,pi: 2 ) ").unwrap(), 4.0);
}

/// Values and slopes of scipy.interpolate.PchipInterpolator (SciPy 1.17.1).
#[test]
fn tables_are_those_of_other_programs() {
    let first = "table(x; 0:3.2, 0.1:3.5, 0.3:3.6, 0.5:3.65, 0.9:3.65, 1:4.1)";
    let second = "table(x; 0:0, 1:2, 3:1, 4:5)";
    let cases = [
        (first, 0.05, 3.386278735632184, 3.308908045977009),
        (first, 0.2, 3.564942528735632, 0.43390804597701216),
        (first, 0.45, 3.6453124999999997, 0.17708333333333254),
        (first, 0.7, 3.65, 0.0),
        (first, 0.95, 3.807499999999999, 5.399999999999994),
        (second, 0.0, 0.0, 2.8333333333333335),
        (second, 0.5, 1.3541666666666667, 2.2916666666666665),
        (second, 1.5, 1.84375, -0.5625),
        (second, 2.5, 1.15625, -0.5625),
        (second, 3.5, 2.3125, 4.625),
        (second, 4.0, 5.0, 5.5),
        (second, 4.1, 5.0, 0.0),
    ];
    for (text, x, y, slope) in cases {
        let found = at(text, x);
        near(found.0, y);
        near(found.1, slope);
    }
    // Two knots make a line.
    assert_eq!(at("table(x; 0:1, 2:5)", 0.5), (2.0, 2.0));
}

#[test]
fn tables_rise_where_their_values_do() {
    let mut random = thetahat_numerics::noise::Noise(5);
    for _ in 0..50 {
        let mut uniform = || random.uniform().abs();
        let (mut knot, mut height) = (0.0, 0.0);
        let knots: Vec<String> = (0..8)
            .map(|_| {
                (knot, height) = (knot + 0.01 + uniform(), height + uniform().powi(4));
                format!("{knot}:{height}")
            })
            .collect();
        let text = format!("table(x; {})", knots.join(", "));
        for step in 0..400 {
            let slope = at(&text, knot * f64::from(step) / 400.0).1;
            // Zero up to what rounding leaves of a slope.
            assert!(slope > -1e-9, "{text} {step}: {slope}");
        }
    }
}

/// A table whose values are unknown is the same function as one of numbers, at any value and knot.
#[test]
fn unknown_values_make_no_other_table() {
    for name in ["table", "lines"] {
        for x in [-1.0, 0.0, 0.3, 1.0, 1.7, 2.0, 2.9, 3.0, 4.0] {
            // a is 0.5.
            let open = at(&format!("{name}(x; 0:2*a, 1:a^2, 2:a, 3:3)"), x);
            let known = at(&format!("{name}(x; 0:1, 1:0.25, 2:0.5, 3:3)"), x);
            near(open.0, known.0);
            near(open.1, known.1);
        }
    }
}

#[test]
fn derivatives_of_tables_and_branches_are_exact() {
    let texts = [
        "table(x; 0:3.2, 0.5:3.65, 1:4.1, 2:5)",
        "table(x * y; 0:1, 0.5:a, 1:a^2 + 1, 2:3 * a)",
        "lines(x + y; 0:a, 1.5:1, 2.5:2 * a, 4:exp(a))",
        "table(lines(x; 0:0, 1:a); 0:1, 0.2:2, 0.4:0)",
        "table(x; 0:a, 1:2, 2:1, 3:5 * a)^2 / a",
        "table(x; 0:3, 0.6:a, 0.8:2, 1:a, 2:a)",
        "if x > y then x^2 else y * a",
        "if x <= y then x^2 else y * a",
        "if x - y > a within 0.3 then x * y else a^2",
        "if x < y within a then sin(x) else 2 * y",
        "max(x, y within 0.1) - min(x * a, y within a)",
        "abs(x - y within 0.2)",
        "if x > y or not (x > a and y > a) then x^2 else y * a * x",
        "sat(x, -a, a) + sat(y, 0, 2) + sat(x, 1, 2)",
        "dead(x, -a, a) + dead(y, 0, 2) + dead(x, 1, 2)",
        "sat(x, -a, a within 0.1) * dead(y, a, 2 * a within 0.2)",
    ];
    for text in texts {
        let at = [0.7, 1.3, 0.4];
        let (_, symbolic, dual) = evaluated(text, at);
        for variable in 0..3 {
            let scale = 1.0 + dual[variable].abs();
            let (found, expected) = (symbolic[variable], dual[variable]);
            // Two exact ways that round differently.
            assert!((found - expected).abs() < 1e-12 * scale, "{text}: {symbolic:?} {dual:?}");
            let h = 1e-6;
            let moved = |by: f64| {
                let mut at = at;
                at[variable] += by;
                evaluated(text, at).0
            };
            let difference = (moved(h) - moved(-h)) / (2.0 * h);
            // A central difference is good to h² and to eps/h.
            assert!((found - difference).abs() < 1e-7 * scale, "{text}: {found} {difference}");
        }
    }
}

#[test]
fn branches_take_the_side_that_holds() {
    // x = 2, y = 3, a = 0.5.
    let cases = [
        ("if x > y then 1 else 2", 2.0),
        ("if x < y then 1 else 2", 1.0),
        ("if x >= 2 then 1 else 2", 1.0),
        ("if x > 2 then 1 else 2", 2.0),
        ("if x <= 2 then 1 else 2", 1.0),
        ("if x < 2 then 1 else 2", 2.0),
        ("if x < 1 then 1 else if x < 3 then 5 else 7", 5.0),
        ("if 1 > 2 then x else y + 1", 4.0),
        ("2 * (if x > 1 then y else 0) + 1", 7.0),
        ("1 + if x > 1 then y else 0 + 10", 4.0),
        ("if(x+1)*2>5 then 1 else 2", 1.0),
        ("if (x > 1) then 1 else 2", 1.0),
        ("if x > 1 and y > 5 then 1 else 2", 2.0),
        ("if x > 1 or y > 5 then 1 else 2", 1.0),
        ("if not x > 1 then 1 else 2", 2.0),
        ("if not not x > 1 then 1 else 2", 1.0),
        // 'and' binds closer than 'or', and 'not' closest.
        ("if x > 1 or y > 5 and y > 9 then 1 else 2", 1.0),
        ("if (x > 1 or y > 5) and y > 9 then 1 else 2", 2.0),
        ("if not x > 5 and y > 5 then 1 else 2", 2.0),
        ("if not (x > 5 and y > 5) then 1 else 2", 1.0),
        ("if 1 < x and x < y and y < 4 then 1 else 2", 1.0),
        ("if 1 < x and x < y and y < 3 then 1 else 2", 2.0),
        ("if x > 9 or y > 9 or a > 0 then 1 else 2", 1.0),
        ("if ((x + 1) * 2 > 5 and (y) > (2)) then 1 else 2", 1.0),
        ("if ((x) + 1) > 5 or (x - y) < 0 then 1 else 2", 1.0),
        ("if ((x > 1)) and ((x) > 1) then 1 else 2", 1.0),
        ("if x > 1 and y > 2 then if x > y or a > 1 then 1 else 7 else 2", 7.0),
        // Only the side that is taken counts.
        ("if x > 3 and y > 1 then sqrt(1 - x) else 4", 4.0),
        ("if x > 3 then sqrt(1 - x) else 4", 4.0),
        ("sat(x, -1, 1) + sat(-x, -1, 1)", 0.0),
        ("sat(a, -1, 1)", 0.5),
        ("dead(x, -1, 1.5) + dead(-x, -1.5, 1)", 0.0),
        ("dead(a, -1, 1)", 0.0),
        // Half way, and one width away: 1/(1 + exp(-2)).
        ("if x > 2 within 0.1 then 1 else 3", 2.0),
        ("if x > 1.9 within 0.1 then 1 else 0", 1.0 / (1.0 + (-2.0_f64).exp())),
        ("if x < 1.9 within 0.1 then 0 else 1", 1.0 / (1.0 + (-2.0_f64).exp())),
        ("abs(x - 2 within 0.1)", 0.1),
        ("max(x, 2 within 0.1)", 2.05),
        ("min(x, 2 within 0.1)", 1.95),
        // The square root of 0.3² + 0.4² is 0.5.
        ("max(x, 1.7 within 0.4)", 2.1),
    ];
    for (text, expected) in cases {
        let found = value(text).unwrap();
        assert!((found - expected).abs() < 1e-13, "{text}: {found}");
    }
}

#[test]
fn what_is_wrong_with_tables_and_branches_is_said_at_its_place() {
    let cases = [
        ("table(x, 0:1)", 7, "';' is missing after what the table is of: a table is written table(x; 0:3.2"),
        ("table(x; 0:1)", 0, "a table has at least two knots"),
        ("lines(x; 0:1, 0:2)", 14, "the knots of a table must rise, but 0 follows 0"),
        ("lines(x; 0:1, -1:2)", 14, "the knots of a table must rise, but -1 follows 0"),
        ("lines(x; 0 1:2)", 11, "':' and a value are missing after the knot 0"),
        ("lines(x; a:1, 1:2)", 9, "a knot must be a number"),
        ("lines(x; 1/0:1, 1:2)", 9, "a knot must be a number"),
        ("lines(x; 0:x, 1:2)", 11, "a value of a table is a number or made of parameters"),
        ("lines(x; 0:1/0, 1:2)", 11, "a value of a table must be finite"),
        ("lines(x; 0:1, 1:2", 5, "this '(' is not closed"),
        ("lines(x; 0:1, 1:)", 16, "must stand here, not ')'"),
        ("table", 0, "'table' is a function"),
        ("x; y", 1, "this stands outside of a table's knots"),
        ("x > y", 2, "a comparison stands only after 'if'"),
        ("(x > y) * 2", 3, "a comparison stands only after 'if'"),
        ("if (x) then 1 else 2", 5, "a comparison must stand here, one of < <= > >="),
        ("if (x > y then 1 else 2", 6, "a comparison stands only after 'if'"),
        ("if x > y and then 1 else 2", 13, "must stand here, not 'then'"),
        ("if x > y and a then 1 else 2", 15, "a comparison must stand here, one of < <= > >="),
        ("if and x > y then 1 else 2", 3, "must stand here, not 'and'"),
        ("if x > y or not then 1 else 2", 16, "must stand here, not 'then'"),
        ("x and y", 2, "an operator (+ - * / ^) is missing before 'and'"),
        ("if x > y and y > a within 0.1 then 1 else 2", 19, "'within' goes with a single comparison"),
        ("if not x > y within 0.1 then 1 else 2", 13, "'within' goes with a single comparison"),
        ("if x then 1 else 2", 5, "a comparison must stand here, one of < <= > >="),
        ("if x == y then 1 else 2", 5, "hardly ever equal"),
        ("if x > y 1", 9, "'then' is missing, here is '1'"),
        ("if 0 < x < y then 1 else 2", 9, "one comparison follows another: join them, as in a < b and b < c"),
        ("if x > y then 1", 15, "'else' is missing, the expression ends"),
        ("if x > then 1", 7, "must stand here, not 'then'"),
        ("if x > y within 0 then 1 else 2", 16, "a width must be above 0"),
        ("if x > y within x then 1 else 2", 16, "a width is a number or made of parameters"),
        ("sin(x within 1)", 6, "'sin' has no width"),
        ("sat(x, 2, 1)", 0, "'sat' is from 2 to 1"),
        ("dead(x)", 0, "'dead' takes 3 arguments, here it has 1"),
    ];
    for (text, offset, expected) in cases {
        let (found, message) = fault(text);
        assert!(message.contains(expected), "{text}: {message}");
        assert_eq!(found, offset, "{text}: {message}");
    }
    let text = CART.replacen("damping * velocity", "lines(velocity; 0:damping, 0:1)", 1);
    let error = GreyBox::from_toml(&text).unwrap_err().to_string();
    assert!(error.starts_with("line 16, column 65: the knots of a table must rise"), "{error}");
    let text = CART.replacen("damping = 0.4", "within = 0.4", 1);
    let error = GreyBox::from_toml(&text).unwrap_err().to_string();
    assert!(error.starts_with("line 12, column 1: 'within' has a meaning in expressions"), "{error}");
}

#[test]
fn branches_that_are_nested_do_not_use_up_the_stack() {
    for (open, close) in
        [("if x > 0 then ", " else 1"), ("if ", " > 0 then 1 else 2"), ("lines(", "; 0:0, 9:9)")]
    {
        let made = |many: usize| format!("{}x{}", open.repeat(many), close.repeat(many));
        assert!(fault(&made(10_000)).1.contains("nested more than 100 deep"), "{open}");
        assert!(value(&made(90)).is_ok(), "{open}");
    }
    assert!(fault(&"if x > 0 then 1 else ".repeat(10_000)).1.contains("nested more than 100 deep"));
    for nested in ["not ", "("] {
        let text = format!("if {}x > 0{} then 1 else 2", nested.repeat(10_000), ")".repeat(10_000));
        assert!(fault(&text).1.contains("nested more than 100 deep"), "{nested}");
    }
    let long = format!("if x > 0{} then 1 else 2", " and x > 1".repeat(10_000));
    assert_eq!(value(&long).unwrap(), 1.0);
}

#[test]
fn a_table_is_looked_up_without_allocating() {
    let knots: Vec<String> = (0..500).map(|knot| format!("{knot}:{}", f64::from(knot).sqrt())).collect();
    let text = CART.replacen("damping * velocity", &format!("table(velocity; {})", knots.join(", ")), 1);
    let model = GreyBox::from_toml(&text).unwrap();
    let (mut next, mut by, mut work) = ([0.0; 2], [0.0; 6], Work::new());
    let mut advance =
        || model.advance(&[0.1, 16.0], &[0.0], Drive::held(&[1.0]), 0.0, 0.1, &mut next, &mut by, &mut work);
    advance();
    assert_eq!(allocation_counter::measure(&mut advance).count_total, 0);
    // (1 - 4)/(0.1 + exp(0)) in a tenth of a second.
    near(next[1], 16.0 - 0.3 / 1.1);
}

#[test]
fn what_jumps_is_not_linear() {
    let of = |through: &str| {
        let force = format!("({through} - damping * velocity)");
        GreyBox::from_toml(&CART.replacen("(force - damping * velocity)", &force, 1)).unwrap()
    };
    assert!(of("force").superposes() && of("(if damping > 1 then 2 * force else force)").superposes());
    for through in [
        "(if force > 0 then 1 else -1)",
        "(if force > 0 then force + 1 else force)",
        "sign(force)",
        "(if t > 5 then 1 else 0)",
        "sat(force, -1, 1)",
        "lines(force; -1:-1, 1:1)",
        "(if position > 0 then 1 else -1)",
    ] {
        assert!(!of(through).superposes(), "{through}");
    }
    let known = |through: &str| of(through).with_parameters(&[("mass", 2.0)]).unwrap().is_linear();
    assert!(known("force") && known("(if force > 0 then 1 else -1)"));
    assert!(!known("(if position > 0 then 1 else -1)") && !known("dead(position, -1, 1)"));
}
