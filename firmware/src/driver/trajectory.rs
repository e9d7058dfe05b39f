//! Position references: interpolation between the targets of a master, and moves with a trapezoidal velocity.
//!
//! ```text
//! CSP: target k arrives -> cubic curve from the present reference to target k in one interpolation period (60C2h)
//! PP, homing: velocity' = acceleration, profile velocity, deceleration -> position
//! ```
//! The cubic curve ends with the velocity that three targets in a row extrapolate, so that position and velocity have
//! no steps, and a course with constant acceleration is followed exactly. It delays the course by one period.
//!
//! *Time of a target.* Bus and background deliver targets early, late, or two at once. The course therefore has a clock of
//! its own: each target is due one period after the one before, and the arrivals correct this clock slowly, as in a
//! phase-locked loop. While a target is late, the reference continues with its velocity for a period, at least 5 and at
//! most 20 steps. Then it moves to the last target as a trapezoidal move.

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
    /// The last target, and the velocity there.
    to: Reference,
    /// Change of position from the target before to the last one, rad per period.
    last_rad: f32,
    /// Steps until the last target is due; negative if the next one is late.
    left: f32,
    /// Time for which the reference continues with its velocity while a target is late, in steps.
    late_steps: f32,
    /// The clock of the course runs.
    has_clock: bool,
}

impl Interpolation {
    /// Time by which bus and background may delay a target, and by which a target may be early, in steps.
    const LATE_STEPS: f32 = 5.0;

    /// Longest time for which the reference continues without targets, in steps.
    const MOST_LATE_STEPS: f32 = 20.0;

    /// Correction of the clock by each target, as a share of its error. An error of a step then changes the velocity of
    /// the reference by 0.4 %, and clocks that differ by 0.1 % remain within half a step.
    const CORRECTION: f32 = 1.0 / 256.0;

    /// Starts at a reference, as if it were the last target.
    pub fn begin(reference: Reference) -> Self {
        Self { reference, to: Reference::at(reference.position_rad), ..Self::default() }
    }

    /// Sets a target, one interpolation period of `steps` of `dt` s after the last one. Returns false if it is too far for
    /// the speed: the reference then stops before it.
    pub fn set_target(&mut self, target_rad: f64, steps: u32, speed_rad_s: f32, dt: f32) -> bool {
        let period = steps as f32;
        let periods = self.advance_clock(target_rad, period);
        let wanted_rad = (target_rad - self.reference.position_rad) as f32;
        let most_rad = speed_rad_s * self.left.max(1.0) * dt;
        let way_rad = wanted_rad.clamp(-most_rad, most_rad);
        let target_step_rad = (target_rad - self.to.position_rad) as f32 / periods;
        let extrapolated = (1.5 * target_step_rad - 0.5 * self.last_rad) / (period * dt);
        // A course that stops or turns is not extrapolated.
        let continues =
            target_step_rad * self.last_rad > 0.0 && extrapolated * target_step_rad > 0.0;
        let velocity_rad_s =
            if continues { extrapolated.clamp(-speed_rad_s, speed_rad_s) } else { 0.0 };
        self.last_rad = target_step_rad;
        self.to = Reference {
            position_rad: self.reference.position_rad + f64::from(way_rad),
            velocity_rad_s,
        };
        way_rad == wanted_rad
    }

    /// Advances the clock to a target. Returns the number of periods since the last one: more than one if targets were
    /// lost.
    fn advance_clock(&mut self, target_rad: f64, period: f32) -> f32 {
        self.late_steps = period.clamp(Self::LATE_STEPS, Self::MOST_LATE_STEPS);
        if !self.has_clock {
            self.has_clock = true;
            self.left = period;
            return 1.0;
        }
        // A target is due about one period after its arrival at the latest, so this many periods may have passed. If bus
        // and background do not explain the delay, targets were lost. Otherwise the distance of the target states it.
        let most = (1.25 - self.left / period).max(1.0);
        let is_lost = -self.left > Self::LATE_STEPS.max(0.75 * period);
        let way = (target_rad - self.to.position_rad) as f32 / self.last_rad;
        let periods = if is_lost {
            most
        } else if way.is_finite() {
            (way + 0.5).clamp(1.0, most)
        } else {
            1.0
        };
        let periods = periods as u32 as f32;
        let due = self.left + period * periods;
        self.left = (due + (period - due) * Self::CORRECTION).min(period + Self::LATE_STEPS);
        periods
    }

    /// Runs a step of `dt` s. `late` limits the move to the last target if the next one does not come.
    pub fn step(&mut self, late: &MoveLimits, dt: f32) -> Reference {
        if self.left <= -self.late_steps {
            self.has_clock = false;
            self.last_rad = 0.0;
            self.reference.move_towards(self.to.position_rad, late, dt);
            return self.reference;
        }
        self.reference = if self.left >= 1.5 { self.curve(dt) } else { self.line(dt) };
        self.left -= 1.0;
        self.reference
    }

    /// Returns the reference a step ahead on the cubic Hermite curve to the last target.
    fn curve(&self, dt: f32) -> Reference {
        let (left_s, s) = (self.left * dt, 1.0 / self.left);
        let way = (self.to.position_rad - self.reference.position_rad) as f32;
        let (v0, v1) = (self.reference.velocity_rad_s * left_s, self.to.velocity_rad_s * left_s);
        // As a polynomial in s.
        let (c2, c3) = (3.0 * way - 2.0 * v0 - v1, v0 + v1 - 2.0 * way);
        Reference {
            position_rad: self.reference.position_rad + f64::from(s * (v0 + s * (c2 + s * c3))),
            velocity_rad_s: (v0 + s * (2.0 * c2 + s * 3.0 * c3)) / left_s,
        }
    }

    /// Returns the reference a step ahead, near the last target or past it. A late target moves the position by the error of
    /// the continued course. The velocity changes only to that of the target: this error in one step is no velocity.
    fn line(&self, dt: f32) -> Reference {
        let velocity_rad_s = self.to.velocity_rad_s;
        let past_rad = velocity_rad_s * (1.0 - self.left) * dt;
        let change = (velocity_rad_s - self.reference.velocity_rad_s) / self.left.max(1.0);
        Reference {
            position_rad: self.to.position_rad + f64::from(past_rad),
            velocity_rad_s: self.reference.velocity_rad_s + change,
        }
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

    /// Follows a sine with targets whose delivery is given: for each step, the number of targets that arrive before it.
    /// Returns the largest change of the velocity in a step, rad/s, after the first targets, and the largest distance from
    /// the course one period before, rad.
    fn follow(period: u32, steps: u32, mut arrivals: impl FnMut(u32) -> Vec<u32>) -> (f32, f64) {
        let course = |ms: f64| 0.5 * (1.0 - (core::f64::consts::PI * 1e-3 * ms).cos());
        let mut curve = Interpolation::begin(Reference::at(0.0));
        let (mut jump, mut far, mut before) = (0.0f32, 0.0f64, Reference::default());
        for step in 0..steps {
            for target in arrivals(step) {
                curve.set_target(course(f64::from(target * period)), period, 12.0, DT);
            }
            let now = curve.step(&LIMITS, DT);
            if step > 100 {
                jump = jump.max((now.velocity_rad_s - before.velocity_rad_s).abs());
                let expected = course(f64::from(step + 1) - f64::from(period));
                far = far.max((now.position_rad - expected).abs());
            }
            before = now;
        }
        (jump, far)
    }

    /// Delivers target k at step `k * period + late(k)`, each after those before it.
    fn delayed(period: u32, late: impl Fn(u32) -> u32) -> impl FnMut(u32) -> Vec<u32> {
        let mut next = 0;
        move |step| {
            let mut found = Vec::new();
            while next * period + late(next) <= step {
                found.push(next);
                next += 1;
            }
            found
        }
    }

    #[test]
    fn interpolation_with_late_targets_has_no_steps_of_velocity() {
        for period in [1, 2, 5, 10] {
            // The course accelerates by 0.005 rad/s in a step.
            let (on_time, near) = follow(period, 4000, delayed(period, |_| 0));
            assert!(on_time < 0.025 && near < 2e-4, "{period}: {on_time} rad/s, {near} rad");
            let patterns: [fn(u32) -> u32; 5] = [
                |k| u32::from(k % 20 == 7),
                |k| if k % 50 == 7 { 3 } else { 0 },
                |k| k * 7 % 3,
                |k| u32::from(k > 1000),
                |k| u32::from(k < 200) * 2,
            ];
            for (number, late) in patterns.into_iter().enumerate() {
                let (jump, far) = follow(period, 4000, delayed(period, late));
                let what = format!("period {period}, pattern {number}");
                assert!(jump < 0.045, "{what}: {jump} rad/s");
                assert!(far < 4e-3, "{what}: {far} rad");
            }
        }
    }

    #[test]
    fn interpolation_with_lost_targets_has_no_steps_of_velocity() {
        for period in [1, 2, 10] {
            let mut delivered = delayed(period, |_| 0);
            let (jump, far) = follow(period, 4000, |step| {
                delivered(step).into_iter().filter(|target| target % 37 != 5).collect()
            });
            assert!(jump < 0.06, "{period}: {jump} rad/s");
            assert!(far < 4e-3, "{period}: {far} rad");
        }
    }

    #[test]
    fn interpolation_with_another_clock_follows_it() {
        // The clock of the master is 0.13 % slower or faster.
        for per_mille in [-1.3, 1.3] {
            let mut next = 0u32;
            let (jump, far) = follow(1, 4000, |step| {
                let mut found = Vec::new();
                while f64::from(next) * (1.0 + 1e-3 * per_mille) <= f64::from(step) {
                    found.push(next);
                    next += 1;
                }
                found
            });
            assert!(jump < 0.03, "{jump} rad/s");
            // The course itself then is up to 5 ms away.
            assert!(far < 1.6e-3 * 6.0, "{far} rad");
        }
    }
}
