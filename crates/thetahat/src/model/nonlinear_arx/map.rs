//! The functions of which a nonlinear ARX model is a weighted sum.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use thetahat_core::{
    Activation as CoreActivation, MOST_NEIGHBOURS, MOST_SLOPES, Membership as CoreMembership,
};
use thetahat_numerics::regression::Monomials;

use super::terms::{factors, written};
use crate::Error;

use crate::figures::short;

/// 1/sigma of the widest radial basis function.
const SMALLEST: f64 = 1e-100;

/// The functions f_j of a nonlinear ARX model, of n regressors z.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "type", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Map {
    /// f_j = the product of some regressors; the constant 1 is the product of none (Leontaritis and Billings 1985).
    Polynomial {
        /// For each function the regressors that are multiplied, from 0 on, in rising order.
        terms: Vec<Vec<usize>>,
    },
    /// f_j = exp(-|z - alpha_j|^2/sigma_j^2), and with `linear` 1 and each regressor before them (Chen, Cowan and Grant
    /// 1991, with sigma^2 for their 2 sigma^2).
    Radial {
        /// alpha, a point for each function.
        centres: Vec<Vec<f64>>,
        /// sigma, one for each function.
        widths: Vec<f64>,
        /// Whether 1 and the regressors come first.
        linear: bool,
    },
    /// 1, each regressor, and bends of single regressors, so that g is a sum of natural cubic splines, one of each
    /// regressor (Hastie, Tibshirani and Friedman 2009, section 5.2.1). A bend of the knots a < b < c is the hat of
    /// area 1 over them, integrated twice: it is 0 up to a, cubic up to b and from there to c, and z - (a + b + c)/3
    /// after c. So g is a line outside of the knots, where a free run may go; other cubic splines are cubics there.
    Spline {
        /// For each bend its regressor, from 0 on.
        regressors: Vec<usize>,
        /// For each bend its knots.
        knots: Vec<[f64; 3]>,
    },
    /// 1, each regressor, and units f(w_j' z + b_j): a network with one hidden layer beside a linear path (Rumelhart,
    /// Hinton and Williams 1986). theta are the weights of its output.
    Network {
        /// f.
        activation: Activation,
        /// w, for each unit one for each regressor.
        weights: Vec<Vec<f64>>,
        /// b, one for each unit.
        biases: Vec<f64>,
    },
    /// Local models, planes or constants, each weighted by the membership of z in its box over the sum of all (Nelles
    /// 2001, section 13.3); outside of the domain weights are those of its nearest point.
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
    /// Samples, whose outputs are the parameters: those nearest to z give their mean, or a plane through them (Stone
    /// 1977; Hastie, Tibshirani and Friedman 2009, section 13.3).
    Neighbours {
        /// How many are asked.
        count: usize,
        /// Whether they give a plane: else their mean.
        planes: bool,
        /// z of each.
        points: Vec<Vec<f64>>,
    },
}

/// What a unit of a network makes of its sum a.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Activation {
    /// tanh a.
    Tanh,
    /// 1/(1 + exp(-a)).
    Logistic,
    /// a where it is positive, else 0: beside a linear path a hinge (Breiman 1993).
    Relu,
    /// 1 where a is not negative, else 0.
    Step,
}

impl Activation {
    pub(crate) fn of_the_core(self) -> CoreActivation {
        match self {
            Self::Tanh => CoreActivation::Tanh,
            Self::Logistic => CoreActivation::Logistic,
            Self::Relu => CoreActivation::Relu,
            Self::Step => CoreActivation::Step,
        }
    }

    /// As options and names of models write it.
    pub fn word(self) -> &'static str {
        match self {
            Self::Tanh => "tanh",
            Self::Logistic => "logistic",
            Self::Relu => "relu",
            Self::Step => "step",
        }
    }
}

/// How the weight of a local model depends on where a point lies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Membership {
    /// 1 in its box, 0 outside.
    Rectangle,
    /// The product, over the regressors, of 1 in the middle half of its box's side, from there a line down to 0 a
    /// quarter of a side outside.
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
            Self::Network { biases, .. } => biases.len() + regressors + 1,
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
            Self::Network { activation, weights, biases } => {
                let own: Vec<usize> =
                    places.iter().filter_map(|place| place.checked_sub(count + 1)).collect();
                Self::Network {
                    activation: *activation,
                    weights: own.iter().map(|place| weights[*place].clone()).collect(),
                    biases: own.iter().map(|place| biases[*place]).collect(),
                }
            }
            // Those of a local model belong together, and so do all samples.
            Self::Local { .. } | Self::Neighbours { .. } => self.clone(),
        }
    }

    /// The numbers of its functions that training moves, function after function: alpha and 1/sigma of radial basis
    /// functions, w and b of units. Of other maps, and of steps, none.
    pub(crate) fn shape(&self) -> Vec<f64> {
        match self {
            Self::Radial { centres, widths, .. } => {
                let each = centres.iter().zip(widths);
                each.flat_map(|(centre, width)| centre.iter().copied().chain([1.0 / width])).collect()
            }
            Self::Network { activation, .. } if *activation == Activation::Step => Vec::new(),
            Self::Network { weights, biases, .. } => {
                let each = weights.iter().zip(biases);
                each.flat_map(|(weights, bias)| weights.iter().copied().chain([*bias])).collect()
            }
            _ => Vec::new(),
        }
    }

    /// The same functions with other numbers, in the order of [`shape`](Self::shape).
    pub(crate) fn with_shape(&self, regressors: usize, shape: &[f64]) -> Self {
        let each = || shape.chunks_exact(regressors + 1);
        let points = || each().map(|own| own[..regressors].to_vec()).collect();
        match self {
            Self::Radial { linear, .. } => Self::Radial {
                centres: points(),
                // Where it has grown flat it is as wide as numbers go.
                widths: each().map(|own| 1.0 / own[regressors].abs().max(SMALLEST)).collect(),
                linear: *linear,
            },
            Self::Network { activation, .. } if *activation != Activation::Step => Self::Network {
                activation: *activation,
                weights: points(),
                biases: each().map(|own| own[regressors]).collect(),
            },
            other => other.clone(),
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
            Self::Network { activation, biases, .. } => {
                format!("{} network, {} unit{}", activation.word(), biases.len(), plural(biases.len()))
            }
            Self::Local { boxes, .. } => format!("local models, {}", boxes.len()),
            Self::Neighbours { count, points, .. } => {
                format!("nearest neighbours, {count} of {} samples", points.len())
            }
        }
    }

    /// The functions by name, those of the regressors being given: y(k-1)^2*u(k), rbf1, bend(u(k), 0.5) where the
    /// middle knot is 0.5, unit1, local1*u(k), or sample1.
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
            Self::Network { biases, .. } => {
                path(regressors).chain((1..=biases.len()).map(|place| format!("unit{place}"))).collect()
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
            Self::Network { weights, biases, .. } => {
                let point =
                    |weights: &Vec<f64>| weights.len() == regressors && weights.iter().all(|w| w.is_finite());
                if let Some(place) = weights.iter().position(|weights| !point(weights)) {
                    return Err(format!(
                        "weights[{place}] is not one number for each of {regressors} regressors"
                    ));
                }
                if biases.len() != weights.len() || !biases.iter().all(|bias| bias.is_finite()) {
                    return Err("biases is not a number for each unit".to_owned());
                }
                Ok(())
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Evaluator;

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
        let network = |activation| Map::Network {
            activation,
            weights: vec![vec![0.7, -1.1], vec![0.2, 0.4], vec![0.9, -0.3]],
            biases: vec![0.1, -0.4, 0.6],
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
            network(Activation::Tanh),
            network(Activation::Logistic),
            network(Activation::Relu),
            network(Activation::Step),
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
    fn gradients_are_differences_of_values() {
        for map in maps() {
            let theta: Vec<f64> = (0..map.parameters(2)).map(|j| 0.3 + j as f64 * 0.4).collect();
            let shape = map.shape();
            assert_eq!(map.with_shape(2, &shape).shape(), shape);
            let all: Vec<f64> = theta.iter().chain(&shape).copied().collect();
            let z = [0.37, -0.81];
            let mut evaluator = Evaluator::new(&map, theta);
            let (mut gradient, mut slopes, mut by_gradient) = (vec![0.0; all.len()], [0.0; 2], [0.0; 2]);
            evaluator.gradient(&z, &mut gradient);
            evaluator.slopes(&z, &mut slopes);
            evaluator.slopes_of_gradient(&z, &gradient, &mut by_gradient);
            for (one, other) in slopes.iter().zip(by_gradient) {
                assert!((one - other).abs() < 1e-13, "{map:?}: {slopes:?} {by_gradient:?}");
            }
            for (place, own) in gradient.iter().enumerate() {
                let mut moved = |step: f64| {
                    let mut all = all.clone();
                    all[place] += step;
                    evaluator.assign(&all);
                    evaluator.value(&z)
                };
                let difference = (moved(1e-5) - moved(-1e-5)) / 2e-5;
                assert!((difference - own).abs() < 1e-8, "{map:?} {place}: {difference} {own}");
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
        assert_eq!(maps()[10].names(&regressors)[2..4], ["u(k)", "unit1"]);
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
        for (weights, biases) in
            [(vec![vec![1.0, 2.0]], vec![0.0]), (vec![vec![1.0]], vec![]), (vec![vec![1.0]], vec![f64::NAN])]
        {
            assert!(Map::Network { activation: Activation::Tanh, weights, biases }.check(1).is_err());
        }
        for (count, points) in [(0, vec![vec![0.0]]), (2, vec![vec![0.0]]), (1, vec![vec![]])] {
            assert!(Map::Neighbours { count, planes: false, points }.check(1).is_err());
        }
    }
}
