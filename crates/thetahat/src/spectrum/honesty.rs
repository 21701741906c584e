//! Whether bands hold what they say: what smoothing hides shows when the resolution is doubled.

use thetahat_numerics::distribution::{binomial_mid_p, chi_square_tail};

use super::estimate::Line;

/// Of an estimate without bias this part of the points lies outside by chance.
const CHANCE: f64 = 0.05;
/// Up to twice that is taken for chance: neighbouring points are alike.
const MOST: f64 = 2.0 * CHANCE;

/// How many points move out of their region when the resolution is doubled.
pub(super) struct Outside {
    /// The points with a variance in both.
    pub(super) compared: usize,
    /// The angles of those that move, in radians per sample.
    pub(super) moved: Vec<f64>,
}

impl Outside {
    /// Whether they are as few as chance makes them: of few points one is soon a tenth.
    pub(super) fn is_chance(&self) -> bool {
        let count = self.moved.len();
        count as f64 <= MOST * self.compared as f64
            || binomial_mid_p(count, self.compared, CHANCE, 1.0) > CHANCE
    }
}

/// Compares an estimate with the same of twice the resolution, line by line. Half the smoothing has twice the variance
/// V, and what it adds is independent of the smoother estimate: the difference has the variance V of the smoother one,
/// and without bias
///
/// ```text
/// |G_fine - G|^2/V  ~  chi-square(2)
/// ```
///
/// with V that of the real part. A line counts as outside where that of an input is beyond the 95 % point
/// (Bonferroni's, of several). The bias of a window falls with the square of its width: what is seen is three fourths
/// of it. None if there is nothing to compare.
pub(super) fn outside(lines: &[Line], finer: &[Line]) -> Option<Outside> {
    let mut outside = Outside { compared: 0, moved: Vec::new() };
    for (line, finer) in lines.iter().zip(finer) {
        let (Ok(coarse), Ok(fine)) = (&line.found, &finer.found) else { continue };
        let (Some(variances), Some(own)) = (&coarse.variances, &fine.variances) else { continue };
        let mut all = coarse.responses.iter().zip(&fine.responses).zip(variances.iter().zip(own));
        let moves = all.any(|((g, fine), (variance, own))| {
            // A bias is in the noise of the smoother one, too.
            let added = variance.min(*own);
            let distance = (g - fine).norm_sqr() / added;
            added > 0.0 && chi_square_tail(distance, 2.0).is_some_and(|p| p < CHANCE / variances.len() as f64)
        });
        outside.compared += 1;
        if moves {
            outside.moved.push(line.angle);
        }
    }
    (outside.compared > 0).then_some(outside)
}
