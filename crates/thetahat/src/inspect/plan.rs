use crate::data::Resample;

/// What to inspect.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct InspectionPlan {
    /// The input channels.
    pub inputs: Vec<String>,
    /// The output channel.
    pub output: Option<String>,
    /// How the log is put on another clock; none: an irregular one: every median step, rounded, by straight lines.
    pub resample: Option<Resample>,
}
