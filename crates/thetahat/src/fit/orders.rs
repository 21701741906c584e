//! The orders of a model of polynomials, as they were given.

use crate::Error;
use crate::model::{Orders, Structure};
use crate::plan::{FitOptions, MapWord, ModelWord};
use crate::select::{Automatic, Choice, Grid, OrderRange, Path};

/// The orders of a model as they were given: values or ranges, one for each input or one for all; or none.
#[derive(Debug)]
pub(super) enum GivenOrders {
    /// Values or ranges.
    Given(Grid),
    /// The data choose.
    Open { structure: Option<Structure>, inputs: bool, nk: Vec<usize>, linear: bool },
}

/// The orders that a structure of polynomials has.
fn orders_of(model: ModelWord) -> &'static [&'static str] {
    match model {
        ModelWord::Arx => &["na", "nb"],
        ModelWord::Armax => &["na", "nb", "nc"],
        ModelWord::Arma => &["na", "nc"],
        ModelWord::Ar => &["na"],
        ModelWord::Oe => &["nb", "nf"],
        ModelWord::Bj => &["nb", "nc", "nd", "nf"],
        ModelWord::General => &["na", "nb", "nc", "nd", "nf"],
        ModelWord::Fir => &["taps"],
        _ => &[],
    }
}

/// The structure of which orders are chosen.
fn structure(model: ModelWord) -> Result<Structure, Error> {
    let refused = |message| Err(Error::argument("model", message));
    match model {
        ModelWord::Arx => Ok(Structure::Arx),
        ModelWord::Armax => Ok(Structure::Armax),
        ModelWord::Arma => Ok(Structure::Arma),
        ModelWord::Ar => Ok(Structure::Ar),
        ModelWord::Oe => Ok(Structure::Oe),
        ModelWord::Bj => Ok(Structure::Bj),
        ModelWord::Fir => refused("fir needs `taps`, such as 70: how long the response is"),
        ModelWord::General => refused(
            "general needs orders: it is any of the others; give `na`, `nb`, `nc`, `nd`, `nf`, or no `model` for a choice among \
             the others",
        ),
        other => {
            let message = format!(
                "{} has no polynomials, and is fitted alone; take another `model` here",
                other.word()
            );
            Err(Error::argument("model", message))
        }
    }
}

/// Names of options as a message has them.
fn listed(options: &[&str]) -> String {
    options.iter().map(|option| format!("`{option}`")).collect::<Vec<_>>().join(", ")
}

impl GivenOrders {
    pub(super) fn new(options: &FitOptions) -> Result<Self, Error> {
        let FitOptions { na, nb, nc, nd, nf, taps, model, path, .. } = options.clone();
        let nk: Vec<OrderRange> = options.nk.iter().map(|nk| nk.0).collect();
        let given = [
            ("na", na.is_some()),
            ("nb", !nb.is_empty()),
            ("nc", nc.is_some()),
            ("nd", nd.is_some()),
            ("nf", !nf.is_empty()),
        ];
        let no_inputs = !nb.is_empty() && nb.iter().all(|nb| nb.last() == 0);
        let only_no_inputs = no_inputs && given.iter().filter(|(_, given)| *given).count() == 1;
        let open = given.iter().all(|(_, given)| !given) || (model.is_none() && only_no_inputs);
        let of = model.unwrap_or(ModelWord::Arx);
        let (name, has) = (of.word(), orders_of(of));
        let wrong =
            |what: String| Err(Error::argument("model", format!("{name} {what}; give {}", listed(has))));
        if let Some((order, _)) = given.iter().find(|(order, given)| *given && !has.contains(order)) {
            return wrong(format!("does not take `{order}`"));
        }
        if model == Some(ModelWord::Fir) && !taps.is_empty() {
            return Self::impulse_response(&taps, nk);
        }
        let takes_inputs = has.contains(&"nb") || model == Some(ModelWord::Fir);
        if !nk.is_empty() && !takes_inputs {
            return Err(Error::argument(
                "model",
                format!("{name} does not take `nk`, as it has no inputs; give {}", listed(has)),
            ));
        }
        if open {
            if path.is_some() {
                return Err(Error::argument(
                    "path",
                    "it is for orders that are ranges; give some, such as `na` 1..10 and `nb` 1..10",
                ));
            }
            let single = |nk: &OrderRange| {
                nk.single().ok_or_else(|| {
                    Error::argument("nk", format!("{nk}: a range of delays needs orders beside it; give `na` and `nb` too, or leave `nk` out"
                    ))
                })
            };
            return Ok(Self::Open {
                structure: model.map(structure).transpose()?,
                inputs: takes_inputs && !no_inputs,
                nk: nk.iter().map(single).collect::<Result<_, _>>()?,
                linear: options.narx == Some(MapWord::None),
            });
        }
        // Of a general model, what is not given is not there.
        let missing: Vec<&str> = given
            .iter()
            .filter(|(order, given)| !given && has.contains(order))
            .map(|(order, _)| *order)
            .collect();
        if model != Some(ModelWord::General) && !missing.is_empty() {
            return wrong(format!("needs {}", listed(&missing)));
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
            path: path.unwrap_or_default(),
        });
        if path.is_some() && !job.is_choice() {
            return Err(Error::argument(
                "path",
                "it is for orders that are ranges; give some, such as `na` 1..10 and `nb` 1..10",
            ));
        }
        if !job.has_inputs() && job.is_filtered() {
            return Err(Error::argument(
                "nf",
                "F is the denominator from an input, and there is none; give an `nb` above 0",
            ));
        }
        if job.is_choice() || !job.has_inputs() {
            job.of(if job.has_inputs() { inputs } else { 0 })?;
        }
        Ok(job)
    }

    /// B alone, from the first sample on unless it is said otherwise.
    fn impulse_response(taps: &[usize], nk: Vec<OrderRange>) -> Result<Self, Error> {
        if nk.iter().any(|nk| nk.single().is_none()) {
            return Err(Error::argument("nk", "`model` fir is one model: give one value for each input"));
        }
        if taps.contains(&0) {
            return Err(Error::argument("taps", "a response has one tap at least"));
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
    pub(super) fn has_inputs(&self) -> bool {
        match self {
            Self::Given(grid) => grid.nb.iter().any(|nb| nb.last() > 0),
            Self::Open { inputs, .. } => *inputs,
        }
    }

    /// Whether there are orders, values or ranges.
    pub(super) fn is_given(&self) -> bool {
        matches!(self, Self::Given(_))
    }

    /// Whether there is a choice among several models.
    pub(super) fn is_choice(&self) -> bool {
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
    pub(super) fn is_filtered(&self) -> bool {
        matches!(self, Self::Given(grid) if grid.nf.iter().any(|nf| nf.first() > 0))
    }

    /// Whether no model among them has F.
    pub(super) fn is_never_filtered(&self) -> bool {
        matches!(self, Self::Given(grid) if grid.nf.iter().all(|nf| nf.last() == 0))
    }

    /// Whether there are B and F, and nothing else.
    pub(super) fn is_output_error(&self) -> bool {
        let alone = |grid: &Grid| [grid.na, grid.nc, grid.nd].iter().all(|range| range.last() == 0);
        matches!(self, Self::Given(grid) if self.is_filtered() && alone(grid))
    }

    /// Whether it is one model without D and F: A y = B u + C e.
    pub(super) fn is_armax(&self) -> bool {
        let without = |grid: &Grid| grid.nf.iter().chain([&grid.nd]).all(|range| range.last() == 0);
        matches!(self, Self::Given(grid) if without(grid))
    }

    /// Whether the predictor is linear in the parameters: C = D = F = 1.
    pub(super) fn is_linear(&self) -> bool {
        match self {
            Self::Given(grid) => grid.nf.iter().chain([&grid.nc, &grid.nd]).all(|range| range.last() == 0),
            Self::Open { .. } => false,
        }
    }

    /// The choice for this many inputs: one value stands for all of them.
    pub(super) fn of(&self, inputs: usize) -> Result<Choice, Error> {
        let lengths = |option: &str, count: usize| {
            if count <= 1 || count == inputs || inputs == 0 {
                return Ok(());
            }
            let s = if inputs == 1 { "" } else { "s" };
            Err(Error::argument(
                option,
                format!("{count} values for {inputs} input{s}; give one for each, or one for all"),
            ))
        };
        let grid = match self {
            Self::Open { structure, nk, linear, .. } => {
                lengths("nk", nk.len())?;
                let each = match nk[..] {
                    [] => None,
                    [one] => Some(vec![one; inputs]),
                    _ => Some(nk.clone()),
                };
                return Ok(Choice::Automatic(Automatic { structure: *structure, nk: each, linear: *linear }));
            }
            Self::Given(grid) => grid,
        };
        lengths("nb", grid.nb.len())?;
        lengths("nf", grid.nf.len())?;
        lengths("nk", grid.nk.len())?;
        if self.is_choice() {
            grid.orders(inputs)?;
            return Ok(Choice::Grid(grid.clone()));
        }
        let each = |ranges: &[OrderRange]| -> Vec<usize> {
            (0..inputs).filter_map(|input| Some(ranges.get(input).or(ranges.first())?.first())).collect()
        };
        let (nb, nf, nk) = (each(&grid.nb), each(&grid.nf), each(&grid.nk));
        let orders = Orders::new(grid.na.first(), &nb, grid.nc.first(), grid.nd.first(), &nf, &nk)?;
        Ok(Choice::Known(orders))
    }
}
