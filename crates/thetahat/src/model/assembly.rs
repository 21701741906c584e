//! The model of given parameters.

use super::dynamics;
use super::fitted::{Parameter, PolynomialModel, Signal, is_covariance};
use crate::Error;
use crate::model::Orders;

impl PolynomialModel {
    /// The model of some parameters, in the order of [`Orders::names`]. Its signals have no names and no offsets. A
    /// matrix that cannot be a covariance says nothing: that of the parameters is unknown then.
    pub(crate) fn from_parameters(
        orders: &Orders,
        values: &[f64],
        covariance: Option<&[Vec<f64>]>,
        noise_variance: f64,
        sample_time: f64,
    ) -> Result<Self, Error> {
        let covariance = covariance.filter(|rows| is_covariance(rows));
        let variance = |position: usize| covariance.map(|rows| rows[position][position]);
        let named = orders.names().into_iter().zip(values).enumerate();
        let parameters: Vec<Parameter> = named
            .map(|(position, (name, &value))| Parameter {
                name,
                value,
                standard_error: variance(position).map(f64::sqrt),
            })
            .collect();
        let usable = |p: &Parameter| p.value.is_finite() && p.standard_error.is_none_or(f64::is_finite);
        if let Some(parameter) = parameters.iter().find(|parameter| !usable(parameter)) {
            return Err(Error::data(format!(
                "parameter {} overflows ({}); scale the channels towards one",
                parameter.name, parameter.value
            )));
        }
        if !noise_variance.is_finite() {
            return Err(Error::data("the noise variance overflows; scale the output towards one"));
        }
        let mut values = values.iter().copied();
        let monic = |values: &mut dyn Iterator<Item = f64>, count| -> Vec<f64> {
            std::iter::once(1.0).chain(values.take(count)).collect()
        };
        let a = monic(&mut values, orders.na);
        let delays = orders.nb.iter().zip(&orders.nk);
        let b: Vec<Vec<f64>> = delays
            .map(|(&nb, &nk)| std::iter::repeat_n(0.0, nk).chain(values.by_ref().take(nb)).collect())
            .collect();
        let c = monic(&mut values, orders.nc);
        let d = monic(&mut values, orders.nd);
        let f: Vec<Vec<f64>> = orders.nf.iter().map(|&nf| monic(&mut values, nf)).collect();
        let mut model = Self {
            structure: orders.structure(),
            orders: orders.clone(),
            sample_time,
            inputs: vec![Signal::default(); orders.inputs()],
            output: Signal::default(),
            a,
            b,
            c,
            d,
            f,
            noise_variance,
            degrees_of_freedom: None,
            parameters,
            covariance: covariance.map(<[_]>::to_vec),
            offset_covariance: None,
            factors: None,
            poles: Vec::new(),
            zeros: Vec::new(),
            noise_poles: Vec::new(),
            noise_zeros: Vec::new(),
            dc_gain: Vec::new(),
            stable: true,
            time_constants: Vec::new(),
        };
        dynamics::describe(&mut model)?;
        Ok(model)
    }

    /// The same with intervals of Student's distribution, where the degrees of freedom of its noise variance are known.
    pub(crate) fn with_degrees_of_freedom(mut self, degrees: Option<usize>) -> Result<Self, Error> {
        self.degrees_of_freedom = degrees;
        dynamics::describe(&mut self)?;
        Ok(self)
    }
}
