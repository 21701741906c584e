//! The errors of a free run as a function of the shapes and dead times.

mod signals;

use std::ops::Range;

use thetahat_numerics::optimize::Objective;
use thetahat_numerics::regression::{Span, sum, sum_of_squares};

use crate::Error;
use crate::estimate::projection::{NormalEquations, Refusal, check_inside, draw_in};
use crate::estimate::response_points::ResponsePoints;
use crate::model::{Parts, ProcessStructure};
use crate::respond::process::{
    HeldLog, free_sensitivities, modes, response_slopes, responses, run, sensitivities,
};

/// Time constants lie between this fraction of the shortest step of the clock, and so many times the longest log.
const SHORTEST: f64 = 1e-3;
const LONGEST: f64 = 1e3;
/// What the damping of a pair may be.
const LEAST_DAMPING: f64 = 1e-4;
const LARGEST_DAMPING: f64 = 1e3;
/// The largest ratio to what it must stay near to.
const NEAR: f64 = 1.5;
/// The longest dead time to start from, as a fraction of the longest log.
pub(super) const LATEST: f64 = 0.25;
/// A dead time is at most this fraction of the longest log.
const LONGEST_DEAD_TIME: f64 = 0.9;

/// What is estimated beside the processes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Background {
    /// The level of the output.
    pub(crate) level: bool,
    /// Its slope.
    pub(crate) slope: bool,
    /// The state in which each log begins; one after a pause has a state of its own anyway.
    pub(crate) free: bool,
}

impl Background {
    /// How many columns of level and slope there are.
    pub(crate) fn offsets(self) -> usize {
        usize::from(self.level) + usize::from(self.slope)
    }

    /// Those of free responses.
    pub(crate) fn free(self, held: &[HeldLog], structures: &[ProcessStructure]) -> usize {
        let states: usize = structures.iter().map(ProcessStructure::states).sum();
        held.iter().filter(|part| self.is_free(part)).count() * states
    }

    /// Whether a log has a state of its own.
    fn is_free(self, part: &HeldLog) -> bool {
        self.free || part.after_pause
    }

    pub(crate) fn columns(self, held: &[HeldLog], structures: &[ProcessStructure]) -> usize {
        self.offsets() + self.free(held, structures)
    }
}

/// The least sum of squared errors that weights, level, slope and free responses leave, by the other parameters:
/// ln(tau), ln(omega), ln(zeta), and the dead time in seconds, of one input after the other.
///
/// It is of logs, or of the points of measured frequency responses, each as its real and its imaginary part.
pub(super) struct ProcessObjective<'a> {
    structures: Vec<ProcessStructure>,
    /// For each input the dead time that it has if none is searched for.
    held_dead_times: Vec<Option<f64>>,
    held: &'a [HeldLog],
    /// For each input; none of logs.
    points: &'a [ResponsePoints],
    background: Background,
    /// The rows that count: in which part, and where in it.
    rows: Vec<(usize, usize)>,
    /// The measured outputs in them, less their mean if there is a level.
    outputs: Vec<f64>,
    mean: f64,
    /// Seconds from the middle of the rows, where a slope is estimated.
    clock: Vec<f64>,
    middle: f64,
    longest: f64,
    shortest: f64,
    /// The shapes that it must stay near to, if to any.
    near: Vec<f64>,
    /// Where it stands.
    point: Vec<f64>,
    parts: Vec<Parts<f64>>,
    offsets: Vec<f64>,
    /// The state in which each log begins, that of one structure after the other.
    first_states: Vec<f64>,
    residuals: Vec<f64>,
    span: Span,
    equations: NormalEquations,
}

impl<'a> ProcessObjective<'a> {
    /// # Errors
    /// [`Error::Data`] if no output is measured, or all rows that count have one time.
    pub(super) fn new(
        structures: Vec<ProcessStructure>,
        held: &'a [HeldLog],
        output: &'a [f64],
        background: Background,
    ) -> Result<Self, Error> {
        let mut rows = Vec::new();
        let mut outputs = Vec::new();
        for (part, own) in held.iter().enumerate() {
            for row in own.counted.iter().cloned().flatten().filter(|row| !output[*row].is_nan()) {
                rows.push((part, row - own.rows.start));
                outputs.push(output[row]);
            }
        }
        if rows.is_empty() {
            return Err(Error::data("the output has no value in the rows to estimate on"));
        }
        let count = rows.len() as f64;
        let mean = if background.level { sum(outputs.iter().copied()) / count } else { 0.0 };
        outputs.iter_mut().for_each(|value| *value -= mean);
        let time = |&(part, row): &(usize, usize)| held[part].begins + held[part].times[row];
        let middle = sum(rows.iter().map(time)) / count;
        let clock =
            if background.slope { rows.iter().map(|row| time(row) - middle).collect() } else { Vec::new() };
        let longest = held.iter().filter_map(|part| part.times.last()).copied().fold(0.0, f64::max);
        let steps = held.iter().flat_map(|part| part.times.windows(2).map(|pair| pair[1] - pair[0]));
        let shortest = steps.fold(f64::INFINITY, f64::min);
        if !(longest > 0.0 && shortest > 0.0 && shortest.is_finite()) {
            return Err(Error::data("one row is no response; give a longer log"));
        }
        let mut objective =
            Self { held, rows, mean, clock, middle, ..Self::empty(outputs, background, [shortest, longest]) };
        objective.take(structures);
        Ok(objective)
    }

    /// The errors of frequency responses, each divided by its standard deviation.
    ///
    /// # Errors
    /// [`Error::Data`] if there is no point.
    pub(super) fn of_points(
        structures: Vec<ProcessStructure>,
        points: &'a [ResponsePoints],
    ) -> Result<Self, Error> {
        let each = || {
            points
                .iter()
                .flat_map(|points| points.frequencies.iter().map(move |own| (*own, points.sample_time)))
        };
        let slowest = each().map(|(own, _)| own).filter(|own| *own > 0.0).fold(f64::INFINITY, f64::min);
        let Some((_, shortest)) = each().next().filter(|_| slowest.is_finite()) else {
            return Err(Error::data("the response has no point at a frequency above 0"));
        };
        let outputs: Vec<f64> = points.iter().flat_map(ResponsePoints::measured).collect();
        let background = Background { level: false, slope: false, free: false };
        let mut objective =
            Self { points, ..Self::empty(outputs, background, [shortest, std::f64::consts::TAU / slowest]) };
        objective.take(structures);
        Ok(objective)
    }

    /// One without an experiment: what was measured, and the shortest and the longest time in it.
    fn empty(outputs: Vec<f64>, background: Background, [shortest, longest]: [f64; 2]) -> Self {
        Self {
            structures: Vec::new(),
            held_dead_times: Vec::new(),
            held: &[],
            points: &[],
            background,
            rows: Vec::new(),
            residuals: outputs.clone(),
            outputs,
            mean: 0.0,
            clock: Vec::new(),
            middle: 0.0,
            longest,
            shortest,
            near: Vec::new(),
            point: Vec::new(),
            parts: Vec::new(),
            offsets: Vec::new(),
            first_states: Vec::new(),
            span: Span::default(),
            equations: NormalEquations::default(),
        }
    }

    /// Whether the errors of points are not known, and taken for relative to these.
    pub(super) fn is_relative(&self) -> bool {
        self.points.iter().any(|points| !points.known)
    }

    /// Whether it is of frequency responses.
    pub(super) fn is_of_points(&self) -> bool {
        !self.points.is_empty()
    }

    pub(super) fn points(&self) -> &'a [ResponsePoints] {
        self.points
    }

    /// Holds the dead times, and keeps the shapes within a factor of [`NEAR`] of a point of them.
    pub(super) fn stay_near(&mut self, point: &[f64], dead_times: &[f64]) {
        self.held_dead_times = dead_times.iter().map(|seconds| Some(*seconds)).collect();
        self.near = point.to_vec();
    }

    /// Whether a shape stands where it may not go further.
    pub(super) fn is_at_a_limit(&self) -> bool {
        self.point.iter().zip(self.limits()).any(|(value, limits)| limits.contains(value))
    }

    /// Takes other structures of the same inputs, with all their dead times.
    pub(super) fn take(&mut self, structures: Vec<ProcessStructure>) {
        let none = |structure: &ProcessStructure| (!structure.has_dead_time()).then_some(0.0);
        self.held_dead_times = structures.iter().map(none).collect();
        self.structures = structures;
    }

    /// Takes the dead time of an input as known; none: searches for it.
    pub(super) fn hold_dead_time(&mut self, input: usize, seconds: Option<f64>) {
        self.held_dead_times[input] = seconds;
    }

    pub(super) fn background(&self) -> Background {
        self.background
    }

    pub(super) fn outputs(&self) -> &[f64] {
        &self.outputs
    }

    pub(super) fn residuals(&self) -> &[f64] {
        &self.residuals
    }

    pub(super) fn parts(&self) -> &[Parts<f64>] {
        &self.parts
    }

    pub(super) fn longest(&self) -> f64 {
        self.longest
    }

    pub(super) fn shortest(&self) -> f64 {
        self.shortest
    }

    /// The level where the slope is zero, and the slope.
    pub(super) fn level(&self) -> (Option<f64>, Option<f64>) {
        let mut own = self.offsets.iter().copied();
        let level = if self.background.level { own.next().map(|level| level + self.mean) } else { None };
        (level, if self.background.slope { own.next() } else { None })
    }

    /// The middle of the rows on their clock, where a slope is estimated.
    pub(super) fn middle(&self) -> f64 {
        self.middle
    }

    /// Where the variables of each input stand: the shape, and the dead time if it is one.
    pub(super) fn places(&self) -> Vec<(Range<usize>, Option<usize>)> {
        let mut first = 0;
        let of = |(structure, known): (&ProcessStructure, &Option<f64>)| {
            let shape = first..first + structure.lags;
            first = shape.end + usize::from(known.is_none());
            (shape.clone(), known.is_none().then_some(shape.end))
        };
        self.structures.iter().zip(&self.held_dead_times).map(of).collect()
    }

    /// Between which dead times no change of an input passes a row that counts: where the output jumps with the input,
    /// those in between leave the same errors.
    pub(super) fn gap(&self, input: usize, dead_time: f64) -> [f64; 2] {
        let mut gap = [0.0, LONGEST_DEAD_TIME * self.longest];
        let mut next = self.rows.iter().peekable();
        for (number, part) in self.held.iter().enumerate() {
            let values = &part.inputs[input];
            let moves =
                (1..values.len()).filter(|row| values[*row] != values[row - 1]).map(|row| part.times[row]);
            let moves: Vec<f64> = moves.collect();
            while let Some((_, row)) = next.next_if(|(own, _)| *own == number) {
                let time = part.times[*row];
                // The changes that this row sees stand before it by the dead time or more; they rise.
                let seen = moves.partition_point(|start| time - start > dead_time);
                if let Some(last) = seen.checked_sub(1).and_then(|last| moves.get(last)) {
                    gap[1] = gap[1].min(time - last);
                }
                if let Some(first) = moves.get(seen) {
                    gap[0] = gap[0].max(time - first);
                }
            }
        }
        gap
    }

    /// Dead times of an input to start from: none, so many from the shortest time to a part of the longest, and of
    /// points that by which the phase falls towards the highest.
    pub(super) fn dead_times(&self, input: usize, count: usize) -> Vec<f64> {
        let latest = (LATEST * self.longest).max(2.0 * self.shortest);
        let late = self.points.get(input).and_then(ResponsePoints::group_delay);
        let late = late.filter(|seconds| *seconds < LONGEST_DEAD_TIME * self.longest);
        std::iter::once(0.0).chain(spread(self.shortest, latest, count)).chain(late).collect()
    }

    /// The shortest time constant that is looked for.
    pub(super) fn least_time_constant(&self) -> f64 {
        SHORTEST * self.shortest
    }

    /// Between which values each variable may lie.
    pub(super) fn limits(&self) -> Vec<[f64; 2]> {
        let (short, long) = (self.least_time_constant().ln(), (LONGEST * self.longest).ln());
        let mut limits = Vec::new();
        for (structure, known) in self.structures.iter().zip(&self.held_dead_times) {
            let from = limits.len();
            limits.resize(from + structure.lags, [short, long]);
            if structure.is_transfer_function() {
                // a_(n-p) is a sum of products of p poles.
                let size = structure.lags as f64;
                for (power, own) in (1_u8..).zip(&mut limits[from..]) {
                    let power = f64::from(power);
                    *own = [-power * long, size - power * short];
                }
            }
            if structure.is_underdamped() {
                limits[from] = [-long, -short];
                limits[from + 1] = [LEAST_DAMPING.ln(), LARGEST_DAMPING.ln()];
            }
            limits.extend(known.is_none().then_some([0.0, LONGEST_DEAD_TIME * self.longest]));
        }
        for (limits, near) in limits.iter_mut().zip(&self.near) {
            *limits = limits.map(|limit| limit.clamp(near - NEAR.ln(), near + NEAR.ln()));
        }
        limits
    }

    /// A column over the rows that count, written by a function for each part.
    fn stacked(
        &self,
        count: usize,
        mut write: impl FnMut(&HeldLog, usize, &mut [Vec<f64>]),
    ) -> Vec<Vec<f64>> {
        let mut stacked = vec![Vec::with_capacity(self.rows.len()); count];
        let mut whole: Vec<Vec<f64>> = vec![Vec::new(); count];
        let mut next = self.rows.iter().peekable();
        for (number, part) in self.held.iter().enumerate() {
            whole.iter_mut().for_each(|column| {
                column.clear();
                column.resize(part.times.len(), 0.0);
            });
            write(part, number, &mut whole);
            while let Some((_, row)) = next.next_if(|(own, _)| *own == number) {
                stacked.iter_mut().zip(&whole).for_each(|(stacked, whole)| stacked.push(whole[*row]));
            }
        }
        stacked
    }

    /// The columns of an input.
    pub(super) fn columns_of(
        &self,
        input: usize,
        structure: &ProcessStructure,
        parts: &Parts<f64>,
    ) -> Vec<Vec<f64>> {
        if self.is_of_points() {
            return self.of_input(input, structure.columns(), |own, columns| {
                responses(structure, &parts.shape, parts.dead_time, own.at(), |row, re, im| {
                    for (column, (re, im)) in columns.iter_mut().zip(re.iter().zip(im)) {
                        (column[2 * row], column[2 * row + 1]) = (*re, *im);
                    }
                });
            });
        }
        self.stacked(structure.columns(), |part, _, whole| {
            let signals = (part.times.as_slice(), part.inputs[input].as_slice());
            run(structure, &parts.shape, parts.dead_time, signals, |row, seen| {
                whole.iter_mut().zip(seen).for_each(|(column, value)| column[row] = *value);
            });
        })
    }

    /// Columns that `write` makes of the columns of an input and of the slopes of their sum by its shape and dead time,
    /// in a row.
    fn slopes_of(
        &self,
        input: usize,
        structure: &ProcessStructure,
        parts: &Parts<f64>,
        count: usize,
        mut write: impl FnMut(&[f64], &[f64], f64, &mut [f64]),
    ) -> Vec<Vec<f64>> {
        let mut own = vec![0.0; count];
        if self.is_of_points() {
            return self.of_input(input, count, |points, columns| {
                response_slopes(structure, parts, points.at(), |row, seen, slopes| {
                    for (side, (seen, slopes)) in seen.into_iter().zip(slopes).enumerate() {
                        let [shape @ .., dead_time] = slopes;
                        write(seen, shape, *dead_time, &mut own);
                        columns
                            .iter_mut()
                            .zip(&own)
                            .for_each(|(column, value)| column[2 * row + side] = *value);
                    }
                });
            });
        }
        let (before, states) = self.places_of_states(input);
        self.stacked(count, |part, number, whole| {
            let lags = parts.shape.len();
            // What the first state does depends on the shape too.
            let mut free = vec![0.0; part.times.len() * lags];
            let first = self.first_states.get(self.free_before(number) * states + before..);
            if let (true, Some(first)) = (self.background.is_free(part), first) {
                let first = &first[..structure.states().min(first.len())];
                free_sensitivities(structure, &parts.shape, first, &part.times, |row, slopes| {
                    free[row * lags..(row + 1) * lags].copy_from_slice(&slopes[..lags]);
                });
            }
            let mut both = vec![0.0; lags];
            let signals = (part.times.as_slice(), part.inputs[input].as_slice());
            sensitivities(structure, parts, signals, |row, seen, shape, dead_time| {
                let free = &free[row * lags..(row + 1) * lags];
                both.iter_mut().zip(shape).zip(free).for_each(|((both, own), free)| *both = own + free);
                write(seen, &both, dead_time, &mut own);
                whole.iter_mut().zip(&own).for_each(|(column, value)| column[row] = *value);
            });
        })
    }

    /// How many of the logs before one have a state of their own.
    fn free_before(&self, number: usize) -> usize {
        self.held[..number].iter().filter(|part| self.background.is_free(part)).count()
    }

    /// The states of structures before that of an input, and of all.
    fn places_of_states(&self, input: usize) -> (usize, usize) {
        let states = |structures: &[ProcessStructure]| structures.iter().map(ProcessStructure::states).sum();
        (states(&self.structures[..input]), states(&self.structures))
    }

    /// Columns of the points of an input, which `write` fills, times their weights; zero at those of the other inputs.
    fn of_input(
        &self,
        input: usize,
        count: usize,
        write: impl FnOnce(&ResponsePoints, &mut [Vec<f64>]),
    ) -> Vec<Vec<f64>> {
        let lengths: Vec<usize> = self.points.iter().map(|points| 2 * points.frequencies.len()).collect();
        let before: usize = lengths[..input].iter().sum();
        let points = &self.points[input];
        let mut own = vec![vec![0.0; lengths[input]]; count];
        write(points, &mut own);
        let whole = own.into_iter().map(|own| {
            let mut column = vec![0.0; self.outputs.len()];
            let weighted = own.iter().enumerate().map(|(row, value)| value * points.weights[row / 2]);
            column[before..].iter_mut().zip(weighted).for_each(|(value, own)| *value = own);
            column
        });
        whole.collect()
    }

    /// Those of level and slope, as far as they are estimated.
    pub(super) fn offset_columns(&self) -> Vec<Vec<f64>> {
        let level = self.background.level.then(|| vec![1.0; self.outputs.len()]);
        level.into_iter().chain(self.background.slope.then(|| self.clock.clone())).collect()
    }

    /// Level, slope, the columns of each input, then free responses.
    fn linear_columns(&self, parts: &[Parts<f64>]) -> Vec<Vec<f64>> {
        let mut columns = self.offset_columns();
        for (input, (structure, parts)) in self.structures.iter().zip(parts).enumerate() {
            columns.extend(self.columns_of(input, structure, parts));
        }
        columns.extend(self.free_columns(parts, true));
        columns
    }

    /// What a first state does in each log that has one of its own, or in each that has not.
    fn free_columns(&self, parts: &[Parts<f64>], free: bool) -> Vec<Vec<f64>> {
        let mut columns = Vec::new();
        for own in (0..self.held.len()).filter(|own| self.background.is_free(&self.held[*own]) == free) {
            for (structure, parts) in self.structures.iter().zip(parts) {
                columns.extend(self.stacked(structure.states(), |part, number, whole| {
                    if number == own {
                        for (column, mode) in
                            whole.iter_mut().zip(modes(structure, &parts.shape, &part.times))
                        {
                            *column = mode;
                        }
                    }
                }));
            }
        }
        columns
    }

    /// psi in the units of the parameters, then of level, slope and free responses.
    pub(super) fn slopes(&self, structures: &[ProcessStructure], parts: &[Parts<f64>]) -> Vec<Vec<f64>> {
        let mut columns = Vec::new();
        for (input, (structure, parts)) in structures.iter().zip(parts).enumerate() {
            let count = structure.parameters();
            columns.extend(self.slopes_of(input, structure, parts, count, |seen, shape, dead_time, own| {
                structure.own_slopes(parts, seen, shape, dead_time, own);
            }));
        }
        columns.extend(self.offset_columns());
        columns.extend(self.free_columns(parts, true));
        columns
    }

    /// The fraction of the squared errors that a first state of each log would explain, where it stands; 0 where it has
    /// one.
    pub(super) fn explained_by_starts(&self) -> f64 {
        if self.background.free || self.is_of_points() {
            return 0.0;
        }
        let mut span = self.span.clone();
        for column in self.free_columns(&self.parts, false) {
            span.add(column);
        }
        let mut left = self.residuals.clone();
        span.take_from(&mut left);
        1.0 - sum_of_squares(&left) / sum_of_squares(&self.residuals)
    }

    /// The residuals and the columns `used` on all rows of each segment that counts; where no output was measured the
    /// residual is NaN and the columns are zero. Gives the residuals, the columns of each segment, and the range of
    /// each segment among the residuals.
    #[expect(clippy::type_complexity, reason = "three lists of one thing each")]
    pub(super) fn by_segments(
        &self,
        psi: &[Vec<f64>],
        used: &[usize],
    ) -> (Vec<f64>, Vec<Vec<Vec<f64>>>, Vec<Range<usize>>) {
        let (mut residuals, mut columns, mut segments) = (Vec::new(), Vec::new(), Vec::new());
        let mut next = self.rows.iter().zip(0..).peekable();
        for (number, part) in self.held.iter().enumerate() {
            for rows in &part.counted {
                let first = residuals.len();
                residuals.resize(first + rows.len(), f64::NAN);
                let mut own = vec![vec![0.0; rows.len()]; used.len()];
                let end = rows.end - part.rows.start;
                while let Some(((_, row), sample)) =
                    next.next_if(|((part, row), _)| *part == number && *row < end)
                {
                    let place = row + part.rows.start - rows.start;
                    residuals[first + place] = self.residuals[sample];
                    own.iter_mut().zip(used).for_each(|(column, used)| column[place] = psi[*used][sample]);
                }
                segments.push(first..residuals.len());
                columns.push(own);
            }
        }
        (residuals, columns, segments)
    }
}

/// So many numbers from one to the other, evenly on a logarithmic scale.
pub(super) fn spread(first: f64, last: f64, count: usize) -> impl Iterator<Item = f64> {
    let step = (last / first).ln() / (count - 1).max(1) as f64;
    (0..count).map(move |index| first * (step * index as f64).exp())
}

impl Objective for ProcessObjective<'_> {
    type Refusal = Refusal;

    fn samples(&self) -> usize {
        self.outputs.len()
    }

    fn evaluate(&mut self, point: &[f64]) -> Result<f64, Refusal> {
        check_inside(point, &self.limits())?;
        let mut parts: Vec<Parts<f64>> = self
            .places()
            .into_iter()
            .zip(&self.held_dead_times)
            .map(|((shape, dead_time), known)| Parts {
                weights: Vec::new(),
                shape: point[shape].iter().map(|value| value.exp()).collect(),
                dead_time: dead_time.map_or(known.unwrap_or(0.0), |place| point[place]),
            })
            .collect();
        let mut span = Span::default();
        for column in self.linear_columns(&parts) {
            span.add(column);
        }
        self.residuals.clone_from(&self.outputs);
        let has = span.take_from(&mut self.residuals);
        let cost = sum_of_squares(&self.residuals);
        if !cost.is_finite() {
            return Err(Refusal::Overflow);
        }
        let mut weights = span.weights(&has).into_iter();
        self.offsets = weights.by_ref().take(self.background.offsets()).collect();
        for (structure, parts) in self.structures.iter().zip(&mut parts) {
            parts.weights = weights.by_ref().take(structure.columns()).collect();
        }
        self.first_states = weights.collect();
        self.parts = parts;
        self.span = span;
        self.point = point.to_vec();
        Ok(cost)
    }

    fn linearize(&mut self) -> Result<f64, Refusal> {
        let mut columns = Vec::with_capacity(self.point.len());
        for (input, ((structure, parts), known)) in
            self.structures.iter().zip(&self.parts).zip(&self.held_dead_times).enumerate()
        {
            let lags = structure.lags;
            let count = lags + usize::from(known.is_none());
            columns.extend(self.slopes_of(input, structure, parts, count, |_, shape, dead_time, own| {
                for (index, value) in own.iter_mut().enumerate() {
                    // By the logarithm of the shape.
                    *value = if index < lags { shape[index] * parts.shape[index] } else { dead_time };
                }
            }));
        }
        columns.iter_mut().for_each(|column| {
            self.span.take_from(column);
        });
        self.equations = NormalEquations::new(columns, &self.residuals, &self.point, &self.limits());
        Ok(0.0)
    }

    fn matrix(&self) -> &[f64] {
        &self.equations.matrix
    }

    fn right(&self) -> &[f64] {
        &self.equations.right
    }

    fn is_outside(refusal: &Refusal) -> bool {
        *refusal == Refusal::Outside
    }

    fn draw_in(&mut self, from: &[f64], trial: &mut [f64]) -> bool {
        draw_in(trial, &self.limits());
        from != trial
    }
}
