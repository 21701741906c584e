//! Searches for the least cost of small objectives with known minima.

use std::ops::ControlFlow;
use std::time::Duration;

use super::*;
use crate::Error;

/// Rosenbrock's valley as a sum of two squares, e = (10 (y - x^2), 1 - x), least at (1, 1); x beyond a wall is outside.
struct Valley {
    at: [f64; 2],
    wall: f64,
    /// A constant that is added to the cost, which the stop rule does not see.
    more: f64,
    matrix: [f64; 4],
    right: [f64; 2],
}

const OPEN: f64 = f64::INFINITY;

impl Valley {
    fn new(wall: f64, more: f64) -> Self {
        Self { at: [0.0; 2], wall, more, matrix: [0.0; 4], right: [0.0; 2] }
    }

    fn errors(&self) -> [f64; 2] {
        let [x, y] = self.at;
        [10.0 * (y - x * x), 1.0 - x]
    }
}

#[derive(Debug, PartialEq)]
struct Beyond;

impl Objective for Valley {
    type Refusal = Beyond;

    fn samples(&self) -> usize {
        2
    }

    fn evaluate(&mut self, parameters: &[f64]) -> Result<f64, Beyond> {
        self.at = [parameters[0], parameters[1]];
        let cost = self.errors().iter().map(|e| e * e).sum::<f64>() + self.more;
        if self.at[0] > self.wall { Err(Beyond) } else { Ok(cost) }
    }

    fn linearize(&mut self) -> Result<f64, Beyond> {
        // psi = -de/dtheta.
        let psi = [[20.0 * self.at[0], -10.0], [1.0, 0.0]];
        let e = self.errors();
        let sum = |of: &dyn Fn(usize) -> f64| (0..2).map(of).sum::<f64>();
        self.right = [0, 1].map(|i| sum(&|row| psi[row][i] * e[row]));
        self.matrix = [0, 1, 2, 3].map(|at| sum(&|row| psi[row][at / 2] * psi[row][at % 2]));
        Ok(0.0)
    }

    fn matrix(&self) -> &[f64] {
        &self.matrix
    }

    fn right(&self) -> &[f64] {
        &self.right
    }

    fn scale(&self, cost: f64) -> f64 {
        cost - self.more
    }

    fn is_outside(_: &Beyond) -> bool {
        true
    }
}

fn found(valley: &mut Valley, options: &Search, start: [f64; 2]) -> Found {
    let go_on = |_: Progress| ControlFlow::Continue(());
    search(valley, &start, options, f64::NEG_INFINITY, Deadline::default(), &go_on).unwrap().unwrap()
}

#[test]
fn all_algorithms_find_the_end_of_a_valley() {
    use Algorithm::{GaussNewton, Gradient, LevenbergMarquardt, Newton};
    for (algorithm, close) in
        [(LevenbergMarquardt, 1e-8), (GaussNewton, 1e-8), (Newton, 1e-4), (Gradient, 0.3)]
    {
        let options = Search { algorithm, max_iterations: 2000, ..Search::default() };
        let mut valley = Valley::new(OPEN, 0.0);
        let found = found(&mut valley, &options, [-1.2, 1.0]);
        let [x, y] = [found.parameters[0], found.parameters[1]];
        assert!((x - 1.0).abs() < close && (y - 1.0).abs() < 2.0 * close, "{algorithm:?}: {found:?}");
        assert!(found.costs.windows(2).all(|pair| pair[1] < pair[0]), "{algorithm:?}: {:?}", found.costs);
        // The objective is left there.
        assert_eq!(valley.at.as_slice(), found.parameters, "{algorithm:?}");
    }
}

#[test]
fn the_tolerance_of_a_negative_cost_is_relative_to_its_scale() {
    let options = Search { tolerance: 1e-6, ..Search::default() };
    let one = found(&mut Valley::new(OPEN, 0.0), &options, [-1.2, 1.0]);
    let other = found(&mut Valley::new(OPEN, -1e3), &options, [-1.2, 1.0]);
    assert!(other.cost() < -999.999);
    assert_eq!(one.stopped, other.stopped);
    assert!((one.parameters[0] - other.parameters[0]).abs() < 1e-6, "{other:?}");
}

#[test]
fn what_is_outside_is_refused_and_told() {
    let found = found(&mut Valley::new(0.5, 0.0), &Search::default(), [-1.2, 1.0]);
    assert!(found.parameters[0] <= 0.5 && found.parameters[0] > 0.49, "{found:?}");
    assert!(found.unstable_steps > 0 && found.stability_bound, "{found:?}");
    assert_eq!(found.stopped, Stopped::NoDescent);
    let go_on = |_: Progress| ControlFlow::Continue(());
    let options = Search::default();
    let refused =
        search(&mut Valley::new(-2.0, 0.0), &[0.0, 0.0], &options, 0.0, Deadline::default(), &go_on).unwrap();
    assert_eq!(refused.unwrap_err(), Beyond);
}

/// x^2 with a matrix that is a hundred times too large, so that steps are a hundredth of the way.
struct Cautious<const LENGTHENS: bool> {
    at: f64,
    matrix: [f64; 1],
    right: [f64; 1],
}

impl<const LENGTHENS: bool> Objective for Cautious<LENGTHENS> {
    type Refusal = Beyond;

    const STEP_RULES: StepRules = StepRules { shortenings: 0, lengthens: LENGTHENS };

    fn samples(&self) -> usize {
        1
    }

    fn evaluate(&mut self, parameters: &[f64]) -> Result<f64, Beyond> {
        self.at = parameters[0];
        Ok(self.at * self.at)
    }

    fn linearize(&mut self) -> Result<f64, Beyond> {
        (self.matrix, self.right) = ([100.0], [-self.at]);
        Ok(0.0)
    }

    fn matrix(&self) -> &[f64] {
        &self.matrix
    }

    fn right(&self) -> &[f64] {
        &self.right
    }
}

#[test]
fn steps_that_gain_more_than_predicted_are_doubled_where_that_is_asked_for() {
    fn iterations<const LENGTHENS: bool>() -> usize {
        let mut objective = Cautious::<LENGTHENS> { at: 0.0, matrix: [0.0], right: [0.0] };
        let options = Search { max_iterations: 1000, ..Search::default() };
        let go_on = |_: Progress| ControlFlow::Continue(());
        let found =
            search(&mut objective, &[1.0], &options, 1e-8, Deadline::default(), &go_on).unwrap().unwrap();
        assert_eq!(found.parameters, [objective.at]);
        assert!(found.cost() <= 1e-8 && found.costs.windows(2).all(|pair| pair[1] < pair[0]), "{found:?}");
        found.costs.len() - 1
    }
    assert!(iterations::<true>() < 12);
    assert!(iterations::<false>() > 500);
}

#[test]
fn iterations_and_time_have_limits_and_a_monitor_ends_a_search() {
    let options = Search { max_iterations: 3, ..Search::default() };
    let short = found(&mut Valley::new(OPEN, 0.0), &options, [-1.2, 1.0]);
    assert_eq!((short.stopped, short.costs.len()), (Stopped::MaxIterations, 4));
    let deadline = Deadline::after(Some(Duration::ZERO));
    let mut valley = Valley::new(OPEN, 0.0);
    let go_on = |_: Progress| ControlFlow::Continue(());
    let over = search(&mut valley, &[-1.2, 1.0], &options, 0.0, deadline, &go_on).unwrap().unwrap();
    assert_eq!((over.stopped, over.costs.len(), over.parameters), (Stopped::TimeLimit, 1, vec![-1.2, 1.0]));
    let stop = |progress: Progress| {
        if progress.iteration == 2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let interrupted = search(&mut valley, &[-1.2, 1.0], &options, 0.0, Deadline::default(), &stop);
    assert_eq!(interrupted.unwrap_err(), Error::Interrupted);
}

#[test]
fn the_first_of_the_lowest_costs_wins() {
    let one = found(&mut Valley::new(OPEN, 0.0), &Search::default(), [-1.2, 1.0]);
    let worse = Found { costs: vec![7.0], ..one.clone() };
    assert_eq!(lowest([None, Some(&worse), Some(&one), Some(&one)]), Some(2));
    assert_eq!(lowest([None]), None);
}

/// Two valleys, e = (x^2 - 1, (x + 1)/2): the lowest is at -1, and near 1 there is another.
#[derive(Default)]
struct Hills {
    at: f64,
    matrix: [f64; 1],
    right: [f64; 1],
}

impl Objective for Hills {
    type Refusal = Beyond;

    fn samples(&self) -> usize {
        2
    }

    fn evaluate(&mut self, parameters: &[f64]) -> Result<f64, Beyond> {
        self.at = parameters[0];
        Ok((self.at * self.at - 1.0).powi(2) + (0.5 * (self.at + 1.0)).powi(2))
    }

    fn linearize(&mut self) -> Result<f64, Beyond> {
        let (e, psi) = ([self.at * self.at - 1.0, 0.5 * (self.at + 1.0)], [-2.0 * self.at, -0.5]);
        self.right = [psi[0] * e[0] + psi[1] * e[1]];
        self.matrix = [psi[0] * psi[0] + psi[1] * psi[1]];
        Ok(0.0)
    }

    fn matrix(&self) -> &[f64] {
        &self.matrix
    }

    fn right(&self) -> &[f64] {
        &self.right
    }
}

#[test]
fn annealing_leaves_a_valley_that_others_stay_in() {
    let found = |algorithm, seed| {
        let options = Search { algorithm, seed, tolerance: 1e-12, ..Search::default() };
        let mut hills = Hills::default();
        let monitor: Monitor<'_> = &|_| ControlFlow::Continue(());
        search(&mut hills, &[1.2], &options, 0.0, Deadline::default(), monitor).unwrap().unwrap().parameters
            [0]
    };
    assert!(found(Algorithm::LevenbergMarquardt, 0) > 0.5);
    for seed in 0..10 {
        let x = found(Algorithm::Annealing, seed);
        assert!((x + 1.0).abs() < 1e-4, "{seed}: {x}");
        assert_eq!(x.to_bits(), found(Algorithm::Annealing, seed).to_bits());
    }
    let options = Search { algorithm: Algorithm::Annealing, ..Search::default() };
    let stopped =
        search(
            &mut Hills::default(),
            &[1.2],
            &options,
            0.0,
            Deadline::default(),
            &|_| ControlFlow::Break(()),
        );
    assert!(matches!(stopped, Err(Error::Interrupted)));
}
