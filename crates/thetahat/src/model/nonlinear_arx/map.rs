//! The functions of which a nonlinear ARX model is a weighted sum.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_core::{
    Basis, Local, MOST_NEIGHBOURS, MOST_SLOPES, Membership as CoreMembership, Neighbours, Polynomial, Radial,
    Spline,
};

use super::terms::{factors, written};
use crate::Error;
use crate::regression::Monomials;

use crate::figures::short;

/// The functions f_j of a nonlinear ARX model, of n regressors z.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Map {
    /// f_j = the product of some regressors; the constant 1 is the product of none (Leontaritis and Billings 1985).
    Polynomial {
        /// For each function the regressors that are multiplied, from 0 on, in rising order.
        terms: Vec<Vec<usize>>,
    },
    /// f_j = exp(-|z - alpha_j|^2/sigma_j^2), and with `linear` 1 and each regressor before them (Chen, Cowan and Grant 1991, with
    /// sigma^2 for their 2 sigma^2).
    Radial {
        /// alpha, a point for each function.
        centres: Vec<Vec<f64>>,
        /// sigma, one for each function.
        widths: Vec<f64>,
        /// Whether 1 and the regressors come first.
        linear: bool,
    },
    /// 1, each regressor, and bends of single regressors, so that g is a sum of natural cubic splines, one of each regressor (Hastie,
    /// Tibshirani and Friedman 2009, section 5.2.1). A bend of the knots a < b < c is the hat of area 1 over them, integrated twice: it is
    /// 0 up to a, cubic up to b and from there to c, and z - (a + b + c)/3 after c. So g is a line outside of the knots, where a free run
    /// may go; other cubic splines are cubics there.
    Spline {
        /// For each bend its regressor, from 0 on.
        regressors: Vec<usize>,
        /// For each bend its knots.
        knots: Vec<[f64; 3]>,
    },
    /// Local models, planes or constants, each weighted by the membership of z in its box over the sum of all (Nelles 2001, section
    /// 13.3); outside of the domain weights are those of its nearest point.
    Local {
        /// What makes weights of boxes.
        membership: Membership,
        /// Whether each is a plane, 1 and each regressor: else it is a constant.
        planes: bool,
        /// For each local model its box: where the side of each regressor begins and ends.
        boxes: Vec<Vec<[f64; 2]>>,
        /// For each regressor its range, which the boxes divide.
        domain: Vec<[f64; 2]>,
    },
    /// Samples, whose outputs are the parameters: those nearest to z give their mean, or a plane through them (Stone 1977; Hastie,
    /// Tibshirani and Friedman 2009, section 13.3).
    Neighbours {
        /// How many are asked.
        count: usize,
        /// Whether they give a plane: else their mean.
        planes: bool,
        /// z of each.
        points: Vec<Vec<f64>>,
    },
}

/// How the weight of a local model depends on where a point lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Membership {
    /// 1 in its box, 0 outside.
    Rectangle,
    /// The product, over the regressors, of 1 in the middle half of its box's side, from there a line down to 0 a quarter of a side
    /// outside.
    Trapezoid,
    /// A Gaussian about the middle of its box, with a third of each side for its standard deviations.
    Gaussian,
}

impl Membership {
    pub(crate) fn of_the_core(self) -> CoreMembership {
        match self {
            Self::Rectangle => CoreMembership::Rectangle,
            Self::Trapezoid => CoreMembership::Trapezoid,
            Self::Gaussian => CoreMembership::Gaussian,
        }
    }
}

impl Map {
    /// All products of regressors up to a degree, the constant first, then by their number of factors.
    ///
    /// # Errors
    /// [`Error::Argument`] for a degree of 0, or if there are too many.
    pub fn polynomial(regressors: usize, degree: usize) -> Result<Self, Error> {
        let monomials = Monomials::new(regressors, degree)?;
        let mut terms: Vec<Vec<usize>> =
            (0..monomials.count()).map(|place| monomials.factors(place)).collect();
        terms.sort_by_key(Vec::len);
        Ok(Self::Polynomial { terms })
    }

    /// Products as [`Map::names`] writes them, of regressors with these names.
    ///
    /// # Errors
    /// [`Error::Argument`] for one that names none of the regressors, is written in another way, or is there twice.
    pub(crate) fn products(terms: &[String], regressors: &[String]) -> Result<Self, Error> {
        Ok(Self::Polynomial { terms: factors(terms, regressors)? })
    }

    /// How many functions there are of this many regressors.
    pub fn parameters(&self, regressors: usize) -> usize {
        match self {
            Self::Polynomial { terms } => terms.len(),
            Self::Radial { centres, linear, .. } => centres.len() + if *linear { regressors + 1 } else { 0 },
            Self::Spline { knots, .. } => knots.len() + regressors + 1,
            Self::Local { planes, boxes, .. } => boxes.len() * if *planes { regressors + 1 } else { 1 },
            Self::Neighbours { points, .. } => points.len(),
        }
    }

    /// Some of its functions beside those of the linear path, by their places among all of `count` regressors.
    pub(crate) fn some(&self, places: &[usize], count: usize) -> Self {
        match self {
            Self::Polynomial { terms } => {
                let own = places.iter().filter_map(|place| terms.get(*place).cloned());
                Self::Polynomial { terms: own.collect() }
            }
            Self::Radial { centres, widths, linear } => {
                let before = self.parameters(count) - centres.len();
                let own: Vec<usize> = places.iter().filter_map(|place| place.checked_sub(before)).collect();
                Self::Radial {
                    centres: own.iter().map(|place| centres[*place].clone()).collect(),
                    widths: own.iter().map(|place| widths[*place]).collect(),
                    linear: *linear,
                }
            }
            Self::Spline { regressors, knots } => {
                let own = places.iter().filter_map(|place| place.checked_sub(count + 1));
                let (regressors, knots) = own.map(|place| (regressors[place], knots[place])).unzip();
                Self::Spline { regressors, knots }
            }
            // Those of a local model belong together, and so do all samples.
            Self::Local { .. } | Self::Neighbours { .. } => self.clone(),
        }
    }

    /// Such as NARX polynomial, 8 terms.
    pub fn name(&self, parameters: usize) -> String {
        format!("NARX {}", self.describe(parameters))
    }

    /// What it is, with its number of parameters.
    pub(super) fn describe(&self, parameters: usize) -> String {
        let plural = |count: usize| if count == 1 { "" } else { "s" };
        match self {
            Self::Polynomial { .. } => format!("polynomial, {parameters} term{}", plural(parameters)),
            Self::Radial { centres, .. } => {
                format!("radial basis functions, {} centre{}", centres.len(), plural(centres.len()))
            }
            Self::Spline { knots, .. } => format!("splines, {} bend{}", knots.len(), plural(knots.len())),
            Self::Local { boxes, .. } => format!("local models, {}", boxes.len()),
            Self::Neighbours { count, points, .. } => {
                format!("nearest neighbours, {count} of {} samples", points.len())
            }
        }
    }

    /// The functions by name, those of the regressors being given: y(k-1)^2*u(k), rbf1, bend(u(k), 0.5) where the middle knot is 0.5,
    /// local1*u(k), or sample1.
    pub(crate) fn names(&self, regressors: &[String]) -> Vec<String> {
        match self {
            Self::Polynomial { terms } => terms.iter().map(|term| written(term, regressors)).collect(),
            Self::Radial { centres, linear, .. } => {
                let path = path(regressors).take(if *linear { regressors.len() + 1 } else { 0 });
                path.chain((1..=centres.len()).map(|place| format!("rbf{place}"))).collect()
            }
            Self::Spline { regressors: own, knots } => {
                let bends = own.iter().zip(knots).map(|(own, [_, middle, _])| {
                    format!("bend({}, {})", regressors.get(*own).map_or("?", String::as_str), short(*middle))
                });
                path(regressors).chain(bends).collect()
            }
            Self::Local { planes, boxes, .. } => {
                let slopes = if *planes { regressors } else { &[] };
                let each = (1..=boxes.len()).flat_map(|place| {
                    let own = slopes.iter().map(move |name| format!("local{place}*{name}"));
                    std::iter::once(format!("local{place}")).chain(own)
                });
                each.collect()
            }
            Self::Neighbours { points, .. } => {
                (1..=points.len()).map(|place| format!("sample{place}")).collect()
            }
        }
    }

    /// Whether its parts go with this many regressors; else which does not.
    pub(crate) fn check(&self, regressors: usize) -> Result<(), String> {
        if regressors > usize::from(u16::MAX) {
            return Err("is of too many regressors".to_owned());
        }
        match self {
            Self::Polynomial { terms } => {
                match terms.iter().position(|term| term.iter().any(|factor| *factor >= regressors)) {
                    Some(place) => Err(format!("terms[{place}] names a regressor that is not there")),
                    None => Ok(()),
                }
            }
            Self::Radial { centres, widths, .. } => {
                let point =
                    |point: &Vec<f64>| point.len() == regressors && point.iter().all(|z| z.is_finite());
                if let Some(place) = centres.iter().position(|centre| !point(centre)) {
                    return Err(format!("centres[{place}] is no point of {regressors} regressors"));
                }
                let positive = |width: &f64| width.is_finite() && *width > 0.0;
                if widths.len() != centres.len() || !widths.iter().all(positive) {
                    return Err("widths is not a positive number for each centre".to_owned());
                }
                Ok(())
            }
            Self::Spline { regressors: own, knots } => {
                if own.len() != knots.len() {
                    return Err("knots are not three for each bend".to_owned());
                }
                if let Some(place) = own.iter().position(|regressor| *regressor >= regressors) {
                    return Err(format!("regressors[{place}] is not there"));
                }
                let rising = |[a, b, c]: &[f64; 3]| a.is_finite() && a < b && b < c && c.is_finite();
                match knots.iter().position(|knots| !rising(knots)) {
                    Some(place) => Err(format!("knots[{place}] are not three rising numbers")),
                    None => Ok(()),
                }
            }
            Self::Local { boxes, domain, .. } => {
                let rising = |[low, high]: &[f64; 2]| low.is_finite() && low < high && high.is_finite();
                let fits = |sides: &Vec<[f64; 2]>| sides.len() == regressors && sides.iter().all(rising);
                if !fits(domain) {
                    return Err("domain is not two rising numbers for each regressor".to_owned());
                }
                match boxes.iter().position(|sides| !fits(sides)) {
                    Some(place) => {
                        Err(format!("boxes[{place}] is not two rising numbers for each regressor"))
                    }
                    None => Ok(()),
                }
            }
            Self::Neighbours { count, planes, points } => {
                let point =
                    |point: &Vec<f64>| point.len() == regressors && point.iter().all(|z| z.is_finite());
                if let Some(place) = points.iter().position(|own| !point(own)) {
                    return Err(format!("points[{place}] is no point of {regressors} regressors"));
                }
                if *count == 0 || *count > points.len().min(MOST_NEIGHBOURS) {
                    return Err(format!(
                        "count is not from 1 to {} of {} points",
                        points.len().min(MOST_NEIGHBOURS),
                        points.len()
                    ));
                }
                if *planes && regressors > MOST_SLOPES {
                    return Err(format!("planes are of {MOST_SLOPES} regressors at most"));
                }
                Ok(())
            }
        }
    }
}

/// The names of the linear path.
fn path(regressors: &[String]) -> impl Iterator<Item = String> {
    std::iter::once("1".to_owned()).chain(regressors.iter().cloned())
}

/// A map laid out to be evaluated along a log, with its parameters, by the functions of the core. Nothing of it allocates.
#[derive(Debug, Clone)]
pub(crate) struct Evaluator {
    theta: Vec<f64>,
    kind: Kind,
}

#[derive(Debug, Clone)]
enum Kind {
    /// The factors of all terms one after the other, and where each term ends.
    Polynomial { factors: Vec<u16>, ends: Vec<u32> },
    /// The centres one after the other, and 1/sigma^2.
    Radial { centres: Vec<f64>, inverse_squares: Vec<f64>, linear: bool },
    /// The regressor and the knots of each bend.
    Spline { bent: Vec<u16>, knots: Vec<[f64; 3]> },
    /// The boxes one after the other.
    Local { membership: CoreMembership, planes: bool, sides: Vec<[f64; 2]>, domain: Vec<[f64; 2]> },
    /// The points one after the other.
    Neighbours { count: usize, planes: bool, points: Vec<f64> },
}

impl Evaluator {
    /// # Panics
    /// Never for a map that was checked.
    pub(crate) fn new(map: &Map, theta: Vec<f64>) -> Self {
        let kind = match map {
            Map::Polynomial { terms } => {
                let ends = terms.iter().scan(0, |end, term| {
                    *end += term.len() as u32;
                    Some(*end)
                });
                let factors = terms.iter().flatten().map(|factor| *factor as u16);
                Kind::Polynomial { factors: factors.collect(), ends: ends.collect() }
            }
            Map::Radial { centres, widths, linear } => Kind::Radial {
                centres: centres.concat(),
                inverse_squares: widths.iter().map(|width| 1.0 / (width * width)).collect(),
                linear: *linear,
            },
            Map::Spline { regressors, knots } => {
                let bent = regressors.iter().map(|regressor| *regressor as u16);
                Kind::Spline { bent: bent.collect(), knots: knots.clone() }
            }
            Map::Local { membership, planes, boxes, domain } => Kind::Local {
                membership: membership.of_the_core(),
                planes: *planes,
                sides: boxes.concat(),
                domain: domain.clone(),
            },
            Map::Neighbours { count, planes, points } => {
                Kind::Neighbours { count: *count, planes: *planes, points: points.concat() }
            }
        };
        Self { theta, kind }
    }

    /// Whether the value may depend on a regressor.
    pub(crate) fn reads(&self, regressor: usize) -> bool {
        match &self.kind {
            Kind::Polynomial { factors, .. } => {
                factors.iter().any(|factor| usize::from(*factor) == regressor)
            }
            _ => true,
        }
    }

    /// How many functions there are.
    pub(crate) fn parameters(&self) -> usize {
        self.theta.len()
    }

    /// g(z) = sum_j theta_j f_j(z).
    pub(crate) fn value(&self, z: &[f64]) -> f64 {
        // Most samples have no weight.
        if let Kind::Neighbours { count, planes, points } = &self.kind {
            return neighbours(z.len(), points, *count, *planes).value(&self.theta, z);
        }
        let mut sum = 0.0;
        self.each(z, |j, f| sum += self.theta[j] * f);
        sum
    }

    /// f_j(z) for each j.
    pub(crate) fn functions(&self, z: &[f64], into: &mut [f64]) {
        self.each(z, |j, f| into[j] = f);
    }

    /// Calls `take` with j and f_j(z), in the order of j.
    pub(crate) fn each(&self, z: &[f64], take: impl FnMut(usize, f64)) {
        match &self.kind {
            Kind::Polynomial { factors, ends } => Polynomial { factors, ends }.each(z, take),
            Kind::Radial { centres, inverse_squares, linear } => {
                radial(z.len(), centres, inverse_squares, *linear).each(z, take);
            }
            Kind::Spline { bent, knots } => Spline { regressors: z.len(), bent, knots }.each(z, take),
            Kind::Local { membership, planes, sides, domain } => {
                Local { membership: *membership, planes: *planes, sides, domain }.each(z, take);
            }
            Kind::Neighbours { count, planes, points } => {
                neighbours(z.len(), points, *count, *planes).each(z, take);
            }
        }
    }

    /// dg/dz_i for each i.
    pub(crate) fn slopes(&self, z: &[f64], into: &mut [f64]) {
        into.fill(0.0);
        match &self.kind {
            Kind::Polynomial { factors, ends } => {
                Polynomial { factors, ends }.add_slopes(&self.theta, z, into)
            }
            Kind::Radial { centres, inverse_squares, linear } => {
                radial(z.len(), centres, inverse_squares, *linear).add_slopes(&self.theta, z, into);
            }
            Kind::Spline { bent, knots } => {
                Spline { regressors: z.len(), bent, knots }.add_slopes(&self.theta, z, into);
            }
            Kind::Local { membership, planes, sides, domain } => {
                Local { membership: *membership, planes: *planes, sides, domain }.add_slopes(
                    &self.theta,
                    z,
                    into,
                );
            }
            Kind::Neighbours { count, planes, points } => {
                neighbours(z.len(), points, *count, *planes).add_slopes(&self.theta, z, into);
            }
        }
    }
}

fn neighbours(regressors: usize, points: &[f64], count: usize, planes: bool) -> Neighbours<'_, f64> {
    Neighbours { regressors, points, count, planes }
}

fn radial<'a>(
    regressors: usize,
    centres: &'a [f64],
    inverse_squares: &'a [f64],
    linear: bool,
) -> Radial<'a, f64> {
    Radial { regressors, centres, inverse_squares, linear }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn maps() -> Vec<Map> {
        let centres = vec![vec![0.2, -0.4], vec![1.0, 0.3], vec![-0.7, 0.9]];
        let local = |membership, planes| Map::Local {
            membership,
            planes,
            boxes: vec![
                vec![[-1.0, 0.0], [-1.0, 1.0]],
                vec![[0.0, 1.0], [-1.0, 0.0]],
                vec![[0.0, 1.0], [0.0, 1.0]],
            ],
            domain: vec![[-1.0, 1.0]; 2],
        };
        let points: Vec<Vec<f64>> =
            (0..20).map(|k| vec![f64::from(k % 5) * 0.3 - 0.7, f64::from(k % 4) * 0.5 - 1.0]).collect();
        vec![
            Map::Polynomial { terms: vec![vec![], vec![0], vec![0, 0, 1], vec![1, 1]] },
            Map::Radial { centres: centres.clone(), widths: vec![0.8, 1.0, 2.0], linear: false },
            Map::Radial { centres, widths: vec![0.8, 1.0, 2.0], linear: true },
            Map::Spline {
                regressors: vec![0, 1, 1],
                knots: vec![[-1.0, 0.5, 1.0], [-1.5, -1.0, 0.5], [-3.0, -2.5, -2.0]],
            },
            local(Membership::Rectangle, true),
            local(Membership::Trapezoid, true),
            local(Membership::Gaussian, true),
            local(Membership::Trapezoid, false),
            Map::Neighbours { count: 3, planes: false, points: points.clone() },
            Map::Neighbours { count: 20, planes: true, points },
        ]
    }

    #[test]
    fn slopes_are_differences_of_values() {
        for map in maps() {
            assert_eq!(map.check(2), Ok(()));
            let count = map.parameters(2);
            let theta: Vec<f64> = (0..count).map(|j| 0.3 + j as f64 * 0.4).collect();
            let evaluator = Evaluator::new(&map, theta.clone());
            let z = [0.37, -0.81];
            let mut functions = vec![0.0; count];
            evaluator.functions(&z, &mut functions);
            let sum: f64 = functions.iter().zip(&theta).map(|(f, theta)| f * theta).sum();
            assert!((sum - evaluator.value(&z)).abs() < 1e-14);
            let mut slopes = [0.0; 2];
            evaluator.slopes(&z, &mut slopes);
            for i in 0..2 {
                let moved = |step: f64| {
                    let mut z = z;
                    z[i] += step;
                    evaluator.value(&z)
                };
                let difference = (moved(1e-5) - moved(-1e-5)) / 2e-5;
                assert!((difference - slopes[i]).abs() < 1e-8, "{map:?} {i}: {difference} {slopes:?}");
            }
        }
    }

    #[test]
    fn functions_have_names() {
        let regressors = ["y(k-1)".to_owned(), "u(k)".to_owned()];
        assert_eq!(maps()[0].names(&regressors), ["1", "y(k-1)", "y(k-1)^2*u(k)", "u(k)^2"]);
        assert_eq!(maps()[2].names(&regressors), ["1", "y(k-1)", "u(k)", "rbf1", "rbf2", "rbf3"]);
        assert_eq!(
            maps()[3].names(&regressors),
            ["1", "y(k-1)", "u(k)", "bend(y(k-1), 0.5)", "bend(u(k), -1)", "bend(u(k), -2.5)"]
        );
        assert_eq!(maps()[4].names(&regressors)[3..6], ["local2", "local2*y(k-1)", "local2*u(k)"]);
        assert_eq!(maps()[7].names(&regressors), ["local1", "local2", "local3"]);
        assert_eq!(maps()[9].names(&regressors)[19], "sample20");
    }

    #[test]
    fn parts_that_do_not_fit_are_told() {
        assert!(Map::Polynomial { terms: vec![vec![2]] }.check(2).is_err());
        assert!(Map::Radial { centres: vec![vec![1.0]], widths: vec![1.0], linear: true }.check(2).is_err());
        assert!(Map::Radial { centres: vec![vec![1.0]], widths: vec![], linear: true }.check(1).is_err());
        for (regressors, knots) in
            [(vec![0], vec![]), (vec![1], vec![[0.0, 1.0, 2.0]]), (vec![0], vec![[0.0, 0.0, 1.0]])]
        {
            assert!(Map::Spline { regressors, knots }.check(1).is_err());
        }
        let (membership, sides) = (Membership::Gaussian, vec![[0.0, 1.0]]);
        for (boxes, domain) in
            [(vec![vec![]], sides.clone()), (vec![sides.clone()], vec![]), (vec![vec![[1.0, 1.0]]], sides)]
        {
            assert!(Map::Local { membership, planes: true, boxes, domain }.check(1).is_err());
        }
        for (count, points) in [(0, vec![vec![0.0]]), (2, vec![vec![0.0]]), (1, vec![vec![]])] {
            assert!(Map::Neighbours { count, planes: false, points }.check(1).is_err());
        }
    }
}
