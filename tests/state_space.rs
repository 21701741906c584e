//! Models in state space: several outputs, in every verb.

use std::fmt::Write;

use serde_json::Value;

use crate::fit_reference::{folder_with, folder_with_any};
use crate::harness::{Folder, number};
use crate::signals::Random;

const MOTOR: &str = "log.csv --time t -u u -y i,speed";

fn motor() -> Folder {
    Folder::with_log(include_str!("data/dc_motor.csv"))
}

fn fitted() -> Folder {
    let folder = motor();
    folder.done(&format!("fit {MOTOR} --estimate 1..700 --validate 701..1000 --report r.json --html r.html"));
    folder
}

/// The fit of an output at a horizon on a part.
fn percent(document: &Value, output: &str, horizon: &Value, part: Option<&str>) -> f64 {
    let fits = document["fit"].as_array().expect("a list");
    let is_asked = |fit: &&Value| {
        fit["output"] == output && fit["horizon"] == *horizon && fit["part"] == Value::from(part)
    };
    fits.iter().find(is_asked).expect("the figure is there")["percent"].as_f64().expect("a number")
}

fn validated(folder: &Folder, options: &str) -> Value {
    let run = folder.done(&format!("validate r.json log.csv {options} --format json"));
    serde_json::from_str(&run.stdout).expect("JSON")
}

fn ahead(steps: usize) -> Value {
    serde_json::json!({ "kind": "steps", "steps": steps })
}

fn free_run() -> Value {
    serde_json::json!({ "kind": "free-run" })
}

#[test]
fn two_outputs_are_fitted_together() {
    let folder = motor();
    let report = folder.fit(&format!("{MOTOR} --estimate 1..700 --validate 701..1000"));
    assert_eq!(
        (&report["model"]["kind"], &report["estimation"]["method"]),
        (&"state-space".into(), &"subspace".into())
    );
    for output in ["i", "speed"] {
        for horizon in [ahead(1), free_run()] {
            assert!(percent(&report, output, &horizon, Some("validation")) > 90.0, "{output} {horizon}");
        }
    }
    // The same model by name, with the orders that it chose.
    let order = report["estimation"]["orders"].as_array().expect("a list").iter().min_by(|a, b| {
        let mdl = |score: &&Value| score["mdl"].as_f64().unwrap_or(f64::INFINITY);
        mdl(a).total_cmp(&mdl(b))
    });
    let order = order.expect("orders were compared")["order"].as_u64().expect("a number");
    let again =
        folder.fit(&format!("{MOTOR} --estimate 1..700 --validate 701..1000 --model ss --order {order}"));
    assert_eq!(again["model"], report["model"]);
    // One output goes the same way.
    let one = folder.fit("log.csv --time t -u u -y speed --model ss --order 1..5 --past 10 --feedthrough no");
    assert_eq!((number(&one, "/estimation/past"), &one["estimation"]["feedthrough"]), (10.0, &false.into()));
    assert!(percent(&one, "speed", &ahead(1), Some("estimation")) > 98.0);
    // The classical methods find the same plant.
    for weighting in ["moesp", "n4sid", "cva"] {
        let other = folder.fit(&format!("{MOTOR} --order 3 --past 10 --weighting {weighting}"));
        assert_eq!(other["estimation"]["weighting"], weighting);
        assert!(percent(&other, "speed", &free_run(), Some("estimation")) > 95.0, "{weighting}");
    }
    // A series has no inputs.
    let series = folder.fit("log.csv --time t -y i,speed --nb 0");
    assert_eq!(series["model"]["inputs"], serde_json::json!([]));
    assert!(percent(&series, "speed", &ahead(1), Some("estimation")) > 90.0);
}

#[test]
fn every_verb_takes_its_report() {
    let folder = fitted();
    let table = folder.run(&format!("fit {MOTOR} --estimate 1..700")).stdout;
    for word in
        ["state space of order", "singular value", "DC gain from", "to speed", "innovations of", "free run"]
    {
        assert!(table.contains(word), "{word}: {table}");
    }
    let report: Value = serde_json::from_str(&folder.read("r.json")).expect("JSON");
    // A validation has the figures of the fit.
    let validation = validated(&folder, "--time t --rows 701..1000 --html v.html");
    for output in ["i", "speed"] {
        for horizon in [ahead(1), free_run()] {
            let fitted = percent(&report, output, &horizon, Some("validation"));
            let found = percent(&validation, output, &horizon, None);
            assert_eq!(fitted.to_bits(), found.to_bits());
        }
    }
    folder.done("predict r.json log.csv --time t --rows 701..1000 --horizon 5 --out p.csv");
    assert!(
        folder.read("p.csv").starts_with("time,measured_i,predicted_i,standard_deviation_i,measured_speed,")
    );
    folder.done("simulate r.json log.csv --time t --out s.csv");
    assert!(folder.read("s.csv").starts_with("time,measured_i,predicted_i,measured_speed,predicted_speed"));
    folder.done("bode r.json --points 5 --out b.csv");
    let bode = folder.read("b.csv");
    assert!(bode.starts_with("output,input,frequency,") && bode.lines().count() == 11, "{bode}");
    folder.done("step r.json --samples 200 --out st.csv --html st.html");
    let steps = folder.read("st.csv");
    let last = steps.lines().last().expect("rows").split(',').nth(3).expect("a value");
    let gain = number(&report, "/model/dc_gain/1/0/value");
    assert!((last.parse::<f64>().expect("a number") / gain - 1.0).abs() < 0.1, "{last} {gain}");
    folder.done("impulse r.json --out i.csv");
    let states = folder.done("filter r.json log.csv --time t --format csv --out f.csv");
    assert!(folder.read("f.csv").contains("x1") && states.code == 0);
    folder.done(&format!("fit {MOTOR} --estimate 1..700 --narx poly --degree 1 --terms 5 --report n.json"));
    folder.done("compare r.json n.json log.csv --time t --rows 701..1000 --html c.html");
    for page in ["r.html", "v.html", "st.html", "c.html"] {
        let page = folder.read(page);
        assert!(page.contains("speed"), "{}", page.len());
    }
    assert!(
        folder.read("r.html").contains("Singular values")
            && folder.read("r.html").contains("Choice of the order")
    );
}

#[test]
fn a_filter_that_knows_all_outputs_predicts_as_the_model_does() {
    let folder = fitted();
    folder.done("predict r.json log.csv --time t --horizon 1 --initial zero --out p.csv");
    folder.done("filter r.json log.csv --time t --initial zero --format csv --out f.csv");
    let column = |file: &str, name: &str| -> Vec<f64> {
        let text = folder.read(file);
        let mut lines = text.lines();
        let place =
            lines.next().expect("a header").split(',').position(|own| own == name).expect("the column");
        lines.map(|line| line.split(',').nth(place).expect("a cell").parse().unwrap_or(f64::NAN)).collect()
    };
    for name in ["predicted_i", "predicted_speed"] {
        let (own, filtered) = (column("p.csv", name), column("f.csv", name));
        let apart = own.iter().zip(&filtered).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(own.len() == 1000 && apart < 1e-6, "{name}: {apart}");
    }
}

/// The log of the motor without the current in every fifth row, without both outputs in rows 401 to 410, and without
/// the speed in the last ten and the current in the last five.
fn with_holes() -> String {
    let mut lines = include_str!("data/dc_motor.csv").lines();
    let header: Vec<&str> = lines.next().expect("a header").split(',').collect();
    let place = |name: &str| header.iter().position(|column| *column == name).expect("the column");
    let (current, speed) = (place("i"), place("speed"));
    let mut text = header.join(",");
    for (row, line) in (1..).zip(lines) {
        let mut cells: Vec<&str> = line.split(',').collect();
        if row % 5 == 0 || (401..=410).contains(&row) || row > 995 {
            cells[current] = "";
        }
        if (401..=410).contains(&row) || row > 990 {
            cells[speed] = "";
        }
        text.push('\n');
        text.push_str(&cells.join(","));
    }
    text
}

#[test]
fn predictions_go_on_through_missing_outputs() {
    let folder = fitted();
    folder.write("holes.csv", with_holes());
    let columns = |options: &str| -> Vec<Vec<f64>> {
        let run = folder.done(&format!("predict r.json {options} --time t"));
        let rows = run.stdout.lines().skip(1);
        rows.map(|line| line.split(',').map(|cell| cell.parse().unwrap_or(f64::NAN)).collect()).collect()
    };
    let (whole, holes) = (columns("log.csv"), columns("holes.csv"));
    assert_eq!((whole.len(), holes.len()), (1000, 1000));
    // The time, then for each output what was measured, what was predicted, and the deviation.
    let (current, speed) = (2, 5);
    // The last current is that of row 994; the row after it is forecast.
    for (row, cells) in holes.iter().enumerate() {
        assert!([current, speed].iter().all(|place| cells[*place].is_finite() == (row < 995)), "{row}");
    }
    for row in [300, 404, 994] {
        let [whole, holes] = [&whole, &holes].map(|rows| &rows[row]);
        for place in [current, speed] {
            // Where less is known deviations are larger, and predictions near.
            let deviation = holes[place + 1];
            assert!(deviation >= whole[place + 1], "{row}");
            assert!((holes[place] - whole[place]).abs() < 3.0 * deviation, "{row}");
        }
        assert!(holes[speed + 1] > whole[speed + 1], "{row}");
    }
    let run = folder.done("validate r.json holes.csv --time t --format json");
    let validation: Value = serde_json::from_str(&run.stdout).expect("JSON");
    for (output, samples) in [("i", 788.0), ("speed", 980.0)] {
        let fits = validation["fit"].as_array().expect("a list");
        let own = fits.iter().find(|fit| fit["output"] == output && fit["horizon"] == ahead(1));
        let own = own.expect("the figure is there");
        assert_eq!(number(own, "/samples"), samples, "{output}");
        assert!(number(own, "/percent") > 97.0, "{output}");
    }
    assert!(validation["portmanteau"]["p_value"].is_number());
}

#[test]
fn requirements_may_be_of_one_output() {
    let folder = fitted();
    let line = "validate r.json log.csv --time t --rows 701..1000";
    folder.done(&format!("{line} --require fit[speed]>=90 --require stable --require coverage[i]>=80"));
    let unmet = folder.run(&format!("{line} --require fit[speed]>=99.99 --require fit>=1"));
    assert!(unmet.code != 0 && unmet.stderr.contains("fit[speed]>=99.99: the fit is"), "{unmet:?}");
    let unknown = folder.run(&format!("{line} --require fit[torque]>=1"));
    assert!(unknown.code != 0 && unknown.stderr.contains("no output 'torque'"), "{unknown:?}");
}

#[test]
fn what_other_models_have_is_refused() {
    let folder = motor();
    for (options, word) in [
        ("--model ss --na 2", "--na: does not work with --model ss"),
        ("--model ss --method iv", "--method"),
        ("--model ss --search newton", "--search"),
        ("--model ss --ridge 1", "--ridge"),
        ("--model ss --order 0", "--order: "),
        ("--model ss --order 5..2", "--order: 5..2"),
        ("--model ss --nk x", "--nk: 'x'"),
        ("--model ss --weighting pem", "--weighting"),
        ("--weighting cva", "--model ss"),
        ("--model ss --nk 0 --feedthrough no", "--nk: 0"),
        ("--model ss --nk 1,2", "--nk: 2 numbers for 1 inputs"),
        ("--model arx --order 2", "--order: does not work with --model arx"),
        ("--past 4", "--model ss"),
    ] {
        let refusal = folder.run(&format!("fit log.csv --time t -u u -y speed {options}"));
        assert!(refusal.code == 2 && refusal.stderr.contains(word), "{options}: {refusal:?}");
    }
    let several = folder.run(&format!("fit {MOTOR} --na 2 --nb 2 --nc 1"));
    assert!(several.code == 2 && several.stderr.contains("--nc"), "{several:?}");
}

#[test]
fn logs_that_say_too_little_are_refused() {
    let folder = motor();
    let mut short = "u,y1,y2\n".to_owned();
    for row in 0..12 {
        writeln!(short, "{},{},{}", row % 3, row % 5, row % 7).expect("memory");
    }
    folder.write("short.csv", short);
    let refusal = folder.run("fit short.csv -u u -y y1,y2 --sample-time 1 --past 5 --report r.json");
    assert!(refusal.code == 4 && refusal.stderr.contains("more samples than signals"), "{refusal:?}");
    let (mut dependent, mut random, mut x) = ("u,y1,y2,y3\n".to_owned(), Random::new(1), 0.0);
    for _ in 0..300 {
        let (u, y) = (random.uniform(), x + 0.1 * random.uniform());
        x = 0.8 * x + u;
        writeln!(dependent, "{u},{y},{},4", 2.0 * y + 1.0).expect("memory");
    }
    folder.write("dependent.csv", dependent);
    let found = folder.done("fit dependent.csv -u u -y y1,y2 --sample-time 1");
    assert!(
        found.stderr.contains("'y2' is known from 'y1'") && found.stdout.contains("order 1,"),
        "{found:?}"
    );
    let refusal = folder.run("fit dependent.csv -u u -y y1,y3 --sample-time 1 --report r.json");
    assert!(refusal.code == 4 && refusal.stderr.contains("'y3' is constant"), "{refusal:?}");
    folder.write("huge.csv", "u,y1,y2\n1,2e200,1\n3,-1e200,4\n2,7e200,1\n5,1,2\n");
    folder.assert_refused(
        "fit huge.csv -u u -y y1,y2 --sample-time 1 --report r.json",
        3,
        "squares of 'y1' leave the range of numbers",
    );
    assert!(!folder.names().contains(&"r.json".to_owned()));
}

#[test]
fn states_that_matter_least_are_left_out() {
    let folder = motor();
    folder.done(&format!("fit {MOTOR} --order 4 --report r.json"));
    let table = folder.done("reduce r.json").stdout;
    assert!(table.contains("Hankel singular value") && table.lines().count() > 5, "{table}");
    let reduced = folder.done("reduce r.json --order 2 --out s.json");
    assert!(reduced.stderr.contains("reduced from 4 to 2 states"), "{reduced:?}");
    let fit = |report: &str| {
        let run = folder.done(&format!("validate {report} log.csv --time t --format json"));
        percent(&serde_json::from_str(&run.stdout).expect("JSON"), "speed", &free_run(), None)
    };
    assert!(fit("s.json") > fit("r.json") - 3.0, "{} {}", fit("s.json"), fit("r.json"));
    // Polynomials have a recursion too; equations keep their own states.
    folder.done("fit log.csv --time t -u u -y speed --na 4 --nb 4 --report p.json");
    folder.done("reduce p.json --order 2 --out q.json");
    folder.done("predict q.json log.csv --time t --out p.csv");
    folder.done("fit log.csv --time t -u u -y speed --narx poly --report n.json");
    folder.assert_refused("reduce n.json", 3, "states are left out of models in state space");
    folder.assert_refused("reduce r.json --order 9 --out x.json", 2, "--order");
    assert!(!folder.names().contains(&"x.json".to_owned()));
}

/// Logs whose licence is not clear: with the figures that SIPPY and ControlSystemIdentification.jl reach.
#[test]
fn public_logs_are_predicted_as_well_as_by_others() {
    let mean = |document: &Value, horizon: &Value, part: Option<&str>, outputs: &[&str]| {
        let sum: f64 = outputs.iter().map(|output| percent(document, output, horizon, part)).sum();
        sum / outputs.len() as f64
    };
    for (name, options, outputs, rows, demanded) in [
        // Measured in closed loop, and the arm acts within a sample.
        ("cd_player_arm", "--split 50/0/50 --feedthrough yes", vec!["y1", "y2"], "1025..2048", [94.8, 84.3]),
        (
            "evaporator",
            "--estimate 1..3300 --detrend none --order 8 --past 20",
            vec!["y1", "y2", "y3"],
            "3301..6305",
            [79.3, 73.7],
        ),
    ] {
        let Some(folder) = folder_with_any(&format!("{name}.csv")) else { continue };
        folder
            .done(&format!("fit log.csv -y {} --sample-time 1 {options} --report r.json", outputs.join(",")));
        let found = validated(&folder, &format!("--sample-time 1 --rows {rows} --horizon 5"));
        for (steps, demanded) in [1, 5].into_iter().zip(demanded) {
            let reached = mean(&found, &ahead(steps), None, &outputs);
            assert!(reached >= demanded, "{name}, {steps} steps: {reached} of {demanded}");
        }
    }
}

#[test]
fn refined_models_have_standard_errors_everywhere() {
    let folder = motor();
    for (refine, horizon) in [("prediction", ahead(1)), ("simulation", free_run())] {
        let plain = folder.fit(&format!("{MOTOR} --order 2"));
        let refined = folder.fit(&format!("{MOTOR} --order 2 --refine {refine}"));
        let search = &refined["estimation"]["refinement"]["search"];
        assert_eq!(search["stopped"], "converged", "{search}");
        let costs = search["costs"].as_array().expect("a list");
        assert!(costs.last().and_then(Value::as_f64) <= costs[0].as_f64());
        for output in ["i", "speed"] {
            let [plain, refined] =
                [&plain, &refined].map(|report| percent(report, output, &horizon, Some("estimation")));
            assert!(refined > plain - 0.05, "{refine} {output}: {plain} {refined}");
        }
        let model = &refined["model"];
        // n (m + 2 l) entries vary.
        assert_eq!(model["covariance"]["entries"].as_array().expect("a list").len(), 2 * (1 + 4));
        assert!(model["dc_gain"][1][0]["standard_error"].as_f64() > Some(0.0));
        assert!(model["poles"][0]["covariance"][0][0].as_f64() > Some(0.0));
    }
    let run =
        folder.done(&format!("fit {MOTOR} --order 2 --refine prediction --report r.json --html r.html"));
    assert!(run.stdout.contains("refined for the least errors of predictions one step ahead"), "{run:?}");
    assert!(run.stdout.contains("pole      standard error  modulus"), "{run:?}");
    // The last column but one of what is said of magnitudes, and the last of steps.
    let errors = |line: &str, column: usize| -> Vec<Option<f64>> {
        let run = folder.done(line);
        run.stdout.lines().skip(1).map(|row| row.split(',').nth(column)?.parse().ok()).collect()
    };
    for (verb, column) in [("bode", 4), ("step", 4), ("impulse", 4)] {
        let found = errors(&format!("{verb} r.json"), column);
        assert!(found.len() > 20 && found.iter().all(Option::is_some), "{verb}: {found:?}");
    }
    // Fewer states are another model.
    folder.done("reduce r.json --order 1 --out s.json");
    assert!(errors("bode s.json", 4).iter().all(Option::is_none));
    let series = folder.run("fit log.csv --time t -y i,speed --nb 0 --refine simulation");
    assert!(series.code == 2 && series.stderr.contains("without inputs there is no free run"), "{series:?}");
    for (options, word) in [
        ("--refine both", "--refine"),
        ("--search newton", "--search: it is for a search; give --refine too"),
        ("--refine prediction --starts 3", "--starts: does not work with several outputs"),
        ("--refine prediction --tolerance 0", "--tolerance"),
    ] {
        let refusal = folder.run(&format!("fit {MOTOR} {options}"));
        assert!(refusal.code == 2 && refusal.stderr.contains(word), "{options}: {refusal:?}");
    }
}

/// Subspace methods start far from the least errors of a free run, or are unstable there.
#[test]
fn a_model_of_one_output_is_refined_from_polynomials_too() {
    for (file, order, largest) in [("hair_dryer.csv", 6, 0.00490), ("robot_arm.csv", 6, 6.0e-5)] {
        let folder = folder_with(file);
        let options = format!("log.csv --sample-time 1 -u u -y y --model ss --order {order}");
        let report = folder.fit(&format!("{options} --refine simulation"));
        let start = &report["estimation"]["refinement"]["search"]["start"];
        assert_eq!(start, "output-error", "{file}");
        let fits = report["fit"].as_array().expect("a list");
        let run = fits.iter().find(|fit| fit["horizon"] == free_run()).expect("a free run");
        let rmse = run["rmse"].as_f64().expect("a number");
        assert!(rmse * rmse <= largest, "{file}: {}", rmse * rmse);
    }
}

#[test]
fn an_arx_model_has_several_outputs() {
    let folder = motor();
    let report = folder.fit(&format!("{MOTOR} --na 1..4 --nb 1..4 --estimate 1..700 --validate 701..1000"));
    let found = &report["estimation"];
    assert_eq!((&found["method"], &report["model"]["kind"]), (&"vector-arx".into(), &"state-space".into()));
    assert_eq!(found["tried"].as_array().map(Vec::len), Some(32));
    let (na, nb) = (number(&report, "/estimation/na"), number(&report, "/estimation/nb/0"));
    for output in ["i", "speed"] {
        assert!(percent(&report, output, &free_run(), Some("validation")) > 90.0, "{output} {na} {nb}");
    }
    // One model of these has the figures of the choice.
    let again = folder.fit(&format!(
        "{MOTOR} --model arx --na {na} --nb {nb} --couple {} --estimate 1..700",
        found["coupling"].as_str().expect("a word")
    ));
    let entry = number(&again, "/estimation/a/0/0/0/value");
    assert!((entry - number(&report, "/estimation/a/0/0/0/value")).abs() < 0.05, "{entry}");
    assert_eq!(again["estimation"]["tried"].as_array().map(Vec::len), Some(0));
    let table = folder
        .done(&format!("fit {MOTOR} --model arx --couple none --na 2 --nb 2 --report r.json --html r.html"));
    assert!(table.stdout.contains("A diagonal") && table.stdout.contains("equation of speed"), "{table:?}");
    for line in [
        "predict r.json log.csv --time t --horizon 5 --out p.csv",
        "simulate r.json log.csv --time t --out s.csv",
        "filter r.json log.csv --time t --out f.csv",
        "validate r.json log.csv --time t --html v.html",
        "compare r.json log.csv --time t",
        "bode r.json",
        "step r.json",
        "reduce r.json --order 2 --out q.json",
    ] {
        folder.done(line);
    }
    // Coefficients that were taken out of a report are not shown, and no harm.
    let mut damaged: Value = serde_json::from_str(&folder.read("r.json")).expect("JSON");
    damaged["estimation"]["a"] = serde_json::json!([[]]);
    damaged["estimation"]["nk"] = serde_json::json!([u64::MAX]);
    folder.write("d.json", damaged.to_string());
    folder.done("validate d.json log.csv --time t --html d.html");
    // What is explained exactly is fitted too.
    let mut exact = "u,y1,y2\n".to_owned();
    let mut x = [0.0, 0.0];
    for row in 0..200 {
        let u = f64::from(row * row % 11) - 5.0;
        writeln!(exact, "{u},{},{}", x[0], x[1]).expect("memory");
        x = [0.8 * x[0] + 0.3 * x[1] + u, 0.5 * x[1] - 0.2 * x[0] + 0.4 * u];
    }
    folder.write("exact.csv", exact);
    folder.done("fit exact.csv -y y1,y2 --sample-time 1 --na 1..2 --nb 1..2 --report e.json");
    folder.assert_refused(
        &format!("fit {MOTOR} --na 2 --nb 2 --nk 5000 --report x.json"),
        4,
        "no segment is longer than the delays",
    );
    // An input that waits is known to.
    let waits = folder.fit(&format!("{MOTOR} --na 2 --nb 2 --nk 3"));
    assert_eq!(waits["estimation"]["nk"], serde_json::json!([3]));
    // Among delays the data choose, with the orders.
    let chosen = folder.fit(&format!("{MOTOR} --na 1..3 --nb 1..3 --nk 0..4"));
    assert_eq!(chosen["estimation"]["tried"].as_array().map(Vec::len), Some(3 * 3 * 5 * 2));
    let nk = chosen["estimation"]["nk"][0].as_u64().expect("a delay");
    let again = folder.fit(&format!(
        "{MOTOR} --na {} --nb {} --nk {nk} --couple {}",
        chosen["estimation"]["na"],
        chosen["estimation"]["nb"][0],
        chosen["estimation"]["coupling"].as_str().expect("a word")
    ));
    // They differ by the rows that are left over at the start.
    let first = |report: &Value| number(report, "/estimation/b/0/0/0/value");
    assert!((first(&again) - first(&chosen)).abs() < 1e-3 * first(&chosen).abs());
    for (options, word) in [
        ("--na 2 --nb 2 --nk 1..900", "--nk: 1..900"),
        ("--na 2 --nb 2 --nk 3..1", "--nk: '3..1'"),
        ("--model ss --nk 1..2", "a range is for all inputs of an ARX model"),
    ] {
        folder.assert_refused(&format!("fit {MOTOR} {options}"), 2, word);
    }
    assert_eq!(waits["model"]["delays"], serde_json::json!([2]));
    for (options, word) in [
        ("--couple some --na 1", "--couple"),
        ("--na 2 --nb 1,2", "--nb: 2 numbers for 1 inputs"),
        ("--na 999", "--na: 999"),
        ("--na 0 --nb 1..2,1", "--nb"),
        ("--na 2 --order 3", "--order: does not work with several outputs"),
        ("--na 2 --refine prediction", "--refine: does not work with several outputs"),
        ("--na 2 --ridge 1", "--ridge: does not work with several outputs"),
    ] {
        let refusal = folder.run(&format!("fit {MOTOR} {options}"));
        assert!(refusal.code == 2 && refusal.stderr.contains(word), "{options}: {refusal:?}");
    }
    let refusal = folder.run("fit log.csv --time t -u u -y i --na 2 --nb 2 --couple full");
    assert!(
        refusal.code == 2 && refusal.stderr.contains("--couple: it is for --model arx with several outputs"),
        "{refusal:?}"
    );
    let refusal =
        folder.refused(&format!("fit {MOTOR} --na 150 --nb 150 --estimate 1..300 --report x.json"), 4);
    assert!(refusal.contains("lower orders") && !folder.names().contains(&"x.json".to_owned()), "{refusal}");
}

/// The figures that a least-squares fit of all rows has.
#[test]
fn the_evaporator_has_the_coefficients_that_others_find() {
    let Some(folder) = folder_with_any("evaporator.csv") else { return };
    folder.done(
        "fit log.csv -y y1,y2,y3 --sample-time 1 --model arx --na 2 --nb 2 --nk 1 --couple full --detrend none --report r.json",
    );
    let report: Value = serde_json::from_str(&folder.read("r.json")).expect("JSON");
    for (place, expected) in [-0.516213, -0.706059, -0.868360].into_iter().enumerate() {
        let found = number(&report, &format!("/estimation/a/0/{place}/{place}/value"));
        assert!((found - expected).abs() < 1e-6, "{found}");
    }
    let (samples, degrees) =
        (number(&report, "/estimation/samples"), number(&report, "/model/degrees_of_freedom"));
    for (place, expected) in [0.06742262, 0.23212252, 0.02445426].into_iter().enumerate() {
        let found = number(&report, &format!("/model/noise_covariance/{place}/{place}")) * degrees / samples;
        assert!((found - expected).abs() < 1e-8, "{found}");
    }
    assert_eq!(samples, 6303.0);
    // ln det cov e = AIC less its 2 p/N.
    let logarithm = number(&report, "/estimation/aic") - 2.0 * 36.0 / samples;
    assert!((logarithm + 7.939704).abs() < 1e-6, "{logarithm}");
}
