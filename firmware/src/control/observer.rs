//! From a wrapped encoder angle to the joint's position, velocity and acceleration.
//!
//! A tracking loop of third order: it predicts the angle with constant acceleration and corrects all
//! three by the innovation `e`, what the encoder says beyond the prediction (shortest way round).
//!
//! ```text
//! p  = x + v T + a T^2/2                e = wrapped(encoder - p)
//! x' = p + g e       v' = v + a T + h/T e       a' = a + 2 k/T^2 e
//! g = 1 - z^3        h = 3/2 (1 - z)^2 (1 + z)  k = (1 - z)^3 / 2,       z = exp(-2 pi f T)
//! ```
//! All three poles lie on `z`: stable for every bandwidth `f` and period `T`, and without error at constant
//! acceleration. A step of velocity is seen to 63 % after `1/(2 pi f)`, and with 25 % of overshoot, which
//! is what following an acceleration costs. The angle is an integer of 2^-32 turns with the turns
//! above it: wrapping is free, and slow motion is not lost to rounding.
//!
//! A sample that is missing, or farther from the last good one than the shaft can have turned, is coasted
//! over with an age. Past `encoder_coast_s` the rotor is *lost*: the bridge must open, the next good
//! samples start anew, and whole turns are no longer known until [`Observer::set_position`].

use super::parameters::{Motor, ObserverGains};
use super::transform::{RAD_PER_UNIT, UNITS_PER_RAD};

/// What happened to the encoder in a cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EncoderState {
    /// The sample's validity bit was off.
    pub invalid: bool,
    /// It was farther from the last good one than the shaft can turn.
    pub implausible: bool,
    /// The angle is the prediction.
    pub coasting: bool,
    /// No angle to drive by: coasted too long, or starting and not settled.
    pub lost: bool,
}

/// The tracking loop's state, in the motor's terms; gains come with every step.
#[derive(Clone, Copy, Debug)]
pub struct Observer {
    /// Position, 2^-32 turns, counted from the encoder's electrical zero.
    position: i64,
    velocity_rad_s: f32,
    acceleration_rad_s2: f32,
    /// Time since the last good sample, s; negative before the first.
    age_s: f32,
    /// The last good sample.
    measured: u32,
    /// Cycles until a new start has settled; the rotor is lost until then.
    settling: u32,
    /// Joint position where the motor's is 0, rad.
    origin_rad: f32,
    /// Whether whole turns of the motor are known (or do not matter).
    referenced: bool,
}

impl Observer {
    /// Knows nothing yet: lost until the first samples have settled.
    pub fn new(motor: &Motor) -> Self {
        Self {
            position: 0,
            velocity_rad_s: 0.0,
            acceleration_rad_s2: 0.0,
            age_s: -1.0,
            measured: 0,
            settling: motor.observer.settle_cycles,
            origin_rad: 0.0,
            referenced: motor.turns_do_not_matter,
        }
    }

    /// Takes one encoder angle, already counted from the electrical zero in the motor's direction
    /// ([`Motor::rotor_angle`]), or `None` where there is no valid one.
    #[inline]
    pub fn step(&mut self, motor: &Motor, angle: Option<u32>) -> EncoderState {
        let gains = &motor.observer;
        let mut state = EncoderState { invalid: angle.is_none(), ..EncoderState::default() };
        let good = angle.filter(|angle| {
            state.implausible = !self.plausible(gains, *angle);
            !state.implausible
        });
        if good.is_some() && self.age_s < 0.0 {
            self.restart(motor, good);
        }
        let change = gains.period_s
            * (self.velocity_rad_s + 0.5 * gains.period_s * self.acceleration_rad_s2);
        self.position = self.position.wrapping_add(i64::from(units(change)));
        match good {
            Some(angle) => {
                let innovation = angle.wrapping_sub(self.position as u32) as i32 as f32;
                let correction = rounded(gains.angle * innovation);
                self.position = self.position.wrapping_add(i64::from(correction));
                let innovation = innovation * RAD_PER_UNIT;
                self.velocity_rad_s +=
                    gains.period_s * self.acceleration_rad_s2 + gains.velocity_per_s * innovation;
                self.acceleration_rad_s2 += gains.acceleration_per_s2 * innovation;
                self.measured = angle;
                self.age_s = 0.0;
                self.settling = self.settling.saturating_sub(1);
            }
            None => {
                // At constant velocity: an acceleration trusted for long runs away.
                self.acceleration_rad_s2 = 0.0;
                state.coasting = true;
                if self.age_s >= 0.0 {
                    self.age_s += gains.period_s;
                }
                if self.age_s > gains.coast_s {
                    self.lose(motor);
                }
            }
        }
        state.lost = self.settling > 0;
        state
    }

    /// Whether the shaft can have turned this far since the last good sample.
    #[inline(always)]
    fn plausible(&self, gains: &ObserverGains, angle: u32) -> bool {
        let turned = (angle.wrapping_sub(self.measured) as i32).unsigned_abs() as f32;
        let reach = gains.jump_units + (self.age_s + gains.period_s) * gains.units_per_s;
        self.age_s < 0.0 || turned <= reach
    }

    /// The rotor is lost; the next good sample starts anew.
    #[cold]
    fn lose(&mut self, motor: &Motor) {
        self.age_s = -1.0;
        self.velocity_rad_s = 0.0;
        self.acceleration_rad_s2 = 0.0;
        self.settling = motor.observer.settle_cycles;
        self.referenced = motor.turns_do_not_matter;
    }

    /// Begins at an angle, at rest, by the shortest way from where the loop was.
    #[cold]
    fn restart(&mut self, motor: &Motor, angle: Option<u32>) {
        if let Some(angle) = angle {
            let way = angle.wrapping_sub(self.position as u32) as i32;
            self.position = self.position.wrapping_add(i64::from(way));
        }
        self.velocity_rad_s = 0.0;
        self.acceleration_rad_s2 = 0.0;
        self.settling = motor.observer.settle_cycles;
    }

    /// Takes what cannot be a number back to rest; `false` if there was such a thing.
    #[inline(always)]
    pub(super) fn ensure_finite(&mut self, motor: &Motor) -> bool {
        let finite = self.velocity_rad_s.is_finite() && self.acceleration_rad_s2.is_finite();
        if !finite {
            self.lose(motor);
        }
        finite
    }

    /// The rotor's mechanical angle now, 2^-32 turns.
    #[inline(always)]
    pub fn angle(&self) -> u32 {
        self.position as u32
    }

    /// The motor's velocity, rad/s.
    #[inline(always)]
    pub fn motor_velocity_rad_s(&self) -> f32 {
        self.velocity_rad_s
    }

    /// The joint's position, rad.
    #[inline(always)]
    pub fn position_rad(&self, motor: &Motor) -> f32 {
        let turns = (self.position >> 32) as i32 as f32;
        let share = self.position as u32 as f32 * RAD_PER_UNIT;
        (turns * core::f32::consts::TAU + share) * motor.joint_per_motor - self.origin_rad
    }

    /// The joint's velocity, rad/s.
    #[inline(always)]
    pub fn velocity_rad_s(&self, motor: &Motor) -> f32 {
        self.velocity_rad_s * motor.joint_per_motor
    }

    /// The joint's acceleration, rad/s^2.
    #[inline(always)]
    pub fn acceleration_rad_s2(&self, motor: &Motor) -> f32 {
        self.acceleration_rad_s2 * motor.joint_per_motor
    }

    /// Time since the last good sample, s; negative where there is none to speak of.
    #[inline(always)]
    pub fn age_s(&self) -> f32 {
        self.age_s
    }

    /// Whether [`Observer::position_rad`] is the joint's, and not just a whole number of motor turns off.
    #[inline(always)]
    pub fn is_referenced(&self) -> bool {
        self.referenced
    }

    /// Says where the joint is, rad, from now on. Anything not finite is ignored.
    pub fn set_position(&mut self, motor: &Motor, position_rad: f32) {
        if position_rad.is_finite() {
            self.origin_rad = 0.0;
            self.origin_rad = self.position_rad(motor) - position_rad;
            self.referenced = true;
        }
    }
}

/// Radians as signed units of 2^-32 turns; saturates, and NaN is 0.
#[inline(always)]
fn units(rad: f32) -> i32 {
    rounded(rad * UNITS_PER_RAD)
}

/// The nearest integer: truncation would be a bias towards rest.
#[inline(always)]
fn rounded(x: f32) -> i32 {
    (x + 0.5f32.copysign(x)) as i32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::control::MotorParameters;
    use crate::control::PERIOD_S;
    use crate::control::transform::binary_angle;

    fn motor() -> Motor {
        MotorParameters::default().build(PERIOD_S).expect("defaults are legal")
    }

    /// A 14-bit encoder at this motor position, rad (f64: many turns).
    fn encoder(motor_rad: f64) -> u32 {
        let turns = motor_rad / std::f64::consts::TAU;
        (((turns - turns.floor()) * 16384.0) as u32) << 18
    }

    fn run(
        observer: &mut Observer,
        motor: &Motor,
        cycles: u32,
        position: impl Fn(f64) -> f64,
    ) -> EncoderState {
        (0..cycles).fold(EncoderState::default(), |_, k| {
            let t = f64::from(k + 1) * f64::from(PERIOD_S);
            observer.step(motor, Some(encoder(position(t))))
        })
    }

    #[test]
    fn constant_velocity_and_acceleration_are_followed_over_many_turns() {
        let motor = motor();
        let gear = f64::from(1.0 / motor.joint_per_motor);
        let mut observer = Observer::new(&motor);
        let (velocity, acceleration) = (-6.0, 3.0); // of the joint
        let at = |t: f64| gear * (velocity * t + 0.5 * acceleration * t * t);
        let state = run(&mut observer, &motor, 40_000, at);
        assert_eq!(state, EncoderState::default());
        let t = 40_000.0 * f64::from(PERIOD_S);
        let error = f64::from(observer.position_rad(&motor)) - at(t) / gear;
        // Floor of the encoder's step: at most one below.
        assert!(error.abs() < 2e-5, "{error:e}");
        assert!((f64::from(observer.velocity_rad_s(&motor)) - 0.0).abs() < 2e-3);
        assert!((observer.acceleration_rad_s2(&motor) - 3.0).abs() < 0.5);
        // What is not seen is not believed to go on accelerating.
        assert!(observer.step(&motor, None).coasting);
        assert_eq!(observer.acceleration_rad_s2(&motor), 0.0);
    }

    #[test]
    fn a_step_of_velocity_is_followed_with_the_bandwidth_asked_for() {
        let motor = motor();
        let gear = f64::from(1.0 / motor.joint_per_motor);
        let mut observer = Observer::new(&motor);
        run(&mut observer, &motor, 2000, |_| 0.0);
        let mut crossed = None;
        let mut peak = 0.0f32;
        for k in 0..2000 {
            let t = f64::from(k + 1) * f64::from(PERIOD_S);
            observer.step(&motor, Some(encoder(gear * 2.0 * t)));
            let share = observer.velocity_rad_s(&motor) / 2.0;
            peak = peak.max(share);
            if share > 0.632 {
                crossed.get_or_insert(t);
            }
        }
        // Of a triple pole at w: v(t) = 1 - e^-x (1 + x - x^2), x = w t, reaches 63.2 % at x = 1
        // and 1.249 at its peak, x = 3.
        let x = crossed.expect("it arrives")
            * f64::from(std::f32::consts::TAU * MotorParameters::default().observer_bandwidth_hz);
        assert!((0.95..1.05).contains(&x), "{x}");
        assert!((1.22..1.28).contains(&peak), "{peak}");
    }

    #[test]
    fn standing_still_is_still() {
        let motor = motor();
        let mut observer = Observer::new(&motor);
        run(&mut observer, &motor, 4000, |_| 1.234);
        assert!(observer.velocity_rad_s(&motor).abs() < 1e-6);
        assert!(observer.acceleration_rad_s2(&motor).abs() < 1e-3);
    }

    #[test]
    fn creeping_below_one_encoder_step_a_second_is_seen() {
        let motor = motor();
        let mut observer = Observer::new(&motor);
        // The encoder's finest possible angle: what is lost is lost by the observer.
        for k in 0..200_000u32 {
            let t = f64::from(k) * f64::from(PERIOD_S);
            let angle = (1e-4 * t / std::f64::consts::TAU * 4_294_967_296.0) as u32;
            observer.step(&motor, Some(angle));
        }
        let seen = observer.motor_velocity_rad_s();
        // Rounding leaves 4e-6 rad/s of the motor.
        assert!((seen - 1e-4).abs() < 1e-5, "{seen:e}");
    }

    #[test]
    fn lost_samples_are_coasted_over_and_too_many_lose_the_rotor() {
        let motor = motor();
        let gear = f64::from(1.0 / motor.joint_per_motor);
        let at = |t: f64| gear * 4.0 * t;
        let mut observer = Observer::new(&motor);
        observer.set_position(&motor, 0.0);
        run(&mut observer, &motor, 4000, at);
        let coast = (MotorParameters::default().encoder_coast_s / PERIOD_S) as u32;
        let mut t = 4000.0 * f64::from(PERIOD_S);
        for k in 0..coast {
            t += f64::from(PERIOD_S);
            let state = observer.step(&motor, None);
            assert!(state.invalid && state.coasting && !state.lost, "{k}: {state:?}");
            assert!((observer.age_s() - (k + 1) as f32 * PERIOD_S).abs() < 1e-6);
            let error = f64::from(observer.position_rad(&motor)) - at(t) / gear;
            assert!(error.abs() < 3e-5, "{k}: {error:e}");
        }
        assert!(observer.is_referenced());
        let ends = (0..3).map(|_| observer.step(&motor, None)).any(|state| state.lost);
        assert!(ends && !observer.is_referenced() && observer.age_s() < 0.0);
        // Found again: lost until settled, then right but for whole turns of the motor.
        let mut cycles = 0;
        loop {
            t += f64::from(PERIOD_S);
            let state = observer.step(&motor, Some(encoder(at(t))));
            if !state.lost {
                break;
            }
            cycles += 1;
            assert!(cycles < 2000);
        }
        assert_eq!(cycles + 1, motor.observer.settle_cycles);
        let velocity = observer.velocity_rad_s(&motor);
        assert!((velocity - 4.0).abs() < 0.04, "{velocity}");
    }

    #[test]
    fn a_jump_no_shaft_makes_is_not_believed() {
        let motor = motor();
        let mut observer = Observer::new(&motor);
        run(&mut observer, &motor, 2000, |_| 0.5);
        let before = observer.angle();
        let state = observer.step(&motor, Some(encoder(0.5 + 1.0)));
        assert!(state.implausible && state.coasting && !state.invalid && !state.lost);
        assert_eq!(observer.angle(), before);
        let state = observer.step(&motor, Some(encoder(0.5)));
        assert_eq!(state, EncoderState::default());
    }

    #[test]
    fn a_home_position_is_kept_through_turns() {
        let motor = motor();
        let gear = f64::from(1.0 / motor.joint_per_motor);
        let mut observer = Observer::new(&motor);
        run(&mut observer, &motor, 2000, |_| 0.0);
        assert!(!observer.is_referenced());
        observer.set_position(&motor, f32::NAN);
        assert!(!observer.is_referenced());
        observer.set_position(&motor, 1.5);
        assert!(observer.is_referenced());
        run(&mut observer, &motor, 20_000, |t| gear * 2.0 * t);
        assert!((observer.position_rad(&motor) - 3.5).abs() < 1e-4);
    }

    #[test]
    fn radians_meet_binary_angles() {
        assert_eq!(units(f32::NAN), 0);
        assert_eq!(units(1e-3), binary_angle(1e-3) as i32);
    }
}
