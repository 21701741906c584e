//! Intervals by profile likelihood: all values of a parameter with which, the others at their best, the likelihood is
//! not significantly below its largest:
//!
//! ```text
//! 2 (ln L(p^) - max ln L(p) over the others) <= chi²_1(0.95) f
//! ```
//!
//! with the factor f by which covariances are multiplied. They know bounds and curvature, where p ± 1.96 standard
//! errors is a parabola's. Source: Venzon and Moolgavkar, A method for computing profile-likelihood-based confidence
//! intervals, Applied Statistics 37, 1988; Pawitan, In All Likelihood, 2001, section 2.6.

use rayon::prelude::*;
use thetahat_numerics::distribution::two_sided;
use thetahat_numerics::optimize::{Deadline, Monitor, Search, search};

use super::EquationsEstimate;
use super::likelihood::{Likelihood, Slopes};
use super::objective::Deviance;
use crate::Error;
use crate::model::GreyBox;
use crate::respond::equations::Failure;

/// The most doublings of the distance in which an end is looked for: beyond, there is none.
const DOUBLINGS: usize = 12;
/// An end is found within this fraction of its distance.
const TOLERANCE: f64 = 1e-4;
const ITERATIONS: usize = 40;
/// Where a noise vanishes, its interval is looked for from this fraction of its start on.
const LITTLE: f64 = 1e-3;

/// The two ends of the interval of 95 % of each parameter, in its own unit; none where the likelihood falls no further
/// on that side, be it to a bound. About twenty searches for each parameter.
pub(crate) fn intervals<L: Likelihood>(
    model: &GreyBox,
    criterion: impl Fn() -> L + Sync,
    found: &EquationsEstimate,
    factor: f64,
    options: &Search,
    monitor: Monitor<'_>,
) -> Result<Vec<[Option<f64>; 2]>, Error> {
    let sides = (0..found.z.len()).flat_map(|index| [(index, -1.0), (index, 1.0)]);
    let ends = sides.collect::<Vec<_>>().into_par_iter().map(|(index, side)| {
        let mut profile = Profile {
            model,
            criterion: Some(criterion()),
            index,
            others: found
                .z
                .iter()
                .enumerate()
                .filter(|(place, _)| *place != index)
                .map(|(_, z)| *z)
                .collect(),
            options,
            monitor,
        };
        let unknown = &model.parameters()[index];
        let least = 2.0 * found.value;
        let (z, slope) = (found.z[index], unknown.scale.slope(found.z[index]));
        if z == f64::NEG_INFINITY && side < 0.0 {
            return Ok(None);
        }
        let (z, width) = if z == f64::NEG_INFINITY {
            let little = unknown.scale.value(z) + LITTLE * (unknown.start - unknown.scale.value(z));
            (unknown.scale.variable(little), 1.0)
        } else {
            (z, two_sided(0.05) * (factor * found.covariance[(index, index)]).sqrt() / slope.abs())
        };
        // The root of the fall, which is a line where the likelihood is a parabola, less that of the border.
        let border = two_sided(0.05);
        let mut away = |distance: f64| -> Result<f64, Error> {
            let fall = profile.value(z + side * distance)?.map_or(f64::INFINITY, |value| value - least);
            Ok((fall.max(0.0) / factor).sqrt() - border)
        };
        let distance = crossing(&mut away, width, border)?;
        Ok(distance.map(|distance| unknown.scale.value(z + side * distance)))
    });
    let ends: Vec<Option<f64>> = ends.collect::<Result<_, Error>>()?;
    // A change of variable may turn the two around.
    let ordered = |pair: &[Option<f64>]| match (pair[0], pair[1]) {
        (Some(low), Some(high)) if low > high => [Some(high), Some(low)],
        (low, high) => [low, high],
    };
    Ok(ends.chunks_exact(2).map(ordered).collect())
}

/// Where a function that begins below 0 crosses it, by doubling and then by the Illinois method (Dowell and Jarratt
/// 1971).
fn crossing(
    away: &mut impl FnMut(f64) -> Result<f64, Error>,
    width: f64,
    border: f64,
) -> Result<Option<f64>, Error> {
    let (mut low, mut below) = (0.0, -border);
    let (mut high, mut above) = (width, away(width)?);
    let mut doublings = 0;
    while above < 0.0 {
        if doublings == DOUBLINGS {
            return Ok(None);
        }
        (low, below) = (high, above);
        (high, doublings) = (2.0 * high, doublings + 1);
        above = away(high)?;
    }
    let mut last_side = 0;
    for _ in 0..ITERATIONS {
        if high - low <= TOLERANCE * high {
            break;
        }
        // The middle, where there is no likelihood on the other side.
        let share = if above.is_finite() { below / (below - above) } else { 0.5 };
        let next = low + (high - low) * share;
        let value = away(next)?;
        let side = if value < 0.0 { -1 } else { 1 };
        if side < 0 {
            (low, below) = (next, value);
            above = if last_side == side && above.is_finite() { above / 2.0 } else { above };
        } else {
            (high, above) = (next, value);
            below = if last_side == side { below / 2.0 } else { below };
        }
        if value.abs() <= TOLERANCE * border {
            return Ok(Some(next));
        }
        last_side = side;
    }
    Ok(Some(0.5 * (low + high)))
}

/// The likelihood with one parameter held.
struct Profile<'a, L> {
    model: &'a GreyBox,
    criterion: Option<L>,
    index: usize,
    /// Where the others were at their best before.
    others: Vec<f64>,
    options: &'a Search,
    monitor: Monitor<'a>,
}

impl<L: Likelihood> Profile<'_, L> {
    /// -2 ln L, the others at their best; none where the filter does not work.
    fn value(&mut self, z: f64) -> Result<Option<f64>, Error> {
        let Some(criterion) = self.criterion.take() else { return Ok(None) };
        let size = self.others.len();
        let held = Held { criterion, index: self.index, full: vec![z; size + 1], slopes: Slopes::zero(size) };
        let mut deviance = Deviance::without(self.model, self.index, held);
        let options = Search { starts: 0, ..self.options.clone() };
        let found = if size == 0 {
            deviance.criterion.evaluate(&[]).map(|value| (2.0 * value, Vec::new()))
        } else {
            let deadline = Deadline::after(None);
            search(&mut deviance, &self.others, &options, f64::NEG_INFINITY, deadline, self.monitor)?
                .map(|found| (found.cost(), found.parameters))
        };
        self.criterion = Some(deviance.criterion.criterion);
        Ok(found.ok().map(|(value, others)| {
            self.others = others;
            value
        }))
    }
}

/// A likelihood of all parameters but one, which is held.
struct Held<L> {
    criterion: L,
    index: usize,
    full: Vec<f64>,
    slopes: Slopes,
}

impl<L> Held<L> {
    fn take(&mut self, z: &[f64]) {
        let (before, after) = z.split_at(self.index);
        self.full[..self.index].copy_from_slice(before);
        self.full[self.index + 1..].copy_from_slice(after);
    }
}

impl<L: Likelihood> Likelihood for Held<L> {
    fn measurements(&self) -> usize {
        self.criterion.measurements()
    }

    fn evaluate(&mut self, z: &[f64]) -> Result<f64, Failure> {
        self.take(z);
        self.criterion.evaluate(&self.full)
    }

    fn linearize(&mut self, z: &[f64]) -> Result<(), Failure> {
        self.take(z);
        self.criterion.linearize(&self.full)?;
        let (all, own) = (self.criterion.slopes(), self.full.len());
        let open = || (0..own).filter(|place| *place != self.index);
        self.slopes.squares = all.squares;
        self.slopes.gradient.clear();
        self.slopes.gradient.extend(open().map(|place| all.gradient[place]));
        self.slopes.information.clear();
        let entries = open().flat_map(|i| open().map(move |j| all.information[i * own + j]));
        self.slopes.information.extend(entries);
        Ok(())
    }

    fn slopes(&self) -> &Slopes {
        &self.slopes
    }
}
