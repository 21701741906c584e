//! Files that other programs wrote: tests/data/spreadsheets/make.py.

use std::path::PathBuf;

use crate::tests::dice::Dice;
use crate::{Error, Options, Reader, Selection, Table};

fn data(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../tests/data/spreadsheets").join(name)
}

fn read(name: &str, options: &Options) -> Result<(Vec<String>, Table), Error> {
    let reader = Reader::open(&data(name), options)?;
    let names = reader.names().to_vec();
    let clock = reader.times().first().copied();
    let time = clock.map(|clock| clock.time);
    let columns = (0..names.len()).filter(|column| Some(*column) != time).collect();
    Ok((names, reader.read(&Selection { columns, time, date: None }, &mut |_, _| {})?))
}

#[test]
fn the_sheet_with_numbers_is_read() {
    let (names, table) = read("log.xlsx", &Options::default()).unwrap();
    assert_eq!(names, ["Date", "u", "y"]);
    assert_eq!((table.rows, table.columns[1][0]), (120, 20.0));
    assert_eq!(table.start.as_deref(), Some("2024-01-10 23:50:00"));
    let time = table.time.unwrap();
    assert!(time.iter().zip(0..).all(|(time, row)| (time - 10.0 * f64::from(row)).abs() < 2e-3), "{time:?}");
    assert_eq!(table.lines.of(0), 5);
    let told = table.words.join("\n");
    assert!(told.contains("sheet 'Data' is read; `sheet` names another one: Other"), "{told}");
    assert!(told.contains("the names are on line 3") && told.contains("line 4 is read as units"), "{told}");
    let other = Options { sheet: Some("Other".to_owned()), ..Options::default() };
    let (names, table) = read("log.xlsx", &other).unwrap();
    assert_eq!((names, table.columns), (vec!["a".into(), "b".into()], vec![vec![1.0, 3.0], vec![2.0, 4.0]]));
}

#[test]
fn what_cannot_be_read_is_said() {
    let refused = |name: &str, options: Options| read(name, &options).unwrap_err().to_string();
    let error = refused("log.xlsx", Options { sheet: Some("None".to_owned()), ..Options::default() });
    assert!(error.contains("there is no sheet 'None'; there are: Notes, Data, Other"), "{error}");
    let error = refused("log.xlsx", Options { delimiter: Some(b';'), ..Options::default() });
    assert!(error.contains("`delimiter` says how a text is written"), "{error}");
    let error = refused("make.py", Options { sheet: Some("Data".to_owned()), ..Options::default() });
    assert!(error.contains("`sheet` is for spreadsheets"), "{error}");
    let error = refused("log.xlsx", Options { sheet: Some("Notes".to_owned()), ..Options::default() });
    assert!(error.contains("no data rows"), "{error}");
}

#[test]
fn damaged_files_are_refused_and_nothing_panics() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("damaged");
    for name in ["log.xls", "log.ods"] {
        let error = read(name, &Options::default()).unwrap_err().to_string();
        assert!(error.contains("no workbook in the format xlsx; save it as xlsx"), "{error}");
    }
    for name in ["log.xlsx"] {
        let whole = std::fs::read(data(name)).unwrap();
        let mut dice = Dice(7);
        for round in 0..240 {
            let mut bytes = whole.clone();
            if round % 3 == 0 {
                bytes.truncate(8 + whole.len() * round / 240);
            } else {
                for _ in 0..1 + round / 16 {
                    let place = 8 + dice.below(bytes.len() - 8);
                    bytes[place] ^= dice.below(256) as u8;
                }
            }
            std::fs::write(&path, &bytes).unwrap();
            // Whatever comes of it, it comes as a value.
            if let Ok(reader) = Reader::open(&path, &Options::default()) {
                let selection =
                    Selection { columns: (0..reader.names().len()).collect(), ..Selection::default() };
                let _ = reader.read(&selection, &mut |_, _| {});
            }
        }
    }
}

#[test]
fn numbers_of_strings_are_not_believed() {
    use super::stated;

    assert_eq!(stated("<sst count=\"12\" uniqueCount=\"7\">"), 12);
    assert_eq!(stated("<sst uniqueCount='99999999999999999999999'>"), u64::MAX);
    assert_eq!(stated("<sst>"), 0);
}
