//! Tables of costs, in Markdown: measured, as budgets, and in docs/firmware.md.

use std::error::Error;
use std::fmt;

/// A table that is measured: where the page has it, and its columns.
pub(crate) struct Kind {
    name: &'static str,
    /// The name of the row, then its figures.
    columns: &'static [&'static str],
}

/// What a step costs: the name of the step, then its figures.
pub(crate) static STEPS: Kind = Kind {
    name: "embedded",
    columns: &["f32", "RAM", "O3 code", "stack", "typical", "worst", "Os code", "stack", "typical", "worst"],
};

/// How large an image is: the estimator in it, then the processors at both levels that save code.
pub(crate) static IMAGES: Kind = Kind {
    name: "images",
    columns: &["f32", "M4F, s", "M4F, z", "M0+, s", "M0+, z", "RV32IMC, s", "RV32IMC, z"],
};

/// What a sample costs in an exported model: the model, then its figures.
pub(crate) static EXPORTS: Kind = Kind {
    name: "exports",
    columns: &["C, f32", "RAM", "O2 code", "typical", "worst", "Os code", "typical", "worst"],
};

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
pub(crate) struct Table {
    kind: &'static Kind,
    rows: Vec<(String, Vec<u64>)>,
}

impl Table {
    /// A table without rows.
    pub(crate) fn new(kind: &'static Kind) -> Self {
        Table { kind, rows: Vec::new() }
    }

    /// Adds the costs at one level to the step's row.
    pub(crate) fn add_costs(&mut self, name: &str, ram: u64, costs: Costs) {
        if self.rows.iter().all(|(known, _)| known != name) {
            self.add(name, ram);
        }
        for figure in [costs.code, costs.stack, costs.typical, costs.worst] {
            self.add(name, figure);
        }
    }

    /// Adds a figure to the row of this name.
    pub(crate) fn add(&mut self, name: &str, figure: u64) {
        match self.rows.iter_mut().find(|(known, _)| known == name) {
            Some((_, figures)) => figures.push(figure),
            None => self.rows.push((name.to_owned(), vec![figure])),
        }
    }

    /// Reads the table of this kind in a text of Markdown.
    pub(crate) fn read(kind: &'static Kind, text: &str) -> Result<Self, Box<dyn Error>> {
        let cells = |line: &str| -> Vec<String> {
            line.trim_matches('|').split('|').map(|cell| cell.trim().to_owned()).collect()
        };
        let mut table = Table::new(kind);
        let lines = text.lines().skip_while(|line| cells(line) != kind.columns).skip(2);
        for line in lines.take_while(|line| line.starts_with('|')) {
            let mut cells = cells(line).into_iter();
            let name = cells.next().unwrap_or_default();
            let figures: Result<Vec<u64>, _> = cells.map(|cell| cell.parse()).collect();
            let figures = figures.map_err(|error| format!("{error}: {line}"))?;
            if figures.len() + 1 != kind.columns.len() {
                return Err(format!("{} cells expected: {line}", kind.columns.len()).into());
            }
            table.rows.push((name, figures));
        }
        Ok(table)
    }

    /// The figures that are above their budgets.
    pub(crate) fn above(&self, budgets: &Table) -> Vec<String> {
        self.compare(budgets, "budget", |measured, budget| measured <= budget)
    }

    /// The figures that differ from what is written by more than some percent of it.
    pub(crate) fn apart(&self, written: &Table, percent: u64) -> Vec<String> {
        let near = |measured: u64, written: u64| 100 * measured.abs_diff(written) <= percent * written;
        self.compare(written, "page docs/firmware.md (renew it: tests/embedded/run --write)", near)
    }

    /// What is wrong with the figures that are not `fine` beside their counterparts.
    fn compare(&self, other: &Table, title: &str, fine: impl Fn(u64, u64) -> bool) -> Vec<String> {
        let lacks = |table: &Table, name: &str| table.rows.iter().all(|(known, _)| known != name);
        let only_here = self.rows.iter().filter(|(name, _)| lacks(other, name));
        let only_there = other.rows.iter().filter(|(name, _)| lacks(self, name));
        let mut faults: Vec<String> =
            only_here.map(|(name, _)| format!("{name}: not in the {title}")).collect();
        faults.extend(only_there.map(|(name, _)| format!("{name}: in the {title}, but not measured")));
        for (name, figures) in &self.rows {
            let Some((_, others)) = other.rows.iter().find(|(known, _)| known == name) else { continue };
            for (index, (&measured, &other)) in figures.iter().zip(others).enumerate() {
                if !fine(measured, other) {
                    let columns = self.kind.columns;
                    let column = columns.get(index + 1).unwrap_or(&"");
                    // Of two columns of one name the first one stands left of that of another level.
                    let level = match columns.iter().filter(|other| *other == column).count() {
                        0 | 1 => String::new(),
                        _ => format!(" ({})", level(&columns[..=index])),
                    };
                    faults.push(format!("{name}: {column}{level} is {measured}, {other} in the {title}"));
                }
            }
        }
        faults
    }
}

impl fmt::Display for Table {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let widest = self.rows.iter().map(|(name, _)| name.len()).max().unwrap_or(0);
        let columns = self.kind.columns;
        let width = |index: usize| if index == 0 { widest } else { columns[index].len() };
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
        line(&columns.iter().map(|&column| column.to_owned()).collect::<Vec<_>>())?;
        let rule = |index| format!("{}{}", "-".repeat(width(index) - 1), if index == 0 { "-" } else { ":" });
        line(&(0..columns.len()).map(rule).collect::<Vec<_>>())?;
        for (name, figures) in &self.rows {
            let cells: Vec<String> =
                [name.clone()].into_iter().chain(figures.iter().map(u64::to_string)).collect();
            line(&cells)?;
        }
        Ok(())
    }
}

/// The level of optimisation that the last of some columns belongs to: the last that names one says it.
fn level(columns: &[&str]) -> String {
    let mut named = columns.iter().rev().filter_map(|column| column.strip_suffix(" code"));
    named.next().unwrap_or_default().to_owned()
}

/// What surrounds the table in the page.
fn markers(kind: &Kind) -> [String; 2] {
    let Kind { name, .. } = kind;
    [format!("<!-- {name}: written by tests/embedded/run --write -->\n"), format!("<!-- /{name} -->\n")]
}

/// The part of the page that holds the table of this kind.
pub(crate) fn find<'a>(kind: &Kind, page: &'a str) -> Result<&'a str, Box<dyn Error>> {
    let [begin, end] = markers(kind);
    let lacks = |line: &str| format!("docs/firmware.md has no line {}", line.trim());
    let (_, rest) = page.split_once(&begin).ok_or_else(|| lacks(&begin))?;
    let (table, _) = rest.split_once(&end).ok_or_else(|| lacks(&end))?;
    Ok(table)
}

/// The page with another table of its kind.
pub(crate) fn replace(page: &str, table: &Table) -> Result<String, Box<dyn Error>> {
    let [begin, end] = markers(table.kind);
    let old = find(table.kind, page)?;
    Ok(page.replacen(&format!("{begin}{old}{end}"), &format!("{begin}{table}{end}"), 1))
}

#[cfg(test)]
mod tests {
    use super::{Costs, IMAGES, STEPS, Table, find, markers, replace};

    fn table(worst: u64) -> Table {
        let mut table = Table::new(&STEPS);
        for (name, ram) in [("a", 1), ("b", 2)] {
            table.add_costs(name, ram, Costs { code: 10, stack: 20, typical: 30, worst: 40 });
            table.add_costs(name, ram, Costs { code: 100, stack: 200, typical: 300, worst });
        }
        table
    }

    #[test]
    fn a_table_is_read_as_it_is_written() {
        let written = table(400).to_string();
        assert_eq!(Table::read(&STEPS, &written).unwrap().to_string(), written);
        // Another table beside it is another one.
        let mut images = Table::new(&IMAGES);
        (1..7).for_each(|figure| images.add("a", figure));
        let both = format!("text\n\n{written}\n{images}\nmore\n");
        assert_eq!(Table::read(&STEPS, &both).unwrap().to_string(), written);
        assert_eq!(Table::read(&IMAGES, &both).unwrap().to_string(), images.to_string());
        for row in ["| c | 1 | 2 |", "| c | 1 | 2 | 3 | 4 | 5 | 6 | 7 | 8 | 9.5 |"] {
            assert!(Table::read(&STEPS, &format!("{written}{row}\n")).is_err(), "{row}");
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
        assert_eq!(table(400).above(&Table::new(&STEPS)).len(), 2);
        assert_eq!(Table::new(&STEPS).above(&table(400)).len(), 2);
    }

    #[test]
    fn figures_may_differ_by_the_margin_both_ways() {
        for (worst, faults) in [(359, 2), (360, 0), (440, 0), (441, 2)] {
            assert_eq!(table(worst).apart(&table(400), 10).len(), faults, "{worst}");
        }
    }

    #[test]
    fn only_what_is_between_the_markers_is_replaced() {
        let [begin, end] = markers(&STEPS);
        let page = |table: &str| format!("before\n{begin}{table}{end}after\n");
        let renewed = replace(&page("old\n"), &table(400)).unwrap();
        assert_eq!(renewed, page(&table(400).to_string()));
        assert_eq!(find(&STEPS, &renewed).unwrap(), table(400).to_string());
        assert!(replace("no markers", &table(400)).is_err());
    }
}
