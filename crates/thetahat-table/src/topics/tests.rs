//! Logs that are written here byte by byte, as the formats say: whole, cut, damaged, and made to do harm.

mod damage;
mod dataflash;
mod ulog;
mod wpilog;

use std::io::Cursor;
use std::ops::ControlFlow;

use super::super::mailbox::Event;
use super::super::memory::Bound;
use super::super::source::Format;
use super::super::{ErrorKind, Header, OwnClock, Reader};
use super::*;

fn opened(bytes: &[u8], options: &Options) -> Result<TopicsReader, Error> {
    let bytes = Bytes::new("flight.log", Cursor::new(bytes.to_vec()), Some(bytes.len() as u64))?;
    let Some(Format::Topical(format)) = bytes.format else {
        return Err(Error::data("flight.log", None, "it is no log of topics"));
    };
    TopicsReader::open(bytes, format, options)
}

fn reader(bytes: &[u8]) -> TopicsReader {
    opened(bytes, &Options::default()).unwrap()
}

fn error(bytes: &[u8]) -> String {
    opened(bytes, &Options::default()).err().unwrap().to_string()
}

/// The columns of these names.
fn selection(reader: &TopicsReader, names: &[&str]) -> Selection {
    let place = |name: &&str| {
        let found = reader.names().iter().position(|own| own == name);
        found.unwrap_or_else(|| panic!("{name} is none of {:?}", reader.names()))
    };
    Selection { columns: names.iter().map(place).collect(), ..Selection::default() }
}

fn table(bytes: &[u8], names: &[&str]) -> Table {
    let reader = reader(bytes);
    let selection = selection(&reader, names);
    reader.table(&selection).unwrap()
}

/// Everything of a log.
fn whole(bytes: &[u8]) -> Result<Table, Error> {
    let reader = opened(bytes, &Options::default())?;
    let columns = (0..reader.names().len()).collect();
    reader.table(&Selection { columns, ..Selection::default() })
}

#[test]
fn each_topic_has_its_clock() {
    let log = ulog::flight();
    let reader = reader(&log);
    let shown: Vec<(&str, usize, i64)> = (reader.topics().iter())
        .map(|topic| (topic.name.as_str(), topic.rows, (1e6 * topic.duration).round() as i64))
        .collect();
    assert_eq!(shown, [("attitude", 4, 30_000), ("battery", 2, 1_000_000), ("battery#1", 1, 0)]);
    assert_eq!(
        reader.names()[reader.topics()[1].columns.clone()],
        ["battery.voltage_v", "battery.cells[0]", "battery.cells[1]"]
    );

    let one = table(&log, &["attitude.yawspeed", "attitude.rollspeed"]);
    assert_eq!(one.time, Some(vec![1.0, 1.01, 1.02, 1.03]));
    assert_eq!(one.columns, [vec![0.0, -0.5, -1.0, -1.5], vec![0.0, 1.0, 2.0, 3.0]]);
    assert_eq!((one.rows, one.clocks.len()), (4, 0));

    let two = table(&log, &["battery.cells[1]", "attitude.rollspeed", "battery.voltage_v"]);
    assert_eq!((two.time, two.rows), (None, 4));
    assert_eq!(two.columns, [vec![2.0, 2.0], vec![0.0, 1.0, 2.0, 3.0], vec![12.5, 12.25]]);
    let clock = |topic: &str, time: &[f64], columns: &[usize]| OwnClock {
        topic: topic.to_owned(),
        time: time.to_vec(),
        columns: columns.to_vec(),
    };
    assert_eq!(
        two.clocks,
        [clock("battery", &[1.0, 2.0], &[0, 2]), clock("attitude", &[1.0, 1.01, 1.02, 1.03], &[1])]
    );
}

#[test]
fn logs_are_known_by_their_first_bytes_packed_or_not() {
    use std::io::Write as _;
    let folder = tempfile::tempdir().unwrap();
    for (log, topics) in [(ulog::flight(), 3), (dataflash::flight(), 3), (wpilog::flight(), 4)] {
        let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        packed.write_all(&log).unwrap();
        for (name, bytes) in [("plain", log), ("packed", packed.finish().unwrap())] {
            let path = folder.path().join(name);
            std::fs::write(&path, bytes).unwrap();
            let reader = Reader::open(&path, &Options::default()).unwrap();
            assert_eq!(reader.topics().map(<[Topic]>::len), Some(topics), "{name}");
            assert_eq!(reader.words(), vec![false; reader.names().len()]);
            assert!(
                reader.times().is_empty()
                    && reader.called_clocks().is_empty()
                    && reader.nameless().is_empty()
            );
            let table = reader.read(&Selection { columns: vec![0], ..Selection::default() }, &mut |_, _| {});
            assert!(table.is_ok_and(|table| table.rows > 0));
        }
    }
}

#[test]
fn a_topic_is_read_in_parts_and_row_by_row_and_several_are_not() {
    let log = ulog::flight();
    let one = reader(&log);
    let rates = selection(&one, &["attitude.rollspeed"]);
    let mut parts = Vec::new();
    let mut take = |part: Table| {
        parts.push((part.time.unwrap(), part.columns));
        ControlFlow::Continue(())
    };
    one.read_parts(&rates, Some(2), &mut |_, _| {}, &mut take).unwrap();
    assert_eq!(parts, [(vec![1.0, 1.01], vec![vec![0.0, 1.0]]), (vec![1.02, 1.03], vec![vec![2.0, 3.0]])]);

    let mut stream = reader(&log).stream(&rates).unwrap();
    let mut rows = Vec::new();
    loop {
        match stream.next().unwrap() {
            Event::Row => rows.push((stream.row(), stream.time().unwrap(), stream.values().to_vec())),
            Event::End => break,
            _ => {}
        }
    }
    assert_eq!(rows.last(), Some(&(4, 1.03, vec![3.0])));
    assert_eq!(rows.len(), 4);

    let two = reader(&log);
    let both = selection(&two, &["attitude.rollspeed", "battery.voltage_v"]);
    let refused =
        two.read_parts(&both, Some(2), &mut |_, _| {}, &mut |_| ControlFlow::Break(())).unwrap_err();
    let stream = reader(&log).stream(&both).err().unwrap();
    for error in [refused, stream] {
        let error = error.to_string();
        assert!(error.contains("of several topics (attitude, battery)"), "{error}");
        assert!(error.contains("name columns of one topic"), "{error}");
    }
}

#[test]
fn what_makes_no_sense_is_refused() {
    let log = ulog::flight();
    let columns = |columns: &[usize]| Selection { columns: columns.to_vec(), ..Selection::default() };
    let with_time = Selection { time: Some(0), ..columns(&[1]) };
    for (selection, message) in [
        (columns(&[0, 0]), "column 'attitude.rollspeed' is selected twice"),
        (columns(&[99]), "there is no column 100"),
        (with_time, "each topic has a clock of its own; leave `time` out"),
    ] {
        let error = reader(&log).table(&selection).unwrap_err().to_string();
        assert!(error.starts_with("flight.log: ") && error.contains(message), "{error}");
    }
    for (options, message) in [
        (
            Options { delimiter: Some(b';'), ..Options::default() },
            "`delimiter` says how a text is written, and this is an ULog",
        ),
        (Options { header: Header::None, ..Options::default() }, "`no-header`"),
        (
            Options { time_unit: Some(crate::Unit::Microseconds), ..Options::default() },
            "`time-unit` says how times",
        ),
    ] {
        let error = opened(&log, &options).err().unwrap().to_string();
        assert!(error.contains(message), "{error}");
    }
}

#[test]
fn a_log_that_does_not_fit_into_memory_is_refused() {
    let log = ulog::flight();
    let with = |per_value: u64, free: u64| {
        let options = Options { bound: Some(Bound::of(per_value, free)), ..Options::default() };
        opened(&log, &options).and_then(|reader| {
            let all = selection(&reader, &["attitude.rollspeed"]);
            reader.table(&all)
        })
    };
    assert!(with(8, 1 << 20).is_ok());
    for (per_value, free, words) in [(8, 10, "the file has more than"), (1 << 30, 1 << 20, "8 values take")] {
        let error = with(per_value, free).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Memory);
        assert!(error.to_string().contains(words), "{error}");
    }
}
