use thetahat_core::RstController;
use thetahat_core::nalgebra::{DVector, Dyn};

use super::interpret::Machine;
use super::*;

fn controller() -> Controller {
    Controller {
        gain: 1.7,
        r: vec![-1.3, 0.3, 0.0],
        s: vec![2.1, -1.4, 0.2],
        observer: vec![-0.8, 0.1, 0.05],
        limits: [-1.5, 2.0],
        offsets: [0.0, 0.0],
    }
}

#[test]
fn a_program_controls_as_the_core_does() {
    let own = controller();
    let vector = |values: &[f64]| DVector::from_column_slice(values);
    let core =
        RstController::<f64, Dyn>::new(own.gain, vector(&own.r), vector(&own.s), vector(&own.observer));
    let mut core = core.and_then(|core| core.with_limits(-1.5..=2.0)).expect("a controller");
    let program = super::controller::program(&own);
    let mut machine = Machine::new(&program, Precision::F64);
    let (control, applied) = (&program.entries[0], &program.entries[1]);
    for (k, (reference, mut y)) in signal(1, 400).into_iter().zip(signal(2, 400)).enumerate() {
        y = if k % 37 == 5 { f64::NAN } else { y };
        let input = core.control(reference, y);
        assert_eq!(machine.run(control, &[&[reference], &[y]])[0].to_bits(), input.to_bits(), "{k}");
        if k % 11 == 3 {
            let acted = 0.5 * input;
            core.applied(acted);
            machine.run(applied, &[&[acted]]);
        }
    }
}

#[test]
fn what_is_no_controller_is_refused() {
    let plan =
        |purpose| Plan { language: Language::C, purpose, precision: Precision::F32, name: "heater".into() };
    for wrong in [
        Controller { r: vec![1.0], ..controller() },
        Controller { gain: f64::NAN, ..controller() },
        Controller { limits: [1.0, 0.0], ..controller() },
        Controller { limits: [f64::NAN, 0.0], ..controller() },
        Controller { r: Vec::new(), s: Vec::new(), observer: Vec::new(), ..controller() },
    ] {
        let error = export_controller(&wrong, &[], &plan(Purpose::Controller)).expect_err("no controller");
        assert!(error.to_string().starts_with("controller: "), "{error}");
    }
    assert!(export_controller(&controller(), &[], &plan(Purpose::Predictor)).is_err());
}
