//! References: interpolation between the targets of a master, and moves with a trapezoidal velocity.
//!
//! ```text
//! CSP: target k arrives -> cubic curve from the present reference to target k in one interpolation period (60C2h)
//! CSV: target k arrives -> straight line from the present velocity to target k in one interpolation period
//! PP, homing: velocity' = acceleration, profile velocity, deceleration -> position
//! ```
//! The cubic curve ends with the velocity that three targets in a row extrapolate, so that position and velocity have
//! no steps, and a course with constant acceleration is followed exactly. It delays the course by one period.
//!
//! *Time of a target.* Bus and background deliver targets early, late, or two at once. The course therefore has a clock of
//! its own: each target is due one period after the one before, and the arrivals correct this clock slowly, as in a
//! phase-locked loop. While a target is late, the reference continues with its velocity, or in CSV with its acceleration,
//! for a period, at least 5 and at most 20 steps. Then it goes to the last target: as a trapezoidal move, or in CSV with
//! the acceleration of the velocity loop.
//!
//! *Speed.* A target that is late leaves less than a period for its way. The reference is at most 1.5 times as fast as the
//! course, and within 6080h, so that it comes later instead.

use super::angle::Angle;

/// Position and velocity of a reference.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reference {
    /// Position.
    pub position: Angle,
    /// Velocity, rad/s.
    pub velocity_rad_s: f32,
}

/// Limits of a move.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MoveLimits {
    /// Maximum speed, rad/s.
    pub speed_rad_s: f32,
    /// Acceleration, rad/s^2.
    pub acceleration_rad_s2: f32,
    /// Deceleration, rad/s^2.
    pub deceleration_rad_s2: f32,
}

/// Distance at which a move has reached its target, rad: below the resolution of the profile.
const REACHED_RAD: f32 = 1e-6;

impl Reference {
    /// Creates a reference at rest.
    pub const fn at(position: Angle) -> Self {
        Self { position, velocity_rad_s: 0.0 }
    }

    /// Moves the reference towards a target for a step of `dt` s. Returns true if it is there, at rest.
    pub fn move_towards(&mut self, target: Angle, limits: &MoveLimits, dt: f32) -> bool {
        let left_rad = target - self.position;
        let slowing = limits.deceleration_rad_s2 * dt;
        if left_rad.abs() < REACHED_RAD && self.velocity_rad_s.abs() <= 2.0 * slowing {
            *self = Self::at(target);
            return true;
        }
        // The largest speed from which steps of `slowing` end at the target.
        let steps = libm::sqrtf(0.25 + 2.0 * left_rad.abs() / (slowing * dt)) - 0.5;
        let speed = (steps * slowing).min(left_rad.abs() / dt).min(limits.speed_rad_s);
        let wanted = if left_rad < 0.0 { -speed } else { speed };
        let change = wanted - self.velocity_rad_s;
        let speeds_up = change * self.velocity_rad_s >= 0.0;
        let most = if speeds_up {
            limits.acceleration_rad_s2 * dt
        } else {
            limits.deceleration_rad_s2 * dt
        };
        // The last steps before the target are shorter than a step of the deceleration.
        self.velocity_rad_s += change.clamp(-1.01 * most, 1.01 * most);
        self.position = self.position.plus(self.velocity_rad_s * dt);
        false
    }
}

/// Clock of a course: the time until its last target is due.
#[derive(Clone, Copy, Debug, Default)]
struct CourseClock {
    /// Steps until the last target is due; negative if the next one is late.
    left: f32,
    /// Steps for which the course continues while a target is late.
    late_steps: f32,
}

impl CourseClock {
    /// Time by which bus and background may delay a target, and by which a target may be early, in steps.
    const LATE_STEPS: f32 = 5.0;

    /// Longest time for which the course continues without targets, in steps.
    const MOST_LATE_STEPS: f32 = 20.0;

    /// Correction of the clock by each target, as a share of its error. An error of a step then changes the velocity of
    /// the reference by 0.4 %, and clocks that differ by 0.1 % remain within half a step.
    const CORRECTION: f32 = 1.0 / 256.0;

    /// Growth of this share with the square of the error in steps, for clocks that differ by 0.5 %, and its maximum.
    const CORRECTION_GROWTH: f32 = 1.0 / 4096.0;
    const MOST_CORRECTION: f32 = 0.25;

    /// Returns true if no target is under way: none came, or the next one is too late.
    fn has_stopped(&self) -> bool {
        self.left <= -self.late_steps
    }

    /// Advances the clock to a target. `ways` is its distance from the last one in those of a period, or NaN. Returns the
    /// number of periods since the last target: more than one if targets were lost.
    fn advance(&mut self, period: f32, ways: f32) -> f32 {
        // A target is due about one period after its arrival at the latest, so this many periods may have passed. If bus
        // and background do not explain the delay, targets were lost. Otherwise the distance of the target states it.
        let most = (1.25 - self.left / period).max(1.0);
        let is_lost = -self.left > Self::LATE_STEPS.max(0.75 * period);
        let periods = if is_lost {
            most
        } else if ways.is_finite() {
            (ways + 0.5).max(1.0).min(most)
        } else {
            1.0
        };
        let periods = periods as u32 as f32;
        if self.has_stopped() {
            self.left = period;
        } else {
            let due = self.left + period * periods;
            let error = period - due;
            let share = Self::CORRECTION + Self::CORRECTION_GROWTH * error * error;
            let corrected = due + error * share.min(Self::MOST_CORRECTION);
            self.left = corrected.min(period + Self::LATE_STEPS);
        }
        self.late_steps = period.clamp(Self::LATE_STEPS, Self::MOST_LATE_STEPS);
        periods
    }
}

/// Interpolation between positions.
#[derive(Clone, Copy, Debug, Default)]
pub struct Interpolation {
    reference: Reference,
    /// The last target, and where the reference goes: there, if it is not too far, with the velocity there.
    target: Angle,
    to: Reference,
    /// Change of position from the target before to the last one, rad per period.
    last_rad: f32,
    /// Highest speed of the course at its last targets, rad per step, and maximum speed of the reference, rad/s.
    course_rad: f32,
    speed_rad_s: f32,
    clock: CourseClock,
}

impl Interpolation {
    /// Maximum speed of the reference relative to the course: a curve that begins or ends at rest has 1.5 times its mean.
    const OVERTAKING: f32 = 1.5;

    /// Share of the highest speed of the course that the next target leaves: a course that turns is slow only there.
    const COURSE_DECAY: f32 = 0.9;

    /// Time in which the reference may reach a target, whatever the course: at least these steps and periods.
    const CATCH_UP_STEPS: f32 = 40.0;
    const CATCH_UP_PERIODS: f32 = 4.0;

    /// Starts at a reference, as if it were the last target.
    pub fn begin(reference: Reference) -> Self {
        let target = reference.position;
        Self { reference, target, to: Reference::at(target), ..Self::default() }
    }

    /// Sets a target, one interpolation period of `steps` of `dt` s after the last one. Returns false if it is too far for
    /// the speed: the reference then stops before it.
    pub fn set_target(&mut self, target: Angle, steps: u32, speed_rad_s: f32, dt: f32) -> bool {
        let period = steps as f32;
        let from_last_rad = target - self.target;
        let periods = self.clock.advance(period, from_last_rad / self.last_rad);
        let wanted_rad = target - self.reference.position;
        let most_rad = speed_rad_s * self.clock.left.max(1.0) * dt;
        let way_rad = wanted_rad.clamp(-most_rad, most_rad);
        let target_step_rad = from_last_rad / periods;
        let extrapolated = (1.5 * target_step_rad - 0.5 * self.last_rad) / (period * dt);
        // A course that stops or turns is not extrapolated.
        let continues =
            target_step_rad * self.last_rad > 0.0 && extrapolated * target_step_rad > 0.0;
        let velocity_rad_s =
            if continues { extrapolated.clamp(-speed_rad_s, speed_rad_s) } else { 0.0 };
        let step_rad = target_step_rad.abs() / period;
        self.course_rad = step_rad.max(Self::COURSE_DECAY * self.course_rad);
        let catch_up_rad =
            wanted_rad.abs() / Self::CATCH_UP_STEPS.max(Self::CATCH_UP_PERIODS * period);
        let most_rad = (Self::OVERTAKING * self.course_rad).max(catch_up_rad);
        self.speed_rad_s = (most_rad / dt).min(speed_rad_s);
        self.last_rad = target_step_rad;
        self.target = target;
        self.to = Reference { position: self.reference.position.plus(way_rad), velocity_rad_s };
        way_rad == wanted_rad
    }

    /// Runs a step of `dt` s. `late` limits the move to the last target if the next one does not come.
    pub fn step(&mut self, late: &MoveLimits, dt: f32) -> Reference {
        let left = self.clock.left;
        self.clock.left -= 1.0;
        if left <= -self.clock.late_steps {
            self.last_rad = 0.0;
            self.reference.move_towards(self.to.position, late, dt);
            return self.reference;
        }
        let next = if left >= 1.5 { self.curve(left, dt) } else { self.line(left, dt) };
        // A late target leaves less time than its way needs. The reference then comes later.
        let (most, most_rad) = (self.speed_rad_s, self.speed_rad_s * dt);
        let way_rad = next.position - self.reference.position;
        self.reference.position =
            self.reference.position.plus(way_rad.max(-most_rad).min(most_rad));
        self.reference.velocity_rad_s = next.velocity_rad_s.max(-most).min(most);
        self.reference
    }

    /// Returns the reference a step ahead on the cubic Hermite curve to the last target, due in `left` steps.
    fn curve(&self, left: f32, dt: f32) -> Reference {
        let (left_s, s) = (left * dt, 1.0 / left);
        let way = self.to.position - self.reference.position;
        let (v0, v1) = (self.reference.velocity_rad_s * left_s, self.to.velocity_rad_s * left_s);
        // As a polynomial in s.
        let (c2, c3) = (3.0 * way - 2.0 * v0 - v1, v0 + v1 - 2.0 * way);
        Reference {
            position: self.reference.position.plus(s * (v0 + s * (c2 + s * c3))),
            velocity_rad_s: (v0 + s * (2.0 * c2 + s * 3.0 * c3)) / left_s,
        }
    }

    /// Returns the reference a step ahead, near the last target or past it. A late target moves the position by the error of
    /// the continued course. The velocity changes only to that of the target: this error in one step is no velocity.
    fn line(&self, left: f32, dt: f32) -> Reference {
        let velocity_rad_s = self.to.velocity_rad_s;
        let past_rad = velocity_rad_s * (1.0 - left) * dt;
        let change = (velocity_rad_s - self.reference.velocity_rad_s) / left.max(1.0);
        Reference {
            position: self.to.position.plus(past_rad),
            velocity_rad_s: self.reference.velocity_rad_s + change,
        }
    }
}

/// Interpolation between velocities.
#[derive(Clone, Copy, Debug, Default)]
pub struct VelocityInterpolation {
    reference_rad_s: f32,
    to_rad_s: f32,
    /// Change from the target before to the last one, rad/s per period, and the same in a step while a target is late.
    last_rad_s: f32,
    late_rad_s: f32,
    clock: CourseClock,
}

impl VelocityInterpolation {
    /// Starts at a velocity, rad/s, as if it were the last target.
    pub fn begin(reference_rad_s: f32) -> Self {
        Self { reference_rad_s, to_rad_s: reference_rad_s, ..Self::default() }
    }

    /// Sets a target, rad/s, one interpolation period of `steps` after the last one.
    pub fn set_target(&mut self, target_rad_s: f32, steps: u32) {
        let period = steps as f32;
        let is_course = !self.clock.has_stopped();
        let change = target_rad_s - self.to_rad_s;
        let step = change / self.clock.advance(period, change / self.last_rad_s);
        // A course that begins, stops or turns is not extrapolated.
        let continues = is_course && step * self.last_rad_s > 0.0;
        self.late_rad_s = if continues { step / period } else { 0.0 };
        self.last_rad_s = step;
        self.to_rad_s = target_rad_s;
    }

    /// Runs a step and returns the reference, rad/s; `None` if the last target is due and the next one does not come.
    pub fn step(&mut self) -> Option<f32> {
        let left = self.clock.left;
        self.clock.left -= 1.0;
        if left <= -self.clock.late_steps {
            self.last_rad_s = 0.0;
            return None;
        }
        self.reference_rad_s = if left >= 1.5 {
            self.reference_rad_s + (self.to_rad_s - self.reference_rad_s) / left
        } else {
            self.to_rad_s + self.late_rad_s * (1.0 - left)
        };
        Some(self.reference_rad_s)
    }
}

#[cfg(test)]
#[path = "trajectory/trajectory_tests.rs"]
mod tests;
