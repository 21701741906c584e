use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::Error;

/// No order may be larger: beyond it a number was mistyped.
const LARGEST: usize = 1000;

/// The orders of A(q) y(t) = sum_j B_j(q)/F_j(q) u_j(t - nk_j) + C(q)/D(q) e(t).
///
/// A, C, D and F are monic: na is the number of coefficients a1 … a_na behind the leading 1, and likewise nc, nd
/// and nf. B has nb coefficients, the first of which multiplies u(t - nk).
///
/// ```
/// use thetahat::Orders;
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

impl Orders {
    /// The orders of an ARX model, A(q) y(t) = sum_j B_j(q) u_j(t - nk_j) + e(t).
    ///
    /// # Errors
    /// [`Error::Argument`] if nb and nk differ in length, all orders are 0, or one is above 1000.
    pub fn arx(na: usize, nb: &[usize], nk: &[usize]) -> Result<Self, Error> {
        if nb.len() != nk.len() {
            return Err(Error::argument(
                "nk",
                format!(
                    "there are {} values for {} inputs; give one for each, or one for all",
                    nk.len(),
                    nb.len()
                ),
            ));
        }
        let largest = nb.iter().chain(nk).copied().fold(na, usize::max);
        if largest > LARGEST {
            return Err(Error::argument(
                "orders",
                format!("{largest} is above {LARGEST}, the largest order"),
            ));
        }
        if na == 0 && nb.iter().all(|&nb| nb == 0) {
            return Err(Error::argument("orders", "na and nb are all 0: the model has no parameters"));
        }
        Ok(Self { na, nb: nb.to_vec(), nc: 0, nd: 0, nf: vec![0; nb.len()], nk: nk.to_vec() })
    }

    /// The number of inputs.
    pub fn inputs(&self) -> usize {
        self.nb.len()
    }

    /// The number of parameters p.
    pub fn parameters(&self) -> usize {
        self.na + self.nc + self.nd + self.nb.iter().sum::<usize>() + self.nf.iter().sum::<usize>()
    }

    /// How many past samples a full ARX regressor reaches back: max(na, nb + nk - 1).
    pub fn reach(&self) -> usize {
        self.inputs_reach().max(self.na)
    }

    /// How many past samples of the inputs matter: max(nb + nk - 1) over the inputs with nb > 0.
    pub(crate) fn inputs_reach(&self) -> usize {
        let reach = |(&nb, &nk): (&usize, &usize)| if nb == 0 { 0 } else { nb + nk - 1 };
        self.nb.iter().zip(&self.nk).map(reach).max().unwrap_or(0)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_carry_the_power_and_the_input() {
        let orders = Orders::arx(1, &[2, 1], &[0, 4]).unwrap();
        assert_eq!(orders.names(), ["a1", "b1_0", "b1_1", "b2_4"]);
        assert_eq!(orders.parameters(), 4);
        assert_eq!(orders.reach(), 4);
    }

    #[test]
    fn orders_that_make_no_model_are_refused() {
        assert!(Orders::arx(0, &[0], &[1]).is_err());
        assert!(Orders::arx(0, &[], &[]).is_err());
        assert!(Orders::arx(1, &[1], &[]).is_err());
        assert!(Orders::arx(1001, &[1], &[1]).is_err());
        assert!(Orders::arx(2, &[], &[]).is_ok());
    }
}
