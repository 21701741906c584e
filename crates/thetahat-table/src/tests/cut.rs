//! Logs that end in the middle of a row: power was lost, or the disk was full.

use std::ops::ControlFlow;

use super::*;

/// Reads all columns in parts of one row or a little more.
fn parts(text: &str, sizes: Sizes) -> Result<Vec<Table>, Error> {
    let reader = start(text.as_bytes(), &comma(), sizes)?;
    let columns = (0..reader.names().len()).collect();
    let selection = Selection { columns, time: None, date: None };
    let mut parts = Vec::new();
    reader.read_parts(&selection, Some(1), &mut |_, _| {}, &mut |part| {
        parts.push(part);
        ControlFlow::Continue(())
    })?;
    Ok(parts)
}

#[test]
fn a_last_row_that_was_cut_is_called_so() {
    for (text, place, fields) in [
        ("t,u,y\n0,1,2\n3,4", "3:4", "2 fields"),
        ("t,u,y\n0,1,2\n3", "3:2", "1 field"),
        ("t,u,y\r\n\r\n0,1,2\r\n3,", "4:3", "2 fields"),
        ("\"t\",u,y\n\"0\",1,2\n\"3\",4", "3:6", "2 fields"),
        // What the row holds does not matter, nor whether there is another.
        ("t,u,y\n0,1,2\n2024-03-0", "3:10", "1 field"),
        ("t,u,y\n1,2", "2:4", "2 fields"),
    ] {
        let told = format!(
            "log.csv:{place}: this row has {fields}, but there are 3 columns (\",\" separates them); this is the last line and \
             has no line break: it was probably cut; delete this line, or add what is missing"
        );
        for (block, piece) in std::iter::once((SIZES.block, SIZES.piece)).chain(TINY) {
            let sizes = sizes(block, piece);
            let error = read_all(text.as_bytes(), &comma(), false, sizes).unwrap_err();
            assert_eq!(error.to_string(), told, "{text:?}");
            assert_eq!(parts(text, sizes).unwrap_err().to_string(), told, "{text:?}");
        }
    }
}

/// It has a line break, or one field too many, or another row before it is not whole, either.
#[test]
fn another_row_was_not_cut() {
    for text in ["t,u,y\n0,1,2\n3,4\n", "t,u,y\n0,1,2\n3,4,5,6", "t,u,y\n0,1,2\n3,4\n5,6"] {
        for (block, piece) in TINY {
            let error =
                read_all(text.as_bytes(), &comma(), false, sizes(block, piece)).unwrap_err().to_string();
            assert!(error.starts_with("log.csv:3:") && !error.contains("cut"), "{error}");
        }
    }
}

/// Only the first row of a log may hold units, and not the first one of a part.
#[test]
fn a_mistake_in_a_later_part_is_no_unit() {
    let text = "t,y\n0,1\n1,2\n2,V\n";
    for (block, piece) in TINY {
        let error = parts(text, sizes(block, piece)).unwrap_err().to_string();
        assert!(error.starts_with("log.csv:4:3: column 'y': \"V\" is not a number"), "{error}");
        assert!(!error.contains("units"), "{error}");
    }
}
