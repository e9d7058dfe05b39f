//! Does the model have more friction than the joint? Then what is compensated of it drives the joint, and it swings.
//!
//! ```text
//! over sliding, each way by itself:   excess = <-r sign(v)>,  friction = <|model's friction|>
//! q = (excess there + excess back) / (friction there + friction back)
//! ```
//! What stands against motion whichever way it goes is friction; a load, an offset, a slope cancel between the two ways, and an
//! inertia that is wrong does over a reversal. So `(1 - q)` of the model is what the joint has, and compensating more than that
//! of it is too much. Then the share of the compensation goes down to nine tenths of what is there, and a limit says so; it never
//! goes above what the parameters ask for. Seen from the limit cycle itself: a joint that swings slides, both ways.

use crate::driver::REPORT_PERIOD_S;

/// Sliding that the means reach back over, s each way: some swings of a limit cycle at 1 Hz. Half of it leaves 9 mrad of swing
/// behind a coupling that bends where this leaves 0.2; twice of it leaves 7 mrad where a sensor goes on saying the same, and
/// this 0.2 (closed loop, scenarios 14 and 13).
const MEMORY_S: f32 = 1.0;
/// Sliding each way before the means are worth a word, s. What half and twice cost, of this and the next: docs/closed-loop.md.
const SETTLED_S: f32 = 0.5;
/// Slower than this the joint does not slide, rad/s: its bristles hold what the model cannot know.
const SLIDES_RAD_S: f32 = 0.05;
/// Share of the friction there is that stays compensated: the compensator's own default.
const LEAVES: f32 = 0.9;
/// Least share that is left. Half and twice of it move no figure of the closed loop; so of the next.
const LEAST: f32 = 0.2;
/// Over-compensation is over when the model has so much less friction than would be too much.
const BACK: f32 = 0.05;

#[derive(Clone, Copy, Debug, Default)]
struct Way {
    excess_nm: f32,
    friction_nm: f32,
    slid_s: f32,
}

impl Way {
    fn take(&mut self, excess_nm: f32, friction_nm: f32) {
        self.slid_s = (self.slid_s + REPORT_PERIOD_S).min(MEMORY_S);
        // A mean of all there is, until there is more than it remembers.
        let share = REPORT_PERIOD_S / self.slid_s;
        self.excess_nm += share * (excess_nm - self.excess_nm);
        self.friction_nm += share * (friction_nm - self.friction_nm);
    }
}

/// What was seen.
#[derive(Clone, Copy, Debug, Default)]
pub struct OverCompensation {
    ways: [Way; 2],
    too_much: bool,
}

/// A report's part of it.
#[derive(Clone, Copy, Debug)]
pub struct Slid {
    /// What no part of the model explains, Nm.
    pub residual_nm: f32,
    /// The model's friction, Nm.
    pub friction_nm: f32,
    /// Velocity, rad/s.
    pub velocity_rad_s: f32,
}

impl OverCompensation {
    /// A report of a joint that is compensated by `scale` of its model, 0..=1. One that says nothing of the model is passed over.
    pub fn step(&mut self, slid: &Slid, scale: f32) {
        let Slid { residual_nm, friction_nm, velocity_rad_s } = *slid;
        let sign = if velocity_rad_s > 0.0 { 1.0 } else { -1.0 };
        let slides = velocity_rad_s.abs() > SLIDES_RAD_S;
        if !slides || !(residual_nm * friction_nm).is_finite() {
            return;
        }
        let [there, back] = &mut self.ways;
        let way = if velocity_rad_s > 0.0 { there } else { back };
        way.take(-sign * residual_nm, sign * friction_nm);
        let beyond = scale - (1.0 - self.excess_share());
        self.too_much = beyond > if self.too_much { -BACK } else { 0.0 };
    }

    /// `q`: the share of the model's friction that the joint does not have; 0 where that is not known.
    pub fn excess_share(&self) -> f32 {
        let [there, back] = self.ways;
        let friction_nm = there.friction_nm + back.friction_nm;
        if there.slid_s < SETTLED_S || back.slid_s < SETTLED_S || friction_nm <= 0.0 {
            return 0.0;
        }
        ((there.excess_nm + back.excess_nm) / friction_nm).clamp(0.0, 1.0)
    }

    /// Whether the joint is given more than its friction.
    pub const fn is_too_much(&self) -> bool {
        self.too_much
    }

    /// Share of the compensation that is left, 0..=1, of a joint that is compensated by `scale`.
    pub fn share(&self, scale: f32) -> f32 {
        if !self.too_much || scale <= 0.0 {
            return 1.0;
        }
        (LEAVES * (1.0 - self.excess_share()) / scale).clamp(LEAST, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Strokes there and back under `load_nm`, the model having `times` the friction of 2 Nm; what it makes of it.
    fn strokes(times: f32, load_nm: f32, scale: f32) -> OverCompensation {
        let mut seen = OverCompensation::default();
        for ms in 0..4000 {
            let velocity_rad_s = (ms as f32 * 6.283e-3).sin();
            let sign = velocity_rad_s.signum();
            let (friction_nm, truth) = (2.0 * times * sign, 2.0 * sign + load_nm);
            let residual_nm = truth - friction_nm;
            seen.step(&Slid { residual_nm, friction_nm, velocity_rad_s }, scale);
        }
        seen
    }

    #[test]
    fn it_leaves_nine_tenths_of_what_is_there_and_says_so() {
        for load_nm in [0.0, 1.5, -1.5] {
            let seen = strokes(1.2, load_nm, 0.9);
            assert!((seen.excess_share() - 1.0 / 6.0).abs() < 0.01, "{}", seen.excess_share());
            assert!(seen.is_too_much());
            // 0.9 of the joint's own friction, of a model a fifth too high and a scale of 0.9.
            assert!((1.2 * 0.9 * seen.share(0.9) - 0.9).abs() < 0.01);
        }
    }

    #[test]
    fn a_model_that_fits_or_has_too_little_is_left_alone() {
        for (times, scale) in [(1.0, 0.9), (0.8, 0.9), (1.05, 0.9), (1.2, 0.5)] {
            let seen = strokes(times, 0.5, scale);
            assert!(!seen.is_too_much(), "x{times} at {scale}");
            assert_eq!(seen.share(scale), 1.0);
        }
        // One way alone says nothing: what stands against it may be a load.
        let mut seen = OverCompensation::default();
        for _ in 0..5000 {
            seen.step(&Slid { residual_nm: -1.0, friction_nm: 2.0, velocity_rad_s: 1.0 }, 0.9);
            seen.step(&Slid { residual_nm: f32::NAN, friction_nm: 2.0, velocity_rad_s: -1.0 }, 0.9);
        }
        assert_eq!((seen.excess_share(), seen.share(0.9)), (0.0, 1.0));
    }
}
