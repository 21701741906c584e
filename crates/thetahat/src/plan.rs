//! The options of a fit as data: one table of what they are called, what they do, what they may be, and which kinds of
//! model take them.
//!
//! [`FIT_OPTIONS`] is the table; a command line, its help, the signatures and documentation of Python, the JSON Schema
//! of plans and refusals are made of it. [`FitOptions`] are the options that were given, which is a plan: it is written
//! to JSON and read back. An option has one of four [`Form`]s, its values are texts, numbers or words.
//! [`fit`](crate::fit) makes a fit of them.

mod asked;
mod kind;
mod options;
#[cfg(test)]
mod tests;
mod value;
mod words;

pub use asked::Fitted;
pub use kind::Kinds;
pub use options::{FIT_OPTIONS, FitOption, FitOptions};
pub use value::{ColumnName, DelayRange, Form, NamedValue, Word};
pub use words::{
    CoupleWord, FeedthroughWord, KernelWord, LikelihoodWord, MapWord, MethodWord, ModelWord, NormOption,
    StepOption,
};
