//! Seasonal ARIMA models in every verb.

use serde_json::Value;

use crate::harness::Folder;

const AIRLINE: &str = "log.csv --sample-time 1 --model arima --order 0,1,1 --seasonal 0,1,1,12";

fn passengers() -> Folder {
    Folder::with_log(include_str!("data/public/air_passengers.csv"))
}

fn factors(report: &Value) -> Vec<(String, f64, f64)> {
    let all = report["model"]["factors"]["parameters"].as_array().expect("a list").iter();
    let number = |own: &Value, field: &str| own[field].as_f64().expect("a number");
    all.map(|own| {
        let name = own["name"].as_str().expect("a name").to_owned();
        (name, number(own, "value"), number(own, "standard_error"))
    })
    .collect()
}

/// R's `arima(log(AirPassengers), c(0, 1, 1), list(order = c(0, 1, 1), period = 12))` has ma1 -0.4018 (0.0896), sma1
/// -0.5569 (0.0731), sigma^2 0.001348 and a log-likelihood of 244.7.
#[test]
fn the_airline_model_has_the_parameters_of_r() {
    let folder = passengers();
    let report = folder.fit(&format!("{AIRLINE} --report r.json"));
    let found = factors(&report);
    let expected = [("ma1", -0.4018, 0.0896), ("sma12", -0.5569, 0.0731)];
    assert_eq!(found.len(), 2);
    for ((name, value, error), (own, truth, spread)) in found.iter().zip(expected) {
        assert_eq!(name, own);
        assert!((value - truth).abs() < 1e-4 && (error - spread).abs() < 1e-4, "{name} {value} {error}");
    }
    let variance = report["model"]["noise_covariance"][0][0].as_f64().expect("a number");
    assert!((variance - 0.001_348).abs() < 1e-6);
    let likelihood = report["estimation"]["log_likelihood"].as_f64().expect("a number");
    assert!((likelihood - 244.6965).abs() < 1e-4);
    // A plan repeats it.
    let again = folder.fit("log.csv --sample-time 1 --plan r.json");
    assert_eq!(again["model"], report["model"]);
}

#[test]
fn every_verb_takes_the_model() {
    let folder = passengers();
    folder
        .done(&format!("fit {AIRLINE} --estimate 1..120 --validate 121..144 --report r.json --html r.html"));
    let report: Value = serde_json::from_str(&folder.read("r.json")).expect("JSON");
    let run = folder.done("validate r.json log.csv --sample-time 1 --rows 121..144 --format json");
    let validation: Value = serde_json::from_str(&run.stdout).expect("JSON");
    // The figures are the same in both.
    let held_out = report["fit"].as_array().expect("a list").iter().find(|fit| fit["part"] == "validation");
    assert_eq!(validation["fit"][0]["percent"], held_out.expect("a figure")["percent"]);
    assert!(validation["residuals"][0]["ljung_box"]["p_value"].as_f64().is_some_and(|p| p > 0.001));
    // Rows beyond the end are forecast, and the deviations grow.
    let rows: Vec<&str> = include_str!("data/public/air_passengers.csv").lines().take(133).collect();
    folder.write("short.csv", rows.join("\n") + "\n");
    let predicted = folder.done("predict r.json short.csv --sample-time 1 --horizon 12").stdout;
    assert!(predicted.lines().count() > 133, "{predicted}");
    for verb in [
        "bode r.json",
        "export r.json --language c",
        "compare r.json r.json --log log.csv --sample-time 1",
        "show r.json",
    ] {
        let run = folder.run(verb);
        assert!(!run.stderr.contains("panicked"), "{verb}: {}", run.stderr);
    }
}

#[test]
fn options_of_other_models_are_refused() {
    let folder = passengers();
    folder.assert_refused("fit log.csv --model arima", 2, "arima needs p,d,q");
    folder.assert_refused("fit log.csv --model arima --order 2", 2, "arima needs p,d,q");
    folder.assert_refused("fit log.csv --model arima --order 1,-1,0", 2, "--order");
    folder.assert_refused("fit log.csv --model arima --order 1,1", 2, "three whole numbers");
    folder.assert_refused(
        "fit log.csv --model arima --order 1,0,0 --seasonal 1,0,0,1",
        2,
        "two rows at least",
    );
    folder.assert_refused("fit log.csv --model arima --order 1,0,0 --na 2", 2, "--na");
    folder.assert_refused("fit log.csv --model ss --order 1,0,0", 2, "p,d,q is of");
    folder.assert_refused("fit log.csv --model ar --na 2 --seasonal 1,0,0,12", 2, "--seasonal");
}
