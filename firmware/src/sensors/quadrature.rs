//! A quadrature encoder: two lines A and B that a counter follows, and an index Z once a turn.
//!
//! The counter knows only changes. Where the shaft is follows from the index, or with less accuracy from Hall sensors:
//!
//! ```text
//! ABZ         no angle until the first index: the joint is not armed. Turn the motor by one turn, by hand.
//! ABZ + Hall  start in the middle of the sector (30 degrees electrical at most), exact to the placement of the sensors at the
//!             first edge of a sensor, exact at the first index
//! ```
//! A better knowledge of the angle is reached at [`SLEW_UNITS`] in each period, so that neither angle nor velocity jumps.
//! With Hall sensors and without an index, the electrical angle keeps the accuracy of the sensors.
//!
//! Each index checks the counts. A difference of more than [`INDEX_TOLERANCE_COUNTS`] is a loss: it is corrected and reported.
//! A loss of a twelfth of an electrical turn (30 degrees) or more, or levels of the Hall sensors that contradict the angle,
//! leave no valid angle for 25 ms, longer than any `encoder_coast_s`: the bridge opens. Edges of A and B at the same time are reported by the
//! counter, and an index that does not come within 1.25 turns is reported as well.

use super::evaluation::Evaluation;
use super::hall::{SECTOR_UNITS, begin};
use crate::start_values::StartValues;
use core::f32::consts::TAU;

/// Largest change of the angle by a correction in a period, 2^-32 turns: 0.3 turns of the motor in a second.
pub const SLEW_UNITS: i32 = 1 << 16;

/// Difference of the counts at an index that its width and the edges of the lines explain.
pub const INDEX_TOLERANCE_COUNTS: i32 = 5;

/// Contradiction between counts and Hall sensors beyond the end of their sector, 2^-32 electrical turns: 25 degrees, of which
/// placement and hysteresis of the sensors use 10.
const HALL_MARGIN_UNITS: u32 = ((1u64 << 32) * 25 / 360) as u32;

/// What a board has read of a quadrature encoder in a period.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Quadrature {
    /// Count of the edges of both lines, which wraps.
    pub count: u16,
    /// Count at the last edge of the index since the period before.
    pub index: Option<u16>,
    /// Both lines changed at the same time, which the counter cannot follow.
    pub has_double_edge: bool,
}

/// How much of the angle is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Known {
    /// Nothing.
    Nothing,
    /// The electrical angle, by Hall sensors.
    Electrical,
    /// The angle from the index.
    Index,
}

/// What an index says about the counts.
enum IndexCheck {
    /// None were lost, as far as is known.
    Agrees,
    /// So few were lost that they are corrected.
    Corrected,
    /// Too many were lost.
    Contradicts,
}

/// A quadrature encoder.
#[derive(Clone, Copy, Debug)]
pub struct QuadratureEncoder {
    counts_per_turn: i32,
    units_per_count: f32,
    pole_pairs: u32,
    /// One over the pole pairs.
    turns_per_electrical: f32,
    /// Largest loss of counts that is corrected.
    correctable_counts: i32,
    has_hall: bool,
    /// The sectors of the Hall sensors fall while the counts rise.
    is_hall_reversed: bool,
    /// Electrical angle at which the first sector begins, 2^-32 turns.
    hall_begin: u32,
    /// Sector of the period before.
    last_sector: u8,
    known: Known,
    last_count: u16,
    /// Counts since the index, from 0 to `counts_per_turn - 1`.
    position: i32,
    /// Net counts since the last index.
    since_index: i32,
    /// Angle at position 0, and the angle that it approaches, 2^-32 turns.
    offset: u32,
    goal: u32,
}

impl QuadratureEncoder {
    /// Creates the encoder of these values, with Hall sensors or without.
    pub fn new(start: &StartValues, has_hall: bool) -> Self {
        let counts_per_turn = 4 * start.abz_lines as i32;
        Self {
            counts_per_turn,
            units_per_count: ((1u64 << 32) as f32) / counts_per_turn as f32,
            pole_pairs: start.pole_pairs as u32,
            turns_per_electrical: 1.0 / start.pole_pairs,
            correctable_counts: (counts_per_turn as f32 / (12.0 * start.pole_pairs)) as i32,
            has_hall,
            is_hall_reversed: start.hall_order < 0.0,
            hall_begin: (start.hall_offset_rad * (((1u64 << 32) as f32) / TAU)) as i32 as u32,
            last_sector: 0,
            known: Known::Nothing,
            last_count: 0,
            position: 0,
            since_index: 0,
            offset: 0,
            goal: 0,
        }
    }

    /// Evaluates a period. `sector` returns that of the Hall sensors; `None` for illegal levels.
    #[inline(always)]
    pub fn evaluate(
        &mut self,
        read: Quadrature,
        sector: impl FnOnce() -> Option<u8>,
    ) -> Evaluation {
        let moved = i32::from(read.count.wrapping_sub(self.last_count) as i16);
        self.last_count = read.count;
        // No motor turns so far in a period, nor does an index come from so far.
        if moved.abs() >= self.counts_per_turn {
            self.known = Known::Nothing;
            return Evaluation::Contradiction;
        }
        self.position = self.wrapped(self.position + moved);
        self.since_index = self.since_index.saturating_add(moved);
        let mut is_doubtful = read.has_double_edge;
        if let Some(at) = read.index {
            match self.check_index(read.count.wrapping_sub(at) as i16) {
                IndexCheck::Agrees => {}
                IndexCheck::Corrected => is_doubtful = true,
                IndexCheck::Contradicts => {
                    self.known = Known::Nothing;
                    return Evaluation::Contradiction;
                }
            }
        }
        if self.has_hall {
            let Some(sector) = sector() else { return Evaluation::Missing };
            // A level that lasts for one period is a disturbance.
            let is_confirmed = core::mem::replace(&mut self.last_sector, sector) == sector;
            if is_confirmed && !self.follow_hall(sector) {
                self.known = Known::Nothing;
                return Evaluation::Contradiction;
            }
        }
        let behind = self.goal.wrapping_sub(self.offset) as i32;
        self.offset = self.offset.wrapping_add(behind.clamp(-SLEW_UNITS, SLEW_UNITS) as u32);
        let angle = self.units(self.position).wrapping_add(self.offset);
        // An index was found, and the shaft has turned by 1.25 turns without another.
        let most = self.counts_per_turn + self.counts_per_turn / 4;
        is_doubtful |= self.known == Known::Index && self.since_index.abs() > most;
        match (self.known, is_doubtful) {
            (Known::Nothing, _) => Evaluation::Missing,
            (_, true) => Evaluation::Doubtful(angle),
            (_, false) => Evaluation::Angle(angle),
        }
    }

    /// Returns a position that is less than a turn out of its range.
    #[inline(always)]
    fn wrapped(&self, position: i32) -> i32 {
        if position >= self.counts_per_turn {
            position - self.counts_per_turn
        } else if position < 0 {
            position + self.counts_per_turn
        } else {
            position
        }
    }

    /// Returns the angle of a position. A product of 24 bits is exact to a millionth of a turn.
    #[inline(always)]
    fn units(&self, position: i32) -> u32 {
        (position as f32 * self.units_per_count) as u32
    }

    /// Returns the best knowledge of the electrical angle, which the present one approaches.
    #[inline(always)]
    fn best_electrical(&self) -> u32 {
        self.units(self.position).wrapping_add(self.goal).wrapping_mul(self.pole_pairs)
    }

    /// Takes an electrical angle as the best one, in the electrical turn of the present one.
    #[inline(never)]
    fn aim(&mut self, electrical: u32) {
        let off = electrical.wrapping_sub(self.best_electrical()) as i32;
        self.goal = self.goal.wrapping_add((off as f32 * self.turns_per_electrical) as i32 as u32);
    }

    /// Compares the position with an index that came this number of counts ago, and corrects it.
    #[cold]
    #[inline(never)]
    fn check_index(&mut self, ago: i16) -> IndexCheck {
        self.since_index = ago.into();
        let found = self.wrapped(ago.into());
        let ahead = self.wrapped(self.position - found);
        let lost = ahead.min(self.counts_per_turn - ahead);
        let is_checked = self.known == Known::Index;
        if is_checked && lost <= INDEX_TOLERANCE_COUNTS {
            return IndexCheck::Agrees;
        }
        // The angle stays, and approaches that of the index.
        let shift = self.units(self.position).wrapping_sub(self.units(found));
        self.position = found;
        self.offset = self.offset.wrapping_add(shift);
        match self.known {
            Known::Index => {}
            // The sensors do not know in which electrical turn they are, and the current does not depend on it.
            Known::Electrical => {
                self.goal = self.goal.wrapping_add(shift);
                self.aim(self.units(found).wrapping_mul(self.pole_pairs));
            }
            Known::Nothing => (self.offset, self.goal) = (0, 0),
        }
        self.known = Known::Index;
        if !is_checked {
            IndexCheck::Agrees
        } else if lost < self.correctable_counts {
            IndexCheck::Corrected
        } else {
            IndexCheck::Contradicts
        }
    }

    /// Compares the angle with the sector of the Hall sensors; returns true if both agree.
    #[inline(always)]
    fn follow_hall(&mut self, sector: u8) -> bool {
        let sector = if self.is_hall_reversed { 5 - sector } else { sector };
        let middle = begin(sector).wrapping_add(self.hall_begin).wrapping_add(SECTOR_UNITS / 2);
        let off = middle.wrapping_sub(self.best_electrical()) as i32;
        let outside = off.unsigned_abs().saturating_sub(SECTOR_UNITS / 2);
        match self.known {
            Known::Nothing => {
                self.aim(middle);
                self.offset = self.goal;
                self.known = Known::Electrical;
                true
            }
            Known::Electrical => {
                // The rotor is at the nearer end of the sector: it has just passed it, or is about to.
                if outside > 0 {
                    let half = (SECTOR_UNITS / 2) as i32;
                    self.aim(middle.wrapping_sub(if off > 0 { half } else { -half } as u32));
                }
                outside <= SECTOR_UNITS / 2 + HALL_MARGIN_UNITS
            }
            Known::Index => outside <= HALL_MARGIN_UNITS,
        }
    }
}

#[cfg(test)]
#[path = "quadrature_tests.rs"]
mod tests;
