//! A TOML file by hand, so that each error can say where it is.

use std::borrow::Cow;
use std::fmt::Write;
use std::ops::Range;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

pub(crate) use crate::text::suggestion;
use crate::{Error, text};

/// An error at a place of a text, with line and column, both counted from 1.
pub(crate) fn error_at(text: &str, offset: usize, message: impl AsRef<str>) -> Error {
    let before = text.get(..offset).unwrap_or(text);
    let line = before.matches('\n').count() + 1;
    let column = before.rsplit('\n').next().map_or(0, |line| line.chars().count()) + 1;
    Error::Model { line, column, message: text::message(message.as_ref()) }
}

/// A word as it is quoted in an error: not too long, and without control characters.
pub(crate) fn quoted(word: &str) -> String {
    format!("'{}'", text::brief(word, 40))
}

/// A name as TOML writes it where it may have blanks.
pub(crate) fn toml_text(name: &str) -> String {
    let mut text = String::from("\"");
    for letter in name.chars() {
        match letter {
            '"' | '\\' => {
                text.push('\\');
                text.push(letter);
            }
            control if control.is_control() => {
                let _ = write!(text, "\\u{:04X}", u32::from(control));
            }
            letter => text.push(letter),
        }
    }
    text.push('"');
    text
}

/// A TOML document that was parsed.
pub(crate) struct Document<'t> {
    text: &'t str,
    root: Spanned<DeTable<'t>>,
}

impl<'t> Document<'t> {
    /// # Errors
    /// [`Error::Model`] where it is no TOML.
    pub(crate) fn parse(text: &'t str) -> Result<Self, Error> {
        let root = DeTable::parse(text).map_err(|error| {
            let offset = error.span().map_or(0, |span| span.start);
            error_at(text, offset, format!("this is not TOML: {}", error.message()))
        })?;
        Ok(Self { text, root })
    }

    pub(crate) fn root(&self) -> Section<'_> {
        Section { text: self.text, name: String::new(), table: self.root.get_ref(), offset: 0 }
    }
}

/// A table of a document.
#[derive(Clone)]
pub(crate) struct Section<'d> {
    text: &'d str,
    /// Such as `states.position`; empty for the document.
    name: String,
    table: &'d DeTable<'d>,
    offset: usize,
}

impl<'d> Section<'d> {
    /// An error at the table.
    pub(crate) fn error(&self, message: impl AsRef<str>) -> Error {
        error_at(self.text, self.offset, message)
    }

    /// The name of a key with the table that it is in.
    fn path(&self, key: &str) -> String {
        if self.name.is_empty() { key.to_owned() } else { format!("{}.{key}", self.name) }
    }

    /// All entries, in the order of the text.
    pub(crate) fn entries(&self) -> Vec<Entry<'d>> {
        let entry = |(key, value): (&'d Spanned<Cow<'d, str>>, &'d Spanned<DeValue<'d>>)| Entry {
            text: self.text,
            path: self.path(key.get_ref()),
            key: key.get_ref(),
            key_offset: key.span().start,
            value,
        };
        let mut entries: Vec<Entry<'d>> = self.table.iter().map(entry).collect();
        entries.sort_by_key(|entry| entry.key_offset);
        entries
    }

    /// That it has no other keys than these.
    pub(crate) fn allow(&self, keys: &[&str]) -> Result<(), Error> {
        match self.entries().iter().find(|entry| !keys.contains(&entry.key)) {
            None => Ok(()),
            Some(entry) => {
                let place =
                    if self.name.is_empty() { "the model".to_owned() } else { format!("[{}]", self.name) };
                let near = suggestion(entry.key, keys.iter().copied());
                let known = keys.join(", ");
                Err(entry.error(format!("{place} has no key {}{near} (it has {known})", quoted(entry.key))))
            }
        }
    }

    pub(crate) fn get(&self, key: &str) -> Option<Entry<'d>> {
        let (key, value) = self.table.get_key_value(key)?;
        Some(Entry {
            text: self.text,
            path: self.path(key.get_ref()),
            key: key.get_ref(),
            key_offset: key.span().start,
            value,
        })
    }

    /// # Errors
    /// [`Error::Argument`] if the key is not there; `what` says what it would be.
    pub(crate) fn require(&self, key: &str, what: &str) -> Result<Entry<'d>, Error> {
        self.get(key).ok_or_else(|| self.error(format!("'{}' is missing: {what}", self.path(key))))
    }

    /// A table in it, if it is there.
    pub(crate) fn section(&self, key: &str) -> Result<Option<Section<'d>>, Error> {
        self.get(key).map(|entry| entry.section()).transpose()
    }

    /// A text, if it is there.
    pub(crate) fn text(&self, key: &str) -> Result<Option<&'d str>, Error> {
        self.get(key).map(|entry| entry.text()).transpose()
    }

    /// A number, if it is there.
    pub(crate) fn number(&self, key: &str) -> Result<Option<f64>, Error> {
        self.get(key).map(|entry| entry.number()).transpose()
    }
}

/// A key with its value.
pub(crate) struct Entry<'d> {
    text: &'d str,
    path: String,
    pub(crate) key: &'d str,
    key_offset: usize,
    value: &'d Spanned<DeValue<'d>>,
}

impl<'d> Entry<'d> {
    /// An error at the key.
    pub(crate) fn error(&self, message: impl AsRef<str>) -> Error {
        error_at(self.text, self.key_offset, message)
    }

    /// An error at the value.
    pub(crate) fn value_error(&self, message: impl AsRef<str>) -> Error {
        error_at(self.text, self.value.span().start, message)
    }

    fn wrong(&self, expected: &str) -> Error {
        self.wrong_value(self.value, expected)
    }

    fn wrong_value(&self, value: &Spanned<DeValue<'_>>, expected: &str) -> Error {
        let found = match value.get_ref() {
            DeValue::String(_) => "a text",
            DeValue::Integer(_) | DeValue::Float(_) => "a number",
            DeValue::Boolean(_) => "true or false",
            DeValue::Datetime(_) => "a date",
            DeValue::Array(_) => "an array",
            DeValue::Table(_) => "a table",
        };
        let message = format!("'{}' must be {expected}, but here is {found}", self.path);
        error_at(self.text, value.span().start, message)
    }

    pub(crate) fn is_table(&self) -> bool {
        matches!(self.value.get_ref(), DeValue::Table(_))
    }

    pub(crate) fn is_text(&self) -> bool {
        matches!(self.value.get_ref(), DeValue::String(_))
    }

    pub(crate) fn section(&self) -> Result<Section<'d>, Error> {
        match self.value.get_ref() {
            DeValue::Table(table) => {
                Ok(Section { text: self.text, name: self.path.clone(), table, offset: self.key_offset })
            }
            _ => Err(self.wrong("a table")),
        }
    }

    pub(crate) fn flag(&self) -> Result<bool, Error> {
        match self.value.get_ref() {
            DeValue::Boolean(flag) => Ok(*flag),
            _ => Err(self.wrong("true or false")),
        }
    }

    /// One of these words.
    pub(crate) fn one_of(&self, words: &[&str]) -> Result<&'d str, Error> {
        let word = self.text()?;
        if words.contains(&word) {
            return Ok(word);
        }
        let near = suggestion(word, words.iter().copied());
        Err(self.value_error(format!("{} is none of: {}{near}", quoted(word), words.join(", "))))
    }

    /// A text that is not empty.
    pub(crate) fn text(&self) -> Result<&'d str, Error> {
        self.text_of(self.value)
    }

    fn text_of(&self, value: &'d Spanned<DeValue<'d>>) -> Result<&'d str, Error> {
        match value.get_ref() {
            DeValue::String(text) if !text.trim().is_empty() => Ok(text),
            DeValue::String(_) => {
                Err(error_at(self.text, value.span().start, format!("'{}' is empty", self.path)))
            }
            _ => Err(self.wrong_value(value, "a text in quotes")),
        }
    }

    /// Where the characters of the text are, if it is written without escapes: its beginning. Else that of the value,
    /// and no places within it.
    pub(crate) fn text_origin(&self) -> (usize, bool) {
        let Range { start, end } = self.value.span();
        let (DeValue::String(value), Some(written)) = (self.value.get_ref(), self.text.get(start..end))
        else {
            return (start, false);
        };
        match written.find(value.as_ref()) {
            Some(within) if written.len() - value.len() <= 8 => (start + within, true),
            _ => (start, false),
        }
    }

    /// The text of the whole document.
    pub(crate) fn document(&self) -> &'d str {
        self.text
    }

    /// A finite number.
    pub(crate) fn number(&self) -> Result<f64, Error> {
        self.number_of(self.value)
    }

    fn number_of(&self, value: &Spanned<DeValue<'_>>) -> Result<f64, Error> {
        let number = match value.get_ref() {
            DeValue::Integer(integer) => match i128::from_str_radix(integer.as_str(), integer.radix()) {
                Ok(integer) => integer as f64,
                Err(_) => integer.as_str().parse().unwrap_or(f64::NAN),
            },
            DeValue::Float(float) => float.as_str().parse().unwrap_or(f64::NAN),
            _ => return Err(self.wrong_value(value, "a number")),
        };
        if number.is_finite() {
            Ok(number)
        } else {
            let message = format!("'{}' must be a finite number", self.path);
            Err(error_at(self.text, value.span().start, message))
        }
    }

    /// A number above 0.
    pub(crate) fn positive(&self) -> Result<f64, Error> {
        let number = self.number()?;
        if number > 0.0 {
            Ok(number)
        } else {
            Err(self.value_error(format!("'{}' is {number}: it must be above 0", self.path)))
        }
    }

    /// A number that is not below 0.
    pub(crate) fn non_negative(&self) -> Result<f64, Error> {
        let number = self.number()?;
        if number >= 0.0 {
            Ok(number)
        } else {
            Err(self.value_error(format!("'{}' is {number}: it must be 0 or more", self.path)))
        }
    }

    fn array_of<'v>(&self, value: &'v Spanned<DeValue<'d>>) -> Result<&'v [Spanned<DeValue<'d>>], Error> {
        match value.get_ref() {
            DeValue::Array(array) => Ok(array),
            _ => Err(self.wrong_value(value, "an array in [ ]")),
        }
    }

    pub(crate) fn texts(&self) -> Result<Vec<String>, Error> {
        self.array_of(self.value)?.iter().map(|value| Ok(self.text_of(value)?.to_owned())).collect()
    }

    pub(crate) fn numbers(&self) -> Result<Vec<f64>, Error> {
        self.array_of(self.value)?.iter().map(|value| self.number_of(value)).collect()
    }

    /// A matrix, row by row. Its rows are as long as one another.
    pub(crate) fn rows(&self) -> Result<Vec<Vec<f64>>, Error> {
        let mut rows: Vec<Vec<f64>> = Vec::new();
        for value in self.array_of(self.value)? {
            let entries = self.array_of(value)?;
            let row: Vec<f64> =
                entries.iter().map(|value| self.number_of(value)).collect::<Result<_, _>>()?;
            if let Some(first) = rows.first().filter(|first| first.len() != row.len()) {
                let message = format!(
                    "row {} of '{}' has {} numbers, the first row {}: make the rows equally long",
                    rows.len() + 1,
                    self.path,
                    row.len(),
                    first.len()
                );
                return Err(error_at(self.text, value.span().start, message));
            }
            rows.push(row);
        }
        Ok(rows)
    }
}
