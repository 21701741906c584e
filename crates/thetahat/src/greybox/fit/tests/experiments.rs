use crate::greybox::fit::experiment::Experiment;
use crate::{Channel, Error, Recording, Times};

fn recording(times: Times) -> Recording {
    let channel = |name: &str, values: [f64; 4]| Channel { name: name.into(), values: values.to_vec() };
    Recording {
        channels: vec![
            channel("y", [1.0, f64::NAN, 3.0, 4.0]),
            channel("u", [f64::NAN, 5.0, f64::NAN, 6.0]),
            channel("w", [7.0, 8.0, 9.0, 10.0]),
        ],
        times,
    }
}

#[test]
fn rows_are_in_the_order_of_the_model() {
    let names = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
    let halves = |step: f64| Ok((2, step / 2.0));
    let recording = recording(Times::Measured(vec![10.0, 11.0, 13.0, 13.5]));
    let experiment = Experiment::new(&recording, &names(&["w", "u"]), &names(&["y"]), halves).unwrap();
    assert_eq!(experiment.rows(), 4);
    let inputs: Vec<&[f64]> = (0..4).map(|row| experiment.input(row)).collect();
    assert_eq!(inputs, [[7.0, 0.0], [8.0, 5.0], [9.0, 5.0], [10.0, 6.0]]);
    assert_eq!(experiment.held, [0, 2]);
    assert!(experiment.output(1)[0].is_nan() && experiment.output(2) == [3.0]);
    assert_eq!(experiment.readings(0), 3);
    let steps: Vec<Vec<(f64, f64)>> = (0..4).map(|row| experiment.steps(row).collect()).collect();
    assert_eq!(
        steps,
        [vec![], vec![(0.0, 0.5), (0.5, 0.5)], vec![(1.0, 1.0), (2.0, 1.0)], vec![(3.0, 0.25), (3.25, 0.25)]]
    );
    // Without inputs.
    let alone = Experiment::new(&recording, &[], &names(&["y"]), halves).unwrap();
    assert_eq!(alone.input(2), [0.0; 0]);
    // A step that the model cannot take is one of a row.
    let refused = Experiment::new(&recording, &[], &names(&["y"]), |step| {
        if step < 1.5 { Ok((1, step)) } else { Err(Error::data("too long")) }
    });
    let Err(Error::Data { row: Some(3), message, .. }) = refused else { panic!("{refused:?}") };
    assert_eq!(message, "row 3: too long");
}
