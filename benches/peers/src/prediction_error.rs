//! The Rust side of the comparison of searches, driven by `prediction_error.py`.
//!
//! `thetahat-prediction-error write FOLDER` writes the signals as raw numbers: the input `input.f64` and the outputs
//! `armax.f64`, `oe.f64` and `bj.f64`.
//! `thetahat-prediction-error serve FOLDER` reads them, then answers each line `METHOD N` on standard input (METHOD is
//! `armax`, `oe` or `bj`, N how many of the samples) with one line: the seconds that the fit took, its mean square
//! prediction error, and the parameters.

use std::error::Error;
use std::fs;
use std::io;
use std::path::Path;
use std::time::Instant;

use thetahat::data::Record;
use thetahat::estimate::{Initial, Method, estimate};
use thetahat::model::Orders;
use thetahat::optimize::Search;

/// Length of the signals.
const SAMPLES: usize = 1_000_000;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["write", folder] => write(Path::new(folder)),
        ["serve", folder] => serve(Path::new(folder)),
        _ => Err("usage: thetahat-prediction-error write|serve FOLDER".into()),
    }
}

/// Simulates the three structures from rest, with one input and one white noise, and writes the signals.
///
/// The input is 1 or -1 at random, the noise uniform with standard deviation 1; the same values every time.
fn write(folder: &Path) -> Result<()> {
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    // Marsaglia's xorshift generator (2003); its upper 53 bits give a number in [0, 1).
    let mut uniform = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    let input: Vec<f64> = (0..SAMPLES).map(|_| if uniform() < 0.5 { -1.0 } else { 1.0 }).collect();
    let noise: Vec<f64> = (0..SAMPLES).map(|_| 12.0_f64.sqrt() * (uniform() - 0.5)).collect();
    let poles = [1.0, -1.5, 0.7];
    let plant = filter(&[0.0, 1.0, 0.5], &poles, &input);
    let disturbances = [
        ("armax.f64", filter(&[1.0, -1.0, 0.2], &poles, &noise)),
        ("bj.f64", filter(&[1.0, 0.5, 0.2], &[1.0, -1.2, 0.5], &noise)),
        ("oe.f64", noise),
    ];
    write_numbers(&folder.join("input.f64"), &input)?;
    for (name, disturbance) in disturbances {
        let output: Vec<f64> = plant.iter().zip(&disturbance).map(|(x, v)| x + v).collect();
        write_numbers(&folder.join(name), &output)?;
    }
    Ok(())
}

/// The response from rest of a filter in powers of 1/q; the denominator begins with 1.
fn filter(numerator: &[f64], denominator: &[f64], signal: &[f64]) -> Vec<f64> {
    let mut response: Vec<f64> = Vec::with_capacity(signal.len());
    for t in 0..signal.len() {
        let sum = |weights: &[f64], of: &[f64], first: usize| -> f64 {
            (first..weights.len().min(t + 1)).map(|lag| weights[lag] * of[t - lag]).sum()
        };
        response.push(sum(numerator, signal, 0) - sum(denominator, &response, 1));
    }
    response
}

fn write_numbers(path: &Path, signal: &[f64]) -> Result<()> {
    Ok(fs::write(path, signal.iter().flat_map(|value| value.to_ne_bytes()).collect::<Vec<u8>>())?)
}

fn read_numbers(path: &Path) -> Result<Vec<f64>> {
    let bytes = fs::read(path)?;
    Ok(bytes.as_chunks().0.iter().map(|&bytes| f64::from_ne_bytes(bytes)).collect())
}

/// Answers requests until standard input ends.
fn serve(folder: &Path) -> Result<()> {
    let input = read_numbers(&folder.join("input.f64"))?;
    let structures = [
        ("armax", Orders::armax(2, &[2], 2, &[1])?),
        ("oe", Orders::oe(&[2], &[2], &[1])?),
        ("bj", Orders::bj(&[2], 2, 2, &[2], &[1])?),
    ];
    let mut served = Vec::new();
    for (name, orders) in structures {
        served.push((name, orders, read_numbers(&folder.join(name).with_extension("f64"))?));
    }
    for request in io::stdin().lines() {
        let request = request?;
        let words: Vec<&str> = request.split_whitespace().collect();
        let [method, samples] = words[..] else { return Err(format!("'{request}' is no request").into()) };
        let (_, orders, output) = served
            .iter()
            .find(|(name, ..)| *name == method)
            .ok_or(format!("there is no method '{method}'"))?;
        let samples: usize = samples.parse()?;
        let (Some(u), Some(y)) = (input.get(..samples), output.get(..samples)) else {
            return Err(format!("there are no {samples} samples").into());
        };
        let begin = Instant::now();
        let record = Record::new(y, vec![u])?;
        let estimate = estimate(&record, orders, &Method::PredictionError(Search::default()), Initial::Auto)?;
        let seconds = begin.elapsed().as_secs_f64();
        let parameters: Vec<String> = estimate.parameters().iter().map(f64::to_string).collect();
        println!("{seconds} {} {}", estimate.mse(), parameters.join(" "));
    }
    Ok(())
}
