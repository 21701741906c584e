//! Noise that integrates: D has the factor 1 - q^-1.
//!
//! ```text
//! A y = B/F u + C/((1 - q^-1) D') e   <=>   A (1 - q^-1) y = B/F (1 - q^-1) u + C/D' e
//! ```
//!
//! The plant is estimated from changes, and the noise is a random walk with a level of its own everywhere: an ARIMAX
//! model (Ljung, System Identification, 2nd ed. 1999, section 4.2; Box, Jenkins and Reinsel, Time Series Analysis,
//! 1994, chapter 4). The level of the output is no parameter of it.

use thetahat_numerics::optimize::{Monitor, Search};

use super::{Estimate, Initial, Method, estimate_of_channels};
use crate::Error;
use crate::data::{Differenced, Record};
use crate::model::Orders;

/// Fits a model whose D, of these orders, has the factor 1 - q^-1.
///
/// # Errors
/// As for [`estimate`](super::estimate()).
pub(crate) fn with_noise_integrator(
    record: &Record<'_>,
    orders: &Orders,
    inputs: &[String],
    search: &Search,
    monitor: Monitor<'_>,
) -> Result<Estimate, Error> {
    let changes = Differenced::new(record);
    let of_changes = Orders { nd: orders.nd.saturating_sub(1), ..orders.clone() };
    let data = changes.record();
    // What a search begins with is of all parameters.
    let method = Method::PredictionError(Search { initial_parameters: None, ..search.clone() });
    let estimate = estimate_of_channels(&data, inputs, &of_changes, &method, Initial::Auto, monitor)?;
    Ok(estimate.integrated(&of_changes))
}

impl Estimate {
    /// The estimate of the signals from that of their changes: (1 - q^-1) D' in the place of D'.
    ///
    /// d_1 = d'_1 - 1, d_i = d'_i - d'_(i-1), d_(n+1) = -d'_n. That is linear, so the covariance is T P T'.
    fn integrated(self, of_changes: &Orders) -> Self {
        let before = of_changes.na + of_changes.nb.iter().sum::<usize>() + of_changes.nc;
        let nd = of_changes.nd;
        // Each parameter as a sum of those before, with signs.
        let of = |place: usize| -> Vec<(usize, f64)> {
            match place.checked_sub(before) {
                None => vec![(place, 1.0)],
                Some(power) if power <= nd => {
                    let own = (power < nd).then_some((place, 1.0));
                    let last = (power > 0).then(|| (place - 1, -1.0));
                    own.into_iter().chain(last).collect()
                }
                Some(_) => vec![(place - 1, 1.0)],
            }
        };
        let terms: Vec<Vec<(usize, f64)>> = (0..=self.parameters.len()).map(of).collect();
        let parameters = terms.iter().enumerate().map(|(place, terms)| {
            let constant = if place == before { -1.0 } else { 0.0 };
            terms.iter().fold(constant, |sum, (from, sign)| sum + sign * self.parameters[*from])
        });
        let product = |covariance: &Vec<Vec<f64>>| -> Vec<Vec<f64>> {
            let entry = |rows: &[(usize, f64)], columns: &[(usize, f64)]| -> f64 {
                let all = rows.iter().flat_map(|row| columns.iter().map(move |column| (row, column)));
                all.fold(0.0, |sum, ((i, a), (j, b))| sum + a * b * covariance[*i][*j])
            };
            terms.iter().map(|rows| terms.iter().map(|columns| entry(rows, columns)).collect()).collect()
        };
        // Changes may begin with zeros before them; what they are changes of has a level.
        let filters = of_changes.nf.iter().any(|&nf| nf > 0);
        let initial = if filters { Initial::Estimate } else { Initial::Drop };
        let covariance = self.covariance.as_ref().map(product);
        Self { parameters: parameters.collect(), covariance, initial, ..self }
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;
    use crate::estimate::Procedure;

    /// y = 0.2 q^-1/(1 - 0.8 q^-1) u + (1 - 0.5 q^-1)/((1 - q^-1)(1 - 0.3 q^-1)) e.
    #[test]
    fn the_root_1_of_d_is_exact_and_the_other_parameters_are_those_of_the_changes() {
        let u: Vec<f64> = (0..400_u32).map(|t| f64::from(t * t % 11) - 5.0).collect();
        let e: Vec<f64> = (0..400_u32).map(|t| f64::from(t * t * 7 % 13) / 13.0 - 0.5).collect();
        let (mut x, mut n, mut y) = (0.0, [0.0; 2], Vec::new());
        for t in 0..u.len() {
            if t > 0 {
                x = 0.8 * x + 0.2 * u[t - 1];
            }
            let own = e[t] - if t > 0 { 0.5 * e[t - 1] } else { 0.0 } + 1.3 * n[0] - 0.3 * n[1];
            n = [own, n[0]];
            y.push(x + own);
        }
        let record = Record::new(&y, vec![&u]).unwrap();
        let orders = Orders::bj(&[1], 1, 2, &[1], &[1]).unwrap();
        let search = Search::default();
        let monitor: Monitor<'_> = &|_| ControlFlow::Continue(());
        let found = with_noise_integrator(&record, &orders, &["u".to_owned()], &search, monitor).unwrap();
        let [b, c, d1, d2, f] = found.parameters() else { panic!("{:?}", found.parameters()) };
        assert!((1.0 + d1 + d2).abs() < 1e-14);
        assert!((b - 0.2).abs() < 0.02 && (f + 0.8).abs() < 0.02, "{b} {f}");
        // d_2 = -d', and d_1 = d' - 1 has the same error; those of the others are their own.
        let covariance = found.covariance().unwrap();
        assert_eq!((covariance[2][2], covariance[2][3]), (covariance[3][3], -covariance[3][3]));
        assert_eq!(covariance[1][3], -covariance[1][2]);
        assert!(c.is_finite() && matches!(found.procedure(), Procedure::PredictionError(_)));
        assert_eq!(found.initial(), Initial::Estimate);
    }
}
