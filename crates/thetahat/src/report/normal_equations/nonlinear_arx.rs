//! The nonlinear ARX model of products that normal equations hold.

use std::ops::Range;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_numerics::regression::{DividedMonomials, ExtendedGram, Monomials};

use super::super::nonlinear_arx::{
    MapPlan, NonlinearArxPlan, ROUNDING, Reported, head, is_constant, reported, warnings, with_expressions,
};
use super::super::schema::Report;
use super::{NormalEquations, Piece, Settings, Totals};
use crate::Error;
use crate::data::Offset;
use crate::estimate::nonlinear_arx::{Candidates, Count, Joint, of_sums};
use crate::estimate::{MapsOutcome, out_of_range};
use crate::model::{ChannelExpression, Map, NonlinearArxModel, Signal};
use crate::respond::InitialCondition;
use crate::select::Select;

/// What the sums are about, and between which values they are.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub(super) struct Centred {
    /// What was taken from each channel, those of expressions last.
    centres: Vec<f64>,
    /// The least and the largest value of each regressor, and at the end of the output; none where there is no sample.
    ranges: Option<Vec<[f64; 2]>>,
}

/// Which products the sums are of.
pub(super) struct Products {
    plan: NonlinearArxPlan,
    expressions: Vec<ChannelExpression>,
    /// The model in the signals' own units, without offsets.
    plain: NonlinearArxModel,
    candidates: Candidates,
    count: Count,
    monomials: DividedMonomials,
    /// The place of the channel of each regressor, and at the end of the output.
    sources: Vec<usize>,
}

impl Products {
    pub(super) fn of(settings: &Settings) -> Result<Self, Error> {
        let plan = settings.nonlinear_plan()?;
        plan.check()?;
        let expressions = plan.read_expressions()?;
        let channels: Vec<&str> = settings.all_names();
        let signal = |name: &&str| Signal { name: (*name).to_owned(), offset: Offset::default() };
        let signals = channels.iter().map(|name| ((*name).to_owned(), signal(name))).collect();
        let plain = head(&plan, &signals, &expressions, 1.0, |_, _| Ok(1.0))?;
        let names: Vec<String> = plain.regressors.iter().map(|one| one.name()).collect();
        let (candidates, count, terms) = match (&plan.map, plan.terms, plan.select) {
            (MapPlan::Products { terms }, _, _) => {
                let (always, map) = (terms.len(), Map::products(terms, &names)?);
                let Map::Polynomial { terms } = map.clone() else {
                    return Err(Error::argument("term", "the functions are no products"));
                };
                (Candidates::Functions { map, always }, Count::Given(always), terms)
            }
            (MapPlan::Polynomial { degree }, terms, select) => {
                let count = match (terms, select) {
                    (Some(count), _) => Count::Given(count),
                    (None, Some(Select::Criterion(criterion))) => Count::Least(criterion),
                    (None, _) => return Err(Error::argument("select", "it is no information criterion")),
                };
                let all = Monomials::new(names.len(), *degree)?;
                let terms = (0..all.count()).map(|place| all.factors(place)).collect();
                (Candidates::Products(all), count, terms)
            }
            _ => return Err(Error::argument("map", "the functions are no products")),
        };
        let monomials = DividedMonomials::new(&terms, names.len()).ok_or_else(|| {
            Error::argument(
                "term",
                "the products and their parts are more than 1000, whose sums are too many; give fewer, or with fewer factors",
            )
        })?;
        let read = plain
            .regressors
            .iter()
            .map(|one| one.channel.as_str())
            .chain(plan.outputs.first().map(String::as_str));
        let sources = read.map(|name| channels.iter().position(|own| *own == name).unwrap_or(0)).collect();
        Ok(Self { plan, expressions, plain, candidates, count, monomials, sources })
    }

    pub(super) fn columns(&self) -> usize {
        self.monomials.size()
    }

    /// The values of these for each regressor and the output, of those of each channel.
    fn of_each(&self, values: &[f64]) -> Vec<f64> {
        self.sources.iter().map(|source| values[*source]).collect()
    }

    /// Sums that are about the centres of some pieces, about those of others.
    fn moved(&self, sums: &ExtendedGram, from: &[f64], to: &[f64]) -> ExtendedGram {
        self.monomials.moved(sums, &self.of_each(from), &self.of_each(to))
    }
}

impl Centred {
    /// Whether it is that of so many channels and regressors.
    pub(super) fn fits(&self, channels: usize, products: &Products) -> bool {
        self.centres.len() == channels
            && self.centres.iter().all(|centre| centre.is_finite())
            && self.ranges.as_ref().is_none_or(|ranges| ranges.len() == products.sources.len())
    }

    /// That of these pieces and others, and the sums of both. Sums without a sample are about nothing.
    pub(super) fn joined(
        &self,
        other: &Self,
        products: &Products,
        (own, others): (&ExtendedGram, &ExtendedGram),
    ) -> (Self, ExtendedGram) {
        let centres = if own.rows() > 0 { &self.centres } else { &other.centres };
        let mut sums = products.moved(own, &self.centres, centres);
        sums.merge(&products.moved(others, &other.centres, centres));
        let ranges = match (&self.ranges, &other.ranges) {
            (Some(own), Some(others)) => {
                let both = own.iter().zip(others);
                Some(both.map(|([a, b], [c, d])| [a.min(*c), b.max(*d)]).collect())
            }
            (own, others) => own.as_ref().or(others.as_ref()).cloned(),
        };
        (Self { centres: centres.clone(), ranges }, sums)
    }
}

/// What is known of a piece.
pub(super) struct Summed {
    pub(super) products: ExtendedGram,
    pub(super) centred: Centred,
    /// Those of the expressions.
    pub(super) totals: Vec<Totals>,
    pub(super) segments: Vec<Range<usize>>,
}

/// The sums over a piece, about its own means, or about offsets that are told.
pub(super) fn summed(settings: &Settings, piece: &Piece<'_>, products: &Products) -> Result<Summed, Error> {
    let (names, plan) = (settings.names(), &products.plan);
    let measured = piece.log.segments(&names, &piece.own)?;
    let whole = with_expressions(piece.log, plan, &products.expressions, &measured)?;
    let read: Vec<String> = plan.inputs.iter().chain(&plan.expressions).cloned().collect();
    let record = whole.record(&read, &plan.outputs[0], &piece.own)?;
    let channels = settings.all_names();
    let signals: Vec<&[f64]> = channels
        .iter()
        .map(|name| Ok(whole.channel(name)?.values.as_slice()))
        .collect::<Result<_, Error>>()?;
    let of = |values: &[f64]| {
        Totals::of(values, piece.past, &record.segments).with_squares(values, &record.segments)
    };
    let totals: Vec<Totals> = signals.iter().map(|values| of(values)).collect();
    let each = channels.iter().zip(&totals);
    let centres: Vec<f64> =
        each.map(|(name, totals)| settings.told_offset(name).unwrap_or_else(|| totals.mean())).collect();
    let lags = settings.lags();
    let rows: Vec<usize> = Piece::with_past(&record, lags)
        .into_iter()
        .flat_map(|segment| (segment.start + lags).min(segment.end)..segment.end)
        .collect();
    let taps: Vec<(usize, usize)> = (products.sources.iter().copied())
        .zip(products.plain.regressors.iter().map(|one| one.lag).chain([0]))
        .collect();
    let fill = |index: usize, first: usize, into: &mut [f64]| {
        let (source, lag) = taps[index];
        let (values, centre) = (signals[source], centres[source]);
        into.iter_mut().zip(&rows[first..]).for_each(|(into, t)| *into = values[t - lag] - centre);
    };
    let sums = products.monomials.sums(rows.len(), fill);
    if !sums.is_in_range() {
        return Err(out_of_range());
    }
    let range = |(source, lag): &(usize, usize)| {
        let values = rows.iter().map(|t| signals[*source][t - lag]);
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[least, largest], value| {
            [least.min(value), largest.max(value)]
        })
    };
    let ranges = (!rows.is_empty()).then(|| taps.iter().map(range).collect());
    Ok(Summed { products: sums, centred: Centred { centres, ranges }, totals, segments: record.segments })
}

/// With the offsets and the scales of all pieces.
pub(super) fn solve(sums: &NormalEquations, centred: &Centred) -> Result<Report, Error> {
    let products = Products::of(&sums.settings)?;
    let (plan, names) = (&products.plan, sums.settings.all_names());
    let (mut offsets, mut scales) = (Vec::new(), Vec::new());
    for (channel, name) in names.iter().enumerate() {
        let ([least, largest], totals) = (sums.range(channel)?, &sums.channels[channel]);
        let role = match channel {
            _ if *name == plan.outputs[0] => "output",
            input if input < plan.inputs.len() => "input",
            _ => "regressor",
        };
        let spread = totals.deviation().unwrap_or(0.0);
        if spread.is_nan() || spread <= ROUNDING * least.abs().max(largest.abs()) {
            return Err(is_constant(name, role));
        }
        scales.push(if plan.raw_terms { 1.0 } else { spread });
        offsets.push(sums.settings.told_offset(name).unwrap_or_else(|| totals.mean()));
    }
    let place = |name: &str| names.iter().position(|own| *own == name).unwrap_or(0);
    let signal = |(name, level): (&&str, &f64)| {
        let offset = Offset { level: *level, slope: 0.0 };
        ((*name).to_owned(), Signal { name: (*name).to_owned(), offset })
    };
    let signals = names.iter().zip(&offsets).map(signal).collect();
    let scale = |name: &str, _: &str| Ok(scales[place(name)]);
    let mut model = head(plan, &signals, &products.expressions, sums.sample_time, scale)?;
    let ranges = centred.ranges.as_deref().unwrap_or_default();
    let ranges =
        ranges.iter().zip(products.of_each(&offsets)).map(|(range, offset)| range.map(|end| end - offset));
    let maps = model.maps.iter_mut().map(|map| &mut map.range);
    let ends = model.regressors.iter_mut().map(|one| &mut one.range).chain(maps);
    ends.zip(ranges).for_each(|(own, range)| *own = range);

    let about = products.moved(&sums.products, &centred.centres, &offsets);
    let choice = (&products.candidates, plan.steps(), &products.count);
    let (solved, outcome) = of_sums(&model, choice, &products.monomials, &about)?;
    let (samples, mse, parameters) = (about.rows(), solved.mse, solved.model.parameters.len());
    let joint = Joint { model: solved.model, mse, determinant: mse, condition: solved.condition };
    let procedure = MapsOutcome { maps: vec![outcome] }.chosen();
    let Reported { mut report, model } = reported(joint, procedure, (parameters, samples), sums.data());
    let spread = about.spread(DividedMonomials::TARGET).sqrt();
    report.fit.push(sums.one_step(&plan.outputs[0], (samples, mse), spread, InitialCondition::Drop));
    report.warnings = warnings(&report, &model);
    Ok(report.with_purpose())
}
