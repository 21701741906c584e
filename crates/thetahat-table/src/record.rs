//! One row, read by the rules for quoted fields.

use csv_core::{ReadFieldResult, ReadRecordResult, Reader, ReaderBuilder, Terminator};

/// The fields of one row, their quotes removed.
///
/// This is the reader that knows all the rules; the fast one in [`super::rows`] takes the rows without
/// quotes.
pub(super) struct Record {
    delimiter: u8,
    reader: Reader,
    /// The fields, one after the other.
    text: Vec<u8>,
    /// Where each field ends in `text`.
    ends: Vec<usize>,
    /// How many fields there are; the buffers above only grow.
    count: usize,
}

/// A reader at the start of a row.
fn reader(delimiter: u8) -> Reader {
    ReaderBuilder::new()
        .delimiter(delimiter)
        // Lines are counted by their newlines, everywhere: the source has made one of a lone carriage return.
        .terminator(Terminator::Any(b'\n'))
        .build()
}

impl Record {
    /// An empty record.
    pub(super) fn new(delimiter: u8) -> Self {
        Self { delimiter, reader: reader(delimiter), text: vec![0; 256], ends: vec![0; 16], count: 0 }
    }

    /// Reads the row at the front of a text, which is neither a blank line nor a comment.
    ///
    /// Returns its length with the newline, or nothing if the text ends before the row does.
    pub(super) fn read(&mut self, text: &[u8]) -> Option<usize> {
        // A clone of a fresh reader would not do: in csv-core 0.1.13 it reads nothing right.
        self.reader.reset();
        let (mut read, mut written) = (0, 0);
        self.count = 0;
        loop {
            // An empty input would mean the end of the text.
            let input = text.get(read..).filter(|input| !input.is_empty())?;
            let (result, bytes_in, bytes_out, ends) =
                self.reader.read_record(input, &mut self.text[written..], &mut self.ends[self.count..]);
            read += bytes_in;
            written += bytes_out;
            self.count += ends;
            match result {
                ReadRecordResult::Record => return Some(read),
                ReadRecordResult::OutputFull => self.text.resize(2 * self.text.len(), 0),
                ReadRecordResult::OutputEndsFull => self.ends.resize(2 * self.ends.len(), 0),
                ReadRecordResult::InputEmpty | ReadRecordResult::End => return None,
            }
        }
    }

    /// The number of fields; after an incomplete row, of those that are complete.
    pub(super) fn len(&self) -> usize {
        self.count
    }

    /// The content of a field; empty if there are not so many.
    pub(super) fn field(&self, index: usize) -> &[u8] {
        let ends = &self.ends[..self.count];
        let start = index.checked_sub(1).map_or(Some(0), |before| ends.get(before).copied());
        match (start, ends.get(index)) {
            (Some(start), Some(&end)) => &self.text[start..end],
            _ => &[],
        }
    }

    /// Where a field starts in the text from which the row was read; the end of the line if there are not so
    /// many.
    pub(super) fn start_of(&self, index: usize, text: &[u8]) -> usize {
        let mut reader = reader(self.delimiter);
        let mut content = [0; 256];
        let mut start = 0;
        let mut fields = 0;
        while fields < index {
            let input = match text.get(start..) {
                Some(input) if !input.is_empty() => input,
                _ => break,
            };
            let (result, bytes_in, _) = reader.read_field(input, &mut content);
            start += bytes_in;
            match result {
                ReadFieldResult::Field { record_end: false } => fields += 1,
                ReadFieldResult::Field { record_end: true } => {
                    // Before the line break.
                    let line = &text[..start];
                    return line.strip_suffix(b"\n").unwrap_or(line).len();
                }
                ReadFieldResult::OutputFull => {}
                ReadFieldResult::InputEmpty | ReadFieldResult::End => break,
            }
        }
        start
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fields(text: &str) -> (Option<usize>, Vec<String>) {
        let mut record = Record::new(b',');
        let length = record.read(text.as_bytes());
        let fields = (0..record.len()).map(|index| String::from_utf8_lossy(record.field(index)).into_owned());
        (length, fields.collect())
    }

    #[test]
    fn quotes_are_removed_and_what_they_protect_is_kept() {
        let (length, fields) = fields("\"a,\"\"b\"\"\nc\", 2,\"\"\n3,4\n");
        assert_eq!(length, Some(18));
        assert_eq!(fields, ["a,\"b\"\nc", " 2", ""]);
    }

    #[test]
    fn an_incomplete_row_says_so() {
        assert_eq!(fields("1,2").0, None);
        assert_eq!(fields("1,\"2\n").0, None);
        assert_eq!(fields("").0, None);
        assert_eq!(fields("1,2\n").0, Some(4));
    }

    #[test]
    fn long_rows_fit() {
        let row = format!("{}\n", vec!["0123456789"; 1000].join(","));
        let (length, fields) = fields(&row);
        assert_eq!(length, Some(row.len()));
        assert_eq!(fields, vec!["0123456789"; 1000]);
    }

    #[test]
    fn a_field_knows_where_it_started() {
        let text = b"\"a,\"\"b\"\"\nc\", 2,3\n4,5\n";
        let mut record = Record::new(b',');
        record.read(text);
        let starts: Vec<_> = (0..4).map(|index| record.start_of(index, text)).collect();
        assert_eq!(starts, [0, 12, 15, 16]);
    }
}
