//! Names from logs and reports may hold anything. What is printed does not: neither what a terminal obeys, nor what a
//! spreadsheet takes for a formula, nor a line without end.

use serde_json::{Value, json};
use thetahat::text::is_invisible;

use crate::harness::{Folder, Run};
use crate::signals::{Experiment, csv, plain_log};

/// Moves the cursor, sets the title, turns the direction, hides a letter, and begins a formula.
const INPUT: &str = "=u\u{1b}[2J\u{9b}31m\u{202e}\u{200b}\u{2066}\u{feff}x\u{7f}";
const OUTPUT: &str = "@y\u{1b}]0;title\u{7}\u{200f}\u{e0041}";

/// A log with such names, and a report of its fit.
fn folder() -> Folder {
    let Experiment { u, y } = Experiment::new(200);
    let folder = Folder::with_log(csv(&[(INPUT, &u), (OUTPUT, &y)]));
    folder.done(&format!("fit log.csv -u '{INPUT}' -y '{OUTPUT}' --na 2 --nb 2 --report model.json"));
    folder
}

fn is_harmless(run: &Run) -> bool {
    [&run.stdout, &run.stderr].iter().all(|text| text.lines().all(|line| !line.contains(is_invisible)))
}

#[test]
fn nothing_that_is_printed_holds_what_is_not_seen() {
    let folder = folder();
    let fit = format!("fit log.csv -u '{INPUT}' -y '{OUTPUT}' --na 2 --nb 2");
    let track = format!("track log.csv -u '{INPUT}' -y '{OUTPUT}' --na 1 --nb 1");
    for line in [
        fit.clone(),
        format!("{fit} --format json"),
        format!("{fit} --offset '{OUTPUT}=1'"),
        format!("fit log.csv -u '{INPUT}' -y '{OUTPUT}' --model oe --nb 1 --nf 1"),
        "inspect log.csv".to_owned(),
        format!("inspect log.csv -u '{INPUT}' -y '{OUTPUT}' --format json"),
        "predict model.json log.csv".to_owned(),
        "simulate model.json log.csv".to_owned(),
        "validate model.json log.csv".to_owned(),
        "validate model.json log.csv --format json".to_owned(),
        "compare model.json model.json log.csv".to_owned(),
        "bode model.json".to_owned(),
        "step model.json".to_owned(),
        "impulse model.json".to_owned(),
        track.clone(),
        format!("{track} --format csv"),
        "filter model.json log.csv".to_owned(),
        "filter model.json log.csv --format csv".to_owned(),
        "track log.csv --warm model.json".to_owned(),
    ] {
        let run = folder.done(&line);
        assert!(is_harmless(&run), "{line}: {run:?}");
    }
    // What is refused, too.
    folder.write("other.csv", format!("{INPUT}\u{1b},{OUTPUT}\n1,2\nx\u{1b}\u{202e},3\n"));
    for line in [
        "fit other.csv --na 2 --nb 2",
        "predict model.json other.csv",
        "track other.csv --na 1 --nb 1",
        &format!("fit log.csv -u '{INPUT}x' -y '{OUTPUT}' --na 2 --nb 2"),
        &format!("fit '{INPUT}.csv' --na 2 --nb 2"),
        &format!("fit log.csv '--na={INPUT}' --nb 2"),
        &format!("{INPUT} log.csv"),
    ] {
        let run = folder.run(line);
        assert!(run.code > 0 && is_harmless(&run), "{line}: {run:?}");
    }
}

#[test]
fn documents_keep_the_names() {
    let folder = folder();
    let report: Value = serde_json::from_str(&folder.read("model.json")).unwrap();
    assert_eq!(
        (&report["model"]["inputs"][0]["name"], &report["model"]["outputs"][0]["name"]),
        (&json!(INPUT), &json!(OUTPUT))
    );
    let run = folder.done("filter model.json log.csv --every 100");
    let line: Value = serde_json::from_str(run.stdout.lines().next().unwrap()).unwrap();
    assert!(line.get(format!("measured_{OUTPUT}")).is_some(), "{line}");
}

#[test]
fn a_cell_is_no_formula() {
    let folder = folder();
    let shown = thetahat::text::harmless(INPUT);
    let first = |line: &str| -> Vec<String> {
        let run = folder.done(line);
        let mut rows = csv::Reader::from_reader(run.stdout.as_bytes());
        let header = rows.headers().unwrap().iter().map(str::to_owned).collect::<Vec<_>>();
        header
            .into_iter()
            .chain(rows.records().flat_map(|row| row.unwrap().iter().map(str::to_owned).collect::<Vec<_>>()))
            .collect()
    };
    let cells = first("bode model.json --points 2");
    assert!(cells.contains(&format!("'{shown}")), "{cells:?}");
    // Numbers below 0 stay numbers.
    assert!(cells.iter().any(|cell| cell.starts_with('-') && cell.parse::<f64>().is_ok()), "{cells:?}");
    // An input that is held is named in its row.
    let mut rows: Vec<String> = folder.read("log.csv").lines().map(str::to_owned).collect();
    rows[50] = format!(",{}", rows[50].split_once(',').unwrap().1);
    folder.write("log.csv", rows.join("\n") + "\n");
    let cells = first("filter model.json log.csv --format csv");
    assert!(cells.contains(&format!("'{shown}")), "{cells:?}");
    let formula = |cell: &String| cell.starts_with(['=', '+', '-', '@']) && cell.parse::<f64>().is_err();
    assert!(!cells.iter().any(formula), "{cells:?}");
}

/// Takes 15 s: cells, names and numbers of three million characters in every file, read by up to five commands.
#[test]
fn what_is_said_of_a_damaged_file_is_a_line_one_can_read() {
    let folder = Folder::with_log(plain_log());
    folder.done("fit log.csv --na 2 --nb 2 --report model.json");
    folder.done("track log.csv --na 1 --nb 1 --state state.json");
    let long = "x".repeat(3_000_000);
    let check = |line: &str| {
        let run = folder.run(line);
        assert!(matches!(run.code, 2 | 3), "{line}: {}", run.code);
        assert!(
            run.stderr.lines().count() < 10 && run.stderr.len() < 1200,
            "{line}: {} bytes",
            run.stderr.len()
        );
        assert!(!run.stderr.contains("xxxx") || run.stderr.contains('…'), "{line}: {}", run.stderr);
    };
    let verbs = [
        "predict model.json log.csv",
        "validate model.json log.csv",
        "filter model.json log.csv",
        "track log.csv --warm model.json",
        "bode model.json",
    ];
    let whole: Value = serde_json::from_str(&folder.read("model.json")).unwrap();
    for place in [
        "/schema",
        "/model/structure",
        "/model/sample_time",
        "/model/a",
        "/model/orders",
        "/model/inputs",
        "/estimation",
    ] {
        let mut edited = whole.clone();
        *edited.pointer_mut(place).unwrap() = long.clone().into();
        folder.write("model.json", edited.to_string());
        verbs.iter().for_each(|line| check(line));
    }
    for text in
        [format!("{{\"schema\": \"thetahat.report/1\", \"{long}\": "), format!("{{\"{long}\""), long.clone()]
    {
        folder.write("model.json", text);
        verbs.iter().for_each(|line| check(line));
    }
    let mut named = whole.clone();
    named["model"]["inputs"][0]["name"] = long.clone().into();
    folder.write("model.json", named.to_string());
    check("predict model.json log.csv");
    check("validate model.json log.csv");

    let state = folder.read("state.json");
    for (from, to) in [
        ("thetahat.track-state/1", long.as_str()),
        ("\"rows\":", &format!("\"{long}\":")),
        ("\"rls\"", &format!("\"{long}\"")),
        ("exponential", &long),
        ("\"--every\",\"1\"", &format!("\"--every\",\"{long}\"")),
    ] {
        assert!(state.contains(from), "{from}: {state}");
        folder.write("state.json", state.replace(from, to));
        check("track log.csv --na 1 --nb 1 --state state.json");
    }

    for text in [
        format!("{long} = 1"),
        format!("sample_time = \"{long}\""),
        format!("sample_time = {long}"),
        format!("[{long}]\na = 1"),
        format!("sample_time = 1\nstates = ['{long}', '{long}']\nF = [[1]]"),
        format!(
            "sample_time = 1\n[states]\nx = {{ start = 0, sd = 1 }}\n[next]\nx = '{long}'\n[outputs]\ny = 'x'"
        ),
    ] {
        folder.write("model.toml", text);
        check("filter model.toml log.csv");
        check("fit --grey model.toml log.csv");
    }

    for log in [
        format!("{long}\n1\n"),
        format!("u,y\n1,{long}\n"),
        format!("u,{long}\n1,2\n"),
        format!("u,y\n1,\"{long}\n"),
    ] {
        folder.write("bad.csv", log);
        check("fit bad.csv --na 2 --nb 2");
        check("track bad.csv --na 1 --nb 1 --strict");
        check(&format!("fit bad.csv --na 2 --nb 2 --time {}", &long[..1000]));
    }
}
