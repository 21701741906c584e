//! Which line of the file a row of the table came from.

/// A map from rows to lines.
///
/// A row is counted from zero and a line from one; headers, blank lines, comments and quoted line breaks set
/// them further apart. Only the rows at which the distance changes are stored, so a plain log costs one
/// entry.
#[derive(Clone, Debug, Default, Eq, PartialEq)]
pub struct Lines {
    /// Each run's first row, and by how much its lines are ahead of its rows.
    runs: Vec<(usize, u64)>,
}

impl Lines {
    /// A row of a file, or of a part of it after so many rows, as messages name it: by its line, as an editor counts,
    /// or without lines by its number.
    pub fn place(&self, file: &str, row: usize, before: usize) -> String {
        if self.runs.is_empty() {
            format!("{file}: row {}", before + row + 1)
        } else {
            format!("{file}:{}", self.of(row))
        }
    }

    /// The line on which a row starts. A row beyond the last one is taken to follow it directly.
    pub(super) fn of(&self, row: usize) -> u64 {
        let run = self.runs.partition_point(|&(first, _)| first <= row);
        let ahead = run.checked_sub(1).and_then(|run| self.runs.get(run));
        row as u64 + ahead.map_or(1, |&(_, ahead)| ahead)
    }

    /// Notes the line of the next row. Rows come in order, and each row is on a later line than the one
    /// before.
    pub(super) fn push(&mut self, row: usize, line: u64) {
        // A piece of a file counts its lines from zero too: they are never after the rows.
        let ahead = line - row as u64;
        if self.runs.last().is_none_or(|&(_, last)| last != ahead) {
            self.runs.push((row, ahead));
        }
    }

    /// Appends the map of the part after `rows` rows of this one.
    pub(super) fn extend(&mut self, rows: usize, part: &Self) {
        part.runs.iter().for_each(|&(first, ahead)| self.push(rows + first, first as u64 + ahead));
    }

    /// Appends the map of a piece that starts at `row` and `line` of this one.
    pub(super) fn append(&mut self, piece: &Self, row: usize, line: u64) {
        for &(first, ahead) in &piece.runs {
            self.push(row + first, line + first as u64 + ahead);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_changes_are_stored() {
        let mut lines = Lines::default();
        let file = [2, 3, 4, 7, 8, 10];
        for (row, &line) in file.iter().enumerate() {
            lines.push(row, line);
        }
        assert_eq!(lines.runs, [(0, 2), (3, 4), (5, 5)]);
        for (row, &line) in file.iter().enumerate() {
            assert_eq!(lines.of(row), line);
        }
        assert_eq!(lines.of(6), 11);
    }

    #[test]
    fn a_piece_joins_seamlessly() {
        let (mut lines, mut piece) = (Lines::default(), Lines::default());
        lines.push(0, 2);
        for (row, line) in [(0, 0), (1, 1), (2, 3)] {
            piece.push(row, line);
        }
        lines.append(&piece, 1, 3);
        assert_eq!(lines.runs, [(0, 2), (3, 3)]);
        assert_eq!((lines.of(1), lines.of(2), lines.of(3)), (3, 4, 6));
    }
}
