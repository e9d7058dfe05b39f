//! Bridge, winding and current sensors of the machine.
//!
//! The currents are integrated in the stationary frame: in phase with phase a, and orthogonal to it. With a constant
//! voltage `u` and back-EMF `e` over a sub-step, the solution is exact:
//!
//! ```text
//! i' = (u + e - R i) / L   ->   i(dt) = i(0) exp(-R dt / L) + (u + e) (1 - exp(-R dt / L)) / R
//! ```
//!
//! The shunt amplifiers show a current only after they have settled, in the off time of its half bridge.

use super::{JointPlant, Measured, Rotor};
use crate::joint_plant::bridge::lost_v;
use rand_distr::{Distribution, StandardNormal};

/// Number of time constants after which `exp(-x)` is negligible in double precision.
const SETTLING_TIME_CONSTANTS: f64 = 40.0;

impl JointPlant {
    /// Returns the present measurements of the power stage.
    pub fn measure(&mut self) -> Measured {
        let phases = self.phase_currents_a();
        let shown: [f64; 3] = std::array::from_fn(|phase| self.settled_share(phase));
        let step = self.p.current_step_a;
        let mut currents_a = [0.0; 3];
        for ((measured, current), shown) in currents_a.iter_mut().zip(phases).zip(shown) {
            let noise: f64 = StandardNormal.sample(&mut self.random);
            *measured = ((current * shown + self.p.current_noise_a * noise) / step).round() * step;
        }
        let turns = self.motor_turns();
        let encoder = ((turns - turns.floor()) * self.p.encoder_counts) as u32;
        Measured { currents_a, bus_v: self.bus_v(), encoder }
    }

    /// Returns the share of the phase current that the shunt amplifier has reached at the sample.
    ///
    /// The amplifier settles from 0 while the low side conducts: half of the off time minus the dead time. It is 1 if the
    /// bridge is open.
    pub(super) fn settled_share(&self, phase: usize) -> f64 {
        let Some(duty) = self.duty else { return 1.0 };
        let conducted = 0.5 * (1.0 - duty[phase]) * self.period_s - self.p.dead_time_s;
        // This includes a lag of 0. The remaining error is below double precision.
        if conducted >= SETTLING_TIME_CONSTANTS * self.p.shunt_lag_s {
            1.0
        } else {
            1.0 - (-conducted.max(0.0) / self.p.shunt_lag_s).exp()
        }
    }

    /// Integrates the currents by `dt` (s) with these duties, or with an open bridge (`None`), and returns the
    /// torque-producing current, A.
    pub(super) fn conduct(&mut self, duty: Option<[f64; 3]>, period_s: f64, dt: f64) -> f64 {
        let resistance = self.resistance_ohm();
        if self.step_s != dt {
            let decay = resistance / self.p.phase_inductance_h * dt;
            (self.step_s, self.kept) = (dt, (-decay).exp());
            self.admittance = (1.0 - self.kept) / resistance;
        }
        // Angle at the middle of the sub-step, because the field rotates during the sub-step.
        let poles = self.p.gear_ratio * self.p.pole_pairs;
        let turned =
            self.rotor.unwrap_or(Rotor { velocity: self.velocity, ..Rotor::at(self.position) });
        let (sine, cosine) = (poles * (turned.position + 0.5 * dt * turned.velocity)).sin_cos();
        let flux = self.torque_constant_nm_per_a() / (1.5 * self.p.pole_pairs);
        let speed = flux * poles * turned.velocity;
        let induced = [speed * sine, -speed * cosine];
        let voltage = match duty {
            Some(duty) => self.voltage(period_s, duty),
            None => self.open_voltage(induced),
        };
        let before = self.current;
        self.lost_j += 1.5 * resistance * (before[0] * before[0] + before[1] * before[1]) * dt;
        self.current = [0, 1].map(|axis| {
            self.kept * before[axis] + self.admittance * (voltage[axis] + induced[axis])
        });
        if let Some(supply) = &mut self.supply {
            // Mean current of the sub-step, because the vector rotates by 4 degrees in 25 us at 8 rad/s. With the
            // initial current, the bus voltage would be several volts too high during braking.
            let mean = [0, 1].map(|axis| 0.5 * (before[axis] + self.current[axis]));
            let power_w = 1.5 * (voltage[0] * mean[0] + voltage[1] * mean[1]);
            supply.step(power_w / supply.bus_v.max(1.0), dt);
        }
        self.current[1] * cosine - self.current[0] * sine
    }

    /// Returns the true torque constant, Nm/A.
    pub(super) fn torque_constant_nm_per_a(&self) -> f64 {
        self.p.motor_torque_constant_nm_per_a * (1.0 + self.p.torque_constant_error)
    }

    /// Returns the phase resistance at the present temperature, ohm.
    fn resistance_ohm(&self) -> f64 {
        let gain = self.winding.map_or(1.0, |winding| winding.resistance_gain(&self.p));
        self.p.phase_resistance_ohm * gain
    }

    /// Returns the mean voltage of the driving bridge in phase with and orthogonal to phase a, V.
    fn voltage(&self, period_s: f64, duty: [f64; 3]) -> [f64; 2] {
        let currents = self.phase_currents_a();
        let bus = self.bus_v();
        vector(std::array::from_fn(|phase| {
            // A half bridge that does not switch has no dead time.
            let switches = 0.0 < duty[phase] && duty[phase] < 1.0;
            let lost = if switches {
                lost_v(&self.p, phase, currents[phase], bus, period_s)
            } else {
                self.p.switch_resistance_ohm * currents[phase]
            };
            duty[phase] * bus - lost
        }))
    }

    /// Returns the voltage of an open bridge in phase with and orthogonal to phase a, V.
    ///
    /// The diodes apply half of the bus voltage against each current and block when it reaches 0. If the voltage that ends
    /// the currents within this sub-step is available, it is applied.
    fn open_voltage(&self, induced: [f64; 2]) -> [f64; 2] {
        let bus = self.bus_v();
        let ends =
            [0, 1].map(|axis| -self.kept / self.admittance * self.current[axis] - induced[axis]);
        if phases(ends).into_iter().all(|voltage| voltage.abs() <= 0.5 * bus) {
            return ends;
        }
        vector(self.phase_currents_a().map(|current| match current {
            current if current > 0.0 => -0.5 * bus,
            current if current < 0.0 => 0.5 * bus,
            _ => 0.0,
        }))
    }
}

/// Clarke transformation: returns the components in phase with and orthogonal to phase a.
fn vector([a, b, c]: [f64; 3]) -> [f64; 2] {
    [(2.0 * a - b - c) / 3.0, (b - c) / 3f64.sqrt()]
}

/// Inverse Clarke transformation: returns the values of phases a, b, c.
pub(super) fn phases([along, across]: [f64; 2]) -> [f64; 3] {
    let root = 0.75f64.sqrt();
    [along, -0.5 * along + root * across, -0.5 * along - root * across]
}
