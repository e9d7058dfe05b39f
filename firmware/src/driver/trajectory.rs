//! Position references: interpolation between the targets of a master, and moves with a trapezoidal velocity.
//!
//! ```text
//! CSP: target k arrives -> cubic curve from the present reference to target k in one interpolation period (60C2h)
//! PP, homing: velocity' = acceleration, profile velocity, deceleration -> position
//! ```
//! The cubic curve ends with the velocity that three targets in a row extrapolate, so that position and velocity have
//! no steps, and a course with constant acceleration is followed exactly. It delays the course by one period. If the
//! next target is late, the reference moves to the last one as a trapezoidal move.

/// Position and velocity of a reference. The position has double precision: at 6 rad and a slow motion, a step of a
/// millisecond is below the resolution of `f32`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reference {
    /// Position, rad.
    pub position_rad: f64,
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
    pub const fn at(position_rad: f64) -> Self {
        Self { position_rad, velocity_rad_s: 0.0 }
    }

    /// Moves the reference towards a target for a step of `dt` s. Returns true if it is there, at rest.
    pub fn move_towards(&mut self, target_rad: f64, limits: &MoveLimits, dt: f32) -> bool {
        let left_rad = (target_rad - self.position_rad) as f32;
        let slowing = limits.deceleration_rad_s2 * dt;
        if left_rad.abs() < REACHED_RAD && self.velocity_rad_s.abs() <= 2.0 * slowing {
            *self = Self::at(target_rad);
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
        self.position_rad += f64::from(self.velocity_rad_s * dt);
        false
    }
}

/// Interpolation between targets.
#[derive(Clone, Copy, Debug, Default)]
pub struct Interpolation {
    reference: Reference,
    from: Reference,
    to: Reference,
    /// Distance between the last two targets, rad.
    last_rad: f32,
    at: u32,
    steps: u32,
}

impl Interpolation {
    /// Starts at a reference, as if it were the last target.
    pub fn begin(reference: Reference) -> Self {
        Self {
            reference,
            from: reference,
            to: Reference::at(reference.position_rad),
            ..Self::default()
        }
    }

    /// Sets a target, to be reached in this number of steps of `dt` s. Returns false if it is too far for the speed: the
    /// reference then stops before it.
    pub fn set_target(&mut self, target_rad: f64, steps: u32, speed_rad_s: f32, dt: f32) -> bool {
        let period_s = steps as f32 * dt;
        let wanted_rad = (target_rad - self.reference.position_rad) as f32;
        let most_rad = speed_rad_s * period_s;
        let way_rad = wanted_rad.clamp(-most_rad, most_rad);
        let target_step_rad = (target_rad - self.to.position_rad) as f32;
        let extrapolated = (1.5 * target_step_rad - 0.5 * self.last_rad) / period_s;
        // A course that stops or turns is not extrapolated.
        let continues =
            target_step_rad * self.last_rad > 0.0 && extrapolated * target_step_rad > 0.0;
        let velocity_rad_s =
            if continues { extrapolated.clamp(-speed_rad_s, speed_rad_s) } else { 0.0 };
        self.last_rad = target_step_rad;
        self.from = self.reference;
        self.to = Reference {
            position_rad: self.reference.position_rad + f64::from(way_rad),
            velocity_rad_s,
        };
        (self.at, self.steps) = (0, steps);
        way_rad == wanted_rad
    }

    /// Runs a step of `dt` s. `late` limits the move to the last target if the next one is late.
    pub fn step(&mut self, late: &MoveLimits, dt: f32) -> Reference {
        if self.at >= self.steps {
            self.reference.move_towards(self.to.position_rad, late, dt);
            return self.reference;
        }
        self.at += 1;
        let period_s = self.steps as f32 * dt;
        let s = self.at as f32 / self.steps as f32;
        let way = (self.to.position_rad - self.from.position_rad) as f32;
        let (v0, v1) = (self.from.velocity_rad_s * period_s, self.to.velocity_rad_s * period_s);
        // Cubic Hermite curve, as a polynomial in s.
        let (c2, c3) = (3.0 * way - 2.0 * v0 - v1, v0 + v1 - 2.0 * way);
        self.reference = Reference {
            position_rad: self.from.position_rad + f64::from(s * (v0 + s * (c2 + s * c3))),
            velocity_rad_s: (v0 + s * (2.0 * c2 + s * 3.0 * c3)) / period_s,
        };
        self.reference
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DT: f32 = 1e-3;
    const LIMITS: MoveLimits =
        MoveLimits { speed_rad_s: 2.0, acceleration_rad_s2: 10.0, deceleration_rad_s2: 20.0 };

    /// Moves to a target; returns the time, s, and checks the limits in every step.
    fn travel(mut reference: Reference, target_rad: f64, may_overshoot: bool) -> f32 {
        let way = target_rad - reference.position_rad;
        for step in 0..20_000 {
            let before = reference;
            if reference.move_towards(target_rad, &LIMITS, DT) {
                return step as f32 * DT;
            }
            let change = reference.velocity_rad_s - before.velocity_rad_s;
            assert!(
                change.abs() <= 1.02 * LIMITS.deceleration_rad_s2 * DT,
                "{before:?} {reference:?}"
            );
            assert!(reference.velocity_rad_s.abs() <= LIMITS.speed_rad_s * 1.001);
            let left = (target_rad - reference.position_rad) * way.signum();
            assert!(may_overshoot || left > -1e-4, "{reference:?} beyond {target_rad}");
        }
        panic!("it does not arrive: {reference:?}");
    }

    #[test]
    fn move_takes_the_time_of_its_trapezoid() {
        // 0.2 s to 2 rad/s, 0.1 s from it: 0.3 rad; the rest at 2 rad/s.
        for (target_rad, expected_s) in [(2.0, 1.15), (-2.0, 1.15), (0.3, 0.3), (0.075, 0.15)] {
            let found_s = travel(Reference::at(0.0), target_rad, false);
            assert!((found_s - expected_s).abs() < 0.02, "{target_rad} rad: {found_s} s");
        }
        assert_eq!(travel(Reference::at(0.5), 0.5, false), 0.0);
        // From a velocity that overshoots the target, it comes back.
        travel(Reference { position_rad: 0.0, velocity_rad_s: 2.0 }, 0.05, true);
    }

    #[test]
    fn interpolation_of_constant_acceleration_is_exact_one_period_later() {
        for steps in [1u32, 2, 10] {
            let course = |ms: u32| 2e-6 * f64::from(ms) * f64::from(ms);
            let mut curve = Interpolation::begin(Reference::at(0.0));
            let mut most = 0.0f64;
            for ms in 0..1000 {
                if ms % steps == 0 {
                    assert!(curve.set_target(course(ms), steps, 12.0, DT));
                }
                let found = curve.step(&LIMITS, DT);
                if ms > 5 * steps {
                    let at = ms + 1 - steps;
                    most = most.max((found.position_rad - course(at)).abs());
                    let velocity = 4.0 * at as f32 * DT;
                    assert!((found.velocity_rad_s - velocity).abs() < 0.02, "{found:?} {velocity}");
                }
            }
            assert!(most < 2e-5, "{most} rad at {steps} ms");
        }
    }

    #[test]
    fn interpolation_without_new_targets_stops_at_the_last_one() {
        let mut curve = Interpolation::begin(Reference::at(0.0));
        for k in 1..=20 {
            curve.set_target(0.02 * f64::from(k), 10, 12.0, DT);
            for _ in 0..10 {
                let _ = curve.step(&LIMITS, DT);
            }
        }
        let mut before = curve.step(&LIMITS, DT);
        for _ in 0..1000 {
            let now = curve.step(&LIMITS, DT);
            assert!((now.velocity_rad_s - before.velocity_rad_s).abs() < 0.021);
            before = now;
        }
        assert!(
            (before.position_rad - 0.4).abs() < 1e-5 && before.velocity_rad_s == 0.0,
            "{before:?}"
        );
    }

    #[test]
    fn interpolation_of_a_jump_is_limited_in_speed() {
        let mut curve = Interpolation::begin(Reference::at(0.0));
        assert!(!curve.set_target(1.0, 10, 2.0, DT));
        let mut most = 0.0f32;
        for _ in 0..10 {
            most = most.max(curve.step(&LIMITS, DT).velocity_rad_s);
        }
        assert!((curve.reference.position_rad - 0.02).abs() < 1e-5 && most < 3.1, "{most} rad/s");
    }
}
