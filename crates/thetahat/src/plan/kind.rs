//! The kinds of model, of which each takes some options.

use crate::options::Kind;

impl Kind {
    /// Polynomials, A y = B/F u + C/D e.
    pub const POLYNOMIAL: Self = Self::new("models of polynomials");
    /// An impulse response.
    pub const IMPULSE_RESPONSE: Self = Self::new("`model` fir");
    /// State space.
    pub const STATE_SPACE: Self = Self::new("`model` ss");
    /// An ARX model with several outputs.
    pub const VECTOR_ARX: Self = Self::new("`model` arx with several outputs");
    /// A process in continuous time.
    pub const PROCESS: Self = Self::new("`structure` and `np`");
    /// A nonlinear ARX model.
    pub const NONLINEAR_ARX: Self = Self::new("`narx`");
    /// A model in equations.
    pub const EQUATIONS: Self = Self::new("`grey`");
    /// A process in continuous time of a measured frequency response.
    pub const RESPONSE: Self = Self::new("`from`");
}
