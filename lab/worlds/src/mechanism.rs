//! A joint with effects that its friction law does not contain: other joints, a payload, a place on the travel, an encoder.

use simulated_machines::conditions::Signal;
use simulated_machines::effects::Wave;
use simulated_machines::imposed::{Point, Trajectory};
use simulated_machines::joint::Joint;
use simulated_machines::motion::{Instant, Motion};

/// Lowest factor of the friction level.
const MIN_FACTOR: f64 = 0.05;

/// A joint with all effects.
#[derive(Clone, Debug)]
pub(super) struct Mechanism {
    /// The joint and the effects of its friction law.
    pub joint: Joint,
    /// Change of the friction level along the travel.
    pub along: Option<Along>,
    /// Torque by another joint.
    pub coupling: Option<Coupling>,
    /// Torque by a payload.
    pub payload: Option<Payload>,
    /// Error of the encoder over the angle, rad. It changes the log, not the torque.
    pub encoder: Option<Wave>,
}

/// What acts on the joint in a run besides its covariates.
#[derive(Clone, Debug, Default)]
pub(super) struct Beside {
    /// Motion of another joint.
    pub other: Option<Motion>,
    /// The payload, 0 to 1.
    pub payload: Signal,
}

/// Shape of the friction level along the travel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum TravelShape {
    /// Linear from one end to the other.
    Slope,
    /// A dip, or with a negative size a hump, at a share of the travel and with a width.
    Dip { at: f64, width: f64 },
}

/// Change of the friction level along the travel.
#[derive(Clone, Copy, Debug)]
pub(super) struct Along {
    /// Relative change of the level.
    pub size: f64,
    /// Begin of the travel, rad.
    pub from_rad: f64,
    /// Length of the travel, rad.
    pub length_rad: f64,
    pub shape: TravelShape,
}

/// Torque by the motion of another joint.
#[derive(Clone, Copy, Debug)]
pub(super) struct Coupling {
    /// Torque at the reference motion, Nm.
    pub size: f64,
    /// Reference velocity, rad/s.
    pub reference_rad_s: f64,
    /// Reference acceleration, rad/s^2.
    pub reference_rad_s2: f64,
    /// Share of the acceleration.
    pub acceleration: f64,
    /// Share of the square of the velocity.
    pub square: f64,
    /// Share of the product of both joints' velocities.
    pub product: f64,
}

/// Torque by a payload: its weight and its inertia.
#[derive(Clone, Copy, Debug)]
pub(super) struct Payload {
    /// Torque of the whole payload at the reference motion, Nm.
    pub size: f64,
    /// Phase of the weight at angle 0, rad.
    pub phase: f64,
    /// Reference acceleration, rad/s^2.
    pub reference_rad_s2: f64,
    /// Share of the weight.
    pub weight: f64,
    /// Share of the inertia.
    pub inertia: f64,
}

impl Along {
    fn factor(&self, angle: f64) -> f64 {
        let share = (angle - self.from_rad) / self.length_rad;
        let change = match self.shape {
            TravelShape::Slope => 2.0 * share - 1.0,
            TravelShape::Dip { at, width } => -(-((share - at) / width).powi(2)).exp(),
        };
        (1.0 + self.size * change).max(MIN_FACTOR)
    }
}

impl Mechanism {
    /// Returns a joint without further effects.
    pub fn plain(joint: Joint) -> Self {
        Self { joint, along: None, coupling: None, payload: None, encoder: None }
    }

    /// Returns the factor of the friction level at an angle.
    pub fn level_factor(&self, angle: f64) -> f64 {
        self.along.map_or(1.0, |along| along.factor(angle))
    }

    /// Returns the torque by the payload and by other joints, Nm.
    pub fn added(&self, beside: &Beside, point: &Point, acceleration: f64) -> f64 {
        let coupled = self.coupling.zip(beside.other.as_ref()).map_or(0.0, |(coupling, motion)| {
            let Instant { velocity, acceleration, .. } = motion.at(point.t);
            let speed = velocity / coupling.reference_rad_s;
            coupling.size
                * (acceleration / coupling.reference_rad_s2 * coupling.acceleration
                    + speed * speed.abs() * coupling.square
                    + speed * point.velocity / coupling.reference_rad_s * coupling.product)
        });
        let carried = self.payload.map_or(0.0, |payload| {
            let weight = (point.angle + payload.phase).sin();
            let inertia = acceleration / payload.reference_rad_s2;
            payload.size
                * beside.payload.at(point.t)
                * (payload.weight * weight + payload.inertia * inertia)
        });
        coupled + carried
    }

    /// Returns a trajectory as the encoder reads it.
    pub fn read_trajectory(&self, trajectory: &Trajectory) -> Trajectory {
        let Some(error) = self.encoder else { return trajectory.clone() };
        let Wave { size, order, phase } = error;
        let slope = |angle: f64| size * order * (order * angle + phase).cos();
        let bend = |angle: f64| -size * order * order * (order * angle + phase).sin();
        let points = trajectory.points.iter().map(|point| Point {
            t: point.t,
            angle: point.angle + size * (order * point.angle + phase).sin(),
            velocity: point.velocity * (1.0 + slope(point.angle)),
        });
        let rows = trajectory.rows.iter().zip(&trajectory.accelerations);
        let accelerations = rows.map(|(row, acceleration)| {
            let Point { angle, velocity, .. } = trajectory.points[*row];
            acceleration * (1.0 + slope(angle)) + bend(angle) * velocity * velocity
        });
        Trajectory {
            points: points.collect(),
            accelerations: accelerations.collect(),
            rows: trajectory.rows.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn read_trajectory_with_encoder_error_keeps_velocity_the_derivative_of_the_angle() {
        let joint = Joint::plain(crate::lubricated_tests::SEAL);
        let error = Wave { size: 0.02, order: 3.0, phase: 0.4 };
        let mechanism = Mechanism { encoder: Some(error), ..Mechanism::plain(joint) };
        let step_s = 1e-4;
        let at = |row: usize| row as f64 * step_s;
        let point =
            |row: usize| Point { t: at(row), angle: at(row).sin(), velocity: at(row).cos() };
        let trajectory = Trajectory {
            points: (0..20_000).map(point).collect(),
            rows: (0..20_000).collect(),
            accelerations: (0..20_000).map(|row| -at(row).sin()).collect(),
        };
        let read = mechanism.read_trajectory(&trajectory);
        for row in (1..19_999).step_by(97) {
            let [before, here, after] = [row - 1, row, row + 1].map(|row| read.points[row]);
            let velocity = (after.angle - before.angle) / (2.0 * step_s);
            let acceleration = (after.velocity - before.velocity) / (2.0 * step_s);
            assert!((velocity - here.velocity).abs() < 1e-6, "{row}");
            assert!((acceleration - read.accelerations[row]).abs() < 1e-5, "{row}");
        }
    }

    #[test]
    fn level_factor_of_dip_is_least_at_its_place() {
        let shape = TravelShape::Dip { at: 0.3, width: 0.1 };
        let along = Along { size: 0.4, from_rad: -1.0, length_rad: 2.0, shape };
        assert!((along.factor(-0.4) - 0.6).abs() < 1e-12);
        assert!((along.factor(1.0) - 1.0).abs() < 1e-12);
        let slope = Along { shape: TravelShape::Slope, ..along };
        assert!(
            (slope.factor(-1.0) - 0.6).abs() < 1e-12 && (slope.factor(1.0) - 1.4).abs() < 1e-12
        );
    }
}
