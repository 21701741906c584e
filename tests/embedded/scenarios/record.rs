//! The recorded samples: a plant of second order with one input, computed when this is compiled.

use thetahat_core::nalgebra::SVector;

use crate::{Case, STEPS};

/// Samples before the first step, so that its regressor is full.
const BEFORE: usize = 16;

/// One sample of the record.
#[derive(Clone, Copy)]
pub(crate) struct Sample {
    pub(crate) u: f32,
    pub(crate) y: f32,
}

type Record = [Sample; BEFORE + STEPS];

static TYPICAL: Record = record(Case::Typical);
static HARD: Record = record(Case::Hard);

/// y(k) = 1.5 y(k-1) - 0.7 y(k-2) + u(k-1) + 0.5 u(k-2), measured with noise.
const fn record(case: Case) -> Record {
    let mut record = [Sample { u: 0.0, y: 0.0 }; BEFORE + STEPS];
    let (mut u, mut y, mut noise) = ([0.0; 3], [0.0; 3], 1);
    let mut k = 0;
    while k < record.len() {
        let (first, rest) = match case {
            Case::Hard if k >= 250 => (0.9, -0.2),
            _ => (1.5, -0.7),
        };
        u = [random(&mut noise), u[0], u[1]];
        if let Case::Hard = case {
            u[0] = match k {
                60..160 => 0.0,
                160..200 => 1.0,
                _ => u[0],
            };
        }
        y = [first * y[0] + rest * y[1] + u[1] + 0.5 * u[2], y[0], y[1]];
        let error = match case {
            Case::Hard if k >= 60 && k < 160 => 0.0,
            _ => 0.1 * random(&mut noise),
        };
        record[k] = Sample { u: u[0], y: y[0] + error };
        if let Case::Hard = case {
            match k {
                210 | 211 | 225 => record[k].y = f32::NAN,
                230 => record[k].u = f32::NAN,
                240 => record[k].y *= 1e6,
                _ => {}
            }
        }
        k += 1;
    }
    record
}

/// Uniform in -1 … 1, exact in single precision: SplitMix64 (Steele, Lea and Flood 2014).
const fn random(state: &mut u64) -> f32 {
    *state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let mut bits = *state;
    bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^= bits >> 31;
    (bits >> 41) as f32 / (1_u32 << 22) as f32 - 1.0
}

/// The sample of step `k`, or one that is `lag` older.
pub(crate) fn sample(case: Case, k: usize, lag: usize) -> Sample {
    let record = match case {
        Case::Typical => &TYPICAL,
        Case::Hard => &HARD,
    };
    let at = (BEFORE + k).checked_sub(lag).and_then(|time| record.get(time));
    at.copied().unwrap_or(Sample { u: f32::NAN, y: f32::NAN })
}

/// The regressor of step `k` with N / 2 past outputs and as many past inputs: -y(k-1), u(k-1), -y(k-2), …
pub(crate) fn regressor<const N: usize>(case: Case, k: usize) -> SVector<f32, N> {
    let mut regressor = SVector::<f32, N>::zeros();
    for (index, entry) in regressor.as_mut_slice().iter_mut().enumerate() {
        let past = sample(case, k, 1 + index / 2);
        *entry = if index % 2 == 0 { -past.y } else { past.u };
    }
    regressor
}
