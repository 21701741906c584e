//! Delay, structure and orders where nothing was asked for.
//!
//! Delays come first (see `delay`); then all structures with these delays are compared.

use std::collections::BTreeSet;

use super::candidates::{MOST_INPUTS, Samples, are_enough, energy, rows, total};
use super::compare::{LONG, SEGMENT, SEGMENTS, compare, keep_quick};
use super::delay;
use super::grid::key;
use super::linear::{Columns, Fitted, Scaled};
use super::ranking::ranked;
use super::{Automatic, Delay, EXACT, Focus, SelectedModel, Selection, Task};
use crate::Error;
use crate::data::{Decision, FindingKind, Record};
use crate::estimate::{Initial, pays, thinned_to};
use crate::model::{Orders, Structure};
use crate::validate::feedback::{Loop, feedback};

/// The highest order of ARX and AR models, and of the others.
const LONGEST: usize = 10;
const HIGHEST: usize = 3;
/// Orders of A or F, of B, of C and of D in models that are compared by their free runs.
const DIAGONAL_ARX: [[usize; 4]; 8] = [
    [1, 1, 0, 0],
    [2, 2, 0, 0],
    [3, 3, 0, 0],
    [4, 4, 0, 0],
    [6, 6, 0, 0],
    [8, 8, 0, 0],
    [10, 10, 0, 0],
    [20, 20, 0, 0],
];
const DIAGONAL_ARMAX: [[usize; 4]; 4] = [[1, 1, 1, 0], [2, 2, 2, 0], [3, 3, 3, 0], [4, 4, 4, 0]];
const DIAGONAL_OE: [[usize; 4]; 8] = [
    [1, 1, 0, 0],
    [1, 2, 0, 0],
    [2, 2, 0, 0],
    [2, 3, 0, 0],
    [3, 3, 0, 0],
    [4, 4, 0, 0],
    [5, 5, 0, 0],
    [6, 6, 0, 0],
];
const DIAGONAL_BJ: [[usize; 4]; 5] = [[1, 1, 1, 1], [2, 2, 1, 1], [2, 2, 2, 2], [3, 3, 1, 1], [4, 4, 1, 1]];
/// The least probability of a delay that is certain.
const CERTAIN: f64 = 0.99;
/// At least this many samples for each parameter of a model in which several inputs have denominators.
const SAMPLES_OF_DENOMINATORS: usize = 10;
/// Orders of ARX models that say whether a constant is worth a parameter.
const CONSTANT_ORDERS: [usize; 2] = [2, LONGEST];

/// # Errors
/// As for [`choose`](super::choose).
pub(super) fn choose(task: &Task<'_>, automatic: &Automatic) -> Result<SelectedModel, Error> {
    let inputs = task.inputs.len();
    if inputs > MOST_INPUTS {
        return Err(Error::argument(
            "inputs",
            format!(
                "{inputs} are too many to choose delays and orders for (at most {MOST_INPUTS}); give orders, or fewer inputs"
            ),
        ));
    }
    let loops = loops(task);
    let follows = loops.certain();
    let closed = automatic.structure.is_none() && task.focus == Focus::Auto && follows.contains(&true);
    let task = &if closed { Task { focus: Focus::Prediction, ..*task } } else { *task };
    // Whoever asks for a structure without a model of the noise, or for free runs, has it.
    let may_drift = task.may_drift
        && matches!(automatic.structure, None | Some(Structure::Bj))
        && matches!(task.focus, Focus::Auto | Focus::Prediction);
    let task = &Task { may_drift, ..*task };
    let structures = structures(task, automatic, closed)?;
    let driven = structures.iter().any(|structure| !matches!(structure, Structure::Ar | Structure::Arma));
    let mut steps = Vec::new();
    let searches = automatic.nk.is_none() && follows.contains(&true);
    let decisions = match searches || closed {
        true => vec![in_closed_loop(task, &follows, searches, closed)],
        false => Vec::new(),
    };
    let (delays, nk) = match &automatic.nk {
        Some(nk) if nk.len() == inputs => (Vec::new(), nk.clone()),
        Some(nk) => {
            return Err(Error::argument(
                "nk",
                format!("there are {} values for {inputs} inputs; give one for each", nk.len()),
            ));
        }
        None if driven => delay::found(task, &loops, &mut steps)?,
        None => (Vec::new(), vec![1; inputs]),
    };
    let mut models = candidates(task.estimation, &structures, &nk)?;
    let idle: Vec<usize> = (0..delays.len()).filter(|&input| delays[input].confidence.is_none()).collect();
    if !idle.is_empty() && idle.len() < inputs {
        models = models.iter().map(|orders| without(orders, &idle)).collect();
        let names: Vec<&str> = idle.iter().map(|&input| task.inputs[input].as_str()).collect();
        steps.push(format!("Models without {} compete, as no effect is seen.", names.join(", ")));
    }
    // What may simulate best is fitted, whatever its MDL.
    let mut essential: Vec<Orders> = Vec::new();
    if task.looks_further() && automatic.nk.is_none() {
        let least = usize::from(follows.contains(&true));
        // What acts within the same sample for certain has no later delay.
        let at_once = |of: &Delay| of.nk == 0 && of.confidence.is_some_and(|confidence| confidence > CERTAIN);
        let most = usize::from(!delays.iter().any(at_once));
        for delay in (least..=most).rev() {
            essential.extend(diagonal(task.estimation, &structures, &vec![delay; inputs])?);
        }
    }
    if task.looks_further() {
        essential.extend(diagonal(task.estimation, &structures, &nk)?);
        essential.extend(models.iter().filter(|orders| orders.nc + orders.nd == 0).cloned());
    }
    models.extend(essential.iter().cloned());
    let supported = |orders: &Orders| has_enough_for_denominators(task.estimation, orders);
    if automatic.structure.is_none() && models.iter().any(supported) {
        let before = models.len();
        models.retain(supported);
        if models.len() < before {
            steps.push(format!(
                "Not tried: OE and Box-Jenkins models of several inputs that have fewer than {SAMPLES_OF_DENOMINATORS} samples for a parameter."
            ));
        }
    }
    let essential: BTreeSet<Vec<usize>> =
        essential.iter().map(|orders| key(&task.with_constants(orders))).collect();
    let mut seen = BTreeSet::new();
    models.retain(|orders| seen.insert(key(orders)));
    steps.extend(keep_quick(task, &mut models));
    models.sort_by_key(Orders::parameters);
    let tried = models.clone();
    let outcome = compare(task, models, Some(&essential))?;
    let SelectedModel { mut selection, initial_parameters, .. } = ranked(task, outcome, None)?;
    selection.steps.extend(at_the_edge(&selection.chosen.orders, &tried));
    steps.append(&mut selection.steps);
    Ok(SelectedModel { selection: Selection { steps, delays, ..selection }, decisions, initial_parameters })
}

/// What tells of a loop.
fn loops(task: &Task<'_>) -> Loop {
    let few = thinned_to(task.estimation, SEGMENTS, SEGMENT).filter(|_| total(task.estimation) > LONG);
    let record = few.as_ref().unwrap_or(task.estimation);
    feedback(&record.inputs[..task.inputs.len()], record.output, &record.segments)
}

/// What feedback means for the choice: whether delays are searched, and whether structures and what decides are open.
fn in_closed_loop(task: &Task<'_>, follows: &[bool], delays: bool, structures: bool) -> Decision {
    let names =
        task.inputs.iter().zip(follows).filter(|(_, follows)| **follows).map(|(name, _)| name.clone());
    let channels: Vec<String> = names.collect();
    let (input, follow, they) = match channels.len() {
        1 => ("input", "follows", "it acts"),
        _ => ("inputs", "follow", "they act"),
    };
    let later = format!("{they} one sample later at the earliest");
    let noise =
        "models with noise of their own compete (ARX, ARMAX, Box-Jenkins), and errors one step ahead decide";
    let (did, instead) = match (delays, structures) {
        (true, true) => (format!("{later}, {noise}"), "`nk`, `model` or `focus`"),
        (true, false) => (later, "`nk`"),
        (false, _) => (noise.to_owned(), "`model` or `focus`"),
    };
    Decision {
        kind: FindingKind::Feedback,
        because: format!(
            "{input} '{}' {follow} past errors of the output, as in a closed loop",
            channels.join("', '")
        ),
        did,
        instead: instead.to_owned(),
        channels,
    }
}

/// Orders without some inputs.
fn without(orders: &Orders, idle: &[usize]) -> Orders {
    let mut orders = orders.clone();
    for &input in idle {
        (orders.nb[input], orders.nf[input]) = (0, 0);
    }
    orders
}

/// Whether there are enough samples for denominators of several inputs: a pole of an input that hardly acts is found
/// near the unit circle by chance, and free runs go away with it.
fn has_enough_for_denominators(record: &Record<'_>, orders: &Orders) -> bool {
    let denominators = orders.nf.iter().filter(|&&nf| nf > 0).count();
    denominators < 2 || total(record) >= SAMPLES_OF_DENOMINATORS * orders.parameters()
}

/// A warning of orders that are the highest that were tried of their structure.
fn at_the_edge(chosen: &Orders, tried: &[Orders]) -> Option<String> {
    let most = |values: &[usize]| values.iter().copied().max().unwrap_or(0);
    let of = |orders: &Orders| [orders.na, most(&orders.nb), orders.nc, orders.nd, most(&orders.nf)];
    let own = of(chosen);
    let others = || tried.iter().filter(|other| other.structure() == chosen.structure()).map(of);
    let names: Vec<&str> = ["na", "nb", "nc", "nd", "nf"]
        .into_iter()
        .enumerate()
        .filter(|(k, _)| {
            let highest = others().map(|orders| orders[*k]).max().unwrap_or(0);
            let lowest = others().map(|orders| orders[*k]).min().unwrap_or(0);
            lowest < highest && own[*k] == highest
        })
        .map(|(_, name)| name)
        .collect();
    (!names.is_empty()).then(|| {
        format!(
            "The chosen {} {} the highest that {} tried: ranges of orders look further.",
            names.join(", "),
            if names.len() == 1 { "is" } else { "are" },
            if names.len() == 1 { "was" } else { "were" }
        )
    })
}

/// Whether a constant lowers the MDL of ARX models of few or of many coefficients: then it is part of every model that
/// is compared, and the chosen one says whether it keeps it.
pub(crate) fn constant_pays(record: &Record<'_>) -> bool {
    let inputs = record.inputs.len();
    if inputs <= MOST_INPUTS
        && let Some(pays) = exactly(record)
    {
        return pays;
    }
    inputs <= MOST_INPUTS
        && CONSTANT_ORDERS.into_iter().any(|order| {
            are_enough(record, order * (1 + inputs), order)
                && Orders::arx(order, &vec![order; inputs], &vec![1; inputs])
                    .is_ok_and(|orders| pays(record, &orders))
        })
}

/// Whether the least order of an ARX model that leaves nothing is less with a constant, where there is such an order.
/// None of data with noise.
fn exactly(record: &Record<'_>) -> Option<bool> {
    let ones = vec![1.0; record.output.len()];
    let with = least_exact(&record.with_inputs(std::slice::from_ref(&ones)), 1)?;
    Some(least_exact(record, 0).is_none_or(|without| with < without))
}

/// The least order of an ARX model that leaves nothing, the last inputs being constants; none where there is no such
/// order.
fn least_exact(record: &Record<'_>, constants: usize) -> Option<usize> {
    let named = record.inputs.len() - constants;
    let enough = |order: &usize| are_enough(record, (order + 1) * (named + 1) + order, *order);
    let orders = (1..=LONGEST).take_while(enough);
    let models = orders.map(|order| Orders::arx(order, &vec![order + 1; named], &vec![0; named]));
    let models: Vec<Orders> =
        models.map(|orders| Ok(orders?.with_constants(constants))).collect::<Result<_, Error>>().ok()?;
    let columns = Columns::new(models.iter(), record.inputs.len());
    let rows = rows(record, &columns, &Samples::unknown(record, models.iter())).ok()?;
    let fitted = Scaled::new(&rows).fit(&columns, &models.iter().collect::<Vec<_>>(), false);
    let exact = |fitted: &Option<Fitted>| fitted.as_ref().is_some_and(|of| of.cost <= EXACT * energy(record));
    fitted.iter().position(exact).map(|place| place + 1)
}

/// Which structures are tried.
fn structures(task: &Task<'_>, automatic: &Automatic, closed: bool) -> Result<Vec<Structure>, Error> {
    use Structure::{Ar, Arma, Armax, Arx, Bj, General, Oe};
    let driven = !task.inputs.is_empty();
    match automatic.structure {
        Some(General) => Err(Error::argument(
            "structure",
            "general has no orders of its own to try; give those of its polynomials, or ranges of them",
        )),
        Some(structure @ (Arx | Armax | Oe | Bj)) if !driven => Err(Error::argument(
            "structure",
            format!(
                "{} needs an input; name one, or take ar or arma",
                format!("{structure:?}").to_lowercase()
            ),
        )),
        Some(structure) => Ok(vec![structure]),
        None if !driven => Ok(vec![Ar, Arma]),
        None if closed && task.initial == Initial::Estimate => Ok(vec![Bj]),
        None if closed && task.initial != Initial::Drop => Ok(vec![Arx, Armax, Bj]),
        // Models with F take no dropped samples, and others no estimated initial conditions.
        None if task.initial == Initial::Drop => Ok(vec![Arx, Armax]),
        None if task.initial == Initial::Estimate => Ok(vec![Oe, Bj]),
        None => Ok(vec![Arx, Armax, Oe, Bj]),
    }
}

/// Models of some structures in which all polynomials of the plant have one order: those that may simulate well
/// although their delays or their noise are wrong.
fn diagonal(record: &Record<'_>, structures: &[Structure], nk: &[usize]) -> Result<Vec<Orders>, Error> {
    let mut models = Vec::new();
    for structure in structures {
        let all: &[[usize; 4]] = match structure {
            Structure::Arx => &DIAGONAL_ARX,
            Structure::Armax => &DIAGONAL_ARMAX,
            Structure::Oe => &DIAGONAL_OE,
            Structure::Bj => &DIAGONAL_BJ,
            Structure::Ar | Structure::Arma | Structure::General => &[],
        };
        for orders in all {
            let orders = of_structure(*structure, *orders, nk)?;
            let left_out =
                (0..nk.len()).map(|input| orders.maximum_input_lag(input)).fold(orders.na, usize::max);
            if are_enough(record, orders.parameters(), left_out) {
                models.push(orders);
            }
        }
    }
    Ok(models)
}

/// The models of some structures with given delays, the smallest first.
fn candidates(record: &Record<'_>, structures: &[Structure], nk: &[usize]) -> Result<Vec<Orders>, Error> {
    let inputs = nk.len();
    let mut models = Vec::new();
    for structure in structures {
        let most = if matches!(structure, Structure::Arx | Structure::Ar) { LONGEST } else { HIGHEST };
        // All with one order.
        let of = |order: usize| of_structure(*structure, [order; 4], nk);
        let fits = |order: &usize| {
            of(*order).is_ok_and(|orders| {
                let left_out =
                    (0..inputs).map(|input| orders.maximum_input_lag(input)).fold(*order, usize::max);
                are_enough(record, orders.parameters(), left_out)
            })
        };
        let highest = (2..=most).rev().find(fits).unwrap_or(1);
        let each = |used: bool| if used { 1..=highest } else { 1..=1 };
        let (third, fourth) = match structure {
            Structure::Arx | Structure::Ar | Structure::Oe | Structure::General => (false, false),
            Structure::Armax | Structure::Arma => (true, false),
            Structure::Bj => (true, true),
        };
        let second = !matches!(structure, Structure::Ar | Structure::Arma);
        // Noise of Box and Jenkins that is white is that of an output-error model.
        let noise = |used: bool| if *structure == Structure::Bj { 0..=highest } else { each(used) };
        for first in each(true) {
            for second in each(second) {
                for third in noise(third) {
                    for fourth in noise(fourth).filter(|fourth| third + fourth > 0) {
                        models.push(of_structure(*structure, [first, second, third, fourth], nk)?);
                    }
                }
            }
        }
    }
    models.sort_by_key(Orders::parameters);
    Ok(models)
}

/// The orders of a structure from those of its polynomials: those of A or F, of B, of C, and of D.
fn of_structure(structure: Structure, orders: [usize; 4], nk: &[usize]) -> Result<Orders, Error> {
    let [poles, zeros, nc, nd] = orders;
    let (none, nb, nf) = (vec![0; nk.len()], vec![zeros; nk.len()], vec![poles; nk.len()]);
    match structure {
        Structure::Ar => Orders::new(poles, &none, 0, 0, &none, nk),
        Structure::Arma => Orders::new(poles, &none, nc, 0, &none, nk),
        Structure::Arx | Structure::General => Orders::new(poles, &nb, 0, 0, &none, nk),
        Structure::Armax => Orders::new(poles, &nb, nc, 0, &none, nk),
        Structure::Oe => Orders::new(0, &nb, 0, 0, &nf, nk),
        Structure::Bj => Orders::new(0, &nb, nc, nd, &nf, nk),
    }
}
