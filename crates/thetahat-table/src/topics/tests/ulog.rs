use super::*;

/// A message with its head.
pub(super) fn message(kind: u8, data: &[u8]) -> Vec<u8> {
    [&(data.len() as u16).to_le_bytes()[..], &[kind], data].concat()
}

pub(super) fn head() -> Vec<u8> {
    [&b"ULog\x01\x12\x35\x01"[..], &999_000_u64.to_le_bytes()].concat()
}

/// No data is appended.
fn flags() -> Vec<u8> {
    message(b'B', &[0; 40])
}

pub(super) fn subscribe(instance: u8, id: u16, name: &str) -> Vec<u8> {
    message(b'A', &[&[instance][..], &id.to_le_bytes(), name.as_bytes()].concat())
}

pub(super) fn data(id: u16, microseconds: u64, values: &[u8]) -> Vec<u8> {
    message(b'D', &[&id.to_le_bytes()[..], &microseconds.to_le_bytes(), values].concat())
}

fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

fn declarations() -> Vec<u8> {
    [
        head(),
        flags(),
        message(b'I', b"\x10char[3] sys_namePX4"),
        message(b'F', b"attitude:uint64_t timestamp;float rollspeed;float yawspeed;uint8_t[4] _padding0;"),
        message(b'F', b"battery:uint64_t timestamp;float voltage_v;char[3] serial;uint8_t[2] cells;"),
        message(b'P', b"\x0cint32_t SYSX\x01\0\0\0"),
        subscribe(0, 0, "attitude"),
        subscribe(0, 1, "battery"),
        subscribe(1, 2, "battery"),
    ]
    .concat()
}

pub(super) fn sync() -> Vec<u8> {
    message(b'S', b"\x2f\x73\x13\x20\x25\x0c\xbb\x12")
}

fn attitude(row: u8) -> Vec<u8> {
    let time = 1_000_000 + 10_000 * u64::from(row);
    data(0, time, &floats(&[f32::from(row), -0.5 * f32::from(row)]))
}

fn battery(id: u16, time: u64, voltage: f32) -> Vec<u8> {
    data(id, time, &[floats(&[voltage]), b"abc\x01\x02".to_vec()].concat())
}

/// Four rows of an attitude, two of a battery and one of another.
pub(super) fn flight() -> Vec<u8> {
    [
        declarations(),
        attitude(0),
        battery(1, 1_000_000, 12.5),
        attitude(1),
        message(b'L', b"6\0\0\0\0\0\0\0\0armed"),
        sync(),
        battery(2, 1_000_500, 3.7),
        attitude(2),
        attitude(3),
        battery(1, 2_000_000, 12.25),
    ]
    .concat()
}

#[test]
fn formats_stand_in_one_another() {
    let log = [
        head(),
        message(b'F', b"esc_status:uint64_t timestamp;int16_t count;esc_report[2] esc;bool armed;"),
        message(b'F', b"esc_report:uint64_t timestamp;uint8_t[3] _padding0;float rpm;"),
        subscribe(3, 7, "esc_status"),
        data(
            7,
            5_000_000,
            &[
                &(-7_i16).to_le_bytes()[..],
                &1_u64.to_le_bytes(),
                &[9, 9, 9],
                &100_f32.to_le_bytes(),
                &(1_u64 << 60).to_le_bytes(),
                &[9, 9, 9],
                &f32::INFINITY.to_le_bytes(),
                &[1],
            ]
            .concat(),
        ),
    ]
    .concat();
    let names = ["count", "esc[0].timestamp", "esc[0].rpm", "esc[1].timestamp", "esc[1].rpm", "armed"];
    let names: Vec<String> = names.iter().map(|name| format!("esc_status#3.{name}")).collect();
    assert_eq!(reader(&log).names(), names);
    let table = whole(&log).unwrap();
    assert_eq!(table.time, Some(vec![5.0]));
    let values: Vec<f64> = table.columns.iter().map(|column| column[0]).collect();
    assert_eq!(values[..4], [-7.0, 1.0, 100.0, (1_u64 << 60) as f64]);
    assert!(values[4].is_nan() && values[5] == 1.0);
    let words = table.words.join("\n");
    assert!(
        words.contains("'esc_status#3.esc[1].rpm' has 1 infinite value, which counts as missing"),
        "{words}"
    );
    assert!(words.contains("'esc_status#3.esc[1].timestamp' has whole numbers beyond 2^53"), "{words}");
}

#[test]
fn a_format_that_contains_itself_is_left_out() {
    let log = [
        declarations(),
        message(b'F', b"loop:uint64_t timestamp;loop[2] again;"),
        message(b'F', b"wide:uint64_t timestamp;none[60000] a;"),
        message(b'F', b"none:empty[60000] b;"),
        message(b'F', b"empty:char[0] c;"),
        message(b'F', b"texts:uint64_t timestamp;char[4] text;"),
        message(b'F', b"clockless:float x;"),
        subscribe(0, 10, "loop"),
        subscribe(0, 11, "wide"),
        subscribe(0, 12, "texts"),
        subscribe(0, 13, "clockless"),
        subscribe(0, 14, "nowhere"),
        attitude(0),
        (10..15).flat_map(|id| data(id, 1, b"abcd")).collect(),
        attitude(1),
    ]
    .concat();
    let reader = reader(&log);
    assert_eq!(reader.topics().len(), 1);
    assert_eq!(
        reader.remarks(),
        ["flight.log: topics without numbers or a clock are left out: loop, wide, texts, clockless, nowhere"]
    );
    assert!(table(&log, &["attitude.rollspeed"]).words.is_empty());
}

#[test]
fn what_was_lost_is_told() {
    let mut log = [declarations(), attitude(0), attitude(1)].concat();
    // A block of a card that was lost, data of a topic that nobody declared, and of a size that is too small.
    log.extend([0; 100]);
    log.extend(sync());
    log.extend(attitude(2));
    log.extend(data(99, 1, b"1234"));
    log.extend(data(0, 1, b"12"));
    log.extend(message(b'O', &1500_u16.to_le_bytes()));
    log.extend(&attitude(3)[..9]);
    let table = table(&log, &["attitude.rollspeed"]);
    assert_eq!(table.columns, [[0.0, 1.0, 2.0]]);
    assert_eq!(
        table.words,
        [
            "flight.log: the log ends in the middle of a message, as where power was cut: it is read up to there",
            "flight.log: 100 bytes in 1 place are no messages, as in a file that is damaged: they are left out",
            "flight.log: 2 messages are not as declared, and left out",
            "flight.log: the recorder was too slow 1 time, and left out 1.500 s in all",
        ]
    );
}

#[test]
fn appended_data_begin_where_the_log_ended() {
    let cut = [declarations(), attitude(0), attitude(1)[..7].to_vec()].concat();
    let mut log = [cut.clone(), attitude(2)].concat();
    let flags = 16 + 3;
    log[flags + 8] = 1;
    log[flags + 16..flags + 24].copy_from_slice(&(cut.len() as u64).to_le_bytes());
    let rows = table(&log, &["attitude.rollspeed"]);
    assert_eq!(rows.columns, [[0.0, 2.0]]);
    // Offsets that lead nowhere do no harm.
    log[flags + 24..flags + 40].fill(0xff);
    assert_eq!(table(&log, &["attitude.rollspeed"]).columns, [[0.0, 2.0]]);
    // What a later version does to a file is not known.
    log[flags + 8] = 2;
    let error = error(&log);
    assert!(error.contains("an ULog of a later version"), "{error}");
}

#[test]
fn times_that_go_back_are_sorted_and_stand_once() {
    let row = |time: u64, value: f32| data(0, time, &floats(&[value, 0.0]));
    let log = [declarations(), row(3, 3.0), row(1, 1.0), row(2, 0.0), row(2, 2.0), row(4, 4.0)].concat();
    let table = table(&log, &["attitude.rollspeed"]);
    assert_eq!(table.time, Some(vec![1e-6, 2e-6, 3e-6, 4e-6]));
    assert_eq!(table.columns, [[1.0, 2.0, 3.0, 4.0]]);
    assert_eq!(
        table.words,
        [
            "flight.log: the times of 'attitude' go back in 1 place: its rows are sorted",
            "flight.log: 'attitude' has 1 row with the time of the one that follows: left out",
        ]
    );
}

#[test]
fn a_log_without_messages_is_refused() {
    for (log, why) in [
        (head(), "it may have ended"),
        ([head(), vec![0; 50]].concat(), "it is damaged"),
        (declarations(), "it may"),
    ] {
        let error = error(&log);
        assert!(
            error.contains("there is no message with numbers and a time") && error.contains(why),
            "{error}"
        );
    }
}

#[test]
fn a_topic_whose_clock_stands_still_has_none() {
    let row = |value: f32| data(0, 0, &floats(&[value, 0.0]));
    let log = [declarations(), row(1.0), row(2.0), battery(1, 5, 12.0)].concat();
    let reader = reader(&log);
    let rates = selection(&reader, &["attitude.rollspeed"]);
    let error = reader.table(&rates).unwrap_err().to_string();
    assert!(
        error.contains("the messages of 'attitude' all have the same time, 0 s: it has no clock"),
        "{error}"
    );
}
