//! Logs as people have them: titles above the names, units below, blanks, words for on and off, numbers in other
//! notations.

use super::*;

/// What is read of a text without any option: the names, the columns, and what the reader is told.
fn read(text: &str) -> (Vec<String>, Vec<Vec<f64>>, Vec<String>) {
    read_with(text, &plain())
}

fn read_with(text: &str, options: &Options) -> (Vec<String>, Vec<Vec<f64>>, Vec<String>) {
    let reader = start(text.as_bytes(), options, SIZES).unwrap();
    let names = reader.names().to_vec();
    // Whatever holds numbers, and the words that stand for them.
    let numeric = reader.words().iter().map(|words| !words).collect::<Vec<_>>();
    let columns = (0..names.len()).filter(|&column| numeric[column]).collect();
    let table = reader.read(&Selection { columns, time: None, date: None }, &mut |_, _| {}).unwrap();
    let own = |words: &String| words.strip_prefix("log.csv: ").map(str::to_owned).unwrap();
    (names, table.columns, table.words.iter().map(own).collect())
}

fn names(text: &str) -> Vec<String> {
    read(text).0
}

const ROWS: &str = "0;1;20.5\n10;0;21.25\n";
const VALUES: [[f64; 2]; 3] = [[0.0, 10.0], [1.0, 0.0], [20.5, 21.25]];

#[test]
fn lines_above_the_names_are_left_out() {
    for (head, line) in [
        ("Logger XY export\nSerial no.;12345\n\nt;u;y\n", Some(4)),
        ("Logger;;\nt;u;y\n", Some(2)),
        ("Motor;Motor;Motor\nt;u;y\n", Some(2)),
        ("Started at 10:30\nt;u;y\n", Some(2)),
        ("12345;678\nt;u;y\n", Some(2)),
        ("# made by x\n# at noon\nt;u;y\n", None),
        ("// made; by x\nt;u;y\n", None),
        ("% made by x\n\nt;u;y\n", None),
        ("# t;u;y\n", None),
        ("#made by x\n# t;u;y\n", None),
        ("sep=;\nt;u;y\n", None),
        ("SEP=;\r\nt;u;y\n", None),
    ] {
        let (names, columns, words) = read(&format!("{head}{ROWS}"));
        assert_eq!(names, ["t", "u", "y"], "{head:?}");
        assert_eq!(columns, VALUES, "{head:?}");
        match line {
            Some(line) => assert!(
                words[0].starts_with(&format!("the names are on line {line}, and what is above")),
                "{words:?}"
            ),
            None => assert!(words.is_empty(), "{head:?}: {words:?}"),
        }
    }
    // The sign may be part of the name.
    assert_eq!(names(&format!("%time;u;y\n{ROWS}")), ["%time", "u", "y"]);
    assert_eq!(names(&format!("sep=,\nt;u;y\n{ROWS}").replace(';', ",")), ["t", "u", "y"]);
}

#[test]
fn places_in_messages_are_those_of_the_file() {
    let error = error("Logger\n\nt;u;y\ns;V;C\n0;1;2\n0;x;3\n", &plain());
    assert!(error.starts_with("log.csv:6:3: column 'u': \"x\" is not a number"), "{error}");
    let table = table("Logger\n\nt;u;y\ns;V;C\n0;1;2\n0;1;3\n", &plain());
    assert_eq!(table.lines.of(0), 5);
}

#[test]
fn units_below_the_names_are_no_row() {
    for units in ["s;V;°C", "[s];[V];[degC]", "(s);(V);", "sec;1;°C", "yyyy-mm-dd HH:MM:SS;%;bar"] {
        let (names, columns, words) = read(&format!("t;u;y\n{units}\n{ROWS}"));
        assert_eq!(
            (names.as_slice(), columns.as_slice()),
            (["t", "u", "y"].map(String::from).as_slice(), VALUES.map(Vec::from).as_slice()),
            "{units}"
        );
        assert_eq!(words.len(), 1, "{units}");
        assert!(words[0].starts_with("line 2 is read as units"), "{words:?}");
    }
    // A logger of weather stations: station, names, units, kinds of averages.
    let text = "\"TOA5\",\"Meadow\",\"CR1000\"\n\"TIMESTAMP\",\"u\",\"y\"\n\"TS\",\"V\",\"DegC\"\n\"\",\"Smp\",\"Avg\"\n\
                \"2024-01-10 00:00:00\",1,\"NAN\"\n\"2024-01-10 00:00:10\",2,3\n";
    let (names, columns, _) = read(text);
    assert_eq!(names, ["TIMESTAMP", "u", "y"]);
    assert_eq!(columns[0], [1.0, 2.0]);
    assert!(columns[1][0].is_nan());
}

#[test]
fn a_first_row_of_numbers_is_a_row() {
    let (names, columns, words) = read(ROWS);
    assert_eq!(names, ["1", "2", "3"]);
    assert_eq!(columns, VALUES);
    assert!(words[0].starts_with("line 1 is the first row"), "{words:?}");
    // A table without names, as pandas writes it, has their numbers.
    assert_eq!(self::names(&format!("0;1;2\n{ROWS}")), ["0", "1", "2"]);
    let (names, _, words) = read(&format!("1;2;3\n{ROWS}"));
    assert_eq!((names, words.len()), (["1", "2", "3"].map(String::from).to_vec(), 1));
    let (names, _, words) = read(&format!("A title\n{ROWS}"));
    assert_eq!(names, ["1", "2", "3"]);
    assert!(words[0].starts_with("line 2 is the first row"), "{words:?}");
}

#[test]
fn the_line_of_names_can_be_named() {
    let options = |line| Options { header: Header::Line(line), ..plain() };
    let text = format!("operator;Smith;x\nt;u;y\n{ROWS}");
    assert_eq!(read_with(&text, &options(2)).0, ["t", "u", "y"]);
    let (names, columns, _) = read_with(&format!("t;u;y\nvolt;amp;deg\n{ROWS}"), &options(1));
    assert_eq!((names[0].as_str(), columns[0].len()), ("t", 2));
    for line in [0, 9] {
        let error = error(&text, &options(line));
        assert!(error.contains("there is no row on that line"), "{error}");
    }
}

#[test]
fn runs_of_blanks_separate() {
    let ascii = "   0.0000000e+00   1.0000000e+00   2.0500000e+01\n   1.0000000e+01   0.0000000e+00   2.1250000e+01\n";
    assert_eq!(read(ascii).1, VALUES);
    for text in [
        "t u y\n0 1 20.5\n10 0 21.25\n",
        "t    u\ty  \n0   1   20.5\n10  0   21.25 \n",
        " t  u  y\n\n 0  1  20,5\n10  0  21,25\n",
        "# t u y\n0 1 20.5\n10 0 21.25\n",
        "\"t\" \"u\" y\n0 1 20.5\n10 0 21.25\n",
        "A title of the log\nt u y\n0 1 20.5\n10 0 21.25\n",
        "  t     u    y\n (s)  (V)  (C)\n  0  1  2.05E+1\n 10  0  2.125E+1\n",
    ] {
        let (names, columns, _) = read(text);
        assert_eq!(names, ["t", "u", "y"], "{text:?}");
        assert_eq!(columns, VALUES, "{text:?}");
        for (block, piece) in TINY {
            let table = read_all(text.as_bytes(), &plain(), false, sizes(block, piece)).unwrap();
            assert_eq!(table.columns, VALUES, "{text:?}");
        }
    }
    // Names with blanks in them have more than one between them.
    let (wide, columns, _) = read("Time (s)   Input u   y out\n0  1  20.5\n10  0  21.25\n");
    assert_eq!((wide.join("|").as_str(), columns[2][1]), ("Time (s)|Input u|y out", 21.25));
    assert_eq!(
        error("u y\n1 2\n1 2 3\n", &plain()),
        "log.csv:3:5: this row has 3 fields, but there are 2 columns (a run of blanks separates them); take a field \
         away, or quote the one that holds a delimiter"
    );
    // Blanks in a text, or after a comma, are none.
    assert_eq!(names("u, y\n1, 2\n3, 4\n"), ["u", "y"]);
    assert_eq!(names("time,note\n0,went on well\n1,went off well\n"), ["time", "note"]);
}

#[test]
fn a_last_field_without_a_name_is_left_out() {
    // LabVIEW: a comment may follow a row.
    let lvm = "LabVIEW Measurement\t\nSeparator\tTab\n***End_of_Header***\t\n\t\nChannels\t2\nDelta_X\t10\t10\n\
               ***End_of_Header***\t\t\nX_Value\tu\ty\tComment\n0\t1\t20.5\tbegun, all well\n10\t0\t21.25\n";
    let lvm = format!("{lvm}{}", "20\t1\t22\n".repeat(20));
    let (names, columns, _) = read(&lvm);
    assert_eq!(names, ["X_Value", "u", "y"]);
    assert!(columns.iter().zip(&VALUES).all(|(column, values)| column[..2] == *values));
    // Each row ends with a delimiter.
    let text = "t;u;y\n0;1;20.5;\n10;0;21.25;\n";
    assert_eq!(read(text).1, VALUES);
    // A row that is short is still refused.
    assert!(error("t;u;y\n0;1;20.5;\n10;0\n", &plain()).contains("this row has 2 fields"));
}

#[test]
fn words_for_off_and_on_are_0_and_1() {
    for (off, on) in [
        ("False", "True"),
        ("OFF", "ON"),
        ("no", "yes"),
        ("closed", "open"),
        ("Aus", "Ein"),
        ("FALSCH", "WAHR"),
    ] {
        let (_, columns, words) = read(&format!("u,y\n{on},1.5\n{off},2.5\n,3.5\n{on},4.5\n"));
        assert_eq!(columns[0][..2], [1.0, 0.0]);
        assert!(columns[0][2].is_nan() && columns[0][3] == 1.0);
        let told =
            format!("column 'u': '{}' is read as 0 and '{}' as 1", off.to_lowercase(), on.to_lowercase());
        assert_eq!(words, [told]);
    }
    // One of two words so far.
    assert_eq!(read("u,y\nOFF,1\nOFF,2\n").1[0], [0.0, 0.0]);
    // Whoever has one word for a state has the other of the pair.
    assert_eq!(
        error(format!("u,y\n{}AUTO,1\n", "ON,1\n".repeat(1500)), &plain()),
        "log.csv:1502:1: column 'u': \"AUTO\" is neither 'off' nor 'on', as the first rows are; correct it"
    );
    // Other words are refused with what there is, and can be said.
    let modes = "mode,y\nmanual,1\nauto,2\noff,3\nmanual,4\n";
    let message = error(modes, &plain());
    assert!(message.contains("this column holds words (manual, auto"), "{message}");
    let values = vec![("manual".to_owned(), 0.0), ("auto".to_owned(), 1.0), ("off".to_owned(), -1.0)];
    assert_eq!(columns(modes, &Options { values, ..plain() })[0], [0.0, 1.0, -1.0, 0.0]);
    // A word among numbers is a mistake.
    assert!(error("u,y\n1,1\nON,2\n", &plain()).contains("is not a number"));
}

#[test]
fn statuses_among_numbers_are_missing_values() {
    let text = "u,y\n1,1\nBad,2\n3,I/O Timeout\n4,#N/A\nBAD,1.#QNAN\n6,unavailable\n";
    let (_, columns, words) = read(text);
    let missing = |column: &[f64]| column.iter().filter(|value| value.is_nan()).count();
    assert_eq!((missing(&columns[0]), missing(&columns[1])), (2, 4));
    assert_eq!(words[0], "column 'u': read as missing values: 'bad' (2 rows)");
    assert!(words[1].contains("'i/o timeout' (1 row), 'unavailable' (1 row), '#n/a' (1 row)"), "{words:?}");
    // Whatever the cuts, and each kind of missing value is one in the end.
    for (block, piece) in TINY {
        let table = read_all(text.as_bytes(), &plain(), false, sizes(block, piece)).unwrap();
        assert_eq!(table.words[0], format!("log.csv: {}", words[0]));
        assert!(
            table
                .columns
                .iter()
                .flatten()
                .all(|value| !value.is_nan() || value.to_bits() == f64::NAN.to_bits())
        );
    }
    // A column of nothing else holds no numbers.
    let reader = start(b"u,y\nBad,1\nBad,2\n", &plain(), SIZES).unwrap();
    assert_eq!(reader.words(), [true, false]);
}

#[test]
fn numbers_in_other_notations() {
    // By the numbers themselves.
    assert_eq!(columns("u;y\n1,5;20\n-2,25;30\n", &plain()), [[1.5, -2.25], [20.0, 30.0]]);
    assert_eq!(columns("u;y\n1.234,5;1.000\n-2,25;30\n", &plain()), [[1234.5, -2.25], [1000.0, 30.0]]);
    assert_eq!(columns("u,y\n\"1,234.5\",\"1,000\"\n2.25,30\n", &plain()), [[1234.5, 2.25], [1000.0, 30.0]]);
    assert_eq!(columns("u;y\n1 234,5;50%\n2,25;7,5 %\n", &plain()), [[1234.5, 2.25], [50.0, 7.5]]);
    // By the delimiter, and said.
    let (_, columns, words) = read("u;y\n1,234;5\n2,345;6\n");
    assert_eq!(columns[0], [1.234, 2.345]);
    assert!(
        words[0].starts_with("numbers such as 1,234 are read with a decimal comma; `decimal-comma`=no"),
        "{words:?}"
    );
    let point = Options { decimal_comma: Some(false), ..plain() };
    assert_eq!(read_with("u;y\n1,234;5\n2,345;6\n", &point).1[0], [1234.0, 2345.0]);
    let (_, columns, words) = read("u,y\n\"1,234\",5\n\"2,345\",6\n");
    assert_eq!(columns[0], [1234.0, 2345.0]);
    assert!(words[0].contains("read as whole numbers; `decimal-comma` reads the comma"), "{words:?}");
    let comma = Options { decimal_comma: Some(true), ..plain() };
    assert_eq!(read_with("u;y\n1,234;5\n2,345;6\n", &comma).1[0], [1.234, 2.345]);
}

#[test]
fn a_plain_log_tells_nothing() {
    for text in
        ["u,y\n1,2\n3,4\n", "y\n1\n2\n", "t;u;y\n0;1;2.5\n1;;3\n", "when,u\n2024-01-01,1\n2024-01-02,2\n"]
    {
        let (_, _, words) = read(text);
        assert!(words.is_empty(), "{text:?}: {words:?}");
    }
}

/// The delimiter is the one that most rows have equally often.
#[test]
fn the_most_consistent_delimiter_wins() {
    for (text, expected) in [
        ("t,u,y\n1,2,3\n", 3),
        ("t;u;y\n1;2;3\n", 3),
        ("t\tu\n1\t2\n", 2),
        // Decimal commas, with and without names.
        ("u;y\n1,5;2,5\n3,5;4,5\n", 2),
        ("1,5;2,5\n3,5;4,5\n", 2),
        // A text column that holds the other delimiter, most of the time.
        ("t,u,note\n1,2,a;b\n1,2,a;b\n", 3),
        // Quoted and commented delimiters do not count.
        ("# a;b\n\"a;b\",c\n1,2\n", 2),
        // A comma in the name of a single column.
        ("\"temperature, °C\"\n1\n2\n", 1),
    ] {
        assert_eq!(names(text).len(), expected, "{text:?}");
    }
    // One ragged row does not change the verdict.
    assert!(error("a,b\n1,2\n1,2,3\n1,2\n", &plain()).starts_with("log.csv:3:5: this row has 3 fields"));
}
