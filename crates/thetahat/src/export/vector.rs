//! Test vectors: what a program is given along a log, and what it has to say.

use std::fmt::Write;

use super::interpret::Machine;
use super::program::{Array, Program};
use super::{ExportedFile, Precision};
use crate::Error;
use crate::data::{Log, Rows, checked};
use crate::model::{Model, Signal};

/// Outputs in single precision are right within this part of the largest.
const SINGLE: f64 = 1e-5;
/// The same of outputs that hang on the mathematical library of a machine.
const LIBRARY: f64 = 1e-12;

/// What programs are given along rows of a log: a column for each input, and for each output where these are needed.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Columns {
    pub(super) inputs: Vec<Vec<f64>>,
    pub(super) measured: Vec<Vec<f64>>,
    rows: usize,
}

impl Columns {
    /// # Errors
    /// [`Error::Data`] for channels or rows that are not there.
    pub(super) fn new(model: &Model, log: &Log, rows: &[Rows], with_outputs: bool) -> Result<Self, Error> {
        let all = [Rows::new(1, log.rows())?];
        let rows = checked("rows", if rows.is_empty() { &all } else { rows }, log.rows())?;
        let column = |signal: &Signal| -> Result<Vec<f64>, Error> {
            let values = &log.channel(&signal.name)?.values;
            Ok(rows.iter().flat_map(|rows| &values[rows.positions()]).copied().collect())
        };
        let outputs = if with_outputs { model.outputs() } else { &[] };
        Ok(Self {
            inputs: model.inputs().iter().map(column).collect::<Result<_, _>>()?,
            measured: outputs.iter().map(column).collect::<Result<_, _>>()?,
            rows: rows.iter().map(|rows| rows.positions().len()).sum(),
        })
    }

    pub(super) fn rows(&self) -> usize {
        self.rows
    }

    /// These and what is expected as CSV: `u1`, `u2`, …, `y1`, …, `expected1`, …; a missing value is empty.
    pub(super) fn csv(&self, name: &str, expected: &[Vec<f64>]) -> ExportedFile {
        let named = |letter: &str, columns: &[Vec<f64>]| -> Vec<String> {
            (1..=columns.len()).map(|number| format!("{letter}{number}")).collect()
        };
        let names =
            [named("u", &self.inputs), named("y", &self.measured), named("expected", expected)].concat();
        let columns: Vec<&Vec<f64>> = self.inputs.iter().chain(&self.measured).chain(expected).collect();
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
    exact: bool,
    /// How far they are off in the precision of the program, as a part of the largest.
    off: f64,
}

impl Vector {
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
        let columns = Columns::new(model, log, rows, reads_outputs)?;
        let expected = run(program, Precision::F64, &columns);
        let size = largest(expected.iter().flatten().copied());
        if !size.is_finite() {
            return Err(Error::data(
                "the run grows out of the range of numbers, and makes no test vector; name fewer rows",
            ));
        }
        let own = run(program, precision, &columns);
        let off =
            largest(expected.iter().flatten().zip(own.iter().flatten()).map(|(one, other)| one - other));
        let exact = precision == Precision::F64 && !program.calls;
        let tolerance = match precision {
            _ if exact => 0.0,
            Precision::F64 => LIBRARY * size,
            Precision::F32 => SINGLE * size,
        };
        Ok(Self { columns, expected, tolerance, exact, off: if size > 0.0 { off / size } else { 0.0 } })
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
            ("EXPECTED", &self.expected),
        ];
        all.into_iter()
            .filter(|(_, columns)| !columns.is_empty())
            .map(|(name, columns)| (name, columns.as_slice()))
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

/// What a program says of each output, row by row.
fn run(program: &Program, precision: Precision, columns: &Columns) -> Vec<Vec<f64>> {
    let rows = columns.rows();
    let mut machine = Machine::new(program, precision);
    let mut said: Vec<Vec<f64>> = Vec::new();
    for row in 0..rows {
        let now = |columns: &[Vec<f64>]| -> Vec<f64> { columns.iter().map(|column| column[row]).collect() };
        let (inputs, measured) = (now(&columns.inputs), now(&columns.measured));
        for entry in &program.entries {
            let given: Vec<&[f64]> = (entry.arguments.iter())
                .map(|Array(array)| match program.arrays.get(*array) {
                    Some(array) if array.name == "u" => inputs.as_slice(),
                    _ => measured.as_slice(),
                })
                .collect();
            let result = machine.run(entry, &given);
            if !result.is_empty() {
                said.resize(result.len(), Vec::with_capacity(rows));
                said.iter_mut().zip(result).for_each(|(said, value)| said.push(*value));
            }
        }
    }
    said
}
