//! The last inputs received over the bus, for a joint on its own sensors.
//!
//! [`ReceivedInputs`] keeps the last frame of each kind with its time of reception. It gives the set-point and
//! the covariates of the current loop, each with its age.

use crate::control::{Covariates, Setpoint};
use compensator_core::can::{CommandFrame, Message, SealFrame, SurroundingsFrame, TorqueFrame};
use compensator_core::compensator::Reading;

/// Sequence of a command relative to the previous one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CommandSequence {
    /// The next command, after a number of lost ones.
    New {
        /// Commands that were lost.
        lost: u8,
    },
    /// The same command again: it does not refresh the set-point.
    Duplicate,
    /// An older command: ignored.
    Late,
}

#[derive(Clone, Copy, Debug)]
struct Received<M> {
    value: M,
    at_us: u64,
}

/// The last frame of each kind and its time of reception.
#[derive(Clone, Copy, Debug, Default)]
pub struct ReceivedInputs {
    command: Option<Received<CommandFrame>>,
    seal: Option<Received<SealFrame>>,
    surroundings: Option<Received<SurroundingsFrame>>,
    torque: Option<Received<TorqueFrame>>,
}

impl ReceivedInputs {
    /// Stores a message for this node. For a command, returns its sequence relative to the previous one.
    pub fn take(&mut self, message: &Message, now_us: u64) -> Option<CommandSequence> {
        match *message {
            Message::Seal(_, value) => self.seal = Some(Received { value, at_us: now_us }),
            Message::Surroundings(_, value) => {
                self.surroundings = Some(Received { value, at_us: now_us });
            }
            Message::Torque(_, value) => self.torque = Some(Received { value, at_us: now_us }),
            Message::Command(_, value) => return Some(self.command(value, now_us)),
            _ => {}
        }
        None
    }

    fn command(&mut self, value: CommandFrame, now_us: u64) -> CommandSequence {
        let ahead = self.command.map_or(1, |last| value.counter.wrapping_sub(last.value.counter));
        match ahead {
            0 => CommandSequence::Duplicate,
            // Half the ring ahead is new, half behind is late.
            1..=128 => {
                self.command = Some(Received { value, at_us: now_us });
                CommandSequence::New { lost: ahead - 1 }
            }
            _ => CommandSequence::Late,
        }
    }

    /// Discards the command: the next one starts a new sequence.
    pub fn reset_command(&mut self) {
        self.command = None;
    }

    /// Returns the set-point and its age.
    pub fn setpoint(&self, now_us: u64) -> Setpoint {
        match self.command {
            None => Setpoint::NONE,
            Some(last) => Setpoint {
                current_a: last.value.current_a,
                velocity_reference_rad_s: last.value.velocity_reference_rad_s(),
                age_s: age_s(last.at_us, now_us),
            },
        }
    }

    /// Returns the covariates and their ages; `campaign_h` is the age of the campaign, h.
    pub fn covariates(&self, campaign_h: f32, now_us: u64) -> Covariates {
        Covariates {
            radial_force_n: reading(self.seal, now_us, |seal| seal.radial_force_n),
            pressure_diff_mpa: reading(self.seal, now_us, SealFrame::pressure_diff_mpa),
            temperature_c: reading(self.surroundings, now_us, |of| of.temperature_c),
            load_torque_nm: reading(self.torque, now_us, |of| of.load_torque_nm),
            auxiliary: reading(self.surroundings, now_us, |of| of.auxiliary),
            campaign_time_h: campaign_h,
        }
    }
}

fn age_s(at_us: u64, now_us: u64) -> f32 {
    now_us.saturating_sub(at_us) as f32 * 1e-6
}

fn reading<M>(received: Option<Received<M>>, now_us: u64, of: impl Fn(&M) -> f32) -> Reading<f32> {
    let Some(last) = received else { return Reading::missing() };
    let value = of(&last.value);
    // NaN marks a quantity that is not measured.
    if value.is_nan() {
        return Reading::missing();
    }
    Reading { value, age_s: age_s(last.at_us, now_us) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::can::NodeId;

    fn command(counter: u8) -> Message {
        Message::Command(NodeId::FIRST, CommandFrame::new(1.0, 0.5, counter))
    }

    #[test]
    fn command_counter_decides_new_lost_duplicate_or_late() {
        let mut live = ReceivedInputs::default();
        let mut take = |counter, now_us| live.take(&command(counter), now_us).unwrap();
        assert_eq!(take(200, 10), CommandSequence::New { lost: 0 });
        assert_eq!(take(201, 20), CommandSequence::New { lost: 0 });
        assert_eq!(take(201, 30), CommandSequence::Duplicate);
        assert_eq!(take(200, 30), CommandSequence::Late);
        assert_eq!(take(5, 40), CommandSequence::New { lost: 59 });
        // Neither the duplicate nor the late command refreshed the set-point.
        assert!((live.setpoint(1_000_040).age_s - 1.0).abs() < 1e-6);
    }

    #[test]
    fn covariates_with_nan_are_missing_and_others_age() {
        let mut live = ReceivedInputs::default();
        assert!(live.covariates(0.0, 0).radial_force_n.age_s < 0.0);
        let seal = SealFrame { radial_force_n: f32::NAN, pressure_diff_pa: 2e5 };
        live.take(&Message::Seal(NodeId::FIRST, seal), 1_000_000);
        let covariates = live.covariates(2.0, 3_000_000);
        assert!(covariates.radial_force_n.age_s < 0.0);
        assert_eq!(covariates.pressure_diff_mpa.age_s, 2.0);
        assert!((covariates.pressure_diff_mpa.value - 0.2).abs() < 1e-6);
        assert_eq!(covariates.campaign_time_h, 2.0);
        assert_eq!(live.setpoint(0).age_s, -1.0);
    }
}
