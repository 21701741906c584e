//! The signals that the benches measure on: noise through a lightly damped second-order system.

/// The input and the output of y(t) = 1.5 y(t-1) - 0.7 y(t-2) + u(t-1) + 0.5 u(t-2) + e(t).
///
/// u and e are uniform and white, with standard deviations 1 and 0.1. The same length gives the same values.
pub(crate) fn signals(samples: usize) -> (Vec<f64>, Vec<f64>) {
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    // Marsaglia's xorshift generator (2003); its upper 53 bits give a number in [0, 1).
    let mut white = move |deviation: f64| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        let uniform = (state >> 11) as f64 / (1_u64 << 53) as f64;
        deviation * 12.0_f64.sqrt() * (uniform - 0.5)
    };
    let input: Vec<f64> = (0..samples).map(|_| white(1.0)).collect();
    let mut output: Vec<f64> = Vec::with_capacity(samples);
    for t in 0..samples {
        let back = |signal: &[f64], lag: usize| if t < lag { 0.0 } else { signal[t - lag] };
        let plant = 1.5 * back(&output, 1) - 0.7 * back(&output, 2);
        let drive = back(&input, 1) + 0.5 * back(&input, 2);
        output.push(plant + drive + white(0.1));
    }
    (input, output)
}
