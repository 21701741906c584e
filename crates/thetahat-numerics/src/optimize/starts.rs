//! Several starts.

use oorandom::Rand64;

use super::outcome::Found;

/// A number that is close enough to a standard normal one for a start: the sum of twelve uniform ones.
pub fn normal_number(random: &mut Rand64) -> f64 {
    (0..12).map(|_| random.rand_float()).sum::<f64>() - 6.0
}

/// Which search found the lowest cost, the first of them where several did. None where there is none.
pub fn lowest<'f>(found: impl IntoIterator<Item = Option<&'f Found>>) -> Option<usize> {
    let mut best: Option<(usize, f64)> = None;
    for (number, found) in found.into_iter().enumerate() {
        if let Some(found) = found
            && best.is_none_or(|(_, cost)| found.cost() < cost)
        {
            best = Some((number, found.cost()));
        }
    }
    best.map(|(number, _)| number)
}
