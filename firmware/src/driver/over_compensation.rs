//! Detection of over-compensation: a model with more friction than the joint, so that the compensation drives a
//! limit cycle.
//!
//! ```text
//! means while sliding, per direction:   excess = <-r sign(v)>,  friction = <|model's friction|>
//! q = (excess forward + excess backward) / (friction forward + friction backward)
//! ```
//! A torque that opposes motion in both directions is friction. A load, an offset and a slope cancel between the
//! two directions, and a wrong inertia cancels over a reversal. So the joint has the share `(1 - q)` of the
//! model's friction, and a higher compensation is too much. Then the share of the compensation is reduced to
//! nine tenths of the friction present, and a limit code reports it. The share never exceeds the scale of the
//! parameters. The data come from the limit cycle itself: a joint that swings slides in both directions.

use super::loop_data::REPORT_PERIOD_S;

/// Sliding time that the means reach back, s per direction: a few swings of a limit cycle at 1 Hz. A shorter memory leaves
/// a residual swing behind an elastic coupling, a longer one reacts too late to a stuck sensor.
const MEMORY_S: f32 = 1.0;
/// Minimum sliding time per direction before the means are used, s; see docs/src/reference/closed-loop.md.
const MIN_SLIDING_S: f32 = 0.5;
/// Minimum speed of sliding, rad/s. Below it, the bristles hold a torque that the model cannot predict.
const MIN_SLIDING_RAD_S: f32 = 0.05;
/// Share of the friction present that stays compensated: the default scale of the compensator.
const TARGET_SHARE: f32 = 0.9;
/// Minimum share of the compensation. The closed-loop figures do not depend on this and the next constant.
const MIN_SHARE: f32 = 0.2;
/// Hysteresis: over-compensation ends when the scale is this far below the limit.
const HYSTERESIS: f32 = 0.05;

#[derive(Clone, Copy, Debug, Default)]
struct DirectionMeans {
    excess_nm: f32,
    friction_nm: f32,
    slid_s: f32,
}

impl DirectionMeans {
    fn take(&mut self, excess_nm: f32, friction_nm: f32) {
        self.slid_s = (self.slid_s + REPORT_PERIOD_S).min(MEMORY_S);
        // The plain mean until the memory is full.
        let share = REPORT_PERIOD_S / self.slid_s;
        self.excess_nm += share * (excess_nm - self.excess_nm);
        self.friction_nm += share * (friction_nm - self.friction_nm);
    }
}

/// Result of the detection.
#[derive(Clone, Copy, Debug, Default)]
pub struct OverCompensationWatch {
    directions: [DirectionMeans; 2],
    is_over: bool,
}

/// Values of one report.
#[derive(Clone, Copy, Debug)]
pub struct SlidingSample {
    /// Residual torque that the model does not explain, Nm.
    pub residual_nm: f32,
    /// Friction torque of the model, Nm.
    pub friction_nm: f32,
    /// Velocity, rad/s.
    pub velocity_rad_s: f32,
}

impl OverCompensationWatch {
    /// Processes a report of a joint that is compensated by `scale` of its model, 0..=1. A report with NaN is
    /// ignored.
    pub fn step(&mut self, slid: &SlidingSample, scale: f32) {
        let SlidingSample { residual_nm, friction_nm, velocity_rad_s } = *slid;
        let sign = if velocity_rad_s > 0.0 { 1.0 } else { -1.0 };
        let slides = velocity_rad_s.abs() > MIN_SLIDING_RAD_S;
        if !slides || !(residual_nm * friction_nm).is_finite() {
            return;
        }
        let [forward, backward] = &mut self.directions;
        let way = if velocity_rad_s > 0.0 { forward } else { backward };
        way.take(-sign * residual_nm, sign * friction_nm);
        let beyond = scale - (1.0 - self.excess_share());
        self.is_over = beyond > if self.is_over { -HYSTERESIS } else { 0.0 };
    }

    /// Returns `q`: the share of the model's friction that the joint does not have; 0 if unknown.
    pub fn excess_share(&self) -> f32 {
        let [forward, backward] = self.directions;
        let friction_nm = forward.friction_nm + backward.friction_nm;
        if forward.slid_s < MIN_SLIDING_S || backward.slid_s < MIN_SLIDING_S || friction_nm <= 0.0 {
            return 0.0;
        }
        ((forward.excess_nm + backward.excess_nm) / friction_nm).clamp(0.0, 1.0)
    }

    /// Returns true if the compensation exceeds the joint's friction.
    pub const fn is_detected(&self) -> bool {
        self.is_over
    }

    /// Returns the share of the compensation in use, 0..=1, for a joint that is compensated by `scale`.
    pub fn share(&self, scale: f32) -> f32 {
        if !self.is_over || scale <= 0.0 {
            return 1.0;
        }
        (TARGET_SHARE * (1.0 - self.excess_share()) / scale).clamp(MIN_SHARE, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Simulates strokes in both directions under `load_nm`. The model has `times` the friction of 2 Nm.
    fn strokes(times: f32, load_nm: f32, scale: f32) -> OverCompensationWatch {
        let mut detection = OverCompensationWatch::default();
        for ms in 0..4000 {
            let velocity_rad_s = (ms as f32 * 6.283e-3).sin();
            let sign = velocity_rad_s.signum();
            let (friction_nm, truth) = (2.0 * times * sign, 2.0 * sign + load_nm);
            let residual_nm = truth - friction_nm;
            detection.step(&SlidingSample { residual_nm, friction_nm, velocity_rad_s }, scale);
        }
        detection
    }

    #[test]
    fn over_compensation_is_detected_and_reduced_to_nine_tenths() {
        for load_nm in [0.0, 1.5, -1.5] {
            let detection = strokes(1.2, load_nm, 0.9);
            assert!(
                (detection.excess_share() - 1.0 / 6.0).abs() < 0.01,
                "{}",
                detection.excess_share()
            );
            assert!(detection.is_detected());
            // 0.9 of the joint's own friction, for a model that is 20 % too high and a scale of 0.9.
            assert!((1.2 * 0.9 * detection.share(0.9) - 0.9).abs() < 0.01);
        }
    }

    #[test]
    fn matching_model_is_not_reduced() {
        for (times, scale) in [(1.0, 0.9), (0.8, 0.9), (1.05, 0.9), (1.2, 0.5)] {
            let detection = strokes(times, 0.5, scale);
            assert!(!detection.is_detected(), "x{times} at {scale}");
            assert_eq!(detection.share(scale), 1.0);
        }
        // One direction alone is not enough: the torque may be a load.
        let mut detection = OverCompensationWatch::default();
        for _ in 0..5000 {
            detection.step(
                &SlidingSample { residual_nm: -1.0, friction_nm: 2.0, velocity_rad_s: 1.0 },
                0.9,
            );
            detection.step(
                &SlidingSample { residual_nm: f32::NAN, friction_nm: 2.0, velocity_rad_s: -1.0 },
                0.9,
            );
        }
        assert_eq!((detection.excess_share(), detection.share(0.9)), (0.0, 1.0));
    }
}
