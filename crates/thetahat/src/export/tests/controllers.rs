use thetahat_core::nalgebra::Complex;

use super::interpret::Machine;
use super::*;
use crate::control::{ControlPlan, Design, control};
use crate::data::Offset;
use crate::model::{Orders, PolynomialModel};

/// A controller of 1/(s (s + 1)) every 0.5 s, about a working point.
fn document() -> Control {
    let e = (-0.5_f64).exp();
    let orders = Orders::arx(2, &[2], &[1]).expect("orders");
    let values = [-1.0 - e, e, -0.5 + e, 1.0 - 1.5 * e];
    let mut model = PolynomialModel::from_parameters(&orders, &values, None, 0.01, 0.5).expect("a model");
    (model.output.name, model.inputs[0].name) = ("y".to_owned(), "u".to_owned());
    model.output.offset = Offset { level: 20.0, slope: 0.0 };
    model.inputs[0].offset = Offset { level: 0.5, slope: 0.0 };
    let poles = vec![Complex::new(0.6, 0.2), Complex::new(0.6, -0.2)];
    let plan = ControlPlan { limits: -1.5..=2.0, ..ControlPlan::new(Design::Poles(poles)) };
    control(&model.into(), &plan).expect("a controller")
}

#[test]
fn a_program_controls_as_the_core_does() {
    let document = document();
    let mut core = document.controller().expect("a controller");
    let own = Controller::new(&document).expect("a controller");
    let program = super::controller::program(&own);
    let mut machine = Machine::new(&program, Precision::F64);
    let (control, applied) = (&program.entries[0], &program.entries[1]);
    let mut clipped = 0;
    for (k, (reference, y)) in signal(1, 400).into_iter().zip(signal(2, 400)).enumerate() {
        let (reference, y) = (20.0 + reference, if k % 37 == 5 { f64::NAN } else { 20.0 + y });
        let input = (core.control(reference - 20.0, y - 20.0) + 0.5).clamp(-1.5, 2.0);
        clipped += usize::from(input == 2.0);
        assert_eq!(machine.run(control, &[&[reference], &[y]])[0].to_bits(), input.to_bits(), "{k}");
        if k % 11 == 3 {
            let acted = 0.5 * input;
            core.applied(acted - 0.5);
            machine.run(applied, &[&[acted]]);
        }
    }
    assert!(clipped > 20);
}

#[test]
fn a_test_vector_is_what_the_core_does_along_a_log() {
    let document = document();
    let (u, y) = (signal(1, 200), signal(2, 200).iter().map(|y| 20.0 + y).collect::<Vec<f64>>());
    let mut holes = (u, y);
    holes.0[70] = f64::NAN;
    holes.1[60] = f64::NAN;
    let (u, y) = (&holes.0, &holes.1);
    let log = log(&[(&document.input.name, u.clone()), (&document.output.name, y.clone())], 0.5);
    let plan = |language| Plan {
        language,
        purpose: Purpose::Controller,
        precision: Precision::F64,
        name: "heater".into(),
    };
    let rows = [Rows::new(1, 150).expect("rows")];
    let exported = export_controller(&document, &plan(Language::C), Some((&log, &rows))).expect("an export");
    let names: Vec<&str> = exported.files.iter().map(|file| file.name.as_str()).collect();
    assert_eq!(names, ["heater.h", "heater.c", "heater.csv", "heater_test.c"]);
    let mut lines = exported.files[2].text.lines();
    assert_eq!(lines.next(), Some("u1,y1,set_point1,expected1"));

    let known = || y[..150].iter().copied().filter(|y| y.is_finite());
    let ends = [known().fold(f64::MIN, f64::max), known().fold(f64::MAX, f64::min)];
    let mut core = document.controller().expect("a controller");
    let mut within = 0;
    for (row, line) in lines.enumerate() {
        let set_point = ends[row / 25 % 2];
        let input = (core.control(set_point - 20.0, y[row] - 20.0) + 0.5).clamp(-1.5, 2.0);
        core.applied(u[row] - 0.5);
        within += usize::from(input > -1.5 && input < 2.0);
        let cells: Vec<&str> = line.split(',').collect();
        assert_eq!(cells[2].parse(), Ok(set_point), "{row}");
        assert_eq!(cells[3].parse(), Ok(input), "{row}");
    }
    // Within the limits and at them.
    assert!((20..130).contains(&within), "{within}");

    let rust = export_controller(&document, &plan(Language::Rust), Some((&log, &[]))).expect("an export");
    assert!(rust.files[2].text.contains("static SET_POINTS: [[f64; 1]; 200]"));
    let slow = super::log(&[("u", vec![0.0; 9]), ("y", vec![0.0; 9])], 0.6);
    let error = export_controller(&document, &plan(Language::C), Some((&slow, &[]))).expect_err("slow");
    assert!(error.to_string().contains("0.6 s, the controller's 0.5 s"), "{error}");
}

#[test]
fn what_is_no_controller_is_refused() {
    let plan =
        |purpose| Plan { language: Language::C, purpose, precision: Precision::F32, name: "heater".into() };
    let mut wrong = document();
    wrong.controller.r[0] = 2.0;
    let error = export_controller(&wrong, &plan(Purpose::Controller), None).expect_err("no controller");
    assert!(error.to_string().contains("controller.r does not begin with 1"), "{error}");
    let mut moving = document();
    moving.output.offset.slope = 1.0;
    let error = export_controller(&moving, &plan(Purpose::Controller), None).expect_err("it moves");
    assert!(error.to_string().contains("is a line in the time of its log"), "{error}");
    assert!(export_controller(&document(), &plan(Purpose::Predictor), None).is_err());
}
