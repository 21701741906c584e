//! Orders that are ranges or are not given: what is compared, what is chosen, and on which rows.

use serde_json::Value;

use crate::fit_reference::{figures, folder_with};
use crate::harness::{Folder, Run, number, parameters};
use crate::signals::{Experiment, Polynomials, Random, csv, plain_log, response};

/// The models of a table of the report: their names and what stands in one field.
fn models(report: &Value, table: &str, field: &str) -> Vec<(Value, f64)> {
    let entries = report["selection"][table].as_array().into_iter().flatten();
    entries.map(|entry| (entry["orders"].clone(), number(entry, field))).collect()
}

fn chosen(report: &Value) -> &Value {
    &report["selection"]["chosen"]["orders"]
}

fn orders(report: &Value) -> Vec<u64> {
    let orders = &report["model"]["orders"];
    let value = |name: &str| orders[name].as_u64().or(orders[name][0].as_u64()).unwrap_or(u64::MAX);
    ["na", "nb", "nc", "nd", "nf", "nk"].map(value).to_vec()
}

/// A log of a plant of second order with some noise: white e, through C/A or C/D.
fn simulated(polynomials: &Polynomials, samples: usize, noise: f64, seed: u64) -> String {
    let mut random = Random::new(seed);
    let u = random.signal(samples);
    let e: Vec<f64> = random.signal(samples).iter().map(|e| noise * e).collect();
    let y = polynomials.outputs(&[&u], &e);
    csv(&[("u", &u), ("y", &y)])
}

#[test]
fn the_delay_of_the_hair_dryer_is_found_on_common_samples() {
    let folder = folder_with("hair_dryer.csv");
    let fit = |nk: &str| folder.fit(&format!("log.csv --estimate 1..500 --na 2 --nb 2 --nk {nk}"));
    for (range, first, expected) in [
        ("1..10", 12, [0.008790, 0.002801, 0.001670, 0.007196, 0.009917]),
        ("1..5", 7, [0.008760, 0.002818, 0.001691, 0.007157, 0.009901]),
    ] {
        let report = fit(range);
        assert_eq!(orders(&report), [2, 2, 0, 0, 0, 3]);
        assert_eq!(number(&report, "/selection/samples"), f64::from(501 - first));
        let found = models(&report, "best", "/mse");
        for (nk, expected) in (1_u64..).zip(expected) {
            let (_, mse) = found.iter().find(|(orders, _)| orders["nk"][0] == nk).unwrap();
            assert!((mse - expected).abs() < 5.1e-7, "nk {nk} of {range}: {mse} {expected}");
        }
        // The model itself sees all rows that it can.
        let alone = fit("3");
        assert_eq!(report["model"], alone["model"]);
        assert_eq!(report["estimation"], alone["estimation"]);
        assert_eq!(alone["selection"], Value::Null);
    }
}

#[test]
fn a_grid_holds_all_models_and_their_criteria() {
    let folder = Folder::with_log(plain_log());
    let report = folder.fit("log.csv --na 1..3 --nb 1..3 --nk 0..2");
    assert_eq!(number(&report, "/selection/models"), 27.0);
    assert_eq!(orders(&report), [2, 2, 0, 0, 0, 1]);
    // The longest regressor reaches max(3, 3 + 2 - 1) samples back.
    let samples = number(&report, "/selection/samples");
    assert_eq!(samples, 196.0);
    let best = models(&report, "best", "/score");
    assert_eq!(best.len(), 27);
    assert!(best.windows(2).all(|pair| pair[0].1 <= pair[1].1));
    assert_eq!(best[0].0, *chosen(&report));
    assert_eq!(best[1].0, report["selection"]["second"]["orders"]);
    // One of each number of parameters, none with a higher score in the table.
    let sizes = report["selection"]["of_size"].as_array().unwrap();
    let counts: Vec<u64> = sizes.iter().map(|entry| entry["parameters"].as_u64().unwrap()).collect();
    assert_eq!(counts, [2, 3, 4, 5, 6]);
    for entry in report["selection"]["best"].as_array().unwrap() {
        let (mse, p) = (number(entry, "/mse"), number(entry, "/parameters"));
        assert!((number(entry, "/score") - (mse.ln() + p * samples.ln() / samples)).abs() < 1e-12);
        let of_size = sizes.iter().find(|size| number(size, "/parameters") == p).unwrap();
        assert!(number(of_size, "/score") <= number(entry, "/score"));
    }
    // Other criteria weigh the same costs otherwise.
    for (select, score) in [
        ("aic", (|mse: f64, p: f64, n: f64| mse.ln() + 2.0 * p / n) as fn(f64, f64, f64) -> f64),
        ("aicc", |mse, p, n| mse.ln() + 2.0 * p / n + 2.0 * p * (p + 1.0) / (n * (n - p - 1.0))),
        ("fpe", |mse, p, n| mse * (n + p) / (n - p)),
    ] {
        let report = folder.fit(&format!("log.csv --na 1..3 --nb 1..3 --nk 0..2 --select {select}"));
        assert_eq!(report["selection"]["select"], select);
        for entry in report["selection"]["best"].as_array().unwrap() {
            let expected = score(number(entry, "/mse"), number(entry, "/parameters"), samples);
            assert!((number(entry, "/score") - expected).abs() < 1e-12, "{select}");
        }
    }
}

#[test]
fn the_best_fifty_of_many_are_kept() {
    let folder = Folder::with_log(Experiment::new(400).csv());
    let report = folder.fit("log.csv --na 1..8 --nb 1..8 --nk 1..2");
    assert_eq!(number(&report, "/selection/models"), 128.0);
    assert_eq!(models(&report, "best", "/mse").len(), 50);
}

#[test]
fn a_path_goes_up_one_order_at_a_time() {
    let folder = Folder::with_log(plain_log());
    let report = folder.fit("log.csv --na 1..3 --nb 1..3 --path alternate");
    let mut found: Vec<(u64, u64)> = models(&report, "best", "/mse")
        .iter()
        .map(|(orders, _)| (orders["na"].as_u64().unwrap(), orders["nb"][0].as_u64().unwrap()))
        .collect();
    found.sort_unstable();
    assert_eq!(found, [(1, 1), (2, 1), (2, 2), (3, 2), (3, 3)]);
    assert_eq!(orders(&report), [2, 2, 0, 0, 0, 1]);
}

#[test]
fn parts_are_cut_in_time_and_the_test_part_is_left_alone() {
    let log = Experiment::new(500).csv();
    let folder = Folder::with_log(&log);
    let report = folder.fit("log.csv --na 1..4 --nb 1..4 --split 60/20/20");
    assert_eq!(report["data"]["split"]["estimation"], serde_json::json!([[1, 300]]));
    assert_eq!(report["data"]["split"]["validation"], serde_json::json!([[301, 400]]));
    assert_eq!(report["data"]["split"]["test"], serde_json::json!([[401, 500]]));
    assert_eq!(report["data"]["estimation"], serde_json::json!([[1, 400]]));
    // The same model as one that was fitted to the first two parts.
    let Value::Number(na) = &chosen(&report)["na"] else { panic!("{report}") };
    let nb = &chosen(&report)["nb"][0];
    let same = folder.fit(&format!("log.csv --na {na} --nb {nb} --estimate 1..400 --validate 401..500"));
    assert_eq!(report["model"], same["model"]);
    for kind in ["steps", "free-run"] {
        let (test, validation) = (figures(&report, "test", kind), figures(&same, "validation", kind));
        assert_eq!(test["percent"], validation["percent"], "{kind}");
        assert_eq!(test["rows"], serde_json::json!([[401, 500]]));
    }
    // Whatever the test part holds, the model is the same.
    let lines: Vec<&str> = log.lines().collect();
    let changed: Vec<String> = lines[401..].iter().map(|line| format!("{line}7")).collect();
    folder.write("other.csv", lines[..401].join("\n") + "\n" + &changed.join("\n"));
    let other = folder.fit("other.csv --na 1..4 --nb 1..4 --split 60/20/20");
    assert_eq!((&other["model"], &other["selection"]), (&report["model"], &report["selection"]));
    assert_ne!(other["fit"], report["fit"]);
    // Orders that are known need no choice; a part that is not wanted has no share.
    let known = folder.fit("log.csv --na 2 --nb 2 --split 80/0/20");
    assert_eq!(known["selection"], Value::Null);
    assert_eq!(known["data"]["split"]["validation"], serde_json::json!([]));
    assert_eq!(figures(&known, "test", "steps")["samples"], 100);
    let all = folder.fit("log.csv --na 2 --nb 2 --split 75/25/0");
    assert_eq!(all["model"], folder.fit("log.csv --na 2 --nb 2")["model"]);
    assert_eq!(*figures(&all, "test", "steps"), Value::Null);
}

#[test]
fn validation_takes_the_smallest_model_within_a_percent_of_the_least() {
    let folder = Folder::with_log(Experiment::new(1000).csv());
    for (select, options) in [("validation", "--split 60/20/20"), ("cv", "")] {
        let report = folder.fit(&format!("log.csv --na 1..5 --nb 1..5 --nk 1 {options} --select {select}"));
        let least = number(&report, "/selection/least/held_out_mse");
        let best = report["selection"]["best"].as_array().unwrap();
        let all = best.iter().map(|entry| (number(entry, "/held_out_mse"), number(entry, "/parameters")));
        let smallest = all.clone().fold(f64::INFINITY, |least, (mse, _)| least.min(mse));
        assert_eq!(least, smallest, "{select}");
        let close = all.filter(|(mse, _)| *mse <= 1.01 * least);
        let fewest = close.fold(f64::INFINITY, |fewest, (_, parameters)| fewest.min(parameters));
        assert_eq!(number(&report, "/selection/chosen/parameters"), fewest, "{select}");
        assert!(number(&report, "/selection/chosen/held_out_mse") <= 1.01 * least, "{select}");
        assert_eq!(orders(&report), [2, 2, 0, 0, 0, 1], "{select}");
    }
}

#[test]
fn without_orders_the_data_choose() {
    let plants = [
        (Polynomials::new(&[-1.5, 0.7], &[0.0, 1.0, 0.5], &[], &[], &[]), "arx", [2, 2, 0, 0, 0, 1]),
        (
            Polynomials::new(&[-1.5, 0.7], &[0.0, 0.0, 1.0, 0.5], &[-1.0, 0.5], &[], &[]),
            "armax",
            [2, 2, 2, 0, 0, 2],
        ),
        (Polynomials::new(&[], &[0.0, 0.0, 0.0, 1.0, 0.5], &[], &[], &[-1.5, 0.7]), "oe", [0, 2, 0, 0, 2, 3]),
    ];
    for (plant, structure, expected) in plants {
        let folder = Folder::with_log(simulated(&plant, 1500, 0.5, 3));
        let report = folder.fit("log.csv");
        assert_eq!(report["model"]["structure"], structure, "{}", report["selection"]["steps"]);
        assert_eq!(orders(&report), expected, "{}", report["selection"]["steps"]);
        // It says what it did, and what came second.
        let steps = report["selection"]["steps"].as_array().unwrap();
        assert!(
            steps.len() >= 2 && steps.iter().all(|step| step.as_str().unwrap().ends_with('.')),
            "{steps:?}"
        );
        assert_ne!(report["selection"]["second"], Value::Null);
        assert_eq!(report["selection"]["delays"][0]["nk"], expected[5]);
        let table = folder.done("fit log.csv").stdout;
        assert!(table.contains("chosen") && table.contains("second"), "{table}");
        // Within a structure, or with a delay that is known.
        let within = folder.fit(&format!("log.csv --model {structure} --nk {}", expected[5]));
        assert_eq!(orders(&within), expected);
    }
}

#[test]
fn a_series_without_inputs_is_left_to_the_data_too() {
    let mut random = Random::new(5);
    let y = response(&[1.0, -1.2, 0.6], &[], &random.signal(1000));
    let folder = Folder::with_log(csv(&[("y", &y)]));
    for line in ["--nb 0", "--model ar"] {
        let report = folder.fit(&format!("log.csv {line}"));
        assert_eq!(orders_of_series(&report), (2, 0), "{line}");
    }
    assert_eq!(folder.fit("log.csv --model ar --na 1..4")["model"]["orders"]["na"], 2);
    // Without a word about inputs they are asked for.
    folder.assert_refused("fit log.csv", 3, "--nb 0");
}

fn orders_of_series(report: &Value) -> (u64, u64) {
    let orders = &report["model"]["orders"];
    (orders["na"].as_u64().unwrap_or(u64::MAX), orders["nc"].as_u64().unwrap_or(u64::MAX))
}

#[test]
fn several_inputs_share_their_orders_or_have_their_own() {
    let mut random = Random::new(9);
    let (u, v) = (random.signal(600), random.signal(600));
    let e: Vec<f64> = random.signal(600).iter().map(|e| 0.1 * e).collect();
    let y = response(&[1.0, -0.7], &[(&[0.0, 1.0], &u), (&[0.0, 0.0, 0.0, 0.5, 0.4], &v)], &e);
    let folder = Folder::with_log(csv(&[("u1", &u), ("u2", &v), ("y", &y)]));
    let shared = folder.fit("log.csv --na 1..2 --nb 1..4 --nk 1");
    assert_eq!(number(&shared, "/selection/models"), 8.0);
    let own = folder.fit("log.csv --na 1..2 --nb 1..2,1..3 --nk 1,1..3");
    assert_eq!(number(&own, "/selection/models"), 36.0);
    assert_eq!(chosen(&own)["nb"], serde_json::json!([1, 2]));
    assert_eq!(chosen(&own)["nk"], serde_json::json!([1, 3]));
    let open = folder.fit("log.csv");
    assert_eq!(open["selection"]["delays"][0]["nk"], 1);
    assert_eq!(open["selection"]["delays"][1]["nk"], 3);
}

#[test]
fn a_search_gives_the_same_bytes_on_any_number_of_threads() {
    let folder = Folder::with_log(plain_log());
    for line in
        ["fit log.csv --format json", "fit log.csv --model armax --na 1..2 --nb 1..2 --nc 1..2 --format json"]
    {
        let reports: Vec<String> = ["1", "2", "7"]
            .iter()
            .map(|threads| {
                let mut command = folder.command(line);
                command.env("RAYON_NUM_THREADS", threads);
                let run = Run::of(command);
                assert_eq!(run.code, 0, "{}", run.stderr);
                run.stdout
            })
            .collect();
        assert!(reports.windows(2).all(|pair| pair[0] == pair[1]), "{line}");
    }
}

#[test]
fn an_order_at_the_end_of_its_range_is_told() {
    let folder = Folder::with_log(plain_log());
    let run = folder.done("fit log.csv --na 1 --nb 1..2 --nk 1");
    assert!(run.stderr.contains("nb is the largest allowed"), "{}", run.stderr);
    assert!(!folder.done("fit log.csv --na 1..3 --nb 1..3").stderr.contains("largest allowed"));
}

#[test]
fn options_that_do_not_go_with_a_choice_are_refused() {
    let folder = Folder::new();
    for (line, part) in [
        ("--na 3..1 --nb 1", "write 1..3"),
        ("--na 1..x --nb 1", "--na: '1..x' is not an order"),
        ("--na 1..1001 --nb 1", "largest order"),
        ("--na 1..1000 --nb 1..1000", "models"),
        ("--na -1..2 --nb 1", "-1"),
        ("--na 2 --nb 2 --select mdl", "--select"),
        ("--na 2 --nb 2 --path alternate", "--path"),
        ("--path alternate", "--path"),
        ("--nk 1..3", "a range of delays"),
        ("--na 1..2 --nb 2 --select validation", "--split"),
        ("--na 1..2 --nb 2 --method iv", "--method"),
        ("--norm 1", "--norm"),
        ("--na 1..2 --nb 2 --ridge 1", "--ridge"),
        ("--na 1..2 --nb 2 --split 60/40", "three shares"),
        ("--na 1..2 --nb 2 --split 0/50/50", "shares"),
        ("--na 1..2 --nb 2 --split 60/20/20 --validate 1..10", "--validate"),
        ("-u a,b --na 1..2 --nb 1..2,1..2,1..2", "--nb: 3 values for 2 inputs"),
    ] {
        let run = folder.run(&format!("fit nowhere.csv {line}"));
        assert_eq!(run.code, 2, "{line}: {}", run.stderr);
        assert!(run.stderr.contains(part), "{line}: {}", run.stderr);
    }
}

#[test]
fn logs_that_serve_no_model_are_refused_in_words() {
    for (log, code) in [
        ("u,y\n", 3),
        ("u,y\n1,2\n", 4),
        ("u,y\n1,2\n2,3\n3,4\n", 4),
        (&("u,y\n".to_owned() + &"1,2\n".repeat(50)), 4),
        (&("u,y\n".to_owned() + &"1,2\n2,2\n".repeat(50)), 4),
        (&("u,y\n".to_owned() + &"nan,2\n".repeat(50)), 3),
        (&("u,y\n".to_owned() + &"1e300,2e300\n-1e300,1e300\n".repeat(50)), 3),
    ] {
        let folder = Folder::with_log(log);
        for line in ["", "--na 1..3 --nb 1..3", "--model oe --nb 1..2 --nf 1..2"] {
            let run = folder.run(&format!("fit log.csv {line} --report model.json"));
            assert_eq!(run.code, code, "{line} {}: {}", &log[..log.len().min(30)], run.stderr);
            assert!(run.refusal().len() > 20 && folder.names() == ["log.csv"]);
        }
    }
    // Few rows are enough for small models.
    let mut random = Random::new(2);
    let u = random.signal(40);
    let y = response(&[1.0, -0.5], &[(&[0.0, 1.0], &u)], &vec![0.0; 40]);
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    let exact = folder.fit("log.csv --detrend none");
    assert_eq!(orders(&exact), [1, 1, 0, 0, 0, 1], "{}", exact["selection"]);
    assert!((parameters(&exact)[0] + 0.5).abs() < 1e-12);
}

/// A plant of more modes than polynomials of the choice have poles for.
#[test]
fn many_modes_make_a_model_in_state_space() {
    let mut random = Random::new(4);
    let (moved, mut y) = (random.signal(500), random.signal(1500));
    y.iter_mut().for_each(|e| *e *= 6.0);
    let u: Vec<f64> = (0..1500).map(|t| moved[t / 3].signum()).collect();
    for (frequency, gain) in [(0.3_f64, 0.3), (0.6, -0.8), (1.0, 1.2), (1.4, -1.0), (1.9, 1.3), (2.4, -0.9)] {
        let mode = response(&[1.0, -1.99 * frequency.cos(), 0.990025], &[(&[0.0, gain], &u)], &[0.0; 1500]);
        y.iter_mut().zip(mode).for_each(|(y, mode)| *y += mode);
    }
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    let rows = "log.csv --estimate 1..1000 --validate 1001..1500";
    let mut report = folder.fit(rows);
    let order = report["selection"]["state_space"]["order"].as_u64().unwrap();
    assert_eq!(report["model"]["kind"], "state-space");
    assert_eq!(report["selection"]["state_space"]["held_out"]["refits"], 3);
    let said = folder.done(&format!("fit {rows} --html page.html"));
    let told = format!("In state space: order {order}, ");
    assert!(said.stdout.contains(&told) && said.stdout.contains("taken instead"), "{}", said.stdout);
    assert!(said.stdout.contains(&format!("state space of order {order}, sample time")), "{}", said.stdout);
    assert!(folder.read("page.html").contains(&format!("state space: order {order}, ")));
    // The report is that of the order.
    let alone = folder.fit(&format!("{rows} --model ss --order {order}"));
    report["selection"] = Value::Null;
    for (name, value) in alone.as_object().unwrap() {
        assert_eq!(&report[name], value, "{name}");
    }
    // Whoever asks for something that it is not gets a polynomial model.
    for asked in ["--focus prediction", "--model oe", "--nk 1", "--select aic", "--initial drop", "--trend"] {
        let report = folder.fit(&format!("{rows} {asked}"));
        assert_eq!(report["model"]["kind"], "polynomial", "{asked}");
        assert_eq!(report["selection"]["state_space"], Value::Null, "{asked}");
    }
}
