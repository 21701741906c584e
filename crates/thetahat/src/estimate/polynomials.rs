//! The polynomials of a parameter vector.

use crate::model::{Orders, polynomial::is_stable};

/// Why parameters have no cost.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Unusable {
    /// C or F has a root outside the unit circle.
    Unstable,
    /// The errors overflow.
    Overflow,
}

/// The polynomials of a parameter vector.
#[derive(Debug)]
pub(super) struct Polynomials {
    pub(super) a: Vec<f64>,
    /// Without the leading zeros.
    pub(super) b: Vec<Vec<f64>>,
    pub(super) c: Vec<f64>,
    pub(super) d: Vec<f64>,
    pub(super) f: Vec<Vec<f64>>,
}

impl Polynomials {
    pub(super) fn new(orders: &Orders, parameters: &[f64]) -> Self {
        let monic = |order: usize| [vec![1.0], vec![0.0; order]].concat();
        let mut polynomials = Self {
            a: monic(orders.na),
            b: orders.nb.iter().map(|&nb| vec![0.0; nb]).collect(),
            c: monic(orders.nc),
            d: monic(orders.nd),
            f: orders.nf.iter().map(|&nf| monic(nf)).collect(),
        };
        polynomials.set(parameters);
        polynomials
    }

    pub(super) fn set(&mut self, mut parameters: &[f64]) {
        let mut fill = |values: &mut [f64]| {
            let (own, rest) = parameters.split_at(values.len());
            values.copy_from_slice(own);
            parameters = rest;
        };
        fill(&mut self.a[1..]);
        self.b.iter_mut().for_each(|b| fill(b));
        fill(&mut self.c[1..]);
        fill(&mut self.d[1..]);
        self.f.iter_mut().for_each(|f| fill(&mut f[1..]));
    }

    /// The parameters in their order.
    pub(super) fn parameters(&self) -> Vec<f64> {
        self.coefficients().copied().collect()
    }

    /// Writes the parameters in their order.
    pub(super) fn write(&self, parameters: &mut [f64]) {
        parameters.iter_mut().zip(self.coefficients()).for_each(|(parameter, value)| *parameter = *value);
    }

    fn coefficients(&self) -> impl Iterator<Item = &f64> {
        let f = self.f.iter().flat_map(|f| &f[1..]);
        self.a[1..].iter().chain(self.b.iter().flatten()).chain(&self.c[1..]).chain(&self.d[1..]).chain(f)
    }

    /// Whether the predictor is stable: C and every F are.
    pub(super) fn are_stable(&self, scratch: &mut Vec<f64>) -> bool {
        is_stable(&self.c, scratch) && self.f.iter().all(|f| is_stable(f, scratch))
    }
}

/// The parameters of a model with the same delays and orders that are not above the others', as parameters of the
/// latter: the polynomials end with zeros.
pub(crate) fn extended(from: &Orders, parameters: &[f64], to: &Orders) -> Vec<f64> {
    let mut polynomials = Polynomials::new(from, parameters);
    polynomials.a.resize(to.na + 1, 0.0);
    polynomials.b.iter_mut().zip(&to.nb).for_each(|(b, &nb)| b.resize(nb, 0.0));
    polynomials.c.resize(to.nc + 1, 0.0);
    polynomials.d.resize(to.nd + 1, 0.0);
    polynomials.f.iter_mut().zip(&to.nf).for_each(|(f, &nf)| f.resize(nf + 1, 0.0));
    polynomials.parameters()
}
