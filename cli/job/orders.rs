use thetahat::model::{Orders, Structure};
use thetahat::select::{Automatic, Choice, Grid, OrderRange, Path};

use super::parsed;
use crate::args::{ModelArgument, ModelArguments, PathArgument};
use crate::failure::Failure;

/// The orders of a model as they were given: values or ranges, one for each input or one for all; or none.
#[derive(Debug)]
pub(crate) enum OrderJob {
    /// Values or ranges.
    Given(Grid),
    /// The data choose.
    Open { structure: Option<Structure>, inputs: bool, nk: Vec<usize>, linear: bool },
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
            Self::General => ("general", &["--na", "--nb", "--nc", "--nd", "--nf"]),
            Self::Fir => ("fir", &["--taps"]),
            Self::Process => ("process", &["--structure"]),
            Self::Tf => ("tf", &["--np"]),
            Self::Ss => ("ss", &["--order"]),
        }
    }

    /// The structure of which orders are chosen.
    fn structure(self) -> Result<Structure, Failure> {
        match self {
            Self::Arx => Ok(Structure::Arx),
            Self::Armax => Ok(Structure::Armax),
            Self::Arma => Ok(Structure::Arma),
            Self::Ar => Ok(Structure::Ar),
            Self::Oe => Ok(Structure::Oe),
            Self::Bj => Ok(Structure::Bj),
            Self::Fir => {
                Err(Failure::usage("--model fir needs --taps, such as --taps 70: how long the response is"))
            }
            Self::Process => Err(Failure::usage(
                "--model process needs --structure, such as --structure p1d: a gain, a lag and a dead time",
            )),
            Self::Tf => {
                Err(Failure::usage("--model tf needs --np, the number of poles, such as --np 2 --nz 1"))
            }
            Self::Ss => Err(Failure::usage(
                "--model ss has no polynomials, and is fitted alone; take another --model here",
            )),
            Self::General => Err(Failure::usage(
                "--model general needs orders: it is any of the others; give --na --nb --nc --nd --nf, or no --model for a choice \
                 among the others",
            )),
        }
    }
}

impl OrderJob {
    pub(super) fn resolve(arguments: &ModelArguments, path: Option<PathArgument>) -> Result<Self, Failure> {
        let ModelArguments { na, nb, nc, nd, nf, nk, taps, kernel, model, .. } = arguments;
        let (na, nc, nd) = (one("--na", na.as_ref())?, one("--nc", nc.as_ref())?, one("--nd", nd.as_ref())?);
        let (nb, nf, nk) = (each("--nb", nb)?, each("--nf", nf)?, each("--nk", nk)?);
        let given = [
            ("--na", na.is_some()),
            ("--nb", !nb.is_empty()),
            ("--nc", nc.is_some()),
            ("--nd", nd.is_some()),
            ("--nf", !nf.is_empty()),
        ];
        let no_inputs = !nb.is_empty() && nb.iter().all(|nb| nb.last() == 0);
        let only_no_inputs = no_inputs && given.iter().filter(|(_, given)| *given).count() == 1;
        let open = given.iter().all(|(_, given)| !given) || (model.is_none() && only_no_inputs);
        let (name, has) = model.unwrap_or(ModelArgument::Arx).shape();
        let wrong =
            |what: String| Err(Failure::usage(format!("--model {name} {what}; give {}", has.join(" "))));
        if let Some((order, _)) = given.iter().find(|(order, given)| *given && !has.contains(order)) {
            return wrong(format!("does not take {order}"));
        }
        if *model == Some(ModelArgument::Fir) && !taps.is_empty() {
            return Self::impulse_response(taps, nk, path);
        }
        if !taps.is_empty() || kernel.is_some() && *model != Some(ModelArgument::Fir) {
            return Err(Failure::usage(
                "--taps and --kernel are for --model fir; leave them out, or give it",
            ));
        }
        let takes_inputs = has.contains(&"--nb") || *model == Some(ModelArgument::Fir);
        if !nk.is_empty() && !takes_inputs {
            return Err(Failure::usage(format!(
                "--model {name} does not take --nk, as it has no inputs; give {}",
                has.join(" ")
            )));
        }
        if open {
            if path.is_some() {
                return Err(Failure::usage(
                    "--path is for orders that are ranges; give some, such as --na 1..10 --nb 1..10",
                ));
            }
            let single = |nk: &OrderRange| {
                nk.single().ok_or_else(|| {
                    Failure::usage(format!(
                        "--nk {nk}: a range of delays needs orders beside it; give --na and --nb too, or leave --nk out"
                    ))
                })
            };
            return Ok(Self::Open {
                structure: model.map(ModelArgument::structure).transpose()?,
                inputs: takes_inputs && !no_inputs,
                nk: nk.iter().map(single).collect::<Result<_, _>>()?,
                linear: false,
            });
        }
        // Of a general model, what is not given is not there.
        let missing: Vec<&str> = given
            .iter()
            .filter(|(order, given)| !given && has.contains(order))
            .map(|(order, _)| *order)
            .collect();
        if *model != Some(ModelArgument::General) && !missing.is_empty() {
            return wrong(format!("needs {}", missing.join(", ")));
        }
        let or = |ranges: Vec<OrderRange>, default: usize| {
            if ranges.is_empty() { vec![OrderRange::from(default)] } else { ranges }
        };
        // What can be said before the log says how many inputs there are.
        let inputs = nb.len().max(nf.len()).max(nk.len());
        let job = Self::Given(Grid {
            na: na.unwrap_or(0.into()),
            // As many as there are inputs; of a model that has none, none.
            nb,
            nc: nc.unwrap_or(0.into()),
            nd: nd.unwrap_or(0.into()),
            nf: or(nf, 0),
            nk: or(nk, 1),
            path: match path {
                None | Some(PathArgument::All) => Path::All,
                Some(PathArgument::Alternate) => Path::Alternate,
            },
        });
        if path.is_some() && !job.is_choice() {
            return Err(Failure::usage(
                "--path is for orders that are ranges; give some, such as --na 1..10 --nb 1..10",
            ));
        }
        if !job.has_inputs() && job.is_filtered() {
            return Err(Failure::usage(
                "--nf: F is the denominator from an input, and there is none; give an --nb above 0",
            ));
        }
        if job.is_choice() || !job.has_inputs() {
            job.of(if job.has_inputs() { inputs } else { 0 })?;
        }
        Ok(job)
    }

    /// B alone, from the first sample on unless it is said otherwise.
    fn impulse_response(
        taps: &[usize],
        nk: Vec<OrderRange>,
        path: Option<PathArgument>,
    ) -> Result<Self, Failure> {
        if path.is_some() || nk.iter().any(|nk| nk.single().is_none()) {
            return Err(Failure::usage(
                "--model fir is one model: give one value after --nk for each input, and no --path",
            ));
        }
        if taps.contains(&0) {
            return Err(Failure::usage("--taps 0: a response has one tap at least"));
        }
        let one = || OrderRange::from(0);
        let job = Self::Given(Grid {
            na: one(),
            nb: taps.iter().map(|taps| OrderRange::from(*taps)).collect(),
            nc: one(),
            nd: one(),
            nf: vec![one()],
            nk: if nk.is_empty() { vec![one()] } else { nk },
            path: Path::All,
        });
        job.of(taps.len())?;
        Ok(job)
    }

    /// Whether the model has inputs at all.
    pub(crate) fn has_inputs(&self) -> bool {
        match self {
            Self::Given(grid) => grid.nb.iter().any(|nb| nb.last() > 0),
            Self::Open { inputs, .. } => *inputs,
        }
    }

    /// Whether there are orders, values or ranges.
    pub(crate) fn is_given(&self) -> bool {
        matches!(self, Self::Given(_))
    }

    /// Whether there is a choice among several models.
    pub(crate) fn is_choice(&self) -> bool {
        match self {
            Self::Given(grid) => {
                let alone = [grid.na, grid.nc, grid.nd];
                let mut ranges = alone.iter().chain(&grid.nb).chain(&grid.nf).chain(&grid.nk);
                ranges.any(|range| range.single().is_none())
            }
            Self::Open { .. } => true,
        }
    }

    /// Whether there is an F for sure.
    pub(crate) fn is_filtered(&self) -> bool {
        matches!(self, Self::Given(grid) if grid.nf.iter().any(|nf| nf.first() > 0))
    }

    /// Whether no model among them has F.
    pub(crate) fn is_never_filtered(&self) -> bool {
        matches!(self, Self::Given(grid) if grid.nf.iter().all(|nf| nf.last() == 0))
    }

    /// Whether there are B and F, and nothing else.
    pub(crate) fn is_output_error(&self) -> bool {
        let alone = |grid: &Grid| [grid.na, grid.nc, grid.nd].iter().all(|range| range.last() == 0);
        matches!(self, Self::Given(grid) if self.is_filtered() && alone(grid))
    }

    /// Whether it is one model without D and F: A y = B u + C e.
    pub(crate) fn is_armax(&self) -> bool {
        let without = |grid: &Grid| grid.nf.iter().chain([&grid.nd]).all(|range| range.last() == 0);
        matches!(self, Self::Given(grid) if without(grid))
    }

    /// Whether the predictor is linear in the parameters: C = D = F = 1.
    pub(crate) fn is_linear(&self) -> bool {
        match self {
            Self::Given(grid) => grid.nf.iter().chain([&grid.nc, &grid.nd]).all(|range| range.last() == 0),
            Self::Open { .. } => false,
        }
    }

    /// The same without nonlinear models, where the data choose.
    pub(crate) fn linear(self, is_linear: bool) -> Self {
        match self {
            Self::Open { structure, inputs, nk, linear } => {
                Self::Open { structure, inputs, nk, linear: linear || is_linear }
            }
            given @ Self::Given(_) => given,
        }
    }

    /// The choice for this many inputs: one value stands for all of them.
    pub(crate) fn of(&self, inputs: usize) -> Result<Choice, Failure> {
        let lengths = |argument: &str, count: usize| {
            if count <= 1 || count == inputs || inputs == 0 {
                return Ok(());
            }
            Err(Failure::usage(format!(
                "{argument} has {count} values for {inputs} input{}; give one for each, or one for all",
                if inputs == 1 { "" } else { "s" }
            )))
        };
        let failed = |error| Failure::option(&error);
        let grid = match self {
            Self::Open { structure, nk, linear, .. } => {
                lengths("--nk", nk.len())?;
                let each = match nk[..] {
                    [] => None,
                    [one] => Some(vec![one; inputs]),
                    _ => Some(nk.clone()),
                };
                return Ok(Choice::Automatic(Automatic { structure: *structure, nk: each, linear: *linear }));
            }
            Self::Given(grid) => grid,
        };
        lengths("--nb", grid.nb.len())?;
        lengths("--nf", grid.nf.len())?;
        lengths("--nk", grid.nk.len())?;
        if self.is_choice() {
            grid.orders(inputs).map_err(failed)?;
            return Ok(Choice::Grid(grid.clone()));
        }
        let each = |ranges: &[OrderRange]| -> Vec<usize> {
            (0..inputs).filter_map(|input| Some(ranges.get(input).or(ranges.first())?.first())).collect()
        };
        let (nb, nf, nk) = (each(&grid.nb), each(&grid.nf), each(&grid.nk));
        let orders =
            Orders::new(grid.na.first(), &nb, grid.nc.first(), grid.nd.first(), &nf, &nk).map_err(failed)?;
        Ok(Choice::Known(orders))
    }
}

fn one(argument: &str, text: Option<&String>) -> Result<Option<OrderRange>, Failure> {
    text.map(|text| parsed(argument, text)).transpose()
}

fn each(argument: &str, texts: &[String]) -> Result<Vec<OrderRange>, Failure> {
    texts.iter().map(|text| parsed(argument, text)).collect()
}
