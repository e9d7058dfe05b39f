//! The paper's pool tests as logs: velocity tracking, low speed and impact.
//!
//! The plant is the one of `host-sim paper underwater-joint` ([`crate::joint_plant`]) with a simple velocity loop at
//! 1 kHz. The loop has feed-forward of inertia and weight, an ideal current loop, and no friction compensation. Depth and
//! temperature differ between runs.
//!
//! `torque_nm` is the total drive torque computed from the measured current, so the logs need `--rigid-body inertia,load`.

use crate::joint_plant::load::{JUMP_FROM_RAD, LIFT_FROM_RAD};
use crate::joint_plant::parameters::PHASE_RAD;
use crate::joint_plant::{JointPlant, Load, Parameters};
use crate::log::{JOINT_COLUMNS, Log, LoggedRun};
use crate::simulation::{Request, Simulated, Simulation, SimulationError};
use rand::{RngExt, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use rand_pcg::Pcg64;
use std::f64::consts::TAU;

/// Periods of the velocity loop and of the plant, s.
const LOOP_S: f64 = 1e-3;
const PERIOD_S: f64 = 50e-6;
/// Crossover of the velocity loop, Hz, and its integral time, s.
const VELOCITY_HZ: f64 = 4.0;
const INTEGRAL_S: f64 = 0.5;
/// Maximum current, A.
const MAX_CURRENT_A: f64 = 26.0;
/// Pause between two runs in campaign time, s.
const PAUSE_S: f64 = 60.0;
/// Maximum number of rows of all runs.
const MAX_ROWS: f64 = 2e7;

/// Pool test: 65 to 95 rpm with a propeller.
pub const VELOCITY_TRACKING: Simulation = Simulation {
    name: "velocity-tracking",
    about: "Pool test: 65 to 95 rpm against a propeller, the whole drive torque",
    run: |request| {
        let velocity = |t: f64| {
            let rpm = 80.0 + 15.0 * (TAU * t / 5.0).sin();
            rpm * TAU / 60.0 * (t / 0.5).min(1.0)
        };
        let load = |_: &Parameters| Load::Propeller;
        Test { scenario: VELOCITY_TRACKING.name, load, seconds: 25.0, velocity }.simulate(request)
    },
};

/// Pool test: lifting and lowering 2 kg at 6.6 rpm.
pub const LOW_SPEED: Simulation = Simulation {
    name: "low-speed",
    about: "Pool test: 6.6 rpm, lifting 2 kg and letting it down, the whole drive torque",
    run: |request| {
        let velocity = |t: f64| {
            let speed = 6.6 * TAU / 60.0;
            let stroke = -2.0 * LIFT_FROM_RAD / speed;
            if ((t / stroke) as u64).is_multiple_of(2) { speed } else { -speed }
        };
        let load = |_: &Parameters| Load::Leg;
        Test { scenario: LOW_SPEED.name, load, seconds: 15.0, velocity }.simulate(request)
    },
};

/// Pool test: a platform that jumps and lands.
pub const IMPACT: Simulation = Simulation {
    name: "impact",
    about: "Pool test: a leg that jumps with its platform and lands, the whole drive torque",
    run: |request| {
        // Up by 1.2 rad in 0.3 s, then slowly down. One jump every two seconds.
        let velocity = |t: f64| {
            let now = t % 2.0;
            let stroke = 1.0 - JUMP_FROM_RAD;
            match now {
                now if now < 0.3 => stroke / 0.3 * (1.0 - (TAU * now / 0.3).cos()),
                now if (0.8..1.8).contains(&now) => -stroke * (1.0 - (TAU * (now - 0.8)).cos()),
                _ => 0.0,
            }
        };
        Test { scenario: IMPACT.name, load: Load::jump, seconds: 10.0, velocity }.simulate(request)
    },
};

/// Definition of a pool test.
struct Test {
    scenario: &'static str,
    load: fn(&Parameters) -> Load,
    seconds: f64,
    /// Reference velocity at a time, rad/s.
    velocity: fn(f64) -> f64,
}

impl Test {
    /// Simulates all runs of the test.
    fn simulate(&self, request: &Request) -> Result<Simulated, SimulationError> {
        request.refuse_effects()?;
        let rate_hz = request.rate_hz.unwrap_or(500.0);
        let every = (1.0 / (rate_hz * LOOP_S)).round();
        if !(every >= 1.0 && (every * rate_hz * LOOP_S - 1.0).abs() < 1e-6) {
            let expected = "1000 Hz divided by an integer".to_owned();
            return Err(SimulationError::Value { option: "--rate", found: rate_hz, expected });
        }
        let (runs, seconds) = (request.runs.unwrap_or(6), request.seconds.unwrap_or(self.seconds));
        if runs as f64 * seconds * rate_hz > MAX_ROWS {
            return Err(SimulationError::TooManyRows { most: MAX_ROWS });
        }
        let p = Parameters::default();
        let nominal_nm_per_a = p.motor_torque_constant_nm_per_a * p.gear_ratio;
        let noise_a =
            request.noise_nm.map_or(p.current_noise_a, |noise_nm| noise_nm / nominal_nm_per_a);
        let runs = (0..runs).map(|run| {
            let seed = request.seed.wrapping_mul(1000).wrapping_add(run as u64);
            let start_s = run as f64 * (seconds + PAUSE_S);
            let columns = self.run(&p, seed, start_s, seconds, every as usize, noise_a);
            LoggedRun { name: run.to_string(), columns }
        });
        let log = Log { columns: JOINT_COLUMNS.map(str::to_owned).to_vec(), runs: runs.collect() };
        let truth = p.truth(self.scenario, request.seed);
        Ok(Simulated { log, truth, hidden: Vec::new() })
    }

    /// Simulates a run and returns its columns, with one row per `every` periods of the velocity loop.
    fn run(
        &self,
        p: &Parameters,
        seed: u64,
        start_s: f64,
        seconds: f64,
        every: usize,
        noise_a: f64,
    ) -> Vec<Vec<f64>> {
        let mut random = Pcg64::seed_from_u64(seed);
        let mut plant = JointPlant::with_phase(p, (self.load)(p), PHASE_RAD, seed);
        // Depth from 0 to 25 m, within the rated depth.
        plant.around.pressure_diff_pa = random.random_range(0.0..0.25e6);
        plant.seal.set_temperature(random.random_range(10.0..26.0));
        let inertia = plant.inertia_kg_m2();
        let gain = inertia * TAU * VELOCITY_HZ;
        let mut integral = 0.0;
        let mut columns = vec![Vec::new(); JOINT_COLUMNS.len()];
        for step in 0..(seconds / LOOP_S) as usize {
            let t = step as f64 * LOOP_S;
            let reference = (self.velocity)(t);
            let acceleration = ((self.velocity)(t + LOOP_S) - reference) / LOOP_S;
            let error = reference - plant.velocity_rad_s();
            let feed_forward =
                inertia * acceleration.clamp(-80.0, 80.0) + plant.around.load_torque_nm;
            let current = feed_forward + gain * error + integral;
            if current.abs() < MAX_CURRENT_A {
                integral += gain * error * LOOP_S / INTEGRAL_S;
            }
            let current = current.clamp(-MAX_CURRENT_A, MAX_CURRENT_A);
            if step.is_multiple_of(every) {
                let shown = plant.show();
                let noise: f64 = StandardNormal.sample(&mut random);
                let nominal = p.motor_torque_constant_nm_per_a * p.gear_ratio;
                let values = [
                    start_s + t,
                    plant.velocity_rad_s(),
                    nominal * (current + noise_a * noise),
                    plant.position_rad(),
                    shown.radial_force_n,
                    shown.pressure_diff_pa,
                    shown.temperature_c,
                    shown.load_torque_nm,
                ];
                columns.iter_mut().zip(values).for_each(|(column, value)| column.push(value));
            }
            let periods = (LOOP_S / PERIOD_S).round() as usize;
            (0..periods).for_each(|_| plant.period_at_current(PERIOD_S, current));
        }
        columns
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn column<'a>(log: &'a Log, run: usize, name: &str) -> &'a [f64] {
        log.column(&log.runs[run], name).expect("a column of that name")
    }

    #[test]
    fn simulate_of_each_pool_test_has_its_motion_and_load() {
        let request = Request { runs: Some(1), ..Request::default() };
        let of = |test: Simulation| test.simulate(&request).expect("a log").log;
        let tracking = of(VELOCITY_TRACKING);
        let late = &column(&tracking, 0, "velocity_rad_s")[1000..];
        let rpm = TAU / 60.0;
        let (least, most) =
            late.iter().fold((f64::MAX, f64::MIN), |(a, b), v| (a.min(*v), b.max(*v)));
        assert!((least / rpm - 65.0).abs() < 2.0 && (most / rpm - 95.0).abs() < 2.0);
        let low = of(LOW_SPEED);
        let torque = column(&low, 0, "torque_nm");
        assert!(
            torque.iter().copied().fold(f64::MIN, f64::max) > 7.0,
            "the load of 5.9 Nm and the friction"
        );
        let jump = of(IMPACT);
        let force = column(&jump, 0, "radial_force_n");
        assert!(
            force.iter().any(|f| *f < 1.0) && force.iter().any(|f| *f > 60.0),
            "the platform leaves the ground"
        );
        assert_eq!(of(LOW_SPEED), low, "the same seed gives the same log");
    }

    #[test]
    fn simulate_with_unsupported_option_returns_error() {
        let rate = Request { rate_hz: Some(300.0), ..Request::default() };
        assert!(IMPACT.simulate(&rate).unwrap_err().to_string().contains("1000 Hz"));
        let unloaded = Request { unloaded: true, ..Request::default() };
        assert!(IMPACT.simulate(&unloaded).unwrap_err().to_string().contains("--unloaded"));
    }
}
