//! Test vectors: what a program is given along a log, and what it has to say.

use std::fmt::Write;

use super::interpret::Machine;
use super::program::{Array, Program};
use super::{ExportedFile, Precision};
use crate::Error;
use crate::control::Control;
use crate::data::{Log, Rows, checked};
use crate::model::{Model, Signal};

/// Outputs in single precision are right within this part of the largest.
const SINGLE: f64 = 1e-5;
/// The same of outputs that hang on the mathematical library of a machine.
const LIBRARY: f64 = 1e-12;
/// The set point of a controller stays as it is for so many rows.
const HELD: usize = 25;

/// What programs are given along rows of a log: a column for each input, for each output where these are needed, and
/// for the set point of a controller.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Columns {
    pub(super) inputs: Vec<Vec<f64>>,
    pub(super) measured: Vec<Vec<f64>>,
    pub(super) set_points: Vec<Vec<f64>>,
    rows: usize,
}

/// What stands in rows of a log, one after the other.
struct Picked<'a> {
    log: &'a Log,
    rows: Vec<Rows>,
}

impl<'a> Picked<'a> {
    /// No rows are all rows.
    fn new(log: &'a Log, rows: &[Rows]) -> Result<Self, Error> {
        let all = [Rows::new(1, log.rows())?];
        Ok(Self { log, rows: checked("rows", if rows.is_empty() { &all } else { rows }, log.rows())? })
    }

    fn column(&self, signal: &Signal) -> Result<Vec<f64>, Error> {
        let values = &self.log.channel(&signal.name)?.values;
        Ok(self.rows.iter().flat_map(|rows| &values[rows.positions()]).copied().collect())
    }

    fn count(&self) -> usize {
        self.rows.iter().map(|rows| rows.positions().len()).sum()
    }
}

impl Columns {
    /// # Errors
    /// [`Error::Data`] for channels or rows that are not there.
    pub(super) fn new(model: &Model, log: &Log, rows: &[Rows], with_outputs: bool) -> Result<Self, Error> {
        let picked = Picked::new(log, rows)?;
        let columns = |signals: &[Signal]| -> Result<Vec<_>, Error> {
            signals.iter().map(|signal| picked.column(signal)).collect()
        };
        let outputs = if with_outputs { model.outputs() } else { &[] };
        Ok(Self {
            inputs: columns(model.inputs())?,
            measured: columns(outputs)?,
            set_points: Vec::new(),
            rows: picked.count(),
        })
    }

    /// Those of a controller: what it measures, and the input that acted. A log has no set point: it goes between the
    /// highest and the lowest measurement, so that it moves the input.
    ///
    /// # Errors
    /// As for [`new`](Self::new).
    pub(super) fn of_controller(document: &Control, log: &Log, rows: &[Rows]) -> Result<Self, Error> {
        let picked = Picked::new(log, rows)?;
        let measured = picked.column(&document.output)?;
        let known = || measured.iter().copied().filter(|value| value.is_finite());
        let ends = [known().reduce(f64::max), known().reduce(f64::min)];
        let ends = ends.map(|end| end.unwrap_or(document.output.offset.level));
        let set_points = (0..measured.len()).map(|row| ends[row / HELD % 2]).collect();
        Ok(Self {
            inputs: vec![picked.column(&document.input)?],
            measured: vec![measured],
            set_points: vec![set_points],
            rows: picked.count(),
        })
    }

    pub(super) fn rows(&self) -> usize {
        self.rows
    }

    /// The column that is given for an argument, by its name in programs.
    fn of(&self, argument: &str) -> &[Vec<f64>] {
        match argument {
            "u" => &self.inputs,
            "set_point" => &self.set_points,
            _ => &self.measured,
        }
    }

    /// These and what is expected as CSV: `u1`, `u2`, …, `y1`, …, `set_point1`, `expected1`, …; a missing value is
    /// empty.
    pub(super) fn csv(&self, name: &str, expected: &[Vec<f64>]) -> ExportedFile {
        let named = |letter: &str, columns: &[Vec<f64>]| -> Vec<String> {
            (1..=columns.len()).map(|number| format!("{letter}{number}")).collect()
        };
        let groups: [(&str, &[Vec<f64>]); 4] = [
            ("u", &self.inputs),
            ("y", &self.measured),
            ("set_point", &self.set_points),
            ("expected", expected),
        ];
        let names = groups.map(|(letter, columns)| named(letter, columns)).concat();
        let columns: Vec<&Vec<f64>> = groups.iter().flat_map(|(_, columns)| *columns).collect();
        let mut text = format!("{}\n", names.join(","));
        for row in 0..self.rows {
            for (place, column) in columns.iter().enumerate() {
                let comma = if place > 0 { "," } else { "" };
                // Writing to a string cannot fail.
                let _ = match column[row] {
                    value if value.is_nan() => write!(text, "{comma}"),
                    value => write!(text, "{comma}{value:?}"),
                };
            }
            text.push('\n');
        }
        ExportedFile { name: format!("{name}.csv"), text }
    }
}

/// A run from the start of a program along rows of a log.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Vector {
    pub(super) columns: Columns,
    /// For each output what it has to be.
    pub(super) expected: Vec<Vec<f64>>,
    /// How far outputs may be off.
    pub(super) tolerance: f64,
    /// How many of the numbers that it is given are missing.
    pub(super) missing: usize,
    exact: bool,
    /// How far they are off in the precision of the program, as a part of the largest.
    off: f64,
}

impl Vector {
    /// That of a program of a model.
    ///
    /// # Errors
    /// [`Error::Data`] for channels or rows that are not there, and for outputs that grow out of the range of numbers.
    pub(super) fn new(
        program: &Program,
        model: &Model,
        precision: Precision,
        (log, rows): (&Log, &[Rows]),
    ) -> Result<Self, Error> {
        let is_measured =
            |Array(array): &Array| program.arrays.get(*array).is_some_and(|array| array.name == "measured");
        let reads_outputs = program.entries.iter().any(|entry| entry.arguments.iter().any(is_measured));
        Self::along(program, precision, Columns::new(model, log, rows, reads_outputs)?)
    }

    /// What a program says along columns.
    ///
    /// # Errors
    /// [`Error::Data`] for outputs that grow out of the range of numbers.
    pub(super) fn along(program: &Program, precision: Precision, columns: Columns) -> Result<Self, Error> {
        let (expected, _) = run(program, Precision::F64, &columns);
        let size = largest(expected.iter().flatten().copied());
        if !size.is_finite() {
            return Err(Error::data(
                "the run grows out of the range of numbers, and makes no test vector; name fewer rows",
            ));
        }
        let (own, missing) = run(program, precision, &columns);
        let off =
            largest(expected.iter().flatten().zip(own.iter().flatten()).map(|(one, other)| one - other));
        let exact = precision == Precision::F64 && !program.calls;
        let tolerance = match precision {
            _ if exact => 0.0,
            Precision::F64 => LIBRARY * size,
            Precision::F32 => SINGLE * size,
        };
        let off = if size > 0.0 { off / size } else { 0.0 };
        Ok(Self { columns, expected, tolerance, missing, exact, off })
    }

    pub(super) fn rows(&self) -> usize {
        self.columns.rows()
    }

    /// What is to be warned of.
    pub(super) fn warning(&self) -> Option<String> {
        (self.off > SINGLE).then(|| {
            format!(
                "in single precision the outputs are off by {:.1e} of the largest along these rows, where {SINGLE:.0e} is expected; \
                 take double precision",
                self.off
            )
        })
    }

    pub(super) fn tolerance_note(&self) -> &'static str {
        match self.exact {
            true => "How far outputs may be off: they are the same numbers.",
            false => "How far outputs may be off: by a part of the largest.",
        }
    }

    /// The tables of a program that checks, by their names.
    pub(super) fn tables(&self) -> impl Iterator<Item = (&'static str, &[Vec<f64>])> {
        let all = [
            ("INPUTS", &self.columns.inputs),
            ("MEASURED", &self.columns.measured),
            ("SET_POINTS", &self.columns.set_points),
            ("EXPECTED", &self.expected),
        ];
        all.into_iter()
            .filter(|(_, columns)| !columns.is_empty())
            .map(|(name, columns)| (name, columns.as_slice()))
    }

    /// The table that is given for an argument, by its name in programs.
    pub(super) fn table_of(argument: &str) -> &'static str {
        match argument {
            "u" => "INPUTS",
            "set_point" => "SET_POINTS",
            _ => "MEASURED",
        }
    }

    pub(super) fn csv(&self, name: &str) -> ExportedFile {
        self.columns.csv(name, &self.expected)
    }
}

fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(
        0.0,
        |largest: f64, value| if value.is_nan() { f64::INFINITY } else { largest.max(value.abs()) },
    )
}

/// What a program says of each output, row by row, and how many numbers were missing.
fn run(program: &Program, precision: Precision, columns: &Columns) -> (Vec<Vec<f64>>, usize) {
    let rows = columns.rows();
    let mut machine = Machine::new(program, precision);
    let mut said: Vec<Vec<f64>> = Vec::new();
    for row in 0..rows {
        for entry in &program.entries {
            let now = |Array(array): &Array| -> Vec<f64> {
                let name = program.arrays.get(*array).map_or("", |array| &array.name);
                columns.of(name).iter().map(|column| column[row]).collect()
            };
            let given: Vec<Vec<f64>> = entry.arguments.iter().map(now).collect();
            let given: Vec<&[f64]> = given.iter().map(Vec::as_slice).collect();
            let result = machine.run(entry, &given);
            if !result.is_empty() {
                said.resize(result.len(), Vec::with_capacity(rows));
                said.iter_mut().zip(result).for_each(|(said, value)| said.push(*value));
            }
        }
    }
    (said, machine.missed())
}
