use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::DMatrix;
use thetahat_numerics::distribution::{student_factor, student_two_sided};

use super::arima::{ArimaOrders, Expanded};
use super::polynomial::product;
use super::quantity::{Quantity, Root};
use crate::Error;
use crate::data::Offset;
use crate::model::{Orders, Structure};

/// A channel as a model sees it: its name, and what its values are measured from.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
pub struct Signal {
    /// The channel's name in the log.
    pub name: String,
    /// What was taken from the channel before the fit, and is put back in predictions.
    pub offset: Offset,
}

/// One estimated coefficient.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Parameter {
    /// Such as `a1` or `b3`: the letter of its polynomial and the power of q^-1 that it multiplies.
    pub name: String,
    /// The estimate.
    pub value: f64,
    /// The square root of its variance; none where no theory gives one.
    pub standard_error: Option<f64>,
}

/// The uncertainty of the output's offset, which is an estimate as the parameters are: found with them, or subtracted
/// before the fit as a mean or a line. With it the model is, in deviations,
///
/// ```text
/// A(q) y(t) = sum_j B_j(q)/F_j(q) u_j(t) + k + m (t - t_m) + C(q)/D(q) e(t)
/// ```
///
/// where k and m are zero as estimated, and uncertain. The offset of an input is part of what y's offset means, and is
/// not.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct OffsetCovariance {
    /// The covariance matrix of the parameters, of k, and of m in units of y per second where a slope was taken, as all
    /// of them are unknown, row by row. Where the offset was taken before the fit, with the square of what its estimate
    /// would have changed.
    pub covariance: Vec<Vec<f64>>,
    /// t_m, in seconds from a log's first row, where a slope was taken.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub middle: Option<f64>,
}

impl OffsetCovariance {
    /// How many numbers there are beside the parameters.
    pub(super) fn count(&self) -> usize {
        1 + usize::from(self.middle.is_some())
    }
}

/// The factors of a seasonal ARIMA model: its own parameters, of which the coefficients of C and D are functions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct ArimaFactors {
    /// (p, d, q)(P, D, Q, s).
    #[serde(flatten)]
    pub orders: ArimaOrders,
    /// The parameters with their standard errors: the constant, the drift and the coefficients of inputs, as far as
    /// there are any, then those of the factors, such as `ar1`, `ma1`, `sar12` and `sma12`.
    pub parameters: Vec<Parameter>,
    /// The covariance matrix of these, row by row; none where it cannot be computed.
    pub covariance: Option<Vec<Vec<f64>>>,
}

/// An estimated model: A(q) y(t) = sum_j B_j(q)/F_j(q) u_j(t) + C(q)/D(q) e(t), var e = `noise_variance`.
///
/// Polynomials are written in rising powers of q^-1: `b[j][i]` multiplies u_j(t - i), so B begins with nk zeros.
/// y and u are deviations from the signals' offsets.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct PolynomialModel {
    /// Which polynomials there are.
    pub structure: Structure,
    /// How long they are.
    pub orders: Orders,
    /// Seconds from one sample to the next.
    pub sample_time: f64,
    /// The inputs, in the order of `b`.
    pub inputs: Vec<Signal>,
    /// The output: a list of one in the document.
    #[serde(rename = "outputs", with = "only")]
    #[schemars(with = "[Signal; 1]")]
    pub output: Signal,
    /// A, monic.
    pub a: Vec<f64>,
    /// B, one for each input.
    pub b: Vec<Vec<f64>>,
    /// C, monic.
    pub c: Vec<f64>,
    /// D, monic.
    pub d: Vec<f64>,
    /// F, monic, one for each input.
    pub f: Vec<Vec<f64>>,
    /// The variance of e: the sum of squared residuals over N - p. A matrix of one row in the document.
    #[serde(rename = "noise_covariance", with = "only_variance")]
    #[schemars(with = "[[f64; 1]; 1]")]
    pub noise_variance: f64,
    /// N - p, less the initial conditions that were estimated: the degrees of freedom of `noise_variance`. None where
    /// it was not estimated so, and in reports that do not say.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub degrees_of_freedom: Option<usize>,
    /// The coefficients with their standard errors, in the order of `covariance`.
    pub parameters: Vec<Parameter>,
    /// The covariance matrix of the parameters, row by row; none where no theory gives one, and where it cannot be
    /// computed, as at the stability boundary.
    pub covariance: Option<Vec<Vec<f64>>>,
    /// The uncertainty of the output's offset together with the parameters; none where it was given, where it is not
    /// known, and in reports that do not say. Predictions, forecasts and drawn runs count it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub offset_covariance: Option<OffsetCovariance>,
    /// The factors of C and D of a seasonal ARIMA model: its own parameters, of which those above are functions. None
    /// of other models.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub factors: Option<ArimaFactors>,
    /// The roots of A, then of each F, in the z plane, the largest of each polynomial first.
    pub poles: Vec<Root>,
    /// The finite roots of B in the z plane, for each input.
    pub zeros: Vec<Vec<Root>>,
    /// The roots of D: what the noise has beside the roots of A.
    pub noise_poles: Vec<Root>,
    /// The roots of C.
    pub noise_zeros: Vec<Root>,
    /// B(1)/(A(1) F(1)) for each input, in units of y per unit of u; none at an integrator.
    pub dc_gain: Vec<Option<Quantity>>,
    /// Whether all poles lie inside the unit circle.
    pub stable: bool,
    /// -T/ln|p| in seconds for each pole p, T being the sample time; none for |p| >= 1.
    pub time_constants: Vec<Option<Quantity>>,
}

/// Coefficients that differ by less, relative to 1 and themselves, are the same.
const SAME: f64 = 1e-9;

/// Where |D(1)| is below this fraction of what it is a sum of, D has the root 1.
const INTEGRATOR: f64 = 1e-9;

impl PolynomialModel {
    /// Whether the noise integrates, D(1) = 0: its level wanders without end.
    pub fn noise_integrates(&self) -> bool {
        let size: f64 = self.d.iter().map(|d| d.abs()).sum();
        self.d.iter().sum::<f64>().abs() <= INTEGRATOR * size
    }
}

impl ArimaFactors {
    /// The equation, such as (1 - q^-1) (1 - q^-12) y(t) = theta(q) Theta(q^12) e(t). z is the output without what a
    /// constant, a drift and inputs do.
    pub fn equation(&self) -> String {
        let orders = &self.orders;
        let season = orders.season();
        let ([p, d, q], [sp, sd, sq, _]) = (orders.order, orders.seasonal.unwrap_or_default());
        let power = |times: usize| if times > 1 { format!("^{times}") } else { String::new() };
        let inputs = self.parameters.iter().filter(|parameter| parameter.name.starts_with('b')).count();
        let has = |name: &str| self.parameters.iter().any(|parameter| parameter.name == name);
        let terms = [
            (has("constant"), "constant"),
            (has("drift"), "drift t"),
            (inputs == 1, "B(q) u(t)"),
            (inputs > 1, "sum_j B_j(q) u_j(t)"),
            (true, "z(t)"),
        ];
        let terms: Vec<&str> = terms.into_iter().filter(|(there, _)| *there).map(|(_, term)| term).collect();
        let of = if terms.len() > 1 { "z(t)" } else { "y(t)" };
        let left = [
            (p > 0, "phi(q) ".to_owned()),
            (sp > 0, format!("Phi(q^{season}) ")),
            (d > 0, format!("(1 - q^-1){} ", power(d))),
            (sd > 0, format!("(1 - q^-{season}){} ", power(sd))),
        ];
        let right = [(q > 0, "theta(q) ".to_owned()), (sq > 0, format!("Theta(q^{season}) "))];
        let side = |factors: &[(bool, String)]| -> String {
            factors.iter().filter(|(there, _)| *there).map(|(_, factor)| factor.as_str()).collect()
        };
        let equation = format!("{}{of} = {}e(t)", side(&left), side(&right));
        if terms.len() > 1 { format!("y(t) = {}, {equation}", terms.join(" + ")) } else { equation }
    }

    /// Checks factors that were read: that the polynomials of the model are their products.
    pub(super) fn check(&self, model: &PolynomialModel) -> Result<(), Error> {
        let wrong = |what: &str| {
            Err(Error::report(format!("model.factors: {what}; the report was edited or damaged")))
        };
        let ArimaOrders { order, seasonal } = self.orders;
        if ArimaOrders::new(order, seasonal).as_ref() != Ok(&self.orders) {
            return wrong("the orders make no sense");
        }
        let Some(own) = self.parameters.len().checked_sub(self.orders.parameters()) else {
            return wrong("there are fewer parameters than the orders have");
        };
        if !self.parameters[own..].iter().map(|parameter| &parameter.name).eq(&self.orders.names()) {
            return wrong("the parameters are not those of the orders");
        }
        let count = self.parameters.len();
        let square = |rows: &Vec<Vec<f64>>| rows.len() == count && rows.iter().all(|row| row.len() == count);
        if !self.covariance.as_ref().is_none_or(square) {
            return wrong("the covariance does not have a row and a column for each parameter");
        }
        let values: Vec<f64> = self.parameters[own..].iter().map(|parameter| parameter.value).collect();
        let Expanded { a, c, .. } = self.orders.expanded(&values, false);
        let near = |one: &[f64], other: &[f64]| {
            let close = |(one, other): (&f64, &f64)| (one - other).abs() <= SAME * (1.0 + other.abs());
            one.len() == other.len() && one.iter().zip(other).all(close)
        };
        if !near(&model.c, &c) || !near(&model.d, &product(&a, &self.orders.differencing())) {
            return wrong("c and d are not their products");
        }
        Ok(())
    }
}

/// One thing as a list of one.
pub(super) mod only {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(in crate::model) fn serialize<T: Serialize, S: Serializer>(
        only: &T,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        [only].serialize(serializer)
    }

    pub(in crate::model) fn deserialize<'de, T: Deserialize<'de>, D: Deserializer<'de>>(
        deserializer: D,
    ) -> Result<T, D::Error> {
        let [only] = <[T; 1]>::deserialize(deserializer)?;
        Ok(only)
    }
}

/// A variance as a matrix of one row.
pub(super) mod only_variance {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};

    pub(in crate::model) fn serialize<S: Serializer>(
        variance: &f64,
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        [[variance]].serialize(serializer)
    }

    pub(in crate::model) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
        let [[variance]] = <[[f64; 1]; 1]>::deserialize(deserializer)?;
        Ok(variance)
    }
}

impl PolynomialModel {
    /// The model with the uncertainty of its output's offset as further inputs, whose coefficients are zero and
    /// uncertain; and those inputs over this many rows. None where that uncertainty is not known.
    pub(crate) fn with_open_offset(&self, rows: usize) -> Option<(Self, Vec<Vec<f64>>)> {
        let open = self.offset_covariance.as_ref()?;
        let (count, place) = (open.count(), self.orders.na + self.orders.nb.iter().sum::<usize>());
        // They stand after B among the parameters, and at the end of the matrix.
        let own = self.parameters.len();
        let order: Vec<usize> = (0..place).chain(own..own + count).chain(place..own).collect();
        let row = |k: &usize| order.iter().map(|l| open.covariance[*k][*l]).collect();
        let mut model = self.clone();
        model.covariance = Some(order.iter().map(row).collect());
        model.offset_covariance = None;
        model.orders = self.orders.with_constants(count);
        model.structure = model.orders.structure();
        let zero = Parameter { name: String::new(), value: 0.0, standard_error: None };
        model.parameters.splice(place..place, vec![zero; count]);
        model.inputs.extend(vec![Signal::default(); count]);
        model.b.extend(vec![vec![0.0]; count]);
        model.f.extend(vec![vec![1.0]; count]);
        let line = |middle: f64| (0..rows).map(move |row| row as f64 * self.sample_time - middle).collect();
        let signals = std::iter::once(vec![1.0; rows]).chain(open.middle.map(line)).collect();
        Some((model, signals))
    }

    /// The standard deviation of Student's distribution with the degrees of freedom of the noise variance.
    pub(crate) fn student_factor(&self) -> f64 {
        student_factor(self.degrees_of_freedom)
    }

    /// How many standard errors from an estimate the end of an interval lies that holds its truth with probability
    /// `level`.
    pub(crate) fn quantile(&self, level: f64) -> f64 {
        student_two_sided(1.0 - level, self.degrees_of_freedom)
    }

    /// Checks a model that was read: that its parts fit together, so that it can be computed with.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let orders = &self.orders;
        let wrong =
            |what: &str| Err(Error::report(format!("model.{what}; the report was edited or damaged")));
        let (nb, nf, nk) = (&orders.nb, &orders.nf, &orders.nk);
        if Orders::new(orders.na, nb, orders.nc, orders.nd, nf, nk).as_ref() != Ok(orders)
            || orders.structure() != self.structure
        {
            return wrong("orders are not those of the structure");
        }
        let inputs = orders.nb.len();
        if [orders.nk.len(), orders.nf.len(), self.inputs.len(), self.b.len(), self.f.len()] != [inputs; 5] {
            return wrong("orders, inputs, b and f do not have as many inputs as one another");
        }
        let monic = |p: &[f64], order: usize| p.len() == order + 1 && p[0] == 1.0;
        let plain = [(&self.a, orders.na), (&self.c, orders.nc), (&self.d, orders.nd)];
        if !plain.into_iter().chain(self.f.iter().zip(nf.iter().copied())).all(|(p, order)| monic(p, order)) {
            return wrong("a, c, d or f does not match its order, or does not begin with 1");
        }
        let length = |j: usize| orders.nk[j] + orders.nb[j];
        if (0..inputs).any(|j| self.b[j].len() != length(j)) {
            return wrong("b does not match its orders");
        }
        if (0..inputs).any(|j| self.b[j].iter().take(orders.nk[j]).any(|value| *value != 0.0)) {
            return wrong("b does not begin with nk zeros");
        }
        let mut names: Vec<&str> =
            self.inputs.iter().chain([&self.output]).map(|s| s.name.as_str()).collect();
        names.sort_unstable();
        if names.windows(2).any(|pair| pair[0] == pair[1]) {
            return wrong("inputs and output share a name");
        }
        if !(self.sample_time.is_finite() && self.sample_time > 0.0) {
            return wrong("sample_time is not positive");
        }
        let offsets = self.inputs.iter().chain([&self.output]).flat_map(|s| [s.offset.level, s.offset.slope]);
        let values = [&self.a, &self.c, &self.d].into_iter().chain(&self.b).chain(&self.f).flatten().copied();
        if !values.chain(offsets).all(f64::is_finite) {
            return wrong("a, b, c, d, f or an offset is not finite");
        }
        if !(self.noise_variance.is_finite() && self.noise_variance >= 0.0) {
            return wrong("noise_covariance is not a variance");
        }
        if !self.parameters.iter().map(|parameter| &parameter.name).eq(&orders.names()) {
            return wrong("parameters are not those of the orders");
        }
        let count = orders.parameters();
        let square = |rows: &Vec<Vec<f64>>| rows.len() == count && rows.iter().all(|row| row.len() == count);
        if !self.covariance.as_ref().is_none_or(square) {
            return wrong("covariance does not have a row and a column for each parameter");
        }
        if let Some(factors) = &self.factors {
            factors.check(self)?;
        }
        if let Some(open) = &self.offset_covariance {
            let count = count + open.count();
            let rows = &open.covariance;
            let values = rows.iter().flatten().chain(&open.middle);
            if rows.len() != count || rows.iter().any(|row| row.len() != count) {
                return wrong(
                    "offset_covariance does not have a row and a column for each parameter and the offset",
                );
            }
            if !values.copied().all(f64::is_finite) {
                return wrong("offset_covariance is not finite");
            }
        }
        Ok(())
    }
}

/// J P J' for functions of the parameters with these slopes, P being the covariance of the parameters; none where that
/// is not known.
pub(super) fn propagated(slopes: &[Vec<f64>], covariance: Option<&[Vec<f64>]>) -> Option<Vec<Vec<f64>>> {
    let covariance = covariance?;
    let entry = |left: &[f64], right: &[f64]| -> f64 {
        let of = |(row, left): (&Vec<f64>, &f64)| {
            left * row.iter().zip(right).map(|(entry, right)| entry * right).sum::<f64>()
        };
        covariance.iter().zip(left).map(of).sum()
    };
    let row = |left: &Vec<f64>| slopes.iter().map(|right| entry(left, right)).collect();
    Some(slopes.iter().map(row).collect())
}

/// Whether a matrix may be a covariance: no variance is below zero, and no combination's by more than rounding.
///
/// On the scale of the standard errors the rounding of P = L S L' is of the size n eps kappa(S), kappa(S) being the
/// ratio of the largest to the least power density of the errors: up to 1e6.
pub(crate) fn is_covariance(rows: &[Vec<f64>]) -> bool {
    const ROUNDING: f64 = 1e-9;
    let size = rows.len();
    let scale = |k: usize| rows[k][k].sqrt();
    if (0..size).any(|k| scale(k).is_nan()) {
        return false;
    }
    let entry = |i: usize, j: usize| {
        let scale = scale(i) * scale(j);
        if scale > 0.0 { rows[i][j] / scale } else { 0.0 }
    };
    let scaled = DMatrix::from_fn(size, size, entry);
    // An overflow has words of its own.
    !scaled.iter().all(|value| value.is_finite())
        || (scaled + DMatrix::identity(size, size) * (ROUNDING * size as f64)).cholesky().is_some()
}

#[cfg(test)]
mod tests;
