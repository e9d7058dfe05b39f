//! A joint with an encoder on either side of its gear: motor, gear with play and torsional stiffness, and load.
//!
//! Motor and load are two bodies. The gear transmits a torque only when one of its flanks is in contact, and then it is a spring
//! with damping. The friction of the load lies behind the gear, that of the motor before it. The encoder of the load has the
//! errors of a real one. Angles, torques and inertias are those of the joint's side.

mod drawn;

pub use drawn::{GearFault, draw};

use rand::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use simulated_machines::LoggedRun;
use simulated_machines::effects::Wave;
use simulated_machines::joint_plant::Gear;
/// Integration step, s: a fortieth of the period of the fastest drawn gear.
const STEP_S: f64 = 2.5e-5;

/// Bristle friction (Canudas de Wit et al. 1995) with its state as a deflection.
#[derive(Clone, Copy, Debug, Default)]
pub struct SideFriction {
    /// Coulomb torque, Nm.
    pub coulomb_nm: f64,
    /// Torque above Coulomb's at breakaway, Nm.
    pub excess_nm: f64,
    /// Speed at which the excess has fallen to 1/e, rad/s.
    pub stribeck_rad_s: f64,
    /// Viscous coefficient, Nms/rad.
    pub viscous_nms: f64,
    /// Travel of the bristles, rad.
    pub travel_rad: f64,
}

impl SideFriction {
    /// Advances the deflection, rad, and returns the torque, Nm.
    fn torque(&self, deflection_rad: &mut f64, speed: f64) -> f64 {
        if self.coulomb_nm <= 0.0 {
            return self.viscous_nms * speed;
        }
        let level =
            self.coulomb_nm + self.excess_nm * (-(speed / self.stribeck_rad_s).powi(2)).exp();
        let stiffness = self.coulomb_nm / self.travel_rad;
        let slip = STEP_S * speed.abs() * stiffness / level;
        *deflection_rad = (*deflection_rad + STEP_S * speed) / (1.0 + slip);
        stiffness * *deflection_rad + self.viscous_nms * speed
    }
}

/// Errors of the encoder at the joint's side.
#[derive(Clone, Copy, Debug, Default)]
pub struct JointEncoder {
    /// Step, rad.
    pub step_rad: f64,
    /// Standard deviation of the noise, rad.
    pub noise_rad: f64,
    /// Angle at the zero of the other encoder, rad.
    pub offset_rad: f64,
    /// Wave of one turn, rad.
    pub eccentricity: Wave,
    /// Harmonic of the turn, rad.
    pub harmonic: Wave,
    /// Error of the scale: 0.001 is 0.1 %.
    pub gain_error: f64,
    /// Delay of its sample, s.
    pub late_s: f64,
    /// Drift with the temperature, rad/K.
    pub drift_rad_per_k: f64,
}

/// A joint with two encoders; see the module documentation.
#[derive(Clone, Debug)]
pub struct TwoSidedJoint {
    /// The gear, with its stiffness under load.
    pub gear: Gear,
    /// Share by which the stiffness is lower without load, 0 to 1.
    pub softness: f64,
    /// Inertia of the motor and of the load, kg m^2.
    pub inertias: [f64; 2],
    /// Friction of the motor and of the load.
    pub frictions: [SideFriction; 2],
    /// Torque of gravity, Nm.
    pub gravity: Wave,
    /// Encoder of the load.
    pub encoder: JointEncoder,
    /// Step of the motor's encoder, rad.
    pub motor_step_rad: f64,
    /// Standard deviation of the torque's noise, Nm.
    pub torque_noise_nm: f64,
    /// Torque ripple of the motor, Nm.
    pub torque_ripple: Wave,
    /// Bandwidth of the position loop, rad/s.
    pub bandwidth_rad_s: f64,
    /// Sample rate of the log, Hz.
    pub rate_hz: f64,
    /// Length of a run, s.
    pub seconds: f64,
    /// Rise of the temperature over a run, K.
    pub warming_k: f64,
    /// Whether the temperature is logged.
    pub logs_temperature: bool,
    /// Waves of the demanded angle of each run.
    pub motions: Vec<Vec<AngleWave>>,
}

/// A wave of the demanded angle over time.
#[derive(Clone, Copy, Debug)]
pub struct AngleWave {
    /// Amplitude, rad.
    pub size_rad: f64,
    /// Angular frequency, rad/s.
    pub rad_s: f64,
    /// Phase at the start, rad.
    pub phase: f64,
}

impl AngleWave {
    /// Returns the angle, rad, and its rate, rad/s, at a time, s.
    fn at(&self, time: f64) -> [f64; 2] {
        let (sine, cosine) =
            ((self.rad_s * time + self.phase).sin(), (self.rad_s * time + self.phase).cos());
        [self.size_rad * sine, self.size_rad * self.rad_s * cosine]
    }
}

/// State of a joint.
#[derive(Clone, Copy, Debug, Default)]
struct State {
    angle: [f64; 2],
    speed: [f64; 2],
    deflection: [f64; 2],
}

impl TwoSidedJoint {
    /// Names of the logged columns.
    pub fn columns(&self) -> Vec<&'static str> {
        let all = ["time_s", "position_rad", "velocity_rad_s", "torque_nm", "joint_position_rad"];
        all.into_iter().chain(self.logs_temperature.then_some("temperature_c")).collect()
    }

    /// Simulates the runs and returns their columns, in the order of [`Self::columns`].
    pub fn record(&self, seed: u64) -> Vec<LoggedRun> {
        let run = |(index, motion): (usize, &Vec<AngleWave>)| {
            let mut random = Pcg64::seed_from_u64(seed.wrapping_mul(1009) + index as u64);
            LoggedRun { name: index.to_string(), columns: self.run(motion, index, &mut random) }
        };
        self.motions.iter().enumerate().map(run).collect()
    }

    /// Returns the torque of the gear on the load, Nm.
    fn gear_torque(&self, state: &State) -> f64 {
        let twist = state.angle[0] - state.angle[1];
        let strain = self.gear.strain_rad(twist);
        // The stiffness rises with the load, up to its nominal value.
        let knee = self.frictions[1].coulomb_nm / self.gear.stiffness_nm_per_rad;
        let share = 1.0 - self.softness * (-strain.abs() / knee.max(1e-12)).exp();
        let stiffness_nm_per_rad = self.gear.stiffness_nm_per_rad * share;
        let gear = Gear { stiffness_nm_per_rad, ..self.gear };
        let torque = gear.torque_nm(twist, state.speed[0] - state.speed[1]);
        // Flanks push and do not pull.
        if torque * strain > 0.0 { torque } else { 0.0 }
    }

    fn run(&self, motion: &[AngleWave], index: usize, random: &mut Pcg64) -> Vec<Vec<f64>> {
        let mut columns = vec![Vec::new(); self.columns().len()];
        let steps_per_row = (1.0 / (self.rate_hz * STEP_S)).round() as usize;
        let steps_per_cycle = (1e-3 / STEP_S).round() as usize;
        let rows = (self.seconds * self.rate_hz) as usize;
        let inertia: f64 = self.inertias.iter().sum();
        let (kp, kd) =
            (inertia * self.bandwidth_rad_s.powi(2), 2.0 * inertia * self.bandwidth_rad_s);
        let demand = |time: f64| {
            motion
                .iter()
                .map(|wave| wave.at(time))
                .fold([0.0; 2], |[q, v], [dq, dv]| [q + dq, v + dv])
        };
        let late_steps = (self.encoder.late_s / STEP_S).round() as usize;
        let mut past = vec![0.0; late_steps + 1];
        let mut state = State { angle: [demand(0.0)[0]; 2], ..State::default() };
        past.fill(state.angle[1]);
        let (mut torque, mut read_speed) = (0.0, 0.0);
        let mut before = state.angle[0];
        for step in 0..rows * steps_per_row {
            let time = step as f64 * STEP_S;
            if step % steps_per_cycle == 0 {
                let read = rounded(state.angle[0], self.motor_step_rad);
                // The speed of the drive: a difference of its encoder through a low-pass of 2 ms.
                read_speed += ((read - before) / 1e-3 - read_speed) / 3.0;
                before = read;
                let [q, v] = demand(time);
                torque = kp * (q - read) + kd * (v - read_speed);
            }
            if step % steps_per_row == 0 {
                let angle = past[step % past.len()];
                let warmth = self.warming_k * (index as f64 + time / self.seconds);
                let noise = |random: &mut Pcg64| -> f64 { StandardNormal.sample(random) };
                let values = [
                    time,
                    rounded(state.angle[0], self.motor_step_rad),
                    read_speed,
                    torque + self.torque_noise_nm * noise(random),
                    self.encoder.read(angle, warmth, noise(random)),
                    20.0 + warmth,
                ];
                columns.iter_mut().zip(values).for_each(|(column, value)| column.push(value));
            }
            self.advance(&mut state, torque);
            let place = (step + 1) % past.len();
            past[place] = state.angle[1];
        }
        columns
    }

    /// Advances the state by a step: first the speeds, then the angles.
    fn advance(&self, state: &mut State, torque: f64) {
        let gear = self.gear_torque(state);
        let [motor, load] = self.frictions;
        let driven = torque + self.torque_ripple.at(state.angle[0]);
        let forces = [
            driven - gear - motor.torque(&mut state.deflection[0], state.speed[0]),
            gear - load.torque(&mut state.deflection[1], state.speed[1])
                - self.gravity.at(state.angle[1]),
        ];
        for (body, force) in forces.iter().enumerate() {
            state.speed[body] += STEP_S * force / self.inertias[body];
            state.angle[body] += STEP_S * state.speed[body];
        }
    }
}

impl JointEncoder {
    /// Returns the reading at an angle, with a temperature above the first and a standard normal number.
    fn read(&self, angle: f64, warmth_k: f64, noise: f64) -> f64 {
        let error = self.eccentricity.at(angle) + self.harmonic.at(angle);
        let scaled = angle * (1.0 + self.gain_error) + self.offset_rad;
        let drift = self.drift_rad_per_k * warmth_k;
        rounded(scaled + error + drift + self.noise_rad * noise, self.step_rad)
    }
}

fn rounded(value: f64, step: f64) -> f64 {
    if step > 0.0 { (value / step).round() * step } else { value }
}
