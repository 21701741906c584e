//! Models with C, D or F: values that other programs found, and what must hold whatever the data.

use serde_json::{Value, json};

use crate::fit_reference::{assert_mse, assert_parameters, folder_with, folder_with_any};
use crate::harness::{Folder, distance, names, number, numbers, parameters};
use crate::signals::{Experiment, Polynomials, Random, csv};

const HAIR_DRYER: &str = "log.csv --sample-time 0.08 --estimate 1..500 --nk 3 --tolerance 1e-14";

#[test]
fn hair_dryer_armax() {
    let folder = folder_with("hair_dryer.csv");
    let report = folder.fit(&format!("{HAIR_DRYER} --model armax --na 2 --nb 2 --nc 2"));
    assert_parameters(&report, &[-1.3090716, 0.4263831, 0.0659772, 0.0411418, -0.3686687, 0.0937665]);
    assert_mse(&report, 0.0015127097);
    assert_eq!(report["estimation"]["initial"], "drop");
    assert_eq!(number(&report, "/estimation/samples"), 496.0);
}

#[test]
fn hair_dryer_output_error_from_zero_and_from_an_estimated_start() {
    let folder = folder_with("hair_dryer.csv");
    let oe = format!("{HAIR_DRYER} --model oe --nb 2 --nf 2");
    let zero = folder.fit(&format!("{oe} --initial zero"));
    assert_parameters(&zero, &[0.0665648, 0.0480111, -1.2638546, 0.3876707]);
    assert_mse(&zero, 0.0084633813);
    let fits = zero["fit"].as_array().unwrap();
    let fit = fits.iter().find(|fit| fit["horizon"]["kind"] == "steps").unwrap();
    assert_eq!(fit["initial"], "zero");
    assert!((number(fit, "/percent") - 89.012).abs() < 5.1e-4, "{fit}");

    let estimate = folder.fit(&format!("{oe} --initial estimate"));
    for (found, expected) in
        parameters(&estimate).into_iter().zip([0.0664883, 0.0479542, -1.264574, 0.388293])
    {
        assert!((found / expected - 1.0).abs() < 1e-5, "{found} {expected}");
    }
    assert!((number(&estimate, "/estimation/mse") / 0.00842128 - 1.0).abs() < 1e-6);
    // The start is worth less than its parameters.
    let auto = folder.fit(&oe);
    assert_eq!(auto["estimation"]["initial"], "zero");
    assert!(distance(&parameters(&auto), &parameters(&zero)) < 1e-7);
}

#[test]
fn hair_dryer_box_jenkins() {
    let folder = folder_with("hair_dryer.csv");
    let report = folder.fit(&format!("{HAIR_DRYER} --model bj --nb 2 --nc 2 --nd 2 --nf 2 --initial zero"));
    let expected =
        [0.0664333, 0.0409323, 0.5919993, -0.0348845, -0.3478476, -0.5181562, -1.3100212, 0.4296684];
    assert_parameters(&report, &expected);
    assert_mse(&report, 0.0014707382);
}

#[test]
fn gas_furnace_of_box_and_jenkins() {
    let folder = folder_with("gas_furnace.csv");
    let report =
        folder.fit("log.csv --model bj --nb 3 --nk 3 --nf 1 --nc 0 --nd 2 --initial zero --tolerance 1e-14");
    assert_eq!(names(&report), ["b3", "b4", "b5", "d1", "d2", "f1"]);
    assert_parameters(&report, &[-0.5315176, -0.3798226, -0.5173056, -1.5286273, 0.6295391, -0.5491927]);
    assert_mse(&report, 0.056876983);
}

#[test]
fn exchanger_armax() {
    let Some(folder) = folder_with_any("exchanger.csv") else { return };
    let report =
        folder.fit("log.csv --model armax --na 2 --nb 2 --nc 2 --estimate 1..2000 --tolerance 1e-14");
    assert_parameters(&report, &[-1.5800034, 0.6382525, 0.0397256, -1.0872439, -0.4219005, -0.4084894]);
    assert_mse(&report, 0.10442014);
}

#[test]
fn sunspots_have_a_moving_average() {
    let folder = folder_with("sunspots.csv");
    let log = "log.csv -y y --tolerance 1e-14";
    let ar = folder.fit("log.csv -y y --model ar --na 2");
    assert_eq!(ar["model"]["structure"], "ar");
    assert_eq!(parameters(&ar), parameters(&folder.fit("log.csv -y y --na 2 --nb 0")));
    // The exact likelihood of another tool; least squares on 307 samples is near it.
    assert!(distance(&parameters(&ar), &[-1.390633, 0.688573]) < 0.01, "{:?}", parameters(&ar));
    let arma = folder.fit(&format!("{log} --model arma --na 2 --nc 1"));
    assert_eq!(arma["model"]["structure"], "arma");
    assert_eq!(names(&arma), ["a1", "a2", "c1"]);
    assert!(number(&arma, "/estimation/mse") < number(&ar, "/estimation/mse"));
    assert_eq!(arma["model"]["inputs"], json!([]));
    assert_eq!(arma["fit"].as_array().unwrap().len(), 1);
}

/// A log that a model made, its columns u (and u2) and y, from rest; and the options that say the model's orders.
struct Case {
    truth: Polynomials,
    inputs: Vec<Vec<f64>>,
    y: Vec<f64>,
    options: &'static str,
}

impl Case {
    fn new(truth: Polynomials, samples: usize, noise: f64, options: &'static str) -> Self {
        let mut random = Random::new(21);
        let inputs: Vec<Vec<f64>> = truth.b.iter().map(|_| random.signal(samples)).collect();
        let e: Vec<f64> = random.signal(samples).iter().map(|e| noise * e).collect();
        let views: Vec<&[f64]> = inputs.iter().map(Vec::as_slice).collect();
        let y = truth.outputs(&views, &e);
        Self { y, inputs, truth, options }
    }

    fn folder(&self) -> Folder {
        let names = ["u1", "u2"];
        let inputs = names.iter().copied().zip(self.inputs.iter().map(Vec::as_slice));
        let columns: Vec<(&str, &[f64])> = inputs.chain([("y", self.y.as_slice())]).collect();
        Folder::with_log(csv(&columns))
    }

    /// The mean of e^2 by the definition, with zeros before the first sample.
    fn cost(&self, polynomials: &Polynomials) -> f64 {
        let inputs: Vec<&[f64]> = self.inputs.iter().map(Vec::as_slice).collect();
        let errors = polynomials.errors(&inputs, &self.y);
        errors.iter().map(|e| e * e).sum::<f64>() / errors.len() as f64
    }
}

/// One of every structure that needs a search.
fn cases(samples: usize, noise: f64) -> Vec<Case> {
    let case = |truth, options| Case::new(truth, samples, noise, options);
    let f = &[-1.5, 0.7];
    let mut two = Polynomials::new(&[], &[0.0, 1.0, 0.4], &[0.5], &[-0.8], f);
    two.b.push(vec![0.0, 0.0, -0.7]);
    two.f.push(vec![1.0, -0.6]);
    vec![
        case(
            Polynomials::new(f, &[0.0, 1.0, 0.4], &[-0.6, 0.2], &[], &[]),
            "--model armax --na 2 --nb 2 --nc 2",
        ),
        case(Polynomials::new(&[], &[0.0, 1.0, 0.4], &[], &[], f), "--model oe --nb 2 --nf 2"),
        case(
            Polynomials::new(&[], &[0.0, 0.0, 1.0], &[0.5], &[-0.8], f),
            "--model bj --nb 1 --nc 1 --nd 1 --nf 2 --nk 2",
        ),
        case(two, "--model bj --nb 2,1 --nc 1 --nd 1 --nf 2,1 --nk 1,2"),
        case(
            Polynomials::new(&[-0.7], &[1.0, 0.4], &[0.5], &[], &[0.5]),
            "--model general --na 1 --nb 2 --nc 1 --nf 1 --nk 0",
        ),
        case(
            Polynomials::new(&[-0.7], &[0.0, 1.0], &[], &[0.6], &[]),
            "--model general --na 1 --nb 1 --nd 1",
        ),
    ]
}

/// The polynomials of a report.
fn polynomials(report: &Value) -> Polynomials {
    let model = &report["model"];
    let list = |name: &str| model[name].as_array().into_iter().flatten().map(numbers).collect();
    let one = |name: &str| numbers(&model[name]);
    Polynomials { a: one("a"), b: list("b"), c: one("c"), d: one("d"), f: list("f") }
}

#[test]
fn noise_free_data_give_the_polynomials_back() {
    for case in cases(300, 0.0).into_iter().filter(|case| case.options.contains("--model oe")) {
        let report = case.folder().fit(&format!("log.csv --detrend none {} --initial zero", case.options));
        let found = polynomials(&report);
        assert!(distance(&found.b[0], &case.truth.b[0]) < 1e-8, "{:?}", found.b);
        assert!(distance(&found.f[0], &case.truth.f[0]) < 1e-8, "{:?}", found.f);
    }
}

#[test]
fn the_truth_lies_within_five_standard_errors() {
    for case in cases(4000, 0.3) {
        let report = case.folder().fit(&format!("log.csv --detrend none {} --initial zero", case.options));
        let (found, truth) = (polynomials(&report), &case.truth);
        let values = |p: &Polynomials| {
            let all = [&p.a].into_iter().chain(&p.b).chain([&p.c, &p.d]).chain(&p.f);
            // Neither the leading 1 nor the delay is estimated, and the same in both.
            all.flatten().copied().collect::<Vec<f64>>()
        };
        let mut errors =
            report["model"]["parameters"].as_array().unwrap().iter().map(|p| number(p, "/standard_error"));
        for (found, truth) in values(&found).into_iter().zip(values(truth)) {
            if found == truth {
                continue;
            }
            let error = errors.next().unwrap();
            assert!((found - truth).abs() < 5.0 * error, "{}: {found} {truth} {error}", case.options);
        }
        assert_eq!(errors.next(), None, "{}", case.options);
        assert_eq!(report["estimation"]["stopped"], "converged", "{}", case.options);
        assert_eq!(report["warnings"], json!([]), "{}", case.options);
    }
}

#[test]
fn what_is_found_is_a_minimum_of_the_cost_by_its_definition() {
    for case in cases(300, 0.5) {
        let line = format!("log.csv --detrend none {} --initial zero --tolerance 1e-13", case.options);
        let report = case.folder().fit(&line);
        let best = polynomials(&report);
        let cost = case.cost(&best);
        assert!((number(&report, "/estimation/mse") / cost - 1.0).abs() < 1e-10, "{}", case.options);
        let of: [fn(&mut Polynomials) -> Vec<&mut f64>; 5] = [
            |p| p.a[1..].iter_mut().collect(),
            |p| p.b.iter_mut().flatten().filter(|b| **b != 0.0).collect(),
            |p| p.c[1..].iter_mut().collect(),
            |p| p.d[1..].iter_mut().collect(),
            |p| p.f.iter_mut().flat_map(|f| &mut f[1..]).collect(),
        ];
        let mut count = 0;
        for part in of {
            for position in 0..part(&mut best.clone()).len() {
                count += 1;
                for change in [-1e-4, 1e-4] {
                    let mut other = best.clone();
                    *part(&mut other)[position] += change;
                    assert!(case.cost(&other) > cost, "{}: {count}", case.options);
                }
            }
        }
        assert_eq!(count, parameters(&report).len(), "{}", case.options);
    }
}

#[test]
fn all_searches_reach_the_same_minimum() {
    for case in cases(200, 0.3).into_iter().take(4) {
        let folder = case.folder();
        let fit = |options: &str| folder.fit(&format!("log.csv --initial zero {} {options}", case.options));
        let expected = fit("--tolerance 1e-13");
        for (options, near) in [
            ("--search gauss-newton --tolerance 1e-13", 1e-11),
            ("--search newton --tolerance 1e-13", 1e-11),
            // Steepest descent is slow along the cost's flat directions, and slower with ever shorter steps.
            ("--search gradient --max-iterations 5000 --tolerance 1e-10", 1e-4),
            ("--search gradient --step 20,20 --max-iterations 5000 --tolerance 1e-10", 2e-2),
            ("--search annealing --max-iterations 50 --tolerance 1e-13", 1e-11),
            ("--starts 3 --seed 7 --tolerance 1e-13", 1e-11),
        ] {
            let report = fit(options);
            let ratio = number(&report, "/estimation/mse") / number(&expected, "/estimation/mse");
            assert!((ratio - 1.0).abs() < near, "{} {options}: {ratio}", case.options);
            assert_eq!(report["estimation"]["method"], "prediction-error");
            let algorithm = options.split_whitespace().nth(1).filter(|_| options.starts_with("--search"));
            assert_eq!(report["estimation"]["algorithm"], algorithm.unwrap_or("lm"));
        }
    }
}

#[test]
fn the_report_says_how_the_search_went() {
    let folder = cases(500, 0.3)[2].folder();
    let line = "log.csv --model bj --nb 1 --nc 1 --nd 1 --nf 2 --nk 2 --initial zero";
    let report = folder.fit(&format!("{line} --starts 4 --seed 5 --max-iterations 50 --tolerance 1e-9"));
    let search = &report["estimation"];
    let costs = numbers(&search["costs"]);
    assert_eq!(costs.len() as f64, number(search, "/iterations") + 1.0);
    assert!(costs.windows(2).all(|pair| pair[1] < pair[0]), "{costs:?}");
    assert!((costs[costs.len() - 1] / number(search, "/mse") - 1.0).abs() < 1e-12);
    assert_eq!(
        (&search["stopped"], &search["seed"], &search["max_iterations"], &search["tolerance"]),
        (&json!("converged"), &json!(5), &json!(50), &json!(1e-9))
    );
    assert!(number(search, "/gradient_norm") < 1e-3);
    assert_eq!(search["stability_bound"], false);
    let starts = search["starts"].as_array().unwrap();
    assert_eq!(starts[0]["name"], search["start"]);
    // Those of smaller models are searched from beside that many others.
    let nested = starts.iter().filter(|start| start["name"] == "nested").count();
    let reached = starts.iter().filter(|start| start["reached"].is_number()).count();
    assert!(starts.len() >= 5 && (5..=5 + nested).contains(&reached), "{starts:?}");

    let gradient = folder.fit(&format!("{line} --search gradient --step 0.5,2 --max-iterations 3"));
    assert_eq!(gradient["estimation"]["step"], json!({"c1": 0.5, "c2": 2.0}));
    assert_eq!(gradient["estimation"]["stopped"], "max-iterations");
    assert_eq!(number(&gradient, "/estimation/iterations"), 3.0);
    let warnings = gradient["warnings"].as_array().unwrap();
    assert!(warnings.iter().any(|w| w.as_str().unwrap().contains("no convergence")), "{warnings:?}");
}

#[test]
fn the_table_says_how_the_search_went() {
    let folder = cases(500, 0.3)[2].folder();
    let table =
        folder.done("fit log.csv --model bj --nb 1 --nc 1 --nd 1 --nf 2 --nk 2 --report model.json").stdout;
    let report: Value = serde_json::from_str(&folder.read("model.json")).unwrap();
    assert!(table.starts_with("Box-Jenkins: y(t) = B(q)/F(q) u(t) + C(q)/D(q) e(t), sample time"), "{table}");
    let search = &report["estimation"];
    let went = format!(
        "{} iterations (lm) from {}, converged",
        search["iterations"],
        search["start"].as_str().unwrap_or_default()
    );
    assert!(table.replace("\n  ", " ").contains(&went), "{table}");
    for root in ["pole of F", "noise pole of D", "noise zero of C"] {
        assert!(table.contains(&format!("\n{root} ")), "{table}");
    }
}

#[test]
fn the_same_seed_gives_the_same_bytes_on_any_number_of_threads() {
    let folder = cases(500, 0.3)[2].folder();
    let line = "fit log.csv --model bj --nb 1 --nc 1 --nd 1 --nf 2 --starts 6 --seed 3 --format json";
    let runs = ["1", "2", "4"].map(|threads| {
        let mut command = folder.command(line);
        command.env("RAYON_NUM_THREADS", threads);
        crate::harness::Run::of(command).stdout
    });
    assert!(runs[0].starts_with('{'));
    assert!(runs.iter().all(|run| *run == runs[0]));
}

#[test]
fn a_slow_plant_that_does_not_start_at_rest_has_its_start_estimated() {
    let mut case = Case::new(
        Polynomials::new(&[], &[0.0, 0.1], &[], &[], &[-0.98]),
        600,
        0.05,
        "--model oe --nb 1 --nf 1",
    );
    // Far from where the inputs will take it.
    (0..600).for_each(|t| case.y[t] += 5.0 * 0.98_f64.powi(t as i32));
    let folder = case.folder();
    let auto = folder.fit(&format!("log.csv --detrend none {}", case.options));
    assert_eq!(auto["estimation"]["initial"], "estimate");
    assert_eq!(number(&auto, "/estimation/initial_conditions"), 1.0);
    assert!((parameters(&auto)[1] + 0.98).abs() < 1e-3, "{:?}", parameters(&auto));
    let zero = folder.fit(&format!("log.csv --detrend none {} --initial zero", case.options));
    assert!(number(&zero, "/estimation/mse") > 10.0 * number(&auto, "/estimation/mse"));
    let estimate = folder.fit(&format!("log.csv --detrend none {} --initial estimate", case.options));
    assert!(distance(&parameters(&estimate), &parameters(&auto)) < 1e-9);
}

#[test]
fn armax_takes_zeros_for_the_past_or_leaves_its_first_samples_out() {
    let case = &cases(300, 0.5)[0];
    let folder = case.folder();
    let line = format!("log.csv --detrend none {} --tolerance 1e-13", case.options);
    let [auto, drop, zero] =
        ["auto", "drop", "zero"].map(|initial| folder.fit(&format!("{line} --initial {initial}")));
    assert_eq!(auto, drop);
    assert_eq!((number(&drop, "/estimation/samples"), number(&zero, "/estimation/samples")), (298.0, 300.0));
    // The log begins at rest, so that both see nearly the same.
    assert!(distance(&parameters(&drop), &parameters(&zero)) < 0.05);
}

#[test]
fn a_time_limit_ends_the_search_and_says_so() {
    let folder = cases(4000, 0.3)[1].folder();
    let run = folder.done("fit log.csv --model oe --nb 2 --nf 2 --nk 1 --time-limit 1e-9 --format json");
    let report: Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!(report["estimation"]["stopped"], "time-limit");
    assert!(
        run.stderr.contains("warning: no convergence") && run.stderr.contains("--time-limit"),
        "{}",
        run.stderr
    );
}

#[test]
fn too_short_a_log_for_its_initial_conditions() {
    let Experiment { u, y } = Experiment::new(6);
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    let line = folder.refused("fit log.csv --model oe --nb 2 --nf 2 --initial estimate --nk 4", 4);
    assert!(line.contains("log.csv: too few rows") && line.contains("initial conditions"), "{line}");
    folder.assert_refused("fit log.csv --model bj --nb 2 --nc 2 --nd 2 --nf 2", 4, "log.csv: too few rows");
}

#[test]
fn orders_above_those_of_the_plant_name_what_cancels() {
    let truth = Polynomials::new(&[], &[0.0, 1.0], &[], &[], &[-0.7]);
    let case = Case::new(truth, 500, 0.0, "--model oe --nb 2 --nf 2");
    let line = case.folder().refused(&format!("fit log.csv --detrend none {}", case.options), 4);
    assert!(
        line.contains("the cost is flat") && line.contains("cancel") && line.contains("lower both orders"),
        "{line}"
    );
}

#[test]
fn an_unstable_plant_given_to_output_error_gets_words() {
    let mut random = Random::new(31);
    let (u, e) = (random.signal(60), random.signal(60));
    let truth = Polynomials::new(&[-1.1], &[0.0, 1.0], &[], &[], &[]);
    let y = truth.outputs(&[&u], &e);
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    let run = folder.done("fit log.csv --detrend none --model oe --nb 1 --nf 1");
    assert!(
        run.stderr.contains("warning: ")
            && run.stderr.contains("stability")
            && run.stderr.contains("unstable plant"),
        "{}",
        run.stderr
    );
    // ARX has no such bound.
    let report = folder.fit("log.csv --detrend none --na 1 --nb 1");
    assert!((parameters(&report)[0] + 1.1).abs() < 0.01);
}

#[test]
fn an_input_that_stands_still_is_refused_by_name() {
    let Experiment { y, .. } = Experiment::new(100);
    let folder = Folder::with_log(csv(&[("u", &[2.0; 100]), ("y", &y)]));
    let line = folder.refused("fit log.csv --model oe --nb 2 --nf 1", 4);
    assert!(line.contains("'u'") && line.contains("b1, b2, f1"), "{line}");
}
