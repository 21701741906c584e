//! The columns that are read: one value for each message of their topic.

use super::super::error::{escaped, shortened};
use super::super::{OwnClock, Table};
use super::{Field, counted};

/// The columns of all topics, each at its place.
pub(super) fn joined(mut wanted: Vec<Wanted<'_>>, columns: usize, words: Vec<String>) -> Table {
    let mut table = Table { columns: vec![Vec::new(); columns], words, ..Table::default() };
    table.rows = wanted.iter().map(|wanted| wanted.time.len()).max().unwrap_or(0);
    for column in wanted.iter_mut().flat_map(|wanted| &mut wanted.columns) {
        if let Some(place) = table.columns.get_mut(column.place) {
            *place = std::mem::take(&mut column.values);
        }
    }
    match wanted.as_mut_slice() {
        [one] => table.time = Some(std::mem::take(&mut one.time)),
        several => {
            table.clocks = several
                .iter_mut()
                .map(|wanted| OwnClock {
                    topic: wanted.name.to_owned(),
                    time: std::mem::take(&mut wanted.time),
                    columns: wanted.columns.iter().map(|column| column.place).collect(),
                })
                .collect();
        }
    }
    table
}

/// The columns of a topic that are read.
pub(super) struct Wanted<'t> {
    pub(super) topic: usize,
    name: &'t str,
    pub(super) time: Vec<f64>,
    pub(super) columns: Vec<Column<'t>>,
}

/// One of them.
pub(super) struct Column<'t> {
    /// Its place among those that were selected.
    place: usize,
    field: &'t Field,
    pub(super) values: Vec<f64>,
    /// How many values were infinite, and beyond what 64 bits of floating point hold.
    infinite: usize,
    rounded: usize,
}

impl<'t> Column<'t> {
    pub(super) fn new(place: usize, field: &'t Field) -> Self {
        Self { place, field, values: Vec::new(), infinite: 0, rounded: 0 }
    }
}

impl<'t> Wanted<'t> {
    pub(super) fn new(topic: usize, name: &'t str) -> Self {
        Self { topic, name, time: Vec::new(), columns: Vec::new() }
    }

    /// Takes a message.
    pub(super) fn add(&mut self, time: f64, data: &[u8]) {
        /// Whole numbers up to here are what they are.
        const EXACT: f64 = (1_u64 << 53) as f64;
        self.time.push(time);
        for column in &mut self.columns {
            let Field { at, number, divisor, .. } = *column.field;
            let mut value = number.read(data, at).map_or(f64::NAN, |value| value / divisor);
            if value.is_infinite() {
                value = f64::NAN;
                column.infinite += 1;
            }
            column.rounded += usize::from(number.is_long() && value.abs() > EXACT);
            column.values.push(value);
        }
    }

    /// Puts the rows in the order of their times, of which each stands once, and says what was done.
    pub(super) fn sort(&mut self, file: &str, words: &mut Vec<String>) {
        let name = escaped(&shortened(self.name));
        let back = self.time.windows(2).filter(|pair| pair[1] < pair[0]).count();
        if back > 0 {
            let mut order: Vec<usize> = (0..self.time.len()).collect();
            let time = &self.time;
            order.sort_by(|a, b| time[*a].total_cmp(&time[*b]));
            let sorted = |values: &Vec<f64>| order.iter().map(|&row| values[row]).collect::<Vec<f64>>();
            for column in &mut self.columns {
                column.values = sorted(&column.values);
            }
            self.time = sorted(&self.time);
            let places = counted(back, "place", "places");
            words.push(format!("{file}: the times of '{name}' go back in {places}: its rows are sorted"));
        }
        let repeated = self.time.windows(2).filter(|pair| pair[1] == pair[0]).count();
        if repeated > 0 {
            let last: Vec<bool> = (0..self.time.len())
                .map(|row| self.time.get(row + 1).is_none_or(|next| *next != self.time[row]))
                .collect();
            let columns = self.columns.iter_mut().map(|column| &mut column.values);
            for values in columns.chain([&mut self.time]) {
                let mut is_last = last.iter().copied();
                values.retain(|_| is_last.next().unwrap_or(true));
            }
            let rows = counted(repeated, "row", "rows");
            words
                .push(format!("{file}: '{name}' has {rows} with the time of the one that follows: left out"));
        }
        for column in &self.columns {
            let name = escaped(&shortened(&column.field.name));
            if column.infinite > 0 {
                let count =
                    counted(column.infinite, "infinite value, which counts", "infinite values, which count");
                words.push(format!("{file}: column '{name}' has {count} as missing"));
            }
            if column.rounded > 0 {
                words.push(format!(
                    "{file}: column '{name}' has whole numbers beyond 2^53, which are rounded to the nearest ones that 64 \
                     bits of floating point hold"
                ));
            }
        }
    }
}
