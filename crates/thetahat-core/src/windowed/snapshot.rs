//! What is written, and how it is checked when it is read back.

use nalgebra::OVector;

use super::Window;
use crate::error::{check_entries, check_length};
use crate::snapshot::{snapshot, vector};
use crate::{Dimension, Error, LeastSquares, Real, WindowedLeastSquares};

snapshot! {
    Snapshot<T, N, B> of WindowedLeastSquares<T, N, B> where [T: Real, N: Dimension, B: Dimension] {
        window: Window;
        #[serde(with = "vector")]
        stored: OVector<T, B>;
        newer: LeastSquares<T, N>;
        current: LeastSquares<T, N>;
        #[serde(with = "vector")]
        parameters: OVector<T, N>;
        older_blocks: usize;
        newer_blocks: usize;
    }
}

impl<T: Real, N: Dimension, B: Dimension> TryFrom<Snapshot<T, N, B>> for WindowedLeastSquares<T, N, B> {
    type Error = Error;

    fn try_from(read: Snapshot<T, N, B>) -> Result<Self, Error> {
        let Snapshot { version: _, window, stored, newer, current, parameters, older_blocks, newer_blocks } =
            read;
        let size = parameters.shape_generic().0;
        let empty = Self::new(size, window)?;
        check_entries("stored", stored.as_slice(), empty.stored.len())?;
        LeastSquares::<T, N>::check_packed(stored.as_slice(), window.samples())?;
        check_entries("parameters", parameters.as_slice(), size.value())?;
        for (argument, problem) in [("newer", &newer), ("current", &current)] {
            check_length(argument, size.value(), problem.rotated_output().len())?;
        }
        let blocks = older_blocks.checked_add(newer_blocks).is_some_and(|blocks| blocks <= window.blocks);
        let counted = blocks && newer.rows().checked_sub(current.rows()) == Some(newer_blocks * window.block);
        if !(counted && current.rows() < window.block) {
            return Err(Error::OutOfRange { argument: "blocks", range: "as many as the window has rows of" });
        }
        let mut windowed =
            WindowedLeastSquares { stored, newer, current, parameters, older_blocks, newer_blocks, ..empty };
        // Whether it determines them follows from its samples; the estimate may be an earlier one.
        windowed.merge();
        Ok(windowed)
    }
}
