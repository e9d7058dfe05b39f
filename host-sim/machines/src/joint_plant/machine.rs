//! Plant of a current loop: motor, bridge, shaft and load.
//!
//! Winding currents are integrated in the stationary frame. The solution over a sub-step is exact for constant voltage
//! and back-EMF. The driving bridge applies the mean voltage of each phase minus the dead-time loss. The diodes of an
//! open bridge drive the currents to 0. Gear and shaft are one inertia, unless the coupling between them is compliant.
//!
//! A period of 50 us has two semi-implicit Euler sub-steps. A test compares them with twenty.

mod adjust;
mod power_stage;

use super::brake::HoldingBrake;
use super::comparators::{Comparators, STEPS_PER_PERIOD};
use super::gear::Gear;
use super::load::{Acting, Load};
use super::orders::OrderAnalyser;
use super::parameters::Parameters;
use super::seal::{Around, Seal};
use super::supply::Supply;
use super::surroundings::Surroundings;
use super::winding::Winding;
use crate::conditions::Conditions;
use crate::joint::Joint;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use std::f64::consts::TAU;

/// Sub-steps per period.
const SUBSTEPS: usize = 2;

/// Measurements of the power stage and its encoder.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Currents of phases a, b, c, A, with noise and the quantisation of the converter.
    pub currents_a: [f64; 3],
    /// Bus voltage, V.
    pub bus_v: f64,
    /// Encoder on the motor, counts within a turn.
    pub encoder: u32,
}

/// Measurements of the sensors at the joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shown {
    /// Side load, N.
    pub radial_force_n: f64,
    /// Pressure difference, Pa.
    pub pressure_diff_pa: f64,
    /// Temperature of the housing near the seal, deg C.
    pub temperature_c: f64,
    /// Torque on the load, Nm, as a load model computes it: without noise.
    pub load_torque_nm: f64,
}

/// The simulated machine. Its public fields may change between two periods.
#[derive(Clone, Debug)]
pub struct JointPlant {
    p: Parameters,
    /// The load.
    pub load: Load,
    /// The seal.
    pub seal: Seal,
    /// Operating conditions of the seal.
    pub around: Around,
    acting: Acting,
    /// Currents in phase with and orthogonal to phase a, A.
    current: [f64; 2],
    position: f64,
    velocity: f64,
    inertia: f64,
    substeps: usize,
    /// Sub-step, s, for which `kept` (remaining share of the winding current) and `admittance` (gain of the voltage, 1/ohm)
    /// were computed.
    step_s: f64,
    kept: f64,
    admittance: f64,
    /// Share of the friction that an ideal actuator compensates.
    cancelled: f64,
    /// Maximum torque of this actuator and the motor together, Nm.
    max_torque_nm: f64,
    /// True if a stand holds the output.
    held: bool,
    /// Velocity at which a stand turns the output, rad/s.
    turned_rad_s: Option<f64>,
    /// Analyser of the motor torque.
    pub orders: Option<OrderAnalyser>,
    /// Recorded currents: time since the start, s, and the currents along and across the magnet, A.
    recorded: Option<Vec<[f64; 3]>>,
    recorded_s: f64,
    /// External side load besides that of the load, N.
    pub side_load_n: f64,
    /// Joint whose additive torques act at the output, besides friction and load.
    pub hidden: Option<Joint>,
    /// Position of a stop against positive motion, rad. It takes all of the velocity.
    pub stop_rad: f64,
    surroundings: Option<Surroundings>,
    /// Time since the surroundings were set, and until they are evaluated again, s.
    elapsed_s: f64,
    surroundings_due_s: f64,
    /// Motor and gear, if the coupling to the output is compliant.
    rotor: Option<Rotor>,
    supply: Option<Supply>,
    /// A holding brake.
    pub brake: Option<HoldingBrake>,
    /// Thermal state of the winding, if the thermal model is enabled.
    pub winding: Option<Winding>,
    comparators: Option<Comparators>,
    /// True if the comparators have opened the bridge and the break flag is not cleared.
    pub is_tripped: bool,
    /// Largest phase current while the comparators were simulated, A.
    pub peak_a: f64,
    /// Copper loss since the last thermal step, J, and the time since then, s.
    lost_j: f64,
    lost_s: f64,
    /// Duties of the previous period. They determine the conduction time of the low sides before the sample.
    duty: Option<[f64; 3]>,
    period_s: f64,
    random: Pcg64,
}

/// Motion of motor and gear before a compliant coupling, in joint coordinates.
#[derive(Clone, Copy, Debug)]
struct Rotor {
    position: f64,
    velocity: f64,
    /// Way that the coupling has slipped, rad, and the torque from which it slips, Nm.
    slipped: f64,
    most_nm: f64,
}

impl Rotor {
    /// At rest at this position, with a sound coupling.
    const fn at(position: f64) -> Self {
        Self { position, velocity: 0.0, slipped: 0.0, most_nm: f64::INFINITY }
    }
}

/// Time between two evaluations of the surroundings, s.
const SURROUNDINGS_STEP_S: f64 = 1e-3;

/// Time step of the thermal model, s.
const HEAT_STEP_S: f64 = 1e-2;

impl JointPlant {
    /// Creates a machine at rest with this load, under water.
    ///
    /// The seed determines the sensor noise and the angles of the eccentricity and the out-of-roundness.
    pub fn new(p: &Parameters, load: Load, seed: u64) -> Self {
        let mut random = Pcg64::seed_from_u64(seed);
        let phase = [random.random_range(0.0..TAU), random.random_range(0.0..TAU)];
        Self::with_phase(p, load, phase, seed)
    }

    /// Creates a machine as [`JointPlant::new`] with given angles of the eccentricity and the out-of-roundness, rad.
    pub fn with_phase(p: &Parameters, load: Load, phase_rad: [f64; 2], seed: u64) -> Self {
        Self::with_seal(p, load, Seal::new(p, phase_rad), seed)
    }

    /// Creates a machine as [`JointPlant::new`] with a seal of the same parameters.
    pub fn with_seal(p: &Parameters, load: Load, mut seal: Seal, seed: u64) -> Self {
        let around = Around { pressure_diff_pa: p.pool_pressure_pa, ..Around::default() };
        let mut load = load;
        let position = load.start_rad();
        let acting = load.act(p, position, 0.0, 0.0);
        let around = Around {
            radial_force_n: acting.radial_force_n,
            load_torque_nm: acting.torque_nm,
            ..around
        };
        seal.settle(&around);
        let geared = p.rotor_inertia_kg_m2 * p.gear_ratio * p.gear_ratio;
        let rigid = p.output_stiffness_nm_per_rad <= 0.0;
        Self {
            inertia: geared + p.output_inertia_kg_m2 + load.inertia_kg_m2(p),
            hidden: None,
            stop_rad: f64::INFINITY,
            surroundings: None,
            elapsed_s: 0.0,
            surroundings_due_s: 0.0,
            rotor: (!rigid).then_some(Rotor::at(position)),
            supply: None,
            brake: None,
            winding: None,
            comparators: None,
            is_tripped: false,
            peak_a: 0.0,
            lost_j: 0.0,
            lost_s: 0.0,
            duty: None,
            period_s: 0.0,
            p: *p,
            load,
            seal,
            around,
            acting,
            current: [0.0; 2],
            position,
            velocity: 0.0,
            substeps: SUBSTEPS,
            step_s: 0.0,
            kept: 0.0,
            admittance: 0.0,
            cancelled: 0.0,
            max_torque_nm: f64::INFINITY,
            held: false,
            turned_rad_s: None,
            orders: None,
            recorded: None,
            recorded_s: 0.0,
            side_load_n: 0.0,
            random: Pcg64::seed_from_u64(seed ^ 0x5eed),
        }
    }

    /// Returns the present measurements of the sensors at the joint.
    pub fn show(&mut self) -> Shown {
        let mut noisy = |value: f64, deviation: f64| {
            let noise: f64 = StandardNormal.sample(&mut self.random);
            value + deviation * noise
        };
        Shown {
            radial_force_n: noisy(self.around.radial_force_n, self.p.force_noise_n),
            pressure_diff_pa: noisy(self.around.pressure_diff_pa, self.p.pressure_noise_pa),
            temperature_c: self.seal.shown_temperature_c(),
            load_torque_nm: self.acting.torque_nm,
        }
    }

    /// Simulates one period (s) with these duties, or with an open bridge (`None`).
    pub fn period(&mut self, period_s: f64, duty: Option<[f64; 3]>) {
        self.follow_surroundings(period_s);
        let mut duty = duty.filter(|_| !self.is_tripped);
        let currents = self.phase_currents_a();
        let mut near = self.comparators.filter(|watch| duty.is_some() && watch.is_near(currents));
        let steps =
            if near.is_some() { self.substeps.max(STEPS_PER_PERIOD) } else { self.substeps };
        let dt = period_s / steps as f64;
        (self.duty, self.period_s) = (duty, period_s);
        let constant = self.torque_constant_nm_per_a();
        for step in 0..steps {
            if let (Some(watch), Some(acting)) = (&mut near, duty) {
                let currents = self.phase_currents_a();
                self.peak_a = currents.iter().fold(self.peak_a, |most, a| most.max(a.abs()));
                if watch.step(dt, step as f64 * dt, period_s, acting, currents) {
                    watch.reset();
                    (self.is_tripped, duty) = (true, None);
                }
            }
            let turning_a = self.conduct(duty, period_s, dt);
            self.advance(constant * self.p.gear_ratio * turning_a, dt);
        }
        if near.is_some() {
            self.comparators = near;
        }
        self.recorded_s += period_s;
        let row = [self.recorded_s, self.magnetising_current_a(), self.torque_current_a()];
        if let Some(recorded) = &mut self.recorded {
            recorded.push(row);
        }
        self.heat(period_s);
    }

    /// Advances the thermal model.
    fn heat(&mut self, period_s: f64) {
        self.lost_s += period_s;
        if self.lost_s < HEAT_STEP_S {
            return;
        }
        if let Some(winding) = &mut self.winding {
            winding.step(&self.p, self.lost_j / self.lost_s, self.lost_s);
            self.step_s = 0.0;
        }
        (self.lost_j, self.lost_s) = (0.0, 0.0);
    }

    /// Sets side load, pressure and water temperature to those of the time after this period.
    fn follow_surroundings(&mut self, period_s: f64) {
        let Some(surroundings) = &self.surroundings else { return };
        self.elapsed_s += period_s;
        self.surroundings_due_s -= period_s;
        if self.surroundings_due_s > 0.0 {
            return;
        }
        self.surroundings_due_s += SURROUNDINGS_STEP_S;
        self.side_load_n = surroundings.side_load_n.at(self.elapsed_s).max(0.0);
        self.around.pressure_diff_pa = surroundings.pressure_pa.at(self.elapsed_s);
        let water_c = surroundings.water_c.at(self.elapsed_s);
        self.p.water_temperature_c = water_c;
        self.seal.set_water(water_c);
    }

    /// Simulates one period (s) with an ideal current loop at `current_a`.
    ///
    /// Gear and torque constant have their true values.
    pub fn period_at_current(&mut self, period_s: f64, current_a: f64) {
        self.follow_surroundings(period_s);
        let dt = period_s / self.substeps as f64;
        let constant = self.torque_constant_nm_per_a();
        for _ in 0..self.substeps {
            self.advance(constant * self.p.gear_ratio * current_a, dt);
        }
    }

    /// Integrates the mechanical motion by `dt` (s).
    fn advance(&mut self, motor_nm: f64, dt: f64) {
        if let Some(orders) = &mut self.orders {
            let turns = self.p.gear_ratio * self.p.pole_pairs;
            let position = self.rotor.map_or(self.position, |rotor| rotor.position);
            orders.add(turns * position, motor_nm, dt);
        }
        if self.held {
            return;
        }
        if let Some(velocity) = self.turned_rad_s {
            (self.velocity, self.position) = (velocity, self.position + dt * velocity);
            if let Some(rotor) = &mut self.rotor {
                (rotor.position, rotor.velocity) = (self.position + rotor.slipped, velocity);
            }
            return;
        }
        self.acting = self.load.act(&self.p, self.position, self.velocity, dt);
        self.acting.radial_force_n += self.side_load_n;
        self.around.radial_force_n = self.acting.radial_force_n;
        self.around.load_torque_nm = self.acting.torque_nm;
        let compensated = (self.cancelled * self.seal.torque_nm())
            .max(-(self.max_torque_nm + motor_nm).max(0.0))
            .min((self.max_torque_nm - motor_nm).max(0.0));
        let friction = self.seal.step(self.velocity, self.position, &self.around, dt);
        let driving = self.transmitted(motor_nm - self.cogging_nm(), dt);
        let hidden = self.hidden.as_ref().map_or(0.0, |joint| {
            joint.added(self.position, self.velocity, 0.0, &Conditions::default())
        });
        let torque = driving + compensated - friction - self.acting.torque_nm - hidden;
        let rotor_inertia = self.rotor.map_or(0.0, |_| self.rotor_inertia());
        self.velocity += dt * torque / (self.inertia - rotor_inertia);
        if let Some(brake) = &mut self.brake {
            let most = dt * brake.step(dt) / (self.inertia - rotor_inertia);
            self.velocity -= self.velocity.clamp(-most, most);
        }
        self.position += dt * self.velocity;
        if self.position > self.stop_rad {
            (self.position, self.velocity) = (self.stop_rad, self.velocity.min(0.0));
        }
    }

    /// Returns the rotor inertia in joint coordinates, kg m^2.
    fn rotor_inertia(&self) -> f64 {
        self.p.rotor_inertia_kg_m2 * self.p.gear_ratio * self.p.gear_ratio
    }

    /// Returns the cogging torque at the joint, Nm, positive against positive motion.
    fn cogging_nm(&self) -> f64 {
        let motor = self.motor_position_rad() * self.p.gear_ratio;
        if self.p.cogging_nm == 0.0 {
            return 0.0;
        }
        self.p.cogging_nm * self.p.gear_ratio * (self.p.cogging_periods * motor).sin()
    }

    /// Returns the motor torque that reaches the output, Nm.
    ///
    /// With a compliant coupling, it integrates the motion of motor and gear.
    fn transmitted(&mut self, motor_nm: f64, dt: f64) -> f64 {
        let inertia = self.rotor_inertia();
        let Some(rotor) = &mut self.rotor else { return motor_nm };
        let gear = Gear {
            stiffness_nm_per_rad: self.p.output_stiffness_nm_per_rad,
            damping_nm_s_per_rad: self.p.output_damping_nm_s_per_rad,
            play_rad: self.p.backlash_rad,
        };
        let twist = rotor.position - self.position - rotor.slipped;
        let coupled = gear.torque_nm(twist, rotor.velocity - self.velocity);
        let held = coupled.clamp(-rotor.most_nm, rotor.most_nm);
        if held != coupled {
            rotor.slipped += (coupled - held) / gear.stiffness_nm_per_rad;
        }
        rotor.velocity += dt * (motor_nm - held) / inertia;
        rotor.position += dt * rotor.velocity;
        held
    }
}

#[cfg(test)]
#[path = "machine_tests.rs"]
mod tests;
