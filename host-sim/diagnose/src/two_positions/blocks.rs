//! The difference of two positions with its regressors, as sums of products over blocks of rows.
//!
//! A block is a stretch of a run with several reversals. Every column is taken less its mean in the block, so a block has an
//! offset of its own. Blocks are the unit of the comparison.

use super::IncomparableReason;
use joint_log::statistics::{extent, quantile_by_count};
use joint_log::{Dataset, JointKind, Quantity, Run, segments};
use nalgebra::DMatrix;
use std::f64::consts::TAU;
use std::ops::Range;

/// Bins of the angle, between which its error is interpolated. Harmonics of up to a quarter of it are followed.
pub(super) const ANGLE_BINS: usize = 24;

/// Travels in the grid.
pub(super) const TRAVELS: usize = 24;

/// Ratio of neighbouring travels.
const TRAVEL_RATIO: f64 = 1.25;

/// Largest travel, as a share of the range of the difference.
const LARGEST_TRAVEL: f64 = 1.5;

/// Speed at which the motor's friction is that of motion, as a share of the 95th percentile of the speed.
const SLOW: f64 = 0.03;

/// Most rows that products are summed over. Of a longer log, the mean of several rows is one.
const MOST_ROWS: usize = 30_000;

/// Shortest time over which rows are averaged, s. A mean of all columns keeps their relation and has less noise of the torque.
const AVERAGED_S: f64 = 0.008;

/// Most rows that are averaged to one because of the noise. The clock of a faulty log may have steps of 0.
const MOST_AVERAGED: f64 = 1e3;

/// Largest share of the torque's squares that is taken for noise.
const MOST_NOISE: f64 = 0.9;

/// Most blocks.
const MOST_BLOCKS: usize = 64;

/// Fewest rows of a block.
const MIN_BLOCK_ROWS: usize = 8;

/// Reversals in a block.
const REVERSALS: usize = 1;

/// Least and greatest slope of the second position over the first.
const SLOPES: Range<f64> = 0.9..1.1;

/// First columns, which all hypotheses share: position, velocity, acceleration and the bins of the angle.
const POSITION: usize = 0;
const VELOCITY: usize = 1;
const ACCELERATION: usize = 2;
const FIRST_BIN: usize = 3;

/// Number of the first columns.
pub(super) const NUISANCES: usize = FIRST_BIN + ANGLE_BINS;

/// Column of the torque.
pub(super) const TORQUE: usize = NUISANCES;

/// First column of the directions: of all speeds, and of low ones.
pub(super) const DIRECTION: usize = TORQUE + 1;

/// Speeds below which friction may be higher, as shares of the 95th percentile of the speed.
const LOW_SPEEDS: [f64; 2] = [0.03, 0.12];

/// Columns of the directions.
pub(super) const DIRECTIONS: usize = 1 + LOW_SPEEDS.len();

/// Column of the difference.
pub(super) const DIFFERENCE: usize = DIRECTION + DIRECTIONS;

/// First column of the operators.
pub(super) const OPERATORS: usize = DIFFERENCE + 1;

/// A function of the travel since the last reversal: a stop operator, without the share of its range that is dead.
#[derive(Clone, Copy, Debug)]
pub(super) struct Operator {
    /// Travel from one end to the other, rad or m.
    pub travel: f64,
    /// Share of the travel without effect, around its middle.
    pub dead: f64,
}

/// Operators along a stretch, with their states of a row.
struct Course<'a> {
    operators: &'a [Operator],
    states: Vec<f64>,
    before: f64,
}

impl<'a> Course<'a> {
    /// Starts in the middle of each travel.
    fn new(operators: &'a [Operator], position: f64) -> Self {
        Self { operators, states: vec![0.0; operators.len()], before: position }
    }

    /// Moves to the next position.
    fn advance(&mut self, position: f64) {
        let step = position - self.before;
        self.before = position;
        for (state, operator) in self.states.iter_mut().zip(self.operators) {
            *state = (*state + step * 2.0 / operator.travel).clamp(-1.0, 1.0);
        }
    }

    /// Returns the values, from -1 to 1.
    fn values(&self) -> impl Iterator<Item = f64> {
        self.states.iter().zip(self.operators).map(|(state, operator)| live(*state, operator.dead))
    }
}

/// Sums of products of the columns over blocks.
pub(super) struct Blocks {
    /// Products of the columns, each less its mean in the block.
    pub grams: Vec<DMatrix<f64>>,
    /// Number of columns.
    pub columns: usize,
    /// Operators of the columns from [`OPERATORS`] on.
    pub operators: Vec<Operator>,
    /// Number of rows.
    pub rows: f64,
    /// Step of the second position, rad or m.
    pub quantum: f64,
}

/// An unbroken stretch of a run.
struct Stretch<'a> {
    run: &'a Run,
    rows: Range<usize>,
    position: &'a [f64],
    difference: Vec<f64>,
}

/// Positions of a log, and their difference, in unbroken stretches.
pub(super) struct Positions<'a> {
    stretches: Vec<Stretch<'a>>,
    scale: Scale,
    /// Largest travel that the difference may hold, rad or m.
    largest: f64,
    /// Step of the second position, rad or m.
    quantum: f64,
}

impl<'a> Positions<'a> {
    /// Collects the rows of a log.
    ///
    /// # Errors
    /// Why the positions cannot be compared, as the end of a sentence: one is missing, nothing moves, or they are not of one joint.
    pub fn new(data: &'a Dataset, column: &str) -> Result<Self, IncomparableReason> {
        let name = Quantity::Position.name(data.joint);
        let mut stretches = Vec::new();
        for run in &data.runs {
            let both = run.get(Quantity::Position).zip(data.column(run, column));
            let (position, second) = both.ok_or(IncomparableReason::NoPosition(name))?;
            for rows in segments(run) {
                let position = &position[rows.clone()];
                let difference = difference(position, &second[rows.clone()], data.joint);
                stretches.push(Stretch { run, rows, position, difference });
            }
        }
        let slope = slope(&stretches).ok_or(IncomparableReason::NoMotion)?;
        if !SLOPES.contains(&slope) {
            let slope = joint_log::number::figure(slope);
            return Err(IncomparableReason::OtherJoint { slope, position: name });
        }
        let largest = largest_travel(&stretches, slope - 1.0);
        Ok(Self {
            largest: largest.ok_or(IncomparableReason::NoMotion)?,
            scale: Scale::new(&stretches, data.joint).ok_or(IncomparableReason::NoMotion)?,
            quantum: quantum(data, column),
            stretches,
        })
    }

    /// Returns stop operators of all travels that may be in the difference.
    pub fn stops(&self) -> Vec<Operator> {
        let travel = |at: usize| self.largest / TRAVEL_RATIO.powi(at as i32);
        (0..TRAVELS).map(|at| Operator { travel: travel(at), dead: 0.0 }).collect()
    }
}

/// The lag of the second position, from a fit of the difference: without what is no lag, as a share of the lost motion.
pub(super) struct Lag<'a> {
    /// Coefficients of the fit.
    pub coefficients: &'a [f64],
    /// Lost motion, rad or m.
    pub lost_motion: f64,
    /// Dead shares of the columns, which follow those of the operators.
    pub dead: Vec<f64>,
}

impl Lag<'_> {
    /// Fills the columns from `first` on. `stop` holds the values of the operator.
    fn fill(&self, table: &mut DMatrix<f64>, first: usize, stop: usize) {
        let half = 0.5 * self.lost_motion;
        let lag: Vec<f64> = (0..table.nrows())
            .map(|row| {
                let shared = (0..NUISANCES).map(|at| self.coefficients[at] * table[(row, at)]);
                shared.sum::<f64>() - table[(row, DIFFERENCE)]
            })
            .collect();
        let rows = lag.len().max(1) as f64;
        let middle =
            (0..lag.len()).map(|row| lag[row] - half * table[(row, stop)]).sum::<f64>() / rows;
        for (dead, column) in self.dead.iter().zip(first..) {
            for (row, lag) in lag.iter().enumerate() {
                table[(row, column)] = live((lag - middle) / half, *dead);
            }
        }
    }
}

/// Returns a lag from -1 to 1 without a dead share around 0.
fn live(lag: f64, dead: f64) -> f64 {
    ((lag.abs() - dead) / (1.0 - dead).max(1e-3)).clamp(0.0, 1.0).copysign(lag)
}

impl Blocks {
    /// Sums the products of the columns with these operators, and with the lag if one is given.
    pub fn new(positions: &Positions, operators: Vec<Operator>, lag: Option<&Lag>) -> Self {
        let averaged = averaged(&positions.stretches);
        let mut blocks = Self {
            grams: Vec::new(),
            columns: OPERATORS + operators.len() + lag.map_or(0, |lag| lag.dead.len()),
            operators,
            rows: 0.0,
            quantum: positions.quantum,
        };
        for stretch in &positions.stretches {
            blocks.add(stretch, positions, averaged, lag);
        }
        blocks
    }

    /// Adds the blocks of a stretch, in which each row is the mean of `averaged` rows. The first rows are left out, in which the
    /// flank is unknown.
    fn add(
        &mut self,
        stretch: &Stretch,
        positions: &Positions,
        averaged: usize,
        lag: Option<&Lag>,
    ) {
        let q = stretch.position;
        let start = q.iter().scan((f64::INFINITY, f64::NEG_INFINITY), |(low, high), q| {
            (*low, *high) = (low.min(*q), high.max(*q));
            Some(*high - *low)
        });
        let Some(first) = start.into_iter().position(|swept| swept > positions.largest) else {
            return;
        };
        let rows = (q.len() - first) / averaged;
        let turned = reversals(q, positions.largest, first);
        let count = (turned / REVERSALS).min(MOST_BLOCKS).min(rows / MIN_BLOCK_ROWS);
        let mut course = Course::new(&self.operators, q[0]);
        q[..first].iter().for_each(|position| course.advance(*position));
        let acceleration = stretch.run.acceleration_or_derived();
        let acceleration = &acceleration[stretch.rows.clone()];
        for block in 0..count {
            let in_block = rows * block / count..rows * (block + 1) / count;
            let mut table = DMatrix::zeros(in_block.len(), self.columns);
            for (place, row) in in_block.enumerate() {
                for at in first + row * averaged..first + (row + 1) * averaged {
                    let values = positions.scale.values(stretch, at, acceleration[at]);
                    for (column, value) in values {
                        table[(place, column)] += value;
                    }
                    course.advance(q[at]);
                    for (value, column) in course.values().zip(OPERATORS..) {
                        table[(place, column)] += value;
                    }
                }
            }
            table /= averaged as f64;
            if let Some(lag) = lag {
                lag.fill(&mut table, OPERATORS + self.operators.len(), OPERATORS);
            }
            for mut column in table.column_iter_mut() {
                let mean = column.mean();
                column.add_scalar_mut(-mean);
            }
            self.rows += table.nrows() as f64;
            let mut gram = table.tr_mul(&table);
            // Noise in a regressor lowers its coefficient, and play would take what the torque leaves.
            let noise = table.nrows() as f64 * noise_variance(table.column(TORQUE).as_slice());
            gram[(TORQUE, TORQUE)] -= noise.min(MOST_NOISE * gram[(TORQUE, TORQUE)]);
            self.grams.push(gram);
        }
    }

    /// Returns the squared error that coefficients leave in a block.
    pub fn squared_error(&self, block: usize, coefficients: &[f64]) -> f64 {
        quadratic(&self.grams[block], coefficients, |_| true)
    }

    /// Returns the RMS of the torsion that coefficients have.
    pub fn torsion_rms(&self, coefficients: &[f64]) -> f64 {
        let is_torsion = |column: usize| (TORQUE..DIFFERENCE).contains(&column);
        let squares = self.grams.iter().map(|gram| quadratic(gram, coefficients, is_torsion));
        (squares.sum::<f64>() / self.rows.max(1.0)).sqrt()
    }
}

/// Returns the sum of squares of a combination of some columns.
fn quadratic(gram: &DMatrix<f64>, coefficients: &[f64], is_in: impl Fn(usize) -> bool) -> f64 {
    let used: Vec<usize> =
        (0..coefficients.len()).filter(|at| coefficients[*at] != 0.0 && is_in(*at)).collect();
    let product = |a: &usize, b: &usize| coefficients[*a] * coefficients[*b] * gram[(*a, *b)];
    used.iter().map(|a| used.iter().map(|b| product(a, b)).sum::<f64>()).sum::<f64>().max(0.0)
}

/// Units of the columns, and the bins of the angle.
struct Scale {
    joint: JointKind,
    slow: f64,
    speed: f64,
    acceleration: f64,
    torque: f64,
    first: f64,
    span: f64,
    middle: f64,
}

impl Scale {
    fn new(stretches: &[Stretch], joint: JointKind) -> Option<Self> {
        let all = |of: &dyn Fn(&Stretch) -> Vec<f64>| -> Vec<f64> {
            stretches.iter().flat_map(of).collect()
        };
        let velocity = all(&|stretch| stretch.run.velocity[stretch.rows.clone()].to_vec());
        let torque = all(&|stretch| stretch.run.torque[stretch.rows.clone()].to_vec());
        let acceleration =
            all(&|stretch| stretch.run.acceleration_or_derived()[stretch.rows.clone()].to_vec());
        let positions = stretches.iter().flat_map(|stretch| stretch.position.iter().copied());
        let [low, high] = extent(positions);
        let span = match joint {
            JointKind::Revolute => (high - low).min(TAU),
            JointKind::Prismatic => high - low,
        };
        let mut speeds: Vec<f64> = velocity.iter().map(|v| v.abs()).collect();
        let top = lower_quantile(&mut speeds, 0.95)?;
        let is_moving = span > 0.0 && top > 0.0;
        is_moving.then(|| Self {
            joint,
            slow: SLOW * top,
            speed: rms(&velocity),
            acceleration: rms(&acceleration),
            torque: rms(&torque),
            first: low,
            span,
            middle: 0.5 * (low + high),
        })
    }

    /// Returns the values of a row of a stretch with their columns, except those of the stop operators.
    fn values(
        &self,
        stretch: &Stretch,
        row: usize,
        acceleration: f64,
    ) -> impl Iterator<Item = (usize, f64)> {
        let position = stretch.position[row];
        let velocity = stretch.run.velocity[stretch.rows.start + row];
        let torque = stretch.run.torque[stretch.rows.start + row];
        let is_whole_turn = self.joint == JointKind::Revolute && self.span >= TAU;
        let bins = if is_whole_turn { ANGLE_BINS } else { ANGLE_BINS - 1 };
        let folded = (position - self.first).rem_euclid(if is_whole_turn { TAU } else { f64::MAX });
        let along = folded / self.span * bins as f64;
        let (bin, share) = (along.floor() as usize, along.fract());
        let direction = (velocity / self.slow).clamp(-1.0, 1.0);
        let slow = self.slow;
        let low_speeds = LOW_SPEEDS.iter().zip(DIRECTION + 1..).map(move |(share, column)| {
            let low = share * slow / SLOW;
            (column, direction * (-(velocity / low).powi(2)).exp())
        });
        let others = [
            (POSITION, (position - self.middle) / self.span),
            (VELOCITY, velocity / self.speed),
            (ACCELERATION, acceleration / self.acceleration.max(f64::MIN_POSITIVE)),
            (FIRST_BIN + bin % ANGLE_BINS, 1.0 - share),
            (FIRST_BIN + (bin + 1) % ANGLE_BINS, share),
            (TORQUE, torque / self.torque.max(f64::MIN_POSITIVE)),
            (DIRECTION, direction),
            (DIFFERENCE, stretch.difference[row]),
        ];
        others.into_iter().chain(low_speeds)
    }
}

/// Returns the second position less the first. An encoder of one turn wraps: a step of half a turn or more is a wrap.
fn difference(first: &[f64], second: &[f64], joint: JointKind) -> Vec<f64> {
    let mut found: Vec<f64> =
        second.iter().zip(first).map(|(second, first)| second - first).collect();
    if joint == JointKind::Revolute {
        for row in 1..found.len() {
            found[row] -= TAU * ((found[row] - found[row - 1]) / TAU).round();
        }
    }
    found
}

/// Returns the slope of the second position over the first; `None` if the first is constant.
fn slope(stretches: &[Stretch]) -> Option<f64> {
    let (mut squares, mut products) = (0.0, 0.0);
    for stretch in stretches {
        let [q, d] = [stretch.position, &stretch.difference].map(less_mean);
        squares += q.iter().map(|q| q * q).sum::<f64>();
        products += q.iter().zip(&d).map(|(q, d)| q * d).sum::<f64>();
    }
    (squares > 0.0).then(|| 1.0 + products / squares)
}

/// Returns the largest travel that the difference may hold, without its own slope over the position. `None` if it is constant.
fn largest_travel(stretches: &[Stretch], slope: f64) -> Option<f64> {
    let rest = |stretch: &Stretch| -> Vec<f64> {
        let [q, d] = [stretch.position, &stretch.difference].map(less_mean);
        q.iter().zip(&d).map(|(q, d)| d - slope * q).collect()
    };
    let mut all: Vec<f64> = stretches.iter().flat_map(rest).collect();
    let range = lower_quantile(&mut all, 0.995)? - lower_quantile(&mut all, 0.005)?;
    (range > 0.0).then_some(LARGEST_TRAVEL * range)
}

/// Returns the value at a share of the way from the least to the largest: rank `share * (n - 1)`, rounded down. `None` without
/// values.
fn lower_quantile(values: &mut [f64], share: f64) -> Option<f64> {
    let last = values.len().checked_sub(1)?;
    Some(*values.select_nth_unstable_by((share * last as f64) as usize, f64::total_cmp).1)
}

/// Returns the number of rows that are averaged to one.
fn averaged(stretches: &[Stretch]) -> usize {
    let steps =
        stretches.iter().flat_map(|stretch| stretch.run.time_s[stretch.rows.clone()].windows(2));
    let (count, time) =
        steps.fold((0usize, 0.0), |(count, time), pair| (count + 1, time + pair[1] - pair[0]));
    let rate = count as f64 / time.max(f64::MIN_POSITIVE);
    (count / MOST_ROWS + 1).max((rate * AVERAGED_S).round().min(MOST_AVERAGED) as usize)
}

/// Returns the variance of the white noise in a column: of its second differences, whose median jumps do not change.
fn noise_variance(values: &[f64]) -> f64 {
    let second = values.windows(3).map(|w| (w[0] - 2.0 * w[1] + w[2]).abs()).collect();
    // The median of a normal variable's size is 0.6745 standard deviations.
    let spread = quantile_by_count(second, 0.5).unwrap_or_default() / 0.6745;
    spread * spread / 6.0
}

fn less_mean(values: &[f64]) -> Vec<f64> {
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    values.iter().map(|value| value - mean).collect()
}

fn rms(values: &[f64]) -> f64 {
    (values.iter().map(|value| value * value).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

/// Returns how often the motion takes up a travel in the other direction, from a row on.
fn reversals(position: &[f64], travel: f64, first: usize) -> usize {
    let operators = [Operator { travel, dead: 0.0 }];
    let mut course = Course::new(&operators, position[0]);
    let mut last = None;
    let mut turned = 0;
    for (row, position) in position.iter().enumerate() {
        course.advance(*position);
        let state = course.states[0];
        if row >= first && state.abs() >= 1.0 {
            let is_turn = last.is_some_and(|last: bool| last != (state > 0.0));
            turned += usize::from(is_turn);
            last = Some(state > 0.0);
        }
    }
    turned
}

/// Returns the smallest change of a column between rows; 0 if it never changes.
fn quantum(data: &Dataset, column: &str) -> f64 {
    let columns = data.runs.iter().filter_map(|run| data.column(run, column));
    let steps = columns.flat_map(|values| values.windows(2).map(|w| (w[1] - w[0]).abs()));
    let least = steps.filter(|step| *step > 1e-9).fold(f64::INFINITY, f64::min);
    if least.is_finite() { least } else { 0.0 }
}
