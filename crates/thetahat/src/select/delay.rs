//! The delays of inputs, from ARX models that are long enough for a disturbance of any colour: of all stretches of lags that
//! a B may have, the one with the least MDL begins at the delay.
//!
//! A coefficient at lag 0 is taken up only if it is worth much more than its price: the input of a sampled plant acts one
//! sample later. In closed loop u(t) may follow y(t) at once, and explain it like an effect that is one; so no lag 0
//! where past residuals foretell the input (the idea of Granger's test, Econometrica 37, 1969).

use std::ops::Range;

use super::automatic::are_enough;
use super::compare::{Samples, rows};
use super::linear::{Columns, Fitted, Rows, Scaled};
use super::ranking::number;
use super::{Delay, Scan, Task};
use crate::data::Record;
use crate::regression::{Lagged, Presample, Taps, add_filtered};
use crate::{Criteria, Error, Orders};

/// Orders of the models: na, and input lags.
const DELAY_ORDER: usize = 10;
const DELAY_LAGS: usize = 14;
/// Lags at most, where a delay seems to be longer.
const MOST_LAGS: usize = 112;
/// What a coefficient at lag 0 must be worth, in prices of a parameter.
const CLEARLY: f64 = 3.0;
/// What past residuals foretell of an input, as a fraction of what the present one has in common with it, where there may be
/// feedback.
const FEEDBACK: f64 = 0.02;
/// What stands for the MDL of a model that leaves nothing, which is not defined.
const EXACT_MODEL: f64 = -1e9;

/// Long ARX models of one record, of which the B have some windows of lags.
struct Long<'r> {
    record: &'r Record<'r>,
    na: usize,
    /// Lags of a B at most.
    lags: usize,
    /// The first lag behind all windows.
    end: usize,
    columns: Columns,
    rows: Rows,
    scaled: Scaled,
}

/// The lags of each input's B: none where it has no effect. Those of a constant and a trend come last.
type Windows = Vec<Range<usize>>;

impl<'r> Long<'r> {
    fn new(task: &Task<'r>, na: usize, lags: usize, end: usize) -> Result<Self, Error> {
        let record = task.estimation;
        let inputs = record.inputs.len();
        let named = task.inputs.len();
        let largest = task.with_constants(&Orders::arx(na, &vec![end; named], &vec![0; named])?);
        let columns = Columns::new(std::iter::once(&largest), inputs);
        let rows = rows(record, &columns, &Samples::unknown(record, std::iter::once(&largest)))?;
        let scaled = Scaled::new(&rows);
        Ok(Self { record, na, lags, end, columns, rows, scaled })
    }

    fn orders(&self, windows: &Windows) -> Result<Orders, Error> {
        let nb: Vec<usize> = windows.iter().map(Range::len).collect();
        let nk: Vec<usize> = windows.iter().map(|window| window.start).collect();
        Orders::arx(self.na, &nb, &nk)
    }

    /// The MDL of models; infinite where the data do not determine them.
    fn mdl(&self, models: &[Windows]) -> Result<Vec<f64>, Error> {
        let models = models.iter().map(|windows| self.orders(windows)).collect::<Result<Vec<_>, Error>>()?;
        let count = self.rows.count();
        let fitted = self.scaled.fit(&self.columns, &models.iter().collect::<Vec<_>>(), false);
        let mdl = |(fitted, orders): (Option<Fitted>, &Orders)| {
            let Some(fitted) = fitted else { return f64::INFINITY };
            let criteria = Criteria::new(fitted.cost / count as f64, orders.parameters(), count);
            // Of exact models the one that has the fewest parameters.
            criteria.mdl.unwrap_or(EXACT_MODEL + orders.parameters() as f64)
        };
        Ok(fitted.into_iter().zip(&models).map(mdl).collect())
    }

    /// The windows of an input, and the MDL of the models with them, the others having theirs. The first is none.
    fn scan(&self, windows: &Windows, input: usize, first: usize) -> Result<Vec<(Range<usize>, f64)>, Error> {
        let all = (first..self.end)
            .flat_map(|start| (start + 1..=self.end.min(start + self.lags)).map(move |end| start..end));
        let own: Vec<Range<usize>> = std::iter::once(self.end..self.end).chain(all).collect();
        let models: Vec<Windows> = own
            .iter()
            .map(|window| {
                let mut windows = windows.clone();
                windows[input] = window.clone();
                windows
            })
            .collect();
        let mdl = self.mdl(&models)?;
        Ok(own.into_iter().zip(mdl).collect())
    }

    /// The windows of the least MDL, each from some lag on. One input after the other, until none moves.
    fn descend(&self, firsts: &[usize], from: Windows) -> Result<Windows, Error> {
        let mut windows = from;
        for _ in 0..firsts.len() + 1 {
            let before = windows.clone();
            for (input, first) in firsts.iter().enumerate() {
                windows[input] = self.least(&self.scan(&windows, input, *first)?).0;
            }
            if windows == before || firsts.len() == 1 {
                break;
            }
        }
        Ok(windows)
    }

    /// The window of the least MDL, the first of equal ones. Of so many late windows one is good by chance: they must be
    /// clearly better.
    fn least(&self, scan: &[(Range<usize>, f64)]) -> (Range<usize>, f64) {
        let count = self.rows.count() as f64;
        let late = |window: &Range<usize>| !window.is_empty() && window.start > self.lags;
        let price =
            |window: &Range<usize>| if late(window) { (CLEARLY - 1.0) * count.ln() / count } else { 0.0 };
        let least = scan.iter().min_by(|a, b| (a.1 + price(&a.0)).total_cmp(&(b.1 + price(&b.0))));
        least.cloned().unwrap_or((self.end..self.end, f64::INFINITY))
    }

    /// The errors of the model with some windows; zero where they do not count.
    fn errors(&self, windows: &Windows) -> Result<Option<Vec<f64>>, Error> {
        let orders = self.orders(windows)?;
        let Some(Some(fitted)) = self.scaled.fit(&self.columns, &[&orders], true).pop() else {
            return Ok(None);
        };
        let record = self.record;
        let mut errors = record.output.to_vec();
        let (a, mut rest) = fitted.parameters.split_at(orders.na);
        let mut subtract = |signal: &[f64], weights: &[f64]| {
            for segment in &record.segments {
                add_filtered(&mut errors[segment.clone()], segment, weights, signal, segment.start);
            }
        };
        subtract(record.output, &[&[0.0], a].concat());
        for (window, u) in windows.iter().zip(&record.inputs) {
            let (b, others) = rest.split_at(window.len());
            rest = others;
            let weights = std::iter::repeat_n(0.0, window.start).chain(b.iter().map(|b| -b));
            subtract(u, &weights.collect::<Vec<_>>());
        }
        for segment in &record.segments {
            errors[segment.start..segment.end.min(segment.start + orders.reach())].fill(0.0);
        }
        Ok(Some(errors))
    }
}

/// The delays, and what there is to say of them.
pub(super) fn found(task: &Task<'_>, steps: &mut Vec<String>) -> Result<(Vec<Delay>, Vec<usize>), Error> {
    let record = task.estimation;
    let inputs = task.inputs.len();
    let lags = |order: usize| order * DELAY_LAGS / DELAY_ORDER;
    let fits = |order: &usize| are_enough(record, order + inputs * lags(*order), (lags(*order)).max(*order));
    let Some(na) = (1..=DELAY_ORDER).rev().find(fits) else {
        steps.push("Too few samples to find delays: they were taken to be 1.".to_owned());
        return Ok((Vec::new(), vec![1; inputs]));
    };
    let lags = lags(na);
    let mut long = Long::new(task, na, lags, 1 + lags)?;
    let mut firsts = vec![1; inputs];
    // A constant and a trend have one coefficient, whatever the others have.
    let constants = vec![0..1; record.inputs.len() - inputs];
    let mut windows = long.descend(&firsts, [vec![1..1 + lags; inputs], constants].concat())?;
    // A delay in the second half, or no effect: it may be a longer one.
    if windows[..inputs].iter().any(|window| 2 * window.start > lags + 1) {
        let fits = |end: &usize| are_enough(record, na + inputs * lags, *end);
        let end = (2 + lags..=MOST_LAGS).rev().find(fits);
        if let Some(end) = end {
            long = Long::new(task, na, lags, end)?;
            windows = long.descend(&firsts, windows)?;
        }
    }
    for (input, name) in task.inputs.iter().enumerate() {
        let (at_once, now) = long.least(&long.scan(&windows, input, 0)?);
        let (_, later) = long.least(&long.scan(&windows, input, 1)?);
        let count = long.rows.count() as f64;
        if at_once.start > 0 || count * (later - now) <= (CLEARLY - 1.0) * count.ln() {
            continue;
        }
        if may_be_feedback(&long, &windows, input)? {
            steps.push(format!(
                "{name} and the output go together without delay, but past residuals foretell {name}: that may be \
                 feedback, and a delay of 0 was left out; if {name} acts at once, give its nk."
            ));
        } else {
            firsts[input] = 0;
            windows[input] = at_once;
            windows = long.descend(&firsts, windows)?;
        }
    }
    let mut delays = Vec::new();
    for (input, name) in task.inputs.iter().enumerate() {
        let scan = long.scan(&windows, input, firsts[input])?;
        let mut table: Vec<Scan> = Vec::new();
        for (window, mdl) in scan.iter().filter(|(window, mdl)| !window.is_empty() && mdl.is_finite()) {
            match table.iter_mut().find(|scan| scan.nk == window.start) {
                Some(scan) => scan.mdl = scan.mdl.min(*mdl),
                None => table.push(Scan { nk: window.start, mdl: *mdl }),
            }
        }
        // What the data do not determine has no figure.
        table.retain(|scan| scan.mdl.is_finite());
        table.sort_by_key(|scan| scan.nk);
        let nk = if windows[input].is_empty() { 1 } else { windows[input].start };
        let mdl = |nk: usize| table.iter().find(|scan| scan.nk == nk).map_or(f64::INFINITY, |scan| scan.mdl);
        if windows[input].is_empty() {
            steps.push(format!("Delay of {name}: no effect of it is seen; it was taken to be 1."));
        } else {
            let others = table.iter().filter(|other| other.nk != nk);
            let second = others.min_by(|a, b| a.mdl.total_cmp(&b.mdl));
            let against = second
                .map(|second| format!(" against {} for {}", shown(second.mdl), second.nk))
                .unwrap_or_default();
            let samples = if nk == 1 { "sample" } else { "samples" };
            steps.push(format!("Delay of {name}: {nk} {samples} (MDL {}{against}).", shown(mdl(nk))));
        }
        delays.push(Delay { input: name.clone(), nk, mdl: table });
    }
    let nk = delays.iter().map(|delay| delay.nk).collect();
    Ok((delays, nk))
}

/// Whether an input that goes together with the output at once may follow it rather than act on it.
///
/// A law of feedback looks at past outputs too: with lag 0 in the model, what past residuals foretell of the input beyond its
/// own past is then not much less than what the present one, without lag 0, has in common with it. In simulated loops of
/// first and second order it was 3 to 20 % of it; where there was none, below 0.5 %.
fn may_be_feedback(long: &Long<'_>, windows: &Windows, input: usize) -> Result<bool, Error> {
    let record = long.record;
    let mut at_once = windows.clone();
    at_once[input] = 0..long.lags;
    let (Some(without), Some(with)) = (long.errors(windows)?, long.errors(&at_once)?) else {
        return Ok(true);
    };
    // The fraction of what is left of the input that residuals explain, from some lag on.
    let explained = |errors: &[f64], first: usize| {
        let signals = [record.inputs[input], errors];
        let own = Taps { signal: 0, first: 1, count: long.lags, sign: 1.0 };
        let residuals = Taps { signal: 1, first, count: long.na + 1 - first, sign: 1.0 };
        let left = |taps: Vec<Taps>| {
            let lagged = Lagged::new(&signals, taps, &record.segments, Presample::Drop);
            let lagged = lagged.behind(long.na + long.end);
            let enough = lagged.rows() > 2 * (long.lags + long.na);
            let norm = |lagged: Lagged<'_>| lagged.solve().ok().map(|solved| solved.residual_norm);
            enough.then(|| norm(lagged)).flatten()
        };
        let (all, rest) = (left(vec![own])?, left(vec![own, residuals])?);
        Some(1.0 - (rest / all).powi(2))
    };
    let (Some(now), Some(past)) = (explained(&without, 0), explained(&with, 1)) else { return Ok(true) };
    Ok(past > FEEDBACK * now)
}

/// An MDL, as far as it is defined.
fn shown(mdl: f64) -> String {
    if mdl < EXACT_MODEL / 2.0 { "not defined: the model is exact".to_owned() } else { number(mdl) }
}
