//! The states of data, with an order and levels that were given or that the least MDL chooses.

use std::ops::RangeInclusive;

use super::data::SubspaceData;
use super::{OrderScore, Subspace, SubspaceOptions, best, subspace_of};
use crate::Error;
use crate::estimate::Constant;

/// The states of a record or of sums, and the order that was given or chosen.
#[derive(Debug, Clone)]
pub(crate) struct Ordered {
    pub(crate) subspace: Subspace,
    pub(crate) order: usize,
    /// What the order was chosen among; none if it was given.
    pub(crate) scores: Vec<OrderScore>,
    /// That of the order; infinite if nobody asks for it.
    mdl: f64,
}

impl Ordered {
    /// The order of least MDL among some, or among those that are offered; with levels where these are asked for, or
    /// lower MDL.
    ///
    /// # Errors
    /// As for [`subspace`](super::subspace) and [`Subspace::order`].
    pub(crate) fn new(
        data: &impl SubspaceData,
        options: &SubspaceOptions,
        orders: Option<&RangeInclusive<usize>>,
        constant: Constant,
    ) -> Result<Self, Error> {
        let compared = constant == Constant::Auto;
        with_levels(
            constant,
            |constant| Self::of(data, &SubspaceOptions { constant, ..*options }, orders, compared),
            |found| found.mdl,
        )
    }

    /// `compared` says whether its MDL is asked for where the order is given.
    fn of(
        data: &impl SubspaceData,
        options: &SubspaceOptions,
        orders: Option<&RangeInclusive<usize>>,
        compared: bool,
    ) -> Result<Self, Error> {
        let subspace = subspace_of(data, options)?;
        let highest = subspace.highest_order();
        let asked = orders.cloned().unwrap_or_else(|| subspace.orders());
        let orders = *asked.start()..=(*asked.end()).min(highest);
        if orders.is_empty() {
            return Err(Error::argument(
                "order",
                format!("the data tell of orders up to {highest}; ask for one of these"),
            ));
        }
        let given = asked.start() == asked.end();
        if given && !compared {
            return Ok(Self { subspace, order: *asked.start(), scores: Vec::new(), mdl: f64::INFINITY });
        }
        let scores = data.scores(&subspace, orders)?;
        let order = if given { *asked.start() } else { best(&scores)? };
        let own = scores.iter().find(|score| score.order == order).and_then(|score| score.mdl);
        let mdl = own.unwrap_or(f64::INFINITY);
        Ok(Self { subspace, order, scores: if given { Vec::new() } else { scores }, mdl })
    }
}

/// What has the least MDL, with levels or without; what has no level, as an integrator, is fitted without.
pub(crate) fn with_levels<T>(
    constant: Constant,
    find: impl Fn(bool) -> Result<T, Error>,
    mdl: impl Fn(&T) -> f64,
) -> Result<T, Error> {
    match constant {
        Constant::No => find(false),
        Constant::Yes => find(true),
        Constant::Auto => {
            let plain = find(false)?;
            Ok(find(true).ok().filter(|other| mdl(other) < mdl(&plain)).unwrap_or(plain))
        }
    }
}
