use std::io::Write as _;

use flate2::Compression;
use flate2::write::ZlibEncoder;

use super::super::{Reader, Selection, Table};
use super::*;
use crate::tests::dice::Dice;

/// An element, filled up to a multiple of eight bytes; short ones within their tag.
fn element(kind: u32, data: &[u8]) -> Vec<u8> {
    let size = data.len() as u32;
    let mut bytes = if (1..=4).contains(&size) {
        [(kind | size << 16).to_le_bytes().to_vec(), data.to_vec()].concat()
    } else {
        [kind.to_le_bytes().to_vec(), size.to_le_bytes().to_vec(), data.to_vec()].concat()
    };
    bytes.resize(bytes.len().next_multiple_of(8), 0);
    bytes
}

/// A matrix of a class, of numbers of a type.
fn matrix(class: u32, name: &str, rows: i32, columns: i32, kind: u32, values: &[u8]) -> Vec<u8> {
    let parts = [
        element(6, &[class.to_le_bytes(), [0; 4]].concat()),
        element(5, &[rows.to_le_bytes(), columns.to_le_bytes()].concat()),
        element(1, name.as_bytes()),
        element(kind, values),
    ];
    element(MATRIX, &parts.concat())
}

fn doubles(name: &str, rows: i32, columns: i32, values: &[f64]) -> Vec<u8> {
    let values: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    matrix(6, name, rows, columns, 9, &values)
}

fn packed(variable: &[u8]) -> Vec<u8> {
    let mut packer = ZlibEncoder::new(Vec::new(), Compression::fast());
    packer.write_all(variable).unwrap();
    let data = packer.finish().unwrap();
    [&COMPRESSED.to_le_bytes(), &(data.len() as u32).to_le_bytes()[..], &data].concat()
}

fn head() -> Vec<u8> {
    let mut head = b"MATLAB 5.0 MAT-file, Platform: here".to_vec();
    head.resize(124, b' ');
    [head, vec![0, 1], b"IM".to_vec()].concat()
}

/// Four rows of a clock, an input that is a row, a matrix, states and switches, and what is none of these.
fn recording() -> Vec<u8> {
    [
        head(),
        packed(&doubles("t", 4, 1, &[0.0, 0.1, 0.2, 0.3])),
        matrix(6, "u", 1, 4, 2, &[0, 1, 1, 0]),
        packed(&doubles("y", 4, 2, &[f64::NAN, 0.1, 1.0 / 3.0, -4.5e-17, 5.0, 6.0, 7.0, 8.0])),
        packed(&matrix(12, "state", 4, 1, 5, &[1_i32, -2, 3, 70_000].map(i32::to_le_bytes).concat())),
        packed(&matrix(7, "gain", 1, 1, 7, &2.5_f32.to_le_bytes())),
        matrix(4, "title", 1, 2, 4, &[104, 0, 105, 0]),
        doubles("long", 3, 1, &[1.0, 2.0, 3.0]),
        matrix(9 | 0x200, "is_on", 4, 1, 2, &[1, 1, 0, 0]),
    ]
    .concat()
}

fn opened(content: &[u8]) -> Result<Reader, Error> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.mat");
    std::fs::write(&path, content).unwrap();
    Reader::open(&path, &Options::default())
}

/// All columns, the clock as one of them.
fn whole(content: &[u8]) -> Result<(Vec<String>, Table), Error> {
    let reader = opened(content)?;
    let names = reader.names().to_vec();
    let selection = Selection { columns: (0..names.len()).collect(), ..Selection::default() };
    reader.read(&selection, &mut |_, _| {}).map(|table| (names, table))
}

fn error(content: &[u8]) -> String {
    opened(content).err().unwrap().to_string()
}

#[test]
fn variables_of_one_length_are_a_table() {
    let (names, table) = whole(&recording()).unwrap();
    assert_eq!(names, ["t", "u", "y_1", "y_2", "state", "is_on"]);
    assert_eq!(table.columns[0], [0.0, 0.1, 0.2, 0.3]);
    assert_eq!(table.columns[1], [0.0, 1.0, 1.0, 0.0]);
    assert!(table.columns[2][0].is_nan());
    assert_eq!(table.columns[2][1..], [0.1, 1.0 / 3.0, -4.5e-17]);
    assert_eq!(table.columns[3], [5.0, 6.0, 7.0, 8.0]);
    assert_eq!(table.columns[4], [1.0, -2.0, 3.0, 70_000.0]);
    assert_eq!(table.columns[5], [1.0, 1.0, 0.0, 0.0]);
    let words = table.words.join("\n");
    for said in [
        "no full real matrices of numbers are left out, such as texts, cells and structures (save their fields as variables): title",
        "the variables of 4 rows are read, and others left out: gain (1), long (3)",
    ] {
        assert!(words.contains(said), "{words}");
    }
    // The clock is one by its name.
    let clock = opened(&recording()).unwrap().times();
    assert_eq!((clock.len(), clock[0].time), (1, 0));
}

#[test]
fn what_is_another_file_says_so() {
    let mut other = head();
    other[7..10].copy_from_slice(b"7.3");
    assert!(
        error(&other).contains("a MATLAB file of version 7.3, which is another format; save it with -v7")
    );
    assert!(error(&head()[..100]).contains("ends in its head"));
    assert!(error(&head()).contains("vectors of numbers, one value for each sample, and there is none"));
    let text = [head(), matrix(4, "title", 1, 2, 4, &[104, 0, 105, 0])].concat();
    assert!(error(&text).contains("and there is none"));
    let options = Options { delimiter: Some(b';'), ..Options::default() };
    let bytes = Bytes::new("log.mat", std::io::Cursor::new(recording()), None).unwrap();
    assert!(
        read(bytes, &options).err().unwrap().to_string().contains("`delimiter` says how a text is written")
    );
}

#[test]
fn the_other_order_of_bytes_is_read() {
    let swapped = |words: &[u32]| words.iter().flat_map(|word| word.to_be_bytes()).collect::<Vec<u8>>();
    let parts = [
        swapped(&[6, 8, 6, 0]),
        swapped(&[5, 8, 2, 1]),
        [swapped(&[1 << 16 | 1]), b"y\0\0\0".to_vec()].concat(),
        [swapped(&[9, 16]), 0.5_f64.to_be_bytes().to_vec(), 2.0_f64.to_be_bytes().to_vec()].concat(),
    ]
    .concat();
    let mut content = head();
    content[124..].copy_from_slice(b"\x01\0MI");
    content.extend(swapped(&[MATRIX, parts.len() as u32]));
    content.extend(parts);
    let (names, table) = whole(&content).unwrap();
    assert_eq!((names, table.columns), (vec!["y".to_owned()], vec![vec![0.5, 2.0]]));
}

#[test]
fn damaged_files_do_no_harm() {
    let content = recording();
    for end in 0..content.len() {
        if let Ok((_, table)) = whole(&content[..end]) {
            assert!(table.rows >= 3, "{end}");
        }
    }
    let mut dice = Dice(2_463_534_242);
    let mut read = 0;
    for _ in 0..1000 {
        let mut content = content.clone();
        for _ in 0..1 + dice.below(3) {
            let at = HEAD + dice.below(content.len() - HEAD);
            content[at] = [dice.below(256) as u8, 0, 0xff][dice.below(3)];
        }
        match whole(&content) {
            Ok(_) => read += 1,
            Err(error) => assert!(!error.to_string().contains('\n'), "{error}"),
        }
    }
    assert!(read > 100, "{read}");
}
