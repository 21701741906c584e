use super::*;

fn message(kind: u8, data: &[u8]) -> Vec<u8> {
    [&[0xa3, 0x95, kind], data].concat()
}

/// A text with zeros after it.
fn text(text: &str, size: usize) -> Vec<u8> {
    let mut bytes = text.as_bytes().to_vec();
    bytes.resize(size, 0);
    bytes
}

fn declare(kind: u8, size: u8, name: &str, letters: &str, labels: &str) -> Vec<u8> {
    let data = [vec![kind, size + 3], text(name, 4), text(letters, 16), text(labels, 64)].concat();
    message(128, &data)
}

fn rate(row: u8) -> Vec<u8> {
    let time = 2_000_000 + 2_500 * u64::from(row);
    message(
        1,
        &[&time.to_le_bytes()[..], &f32::from(row).to_le_bytes(), &(10 * i16::from(row)).to_le_bytes()]
            .concat(),
    )
}

fn sensor(kind: u8, time: u64, instance: u8, value: f32) -> Vec<u8> {
    message(kind, &[&time.to_le_bytes()[..], &[instance], &value.to_le_bytes()].concat())
}

fn declarations() -> Vec<u8> {
    [
        declare(128, 86, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns"),
        declare(1, 14, "RATE", "Qfc", "TimeUS,R,ROut"),
        declare(2, 13, "IMU", "QBf", "TimeUS,I,GyrX"),
        declare(3, 41, "FMTU", "QBNN", "TimeUS,FmtType,UnitIds,MultIds"),
        declare(4, 72, "MSG", "QZ", "TimeUS,Message"),
    ]
    .concat()
}

fn units(kind: u8, units: &str) -> Vec<u8> {
    message(3, &[1_500_000_u64.to_le_bytes().to_vec(), vec![kind], text(units, 16), text("F--", 16)].concat())
}

/// Four rows of rates, and two sensors of one kind.
pub(super) fn flight() -> Vec<u8> {
    [
        declarations(),
        rate(0),
        sensor(2, 2_000_000, 0, 0.5),
        sensor(2, 2_000_000, 1, 0.25),
        // What tells them apart is said after their first messages.
        units(2, "s#E"),
        message(4, &[2_000_000_u64.to_le_bytes().to_vec(), text("armed", 64)].concat()),
        rate(1),
        sensor(2, 2_002_500, 0, 0.75),
        sensor(2, 2_002_500, 1, 0.125),
        rate(2),
        rate(3),
    ]
    .concat()
}

#[test]
fn sensors_of_one_kind_are_topics_of_their_own() {
    let log = flight();
    let reader = reader(&log);
    assert_eq!(reader.names(), ["RATE.R", "RATE.ROut", "IMU.GyrX", "IMU#1.GyrX"]);
    assert_eq!(reader.remarks(), ["flight.log: messages without numbers or a clock are left out: MSG"]);
    let table = table(&log, &["IMU#1.GyrX", "RATE.ROut"]);
    assert_eq!(table.columns, [vec![0.25, 0.125], vec![0.0, 0.1, 0.2, 0.3]]);
    assert_eq!(table.clocks[0].time, [2.0, 2.0025]);
    assert_eq!(table.clocks[1].time, [2.0, 2.0025, 2.005, 2.0075]);
    assert!(table.words.is_empty());
}

#[test]
fn letters_are_numbers() {
    let letters = "IbBhHiIqgdcCeELa";
    let values = [
        3_000_u32.to_le_bytes().to_vec(),
        vec![0xff, 0xfe],
        [(-300_i16).to_le_bytes(), 300_u16.to_le_bytes()].concat(),
        [(-70_000_i32).to_le_bytes(), 70_000_u32.to_le_bytes()].concat(),
        (-5_i64).to_le_bytes().to_vec(),
        0x3c00_u16.to_le_bytes().to_vec(),
        0.1_f64.to_le_bytes().to_vec(),
        [(-150_i16).to_le_bytes(), 150_u16.to_le_bytes()].concat(),
        [(-1_250_i32).to_le_bytes(), 1_250_u32.to_le_bytes()].concat(),
        473_977_418_i32.to_le_bytes().to_vec(),
        (0..32_i16).flat_map(|value| (value - 16).to_le_bytes()).collect(),
    ];
    let data = values.concat();
    let log = [
        declare(9, data.len() as u8, "ALL", letters, "TimeMS,b,B,h,H,i,I,q,g,d,c,C,e,E,L,a"),
        message(9, &data),
    ]
    .concat();
    let table = whole(&log).unwrap();
    assert_eq!(table.time, Some(vec![3.0]));
    let values: Vec<f64> = table.columns.iter().map(|column| column[0]).collect();
    let expected = [
        -1.0,
        254.0,
        -300.0,
        300.0,
        -70_000.0,
        70_000.0,
        -5.0,
        1.0,
        0.1,
        -1.5,
        1.5,
        -12.5,
        12.5,
        47.397_741_8,
    ];
    assert_eq!(values[..14], expected);
    assert_eq!((values[14], values[45], values.len()), (-16.0, 15.0, 46));
}

#[test]
fn what_was_lost_is_told() {
    let mut log =
        [declarations(), rate(0), vec![0xff; 20], rate(1), message(77, b"nobody declared this")].concat();
    log.extend(rate(2));
    log.extend(&rate(3)[..8]);
    let table = table(&log, &["RATE.R"]);
    assert_eq!(table.columns, [[0.0, 1.0, 2.0]]);
    assert_eq!(
        table.words,
        [
            "flight.log: the log ends in the middle of a message, as where power was cut: it is read up to there",
            "flight.log: 43 bytes in 2 places are no messages, as in a file that is damaged: they are left out",
        ]
    );
}

#[test]
fn declarations_that_do_not_fit_are_no_declarations() {
    let log = [
        declarations(),
        // More than the message has, and letters that nobody knows.
        declare(20, 4, "LONG", "Qf", "TimeUS,X"),
        declare(21, 12, "ODD", "Q?", "TimeUS,X"),
        // Before its own head ends.
        message(128, &[vec![22, 2], text("TINY", 4), text("Q", 16), text("TimeUS", 64)].concat()),
        rate(0),
        rate(1),
    ]
    .concat();
    assert_eq!(reader(&log).names(), ["RATE.R", "RATE.ROut"]);
}
