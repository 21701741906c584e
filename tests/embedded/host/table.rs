//! The table of costs, in Markdown: measured, as budgets, and in the README.

use std::error::Error;
use std::fmt;

/// What surrounds the table in the README.
const BEGIN: &str = "<!-- embedded: written by tests/embedded/run --write -->\n";
const END: &str = "<!-- /embedded -->\n";

/// The name of the step, then its figures.
const COLUMNS: [&str; 10] =
    ["f32", "RAM", "O3 code", "stack", "typical", "worst", "Os code", "stack", "typical", "worst"];

/// What one step costs at one level of optimisation.
pub(crate) struct Costs {
    /// Bytes of code: the step and all it calls.
    pub(crate) code: u64,
    /// Bytes of stack.
    pub(crate) stack: u64,
    /// Instructions.
    pub(crate) typical: u64,
    /// Instructions.
    pub(crate) worst: u64,
}

/// Rows of a name and its figures.
#[derive(Default)]
pub(crate) struct Table(Vec<(String, Vec<u64>)>);

impl Table {
    /// Adds the costs at one level to the step's row.
    pub(crate) fn add(&mut self, name: &str, ram: u64, costs: Costs) {
        let row = self.0.iter_mut().find(|(known, _)| known == name);
        let costs = [costs.code, costs.stack, costs.typical, costs.worst];
        match row {
            Some((_, figures)) => figures.extend(costs),
            None => self.0.push((name.to_owned(), [ram].into_iter().chain(costs).collect())),
        }
    }

    /// Reads the table in a text of Markdown.
    pub(crate) fn read(text: &str) -> Result<Self, Box<dyn Error>> {
        let mut rows = Vec::new();
        for line in text.lines().filter(|line| line.starts_with('|')).skip(2) {
            let mut cells = line.trim_matches('|').split('|').map(str::trim);
            let name = cells.next().unwrap_or_default().to_owned();
            let figures: Result<Vec<u64>, _> = cells.map(str::parse).collect();
            let figures = figures.map_err(|error| format!("{error}: {line}"))?;
            if figures.len() + 1 != COLUMNS.len() {
                return Err(format!("{} cells expected: {line}", COLUMNS.len()).into());
            }
            rows.push((name, figures));
        }
        Ok(Table(rows))
    }

    /// The figures that are above their budgets.
    pub(crate) fn above(&self, budgets: &Table) -> Vec<String> {
        self.compare(budgets, "budget", |measured, budget| measured <= budget)
    }

    /// The figures that differ from what is written by more than some percent of it.
    pub(crate) fn apart(&self, written: &Table, percent: u64) -> Vec<String> {
        let near = |measured: u64, written: u64| 100 * measured.abs_diff(written) <= percent * written;
        self.compare(written, "README (renew it: tests/embedded/run --write)", near)
    }

    /// What is wrong with the figures that are not `fine` beside their counterparts.
    fn compare(&self, other: &Table, title: &str, fine: impl Fn(u64, u64) -> bool) -> Vec<String> {
        let lacks = |table: &Table, name: &str| table.0.iter().all(|(known, _)| known != name);
        let only_here = self.0.iter().filter(|(name, _)| lacks(other, name));
        let only_there = other.0.iter().filter(|(name, _)| lacks(self, name));
        let mut faults: Vec<String> =
            only_here.map(|(name, _)| format!("{name}: not in the {title}")).collect();
        faults.extend(only_there.map(|(name, _)| format!("{name}: in the {title}, but not measured")));
        for (name, figures) in &self.0 {
            let Some((_, others)) = other.0.iter().find(|(known, _)| known == name) else { continue };
            for (index, (&measured, &other)) in figures.iter().zip(others).enumerate() {
                if !fine(measured, other) {
                    let column = COLUMNS.get(index + 1).unwrap_or(&"");
                    let level = ["", " (O3)", " (Os)"][index.div_ceil(4)];
                    faults.push(format!("{name}: {column}{level} is {measured}, {other} in the {title}"));
                }
            }
        }
        faults
    }
}

impl fmt::Display for Table {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let widest = self.0.iter().map(|(name, _)| name.len()).max().unwrap_or(0);
        let width = |index: usize| if index == 0 { widest } else { COLUMNS[index].len() };
        let mut line = |cells: &[String]| {
            for (index, cell) in cells.iter().enumerate() {
                let width = width(index);
                match index {
                    0 => write!(formatter, "| {cell:width$} |")?,
                    _ => write!(formatter, " {cell:>width$} |")?,
                }
            }
            writeln!(formatter)
        };
        line(&COLUMNS.map(str::to_owned))?;
        let rule = |index| format!("{}{}", "-".repeat(width(index) - 1), if index == 0 { "-" } else { ":" });
        line(&std::array::from_fn::<_, { COLUMNS.len() }, _>(rule))?;
        for (name, figures) in &self.0 {
            let cells: Vec<String> =
                [name.clone()].into_iter().chain(figures.iter().map(u64::to_string)).collect();
            line(&cells)?;
        }
        Ok(())
    }
}

/// The part of the README that holds the table.
pub(crate) fn find(readme: &str) -> Result<&str, Box<dyn Error>> {
    let lacks = |line: &str| format!("README.md has no line {}", line.trim());
    let (_, rest) = readme.split_once(BEGIN).ok_or_else(|| lacks(BEGIN))?;
    let (table, _) = rest.split_once(END).ok_or_else(|| lacks(END))?;
    Ok(table)
}

/// The README with another table.
pub(crate) fn replace(readme: &str, table: &Table) -> Result<String, Box<dyn Error>> {
    Ok(readme.replacen(&format!("{BEGIN}{}{END}", find(readme)?), &format!("{BEGIN}{table}{END}"), 1))
}

#[cfg(test)]
mod tests {
    use super::{BEGIN, Costs, END, Table, find, replace};

    fn table(worst: u64) -> Table {
        let mut table = Table::default();
        for (name, ram) in [("a", 1), ("b", 2)] {
            table.add(name, ram, Costs { code: 10, stack: 20, typical: 30, worst: 40 });
            table.add(name, ram, Costs { code: 100, stack: 200, typical: 300, worst });
        }
        table
    }

    #[test]
    fn a_table_is_read_as_it_is_written() {
        let written = table(400).to_string();
        assert_eq!(Table::read(&written).unwrap().to_string(), written);
        for row in ["| c | 1 | 2 |", "| c | 1 | 2 | 3 | 4 | 5 | 6 | 7 | 8 | 9.5 |"] {
            assert!(Table::read(&format!("{written}{row}\n")).is_err(), "{row}");
        }
    }

    #[test]
    fn only_figures_above_their_budgets_are_faults() {
        assert_eq!(table(400).above(&table(400)), [""; 0]);
        assert_eq!(table(300).above(&table(400)), [""; 0]);
        assert_eq!(
            table(401).above(&table(400)),
            ["a", "b"].map(|name| format!("{name}: worst (Os) is 401, 400 in the budget"))
        );
        assert_eq!(table(400).above(&Table::default()).len(), 2);
        assert_eq!(Table::default().above(&table(400)).len(), 2);
    }

    #[test]
    fn figures_may_differ_by_the_margin_both_ways() {
        for (worst, faults) in [(359, 2), (360, 0), (440, 0), (441, 2)] {
            assert_eq!(table(worst).apart(&table(400), 10).len(), faults, "{worst}");
        }
    }

    #[test]
    fn only_what_is_between_the_markers_is_replaced() {
        let readme = |table: &str| format!("before\n{BEGIN}{table}{END}after\n");
        let renewed = replace(&readme("old\n"), &table(400)).unwrap();
        assert_eq!(renewed, readme(&table(400).to_string()));
        assert_eq!(find(&renewed).unwrap(), table(400).to_string());
        assert!(replace("no markers", &table(400)).is_err());
    }
}
