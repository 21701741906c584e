//! Models of polynomials:
//!
//! ```text
//! x(t) = sum_j B_j(q)/F_j(q) u_j(t)
//! w(t) = A(q) y(t) - x(t)
//! e(t) = (D(q)/C(q)) w(t),   y^(t) = y(t) - e(t)
//! ```
//!
//! (Ljung, System Identification, 2nd ed. 1999, section 3.2), in the order of operations of
//! [`respond`](crate::respond). The prediction is what e lacks of y(t), so that it is known before y(t) is.

use super::program::{Array, Condition, Entry, Index, Program, Statement, Value, Variable};
use super::signals::{FREE_RUN, PREDICTION, Signals, UPDATE};
use super::{Form, Purpose, refused};
use crate::Error;
use crate::model::{Model, PolynomialModel};

/// The program of a model.
///
/// # Errors
/// [`Error::Report`] for an offset that moves; [`Error::Argument`] for what such a model has not.
pub(super) fn form(whole: &Model, model: &PolynomialModel, purpose: Purpose) -> Result<Form, Error> {
    let mut program = Program::default();
    let signals = Signals::of(&mut program, whole)?;
    let mut equations = vec![format!("{}, {}", model.orders, model.orders.equation())];
    equations.extend(delays(model));
    let driven = Driven::new(&mut program, model);
    let entries = match purpose {
        Purpose::Simulator if !whole.is_driven() => {
            return Err(Error::argument(
                "what",
                "a simulator runs on inputs, and no input drives this model; take predictor",
            ));
        }
        Purpose::Simulator => vec![simulator(&mut program, &signals, model, &driven)],
        Purpose::Predictor => predictor(&mut program, &signals, model, &driven),
        _ => return Err(refused(purpose, "a model of polynomials", "predictor, simulator or recursive")),
    };
    program.entries = entries;
    Ok(Form { program, equations, start: "at rest at the offsets".to_owned() })
}

/// The delay of each input.
fn delays(model: &PolynomialModel) -> Vec<String> {
    let each = model.inputs.iter().zip(&model.orders.nk).zip(&model.orders.nb).filter(|(_, nb)| **nb > 0);
    each.map(|((input, nk), _)| {
        format!(
            "'{}' acts {nk} sample{} later",
            crate::text::harmless(&input.name),
            if *nk == 1 { "" } else { "s" }
        )
    })
    .collect()
}

/// The weights of past values, the oldest first, and these.
#[derive(Debug, Clone, Copy)]
struct Filter {
    weights: Array,
    line: Array,
}

impl Filter {
    /// That of a monic polynomial; none without a weight.
    fn monic(program: &mut Program, [table, line]: [&str; 2], doc: &str, monic: &[f64]) -> Option<Self> {
        let past = monic.get(1..).filter(|past| !past.is_empty())?;
        let weights: Vec<f64> = past.iter().rev().copied().collect();
        let zeros = vec![0.0; weights.len()];
        let weights =
            program.table(table, &format!("{doc}, the highest power first, without the leading 1."), weights);
        Some(Self { weights, line: program.memory(line, "The values before, the oldest first.", zeros) })
    }

    fn product(&self, index: &Index) -> Value {
        self.weights.at(index.clone()) * self.line.at(index.clone())
    }

    /// `sum += sum_i weight_i value_i`, the oldest first.
    fn add(&self, program: &mut Program, sum: Variable) -> Vec<Statement> {
        let count = program.length(self.weights);
        program.repeat(count, |_, i| vec![Statement::Set(sum, sum + self.product(&i))])
    }

    /// `sum -= sum_i weight_i value_i`, as the library divides by a polynomial.
    fn subtract(&self, program: &mut Program, sum: Variable) -> Vec<Statement> {
        let count = program.length(self.weights);
        program.repeat(count, |_, i| vec![Statement::Set(sum, sum - self.product(&i))])
    }
}

/// What the inputs do.
struct Driven {
    /// For each input that acts its place, B with the inputs, and F.
    each: Vec<(usize, Filter, Option<Filter>)>,
}

impl Driven {
    fn new(program: &mut Program, model: &PolynomialModel) -> Self {
        let orders = &model.orders;
        let acting = (0..orders.inputs()).filter(|input| orders.nb[*input] > 0);
        let each = acting.map(|input| {
            let number = input + 1;
            let weights: Vec<f64> = model.b[input].iter().skip(orders.nk[input]).rev().copied().collect();
            let zeros = vec![0.0; orders.nk[input] + weights.len()];
            let doc = format!("B of input {number}, the highest power first, without its leading zeros.");
            let weights = program.table(&format!("B{number}"), &doc, weights);
            let line = program.memory(&format!("u{number}"), "The input, the oldest value first.", zeros);
            let names = [format!("F{number}"), format!("x{number}")];
            let f = Filter::monic(
                program,
                [&names[0], &names[1]],
                &format!("F of input {number}"),
                &model.f[input],
            );
            (input, Filter { weights, line }, f)
        });
        Self { each: each.collect() }
    }

    /// Takes the inputs, and gives x in `sum`.
    fn statements(&self, program: &mut Program, signals: &Signals, sum: Variable) -> Vec<Statement> {
        let mut statements = vec![Statement::Let(sum, 0.0.into())];
        for (input, b, f) in &self.each {
            statements.extend(signals.take_input(program, *input, b.line));
            let Some(f) = f else {
                statements.extend(b.add(program, sum));
                continue;
            };
            let own = program.variable(&format!("x{}", input + 1));
            statements.push(Statement::Let(own, 0.0.into()));
            statements.extend(b.add(program, own));
            statements.extend(f.subtract(program, own));
            statements.extend(program.push(f.line, own));
            statements.push(Statement::Set(sum, sum + own));
        }
        statements
    }
}

/// A(q) y^(t) = x(t).
fn simulator(program: &mut Program, signals: &Signals, model: &PolynomialModel, driven: &Driven) -> Entry {
    let a = Filter::monic(program, ["A", "past_y"], "A", &model.a);
    let y = program.variable("x");
    let mut body = driven.statements(program, signals, y);
    if let Some(a) = a {
        body.extend(a.subtract(program, y));
        body.extend(program.push(a.line, y));
    }
    body.push(signals.say(&0.into(), y));
    signals.responds("step", FREE_RUN, body)
}

fn predictor(
    program: &mut Program,
    signals: &Signals,
    model: &PolynomialModel,
    driven: &Driven,
) -> Vec<Entry> {
    let a = Filter::monic(program, ["A", "past_y"], "A", &model.a);
    let c = Filter::monic(program, ["C", "past_e"], "C", &model.c);
    let d = Filter::monic(program, ["D", "past_w"], "D", &model.d);
    let learns = a.is_some() || c.is_some() || d.is_some();
    let x = program.variable("x");
    let mut body = driven.statements(program, signals, x);
    if !learns {
        body.push(signals.say(&0.into(), x));
        let doc =
            "The next sample: takes u(k), and gives the prediction of y(k). Past outputs say nothing of it.";
        return vec![signals.responds("predict", doc, body)];
    }
    let known = program.memory("known", "w(k) without y(k), and the prediction of y(k).", vec![0.0; 2]);
    body.push(Statement::Set(x, -Value::from(x)));
    if let Some(a) = &a {
        body.extend(a.add(program, x));
    }
    body.push(Statement::Store(known, 0.into(), x.into()));
    let mut sums: Vec<Statement> = Vec::new();
    let rest = program.variable("rest");
    if let Some(d) = &d {
        body.push(Statement::Let(rest, 0.0.into()));
        body.extend(d.add(program, rest));
        body.push(Statement::Set(rest, rest + x));
        sums.push(Statement::Let(rest, 0.0.into()));
        sums.extend(d.add(program, rest));
    } else {
        body.push(Statement::Let(rest, x.into()));
    }
    if let Some(c) = &c {
        body.extend(c.subtract(program, rest));
    }
    body.push(Statement::Store(known, 1.into(), -Value::from(rest)));
    body.push(signals.say(&0.into(), known.at(1)));
    let predict = signals.responds("predict", PREDICTION, body);

    let (y, w, e) = (program.variable("output"), program.variable("w"), program.variable("e"));
    let needs_e = c.is_some();
    let mut body = vec![
        Statement::Let(y, signals.output(&0.into())),
        Statement::Choose {
            condition: Condition::Missing(y.into()),
            then: vec![Statement::Miss, Statement::Set(y, known.at(1))],
            otherwise: Vec::new(),
        },
    ];
    if needs_e || d.is_some() {
        body.push(Statement::Let(w, known.at(0) + y));
    }
    if let Some(c) = &c {
        match d {
            Some(_) => {
                body.extend(sums);
                body.push(Statement::Let(e, rest + w));
            }
            None => body.push(Statement::Let(e, w.into())),
        }
        body.extend(c.subtract(program, e));
        body.push(Statement::Choose {
            condition: Condition::Missing(signals.measured.at(0)),
            then: vec![Statement::Set(e, 0.0.into())],
            otherwise: Vec::new(),
        });
        body.extend(program.push(c.line, e));
    }
    if let Some(d) = &d {
        body.extend(program.push(d.line, w));
    }
    if let Some(a) = &a {
        body.extend(program.push(a.line, y));
    }
    vec![predict, signals.updates(UPDATE, body)]
}
