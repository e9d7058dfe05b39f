//! Three Hall sensors: the sector of the magnet, and an angle between their edges.
//!
//! The sensors are 120 degrees (electrical) apart, so six of the eight levels are legal, each for a sixth of an electrical
//! turn. Three low or three high levels are a broken wire, a short or a missing supply. A sector is never skipped, because the
//! magnet turns less than 0.6 rad in a period.
//!
//! Between two edges the angle is extrapolated at the speed of the last sector, but not past the end of the present one:
//! whatever the motor does, the angle is wrong by 60 degrees at most. The extrapolated angle reaches that of an edge at a
//! limited rate, so that the placement errors of the sensors do not jump. Without an edge for `REST_PERIODS` it moves to the
//! middle of the sector, where it is wrong by 30 degrees at most.
//!
//! An edge counts from its second period on, so that a disturbance of one period is none. The delay is part of the age of the
//! angle.
//!
//! A sensor that is stuck leads to an illegal level or to a skipped sector within an electrical turn. All of them stuck hold
//! the field still: `crate::driver::unseen_turning` finds a rotor that turns on.

use super::evaluation::Evaluation;

/// A sixth of a turn, in 2^-32 turns.
pub(crate) const SECTOR_UNITS: u32 = ((1u64 << 32) / 6) as u32;

/// Illegal levels in a row from which they are a contradiction. Fewer are a disturbance, during which the observer coasts.
const ILLEGAL_PERIODS: u8 = 3;

/// Periods without an edge after which the angle moves to the middle of the sector: 50 ms.
const REST_PERIODS: u16 = 1000;

/// Least change of the angle in a period, in 2^-32 electrical turns: a turn in 0.1 s.
const LEAST_STEP_UNITS: u32 = 1 << 21;

/// Least change while the angle is outside of the sector: it is inside after 32 periods.
const OUTSIDE_STEP_UNITS: u32 = SECTOR_UNITS / 32;

/// Number of sectors.
const SECTORS: u8 = 6;
/// Sector of each level, four bits each, from level 0 on. A rising angle passes 001, 011, 010, 110, 100, 101.
const SECTOR_OF_LEVELS: u32 = 0x7354_1207;
/// Number of a level without a sector.
const NO_SECTOR: u32 = 7;

/// Returns the sector of these levels, 0 to 5; `None` for three low or three high levels.
#[inline(always)]
pub(crate) const fn sector(levels: u8) -> Option<u8> {
    let sector = SECTOR_OF_LEVELS >> (4 * (levels & 7) as u32) & 7;
    if sector == NO_SECTOR { None } else { Some(sector as u8) }
}

/// Returns the direction from one sector to its neighbour, 1 or -1; 0 if they are no neighbours.
#[inline(always)]
pub(super) const fn direction(from: u8, to: u8) -> i8 {
    match to + SECTORS - from {
        1 | 7 => 1,
        5 | 11 => -1,
        _ => 0,
    }
}

/// Returns the begin of a sector, in 2^-32 electrical turns.
#[inline(always)]
pub(crate) const fn begin(sector: u8) -> u32 {
    sector as u32 * SECTOR_UNITS
}

/// An encoder of Hall sensors alone.
#[derive(Clone, Copy, Debug)]
pub struct HallEncoder {
    pole_pairs: u32,
    /// One over the pole pairs.
    turns_per_electrical: f32,
    /// Last sector; `None` before the first.
    sector: Option<u8>,
    /// Sector of the period before.
    candidate: u8,
    /// Angle, 2^-32 turns of the motor.
    angle: u32,
    /// Direction of the last edge, and change of the electrical angle per period that it showed.
    direction: i8,
    step: u32,
    since_edge: u16,
    illegal: u8,
}

impl HallEncoder {
    /// Creates the encoder. Its electrical angle is 0 at the begin of sector 001, so that commissioning finds the order of the
    /// wires and the electrical zero as those of any encoder.
    pub fn new(pole_pairs: f32) -> Self {
        Self {
            pole_pairs: pole_pairs as u32,
            turns_per_electrical: 1.0 / pole_pairs,
            sector: None,
            candidate: 0,
            angle: 0,
            direction: 0,
            step: 0,
            since_edge: REST_PERIODS,
            illegal: 0,
        }
    }

    /// Evaluates the sector of a period, `None` for illegal levels.
    #[inline(always)]
    pub fn evaluate(&mut self, sector: Option<u8>) -> Evaluation {
        let Some(now) = sector else {
            self.illegal = self.illegal.saturating_add(1);
            let is_contradiction = self.illegal >= ILLEGAL_PERIODS;
            return if is_contradiction { Evaluation::Contradiction } else { Evaluation::Missing };
        };
        self.illegal = 0;
        // A level that lasts for one period is a disturbance.
        let is_confirmed = self.candidate == now;
        self.candidate = now;
        let now = if is_confirmed { now } else { self.sector.unwrap_or(now) };
        self.since_edge = (self.since_edge + 1).min(REST_PERIODS);
        let last = self.sector.replace(now);
        if last.is_some_and(|last| last != now) {
            let direction = direction(last.unwrap_or(now), now);
            if direction == 0 {
                (self.step, self.since_edge) = (0, REST_PERIODS);
                return Evaluation::Contradiction;
            }
            let is_steady = direction == self.direction && self.since_edge < REST_PERIODS;
            let periods = u32::from(self.since_edge.max(1));
            self.step = if is_steady { SECTOR_UNITS / periods } else { 0 };
            (self.direction, self.since_edge) = (direction, 0);
        }
        let share = if self.since_edge == REST_PERIODS {
            SECTOR_UNITS / 2
        } else {
            self.step.saturating_mul(self.since_edge.into()).min(SECTOR_UNITS)
        };
        let share = if self.direction < 0 { SECTOR_UNITS - share } else { share };
        let electrical = self.angle.wrapping_mul(self.pole_pairs);
        let behind = begin(now).wrapping_add(share).wrapping_sub(electrical) as i32;
        let middle = begin(now).wrapping_add(SECTOR_UNITS / 2);
        let off = (electrical.wrapping_sub(middle) as i32).unsigned_abs();
        // The first angle is taken at once, and the motor is not outside of the sector.
        let least = if off > SECTOR_UNITS / 2 { OUTSIDE_STEP_UNITS } else { LEAST_STEP_UNITS };
        let most = if last.is_none() { i32::MAX } else { (2 * self.step + least) as i32 };
        let change = behind.max(-most).min(most) as f32 * self.turns_per_electrical;
        self.angle = self.angle.wrapping_add(change as i32 as u32);
        Evaluation::Angle(self.angle)
    }
}

#[cfg(test)]
#[path = "hall_tests.rs"]
mod tests;
