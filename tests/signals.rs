//! Logs of our own: a small random generator, the difference equation, and CSV.

use std::fmt::Write;

/// Uniform random numbers: xorshift (Marsaglia 2003).
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        let mut random = Self(seed.wrapping_mul(0x9E37_79B9_7F4A_7C15) | 1);
        // Away from a seed of few bits.
        random.signal(20);
        random
    }

    pub(crate) fn bits(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    /// A whole number below `limit`.
    pub(crate) fn below(&mut self, limit: usize) -> usize {
        (self.bits() >> 11) as usize % limit
    }

    /// A number in [-1, 1).
    pub(crate) fn uniform(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    pub(crate) fn signal(&mut self, samples: usize) -> Vec<f64> {
        (0..samples).map(|_| self.uniform()).collect()
    }
}

/// The y of A(q) y(t) = sum_j B_j(q) u_j(t) + e(t), with zeros before the first sample.
///
/// `inputs` holds each B, from q^0 on, with its u. A is monic.
pub(crate) fn response(a: &[f64], inputs: &[(&[f64], &[f64])], e: &[f64]) -> Vec<f64> {
    let mut y: Vec<f64> = Vec::with_capacity(e.len());
    for t in 0..e.len() {
        let past = a.iter().enumerate().skip(1).filter(|(lag, _)| *lag <= t).map(|(lag, a)| -a * y[t - lag]);
        let driven = inputs.iter().flat_map(|(b, u)| {
            b.iter().enumerate().filter(|(lag, _)| *lag <= t).map(|(lag, b)| b * u[t - lag])
        });
        y.push(e[t] + past.sum::<f64>() + driven.sum::<f64>());
    }
    y
}

/// The polynomials of A(q) y(t) = sum_j B_j(q)/F_j(q) u_j(t) + C(q)/D(q) e(t), from q^0 on; all but B are monic.
#[derive(Clone)]
pub(crate) struct Polynomials {
    pub(crate) a: Vec<f64>,
    pub(crate) b: Vec<Vec<f64>>,
    pub(crate) c: Vec<f64>,
    pub(crate) d: Vec<f64>,
    pub(crate) f: Vec<Vec<f64>>,
}

impl Polynomials {
    /// With one input. What is empty is 1.
    pub(crate) fn new(a: &[f64], b: &[f64], c: &[f64], d: &[f64], f: &[f64]) -> Self {
        let monic = |after: &[f64]| [&[1.0], after].concat();
        Self { a: monic(a), b: vec![b.to_vec()], c: monic(c), d: monic(d), f: vec![monic(f)] }
    }

    /// sum_j B_j/F_j u_j.
    fn driven(&self, inputs: &[&[f64]]) -> Vec<f64> {
        let mut sum = vec![0.0; inputs[0].len()];
        for ((b, f), u) in self.b.iter().zip(&self.f).zip(inputs) {
            let x = response(f, &[(b, u)], &vec![0.0; u.len()]);
            sum.iter_mut().zip(x).for_each(|(sum, x)| *sum += x);
        }
        sum
    }

    /// y, from rest.
    pub(crate) fn outputs(&self, inputs: &[&[f64]], e: &[f64]) -> Vec<f64> {
        let silence = vec![0.0; e.len()];
        let noise = response(&self.d, &[(&self.c, e)], &silence);
        let sum: Vec<f64> = self.driven(inputs).iter().zip(noise).map(|(x, v)| x + v).collect();
        response(&self.a, &[], &sum)
    }

    /// The e that gives this y, with zeros before the first sample: D/C (A y - sum_j B_j/F_j u_j).
    pub(crate) fn errors(&self, inputs: &[&[f64]], y: &[f64]) -> Vec<f64> {
        let silence = vec![0.0; y.len()];
        let weighted = response(&[1.0], &[(&self.a, y)], &silence);
        let w: Vec<f64> = weighted.iter().zip(self.driven(inputs)).map(|(w, x)| w - x).collect();
        response(&self.c, &[(&self.d, &w)], &silence)
    }
}

/// An experiment on a stable system with one input, na = nb = 2, nk = 1, around u = 5 and y = 20, with noise.
pub(crate) struct Experiment {
    pub(crate) u: Vec<f64>,
    pub(crate) y: Vec<f64>,
}

impl Experiment {
    pub(crate) const A: [f64; 3] = [1.0, -1.2, 0.5];
    pub(crate) const B: [f64; 3] = [0.0, 1.0, 0.4];

    pub(crate) fn new(samples: usize) -> Self {
        let mut random = Random::new(7);
        let u = random.signal(samples);
        let e: Vec<f64> = random.signal(samples).iter().map(|e| 0.1 * e).collect();
        let y = response(&Self::A, &[(&Self::B, &u)], &e);
        Self { u: u.iter().map(|u| 5.0 + u).collect(), y: y.iter().map(|y| 20.0 + y).collect() }
    }

    /// As CSV, columns u and y.
    pub(crate) fn csv(&self) -> String {
        csv(&[("u", &self.u), ("y", &self.y)])
    }

    /// As CSV, with a column of times in front.
    pub(crate) fn timed(&self, times: &[f64]) -> String {
        csv(&[("time", times), ("u", &self.u), ("y", &self.y)])
    }
}

/// The plain log of most tests: 200 rows of u and y.
pub(crate) fn plain_log() -> String {
    Experiment::new(200).csv()
}

/// Columns as CSV, every number with all its digits; NaN is an empty field.
pub(crate) fn csv(columns: &[(&str, &[f64])]) -> String {
    let names: Vec<&str> = columns.iter().map(|(name, _)| *name).collect();
    let mut text = names.join(",") + "\n";
    for row in 0..columns[0].1.len() {
        for (position, (_, values)) in columns.iter().enumerate() {
            let comma = if position == 0 { "" } else { "," };
            // Writing to a string cannot fail.
            let _ = if values[row].is_nan() {
                write!(text, "{comma}")
            } else {
                write!(text, "{comma}{}", values[row])
            };
        }
        text.push('\n');
    }
    text
}
