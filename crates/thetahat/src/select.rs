//! Which of several models to believe.

mod criteria;

pub use criteria::Criteria;
