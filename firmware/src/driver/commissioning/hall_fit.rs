//! Where the sectors of Hall sensors lie, from their levels while the field turns the rotor.
//!
//! ```text
//! begin of sector 001 = mean of: electrical angle of the encoder - middle of the sector, for both orders of the sensors
//! ```
//! For the right order, this difference stays within half a sector; for the other one, it turns with the rotor. Equal turns in
//! both directions remove the age of the levels and their hysteresis.

use crate::control::transform::RAD_PER_UNIT;
use crate::sensors::hall::{SECTOR_UNITS, begin, sector};

/// Largest deviation from the first difference, 2^-32 turns: a sector, and 60 degrees for placement, and for the age of the levels
/// (9 degrees in a millisecond) in both directions.
const SPREAD_MAX: u32 = 2 * SECTOR_UNITS;
/// Minimum number of blocks: a tenth of what both directions take at the fastest field.
const BLOCKS_MIN: i32 = 50;

/// Differences for one order of the sensors: the first one, and sum and largest deviation from it.
#[derive(Clone, Copy, Debug, Default)]
struct Differences {
    first: u32,
    sum: i64,
    largest: u32,
}

/// How Hall sensors lie beside an encoder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HallPlacement {
    /// 1, or -1 if the sectors fall while the encoder counts up.
    pub order: f32,
    /// Electrical angle from the encoder's zero at which sector 001 begins, rad.
    pub begin_rad: f32,
}

/// The levels so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct HallFit {
    orders: [Differences; 2],
    blocks: i32,
    is_illegal: bool,
}

impl HallFit {
    /// Adds the levels at an electrical angle of the encoder, 2^-32 turns.
    #[inline(never)]
    pub(super) fn add(&mut self, levels: u8, electrical: u32) {
        let Some(sector) = sector(levels) else {
            self.is_illegal = true;
            return;
        };
        for (order, sector) in self.orders.iter_mut().zip([sector, 5 - sector]) {
            let difference = electrical.wrapping_sub(begin(sector) + SECTOR_UNITS / 2);
            if self.blocks == 0 {
                order.first = difference;
            }
            let deviation = difference.wrapping_sub(order.first) as i32;
            order.sum += i64::from(deviation);
            order.largest = order.largest.max(deviation.unsigned_abs());
        }
        self.blocks += 1;
    }

    /// Returns the placement; `None` without sound sensors.
    #[inline(never)]
    pub(super) fn found(&self) -> Option<HallPlacement> {
        let is_sound = self.blocks >= BLOCKS_MIN && !self.is_illegal;
        let mut orders = self.orders.iter().zip([1.0, -1.0]).filter(|_| is_sound);
        let (differences, order) = orders.find(|(order, _)| order.largest <= SPREAD_MAX)?;
        let mean = (differences.sum / i64::from(self.blocks)) as i32 as u32;
        let begin_rad = differences.first.wrapping_add(mean) as i32 as f32 * RAD_PER_UNIT;
        Some(HallPlacement { order, begin_rad })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f32::consts::TAU;

    /// Turns the rotor once there and once back, electrically, with sensors that begin at this angle, turns.
    fn fit(begin_turns: f32, is_reversed: bool) -> HallFit {
        let mut fit = HallFit::default();
        for k in (0..500).chain((0..500).rev()) {
            let turns = k as f32 / 500.0;
            let seen = (turns - begin_turns).rem_euclid(1.0) * 6.0;
            let seen =
                if is_reversed { 5 - (seen as usize).min(5) } else { (seen as usize).min(5) };
            let levels = [0b001, 0b011, 0b010, 0b110, 0b100, 0b101][seen];
            fit.add(levels, (turns * 4_294_967_296.0) as u32);
        }
        fit
    }

    #[test]
    fn fit_of_sound_sensors_finds_order_and_begin() {
        for begin_turns in [-0.45f32, -0.1, 0.0, 0.2, 0.3] {
            for is_reversed in [false, true] {
                let HallPlacement { order, begin_rad } =
                    fit(begin_turns, is_reversed).found().expect("found");
                assert_eq!(order, if is_reversed { -1.0 } else { 1.0 });
                let off = (begin_rad / TAU - begin_turns + 0.5).rem_euclid(1.0) - 0.5;
                assert!(off.abs() < 2e-3, "{begin_turns}: {begin_rad} rad");
            }
        }
    }

    #[test]
    fn fit_of_stuck_or_missing_sensors_finds_nothing() {
        let levels_at = |levels: fn(u32) -> u8| {
            let mut fit = HallFit::default();
            (0..500).for_each(|k| fit.add(levels(k), k << 23));
            fit.found()
        };
        assert_eq!(levels_at(|_| 0b001), None, "stuck");
        assert_eq!(levels_at(|_| 0b111), None, "missing");
        assert_eq!(levels_at(|k| if k == 70 { 0 } else { 0b001 }), None);
    }
}
