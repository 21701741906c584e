//! Documents for people: as tables of text, and as pages.
//!
//! - With the feature `tables`, [`tables`] has a function for each document, which writes it as lines of text in a
//!   [`Layout`].
//! - With the feature `html`, `fit_page`, `validation_page`, `comparison_page`, `inspection_page`, `response_page`,
//!   `step_test_page`, `transient_page` (of a `Transient`) and `tuning_page` make one file of HTML that loads nothing,
//!   with charts that can be zoomed.
//!
//! ```
//! # #[cfg(feature = "tables")] {
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
//! # }
//! # Ok::<(), thetahat::Error>(())
//! ```

#[cfg(feature = "html")]
mod pages;
#[cfg(feature = "tables")]
pub mod tables;
#[cfg(any(feature = "html", feature = "tables"))]
mod words;

#[cfg(feature = "html")]
pub use pages::{
    Transient, comparison_page, fit_page, inspection_page, response_page, step_test_page, transient_page,
    tuning_page, validation_page,
};

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
