use std::fmt;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Error;

/// No order may be larger: beyond it a number was mistyped.
pub(crate) const LARGEST: usize = 1000;

/// The orders of A(q) y(t) = sum_j B_j(q)/F_j(q) u_j(t - nk_j) + C(q)/D(q) e(t).
///
/// A, C, D and F are monic: na is the number of coefficients a1 … a_na after the leading 1, and likewise nc, nd
/// and nf. B has nb coefficients, the first of which multiplies u(t - nk).
///
/// ```
/// use thetahat::model::Orders;
///
/// let orders = Orders::arx(2, &[2], &[3])?;
/// assert_eq!(orders.names(), ["a1", "a2", "b3", "b4"]);
/// # Ok::<(), thetahat::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub struct Orders {
    /// Coefficients of A.
    pub na: usize,
    /// Coefficients of B, for each input.
    pub nb: Vec<usize>,
    /// Coefficients of C.
    pub nc: usize,
    /// Coefficients of D.
    pub nd: usize,
    /// Coefficients of F, for each input.
    pub nf: Vec<usize>,
    /// Samples from an input's change to its first effect, for each input. 0: it acts at once.
    pub nk: Vec<usize>,
}

/// The model structures, special cases of A y = B/F u + C/D e. The orders say which one a model has.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Structure {
    /// Autoregression: A(q) y(t) = e(t).
    Ar,
    /// Autoregression and moving average: A(q) y(t) = C(q) e(t).
    Arma,
    /// A(q) y(t) = sum_j B_j(q) u_j(t) + e(t).
    Arx,
    /// A(q) y(t) = sum_j B_j(q) u_j(t) + C(q) e(t).
    Armax,
    /// Output error: y(t) = sum_j B_j(q)/F_j(q) u_j(t) + e(t).
    Oe,
    /// Box and Jenkins: y(t) = sum_j B_j(q)/F_j(q) u_j(t) + C(q)/D(q) e(t).
    Bj,
    /// Any other combination.
    General,
}

impl Orders {
    /// The orders of an ARX model, A(q) y(t) = sum_j B_j(q) u_j(t - nk_j) + e(t). Without inputs: of an AR model.
    ///
    /// # Errors
    /// As for [`Orders::new`].
    pub fn arx(na: usize, nb: &[usize], nk: &[usize]) -> Result<Self, Error> {
        Self::new(na, nb, 0, 0, &vec![0; nb.len()], nk)
    }

    /// The orders of an ARMAX model, A(q) y(t) = sum_j B_j(q) u_j(t - nk_j) + C(q) e(t). Without inputs: of an ARMA
    /// model.
    ///
    /// # Errors
    /// As for [`Orders::new`].
    pub fn armax(na: usize, nb: &[usize], nc: usize, nk: &[usize]) -> Result<Self, Error> {
        Self::new(na, nb, nc, 0, &vec![0; nb.len()], nk)
    }

    /// The orders of an output-error model, y(t) = sum_j B_j(q)/F_j(q) u_j(t - nk_j) + e(t).
    ///
    /// # Errors
    /// As for [`Orders::new`].
    pub fn oe(nb: &[usize], nf: &[usize], nk: &[usize]) -> Result<Self, Error> {
        Self::new(0, nb, 0, 0, nf, nk)
    }

    /// The orders of a Box-Jenkins model, y(t) = sum_j B_j(q)/F_j(q) u_j(t - nk_j) + C(q)/D(q) e(t).
    ///
    /// # Errors
    /// As for [`Orders::new`].
    pub fn bj(nb: &[usize], nc: usize, nd: usize, nf: &[usize], nk: &[usize]) -> Result<Self, Error> {
        Self::new(0, nb, nc, nd, nf, nk)
    }

    /// The orders of A(q) y(t) = sum_j B_j(q)/F_j(q) u_j(t - nk_j) + C(q)/D(q) e(t), in the order of the letters.
    ///
    /// # Errors
    /// [`Error::Argument`] if nb, nf and nk differ in length, all orders are 0, one is above 1000, or F is given for an
    /// input that has no B.
    pub fn new(
        na: usize,
        nb: &[usize],
        nc: usize,
        nd: usize,
        nf: &[usize],
        nk: &[usize],
    ) -> Result<Self, Error> {
        for (name, values) in [("nk", nk), ("nf", nf)] {
            if values.len() != nb.len() {
                return Err(Error::argument(
                    name,
                    format!(
                        "there are {} values for {} inputs; give one for each, or one for all",
                        values.len(),
                        nb.len()
                    ),
                ));
            }
        }
        let every = nb.iter().chain(nk).chain(nf).chain([&na, &nc, &nd]).copied();
        let largest = every.max().unwrap_or(0);
        if largest > LARGEST {
            return Err(Error::argument(
                "orders",
                format!("{largest} is above {LARGEST}, the largest order"),
            ));
        }
        if let Some(input) = nb.iter().zip(nf).position(|(&nb, &nf)| nb == 0 && nf > 0) {
            return Err(Error::argument(
                "nf",
                format!("input {} has F without B: give it an nb above 0, or nf 0", input + 1),
            ));
        }
        let orders = Self { na, nb: nb.to_vec(), nc, nd, nf: nf.to_vec(), nk: nk.to_vec() };
        if orders.parameters() == 0 {
            return Err(Error::argument("orders", "all orders are 0: the model has no parameters"));
        }
        Ok(orders)
    }

    /// Which structure these orders make. A Box-Jenkins model without C and D is one of output error, and so on.
    pub fn structure(&self) -> Structure {
        let (input, filtered) = (self.nb.iter().any(|&nb| nb > 0), self.nf.iter().any(|&nf| nf > 0));
        match (input, filtered, self.na > 0, self.nc > 0, self.nd > 0) {
            (false, _, _, false, false) => Structure::Ar,
            (false, _, _, true, false) => Structure::Arma,
            (true, false, _, false, false) => Structure::Arx,
            (true, false, _, true, false) => Structure::Armax,
            (true, true, false, false, false) => Structure::Oe,
            (true, _, false, _, _) => Structure::Bj,
            _ => Structure::General,
        }
    }

    /// What the numbers of these orders stand for, as they are written: `ARX(na, nb, nk)`.
    ///
    /// ```
    /// assert_eq!(thetahat::model::Orders::oe(&[2], &[1], &[3])?.legend(), "OE(nb, nf, nk)");
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn legend(&self) -> &'static str {
        match self.structure() {
            Structure::Ar => "AR(na)",
            Structure::Arma => "ARMA(na, nc)",
            Structure::Arx => "ARX(na, nb, nk)",
            Structure::Armax => "ARMAX(na, nb, nc, nk)",
            Structure::Oe => "OE(nb, nf, nk)",
            Structure::Bj => "BJ(nb, nc, nd, nf, nk)",
            Structure::General => "General(na, nb, nc, nd, nf, nk)",
        }
    }

    /// The equation of these orders, without what they do not have.
    ///
    /// ```
    /// assert_eq!(thetahat::model::Orders::arx(2, &[2], &[1])?.equation(), "A(q) y(t) = B(q) u(t) + e(t)");
    /// # Ok::<(), thetahat::Error>(())
    /// ```
    pub fn equation(&self) -> String {
        let several = self.inputs() > 1;
        let of = |letter: char| if several { format!("{letter}_j(q)") } else { format!("{letter}(q)") };
        let mut right = Vec::new();
        if self.nb.iter().any(|&nb| nb > 0) {
            let divided =
                if self.nf.iter().any(|&nf| nf > 0) { format!("/{}", of('F')) } else { String::new() };
            let (sum, input) = if several { ("sum_j ", "u_j(t)") } else { ("", "u(t)") };
            right.push(format!("{sum}{}{divided} {input}", of('B')));
        }
        right.push(
            match (self.nc > 0, self.nd > 0) {
                (false, false) => "e(t)",
                (true, false) => "C(q) e(t)",
                (false, true) => "1/D(q) e(t)",
                (true, true) => "C(q)/D(q) e(t)",
            }
            .to_owned(),
        );
        format!("{} = {}", if self.na > 0 { "A(q) y(t)" } else { "y(t)" }, right.join(" + "))
    }

    /// Whether the predictor is linear in the parameters: C = D = F = 1.
    pub fn is_linear(&self) -> bool {
        self.nc == 0 && self.nd == 0 && self.nf.iter().all(|&nf| nf == 0)
    }

    /// The number of inputs.
    pub fn inputs(&self) -> usize {
        self.nb.len()
    }

    /// The number of parameters p.
    pub fn parameters(&self) -> usize {
        self.na + self.nc + self.nd + self.nb.iter().sum::<usize>() + self.nf.iter().sum::<usize>()
    }

    /// The lags of an ARX regressor by name, those of the output first: y(k-1), u(k-1), …
    pub fn lag_names(&self, inputs: &[String], output: &str) -> Vec<String> {
        let mut names: Vec<String> = (1..=self.na).map(|lag| lag_name(output, lag)).collect();
        for (input, (&nb, &nk)) in inputs.iter().zip(self.nb.iter().zip(&self.nk)) {
            names.extend((nk..nk + nb).map(|lag| lag_name(input, lag)));
        }
        names
    }

    /// The maximum lag of a full ARX regressor: max(na, nb + nk - 1).
    pub fn maximum_lag(&self) -> usize {
        (0..self.inputs()).map(|input| self.maximum_input_lag(input)).fold(self.na, usize::max)
    }

    /// With this many further inputs after their own, of one coefficient each that acts at once: those of a constant
    /// and a trend.
    pub(crate) fn with_constants(&self, count: usize) -> Self {
        let more = |values: &[usize], value| [values, &vec![value; count]].concat();
        Self { nb: more(&self.nb, 1), nf: more(&self.nf, 0), nk: more(&self.nk, 0), ..self.clone() }
    }

    /// The maximum lag of B for an input: nb + nk - 1, or 0 without B.
    pub(crate) fn maximum_input_lag(&self, input: usize) -> usize {
        if self.nb[input] == 0 { 0 } else { self.nb[input] + self.nk[input] - 1 }
    }

    /// How many first samples of a segment have no e where nothing before it is known and no initial-condition response
    /// of 1/F makes up for it: max(na, nb + nk - 1 of the inputs without F), and nd more. For ARX this is the maximum
    /// lag.
    pub(crate) fn conditioned(&self) -> usize {
        let direct = (0..self.inputs()).filter(|&input| self.nf[input] == 0);
        direct.map(|input| self.maximum_input_lag(input)).fold(self.na, usize::max) + self.nd
    }

    /// How many samples before a segment its errors reach back to: max(na, nb + nk - 1 of all inputs) + nd. With this
    /// many known, all samples of the segment have an error.
    pub(crate) fn history(&self) -> usize {
        self.maximum_lag() + self.nd
    }

    /// Whether errors depend on past outputs. If not, A = C = D = 1, a missing output is a missing error and nothing
    /// more.
    pub(crate) fn needs_past_outputs(&self) -> bool {
        self.na + self.nc + self.nd > 0
    }

    /// Whether an input has F.
    pub(crate) fn has_f(&self) -> bool {
        self.nf.iter().any(|&nf| nf > 0)
    }

    /// The number of initial-condition responses of 1/F for an input: what unknown samples before a segment do to B/F u
    /// is, from sample nb + nk - 1 on, a combination of nf of them. Before that earlier inputs are taken to be zero,
    /// the mean.
    pub(crate) fn free_responses(&self, input: usize) -> usize {
        self.nf[input]
    }

    /// The same where earlier inputs are not taken to be zero: max(nf, nb + nk - 1), the first `known` inputs being
    /// known.
    pub(crate) fn free_responses_and_inputs(&self, input: usize, known: usize) -> usize {
        let nf = self.nf[input];
        if nf == 0 { 0 } else { nf.max(self.maximum_input_lag(input).saturating_sub(known)) }
    }

    /// The parameters' names in their order: a, b of each input, c, d, f of each input.
    ///
    /// The number is the power of q^-1 that the coefficient multiplies, so the first of B is b_nk. With several
    /// inputs the input's number comes first: `b2_1` multiplies u2(t - 1).
    pub fn names(&self) -> Vec<String> {
        let several = self.inputs() > 1;
        let of = |letter: &str, input: usize, power: usize| {
            if several { format!("{letter}{}_{power}", input + 1) } else { format!("{letter}{power}") }
        };
        let mut names: Vec<String> = (1..=self.na).map(|power| format!("a{power}")).collect();
        for (input, (&nb, &nk)) in self.nb.iter().zip(&self.nk).enumerate() {
            names.extend((nk..nk + nb).map(|power| of("b", input, power)));
        }
        names.extend((1..=self.nc).map(|power| format!("c{power}")));
        names.extend((1..=self.nd).map(|power| format!("d{power}")));
        for (input, &nf) in self.nf.iter().enumerate() {
            names.extend((1..=nf).map(|power| of("f", input, power)));
        }
        names
    }
}

/// As the field writes them: `ARX(2, 2, 3)` is ARX(na, nb, nk), and so on, see [`Orders::legend`]. Several inputs stand
/// in brackets where they differ.
///
/// ```
/// assert_eq!(thetahat::model::Orders::oe(&[2], &[1], &[3])?.to_string(), "OE(2, 1, 3)");
/// # Ok::<(), thetahat::Error>(())
/// ```
impl fmt::Display for Orders {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let one = |order: &usize| order.to_string();
        let each = |orders: &[usize]| match orders {
            [first, rest @ ..] if rest.iter().all(|order| order == first) => first.to_string(),
            _ => format!("[{}]", orders.iter().map(one).collect::<Vec<_>>().join(" ")),
        };
        let (na, nc, nd) = (one(&self.na), one(&self.nc), one(&self.nd));
        let (nb, nf, nk) = (each(&self.nb), each(&self.nf), each(&self.nk));
        let mut written = self.legend().to_owned();
        for (letters, orders) in [("na", na), ("nb", nb), ("nc", nc), ("nd", nd), ("nf", nf), ("nk", nk)] {
            written = written.replace(letters, &orders);
        }
        f.write_str(&written)
    }
}

/// Such as y(k-1), or u(k) without a lag.
pub(crate) fn lag_name(channel: &str, lag: usize) -> String {
    if lag == 0 { format!("{channel}(k)") } else { format!("{channel}(k-{lag})") }
}

#[cfg(test)]
mod tests;
