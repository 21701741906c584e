//! Each template on the log that tests/data/simulated_templates.rs simulates for it, and on drawn plants.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use super::Template;
use crate::Error;
use crate::data::{Channel, Log};
use crate::model::{EquationsModel, GreyBox, Model};
use crate::report::{EquationsPlan, Report, apply, fit_equations};
use crate::respond::{Horizon, InitialCondition};

/// A log in CSV, with the time in its first column.
fn log(text: &str) -> Log {
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let mut columns = vec![Vec::new(); names.len()];
    for line in lines {
        for (column, value) in columns.iter_mut().zip(line.split(',')) {
            column.push(value.parse().expect("a number"));
        }
    }
    let time = columns.remove(0);
    let channels =
        names[1..].iter().zip(columns).map(|(name, values)| Channel { name: (*name).into(), values });
    Log::recorded(channels.collect(), time).expect("a log")
}

fn model(name: &str, log: &Log, known: &[(&str, f64)]) -> Result<GreyBox, Error> {
    let template = Template::named(name)?;
    let names: Vec<String> = log.channels().iter().map(|channel| channel.name.clone()).collect();
    let known: Vec<(String, f64)> = known.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect();
    template.model(log, &template.columns_in(&names, &[])?, &known, &[])
}

fn fit(model: &GreyBox, log: &Log) -> Report {
    fit_equations(model, log, &[], &EquationsPlan::default(), &|_| ControlFlow::Continue(())).expect("a fit")
}

/// By name: a value, and what else is known of it.
type Figures = BTreeMap<String, (f64, f64, Option<f64>)>;

/// What gravity takes at an angle.
type Gravity = fn(f64) -> f64;

/// What was found, with its standard errors and where the search started: parameters and figures.
fn found(report: &Report) -> (Figures, &EquationsModel) {
    let Model::Equations(model) = &report.model else { panic!("no equations") };
    let outcome = report.estimation.procedure.equations().expect("equations");
    let parameters = model.parameters.iter().zip(&outcome.unknown).map(|(parameter, unknown)| {
        (
            parameter.name.clone(),
            (parameter.value, parameter.standard_error.unwrap_or(0.0), Some(unknown.start)),
        )
    });
    let figures = model.figures.iter().map(|figure| {
        (
            figure.name.clone(),
            (figure.value.expect("a value"), figure.standard_error.expect("an error"), None),
        )
    });
    (parameters.chain(figures).collect(), model)
}

/// The truth lies within 3.5 standard errors, and a start within this part of it; with which numbers known, and what
/// the plants of the program are.
#[track_caller]
fn recovers(name: &str, csv: &str, known: &[(&str, f64)], near: f64, truth: &[(&str, f64)]) {
    let log = log(csv);
    let report = fit(&model(name, &log, known).expect("a model"), &log);
    let (found, _) = found(&report);
    for (parameter, truth) in truth {
        let (value, error, start) = found[*parameter];
        assert!(
            error > 0.0 && (value - truth).abs() < 3.5 * error,
            "{name}: {parameter} {value} +- {error}, {truth}"
        );
        assert!(error < 0.15 * truth.abs(), "{name}: {parameter} {value} +- {error} says little");
        if let Some(start) = start {
            assert!(
                (start - truth).abs() < near * truth.abs(),
                "{name}: {parameter} starts at {start}, {truth}"
            );
        }
    }
}

#[test]
fn a_motor_is_recovered() {
    let truth = [
        ("resistance", 0.8),
        ("inductance", 0.0012),
        ("torque_constant", 0.03),
        ("inertia", 4e-5),
        ("friction", 2e-5),
        ("dry_friction", 0.004),
        ("electrical_time_constant", 0.0015),
        ("mechanical_time_constant", 4e-5 * 0.8 / (9e-4 + 0.8 * 2e-5)),
        ("no_load_speed", (0.03 * 12.0 - 0.8 * 0.004) / (9e-4 + 0.8 * 2e-5)),
        ("stall_current", 15.0),
    ];
    recovers("motor", include_str!("../../../../tests/data/templates/motor.csv"), &[], 0.2, &truth);
}

#[test]
fn mechanisms_are_recovered() {
    let simple = [("kS", 1.01), ("kV", 3.06), ("kA", 0.327)];
    recovers("mechanism", include_str!("../../../../tests/data/templates/mechanism.csv"), &[], 0.05, &simple);
    let elevator = [simple.as_slice(), &[("kG", -0.211)]].concat();
    recovers("elevator", include_str!("../../../../tests/data/templates/elevator.csv"), &[], 0.05, &elevator);
    let arm = [simple.as_slice(), &[("kG", 0.6), ("offset", 0.1)]].concat();
    recovers("arm", include_str!("../../../../tests/data/templates/arm.csv"), &[], 0.1, &arm);
}

/// The reference of WPILib: FeedforwardAnalysisTest.cpp of SysId wants Ks 1.01, Kv 3.060, Ka 0.327 and Kg -0.211 within
/// 0.005 from runs without noise; FeedbackAnalysisTest.cpp gains of 2.11 for the velocity and of 6.41 and 2.48 for the
/// position, within 0.05, with errors of 1 and 1.5 and 7 V.
#[test]
fn the_reference_of_wpilib_is_met_without_noise() {
    const STEP: f64 = 0.005;
    const PARTS: usize = 50;
    let gravities: [(&str, &str, Gravity); 3] = [
        ("mechanism", "position", |_| 0.0),
        ("elevator", "position", |_| -0.211),
        ("arm", "angle", |angle| -0.211 * angle.cos()),
    ];
    for (name, place, gravity) in gravities {
        let (mut velocity, mut position) = (0.0_f64, 0.0_f64);
        let mut columns = [Vec::new(), Vec::new(), Vec::new()];
        let part = STEP / PARTS as f64;
        let fade = (-part * 3.06 / 0.327).exp();
        for k in 0..2600 {
            // Slow there and back, fast there and back; the mechanism stops in between.
            let voltage = match k {
                0..900 => f64::from(k) * STEP * 1.4,
                1000..1900 => -f64::from(k - 1000) * STEP * 1.4,
                2000..2200 => 7.0,
                2300..2500 => -7.0,
                _ => 0.0,
            };
            for (column, value) in columns.iter_mut().zip([voltage, velocity, position]) {
                column.push(value);
            }
            for _ in 0..PARTS {
                let pulled = voltage - gravity(position);
                let side = if velocity == 0.0 { pulled.signum() } else { velocity.signum() };
                let end = (pulled - 1.01 * side) / 3.06;
                let before = velocity;
                velocity = end + (velocity - end) * fade;
                if velocity * side < 0.0 {
                    velocity = 0.0;
                }
                position += part * (before + velocity) / 2.0;
            }
        }
        let names = ["voltage", "velocity", place];
        let channels = names.iter().zip(columns);
        let channels = channels.map(|(name, values)| Channel { name: (*name).into(), values }).collect();
        let log = Log::new(channels, STEP).expect("a log");
        let report = fit(&model(name, &log, &[]).expect("a model"), &log);
        let (found, _) = found(&report);
        let near = |parameter: &str, truth: f64, tolerance: f64| {
            let (value, ..) = found[parameter];
            assert!((value - truth).abs() < tolerance, "{name}: {parameter} is {value}, not {truth}");
        };
        near("kS", 1.01, 0.005);
        near("kV", 3.060, 0.005);
        near("kA", 0.327, 0.005);
        if name != "mechanism" {
            near("kG", -0.211, 0.005);
        }
        near("velocity_kp", 2.11, 0.05);
        near("position_kp", 6.41, 0.05);
        near("position_kd", 2.48, 0.05);
    }
}

#[test]
fn batteries_are_recovered() {
    let known = [("capacity", 2.5)];
    let open = |soc: f64| {
        3.0 + 1.1 * soc - 0.55 * soc.powi(2) + 0.5 * soc.powi(3) + 0.1 * (1.0 - (-20.0 * soc).exp())
    };
    let one = [("r0", 0.02), ("r1", 0.01), ("tau1", 25.0), ("capacitor1", 2500.0), ("resistance", 0.03)];
    let csv = include_str!("../../../../tests/data/templates/battery.csv");
    recovers("battery", csv, &known, 0.2, &one);
    let two = [("r0", 0.02), ("r1", 0.01), ("tau1", 25.0), ("r2", 0.015), ("tau2", 250.0)];
    recovers("battery2", include_str!("../../../../tests/data/templates/battery2.csv"), &known, 0.6, &two);
    // The table, which the plant does not have, goes through its open-circuit voltage.
    let log = log(csv);
    let report = fit(&model("battery", &log, &known).expect("a model"), &log);
    let (found, fitted) = found(&report);
    let start = fitted.equations.find("table(soc; ").expect("a table") + "table(soc; ".len();
    let table = fitted.equations[start..].split(')').next().expect("its end");
    for (knot, name) in table.split(", ").map(|pair| pair.split_once(':').expect("a knot")) {
        let soc: f64 = knot.parse().expect("a number");
        assert!((found[name].0 - open(soc)).abs() < 0.003, "{knot}: {} {}", found[name].0, open(soc));
    }
}

#[test]
fn rooms_are_recovered() {
    let one = [("resistance", 0.008), ("capacity", 4e6), ("aperture", 1.5), ("heat_loss", 125.0)];
    recovers("room", include_str!("../../../../tests/data/templates/room.csv"), &[], 0.1, &one);
    let two = [
        ("resistance_inside", 0.003),
        ("resistance_outside", 0.006),
        ("capacity_air", 1.2e6),
        ("capacity_walls", 8e6),
        ("aperture", 1.5),
        ("heat_loss", 1.0 / 0.009),
    ];
    recovers("room2", include_str!("../../../../tests/data/templates/room2.csv"), &[], 0.2, &two);
}

#[test]
fn the_others_are_recovered() {
    let tank = [("area", 0.05), ("outflow", 4e-4)];
    recovers("tank", include_str!("../../../../tests/data/templates/tank.csv"), &[], 0.05, &tank);
    let pendulum = [
        ("length", 0.5),
        ("damping", 0.3),
        ("inertia", 0.1),
        ("zero", 0.05),
        ("natural_frequency", (9.80665_f64 / 0.5).sqrt()),
        ("damping_ratio", 0.3 / (2.0 * (9.80665_f64 / 0.5).sqrt())),
    ];
    recovers("pendulum", include_str!("../../../../tests/data/templates/pendulum.csv"), &[], 0.1, &pendulum);
    let spring = [
        ("mass", 2.0),
        ("stiffness", 80.0),
        ("damping", 3.0),
        ("rest", 0.01),
        ("natural_frequency", 40.0_f64.sqrt()),
        ("damping_ratio", 3.0 / (2.0 * 160.0_f64.sqrt())),
    ];
    recovers("spring", include_str!("../../../../tests/data/templates/spring.csv"), &[], 0.1, &spring);
    let axis = [("gain", 120.0), ("motor_lag", 0.04), ("delay", 0.018)];
    recovers("multirotor", include_str!("../../../../tests/data/templates/multirotor.csv"), &[], 0.3, &axis);
    let exchanger = [("holdup", 4.0), ("ua", 1500.0), ("medium_temperature", 130.0)];
    recovers(
        "exchanger",
        include_str!("../../../../tests/data/templates/exchanger.csv"),
        &[],
        0.1,
        &exchanger,
    );
}

/// Uniform numbers in [0, 1): xorshift (Marsaglia 2003).
struct Random(u64);

impl Random {
    fn uniform(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

/// Plants whose parameters are up to twice as large or small as those of a log, driven by its inputs: the template
/// finds them from its own start values.
#[track_caller]
fn drawn(name: &str, csv: &str, known: &[(&str, f64)], count: u64) {
    let log = log(csv);
    let base = fit(&model(name, &log, known).expect("a model"), &log);
    let Model::Equations(base) = &base.model else { panic!("no equations") };
    for seed in 1..=count {
        let mut random = Random(seed * 7_919 + 1);
        let box_of_log = GreyBox::from_toml(&base.equations).expect("a model");
        let truth: Vec<f64> = base
            .parameters
            .iter()
            .map(|parameter| {
                let stays = parameter.name.starts_with("ocv") || parameter.name.contains('.');
                let factor = if stays { 1.0 } else { 2.0_f64.powf(2.0 * random.uniform() - 1.0) };
                parameter.value * factor
            })
            .collect();
        let none = vec![vec![0.0; truth.len()]; truth.len()];
        let plant: Model =
            EquationsModel::new(&box_of_log, &truth, none, &box_of_log.measurement_variances_at_start())
                .into();
        let run = apply(&plant, &log, &[], None, Horizon::FreeRun, InitialCondition::Zero).expect("a run");
        let noises: Vec<f64> =
            base.noise_covariance.iter().enumerate().map(|(i, row)| row[i].sqrt()).collect();
        let mut channels = log.channels().to_vec();
        for (output, noise) in run.outputs.iter().zip(noises) {
            let channel = channels.iter_mut().find(|channel| channel.name == output.name).expect("a channel");
            channel.values = output.predicted.iter().map(|y| y + noise * random.normal()).collect();
        }
        let time = (0..log.rows()).map(|row| log.elapsed(row)).collect();
        let own = Log::recorded(channels, time).expect("a log");
        let report =
            fit(&model(name, &own, known).unwrap_or_else(|error| panic!("{name} {seed}: {error}")), &own);
        let (found, _) = found(&report);
        for (parameter, truth) in base
            .parameters
            .iter()
            .zip(&truth)
            .filter(|(own, _)| !own.name.starts_with("ocv") && !own.name.contains('.'))
        {
            let (value, error, _) = found[&parameter.name];
            let far = (value - truth).abs() / error;
            assert!(far < 4.0, "{name} {seed}: {} {value} +- {error}, {truth}", parameter.name);
        }
    }
}

#[test]
fn drawn_plants_are_recovered() {
    for (name, csv, known) in [
        ("motor", include_str!("../../../../tests/data/templates/motor.csv"), [].as_slice()),
        ("elevator", include_str!("../../../../tests/data/templates/elevator.csv"), &[]),
        ("arm", include_str!("../../../../tests/data/templates/arm.csv"), &[]),
        ("room", include_str!("../../../../tests/data/templates/room.csv"), &[]),
        ("room2", include_str!("../../../../tests/data/templates/room2.csv"), &[]),
        ("tank", include_str!("../../../../tests/data/templates/tank.csv"), &[]),
        ("pendulum", include_str!("../../../../tests/data/templates/pendulum.csv"), &[]),
        ("spring", include_str!("../../../../tests/data/templates/spring.csv"), &[]),
        ("exchanger", include_str!("../../../../tests/data/templates/exchanger.csv"), &[]),
        ("multirotor", include_str!("../../../../tests/data/templates/multirotor.csv"), &[]),
        (
            "battery",
            include_str!("../../../../tests/data/templates/battery.csv"),
            &[("capacity", 2.5), ("knots", 11.0)],
        ),
    ] {
        // With twenty of each the farthest was 3.2 standard errors off.
        drawn(name, csv, known, if name == "battery" { 1 } else { 3 });
    }
}

fn refusal(name: &str, log: &Log, known: &[(&str, f64)]) -> String {
    model(name, log, known).expect_err("a refusal").to_string()
}

fn columns(pairs: &[(&str, &[f64])]) -> Log {
    let channel = |(name, values): &(&str, &[f64])| Channel { name: (*name).into(), values: values.to_vec() };
    Log::new(pairs.iter().map(channel).collect(), 0.02).expect("a log")
}

#[test]
fn what_no_plant_has_is_refused_with_the_reason() {
    let log = log(include_str!("../../../../tests/data/templates/mechanism.csv"));
    let with = |voltage: f64, velocity: f64| {
        let values = |name: &str, by: f64| -> Vec<f64> {
            log.channel(name).expect("a channel").values.iter().map(|value| by * value).collect()
        };
        columns(&[("voltage", &values("voltage", voltage)), ("velocity", &values("velocity", velocity))])
    };
    let inverted = refusal("mechanism", &with(1.0, -1.0), &[]);
    assert!(inverted.starts_with("kA = -0.") && inverted.contains("has the wrong sign"), "{inverted}");
    let still = refusal("mechanism", &with(1.0, 0.0), &[]);
    assert!(still.contains("column 'velocity' is 0 in all rows"), "{still}");
    let few = columns(&[("voltage", &[0.0, 1.0, 2.0]), ("velocity", &[0.0, 0.1, 0.2])]);
    assert!(refusal("mechanism", &few, &[]).contains("does not tell kS, kV and kA apart"));
    let battery = columns(&[("current", &[0.0, 1.0, 1.0, 0.0]), ("voltage", &[4.0, 3.0, 3.0, 4.0])]);
    assert!(refusal("battery", &battery, &[]).contains("steps of the current"));
    let degrees: Vec<f64> = (0..100).map(|k| 80.0 * (0.2 * f64::from(k)).cos()).collect();
    assert!(refusal("pendulum", &columns(&[("angle", &degrees)]), &[]).contains("looks like degrees"));
    let nothing = columns(&[("voltage", &[f64::NAN; 9]), ("velocity", &[1.0; 9])]);
    assert!(refusal("mechanism", &nothing, &[]).contains("column 'voltage' has no values"));
    let one = columns(&[("voltage", &[1.0]), ("velocity", &[1.0])]);
    assert!(refusal("mechanism", &one, &[]).contains("needs a log of some rows"));
    for (known, said) in [
        (("kQ", 1.0), "mechanism has no 'kQ'"),
        (("period", 0.0), "period is 0; give one above 0"),
        (("kS", f64::NAN), "give a finite number"),
    ] {
        let message = refusal("mechanism", &log, &[known]);
        assert!(message.contains(said), "{message}");
    }
}

#[test]
fn columns_go_by_their_names() {
    let battery = Template::named("battery").expect("a template");
    let header = |names: &[&str]| -> Vec<String> { names.iter().map(|name| (*name).to_owned()).collect() };
    let given = |role: &str, name: &str| vec![(role.to_owned(), name.to_owned())];
    let found = |names: &[&str], given: &[(String, String)]| {
        let columns = battery.columns_in(&header(names), given);
        columns
            .map(|columns| columns.names().map(str::to_owned).collect::<Vec<_>>())
            .map_err(|error| error.to_string())
    };
    for names in
        [["current", "voltage"], ["I [A]", "U [V]"], ["Current(A)", "Voltage(V)"], ["i_batt_a", "voltage_v"]]
    {
        assert_eq!(found(&names, &[]), Ok(header(&names)));
    }
    // The own name comes before another one, and what is given before both.
    assert_eq!(found(&["i", "current", "v"], &[]), Ok(header(&["current", "v"])));
    assert_eq!(found(&["i", "current", "v"], &given("current", "i")), Ok(header(&["i", "v"])));
    for (names, given, said) in [
        (
            vec!["x", "y"],
            vec![],
            "wants current [A], voltage [V]; the log has x, y; say which is which, such as current=NAME",
        ),
        (vec!["i", "amps", "v"], vec![], "'i' and 'amps' of the log may be current"),
        (vec!["i", "v"], given("curent", "i"), "did you mean 'current'?"),
        (vec!["i", "v"], given("current", "j"), "the log has no column 'j'"),
    ] {
        let message = found(&names, &given).expect_err("a refusal");
        assert!(message.contains(said), "{message}");
    }
    let twice = [given("current", "i"), given("voltage", "i")].concat();
    assert!(found(&["i", "v"], &twice).is_err_and(|message| message.contains("each column has one role")));
}

#[test]
fn what_is_known_is_not_estimated() {
    let log = log(include_str!("../../../../tests/data/templates/spring.csv"));
    let model = model("spring", &log, &[("mass", 2.0)]).expect("a model");
    assert_eq!(model.unknown().take(3).collect::<Vec<_>>(), ["stiffness", "damping", "rest"]);
    assert!(model.text().contains("mass = 2 "));
}
