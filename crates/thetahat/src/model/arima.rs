//! Seasonal ARIMA models: polynomials that are products of few factors.
//!
//! ```text
//! y(t) = c + m t + sum_j B_j(q) u_j(t) + z(t)
//! phi(q) Phi(q^s) (1 - q^-1)^d (1 - q^-s)^D z(t) = theta(q) Theta(q^s) e(t)
//!
//! phi(q) = 1 - ar1 q^-1 - … - ar_p q^-p              theta(q) = 1 + ma1 q^-1 + … + ma_q q^-q
//! Phi(q^s) = 1 - sar_s q^-s - … - sar_Ps q^-Ps       Theta(q^s) = 1 + sma_s q^-s + … + sma_Qs q^-Qs
//! ```
//!
//! That is y = B u + C/D e with C = theta Theta and D = phi Phi (1 - q^-1)^d (1 - q^-s)^D, whose coefficients are
//! functions of few parameters (Box and Jenkins, Time Series Analysis: Forecasting and Control, 1970, chapter 9).

#[cfg(test)]
mod tests;

use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::orders::LARGEST;
use super::polynomial::product;
use crate::Error;

/// The orders (p, d, q)(P, D, Q, s) of a seasonal ARIMA model.
///
/// ```
/// use thetahat::model::ArimaOrders;
///
/// let airline = ArimaOrders::new([0, 1, 1], Some([0, 1, 1, 12]))?;
/// assert_eq!(airline.names(), ["ma1", "sma12"]);
/// assert_eq!(airline.to_string(), "ARIMA(0, 1, 1)(0, 1, 1, 12)");
/// assert_eq!(airline.differences(), 13);
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct ArimaOrders {
    /// p, d and q: autoregressive parameters, differences, and parameters of the moving average.
    pub order: [usize; 3],
    /// P, D, Q and s: the same over seasons, and the rows that a season has; none without seasons.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seasonal: Option<[usize; 4]>,
}

/// A factor of C or D, by the lags of its parameters and their sign in it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Factor {
    Ar,
    Ma,
    SeasonalAr,
    SeasonalMa,
}

impl Factor {
    /// In the order of the parameters.
    pub(crate) const ALL: [Self; 4] = [Self::Ar, Self::Ma, Self::SeasonalAr, Self::SeasonalMa];

    fn letters(self) -> &'static str {
        match self {
            Self::Ar => "ar",
            Self::Ma => "ma",
            Self::SeasonalAr => "sar",
            Self::SeasonalMa => "sma",
        }
    }

    /// Whether it is one of D.
    pub(crate) fn is_autoregressive(self) -> bool {
        matches!(self, Self::Ar | Self::SeasonalAr)
    }
}

/// A and C of the process after differencing, A w = C e, with their derivatives by each parameter of the factors.
#[derive(Debug, Clone)]
pub(crate) struct Expanded {
    pub(crate) a: Vec<f64>,
    pub(crate) c: Vec<f64>,
    /// dA and dC for each parameter; none where no derivatives are wanted.
    pub(crate) slopes: Vec<(Vec<f64>, Vec<f64>)>,
}

impl ArimaOrders {
    /// # Errors
    /// [`Error::Argument`] if a season has fewer than two rows, there are seasonal orders without a season or a season
    /// without orders, or a lag is above 1000.
    pub fn new(order: [usize; 3], seasonal: Option<[usize; 4]>) -> Result<Self, Error> {
        let orders = Self { order, seasonal: seasonal.filter(|seasonal| *seasonal != [0; 4]) };
        if let Some([p, d, q, season]) = orders.seasonal {
            if season < 2 {
                return Err(Error::argument(
                    "seasonal",
                    format!(
                        "a season has two rows at least, and s is {season}; write P,D,Q,s, such as 0,1,1,12"
                    ),
                ));
            }
            if [p, d, q] == [0; 3] {
                return Err(Error::argument(
                    "seasonal",
                    "P, D and Q are 0: there is nothing seasonal; leave it out, or raise one of them",
                ));
            }
        }
        let lag = |own: usize, seasonal: usize| -> usize {
            own.saturating_add(seasonal.saturating_mul(orders.season().max(1)))
        };
        let [sp, sd, sq, _] = orders.seasonal.unwrap_or_default();
        let [p, d, q] = order;
        let longest = lag(p.saturating_add(d), sp.saturating_add(sd)).max(lag(q, sq));
        if longest > LARGEST {
            return Err(Error::argument(
                "order",
                format!(
                    "the model reaches {longest} rows back, and {LARGEST} is the most; lower the orders or s"
                ),
            ));
        }
        Ok(orders)
    }

    /// s; zero without seasons.
    pub fn season(&self) -> usize {
        self.seasonal.map_or(0, |[.., season]| season)
    }

    /// How many parameters a factor has, and how many rows one lag of it is.
    pub(crate) fn factor(&self, factor: Factor) -> (usize, usize) {
        let [p, _, q] = self.order;
        let [sp, _, sq, season] = self.seasonal.unwrap_or_default();
        match factor {
            Factor::Ar => (p, 1),
            Factor::Ma => (q, 1),
            Factor::SeasonalAr => (sp, season),
            Factor::SeasonalMa => (sq, season),
        }
    }

    /// The number of parameters of all factors.
    pub fn parameters(&self) -> usize {
        Factor::ALL.iter().map(|factor| self.factor(*factor).0).sum()
    }

    /// The names of the parameters of the factors: `ar1`, `ma1`, `sar12`, `sma12`, by the lag in rows.
    pub fn names(&self) -> Vec<String> {
        let of = |factor: &Factor| {
            let (count, rows) = self.factor(*factor);
            let letters = factor.letters();
            (1..=count).map(move |lag| format!("{letters}{}", lag * rows))
        };
        Factor::ALL.iter().flat_map(of).collect()
    }

    /// d + D: how often the output is differenced.
    pub fn integrations(&self) -> usize {
        self.order[1] + self.seasonal.map_or(0, |[_, d, ..]| d)
    }

    /// d + s D: the rows that differencing takes.
    pub fn differences(&self) -> usize {
        self.order[1] + self.seasonal.map_or(0, |[_, d, _, season]| d * season)
    }

    /// (1 - q^-1)^d (1 - q^-s)^D.
    pub(crate) fn differencing(&self) -> Vec<f64> {
        let mut difference = vec![1.0];
        for _ in 0..self.order[1] {
            difference = product(&difference, &[1.0, -1.0]);
        }
        if let Some([_, d, _, season]) = self.seasonal {
            let mut seasonal = vec![0.0; season + 1];
            (seasonal[0], seasonal[season]) = (1.0, -1.0);
            for _ in 0..d {
                difference = product(&difference, &seasonal);
            }
        }
        difference
    }

    /// Each factor as a monic polynomial in its own lag, in the order of [`Factor::ALL`].
    pub(crate) fn factors(&self, parameters: &[f64]) -> [Vec<f64>; 4] {
        let mut parameters = parameters.iter();
        Factor::ALL.map(|factor| {
            let (count, _) = self.factor(factor);
            let sign = if factor.is_autoregressive() { -1.0 } else { 1.0 };
            let own = parameters.by_ref().take(count).map(|value| sign * value);
            std::iter::once(1.0).chain(own).collect()
        })
    }

    /// A = phi Phi and C = theta Theta.
    pub(crate) fn expanded(&self, parameters: &[f64], with_slopes: bool) -> Expanded {
        let in_rows = |factor: Factor, monic: &[f64]| -> Vec<f64> {
            let (_, rows) = self.factor(factor);
            let mut spread = vec![0.0; (monic.len() - 1) * rows + 1];
            monic.iter().enumerate().for_each(|(lag, value)| spread[lag * rows] = *value);
            spread
        };
        let factors = self.factors(parameters);
        let [ar, ma, seasonal_ar, seasonal_ma] =
            [0, 1, 2, 3].map(|place| in_rows(Factor::ALL[place], &factors[place]));
        let (a, c) = (product(&ar, &seasonal_ar), product(&ma, &seasonal_ma));
        let mut slopes = Vec::new();
        if with_slopes {
            for (factor, other) in Factor::ALL.into_iter().zip([&seasonal_ar, &seasonal_ma, &ar, &ma]) {
                let (count, rows) = self.factor(factor);
                for lag in 1..=count {
                    let sign = if factor.is_autoregressive() { -1.0 } else { 1.0 };
                    let mut own = vec![0.0; if factor.is_autoregressive() { a.len() } else { c.len() }];
                    own[lag * rows..].iter_mut().zip(other).for_each(|(own, other)| *own = sign * other);
                    slopes.push(if factor.is_autoregressive() {
                        (own, vec![0.0; c.len()])
                    } else {
                        (vec![0.0; a.len()], own)
                    });
                }
            }
        }
        Expanded { a, c, slopes }
    }

    /// The names of all parameters of a model with these inputs: `constant`, `drift`, `b0` or `b1_0`, `b2_0`, …, then
    /// those of the factors.
    pub(crate) fn all_names(&self, constant: bool, drift: bool, inputs: &[usize]) -> Vec<String> {
        let several = inputs.len() > 1;
        let lines = [(constant, "constant"), (drift, "drift")];
        let lines = lines.into_iter().filter(|(there, _)| *there).map(|(_, name)| name.to_owned());
        let of_input = |(input, nk): (usize, &usize)| match several {
            true => format!("b{}_{nk}", input + 1),
            false => format!("b{nk}"),
        };
        lines.chain(inputs.iter().enumerate().map(of_input)).chain(self.names()).collect()
    }
}

/// `ARIMA(1, 1, 1)(0, 1, 1, 12)`.
impl fmt::Display for ArimaOrders {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [p, d, q] = self.order;
        write!(out, "ARIMA({p}, {d}, {q})")?;
        match self.seasonal {
            Some([p, d, q, season]) => write!(out, "({p}, {d}, {q}, {season})"),
            None => Ok(()),
        }
    }
}
