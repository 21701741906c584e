use super::*;

/// A record with numbers of as many bytes as they need.
fn record(entry: u32, microseconds: u64, data: &[u8]) -> Vec<u8> {
    let least = |number: u64| (8 - number.leading_zeros() as usize / 8).clamp(1, 8);
    let (id, size, time) = (least(entry.into()), least(data.len() as u64), least(microseconds));
    let sizes = (id - 1) | (size - 1) << 2 | (time - 1) << 4;
    [
        &[sizes as u8],
        &entry.to_le_bytes()[..id],
        &(data.len() as u32).to_le_bytes()[..size],
        &microseconds.to_le_bytes()[..time],
        data,
    ]
    .concat()
}

fn text(text: &str) -> Vec<u8> {
    [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat()
}

fn start(entry: u32, name: &str, kind: &str) -> Vec<u8> {
    record(0, 1, &[vec![0], entry.to_le_bytes().to_vec(), text(name), text(kind), text("{}")].concat())
}

fn finish(entry: u32) -> Vec<u8> {
    record(0, 1, &[&[1], &entry.to_le_bytes()[..]].concat())
}

fn doubles(values: &[f64]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

pub(super) fn head() -> Vec<u8> {
    [b"WPILOG\x00\x01", &text("made here")[..]].concat()
}

/// Velocities, an array that grows, switches and counts.
pub(super) fn flight() -> Vec<u8> {
    [
        head(),
        start(1, "NT:/drive/velocity", "double"),
        start(2, "/drive/modules", "float[]"),
        start(3, "enabled", "boolean"),
        start(300, "count", "int64"),
        start(5, "pose", "struct:Pose2d"),
        start(6, "console", "string"),
        record(1, 1_000_000, &doubles(&[0.5])),
        record(2, 1_000_000, &1_f32.to_le_bytes()),
        record(3, 1_000_001, &[1]),
        record(1, 1_020_000, &doubles(&[0.75])),
        record(300, 5_000_000_000, &(-3_i64).to_le_bytes()),
        record(2, 1_020_000, &[2_f32.to_le_bytes(), 3_f32.to_le_bytes()].concat()),
        record(5, 1_020_000, &[0; 24]),
        record(6, 1_020_000, b"hello"),
        record(0, 1, &[&[2][..], &1_u32.to_le_bytes(), &text("{\"source\": 1}")].concat()),
    ]
    .concat()
}

#[test]
fn entries_are_topics() {
    let log = flight();
    let reader = reader(&log);
    assert_eq!(
        reader.names(),
        ["NT:/drive/velocity", "drive/modules[0]", "drive/modules[1]", "enabled", "count"]
    );
    assert_eq!(
        reader.remarks(),
        [
            "flight.log: entries of structures are left out (record their numbers as entries of their own): pose",
            "flight.log: entries without numbers, or with others than before, are left out: console",
        ]
    );
    let modules = table(&log, &["drive/modules[1]", "drive/modules[0]"]);
    assert_eq!(modules.time, Some(vec![1.0, 1.02]));
    assert!(modules.columns[0][0].is_nan());
    assert_eq!((modules.columns[0][1], &modules.columns[1]), (3.0, &vec![1.0, 2.0]));
    let table = table(&log, &["count", "enabled", "NT:/drive/velocity"]);
    assert_eq!(table.columns, [vec![-3.0], vec![1.0], vec![0.5, 0.75]]);
    assert_eq!(table.clocks[0].time, [5000.0]);
}

#[test]
fn an_entry_that_starts_again_goes_on() {
    let log = [
        head(),
        start(1, "v", "double"),
        record(1, 10, &doubles(&[1.0])),
        finish(1),
        record(1, 11, &doubles(&[9.0])),
        start(4, "v", "double"),
        record(4, 20, &doubles(&[2.0])),
        // Another type is another entry, and has no name of its own.
        start(5, "v", "int64"),
        record(5, 30, &doubles(&[3.0])),
    ]
    .concat();
    let table = whole(&log).unwrap();
    assert_eq!((table.columns, table.time), (vec![vec![1.0, 2.0]], Some(vec![1e-5, 2e-5])));
    assert_eq!(table.words, ["flight.log: 1 message is not as declared, and left out"]);
    assert_eq!(reader(&log).remarks().len(), 2);
}

#[test]
fn long_arrays_are_cut_and_other_versions_refused() {
    let log = [head(), start(1, "a", "boolean[]"), record(1, 10, &[1; 1000])].concat();
    let reader = reader(&log);
    assert_eq!(reader.names().len(), 256);
    assert!(reader.remarks()[0].contains("more than 256 numbers"), "{:?}", reader.remarks());
    let mut log = flight();
    log[7] = 2;
    let error = error(&log);
    assert!(error.contains("a data log of version 2.0, and this program reads version 1"), "{error}");
}

#[test]
fn sizes_that_are_only_stated_take_nothing() {
    let record = [&[0x7f][..], &[1, 0, 0, 0], &[0xff; 4], &[0; 8], b"short"].concat();
    let log = [head(), start(1, "v", "double"), self::record(1, 10, &doubles(&[1.0])), record].concat();
    let table = whole(&log).unwrap();
    assert_eq!(table.columns, [[1.0]]);
    assert!(table.words[0].contains("ends in the middle of a message"), "{:?}", table.words);
    let names = record_of_names();
    assert!(error(&[head(), names].concat()).contains("there is no message"));
}

/// An entry whose name is said to be longer than there is.
fn record_of_names() -> Vec<u8> {
    record(0, 1, &[&[0][..], &1_u32.to_le_bytes(), &u32::MAX.to_le_bytes(), b"v"].concat())
}
