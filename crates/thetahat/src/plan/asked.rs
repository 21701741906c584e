//! Which kind of model some options ask for, and whether it takes them all.

use super::fit::FitOptions;
use super::words::{MapWord, ModelWord};
use crate::Error;
use crate::options::{Kind, Options};

/// What is fitted beside options: they say the rest.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fitted {
    /// A model of a log, which has several outputs for sure where that is said.
    Log {
        /// Whether there are several outputs.
        several_outputs: bool,
    },
    /// The unknown parameters of equations that are there already.
    Equations,
    /// A model of a frequency response.
    Response,
}

/// The kind of model that is asked for, and the option that says so; none where nothing says it.
pub(crate) struct Asked {
    pub(crate) kind: Kind,
    because: Option<String>,
}

impl FitOptions {
    /// Whether the only order is that of no input.
    pub(crate) fn is_without_inputs(&self) -> bool {
        matches!(&*self.nb, [nb] if nb.last() == 0)
    }

    /// The kind of model, with every option checked against it.
    ///
    /// # Errors
    /// [`Error::Argument`] for an option that this kind of model does not take.
    pub(crate) fn kind(&self, fitted: Fitted) -> Result<Asked, Error> {
        let asked = self.asked(fitted);
        self.check_kind(asked.kind, asked.because.as_deref())?;
        Ok(asked)
    }

    fn asked(&self, fitted: Fitted) -> Asked {
        let because = |option: &str| Some(option.to_owned());
        let several_outputs = match fitted {
            Fitted::Equations => return Asked { kind: Kind::EQUATIONS, because: because("`grey`") },
            Fitted::Response if self.model == Some(ModelWord::Ss) => {
                return Asked { kind: Kind::RESPONSE_STATES, because: because("`from` with `model` ss") };
            }
            Fitted::Response => return Asked { kind: Kind::RESPONSE, because: because("`from`") },
            Fitted::Log { several_outputs } => several_outputs || self.output.len() > 1,
        };
        if self.blocks.is_some() {
            return Asked { kind: Kind::BLOCKS, because: because("`blocks`") };
        }
        if self.narx.is_some_and(|map| map != MapWord::None) {
            return Asked { kind: Kind::NONLINEAR_ARX, because: because("`narx`") };
        }
        let own = self.model.map(|model| format!("`model` {}", model.word()));
        match self.model.map(ModelWord::kind) {
            None if !self.structure.is_empty() => {
                return Asked { kind: Kind::PROCESS, because: because("`structure`") };
            }
            None if !self.np.is_empty() => return Asked { kind: Kind::PROCESS, because: because("`np`") },
            Some(kind) if kind != Kind::POLYNOMIAL => return Asked { kind, because: own },
            _ => {}
        }
        // A model without inputs is asked for as of all structures.
        let noise = self.nc.is_some() || self.nd.is_some() || !self.nf.is_empty();
        let orders = noise || self.na.is_some() || (!self.nb.is_empty() && !self.is_without_inputs());
        let several = || because("several outputs");
        match self.model {
            Some(ModelWord::Arx) if several_outputs => Asked { kind: Kind::VECTOR_ARX, because: several() },
            None if several_outputs && orders && !noise => {
                Asked { kind: Kind::VECTOR_ARX, because: several() }
            }
            None if several_outputs && !orders => Asked { kind: Kind::STATE_SPACE, because: several() },
            _ => Asked { kind: Kind::POLYNOMIAL, because: own },
        }
    }
}
