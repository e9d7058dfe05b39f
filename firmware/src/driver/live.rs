//! Between the bus and a current loop that runs on real sensors.
//!
//! The loop runs in an interrupt and owns its state; the driver runs below it and owns the bus. What goes
//! over are whole values: [`LoopOrders`] down, once a millisecond or so, and a [`LoopReport`] up. Nothing
//! is shared, so nothing can be seen half-written. Everything that came over the bus carries its age.

use crate::control::probe::{ProbeOrder, ProbeReport};
use crate::control::{Covariates, LoopFlags, Setpoint};
use compensator_core::Flags;
use compensator_core::can::{Command, Message, Seal, Surroundings, Torque};
use compensator_core::compensator::Reading;
use compensator_core::network::Factors;

/// What the current loop is to do until the next orders.
#[derive(Clone, Copy, Debug)]
pub struct LoopOrders {
    /// What the joint is to do.
    pub setpoint: Setpoint,
    /// What is known of the joint beside its encoder.
    pub covariates: Covariates,
    /// Whether the bridge may be on.
    pub bridge: bool,
    /// Whether friction may be compensated.
    pub compensation: bool,
    /// Share of the current limit that temperature leaves, 0..=1.
    pub current_share: f32,
    /// Share of the compensation that is left, 0..=1: less than 1 where the model was seen to have more friction than the joint.
    pub compensation_share: f32,
    /// What a network last said of the law's levels and stiffness; `None` for its constants.
    pub factors: Option<Factors<f32>>,
    /// Counts the times the gate driver is to be put to sleep, which clears a fault it holds.
    pub gate_resets: u8,
    /// Counts parameter sets: where it changes, the loop is to be given the new one.
    pub set_number: u32,
    /// Where the joint was last said to be.
    pub home: Home,
    /// The motor is being measured: a voltage along a field in place of the current loop. It too ends with the set-point's age.
    pub probe: Option<ProbeOrder>,
}

/// Where a joint is, as somebody who knows said: an encoder on the motor tells the angle within its turn, and
/// not which turn it is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Home {
    /// Position at the moment this was said, rad.
    pub position_rad: f32,
    /// Counts the times it was said: where it changes, the joint is there now.
    pub number: u32,
}

/// What the current loop, and the board around it, did and saw since the last report.
#[derive(Clone, Copy, Debug)]
pub struct LoopReport {
    /// Bus voltage, V; `None` where it is not measured.
    pub bus_voltage_v: Option<f32>,
    /// Phase currents, A; `None` where they are not measured.
    pub phase_currents_a: Option<[f32; 3]>,
    /// Torque-making current, A.
    pub current_a: f32,
    /// What it should be, A.
    pub current_reference_a: f32,
    /// Voltage across the magnet, V, in the motor's sign; 0 with the bridge open.
    pub voltage_q_v: f32,
    /// Joint velocity, rad/s.
    pub velocity_rad_s: f32,
    /// Joint position, rad; NaN where whole turns are not known.
    pub position_rad: f32,
    /// The same from any zero, rad: known as long as the encoder is.
    pub turned_rad: f32,
    /// Torque of the measured current at the joint, Nm.
    pub motor_torque_nm: f32,
    /// The model's friction torque, Nm.
    pub friction_torque_nm: f32,
    /// Current of the compensation, A.
    pub feed_forward_current_a: f32,
    /// What no part of the model explains, Nm.
    pub residual_torque_nm: f32,
    /// Torque held by the model's bent bristles, Nm.
    pub bristle_torque_nm: f32,
    /// Every flag of the loop since the last report.
    pub loop_flags: LoopFlags,
    /// Every flag of the compensator since the last report.
    pub flags: Flags,
    /// Temperature of the bridge, deg C; `None` where it is not measured.
    pub bridge_temperature_c: Option<f32>,
    /// Temperature of the motor, deg C; `None` where it is not measured.
    pub motor_temperature_c: Option<f32>,
    /// Age of the latest conversion, us.
    pub sample_age_us: Option<u32>,
    /// The gate driver reports a fault.
    pub gate_driver_fault: bool,
    /// The chip opened the bridge by itself: supply, clock, memory or processor.
    pub system_break: bool,
    /// The guard below the stack is whole.
    pub stack_intact: bool,
    /// Periods the loop did not end in since the last report: the longest row of them.
    pub overruns_in_a_row: u32,
    /// What came of the last block of a measurement.
    pub probe: ProbeReport,
}

impl Default for LoopReport {
    /// Nothing measured, nothing wrong.
    fn default() -> Self {
        Self {
            bus_voltage_v: None,
            phase_currents_a: None,
            current_a: 0.0,
            current_reference_a: 0.0,
            voltage_q_v: 0.0,
            velocity_rad_s: 0.0,
            position_rad: f32::NAN,
            turned_rad: 0.0,
            motor_torque_nm: f32::NAN,
            friction_torque_nm: 0.0,
            feed_forward_current_a: 0.0,
            residual_torque_nm: f32::NAN,
            bristle_torque_nm: 0.0,
            loop_flags: LoopFlags::empty(),
            flags: Flags::DISABLED,
            bridge_temperature_c: None,
            motor_temperature_c: None,
            sample_age_us: None,
            gate_driver_fault: false,
            system_break: false,
            stack_intact: true,
            overruns_in_a_row: 0,
            probe: ProbeReport::default(),
        }
    }
}

/// How a command stands to the one before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CommandSequence {
    /// The next one, after so many lost ones.
    New {
        /// Commands that never came.
        lost: u8,
    },
    /// The same again: not a sign of life.
    Duplicate,
    /// An older one: passed over.
    Late,
}

#[derive(Clone, Copy, Debug)]
struct Received<M> {
    value: M,
    at_us: u64,
}

/// What last came over the bus, and when.
#[derive(Clone, Copy, Debug, Default)]
pub struct Live {
    command: Option<Received<Command>>,
    seal: Option<Received<Seal>>,
    surroundings: Option<Received<Surroundings>>,
    torque: Option<Received<Torque>>,
}

impl Live {
    /// Takes in a message for this node. A command says how it stands to the one before.
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

    fn command(&mut self, value: Command, now_us: u64) -> CommandSequence {
        let ahead = self.command.map_or(1, |had| value.counter.wrapping_sub(had.value.counter));
        match ahead {
            0 => CommandSequence::Duplicate,
            // Half the ring ahead, or half behind.
            1..=128 => {
                self.command = Some(Received { value, at_us: now_us });
                CommandSequence::New { lost: ahead - 1 }
            }
            _ => CommandSequence::Late,
        }
    }

    /// Forgets the command: the next one counts from anew.
    pub fn forget_command(&mut self) {
        self.command = None;
    }

    /// The set-point and its age.
    pub fn setpoint(&self, now_us: u64) -> Setpoint {
        match self.command {
            None => Setpoint::NONE,
            Some(had) => Setpoint {
                current_a: had.value.current_a,
                velocity_reference_rad_s: had.value.velocity_reference_rad_s(),
                age_s: age_s(had.at_us, now_us),
            },
        }
    }

    /// The covariates and their ages, of a campaign that is so old.
    pub fn covariates(&self, campaign_h: f32, now_us: u64) -> Covariates {
        Covariates {
            radial_force_n: reading(self.seal, now_us, |seal| seal.radial_force_n),
            pressure_diff_mpa: reading(self.seal, now_us, Seal::pressure_diff_mpa),
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
    let Some(had) = received else { return Reading::missing() };
    let value = of(&had.value);
    // NaN says that nobody measures it.
    if value.is_nan() {
        return Reading::missing();
    }
    Reading { value, age_s: age_s(had.at_us, now_us) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::can::Node;

    fn command(counter: u8) -> Message {
        Message::Command(Node::FIRST, Command::new(1.0, 0.5, counter))
    }

    #[test]
    fn commands_are_new_lost_again_or_late() {
        let mut live = Live::default();
        let mut take = |counter, now_us| live.take(&command(counter), now_us).unwrap();
        assert_eq!(take(200, 10), CommandSequence::New { lost: 0 });
        assert_eq!(take(201, 20), CommandSequence::New { lost: 0 });
        assert_eq!(take(201, 30), CommandSequence::Duplicate);
        assert_eq!(take(200, 30), CommandSequence::Late);
        assert_eq!(take(5, 40), CommandSequence::New { lost: 59 });
        // Neither the repeated nor the late one made the set-point younger.
        assert!((live.setpoint(1_000_040).age_s - 1.0).abs() < 1e-6);
    }

    #[test]
    fn what_nobody_measures_is_missing_and_the_rest_ages() {
        let mut live = Live::default();
        assert!(live.covariates(0.0, 0).radial_force_n.age_s < 0.0);
        let seal = Seal { radial_force_n: f32::NAN, pressure_diff_pa: 2e5 };
        live.take(&Message::Seal(Node::FIRST, seal), 1_000_000);
        let covariates = live.covariates(2.0, 3_000_000);
        assert!(covariates.radial_force_n.age_s < 0.0);
        assert_eq!(covariates.pressure_diff_mpa.age_s, 2.0);
        assert!((covariates.pressure_diff_mpa.value - 0.2).abs() < 1e-6);
        assert_eq!(covariates.campaign_time_h, 2.0);
        assert_eq!(live.setpoint(0).age_s, -1.0);
    }
}
