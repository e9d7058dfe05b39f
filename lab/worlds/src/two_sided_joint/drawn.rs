//! Joints with two encoders, drawn at random from the ranges of real parts.

use super::{AngleWave, JointEncoder, SideFriction, TwoSidedJoint};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use simulated_machines::effects::Wave;
use simulated_machines::joint_plant::Gear;
use std::f64::consts::TAU;

/// What makes the difference of the two positions large. Every joint has all other errors too, at their usual size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum GearFault {
    /// Play.
    Play,
    /// No play, and a soft gear.
    Elasticity,
    /// No play, and a wave of the joint's encoder.
    Eccentricity,
    /// No play, and a late sample of the joint's encoder.
    Skew,
    /// No play, and an error of the scale and a drift.
    Drift,
}

impl GearFault {
    /// All of them.
    pub const ALL: [Self; 5] =
        [Self::Play, Self::Elasticity, Self::Eccentricity, Self::Skew, Self::Drift];

    /// Returns the name in tables.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Play => "play",
            Self::Elasticity => "elasticity",
            Self::Eccentricity => "eccentricity",
            Self::Skew => "skew",
            Self::Drift => "drift",
        }
    }
}

/// Draws a joint with a fault. The same seed gives the same joint.
pub fn draw(fault: GearFault, seed: u64) -> TwoSidedJoint {
    let mut random = Pcg64::seed_from_u64(0x2e_0000 + 8 * seed + fault as u64);
    let random = &mut random;
    let coulomb = log_uniform(random, 0.5, 8.0);
    // Torsion under the friction of the load: that of a stiff planetary gear to that of a soft strain wave gear.
    let windup = match fault {
        GearFault::Elasticity => log_uniform(random, 3e-4, 1e-2),
        _ => log_uniform(random, 3e-5, 1e-3),
    };
    let inertia = coulomb * log_uniform(random, 0.01, 0.08);
    let inertias = [inertia, inertia * log_uniform(random, 0.2, 3.0)];
    let stiffness_nm_per_rad = coulomb / windup;
    let least: f64 = inertias[0].min(inertias[1]);
    let motor = coulomb * log_uniform(random, 0.15, 1.5);
    let gravity =
        if random.random_bool(0.5) { coulomb * log_uniform(random, 0.1, 1.2) } else { 0.0 };
    let encoder = encoder(fault, random);
    // From a good cycloidal gear (one arc minute) to a worm gear.
    let play_rad = if fault == GearFault::Play { log_uniform(random, 2e-4, 2e-2) } else { 0.0 };
    let softness = if random.random_bool(0.5) { 0.5 * random.random::<f64>() } else { 0.0 };
    let damping_nm_s_per_rad =
        2.0 * log_uniform(random, 0.02, 0.2) * (stiffness_nm_per_rad * least).sqrt();
    TwoSidedJoint {
        gear: Gear { stiffness_nm_per_rad, damping_nm_s_per_rad, play_rad },
        softness,
        inertias,
        frictions: [friction(motor, random), friction(coulomb, random)],
        gravity: Wave { size: gravity, order: 1.0, phase: -phase(random) },
        encoder,
        motor_step_rad: log_uniform(random, 2e-6, 5e-5),
        torque_noise_nm: coulomb * log_uniform(random, 0.005, 0.1),
        torque_ripple: Wave {
            order: log_uniform(random, 20.0, 400.0).round(),
            size: motor * log_uniform(random, 0.01, 0.1),
            phase: 0.0,
        },
        bandwidth_rad_s: log_uniform(random, 15.0, 50.0),
        rate_hz: [200.0, 250.0, 500.0, 1000.0][random.random_range(0..4)],
        seconds: 10.0,
        warming_k: 3.0 * random.random::<f64>(),
        logs_temperature: random.random_bool(0.5),
        motions: (0..4).map(|_| motion(random)).collect(),
    }
}

fn friction(coulomb_nm: f64, random: &mut Pcg64) -> SideFriction {
    SideFriction {
        coulomb_nm,
        excess_nm: coulomb_nm * 0.6 * random.random::<f64>(),
        stribeck_rad_s: log_uniform(random, 0.02, 0.3),
        viscous_nms: coulomb_nm * log_uniform(random, 0.02, 0.6),
        travel_rad: log_uniform(random, 3e-5, 1e-3),
    }
}

/// Draws an encoder of 14 to 20 bits. A drawn fault is five times the usual error.
fn encoder(fault: GearFault, random: &mut Pcg64) -> JointEncoder {
    let step_rad = TAU / 2f64.powi(random.random_range(14..=20));
    let times = |is: GearFault| if fault == is { 5.0 } else { 1.0 };
    JointEncoder {
        step_rad,
        noise_rad: step_rad * log_uniform(random, 0.2, 1.5),
        offset_rad: random.random::<f64>() - 0.5,
        eccentricity: Wave {
            order: 1.0,
            size: times(GearFault::Eccentricity) * log_uniform(random, 1e-4, 2e-3),
            phase: phase(random),
        },
        harmonic: Wave {
            order: random.random_range(2..=8) as f64,
            size: times(GearFault::Eccentricity) * log_uniform(random, 2e-5, 3e-4),
            phase: phase(random),
        },
        gain_error: times(GearFault::Drift) * 2e-4 * (2.0 * random.random::<f64>() - 1.0),
        late_s: times(GearFault::Skew) * log_uniform(random, 2e-5, 1e-3),
        drift_rad_per_k: times(GearFault::Drift) * 5e-5 * (2.0 * random.random::<f64>() - 1.0),
    }
}

/// Draws the motion of a run: one to three waves, with a common largest speed.
fn motion(random: &mut Pcg64) -> Vec<AngleWave> {
    let speed = log_uniform(random, 0.3, 3.0);
    let count = random.random_range(1..=3);
    let wave = |random: &mut Pcg64| {
        let rad_s = TAU * log_uniform(random, 0.15, 1.2);
        AngleWave { size_rad: speed / (count as f64 * rad_s), rad_s, phase: phase(random) }
    };
    (0..count).map(|_| wave(random)).collect()
}

/// Draws a number whose logarithm is uniform.
fn log_uniform(random: &mut Pcg64, low: f64, high: f64) -> f64 {
    low * (high / low).powf(random.random::<f64>())
}

/// Draws a phase, rad.
fn phase(random: &mut Pcg64) -> f64 {
    TAU * random.random::<f64>()
}
