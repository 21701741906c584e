//! Where times come from: seconds, dates, a sample time; gaps, and logs made uniform.

use serde_json::{Value, json};

use crate::harness::{Answer, Folder, distance, number, parameters};
use crate::signals::{Experiment, Random, csv};

/// Quarters of a second are exact, however they are written and subtracted.
const STEP: f64 = 0.25;

fn uniform(rows: u32) -> Vec<f64> {
    (0..rows).map(|row| 100.0 + STEP * f64::from(row)).collect()
}

/// The plain log with a column of times that are written in some way.
fn written(time: impl Fn(f64) -> String) -> String {
    let log = Experiment::new(200).csv();
    let rows = log.lines().skip(1).zip(uniform(200)).map(|(row, at)| format!("{},{row}\n", time(at)));
    format!("time,u,y\n{}", rows.collect::<String>())
}

/// Such as 01:40.25.
fn minutes_and_seconds(time: f64) -> String {
    format!("{:02}:{:05.2}", (time / 60.0).floor(), time % 60.0)
}

/// A report without what it says of the clock's writing.
fn without_clock(mut report: Value) -> Value {
    for field in ["file", "time", "start"] {
        report["data"]["logs"][0][field] = Value::Null;
    }
    report
}

#[test]
fn a_column_of_seconds_gives_the_sample_time() {
    let folder = Folder::with_log(written(|time| time.to_string()));
    let report = folder.fit("log.csv --time time --na 2 --nb 2");
    assert_eq!(number(&report, "/data/sample_time"), STEP);
    assert_eq!(number(&report, "/model/sample_time"), STEP);
    assert_eq!(report["data"]["logs"][0]["time"], "time");
    assert_eq!(report["data"]["logs"][0]["start"], Value::Null);
}

#[test]
fn dates_and_sample_times_say_the_same_as_seconds() {
    let seconds = Folder::with_log(written(|time| time.to_string())).fit("log.csv --time time --na 2 --nb 2");
    let expected = without_clock(seconds);
    for (log, options, start) in [
        (
            written(|time| format!("2024-03-01T12:{}Z", minutes_and_seconds(time))),
            "--time time",
            json!("2024-03-01T12:01:40.00Z"),
        ),
        (
            written(|time| format!("2024-02-29 23:{}+02:00", minutes_and_seconds(time))),
            "--time time",
            json!("2024-02-29 23:01:40.00+02:00"),
        ),
        (
            written(|time| format!("01.03.2024 12:{}", minutes_and_seconds(time))),
            "--time time --time-format '%d.%m.%Y %H:%M:%S%.f'",
            json!("2024-03-01T12:01:40"),
        ),
        (
            written(|time| format!("01.03.2024 12:{}", minutes_and_seconds(time))),
            "",
            json!("2024-03-01T12:01:40"),
        ),
        (
            written(|time| format!("2024/03/01 12:{}", minutes_and_seconds(time))),
            "",
            json!("2024-03-01T12:01:40"),
        ),
        (
            written(|time| format!("01.03.2024,12:{}", minutes_and_seconds(time))).replacen(
                "time",
                "day,time of day",
                1,
            ),
            "",
            json!("2024-03-01T12:01:40"),
        ),
        (written(|time| ((time + 1_709_294_400.0) * 1000.0).to_string()), "", json!("2024-03-01T12:01:40Z")),
        (written(|time| (time * 1000.0).to_string()).replacen("time", "time [ms]", 1), "", Value::Null),
        (written(|time| (time * 1e6).to_string()).replacen("time", "TimeUS", 1), "", Value::Null),
        (written(|time| (time / 60.0).to_string()), "--time-unit min", Value::Null),
        (
            written(|time| format!("12:{}", minutes_and_seconds(time))),
            "--time time --time-format %H:%M:%S%.f",
            json!("12:01:40.00"),
        ),
        (written(|time| time.to_string()), "--sample-time 0.25", Value::Null),
    ] {
        let folder = Folder::with_log(log);
        let report = folder.fit(&format!("log.csv {options} --na 2 --nb 2"));
        assert_eq!(report["data"]["logs"][0]["start"], start, "{options}");
        assert_eq!(without_clock(report), expected, "{options}");
    }
}

#[test]
fn a_clock_in_hundredths_gives_a_sample_time_of_a_hundredth() {
    let Experiment { u, y } = Experiment::new(200);
    let times: Vec<f64> = (0..200).map(|row| f64::from(row) / 100.0).collect();
    let report =
        Folder::with_log(csv(&[("t", &times), ("u", &u), ("y", &y)])).fit("log.csv --time t --na 2 --nb 2");
    // The median of steps that rounding makes differ.
    assert!((number(&report, "/model/sample_time") / 0.01 - 1.0).abs() < 1e-12);
}

#[test]
fn without_a_clock_rows_are_counted() {
    let folder = Folder::with_log(Experiment::new(100).csv());
    let report = folder.fit("log.csv --na 2 --nb 2 --report model.json");
    assert_eq!(number(&report, "/model/sample_time"), 1.0);
    let run = folder.done("predict model.json log.csv");
    assert!(run.stdout.starts_with("row,measured,predicted,standard_deviation\n1,"), "{}", run.stdout);
}

#[test]
fn the_one_column_that_is_a_clock_is_taken() {
    let folder = Folder::with_log(written(|time| time.to_string()));
    let run = folder.done("fit log.csv --na 2 --nb 2");
    assert_eq!(
        run.stderr,
        "note: log.csv: the clock is column 'time'; --time names another, --sample-time says that rows are evenly apart\n"
    );
    let report = |options: &str| folder.fit(&format!("log.csv {options} --na 2 --nb 2"));
    assert_eq!(report(""), report("--time time"));
    assert_eq!(folder.done("fit log.csv --sample-time 2 --na 2 --nb 2").stderr, "");
    // It is resampled without its name, too.
    assert_eq!(report("--resample 0.5:hold"), report("--time time --resample 0.5:hold"));
    // A column that is used otherwise is none.
    assert_eq!(number(&report("-u time"), "/model/sample_time"), 1.0);
    // Of two nobody knows which.
    folder.write(
        "log.csv",
        written(|time| format!("{time},{}", time + 5.0)).replacen("time", "time,timestamp", 1),
    );
    folder.assert_refused(
        "fit log.csv --na 2 --nb 2",
        3,
        "several columns may be the clock: 'time', 'timestamp'; name one with --time",
    );
    folder.done("fit log.csv --na 2 --nb 2 --time timestamp");
    folder.done("fit log.csv --na 2 --nb 2 --sample-time 1");
}

#[test]
fn a_step_over_one_and_a_half_medians_starts_a_segment() {
    let experiment = Experiment::new(200);
    let late = |by: f64| -> Vec<f64> {
        let late = |(row, time): (usize, f64)| if row < 120 { time } else { time + by };
        uniform(200).into_iter().enumerate().map(late).collect()
    };
    let folder = Folder::with_log(experiment.timed(&late(0.51 * STEP)));
    let run = folder.done("fit log.csv --time time --na 2 --nb 2 --format json --report gap.json");
    assert!(run.stderr.starts_with("warning: ") && run.stderr.contains("clock"), "{}", run.stderr);
    let report: Value = serde_json::from_str(&run.stdout).unwrap();
    assert_eq!(report["data"]["segments"], json!([[1, 120], [121, 200]]));
    assert_eq!(number(&report, "/data/time_gaps"), 1.0);
    assert_eq!(number(&report, "/data/sample_time"), STEP);
    assert_eq!(number(&report, "/estimation/samples"), 196.0);

    // The same as a missing value there, but for the row that it takes.
    let at = |signal: &[f64]| [&signal[..120], &[f64::NAN], &signal[120..]].concat();
    folder.write("missing.csv", csv(&[("u", &at(&experiment.u)), ("y", &at(&experiment.y))]));
    let missing = folder.fit("missing.csv --na 2 --nb 2");
    assert!(distance(&parameters(&report), &parameters(&missing)) < 1e-12);

    // A prediction does not reach across either.
    let answer = Answer::read(&folder.done("predict gap.json log.csv --time time").stdout);
    let without: Vec<usize> = (0..200).filter(|row| answer.predicted[*row].is_none()).collect();
    assert_eq!(without, [0, 1, 120, 121]);
}

#[test]
fn a_step_below_one_and_a_half_medians_is_jitter() {
    let times: Vec<f64> =
        uniform(200).iter().enumerate().map(|(row, t)| if row < 120 { *t } else { t + 0.12 }).collect();
    let folder = Folder::with_log(Experiment::new(200).timed(&times));
    let line = folder.refused("fit log.csv --time time --na 2 --nb 2", 3);
    assert!(line.contains("log.csv:122") && line.contains("--resample"), "{line}");
}

#[test]
fn jitter_of_a_tenth_is_fine() {
    let mut random = Random::new(9);
    let times: Vec<f64> = uniform(200).iter().map(|time| time + 0.04 * STEP * random.uniform()).collect();
    let folder = Folder::with_log(Experiment::new(200).timed(&times));
    let report = folder.fit("log.csv --time time --na 2 --nb 2");
    assert!((number(&report, "/model/sample_time") - STEP).abs() < 0.02 * STEP);
    assert_eq!(report["data"]["segments"], json!([[1, 200]]));
}

/// A log with an irregular clock, and what it is at every half second from its first sample on.
fn irregular() -> (String, [[Vec<f64>; 2]; 2]) {
    let mut random = Random::new(10);
    let mut now = 3.0;
    let mut samples = Vec::new();
    for _ in 0..300 {
        samples.push((now, random.uniform(), 10.0 + random.uniform()));
        now += 0.5 * (1.0 + 0.9 * random.uniform());
    }
    let column = |of: fn(&(f64, f64, f64)) -> f64| samples.iter().map(of).collect::<Vec<f64>>();
    let (t, u, y) = (column(|s| s.0), column(|s| s.1), column(|s| s.2));
    let log = csv(&[("t", &t), ("u", &u), ("y", &y)]);

    let instants = (0..).map(|k| 3.0 + 0.5 * f64::from(k)).take_while(|at| *at <= t[299]);
    let places: Vec<(usize, f64)> =
        instants.map(|at| (t.iter().rposition(|t| *t <= at).expect("the first is the start"), at)).collect();
    let hold = |values: &[f64]| places.iter().map(|(left, _)| values[*left]).collect::<Vec<f64>>();
    let linear = |values: &[f64]| {
        let between = |(left, at): &(usize, f64)| match t.get(left + 1) {
            Some(next) => {
                let share = (at - t[*left]) / (next - t[*left]);
                values[*left] + share * (values[left + 1] - values[*left])
            }
            None => values[*left],
        };
        places.iter().map(between).collect::<Vec<f64>>()
    };
    (log, [[hold(&u), hold(&y)], [linear(&u), linear(&y)]])
}

#[test]
fn a_step_that_leaves_one_row_is_refused_however_long_it_is() {
    let folder = Folder::with_log("t,u,y\n0,0,0\n1,1,1\n2,0,1\n3,1,2\n4,0,1\n5,1,1\n");
    for step in ["6", "1e7", "1e300"] {
        folder.assert_refused(
            &format!("fit log.csv --time t --na 1 --nb 1 --resample {step}:linear"),
            2,
            "leaves one row of a log of 5 s",
        );
    }
}

#[test]
fn a_resampled_log_gives_the_fit_of_the_uniform_one() {
    let (log, uniform) = irregular();
    for (how, [u, y]) in ["hold", "linear"].into_iter().zip(uniform) {
        let folder = Folder::with_log(&log);
        folder.write("uniform.csv", csv(&[("u", &u), ("y", &y)]));
        let options = "--na 2 --nb 2 --report model.json";
        let expected = folder.fit(&format!("uniform.csv --sample-time 0.5 {options}"));
        let report = folder.fit(&format!("log.csv --time t --resample 0.5:{how} {options}"));
        assert!(distance(&parameters(&report), &parameters(&expected)) < 1e-9, "{how}");
        assert_eq!(report["data"]["rows"], expected["data"]["rows"]);
        assert_eq!(number(&report, "/data/sample_time"), 0.5);
        let provenance = json!({"step": 0.5, "interpolation": how, "rows": 300});
        assert_eq!(report["data"]["logs"][0]["resampled"], provenance);

        let run = folder.done(&format!("predict model.json log.csv --time t --resample 0.5:{how}"));
        let answer = Answer::read(&run.stdout);
        let measured: Vec<f64> = answer.measured.iter().flatten().copied().collect();
        assert!(distance(&measured, &y) < 1e-12, "{how}");
        assert_eq!(answer.time[..3], [3.0, 3.5, 4.0]);
    }
}

#[test]
fn fit_and_inspect_advise_the_same() {
    // Every second under load, and every minute at rest, as a cell is logged.
    let mut times: Vec<f64> = (0..600).map(f64::from).collect();
    times[300] += 0.2;
    times.extend((1..=540).map(|k| 599.0 + 60.0 * f64::from(k)));
    let folder = Folder::with_log(Experiment::new(1140).timed(&times));
    let refusal = folder.refused("fit log.csv --time time --na 2 --nb 2", 3);
    let advice =
        "resampled every 1 s it would have 33000 rows, of which 1140 were recorded; cut it at its pauses";
    assert!(refusal.contains(advice), "{refusal}");
    let document = folder.done("inspect log.csv --time time --format json").stdout;
    assert!(document.contains(advice) && !document.contains("--resample 1"), "{document}");
    // A few pauses are bridged.
    times.truncate(620);
    folder.write("log.csv", Experiment::new(620).timed(&times));
    let advice = "resample it every 1 s (--resample 1:linear)";
    folder.assert_refused("fit log.csv --time time --na 2 --nb 2", 3, advice);
    let document = folder.done("inspect log.csv --time time --format json").stdout;
    // The document names the argument, the program its option.
    let named = advice.replace("--resample", "`resample`");
    assert!(document.contains(&named) && document.contains("--resample 1:linear -u u"), "{document}");
    folder.done("fit log.csv --time time --resample 1:linear --na 2 --nb 2");
}

#[test]
fn an_irregular_log_is_refused_unless_it_is_resampled() {
    let line = Folder::with_log(irregular().0).refused("fit log.csv --time t --na 2 --nb 2", 3);
    assert!(line.contains("log.csv:") && line.contains("--resample"), "{line}");
}

#[test]
fn a_missing_value_stays_missing_after_resampling() {
    let mut experiment = Experiment::new(200);
    experiment.y[80] = f64::NAN;
    let folder = Folder::with_log(experiment.timed(&uniform(200)));
    for (how, segments) in
        [("hold", json!([[1, 160], [163, 399]])), ("linear", json!([[1, 159], [163, 399]]))]
    {
        let report = folder.fit(&format!("log.csv --time time --resample 0.125:{how} --na 1 --nb 1"));
        assert_eq!(report["data"]["segments"], segments, "{how}");
    }
}

#[test]
fn predictions_carry_the_logs_own_times() {
    let folder = Folder::with_log(written(|time| time.to_string()));
    folder.done("fit log.csv --time time --na 2 --nb 2 --report model.json");
    let run = folder.done("predict model.json log.csv --time time");
    assert!(run.stdout.starts_with("time,measured,predicted,standard_deviation\n"), "{}", run.stdout);
    assert_eq!(Answer::read(&run.stdout).time, uniform(200));
}

#[test]
fn options_of_the_clock_that_exclude_or_need_each_other() {
    let folder = Folder::with_log(written(|time| time.to_string()));
    for options in [
        "--time time --sample-time 1",
        // The sample time does not make up for the column of times.
        "--sample-time 1 --resample 2:hold",
        "--sample-time 1 --time-format %s",
    ] {
        let run = folder.run(&format!("fit log.csv {options} --na 2 --nb 2"));
        assert_eq!(run.code, 2, "{options}: {}", run.stderr);
        assert!(run.stdout.is_empty() && run.stderr.starts_with("error: "), "{options}: {}", run.stderr);
    }
}

/// A positioning drive that is logged every millisecond: a slow lag, a lightly damped mode of 150 Hz that no clock of
/// 10 ms shows, and an encoder. Its setpoint jumps at any millisecond.
fn drive() -> String {
    const ROWS: usize = 20_000;
    let mut random = Random::new(11);
    let mut level = 1.0;
    let u: Vec<f64> = (0..ROWS)
        .map(|_| {
            if random.uniform() > 0.92 {
                level = random.uniform();
            }
            level
        })
        .collect();
    let lag = (-1.0_f64 / 80.0).exp();
    let (radius, angle) = (0.985, std::f64::consts::TAU * 0.15);
    let (mut slow, mut fast) = (0.0, [0.0; 2]);
    let mut y = Vec::with_capacity(ROWS);
    for t in 0..ROWS {
        let before = if t > 0 { u[t - 1] } else { 0.0 };
        slow = lag * slow + (1.0 - lag) * before;
        let next = 2.0 * radius * angle.cos() * fast[0] - radius * radius * fast[1] + 0.05 * before;
        fast = [next, fast[0]];
        y.push(slow + next + 0.02 * random.uniform());
    }
    let time: Vec<f64> = (0..ROWS).map(|row| row as f64 * 1e-3).collect();
    csv(&[("t", &time), ("u", &u), ("y", &y)])
}

#[test]
fn a_fast_log_is_filtered_before_it_is_thinned() {
    let folder = Folder::with_log(drive());
    let free_run = |how: &str| {
        let line = format!("log.csv --time t --resample 0.01:{how} --model oe --nb 3 --nf 1 --nk 0");
        let report = folder.fit(&format!("{line} --estimate 1..1400 --validate 1401..2000"));
        assert_eq!(report["data"]["rows"], 2000);
        let filter = report["data"]["logs"][0]["resampled"]["anti_alias"].clone();
        let fits = report["fit"].as_array().unwrap();
        (number(fits.last().unwrap(), "/percent"), filter)
    };
    let (raw, none) = free_run("hold:unfiltered");
    let (filtered, filter) = free_run("hold");
    println!("free run on the validation rows: {raw} % unfiltered, {filtered} % filtered");
    assert_eq!((none, &filter["taps"]), (Value::Null, &json!(365)));
    assert!((number(&filter, "/cutoff") - 45.0).abs() < 1e-9);
    assert!(raw < 88.0 && filtered > 94.0, "{raw} {filtered}");
}
