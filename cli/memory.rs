//! How much memory the work on a log takes.

/// What reading a log and working on it takes at most for each value, in bytes, the value itself included.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum PerValue {
    /// An inspection, least squares, or a stored model.
    Plain = 64,
    /// A search, a choice among models, another criterion, or a page.
    Search = 128,
}
