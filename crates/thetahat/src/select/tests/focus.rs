use super::super::candidates::Compared;
use super::super::winners::winners;
use super::*;
use crate::estimate::{Method, estimate};
use crate::model::PolynomialModel;
use crate::respond::{Horizon, InitialCondition, simulate};

const F: [f64; 3] = [1.0, -1.5, 0.7];

fn compared(radius: f64, blocks: f64, onward: f64, unstable: usize) -> Compared {
    let held_out = Some(HeldOut { blocks, onward, unpunished: blocks, unstable, refits: 3 });
    let orders = Orders::arx(1, &[1], &[1]).unwrap();
    let structure = Structure::Arx;
    let scored =
        Candidate { structure, orders, parameters: 2, mse: 1.0, held_out_mse: None, held_out, score: None };
    // As if each part had its share.
    Compared {
        scored,
        initial_parameters: None,
        radius,
        noise_radius: 0.0,
        parts: Some((0..30).map(|k| blocks * (1.0 + 0.01 * f64::from(k))).collect()),
    }
}

/// P, S and what is taken of models in the order of their criterion, for 100 samples.
fn taken(focus: Focus, models: &[Compared]) -> Option<[usize; 3]> {
    let models: Vec<&Compared> = models.iter().collect();
    winners(focus, &models, 100).map(|won| [won.prediction, won.simulation, won.chosen])
}

#[test]
fn the_gate_opens_for_a_clear_difference_only() {
    // exp(-0.1) = 0.905: both logarithms fall by 0.094, then by 0.105.
    let models = |factor: f64| [compared(0.9, 0.5, 0.5, 0), compared(0.9, 0.5 * factor, 0.5 * factor, 0)];
    assert_eq!(taken(Focus::Auto, &models(0.91)), Some([0, 1, 0]));
    assert_eq!(taken(Focus::Auto, &models(0.90)), Some([0, 1, 1]));
    assert_eq!(taken(Focus::Simulation, &models(0.91)), Some([0, 1, 1]));
    assert_eq!(taken(Focus::Steps(5), &models(0.91)), Some([0, 1, 1]));
    assert_eq!(taken(Focus::Prediction, &models(0.1)), Some([0, 1, 0]));
    // Where the parts do not agree, the fall must be larger: exp(-0.3) = 0.741.
    let uncertain = |factor: f64| {
        let [one, mut other] = models(factor);
        let parts = other.parts.insert(one.parts.clone().unwrap());
        parts[0] *= factor;
        [one, other]
    };
    assert_eq!(taken(Focus::Auto, &uncertain(0.76)), Some([0, 1, 0]));
    assert_eq!(taken(Focus::Auto, &uncertain(0.73)), Some([0, 1, 1]));
    // What the blocks gain and the run onward loses is no gain.
    let apart = [compared(0.9, 0.5, 0.5, 0), compared(0.9, 0.25, 1.01, 0)];
    assert_eq!(taken(Focus::Auto, &apart), Some([0, 0, 0]));
}

#[test]
fn a_model_whose_noise_zeros_ended_on_the_circle_does_not_simulate() {
    let (inside, mut ended) = (compared(0.9, 0.5, 0.5, 0), compared(0.9, 0.1, 0.1, 0));
    assert_eq!(taken(Focus::Auto, &[inside.clone(), ended.clone()]), Some([0, 1, 1]));
    ended.noise_radius = 1.0 - 1e-7;
    assert_eq!(taken(Focus::Auto, &[inside, ended]), Some([0, 0, 0]));
}

#[test]
fn unstable_and_very_slow_models_do_not_simulate() {
    let stable = compared(0.9, 0.5, 0.5, 0);
    // A time constant of 200 samples has the modulus exp(-1/200).
    let slow = compared(0.9951, 0.1, 0.1, 0);
    assert_eq!(taken(Focus::Auto, &[stable.clone(), slow]), Some([0, 0, 0]));
    assert_eq!(taken(Focus::Auto, &[compared(1.01, 0.4, 0.4, 1), stable.clone()]), Some([1, 1, 1]));
    // Unstable however the rows are cut, and clearly better: so is the plant.
    assert_eq!(taken(Focus::Auto, &[compared(1.01, 0.4, 0.4, 3), stable.clone()]), Some([1, 1, 0]));
    assert_eq!(taken(Focus::Auto, &[compared(1.01, 0.49, 0.4, 3), stable]), Some([1, 1, 1]));
    assert_eq!(taken(Focus::Auto, &[compared(1.01, 0.4, 0.4, 3)]), None);
    // What the data without a block do not determine predicts, and is not compared.
    let mut open = compared(0.9, 0.5, 0.5, 0);
    open.scored.held_out = None;
    assert_eq!(taken(Focus::Auto, &[open.clone(), compared(0.9, 0.1, 0.1, 0)]), Some([0, 1, 0]));
    assert_eq!(taken(Focus::Simulation, &[open.clone(), compared(0.9, 0.1, 0.1, 0)]), Some([0, 1, 1]));
    assert_eq!(taken(Focus::Auto, &[open]), Some([0, 0, 0]));
}

#[test]
fn figures_of_blocks_are_those_of_single_fits() {
    let mut noise = Noise(11);
    let (u, e) = (noise.take(330), noise.take(330));
    let y = sum(&filtered(&[0.0, 1.0, 0.5], &F, &u), &e, 0.4);
    let whole = Record::new(&y, vec![&u]).unwrap();
    let orders = Orders::arx(2, &[2], &[1]).unwrap();
    let choice = Choice::Grid(arx_grid(2.into(), &[2.into()], &[1.into()]));
    let found = focused(&whole, &choice, Focus::Simulation).unwrap().selection;
    let seen = found.chosen.held_out.unwrap();
    let mean = y.iter().sum::<f64>() / 330.0;
    let variance = y.iter().map(|y| (y - mean).powi(2)).sum::<f64>() / 330.0;
    let model = |segments: &[Range<usize>]| {
        let estimate =
            estimate(&record(&y, &[&u], segments), &orders, &Method::default(), Initial::Drop).unwrap();
        PolynomialModel::from_parameters(&orders, estimate.parameters(), None, 1.0, 1.0).unwrap()
    };
    let error = |model: &PolynomialModel, record: &Record<'_>, rows: Range<usize>| {
        let run = simulate(model, record, InitialCondition::Estimate).unwrap();
        rows.map(|t| (y[t] - run.values[t]).powi(2)).sum::<f64>()
    };
    let blocks = [0..110, 110..220, 220..330];
    let mut total = 0.0;
    for (left_out, block) in blocks.iter().enumerate() {
        let others: Vec<_> = (0..3).filter(|k| *k != left_out).map(|k| blocks[k].clone()).collect();
        let test = Record { past: vec![block.start], ..record(&y, &[&u], std::slice::from_ref(block)) };
        total += error(&model(&others), &test, block.clone());
    }
    assert!(close(seen.blocks, total / 330.0 / variance, 1e-9), "{seen:?} {total}");
    // Onward: the initial state is that of the rows before the last block.
    let mut known = y.clone();
    known[220..].fill(f64::NAN);
    let onward =
        error(&model(&blocks[..2]), &record(&known, &[&u], std::slice::from_ref(&(0..330))), 220..330);
    assert!(close(seen.onward, onward / 110.0 / variance, 1e-9), "{seen:?} {onward}");
    assert_eq!((seen.unstable, seen.refits, seen.unpunished), (0, 3, seen.blocks));
    assert!((seen.percent() - 100.0 * (1.0 - (seen.blocks * seen.onward).powf(0.25))).abs() < 1e-12);
}

/// A noise that wanders, which a slow pole of the plant would follow: free runs have levels of their own, and the noise
/// integrates.
#[test]
fn a_slow_pole_is_not_rewarded_for_a_drift() {
    let mut noise = Noise(18);
    let (mut u, e) = (vec![0.0; 1500], noise.take(1500));
    for t in 1..1500 {
        u[t] = if t % 12 == 0 { 2.0 * noise.uniform() } else { u[t - 1] };
    }
    let x = filtered(&[0.0, 0.2], &[1.0, -0.9], &u);
    let choice = Choice::Automatic(Automatic::default());
    let of = |drift: f64| {
        let wandering: Vec<f64> = x.iter().zip(&e).map(|(x, e)| x + 0.1 * e).collect();
        let y = sum(&wandering, &filtered(&[0.0, 1.0], &[1.0, -1.0], &e), drift);
        choose_orders(&Record::new(&y, vec![&u]).unwrap(), None, &choice, Select::MDL).unwrap()
    };
    let still = of(0.0);
    assert_eq!((still.level_window, still.noise_integrates), (None, false));
    let wandering = of(0.05);
    // Four time constants of 9.5 samples are shorter than the shortest window.
    assert_eq!(
        (wandering.level_window, wandering.noise_integrates),
        (Some(64), true),
        "{:?}",
        wandering.steps
    );
    assert!(
        wandering.chosen.orders.nd > 0 && wandering.chosen.orders.nf[0] <= 2,
        "{}",
        wandering.chosen.orders
    );
}

/// A static curve in front of the plant and a drift, of which nothing is to be known: outside of the model set.
#[test]
fn what_simulates_is_taken_where_the_plant_is_not_among_the_models() {
    let mut noise = Noise(17);
    let (mut u, e) = (vec![0.0; 900], noise.take(900));
    for t in 1..900 {
        u[t] = if t % 30 == 0 { 2.0 * noise.uniform() } else { u[t - 1] };
    }
    let bent: Vec<f64> = u.iter().map(|u| u + 0.5 * u * u).collect();
    let slow = [1.0, -1.93, 0.9312];
    let x = filtered(&[0.0, 0.0006, 0.0006], &slow, &bent);
    let drift = filtered(&[1.0], &[1.0, -0.995], &e);
    let y = sum(&sum(&x, &drift, 0.01), &noise.take(900), 0.002);
    let record = Record::new(&y, vec![&u]).unwrap();
    let choice = Choice::Automatic(Automatic::default());
    let of = |focus| focused(&record, &choice, focus).unwrap().selection;
    let (auto, prediction, simulation) = (of(Focus::Auto), of(Focus::Prediction), of(Focus::Simulation));
    let best = auto.winners.clone().unwrap();
    assert_eq!(prediction.winners, None);
    assert_eq!(simulation.winners.unwrap().simulation, simulation.chosen);
    let (p, s) = (best.prediction.held_out.unwrap(), best.simulation.held_out.unwrap());
    assert!(s.blocks <= p.blocks);
    assert!((p.blocks.ln() + p.onward.ln() - s.blocks.ln() - s.onward.ln()) / 2.0 > 0.3, "{p:?} {s:?}");
    assert_eq!(auto.chosen, best.simulation, "{:?}", auto.steps);
    assert!(auto.steps.iter().any(|step| step.starts_with("Best one step ahead: ")), "{:?}", auto.steps);
}

#[test]
fn blocks_are_predicted_as_far_ahead_as_the_focus_says() {
    let mut noise = Noise(19);
    let (u, e) = (noise.take(400), noise.take(400));
    let y = sum(&filtered(&[0.0, 1.0], &F, &u), &filtered(&[1.0], &F, &e), 0.3);
    let record = Record::new(&y, vec![&u]).unwrap();
    let choice = Choice::Automatic(Automatic { structure: Some(Structure::Arx), ..Automatic::default() });
    let figure = |focus| {
        let selection = focused(&record, &choice, focus).unwrap().selection;
        let model = selection.best.into_iter().find(|model| model.orders.to_string() == "ARX(2, 1, 1)");
        model.unwrap().held_out.unwrap().blocks
    };
    // Errors grow with the horizon, up to those of a free run.
    let figures = [figure(Focus::Steps(2)), figure(Focus::Steps(5)), figure(Focus::Simulation)];
    assert!(figures[0] < figures[1] && figures[1] < 1.05 * figures[2], "{figures:?}");
    assert_eq!(Focus::Steps(5).horizon(), Horizon::Steps { steps: 5 });
    for text in ["auto", "prediction", "simulation", "12"] {
        assert_eq!(text.parse::<Focus>().unwrap().to_string(), text);
    }
    for text in ["", "0", "-1", "free", "1.5"] {
        assert!(text.parse::<Focus>().is_err(), "{text}");
    }
}

#[test]
fn selection_on_held_out_rows_uses_the_horizon() {
    let mut noise = Noise(23);
    let (u, e) = (noise.take(500), noise.take(500));
    let y = sum(&filtered(&[0.0, 1.0, 0.5], &F, &u), &e, 0.5);
    let (first, second) = (
        record(&y, &[&u], std::slice::from_ref(&(0..350))),
        record(&y, &[&u], std::slice::from_ref(&(350..500))),
    );
    let orders = Orders::oe(&[2], &[2], &[1]).unwrap();
    let inputs = ["u1".to_owned()];
    for (select, focus) in [(Select::Validation, Focus::Simulation), (Select::Cv, Focus::Simulation)] {
        let search = Search::default();
        let validation = Some(&second);
        let task = Task { validation, select, focus, may_drift: false, ..task(&first, &inputs, &search) };
        let found = choose(&task, &Choice::Known(orders.clone())).unwrap();
        let held_out_mse = found.selection.chosen.held_out_mse.unwrap();
        // The noise that no model simulates: uniform within a half.
        assert!((0.06..0.11).contains(&held_out_mse), "{select:?} {held_out_mse}");
        if select == Select::Validation {
            let model =
                PolynomialModel::from_parameters(&orders, &found.initial_parameters.unwrap(), None, 1.0, 1.0)
                    .unwrap();
            let run = simulate(&model, &second, InitialCondition::Estimate).unwrap();
            let own = (350..500).map(|t| (y[t] - run.values[t]).powi(2)).sum::<f64>() / 150.0;
            assert!(close(held_out_mse, own, 1e-9), "{held_out_mse} {own}");
        }
    }
}
