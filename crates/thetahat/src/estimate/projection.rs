//! Variable projection between bounds: what searches have in common that move some parameters, each of which stays in a
//! range, while the others are least squares for these (Golub and Pereyra 1973).

use thetahat_numerics::regression::product;

/// Why parameters have no cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Refusal {
    /// They are outside of their limits.
    Outside,
    /// The errors are no numbers.
    Overflow,
}

/// # Errors
/// [`Refusal::Outside`] for a parameter that is not between its limits.
pub(super) fn check_inside(point: &[f64], limits: &[[f64; 2]]) -> Result<(), Refusal> {
    let inside = |(value, [low, high]): (&f64, &[f64; 2])| value >= low && value <= high;
    if point.iter().zip(limits).all(inside) { Ok(()) } else { Err(Refusal::Outside) }
}

/// Moves parameters onto the bound that they would cross. They stay there from then on, see [`NormalEquations`].
pub(super) fn draw_in(trial: &mut [f64], limits: &[[f64; 2]]) {
    for (value, [low, high]) in trial.iter_mut().zip(limits) {
        *value = value.clamp(*low, *high);
    }
}

/// psi' psi, row by row, and psi' e, of the parameters that are searched for.
#[derive(Debug, Clone, Default)]
pub(super) struct NormalEquations {
    pub(super) matrix: Vec<f64>,
    pub(super) right: Vec<f64>,
}

impl NormalEquations {
    /// Of columns of psi less their part in the span of the linear ones (Kaufman 1975). A parameter that would leave
    /// through the bound that it stands on stays where it is. O(N p^2).
    pub(super) fn new(
        mut columns: Vec<Vec<f64>>,
        residuals: &[f64],
        point: &[f64],
        limits: &[[f64; 2]],
    ) -> Self {
        let mut right: Vec<f64> = columns.iter().map(|column| product(column, residuals)).collect();
        for (((column, right), value), [low, high]) in
            columns.iter_mut().zip(&mut right).zip(point).zip(limits)
        {
            if value <= low && *right < 0.0 || value >= high && *right > 0.0 {
                column.fill(0.0);
                *right = 0.0;
            }
        }
        let matrix =
            columns.iter().flat_map(|left| columns.iter().map(|right| product(left, right))).collect();
        Self { matrix, right }
    }
}
