//! The Rust side of the comparison, driven by `compare.py`.
//!
//! `thetahat-peers write FOLDER` writes the signals: `u.f64` and `y.f64` (raw numbers) and `log.csv`. `thetahat-peers
//! serve FOLDER` reads them, then answers each line `METHOD NA NB NK` on standard input with one line: the seconds that
//! the method took, and the parameters. `grid NA NB NK` compares all models up to these orders on the first tenth of
//! the signals, then fits the chosen one: the answer holds its orders and mean square error instead. `largest` fits the
//! largest of them to the same samples.

#[path = "../../signals.rs"]
mod signals;

use std::error::Error;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::Path;
use std::time::Instant;

use faer::Mat;
use faer::prelude::SolveLstsq;
use thetahat::data::Record;
use thetahat::estimate::{Estimate, Initial, arx, arx_factor};
use thetahat::model::Orders;
use thetahat::select::{Choice, Grid, OrderRange, Path as Walk, Select, choose_orders};

/// Rows of the log.
const SAMPLES: usize = 1_000_000;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["write", folder] => write(Path::new(folder)),
        ["serve", folder] => serve(Path::new(folder)),
        _ => Err("usage: thetahat-peers write|serve FOLDER".into()),
    }
}

/// Writes the signals as raw numbers and as the log of `numpy.savetxt`.
fn write(folder: &Path) -> Result<()> {
    let (input, output) = signals::signals(SAMPLES);
    for (name, signal) in [("u.f64", &input), ("y.f64", &output)] {
        fs::write(
            folder.join(name),
            signal.iter().flat_map(|value| value.to_ne_bytes()).collect::<Vec<u8>>(),
        )?;
    }
    let mut log = BufWriter::new(File::create(folder.join("log.csv"))?);
    writeln!(log, "u,y")?;
    for (u, y) in input.iter().zip(&output) {
        writeln!(log, "{},{}", scientific(*u)?, scientific(*y)?)?;
    }
    Ok(log.flush()?)
}

/// A number as C's `%.18e` writes it: with the sign of the exponent, and two digits of it.
fn scientific(value: f64) -> Result<String> {
    let text = format!("{value:.18e}");
    let (digits, exponent) = text.split_once('e').ok_or("a number without an exponent")?;
    let exponent: i32 = exponent.parse()?;
    Ok(format!("{digits}e{exponent:+03}"))
}

/// Answers requests until standard input ends.
fn serve(folder: &Path) -> Result<()> {
    let read = |name: &str| -> Result<Vec<f64>> {
        let bytes = fs::read(folder.join(name))?;
        Ok(bytes.as_chunks().0.iter().map(|&bytes| f64::from_ne_bytes(bytes)).collect())
    };
    let (input, output) = (read("u.f64")?, read("y.f64")?);
    for request in io::stdin().lines() {
        let request = request?;
        let words: Vec<&str> = request.split_whitespace().collect();
        let [method, na, nb, nk] = words[..] else { return Err(format!("'{request}' is no request").into()) };
        let (na, nb, nk) = (na.parse()?, nb.parse()?, nk.parse()?);
        let part = ..output.len() / 10;
        let begin = Instant::now();
        let parameters = match method {
            "arx" => gram(&input, &output, &Orders::arx(na, &[nb], &[nk])?)?,
            "factor" => factor(&input, &output, &Orders::arx(na, &[nb], &[nk])?)?,
            "grid" => grid(&input[part], &output[part], [na, nb, nk])?,
            "largest" => gram(&input[part], &output[part], &Orders::arx(na, &[nb], &[nk])?)?,
            "faer" => faer_qr(&input, &output, [na, nb, nk]),
            _ => return Err(format!("there is no method '{method}'").into()),
        };
        let seconds = begin.elapsed().as_secs_f64();
        let parameters: Vec<String> = parameters.iter().map(f64::to_string).collect();
        println!("{seconds} {}", parameters.join(" "));
    }
    Ok(())
}

/// The estimate through the Gram matrix.
fn gram(input: &[f64], output: &[f64], orders: &Orders) -> Result<Vec<f64>> {
    Ok(arx(&Record::new(output, vec![input])?, orders, Initial::Drop)?.parameters().to_vec())
}

/// The best of all models with 1 to `na`, 1 to `nb`, 1 to `nk`, fitted: its orders, and its mean square error on the
/// samples that all of them have.
fn grid(input: &[f64], output: &[f64], [na, nb, nk]: [usize; 3]) -> Result<Vec<f64>> {
    let up_to = |last| OrderRange::new(1, last);
    let grid = Grid {
        na: up_to(na)?,
        nb: vec![up_to(nb)?],
        nc: 0.into(),
        nd: 0.into(),
        nf: vec![0.into()],
        nk: vec![up_to(nk)?],
        path: Walk::All,
    };
    let record = Record::new(output, vec![input])?;
    let chosen = choose_orders(&record, None, &Choice::Grid(grid), Select::MDL)?.chosen;
    arx(&record, &chosen.orders, Initial::Drop)?;
    let orders = [chosen.orders.na, chosen.orders.nb[0], chosen.orders.nk[0]];
    Ok(orders.iter().map(|&order| order as f64).chain([chosen.mse]).collect())
}

/// The estimate through a triangular factor.
fn factor(input: &[f64], output: &[f64], orders: &Orders) -> Result<Vec<f64>> {
    let factor = arx_factor(&Record::new(output, vec![input])?, orders, Initial::Drop)?;
    Ok(Estimate::from_factor(&factor, orders)?.parameters().to_vec())
}

/// The estimate through faer's QR of the whole regressor matrix.
fn faer_qr(input: &[f64], output: &[f64], [na, nb, nk]: [usize; 3]) -> Vec<f64> {
    let first = na.max(nb + nk - 1);
    let rows = output.len() - first;
    let regressors = Mat::from_fn(rows, na + nb, |row, column| {
        let t = first + row;
        if column < na { -output[t - 1 - column] } else { input[t - nk - (column - na)] }
    });
    let target = Mat::from_fn(rows, 1, |row, _| output[first + row]);
    regressors.qr().solve_lstsq(&target).col_as_slice(0).to_vec()
}
