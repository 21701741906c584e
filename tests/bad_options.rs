//! Options that do not go together, or make no sense: refused in one line, before anything is read.

use crate::harness::Folder;
use crate::signals::plain_log;

/// Fits nothing, as each line is refused with exit code 2 and in words that have the parts.
fn refused(lines: &[(&str, &[&str])]) {
    // Without a log: what can be said without one comes first.
    let folder = Folder::new();
    for (line, parts) in lines {
        let refusal = folder.refused(&format!("fit nowhere.csv {line} --report model.json"), 2);
        for part in *parts {
            assert!(refusal.contains(part), "{line}: {part}: {refusal}");
        }
        assert!(folder.names().is_empty());
    }
}

#[test]
fn orders_that_a_model_needs() {
    refused(&[
        ("--nb 2", &["--model: arx needs --na"]),
        ("--na 2", &["--model: arx needs --nb"]),
        ("--model armax --na 2 --nb 2", &["--model: armax needs --nc"]),
        ("--model arma --nc 1", &["--model: arma needs --na"]),
        ("--model oe --nb 2", &["--model: oe needs --nf"]),
        ("--model bj --nb 2 --nf 2", &["--model: bj needs --nc, --nd"]),
        ("--model general", &["--model: general needs orders", "--na, --nb, --nc, --nd, --nf"]),
        ("--model general --na 0", &["no parameters"]),
    ]);
}

#[test]
fn orders_that_a_model_does_not_take() {
    refused(&[
        ("--na 2 --nb 2 --nc 1", &["--model: arx does not take --nc"]),
        ("--model armax --na 2 --nb 2 --nc 1 --nf 1", &["--model: armax does not take --nf"]),
        ("--model oe --na 2 --nb 2 --nf 2", &["--model: oe does not take --na", "--nb, --nf"]),
        ("--model bj --na 1 --nb 2 --nc 1 --nd 1 --nf 2", &["--model: bj does not take --na"]),
        ("--model arma --na 2 --nc 1 --nb 2", &["--model: arma does not take --nb"]),
        ("--model ar --na 2 --nk 2", &["--model: ar does not take --nk", "no inputs"]),
        ("--model ar --na 2 --nc 1", &["--model: ar does not take --nc"]),
    ]);
}

#[test]
fn inputs_of_a_model_without_any() {
    refused(&[
        ("--model arma --na 2 --nc 1 -u u", &["without inputs", "--input"]),
        ("--na 2 --nb 0 -u u", &["without inputs", "--input"]),
        ("--model general --na 1 --nf 1", &["--nf", "--nb"]),
        ("--model oe --nb 0 --nf 1", &["--nf", "--nb"]),
    ]);
}

#[test]
fn orders_for_another_number_of_inputs() {
    refused(&[
        ("--model oe -u a,b --nb 2 --nf 2,1,1", &["--nf: 3 values for 2 inputs"]),
        ("--model oe -u a --nb 2,1 --nf 2", &["--nb: 2 values for 1 input;"]),
        ("--model oe -u a,b --nb 2,0 --nf 1,2", &["--nf: input 2 has F without B"]),
        ("--model oe -u a --nb 1001 --nf 2", &["1000"]),
    ]);
    let folder = Folder::with_log(plain_log());
    folder.assert_refused("fit log.csv --model oe --nb 2 --nf 2,2", 2, "--nf: 2 values for 1 input");
}

#[test]
fn a_search_where_there_is_none() {
    for option in
        ["--search lm", "--max-iterations 5", "--tolerance 1e-9", "--step 1", "--starts 2", "--time-limit 3"]
    {
        let name = option.split(' ').next().unwrap();
        for model in [
            "--na 2 --nb 2",
            "--model ar --na 2",
            "--model general --na 1 --nb 1",
            "--model bj --nb 1 --nc 0 --nd 0 --nf 0",
        ] {
            refused(&[(&format!("{model} {option}"), &[name, "one step"])]);
        }
    }
}

#[test]
fn search_options_that_make_no_sense() {
    let oe = "--model oe --nb 2 --nf 2";
    for (options, parts) in [
        ("--step 1", &["--step", "--search gradient"][..]),
        ("--search newton --step 1", &["--step", "--search gradient"]),
        ("--search gradient --step 0", &["--step: '0'", "C1,C2"]),
        ("--search gradient --step 1,-2", &["--step: '1,-2'", "C1,C2"]),
        ("--search gradient --step 1,2,3", &["--step: '1,2,3'", "C1,C2"]),
        ("--search gradient --step inf", &["--step: 'inf'", "C1,C2"]),
        ("--tolerance 0", &["--tolerance: 0", "positive"]),
        ("--tolerance -1e-9", &["--tolerance", "positive"]),
        ("--tolerance nan", &["--tolerance: 'nan'", "finite"]),
        ("--time-limit 0", &["--time-limit: 0", "positive"]),
        ("--time-limit -3", &["--time-limit: -3", "positive"]),
        ("--time-limit 1e300", &["--time-limit: 1e300", "too long"]),
        ("--initial drop", &["--initial: drop", "without F"]),
    ] {
        refused(&[(&format!("{oe} {options}"), parts)]);
    }
}

#[test]
fn words_that_the_parser_does_not_know() {
    let folder = Folder::new();
    for options in [
        "--model neural --na 2",
        "--na -1 --nb 2",
        "--na 2.5 --nb 2",
        "--na 2 --nb 2,x",
        "--model oe --nb 2 --nf 2 --search tabu",
        "--model oe --nb 2 --nf 2 --initial guess",
        "--model oe --nb 2 --nf 2 --max-iterations 0",
        "--model oe --nb 2 --nf 2 --max-iterations 99999999999999999999",
        "--model oe --nb 2 --nf 2 --starts -1",
        "--model oe --nb 2 --nf 2 --starts 99999999",
        "--model oe --nb 2 --nf 2 --seed 1",
        "--model oe --nb 2 --nf 2 --tolerance small",
        "--model oe --nb 2 --nf 2 --time-limit soon",
    ] {
        let run = folder.run(&format!("fit nowhere.csv {options}"));
        assert_eq!((run.code, run.stdout.as_str()), (2, ""), "{options}");
        assert!(run.stderr.starts_with("error: "), "{options}: {}", run.stderr);
    }
}
