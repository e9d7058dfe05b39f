//! Friction run: the drive moves its joint so that a log shows its friction.
//!
//! ```text
//! speeds from the fastest to the slowest, each 0.75 of the one before:  forward -> backward -> next
//! a pass ends near the end of the range, or after MAX_PASS_MS.
//! ```
//! The speed decreases, because a stop or a held joint is detected soonest at high speed, where it costs the
//! least travel. Every pass starts with a reversal, which shows presliding. No model is active: the log shows
//! the torque of the drive alone. Current, travel, time and the master's confirmation are bounded, and also the
//! speed and a joint that does not follow. The run is a step per millisecond in the background, and commands
//! [`crate::control::velocity_loop`].

use super::{AbortReason, CommissioningStep};

/// Limits of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrictionBounds {
    /// Maximum current, A.
    pub current_a: f32,
    /// Maximum travel to either side of the start, rad.
    pub travel_rad: f32,
    /// Speed of the first passes, rad/s.
    pub speed_rad_s: f32,
    /// Acceleration of the reversals, rad/s^2.
    pub acceleration_rad_s2: f32,
}

/// Measured state of the joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrictionSample {
    /// Position from an arbitrary zero, rad.
    pub position_rad: f32,
    /// Velocity, rad/s.
    pub velocity_rad_s: f32,
    /// Last current command of the velocity loop, A.
    pub commanded_a: f32,
}

/// Number of speeds, and the ratio of each to the one before: from 2 rad/s down to 0.05. docs/src/reference/closed-loop.md
/// shows the effect of half and twice as many.
const SPEED_LEVELS: u8 = 14;
const SPEED_RATIO: f32 = 0.75;
/// Maximum duration of a pass, ms: at the lowest speed the joint moves by 0.14 rad.
const MAX_PASS_MS: u32 = 2500;
/// Share of the travel at which a pass reverses.
const TURN_BACK_SHARE: f32 = 0.9;
/// Delay of velocity loop and observer, s.
const LOOP_DELAY_S: f32 = 0.05;
/// Time at the current limit after which the joint counts as held, ms.
const MAX_HELD_MS: u32 = 300;
/// Share of the current limit that counts as at the limit.
const CURRENT_BOUND_SHARE: f32 = 0.98;
/// Maximum speed: factor on the commanded speed, plus a margin, rad/s.
const OVERSPEED_FACTOR: f32 = 1.5;
const OVERSPEED_MARGIN_RAD_S: f32 = 0.3;
/// Maximum duration of a run, ms.
const MAX_RUN_MS: u32 = 2 * SPEED_LEVELS as u32 * MAX_PASS_MS + 1000;

with_defaults! {
    /// A run, and how the last one ended.
    #[derive(Clone, Copy, Debug)]
    pub struct FrictionRun {
        step: CommissioningStep = CommissioningStep::Idle,
        reason: AbortReason = AbortReason::None,
        bounds: FrictionBounds,
        level: u8,
        backwards: bool,
        speed_rad_s: f32,
        /// Position at the start, rad; `None` before the first step.
        from_rad: Option<f32>,
        /// Duration of the pass, of the run, and at the current limit, ms.
        pass_ms: u32,
        run_ms: u32,
        held_ms: u32,
    }
}

impl FrictionRun {
    /// Starts a run.
    pub fn begin(bounds: FrictionBounds) -> Self {
        let speed_rad_s = bounds.speed_rad_s;
        Self { step: CommissioningStep::Rubbing, bounds, speed_rad_s, ..Self::default() }
    }

    /// Ends a run; has no effect after the end.
    pub fn end(&mut self, reason: AbortReason) {
        if self.is_running() {
            (self.step, self.reason) = (CommissioningStep::Aborted, reason);
        }
    }

    /// Returns true while it moves the joint.
    pub fn is_running(&self) -> bool {
        self.step == CommissioningStep::Rubbing
    }

    /// Returns the present step.
    pub const fn step(&self) -> CommissioningStep {
        self.step
    }

    /// Returns the reason of the end.
    pub const fn reason(&self) -> AbortReason {
        self.reason
    }

    /// Returns the limits of the run.
    pub const fn bounds(&self) -> &FrictionBounds {
        &self.bounds
    }

    /// Runs a step, once a millisecond; returns the target velocity, rad/s.
    // Not inlined: from its own part, it reaches the fields by short offsets.
    #[inline(never)]
    pub fn next_speed_rad_s(&mut self, sample: &FrictionSample) -> f32 {
        self.run_ms += 1;
        self.pass_ms += 1;
        let FrictionSample { position_rad, velocity_rad_s, commanded_a } = *sample;
        let from_rad = *self.from_rad.get_or_insert(position_rad);
        let at_rad = position_rad - from_rad;
        let at_bound = commanded_a.abs() >= CURRENT_BOUND_SHARE * self.bounds.current_a;
        self.held_ms = if at_bound { self.held_ms + 1 } else { 0 };
        let too_fast = OVERSPEED_FACTOR * self.bounds.speed_rad_s + OVERSPEED_MARGIN_RAD_S;
        let ended = if self.run_ms > MAX_RUN_MS {
            AbortReason::Time
        } else if self.held_ms > MAX_HELD_MS {
            AbortReason::JointHeld
        } else if velocity_rad_s.abs() > too_fast {
            AbortReason::TooFast
        } else if at_rad.abs() > self.bounds.travel_rad {
            AbortReason::Travel
        } else {
            AbortReason::None
        };
        // NaN passes none of the comparisons above, so it is checked here.
        if ended != AbortReason::None || !(at_rad + velocity_rad_s).is_finite() {
            self.end(if ended == AbortReason::None { AbortReason::NoAnswer } else { ended });
            return 0.0;
        }
        let (ahead_rad, speed_rad_s) =
            if self.backwards { (-at_rad, -velocity_rad_s) } else { (at_rad, velocity_rad_s) };
        let stops_in_rad = speed_rad_s
            * (LOOP_DELAY_S + 0.5 * speed_rad_s.max(0.0) / self.bounds.acceleration_rad_s2);
        if self.pass_ms >= MAX_PASS_MS
            || ahead_rad + stops_in_rad > TURN_BACK_SHARE * self.bounds.travel_rad
        {
            self.turn_back();
        }
        if self.backwards { -self.speed_rad_s } else { self.speed_rad_s }
    }

    fn turn_back(&mut self) {
        self.pass_ms = 0;
        self.backwards = !self.backwards;
        if !self.backwards {
            self.level += 1;
            self.speed_rad_s *= SPEED_RATIO;
        }
        if self.level >= SPEED_LEVELS {
            self.step = CommissioningStep::Done;
            self.speed_rad_s = 0.0;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BOUNDS: FrictionBounds = FrictionBounds {
        current_a: 8.0,
        travel_rad: 0.5,
        speed_rad_s: 2.0,
        acceleration_rad_s2: 20.0,
    };

    /// Simulates a joint that follows immediately, modified by `moves`. Returns the run, its largest excursion
    /// and the targets.
    fn run(moves: impl Fn(u32, f32) -> (f32, f32)) -> (FrictionRun, f32, Vec<f32>) {
        let mut run = FrictionRun::begin(BOUNDS);
        let (mut at, mut farthest, mut speed, mut commanded_a) = (3.0f32, 0.0f32, 0.0f32, 0.0f32);
        let mut speeds = Vec::new();
        for ms in 0..200_000 {
            let target = run.next_speed_rad_s(&FrictionSample {
                position_rad: at,
                velocity_rad_s: speed,
                commanded_a,
            });
            if !run.is_running() {
                break;
            }
            if speeds.last() != Some(&target) {
                speeds.push(target);
            }
            let wanted = speed + (target - speed).clamp(-0.02, 0.02);
            (speed, commanded_a) = moves(ms, wanted);
            at += 1e-3 * speed;
            farthest = farthest.max((at - 3.0).abs());
        }
        (run, farthest, speeds)
    }

    #[test]
    fn friction_run_uses_all_speeds_in_both_directions_within_its_travel() {
        let (run, farthest, speeds) = run(|_, speed| (speed, 1.0));
        assert_eq!((run.step(), run.reason()), (CommissioningStep::Done, AbortReason::None));
        assert!((0.4..0.5).contains(&farthest), "{farthest}");
        assert_eq!(speeds.len(), 2 * usize::from(SPEED_LEVELS));
        assert!(speeds.chunks(2).all(|pair| pair[0] == -pair[1] && pair[0] > 0.0));
        assert!(speeds[26] < 0.05 && speeds[26] > 0.04, "{}", speeds[26]);
    }

    #[test]
    fn friction_run_ends_at_each_limit() {
        // Held at the current limit; too fast; not stopped at the end of travel; NaN.
        let (held, ..) = run(|_, _| (0.0, 8.0));
        assert_eq!(held.reason(), AbortReason::JointHeld);
        let (fast, ..) = run(|ms, speed| (if ms > 50 { 3.5 } else { speed }, 1.0));
        assert_eq!(fast.reason(), AbortReason::TooFast);
        let (on, farthest, _) = run(|_, speed| (speed.abs().max(0.5), 1.0));
        assert_eq!(on.reason(), AbortReason::Travel);
        assert!(farthest < 0.51);
        let (none, ..) = run(|_, _| (f32::NAN, 1.0));
        assert_eq!(none.reason(), AbortReason::NoAnswer);
        // A joint that does not move ends by time, within 90 s.
        let (slow, ..) = run(|_, _| (0.0, 1.0));
        assert_eq!(slow.step(), CommissioningStep::Done);
    }
}
