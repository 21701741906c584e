//! Forward regression: the term that explains most of what is left comes next.
//!
//! With the columns orthogonalised as they are chosen (Chen, Billings and Luo, Orthogonal least squares methods and
//! their application to non-linear system identification, Int. J. Control 50, 1989), all that is needed of the columns
//! are their products. With d_j = phi_j' phi_j and c_j = phi_j' y at the start, the choice of s makes
//!
//! ```text
//! z = c_s/sqrt(d_s),   r_j = (phi_s' phi_j - sum over the chosen i of r_is r_ij)/sqrt(d_s),   d_j -= r_j^2,   c_j -= r_j z
//! ```
//!
//! which is a Cholesky factor of the Gram matrix with its pivots chosen by what they explain. The error reduction ratio
//! of s is z^2/(y'y). Cost: O(M K^2) for K of M terms.

/// A term of which less than this fraction of its square is orthogonal to the chosen ones is one of their sums.
const ALIASED: f64 = 1e-11;
/// Terms that explain as much as this close are tied.
const TIED: f64 = 1e-9;

/// A chosen term.
#[derive(Debug, Clone, PartialEq)]
pub struct Chosen {
    /// Its place among the candidates.
    pub place: usize,
    /// The error reduction ratio: the share of the target's square that it explains.
    pub reduction: f64,
    /// Other candidates that are sums of this term and those before, and can no longer be told from them.
    pub aliases: Vec<usize>,
    /// Its column of the triangle R, with the pivot last.
    column: Vec<f64>,
    /// Its entry of Q'y.
    rotated: f64,
}

/// The terms in the order of their choice.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Path {
    /// The first chosen stands first.
    pub chosen: Vec<Chosen>,
}

impl Path {
    /// The least-squares coefficients of the first `count` terms: R theta = Q'y.
    pub fn coefficients(&self, count: usize) -> Vec<f64> {
        let chosen = &self.chosen[..count.min(self.chosen.len())];
        let mut theta: Vec<f64> = chosen.iter().map(|term| term.rotated).collect();
        for at in (0..theta.len()).rev() {
            theta[at] /= chosen[at].column[at];
            let (before, own) = theta.split_at_mut(at);
            for (sum, entry) in before.iter_mut().zip(&chosen[at].column) {
                *sum -= entry * own[0];
            }
        }
        theta
    }

    /// The places of the first terms.
    pub fn places(&self, count: usize) -> Vec<usize> {
        self.chosen.iter().take(count).map(|term| term.place).collect()
    }

    /// The sum of squared errors of the first terms, as a fraction of that of the target.
    pub fn left(&self, count: usize) -> f64 {
        self.chosen.iter().take(count).fold(1.0, |left, term| left - term.reduction)
    }
}

/// Chooses `most` terms at most; fewer where no other is left, or nothing is left to explain. `gram` gives the product
/// of two candidates, `cross` that of each with the target, whose square is `energy`. Those of `first` are taken first,
/// in their order, as far as they are no sums of others. Ties go to the candidate that comes first in `preferred`: it
/// gives a rank for each.
pub fn forward(
    gram: impl Fn(usize, usize) -> f64,
    cross: &[f64],
    energy: f64,
    first: &[usize],
    preferred: &[usize],
    most: usize,
) -> Path {
    let mut first = first.iter().copied();
    let count = cross.len();
    let squares: Vec<f64> = (0..count).map(|place| gram(place, place)).collect();
    let mut left = squares.clone();
    let mut products = cross.to_vec();
    let mut open: Vec<bool> = squares.iter().map(|square| *square > 0.0).collect();
    // For each candidate its entries of R.
    let mut entries: Vec<Vec<f64>> = vec![Vec::new(); count];
    let mut path = Path::default();
    while path.chosen.len() < most {
        let gain = |place: usize| products[place] * products[place] / left[place];
        let next = first.find(|place| open[*place]).or_else(|| {
            let largest = (0..count).filter(|place| open[*place]).map(gain).fold(0.0, f64::max);
            if largest <= f64::EPSILON * f64::EPSILON * energy {
                return None;
            }
            let tied = (0..count).filter(|place| open[*place] && gain(*place) >= largest * (1.0 - TIED));
            tied.min_by_key(|place| preferred[*place])
        });
        let Some(best) = next else { break };
        let pivot = left[best].sqrt();
        let rotated = products[best] / pivot;
        let own = std::mem::take(&mut entries[best]);
        open[best] = false;
        let mut aliases = Vec::new();
        for place in (0..count).filter(|place| open[*place]).collect::<Vec<_>>() {
            let explained = super::product(&own, &entries[place]);
            let entry = (gram(best, place) - explained) / pivot;
            entries[place].push(entry);
            left[place] -= entry * entry;
            products[place] -= entry * rotated;
            if left[place] <= ALIASED * squares[place] {
                open[place] = false;
                aliases.push(place);
            }
        }
        path.chosen.push(Chosen {
            place: best,
            reduction: rotated * rotated / energy,
            aliases,
            column: [&own[..], &[pivot]].concat(),
            rotated,
        });
    }
    path
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coefficients_are_those_of_least_squares() {
        let rows = 50;
        let column = |place: usize, t: usize| ((t * t + 3 * t * (place + 1)) % (11 + place)) as f64 - 4.0;
        let y = |t: usize| 2.0 * column(3, t) - 0.5 * column(1, t) + 0.1 * ((t * 7) % 5) as f64;
        let gram = |i: usize, j: usize| (0..rows).map(|t| column(i, t) * column(j, t)).sum::<f64>();
        let cross: Vec<f64> = (0..5).map(|i| (0..rows).map(|t| column(i, t) * y(t)).sum()).collect();
        let energy = (0..rows).map(|t| y(t) * y(t)).sum::<f64>();
        let path = forward(gram, &cross, energy, &[], &[0, 1, 2, 3, 4], 4);
        assert_eq!(path.places(1), [3]);
        for count in 1..=path.chosen.len() {
            let (places, theta) = (path.places(count), path.coefficients(count));
            let error =
                |t: usize| y(t) - places.iter().zip(&theta).map(|(p, c)| c * column(*p, t)).sum::<f64>();
            for place in places.clone() {
                let product: f64 = (0..rows).map(|t| error(t) * column(place, t)).sum();
                assert!(product.abs() < 1e-8, "{product}");
            }
            let left: f64 = (0..rows).map(|t| error(t).powi(2)).sum();
            assert!((left / energy - path.left(count)).abs() < 1e-12);
        }
        let forced = forward(gram, &cross, energy, &[4, 0], &[0, 1, 2, 3, 4], 3);
        assert_eq!(forced.places(3), [4, 0, 3]);
    }

    #[test]
    fn ties_go_to_the_preferred_and_name_their_aliases() {
        // The second is twice the first, the third something else.
        let column = |place: usize, t: usize| match place {
            0 => 2.0 * (t % 3) as f64,
            1 => (t % 3) as f64,
            _ => (t % 7) as f64,
        };
        let gram = |i: usize, j: usize| (0..40).map(|t| column(i, t) * column(j, t)).sum::<f64>();
        let cross: Vec<f64> = (0..3).map(|i| gram(i, 1)).collect();
        let path = forward(gram, &cross, gram(1, 1), &[], &[1, 0, 2], 3);
        assert_eq!((path.chosen[0].place, &path.chosen[0].aliases[..]), (1, &[0][..]));
        assert_eq!(path.chosen.len(), 1, "nothing is left to explain");
        assert!(path.coefficients(0).is_empty());
    }
}
