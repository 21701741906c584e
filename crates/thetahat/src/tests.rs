//! What tests of many modules say.

/// This many numbers that look random, in -1 … 1: a linear congruential generator (Press and others, Numerical Recipes,
/// 1992).
pub(crate) fn congruential(seed: u32, count: usize) -> Vec<f64> {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1 << 23) - 1.0
    };
    (0..count).map(|_| next()).collect()
}
