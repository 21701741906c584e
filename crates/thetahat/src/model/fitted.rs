use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_core::nalgebra::{self, ComplexField};

use super::polynomial;
use crate::data::Offset;
use crate::estimate::Estimate;
use crate::{Error, Orders};

/// The model structures, special cases of A y = B/F u + C/D e.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Structure {
    /// A(q) y(t) = sum_j B_j(q) u_j(t) + e(t).
    Arx,
}

/// A channel as a model sees it: its name, and what its values are measured from.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
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
    /// The square root of its variance.
    pub standard_error: f64,
}

/// A complex number.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Complex {
    /// Real part.
    pub re: f64,
    /// Imaginary part.
    pub im: f64,
}

impl From<nalgebra::Complex<f64>> for Complex {
    fn from(value: nalgebra::Complex<f64>) -> Self {
        Self { re: value.re, im: value.im }
    }
}

/// An estimated model: A(q) y(t) = sum_j B_j(q)/F_j(q) u_j(t) + C(q)/D(q) e(t), var e = `noise_variance`.
///
/// Polynomials are written in rising powers of q^-1: `b[j][i]` multiplies u_j(t - i), so B begins with nk zeros.
/// y and u are deviations from the signals' offsets.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct Model {
    /// Which polynomials there are.
    pub structure: Structure,
    /// How long they are.
    pub orders: Orders,
    /// Seconds from one sample to the next.
    pub sample_time: f64,
    /// The inputs, in the order of `b`.
    pub inputs: Vec<Signal>,
    /// The output.
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
    /// The variance of e: the sum of squared residuals over N - p.
    pub noise_variance: f64,
    /// The coefficients with their standard errors, in the order of `covariance`.
    pub parameters: Vec<Parameter>,
    /// The covariance matrix of the parameters, row by row.
    pub covariance: Vec<Vec<f64>>,
    /// The roots of A in the z plane, largest first.
    pub poles: Vec<Complex>,
    /// The finite roots of B in the z plane, for each input.
    pub zeros: Vec<Vec<Complex>>,
    /// B(1)/A(1) for each input, in units of y per unit of u; none at an integrator.
    pub dc_gain: Vec<Option<f64>>,
    /// Whether all poles lie inside the unit circle.
    pub stable: bool,
    /// -T/ln|p| in seconds for each pole p, T being the sample time; none for |p| >= 1.
    pub time_constants: Vec<Option<f64>>,
}

impl Model {
    /// The ARX model of an estimate.
    ///
    /// # Errors
    /// [`Error::Data`] if a coefficient or the variance overflows, or roots do not converge.
    pub fn arx(
        orders: &Orders,
        estimate: &Estimate,
        sample_time: f64,
        inputs: Vec<Signal>,
        output: Signal,
    ) -> Result<Self, Error> {
        let parameters: Vec<Parameter> = orders
            .names()
            .into_iter()
            .zip(estimate.parameters())
            .zip(estimate.covariance().iter().enumerate())
            .map(|((name, &value), (position, row))| Parameter {
                name,
                value,
                standard_error: row[position].sqrt(),
            })
            .collect();
        let unusable = parameters.iter().find(|p| !(p.value.is_finite() && p.standard_error.is_finite()));
        if let Some(parameter) = unusable {
            return Err(Error::data(format!(
                "parameter {} overflows ({}); scale the channels towards one",
                parameter.name, parameter.value
            )));
        }
        if !(estimate.noise_variance().is_finite() && estimate.criteria().fpe.is_finite()) {
            return Err(Error::data("the noise variance overflows; scale the output towards one"));
        }
        let mut values = estimate.parameters().iter().copied();
        let monic = |values: &mut dyn Iterator<Item = f64>, count| -> Vec<f64> {
            std::iter::once(1.0).chain(values.take(count)).collect()
        };
        let a = monic(&mut values, orders.na);
        let delays = orders.nb.iter().zip(&orders.nk);
        let b: Vec<Vec<f64>> = delays
            .map(|(&nb, &nk)| std::iter::repeat_n(0.0, nk).chain(values.by_ref().take(nb)).collect())
            .collect();
        let roots = |polynomial: &[f64]| {
            polynomial::roots(polynomial)
                .ok_or_else(|| Error::data("the roots of a polynomial do not converge; lower the orders"))
        };
        let poles = roots(&a)?;
        let zeros = b.iter().map(|b| Ok(roots(b)?.into_iter().map(Complex::from).collect()));
        let at_one: f64 = a.iter().sum();
        let size: f64 = a.iter().map(|a| a.abs()).sum();
        // Below this A(1) is rounding: an integrator has no gain at frequency zero.
        let integrates = at_one.abs() <= 16.0 * f64::EPSILON * size;
        let gain = |b: &Vec<f64>| {
            Some(b.iter().sum::<f64>() / at_one).filter(|gain| gain.is_finite() && !integrates)
        };
        Ok(Self {
            structure: Structure::Arx,
            orders: orders.clone(),
            sample_time,
            inputs,
            output,
            c: vec![1.0],
            d: vec![1.0],
            f: vec![vec![1.0]; b.len()],
            noise_variance: estimate.noise_variance(),
            parameters,
            covariance: estimate.covariance().to_vec(),
            zeros: zeros.collect::<Result<_, Error>>()?,
            dc_gain: b.iter().map(gain).collect(),
            stable: poles.iter().all(|pole| pole.modulus() < 1.0),
            time_constants: poles
                .iter()
                .map(|pole| (pole.modulus() < 1.0).then(|| -sample_time / pole.modulus().ln()))
                .collect(),
            poles: poles.into_iter().map(Complex::from).collect(),
            a,
            b,
        })
    }

    /// Checks a model that was read: that its parts fit together, so that it can be computed with.
    pub(crate) fn check(&self) -> Result<(), Error> {
        let orders = &self.orders;
        let wrong =
            |what: &str| Err(Error::report(format!("model.{what}; the report was edited or damaged")));
        if Orders::arx(orders.na, &orders.nb, &orders.nk).as_ref() != Ok(orders) {
            return wrong("orders are not those of an ARX model");
        }
        let inputs = orders.nb.len();
        if [orders.nk.len(), orders.nf.len(), self.inputs.len(), self.b.len(), self.f.len()] != [inputs; 5] {
            return wrong("orders, inputs, b and f do not have as many inputs as one another");
        }
        if self.a.len() != orders.na + 1 || self.a.first() != Some(&1.0) {
            return wrong("a does not match its order, or does not begin with 1");
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
        if !self.a.iter().chain(self.b.iter().flatten()).copied().chain(offsets).all(f64::is_finite) {
            return wrong("a, b or an offset is not finite");
        }
        let plain = |p: &[f64]| p == [1.0];
        if !(plain(&self.c) && plain(&self.d) && self.f.iter().all(|f| plain(f))) {
            return wrong("c, d and f of an ARX model are 1");
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::data::Record;
    use crate::estimate::arx;
    use crate::regression::noise::Noise;
    use crate::{Initial, Offset};

    /// The model fitted to data that ARX with these parameters made without noise.
    fn fitted(a: &[f64], b: &[f64]) -> Model {
        let mut noise = Noise(1);
        let u = noise.take(100);
        let mut y = vec![0.0; 100];
        for t in 0..100 {
            let past: f64 = (1..=t).zip(a).map(|(lag, a)| a * y[t - lag]).sum();
            y[t] = (1..=t).zip(b).map(|(lag, b)| b * u[t - lag]).sum::<f64>() - past;
        }
        let orders = Orders::arx(a.len(), &[b.len()], &[1]).unwrap();
        let estimate = arx(&Record::new(&y, vec![&u]).unwrap(), &orders, Initial::Drop).unwrap();
        let signal = |name: &str| Signal { name: name.to_owned(), offset: Offset::default() };
        Model::arx(&orders, &estimate, 0.5, vec![signal("u")], signal("y")).unwrap()
    }

    #[test]
    fn poles_zeros_and_gains_are_those_of_the_polynomials() {
        // (1 - 0.8 q^-1)(1 - 0.5 q^-1) and 2 q^-1 (1 + 3 q^-1).
        let model = fitted(&[-1.3, 0.4], &[2.0, 6.0]);
        let near = |found: f64, expected: f64| (found - expected).abs() < 1e-12;
        assert_eq!((model.a.len(), model.b[0].len(), model.b[0][0]), (3, 3, 0.0));
        assert!(near(model.poles[0].re, 0.8) && near(model.poles[1].re, 0.5) && model.stable);
        assert!(model.zeros[0].len() == 1 && near(model.zeros[0][0].re, -3.0));
        assert!(near(model.dc_gain[0].unwrap(), 80.0));
        assert!(near(model.time_constants[0].unwrap(), -0.5 / 0.8_f64.ln()));
    }

    #[test]
    fn an_integrator_has_no_gain_and_an_unstable_pole_no_time_constant() {
        assert_eq!(fitted(&[-1.0], &[1.0]).dc_gain, [None]);
        let unstable = fitted(&[-1.3], &[1.0]);
        assert!(!unstable.stable && unstable.time_constants == [None]);
    }

    #[test]
    fn a_damaged_model_is_refused() {
        let good = fitted(&[-0.5], &[1.0, 2.0]);
        assert!(good.check().is_ok());
        let damages: [fn(&mut Model); 10] = [
            |model| model.orders.na = usize::MAX,
            |model| model.orders.nk = vec![usize::MAX],
            |model| model.orders.nc = usize::MAX,
            |model| model.orders.nb = vec![1, 1],
            |model| model.a = vec![2.0, 0.5],
            |model| model.b[0][1] = f64::NAN,
            |model| model.f = vec![],
            |model| model.b[0][0] = 1.0,
            |model| model.output.name = "u".to_owned(),
            |model| model.sample_time = 0.0,
        ];
        for damage in damages {
            let mut model = good.clone();
            damage(&mut model);
            assert!(matches!(model.check(), Err(Error::Report { .. })));
        }
    }
}
