//! The Rust side of the comparison of recursive filters, driven by `filters.py`.
//!
//! `thetahat-filters write FOLDER` writes the recorded data, a JSON file for each work.
//! `thetahat-filters serve` answers each line on standard input with one line. `WORK` gives the names of the
//! filters, ours first, with tabs between them; `WORK NAME` gives the seconds that this filter took for a step,
//! and its estimate after one pass over the record.
//! `thetahat-filters potter` and `thetahat-filters endure STEPS` print what single precision does to the
//! covariance of each Kalman filter: rows of cells with tabs between them.

#[path = "../../../signals.rs"]
mod signals;

mod data;
mod kalman;
mod nalgebra_form;
mod nonlinear;
mod ours;
mod peers;
mod survival;
mod timing;

use std::error::Error;
use std::path::Path;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["write", folder] => data::write(Path::new(folder)),
        ["serve"] => timing::serve(),
        ["potter"] => {
            survival::potter();
            Ok(())
        }
        ["endure", steps] => {
            survival::endurance(steps.parse()?);
            Ok(())
        }
        _ => Err("usage: thetahat-filters write FOLDER|serve|potter|endure STEPS".into()),
    }
}
