//! The interface as C sees it: programs in C are compiled and linked with the library, and run.

mod build;
mod library;
mod steps;

use build::run;
use library::Precision;

#[test]
fn c_gets_the_bits_of_rust() {
    for precision in [Precision::Single, Precision::Double] {
        let Some(printed) = run(precision, "steps", &["crates/thetahat-c/tests/c/steps.c"]) else { return };
        let expected = match precision {
            Precision::Single => steps::lines::<f32>(),
            Precision::Double => steps::lines::<f64>(),
        };
        let expected = expected.expect("steps without errors");
        for (from_c, from_rust) in printed.lines().zip(expected.lines()) {
            assert_eq!(from_c, from_rust, "{precision:?}");
        }
        assert_eq!(printed.lines().count(), expected.lines().count());
    }
}

#[test]
fn the_header_says_how_much_memory_each_size_needs() {
    for precision in [Precision::Single, Precision::Double] {
        let Some(printed) = run(precision, "sizes", &["crates/thetahat-c/tests/c/sizes.c"]) else { return };
        assert_eq!(printed, "130 sizes\n");
    }
}

#[test]
fn a_direct_term_is_taken_with_the_inputs_of_the_transition_or_refused() {
    for precision in [Precision::Single, Precision::Double] {
        let Some(printed) = run(precision, "inputs", &["crates/thetahat-c/tests/c/inputs.c"]) else { return };
        assert_eq!(printed, " 0 0 0\n");
    }
}

#[test]
fn the_example_of_the_documentation_controls_its_heater() {
    for precision in [Precision::Single, Precision::Double] {
        run(precision, "heater", &["crates/thetahat-c/tests/c/heater.c"]);
    }
}

#[test]
fn the_battery_gauge_is_right() {
    let sources = ["examples/battery_gauge/gauge.c", "examples/battery_gauge/main.c"];
    for precision in [Precision::Single, Precision::Double] {
        let Some(printed) = run(precision, "gauge", &sources) else { return };
        assert!(printed.starts_with("charge: 390 of 1000, gauge 39"), "{printed}");
    }
}

#[test]
fn the_header_is_cpp_too() {
    build::compile_header_as_cpp();
}
