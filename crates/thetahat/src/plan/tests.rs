use serde_json::{Map, Value, json};

use super::*;
use crate::Error;
use crate::options::{Kind, OptionRow, Options};

/// Options as text, read.
fn read(text: &str) -> Result<FitOptions, Error> {
    FitOptions::of(&serde_json::from_str::<Map<String, Value>>(text).expect("an object"))
}

#[test]
fn the_table_names_options_that_there_are() {
    let names: Vec<String> = FitOptions::TABLE.iter().map(OptionRow::name).collect();
    let beside = ["grey", "from"];
    for (index, option) in FitOptions::TABLE.iter().enumerate() {
        assert!(!names[..index].contains(&option.name()), "{} stands twice", option.field);
        assert!(!option.help.trim().ends_with('.'), "{}: {}", option.field, option.help);
        let texts = [option.help, option.default].into_iter().map(str::to_owned);
        let words = (option.words)().into_iter().map(|word| word.help.to_owned());
        for text in texts.chain(words) {
            assert_eq!(text.matches('`').count() % 2, 0, "{text}");
            for named in text.split('`').skip(1).step_by(2) {
                assert!(names.iter().any(|name| name == named) || beside.contains(&named), "{named}: {text}");
            }
        }
    }
}

#[test]
fn what_is_written_is_read_back() {
    let all = json!({
        "input": ["u", "a,b"], "output": ["y"], "estimate": ["1..9", "20..30"], "detrend": "start:3",
        "offset": {"u": 4.5, "a=b": -1}, "prefilter": "0.1..", "model": "bj", "na": "1..3", "nb": [2, "1..4"],
        "nk": [0], "taps": [20], "structure": ["p1d", "p2zu"], "delay": true, "initial": "zero", "focus": 5, "order": 3,
        "weighting": "cva", "feedthrough": "no", "refine": "simulation", "narx": "rbf-free", "regressor": ["sqrt(u)"],
        "width": 0.5, "membership": "trapezoid", "select": "aic", "split": "60/20/20", "search": "gauss-newton",
        "step": "1,2", "seed": 18_446_744_073_709_551_615_u64, "time_limit": 1.5, "norm": "huber:2",
        "bound": {"a1": "-2..0", "b1": 0.5}, "dc_gain": {"u": "..3"}, "couple": "auto", "tolerance": 1e-9,
    });
    let options: FitOptions = serde_json::from_value(all.clone()).expect("options");
    let written = serde_json::to_value(&options).expect("an object");
    // Whole numbers have no point, and one value of a list is a list.
    assert_eq!(written["offset"], json!({"u": 4.5, "a=b": -1.0}));
    assert_eq!(written["dc_gain"], json!({"u": "..3"}));
    for (name, value) in all.as_object().expect("an object") {
        if name != "offset" {
            assert_eq!(&written[name], value, "{name}");
        }
    }
    assert_eq!(serde_json::from_value::<FitOptions>(written).expect("options"), options);
}

#[test]
fn values_have_several_forms() -> Result<(), Error> {
    let same = [
        [r#"{"na": 2}"#, r#"{"na": "2"}"#],
        [r#"{"na": 2.0}"#, r#"{"na": "2..2"}"#],
        [r#"{"nb": "2,3"}"#, r#"{"nb": [2, "3"]}"#],
        [r#"{"bound": {"a1": [-2, null]}}"#, r#"{"bound": ["a1=-2.."]}"#],
        [r#"{"dc-gain": [[1, 2]]}"#, r#"{"dc_gain": "1..2"}"#],
        [r#"{"narx": "hinge"}"#, r#"{"narx": "relu"}"#],
        [r#"{"norm": 1.0, "trend": false}"#, r#"{"norm": "1", "na": null}"#],
    ];
    for [one, other] in same {
        assert_eq!(read(one)?, read(other)?, "{one}");
    }
    Ok(())
}

#[test]
fn what_cannot_be_is_refused_with_its_name() {
    for (text, option, part) in [
        (r#"{"nq": 1}"#, "nq", "no such option; did you mean 'na'?"),
        (r#"{"wavelet": 1}"#, "wavelet", "no such option"),
        (r#"{"na": -1}"#, "na", "'-1' is not an order"),
        (r#"{"na": [1, 2, 3]}"#, "na", "neither a text nor a number"),
        (r#"{"na": true}"#, "na", "true is neither"),
        (r#"{"nb": {}}"#, "nb", "there is none"),
        (r#"{"model": "arxx"}"#, "model", "'arxx' is none of arx, armax"),
        (r#"{"trend": 1}"#, "trend", "1 is neither true nor false"),
        (r#"{"ridge": "nan"}"#, "ridge", "not a finite number"),
        (r#"{"offset": {"u": "x"}}"#, "offset", "NAME=VALUE"),
        (r#"{"max_iterations": 2.5}"#, "max-iterations", "'2.5' is not a whole number"),
        (r#"{"step": "0"}"#, "step", "C1,C2"),
        (r#"{"norm": 3}"#, "norm", "give 2, 1, huber"),
        (r#"{"estimate": "9..1"}"#, "estimate", "9..1"),
    ] {
        match read(text) {
            Err(Error::Argument { argument, message }) => {
                assert_eq!(argument, option, "{text}");
                assert!(message.contains(part), "{text}: {message}");
            }
            other => panic!("{text}: {other:?}"),
        }
    }
}

#[test]
fn a_kind_of_model_takes_its_own_options() -> Result<(), Error> {
    let log = Fitted::Log { several_outputs: false };
    for (text, fitted, kind) in [
        ("{}", log, Kind::POLYNOMIAL),
        (r#"{"narx": "none"}"#, log, Kind::POLYNOMIAL),
        (r#"{"model": "fir"}"#, log, Kind::IMPULSE_RESPONSE),
        (r#"{"np": 2}"#, log, Kind::PROCESS),
        (r#"{"structure": "p1"}"#, Fitted::Response, Kind::RESPONSE),
        (r#"{"model": "ss", "order": "1..4"}"#, Fitted::Response, Kind::RESPONSE_STATES),
        (r#"{"narx": "auto"}"#, log, Kind::NONLINEAR_ARX),
        (r#"{"blocks": "wh"}"#, log, Kind::BLOCKS),
        ("{}", Fitted::Equations, Kind::EQUATIONS),
        ("{}", Fitted::Log { several_outputs: true }, Kind::STATE_SPACE),
        (r#"{"output": ["a", "b"], "nb": 0}"#, log, Kind::STATE_SPACE),
        (r#"{"output": ["a", "b"], "na": 1}"#, log, Kind::VECTOR_ARX),
        (r#"{"output": ["a", "b"], "nf": 1}"#, log, Kind::POLYNOMIAL),
    ] {
        assert_eq!(read(text)?.kind(fitted)?.kind, kind, "{text}");
    }
    for (text, fitted, message) in [
        (
            r#"{"norm": 1, "structure": "p1d"}"#,
            log,
            "norm: does not work with `structure`; leave one of the two out",
        ),
        (r#"{"na": 2, "model": "ss"}"#, log, "na: does not work with `model` ss; leave one of the two out"),
        (r#"{"na": 2}"#, Fitted::Equations, "na: does not work with `grey`; leave one of the two out"),
        (r#"{"degree": 2}"#, log, "degree: it is for `narx` and `blocks`; leave it out, or give that"),
        (r#"{"past": 2, "output": ["a", "b"], "na": 1}"#, log, "past: does not work with several outputs"),
        (r#"{"couple": "full"}"#, log, "couple: it is for `model` arx with several outputs; leave it out"),
    ] {
        let error = read(text)?.kind(fitted).err().map(|error| error.to_string()).unwrap_or_default();
        assert!(error.contains(message), "{text}: {error}");
    }
    Ok(())
}
