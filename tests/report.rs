//! The JSON document and the table.

use serde_json::{Value, json};
use thetahat::Document;
use thetahat::report::Report;

use crate::harness::{Folder, number, numbers};
use crate::signals::{Experiment, Random, csv, plain_log, response};

/// A log whose model has nk = 3.
fn delayed() -> String {
    let mut random = Random::new(12);
    let u = random.signal(500);
    let e: Vec<f64> = random.signal(500).iter().map(|e| 0.1 * e).collect();
    csv(&[("u", &u), ("y", &response(&[1.0, -1.2, 0.5], &[(&[0.0, 0.0, 0.0, 1.0, 0.4], &u)], &e))])
}

/// Reports of all kinds, each with a name.
fn reports() -> Vec<(&'static str, String)> {
    let Experiment { u, y } = Experiment::new(200);
    let times: Vec<f64> =
        (0..200).map(|row| f64::from(row) * 0.5 + if row > 80 { 2.0 } else { 0.0 }).collect();
    let second = Random::new(13).signal(200);
    let mut missing = y.clone();
    missing[30] = f64::NAN;
    let exact = response(&[1.0, -1.0], &[(&[0.0, 1.0], &second)], &[0.0; 200]);
    let folder = Folder::with_log(plain_log());
    folder.write("two.csv", csv(&[("t", &times), ("u1", &u), ("u2", &second), ("y", &missing)]));
    folder.write("exact.csv", csv(&[("u", &second), ("y", &exact)]));
    [
        ("one input", "log.csv --na 2 --nb 2 --estimate 1..100,120..150 --validate 151..200"),
        ("two inputs", "two.csv --time t --na 2 --nb 2,1 --nk 1,0"),
        ("resampled", "two.csv --time t --resample 0.25:linear --na 1 --nb 1 --detrend linear"),
        ("an input without parameters", "two.csv --na 2 --nb 2,0"),
        ("no inputs", "log.csv --na 2 --nb 0 --initial zero"),
        ("no outputs", "log.csv --na 0 --nb 3 --detrend start:10"),
        ("no noise", "exact.csv --na 1 --nb 1 --detrend none"),
        ("no validation figures", "log.csv --na 2 --nb 2 --estimate 1..150 --validate 200..200"),
    ]
    .map(|(name, line)| (name, folder.done(&format!("fit {line} --format json")).stdout))
    .to_vec()
}

#[test]
fn the_skeleton_that_other_tools_rely_on_is_there() {
    let report =
        Folder::with_log(delayed()).fit("log.csv --sample-time 0.08 --estimate 1..300 --na 2 --nb 2 --nk 3");
    assert_eq!(report["schema"], "thetahat.report/1");
    assert!(report["data"].is_object());

    let model = &report["model"];
    assert_eq!(model["structure"], "arx");
    assert_eq!(model["orders"], json!({"na": 2, "nb": [2], "nc": 0, "nd": 0, "nf": [0], "nk": [3]}));
    assert_eq!(model["sample_time"], 0.08);
    assert_eq!((numbers(&model["a"]).len(), &model["a"][0]), (3, &json!(1.0)));
    let b = numbers(&model["b"][0]);
    assert_eq!((b.len(), &b[..3]), (5, &[0.0; 3][..]));
    assert_eq!(model["c"], json!([1.0]));
    assert_eq!(model["d"], json!([1.0]));
    assert_eq!(model["f"], json!([[1.0]]));
    assert!(number(model, "/noise_covariance/0/0") > 0.0);
    let parameters = model["parameters"].as_array().unwrap();
    for (parameter, (name, value)) in parameters.iter().zip([
        ("a1", &model["a"][1]),
        ("a2", &model["a"][2]),
        ("b3", &model["b"][0][3]),
        ("b4", &model["b"][0][4]),
    ]) {
        assert_eq!((&parameter["name"], &parameter["value"]), (&json!(name), value));
        assert!(number(parameter, "/standard_error") > 0.0);
    }
    assert_eq!(parameters.len(), 4);
    let covariance: Vec<usize> =
        model["covariance"].as_array().unwrap().iter().map(|row| numbers(row).len()).collect();
    assert_eq!(covariance, [4; 4]);
    assert_eq!(model["poles"].as_array().unwrap().len(), 2);
    assert!(model["poles"][0]["re"].is_number() && model["poles"][0]["im"].is_number());

    let estimation = &report["estimation"];
    assert!(estimation["method"].is_string());
    assert_eq!(estimation["samples"], 296);
    for figure in ["mse", "fpe", "aic", "aicc", "mdl", "condition"] {
        assert!(estimation[figure].is_number(), "{figure}");
    }

    assert_eq!(report["fit"].as_array().unwrap().len(), 2);
    for (fit, (horizon, initial)) in report["fit"]
        .as_array()
        .unwrap()
        .iter()
        .zip([(json!({"kind": "steps", "steps": 1}), "drop"), (json!({"kind": "free-run"}), "estimate")])
    {
        assert_eq!(fit["rows"], json!([[1, 300]]));
        assert_eq!(fit["part"], "estimation");
        assert_eq!(fit["horizon"], horizon);
        assert_eq!(fit["initial"], initial);
        assert!(number(fit, "/percent") > 80.0 && number(fit, "/rmse") > 0.0, "{fit}");
    }
    assert_eq!(report["warnings"], json!([]));
}

#[test]
fn it_says_where_the_data_came_from() {
    let folder = Folder::with_log(plain_log());
    let data = &folder
        .fit("log.csv --sample-time 0.5 --estimate 11..100,121..150 --validate 151..200 --na 2 --nb 2")["data"];
    assert_eq!(
        data["logs"],
        json!([{"file": "log.csv", "rows": [1, 200], "time": null, "start": null, "resampled": null}])
    );
    assert_eq!(data["rows"], 200);
    assert_eq!(data["sample_time"], 0.5);
    assert_eq!(data["detrend"], "mean");
    assert_eq!(data["estimation"], json!([[11, 100], [121, 150]]));
    assert_eq!(data["validation"], json!([[151, 200]]));
    assert_eq!(data["segments"], json!([[11, 100], [121, 150]]));
}

#[test]
fn offsets_are_those_of_the_estimation_rows() {
    let Experiment { u, y } = Experiment::new(200);
    let folder = Folder::with_log(plain_log());
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    for (options, expected) in [
        ("", (mean(&u[20..150]), mean(&y[20..150]))),
        ("--detrend start:7", (mean(&u[20..27]), mean(&y[20..27]))),
        ("--detrend none", (0.0, 0.0)),
        ("--offset u=4.5", (4.5, mean(&y[20..150]))),
    ] {
        let line = format!("log.csv --estimate 21..150 --na 2 --nb 2 --constant no {options}");
        let report = folder.fit(&line);
        let level = |pointer: &str| number(&report, pointer);
        assert!((level("/model/inputs/0/offset/level") - expected.0).abs() < 1e-12, "{options}");
        assert!((level("/model/outputs/0/offset/level") - expected.1).abs() < 1e-12, "{options}");
    }
}

#[test]
fn criteria_follow_their_definitions() {
    let report = Folder::with_log(plain_log()).fit("log.csv --na 2 --nb 2");
    let of = |name: &str| number(&report, &format!("/estimation/{name}"));
    let (n, p, mse) = (of("samples"), 4.0, of("mse"));
    assert_eq!(n, 198.0);
    // Akaike 1969, Akaike 1974, Hurvich and Tsai 1989, Rissanen 1978, each for one sample.
    assert!((of("fpe") / (mse * (1.0 + p / n) / (1.0 - p / n)) - 1.0).abs() < 1e-12);
    assert!((of("aic") - (mse.ln() + 2.0 * p / n)).abs() < 1e-12);
    assert!((of("aicc") - (of("aic") + 2.0 * p * (p + 1.0) / (n * (n - p - 1.0)))).abs() < 1e-12);
    assert!((of("mdl") - (mse.ln() + p * n.ln() / n)).abs() < 1e-12);
    assert!((number(&report, "/model/noise_covariance/0/0") / (mse * n / (n - p)) - 1.0).abs() < 1e-12);
}

#[test]
fn poles_zeros_gain_and_time_constants_follow_from_the_polynomials() {
    let report = Folder::with_log(delayed()).fit("log.csv --sample-time 0.5 --na 3 --nb 3 --nk 2");
    let model = &report["model"];
    let (a, b) = (numbers(&model["a"]), numbers(&model["b"][0]));
    // Of sum p_i z^-i, the size at z, compared with the sum of the sizes.
    let relative_size = |p: &[f64], z: &Value| {
        let (size, angle) =
            (number(z, "/re").hypot(number(z, "/im")), number(z, "/im").atan2(number(z, "/re")));
        let term = |(i, p): (usize, &f64)| {
            let (power, turn) = (p * size.powi(-(i as i32)), -angle * i as f64);
            (power * turn.cos(), power * turn.sin(), power.abs())
        };
        let (re, im, all) =
            p.iter().enumerate().map(term).fold((0.0, 0.0, 0.0), |s, t| (s.0 + t.0, s.1 + t.1, s.2 + t.2));
        f64::hypot(re, im) / all
    };
    let poles = model["poles"].as_array().unwrap();
    assert_eq!(poles.len(), 3);
    for (position, pole) in poles.iter().enumerate() {
        assert!(relative_size(&a, pole) < 1e-10, "{pole}");
        let modulus = number(pole, "/re").hypot(number(pole, "/im"));
        let time_constant = number(model, &format!("/time_constants/{position}/value"));
        assert!((time_constant / (-0.5 / modulus.ln()) - 1.0).abs() < 1e-12);
    }
    let zeros = model["zeros"][0].as_array().unwrap();
    assert_eq!(zeros.len(), 2);
    assert!(zeros.iter().all(|zero| relative_size(&b, zero) < 1e-10), "{zeros:?}");
    let gain = b.iter().sum::<f64>() / a.iter().sum::<f64>();
    assert!((number(model, "/dc_gain/0/value") / gain - 1.0).abs() < 1e-12);
    assert_eq!(model["stable"], true);
}

#[test]
fn an_integrator_has_no_gain_and_is_not_stable() {
    let u = Random::new(14).signal(200);
    let y = response(&[1.0, -1.0], &[(&[0.0, 1.0], &u)], &[0.0; 200]);
    let folder = Folder::with_log(csv(&[("u", &u), ("y", &y)]));
    let report = folder.fit("log.csv --na 1 --nb 1 --detrend none");
    assert_eq!(report["model"]["dc_gain"], json!([null]));
    assert_eq!(report["model"]["stable"], false);
    assert_eq!(report["model"]["time_constants"], json!([null]));
}

#[test]
fn warnings_are_in_the_report_and_on_standard_error() {
    let folder = Folder::with_log(plain_log());
    let run = folder.done("fit log.csv --na 2 --nb 2 --estimate 1..120 --validate 100..200 --format json");
    let report: Value = serde_json::from_str(&run.stdout).unwrap();
    let warnings = report["warnings"].as_array().unwrap();
    assert_eq!(warnings.len(), 1);
    let warning = warnings[0].as_str().unwrap();
    assert!(warning.contains("overlap"), "{warning}");
    assert_eq!(run.stderr, format!("warning: {warning}\n"));
}

#[test]
fn every_field_is_known_and_the_document_reads_back_as_it_is() {
    for (name, text) in reports() {
        let report = Report::from_json(&text).unwrap();
        // The same bytes: no field was dropped, and no number lost a digit.
        let again = report.to_json().unwrap();
        let differing = again.lines().zip(text.lines()).find(|(again, text)| again != text);
        assert!(again == text, "{name}: {differing:?}");
    }
}

#[test]
fn every_report_keeps_to_the_schema() {
    let schema: Value = serde_json::from_str(&Folder::new().done("schema").stdout).unwrap();
    assert_eq!(schema["$schema"], "https://json-schema.org/draft/2020-12/schema");
    for (name, text) in reports() {
        let report = serde_json::from_str(&text).unwrap();
        let faults = faults(&schema, &schema, &report, "");
        assert!(faults.is_empty(), "{name}:\n{}", faults.join("\n"));
    }
}

#[test]
fn the_schema_refuses_what_is_no_report() {
    let schema: Value = serde_json::from_str(&Folder::new().done("schema").stdout).unwrap();
    let report: Value = serde_json::from_str(&reports()[0].1).unwrap();
    for (place, value) in [
        ("/model/a", json!("1")),
        ("/model/orders/na", json!(-1)),
        ("/model/structure", json!("neural")),
        ("/model/poles/0/re", json!(null)),
        ("/fit/0/horizon/kind", json!("far")),
        ("/fit/0/rows/0", json!([1, 2, 3])),
        ("/data", json!({})),
    ] {
        let mut wrong = report.clone();
        *wrong.pointer_mut(place).unwrap() = value;
        assert!(!faults(&schema, &schema, &wrong, "").is_empty(), "{place}");
    }
}

/// What is wrong with a value by a schema (JSON Schema 2020-12, the keywords that ours uses; any other is a fault).
/// A property that the schema does not name is a fault too.
fn faults(root: &Value, schema: &Value, value: &Value, place: &str) -> Vec<String> {
    let mut found = mismatches(root, schema, value, place);
    let known = properties(root, schema, value);
    let names = value.as_object().into_iter().flatten().map(|(name, _)| name);
    found.extend(
        names.filter(|name| !known.contains(name)).map(|name| format!("{place}: unknown property {name}")),
    );
    found
}

/// The schemas that say more of the same value.
fn branches<'a>(root: &'a Value, schema: &'a Value) -> Vec<&'a Value> {
    let target = schema["$ref"].as_str().and_then(|path| root.pointer(path.trim_start_matches('#')));
    let several = ["oneOf", "anyOf"].map(|keyword| schema[keyword].as_array().into_iter().flatten());
    target.into_iter().chain(several.into_iter().flatten()).collect()
}

/// The properties that a schema names, with those of its branches that the value agrees with.
fn properties<'a>(root: &'a Value, schema: &'a Value, value: &'a Value) -> Vec<&'a String> {
    let own = schema["properties"].as_object().into_iter().flatten().map(|(name, _)| name);
    // A map has whatever names it has.
    let any = value.as_object().filter(|_| schema.get("additionalProperties").is_some());
    let own = own.chain(any.into_iter().flatten().map(|(name, _)| name));
    let fitting =
        branches(root, schema).into_iter().filter(|branch| mismatches(root, branch, value, "").is_empty());
    own.chain(fitting.flat_map(|branch| properties(root, branch, value))).collect()
}

/// The faults but for unknown properties of the value itself, which another part of the schema may know.
fn mismatches(root: &Value, schema: &Value, value: &Value, place: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut demand = |holds: bool, keyword: &str| {
        if !holds {
            found.push(format!("{place}: {keyword}: {value}"));
        }
    };
    let of_type = |name: &Value| match name.as_str() {
        Some("object") => value.is_object(),
        Some("array") => value.is_array(),
        Some("string") => value.is_string(),
        Some("boolean") => value.is_boolean(),
        Some("null") => value.is_null(),
        Some("number") => value.is_number(),
        Some("integer") => value.is_u64() || value.is_i64(),
        _ => false,
    };
    let agreeing = |schemas: &Value| {
        let schemas = schemas.as_array().into_iter().flatten();
        schemas.filter(|schema| mismatches(root, schema, value, place).is_empty()).count()
    };
    let items = value.as_array();
    let count = |value: &Value| value.as_u64().unwrap_or(u64::MAX);
    let mut parts: Vec<(&Value, &Value, String)> = Vec::new();
    let mut same: Vec<&Value> = Vec::new();
    for (keyword, rule) in schema.as_object().into_iter().flatten() {
        match keyword.as_str() {
            "$schema" | "$defs" | "title" | "description" | "format" | "default" => {}
            "$ref" => {
                let target = rule.as_str().and_then(|path| root.pointer(path.trim_start_matches('#')));
                demand(target.is_some(), keyword);
                same.extend(target);
            }
            "type" => {
                demand(rule.as_array().map_or(of_type(rule), |names| names.iter().any(of_type)), keyword)
            }
            "const" => demand(value == rule, keyword),
            "enum" => demand(rule.as_array().is_some_and(|values| values.contains(value)), keyword),
            "anyOf" => demand(agreeing(rule) > 0, keyword),
            "oneOf" => demand(agreeing(rule) == 1, keyword),
            // Of what is no number or no array these say nothing.
            "minimum" => demand(!value.is_number() || value.as_f64() >= rule.as_f64(), keyword),
            "minItems" => demand(items.is_none_or(|items| items.len() as u64 >= count(rule)), keyword),
            "maxItems" => demand(items.is_none_or(|items| items.len() as u64 <= count(rule)), keyword),
            "required" => {
                let has = |name: &Value| name.as_str().is_some_and(|name| value.get(name).is_some());
                demand(rule.as_array().is_some_and(|names| names.iter().all(has)), keyword);
            }
            "properties" => {
                for (name, value) in value.as_object().into_iter().flatten() {
                    parts.extend(rule.get(name).map(|rule| (rule, value, format!("{place}/{name}"))));
                }
            }
            "additionalProperties" => {
                let named = |name: &String| schema["properties"].get(name).is_some();
                let others = value.as_object().into_iter().flatten().filter(|(name, _)| !named(name));
                parts.extend(others.map(|(name, value)| (rule, value, format!("{place}/{name}"))));
            }
            "items" | "prefixItems" => {
                for (position, value) in items.into_iter().flatten().enumerate() {
                    let rule = if keyword == "items" { Some(rule) } else { rule.get(position) };
                    parts.extend(rule.map(|rule| (rule, value, format!("{place}/{position}"))));
                }
            }
            _ => demand(false, &format!("unknown keyword {keyword}")),
        }
    }
    found.extend(same.into_iter().flat_map(|schema| mismatches(root, schema, value, place)));
    found.extend(parts.into_iter().flat_map(|(schema, value, place)| faults(root, schema, value, &place)));
    found
}

#[test]
fn fields_from_the_future_are_ignored() {
    let folder = Folder::with_log(plain_log());
    let mut report = folder.fit("log.csv --na 2 --nb 2 --report model.json");
    let expected = folder.done("predict model.json log.csv").stdout;
    report["horoscope"] = json!({"sign": "leo"});
    report["model"]["uncertainty"] = json!([1, 2, 3]);
    report["model"]["orders"]["np"] = json!(0);
    report["data"]["colour"] = json!("blue");
    report["fit"][0]["mood"] = json!(null);
    folder.write("model.json", report.to_string());
    assert_eq!(folder.done("predict model.json log.csv").stdout, expected);
}

#[test]
fn the_table_says_what_the_report_says() {
    let folder = Folder::with_log(plain_log());
    let table = folder.done("fit log.csv --na 2 --nb 2 --validate 150..200 --report model.json").stdout;
    let report: Value = serde_json::from_str(&folder.read("model.json")).unwrap();
    let rows: Vec<Vec<&str>> = table.lines().map(|line| line.split_whitespace().collect()).collect();
    for parameter in report["model"]["parameters"].as_array().unwrap() {
        let row = rows.iter().find(|row| row.first().copied() == parameter["name"].as_str()).unwrap();
        let (value, error): (f64, f64) = (row[1].parse().unwrap(), row[2].parse().unwrap());
        assert!((value / number(parameter, "/value") - 1.0).abs() < 1e-5, "{parameter}");
        // Three digits.
        assert!((error / number(parameter, "/standard_error") - 1.0).abs() < 1e-2, "{parameter}");
    }
    for fit in report["fit"].as_array().unwrap() {
        let percent = format!("{:.3}", number(fit, "/percent"));
        let row = rows.iter().find(|row| row.contains(&percent.as_str())).unwrap();
        let rows = format!("{}..{}", fit["rows"][0][0], fit["rows"][0][1]);
        assert!(row.contains(&rows.as_str()), "{row:?}");
        assert!(
            row.contains(&fit["initial"].as_str().unwrap()) && row.contains(&fit["part"].as_str().unwrap())
        );
    }
    assert!(table.contains("\nstable\n"), "{table}");
}
