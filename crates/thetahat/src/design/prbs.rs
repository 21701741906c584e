//! Pseudo-random binary sequences of maximum length.
//!
//! A shift register of n bits whose next bit is the sum modulo 2 of some of them,
//!
//! ```text
//! a(t + n) = a(t) + sum_k a(t + k)   modulo 2,   k the other powers of a primitive polynomial x^n + … + 1,
//! ```
//!
//! goes through all 2^n - 1 states but zero before it comes back (Golomb, Shift Register Sequences, 1967; Söderström
//! and Stoica, System Identification, 1989, section 5.3). With s(t) = 1 - 2 a(t) the sum over a period of L = 2^n - 1
//! is -1, and the autocorrelation (1/L) sum_t s(t) s(t + k) is 1 for k = 0 and -1/L for every other shift: that of
//! white noise but for the mean.

use thetahat_numerics::random::mixed;

/// The shortest and the longest register.
pub(super) const ORDERS: [u32; 2] = [2, 16];

/// The powers below n of a primitive polynomial of each order, without 0 (Peterson and Weldon, Error-Correcting Codes,
/// 2nd ed. 1972, appendix C).
const POWERS: [&[u32]; 15] = [
    &[1],
    &[1],
    &[1],
    &[2],
    &[1],
    &[1],
    &[4, 3, 2],
    &[4],
    &[3],
    &[2],
    &[6, 4, 1],
    &[4, 3, 1],
    &[10, 6, 1],
    &[1],
    &[12, 3, 1],
];

/// L = 2^n - 1.
pub(super) fn length(order: u32) -> usize {
    (1 << order) - 1
}

/// The longest register of which a period has at most this many values.
pub(super) fn longest_order(values: usize) -> Option<u32> {
    (ORDERS[0]..=ORDERS[1]).rev().find(|&order| length(order) <= values)
}

/// The register of which a period has just so many values.
pub(super) fn order_of(values: usize) -> Option<u32> {
    (ORDERS[0]..=ORDERS[1]).find(|&order| length(order) == values)
}

/// One period of values 1 and -1 of a register of `order` bits, which begins where the seed says. Empty for an order
/// that there is no register of.
pub(super) fn sequence(order: u32, seed: u64) -> Vec<f64> {
    let Some(powers) = order.checked_sub(ORDERS[0]).and_then(|index| POWERS.get(index as usize)) else {
        return Vec::new();
    };
    let taps = powers.iter().fold(1_u32, |taps, power| taps | 1 << power);
    let states = length(order) as u64;
    let mut state = (1 + mixed(seed) % states) as u32;
    let next = |_| {
        let bit = state & 1;
        let sum = (state & taps).count_ones() & 1;
        state = state >> 1 | sum << (order - 1);
        1.0 - 2.0 * f64::from(bit)
    };
    (0..states).map(next).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sum_is_minus_one_and_the_autocorrelation_one_or_minus_one_over_the_length() {
        for order in ORDERS[0]..=ORDERS[1] {
            let values = sequence(order, u64::from(order));
            let length = values.len();
            assert_eq!((length, values.iter().sum::<f64>()), ((1 << order) - 1, -1.0), "{order}");
            // Sums of ones are exact. Of long sequences every shift up to 100, and some of the others.
            let shifts = (0..length).filter(|shift| order <= 11 || *shift <= 100 || shift % 997 == 0);
            for shift in shifts {
                let (head, tail) = values.split_at(shift);
                let sum: f64 = tail.iter().chain(head).zip(&values).map(|(one, other)| one * other).sum();
                assert_eq!(sum, if shift == 0 { length as f64 } else { -1.0 }, "{order}, {shift}");
            }
        }
    }

    #[test]
    fn all_states_but_zero_are_passed_before_the_first_comes_back() {
        // n values in a row are a state: none comes twice.
        for order in ORDERS[0]..=ORDERS[1] {
            let values = sequence(order, 0);
            let mut seen = vec![false; 1 << order];
            for first in 0..values.len() {
                let bit = |k: usize| usize::from(values[(first + k) % values.len()] < 0.0) << k;
                let state: usize = (0..order as usize).map(bit).sum();
                assert!(state > 0 && !std::mem::replace(&mut seen[state], true), "{order}, {first}");
            }
        }
    }

    #[test]
    fn a_seed_begins_elsewhere_in_the_same_sequence() {
        let (one, other) = (sequence(7, 0), sequence(7, 1));
        let shifted = |shift: usize| [&one[shift..], &one[..shift]].concat() == other;
        assert_ne!(one, other);
        assert_eq!((0..127).filter(|shift| shifted(*shift)).count(), 1);
        assert!(sequence(1, 0).is_empty() && sequence(17, 0).is_empty());
    }
}
