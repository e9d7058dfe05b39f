//! Observer of the joint's position, velocity and acceleration from a wrapped encoder angle.
//!
//! A tracking loop of third order. It predicts the angle with constant acceleration and corrects all three
//! states by the innovation `e`: the encoder angle less the prediction, the shortest way round.
//!
//! ```text
//! p  = x + v T + a T^2/2                e = wrapped(encoder - p)
//! x' = p + g e       v' = v + a T + h/T e       a' = a + 2 k/T^2 e
//! g = 1 - z^3        h = 3/2 (1 - z)^2 (1 + z)  k = (1 - z)^3 / 2,       z = exp(-2 pi f T)
//! ```
//! All three poles lie on `z`. The loop is stable for every bandwidth `f` and period `T`, and has no error at
//! constant acceleration. After a step of velocity the estimate reaches 63 % after `1/(2 pi f)` and overshoots
//! by 25 %, the price of following an acceleration. The angle is an integer of 2^-32 turns plus whole turns: it
//! wraps without extra code, and slow motion is not lost to rounding.
//!
//! A sample that is missing, or farther from the last valid one than the shaft can turn, is replaced by the
//! prediction ("coasting"), and the age grows. Past `encoder_coast_s` the rotor is *lost*: the bridge must open,
//! the next valid samples restart the observer, and whole turns are unknown until [`Observer::set_position`].
//!
//! An encoder that hangs repeats its last angle. At speed the observer expects another angle in every period: 20
//! counts of 14 bits for the reference joint at 3 rad/s. [`FROZEN_SAMPLES`] identical samples with an innovation above
//! [`FROZEN_INNOVATION_RAD`] are therefore a *frozen* encoder, and the rotor is lost at once. A joint that hits a stop
//! is not reported, because the noise of its encoder goes on.

use super::parameters::{Motor, ObserverGains};
use super::transform::{RAD_PER_UNIT, UNITS_PER_RAD};

/// Innovation from which identical samples are a frozen encoder, rad of the motor: 32 counts of 14 bits. After a
/// deceleration to rest by 300 rad/s^2 of the reference joint, three times what its motor can, the observer is off by
/// less. An encoder without noise passes, too.
pub const FROZEN_INNOVATION_RAD: f32 = 0.0123;

/// Minimum number of identical samples of a frozen encoder. A noise of one count, a third of that of the sensor,
/// gives this many with a probability of 1e-9.
pub const FROZEN_SAMPLES: u32 = 16;

const FROZEN_UNITS: f32 = FROZEN_INNOVATION_RAD * UNITS_PER_RAD;

/// State of the encoder in a cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EncoderState {
    /// The sample was marked invalid.
    pub is_invalid: bool,
    /// The sample was farther from the last valid one than the shaft can turn.
    pub is_implausible: bool,
    /// The angle is a prediction.
    pub is_coasting: bool,
    /// The samples do not change although the rotor turns.
    pub is_frozen: bool,
    /// The rotor angle is unknown: predicted for too long, or not settled after a start.
    pub is_lost: bool,
}

/// State of the tracking loop, for the motor shaft. Gains are passed with every step.
#[derive(Clone, Copy, Debug)]
pub struct Observer {
    /// Position, 2^-32 turns, counted from the encoder's electrical zero.
    position: i64,
    velocity_rad_s: f32,
    acceleration_rad_s2: f32,
    /// Time since the last valid sample, s; negative before the first.
    age_s: f32,
    /// The last valid sample.
    measured: u32,
    /// Number of samples that are equal to the one before.
    identical: u32,
    /// Cycles until a new start has settled; the rotor is lost until then.
    settling: u32,
    /// Joint position at motor position 0, rad.
    origin_rad: f32,
    /// True if whole turns of the motor are known, or have no effect.
    referenced: bool,
}

impl Observer {
    /// Creates an observer without a sample: lost until the first samples have settled.
    pub fn new(motor: &Motor) -> Self {
        Self {
            position: 0,
            velocity_rad_s: 0.0,
            acceleration_rad_s2: 0.0,
            age_s: -1.0,
            measured: 0,
            identical: 0,
            settling: motor.observer.settle_cycles,
            origin_rad: 0.0,
            referenced: motor.is_direct_drive,
        }
    }

    /// Processes one encoder angle, counted from the electrical zero in the motor's direction
    /// ([`Motor::rotor_angle`]); `None` if there is no valid angle.
    #[inline]
    pub fn step(&mut self, motor: &Motor, angle: Option<u32>) -> EncoderState {
        let gains = &motor.observer;
        let mut state = EncoderState { is_invalid: angle.is_none(), ..EncoderState::default() };
        let good = angle.filter(|angle| {
            state.is_implausible = !self.is_plausible(gains, *angle);
            !state.is_implausible
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
                state.is_frozen = self.is_frozen(angle, innovation);
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
                // Coast at constant velocity: a constant acceleration would make the prediction diverge.
                self.acceleration_rad_s2 = 0.0;
                state.is_coasting = true;
                if self.age_s >= 0.0 {
                    self.age_s += gains.period_s;
                }
                if self.age_s > gains.coast_s {
                    self.mark_lost(motor);
                }
            }
        }
        if state.is_frozen {
            self.mark_lost(motor);
        }
        state.is_lost = self.settling > 0;
        state
    }

    /// Counts identical samples; returns true if they contradict the motion of the rotor.
    #[inline(always)]
    fn is_frozen(&mut self, angle: u32, innovation: f32) -> bool {
        self.identical = if angle == self.measured { self.identical.wrapping_add(1) } else { 0 };
        self.identical >= FROZEN_SAMPLES && innovation.abs() > FROZEN_UNITS
    }

    /// Returns true if the shaft can have turned this far since the last valid sample.
    #[inline(always)]
    fn is_plausible(&self, gains: &ObserverGains, angle: u32) -> bool {
        let turned = (angle.wrapping_sub(self.measured) as i32).unsigned_abs() as f32;
        let reach = gains.jump_units + (self.age_s + gains.period_s) * gains.units_per_s;
        self.age_s < 0.0 || turned <= reach
    }

    /// Marks the rotor as lost; the next valid sample restarts the observer.
    #[cold]
    fn mark_lost(&mut self, motor: &Motor) {
        self.age_s = -1.0;
        self.velocity_rad_s = 0.0;
        self.acceleration_rad_s2 = 0.0;
        self.settling = motor.observer.settle_cycles;
        self.referenced = motor.is_direct_drive;
    }

    /// Restarts at an angle, at rest, by the shortest way from the present position.
    #[cold]
    fn restart(&mut self, motor: &Motor, angle: Option<u32>) {
        if let Some(angle) = angle {
            let way = angle.wrapping_sub(self.position as u32) as i32;
            self.position = self.position.wrapping_add(i64::from(way));
        }
        self.velocity_rad_s = 0.0;
        self.acceleration_rad_s2 = 0.0;
        self.identical = 0;
        self.settling = motor.observer.settle_cycles;
    }

    /// Clears a state that is not finite; returns `false` if it had to.
    #[inline(always)]
    pub(super) fn ensure_finite(&mut self, motor: &Motor) -> bool {
        let finite = self.velocity_rad_s.is_finite() && self.acceleration_rad_s2.is_finite();
        if !finite {
            self.mark_lost(motor);
        }
        finite
    }

    /// Returns the rotor's mechanical angle, 2^-32 turns.
    #[inline(always)]
    pub fn angle(&self) -> u32 {
        self.position as u32
    }

    /// Returns the motor velocity, rad/s.
    #[inline(always)]
    pub fn motor_velocity_rad_s(&self) -> f32 {
        self.velocity_rad_s
    }

    /// Returns the joint position, rad.
    #[inline(always)]
    pub fn position_rad(&self, motor: &Motor) -> f32 {
        let turns = (self.position >> 32) as i32 as f32;
        let share = self.position as u32 as f32 * RAD_PER_UNIT;
        (turns * core::f32::consts::TAU + share) * motor.joint_per_motor - self.origin_rad
    }

    /// Returns the joint velocity, rad/s.
    #[inline(always)]
    pub fn velocity_rad_s(&self, motor: &Motor) -> f32 {
        self.velocity_rad_s * motor.joint_per_motor
    }

    /// Returns the joint acceleration, rad/s^2.
    #[inline(always)]
    pub fn acceleration_rad_s2(&self, motor: &Motor) -> f32 {
        self.acceleration_rad_s2 * motor.joint_per_motor
    }

    /// Returns the time since the last valid sample, s; negative if there is none.
    #[inline(always)]
    pub fn age_s(&self) -> f32 {
        self.age_s
    }

    /// Returns true if [`Observer::position_rad`] is absolute; if false, it is off by whole motor turns.
    #[inline(always)]
    pub fn is_referenced(&self) -> bool {
        self.referenced
    }

    /// Sets the present joint position, rad. A value that is not finite is ignored.
    pub fn set_position(&mut self, motor: &Motor, position_rad: f32) {
        if position_rad.is_finite() {
            self.origin_rad = 0.0;
            self.origin_rad = self.position_rad(motor) - position_rad;
            self.referenced = true;
        }
    }
}

/// Converts radians to signed units of 2^-32 turns; saturates, and NaN gives 0.
#[inline(always)]
fn units(rad: f32) -> i32 {
    rounded(rad * UNITS_PER_RAD)
}

/// Rounds to the nearest integer: truncation would bias the velocity towards zero.
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

    /// Returns the angle of a 14-bit encoder at this motor position, rad (f64: many turns).
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
    fn observer_at_constant_acceleration_over_many_turns_has_no_error() {
        let motor = motor();
        let gear = f64::from(1.0 / motor.joint_per_motor);
        let mut observer = Observer::new(&motor);
        let (velocity, acceleration) = (-6.0, 3.0); // Of the joint.
        let at = |t: f64| gear * (velocity * t + 0.5 * acceleration * t * t);
        let state = run(&mut observer, &motor, 40_000, at);
        assert_eq!(state, EncoderState::default());
        let t = 40_000.0 * f64::from(PERIOD_S);
        let error = f64::from(observer.position_rad(&motor)) - at(t) / gear;
        // The encoder rounds down, by at most one step.
        assert!(error.abs() < 2e-5, "{error:e}");
        assert!((f64::from(observer.velocity_rad_s(&motor)) - 0.0).abs() < 2e-3);
        assert!((observer.acceleration_rad_s2(&motor) - 3.0).abs() < 0.5);
        // Without a sample, the acceleration is not extrapolated.
        assert!(observer.step(&motor, None).is_coasting);
        assert_eq!(observer.acceleration_rad_s2(&motor), 0.0);
    }

    /// A noise of about normal distribution, counts of 14 bits: the sum of twelve uniform numbers (xorshift).
    struct Noise(u64);

    impl Noise {
        fn counts(&mut self, deviation: f64) -> f64 {
            let sum: f64 = (0..12)
                .map(|_| {
                    self.0 ^= self.0 << 13;
                    self.0 ^= self.0 >> 7;
                    self.0 ^= self.0 << 17;
                    (self.0 >> 11) as f64 / (1u64 << 53) as f64
                })
                .sum();
            deviation * (sum - 6.0)
        }
    }

    /// Runs a motion of the joint, rad, for this time, s, with noise of this deviation, counts. Returns true if the
    /// encoder was reported as frozen.
    fn is_reported(seconds: f64, deviation: f64, joint_rad: impl Fn(f64) -> f64) -> bool {
        let motor = motor();
        let gear = f64::from(1.0 / motor.joint_per_motor);
        let (mut observer, mut noise) = (Observer::new(&motor), Noise(7));
        (0..(seconds / f64::from(PERIOD_S)) as u32).any(|k| {
            let counts = std::f64::consts::TAU / 16384.0 * noise.counts(deviation);
            let angle = encoder(gear * joint_rad(f64::from(k) * f64::from(PERIOD_S)) + counts);
            observer.step(&motor, Some(angle)).is_frozen
        })
    }

    #[test]
    fn frozen_encoder_at_speed_is_lost_within_2_ms() {
        let motor = motor();
        let gear = f64::from(1.0 / motor.joint_per_motor);
        for (speed, most_samples) in [(0.7, 24), (1.0, 16), (3.0, 16), (-3.0, 16), (11.0, 16)] {
            let mut observer = Observer::new(&motor);
            run(&mut observer, &motor, 4000, |t| gear * speed * t);
            let last = encoder(gear * speed * 4000.0 * f64::from(PERIOD_S));
            let samples = (1..=100).find(|_| observer.step(&motor, Some(last)).is_lost);
            let samples = samples.expect("it is found");
            println!("frozen at {speed} rad/s: lost after {samples} samples");
            assert!((16..=most_samples).contains(&samples), "{speed} rad/s: {samples} samples");
            assert!(!observer.is_referenced());
        }
    }

    #[test]
    fn sound_encoder_at_rest_or_in_any_motion_is_never_frozen() {
        for deviation in [0.0, 0.3, 1.0, 3.1, 15.5] {
            for speed in [0.0, 1e-4, 1e-3, 0.01, 0.05, 0.1, 0.2, 0.3, 0.5, 1.0, 3.0] {
                assert!(!is_reported(1.0, deviation, |t| speed * t), "{speed} rad/s, {deviation}");
            }
            // Reversals: small, slow, and at the joint's acceleration.
            for (rad, rate) in [(1e-4, 300.0), (1e-3, 100.0), (0.01, 60.0), (0.1, 30.0), (1.0, 8.0)]
            {
                let found = is_reported(2.0, deviation, |t| rad * (rate * t).sin());
                assert!(!found, "{rad} rad at {rate} rad/s, {deviation}");
            }
            // Braking to rest. The motor alone reaches 105 rad/s^2.
            for rate in [50.0, 105.0, 200.0, 300.0] {
                let stop = |t: f64| {
                    let braked = (t - 0.5).clamp(0.0, 3.0 / rate);
                    3.0 * t.min(0.5) + (3.0 - 0.5 * rate * braked) * braked
                };
                assert!(!is_reported(0.6, deviation, stop), "braking at {rate}, {deviation}");
            }
        }
        // A hard stop at speed: the rotor stands at once, and the noise of the encoder goes on.
        for deviation in [0.7, 1.0, 3.1] {
            for speed in [0.5, 3.0, 8.0, 12.0] {
                let found = is_reported(0.6, deviation, |t| speed * t.min(0.5));
                assert!(!found, "hard stop from {speed} rad/s, {deviation}");
            }
        }
    }

    #[test]
    fn observer_after_velocity_step_responds_with_its_bandwidth() {
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
    fn observer_at_standstill_reports_zero_velocity() {
        let motor = motor();
        let mut observer = Observer::new(&motor);
        run(&mut observer, &motor, 4000, |_| 1.234);
        assert!(observer.velocity_rad_s(&motor).abs() < 1e-6);
        assert!(observer.acceleration_rad_s2(&motor).abs() < 1e-3);
    }

    #[test]
    fn observer_at_very_low_speed_keeps_the_velocity() {
        let motor = motor();
        let mut observer = Observer::new(&motor);
        // The finest angle an encoder can have: any loss is that of the observer.
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
    fn observer_without_samples_coasts_and_then_reports_lost() {
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
            assert!(state.is_invalid && state.is_coasting && !state.is_lost, "{k}: {state:?}");
            assert!((observer.age_s() - (k + 1) as f32 * PERIOD_S).abs() < 1e-6);
            let error = f64::from(observer.position_rad(&motor)) - at(t) / gear;
            assert!(error.abs() < 3e-5, "{k}: {error:e}");
        }
        assert!(observer.is_referenced());
        let ends = (0..3).map(|_| observer.step(&motor, None)).any(|state| state.is_lost);
        assert!(ends && !observer.is_referenced() && observer.age_s() < 0.0);
        // After the encoder returns: lost until settled, then correct except for whole motor turns.
        let mut cycles = 0;
        loop {
            t += f64::from(PERIOD_S);
            let state = observer.step(&motor, Some(encoder(at(t))));
            if !state.is_lost {
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
    fn observer_with_implausible_jump_discards_the_sample() {
        let motor = motor();
        let mut observer = Observer::new(&motor);
        run(&mut observer, &motor, 2000, |_| 0.5);
        let before = observer.angle();
        let state = observer.step(&motor, Some(encoder(0.5 + 1.0)));
        assert!(state.is_implausible && state.is_coasting && !state.is_invalid && !state.is_lost);
        assert_eq!(observer.angle(), before);
        let state = observer.step(&motor, Some(encoder(0.5)));
        assert_eq!(state, EncoderState::default());
    }

    #[test]
    fn observer_with_home_position_keeps_it_over_turns() {
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
    fn units_of_radians_match_binary_angle() {
        assert_eq!(units(f32::NAN), 0);
        assert_eq!(units(1e-3), binary_angle(1e-3) as i32);
    }
}
