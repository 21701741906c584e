//! Random logs: nothing makes the reader panic, and nothing depends on where the text is cut.

use super::dice::Dice;
use super::*;

/// Everything in a table that can be compared.
fn contents(table: &Table) -> impl PartialEq + std::fmt::Debug + use<> {
    let bits = |column: &Vec<f64>| column.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
    (
        table.columns.iter().map(bits).collect::<Vec<_>>(),
        table.time.as_ref().map(bits),
        (table.rows, table.start.clone()),
        table.lines.clone(),
    )
}

/// A table without mistakes, and the same with quotes that change nothing.
fn random_table(dice: &mut Dice) -> (String, String) {
    let (mut plain, mut quoted) = (String::new(), String::new());
    let width = 1 + dice.below(4);
    for row in 0..dice.below(30) + 2 {
        let fields: Vec<String> = (0..width)
            .map(|_| match dice.below(8) {
                _ if row == 0 => "name".to_owned(),
                0 => dice.pick(&["NaN", "na", "-9", "-9.0", "null"]).to_owned(),
                1 => format!("{}e{}", dice.below(10), dice.below(99)),
                2 => format!("-{}.", dice.below(1000)),
                _ => format!("{}.{:018}e-{:02}", dice.below(10), dice.below(1_000_000_000), dice.below(20)),
            })
            .collect();
        let end = dice.pick(&["\n", "\n", "\r\n", "\r"]);
        let blank = dice.pick(&["", "", " ", "\t "]);
        for field in &fields {
            let separator = if std::ptr::eq(field, &fields[0]) { "" } else { "," };
            plain += &format!("{separator}{blank}{field}{blank}");
            quoted += &match dice.below(3) {
                0 => format!("{separator}\"{blank}{field}\"{blank}"),
                _ => format!("{separator}{blank}{field}{blank}"),
            };
        }
        let between = dice.pick(&["", "", "", "", "\n", " \n", "# it's, \"quoted\"\n"]);
        for text in [&mut plain, &mut quoted] {
            *text += end;
            *text += between;
        }
    }
    if dice.below(2) == 0 {
        plain.truncate(plain.trim_end().len());
    }
    (plain, quoted)
}

#[test]
fn the_fast_and_the_careful_reader_agree() {
    let mut dice = Dice(0x9e37_79b9_7f4a_7c15);
    for _ in 0..60 {
        let (plain, quoted) = random_table(&mut dice);
        let expected = contents(&read_all(plain.as_bytes(), &comma(), false, SIZES).unwrap());
        for text in [&plain, &quoted] {
            for (block, piece) in TINY {
                let table = read_all(text.as_bytes(), &comma(), false, sizes(block, piece)).unwrap();
                assert_eq!(contents(&table), expected, "{block} {piece} {text:?}");
            }
        }
    }
}

#[test]
fn the_first_mistake_is_told_whatever_the_cuts_and_threads() {
    let pools: Vec<_> =
        [1, 2, 5].map(|threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap()).into();
    let mut dice = Dice(42);
    for _ in 0..60 {
        let rows = 40 + dice.below(40);
        let mut lines: Vec<String> = (0..rows).map(|row| format!("{row},\"µ\",{row}.5")).collect();
        let mistakes: Vec<usize> = (0..1 + dice.below(5)).map(|_| dice.below(rows)).collect();
        for &row in &mistakes {
            lines[row] =
                dice.pick(&["1,2,x", "1,µµ, inf", "1,2", "1,2,3,4", "1,\"\n\",y", "y,2,3"]).to_owned();
        }
        if dice.below(2) == 0 {
            lines.iter_mut().for_each(|line| *line = line.replace("\"µ\"", "µ"));
        }
        let text = format!("a,b,c\n{}\n", lines.join("\n"));
        let read = |sizes| {
            let reader = start(text.as_bytes(), &comma(), sizes)?;
            reader.read(&Selection { columns: vec![0, 2], time: None, date: None }, &mut |_, _| {})
        };
        let expected = read(SIZES).unwrap_err();
        let first = mistakes.iter().min().unwrap();
        let line = 2 + lines[..*first].iter().map(|line| line.matches('\n').count() + 1).sum::<usize>();
        let place = if lines[*first].contains('\n') { line + 1 } else { line };
        assert!(expected.to_string().starts_with(&format!("log.csv:{place}:")), "{expected}: {text}");
        for pool in &pools {
            for (block, piece) in TINY {
                assert_eq!(pool.install(|| read(sizes(block, piece)).unwrap_err()), expected);
            }
        }
    }
}

#[test]
fn no_bytes_make_it_panic_and_no_cut_makes_a_difference() {
    let mut dice = Dice(7);
    let words: [&[u8]; 25] = [
        b"1",
        b"-2.5e3",
        b".",
        b",",
        b",",
        b",",
        b";",
        b"\"",
        b"\"\"",
        b"\n",
        b"\n",
        b"\r\n",
        b"\r",
        b" ",
        b"\t",
        b"#",
        b"nan",
        b"inf",
        b"x",
        b"\xc2\xb5",
        b"\xff",
        b"2024-03-01T00:00:00Z",
        b"1,2\n",
        b"\"a\nb\"",
        b"\xef\xbb\xbf",
    ];
    for round in 0..400 {
        let mut bytes = if round % 2 == 0 { b"1,2\n3,4\n".to_vec() } else { Vec::new() };
        for _ in 0..dice.below(40) {
            bytes.extend_from_slice(dice.pick(&words));
        }
        let options = Options {
            header: dice.pick(&[Header::Recognised, Header::None, Header::Line(2)]),
            skip_rows: dice.below(2),
            ..comma()
        };
        let time = dice.below(2) == 0;
        let outcome = |sizes| match read_all(&bytes, &options, time, sizes) {
            Ok(table) => Ok(contents(&table)),
            Err(error) => {
                assert!(!error.to_string().contains(['\n', '\r', '\u{feff}']), "{error:?}");
                Err(error)
            }
        };
        let expected = outcome(SIZES);
        for (block, piece) in TINY {
            assert_eq!(
                outcome(sizes(block, piece)),
                expected,
                "{block} {piece} {:?}",
                bytes.escape_ascii().to_string()
            );
        }
    }
}

#[test]
fn no_stream_makes_it_panic() {
    let mut dice = Dice(99);
    let good = gzip("\u{feff}t,y\n1,2\n3,4\n5,6\n".as_bytes());
    for _ in 0..1000 {
        let mut bytes: Vec<u8> = match dice.below(4) {
            0 => good.clone(),
            1 => vec![0xff, 0xfe],
            2 => vec![0xfe, 0xff],
            _ => Vec::new(),
        };
        bytes.extend((0..dice.below(60)).map(|_| (dice.below(256)) as u8));
        for _ in 0..dice.below(3) {
            let place = dice.below(bytes.len().max(1));
            if let Some(byte) = bytes.get_mut(place) {
                *byte = dice.below(256) as u8;
            }
        }
        let encoding =
            dice.pick(&[None, None, Some(UTF_16LE), Some(WINDOWS_1252), Some(encoding_rs::SHIFT_JIS)]);
        let options =
            Options { encoding, decimal_comma: dice.pick(&[None, Some(false), Some(true)]), ..plain() };
        let block = dice.pick(&[1, 2, 3, 5, 100]);
        let _ = read_all(&bytes, &options, false, sizes(block, 3));
    }
}
