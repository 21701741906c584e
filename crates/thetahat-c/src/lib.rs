#![cfg_attr(target_os = "none", no_std)]
//! A C interface of [`thetahat_core`]: a static library and the header `include/thetahat.h`, which cbindgen makes from
//! these sources.
//!
//! | | |
//! |---|---|
//! | `thetahat_rls` | recursive least squares |
//! | `thetahat_arx` | recursive ARX and ARMAX estimators |
//! | `thetahat_kalman` | the Kalman filter of a linear model |
//! | `thetahat_ekf` | the extended Kalman filter of functions in C |
//! | `thetahat_ukf` | the unscented Kalman filter of functions in C, without Jacobians |
//! | `thetahat_luenberger` | the observer of a linear model |
//! | `thetahat_detector` | charts that watch innovations |
//! | `thetahat_rst` | a linear controller, and pole placement for it |
//! | `thetahat_tuner` | self-tuning controllers |
//!
//! `docs/c.md` shows how it is built, linked and used.
//!
//! # Sizes
//!
//! Every object lives in memory of the caller, and has the size that its init function is given: `&thetahat_rls_4` for
//! four parameters. Such a constant refers to the code for its size, which is that of the core for `Const<4>`. So a
//! program links the sizes that it names and no others (with `--gc-sections`), runs as fast as one in Rust, and has its
//! bits.
//!
//! One code for all sizes up to a largest one, say 16, would serve four parameters with the memory and the time of
//! sixteen: recursive least squares takes 1196 bytes in place of 140, and 3174 instructions a step in place of 392, on
//! a Cortex-M4F. (Its code would be as large as that for one size; most firmware has one or two.) One that reads its
//! size at run time would need a heap, as `Dyn` does.
//!
//! # Rules of the interface
//!
//! - A pointer that is not NULL is valid for as many values as its function says, and aligned for them.
//! - Memory given to an init function belongs to the object until it is given to another, or to something else.
//! - An array that a function writes overlaps no other that it is given.
//! - One thread, or interrupt, uses an object at a time.
//!
//! Whatever can be checked is: NULL, alignment, sizes, numbers, and that a handle is that of an initialised object of
//! its kind. A call that does not answer 0 has changed nothing. Nothing allocates, panics, unwinds, or has a state of
//! its own.
//!
//! NaN is a missing sample, as in the core.

mod arx;
mod detector;
mod ekf;
mod error;
mod functions;
mod innovation;
mod kalman;
mod learning;
mod linear;
mod luenberger;
mod memory;
#[cfg(target_os = "none")]
mod panic;
mod rls;
mod rst;
mod shapes;
mod sizes;
mod tuner;
mod ukf;

pub use arx::*;
pub use detector::*;
pub use ekf::*;
pub use error::*;
pub use functions::{Function, FunctionOfState};
pub use innovation::*;
pub use kalman::*;
pub use learning::*;
pub use luenberger::*;
pub use memory::Word;
pub use rls::*;
pub use rst::*;
pub use sizes::*;
pub use tuner::*;
pub use ukf::*;

/// A number of the interface: `float`, or `double` where THETAHAT_DOUBLE is defined. It must be that of the library,
/// whose feature `double` makes it `double`.
#[cfg(not(feature = "double"))]
pub type Number = f32;
/// A number of the interface: `float`, or `double` where THETAHAT_DOUBLE is defined. It must be that of the library,
/// whose feature `double` makes it `double`.
#[cfg(feature = "double")]
pub type Number = f64;
/// The size of a number in the library: not that of a `thetahat_number` where the header and the library disagree.
#[unsafe(no_mangle)]
pub extern "C" fn thetahat_number_bytes() -> usize {
    size_of::<Number>()
}

#[cfg(test)]
mod tests;
