//! Logs as loggers, spreadsheets, historians and people write them: whatever the writing, the plant is the same.

use std::fmt::Write as _;

use crate::harness::{Folder, number};
use crate::signals::Random;

/// K = 2 and tau = 90 s, every 10 s, the input 0 or 1 for some rows each; y rests at 20.
const ROWS: usize = 240;
const STEP: f64 = 10.0;

/// Seconds from the first row, u and y of each row.
fn rows() -> Vec<(f64, f64, f64)> {
    let mut random = Random::new(5);
    let (mut u, mut x, mut left) = (0.0, 0.0, 6_usize);
    let decay = (-STEP / 90.0_f64).exp();
    (0..ROWS)
        .map(|row| {
            let now = (STEP * row as f64, u, 20.0 + x + 1e-3 * random.uniform());
            x = decay * x + 2.0 * (1.0 - decay) * u;
            left -= 1;
            if left == 0 {
                (u, left) = (1.0 - u, 3 + random.below(12));
            }
            now
        })
        .collect()
}

/// A text with a line for each row.
fn written(head: &str, line: impl Fn(f64, f64, f64) -> String) -> String {
    rows().iter().fold(head.to_owned(), |mut text, &(t, u, y)| {
        let _ = writeln!(text, "{}", line(t, u, y));
        text
    })
}

/// A time of day after so many seconds, and how many midnights there were.
fn time_of_day(seconds: f64) -> (String, u32) {
    let whole = seconds as u32;
    let (day, left) = (whole / 86_400, whole % 86_400);
    (format!("{:02}:{:02}:{:02}", left / 3600, left / 60 % 60, left % 60), day)
}

fn comma(value: f64) -> String {
    format!("{value:.4}").replace('.', ",")
}

/// Fits the process, and checks that it is the plant; what standard error has is `told`.
fn is_the_plant(name: &str, log: &str, options: &str, told: &str) {
    let folder = Folder::new();
    folder.write(name, log);
    let run = folder.run(&format!("fit '{name}' {options} --structure p1 --initial estimate --format json"));
    assert_eq!(run.code, 0, "{name}: {}", run.stderr);
    assert!(run.stderr.contains(told), "{name}: {}", run.stderr);
    let report: serde_json::Value = serde_json::from_str(&run.stdout).expect("a report");
    let parameter = |place: usize| number(&report, &format!("/model/parameters/{place}/value"));
    assert!((parameter(0) / 2.0 - 1.0).abs() < 0.01, "{name}: K {}", parameter(0));
    assert!((parameter(1) / 90.0 - 1.0).abs() < 0.01, "{name}: tau {}", parameter(1));
    // An inspection sees the same log.
    let inspect = options.replace("--structure p1", "");
    folder.done(&format!("inspect '{name}' {inspect}"));
}

#[test]
fn clocks_are_found_and_understood() {
    let epoch = |t: f64| 1_706_000_000.0 + t;
    let plain = |t: String, u: f64, y: f64| format!("{t},{u},{y:.4}");
    for (name, log, told) in [
        (
            "seconds",
            written("Time (s),u,y\n", |t, u, y| plain(t.to_string(), u, y)),
            "the clock is column 'Time (s)'",
        ),
        ("milliseconds", written("t [ms],u,y\n", |t, u, y| plain((1e3 * t).to_string(), u, y)), "'t [ms]'"),
        (
            "microseconds",
            written("TimeUS,u,y\n", |t, u, y| plain((1e6 * t + 7e6).to_string(), u, y)),
            "'TimeUS'",
        ),
        ("nanoseconds", written("time_ns,u,y\n", |t, u, y| plain((1e9 * t).to_string(), u, y)), "'time_ns'"),
        (
            "minutes",
            written("Time [min],u,y\n", |t, u, y| plain(format!("{:.9}", t / 60.0), u, y)),
            "'Time [min]'",
        ),
        ("epoch", written("timestamp,u,y\n", |t, u, y| plain(epoch(t).to_string(), u, y)), "'timestamp'"),
        ("epoch ms", written("_time,u,y\n", |t, u, y| plain((1e3 * epoch(t)).to_string(), u, y)), "'_time'"),
        (
            "epoch ns",
            written("%time,u,y\n", |t, u, y| plain(format!("{}000000000", epoch(t)), u, y)),
            "'%time'",
        ),
        (
            "sheet days",
            written("Date,u,y\n", |t, u, y| plain(format!("{:.8}", 45_300.0 + t / 86_400.0), u, y)),
            "'Date'",
        ),
        (
            "iso",
            written("datetime,u,y\n", |t, u, y| plain(format!("2024-01-10T{}Z", time_of_day(t).0), u, y)),
            "'datetime'",
        ),
        (
            "unnamed index",
            written(",u,y\n", |t, u, y| plain(format!("2024-01-10 {}", time_of_day(t).0), u, y)),
            "the clock is column ''",
        ),
        (
            "german dates",
            written("Zeit;u;y\n", |t, u, y| format!("10.01.2024 {};{u};{}", time_of_day(t).0, comma(y))),
            "'Zeit'",
        ),
        (
            "matlab dates",
            written("when,u,y\n", |t, u, y| plain(format!("10-Jan-2024 {}", time_of_day(t).0), u, y)),
            "'when'",
        ),
        (
            "date and time",
            written("Date,Time,u,y\n", |t, u, y| plain(format!("2024/01/10,{}", time_of_day(t).0), u, y)),
            "the clock is column 'Date,Time'",
        ),
        (
            "midnight",
            written("time,u,y\n", |t, u, y| plain(time_of_day(t + 86_000.0).0, u, y)),
            "the times of day pass midnight",
        ),
        (
            "one day",
            written("time,u,y\n", |t, u, y| plain(format!("03/04/2024 {}", time_of_day(t).0), u, y)),
            "dates such as 03/04/2024 00:00:00 are read as --time-format '%d/%m/%Y %H:%M:%S%.f'",
        ),
    ] {
        is_the_plant(name, &log, "", told);
    }
    let durations = written("time,u,y\n", |t, u, y| {
        let t = 23.0 * 3600.0 + 1800.0 + t;
        plain(format!("{:02}:{:02}:{:02}", (t / 3600.0) as u32, (t / 60.0) as u32 % 60, t as u32 % 60), u, y)
    });
    is_the_plant("durations", &durations, "", "the clock is column 'time'");
    let minutes =
        written("time,u,y\n", |t, u, y| plain(format!("{:02}:{:04.1}", (t / 60.0) as u32, t % 60.0), u, y));
    is_the_plant("minutes and seconds", &minutes, "", "the clock is column 'time'");
    let stamps = written("sec,nanosec,u,y\n", |t, u, y| plain(format!("{},0", epoch(t)), u, y));
    is_the_plant("sec", &stamps, "", "the clock is column 'sec'");
    // What is called a clock and is none is told.
    let unsorted = written("time,u,y\n", |t, u, y| plain(((7.0 * t) % 1000.0).to_string(), u, y));
    let run = Folder::with_log(unsorted).done("fit log.csv --structure p1");
    assert!(run.stderr.contains("column 'time' is called as a clock is"), "{}", run.stderr);
    let minutes = written("elapsed,u,y\n", |t, u, y| plain((t / 60.0).to_string(), u, y));
    is_the_plant("minutes", &minutes, "--time-unit min", "");
    // A clock without a unit is read in seconds, and questioned where that makes no sense.
    let counter = written("timestamp,u,y\n", |t, u, y| plain((1e6 * t + 5e6).to_string(), u, y));
    is_the_plant("counter", &counter, "--time-unit us", "");
    let run = Folder::with_log(&counter).done("fit log.csv --structure p1");
    assert!(
        run.stderr.contains("so that a step is 1e7 s; --time-unit ns reads nanoseconds"),
        "{}",
        run.stderr
    );
}

#[test]
fn clocks_that_stand_still_or_go_back_are_mended() {
    let plain = |t: String, u: f64, y: f64| format!("{t},{u},{y:.4}");
    let coarse = written("time,u,y\n", |t, u, y| plain(((t / 40.0).floor() * 40.0).to_string(), u, y));
    is_the_plant("coarse", &coarse, "", "4 rows have the same time, again and again");
    // Summer time ends on 2024-10-27 at 03:00 and begins on 2024-03-31 at 02:00.
    let wall = |t: f64, day: &str, set: f64| {
        let t = 6000.0 + t;
        let shown = if t >= 7200.0 { t + set } else { t };
        format!("{day} {}", time_of_day(shown).0)
    };
    let autumn = written("time,u,y\n", |t, u, y| plain(wall(t, "2024-10-27", -3600.0), u, y));
    is_the_plant("autumn", &autumn, "", "in row 121 the clock goes back by an hour");
    let spring = written("time,u,y\n", |t, u, y| plain(wall(t, "2024-03-31", 3600.0), u, y));
    is_the_plant("spring", &spring, "", "in row 121 the clock is an hour ahead");
    is_the_plant("zone", &spring, "--time-zone Europe/Berlin", "");
    // On a Tuesday it is a mistake.
    let tuesday = written("time,u,y\n", |t, u, y| plain(wall(t, "2024-10-29", -3600.0), u, y));
    let refusal = Folder::with_log(tuesday).refused("fit log.csv --structure p1", 3);
    assert!(refusal.contains("log.csv:122: time goes back by an hour"), "{refusal}");
    assert!(refusal.contains("name its zone (--time-zone)"), "{refusal}");
    // The recorder was started again: two experiments.
    let again = written("time,u,y\n", |t, u, y| plain((t % 1200.0).to_string(), u, y));
    is_the_plant("again", &again, "", "in row 121 the clock begins again");
    let folder = Folder::with_log(&again);
    let report = folder.fit("log.csv --na 1 --nb 1");
    assert_eq!(report["data"]["segments"], serde_json::json!([[1, 120], [121, 240]]));
}

#[test]
fn heads_and_notations_are_understood() {
    let plain = |t: f64, u: f64, y: f64| format!("{t},{u},{y:.4}");
    for (name, log, options, told) in [
        ("title", written("Export of pump 3\n\nt,u,y\n", plain), "", "the names are on line 3"),
        ("settings", written("Serial no.,12345,\nRange,0,10\nt,u,y\n", plain), "", "the names are on line 3"),
        ("units", written("t,u,y\ns,V,degC\n", plain), "", "line 2 is read as units"),
        (
            "units of the clock",
            written("t,u,y\n[ms],[V],[degC]\n", |t, u, y| plain(1e3 * t, u, y)),
            "",
            "line 2",
        ),
        ("comments", written("# made by a logger\n# t,u,y\n", plain), "", "the clock is column 't'"),
        ("excel", written("sep=;\nt;u;y\n", |t, u, y| format!("{t};{u};{}", comma(y))), "", "'t'"),
        (
            "labview",
            written(
                "LabVIEW Measurement\t\nSeparator\tTab\n***End_of_Header***\t\n\t\nChannels\t2\nX0\t0\t0\nX_Value\tu\ty\tComment\n",
                |t, u, y| {
                    let note = if t == 0.0 { "\tstarted" } else { "" };
                    format!("{t}\t{u}\t{y:.4}{note}")
                },
            ),
            "",
            "the clock is column 'X_Value'",
        ),
        (
            "weather station",
            written(
                "\"TOA5\",\"Hill\",\"CR1000\"\n\"TIMESTAMP\",\"u\",\"y\"\n\"TS\",\"V\",\"DegC\"\n\"\",\"Smp\",\"Avg\"\n",
                |t, u, y| format!("\"2024-01-10 {}\",{u},{y:.4}", time_of_day(t).0),
            ),
            "",
            "the clock is column 'TIMESTAMP'",
        ),
        (
            "fixed width",
            written(" Time (s)    u     y\n", |t, u, y| format!("  {t:.3E}  {u:.3E}  {y:.6E}")),
            "",
            "the clock is column 'Time (s)'",
        ),
        ("blanks", written("t u y\n", |t, u, y| format!("{t}   {u} \t{y:.4}")), "", "'t'"),
        (
            "save -ascii",
            written("", |t, u, y| format!("   {t:.7e}   {u:.7e}   {y:.7e}")),
            "--time 1 -u 2 -y 3",
            "line 1 is the first row",
        ),
        ("named row", written("1,2,3\nt,u,y\nvolt,amp,grad\n", plain), "--header-row 2", ""),
        (
            "on and off",
            written("t,u,y\n", |t, u, y| format!("{t},{},{y:.4}", if u > 0.5 { "ON" } else { "OFF" })),
            "",
            "column 'u': 'off' is read as 0 and 'on' as 1",
        ),
        (
            "true and false",
            written("t,u,y\n", |t, u, y| format!("{t},{},{y:.4}", if u > 0.5 { "True" } else { "False" })),
            "",
            "'false' is read as 0",
        ),
        (
            "modes",
            written("t,u,y\n", |t, u, y| format!("{t},{},{y:.4}", if u > 0.5 { "auto" } else { "manual" })),
            "--value auto=1 --value manual=0",
            "",
        ),
        (
            "historian",
            written("t,u,y\n", |t, u, y| {
                if (t / 10.0) as u32 % 50 == 7 { format!("{t},{u},I/O Timeout") } else { plain(t, u, y) }
            }),
            "",
            "column 'y': read as missing values: 'i/o timeout' (5 rows)",
        ),
        (
            "spreadsheet errors",
            written("t,u,y\n", |t, u, y| if t == 500.0 { format!("{t},{u},#N/A") } else { plain(t, u, y) }),
            "",
            "'#n/a' (1 row)",
        ),
        ("thousands", written("t,u,y\n", |t, u, y| format!("\"{}\",{u},{y:.4}", grouped(t))), "", "'t'"),
        ("percent", written("t;u;y\n", |t, u, y| format!("{t};{}%;{}", comma(u), comma(y))), "", "'t'"),
        ("last delimiter", written("t;u;y\n", |t, u, y| format!("{t};{u};{y:.4};")), "", "'t'"),
    ] {
        is_the_plant(name, &log, options, told);
    }
    let modes =
        written("t,u,y\n", |t, u, y| format!("{t},{},{y:.4}", if u > 0.5 { "auto" } else { "manual" }));
    let refusal = Folder::with_log(modes).refused("fit log.csv --structure p1", 3);
    assert!(refusal.contains("column 'u': this column holds words (manual, auto), not numbers"), "{refusal}");
    assert!(refusal.contains("(--value manual=0)"), "{refusal}");
}

/// 12345 as 12,345.0.
fn grouped(value: f64) -> String {
    let whole = value as u64;
    match whole / 1000 {
        0 => format!("{whole}.0"),
        thousands => format!("{thousands},{:03}.0", whole % 1000),
    }
}

#[test]
fn logs_of_two_rates_are_understood() {
    // Every second for a minute after a step, then every ten seconds.
    let mut rows = Vec::new();
    let (mut y, mut t) = (0.0, 0.0_f64);
    for step in 0..8 {
        let u = f64::from(step % 2);
        for row in 0..120 {
            let length = if row < 60 { 1.0 } else { 10.0 };
            rows.push(format!("{t},{u},{:.5}", 20.0 + y));
            let decay = (-length / 90.0_f64).exp();
            y = decay * y + 2.0 * (1.0 - decay) * u;
            t += length;
        }
    }
    let log = format!("t,u,y\n{}\n", rows.join("\n"));
    is_the_plant("two rates", &log, "", "the clock is column 't'");
    let folder = Folder::with_log(&log);
    let run = folder.done("fit log.csv --model oe --nb 1 --nf 1 --format json");
    assert!(run.stderr.contains("the log has two rates"), "{}", run.stderr);
    let report: serde_json::Value = serde_json::from_str(&run.stdout).expect("a report");
    assert_eq!(number(&report, "/model/sample_time"), 1.0);
    assert_eq!(report["data"]["logs"][0]["resampled"]["interpolation"], "auto");
    let pole = -number(&report, "/model/parameters/1/value");
    assert!((pole / (-1.0 / 90.0_f64).exp() - 1.0).abs() < 2e-4, "{pole}");
    let words = folder.done("inspect log.csv").stdout;
    assert!(words.contains("the clock has two rates") && !words.contains("excites nothing"), "{words}");
}

#[test]
fn a_pause_of_the_clock_is_no_part_of_a_response() {
    // After a quarter of an hour without a record nobody knows in which state the plant is.
    let late = |t: f64| if t >= 1200.0 { t + 905.0 } else { t };
    let moved = |t: f64, y: f64| if t >= 1200.0 { y + 0.8 * (-(t - 1200.0) / 90.0_f64).exp() } else { y };
    let log = written("t,u,y\n", |t, u, y| format!("{},{u},{:.4}", late(t), moved(t, y)));
    is_the_plant("pause", &log, "", "");
    // One log with a pause is as good as two.
    let folder = Folder::with_log(&log);
    let lines: Vec<&str> = log.lines().collect();
    folder.write("first.csv", lines[..121].join("\n"));
    folder.write("second.csv", [&lines[..1], &lines[121..]].concat().join("\n"));
    let fit = |logs: &str| {
        let report = folder.fit(&format!("{logs} --structure p1 --initial estimate"));
        (report["model"]["parameters"].clone(), report["estimation"]["mse"].clone())
    };
    assert_eq!(fit("log.csv"), fit("first.csv second.csv"));
}

#[test]
fn dates_come_back_as_dates() {
    let line = |t: f64, u: f64, y: f64| format!("2024-01-10T{}Z,{u},{y:.4}", time_of_day(t).0);
    let folder = Folder::with_log(written("time,u,y\n", line));
    folder.done("fit log.csv --structure p1 --report model.json --html page.html");
    let times = |verb: &str| -> Vec<String> {
        let csv = folder.done(&format!("{verb} model.json log.csv")).stdout;
        csv.lines().map(|line| line.split(',').next().unwrap_or_default().to_owned()).collect()
    };
    for verb in ["predict", "simulate"] {
        let times = times(verb);
        assert_eq!(times[..3], ["time", "2024-01-10T00:00:00Z", "2024-01-10T00:00:10Z"], "{verb}");
        assert_eq!(times.last().map(String::as_str), Some("2024-01-10T00:39:50Z"), "{verb}");
    }
    // An axis of dates has milliseconds since 1970.
    assert!(folder.read("page.html").contains("\"type\":\"date\""));
    folder.done("inspect log.csv --html inspection.html");
    assert!(folder.read("inspection.html").contains("1704844810000"));
    // Seconds stay seconds.
    folder.write("log.csv", written("time,u,y\n", |t, u, y| format!("{t},{u},{y:.4}")));
    assert_eq!(times("simulate")[..3], ["time", "0.0", "10.0"]);
}
