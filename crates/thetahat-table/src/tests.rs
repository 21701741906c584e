//! Whole logs, read from memory.

use std::io::{self, Cursor, Read, Write};
use std::path::PathBuf;

use encoding_rs::{Encoding, UTF_16LE, WINDOWS_1252};
use flate2::Compression;
use flate2::write::GzEncoder;

use super::reader::{SIZES, Sizes, TextReader};
use super::source::{Bytes, Source};
use super::*;

mod cut;
pub(crate) mod dice;
mod random;
mod shapes;
mod stream;

/// Blocks and pieces so small that rows, fields and numbers are cut everywhere.
const TINY: [(usize, usize); 6] = [(1, 1), (2, 1), (7, 3), (16, 5), (64, 16), (1000, 40)];

impl TextReader {
    /// Behind the front of all formats.
    fn read(self, selection: &Selection, progress: &mut dyn FnMut(u64, Option<u64>)) -> Result<Table, Error> {
        Reader::of_text(self).read(selection, progress)
    }
}

fn sizes(block: usize, piece: usize) -> Sizes {
    Sizes { block, piece, ..SIZES }
}

fn start(bytes: &[u8], options: &Options, sizes: Sizes) -> Result<TextReader, Error> {
    let bytes = Bytes::new("log.csv", Cursor::new(bytes.to_vec()), Some(bytes.len() as u64))?;
    TextReader::start(Source::new(bytes, options.encoding), options, sizes)
}

/// Reads all columns, the first as time if so said.
fn read_all(bytes: &[u8], options: &Options, time: bool, sizes: Sizes) -> Result<Table, Error> {
    let reader = start(bytes, options, sizes)?;
    let columns = (usize::from(time)..reader.names().len()).collect();
    reader.read(&Selection { columns, time: time.then_some(0), date: None }, &mut |_, _| {})
}

fn table(text: &str, options: &Options) -> Table {
    read_all(text.as_bytes(), options, false, SIZES).unwrap()
}

fn columns(text: &str, options: &Options) -> Vec<Vec<f64>> {
    table(text, options).columns
}

fn error(bytes: impl AsRef<[u8]>, options: &Options) -> String {
    read_all(bytes.as_ref(), options, false, SIZES).unwrap_err().to_string()
}

fn plain() -> Options {
    Options::default()
}

/// With tiny blocks the delimiter cannot be recognised.
fn comma() -> Options {
    Options { delimiter: Some(b','), comment: Some(b'#'), missing: vec!["-9".to_owned()], ..plain() }
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).unwrap();
    encoder.finish().unwrap()
}

#[test]
fn a_plain_log() {
    let table = table("u,y\n1,2\n3,4.5\n", &plain());
    assert_eq!(table.columns, [[1.0, 3.0], [2.0, 4.5]]);
    assert_eq!(table.rows, 2);
    assert_eq!((table.time, table.start), (None, None));
    assert_eq!((table.lines.of(0), table.lines.of(1)), (2, 3));
}

#[test]
fn names_are_given_as_they_are() {
    let names =
        |text: &str, options: &Options| start(text.as_bytes(), options, SIZES).unwrap().names().to_vec();
    assert_eq!(names("u, y ,,u\n1,2,3,4\n", &plain()), ["u", "y", "", "u"]);
    assert_eq!(names("\"a,\nb\";\"say \"\"µ\"\"\"\n1;2\n", &plain()), ["a,\nb", "say \"µ\""]);
    assert_eq!(names("5,6,7\n", &Options { header: Header::None, ..plain() }), ["1", "2", "3"]);
}

#[test]
fn columns_come_in_the_order_of_the_selection() {
    let reader = start(b"a,b,c,d\nx,1,2,3\ny,4,5,6\n", &plain(), SIZES).unwrap();
    let selection = Selection { columns: vec![3, 1], time: Some(2), date: None };
    let table = reader.read(&selection, &mut |_, _| {}).unwrap();
    assert_eq!(table.columns, [[3.0, 6.0], [1.0, 4.0]]);
    assert_eq!(table.time, Some(vec![2.0, 5.0]));
    // No column at all is a way to count rows.
    let reader = start(b"a,b\nx,1\ny,4\n", &plain(), SIZES).unwrap();
    assert_eq!(reader.read(&Selection::default(), &mut |_, _| {}).unwrap().rows, 2);
}

#[test]
fn a_selection_must_make_sense() {
    let select = |columns: Vec<usize>, time| {
        let reader = start(b"u,y\n1,2\n", &plain(), SIZES).unwrap();
        reader.read(&Selection { columns, time, date: None }, &mut |_, _| {}).unwrap_err().to_string()
    };
    assert_eq!(select(vec![0, 2], None), "log.csv: there is no column 3; select from the first 2");
    assert_eq!(select(vec![1, 0, 1], None), "log.csv: column 'y' is selected twice; select it once");
    assert_eq!(select(vec![1, 0], Some(0)), "log.csv: column 'u' is selected twice; select it once");
}

#[test]
fn line_ends_blanks_and_blank_lines_do_not_matter() {
    let expected = [[1.0, 3.0], [2.0, 4.0]];
    for text in [
        "u,y\n1,2\n3,4\n",
        "u,y\n1,2\n3,4",
        "u,y\r\n1,2\r\n3,4\r\n",
        "u,y\r1,2\r3,4\r",
        "u,y\r1,2\r3,4",
        "\ru,y\r\r1,2\r\r\n3,4\n",
        "u,y\r\n1,2\r3,4\n",
        "u,y\n1,2\r3,4\r\n",
        "u,y\r\n1,2\r\n3,4",
        "\n\r\n  \nu,y\n\n1,2\n \t\n3,4\n\n\n",
        " u , y \n 1 ,\t2\n3,  4  \n",
        "u\ty\n1\t2\n 3 \t 4 \n",
        "u;y\n1;2\n3;4\n",
        "\"u\",\"y\"\n\"1\",\"2\"\n\" 3 \",4\n",
        "u,y\n+1,2.\n3e0,.4E+1\n",
    ] {
        assert_eq!(columns(text, &plain()), expected, "{text:?}");
    }
}

/// They are counted as an editor does, whatever the cuts; in a quoted name they are one newline.
#[test]
fn carriage_returns_end_lines() {
    for text in ["\"u\r\nV\",y\r\n1,2\r3,x\r\n5,6\r", "\"u\rV\",y\r1,2\r3,x\r5,6\r"] {
        for (block, piece) in TINY {
            let reader = start(text.as_bytes(), &comma(), sizes(block, piece)).unwrap();
            assert_eq!(reader.names(), ["u\nV", "y"]);
            let error = read_all(text.as_bytes(), &comma(), false, sizes(block, piece)).unwrap_err();
            assert!(error.to_string().starts_with("log.csv:4:3: column 'y': "), "{error}");
        }
    }
}

#[test]
fn one_column_needs_no_delimiter() {
    assert_eq!(columns("y\n1\n2\n", &plain()), [[1.0, 2.0]]);
    assert_eq!(columns("y\n1\n\n2", &plain()), [[1.0, 2.0]]);
    let table = table("y\n1\n\"\"\n2\n", &plain());
    assert_eq!(table.rows, 3);
    assert!(table.columns[0][1].is_nan());
    assert_eq!(columns("7\n", &Options { header: Header::None, ..plain() }), [[7.0]]);
}

#[test]
fn a_given_delimiter_is_used() {
    for delimiter in *b",;\t| :" {
        let options = Options { delimiter: Some(delimiter), ..plain() };
        let text = "u,y\n1,2\n3,4\n".replace(',', &char::from(delimiter).to_string());
        assert_eq!(columns(&text, &options), [[1.0, 3.0], [2.0, 4.0]], "{text:?}");
    }
}

#[test]
fn comments_and_units_are_left_out() {
    let options = Options { comment: Some(b'#'), skip_rows: 1, ..plain() };
    let table = table("# it's a \"log\nu,y\n# units\nV,°C\n1,2\n # a,b,c\n\n3,4\n", &options);
    assert_eq!(table.columns, [[1.0, 3.0], [2.0, 4.0]]);
    assert_eq!((table.lines.of(0), table.lines.of(1)), (5, 8));
    let options = Options { header: Header::None, skip_rows: 2, ..plain() };
    assert_eq!(columns("made by,x\n\nV,°C\n1,2\n3,4\n", &options), [[1.0, 3.0], [2.0, 4.0]]);
}

#[test]
fn quotes_protect_delimiters_and_line_breaks() {
    let text = "t,note,y\n1,plain,2\n3,\"a,\nb \"\"c\"\"\n\",4\n5,\"\",\"6\"\n7,\"\n\",8";
    let reader = start(text.as_bytes(), &plain(), SIZES).unwrap();
    let table =
        reader.read(&Selection { columns: vec![0, 2], time: None, date: None }, &mut |_, _| {}).unwrap();
    assert_eq!(table.columns, [[1.0, 3.0, 5.0, 7.0], [2.0, 4.0, 6.0, 8.0]]);
    let lines: Vec<_> = (0..4).map(|row| table.lines.of(row)).collect();
    assert_eq!(lines, [2, 3, 6, 7]);
    // A quote inside a field is nothing special.
    assert_eq!(columns("u,5\" pipe\n1,2\n", &plain()), [[1.0], [2.0]]);
}

#[test]
fn quoted_line_breaks_in_the_header_count() {
    let table = table("\"a\n\nb\",c\n1,2\n", &plain());
    assert_eq!(table.lines.of(0), 4);
}

#[test]
fn decimal_commas() {
    let options = Options { decimal_comma: Some(true), ..plain() };
    assert_eq!(columns("u;y\n1,5;-2\n,5;1,e2\n", &options), [[1.5, 0.5], [-2.0, 100.0]]);
    assert_eq!(columns("y\n1,5\n2,5\n", &options), [[1.5, 2.5]]);
    assert_eq!(columns("u\ty\n1,5\t\"2,5\"\n", &options), [[1.5], [2.5]]);
    assert_eq!(
        error("u;y\n1.5;2\n", &options),
        "log.csv:2:1: column 'u': \"1.5\" has a decimal point where others have a comma; correct it, or say \
         `decimal-comma`=no"
    );
    // They are recognised.
    assert_eq!(columns("u;y\n1;2,5\n", &plain()), [[1.0], [2.5]]);
    assert_eq!(columns("y\n1,5\n2,5\n", &plain()), [[1.5, 2.5]]);
    assert_eq!(
        error("u;y\n1;2,5\n", &Options { decimal_comma: Some(false), ..plain() }),
        "log.csv:2:3: column 'y': \"2,5\" is not a number; if it has a decimal comma, say `decimal-comma`"
    );
    assert_eq!(
        error("u;y\n1,5;2,5\n1;1.55\n", &plain()),
        "log.csv:2:1: column 'u': \"1,5\" is not a number; if it has a decimal comma, say `decimal-comma`"
    );
    assert_eq!(
        error("u,y\n1,5,2,5\n1,5,2,5\n", &plain()),
        "log.csv:2:5: this row has 4 fields, but there are 2 columns (\",\" separates them); if it has decimal \
         commas, separate its fields by semicolons and say `decimal-comma`"
    );
}

#[test]
fn missing_values_are_nan() {
    let options = Options { missing: vec!["-999".to_owned(), "bad".to_owned()], ..plain() };
    let table = table("a,b,c\n1,,NaN\nna,N/A,null\n-999.0,BAD,\n 5 ,\"NA\", 6\n", &options);
    let missing = |column: &Vec<f64>| column.iter().filter(|value| value.is_nan()).count();
    assert_eq!(table.columns.iter().map(missing).collect::<Vec<_>>(), [2, 4, 3]);
    assert_eq!(table.columns[0][3], 5.0);
    assert_eq!(table.columns[2][3], 6.0);
}

#[test]
fn values_that_are_no_numbers() {
    for (text, message) in [
        (
            "u,y\n1,2\n3,abc\n",
            "log.csv:3:3: column 'y': \"abc\" is not a number; correct it, or name it with `missing` abc if it stands \
             for a missing value",
        ),
        (
            "u,y\nV,5\n1,2\n",
            "log.csv:2:1: column 'u': \"V\" is not a number; correct it, or name it with `missing` V if it stands for \
             a missing value; if this row holds units, leave it out with `skip-rows`",
        ),
        (
            "µ,y\n1,2\n\"é\né\", inf\n",
            "log.csv:3:1: column 'µ': \"é\\né\" is not a number; correct it, or declare it with `missing` if it stands \
             for a missing value",
        ),
        (
            "u,\n1,2\n\"3\",  -1e400\n",
            "log.csv:3:7: column 2: \"-1e400\" is infinite; correct it, or name it with `missing`='-1e400' if it \
             stands for a missing value",
        ),
        (
            "u,y\n1 2,3\n",
            "log.csv:2:1: column 'u': \"1 2\" is not one number; say `delimiter` ' ' if blanks separate fields",
        ),
    ] {
        assert_eq!(error(text, &plain()), message, "{text:?}");
    }
    assert!(error(b"y\n\xb0C\n", &plain()).contains("`encoding` windows-1252"));
    assert!(error(format!("y\n1\n{}\n", "x".repeat(1000)), &plain()).len() < 200);
}

#[test]
fn only_selected_columns_are_parsed() {
    let reader = start(b"t,note,y\n1,abc,2\n3,\xff,4\n5,,6\n", &plain(), SIZES).unwrap();
    let table =
        reader.read(&Selection { columns: vec![2], time: Some(0), date: None }, &mut |_, _| {}).unwrap();
    assert_eq!(table.columns, [[2.0, 4.0, 6.0]]);
}

#[test]
fn ragged_rows() {
    for (text, message) in [
        (
            "a,b,c\n1,2,3\n1,2\n",
            "log.csv:3:4: this row has 2 fields, but there are 3 columns (\",\" separates them); add what is missing, \
             if only the delimiters",
        ),
        (
            "a;b\r\n1;2\r\n1;2;3\r\n",
            "log.csv:3:5: this row has 3 fields, but there are 2 columns (\";\" separates them); take a field away, \
             or quote the one that holds a delimiter",
        ),
        (
            "a\tb\n1\t2\t\n3\t4\t5\n",
            "log.csv:2:5: this row has 3 fields, but there are 2 columns (\"\\t\" separates them); take the delimiter \
             at its end away, or name one column more",
        ),
        // The wrong number of fields explains the wrong content of one.
        (
            "a,b\n1,2\nx\n",
            "log.csv:3:2: this row has 1 field, but there are 2 columns (\",\" separates them); add what is missing, \
             if only the delimiters",
        ),
        (
            "a,b,c\n1,2,3\n# paused\n4,5,6\n",
            "log.csv:3:9: this row has 1 field, but there are 3 columns (\",\" separates them); if this line is a \
             comment, say `comment` and its first character",
        ),
    ] {
        assert_eq!(error(text, &plain()), message, "{text:?}");
    }
    // Without a header the first row counts.
    assert!(
        error("1,2\n1,2,3\n", &Options { header: Header::None, ..plain() })
            .starts_with("log.csv:2:5: this row has 3")
    );
}

#[test]
fn nothing_to_read() {
    let empty = "log.csv: the file is empty; record at least one row";
    let no_rows = "there are no data rows below the header; record at least one";
    assert_eq!(error("", &plain()), empty);
    assert_eq!(error("\u{feff}", &plain()), empty);
    assert_eq!(error(gzip(b""), &plain()), empty);
    assert_eq!(error("u,y\n", &plain()), format!("log.csv:2:1: {no_rows}"));
    assert_eq!(error("u,y", &plain()), format!("log.csv:2:1: {no_rows}"));
    assert_eq!(error("u,y\nV,V\n", &Options { skip_rows: 1, ..plain() }), format!("log.csv:3:1: {no_rows}"));
    let options = Options { comment: Some(b'#'), ..plain() };
    assert_eq!(
        error("\n# x\n\n", &options),
        "log.csv:4:1: there is no row, only blank lines and comments; record at least one row"
    );
    assert_eq!(table("u,y\n1,2", &plain()).rows, 1);
}

#[test]
fn what_is_no_text_table() {
    assert_eq!(
        error(b"\x7fELF\n\x00\x01", &plain()),
        "log.csv:2:1: a NUL byte: this is no text table; name a text file, or say `encoding` utf-16le if it is UTF-16"
    );
    assert!(error(b"u\x00,\x00y\x00\n\x00", &plain()).contains("utf-16le"));
    // A NUL byte that turns up after the first block.
    let text = format!("y\n{}1\0\n", "1\n".repeat(100));
    let error = read_all(text.as_bytes(), &plain(), false, sizes(10, 5)).unwrap_err().to_string();
    assert!(error.starts_with("log.csv:102:2: a NUL byte: this is no text table"), "{error}");
    let text = format!("y\n{}1\0\n", "1\n".repeat(200_000));
    let error = read_all(text.as_bytes(), &plain(), false, SIZES).unwrap_err().to_string();
    assert!(
        error.starts_with("log.csv:200002:1: column 'y': \"1\\0\" is not a number; there is a NUL byte"),
        "{error}"
    );
    // No newline for too long, in the header and later.
    for text in [vec![b'x'; 100], [&b"y\n1\n"[..], &[b'1'; 100]].concat()] {
        let sizes = Sizes { block: 8, piece: 4, row: 20 };
        let error = read_all(&text, &plain(), false, sizes).unwrap_err().to_string();
        assert!(error.contains("this row is longer than 20 bytes"), "{error}");
    }
}

#[test]
fn quotes_that_are_not_closed() {
    assert_eq!(
        error("u,y\n1,2\n3, \"4\n5,\"6\n7,8\n", &plain()),
        "log.csv:3:4: column 'y': \"\\\"4\" is not a number; take away the blanks in front of the quote, or the quote"
    );
    for text in ["u,y\n1,2\n5,\"6\n7,8\n", "u,y\n1,2\n5,\"6"] {
        let message =
            "log.csv:3:3: this quote is not closed before the end of the file; close it, or take it away";
        assert_eq!(error(text, &plain()), message);
        for (block, piece) in TINY {
            let error = read_all(text.as_bytes(), &comma(), false, sizes(block, piece)).unwrap_err();
            assert_eq!(error.to_string(), message);
        }
    }
    assert!(error("\"u,y\n1,2\n", &plain()).starts_with("log.csv:1:1: this quote is not closed"));
    let sizes = Sizes { block: 8, piece: 4, row: 30 };
    let text = format!("u,y\n1,2\n3,\"{}", "4,5\n".repeat(20));
    let error = read_all(text.as_bytes(), &comma(), false, sizes).unwrap_err().to_string();
    assert!(error.starts_with("log.csv:3:1: this row is longer than 30 bytes"), "{error}");
}

#[test]
fn gzip_is_unpacked() {
    let text = b"u,y\n1,2\n3,4\n";
    let packed = gzip(text);
    let expected = [[1.0, 3.0], [2.0, 4.0]];
    assert_eq!(read_all(&packed, &plain(), false, SIZES).unwrap().columns, expected);
    // Members one after the other.
    let members = [gzip(b"u,y\n1,"), gzip(b"2\n3,4\n")].concat();
    assert_eq!(read_all(&members, &plain(), false, SIZES).unwrap().columns, expected);
    // UTF-16 inside.
    let wide: Vec<u8> = "\u{feff}u,y\n1,2\n3,4\n".encode_utf16().flat_map(u16::to_be_bytes).collect();
    assert_eq!(read_all(&gzip(&wide), &plain(), false, SIZES).unwrap().columns, expected);

    let truncated =
        "log.csv: the gzip stream ends too early: the file is truncated; copy or compress it again";
    for length in [2, 9, 15, packed.len() - 9, packed.len() - 1] {
        let error = read_all(&packed[..length], &plain(), false, SIZES).unwrap_err();
        assert_eq!(error.to_string(), truncated, "{length}");
        assert_eq!(error.kind(), ErrorKind::Io);
    }
    let mut damaged = packed.clone();
    damaged[packed.len() - 6] ^= 1; // the checksum
    let error = error(&damaged, &plain());
    assert!(error.starts_with("log.csv: the gzip stream is damaged ("), "{error}");
}

#[test]
fn encodings() {
    let text = "t;T °C\n1;2\n";
    let wide =
        |marked: &str, bytes: fn(u16) -> [u8; 2]| marked.encode_utf16().flat_map(bytes).collect::<Vec<u8>>();
    let marked = format!("\u{feff}{text}");
    let with = |encoding: &'static Encoding| Options { encoding: Some(encoding), ..plain() };
    for (bytes, options) in [
        (text.as_bytes().to_vec(), plain()),
        (marked.as_bytes().to_vec(), plain()),
        (marked.as_bytes().to_vec(), with(WINDOWS_1252)), // the mark knows better
        (wide(&marked, u16::to_le_bytes), plain()),
        (wide(&marked, u16::to_be_bytes), plain()),
        (wide(text, u16::to_le_bytes), with(UTF_16LE)),
        (b"t;T \xb0C\n1;2\n".to_vec(), with(WINDOWS_1252)),
    ] {
        for block in [1, 3, 4, 1000] {
            let options = Options { delimiter: Some(b';'), ..options.clone() };
            let reader = start(&bytes, &options, sizes(block, 8)).unwrap();
            assert_eq!(reader.names(), ["t", "T °C"]);
            let table = reader
                .read(&Selection { columns: vec![0, 1], time: None, date: None }, &mut |_, _| {})
                .unwrap();
            assert_eq!(table.columns, [[1.0], [2.0]]);
        }
    }
}

#[test]
fn a_name_that_is_not_utf8_matters_if_its_column_is_used() {
    let open = || start(b"t;T \xb0C\n1;2\n", &plain(), SIZES).unwrap();
    let select = |column| Selection { columns: vec![column], time: None, ..Selection::default() };
    assert_eq!(open().read(&select(0), &mut |_, _| {}).unwrap().rows, 1);
    assert_eq!(
        open().read(&select(1), &mut |_, _| {}).unwrap_err().to_string(),
        "log.csv:1:3: column 2: its name \"T \\xb0C\" is not UTF-8; name the file's encoding, as in `encoding` \
         windows-1252"
    );
}

#[test]
fn times() {
    let time = |text: &str, options: &Options| read_all(text.as_bytes(), options, true, SIZES);
    let table = time("t,y\n0.5,1\n1e0,2\n", &plain()).unwrap();
    assert_eq!((table.time, table.start), (Some(vec![0.5, 1.0]), None));

    let text = "t,y\n2024-03-01T12:00:00.250Z,1\n2024-03-01 12:00:00.350,2\n2024-03-01T13:00:00.45+01:00,3\n";
    let table = time(text, &plain()).unwrap();
    assert_eq!(table.time, Some(vec![0.0, 0.1, 0.2]));
    assert_eq!(table.start.as_deref(), Some("2024-03-01T12:00:00.250Z"));

    let options = Options { time_format: Some("%d.%m.%Y %H:%M".to_owned()), ..plain() };
    let table = time("t;y\n29.02.2024 23:59;1\n01.03.2024 00:00;2\n", &options).unwrap();
    assert_eq!(table.time, Some(vec![0.0, 60.0]));

    // The order is not checked here.
    assert_eq!(time("t,y\n2,1\n1,2\n1,3\n", &plain()).unwrap().time, Some(vec![2.0, 1.0, 1.0]));

    let error = |text: &str| time(text, &plain()).unwrap_err().to_string();
    assert_eq!(
        error("t,y\n1,1\n,2\n"),
        "log.csv:3:1: column 't': the time is missing; fill it in, or take the row out"
    );
    assert_eq!(
        error("t,y\n2024-03-01,1\nNaN,2\n"),
        "log.csv:3:1: column 't': the time is missing; fill it in, or take the row out"
    );
    assert_eq!(
        error("t,y\n1,1\n2024-03-01,2\n"),
        "log.csv:3:1: column 't': \"2024-03-01\" is a date, but the first time is a number; write all times alike"
    );
    assert!(error("t,y\n2024-03-01,1\n5,2\n").starts_with("log.csv:3:1: column 't': \"5\" is not a date"));
    assert!(error("t,y\nx,5\n1,2\n").ends_with("if this row holds units, leave it out with `skip-rows`"));
    assert!(error("t,y\n12:00h,1\n").contains("`time-format`"));
    assert!(error("t,y\n,1\n").contains("the time is missing"));
    // A ragged first row is that in the first place.
    assert!(error("t,y\nx\n1,2\n").starts_with("log.csv:2:2: this row has 1 field"));
}

#[test]
fn options_are_checked() {
    let error = |options: Options| options.check().unwrap_err();
    assert!(error(Options { delimiter: Some(b'5'), ..plain() }).contains("\"5\" cannot be the delimiter"));
    assert!(error(Options { delimiter: Some(b'"'), ..plain() }).contains("cannot be the delimiter"));
    assert!(
        error(Options { delimiter: Some(0xb0), ..plain() }).contains("\"\\xb0\" cannot be the delimiter")
    );
    assert!(error(Options { comment: Some(b'-'), ..plain() }).contains("cannot start a comment"));
    assert!(error(Options { comment: Some(b' '), ..plain() }).contains("cannot start a comment"));
    assert!(error(Options { comment: Some(b';'), delimiter: Some(b';'), ..plain() }).contains("both"));
    assert!(
        error(Options { delimiter: Some(b','), decimal_comma: Some(true), ..plain() })
            .contains("decimal comma")
    );
    assert_eq!(plain().check(), Ok(()));
    let options = Options { delimiter: Some(b'.'), ..plain() };
    let error = Reader::open("log.csv".as_ref(), &options).map(drop).unwrap_err();
    assert_eq!(
        error.to_string(),
        "log.csv: \".\" cannot be the delimiter; use a comma, a semicolon, a tab or a space"
    );
}

#[test]
fn files_that_cannot_be_read() {
    let error = Reader::open("no/such.csv".as_ref(), &plain()).map(drop).unwrap_err();
    assert!(error.to_string().starts_with("no/such.csv: cannot be opened: "), "{error}");
    assert_eq!(error.kind(), ErrorKind::Io);
    let error = Reader::open(&std::env::temp_dir(), &plain()).map(drop).unwrap_err();
    assert!(error.to_string().ends_with(": is a directory; name a file in it"), "{error}");
}

#[test]
fn a_file_on_disk() {
    let path: PathBuf = std::env::temp_dir().join(format!("thetahat-table-{}.csv", std::process::id()));
    std::fs::write(&path, "u,y\n1,2\n3,4\n").unwrap();
    let mut calls = Vec::new();
    let selection = Selection { columns: vec![0, 1], time: None, ..Selection::default() };
    let read = Reader::open(&path, &plain())
        .and_then(|reader| reader.read(&selection, &mut |bytes, total| calls.push((bytes, total))));
    std::fs::remove_file(&path).unwrap();
    assert_eq!(read.unwrap().columns, [[1.0, 3.0], [2.0, 4.0]]);
    assert_eq!(calls, [(12, Some(12))]);
}

/// A stream that breaks off with an error after its bytes, which come one at a time and with interruptions.
struct Breaking {
    bytes: Cursor<Vec<u8>>,
    interrupt: bool,
}

impl Read for Breaking {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.interrupt = !self.interrupt;
        if self.interrupt {
            return Err(io::ErrorKind::Interrupted.into());
        }
        match self.bytes.read(&mut buffer[..1])? {
            0 => Err(io::Error::other("cable pulled")),
            count => Ok(count),
        }
    }
}

#[test]
fn a_stream_that_breaks_off() {
    let read = |text: &str| {
        let stream = Breaking { bytes: Cursor::new(text.as_bytes().to_vec()), interrupt: false };
        let source = Source::new(Bytes::new("stream", stream, None)?, None);
        let reader = TextReader::start(source, &comma(), sizes(16, 8))?;
        reader.read(&Selection { columns: vec![0, 1], time: None, date: None }, &mut |_, _| {})
    };
    let text = "u,y\n1,2\n3,4\n5,6\n7,8\n9,10\n".to_owned();
    assert_eq!(read(&text).unwrap_err().to_string(), "stream: cannot be read: cable pulled");
    assert_eq!(read("u").unwrap_err().to_string(), "stream: cannot be read: cable pulled");
    // A mistake in front of the break is told first.
    assert!(read(&text.replace('4', "x")).unwrap_err().to_string().starts_with("stream:3:3: "));
}

#[test]
fn progress_counts_stored_bytes() {
    let text = format!("y\n{}", "1.25\n".repeat(1000));
    let packed = gzip(text.as_bytes());
    for bytes in [text.as_bytes(), &packed] {
        let mut calls = Vec::new();
        let reader = start(bytes, &plain(), sizes(500, 100)).unwrap();
        let table = reader
            .read(&Selection { columns: vec![0], time: None, date: None }, &mut |read, total| {
                calls.push((read, total))
            })
            .unwrap();
        assert_eq!(table.rows, 1000);
        assert!(calls.len() > 5);
        assert!(calls.is_sorted());
        assert_eq!(calls.last(), Some(&(bytes.len() as u64, Some(bytes.len() as u64))));
    }
}

#[test]
fn memory_is_estimated_not_doubled() {
    let text = format!("y\n{}", "1.25\n".repeat(100_000));
    let table = read_all(text.as_bytes(), &plain(), false, sizes(1 << 12, 1 << 10)).unwrap();
    assert_eq!(table.rows, 100_000);
    assert!(table.columns[0].capacity() < 103_000, "{}", table.columns[0].capacity());
}
