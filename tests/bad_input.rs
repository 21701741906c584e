//! Logs and command lines that cannot be used: one line that says where and what to do, the exit code, and no report.

use std::io::Write;

use crate::harness::{Folder, Run};
use crate::signals::{Experiment, Random, csv, plain_log};

/// The plain log with one of its lines changed. Line 1 is the header.
fn with_line(number: usize, line: &str) -> String {
    let log = plain_log();
    let mut lines: Vec<&str> = log.lines().collect();
    lines[number - 1] = line;
    lines.join("\n") + "\n"
}

/// A log of `u` and `y` that are functions of the row.
fn log_of(u: impl Fn(usize) -> f64, y: impl Fn(usize) -> f64) -> String {
    let column = |of: &dyn Fn(usize) -> f64| (0..100).map(of).collect::<Vec<f64>>();
    csv(&[("u", &column(&u)), ("y", &column(&y))])
}

/// The plain log with times, of which some are changed.
fn timed(change: impl Fn(&mut Vec<f64>)) -> String {
    let mut times: Vec<f64> = (0..200).map(|row| f64::from(row) * 0.25).collect();
    change(&mut times);
    Experiment::new(200).timed(&times)
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(bytes).expect("memory can be written to");
    encoder.finish().expect("memory can be written to")
}

/// Fits a log, which must be refused with this exit code and in one line that has all of `parts`; no report is
/// written, and one that is there is left alone.
fn refused(log: impl AsRef<[u8]>, options: &str, code: i32, parts: &[&str]) {
    let folder = Folder::with_log(log);
    refused_in(&folder, "log.csv", options, code, parts);
}

fn refused_in(folder: &Folder, log: &str, options: &str, code: i32, parts: &[&str]) {
    folder.write("old.json", "old");
    let before = folder.names();
    for report in ["old.json", "new.json"] {
        let line = folder.refused(&format!("fit {log} --na 2 --nb 2 {options} --report {report}"), code);
        for part in parts {
            assert!(line.contains(part), "{part}: {line}");
        }
    }
    assert_eq!(folder.read("old.json"), "old");
    assert_eq!(folder.names(), before);
}

#[test]
fn an_empty_file() {
    refused("", "", 3, &["log.csv: ", "empty"]);
    refused(gzip(b""), "", 3, &["log.csv: ", "empty"]);
}

#[test]
fn blank_lines_only() {
    refused("\n\n\r\n", "", 3, &["log.csv:"]);
}

#[test]
fn a_header_only() {
    refused("u,y\n", "", 3, &["log.csv:2:1: ", "no data rows"]);
    refused("u,y", "", 3, &["log.csv:", "no data rows"]);
}

#[test]
fn one_row() {
    refused("u,y\n1,2\n", "", 4, &["log.csv: ", "row"]);
}

#[test]
fn too_few_rows_for_the_orders() {
    let few: Vec<String> = plain_log().lines().take(6).map(str::to_owned).collect();
    refused(few.join("\n"), "", 4, &["log.csv: ", "4 parameters", "more rows"]);
    refused(plain_log(), "--estimate 198..200", 4, &["log.csv: ", "4 parameters"]);
    refused(plain_log(), "--nk 300", 4, &["log.csv: ", "4 parameters"]);
}

#[test]
fn a_row_with_a_field_too_many_or_too_few() {
    refused(with_line(13, "1,2,3"), "", 3, &["log.csv:13:5: ", "3 fields", "2 columns"]);
    refused(with_line(13, "1"), "", 3, &["log.csv:13:2: ", "1 field", "2 columns"]);
    refused(with_line(2, "1;2"), "", 3, &["log.csv:2:"]);
}

#[test]
fn a_row_cut_off_at_the_end_of_the_file() {
    let log = plain_log();
    let last = log.trim_end().rfind(',').unwrap();
    refused(&log[..last], "", 3, &["log.csv:201:", "1 field"]);
}

#[test]
fn a_word_where_a_number_should_be() {
    refused(with_line(13, "1,oops"), "", 3, &["log.csv:13:3: ", "'y'", "\"oops\"", "--missing oops"]);
    refused(with_line(13, "-x,2"), "", 3, &["log.csv:13:1: ", "'u'", "\"-x\"", "--missing='-x'"]);
    refused(with_line(13, "\"1\",\"a,b\""), "", 3, &["log.csv:13:5: ", "\"a,b\""]);
    refused(with_line(13, "0x10,2"), "", 3, &["log.csv:13:1: "]);
}

#[test]
fn a_row_of_units() {
    refused(with_line(2, "V,17"), "", 3, &["log.csv:2:1: ", "--skip-rows"]);
}

#[test]
fn decimal_commas_that_were_not_announced() {
    let log = plain_log().replace(',', ";").replace('.', ",");
    refused(log, "--decimal-comma=no", 3, &["log.csv:2:1: ", "--decimal-comma"]);
}

#[test]
fn infinity_and_what_overflows_to_it() {
    for word in ["inf", "-Infinity", "1e400", "-1e999"] {
        let place = ["log.csv:13:3: ", "'y'", word];
        refused(with_line(13, &format!("1,{word}")), "", 3, &place);
    }
}

#[test]
fn nan_only() {
    let nan = |_| f64::NAN;
    refused(log_of(nan, nan).replace("\n,", "\nNaN,NaN"), "", 3, &["log.csv: ", "no estimation row"]);
    refused(log_of(|row| row as f64, nan), "", 3, &["log.csv: ", "no estimation row"]);
}

#[test]
fn values_too_large_to_compute_with() {
    refused(log_of(|row| (row % 7) as f64 * 1e300, |row| (row % 5) as f64 * 1e300), "", 3, &["log.csv: "]);
}

#[test]
fn a_missing_column() {
    let there_are = "there are: u, y";
    refused(plain_log(), "-u voltage", 3, &["log.csv", "'voltage'", there_are]);
    refused(plain_log(), "-y speed", 3, &["log.csv", "'speed'", there_are]);
    refused(plain_log(), "--time t", 3, &["log.csv", "'t'", there_are]);
    refused(plain_log().replace("u,y", "u,z"), "", 3, &["log.csv", "y", "--output", "there are: u, z"]);
    refused(plain_log().replace("u,y", "v,y"), "", 3, &["log.csv", "u", "--input", "there are: v, y"]);
}

#[test]
fn a_duplicate_column() {
    let twice = |header: &str| plain_log().replace("u,y", header).replace('\n', ",1\n").replacen(",1", "", 1);
    refused(twice("u,y,y"), "", 3, &["log.csv", "two columns", "'y'", "rename"]);
    refused(twice("u,u,y"), "", 3, &["log.csv", "two columns", "'u'", "rename"]);
}

#[test]
fn a_column_in_two_roles() {
    refused(plain_log(), "-u u -y u", 2, &["'u'", "one role"]);
    refused(plain_log(), "-u u,u", 2, &["'u'", "one role"]);
    refused(plain_log(), "--time u", 2, &["'u'", "one role"]);
}

#[test]
fn a_constant_or_zero_input() {
    let y = |row| (row * row % 17) as f64;
    refused(log_of(|_| 3.7, y), "", 4, &["log.csv: ", "'u'", "constant", "b1, b2"]);
    refused(log_of(|_| 0.0, y), "", 4, &["log.csv: ", "'u'", "constant", "b1, b2"]);
    refused(log_of(|_| 0.0, y), "--detrend none", 4, &["log.csv: ", "b1, b2"]);
}

#[test]
fn an_input_too_poor_for_its_parameters() {
    let y = |row| (row * row % 17) as f64;
    // A square wave of period 2 has one amplitude: u(t-2) = -u(t-1).
    refused(log_of(|row| (row % 2) as f64, y), "", 4, &["log.csv: ", "b2"]);
}

#[test]
fn two_equal_inputs() {
    let Experiment { u, y } = Experiment::new(200);
    let log = csv(&[("u1", &u), ("u2", &u), ("y", &y)]);
    refused(log, "", 4, &["log.csv: ", "b2_1", "b2_2"]);
}

#[test]
fn a_constant_output() {
    let u = |row| (row * row % 17) as f64;
    refused(log_of(u, |_| 20.1), "", 4, &["log.csv: ", "'y'", "constant"]);
}

#[test]
fn an_input_that_is_the_output() {
    let Experiment { y, .. } = Experiment::new(200);
    refused(csv(&[("u", &y), ("y", &y)]), "", 4, &["log.csv: ", "b1", "b2"]);
}

#[test]
fn a_file_that_is_not_there_or_is_a_folder() {
    let folder = Folder::new();
    refused_in(&folder, "nowhere.csv", "", 5, &["nowhere.csv: ", "No such file"]);
    refused_in(&folder, ".", "", 5, &[".: ", "directory"]);
    refused_in(&folder, "old.json/log.csv", "", 5, &["old.json/log.csv: "]);
}

#[test]
fn a_truncated_or_damaged_gzip_file() {
    let whole = gzip(plain_log().as_bytes());
    refused(&whole[..whole.len() / 2], "", 5, &["log.csv: ", "truncated"]);
    refused(&whole[..whole.len() - 1], "", 5, &["log.csv: ", "truncated"]);
    refused(&whole[..5], "", 5, &["log.csv: ", "truncated"]);
    let mut damaged = whole;
    let middle = damaged.len() / 2;
    damaged[middle..middle + 20].fill(0x55);
    refused(damaged, "", 5, &["log.csv: ", "damaged"]);
}

#[test]
fn binary_garbage() {
    let mut random = Random::new(4);
    let bytes: Vec<u8> = (0..4000).map(|_| random.bits() as u8).collect();
    refused(&bytes, "", 3, &["log.csv:"]);
    // Without the zeros that give it away, and with a name that is right by chance.
    let text: Vec<u8> = bytes.iter().map(|byte| byte.max(&1)).copied().collect();
    refused([b"u,y\n", &text[..]].concat(), "", 3, &["log.csv:"]);
}

#[test]
fn a_message_about_garbage_is_one_short_line() {
    let mut random = Random::new(5);
    let bytes: Vec<u8> = (0..4000).map(|_| random.below(255) as u8 + 1).collect();
    let line = Folder::with_log(bytes).refused("fit log.csv --na 2 --nb 2", 3);
    assert!(line.chars().count() < 400, "{} characters", line.chars().count());
    assert!(!line.chars().any(char::is_control), "{line:?}");
}

#[test]
fn a_quote_that_is_not_closed() {
    refused(with_line(13, "\"1,2"), "", 3, &["log.csv:13:1: ", "quote"]);
}

#[test]
fn utf16_without_a_mark() {
    let utf16: Vec<u8> = plain_log().encode_utf16().flat_map(u16::to_le_bytes).collect();
    refused(utf16, "", 3, &["log.csv:1:2: ", "--encoding utf-16le"]);
}

#[test]
fn time_that_repeats_goes_back_or_is_missing() {
    let row = 51;
    let at = "log.csv:53";
    refused(timed(|times| times[row] = times[row - 1]), "--time time", 3, &[at, "repeats", "12.5"]);
    refused(timed(|times| times[row] = 1.0), "--time time", 3, &[at, "goes back"]);
    refused(timed(|times| times[row] = f64::NAN), "--time time", 3, &["log.csv:53:1: ", "time is missing"]);
    refused(timed(|times| times.fill(7.0)), "--time time", 3, &["log.csv:3", "repeats"]);
    refused(timed(|times| times.reverse()), "--time time", 3, &["log.csv:3", "goes back"]);
    let repeated = timed(|times| times[row] = times[row - 1]);
    refused(repeated, "--time time --resample 0.25:hold", 3, &[at, "repeats"]);
}

#[test]
fn time_that_jitters() {
    let late = |times: &mut Vec<f64>| times[51] += 0.03;
    refused(timed(late), "--time time", 3, &["log.csv:53", "10 %", "--resample"]);
}

#[test]
fn a_time_that_is_no_time() {
    let log = timed(|_| {}).replace("\n12.5,", "\nnoon,");
    refused(log, "--time time", 3, &["log.csv:52:1: ", "'time'", "\"noon\""]);
    let log = timed(|_| {}).replace("\n0,", "\n01.03.2024 12:00,");
    refused(log, "--time time", 3, &["log.csv:2:1: ", "--time-format"]);
}

#[test]
fn a_clock_with_one_row() {
    refused("time,u,y\n0,1,2\n", "--time time", 3, &["log.csv", "one row", "two"]);
}

#[test]
fn rows_beyond_the_log() {
    for option in ["--estimate", "--validate"] {
        refused(
            plain_log(),
            &format!("{option} 150..201"),
            3,
            &["log.csv: ", option, "150..201", "200 rows"],
        );
    }
}

#[test]
fn ranges_that_are_no_ranges() {
    for option in ["--estimate", "--validate"] {
        for (range, remedy) in [
            ("300..1", "1..300"),
            ("1..100,100..120", "overlap"),
            ("0..10", "from 1"),
            ("5", "1..300"),
            ("a..b", "1..300"),
            ("1..2..3", "1..300"),
            ("..", "1..300"),
            ("1..", "1..300"),
            ("1..99999999999999999999999", "1..300"),
        ] {
            refused(plain_log(), &format!("{option} {range}"), 2, &[option, remedy]);
        }
    }
}

#[test]
fn wrong_offsets() {
    for offset in ["u", "u=", "u=high", "u=inf", "u=NaN", "=3"] {
        refused(plain_log(), &format!("--offset {offset}"), 2, &["--offset"]);
    }
    refused(plain_log(), "--offset speed=3", 2, &["--offset", "'speed'"]);
    refused(plain_log(), "--offset u=1 --offset u=2", 2, &["--offset", "u"]);
}

#[test]
fn words_that_options_do_not_know() {
    for (option, word) in [
        ("--encoding", "klingon"),
        ("--detrend", "sometimes"),
        ("--detrend", "start:0"),
        ("--delimiter", "ab"),
        ("--comment", "##"),
        ("--sample-time", "0"),
        ("--sample-time", "nan"),
    ] {
        refused(plain_log(), &format!("{option} {word}"), 2, &[option]);
    }
    for step in ["0.25", "0.25:cubic", "x:hold", "0:hold", "inf:linear"] {
        refused(plain_log(), &format!("--time time --resample {step}"), 2, &["--resample"]);
    }
    refused(plain_log(), "--delimiter , --decimal-comma", 2, &["comma"]);
}

#[test]
fn a_resampling_that_would_fill_the_memory() {
    refused(timed(|_| {}), "--time time --resample 1e-12:hold", 2, &["--resample", "rows"]);
}

#[test]
fn orders_that_do_not_go_together() {
    refused(plain_log(), "--nk 1,2", 2, &["--nk", "2 values", "1 input"]);
    let folder = Folder::with_log(plain_log());
    for (orders, part) in [
        ("--na 0 --nb 0", "no parameters"),
        ("--na 2 --nb 2,2", "--nb"),
        ("--na 1001 --nb 2", "1000"),
        ("--na 2 --nb 2 --nk 2000", "1000"),
        ("--na 2 --nb 0 -u u", "--input"),
    ] {
        folder.assert_refused(&format!("fit log.csv {orders}"), 2, part);
    }
}

#[test]
fn a_start_longer_than_the_log() {
    refused(plain_log(), "--detrend start:201", 3, &["log.csv: ", "start:201", "200"]);
}

#[test]
fn bad_input_on_standard_input_is_named() {
    let run = Folder::new().run_on("fit - --na 2 --nb 2", with_line(13, "1,oops"));
    assert_eq!(run.code, 3);
    assert!(run.refusal().contains("standard input:13:3: "), "{}", run.stderr);
}

#[test]
fn a_name_with_control_characters_cannot_harm_a_terminal() {
    let log = plain_log().replace("u,y", "u\u{1b}[31m\u{7},y");
    refused(log, "", 3, &["there are: "]);
    let line = Folder::new().refused("fit '\u{1b}[31m.csv' --na 1 --nb 1", 5);
    assert!(!line.chars().any(char::is_control), "{line:?}");
}

#[test]
fn every_refusal_says_what_to_do() {
    let folder = Folder::with_log(plain_log());
    folder.write("word.csv", with_line(13, "1,oops"));
    folder.write("ragged.csv", with_line(13, "1"));
    folder.write("constant.csv", log_of(|_| 1.0, |row| row as f64));
    folder.write("timed.csv", timed(|times| times[51] = 1.0));
    folder.done("fit log.csv --na 2 --nb 2 --report model.json");
    folder.write("half.json", &folder.read("model.json")[..500]);
    folder.write("second.json", folder.read("model.json").replace("report/1", "report/2"));
    folder.write("edited.json", folder.read("model.json").replace("\"na\": 2", "\"na\": 3"));
    let silent: Vec<String> = [
        "fit word.csv --na 2 --nb 2",
        "fit ragged.csv --na 2 --nb 2",
        "fit constant.csv --na 2 --nb 2",
        "fit timed.csv --time time --na 2 --nb 2",
        "fit log.csv --na 2 --nb 2 --estimate 1..201",
        "fit log.csv --na 2 --nb 2 -u voltage",
        "fit log.csv --na 2 --nb 2 --offset speed=3",
        "fit log.csv --na 2 --nb 2 --report nowhere/model.json",
        "fit log.csv --na 2 --nb 2 --report .",
        "fit nowhere.csv --na 2 --nb 2",
        "predict nowhere.json log.csv",
        "predict . log.csv",
        "predict half.json log.csv",
        "predict second.json log.csv",
        "predict edited.json log.csv",
        "predict model.json log.csv --sample-time 2",
        "predict model.json log.csv --rows 1..201",
        "fit log.csv --model oe --nb 2",
        "fit log.csv --model oe --na 1 --nb 2 --nf 2",
        "fit log.csv --model oe --nb 2 --nf 0,2",
        "fit log.csv --model oe --nb 0 --nf 2",
        "fit log.csv --model oe --nb 2 --nf 2 --initial drop",
        "fit log.csv --model oe --nb 2 --nf 2 --tolerance 0",
        "fit log.csv --model oe --nb 2 --nf 2 --step 1",
        "fit log.csv --model oe --nb 2 --nf 2 --norm inf --ridge 2",
        "fit log.csv --model oe --nb 2 --nf 2 --method iv",
        "fit log.csv --model oe --nb 2 --nf 2 --estimate 1..5",
        "fit log.csv --na 2 --nb 2 --method sriv",
        "fit log.csv --na 2 --nb 2 --starts 2",
        "fit log.csv --na 2 --nb 2 --bound a1=1..0",
        "fit log.csv --na 2 --nb 2 --bound c1=1..2",
        "fit log.csv --na 2 --nb 2 --noise-bound 1e-6",
        "fit log.csv constant.csv --na 2 --nb 2 --detrend linear",
        "bode nowhere.json",
        "bode model.json --frequencies 1..4",
    ]
    .into_iter()
    .filter_map(|line| {
        let run = folder.run(line);
        assert_ne!(run.code, 0, "{line}");
        // "what is wrong; what to do" is how all of them are written.
        let refusal = run.refusal();
        (!refusal.contains("; ")).then(|| format!("thetahat {line}\n  {refusal}"))
    })
    .collect();
    assert!(silent.is_empty(), "\n{}", silent.join("\n"));
}

/// A copy of some bytes with one to four mistakes in it.
fn mutilated(original: &[u8], random: &mut Random) -> Vec<u8> {
    const PIECES: [&str; 16] = [
        "NaN",
        "1e400",
        "\"",
        ";",
        "\0",
        "\u{feff}",
        ",,",
        "\n\n",
        "-",
        "inf",
        "\r",
        "e",
        "999999999",
        "\u{b5}",
        "[",
        "}",
    ];
    let mut bytes = original.to_vec();
    for _ in 0..=random.below(4) {
        let place = random.below(bytes.len().max(1)).min(bytes.len());
        let end = (place + random.below(30)).min(bytes.len());
        match random.below(5) {
            0 => bytes.truncate(place),
            1 => drop(bytes.drain(place..end)),
            2 => {
                bytes.splice(place..place, original[..original.len().min(40)].iter().copied()).for_each(drop)
            }
            3 => bytes.splice(place..end, PIECES[random.below(16)].bytes()).for_each(drop),
            _ => bytes.splice(place..end.min(place + 1), [random.bits() as u8]).for_each(drop),
        }
    }
    bytes
}

fn assert_calm(run: &Run, about: &[u8]) {
    let shown = String::from_utf8_lossy(about);
    assert!([0, 2, 3, 4, 5].contains(&run.code), "exit code {}: {}\n{shown}", run.code, run.stderr);
    if run.code != 0 {
        assert_eq!(run.stdout, "", "{shown}");
        assert_eq!(
            run.stderr.lines().filter(|line| line.starts_with("error: ")).count(),
            1,
            "{}",
            run.stderr
        );
    }
}

#[test]
fn mutilated_logs_never_panic() {
    let mut random = Random::new(6);
    let experiment = Experiment::new(30);
    let original = experiment.timed(&(0..30).map(|row| f64::from(row) * 0.25).collect::<Vec<f64>>());
    let folder = Folder::new();
    for options in ["--time time", "--skip-rows 1 --missing 999999999"].repeat(60) {
        let log = mutilated(original.as_bytes(), &mut random);
        folder.write("log.csv", &log);
        assert_calm(&folder.run(&format!("fit log.csv --na 2 --nb 2 {options}")), &log);
    }
}

#[test]
fn mutilated_reports_never_panic() {
    let mut random = Random::new(8);
    let folder = Folder::with_log(Experiment::new(30).csv());
    folder.done("fit log.csv --na 2 --nb 2 --report model.json");
    let original = folder.read("model.json");
    for line in ["predict model.json log.csv --horizon 3", "simulate model.json log.csv"].repeat(60) {
        let report = mutilated(original.as_bytes(), &mut random);
        folder.write("model.json", &report);
        assert_calm(&folder.run(line), &report);
    }
}
