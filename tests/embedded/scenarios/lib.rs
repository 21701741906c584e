#![no_std]
#![forbid(unsafe_code)]
//! Every estimator of thetahat-core, set up and fed with recorded samples: the same code for the host and the
//! firmware.
//!
//! To add an estimator, implement [`Scenario`] for it in a file of this folder, name it in [`visit_all`], and
//! give it a row in `budgets.md`. Leave out what needs ln, sin or cos: their last bit differs
//! between the host's library and the firmware's. (The exponential of [`Radial`] and [`Local`] is the same on both,
//! and so is the hyperbolic tangent of [`Network`].)

mod attitude;
mod control;
mod detect;
mod kalman;
mod late;
mod least_squares;
mod nonlinear;
mod record;
mod recursive;

use core::fmt;

pub use attitude::{Attitude, FIELD, GRAVITY, Gyroscope, Sensors};
use thetahat_core::{Error, Local, Neighbours, Network, Polynomial, Radial, Spline};

/// How often an estimator is stepped in each [`Case`].
pub const STEPS: usize = 300;

/// What the estimator is fed with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Case {
    /// A plant that is well excited.
    Typical,
    /// Silence, a held input, another plant, missing and badly scaled samples: what takes a step out of its
    /// way.
    Hard,
}

/// One estimator, with all that it keeps in memory from step to step.
pub trait Scenario: Sized {
    /// The name of its row in the table.
    const NAME: &'static str;
    /// Whether the hard case makes a step go a longer way, so that the worst step must cost more than the
    /// typical one.
    const DETOUR: bool = false;
    /// What one step takes.
    type Input;
    /// What one step answers.
    type Output;

    /// The estimator before its first step.
    fn start(case: Case) -> Result<Self, Error>;

    /// What step `k` takes.
    fn input(case: Case, k: usize) -> Self::Input;

    /// The step that is measured: implement it `#[inline(never)]`.
    fn step(&mut self, input: &Self::Input) -> Result<Self::Output, Error>;

    /// Passes on all numbers of the answer and of the estimator that can be read.
    fn numbers(&self, output: &Self::Output, number: &mut impl FnMut(f32));
}

/// Something to do with every scenario.
pub trait Visitor {
    /// Does it with one.
    fn visit<S: Scenario>(&mut self);
}

/// Does it with every scenario, in the order of the table.
pub fn visit_all(visitor: &mut impl Visitor) {
    visitor.visit::<least_squares::Lines>();
    visitor.visit::<least_squares::Rows>();
    visitor.visit::<least_squares::Windowed>();
    visitor.visit::<recursive::Recursive<4>>();
    visitor.visit::<recursive::Recursive<8>>();
    visitor.visit::<recursive::Recursive<16>>();
    visitor.visit::<recursive::Arx>();
    visitor.visit::<recursive::VectorArx>();
    visitor.visit::<recursive::Armax>();
    visitor.visit::<recursive::OutputError>();
    visitor.visit::<nonlinear::Narx>();
    visitor.visit::<nonlinear::Stored<Polynomial<'static>>>();
    visitor.visit::<nonlinear::Stored<Radial<'static, f32>>>();
    visitor.visit::<nonlinear::Stored<Network<'static, f32>>>();
    visitor.visit::<nonlinear::Stored<Spline<'static, f32>>>();
    visitor.visit::<nonlinear::Stored<Local<'static, f32>>>();
    visitor.visit::<nonlinear::Stored<Neighbours<'static, f32>>>();
    visitor.visit::<detect::Detector>();
    visitor.visit::<kalman::Kalman<2, 1>>();
    visitor.visit::<kalman::Kalman<4, 2>>();
    visitor.visit::<kalman::Kalman<6, 3>>();
    visitor.visit::<kalman::Extended>();
    visitor.visit::<kalman::Unscented>();
    visitor.visit::<Attitude>();
    visitor.visit::<kalman::Set>();
    visitor.visit::<late::Late>();
    visitor.visit::<kalman::Observer>();
    visitor.visit::<control::Placed>();
    visitor.visit::<control::Tuned>();
    visitor.visit::<control::Direct>();
}

/// Plays both cases of one scenario: `step` gets the case, the number of the step, the scenario and what its
/// step takes, and is to call [`Scenario::step`].
pub fn play<S: Scenario>(mut step: impl FnMut(Case, usize, &mut S, &S::Input)) -> Result<(), Error> {
    for case in [Case::Typical, Case::Hard] {
        let mut scenario = S::start(case)?;
        for k in 0..STEPS {
            step(case, k, &mut scenario, &S::input(case, k));
        }
    }
    Ok(())
}

/// Writes one line: where it comes from, and the bits of every number after this step, or the error.
pub fn write_bits<S: Scenario>(
    into: &mut impl fmt::Write,
    (case, k): (Case, usize),
    scenario: &S,
    outcome: &Result<S::Output, Error>,
) -> fmt::Result {
    write!(into, "bits;{};{case:?};{k};", S::NAME)?;
    let mut result = Ok(());
    match outcome {
        Ok(output) => scenario.numbers(output, &mut |number| {
            // The bits of a NaN are the processor's choice.
            let bits = if number.is_nan() { f32::NAN.to_bits() } else { number.to_bits() };
            result = result.and_then(|()| write!(into, " {bits:08x}"));
        }),
        Err(error) => write!(into, " {error:?}")?,
    }
    result.and_then(|()| writeln!(into))
}
