//! Joints with two encoders, drawn at random from the ranges of real parts.

use super::{JointEncoder, SideFriction, TwoSidedJoint, log_uniform, phase};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

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
    let own = &mut random;
    let coulomb = log_uniform(own, 0.5, 8.0);
    // Torsion under the friction of the load: that of a stiff planetary gear to that of a soft strain wave gear.
    let windup = match fault {
        GearFault::Elasticity => log_uniform(own, 3e-4, 1e-2),
        _ => log_uniform(own, 3e-5, 1e-3),
    };
    let inertia = coulomb * log_uniform(own, 0.01, 0.08);
    let inertias = [inertia, inertia * log_uniform(own, 0.2, 3.0)];
    let stiffness_nm = coulomb / windup;
    let least: f64 = inertias[0].min(inertias[1]);
    let motor = coulomb * log_uniform(own, 0.15, 1.5);
    let gravity = if own.random_bool(0.5) { coulomb * log_uniform(own, 0.1, 1.2) } else { 0.0 };
    let encoder = encoder(fault, own);
    TwoSidedJoint {
        // From a good cycloidal gear (one arc minute) to a worm gear.
        play_rad: if fault == GearFault::Play { log_uniform(own, 2e-4, 2e-2) } else { 0.0 },
        stiffness_nm,
        softness: if own.random_bool(0.5) { 0.5 * own.random::<f64>() } else { 0.0 },
        damping_nms: 2.0 * log_uniform(own, 0.02, 0.2) * (stiffness_nm * least).sqrt(),
        inertias,
        frictions: [friction(motor, own), friction(coulomb, own)],
        gravity: (gravity, phase(own)),
        encoder,
        motor_step_rad: log_uniform(own, 2e-6, 5e-5),
        torque_noise_nm: coulomb * log_uniform(own, 0.005, 0.1),
        torque_ripple: (log_uniform(own, 20.0, 400.0).round(), motor * log_uniform(own, 0.01, 0.1)),
        bandwidth_rad_s: log_uniform(own, 15.0, 50.0),
        rate_hz: [200.0, 250.0, 500.0, 1000.0][own.random_range(0..4)],
        seconds: 10.0,
        warming_k: 3.0 * own.random::<f64>(),
        logs_temperature: own.random_bool(0.5),
        motions: (0..4).map(|_| motion(own)).collect(),
    }
}

fn friction(coulomb_nm: f64, own: &mut Pcg64) -> SideFriction {
    SideFriction {
        coulomb_nm,
        excess_nm: coulomb_nm * 0.6 * own.random::<f64>(),
        stribeck_rad_s: log_uniform(own, 0.02, 0.3),
        viscous_nms: coulomb_nm * log_uniform(own, 0.02, 0.6),
        travel_rad: log_uniform(own, 3e-5, 1e-3),
    }
}

/// Draws an encoder of 14 to 20 bits. A drawn fault is five times the usual error.
fn encoder(fault: GearFault, own: &mut Pcg64) -> JointEncoder {
    let step_rad = std::f64::consts::TAU / 2f64.powi(own.random_range(14..=20));
    let times = |is: GearFault| if fault == is { 5.0 } else { 1.0 };
    JointEncoder {
        step_rad,
        noise_rad: step_rad * log_uniform(own, 0.2, 1.5),
        offset_rad: own.random::<f64>() - 0.5,
        eccentricity: (times(GearFault::Eccentricity) * log_uniform(own, 1e-4, 2e-3), phase(own)),
        harmonic: (
            own.random_range(2..=8) as f64,
            times(GearFault::Eccentricity) * log_uniform(own, 2e-5, 3e-4),
            phase(own),
        ),
        gain_error: times(GearFault::Drift) * 2e-4 * (2.0 * own.random::<f64>() - 1.0),
        late_s: times(GearFault::Skew) * log_uniform(own, 2e-5, 1e-3),
        drift_rad_per_k: times(GearFault::Drift) * 5e-5 * (2.0 * own.random::<f64>() - 1.0),
    }
}

/// Draws the motion of a run: one to three waves, with a common largest speed.
fn motion(own: &mut Pcg64) -> Vec<(f64, f64, f64)> {
    let speed = log_uniform(own, 0.3, 3.0);
    let count = own.random_range(1..=3);
    let wave = |own: &mut Pcg64| {
        let frequency = std::f64::consts::TAU * log_uniform(own, 0.15, 1.2);
        (speed / (count as f64 * frequency), frequency, phase(own))
    };
    (0..count).map(|_| wave(own)).collect()
}
