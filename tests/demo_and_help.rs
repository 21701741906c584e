//! What a first user meets: the demo, the help and its examples, manual pages and completions.

use serde_json::Value;

use crate::harness::Folder;
use crate::signals::{Experiment, csv};

const VERBS: [&str; 24] = [
    "fit",
    "inspect",
    "spectrum",
    "predict",
    "simulate",
    "validate",
    "compare",
    "track",
    "filter",
    "bode",
    "step",
    "reduce",
    "convert",
    "model",
    "tune",
    "control",
    "export",
    "impulse",
    "design",
    "templates",
    "demo",
    "schema",
    "completions",
    "man",
];

/// The examples of a help text, as far as the shell would pass them to the program.
fn examples(help: &str) -> Vec<String> {
    let joined = help.replace("\\\n", " ");
    let lines = joined.lines().filter_map(|line| line.strip_prefix("  thetahat "));
    let upto = |line: &str, end: &str| line.split(end).next().unwrap_or_default().to_owned();
    lines.map(|line| upto(&upto(line, " > "), " | ").trim().to_owned()).collect()
}

#[test]
fn the_demo_writes_log_and_report_and_prints_what_fit_prints() {
    let folder = Folder::new();
    let demo = folder.done("demo");
    assert_eq!(demo.stderr, "");
    let (command, table) = demo.stdout.split_once("\n\n").unwrap();
    let words = command.strip_prefix("thetahat ").unwrap();
    let report = folder.read("thetahat-demo/dc_motor.json");
    assert_eq!(folder.done(words).stdout, table);
    assert_eq!(folder.read("thetahat-demo/dc_motor.json"), report);
    assert!(report.starts_with('{') && folder.read("thetahat-demo/dc_motor.csv").starts_with("t,u,y\n"));
    assert!(table.contains("\nstable\n"), "{table}");
}

#[test]
fn the_demo_goes_to_the_folder_that_is_named_as_often_as_it_is_run() {
    let folder = Folder::new();
    let first = folder.done("demo some/where");
    assert_eq!(folder.done("demo some/where").stdout, first.stdout);
    assert!(folder.read("some/where/dc_motor.json").starts_with('{'));
    assert_eq!(folder.names(), ["some"]);
}

#[test]
fn a_demo_that_cannot_write_says_so() {
    let folder = Folder::new();
    folder.write("file", "");
    for place in ["file", "file/below"] {
        folder.assert_refused(&format!("demo {place}"), 5, place);
    }
}

#[test]
fn every_verb_has_examples_and_they_run() {
    let Experiment { u, y } = Experiment::new(1000);
    let times: Vec<f64> = (0..1000).map(|row| 0.08 * f64::from(row)).collect();
    let folder =
        Folder::with_log(csv(&[("t", &times), ("u", &u), ("y", &y), ("heater", &u), ("temperature", &y)]));
    let rises = |t: i32| 20.0 + 5.0 * (1.0 - (-f64::from((t - 100).max(0)) / 60.0).exp());
    let heater: Vec<f64> = (0..1000).map(|t| if t < 100 { 1.0 } else { 3.0 }).collect();
    let temperature: Vec<f64> = (0..1000).map(rises).collect();
    folder.write("steps.csv", csv(&[("t", &times), ("heater", &heater), ("temperature", &temperature)]));
    folder.write("sunspots.csv", csv(&[("count", &y)]));
    for day in ["monday.csv", "tuesday.csv"] {
        folder.write(day, csv(&[("u", &u), ("y", &y)]));
    }
    folder.write(
        "level.toml",
        "sample_time = 1\noutputs = ['y']\nF = [[1]]\nH = [[1]]\nQ = [[1]]\nR = [[1]]\nP0 = [[100]]\n",
    );
    folder.write(
        "spring.toml",
        "sample_time = 0.08\n[states]\nx = { start = 20, sd = 5 }\n[inputs]\nforce = 'u'\n[parameters]\n\
         a = { start = 0.5, sd = 1, unknown = true, min = -1, max = 1 }\n[next]\nx = '20 + a * (x - 20) + force - 5'\n\
         [outputs]\ny = 'x'\n[noise]\nprocess = { x = 1 }\nmeasurement = { y = 0.5 }\n",
    );
    folder.done("fit steps.csv --time t -u heater -y temperature --structure p1d --report heater.json");
    for verb in VERBS {
        let examples = examples(&folder.done(&format!("{verb} --help")).stdout);
        assert!(!examples.is_empty(), "{verb}");
        // Whatever the last fit left there is not for every verb.
        folder.done("fit log.csv --na 2 --nb 2 --report model.json");
        for example in examples {
            assert!(example.starts_with(verb), "{example}");
            folder.done(&format!("{example} --help"));
            folder.done(&example);
        }
    }
}

#[test]
fn help_lists_the_verbs_and_the_exit_codes() {
    let help = Folder::new().done("--help").stdout;
    for verb in VERBS {
        assert!(help.contains(&format!("\n  {verb} ")), "{verb}");
    }
    for code in [
        "0  done",
        "2  usage",
        "3  bad data",
        "4  the data cannot",
        "5  input/output",
        "6  the model does not meet",
        "7  track ended at an alarm",
        "130  interrupted",
    ] {
        assert!(help.contains(&format!("\n  {code}")), "{code}");
    }
}

#[test]
fn every_document_has_a_schema() {
    let folder = Folder::new();
    for name in [
        "report",
        "validation",
        "comparison",
        "inspection",
        "topics",
        "response",
        "step",
        "tuning",
        "control",
        "track",
        "filter",
        "design",
        "normal-equations",
    ] {
        let schema: Value =
            serde_json::from_str(&folder.done(&format!("schema {name}")).stdout).expect("it is JSON");
        let description = schema["description"].as_str().unwrap_or_default();
        assert!(description.contains(&format!("`thetahat.{name}/1`")), "{description}");
        assert_eq!(schema["properties"]["schema"]["type"], "string", "{name}");
    }
}

#[test]
fn help_of_fit_lists_its_options() {
    let help = Folder::new().done("fit --help").stdout;
    for option in [
        "-u, --input",
        "-y, --output",
        "--time",
        "--time-format",
        "--sample-time",
        "--resample",
        "--estimate",
        "--validate",
        "--detrend",
        "--offset",
        "--model",
        "--na",
        "--nb",
        "--nc",
        "--nd",
        "--nf",
        "--nk",
        "--method",
        "--initial",
        "--search",
        "--max-iterations",
        "--tolerance",
        "--step",
        "--starts",
        "--seed",
        "--time-limit",
        "--norm",
        "--bound",
        "--dc-gain",
        "--ridge",
        "--noise-bound",
        "--report",
        "--format",
        "--delimiter",
        "--decimal-comma",
        "--no-header",
        "--skip-rows",
        "--comment",
        "--missing",
        "--encoding",
    ] {
        assert!(help.contains(&format!(" {option}")), "{option}");
    }
}

#[test]
fn without_a_verb_there_is_help_and_exit_code_2() {
    let run = Folder::new().run("");
    assert_eq!((run.code, run.stdout.as_str()), (2, ""));
    assert!(run.stderr.contains("Usage: thetahat"), "{}", run.stderr);
}

#[test]
fn command_lines_that_make_no_sense_are_exit_code_2() {
    let folder = Folder::new();
    for line in [
        "dance",
        "fit",
        "fit log.csv --na 2",
        "fit log.csv --na 2",
        "fit log.csv --na two --nb 2",
        "predict",
        "man dance",
    ] {
        let run = folder.run(line);
        assert_eq!((run.code, run.stdout.as_str()), (2, ""), "{line}");
        assert!(run.stderr.starts_with("error: "), "{line}: {}", run.stderr);
    }
}

#[test]
fn it_knows_its_version() {
    assert_eq!(Folder::new().done("--version").stdout, concat!("thetahat ", env!("CARGO_PKG_VERSION"), "\n"));
}

#[test]
fn there_is_a_manual_page_for_the_program_and_every_verb() {
    let folder = Folder::new();
    let page = folder.done("man").stdout;
    assert!(page.contains(".TH thetahat 1") && page.contains("Exit codes"), "{page}");
    for verb in VERBS {
        let page = folder.done(&format!("man {verb}")).stdout;
        assert!(page.contains(&format!(".TH thetahat-{verb} 1")), "{verb}");
        assert!(page.contains("Example"), "{verb}");
    }
}

#[test]
fn there_are_completions_for_every_shell() {
    for shell in ["bash", "elvish", "fish", "powershell", "zsh"] {
        let script = Folder::new().done(&format!("completions {shell}")).stdout;
        for word in VERBS.into_iter().chain(["detrend", "horizon"]) {
            assert!(script.contains(word), "{shell}: {word}");
        }
    }
}
