//! Motor, bridge, shaft and load in motion: what a current loop is connected to.
//!
//! Winding currents are integrated in the stationary frame, exactly over a sub-step for constant voltage and
//! back-EMF; the bridge gives each phase its mean voltage less what the dead time takes, and open its diodes drive
//! the currents to 0. Gear and shaft are one inertia, unless the coupling between them is not rigid. Two sub-steps of semi-implicit Euler in a period of 50 us; a test holds
//! them against twenty.

use super::comparators::{Comparators, STEPS};
use super::load::{Acting, Load};
use super::parameters::Parameters;
use super::seal::{Around, Seal};
use super::supply::Supply;
use super::winding::Winding;
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use std::f64::consts::TAU;

/// After so many time constants `exp(-x)` is less than half of the last digit of 1.
const SETTLED_LAGS: f64 = 40.0;

/// Sub-steps of a period.
const SUBSTEPS: usize = 2;

/// Currents below this are not told apart by the dead time: the bridge's output is a ramp there, A.
const DEAD_TIME_RAMP_A: f64 = 0.1;

/// What a power stage and its encoder measure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// Currents of phases a, b, c, A, with noise, rounded to the converter's steps.
    pub currents_a: [f64; 3],
    /// Bus voltage, V.
    pub bus_v: f64,
    /// Encoder on the motor, counts of a turn.
    pub encoder: u32,
}

/// What sensors at the joint show, beside the drive's own.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shown {
    /// Side load, N.
    pub radial_force_n: f64,
    /// Pressure difference, Pa.
    pub pressure_diff_pa: f64,
    /// Housing beside the seal, deg C.
    pub temperature_c: f64,
    /// Torque on the load, Nm, as a model of the load knows it: without noise.
    pub load_torque_nm: f64,
}

/// The machine.
#[derive(Clone, Debug)]
pub struct JointPlant {
    p: Parameters,
    load: Load,
    seal: Seal,
    around: Around,
    acting: Acting,
    /// Currents along and across phase a, A.
    current: [f64; 2],
    position: f64,
    velocity: f64,
    inertia: f64,
    substeps: usize,
    /// Sub-step the next two are for, s; what a winding keeps of its current in it; its share of a new one, 1/ohm.
    step_s: f64,
    kept: f64,
    admittance: f64,
    /// Share of its own friction that an ideal actuator gives back: the perfect model.
    cancelled: f64,
    /// The most it and the motor give together, Nm.
    most_nm: f64,
    /// A stand holds the output.
    held: bool,
    /// Side load from elsewhere than the load, N.
    pushed_n: f64,
    /// Motor and gear, where the coupling to the output is not rigid.
    rotor: Option<Rotor>,
    supply: Option<Supply>,
    winding: Option<Winding>,
    comparators: Option<Comparators>,
    /// They have opened the bridge, and nobody has closed it since.
    broke: bool,
    /// Largest phase current of the steps they were asked in, A.
    peak_a: f64,
    /// Copper loss since the winding's last step, J, and the time, s.
    lost_j: f64,
    lost_s: f64,
    /// Duties of the period before: how long the low sides conducted before the sample.
    duty: Option<[f64; 3]>,
    period_s: f64,
    random: Pcg64,
}

/// Motor and gear behind a coupling, seen from the joint.
#[derive(Clone, Copy, Debug, Default)]
struct Rotor {
    position: f64,
    velocity: f64,
}

/// Steps of the winding's heat, s.
const HEAT_STEP_S: f64 = 1e-2;

impl JointPlant {
    /// A machine at rest with this load on it, under water; the seed draws its sensors' noise and where the
    /// eccentricity lies.
    pub fn new(p: &Parameters, load: Load, seed: u64) -> Self {
        let mut random = Pcg64::seed_from_u64(seed);
        let phase = [random.random_range(0.0..TAU), random.random_range(0.0..TAU)];
        Self::with_phase(p, load, phase, seed)
    }

    /// As [`JointPlant::new`], with a known angle of the eccentricity and the out-of-roundness, rad: the same
    /// machine again.
    pub fn with_phase(p: &Parameters, load: Load, phase_rad: [f64; 2], seed: u64) -> Self {
        let around = Around { pressure_diff_pa: p.pool_pressure_pa, ..Around::default() };
        let mut seal = Seal::new(p, phase_rad);
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
            rotor: (!rigid).then_some(Rotor { position, velocity: 0.0 }),
            supply: None,
            winding: None,
            comparators: None,
            broke: false,
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
            most_nm: f64::INFINITY,
            held: false,
            pushed_n: 0.0,
            random: Pcg64::seed_from_u64(seed ^ 0x5eed),
        }
    }

    /// Takes so many sub-steps a period.
    pub fn set_substeps(&mut self, substeps: usize) {
        self.substeps = substeps.max(1);
        self.step_s = 0.0;
    }

    /// Lets an ideal actuator give back this share of the friction, a sub-step late: what no model can beat. With the motor it
    /// gives so many Nm at most, as a driver whose current is limited.
    pub fn cancel_friction(&mut self, share: f64, most_nm: f64) {
        (self.cancelled, self.most_nm) = (share, most_nm);
    }

    /// A stand holds the output, or lets go of it.
    pub fn hold(&mut self, held: bool) {
        self.held = held;
    }

    /// A stand puts the output there (rad) and stops it.
    pub fn place(&mut self, position_rad: f64) {
        (self.position, self.velocity) = (position_rad, 0.0);
        if let Some(rotor) = &mut self.rotor {
            *rotor = Rotor { position: position_rad, velocity: 0.0 };
        }
    }

    /// Puts it on a capacitor with a supply that takes nothing back, in place of a stiff bus.
    pub fn charge_bus(&mut self) {
        self.supply = Some(Supply::of(&self.p));
    }

    /// The supply's voltage from now on, V: of a stiff bus, or what charges the capacitor.
    pub fn set_supply(&mut self, voltage_v: f64) {
        match &mut self.supply {
            Some(supply) => supply.set_v = voltage_v,
            None => self.p.bus_voltage_v = voltage_v,
        }
    }

    /// Bus voltage, V.
    pub fn bus_v(&self) -> f64 {
        self.supply.map_or(self.p.bus_voltage_v, |supply| supply.bus_v())
    }

    /// Puts overcurrent comparators at its shunts.
    pub fn watch_overcurrent(&mut self) {
        self.comparators = Some(Comparators::of(&self.p));
    }

    /// Whether they have opened the bridge. It stays open until [`JointPlant::forget_break`].
    pub fn overcurrent_broke(&self) -> bool {
        self.broke
    }

    /// The timer's break flag is cleared: the bridge may close again.
    pub fn forget_break(&mut self) {
        self.broke = false;
    }

    /// Largest phase current near the comparators' level since the last call, A; 0 where it never was.
    pub fn take_peak_a(&mut self) -> f64 {
        std::mem::take(&mut self.peak_a)
    }

    /// Lets the winding heat up, from the water's temperature.
    pub fn heat_winding(&mut self) {
        self.winding = Some(Winding::of(&self.p));
        self.step_s = 0.0;
    }

    /// Its temperatures, where it heats up.
    pub fn winding(&self) -> Option<&Winding> {
        self.winding.as_ref()
    }

    /// A side load from elsewhere than the load, N; it stays where the load puts none of its own.
    pub fn set_side_load(&mut self, radial_force_n: f64) {
        self.pushed_n = radial_force_n;
    }

    /// Currents that flow in phases a, b, c, A: without sensors.
    pub fn phase_currents_a(&self) -> [f64; 3] {
        phases(self.current)
    }

    /// Current that makes torque, A, positive towards positive position.
    pub fn torque_current_a(&self) -> f64 {
        let angle = self.p.gear_ratio * self.p.pole_pairs * self.motor_position_rad();
        let (sine, cosine) = angle.sin_cos();
        self.current[1] * cosine - self.current[0] * sine
    }

    /// Pressure from now on, Pa.
    pub fn set_pressure(&mut self, pressure_diff_pa: f64) {
        self.around.pressure_diff_pa = pressure_diff_pa;
    }

    /// The seal, to be warmed or worn.
    pub fn seal_mut(&mut self) -> &mut Seal {
        &mut self.seal
    }

    /// The seal.
    pub fn seal(&self) -> &Seal {
        &self.seal
    }

    /// The load.
    pub fn load(&self) -> &Load {
        &self.load
    }

    /// Joint position, rad.
    pub fn position_rad(&self) -> f64 {
        self.position
    }

    /// Joint velocity, rad/s.
    pub fn velocity_rad_s(&self) -> f64 {
        self.velocity
    }

    /// What acts on the seal.
    pub fn around(&self) -> Around {
        self.around
    }

    /// Inertia at the joint, kg m^2.
    pub fn inertia_kg_m2(&self) -> f64 {
        self.inertia
    }

    /// Position of motor and gear, rad of the joint.
    fn motor_position_rad(&self) -> f64 {
        self.rotor.map_or(self.position, |rotor| rotor.position)
    }

    /// How far the encoder will have turned in so many seconds, turns of the motor.
    pub fn motor_turns_in(&self, seconds: f64) -> f64 {
        let velocity = self.rotor.map_or(self.velocity, |rotor| rotor.velocity);
        self.p.encoder_direction * velocity * self.p.gear_ratio * seconds / TAU
    }

    /// What its stage measures now.
    pub fn measure(&mut self) -> Measured {
        let phases = self.phase_currents_a();
        let shown: [f64; 3] = std::array::from_fn(|phase| self.settled(phase));
        let step = self.p.current_step_a;
        let mut currents_a = [0.0; 3];
        for ((measured, current), shown) in currents_a.iter_mut().zip(phases).zip(shown) {
            let noise: f64 = StandardNormal.sample(&mut self.random);
            *measured = ((current * shown + self.p.current_noise_a * noise) / step).round() * step;
        }
        let motor = self.motor_position_rad() * self.p.gear_ratio;
        let off = match self.p.magnet_eccentricity_rad {
            0.0 => 0.0,
            eccentricity => eccentricity * motor.sin(),
        };
        let seen = motor + off;
        let turns = (self.p.encoder_direction * seen + self.p.encoder_zero_rad) / TAU;
        let encoder = ((turns - turns.floor()) * self.p.encoder_counts) as u32;
        Measured { currents_a, bus_v: self.bus_v(), encoder }
    }

    /// Share of its current that a low side's shunt amplifier shows at the top: it has half of the period less the duty's
    /// share, and the dead time, to come from nothing. With the bridge open nothing switches.
    fn settled(&self, phase: usize) -> f64 {
        let Some(duty) = self.duty else { return 1.0 };
        let conducted = 0.5 * (1.0 - duty[phase]) * self.period_s - self.p.dead_time_s;
        // No lag: sensors in the phases. What is missing after so many is not seen beside 1 in double precision.
        if conducted >= SETTLED_LAGS * self.p.shunt_lag_s {
            1.0
        } else {
            1.0 - (-conducted.max(0.0) / self.p.shunt_lag_s).exp()
        }
    }

    /// What the joint's other sensors show now.
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

    /// One period (s) under these duties, or with the bridge open.
    pub fn period(&mut self, period_s: f64, duty: Option<[f64; 3]>) {
        let mut duty = duty.filter(|_| !self.broke);
        let currents = self.phase_currents_a();
        let mut near = self.comparators.filter(|watch| duty.is_some() && watch.is_near(currents));
        let steps = if near.is_some() { self.substeps.max(STEPS) } else { self.substeps };
        let dt = period_s / steps as f64;
        if self.step_s != dt {
            let resistance = self.resistance_ohm();
            let decay = resistance / self.p.phase_inductance_h * dt;
            (self.step_s, self.kept) = (dt, (-decay).exp());
            self.admittance = (1.0 - self.kept) / resistance;
        }
        (self.duty, self.period_s) = (duty, period_s);
        let poles = self.p.gear_ratio * self.p.pole_pairs;
        let constant = self.p.motor_torque_constant_nm_per_a * (1.0 + self.p.torque_constant_error);
        let flux = constant / (1.5 * self.p.pole_pairs);
        for step in 0..steps {
            if let (Some(watch), Some(acting)) = (&mut near, duty) {
                let currents = self.phase_currents_a();
                self.peak_a = currents.iter().fold(self.peak_a, |most, a| most.max(a.abs()));
                if watch.step(dt, step as f64 * dt, period_s, acting, currents) {
                    watch.forget();
                    (self.broke, duty) = (true, None);
                }
            }
            // Half a sub-step on: the field turns under the voltage.
            let turned =
                self.rotor.unwrap_or(Rotor { position: self.position, velocity: self.velocity });
            let angle = poles * (turned.position + 0.5 * dt * turned.velocity);
            let (sine, cosine) = angle.sin_cos();
            let induced = flux * poles * turned.velocity;
            let induced = [induced * sine, -induced * cosine];
            let voltage = match duty {
                Some(duty) => self.voltage(period_s, duty),
                None => self.open_voltage(induced),
            };
            let [along, across] = self.current;
            self.lost_j += 1.5 * self.resistance_ohm() * (along * along + across * across) * dt;
            self.current = [
                self.kept * along + self.admittance * (voltage[0] + induced[0]),
                self.kept * across + self.admittance * (voltage[1] + induced[1]),
            ];
            if let Some(supply) = &mut self.supply {
                // The mean current of the sub-step: at 8 rad/s the vector turns by 4 degrees in 25 us. With the one before,
                // braking from there with 26 A took the bus to 55.5 V; with steps of a microsecond it is 52.3, with this 52.2.
                let [along, across] =
                    [0, 1].map(|axis| 0.5 * ([along, across][axis] + self.current[axis]));
                let power_w = 1.5 * (voltage[0] * along + voltage[1] * across);
                supply.step(power_w / supply.bus_v().max(1.0), dt);
            }
            let turning = self.current[1] * cosine - self.current[0] * sine;
            self.move_on(constant * self.p.gear_ratio * turning, dt);
        }
        if near.is_some() {
            self.comparators = near;
        }
        self.heat(period_s);
    }

    /// Resistance of a phase as warm as it is, ohm.
    fn resistance_ohm(&self) -> f64 {
        let gain = self.winding.map_or(1.0, |winding| winding.resistance_gain(&self.p));
        self.p.phase_resistance_ohm * gain
    }

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

    /// One period (s) with an ideal current loop that makes so many ampere, gear and magnet as they are.
    pub fn period_at_current(&mut self, period_s: f64, current_a: f64) {
        let dt = period_s / self.substeps as f64;
        let constant = self.p.motor_torque_constant_nm_per_a * (1.0 + self.p.torque_constant_error);
        for _ in 0..self.substeps {
            self.move_on(constant * self.p.gear_ratio * current_a, dt);
        }
    }

    /// Mean voltage of the driving bridge along and across phase a, V.
    fn voltage(&self, period_s: f64, duty: [f64; 3]) -> [f64; 2] {
        let currents = self.phase_currents_a();
        let bus = self.bus_v();
        let lost = bus * self.p.dead_time_s / period_s;
        let ramp = |current: f64| (current / DEAD_TIME_RAMP_A).clamp(-1.0, 1.0);
        vector(std::array::from_fn(|phase| {
            // A half bridge that does not switch has no dead time.
            let switches = 0.0 < duty[phase] && duty[phase] < 1.0;
            let lost = if switches { lost } else { 0.0 };
            duty[phase] * bus - lost * ramp(currents[phase])
        }))
    }

    /// The same of an open bridge: its diodes put half the bus against every current, and block once it is 0. What would
    /// end the currents in this sub-step is what they do, where they can.
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

    fn move_on(&mut self, motor_nm: f64, dt: f64) {
        if self.held {
            return;
        }
        self.acting = self.load.act(&self.p, self.position, self.velocity, dt);
        self.acting.radial_force_n += self.pushed_n;
        self.around.radial_force_n = self.acting.radial_force_n;
        self.around.load_torque_nm = self.acting.torque_nm;
        let given_back = (self.cancelled * self.seal.torque_nm())
            .max(-(self.most_nm + motor_nm).max(0.0))
            .min((self.most_nm - motor_nm).max(0.0));
        let friction = self.seal.step(self.velocity, self.position, &self.around, dt);
        let driving = self.transmitted(motor_nm - self.cogging_nm(), dt);
        let torque = driving + given_back - friction - self.acting.torque_nm;
        let own = self.rotor.map_or(0.0, |_| self.rotor_inertia());
        self.velocity += dt * torque / (self.inertia - own);
        self.position += dt * self.velocity;
    }

    fn rotor_inertia(&self) -> f64 {
        self.p.rotor_inertia_kg_m2 * self.p.gear_ratio * self.p.gear_ratio
    }

    /// Cogging, Nm at the joint, positive against positive motion.
    fn cogging_nm(&self) -> f64 {
        let motor = self.motor_position_rad() * self.p.gear_ratio;
        if self.p.cogging_nm == 0.0 {
            return 0.0;
        }
        self.p.cogging_nm * self.p.gear_ratio * (self.p.cogging_periods * motor).sin()
    }

    /// What of the motor's torque reaches the output, Nm; motor and gear move on where they are not one with it.
    fn transmitted(&mut self, motor_nm: f64, dt: f64) -> f64 {
        let inertia = self.rotor_inertia();
        let Some(rotor) = &mut self.rotor else { return motor_nm };
        let twist = rotor.position - self.position;
        let half = 0.5 * self.p.backlash_rad;
        let strained = twist - twist.clamp(-half, half);
        let coupled = if strained == 0.0 {
            0.0
        } else {
            self.p.output_stiffness_nm_per_rad * strained
                + self.p.output_damping_nm_s_per_rad * (rotor.velocity - self.velocity)
        };
        rotor.velocity += dt * (motor_nm - coupled) / inertia;
        rotor.position += dt * rotor.velocity;
        coupled
    }
}

/// A vector along and across phase a, of phases a, b, c.
fn vector([a, b, c]: [f64; 3]) -> [f64; 2] {
    [(2.0 * a - b - c) / 3.0, (b - c) / 3f64.sqrt()]
}

/// Phases a, b, c of a vector along and across phase a.
fn phases([along, across]: [f64; 2]) -> [f64; 3] {
    let root = 0.75f64.sqrt();
    [along, -0.5 * along + root * across, -0.5 * along - root * across]
}

#[cfg(test)]
#[path = "machine_tests.rs"]
mod tests;
