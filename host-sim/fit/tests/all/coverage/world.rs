//! Simulated joints with known parameters, integrated apart from the core: LuGre with the exact exponential in the bristle
//! deflection, by Runge and Kutta's method of fourth order in steps far below the bristle's time constant.

use compensator_core::ParameterId as Id;
use joint_log::Dataset;
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use std::f64::consts::{PI, TAU};

/// Largest step of the integrator, in time constants of the bristle.
const MAX_STEP_TIME_CONSTANTS: f64 = 0.1;

/// Largest step of the integrator, s.
const MAX_STEP_S: f64 = 2e-4;

/// Runs of a log. Each has another motion.
const RUNS: usize = 6;

/// Duration of a run, s.
const RUN_S: f64 = 8.0;

/// Parameters of a joint.
#[derive(Clone, Copy, Debug)]
pub struct Joint {
    pub coulomb: f64,
    pub static_torque: f64,
    pub stribeck_velocity: f64,
    pub stiffness: f64,
    pub damping: f64,
    pub viscous: f64,
}

impl Joint {
    /// Returns the true value of a parameter of the law.
    pub fn value(&self, id: Id) -> f64 {
        match id {
            Id::CoulombTorque => self.coulomb,
            Id::StaticTorque => self.static_torque,
            Id::StribeckVelocity => self.stribeck_velocity,
            Id::BristleStiffness => self.stiffness,
            Id::BristleDamping => self.damping,
            Id::ViscousFriction => self.viscous,
            _ => panic!("{} is not a parameter of LuGre", id.name()),
        }
    }

    fn level(&self, velocity: f64) -> f64 {
        let relative = velocity / self.stribeck_velocity;
        self.coulomb + (self.static_torque - self.coulomb) * (-relative * relative).exp()
    }

    /// Speed of the deflection `z`, rad/s.
    fn rate(&self, velocity: f64, z: f64) -> f64 {
        velocity - self.stiffness * velocity.abs() / self.level(velocity) * z
    }
}

/// A motion: sums of sines, of which some rows are at rest.
struct Motion {
    /// Amplitude, rad/s; frequency, Hz; phase, rad.
    waves: Vec<[f64; 3]>,
    /// Duration of a stop and of the motion before it, s; `None` without stops.
    stops_s: Option<[f64; 2]>,
}

impl Motion {
    fn velocity(&self, time: f64) -> f64 {
        let wave = |[size, hertz, phase]: &[f64; 3]| size * (TAU * hertz * time + phase).sin();
        // Starts at rest, so that the first rows show what the bristles hold.
        let ramp = (time / 0.4).min(1.0);
        let start = ramp * ramp * (3.0 - 2.0 * ramp);
        let gate = self.stops_s.map_or(1.0, |[stop, go]| {
            let phase = time % (stop + go);
            if phase < go { (PI * phase / go).sin().powi(2) } else { 0.0 }
        });
        start * gate * self.waves.iter().map(wave).sum::<f64>()
    }
}

/// A log with its truth.
pub struct World {
    pub joint: Joint,
    pub data: Dataset,
}

struct Random(Pcg64);

impl Random {
    fn between(&mut self, least: f64, most: f64) -> f64 {
        self.0.random_range(least..most)
    }

    fn logarithmic(&mut self, least: f64, most: f64) -> f64 {
        self.between(least.ln(), most.ln()).exp()
    }

    /// Box and Muller's method.
    fn normal(&mut self) -> f64 {
        let size = (-2.0 * self.between(f64::MIN_POSITIVE, 1.0).ln()).sqrt();
        size * (TAU * self.between(0.0, 1.0)).cos()
    }
}

impl World {
    /// Draws a world.
    pub fn draw(seed: u64) -> Self {
        let random = &mut Random(Pcg64::seed_from_u64(seed));
        let rate_hz = random.logarithmic(200.0, 1000.0).round();
        let speed = random.logarithmic(0.5, 2.0);
        let coulomb = random.logarithmic(0.5, 8.0);
        let deflection = random.logarithmic(3e-4, 5e-3);
        let stiffness = coulomb / deflection;
        let joint = Joint {
            coulomb,
            static_torque: coulomb * random.between(1.15, 1.8),
            stribeck_velocity: speed * random.logarithmic(0.05, 0.25),
            stiffness,
            // A share of the damping whose time constant is 10 ms.
            damping: stiffness * 1e-2 * random.logarithmic(0.1, 1.0),
            viscous: coulomb / speed * random.between(0.05, 0.5),
        };
        let noise_nm = coulomb * random.logarithmic(3e-3, 3e-2);
        Self::with_motions(joint, speed, rate_hz, noise_nm, random)
    }

    /// Simulates a joint with drawn motions of this speed, rad/s, and white noise, Nm.
    pub fn of(joint: Joint, speed: f64, rate_hz: f64, noise_nm: f64, seed: u64) -> Self {
        let random = &mut Random(Pcg64::seed_from_u64(seed));
        Self::with_motions(joint, speed, rate_hz, noise_nm, random)
    }

    fn with_motions(
        joint: Joint,
        speed: f64,
        rate_hz: f64,
        noise_nm: f64,
        random: &mut Random,
    ) -> Self {
        let runs = (0..RUNS).map(|run| {
            let motion = draw_motion(run, speed, joint.coulomb / joint.stiffness, random);
            let [time, velocity, torque] = simulate(&joint, &motion, rate_hz);
            let torque = torque.iter().map(|t| t + noise_nm * random.normal()).collect();
            (run.to_string(), vec![time, velocity, torque])
        });
        let names = ["time_s", "velocity_rad_s", "torque_nm"].map(str::to_owned);
        let data = Dataset::from_columns(&names, runs.collect::<Vec<_>>()).expect("columns");
        Self { joint, data }
    }
}

/// Draws the motion of a run: presliding, slow and fast reversals, mixtures, and stop and go.
fn draw_motion(run: usize, speed: f64, deflection: f64, random: &mut Random) -> Motion {
    let mut wave = |size: f64, least: f64, most: f64| {
        [size, random.logarithmic(least, most), random.between(0.0, TAU)]
    };
    match run % 3 {
        0 => {
            let hertz = wave(1.0, 0.5, 3.0)[1];
            // Travels a few deflections to either side.
            let size = deflection * TAU * hertz * random.between(0.5, 3.0);
            let slow = [random.between(0.1, 0.3) * speed, 0.15, random.between(0.0, TAU)];
            Motion { waves: vec![[size, hertz, 0.0], slow], stops_s: None }
        }
        1 => {
            let waves = [0.6, 0.3, 0.15, 0.08].iter().zip([0.15, 0.4, 1.0, 2.5]);
            let waves = waves.map(|(size, hertz)| wave(size * speed, hertz, 2.0 * hertz)).collect();
            Motion { waves, stops_s: None }
        }
        _ => {
            let waves = vec![wave(speed, 0.1, 0.5)];
            let (stop, go) = (random.between(0.1, 0.4), random.between(0.4, 1.2));
            Motion { waves, stops_s: Some([stop, go]) }
        }
    }
}

/// Returns time, s, velocity, rad/s, and torque, Nm, of a run.
fn simulate(joint: &Joint, motion: &Motion, rate_hz: f64) -> [Vec<f64>; 3] {
    let rows = (RUN_S * rate_hz) as usize;
    let fastest = (0..rows).map(|row| motion.velocity(row as f64 / rate_hz).abs());
    let fastest = fastest.fold(0.0, f64::max);
    let constant = joint.coulomb / (joint.stiffness * fastest);
    let step = MAX_STEP_S.min(MAX_STEP_TIME_CONSTANTS * constant);
    let substeps = (1.0 / (rate_hz * step)).ceil() as usize;
    let dt = 1.0 / (rate_hz * substeps as f64);
    let (mut z, mut now) = (0.0, motion.velocity(0.0));
    let [mut time, mut velocity, mut torque] = [const { Vec::new() }; 3];
    for row in 0..rows {
        let rate = joint.rate(now, z);
        time.push(row as f64 / rate_hz);
        velocity.push(now);
        torque.push(joint.stiffness * z + joint.damping * rate + joint.viscous * now);
        for step in 0..substeps {
            let at = row as f64 / rate_hz + step as f64 * dt;
            let (middle, end) = (motion.velocity(at + 0.5 * dt), motion.velocity(at + dt));
            let first = joint.rate(now, z);
            let second = joint.rate(middle, z + 0.5 * dt * first);
            let third = joint.rate(middle, z + 0.5 * dt * second);
            let fourth = joint.rate(end, z + dt * third);
            z += dt / 6.0 * (first + 2.0 * second + 2.0 * third + fourth);
            now = end;
        }
    }
    [time, velocity, torque]
}
