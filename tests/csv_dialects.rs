//! However a log is written, the report is the same but for the file's name.

use std::fmt::Write as _;
use std::io::Write as _;

use serde_json::Value;

use crate::harness::{Folder, distance, number, parameters};
use crate::signals::{Experiment, csv, plain_log};

const FIT: &str = "--na 2 --nb 2 --validate 150..200";

/// A report without the file's name.
fn without_name(mut report: Value) -> Value {
    report["data"]["logs"][0]["file"] = Value::Null;
    report
}

/// Fits a log written in some way, and the plain one.
fn assert_same(log: impl AsRef<[u8]>, options: &str) {
    let folder = Folder::with_log(plain_log());
    folder.write("written.csv", log);
    let report = |log: &str, options: &str| {
        let run = folder.done(&format!("fit {log} {FIT} {options} --format json"));
        assert_eq!(
            run.stderr,
            "warning: validation rows overlap estimation rows: their figures flatter the model\n"
        );
        without_name(serde_json::from_str(&run.stdout).expect("the report is JSON"))
    };
    assert_eq!(report("written.csv", options), report("log.csv", ""), "{options}");
}

/// The plain log, line by line as another writer would have it.
fn rewritten(line: impl Fn(&str) -> String) -> String {
    plain_log().lines().map(line).collect()
}

#[test]
fn semicolons_and_tabs() {
    for delimiter in [";", "\t"] {
        assert_same(plain_log().replace(',', delimiter), "");
    }
    assert_same(plain_log().replace(',', "|"), "--delimiter |");
    assert_same(plain_log().replace(',', " "), "--delimiter ' '");
    assert_same(plain_log().replace(',', "   "), "--delimiter blanks");
    assert_same(plain_log().replace(',', " \t "), "");
    assert_same(format!("sep=;\n{}", plain_log().replace(',', ";")), "");
    assert_same(plain_log().replace(',', "\t"), "--delimiter tab");
}

#[test]
fn decimal_commas() {
    let log = plain_log().replace(',', ";").replace('.', ",");
    for options in ["--decimal-comma", "--decimal-comma=yes", ""] {
        assert_same(&log, options);
        assert_same(log.replace(';', "\t"), options);
    }
}

#[test]
fn quoted_fields() {
    assert_same(rewritten(|line| format!("\"{}\"\n", line.replace(',', "\",\""))), "");
    // Decimal commas within quotes.
    let quoted = rewritten(|line| format!("\"{}\"\n", line.replace(',', "\";\"").replace('.', ",")));
    assert_same(&quoted, "--decimal-comma");
    assert_same(quoted, "");
}

#[test]
fn carriage_returns() {
    assert_same(rewritten(|line| format!("{line}\r\n")), "");
}

#[test]
fn blanks_around_fields() {
    assert_same(rewritten(|line| format!(" {}  \n", line.replace(',', " ,  "))), "");
}

#[test]
fn blank_last_lines_and_none_at_all() {
    assert_same(plain_log() + "\n\n  \n\r\n", "");
    assert_same(plain_log().trim_end(), "");
    assert_same("\n\n".to_owned() + &plain_log(), "");
}

#[test]
fn a_byte_order_mark() {
    assert_same("\u{feff}".to_owned() + &plain_log(), "");
}

#[test]
fn utf16_of_both_ends() {
    let marked = "\u{feff}".to_owned() + &plain_log();
    assert_same(marked.encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<u8>>(), "");
    assert_same(marked.encode_utf16().flat_map(u16::to_be_bytes).collect::<Vec<u8>>(), "");
    // Without a mark it must be said.
    let plain = plain_log().encode_utf16().flat_map(u16::to_le_bytes).collect::<Vec<u8>>();
    assert_same(plain, "--encoding utf-16le");
}

#[test]
fn names_in_latin1() {
    let Experiment { u, y } = Experiment::new(200);
    let text = csv(&[("u [V]", &u), ("\u{b0}C", &y)]);
    let latin1: Vec<u8> = text.chars().map(|character| character as u32 as u8).collect();
    let folder = Folder::with_log(latin1);
    let report = folder.fit("log.csv --encoding latin1 -u 'u [V]' -y \u{b0}C --na 2 --nb 2");
    assert_eq!(report["model"]["outputs"][0]["name"], "\u{b0}C");
    assert_eq!(report["model"]["inputs"][0]["name"], "u [V]");
    folder.assert_refused("fit log.csv -u 'u [V]' -y \u{b0}C --na 2 --nb 2", 3, "log.csv");
}

#[test]
fn gzip() {
    for log in [plain_log(), plain_log().replace(',', ";")] {
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
        encoder.write_all(log.as_bytes()).unwrap();
        assert_same(encoder.finish().unwrap(), "");
    }
}

#[test]
fn gzip_in_two_members() {
    let log = plain_log();
    let mut both = Vec::new();
    for half in [&log[..3000], &log[3000..]] {
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        encoder.write_all(half.as_bytes()).unwrap();
        both.extend(encoder.finish().unwrap());
    }
    assert_same(both, "");
}

#[test]
fn comments() {
    let log =
        "# made by hand; with care, 2024\n".to_owned() + &plain_log().replacen("\n", "\n# units: V, m\n", 1);
    assert_same(&log, "--comment #");
    assert_same(log.replace('#', "%"), "--comment %");
    assert_same(&log, "");
    assert_same(log + "# the end\n", "--comment #");
}

#[test]
fn a_row_of_units() {
    assert_same(plain_log().replacen('\n', "\nV,rad/s\n", 1), "--skip-rows 1");
    assert_same(plain_log().replacen('\n', "\nV,rad/s\n-,-\n", 1), "--skip-rows 2");
    let told = |log: String, words: &str| {
        let run = Folder::with_log(log).run(&format!("fit log.csv {FIT}"));
        assert_eq!(run.code, 0, "{}", run.stderr);
        assert!(run.stderr.contains(words), "{}", run.stderr);
    };
    told(plain_log().replacen('\n', "\nV,rad/s\n", 1), "log.csv: line 2 is read as units; --skip-rows says");
    told(
        format!("Logger 12\n\n{}", plain_log()),
        "log.csv: the names are on line 3, and what is above is left out; --header-row",
    );
}

#[test]
fn other_columns_do_not_matter() {
    let log = rewritten(|line| {
        let (u, y) = line.split_once(',').expect("two fields");
        format!("{y},some text; with \u{b5},{u},,oops\n")
    });
    assert_same(log.replacen("some text; with \u{b5}", "note", 1), "-u u");
}

#[test]
fn no_header() {
    let Experiment { u, y } = Experiment::new(200);
    let log = csv(&[("1", &u), ("2", &y)]);
    let folder = Folder::with_log(&log);
    folder.write("bare.csv", log.split_once('\n').unwrap().1);
    let report = |log: &str| without_name(folder.fit(&format!("{log} -u 1 -y 2 --na 2 --nb 2")));
    assert_eq!(report("bare.csv --no-header"), report("log.csv"));
}

#[test]
fn standard_input() {
    let folder = Folder::with_log(plain_log());
    let run = folder.run_on(&format!("fit - {FIT} --format json"), plain_log());
    assert_eq!(run.code, 0, "{}", run.stderr);
    let report: Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!(without_name(report), without_name(folder.planned(&format!("log.csv {FIT}"))));
}

#[test]
fn missing_values_in_all_their_spellings() {
    let log = |token: &str| {
        let rewrite = |(number, line): (usize, &str)| match (number, line.split_once(',')) {
            (20, Some((u, _))) => format!("{u},{token}\n"),
            (50, Some((_, y))) => format!("{token},{y}\n"),
            _ => format!("{line}\n"),
        };
        plain_log().lines().enumerate().map(rewrite).collect::<String>()
    };
    let folder = Folder::with_log(log(""));
    let expected = without_name(folder.fit("log.csv --na 2 --nb 2"));
    assert_eq!(number(&expected, "/data/missing/0/rows"), 1.0);
    assert_eq!(number(&expected, "/data/missing/1/rows"), 1.0);
    assert_eq!(expected["data"]["segments"], serde_json::json!([[1, 19], [21, 49], [51, 200]]));
    let warnings = expected["warnings"].to_string();
    assert!(
        warnings.contains("'u' misses 1 of 200") && warnings.contains("'y' misses 1 of 200"),
        "{warnings}"
    );
    let simulated = folder.fit("log.csv --model oe --nb 2 --nf 2")["warnings"].to_string();
    for word in
        ["'u' misses 1 of 200 values; the log is cut", "'y' misses 1 of 200 values; these rows do not count"]
    {
        assert!(simulated.contains(word), "{simulated}");
    }
    for (token, option) in [
        ("NaN", ""),
        ("nan", ""),
        ("NA", ""),
        ("null", ""),
        ("N/A", ""),
        ("  ", ""),
        ("\"\"", ""),
        ("-999", "--missing -999"),
        ("-999.0", "--missing -999"),
        ("bad", "--missing bad"),
        ("---", "--missing ---"),
        ("?", "--missing x --missing ?"),
    ] {
        folder.write("log.csv", log(token));
        let report = without_name(folder.fit(&format!("log.csv --na 2 --nb 2 {option}")));
        assert_eq!(report, expected, "{token}");
    }
}

#[test]
fn numbers_in_all_their_spellings() {
    let mut log = String::from("u,y\n");
    let Experiment { u, y } = Experiment::new(200);
    for (row, (u, y)) in u.iter().zip(&y).enumerate() {
        let sign = if *u < 0.0 { "" } else { "+" };
        match row % 3 {
            0 => writeln!(log, "{sign}{u:e},{y:E}"),
            1 => writeln!(log, "00{u},{y}0000"),
            _ => writeln!(log, "{}e-3,{y}", u * 1000.0),
        }
        .unwrap();
    }
    let folder = Folder::with_log(plain_log());
    folder.write("written.csv", log);
    let theta = |log: &str| parameters(&folder.fit(&format!("{log} --na 2 --nb 2")));
    assert!(distance(&theta("written.csv"), &theta("log.csv")) < 1e-12);
}

#[test]
fn inputs_are_u_u1_u2_in_the_order_of_their_numbers() {
    let Experiment { u, y } = Experiment::new(200);
    let other: Vec<f64> = u.iter().rev().copied().collect();
    let third: Vec<f64> = u.iter().map(|u| (7.0 * u).sin()).collect();
    let log = csv(&[("u10", &third), ("y", &y), ("u2", &other), ("u1", &u), ("ux", &y), ("u02", &y)]);
    let report = Folder::with_log(log).fit("log.csv --na 2 --nb 2");
    let names: Vec<&Value> =
        report["model"]["inputs"].as_array().unwrap().iter().map(|u| &u["name"]).collect();
    assert_eq!(names, ["u1", "u2", "u10"]);
}
