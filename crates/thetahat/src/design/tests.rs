//! Signals as they have to be.

mod signals;
mod worth;
