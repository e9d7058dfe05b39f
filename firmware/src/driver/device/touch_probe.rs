//! Touch probe of CiA 402-2 (60B8h to 60BDh): the position at an edge of an input, or at the zero of the encoder.
//!
//! The interrupt reads the input in every period and keeps the rotor's angle before the first rise and the first fall since the
//! last report. The edge came between two periods: it is placed in their middle, by the velocity. So its error is at most half a
//! period's way: 0.3 mrad at 12 rad/s, and the noise of the encoder.
//!
//! The zero of the encoder needs no work in the interrupt. Two reports on its two sides show that the rotor has passed it, and
//! the angle gives its position. It counts as both edges of an index pulse without width.
//!
//! Both probes can use the input or the zero. An edge in the two milliseconds after a probe was enabled may be older, so it is
//! ignored.

use super::Device;
use crate::control::transform::{RAD_PER_UNIT, binary_angle};
use crate::control::{LoopFlags, PERIOD_S};
use crate::driver::angle;
use crate::driver::loop_data::LoopReport;
use crate::node::sdo::Abort;
use compensator_core::text;
use embedded_storage::nor_flash::NorFlash;

/// Bits of a probe in its half of 60B8h.
mod function {
    pub const ENABLED: u16 = 1 << 0;
    pub const CONTINUOUS: u16 = 1 << 1;
    pub const SOURCE: u16 = 3 << 2;
    pub const SOURCE_ZERO: u16 = 1 << 2;
    pub const POSITIVE_EDGE: u16 = 1 << 4;
}

/// Bits of a probe in its half of 60B9h: it is enabled, the position of its positive edge is stored, and a bit that changes
/// with every stored position. Those of the negative edge follow.
mod status {
    pub const ENABLED: u16 = 1 << 0;
    pub const POSITIVE_STORED: u16 = 1 << 1;
    pub const POSITIVE_TOGGLE: u16 = 1 << 6;
}

/// Reports in which the edges may be older than the enabling of a probe.
const OLD_REPORTS: u8 = 2;
/// Angle of the rotor between two reports, 2^-32 turns, up to which they are on two sides of the zero: a quarter turn each.
const NEAR_ZERO: u32 = 1 << 30;

/// State of both probes.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct TouchProbes {
    /// 60B8h.
    pub function: u16,
    /// 60B9h.
    pub status: u16,
    /// 60BAh to 60BDh, 1e-6 rad.
    pub positions: [i32; 4],
    /// Reports that are ignored.
    ignored: [u8; 2],
    /// Angle of the rotor from the encoder's zero in the last report, 2^-32 turns.
    from_zero: Option<i32>,
}

impl TouchProbes {
    /// Stores the positions of a rise and of a fall for a probe, 1e-6 rad.
    fn store(&mut self, probe: usize, edges: [Option<i32>; 2]) {
        let shift = 8 * probe;
        let function = self.function >> shift;
        for (edge, position) in edges.into_iter().enumerate() {
            let stored = status::POSITIVE_STORED << edge << shift;
            let is_open = function & function::CONTINUOUS != 0 || self.status & stored == 0;
            let is_wanted = function & (function::POSITIVE_EDGE << edge) != 0 && is_open;
            let place = self.positions.get_mut(2 * probe + edge);
            if let (true, Some(position), Some(place)) = (is_wanted, position, place) {
                *place = position;
                self.status |= stored;
                self.status ^= status::POSITIVE_TOGGLE << edge << shift;
            }
        }
    }
}

impl<F: NorFlash> Device<F> {
    /// 60B8h. A rising bit 0 (8) enables a probe anew.
    pub(crate) fn set_touch_function(&mut self, word: u16) -> Result<(), Abort> {
        let sources = [word, word >> 8].map(|half| half & function::SOURCE);
        if sources.iter().any(|source| *source > function::SOURCE_ZERO) {
            let why = text!(
                "touch_probe_function: the source (bits 2, 3 and 10, 11) must be 0 (input) or 1 (zero of the encoder)"
            );
            return Err(self.base.refuse(Abort::Value, why));
        }
        let probes = &mut self.touch;
        for (probe, ignored) in probes.ignored.iter_mut().enumerate() {
            let enabled = function::ENABLED << (8 * probe);
            if word & enabled == 0 {
                probes.status &= !(0xFF << (8 * probe));
            } else if probes.function & enabled == 0 {
                probes.status |= status::ENABLED << (8 * probe);
                *ignored = OLD_REPORTS;
            }
        }
        probes.function = word;
        Ok(())
    }

    /// Takes the edges of a report.
    pub(super) fn step_touch_probes(&mut self) {
        let report = self.base.report();
        let input = self.edges_of_input(report);
        let from_zero = self.angle_from_zero(report);
        let before = self.touch.from_zero;
        self.touch.from_zero = from_zero;
        let zero = match (before, from_zero) {
            (Some(before), Some(now)) if has_passed(before, now) => {
                let position = self.micro_at_angle(report, now.wrapping_neg(), 0.0);
                [Some(position); 2]
            }
            _ => [None; 2],
        };
        for probe in 0..2 {
            let ignored = self.touch.ignored.get_mut(probe);
            if let Some(left @ 1..) = ignored {
                *left -= 1;
                continue;
            }
            let function = self.touch.function >> (8 * probe);
            if function & function::ENABLED != 0 {
                let is_of_zero = function & function::SOURCE != 0;
                self.touch.store(probe, if is_of_zero { zero } else { input });
            }
        }
    }

    /// Returns the positions of a rise and of a fall of the input, 1e-6 rad.
    fn edges_of_input(&self, report: &LoopReport) -> [Option<i32>; 2] {
        [report.touch.rise, report.touch.fall].map(|angle| {
            let from_report = angle?.wrapping_sub(report.rotor_angle) as i32;
            let later_s = 0.5 * PERIOD_S + self.base.identity.stage.encoder_age_s;
            Some(self.micro_at_angle(report, from_report, later_s))
        })
    }

    /// Returns the position at this angle of the rotor from that of the report, 2^-32 turns, and this time later, 1e-6 rad.
    #[inline(never)]
    fn micro_at_angle(&self, report: &LoopReport, from_report: i32, later_s: f32) -> i32 {
        let motor = &self.set().motor;
        let way_rad = from_report as f32 * RAD_PER_UNIT * motor.joint_direction / motor.gear_ratio;
        angle::micro(report.turned_rad + way_rad + later_s * report.velocity_rad_s)
    }

    /// Returns the angle of the rotor from the encoder's zero, 2^-32 turns; `None` while it is unknown.
    pub(super) fn angle_from_zero(&self, report: &LoopReport) -> Option<i32> {
        let motor = &self.set().motor;
        let offset = binary_angle(motor.encoder_offset_rad);
        let zero = if motor.encoder_direction < 0.0 { offset } else { offset.wrapping_neg() };
        let is_known = !report.loop_flags.contains(LoopFlags::ENCODER_LOST);
        is_known.then(|| report.rotor_angle.wrapping_sub(zero) as i32)
    }
}

/// Returns true if the rotor has passed the zero between two angles from it.
fn has_passed(before: i32, now: i32) -> bool {
    let is_near = before.unsigned_abs() < NEAR_ZERO && now.unsigned_abs() < NEAR_ZERO;
    is_near && (before < 0) != (now < 0)
}
