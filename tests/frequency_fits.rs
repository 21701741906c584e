//! Fits to frequency responses that were measured elsewhere: tables of points, such as impedance spectra.

use std::fmt::Write;

use serde_json::Value;

use crate::harness::{Folder, names, number, parameters};

const CELL: &str = include_str!("data/cell_impedance.toml");

/// R0, R1, tau1, R2, tau2 of the table below.
const TRUTH: [f64; 5] = [0.015, 0.01, 0.05, 0.04, 8.0];

/// The impedance of two RC pairs in series with a resistance, as potentiostats write it.
fn impedance() -> String {
    let mut table = "freq/Hz,Re(Z)/Ohm,-Im(Z)/Ohm,|Z|/Ohm\n".to_owned();
    let [r0, r1, tau1, r2, tau2] = TRUTH;
    for row in 0..50 {
        let hertz = 10.0_f64.powf(3.0 - 5.0 * f64::from(row) / 49.0);
        let omega = std::f64::consts::TAU * hertz;
        let (mut re, mut minus) = (r0, 0.0);
        for (r, tau) in [(r1, tau1), (r2, tau2)] {
            let below = 1.0 + (omega * tau).powi(2);
            re += r / below;
            minus += r * omega * tau / below;
        }
        writeln!(table, "{hertz},{re},{minus},{}", re.hypot(minus)).expect("memory");
    }
    table
}

fn value(report: &Value, name: &str) -> [f64; 2] {
    let place = names(report).iter().position(|own| own == name).expect("the parameter is there");
    let error = number(report, &format!("/model/parameters/{place}/standard_error"));
    [parameters(report)[place], error]
}

fn near(found: f64, expected: f64, tolerance: f64) {
    assert!((found / expected - 1.0).abs() < tolerance, "{found} {expected}");
}

/// That a command is refused in one line, after what it said of how the table was read.
fn refused(folder: &Folder, line: &str, code: Option<i32>, words: &str) {
    let run = folder.run(line);
    let last = run.stderr.lines().last().unwrap_or_default();
    assert!(
        run.stdout.is_empty() && last.starts_with("error: ") && last.contains(words),
        "{line}: {}",
        run.stderr
    );
    assert!(run.stderr.lines().rev().skip(1).all(|line| line.starts_with("note: ")), "{}", run.stderr);
    assert!(code.map_or((2..6).contains(&run.code), |code| run.code == code), "{line}: {}", run.code);
}

#[test]
fn the_elements_of_a_known_cell_come_back() {
    let folder = Folder::new();
    folder.write("z.csv", impedance());
    folder.write("cell.toml", CELL);
    let run = folder.done("fit --from z.csv --structure rc2 -u current -y voltage --report process.json");
    assert!(
        run.stderr.contains(
            "read as frequency in Hz 'freq/Hz', real part 'Re(Z)/Ohm', minus the imaginary part '-Im(Z)/Ohm'"
        ),
        "{}",
        run.stderr
    );
    let report: Value = serde_json::from_str(&folder.read("process.json")).expect("a report");
    let sorted = |pairs: &[(&str, &str)]| -> Vec<[f64; 2]> {
        let mut found: Vec<[f64; 2]> =
            pairs.iter().map(|(r, tau)| [value(&report, r)[0], value(&report, tau)[0]]).collect();
        found.sort_by(|one, other| one[1].total_cmp(&other[1]));
        found
    };
    near(value(&report, "R0")[0], TRUTH[0], 1e-6);
    for (found, truth) in sorted(&[("R1", "tau1"), ("R2", "tau2")]).iter().zip(TRUTH[1..].chunks(2)) {
        near(found[0], truth[0], 1e-6);
        near(found[1], truth[1], 1e-6);
    }
    // The equations name their channels, and the table has none.
    let report = folder.fit("--from z.csv --grey cell.toml --profile --report cell.json");
    for (name, truth) in [("r0", 0.015), ("r1", 0.01), ("c1", 5.0), ("r2", 0.04), ("c2", 200.0)] {
        near(value(&report, name)[0], truth, 1e-6);
    }
    near(number(&report, "/model/figures/1/value"), 8.0, 1e-6);
    assert_eq!(report["data"]["logs"][0]["file"], "z.csv");
    // The document of it goes on: to a log of the cell, to firmware, and back to equations.
    folder.write("log.csv", "t,current,voltage\n0,0,0\n1,1,0.02\n2,1,0.03\n3,0,0.01\n4,0,0\n5,1,0.02\n");
    let renamed = CELL.replace("i = \"current\"", "i = \"amps\"");
    folder.write("renamed.toml", renamed);
    folder.done("simulate cell.json log.csv --time t");
    folder.done("export cell.json --to c --what simulator --sample-time 1 -o out");
    folder.done("fit --from z.csv --grey renamed.toml");
}

/// The figures of an independent program (scipy 1.x, least squares of errors relative to each point, the best of sixty
/// starts), with its standard errors.
#[test]
fn a_measured_cell_is_what_an_independent_program_finds() {
    let folder = Folder::new();
    folder.write("z.csv", include_str!("data/public/cell_impedance.csv"));
    folder.write("cell.toml", CELL);
    let band = "--frequencies 0.1..300";
    let report = folder.fit(&format!("--from z.csv --structure rc3 {band}"));
    assert_eq!(report["estimation"]["samples"], 68);
    near(number(&report, "/estimation/mse"), 4.702_868_9e-4, 1e-6);
    let [resistance, error] = value(&report, "R0");
    near(resistance, 0.021_385_849, 1e-5);
    near(error, 2.255e-4, 1e-2);
    assert_eq!(report["warnings"], serde_json::json!([]), "{report}");
    let report = folder.fit(&format!("--from z.csv --grey cell.toml {band}"));
    near(number(&report, "/estimation/mse"), 1.854_247_08e-3, 1e-6);
    let mut found = [("r1", "tau1", 0), ("r2", "tau2", 1)].map(|(r, _, figure)| {
        let tau = number(&report, &format!("/model/figures/{figure}/value"));
        let error = number(&report, &format!("/model/figures/{figure}/standard_error"));
        [value(&report, r), [tau, error]]
    });
    found.sort_by(|one, other| one[1][0].total_cmp(&other[1][0]));
    let expected = [
        [[0.055_155_83, 6.138e-3], [0.175_950_6, 1.566e-2]],
        [[0.125_034_03, 6.037e-3], [1.015_307_5, 8.179e-2]],
    ];
    for (found, expected) in found.iter().flatten().zip(expected.iter().flatten()) {
        near(found[0], expected[0], 1e-5);
        near(found[1], expected[1], 1e-2);
    }
    near(value(&report, "r0")[0], 0.022_666_238, 1e-5);
}

#[test]
fn tables_without_names_and_of_magnitude_and_phase_are_read() {
    let folder = Folder::new();
    let rows: Vec<Vec<f64>> = impedance()
        .lines()
        .skip(1)
        .map(|line| line.split(',').map(|cell| cell.parse().expect("a number")).collect())
        .collect();
    let [mut bare, mut polar, mut german] =
        [String::new(), "w [rad/s];gain [dB];phase\n".to_owned(), "f;re;im\n".to_owned()];
    for row in &rows {
        let (hertz, re, im) = (row[0], row[1], -row[2]);
        writeln!(bare, "{hertz},{re},{im}").expect("memory");
        let (size, angle) = (20.0 * re.hypot(im).log10(), im.atan2(re).to_degrees());
        writeln!(polar, "{};{size};{angle}", hertz * std::f64::consts::TAU).expect("memory");
        let comma = |value: f64| value.to_string().replace('.', ",");
        writeln!(german, "{};{};{}", comma(hertz), comma(re), comma(im)).expect("memory");
    }
    folder.write("bare.csv", bare);
    folder.write("polar.csv", polar);
    folder.write("german.csv", german);
    for file in ["bare.csv", "polar.csv", "german.csv"] {
        let report = folder.fit(&format!("--from {file} --structure rc2"));
        near(value(&report, "R0")[0], 0.015, 1e-6);
    }
    // A row of units that looks like a comment, and a further column of words.
    let rows =
        impedance().lines().skip(1).map(|row| format!("ok;{}\n", row.replace(',', ";"))).collect::<String>();
    folder.write("rig.csv", format!("state;Freq;Zreal;Zimag;Zmod\n#;Hz;ohm;ohm;ohm\n{rows}"));
    let report = folder.fit("--from rig.csv --skip-rows 1 --delimiter ; --columns=-im=Zimag --structure rc2");
    near(value(&report, "R0")[0], 0.015, 1e-6);
    let report = folder.fit("--from bare.csv --columns hz=1,re=2,im=3 --structure rc2");
    near(value(&report, "R0")[0], 0.015, 1e-6);
}

#[test]
fn what_is_no_frequency_response_is_refused_and_nothing_written() {
    let folder = Folder::new();
    folder.write("cell.toml", CELL);
    for (table, words) in [
        ("", "empty"),
        ("f,re,im\n", "row"),
        ("f,re,im\n1,2,3\n", "more than 2 measured values; give more"),
        ("f,re,im\n0,2,3\n0,2,3\n", "none above frequency 0"),
        ("f,re,im\n1,2,3\n-1,2,3\n2,1,1\n", "z.csv:3"),
        ("f,re,im\n1,2,3\n2,inf,3\n2,1,1\n", "inf"),
        ("f,re,im\n1,two,3\n2,1,1\n", "two"),
        ("t,u,y\n1,2,3\n2,1,1\n", "no frequency response is known by the columns t, u, y"),
        (
            "frequency,magnitude,magnitude_standard_error,phase\n1,2,3,4\n2,1,1,1\n",
            "a table that thetahat wrote",
        ),
        ("frequency [rad/s]  magnitude  standard error\n1  2  3\n4  5  6\n", "a table that thetahat wrote"),
        ("{\"schema\": \"thetahat.response/1\"", "z.csv"),
    ] {
        folder.write("z.csv", table);
        for model in ["--structure rc2", "--grey cell.toml"] {
            refused(&folder, &format!("fit --from z.csv {model} --report r.json"), None, words);
        }
    }
    let constant: String = (1..40).map(|row| format!("{row},5,0\n")).collect();
    folder.write("z.csv", format!("f,re,im\n{constant}"));
    let apart = "cannot tell 'r0', 'r1' and 'r2' apart";
    refused(&folder, "fit --from z.csv --grey cell.toml --report r.json", Some(4), apart);
    folder.write("z.csv", impedance());
    for (line, code, words) in [
        ("--structure rc2 --frequencies 5", 2, "write a band as LOW..HIGH"),
        ("--structure rc2 --frequencies 5..1", 2, "write a band as LOW..HIGH"),
        ("--structure rc2 --frequencies 1e7..1e8", 2, "no point between"),
        ("--structure rc2 --columns real=Re", 3, "a column is one of hz, rad/s"),
        ("--structure rc2 --columns re=Re", 3, "there is no column 'Re'"),
        ("--grey template:battery", 2, "a template finds its start values in a log"),
        ("--grey cell.toml --estimate 1..5", 2, "a frequency response has no rows"),
        ("--grey cell.toml --known r7=1", 2, "no such unknown parameter"),
        ("--na 2 --nb 2", 2, "from"),
        ("--structure rc2 --header-row 99", 3, "99"),
    ] {
        refused(&folder, &format!("fit --from z.csv {line} --report r.json"), Some(code), words);
    }
    // What the response does not tell is named.
    let text = CELL.replace("slow = { start = 0, sd = 0 }", "slow = { start = \"c3\", sd = 0 }");
    folder.write(
        "cell.toml",
        text.replace("[derivative]", "c3 = { start = 1, sd = 1, unknown = true }\n[derivative]"),
    );
    refused(&folder, "fit --from z.csv --grey cell.toml --report r.json", Some(4), "c3");
    assert_eq!(folder.names(), ["cell.toml", "z.csv"]);
}

#[test]
fn a_model_in_continuous_time_lies_over_the_table() {
    let folder = Folder::new();
    folder.write("z.csv", impedance());
    folder.done("fit --from z.csv --structure rc2 --report model.json");
    refused(&folder, "bode model.json --over z.csv", Some(3), "convert it to continuous time first");
    folder.done("convert model.json --to continuous -o continuous.json");
    let csv = folder.done("bode continuous.json --over z.csv").stdout;
    let far = csv.lines().skip(1).filter(|line| {
        let cells: Vec<&str> = line.split(',').collect();
        let number = |place: usize| cells[place].parse::<f64>().expect("a number");
        (number(3) / number(7) - 1.0).abs() > 1e-6
    });
    assert_eq!((csv.lines().count(), far.count()), (51, 0), "{csv}");
}

#[test]
fn state_space_of_a_table_and_of_the_document_of_a_log() {
    let folder = Folder::new();
    folder.write("z.csv", impedance());
    let report = folder.fit("--from z.csv --model ss --order 1..6");
    assert_eq!(report["model"]["kind"], "continuous-state-space");
    let poles: Vec<f64> = report["model"]["poles"]
        .as_array()
        .unwrap()
        .iter()
        .map(|pole| pole["re"].as_f64().unwrap())
        .collect();
    near(-1.0 / poles[0], 0.05, 1e-6);
    near(-1.0 / poles[1], 8.0, 1e-3);
    assert_eq!(poles.len(), 2);
    let run = folder.done("fit --from z.csv --model ss --order 2 --feedthrough yes --report model.json");
    assert!(run.stdout.contains("inputs act at once, as asked for"), "{}", run.stdout);
    folder.done("bode model.json --over z.csv -o over.csv");
    folder.done("convert model.json --to 0.01 -o sampled.json");
    for (line, words) in [
        ("--order 200", "too few for a model of order 200"),
        ("--order 0", "from 1 on"),
        ("--order 2 --nk 1", "a response in continuous time has no samples"),
        ("--order 2 --past 3", "--past: does not work with --from with --model ss"),
        ("--order 2 --estimate 1..5", "--estimate"),
        ("--order 2 -u other -y other", "'other' is the input already"),
    ] {
        refused(&folder, &format!("fit --from z.csv --model ss {line} --report r.json"), None, words);
    }
    folder.write("z.csv", "f,re,im\n1,2,3\n");
    refused(&folder, "fit --from z.csv --model ss --report r.json", Some(4), "give more points");
    // Resistance alone: no pole is told from nothing.
    let constant: String = (1..40).map(|row| format!("{row},5,0\n")).collect();
    folder.write("z.csv", format!("f,re,im\n{constant}"));
    folder.done("fit --from z.csv --model ss --order 1 --feedthrough yes");
}

#[test]
fn a_dead_time_comes_back_over_five_decades() {
    let folder = Folder::new();
    // (2 s + 3) e^(-0.01 s)/(s^2 + 0.4 s + 25), from 0.01 to 1000 rad/s.
    let rows = (0..60).map(|place| {
        let omega = 10.0_f64.powf(-2.0 + 5.0 * f64::from(place) / 59.0);
        let (real, imaginary) = (25.0 - omega * omega, 0.4 * omega);
        let magnitude = (9.0 + 4.0 * omega * omega).sqrt() / real.hypot(imaginary);
        let phase = (2.0 * omega).atan2(3.0) - imaginary.atan2(real) - 0.01 * omega;
        format!("{omega},{magnitude},{}\n", phase.to_degrees())
    });
    folder.write("z.csv", format!("rad/s,magnitude,phase\n{}", rows.collect::<String>()));
    let report = folder.fit("--from z.csv --np 2 --nz 1 --delay");
    for (name, truth) in [("b1", 2.0), ("b0", 3.0), ("a1", 0.4), ("a0", 25.0), ("theta", 0.01)] {
        near(value(&report, name)[0], truth, 1e-5);
    }
}
