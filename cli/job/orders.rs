use thetahat::Orders;

use crate::args::{ModelArgument, ModelArguments};
use crate::failure::Failure;

/// The orders of a model as they were given: one value for each input, or one for all.
#[derive(Debug)]
pub(crate) struct OrderJob {
    na: usize,
    nb: Vec<usize>,
    nc: usize,
    nd: usize,
    nf: Vec<usize>,
    nk: Vec<usize>,
}

impl ModelArgument {
    /// The word that stands for it, and the orders that it has.
    fn shape(self) -> (&'static str, &'static [&'static str]) {
        match self {
            Self::Arx => ("arx", &["--na", "--nb"]),
            Self::Armax => ("armax", &["--na", "--nb", "--nc"]),
            Self::Arma => ("arma", &["--na", "--nc"]),
            Self::Ar => ("ar", &["--na"]),
            Self::Oe => ("oe", &["--nb", "--nf"]),
            Self::Bj => ("bj", &["--nb", "--nc", "--nd", "--nf"]),
            Self::Pem => ("pem", &["--na", "--nb", "--nc", "--nd", "--nf"]),
        }
    }
}

impl OrderJob {
    pub(super) fn resolve(arguments: &ModelArguments) -> Result<Self, Failure> {
        let ModelArguments { na, nb, nc, nd, nf, nk, model, .. } = arguments;
        let (name, has) = model.shape();
        let given = [
            ("--na", na.is_some()),
            ("--nb", !nb.is_empty()),
            ("--nc", nc.is_some()),
            ("--nd", nd.is_some()),
            ("--nf", !nf.is_empty()),
        ];
        let wrong =
            |what: String| Err(Failure::usage(format!("--model {name} {what}; give {}", has.join(" "))));
        if let Some((order, _)) = given.iter().find(|(order, given)| *given && !has.contains(order)) {
            return wrong(format!("does not take {order}"));
        }
        if !nk.is_empty() && !has.contains(&"--nb") {
            return wrong("does not take --nk, as it has no inputs".to_owned());
        }
        // Of a general model, what is not given is not there.
        let missing: Vec<&str> = given
            .iter()
            .filter(|(order, given)| !given && has.contains(order))
            .map(|(order, _)| *order)
            .collect();
        if *model != ModelArgument::Pem && !missing.is_empty() {
            return wrong(format!("needs {}", missing.join(", ")));
        }
        let job = Self {
            na: na.unwrap_or(0),
            nb: nb.clone(),
            nc: nc.unwrap_or(0),
            nd: nd.unwrap_or(0),
            nf: if nf.is_empty() { vec![0] } else { nf.clone() },
            nk: if nk.is_empty() { vec![1] } else { nk.clone() },
        };
        if !job.has_inputs() {
            if job.is_filtered() {
                return Err(Failure::usage(
                    "--nf: F is the denominator from an input, and there is none; give an --nb above 0",
                ));
            }
            job.of(0)?;
        }
        Ok(job)
    }

    /// Whether the model has inputs at all.
    pub(crate) fn has_inputs(&self) -> bool {
        self.nb.iter().any(|&nb| nb > 0)
    }

    /// Whether there is an F.
    pub(crate) fn is_filtered(&self) -> bool {
        self.nf.iter().any(|&nf| nf > 0)
    }

    /// Whether there are B and F, and nothing else.
    pub(crate) fn is_output_error(&self) -> bool {
        self.is_filtered() && self.na + self.nc + self.nd == 0
    }

    /// Whether the predictor is linear in the parameters: C = D = F = 1.
    pub(crate) fn is_linear(&self) -> bool {
        self.nc == 0 && self.nd == 0 && !self.is_filtered()
    }

    /// The orders for so many inputs: one value stands for all of them.
    pub(crate) fn of(&self, inputs: usize) -> Result<Orders, Failure> {
        let each = |argument: &str, values: &[usize]| match values {
            [one] => Ok(vec![*one; inputs]),
            several if several.len() == inputs || inputs == 0 => {
                Ok(several.iter().copied().take(inputs).collect())
            }
            several => Err(Failure::usage(format!(
                "{argument} has {} values for {inputs} input{}; give one for each, or one for all",
                several.len(),
                if inputs == 1 { "" } else { "s" }
            ))),
        };
        let (nb, nf, nk) = (each("--nb", &self.nb)?, each("--nf", &self.nf)?, each("--nk", &self.nk)?);
        Orders::new(self.na, &nb, self.nc, self.nd, &nf, &nk).map_err(|error| Failure::option(&error))
    }
}
