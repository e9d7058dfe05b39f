//! Changes to the machine between two periods, and its true state.
//!
//! A test changes the surroundings (supply, water, side load, a stand that holds the output), adds parts (brake, comparators,
//! thermal model) and reads what no sensor of the joint measures.

use super::power_stage::phases;
use super::{JointPlant, Rotor};
use crate::joint_plant::comparators::Comparators;
use crate::joint_plant::orders::OrderAnalyser;
use crate::joint_plant::supply::Supply;
use crate::joint_plant::surroundings::Surroundings;
use crate::joint_plant::winding::Winding;
use std::f64::consts::TAU;

impl JointPlant {
    /// Sets the number of sub-steps per period.
    pub fn set_substeps(&mut self, substeps: usize) {
        self.substeps = substeps.max(1);
        self.step_s = 0.0;
    }

    /// Lets an ideal actuator compensate this share of the friction with a delay of one sub-step.
    ///
    /// This is the upper bound of any model. The sum with the motor torque is limited to `max_torque_nm`, as in a driver
    /// with a current limit.
    pub fn cancel_friction(&mut self, share: f64, max_torque_nm: f64) {
        (self.cancelled, self.max_torque_nm) = (share, max_torque_nm);
    }

    /// Sets whether a stand holds the output.
    pub fn hold(&mut self, held: bool) {
        self.held = held;
    }

    /// Lets a stand turn the output at this velocity (rad/s), or sets it free.
    pub fn turn(&mut self, velocity_rad_s: Option<f64>) {
        self.turned_rad_s = velocity_rad_s;
    }

    /// Starts an analysis of the true motor torque at the joint, and returns the one before.
    pub fn analyse_order(&mut self, order: f64) -> Option<OrderAnalyser> {
        self.orders.replace(OrderAnalyser::of(order))
    }

    /// Starts a record of the true currents after each period, and returns the one before: time since the start, s, and the
    /// currents along and across the magnet, A.
    pub fn record_currents(&mut self) -> Vec<[f64; 3]> {
        self.recorded_s = 0.0;
        self.recorded.replace(Vec::new()).unwrap_or_default()
    }

    /// Sets the inductance of a phase, H: saturation lowers it.
    pub fn set_inductance(&mut self, inductance_h: f64) {
        self.p.phase_inductance_h = inductance_h;
        self.step_s = 0.0;
    }

    /// Moves the output to this position (rad) and sets its velocity to 0.
    pub fn place(&mut self, position_rad: f64) {
        (self.position, self.velocity) = (position_rad, 0.0);
        if let Some(rotor) = &mut self.rotor {
            *rotor = Rotor { most_nm: rotor.most_nm, ..Rotor::at(position_rad) };
        }
    }

    /// Lets a compliant coupling slip from this torque on, Nm; with 0 it is broken. A rigid coupling does not slip.
    pub fn limit_coupling(&mut self, most_nm: f64) {
        if let Some(rotor) = &mut self.rotor {
            rotor.most_nm = most_nm;
        }
    }

    /// Sets whether the coil of the holding brake has power, which releases it. Without a brake it has no effect.
    pub fn energise_brake(&mut self, is_energised: bool) {
        if let Some(brake) = &mut self.brake {
            brake.energise(is_energised);
        }
    }

    /// Replaces the stiff bus by a capacitor with a unidirectional supply.
    pub fn charge_bus(&mut self) {
        self.supply = Some(Supply::of(&self.p));
    }

    /// Sets the voltage of the supply, V: of a stiff bus, or of the source that charges the capacitor.
    pub fn set_supply(&mut self, voltage_v: f64) {
        match &mut self.supply {
            Some(supply) => supply.set_v = voltage_v,
            None => self.p.bus_voltage_v = voltage_v,
        }
    }

    /// Returns the bus voltage, V.
    pub fn bus_v(&self) -> f64 {
        self.supply.map_or(self.p.bus_voltage_v, |supply| supply.bus_v)
    }

    /// Adds overcurrent comparators at the shunts.
    pub fn watch_overcurrent(&mut self) {
        self.comparators = Some(Comparators::of(&self.p));
    }

    /// Sets the nominal lower and upper level of the comparators, if there are any, A: of phase a, of phase b, and of the
    /// sum of both. An infinite one never acts.
    pub fn set_break_levels(&mut self, levels_a: [[f64; 2]; 3]) {
        if let Some(watch) = &mut self.comparators {
            watch.set_levels(levels_a, &self.p);
        }
    }

    /// Enables the thermal model of the winding, which starts at the water temperature.
    pub fn heat_winding(&mut self) {
        self.winding = Some(Winding::of(&self.p));
        self.step_s = 0.0;
    }

    /// Returns the true currents of phases a, b, c, A.
    pub fn phase_currents_a(&self) -> [f64; 3] {
        phases(self.current)
    }

    /// Returns the torque-producing current, A, positive for torque in positive direction.
    pub fn torque_current_a(&self) -> f64 {
        let (sine, cosine) = self.electrical_rad().sin_cos();
        self.current[1] * cosine - self.current[0] * sine
    }

    /// Returns the current along the magnet, A.
    pub fn magnetising_current_a(&self) -> f64 {
        let (sine, cosine) = self.electrical_rad().sin_cos();
        self.current[0] * cosine + self.current[1] * sine
    }

    /// Returns the electrical angle of the motor, rad.
    fn electrical_rad(&self) -> f64 {
        self.p.gear_ratio * self.p.pole_pairs * self.motor_position_rad()
    }

    /// Lets side load, pressure and water temperature follow these courses from now on. Film and thermometer of the seal
    /// start at the water temperature.
    pub fn surround(&mut self, surroundings: Surroundings) {
        let water_c = surroundings.water_c.at(0.0);
        self.p.water_temperature_c = water_c;
        self.seal.set_water(water_c);
        self.seal.set_temperature(water_c);
        self.side_load_n = surroundings.side_load_n.at(0.0).max(0.0);
        self.around.pressure_diff_pa = surroundings.pressure_pa.at(0.0);
        self.around.radial_force_n = self.acting.radial_force_n + self.side_load_n;
        self.seal.settle(&self.around);
        self.surroundings = Some(surroundings);
        (self.elapsed_s, self.surroundings_due_s) = (0.0, 0.0);
    }

    /// Sets the play of a compliant coupling, rad.
    pub fn set_backlash(&mut self, backlash_rad: f64) {
        self.p.backlash_rad = backlash_rad;
    }

    /// Returns the joint position, rad.
    pub fn position_rad(&self) -> f64 {
        self.position
    }

    /// Returns the joint velocity, rad/s.
    pub fn velocity_rad_s(&self) -> f64 {
        self.velocity
    }

    /// Returns the true friction of seal and gear, Nm, positive against positive motion.
    pub fn friction_nm(&self) -> f64 {
        self.seal.torque_nm()
    }

    /// Returns the inertia at the joint, kg m^2.
    pub fn inertia_kg_m2(&self) -> f64 {
        self.inertia
    }

    /// Returns the position of motor and gear in joint coordinates, rad.
    pub fn motor_position_rad(&self) -> f64 {
        self.rotor.map_or(self.position, |rotor| rotor.position)
    }

    /// Returns the angle that an encoder of the motor shows, turns; it does not wrap.
    pub fn motor_turns(&self) -> f64 {
        let motor = self.motor_position_rad() * self.p.gear_ratio;
        let off = match self.p.magnet_eccentricity_rad {
            0.0 => 0.0,
            eccentricity => eccentricity * motor.sin(),
        };
        (self.p.encoder_direction * (motor + off) + self.p.encoder_zero_rad) / TAU
    }

    /// Returns the pole pairs of the motor.
    pub fn pole_pairs(&self) -> f64 {
        self.p.pole_pairs
    }

    /// Returns the rotation of the encoder in `seconds` at the present velocity, turns of the motor.
    pub fn motor_turns_in(&self, seconds: f64) -> f64 {
        let velocity = self.rotor.map_or(self.velocity, |rotor| rotor.velocity);
        self.p.encoder_direction * velocity * self.p.gear_ratio * seconds / TAU
    }
}
