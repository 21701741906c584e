//! The maps of nonlinear ARX models: as a constant of the core, which Rust evaluates, and in statements, which do the
//! same in its order.

use super::program::{
    Array, Basis, Condition, Evaluated, Field, Function, Index, Program, Statement, Value, Variable,
};
use crate::model::{Activation, Map, Membership};

/// A map by its number, of regressors that stand in `z`.
pub(super) fn evaluated(
    program: &mut Program,
    number: usize,
    functions: &Map,
    theta: Vec<f64>,
    z: Array,
) -> Evaluated {
    let named = |letter: &str| if number == 1 { letter.to_owned() } else { format!("{letter}{number}") };
    let parameters = program.table(&named("THETA"), "The parameters.", theta.clone());
    let regressors = program.length(z);
    let maker = Maker { z, parameters, regressors };
    let count = ("regressors", Field::Count(regressors));
    let (basis, statements) = match functions {
        Map::Polynomial { terms } => {
            let ends = terms.iter().scan(0, |end, term| {
                *end += term.len();
                Some(*end)
            });
            let fields =
                vec![("factors", Field::Integers(terms.concat())), ("ends", Field::Integers(ends.collect()))];
            let basis = Basis { name: "Polynomial", generic: false, fields };
            (basis, Some(maker.polynomial(program, terms)))
        }
        Map::Radial { centres, widths, linear } => {
            let squares = widths.iter().map(|width| 1.0 / (width * width)).collect();
            let centres = program.table(&named("CENTRES"), "The centres.", centres.concat());
            let squares =
                program.table(&named("INVERSE_SQUARES"), "1 over the squares of the widths.", squares);
            let fields = vec![
                count,
                ("centres", Field::Table(centres)),
                ("inverse_squares", Field::Table(squares)),
                ("linear", Field::Flag(*linear)),
            ];
            let basis = Basis { name: "Radial", generic: true, fields };
            (basis, Some(maker.radial(program, [centres, squares], *linear)))
        }
        Map::Spline { regressors, knots } => {
            let table = program.table(&named("KNOTS"), "The knots of the bends, three each.", knots.concat());
            program.group(table, 3);
            let fields =
                vec![count, ("bent", Field::Integers(regressors.clone())), ("knots", Field::Table(table))];
            let basis = Basis { name: "Spline", generic: true, fields };
            (basis, Some(maker.spline(program, regressors, table)))
        }
        Map::Network { activation, weights, biases } => {
            let weights = program.table(&named("WEIGHTS"), "The weights of the units.", weights.concat());
            let biases = program.table(&named("BIASES"), "Their biases.", biases.clone());
            let word = match activation {
                Activation::Tanh => "Tanh",
                Activation::Logistic => "Logistic",
                Activation::Relu => "Relu",
                Activation::Step => "Step",
            };
            let fields = vec![
                ("activation", Field::Word("Activation", word)),
                count,
                ("weights", Field::Table(weights)),
                ("biases", Field::Table(biases)),
            ];
            let basis = Basis { name: "Network", generic: true, fields };
            (basis, Some(maker.network(program, [weights, biases], *activation)))
        }
        Map::Local { membership, planes, boxes, domain } => {
            let sides = boxes.iter().flatten().flatten().copied().collect();
            let sides = program.table(&named("SIDES"), "The sides of the boxes, two ends each.", sides);
            let domain = program.table(&named("DOMAIN"), "The range of each regressor.", domain.concat());
            program.group(sides, 2);
            program.group(domain, 2);
            let word = match membership {
                Membership::Rectangle => "Rectangle",
                Membership::Trapezoid => "Trapezoid",
                Membership::Gaussian => "Gaussian",
            };
            let fields = vec![
                ("membership", Field::Word("Membership", word)),
                ("planes", Field::Flag(*planes)),
                ("sides", Field::Table(sides)),
                ("domain", Field::Table(domain)),
            ];
            let basis = Basis { name: "Local", generic: true, fields };
            (basis, Some(maker.local(program, [sides, domain], *membership, (boxes.len(), *planes))))
        }
        Map::Neighbours { count: asked, planes, points } => {
            let points = program.table(&named("POINTS"), "The samples.", points.concat());
            let fields = vec![
                count,
                ("points", Field::Table(points)),
                ("count", Field::Count(*asked)),
                ("planes", Field::Flag(*planes)),
            ];
            (Basis { name: "Neighbours", generic: true, fields }, None)
        }
    };
    Evaluated { functions: functions.clone(), theta, z, parameters, basis, statements }
}

/// What the statements of a map are made of.
struct Maker {
    z: Array,
    parameters: Array,
    regressors: usize,
}

type Made = (Vec<Statement>, Variable);

impl Maker {
    /// A sum that begins with 1 and each regressor.
    fn path(&self, program: &mut Program, linear: bool) -> (Vec<Statement>, Variable, usize) {
        let sum = program.variable("sum");
        let mut statements = vec![Statement::Let(sum, 0.0.into())];
        if !linear {
            return (statements, sum, 0);
        }
        statements.push(Statement::Set(sum, sum + self.parameters.at(0)));
        statements.extend(program.repeat(self.regressors, |_, i| {
            vec![Statement::Set(sum, sum + self.parameters.at(i.clone().plus(1)) * self.z.at(i))]
        }));
        (statements, sum, self.regressors + 1)
    }

    fn polynomial(&self, program: &mut Program, terms: &[Vec<usize>]) -> Made {
        let sum = program.variable("sum");
        let mut statements = vec![Statement::Let(sum, 0.0.into())];
        for (place, term) in terms.iter().enumerate() {
            let product = term.iter().map(|factor| self.z.at(*factor)).reduce(|product, z| product * z);
            let own = self.parameters.at(place);
            let own = match product {
                Some(product) => own * product,
                None => own,
            };
            statements.push(Statement::Set(sum, sum + own));
        }
        (statements, sum)
    }

    fn radial(&self, program: &mut Program, [centres, squares]: [Array; 2], linear: bool) -> Made {
        let (mut statements, sum, first) = self.path(program, linear);
        let (distance, from) = (program.variable("distance"), program.variable("from"));
        let count = program.length(squares);
        statements.extend(program.repeat(count, |program, j| {
            let mut body = vec![Statement::Let(distance, 0.0.into())];
            body.extend(program.repeat(self.regressors, |_, i| {
                let centre = centres.at(j.entry(self.regressors, &i));
                vec![
                    Statement::Let(from, self.z.at(i) - centre),
                    Statement::Set(distance, distance + from * from),
                ]
            }));
            let value =
                program.call(Function::Exponential, vec![-Value::from(distance) * squares.at(j.clone())]);
            body.push(Statement::Set(sum, sum + self.parameters.at(j.plus(first)) * value));
            body
        }));
        (statements, sum)
    }

    fn spline(&self, program: &mut Program, bent: &[usize], knots: Array) -> Made {
        let (mut statements, sum, first) = self.path(program, true);
        let bend = program.variable("bend");
        for (place, regressor) in bent.iter().enumerate() {
            let x = || self.z.at(*regressor);
            let [a, b, c] = [0, 1, 2].map(|knot| knots.at(3 * place + knot));
            let cube = |from: Value, one: Value, other: Value| {
                let share = Value::from(1.0) / (one * other);
                from.clone() * from.clone() * from * share / 3.0
            };
            let line = x() - (a.clone() + b.clone() + c.clone()) / 3.0;
            let rising = cube(x() - a.clone(), b.clone() - a.clone(), c.clone() - a.clone());
            let falling = cube(c.clone() - x(), c.clone() - b.clone(), c.clone() - a.clone());
            statements.push(match place {
                0 => Statement::Let(bend, line.clone()),
                _ => Statement::Set(bend, line.clone()),
            });
            let choose = |condition, then, otherwise| Statement::Choose { condition, then, otherwise };
            let set = |value: Value| vec![Statement::Set(bend, value)];
            let end = choose(Condition::Less(x(), c), set(line + falling), Vec::new());
            let middle = choose(Condition::AtMost(x(), b), set(rising), vec![end]);
            statements.push(choose(Condition::AtMost(x(), a), set(0.0.into()), vec![middle]));
            statements.push(Statement::Set(sum, sum + self.parameters.at(first + place) * bend));
        }
        (statements, sum)
    }

    fn network(&self, program: &mut Program, [weights, biases]: [Array; 2], activation: Activation) -> Made {
        let (mut statements, sum, first) = self.path(program, true);
        let (inner, unit) = (program.variable("inner"), program.variable("unit"));
        let count = program.length(biases);
        statements.extend(program.repeat(count, |program, j| {
            let mut body = vec![Statement::Let(inner, biases.at(j.clone()))];
            body.extend(program.repeat(self.regressors, |_, i| {
                let weight = weights.at(j.entry(self.regressors, &i));
                vec![Statement::Set(inner, inner + weight * self.z.at(i))]
            }));
            let choose = |condition, then, otherwise| Statement::Choose { condition, then, otherwise };
            let set = |value: f64| vec![Statement::Set(unit, value.into())];
            match activation {
                Activation::Tanh => {
                    let value = program.call(Function::HyperbolicTangent, vec![inner.into()]);
                    body.push(Statement::Let(unit, value));
                }
                Activation::Logistic => {
                    let half = program.call(Function::HyperbolicTangent, vec![Value::from(0.5) * inner]);
                    body.push(Statement::Let(unit, Value::from(0.5) + Value::from(0.5) * half));
                }
                Activation::Relu => {
                    body.push(Statement::Let(unit, inner.into()));
                    body.push(choose(Condition::AtMost(inner.into(), 0.0.into()), set(0.0), Vec::new()));
                }
                Activation::Step => {
                    body.push(Statement::Let(unit, inner.into()));
                    let below = choose(Condition::Less(inner.into(), 0.0.into()), set(0.0), Vec::new());
                    body.push(choose(Condition::AtMost(0.0.into(), inner.into()), set(1.0), vec![below]));
                }
            }
            body.push(Statement::Set(sum, sum + self.parameters.at(j.plus(first)) * unit));
            body
        }));
        (statements, sum)
    }

    fn local(
        &self,
        program: &mut Program,
        [sides, domain]: [Array; 2],
        membership: Membership,
        (boxes, planes): (usize, bool),
    ) -> Made {
        let member = Member {
            z: self.z,
            regressors: self.regressors,
            sides,
            domain,
            membership,
            member: program.variable("member"),
            near: program.variable("near"),
            height: program.variable("height"),
            quarter: program.variable("quarter"),
            rise: program.variable("rise"),
            fall: program.variable("fall"),
        };
        let (sum, total, share) =
            (program.variable("sum"), program.variable("total"), program.variable("share"));
        let mut statements = vec![Statement::Let(total, 0.0.into())];
        statements.extend(program.repeat(boxes, |program, own| {
            let mut body = member.statements(program, &own);
            body.push(Statement::Set(total, total + member.member));
            body
        }));
        statements.push(Statement::Let(share, f64::NAN.into()));
        statements.push(Statement::Choose {
            condition: Condition::Less(0.0.into(), total.into()),
            then: vec![Statement::Set(share, Value::from(1.0) / total)],
            otherwise: Vec::new(),
        });
        statements.push(Statement::Let(sum, 0.0.into()));
        let weight = program.variable("weight");
        let each = if planes { self.regressors + 1 } else { 1 };
        statements.extend(program.repeat(boxes, |program, own| {
            let mut body = member.statements(program, &own);
            body.push(Statement::Let(weight, member.member * share));
            let first = own.entry(each, &0.into());
            body.push(Statement::Set(sum, sum + self.parameters.at(first.clone()) * weight));
            if planes {
                body.extend(program.repeat(self.regressors, |_, i| {
                    let place = own.entry(each, &i.clone().plus(1));
                    vec![Statement::Set(sum, sum + self.parameters.at(place) * (weight * self.z.at(i)))]
                }));
            }
            body
        }));
        (statements, sum)
    }
}

/// The membership of z in a box.
struct Member {
    z: Array,
    regressors: usize,
    sides: Array,
    domain: Array,
    membership: Membership,
    member: Variable,
    near: Variable,
    height: Variable,
    quarter: Variable,
    rise: Variable,
    fall: Variable,
}

impl Member {
    fn statements(&self, program: &mut Program, own: &Index) -> Vec<Statement> {
        let (member, near) = (self.member, self.near);
        let gaussian = self.membership == Membership::Gaussian;
        let mut statements = vec![Statement::Let(member, if gaussian { 0.0 } else { 1.0 }.into())];
        statements.extend(program.repeat(self.regressors, |_, i| {
            let ends = |array: Array, place: Index| [0, 1].map(|end| array.at(place.entry(2, &end.into())));
            let side = ends(self.sides, own.entry(self.regressors, &i));
            let domain = ends(self.domain, i.clone());
            // The nearest point of the domain.
            let mut body = vec![
                Statement::Let(near, self.z.at(i)),
                when(
                    Condition::Less(near.into(), domain[0].clone()),
                    vec![Statement::Set(near, domain[0].clone())],
                ),
                when(
                    Condition::Less(domain[1].clone(), near.into()),
                    vec![Statement::Set(near, domain[1].clone())],
                ),
            ];
            body.extend(match self.membership {
                Membership::Rectangle => self.rectangle(side, &domain),
                Membership::Trapezoid => self.trapezoid(&side, domain),
                Membership::Gaussian => {
                    let [low, high] = side;
                    let middle = Value::from(0.5) * (low.clone() + high.clone());
                    let from = (near - middle) / ((high - low) / 3.0);
                    vec![
                        Statement::Let(self.height, from),
                        Statement::Set(member, member + self.height * self.height),
                    ]
                }
            });
            body
        }));
        if gaussian {
            let value = program.call(Function::Exponential, vec![Value::from(-0.5) * member]);
            statements.push(Statement::Set(member, value));
        }
        statements
    }

    fn rectangle(&self, [low, high]: [Value; 2], domain: &[Value; 2]) -> Vec<Statement> {
        let outside = || vec![Statement::Set(self.member, 0.0.into())];
        let is_inner = Condition::Less(high.clone(), domain[1].clone());
        vec![
            Statement::Choose {
                condition: Condition::AtMost(low, self.near.into()),
                then: Vec::new(),
                otherwise: outside(),
            },
            when(Condition::AtMost(high, self.near.into()), vec![when(is_inner, outside())]),
        ]
    }

    fn trapezoid(&self, [low, high]: &[Value; 2], [first, last]: [Value; 2]) -> Vec<Statement> {
        let Self { member, near, height, quarter, rise, fall, .. } = *self;
        let slope = |edge: Variable| {
            let below =
                when(Condition::AtMost(edge.into(), 0.0.into()), vec![Statement::Set(height, 0.0.into())]);
            when(Condition::Less(edge.into(), 1.0.into()), vec![Statement::Set(height, edge.into()), below])
        };
        vec![
            Statement::Let(height, 1.0.into()),
            Statement::Let(quarter, (high.clone() - low.clone()) / 4.0),
            Statement::Let(rise, (near - low.clone() + quarter) / (quarter + quarter)),
            Statement::Let(fall, (high.clone() + quarter - near) / (quarter + quarter)),
            when(Condition::Less(first, low.clone()), vec![slope(rise)]),
            when(Condition::Less(high.clone(), last), vec![slope(fall)]),
            Statement::Set(member, member * height),
        ]
    }
}

fn when(condition: Condition, then: Vec<Statement>) -> Statement {
    Statement::Choose { condition, then, otherwise: Vec::new() }
}
