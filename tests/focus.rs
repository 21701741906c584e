//! What a model is for: prediction, simulation, or a number of steps ahead.

use serde_json::Value;

use crate::fit_reference::folder_with;
use crate::harness::{Folder, distance, number, parameters};
use crate::signals::{Random, csv, plain_log, response};

fn words(report: &Value) -> String {
    let steps = report["selection"]["steps"].as_array().into_iter().flatten();
    steps.filter_map(Value::as_str).collect::<Vec<_>>().join(" ")
}

fn figures(report: &Value, kind: &str) -> Vec<f64> {
    let fits = report["fit"].as_array().into_iter().flatten();
    let own = fits.filter(|fit| fit["part"] == "validation" && fit["horizon"]["kind"] == kind);
    own.map(|fit| number(fit, "/percent")).collect()
}

#[test]
fn a_fit_for_simulation_has_the_plant_of_output_error() {
    let folder = folder_with("hair_dryer.csv");
    let rows = "log.csv --estimate 1..500 --validate 501..1000";
    let oe = folder.fit(&format!("{rows} --model oe --nb 2 --nf 2 --nk 3 --constant no"));
    let bj = "--model bj --nb 2 --nc 1 --nd 2 --nf 2 --nk 3 --constant no";
    let both = folder.fit(&format!("{rows} {bj} --focus simulation"));
    let (plant, all) = (parameters(&oe), parameters(&both));
    // b3, b4, c1, d1, d2, f1, f2.
    assert_eq!([all[0], all[1], all[5], all[6]], plant[..]);
    assert_eq!(both["estimation"]["plant_first"], true);
    let plain = folder.fit(&format!("{rows} {bj}"));
    assert_eq!(plain["estimation"]["plant_first"], false);
    assert!(number(&both, "/estimation/mse") >= number(&plain, "/estimation/mse") * (1.0 - 1e-6));
    assert!(number(&both, "/estimation/mse") < 0.5 * number(&oe, "/estimation/mse"));
    assert_eq!(figures(&both, "free-run"), figures(&oe, "free-run"));
    // A as the denominator of an output error.
    let arx = folder.fit(&format!("{rows} --na 2 --nb 2 --nk 3 --constant no --focus simulation"));
    let own = parameters(&arx);
    assert_eq!([own[2], own[3], own[0], own[1]], plant[..]);
}

#[test]
fn several_inputs_share_the_poles_of_a_fit_for_simulation() {
    let mut random = Random::new(7);
    let (u1, u2, e) = (random.signal(900), random.signal(900), random.signal(900));
    let noise = response(&[1.0, -0.95], &[], &e);
    let plant = response(&[1.0, -1.5, 0.7], &[(&[0.0, 0.5], &u1), (&[0.0, 0.0, 1.0], &u2)], &vec![0.0; 900]);
    let y: Vec<f64> = plant.iter().zip(&noise).map(|(x, v)| x + 0.5 * v).collect();
    let folder = Folder::with_log(csv(&[("u1", &u1), ("u2", &u2), ("y", &y)]));
    let rows = "log.csv --sample-time 1 -u u1,u2 -y y --estimate 1..600 --validate 601..900";
    let arx = "--na 2 --nb 1,1 --nk 1,2";
    let plain = folder.fit(&format!("{rows} {arx}"));
    let run = folder.fit(&format!("{rows} {arx} --focus simulation"));
    let of = |report: &Value, part: &str| {
        let fits = report["fit"].as_array().into_iter().flatten();
        let mut own = fits.filter(|fit| fit["part"] == part && fit["horizon"]["kind"] == "free-run");
        number(own.next().expect("it is there"), "/percent")
    };
    assert!(of(&run, "estimation") > of(&plain, "estimation") + 1.0);
    let error = |report: &Value| distance(&parameters(report)[..4], &[-1.5, 0.7, 0.5, 1.0]);
    assert!(error(&run) < 0.1 && error(&plain) > 2.0 * error(&run), "{} {}", error(&run), error(&plain));
    assert_eq!(run["estimation"]["plant_first"], true);
    assert!(run["model"]["stable"] == true);
}

#[test]
fn a_number_is_the_horizon_of_the_figure_on_held_out_rows() {
    let folder = folder_with("hair_dryer.csv");
    let rows = "log.csv --estimate 1..500 --validate 501..1000 --na 2 --nb 2 --nk 3";
    let report = folder.fit(&format!("{rows} --focus 5"));
    let plain = folder.fit(rows);
    let [one, five] = figures(&report, "steps")[..] else { panic!("two horizons: {report}") };
    let free = figures(&report, "free-run")[0];
    assert!(one > five && five > free, "{one} {five} {free}");
    assert_eq!(figures(&plain, "steps"), [one]);
    assert_eq!(report["model"], plain["model"]);
}

#[test]
fn a_choice_names_both_winners_and_says_which_was_taken() {
    let folder = folder_with("hair_dryer.csv");
    let auto = folder.fit("log.csv --estimate 1..700");
    let said = words(&auto);
    let selection = &auto["selection"];
    for part in
        ["Best one step ahead: ", "Best free run on held-out blocks: ", "Taken: the best one step ahead, as "]
    {
        assert!(said.contains(part), "{part}: {said}");
    }
    let blocks = |name: &str| number(selection, &format!("/winners/{name}/held_out/blocks"));
    assert!(blocks("simulation") < blocks("prediction"), "{said}");
    let of = |focus: &str| folder.fit(&format!("log.csv --estimate 1..700 --focus {focus}"));
    let (prediction, simulation) = (of("prediction"), of("simulation"));
    assert_eq!(simulation["selection"]["chosen"], selection["winners"]["simulation"]);
    assert_eq!(prediction["selection"]["winners"], Value::Null);
    assert!(simulation["model"]["stable"] == true && auto["model"]["stable"] == true);
}

/// A structure without orders obeys too, and what simulates has its noise behind it.
#[test]
fn the_noise_of_a_plant_that_simulates_is_described_behind_it() {
    let folder = folder_with("hair_dryer.csv");
    let rows = "log.csv --estimate 1..700 --validate 701..1000";
    let report = folder.fit(&format!("{rows} --focus simulation"));
    assert_eq!(report["selection"]["chosen"]["structure"], "oe", "{}", words(&report));
    assert_eq!(report["model"]["structure"], "bj");
    assert!(words(&report).contains("After it an autoregression of order"), "{}", words(&report));
    assert!(figures(&report, "steps")[0] > figures(&report, "free-run")[0]);
    let own = folder.fit(&format!("{rows} --focus simulation --model oe"));
    assert_eq!(own["model"]["structure"], "oe");
    assert_eq!(own["selection"]["focus"], "simulation");
}

#[test]
fn what_makes_no_sense_is_refused() {
    let folder = Folder::with_log(plain_log());
    for (options, words) in [
        ("--na 1 --nb 1 --focus 0", "simulation, or a number of steps"),
        ("--na 1 --nb 1 --focus free", "simulation, or a number of steps"),
        ("--model ar --na 1 --focus simulation", "simulation needs inputs"),
        ("--na 1 --nb 1 --method iv --focus simulation", "leave out the other method"),
        ("--na 1 --nb 1 --norm 1 --focus simulation", "leave out the other method"),
        ("--model general --na 1 --nb 1 --nf 1 --focus simulation", "leave out A"),
    ] {
        let run = folder.run(&format!("fit log.csv {options} --report out.json"));
        assert_eq!(run.code, 2, "{options}: {}", run.stderr);
        assert!(run.stderr.contains(words), "{options}: {}", run.stderr);
        assert!(!folder.path("out.json").exists());
    }
}
