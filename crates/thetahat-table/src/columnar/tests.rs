//! Files that the writers of the same libraries make.

use std::fs;
use std::path::PathBuf;
use std::sync::Arc;

use arrow_array::types::*;
use arrow_array::*;
use arrow_ipc::CompressionType;
use arrow_ipc::writer::{FileWriter, IpcWriteOptions, StreamWriter};
use arrow_schema::{DataType, Field, Schema};
use parquet::arrow::ArrowWriter;
use parquet::basic::{BrotliLevel, Compression, GzipLevel, ZstdLevel};
use parquet::file::properties::WriterProperties;
use tempfile::TempDir;

use crate::memory::Bound;
use crate::{ClockColumns, Error, ErrorKind, Event, Header, Options, Reader, Selection, Table};

/// The formats by the ending of a file's name.
const FORMATS: [&str; 3] = ["parquet", "arrow", "arrows"];

fn batch(columns: &[(&str, ArrayRef)]) -> RecordBatch {
    let field = |(name, array): &(&str, ArrayRef)| Field::new(*name, array.data_type().clone(), true);
    let schema = Schema::new(columns.iter().map(field).collect::<Vec<_>>());
    let options =
        RecordBatchOptions::new().with_row_count(columns.first().map(|(_, array)| array.len()).or(Some(0)));
    let arrays = columns.iter().map(|(_, array)| Arc::clone(array)).collect();
    RecordBatch::try_new_with_options(Arc::new(schema), arrays, &options).unwrap()
}

/// The bytes of a file of batches of one schema; each is a row group.
fn bytes(format: &str, batches: &[RecordBatch]) -> Vec<u8> {
    let schema = batches[0].schema();
    let mut bytes = Vec::new();
    match format {
        "parquet" => {
            let mut writer = ArrowWriter::try_new(&mut bytes, schema, None).unwrap();
            for batch in batches {
                writer.write(batch).unwrap();
                writer.flush().unwrap();
            }
            writer.close().unwrap();
        }
        "arrow" => {
            let mut writer = FileWriter::try_new(&mut bytes, &schema).unwrap();
            batches.iter().for_each(|batch| writer.write(batch).unwrap());
            writer.finish().unwrap();
        }
        _ => {
            let mut writer = StreamWriter::try_new(&mut bytes, &schema).unwrap();
            batches.iter().for_each(|batch| writer.write(batch).unwrap());
            writer.finish().unwrap();
        }
    }
    bytes
}

/// A log in a folder of its own.
struct Written {
    _folder: TempDir,
    path: PathBuf,
}

fn written(bytes: &[u8]) -> Written {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("log");
    fs::write(&path, bytes).unwrap();
    Written { _folder: folder, path }
}

/// Reads columns by name, the clock among them if there is one.
fn read(bytes: &[u8], columns: &[&str], time: Option<&str>, options: &Options) -> Result<Table, Error> {
    let log = written(bytes);
    let reader = Reader::open(&log.path, options)?;
    let selection = selection(&reader, columns, time);
    reader.read(&selection, &mut |_, _| {})
}

fn selection(reader: &Reader, columns: &[&str], time: Option<&str>) -> Selection {
    let place = |name: &&str| reader.names().iter().position(|other| other == name).unwrap_or(99);
    Selection { columns: columns.iter().map(place).collect(), time: time.as_ref().map(place), date: None }
}

fn error(bytes: &[u8], columns: &[&str], time: Option<&str>) -> String {
    let error = read(bytes, columns, time, &Options::default()).map(drop).unwrap_err().to_string();
    // Without the folder.
    error.split_once("/log: ").map_or(error.clone(), |(_, message)| message.to_owned())
}

/// NaN as None, so that values can be compared.
fn shown(values: &[f64]) -> Vec<Option<f64>> {
    values.iter().map(|&value| (!value.is_nan()).then_some(value)).collect()
}

fn numbers(values: impl IntoIterator<Item = f64>) -> ArrayRef {
    Arc::new(Float64Array::from_iter_values(values))
}

fn array<A: Array + 'static>(array: A) -> ArrayRef {
    Arc::new(array)
}

#[test]
fn every_kind_of_number_is_read() {
    let dictionary =
        DictionaryArray::<Int8Type>::new(Int8Array::from(vec![Some(1), None, Some(0)]), numbers([2.5, -1.5]));
    let columns: Vec<(&str, ArrayRef, [Option<f64>; 3])> = vec![
        ("i8", array(Int8Array::from(vec![Some(-5), None, Some(7)])), [Some(-5.0), None, Some(7.0)]),
        ("i16", array(Int16Array::from(vec![Some(-500), None, Some(7)])), [Some(-500.0), None, Some(7.0)]),
        (
            "i32",
            array(Int32Array::from(vec![Some(-70_000), None, Some(7)])),
            [Some(-70_000.0), None, Some(7.0)],
        ),
        (
            "i64",
            array(Int64Array::from(vec![Some(-1 << 53), None, Some(7)])),
            [Some(-9_007_199_254_740_992.0), None, Some(7.0)],
        ),
        ("u8", array(UInt8Array::from(vec![Some(255), None, Some(7)])), [Some(255.0), None, Some(7.0)]),
        (
            "u16",
            array(UInt16Array::from(vec![Some(65_535), None, Some(7)])),
            [Some(65_535.0), None, Some(7.0)],
        ),
        (
            "u32",
            array(UInt32Array::from(vec![Some(u32::MAX), None, Some(7)])),
            [Some(4_294_967_295.0), None, Some(7.0)],
        ),
        (
            "u64",
            array(UInt64Array::from(vec![Some(1 << 53), None, Some(7)])),
            [Some(9_007_199_254_740_992.0), None, Some(7.0)],
        ),
        (
            "f32",
            array(Float32Array::from(vec![Some(0.1), None, Some(f32::NAN)])),
            [Some(f64::from(0.1_f32)), None, None],
        ),
        ("f64", array(Float64Array::from(vec![Some(0.1), None, Some(f64::NAN)])), [Some(0.1), None, None]),
        (
            "bool",
            array(BooleanArray::from(vec![Some(true), None, Some(false)])),
            [Some(1.0), None, Some(0.0)],
        ),
        ("null", array(NullArray::new(3)), [None; 3]),
        (
            "decimal",
            array(
                Decimal128Array::from(vec![Some(1_234), None, Some(-5)])
                    .with_precision_and_scale(10, 3)
                    .unwrap(),
            ),
            [Some(1.234), None, Some(-0.005)],
        ),
        (
            "long decimal",
            array(
                Decimal128Array::from(vec![Some(12_345_678_901_234_567_890_123), None, Some(1)])
                    .with_precision_and_scale(30, 22)
                    .unwrap(),
            ),
            [Some(1.234_567_890_123_456_8), None, Some(1e-22)],
        ),
        ("dictionary", array(dictionary), [Some(-1.5), None, Some(2.5)]),
    ];
    let table = batch(&columns.iter().map(|(name, array, _)| (*name, Arc::clone(array))).collect::<Vec<_>>());
    let names: Vec<&str> = columns.iter().map(|(name, ..)| *name).collect();
    for format in FORMATS {
        let found =
            read(&bytes(format, std::slice::from_ref(&table)), &names, None, &Options::default()).unwrap();
        assert_eq!((found.rows, found.time, found.start, found.words), (3, None, None, vec![]));
        for ((name, _, expected), values) in columns.iter().zip(&found.columns) {
            assert_eq!(shown(values), expected, "{format} {name}");
        }
    }
}

#[test]
fn batches_and_row_groups_follow_one_another() {
    let part = |rows: std::ops::Range<i32>| {
        batch(&[
            ("n", array(Int32Array::from_iter_values(rows.clone()))),
            ("y", numbers(rows.map(|row| f64::from(row) / 8.0))),
        ])
    };
    for format in FORMATS {
        let bytes = bytes(format, &[part(0..40_000), part(0..0), part(40_000..40_001), part(40_001..50_000)]);
        let table = read(&bytes, &["y", "n"], None, &Options::default()).unwrap();
        assert_eq!(table.rows, 50_000);
        assert!(table.columns[1].iter().enumerate().all(|(row, n)| *n == row as f64), "{format}");
        assert!(table.columns[0].iter().enumerate().all(|(row, y)| *y == row as f64 / 8.0), "{format}");
        assert_eq!(table.lines.place("log", 6, 0), "log: row 7");
        // Row by row they are the same.
        let log = written(&bytes);
        let reader = Reader::open_live(&log.path, &Options::default()).unwrap();
        let selection = selection(&reader, &["y"], Some("n"));
        let mut stream = reader.stream(&selection, false, None).unwrap();
        let mut rows = 0;
        loop {
            match stream.advance().unwrap() {
                Event::Row => {
                    assert_eq!(
                        (stream.values(), stream.time()),
                        (&[f64::from(rows) / 8.0][..], Some(f64::from(rows)))
                    );
                    rows += 1;
                    assert_eq!(stream.place("log"), format!("log: row {rows}"));
                }
                Event::Idle => {}
                Event::End => break,
                other => panic!("{other:?}"),
            }
        }
        assert_eq!(rows, 50_000, "{format}");
    }
}

#[test]
fn times_have_units_and_zones() {
    let second = 1_709_294_400; // 2024-03-01T12:00:00Z
    let clocks: Vec<(ArrayRef, Option<&str>, f64)> = vec![
        (array(TimestampSecondArray::from(vec![second, second + 2])), Some("2024-03-01T12:00:00"), 2.0),
        (
            array(
                TimestampMillisecondArray::from(vec![1_000 * second + 250, 1_000 * second + 350])
                    .with_timezone("UTC"),
            ),
            Some("2024-03-01T12:00:00.25Z"),
            0.1,
        ),
        (
            array(
                TimestampMicrosecondArray::from(vec![1_000_000 * second, 1_000_000 * second + 1])
                    .with_timezone("+01:00"),
            ),
            Some("2024-03-01T13:00:00+01:00"),
            1e-6,
        ),
        (
            array(
                TimestampNanosecondArray::from(vec![1_000_000_000 * second, 1_000_000_000 * second + 1])
                    .with_timezone("Europe/Berlin"),
            ),
            Some("2024-03-01T12:00:00Z"),
            1e-9,
        ),
        (array(Date32Array::from(vec![19_783, 19_784])), Some("2024-03-01"), 86_400.0),
        (
            array(Date64Array::from(vec![1_000 * second, 1_000 * second + 86_400_000])),
            Some("2024-03-01T12:00:00"),
            86_400.0,
        ),
        (
            array(StringArray::from(vec!["2024-03-01T12:00:00Z", "2024-03-01T13:00:01+01:00"])),
            Some("2024-03-01T12:00:00Z"),
            1.0,
        ),
        (array(StringViewArray::from(vec!["2024-03-01", "2024-03-02"])), Some("2024-03-01"), 86_400.0),
        (
            array(vec!["2024-03-01", "2024-03-02"].into_iter().collect::<DictionaryArray<Int32Type>>()),
            Some("2024-03-01"),
            86_400.0,
        ),
        (array(DurationMillisecondArray::from(vec![0, 1_500])), None, 1.5),
        (array(Time64MicrosecondArray::from(vec![0, 1_500_000])), None, 1.5),
        (numbers([0.0, 0.25]), None, 0.25),
        (array(Int64Array::from(vec![0, 3])), None, 3.0),
    ];
    for (clock, start, step) in clocks {
        let kind = clock.data_type().to_string();
        let table = batch(&[("when", clock), ("y", numbers([1.0, 2.0]))]);
        for format in FORMATS {
            // A day of 64 bits is a day to Parquet.
            if format == "parquet" && kind == "Date64" {
                continue;
            }
            let bytes = bytes(format, std::slice::from_ref(&table));
            let found = read(&bytes, &["y"], Some("when"), &Options::default()).unwrap();
            let time = found.time.unwrap();
            assert_eq!((time[1] - time[0], found.start.as_deref()), (step, start), "{format} {kind}");
            // Another run goes on from the same instant, whatever the zone it was written in.
            let log = written(&bytes);
            let reader = Reader::open_live(&log.path, &Options::default()).unwrap();
            let selection = selection(&reader, &["y"], Some("when"));
            let mut stream = reader.stream(&selection, true, start).unwrap();
            assert_eq!(stream.start(), start);
            while !matches!(stream.advance().unwrap(), Event::Row) {}
            assert_eq!(stream.time(), Some(time[0]), "{format} {kind}");
        }
    }
}

#[test]
fn what_is_rounded_is_said() {
    let table = batch(&[
        ("n", array(Int64Array::from(vec![i64::MAX, 1]))),
        ("m", array(UInt64Array::from(vec![1, u64::MAX]))),
    ]);
    let found = read(&bytes("arrow", &[table]), &["n", "m"], None, &Options::default()).unwrap();
    assert_eq!(found.columns, [[9_223_372_036_854_775_808.0, 1.0], [1.0, 18_446_744_073_709_551_616.0]]);
    assert_eq!(found.words.len(), 2);
    assert!(found.words[0].ends_with(
        "column 'n' has whole numbers beyond 2^53, which are rounded to the nearest ones that 64 bits of floating point hold"
    ));
}

#[test]
fn a_wrong_value_is_told_with_its_row() {
    let part = |y: [f64; 2], time: [Option<i64>; 2]| {
        batch(&[("y", numbers(y)), ("when", array(TimestampSecondArray::from(time.to_vec())))])
    };
    for format in FORMATS {
        let infinite = bytes(
            format,
            &[part([1.0, 2.0], [Some(0), Some(1)]), part([f64::INFINITY, 4.0], [Some(2), None])],
        );
        assert_eq!(
            error(&infinite, &["y"], None),
            "column 'y', row 3: the value is infinite; correct it, or write null if it is missing"
        );
        assert_eq!(
            error(&infinite, &[], Some("when")),
            "column 'when', row 4: the time is missing; fill it in, or take the row out"
        );
        let missing = bytes(format, &[part([1.0, 2.0], [None, Some(1)])]);
        assert_eq!(
            error(&missing, &["y"], Some("when")),
            "column 'when', row 1: the time is missing; fill it in, or take the row out"
        );
        // A stream leaves the row out, and goes on.
        let log = written(&infinite);
        let reader = Reader::open_live(&log.path, &Options::default()).unwrap();
        let selection = selection(&reader, &["y"], None);
        let mut stream = reader.stream(&selection, false, None).unwrap();
        let mut events = Vec::new();
        loop {
            match stream.advance().unwrap() {
                Event::Row => events.push(format!("{:?}", stream.values())),
                Event::Malformed(error) => {
                    events.push(error.to_string().split_once("/log: ").unwrap().1.to_owned())
                }
                Event::Idle => {}
                _ => break,
            }
        }
        let wrong = "column 'y', row 3: the value is infinite; correct it, or write null if it is missing";
        assert_eq!(events, ["[1.0]", "[2.0]", wrong, "[4.0]"]);
    }
}

#[test]
fn columns_that_hold_no_numbers_are_known_and_refused() {
    let list = ListArray::from_iter_primitive::<Float64Type, _, _>([Some([Some(1.0)])]);
    let inner: (Arc<Field>, ArrayRef) = (Arc::new(Field::new("x", DataType::Float64, true)), numbers([1.0]));
    let table = batch(&[
        ("list", array(list)),
        ("pair", array(StructArray::from(vec![inner]))),
        ("word", array(StringArray::from(vec!["1.5"]))),
        ("raw", array(BinaryArray::from(vec![&b"1"[..]]))),
        ("when", array(TimestampSecondArray::from(vec![0]))),
        ("y", numbers([1.0])),
        ("y2", numbers([2.0])),
    ]);
    for format in FORMATS {
        let bytes = bytes(format, std::slice::from_ref(&table));
        let log = written(&bytes);
        let reader = Reader::open(&log.path, &Options::default()).unwrap();
        assert_eq!(reader.words(), [true, true, true, true, true, false, false]);
        assert_eq!((reader.times(), reader.nameless()), (vec![ClockColumns { time: 4, date: None }], vec![]));
        for (column, expected) in [
            ("list", "column 'list' is of the type List"),
            ("pair", "column 'pair' is of the type Struct"),
            ("raw", "column 'raw' is of the type Binary"),
            ("word", "column 'word' holds texts (Utf8), not numbers; write it as a column of numbers"),
            ("when", "which only the clock is; name it with `time`"),
        ] {
            let message = error(&bytes, &[column], None);
            assert!(message.contains(expected), "{message}");
        }
        assert!(error(&bytes, &["y"], Some("list")).contains("holds no times"));
        assert!(error(&bytes, &["y", "y"], None).contains("selected twice"));
        assert!(error(&bytes, &["no"], None).contains("there is no column"));
        // What is beside them is read.
        assert_eq!(read(&bytes, &["y2"], Some("y"), &Options::default()).unwrap().columns, [[2.0]]);
    }
}

#[test]
fn options_of_texts_are_refused() {
    let table = batch(&[("t", numbers([0.0])), ("y", numbers([1.0]))]);
    let bytes = bytes("parquet", &[table]);
    for (options, option) in [
        (Options { delimiter: Some(b';'), ..Options::default() }, "`delimiter`"),
        (Options { decimal_comma: Some(true), ..Options::default() }, "`decimal-comma`"),
        (Options { header: Header::None, ..Options::default() }, "`no-header`"),
        (Options { skip_rows: 1, ..Options::default() }, "`skip-rows`"),
        (Options { comment: Some(b'#'), ..Options::default() }, "`comment`"),
        (Options { missing: vec!["-9".to_owned()], ..Options::default() }, "`missing`"),
        (Options { encoding: Some(encoding_rs::WINDOWS_1252), ..Options::default() }, "`encoding`"),
        (Options { time_format: Some("%Y".to_owned()), ..Options::default() }, "`time-format`"),
    ] {
        let message = read(&bytes, &["y"], Some("t"), &options).map(drop).unwrap_err().to_string();
        assert!(message.contains(option) && message.contains("leave it out"), "{message}");
    }
}

#[test]
fn nothing_to_read() {
    for format in FORMATS {
        let empty = batch(&[("y", numbers([]))]);
        assert_eq!(error(&bytes(format, &[empty]), &["y"], None), "there are no rows; record at least one");
        let bare = batch(&[]);
        assert_eq!(error(&bytes(format, &[bare]), &[], None), "there are no columns; write at least one");
    }
    // No column at all is a way to count rows.
    let rows = |format| {
        let table = batch(&[("y", numbers([1.0, 2.0]))]);
        read(&bytes(format, &[table]), &[], None, &Options::default()).unwrap().rows
    };
    assert_eq!(FORMATS.map(rows), [2, 2, 2]);
}

#[test]
fn what_cannot_be_read_is_said() {
    assert_eq!(
        error(b"PARE, and more", &[], None),
        "this Parquet file is encrypted; write it without encryption"
    );
    assert!(error(b"FEA1, and more", &[], None).contains("version 1"));
    assert!(error(b"PAR1, and no more", &[], None).starts_with("this is no whole Parquet file ("));
    assert!(error(b"ARROW1, and no more", &[], None).starts_with("this is no whole Arrow file ("));
    assert!(error(&[0xff; 99], &[], None).starts_with("it is damaged after 0 rows ("));
    // Not even the beginning of a mark is lost to a text.
    let text = read(b"PAR,y\n1,2\n", &["PAR"], None, &Options::default()).unwrap();
    assert_eq!(text.columns, [[1.0]]);
}

#[test]
fn a_file_that_is_cut_off_or_damaged_is_refused_everywhere() {
    let part = |rows: std::ops::Range<i32>| {
        let texts =
            array(StringArray::from_iter_values(rows.clone().map(|row| format!("2024-03-{:02}", row + 1))));
        batch(&[("y", numbers(rows.map(f64::from))), ("when", texts)])
    };
    for format in FORMATS {
        let whole = bytes(format, &[part(0..3), part(3..5)]);
        for length in (8..whole.len()).step_by(3) {
            let found = read(&whole[..length], &["y"], Some("when"), &Options::default());
            // A stream may end between two batches, and its end needs no mark.
            let between = format == "arrows" && found.as_ref().is_ok_and(|table| matches!(table.rows, 3 | 5));
            assert!(found.is_err() || between, "{format} {length}");
        }
        for place in 0..whole.len() {
            let mut damaged = whole.clone();
            damaged[place] ^= [0x01, 0x80, 0xff][place % 3];
            // Whatever it says, it says it.
            if let Err(error) = read(&damaged, &["y"], Some("when"), &Options::default()) {
                assert!(!error.to_string().contains('\n'), "{error}");
            }
        }
    }
}

#[test]
fn every_compression_is_unpacked() {
    let values: Vec<f64> = (0..5_000).map(|row| f64::from(row % 100)).collect();
    let table = batch(&[("y", numbers(values.clone()))]);
    let mut files = Vec::new();
    for compression in [
        Compression::SNAPPY,
        Compression::GZIP(GzipLevel::default()),
        Compression::BROTLI(BrotliLevel::default()),
        Compression::LZ4,
        Compression::LZ4_RAW,
        Compression::ZSTD(ZstdLevel::default()),
    ] {
        let mut bytes = Vec::new();
        let properties = WriterProperties::builder().set_compression(compression).build();
        let mut writer = ArrowWriter::try_new(&mut bytes, table.schema(), Some(properties)).unwrap();
        writer.write(&table).unwrap();
        writer.close().unwrap();
        files.push(bytes);
    }
    for compression in [CompressionType::LZ4_FRAME, CompressionType::ZSTD] {
        let mut bytes = Vec::new();
        let options = IpcWriteOptions::default().try_with_compression(Some(compression)).unwrap();
        let mut writer = FileWriter::try_new_with_options(&mut bytes, &table.schema(), options).unwrap();
        writer.write(&table).unwrap();
        writer.finish().unwrap();
        files.push(bytes);
    }
    for bytes in files {
        assert!(bytes.len() < 20_000);
        assert_eq!(
            read(&bytes, &["y"], None, &Options::default()).unwrap().columns,
            std::slice::from_ref(&values)
        );
    }
}

/// What begins a buffer says how long it will be: it is counted before memory is taken for as much.
#[test]
fn lengths_that_are_made_up_take_no_memory() {
    let rows = 10_000;
    let batch = batch(&[("y", numbers(vec![1.0; rows])), ("u", numbers((0..rows).map(|row| row as f64)))]);
    for codec in [CompressionType::LZ4_FRAME, CompressionType::ZSTD] {
        let options = IpcWriteOptions::default().try_with_compression(Some(codec)).unwrap();
        let (mut file, mut stream) = (Vec::new(), Vec::new());
        let mut writer =
            FileWriter::try_new_with_options(&mut file, &batch.schema(), options.clone()).unwrap();
        writer.write(&batch).unwrap();
        writer.finish().unwrap();
        let mut writer = StreamWriter::try_new_with_options(&mut stream, &batch.schema(), options).unwrap();
        writer.write(&batch).unwrap();
        writer.finish().unwrap();
        for whole in [file, stream] {
            let length = (8 * rows as i64).to_le_bytes();
            let place = whole.windows(8).position(|bytes| bytes == length).unwrap();
            for made_up in [1 << 60, 1 << 21, i64::MAX, 8 * rows as i64 + 8, -2] {
                let mut damaged = whole.clone();
                damaged[place..place + 8].copy_from_slice(&i64::to_le_bytes(made_up));
                let message = error(&damaged, &["y"], None);
                assert!(message.starts_with("it is damaged after 0 rows ("), "{made_up}: {message}");
            }
        }
    }
}

/// What is constant is packed into nearly nothing, and read all the same.
#[test]
fn a_long_constant_column_is_no_damage() {
    let rows = 1_000_000;
    let batch = batch(&[("y", numbers(vec![1.0; rows]))]);
    let options = IpcWriteOptions::default().try_with_compression(Some(CompressionType::ZSTD)).unwrap();
    let mut stream = Vec::new();
    let mut writer = StreamWriter::try_new_with_options(&mut stream, &batch.schema(), options).unwrap();
    writer.write(&batch).unwrap();
    writer.finish().unwrap();
    assert!(stream.len() < 10_000, "{}", stream.len());
    assert_eq!(read(&stream, &["y"], None, &Options::default()).unwrap().columns[0], vec![1.0; rows]);
}

/// An Arrow file and a stream of a batch, packed by zstd.
fn packed(batch: &RecordBatch) -> [Vec<u8>; 2] {
    let options = IpcWriteOptions::default().try_with_compression(Some(CompressionType::ZSTD)).unwrap();
    let (mut file, mut stream) = (Vec::new(), Vec::new());
    let mut writer = FileWriter::try_new_with_options(&mut file, &batch.schema(), options.clone()).unwrap();
    writer.write(batch).unwrap();
    writer.finish().unwrap();
    let mut writer = StreamWriter::try_new_with_options(&mut stream, &batch.schema(), options).unwrap();
    writer.write(batch).unwrap();
    writer.finish().unwrap();
    [file, stream]
}

/// A few kilobytes are gigabytes unpacked: they are held against the bound before that, and only what is read counts.
#[test]
fn a_batch_is_held_against_the_bound_before_it_is_unpacked() {
    let rows = 1_000;
    let long = "x".repeat(10_000);
    let table = batch(&[
        ("y", numbers(vec![1.0; rows])),
        ("note", array(StringArray::from_iter_values(std::iter::repeat_n(&long, rows)))),
        ("u", numbers(vec![2.0; rows])),
    ]);
    let kept = |per_value, free| Options { bound: Some(Bound::of(per_value, free)), ..Options::default() };
    let refused = |error: Error| {
        assert_eq!(error.kind(), ErrorKind::Memory);
        error.to_string().split_once("into memory: ").unwrap().1.to_owned()
    };
    for bytes in packed(&table) {
        assert!(bytes.len() < 20_000, "{}", bytes.len());
        let options = kept(64, 1_000_000);
        assert_eq!(read(&bytes, &["y", "u"], None, &options).unwrap().columns[1], vec![2.0; rows]);
        let words = refused(read(&bytes, &["y"], Some("note"), &options).unwrap_err());
        assert!(words.starts_with("one of its batches takes 10 MB unpacked, and 1 MB are free; "), "{words}");
        let words = refused(read(&bytes, &["y", "u"], None, &kept(64, 100_000)).unwrap_err());
        assert!(words.starts_with("2000 values take 0 MB at 64 bytes each, and 0 MB are free; "), "{words}");
    }
}

/// So are the pages of a Parquet file, which say how long they will be.
#[test]
fn the_pages_of_a_parquet_file_are_held_against_the_bound() {
    let rows = 200_000;
    let table = batch(&[("y", numbers(vec![1.0; rows])), ("u", numbers((0..rows).map(|row| row as f64)))]);
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_dictionary_enabled(false)
        .set_data_page_row_count_limit(rows)
        .build();
    let mut bytes = Vec::new();
    let mut writer = ArrowWriter::try_new(&mut bytes, table.schema(), Some(properties)).unwrap();
    writer.write(&table).unwrap();
    writer.close().unwrap();
    let with = |free| Options { bound: Some(Bound::of(1, free)), ..Options::default() };
    // A column has pages of a mebibyte: the first one and another are counted.
    assert_eq!(read(&bytes, &["y"], None, &with(3_000_000)).unwrap().rows, rows);
    for (columns, free) in [(&["y", "u"][..], 3_000_000), (&["y"], 1_000_000)] {
        let error = read(&bytes, columns, None, &with(free)).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::Memory);
        assert!(error.to_string().contains("one of its batches takes "), "{error}");
    }
    // Wherever the header of a page is cut, it is none.
    let header = &bytes[4..];
    let (length, unpacked, stored) = super::footer::page(header).unwrap();
    assert!(unpacked > 1_000_000 && stored < 10_000, "{unpacked} {stored}");
    assert!((0..length as usize).all(|end| super::footer::page(&header[..end]).is_none()));
}

/// Nulls take no bytes, so any number of rows may be said.
#[test]
fn rows_without_bytes_are_held_against_the_bound() {
    let rows = 1 << 46;
    let nulls = batch(&[("y", array(NullArray::new(rows)))]);
    let values: ArrayRef = array(NullArray::new(rows));
    let dictionary = array(DictionaryArray::<Int8Type>::new(Int8Array::from(vec![0, 1]), values));
    for table in [nulls, batch(&[("y", dictionary)])] {
        for format in ["arrow", "arrows"] {
            for bound in [None, Some(Bound::of(64, 1 << 30))] {
                let options = Options { bound, ..Options::default() };
                let bytes = bytes(format, std::slice::from_ref(&table));
                let error = read(&bytes, &["y"], None, &options).unwrap_err();
                assert_eq!(error.kind(), ErrorKind::Memory, "{error}");
            }
        }
    }
}

/// A clock without times is one error, not one for each row.
#[test]
fn the_first_fault_of_a_column_is_kept() {
    let none = array(NullArray::new(3));
    let table = batch(&[("t", none), ("y", numbers([1.0, f64::INFINITY, f64::INFINITY]))]);
    assert!(error(&bytes("arrow", &[table]), &["y"], Some("t")).starts_with("column 't', row 1: "));
}

/// A Parquet file of a schema: how many children each column has, the root first.
fn parquet_of(children: &[u32]) -> Vec<u8> {
    fn integer(mut value: u64, bytes: &mut Vec<u8>) {
        while value >= 0x80 {
            bytes.push(value as u8 | 0x80);
            value >>= 7;
        }
        bytes.push(value as u8);
    }
    // Version 2; a list of structs.
    let mut directory = vec![0x15, 4, 0x19, 0xfc];
    integer(children.len() as u64, &mut directory);
    for &children in children {
        // The name x in field 4; the number of children, with its sign in the last bit, in field 5.
        directory.extend([0x48, 1, b'x', 0x15]);
        integer(2 * u64::from(children), &mut directory);
        directory.push(0);
    }
    // No rows, no groups of rows.
    directory.extend([0x16, 0, 0x19, 0x0c, 0]);
    let length = u32::try_from(directory.len()).unwrap();
    [b"PAR1".as_slice(), &directory, &length.to_le_bytes(), b"PAR1"].concat()
}

#[test]
fn the_directory_of_a_parquet_file_is_bounded() {
    let deep: Vec<u32> = std::iter::repeat_n(1, 20_000).chain([0]).collect();
    for (children, why) in [
        (deep.as_slice(), "its columns are nested too deep"),
        (&[2_000_000_000], "a column has more children than there are columns"),
        (&[1, 3, 0], "a column has more children than there are columns"),
    ] {
        let message = error(&parquet_of(children), &[], None);
        assert!(message.contains(why), "{message}");
    }
    // A list of more elements than there are bytes, and structs in structs.
    let whole = parquet_of(&[1, 0]);
    let directory = &whole[4..whole.len() - 8];
    assert_eq!(super::footer::fault(directory), None);
    let mut long = directory.to_vec();
    long.splice(4..5, [0xff, 0xff, 0xff, 0xff, 0x0f]);
    let ends = Some("its directory ends before what it says that it holds");
    assert_eq!(super::footer::fault(&long), ends);
    assert_eq!(super::footer::fault(&[0x1c; 1_000_000]), ends);
    assert_eq!(super::footer::fault(&[0x19; 1_000_000]), ends);
    // Wherever it is cut.
    for end in 0..directory.len() {
        assert_eq!(super::footer::fault(&directory[..end]), ends, "{end}");
    }
}
