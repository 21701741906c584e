//! Logs of flights and robots, whose topics have clocks of their own: the plant between two topics is found, whatever
//! the format.

use std::fs;
use std::path::PathBuf;

use serde_json::Value;

use crate::harness::{Folder, number};
use crate::signals::Random;

/// y' = (K u - y)/tau.
const GAIN: f64 = 3.0;
const TIME_CONSTANT: f64 = 0.15;
/// Microseconds after the start of the recorder.
const BEGIN: u64 = 12_345_678;
const OUTPUTS: u64 = 20_000;
const RATES: u64 = 4_000;
const ROWS: u64 = 300;

/// A recorded value and its time in microseconds.
type Sample = (u64, f64);

/// The output to a motor every 20 ms, and the rate every 4 ms or so from a little later on.
fn flight() -> (Vec<Sample>, Vec<Sample>) {
    let mut random = Random::new(3);
    let (mut level, mut left, mut state) = (0.0, 5, 0.0);
    let (mut outputs, mut rates) = (Vec::new(), Vec::new());
    for row in 0..ROWS {
        let now = BEGIN + OUTPUTS * row;
        outputs.push((now, level));
        let after = |microseconds: u64| {
            let decay = (-1e-6 * microseconds as f64 / TIME_CONSTANT).exp();
            decay * state + GAIN * (1.0 - decay) * level
        };
        for step in 0..OUTPUTS / RATES {
            let jitter = random.below(200) as u64;
            rates.push((
                now + 900 + RATES * step + jitter,
                after(900 + RATES * step + jitter) + 1e-3 * random.uniform(),
            ));
        }
        state = after(OUTPUTS);
        left -= 1;
        if left == 0 {
            (level, left) = (0.25 * random.below(5) as f64 - 0.5, 4 + random.below(12));
        }
    }
    (outputs, rates)
}

/// A ULog with batteries besides.
fn ulog(outputs: &[Sample], rates: &[Sample]) -> Vec<u8> {
    let message = |kind: u8, data: &[u8]| [&(data.len() as u16).to_le_bytes()[..], &[kind], data].concat();
    let subscribe = |id: u16, instance: u8, name: &str| {
        message(b'A', &[&[instance][..], &id.to_le_bytes(), name.as_bytes()].concat())
    };
    let data = |id: u16, time: u64, values: &[f64]| {
        let values: Vec<u8> = values.iter().flat_map(|&value| (value as f32).to_le_bytes()).collect();
        message(b'D', &[&id.to_le_bytes()[..], &time.to_le_bytes(), &values].concat())
    };
    let mut log = [&b"ULog\x01\x12\x35\x01"[..], &BEGIN.to_le_bytes()].concat();
    log.extend(message(b'B', &[0; 40]));
    for format in [
        "vehicle_attitude:uint64_t timestamp;float rollspeed;float pitchspeed;",
        "actuator_outputs:uint64_t timestamp;float[2] output;",
        "battery_status:uint64_t timestamp;float voltage_v;",
    ] {
        log.extend(message(b'F', format.as_bytes()));
    }
    log.extend(subscribe(0, 0, "vehicle_attitude"));
    log.extend(subscribe(1, 0, "actuator_outputs"));
    log.extend(subscribe(2, 0, "battery_status"));
    log.extend(subscribe(3, 1, "battery_status"));
    let mut messages: Vec<(u64, Vec<u8>)> = Vec::new();
    messages.extend(rates.iter().map(|&(time, rate)| (time, data(0, time, &[rate, 0.0]))));
    messages.extend(outputs.iter().map(|&(time, output)| (time, data(1, time, &[output, -output]))));
    for second in 0..4 {
        let time = BEGIN + 1_000_000 * second;
        messages.extend([(2, 12.5), (3, 3.7)].map(|(id, volts)| (time, data(id, time, &[volts]))));
    }
    messages.sort_by_key(|(time, _)| *time);
    messages.into_iter().fold(log, |log, (_, message)| [log, message].concat())
}

fn dataflash(outputs: &[Sample], rates: &[Sample]) -> Vec<u8> {
    let text = |text: &str, size: usize| {
        let mut bytes = text.as_bytes().to_vec();
        bytes.resize(size, 0);
        bytes
    };
    let declare = |kind: u8, size: u8, name: &str, letters: &str, labels: &str| {
        let head = vec![0xa3, 0x95, 128, kind, size];
        [head, text(name, 4), text(letters, 16), text(labels, 64)].concat()
    };
    let row = |kind: u8, (time, value): Sample| {
        [&[0xa3, 0x95, kind][..], &time.to_le_bytes(), &(value as f32).to_le_bytes()].concat()
    };
    let mut log = declare(128, 89, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns");
    log.extend(declare(1, 15, "MOTB", "Qf", "TimeUS,Out"));
    log.extend(declare(2, 15, "RATE", "Qf", "TimeUS,R"));
    let mut rows: Vec<(u8, Sample)> = outputs.iter().map(|sample| (1, *sample)).collect();
    rows.extend(rates.iter().map(|sample| (2, *sample)));
    rows.sort_by_key(|(_, (time, _))| *time);
    rows.into_iter().fold(log, |log, (kind, sample)| [log, row(kind, sample)].concat())
}

fn wpilog(outputs: &[Sample], rates: &[Sample]) -> Vec<u8> {
    // All numbers in as many bytes as there may be.
    let record = |entry: u32, time: u64, data: &[u8]| {
        [&[0x7f][..], &entry.to_le_bytes(), &(data.len() as u32).to_le_bytes(), &time.to_le_bytes(), data]
            .concat()
    };
    let text = |text: &str| [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat();
    let start = |entry: u32, name: &str| {
        record(0, 0, &[vec![0], entry.to_le_bytes().to_vec(), text(name), text("double"), text("")].concat())
    };
    let mut log = b"WPILOG\x00\x01\0\0\0\0".to_vec();
    log.extend(start(1, "NT:/drive, left/volts"));
    log.extend(start(2, "/drive/velocity"));
    for (entry, samples) in [(1, outputs), (2, rates)] {
        log.extend(samples.iter().flat_map(|&(time, value)| record(entry, time, &value.to_le_bytes())));
    }
    log
}

/// The file of the pages.
fn sample() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/data/flights/roll.ulg")
}

fn folder() -> Folder {
    let (outputs, rates) = flight();
    let folder = Folder::new();
    folder.write("flight.ulg", ulog(&outputs, &rates));
    folder.write("flight.bin", dataflash(&outputs, &rates));
    folder.write("robot.wpilog", wpilog(&outputs, &rates));
    folder
}

/// The names of input and output in each format.
const CHANNELS: [(&str, &str); 3] = [
    ("flight.ulg", "-u 'actuator_outputs.output[0]' -y vehicle_attitude.rollspeed"),
    ("flight.bin", "-u MOTB.Out -y RATE.R"),
    ("robot.wpilog", "-u '\"NT:/drive, left/volts\"' -y drive/velocity"),
];

#[test]
fn the_file_of_the_pages_is_what_is_written_here() {
    let (outputs, rates) = flight();
    let log = ulog(&outputs, &rates);
    if std::env::var_os("WRITE_FLIGHT").is_some() {
        fs::write(sample(), &log).expect("the file can be written");
    }
    assert!(fs::read(sample()).expect("the file") == log, "WRITE_FLIGHT=1 writes it");
}

#[test]
fn the_plant_between_two_topics_is_found() {
    let folder = folder();
    for (log, channels) in CHANNELS {
        let run =
            folder.run(&format!("fit {log} {channels} --structure p1 --initial estimate --format json"));
        assert_eq!(run.code, 0, "{log}: {}", run.stderr);
        let notes: Vec<&str> = run.stderr.lines().filter(|line| line.starts_with("note: ")).collect();
        let [note] = notes[..] else { panic!("{log}: {}", run.stderr) };
        for words in ["(50 Hz)", "(250 Hz)", "every 0.004 s", "--resample says otherwise"] {
            assert!(note.contains(words), "{log}: {note}");
        }
        let report: Value = serde_json::from_str(&run.stdout).expect("a report");
        for (place, truth) in [(0, GAIN), (1, TIME_CONSTANT)] {
            let found = number(&report, &format!("/model/parameters/{place}/value"));
            // The input changes up to a millisecond before the instant from which on it counts.
            assert!((found / truth - 1.0).abs() < 0.02, "{log}: {found}, truth {truth}");
        }
        let source = &report["data"]["logs"][0];
        assert_eq!(source["resampled"]["step"], 0.004, "{log}");
        assert_eq!(source["time"], Value::Null, "{log}");
    }
}

#[test]
fn another_clock_is_asked_for() {
    let folder = folder();
    for (log, channels) in CHANNELS {
        let command = format!("{log} {channels} --resample 0.01:auto --structure p1 --initial estimate");
        let report = folder.fit(&command);
        assert_eq!(report["data"]["logs"][0]["resampled"]["step"], 0.01, "{log}");
        let found = number(&report, "/model/parameters/1/value");
        assert!((found / TIME_CONSTANT - 1.0).abs() < 0.05, "{log}: {found}");
    }
}

#[test]
fn an_inspection_lists_topics_and_sees_several() {
    let folder = folder();
    let run = folder.done("inspect flight.ulg");
    for words in [
        "flight.ulg: 4 topics, each with a clock of its own",
        "vehicle_attitude  1500",
        "actuator_outputs: output[0..1]",
        "battery_status#1: voltage_v",
        "thetahat inspect flight.ulg -u 'actuator_outputs.output[0]' -y vehicle_attitude.rollspeed",
    ] {
        assert!(run.stdout.contains(words), "{words}: {}", run.stdout);
    }
    let list: Value =
        serde_json::from_str(&folder.done("inspect robot.wpilog --format json").stdout).expect("a list");
    assert_eq!(list["schema"], "thetahat.topics/1");
    assert_eq!(list["topics"][0]["columns"][0], "NT:/drive, left/volts");
    assert_eq!(
        (list["topics"][0]["rows"].as_u64(), list["topics"][1]["rows"].as_u64()),
        (Some(300), Some(1500))
    );

    for (log, channels) in CHANNELS {
        let run = folder.done(&format!("inspect {log} {channels} --format json"));
        let inspection: Value = serde_json::from_str(&run.stdout).expect("an inspection");
        assert_eq!(inspection["log"]["resampled"]["step"], 0.004, "{log}");
        assert_eq!(inspection["clock"]["sample_time"], 0.004, "{log}");
        let command = inspection["command"].as_str().expect("a command");
        let command = command.strip_prefix("thetahat ").expect("a command");
        folder.done(command);
        let asked = folder.done(&format!("inspect {log} {channels} --resample 0.02:hold"));
        assert!(asked.stdout.contains("--resample 0.02:hold"), "{log}: {}", asked.stdout);
    }
}

#[test]
fn columns_of_one_topic_are_a_table() {
    let folder = folder();
    let log = "flight.ulg -u vehicle_attitude.pitchspeed -y vehicle_attitude.rollspeed";
    let run = folder.done(&format!("inspect {log}"));
    assert!(
        run.stderr.is_empty() && run.stdout.contains("flight.ulg: 1500 rows, regular clock"),
        "{}",
        run.stdout
    );
    let streamed = folder.done(&format!("inspect {log} --stream"));
    assert!(streamed.stdout.contains("1500 rows"), "{}", streamed.stdout);
    let series = "flight.ulg -y vehicle_attitude.rollspeed --na 2 --nb 0";
    let counted = folder.fit(&format!("{series} --sample-time 0.5"));
    assert_eq!(counted["model"]["sample_time"], 0.5);
    let tracked = folder.done(&format!("track {series} --format csv --quiet --sample-time 0.004"));
    assert_eq!(tracked.stdout.lines().count(), 1501);
    let last = tracked.stdout.lines().last().expect("a line");
    assert!(last.contains("18.3"), "{last}");
}

#[test]
fn what_is_not_there_or_does_not_go_together_is_refused() {
    let folder = folder();
    let channels = CHANNELS[0].1;
    let cases = [
        ("fit flight.ulg --na 1 --nb 1".to_owned(), 3, "no column is called y"),
        (
            "fit flight.ulg --na 1 --nb 1".to_owned(),
            3,
            "`thetahat inspect flight.ulg` lists the columns of its 4 topics",
        ),
        (
            "fit flight.ulg -u battery_status#2.voltage_v -y vehicle_attitude.rollspeed --na 1 --nb 1"
                .to_owned(),
            3,
            "there is no column 'battery_status#2.voltage_v'",
        ),
        (format!("fit flight.ulg {channels} --na 1 --nb 1 --time t"), 3, "leave --time out"),
        (format!("fit flight.ulg {channels} --na 1 --nb 1 --sample-time 1"), 3, "of several topics"),
        (
            format!("fit flight.ulg {channels} --na 1 --nb 1 --delimiter ,"),
            3,
            "--delimiter says how a text is written",
        ),
        (format!("fit flight.ulg {channels} --na 1 --nb 1 --stream"), 3, "name columns of one topic"),
        (format!("inspect flight.ulg {channels} --stream"), 3, "name columns of one topic"),
        ("inspect flight.ulg --stream".to_owned(), 3, "lists the columns of its 4 topics"),
        ("inspect flight.ulg --html page.html".to_owned(), 2, "--html draws columns"),
        (format!("track flight.ulg {channels} --na 1 --nb 1"), 3, "name columns of one topic"),
    ];
    for (line, code, words) in cases {
        folder.assert_refused(&line, code, words);
    }
}

#[test]
fn a_log_that_ends_in_a_message_is_read_up_to_there() {
    let folder = folder();
    for (log, channels) in CHANNELS {
        let bytes = fs::read(folder.path(log)).expect("a log");
        folder.write(log, &bytes[..bytes.len() - 3]);
        let run = folder.done(&format!("fit {log} {channels} --structure p1"));
        assert!(
            run.stderr.contains("warning: ") && run.stderr.contains("as where power was cut"),
            "{log}: {}",
            run.stderr
        );
    }
}
