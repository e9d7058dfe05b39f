//! How well a joint followed a motion, and whether it oscillates.
//!
//! | quantity | computation |
//! |---|---|
//! | error at reversals | largest position error in 0.25 s after each reversal of the demand, mean over the reversals |
//! | tracking error | root mean square of the position error over the block |
//! | current | root mean square |
//! | time stuck | time at which the demand moves and the joint does not |
//!
//! A set that makes a joint *oscillate* is rejected whatever it gains: [`Health`] compares the swing in rests of the demand and
//! the fast part of the current with those of the former set.

use crate::recording::Recording;
use friction_results::tune::TuneQuantity;

/// Time after a reversal in which its error is sought, s.
const REVERSAL_WINDOW_S: f64 = 0.25;
/// Speed of the demand below which it rests, rad/s.
const REST_RAD_S: f64 = 2e-3;
/// Share of the demanded speed below which the joint is stuck.
const STUCK_SHARE: f64 = 0.15;
/// Time over which velocities are taken, s: longer than the noise, shorter than a reversal.
const VELOCITY_WINDOW_S: f64 = 0.02;
/// Rests shorter than this show no swing, s.
const MIN_REST_S: f64 = 0.15;
/// Time after which a joint that rests has settled, s.
const SETTLING_S: f64 = 0.1;

/// Values of a block: how well the joint followed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scores {
    /// Largest position error after a reversal, mean over the reversals, rad.
    pub reversal_error_rad: f64,
    /// Root mean square of the position error, rad.
    pub tracking_rms_rad: f64,
    /// Root mean square of the current, A.
    pub current_rms_a: f64,
    /// Time at rest where motion was demanded, s.
    pub stuck_s: f64,
}

impl Scores {
    /// Returns the value of a quantity, in its unit.
    pub fn of(&self, quantity: TuneQuantity) -> f64 {
        match quantity {
            TuneQuantity::ReversalError => self.reversal_error_rad,
            TuneQuantity::TrackingRms => self.tracking_rms_rad,
            TuneQuantity::CurrentRms => self.current_rms_a,
            TuneQuantity::StuckTime => self.stuck_s,
        }
    }
}

#[cfg(test)]
impl From<[f64; 4]> for Scores {
    fn from([reversal_error_rad, tracking_rms_rad, current_rms_a, stuck_s]: [f64; 4]) -> Self {
        Self { reversal_error_rad, tracking_rms_rad, current_rms_a, stuck_s }
    }
}

/// Oscillation of a block.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Health {
    /// Largest swing of the position in a rest, after it has settled, rad, peak to peak.
    pub swing_rad: f64,
    /// Root mean square of the change of the current in a millisecond, A.
    pub current_step_a: f64,
    /// Largest position error, rad.
    pub worst_error_rad: f64,
}

/// A block, scored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scored {
    /// The scores.
    pub scores: Scores,
    /// Its oscillation.
    pub health: Health,
}

/// Returns how well a recording follows its demand. `nm_per_a` is the joint torque per current.
pub fn score(recording: &Recording, nm_per_a: f64) -> Scored {
    let rows = &recording.rows;
    let period_s = recording.seconds() / (rows.len().max(2) - 1) as f64;
    let window = (VELOCITY_WINDOW_S / period_s).round().max(1.0) as usize;
    let velocity = |of: &dyn Fn(usize) -> f64, at: usize| {
        let (from, to) = (at.saturating_sub(window / 2), (at + window / 2).min(rows.len() - 1));
        (of(to) - of(from)) / ((to - from).max(1) as f64 * period_s)
    };
    let demand = |at: usize| rows[at].demand_rad();
    let position = |at: usize| rows[at].position_rad;
    let demanded: Vec<f64> = (0..rows.len()).map(|at| velocity(&demand, at)).collect();
    let moved: Vec<f64> = (0..rows.len()).map(|at| velocity(&position, at)).collect();
    let error = |at: usize| rows[at].error_rad.abs();

    let length = (REVERSAL_WINDOW_S / period_s) as usize;
    let peaks: Vec<f64> = reversals(&demanded)
        .into_iter()
        .map(|at| (at..(at + length).min(rows.len())).map(error).fold(0.0, f64::max))
        .collect();
    let reversal = peaks.iter().sum::<f64>() / peaks.len().max(1) as f64;
    let rms = |value: &dyn Fn(usize) -> f64| {
        let sum: f64 = (0..rows.len()).map(|at| value(at).powi(2)).sum();
        (sum / rows.len().max(1) as f64).sqrt()
    };
    let stuck = demanded.iter().zip(&moved);
    let stuck =
        stuck.filter(|(want, is)| want.abs() > REST_RAD_S && is.abs() < STUCK_SHARE * want.abs());
    let current = |at: usize| rows[at].torque_nm / nm_per_a;
    let step = |at: usize| if at == 0 { 0.0 } else { current(at) - current(at - 1) };
    Scored {
        scores: Scores {
            reversal_error_rad: reversal,
            tracking_rms_rad: rms(&error),
            current_rms_a: rms(&current),
            stuck_s: stuck.count() as f64 * period_s,
        },
        health: Health {
            swing_rad: swing(&demanded, position, period_s),
            current_step_a: rms(&step),
            worst_error_rad: (0..rows.len()).map(error).fold(0.0, f64::max),
        },
    }
}

/// Returns the rows at which the demand begins to move in the other direction than before.
fn reversals(demanded: &[f64]) -> Vec<usize> {
    let mut last = 0.0f64;
    let mut found = Vec::new();
    for (at, velocity) in demanded.iter().enumerate() {
        if velocity.abs() < REST_RAD_S {
            continue;
        }
        if last * velocity < 0.0 {
            found.push(at);
        }
        last = *velocity;
    }
    found
}

/// Returns the largest swing of a position in a rest of the demand: its range less its net way, which is 0 for a joint that
/// creeps to its place.
fn swing(demanded: &[f64], position: impl Fn(usize) -> f64, period_s: f64) -> f64 {
    let [least, settling] = [MIN_REST_S, SETTLING_S].map(|time| (time / period_s) as usize);
    let rests = demanded.chunk_by(|a, b| (a.abs() < REST_RAD_S) == (b.abs() < REST_RAD_S));
    let mut at = 0;
    let mut most = 0.0f64;
    for rest in rests {
        let (begin, end) = (at + settling, at + rest.len());
        at = end;
        if rest[0].abs() < REST_RAD_S && rest.len() > least + settling {
            let (low, high) = (begin..end)
                .map(&position)
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)));
            most = most.max(high - low - (position(end - 1) - position(begin)).abs());
        }
    }
    most
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::recording::Row;

    /// A triangle of the demand with 0.2 rad/s; the joint lags by `lag` and sticks for 0.1 s after each reversal.
    fn block(lag_rad: f64, sticks: bool) -> Recording {
        let mut position = 0.0f64;
        let rows = (0..4000).map(|at| {
            let time_s = 1e-3 * at as f64;
            let phase = time_s % 2.0;
            let demand = 0.2 * if phase < 1.0 { phase } else { 2.0 - phase };
            let since = phase % 1.0;
            let sign = if phase < 1.0 { 1.0 } else { -1.0 };
            if !(sticks && since < 0.1) {
                position = demand - sign * lag_rad;
            }
            Row {
                time_s,
                position_rad: position,
                error_rad: demand - position,
                torque_nm: sign,
                ..Row::default()
            }
        });
        Recording { name: "triangle".into(), rows: rows.collect() }
    }

    #[test]
    fn score_measures_lag_reversals_and_stuck_time() {
        let free = score(&block(0.001, false), 2.0).scores;
        let stuck = score(&block(0.001, true), 2.0).scores;
        assert!((free.reversal_error_rad - 0.001).abs() < 2e-4, "{free:?}");
        assert!((free.tracking_rms_rad - 0.001).abs() < 1e-4, "{free:?}");
        assert!((free.current_rms_a - 0.5).abs() < 1e-6, "{free:?}");
        // 0.1 s at 0.2 rad/s, and the lag before.
        assert!((stuck.reversal_error_rad - 0.019).abs() < 0.004, "{stuck:?}");
        assert!(free.stuck_s < 0.03 && (stuck.stuck_s - 0.35).abs() < 0.12, "{free:?} {stuck:?}");
    }

    #[test]
    fn swing_is_seen_in_rests_only() {
        let swinging = |swing_rad: f64| {
            let rows = (0..2000).map(|at| {
                let time_s = 1e-3 * at as f64;
                let position_rad = 0.5 * swing_rad * (40.0 * time_s).sin();
                Row { time_s, position_rad, error_rad: -position_rad, ..Row::default() }
            });
            Recording { name: "rest".into(), rows: rows.collect() }
        };
        let seen = score(&swinging(0.01), 1.0).health.swing_rad;
        assert!((seen - 0.01).abs() < 0.005, "{seen}");
        let creep = (0..2000).map(|at| {
            let time_s = 1e-3 * at as f64;
            let position_rad = 0.01 * (1.0 - (-time_s).exp());
            Row { time_s, position_rad, error_rad: -position_rad, ..Row::default() }
        });
        let creeping = Recording { name: "creep".into(), rows: creep.collect() };
        assert!(score(&creeping, 1.0).health.swing_rad < 1e-6);
    }
}
