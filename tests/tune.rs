//! Controllers for processes: settings, closed loops, and what cannot be tuned.

use crate::harness::{Folder, number};

const FIT: &str = "fit log.csv --time t -u q1 -y t1";

#[test]
fn a_heater_is_tuned() {
    let folder = Folder::with_log(include_str!("data/public/tclab_siso_step.csv"));
    folder.done(&format!("{FIT} --structure p2d --report heater.json"));
    let run = folder.done(
        "tune heater.json --format json --html loop.html --responses loop.csv --document tuning.json -o out.json",
    );
    assert!(run.stderr.contains("theta is known to"), "{}", run.stderr);
    let found: serde_json::Value = serde_json::from_str(&folder.read("tuning.json")).expect("a document");
    assert_eq!(folder.read("tuning.json"), folder.read("out.json"));
    // By the half rule: theta = 4.665 + 9.966/2, tau1 = 136.48 + 9.966/2; tau_c = theta.
    let theta = number(&found, "/settings/0/process/dead_time");
    assert!((theta - 9.64809).abs() < 1e-3, "{theta}");
    let tau = number(&found, "/settings/0/process/time_constant");
    let gain = number(&found, "/settings/0/gain");
    assert!((gain - tau / (0.362616 * 2.0 * theta)).abs() < 1e-3 * gain, "{gain}");
    assert!((number(&found, "/settings/0/integral_time") - 8.0 * theta).abs() < 1e-6 * theta);
    for place in 0..4 {
        let of = |name: &str| number(&found, &format!("/settings/{place}/closed_loop/{name}"));
        assert!(of("peak_sensitivity") > 1.0 && of("peak_sensitivity") < 2.0, "{found:#}");
        assert!(of("worst_peak_sensitivity") >= of("peak_sensitivity"));
        assert!(of("overshoot") < 0.4 && of("settling_time") > 0.0);
    }
    assert!(
        folder
            .read("loop.csv")
            .starts_with("rule,controller,time,setpoint_response,controller_output,load_response\nSIMC,PI,0")
    );
    assert!(folder.read("loop.html").contains("After a step of the load"));
    // Slower is safer.
    let slow = folder.done("tune heater.json --lambda 60 --controller pi");
    assert!(slow.stdout.contains("lambda") && !slow.stdout.contains("PID"), "{}", slow.stdout);
}

#[test]
fn what_cannot_be_tuned_is_told() {
    let folder = Folder::with_log(include_str!("data/public/tclab_siso_step.csv"));
    folder.done(&format!("{FIT} --structure p1d --report heater.json"));
    folder.done(&format!("{FIT} --structure p2dz --report zero.json"));
    folder.done("fit log.csv --sample-time 1 -u q1 -y t1 --na 1 --nb 1 --report arx.json");
    let before = folder.names();
    for (line, code, words) in [
        ("tune arx.json", 3, "settings are of a process"),
        ("tune zero.json", 2, "with a zero"),
        ("tune heater.json -u v", 2, "none called 'v'"),
        ("tune heater.json --lambda 0", 2, "not a positive"),
        ("tune heater.json --lambda -3", 2, "not a positive"),
        ("tune heater.json --lambda nan", 2, "not a positive"),
        ("tune log.csv", 3, "not a thetahat report"),
        ("tune nowhere.json", 5, "cannot be read"),
    ] {
        folder.assert_refused(&format!("{line} --responses r.csv --html h.html"), code, words);
        assert_eq!(folder.names(), before);
    }
    let run = folder.done("tune heater.json --controller pid");
    assert!(run.stderr.contains("take a PI"), "{}", run.stderr);
}
