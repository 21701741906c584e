//! The directory of a Parquet file, whose numbers are looked at before they are believed: how deep it is nested, how
//! many elements its lists have, how many children a column has. Its reader takes memory, and stack, for as many.
//!
//! It is a struct in the compact protocol of Thrift: fields of a type and a number, lists with a count, integers of
//! seven bits a byte (Apache Thrift, Thrift Compact protocol encoding). Only the schema, field 2, is looked into: a
//! list of columns before their children, each with the count of these in field 5.

/// Structs and lists in each other; the format itself needs seven.
const DEPTH: usize = 32;
/// Groups in each other in a schema.
const LEVELS: usize = 100;

/// What is wrong with a directory, if it is.
pub(super) fn fault(directory: &[u8]) -> Option<&'static str> {
    let mut thrift = Thrift { bytes: directory, children: Vec::new() };
    if thrift.structure(&mut Vec::new()).is_none() {
        return Some("its directory ends before what it says that it holds");
    }
    // How many children of each group around a column are still to come.
    let mut open: Vec<usize> = Vec::new();
    for (index, &children) in thrift.children.iter().enumerate() {
        let left = thrift.children.len() - index - 1;
        while open.last() == Some(&0) {
            open.pop();
        }
        if let Some(last) = open.last_mut() {
            *last -= 1;
        }
        if children > left {
            return Some("a column has more children than there are columns");
        }
        open.push(children);
        if open.len() > LEVELS {
            return Some("its columns are nested too deep");
        }
    }
    None
}

/// The header of a page: its own length, the bytes that the page has unpacked, and as it is stored. None where it is
/// cut.
pub(super) fn page(bytes: &[u8]) -> Option<(u64, u64, u64)> {
    let mut thrift = Thrift { bytes, children: Vec::new() };
    let (mut field, mut unpacked, mut stored) = (0, 0, 0);
    loop {
        let head = thrift.byte()?;
        if head == 0 {
            break;
        }
        field = match u64::from(head >> 4) {
            0 => zigzag(thrift.integer()?),
            step => field + step,
        };
        match field {
            2 if head & 15 == I32 => unpacked = zigzag(thrift.integer()?),
            3 if head & 15 == I32 => stored = zigzag(thrift.integer()?),
            _ => thrift.value(head & 15, &mut Vec::new(), true)?,
        }
    }
    Some(((bytes.len() - thrift.bytes.len()) as u64, unpacked, stored))
}

/// Types of values, as fields and lists name them.
const TRUE: u8 = 1;
const FALSE: u8 = 2;
const BYTE: u8 = 3;
const I32: u8 = 5;
const DOUBLE: u8 = 7;
const BINARY: u8 = 8;
const LIST: u8 = 9;
const SET: u8 = 10;
const MAP: u8 = 11;
const STRUCT: u8 = 12;
const UUID: u8 = 13;

/// What is left of the bytes.
struct Thrift<'b> {
    bytes: &'b [u8],
    /// Of each column of the schema.
    children: Vec<usize>,
}

impl Thrift<'_> {
    fn skip(&mut self, count: usize) -> Option<()> {
        self.bytes = self.bytes.get(count..)?;
        Some(())
    }

    fn byte(&mut self) -> Option<u8> {
        let (first, rest) = self.bytes.split_first()?;
        self.bytes = rest;
        Some(*first)
    }

    /// An integer without a sign, seven bits a byte, the lowest first.
    fn integer(&mut self) -> Option<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Some(value);
            }
        }
        None
    }

    /// Passes a struct, whose place is told by the numbers of the fields around it.
    fn structure(&mut self, path: &mut Vec<u64>) -> Option<()> {
        let mut field = 0;
        let mut children = 0;
        loop {
            let head = self.byte()?;
            if head == 0 {
                break;
            }
            field = match u64::from(head >> 4) {
                0 => zigzag(self.integer()?),
                step => field + step,
            };
            if path.as_slice() == [2] && field == 5 && (4..=6).contains(&(head & 15)) {
                children = zigzag(self.integer()?);
                continue;
            }
            path.push(field);
            self.value(head & 15, path, true)?;
            path.pop();
        }
        if path.as_slice() == [2] {
            self.children.push(usize::try_from(children).ok()?);
        }
        Some(())
    }

    /// Passes a value. Of a field that is true or false the type is the value.
    fn value(&mut self, kind: u8, path: &mut Vec<u64>, is_field: bool) -> Option<()> {
        if path.len() > DEPTH {
            return None;
        }
        match kind {
            TRUE | FALSE if is_field => Some(()),
            TRUE | FALSE | BYTE => self.skip(1),
            4..=6 => self.integer().map(|_| ()),
            DOUBLE => self.skip(8),
            UUID => self.skip(16),
            BINARY => {
                let length = usize::try_from(self.integer()?).ok()?;
                self.skip(length)
            }
            LIST | SET => {
                let head = self.byte()?;
                let count = if head >> 4 == 15 { self.integer()? } else { u64::from(head >> 4) };
                // None has less than a byte.
                if count > self.bytes.len() as u64 {
                    return None;
                }
                (0..count).try_for_each(|_| self.element(head & 15, path))
            }
            MAP => {
                let count = self.integer()?;
                if count == 0 {
                    return Some(());
                }
                let kinds = self.byte()?;
                if count > self.bytes.len() as u64 {
                    return None;
                }
                (0..count).try_for_each(|_| {
                    self.element(kinds >> 4, path)?;
                    self.element(kinds & 15, path)
                })
            }
            STRUCT => self.structure(path),
            _ => None,
        }
    }

    /// Passes an element of a list: a struct of it stands where the list does, a list in it one deeper.
    fn element(&mut self, kind: u8, path: &mut Vec<u64>) -> Option<()> {
        if kind == STRUCT {
            return self.structure(path);
        }
        path.push(0);
        self.value(kind, path, false)?;
        path.pop();
        Some(())
    }
}

/// A number with its sign in the last bit, as one without: what is below 0 is 0.
fn zigzag(value: u64) -> u64 {
    if value & 1 == 1 { 0 } else { value >> 1 }
}
