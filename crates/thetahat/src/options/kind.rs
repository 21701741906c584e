/// A kind of what is done, such as a kind of model or a method, which takes some options and not others: what asks for
/// it, in words.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Kind(&'static str);

impl Kind {
    /// What asks for it; options are named between backticks.
    pub(crate) const fn new(asked_by: &'static str) -> Self {
        Self(asked_by)
    }

    /// What asks for some, as a list in words.
    pub(super) fn list(kinds: &[Self]) -> String {
        let names: Vec<&str> = kinds.iter().map(|kind| kind.0).collect();
        match names.split_last() {
            Some((last, others)) if !others.is_empty() => format!("{} and {last}", others.join(", ")),
            _ => names.concat(),
        }
    }
}
