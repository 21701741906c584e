//! Nonlinear ARX models.

use std::borrow::Cow;
use std::sync::Arc;

use thetahat_numerics::optimize::{Monitor, Search};

use super::search;
use super::{Common, Draft, KindPlan, common};
use crate::Error;
use crate::data::{Log, Source};
use crate::model::{Activation, Membership};
use crate::plan::{FitOptions, MapWord};
use crate::report::{
    Centres, InputLags, MapPlan, NonlinearArxPlan, NormalEquations, Report, fit_nonlinear_arx_monitored,
};
use crate::select::Focus;

/// Bends of each regressor. Natural splines seldom need more than five knots (Stone, Statistical Science 1, 1986);
/// these have seven, of which a choice leaves out what is not needed.
const BENDS: usize = 5;

/// A nonlinear ARX model of which the channels and the lags of inputs are open.
#[derive(Debug)]
pub(super) struct NonlinearArxDraft {
    /// Whether there are inputs at all.
    driven: bool,
    ny: Vec<usize>,
    nu: Vec<usize>,
    nk: Vec<usize>,
    /// The rest of the plan.
    plan: NonlinearArxPlan,
}

impl NonlinearArxDraft {
    pub(super) fn new(options: &FitOptions) -> Result<Self, Error> {
        let map = options.narx.unwrap_or(MapWord::None);
        check_pairs(options)?;
        let default = NonlinearArxPlan::new(&[], &[]);
        let Common { estimate, validate, split, detrend, offsets } = common(options)?;
        let lags_open = options.ny.is_empty() && options.nu.is_empty() && options.nk.is_empty();
        let plan = NonlinearArxPlan {
            estimate,
            validate,
            split,
            detrend,
            offsets,
            expressions: options.regressor.clone(),
            lags_chosen: map == MapWord::Auto && lags_open,
            map: map_plan(options, map)?,
            terms: options.terms,
            most: options.most_terms,
            select: options.select,
            ridge: options.ridge,
            // How far ahead errors are made small, if that is said.
            focus: options.focus.filter(|focus| *focus != Focus::Auto).map(Focus::horizon),
            search: searched(options, map, default.search.clone())?,
            raw_terms: options.raw_terms,
            ..default
        };
        let nk = options.nk.iter().map(|nk| {
            nk.0.single().ok_or_else(|| {
                Error::argument(
                    "nk",
                    format!("{}: a nonlinear ARX model takes one delay for each input, such as 1", nk.0),
                )
            })
        });
        let draft = Self {
            driven: options.nu.is_empty() || options.nu.iter().any(|lags| *lags > 0),
            ny: options.ny.clone(),
            nu: options.nu.clone(),
            nk: nk.collect::<Result<_, Error>>()?,
            plan,
        };
        if !draft.driven && !options.input.is_empty() {
            return Err(Error::argument(
                "nu",
                "0 makes a model without inputs; leave out `input`, or give another `nu`",
            ));
        }
        Ok(draft)
    }
}

impl Draft for NonlinearArxDraft {
    fn is_driven(&self) -> bool {
        self.driven
    }

    fn asks_for_no_inputs(&self) -> &'static str {
        "`nu` 0"
    }

    fn plan(&self, inputs: Vec<String>, outputs: Vec<String>) -> Result<Arc<dyn KindPlan>, Error> {
        let each = |option: &str, values: &[usize], default: usize, count: usize, of: &str| match values {
            [] => Ok(vec![default; count]),
            [one] => Ok(vec![*one; count]),
            several if several.len() == count => Ok(several.to_vec()),
            several => Err(Error::argument(
                option,
                format!("{} numbers for {count} {of}; give one for all or one for each", several.len()),
            )),
        };
        let nu = each("nu", &self.nu, 2, inputs.len(), "inputs")?;
        let nk = each("nk", &self.nk, 1, inputs.len(), "inputs")?;
        let output_lags = each("ny", &self.ny, 2, outputs.len(), "outputs")?;
        let input_lags = nu.into_iter().zip(nk).map(|(lags, delay)| InputLags { lags, delay }).collect();
        let plan = NonlinearArxPlan { inputs, outputs, output_lags, input_lags, ..self.plan.clone() };
        plan.check()?;
        Ok(Arc::new(plan))
    }
}

impl KindPlan for NonlinearArxPlan {
    fn fit(&self, log: Cow<'_, Log>, sources: &[Source], monitor: Monitor<'_>) -> Result<Report, Error> {
        fit_nonlinear_arx_monitored(&log, sources, self, monitor)
    }

    fn check_pieces(&self) -> Result<(), Error> {
        Ok(())
    }

    fn lags(&self) -> usize {
        self.lags()
    }

    fn pieces(&self, log: &Log, sources: &[Source], past: usize) -> Result<NormalEquations, Error> {
        NormalEquations::of_nonlinear_arx(log, sources, self, past)
    }
}

/// Options of which one makes the other needless.
fn check_pairs(options: &FitOptions) -> Result<(), Error> {
    let pairs: [(&str, &[&str]); 3] = [
        ("term", &["terms", "most_terms", "select", "degree"]),
        ("terms", &["select", "most_terms"]),
        ("most_terms", &["terms"]),
    ];
    for (option, others) in pairs {
        if let Some((option, other)) = options.first_given(&[option]).zip(options.first_given(others)) {
            return Err(Error::argument(
                &option,
                format!("does not work with `{other}`; leave one of the two out"),
            ));
        }
    }
    Ok(())
}

fn map_plan(options: &FitOptions, map: MapWord) -> Result<MapPlan, Error> {
    use MapWord::{Auto, Knn, Local, Logistic, Poly, Rbf, RbfFree, Relu, Spline, Step, Tanh};
    let own: [(&str, &[MapWord]); 10] = [
        ("degree", &[Poly]),
        ("centres", &[Rbf]),
        ("width", &[Rbf]),
        ("no_linear", &[Rbf, Local, Knn]),
        ("membership", &[Local]),
        ("terms", &[Poly, Rbf, Spline, Tanh, Logistic, Relu, Step]),
        ("term", &[Poly]),
        ("seed", &[Rbf, Tanh, Logistic, Relu, Step, RbfFree, Auto]),
        ("units", &[Spline, Local, Knn, Tanh, Logistic, Relu, Step, RbfFree]),
        ("drawn", &[Tanh, Logistic, Relu]),
    ];
    for (field, maps) in own {
        if let Some(option) = options.first_given(&[field]).filter(|_| !maps.contains(&map)) {
            let names: Vec<String> = maps.iter().map(|map| format!("`narx` {}", map.word())).collect();
            let names = match names.split_last() {
                Some((last, others)) if !others.is_empty() => format!("{} and {last}", others.join(", ")),
                _ => names.concat(),
            };
            return Err(Error::argument(&option, format!("it is for {names}")));
        }
    }
    match map {
        Poly if !options.term.is_empty() => Ok(MapPlan::Products { terms: options.term.clone() }),
        Poly => Ok(MapPlan::Polynomial { degree: options.degree.unwrap_or(2) }),
        Rbf => {
            let text = options.centres.as_deref().unwrap_or("chosen");
            if options.seed.is_some() && !text.starts_with("kmeans") && !text.starts_with("random") {
                return Err(Error::argument("seed", "is for `centres` kmeans:N and random:N"));
            }
            Ok(MapPlan::Radial {
                centres: centres(text, options.seed.unwrap_or(0))?,
                width: options.width,
                linear: !options.no_linear,
            })
        }
        Spline => Ok(MapPlan::Spline { units: options.units.unwrap_or(BENDS) }),
        Local => {
            let membership = options.membership.unwrap_or(Membership::Gaussian);
            Ok(MapPlan::Local { membership, planes: !options.no_linear, units: options.units })
        }
        Knn => Ok(MapPlan::Neighbours { planes: !options.no_linear, units: options.units }),
        Tanh => Ok(network(Activation::Tanh, options)),
        Logistic => Ok(network(Activation::Logistic, options)),
        Relu => Ok(network(Activation::Relu, options)),
        Step => Ok(MapPlan::Network { activation: Activation::Step, units: options.units, drawn: true }),
        RbfFree => Ok(MapPlan::FreeRadial { units: options.units }),
        Auto => Ok(MapPlan::Auto),
        MapWord::None => Err(Error::argument("narx", "none fits no nonlinear model; name the functions")),
    }
}

fn network(activation: Activation, options: &FitOptions) -> MapPlan {
    MapPlan::Network { activation, units: options.units, drawn: options.drawn }
}

/// How to search, where a map is trained, or its parameters for longer runs.
fn searched(options: &FitOptions, map: MapWord, default: Search) -> Result<Search, Error> {
    use MapWord::{Auto, Logistic, RbfFree, Relu, Tanh};
    let trained = matches!(map, Tanh | Logistic | Relu | RbfFree | Auto) && !options.drawn;
    if options.starts.is_some() && !trained {
        return Err(Error::argument(
            "starts",
            "it is for maps that are trained: `narx` tanh, logistic, relu, rbf-free and auto",
        ));
    }
    let found = search::seeded(options)?;
    Ok(Search {
        starts: options.starts.map_or(default.starts, |_| found.starts),
        max_iterations: options.max_iterations.map_or(default.max_iterations, |_| found.max_iterations),
        ..found
    })
}

fn centres(text: &str, seed: u64) -> Result<Centres, Error> {
    let (word, count) = text.split_once(':').unwrap_or((text, ""));
    match (word, count.parse()) {
        ("chosen", _) if count.is_empty() => Ok(Centres::Chosen),
        ("kmeans", Ok(count)) => Ok(Centres::Clusters { count, seed }),
        ("grid", Ok(each)) => Ok(Centres::Grid { each }),
        ("random", Ok(count)) => Ok(Centres::Random { count, seed }),
        _ => Err(Error::argument(
            "centres",
            format!("{text}: write it as chosen, kmeans:N, grid:N or random:N, such as kmeans:20"),
        )),
    }
}
