//! Logs of linear systems and static curves that follow one another.

use std::fmt::Write;

use super::Random;

/// A first-order lag of so many samples, of a gain of 1.
fn lag(level: f64, input: f64, samples: f64) -> f64 {
    let pole = (-1.0 / samples).exp();
    pole * level + (1.0 - pole) * input
}

/// A valve that opens at 20 % of its stroke, as a root; lags of 20 and 5 s, and 3 s until anything happens: time [s],
/// stroke [%], flow.
fn valve() -> String {
    let mut random = Random(31);
    let (mut slow, mut flow, mut strokes) = (0.0, 0.0, vec![50.0; 3]);
    let mut csv = String::from("t,valve,flow\n");
    for k in 0..3000 {
        let before = strokes[strokes.len() - 1];
        let stroke = if random.uniform() < 1.0 / 30.0 { (100.0 * random.uniform()).round() } else { before };
        // Writing to a string cannot fail.
        let _ = writeln!(csv, "{k},{stroke},{:.3}", flow + 0.2 * random.normal());
        strokes.push(stroke);
        let open = 30.0 * ((strokes[strokes.len() - 3] - 20.0_f64).max(0.0) / 80.0).sqrt();
        flow = lag(flow, slow, 5.0);
        slow = lag(slow, open, 20.0);
    }
    csv
}

/// A sensor that saturates, 2 tanh(x/1.5), behind lags of 15 and 4 samples: time [s], drive, reading.
fn sensor() -> String {
    let mut random = Random(37);
    let (mut slow, mut level, mut drive) = (0.0, 0.0, 0.0);
    let mut csv = String::from("t,drive,reading\n");
    for k in 0..3000 {
        if random.uniform() < 1.0 / 25.0 {
            drive = (60.0 * random.uniform() - 30.0).round() / 10.0;
        }
        let reading = 2.0 * (level / 1.5_f64).tanh() + 0.02 * random.normal();
        let _ = writeln!(csv, "{:.1},{drive},{reading:.4}", 0.1 * f64::from(k));
        level = lag(level, slow, 4.0);
        slow = lag(slow, drive, 15.0);
    }
    csv
}

/// An amplifier between two filters: a pole of 0.7, then a gain of 1 up to 0.5 and of 0.1 beyond, then (0.15 q^-1 + 0.1
/// q^-2)/(1 - 1.3 q^-1 + 0.55 q^-2): input and output [V], 1000 a second.
fn amplifier() -> String {
    let mut random = Random(41);
    let (mut input, mut first) = (0.0, 0.0);
    let (mut y, mut w) = ([0.0; 2], [0.0; 2]);
    let mut csv = String::from("t,input,output\n");
    for k in 0..4000 {
        input = 0.7 * input + random.normal();
        let bent = if first < 0.5 { first } else { 0.5 + 0.1 * (first - 0.5) };
        let output = 1.3 * y[0] - 0.55 * y[1] + 0.15 * w[0] + 0.1 * w[1];
        let measured = output + 0.005 * random.normal();
        let _ = writeln!(csv, "{:.3},{input:.5},{measured:.5}", 1e-3 * f64::from(k));
        (y, w) = ([output, y[0]], [bent, w[0]]);
        first = 0.7 * first + 0.3 * (format!("{input:.5}").parse().unwrap_or(input));
    }
    csv
}

/// A mass of 1 kg on a spring that stiffens, 40 x + 400 x^3 [N], with a damper of 1 N s/m: time [s], force [N],
/// position [m].
fn spring() -> String {
    let mut random = Random(43);
    let (mut position, mut velocity, mut force) = (0.0, 0.0, 0.0);
    let mut csv = String::from("t,force,position\n");
    for k in 0..3000 {
        force = 0.8 * force + 6.0 * random.normal();
        let held = (100.0 * force).round() / 100.0;
        let _ = writeln!(csv, "{:.2},{held},{:.5}", 0.02 * f64::from(k), position + 5e-4 * random.normal());
        for _ in 0..40 {
            velocity += 5e-4 * (held - 40.0 * position - 400.0 * position.powi(3) - velocity);
            position += 5e-4 * velocity;
        }
    }
    csv
}

/// All of them, by their files.
pub(super) fn logs() -> Vec<(&'static str, String)> {
    vec![("valve", valve()), ("sensor", sensor()), ("amplifier", amplifier()), ("spring", spring())]
}
