//! The options of a fit, and which kinds of model take them: one table.
//!
//! [`FitOptions`] are the options that were given, which is a plan: it is written to JSON and read back.
//! [`fit`](crate::fit) makes a fit of them.

mod asked;
mod fit;
#[cfg(test)]
mod tests;
mod words;

pub use asked::Fitted;
pub use fit::FitOptions;
pub use words::{
    CoupleWord, CurveWord, DelayRange, FeedthroughWord, KernelWord, LikelihoodWord, MapWord, MethodWord,
    ModelWord, NormOption, OrderOption, SeasonalOption, StepOption,
};
