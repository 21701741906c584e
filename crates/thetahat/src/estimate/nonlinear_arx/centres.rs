//! Where radial basis functions stand.

use oorandom::Rand64;

use crate::model::Map;

/// Iterations of k-means at most.
const ITERATIONS: usize = 100;
/// Neighbours overlap: a function is exp(-1/4) where its nearest neighbour stands.
const OVERLAP: f64 = 2.0;

/// Points that functions may stand at.
pub(crate) fn spread(points: &[Vec<f64>], most: usize) -> Vec<Vec<f64>> {
    let count = points.len().min(most);
    let mut found: Vec<Vec<f64>> = (0..count).map(|k| points[k * points.len() / count].clone()).collect();
    found.dedup();
    found
}

/// A grid over the range of the points, `each` in each direction.
pub(crate) fn grid(points: &[Vec<f64>], each: usize) -> Vec<Vec<f64>> {
    let mut found = vec![Vec::new()];
    for (low, high) in ranges(points) {
        let value = |k: usize| {
            if each == 1 {
                f64::midpoint(low, high)
            } else {
                low + (high - low) * k as f64 / (each - 1) as f64
            }
        };
        found = found
            .iter()
            .flat_map(|point: &Vec<f64>| (0..each).map(move |k| [&point[..], &[value(k)]].concat()))
            .collect();
    }
    found
}

/// Pseudo-random points in the range of the points.
pub(crate) fn random(points: &[Vec<f64>], count: usize, seed: u64) -> Vec<Vec<f64>> {
    let (ranges, mut numbers) = (ranges(points), Rand64::new(u128::from(seed)));
    let mut point = || ranges.iter().map(|(low, high)| low + (high - low) * numbers.rand_float()).collect();
    (0..count).map(|_| point()).collect()
}

/// The means of clusters (Lloyd 1982), from starts that lie apart (Arthur and Vassilvitskii 2007).
pub(crate) fn clusters(points: &[Vec<f64>], count: usize, seed: u64) -> Vec<Vec<f64>> {
    let mut numbers = Rand64::new(u128::from(seed));
    let mut centres: Vec<Vec<f64>> =
        vec![points[numbers.rand_range(0..points.len() as u64) as usize].clone()];
    let mut away: Vec<f64> = vec![f64::INFINITY; points.len()];
    while centres.len() < count {
        let last = &centres[centres.len() - 1];
        away.iter_mut().zip(points).for_each(|(away, point)| *away = away.min(square(point, last)));
        let total: f64 = away.iter().sum();
        if total <= 0.0 {
            break;
        }
        let mut left = numbers.rand_float() * total;
        let next = away.iter().position(|away| {
            left -= away;
            left < 0.0
        });
        centres.push(points[next.unwrap_or(points.len() - 1)].clone());
    }
    let mut own = vec![usize::MAX; points.len()];
    for _ in 0..ITERATIONS {
        let nearest = |point: &Vec<f64>| {
            let each = centres.iter().enumerate().map(|(place, centre)| (square(point, centre), place));
            each.min_by(|(one, _), (other, _)| one.total_cmp(other)).map_or(0, |(_, place)| place)
        };
        let found: Vec<usize> = points.iter().map(nearest).collect();
        if found == own {
            break;
        }
        own = found;
        for (place, centre) in centres.iter_mut().enumerate() {
            let members: Vec<&Vec<f64>> =
                points.iter().zip(&own).filter(|(_, own)| **own == place).map(|(point, _)| point).collect();
            if members.is_empty() {
                continue;
            }
            for (axis, value) in centre.iter_mut().enumerate() {
                *value = members.iter().map(|point| point[axis]).sum::<f64>() / members.len() as f64;
            }
        }
    }
    centres
}

/// Functions at some points. Without a width, each is as wide as it takes to overlap with its nearest neighbour; or all
/// alike, by the spread of the points of the fit.
pub(crate) fn map(
    centres: Vec<Vec<f64>>,
    width: Option<f64>,
    points: &[Vec<f64>],
    alike: bool,
    linear: bool,
) -> Map {
    let common = || {
        let count = points.len() as f64;
        let axes = points.first().map_or(0, Vec::len);
        let variance = |axis: usize| {
            let mean = points.iter().map(|point| point[axis]).sum::<f64>() / count;
            points.iter().map(|point| (point[axis] - mean).powi(2)).sum::<f64>() / count
        };
        // The root of the mean squared distance of two points; they may all be one.
        Some((2.0 * (0..axes).map(variance).sum::<f64>()).sqrt()).filter(|width| *width > 0.0).unwrap_or(1.0)
    };
    let nearest = |place: usize| {
        let others = centres.iter().enumerate().filter(|(other, _)| *other != place);
        let least =
            others.map(|(_, other)| square(&centres[place], other)).fold(f64::INFINITY, f64::min).sqrt();
        if least.is_finite() && least > 0.0 { OVERLAP * least } else { common() }
    };
    let widths = match width {
        Some(width) => vec![width; centres.len()],
        None if alike => vec![common(); centres.len()],
        None => (0..centres.len()).map(nearest).collect(),
    };
    Map::Radial { centres, widths, linear }
}

fn ranges(points: &[Vec<f64>]) -> Vec<(f64, f64)> {
    let axes = points.first().map_or(0, Vec::len);
    let range = |axis: usize| {
        points
            .iter()
            .map(|point| point[axis])
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)))
    };
    (0..axes).map(range).collect()
}

fn square(one: &[f64], other: &[f64]) -> f64 {
    one.iter().zip(other).map(|(one, other)| (one - other).powi(2)).sum()
}

#[cfg(test)]
mod tests;
