//! The drive moves its joint by itself, so that a log of it shows what friction there is.
//!
//! ```text
//! speeds from the fastest down, each three quarters of the one before:  there -> back -> next
//! a pass ends near the end of the range, or after PASS ms
//! ```
//! Downwards, because a stop or a held joint shows soonest at speed, where it costs least travel. Every pass begins with a
//! reversal, which is what presliding is known by. No model is in force: what the log shows is all the drive's own torque.
//! Bounded like any run: current, travel, time and the master's sign of life; beside them the speed, and a joint that does not
//! follow. It runs in the background, a step a millisecond, and asks [`crate::control::velocity_loop`] for its speed.

use super::{Reason, Step};

/// What a run may do.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrictionBounds {
    /// Largest current, A.
    pub current_a: f32,
    /// How far the joint may go to either side of where it began, rad.
    pub travel_rad: f32,
    /// Speed of the first passes, rad/s.
    pub speed_rad_s: f32,
    /// Acceleration it reverses with, rad/s^2.
    pub acceleration_rad_s2: f32,
}

/// What is seen of the joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Position, rad, from any zero.
    pub position_rad: f32,
    /// Velocity, rad/s.
    pub velocity_rad_s: f32,
    /// Current the velocity loop asked for last, A.
    pub asked_a: f32,
}

/// Speeds, and how much of the one before the next is: from 2 rad/s down to 0.05. Half as many find the friction to 2.4 %,
/// these to 1.9 %, twice as many to 1.8 % (docs/closed-loop.md).
const LEVELS: u8 = 14;
const NEXT: f32 = 0.75;
/// Milliseconds a pass takes at most: at the lowest speed it moves by a seventh of a radian.
const PASS: u32 = 2500;
/// Share of the travel in which a pass turns back.
const TURNS_AT: f32 = 0.9;
/// What velocity loop and observer are late, s.
const LATE_S: f32 = 0.05;
/// Milliseconds at the current's bound that are a joint that does not follow.
const HELD: u32 = 300;
/// Share of the current's bound that is at it.
const AT_BOUND: f32 = 0.98;
/// Speed that is too much: so many times what is asked for, and so much more, rad/s.
const TOO_FAST: f32 = 1.5;
const TOO_FAST_RAD_S: f32 = 0.3;
/// Milliseconds a run may take.
const LONGEST: u32 = 2 * LEVELS as u32 * PASS + 1000;

/// A run, and how the last one ended.
#[derive(Clone, Copy, Debug)]
pub struct FrictionRun {
    step: Step,
    reason: Reason,
    bounds: FrictionBounds,
    level: u8,
    backwards: bool,
    speed_rad_s: f32,
    /// Position it began at, rad; none before the first step.
    from_rad: Option<f32>,
    /// Milliseconds of the pass, of the run, and at the current's bound.
    pass: u32,
    all: u32,
    held: u32,
}

impl Default for FrictionRun {
    fn default() -> Self {
        Self {
            step: Step::Idle,
            reason: Reason::None,
            bounds: FrictionBounds::default(),
            level: 0,
            backwards: false,
            speed_rad_s: 0.0,
            from_rad: None,
            pass: 0,
            all: 0,
            held: 0,
        }
    }
}

impl FrictionRun {
    /// Begins a run.
    pub fn begin(bounds: FrictionBounds) -> Self {
        let speed_rad_s = bounds.speed_rad_s;
        Self { step: Step::Rubbing, bounds, speed_rad_s, ..Self::default() }
    }

    /// Ends a run; one that has ended stays as it is.
    pub fn end(&mut self, reason: Reason) {
        if self.is_running() {
            (self.step, self.reason) = (Step::Aborted, reason);
        }
    }

    /// Whether it moves the joint.
    pub fn is_running(&self) -> bool {
        self.step == Step::Rubbing
    }

    /// Where it is.
    pub const fn step(&self) -> Step {
        self.step
    }

    /// Why it ended.
    pub const fn reason(&self) -> Reason {
        self.reason
    }

    /// What it may do.
    pub const fn bounds(&self) -> &FrictionBounds {
        &self.bounds
    }

    /// Once a millisecond, while it runs: the velocity the joint is to have, rad/s.
    pub fn take(&mut self, seen: &Seen) -> f32 {
        self.all += 1;
        self.pass += 1;
        let Seen { position_rad, velocity_rad_s, asked_a } = *seen;
        let from_rad = *self.from_rad.get_or_insert(position_rad);
        let at_rad = position_rad - from_rad;
        let at_bound = asked_a.abs() >= AT_BOUND * self.bounds.current_a;
        self.held = if at_bound { self.held + 1 } else { 0 };
        let too_fast = TOO_FAST * self.bounds.speed_rad_s + TOO_FAST_RAD_S;
        let ended = if self.all > LONGEST {
            Reason::Time
        } else if self.held > HELD {
            Reason::JointHeld
        } else if velocity_rad_s.abs() > too_fast {
            Reason::TooFast
        } else if at_rad.abs() > self.bounds.travel_rad {
            Reason::Travel
        } else {
            Reason::None
        };
        // A number that is none passes no comparison above, and this one.
        if ended != Reason::None || !(at_rad + velocity_rad_s).is_finite() {
            self.end(if ended == Reason::None { Reason::NoAnswer } else { ended });
            return 0.0;
        }
        let (ahead_rad, speed_rad_s) =
            if self.backwards { (-at_rad, -velocity_rad_s) } else { (at_rad, velocity_rad_s) };
        let stops_in_rad =
            speed_rad_s * (LATE_S + 0.5 * speed_rad_s.max(0.0) / self.bounds.acceleration_rad_s2);
        if self.pass >= PASS || ahead_rad + stops_in_rad > TURNS_AT * self.bounds.travel_rad {
            self.turn_back();
        }
        if self.backwards { -self.speed_rad_s } else { self.speed_rad_s }
    }

    fn turn_back(&mut self) {
        self.pass = 0;
        self.backwards = !self.backwards;
        if !self.backwards {
            self.level += 1;
            self.speed_rad_s *= NEXT;
        }
        if self.level >= LEVELS {
            self.step = Step::Done;
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

    /// A joint that follows at once, but for what `moves` makes of it; how far it went, and the speeds it was asked for.
    fn run(moves: impl Fn(u32, f32) -> (f32, f32)) -> (FrictionRun, f32, Vec<f32>) {
        let mut run = FrictionRun::begin(BOUNDS);
        let (mut at, mut farthest, mut speed, mut asked_a) = (3.0f32, 0.0f32, 0.0f32, 0.0f32);
        let mut speeds = Vec::new();
        for ms in 0..200_000 {
            let target = run.take(&Seen { position_rad: at, velocity_rad_s: speed, asked_a });
            if !run.is_running() {
                break;
            }
            if speeds.last() != Some(&target) {
                speeds.push(target);
            }
            let wanted = speed + (target - speed).clamp(-0.02, 0.02);
            (speed, asked_a) = moves(ms, wanted);
            at += 1e-3 * speed;
            farthest = farthest.max((at - 3.0).abs());
        }
        (run, farthest, speeds)
    }

    #[test]
    fn it_goes_down_its_speeds_both_ways_and_stays_in_its_range() {
        let (run, farthest, speeds) = run(|_, speed| (speed, 1.0));
        assert_eq!((run.step(), run.reason()), (Step::Done, Reason::None));
        assert!((0.4..0.5).contains(&farthest), "{farthest}");
        assert_eq!(speeds.len(), 2 * usize::from(LEVELS));
        assert!(speeds.chunks(2).all(|pair| pair[0] == -pair[1] && pair[0] > 0.0));
        assert!(speeds[26] < 0.05 && speeds[26] > 0.04, "{}", speeds[26]);
    }

    #[test]
    fn each_bound_ends_it() {
        // It stands at its current's bound; runs off; is not stopped at the end; says nothing.
        let (held, ..) = run(|_, _| (0.0, 8.0));
        assert_eq!(held.reason(), Reason::JointHeld);
        let (fast, ..) = run(|ms, speed| (if ms > 50 { 3.5 } else { speed }, 1.0));
        assert_eq!(fast.reason(), Reason::TooFast);
        let (on, farthest, _) = run(|_, speed| (speed.abs().max(0.5), 1.0));
        assert_eq!(on.reason(), Reason::Travel);
        assert!(farthest < 0.51);
        let (none, ..) = run(|_, _| (f32::NAN, 1.0));
        assert_eq!(none.reason(), Reason::NoAnswer);
        // And one that never gets anywhere: by time, within a minute and a half.
        let (slow, ..) = run(|_, _| (0.0, 1.0));
        assert_eq!(slow.step(), Step::Done);
    }
}
