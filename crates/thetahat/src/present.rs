//! Documents for people: as tables of text, and as pages, with the feature `present`.
//!
//! - [`tables`] has a function for each document, which writes it as lines of text in a [`Layout`].
//! - `fit_page`, `validation_page`, `comparison_page`, `inspection_page`, `response_page`, `step_test_page`,
//!   `transient_page` (of a `Transient`) and `tuning_page` make one file of HTML that loads nothing, with charts that
//!   can be zoomed.
//!
//! Both draw the same tree of sections, sentences and tables, which each kind of document makes once.
//!
//! ```
//! use thetahat::data::{Channel, Log};
//! use thetahat::model::Orders;
//! use thetahat::present::{Layout, tables};
//! use thetahat::report::{Plan, identify};
//!
//! let u: Vec<f64> = (0..200).map(|t| f64::from(t * t % 7)).collect();
//! let y = [vec![0.0], u[..199].to_vec()].concat();
//! let channel = |name: &str, values| Channel { name: name.into(), values };
//! let log = Log::new(vec![channel("u", u), channel("y", y)], 0.1)?;
//! let report = identify(log, &[], &Plan::new(&["u"], "y", Orders::arx(1, &[1], &[1])?))?;
//! let shown = tables::report(&report, Layout::default());
//! assert!(shown.lines().all(|line| line.chars().count() <= 80) && shown.contains("b1"));
//! # Ok::<(), thetahat::Error>(())
//! ```

mod charts;
mod control;
mod data;
mod design;
mod filtered;
mod fit;
mod fits;
mod html;
mod inspection;
mod kinds;
mod outputs;
mod reduction;
mod residuals;
mod response;
mod selection;
mod step_test;
mod text;
mod topics;
mod tracking;
mod tree;
mod tuning;
mod validation;
mod words;

pub use self::{
    charts::Transient,
    fit::fit_page,
    inspection::inspection_page,
    response::response_page,
    step_test::{step_test_page, transient_page},
    tuning::tuning_page,
    validation::{comparison_page, validation_page},
};

/// Documents as tables of text.
pub mod tables {
    pub use super::control::control;
    pub use super::design::{experiment_design, test_signal};
    pub use super::filtered::{filtered, noises};
    pub use super::fit::{converted, report};
    pub use super::fits::figure;
    pub use super::inspection::inspection;
    pub use super::reduction::hankel_singular_values;
    pub use super::response::response;
    pub use super::step_test::step_test;
    pub use super::text::wrapped;
    pub use super::topics::topics;
    pub use super::tracking::tracking;
    pub use super::tuning::tuning;
    pub use super::validation::{comparison, validation};
}

/// How text is laid out.
#[derive(Debug, Clone, Copy)]
pub struct Layout {
    /// No line has more columns, but for one long word.
    pub width: usize,
    /// What an argument, which messages name between backticks, is called where the text is read: `nk` is the option
    /// --nk of a command line.
    pub spelled: fn(&str) -> String,
}

impl Default for Layout {
    /// 80 columns, and arguments as they are.
    fn default() -> Self {
        Self { width: 80, spelled: str::to_owned }
    }
}
