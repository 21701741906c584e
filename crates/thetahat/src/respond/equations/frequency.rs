//! The frequency response of equations near one point.
//!
//! With s = j omega, and the ways e by which an input comes in, each with its delay:
//!
//! ```text
//! G = sum_e (C (s I - A)^-1 B_e + D_e) e^(-s theta_e)
//! ```
//!
//! for sines in continuous time. Of inputs in samples of T seconds, with z = e^(j omega T) and theta_e = (m - f) T:
//!
//! ```text
//! G = sum_e (C (z I - A)^-1 (B_e + E_e (z - 1)) + D_e) z^-m (1 - f + f z)
//! ```
//!
//! with the A and B_e of samples, and E_e of inputs that go in lines ([`Linearized`]). An input some time ago is its
//! mean over the step, as in predictions and simulations.
//!
//! Source: Åström and Wittenmark, Computer-Controlled Systems, 3rd ed. 1997, sections 2.3 and 8.2.

use thetahat_core::Number;

use crate::model::equations::{Entrance, Linearized};
use crate::model::{Complex, resolved};

/// The response of an output at one frequency, in rad/s, from each of so many inputs. `held` is for how long these are
/// held, or go in lines; none for sines in continuous time. O(n^3).
pub(crate) fn response<S: Number<f64>>(
    system: &Linearized<S>,
    output: usize,
    inputs: usize,
    frequency: f64,
    held: Option<f64>,
) -> Vec<Complex<S>> {
    let n = system.a.len().isqrt();
    let outputs = system.c.len() / n.max(1);
    let point: Complex<S> = match held {
        Some(time) => Complex::turned(S::from(frequency * time)),
        None => Complex::new(0.0, frequency),
    };
    // C (point I - A)^-1.
    let seen = resolved(n, point, |i, j| system.a[i * n + j], |i| system.c[i * outputs + output]);
    let mut found = vec![Complex::new(0.0, 0.0); inputs];
    for own in &system.entrances {
        let mut sum = Complex::real(own.d[output]);
        for (row, seen) in seen.iter().enumerate() {
            let mut enters = Complex::real(own.b[row]);
            if let Some(&bend) = own.bend.get(row) {
                enters = enters.plus(point.minus(Complex::new(1.0, 0.0)).times(Complex::real(bend)));
            }
            sum = sum.plus(seen.times(enters));
        }
        found[own.input] = found[own.input].plus(sum.times(late(own, frequency, held)));
    }
    found
}

/// What a delay makes of a sine, or of its samples.
fn late<S: Number<f64>>(own: &Entrance<S>, frequency: f64, held: Option<f64>) -> Complex<S> {
    let Some(time) = held else { return Complex::turned(-(own.delay * frequency)) };
    let (samples, part) = own.late(time);
    let whole = Complex::turned(S::from(-(samples as f64) * frequency * time));
    let (one, z) = (Complex::real(-part + 1.0), Complex::turned(S::from(frequency * time)));
    whole.times(one.plus(Complex::real(part).times(z)))
}
