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
fn what_is_no_controller_is_refused() {
    let plan =
        |purpose| Plan { language: Language::C, purpose, precision: Precision::F32, name: "heater".into() };
    let mut wrong = document();
    wrong.controller.r[0] = 2.0;
    let error = export_controller(&wrong, &plan(Purpose::Controller)).expect_err("no controller");
    assert!(error.to_string().contains("controller.r does not begin with 1"), "{error}");
    let mut moving = document();
    moving.output.offset.slope = 1.0;
    let error = export_controller(&moving, &plan(Purpose::Controller)).expect_err("it moves");
    assert!(error.to_string().contains("is a line in the time of its log"), "{error}");
    assert!(export_controller(&document(), &plan(Purpose::Predictor)).is_err());
}
