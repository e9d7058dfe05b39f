//! The home over a reset: see [`crate::driver::home`].

use super::Device;
use crate::control::LoopFlags;
use crate::driver::home::{KeptHome, has_turns, is_absolute, shaft_number};
use crate::node::sdo::Abort;
use embedded_storage::nor_flash::NorFlash;

/// What the start has made of a kept home so far.
#[derive(Clone, Copy, Debug, Default)]
pub(super) enum HomeState {
    /// There is none, or it was used.
    #[default]
    Settled,
    /// It waits for an angle of the encoder.
    Kept(KeptHome),
    /// It is known with an angle, and waits until the joint is at rest.
    Known {
        kept: KeptHome,
        /// Position at that angle, rad.
        position_rad: f32,
        /// Position from the arbitrary zero at the same time, rad.
        turned_rad: f32,
    },
}

impl<F: NorFlash> Device<F> {
    /// Takes the home that the previous run kept.
    pub(super) fn begin_home(&mut self, kept: Option<KeptHome>) {
        self.home = kept.map_or(HomeState::Settled, HomeState::Kept);
    }

    /// Sets the kept home once the encoder is read and the joint is at rest. Called with each report.
    #[inline(never)]
    pub(super) fn restore_home(&mut self) {
        let report = self.base.report();
        let is_lost = report.loop_flags.contains(LoopFlags::ENCODER_LOST);
        match self.home {
            HomeState::Settled => {}
            HomeState::Kept(kept) => {
                let Some(encoder) = self.angle_from_zero(report) else { return };
                let turned_rad = report.turned_rad;
                let (turns, set) = (self.turn_readings.turns(), self.base.set());
                if has_turns(set) && kept.turns.is_some() && turns.is_none() {
                    return;
                }
                match kept.position_at(encoder as u32, turns, set) {
                    Ok(position_rad) => {
                        self.home = HomeState::Known { kept, position_rad, turned_rad };
                    }
                    Err(why) => {
                        self.home = HomeState::Settled;
                        let _ = self.base.refuse(Abort::State, why);
                    }
                }
            }
            HomeState::Known { position_rad, turned_rad, .. }
                if self.base.is_standing() && !is_lost =>
            {
                let now_rad = position_rad + report.turned_rad - turned_rad;
                self.home = HomeState::Settled;
                self.base.current_loop.set_home(now_rad);
            }
            HomeState::Known { .. } => {}
        }
    }

    /// Returns the home to keep; `None` if none is known.
    pub(crate) fn kept_home(&self) -> Option<KeptHome> {
        if let HomeState::Kept(kept) | HomeState::Known { kept, .. } = self.home {
            return Some(kept);
        }
        self.measured_home().filter(|home| home.position_rad.is_finite())
    }

    /// Returns angle and position of the last report; `None` without an angle. The position is NaN before homing.
    pub(super) fn measured_home(&self) -> Option<KeptHome> {
        let (report, set) = (self.base.report(), self.base.set());
        let is_absolute_joint = !self.base.settings.is_in_hil() && is_absolute(set);
        let is_known = is_absolute_joint && !self.turn_readings.contradict();
        let encoder = self.angle_from_zero(report).filter(|_| is_known)?;
        Some(KeptHome {
            position_rad: report.position_rad,
            encoder: encoder as u32,
            shaft: shaft_number(set),
            turns: self.turn_readings.turns(),
            may_move: self.base.is_bridge_in_use() || !self.base.is_standing(),
        })
    }
}
