//! Kinds of model, of which each takes some options.

/// Kinds of model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Kinds(u8);

impl Kinds {
    /// No kind.
    pub(super) const NONE: Self = Self(0);
    /// Polynomials, A y = B/F u + C/D e.
    pub const POLYNOMIAL: Self = Self(1);
    /// An impulse response.
    pub const IMPULSE_RESPONSE: Self = Self(1 << 1);
    /// State space.
    pub const STATE_SPACE: Self = Self(1 << 2);
    /// An ARX model with several outputs.
    pub const VECTOR_ARX: Self = Self(1 << 3);
    /// A process in continuous time.
    pub const PROCESS: Self = Self(1 << 4);
    /// A nonlinear ARX model.
    pub const NONLINEAR_ARX: Self = Self(1 << 5);
    /// A model in equations.
    pub const EQUATIONS: Self = Self(1 << 6);
    /// A process in continuous time of a measured frequency response.
    pub const RESPONSE: Self = Self(1 << 7);

    /// Each, with what asks for it.
    const ALL: [(Self, &'static str); 8] = [
        (Self::POLYNOMIAL, "models of polynomials"),
        (Self::IMPULSE_RESPONSE, "`model` fir"),
        (Self::STATE_SPACE, "`model` ss"),
        (Self::VECTOR_ARX, "`model` arx with several outputs"),
        (Self::PROCESS, "`structure` and `np`"),
        (Self::NONLINEAR_ARX, "`narx`"),
        (Self::EQUATIONS, "`grey`"),
        (Self::RESPONSE, "`from`"),
    ];

    /// These and those.
    pub(super) const fn and(self, others: Self) -> Self {
        Self(self.0 | others.0)
    }

    /// Whether all of these are among them.
    pub fn contains(self, others: Self) -> bool {
        self.0 & others.0 == others.0
    }

    /// What asks for them, as a list in words.
    pub(super) fn named(self) -> String {
        let names: Vec<&str> =
            Self::ALL.iter().filter(|(kind, _)| self.contains(*kind)).map(|(_, name)| *name).collect();
        match names.split_last() {
            Some((last, others)) if !others.is_empty() => format!("{} and {last}", others.join(", ")),
            _ => names.concat(),
        }
    }
}
