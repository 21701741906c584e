//! The arrays that a run returns.

use core::mem;

use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PySlice;

use super::argument::out_of_memory;

/// Arrays of these shapes in one block of memory, of which they are views.
///
/// The system's allocator keeps one block for the next run. Several it hands back, and to get each of their pages anew
/// takes longer than the arithmetic (measured: 1.8 us a page, 150 ns a row of a filter with four states).
pub(crate) struct Results<'py, const K: usize> {
    block: Bound<'py, PyArray1<f64>>,
    shapes: [Vec<usize>; K],
}

/// The rows of an array that are still to be written.
pub(crate) struct Column<'a>(&'a mut [f64]);

impl Column<'_> {
    /// Writes what comes next.
    #[inline(always)]
    pub(crate) fn push(&mut self, values: &[f64]) {
        // Where their number is known as a type, it is known here too: a loop over both would not know it.
        if let Some((row, rest)) = mem::take(&mut self.0).split_at_mut_checked(values.len()) {
            row.copy_from_slice(values);
            self.0 = rest;
        }
    }

    /// The next so many places: empty at the end.
    #[inline(always)]
    pub(crate) fn next(&mut self, count: usize) -> &mut [f64] {
        let (row, rest) = mem::take(&mut self.0).split_at_mut_checked(count).unwrap_or_default();
        self.0 = rest;
        row
    }
}

impl<'py, const K: usize> Results<'py, K> {
    pub(crate) fn new(py: Python<'py>, shapes: [Vec<usize>; K]) -> PyResult<Self> {
        let total = shapes.iter().try_fold(0_usize, |total, shape| {
            let count = shape.iter().try_fold(1_usize, |count, &length| count.checked_mul(length));
            total.checked_add(count?)
        });
        // To fill it with zeros would be to write it twice.
        let block = py.import("numpy")?.call_method1("empty", (total.ok_or_else(out_of_memory)?,));
        Ok(Results { block: block.map_err(|_| out_of_memory())?.cast_into()?, shapes })
    }

    /// Calls `work` with all arrays, to be written from their first rows on to their last ones.
    pub(crate) fn write<A>(&self, work: impl FnOnce([Column<'_>; K]) -> A) -> PyResult<A> {
        let mut block = self.block.try_readwrite()?;
        let mut rest = block.as_slice_mut()?;
        let columns = self.shapes.each_ref().map(|shape| {
            let (column, others) =
                mem::take(&mut rest).split_at_mut_checked(shape.iter().product()).unwrap_or_default();
            rest = others;
            Column(column)
        });
        Ok(work(columns))
    }

    /// The arrays.
    pub(crate) fn arrays(self) -> PyResult<[Bound<'py, PyAny>; K]> {
        let py = self.block.py();
        let mut arrays = self.shapes.each_ref().map(|_| self.block.clone().into_any());
        let mut end = 0;
        for (array, shape) in arrays.iter_mut().zip(self.shapes) {
            let start = end;
            end += shape.iter().product::<usize>() as isize;
            *array = array.get_item(PySlice::new(py, start, end, 1))?.call_method1("reshape", (shape,))?;
        }
        Ok(arrays)
    }
}
