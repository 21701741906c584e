//! Which values a model was fitted to.

use std::collections::BTreeMap;
use std::ops::Range;

use rayon::prelude::*;
use twox_hash::XxHash3_128;

use super::{Log, Rows};
use crate::Error;

/// Values that are hashed together.
const BLOCK: usize = 512;

/// For each log of which this one is made, the digests of some channels in the rows that lie in it; empty for a log
/// without such a row.
///
/// # Errors
/// [`Error::Data`] for a channel that is not there.
pub(crate) fn digests(
    log: &Log,
    names: &[&str],
    rows: &[Rows],
) -> Result<Vec<BTreeMap<String, String>>, Error> {
    let of_part = |part: Range<usize>| {
        let inside = inside(rows, &part);
        let of =
            |name: &&str| Ok(((*name).to_owned(), digest(&log.channel(name)?.values[part.clone()], &inside)));
        if inside.is_empty() { Ok(BTreeMap::new()) } else { names.par_iter().map(of).collect() }
    };
    log.logs().map(of_part).collect()
}

/// The rows that lie in a part of a log, counted from the part's first one.
pub(crate) fn inside(rows: &[Rows], part: &Range<usize>) -> Vec<Range<usize>> {
    let each = rows.iter().map(Rows::positions).filter_map(|rows| {
        let (first, end) = (rows.start.max(part.start), rows.end.min(part.end));
        (first < end).then(|| first - part.start..end - part.start)
    });
    each.collect()
}

/// A digest of some rows of a signal, and of where they stand in it: 32 hexadecimal digits of XXH3. Two signals have
/// the same one if they have the same values there, bit for bit; that others share it has a probability of 1e-38.
pub(crate) fn digest(values: &[f64], rows: &[Range<usize>]) -> String {
    let mut hasher = XxHash3_128::new();
    let places = rows.iter().flat_map(|rows| [rows.start, rows.end]);
    places.for_each(|place| hasher.write(&(place as u64).to_le_bytes()));
    rows.iter().for_each(|rows| write(&mut hasher, &values[rows.clone()]));
    format!("{:032x}", hasher.finish_128())
}

/// A digest of a text: 32 hexadecimal digits of XXH3.
pub(crate) fn text_digest(text: &str) -> String {
    format!("{:032x}", XxHash3_128::oneshot(text.as_bytes()))
}

/// The bits of some values; all that are not numbers are the same.
fn write(hasher: &mut XxHash3_128, values: &[f64]) {
    let mut bytes = [0; 8 * BLOCK];
    for block in values.chunks(BLOCK) {
        for (bytes, value) in bytes.as_chunks_mut::<8>().0.iter_mut().zip(block) {
            let value = if value.is_nan() { f64::NAN } else { *value };
            *bytes = value.to_bits().to_le_bytes();
        }
        hasher.write(&bytes[..8 * block.len()]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::channel;

    #[test]
    fn a_digest_is_that_of_the_rows_whatever_stands_around_them() -> Result<(), Error> {
        let log = |y: Vec<f64>| {
            let u = vec![1.0; y.len()];
            Log::new(vec![channel("u", u), channel("y", y)], 1.0)
        };
        let rows = ["2..3".parse()?];
        let of = |log: &Log| digests(log, &["u", "y"], &rows);
        let first = log(vec![1.0, 2.0, f64::NAN, 4.0])?;
        let known = of(&first)?;
        assert_eq!(known[0]["y"].len(), 32);
        assert_eq!(of(&log(vec![9.0, 2.0, -f64::NAN, 9.0, 9.0])?)?, known);
        let other = of(&log(vec![1.0, 2.0, 3.0, 4.0])?)?;
        assert!(other[0]["u"] == known[0]["u"] && other[0]["y"] != known[0]["y"]);
        assert_ne!(digests(&first, &["y"], &["2..4".parse()?])?[0]["y"], known[0]["y"]);
        // Of several logs each has its own; the rows count from its own first one.
        let joined = Log::join(vec![log(vec![0.0; 4])?, first])?;
        let both = digests(&joined, &["u", "y"], &["6..7".parse()?])?;
        assert_eq!(both, [BTreeMap::new(), known[0].clone()]);
        Ok(())
    }
}
