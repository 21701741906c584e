//! Lists of names in one text: written, and read, as the header of a table with commas.

use super::dialect::Dialect;
use super::record::Record;

const COMMAS: Dialect = Dialect { delimiter: b',', comment: None, blanks: false };

/// The names in a list: between commas, and between double quotes where a name holds a comma.
///
/// # Errors
/// A message for a quote that is not closed.
pub fn names(list: &str) -> Result<Vec<String>, String> {
    if list.trim().is_empty() {
        // A blank line is no row.
        return Ok(vec![String::new()]);
    }
    let mut record = Record::new(COMMAS.delimiter);
    let line = format!("{list}\n");
    if record.read(line.as_bytes()) != Some(line.len()) {
        return Err("a double quote is not closed; write it as in CSV: \"a, b\",c".to_owned());
    }
    let name = |index| String::from_utf8_lossy(COMMAS.trimmed(record.field(index))).into_owned();
    Ok((0..record.len()).map(name).collect())
}

/// A list that [`names`] reads as these names.
pub fn list(names: &[&str]) -> String {
    let field = |name: &&str| {
        if name.contains([',', '"', '\n']) {
            format!("\"{}\"", name.replace('"', "\"\""))
        } else {
            (*name).to_owned()
        }
    };
    names.iter().map(field).collect::<Vec<_>>().join(",")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_as_a_header_is() {
        for (text, expected) in [
            ("u1, u2", &["u1", "u2"][..]),
            ("\"flow, in\",p", &["flow, in", "p"]),
            ("5\" pipe,\"say \"\"so\"\"\"", &["5\" pipe", "say \"so\""]),
            ("", &[""]),
        ] {
            assert!(names(text).is_ok_and(|found| found == expected), "{text}");
        }
        assert!(names("\"a,b").is_err_and(|message| message.contains("not closed")));
    }

    #[test]
    fn a_list_is_read_as_it_was_written() {
        for written in [&["u"][..], &["a,b", "c"], &["\"", "a\"b,", "x y"], &["a\nb", "ä;ö"]] {
            assert!(names(&list(written)).is_ok_and(|found| found == written), "{written:?}");
        }
    }
}
