//! The decision about a new set: a gain is proven, or the former set returns.

use crate::score::{Scored, gains};
use firmware::control::ENCODER_ERROR_RAD;
use friction_results::tune::{TuneGain, TuneQuantity};

/// Least gain, at the lower end of its interval, for which parameters are changed. A smaller one may be the luck of a refit.
const MIN_GAIN: f64 = 0.05;
/// Loss, at the upper end of the interval, that counts as worse.
const WORSE: f64 = -0.02;
/// Largest proven increase of the current, if it exceeds [`CONTINUOUS_SHARE`] of the rated one.
const MAX_CURRENT_INCREASE: f64 = 0.1;
/// Share of the rated current that a joint bears continuously whatever its motor.
const CONTINUOUS_SHARE: f64 = 0.4;
/// Ratio of the swing at rest to that of the former set, and swing that is never too much, rad.
const SWING_RATIO: f64 = 2.0;
const SMALL_SWING_RAD: f64 = 5e-4;
/// Ratio of the fast part of the current to that of the former set, and size that is never too much, A.
const CURRENT_STEP_RATIO: f64 = 2.5;
const SMALL_CURRENT_STEP_A: f64 = 0.15;

/// The decision.
#[derive(Clone, Debug)]
pub struct Verdict {
    /// The new set is proven to be better, and worse in nothing.
    pub is_proven: bool,
    /// Why not, as a sentence; empty if it is.
    pub why: String,
    /// The gains; empty if the trial was not completed.
    pub gains: Vec<TuneGain>,
}

impl Verdict {
    /// Returns the decision for the former set, without a completed trial.
    pub fn returned(why: &str) -> Self {
        Self { is_proven: false, why: why.to_owned(), gains: Vec::new() }
    }

    /// Returns the gain of the tracking error; 0 without a completed trial.
    pub fn tracking_gain(&self) -> f64 {
        let found = self.gains.iter().find(|own| own.quantity == TuneQuantity::TrackingRms);
        found.map_or(0.0, |own| own.gain)
    }
}

/// Returns the mean logarithm of both errors relative to those of the former set: negative is better.
pub fn cost(former: &Scored, new: &Scored) -> f64 {
    let ratio = |place: usize| (new.scores[place] / former.scores[place].max(1e-9)).max(1e-6).ln();
    0.5 * (ratio(0) + ratio(1))
}

/// Returns why a block oscillates, compared with one of the former set.
pub fn oscillates(former: &Scored, new: &Scored) -> Option<String> {
    let (old, own) = (&former.health, &new.health);
    let swing = (SWING_RATIO * old.swing_rad).max(SMALL_SWING_RAD);
    if own.swing_rad > swing {
        return Some(format!(
            "the joint swings by {:.4} rad at rest with the new set, and by {:.4} rad with the former one",
            own.swing_rad, old.swing_rad
        ));
    }
    let step = (CURRENT_STEP_RATIO * old.current_step_a).max(SMALL_CURRENT_STEP_A);
    (own.current_step_a > step).then(|| {
        format!(
            "the current is rough with the new set: {:.3} A from millisecond to millisecond, {:.3} A with the former one",
            own.current_step_a, old.current_step_a
        )
    })
}

/// What the joint can show.
#[derive(Clone, Copy, Debug)]
pub struct Means {
    /// Motor turns per joint turn.
    pub gear_ratio: f64,
    /// Rated current, A.
    pub rated_a: f64,
}

impl Means {
    /// Returns what the encoder of the motor may be wrong by at the joint, rad: a smaller change of an error may be one of the
    /// motor alone.
    pub fn resolution_rad(&self) -> f64 {
        f64::from(ENCODER_ERROR_RAD) / self.gear_ratio
    }
}

/// Decides from pairs of blocks: former set, new set.
pub fn verdict(pairs: &[[Scored; 2]], means: &Means, seed: u64) -> Verdict {
    let gains = gains(pairs, seed);
    let of = |quantity: TuneQuantity| gains.iter().find(|own| own.quantity == quantity);
    let errors = [TuneQuantity::ReversalError, TuneQuantity::TrackingRms];
    let resolution_rad = means.resolution_rad();
    let is_visible = |own: &&TuneGain| (own.before - own.after).abs() > resolution_rad;
    let worse =
        errors.iter().filter_map(|own| of(*own)).filter(is_visible).find(|own| own.ci95[1] < WORSE);
    let current = of(TuneQuantity::CurrentRms).filter(|own| {
        own.ci95[1] < -MAX_CURRENT_INCREASE && own.after > CONTINUOUS_SHARE * means.rated_a
    });
    let stuck = of(TuneQuantity::StuckTime).filter(|own| own.ci95[1] < WORSE && own.after > 0.05);
    let why = if let Some(own) = worse.or(current).or(stuck) {
        format!(
            "the {} is worse by {:.0} % (95 % interval {:.0} to {:.0} %)",
            own.quantity.in_words(),
            -100.0 * own.gain,
            -100.0 * own.ci95[1],
            -100.0 * own.ci95[0]
        )
    } else if errors
        .iter()
        .filter_map(|own| of(*own))
        .filter(is_visible)
        .any(|own| own.ci95[0] > MIN_GAIN)
    {
        String::new()
    } else if !errors.iter().filter_map(|own| of(*own)).any(|own| is_visible(&own)) {
        format!(
            "both errors change by less than {:.2} mrad, which the encoder may be wrong by: no gain can be proven",
            1e3 * resolution_rad
        )
    } else {
        let best = errors
            .iter()
            .filter_map(|own| of(*own))
            .fold(f64::NEG_INFINITY, |a, b| a.max(b.ci95[0]));
        format!(
            "no gain is proven: of the two errors, the larger lower bound of the gain is {:.0} %, and {:.0} % is required",
            100.0 * best,
            100.0 * MIN_GAIN
        )
    };
    Verdict { is_proven: why.is_empty(), why, gains }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::Health;

    fn pairs(former: [f64; 4], new: [f64; 4]) -> Vec<[Scored; 2]> {
        let scored = |scores: [f64; 4], share: f64| Scored {
            scores: scores.map(|value| value * share),
            health: Health::default(),
        };
        [1.0, 1.02, 0.99, 1.01]
            .iter()
            .map(|share| [scored(former, *share), scored(new, 2.0 - share)])
            .collect()
    }

    #[test]
    fn verdict_needs_a_gain_and_nothing_worse() {
        let former = [1.0, 1.0, 1.0, 0.0];
        let means = Means { gear_ratio: 50.0, rated_a: 2.0 };
        let verdict = |pairs: &[[Scored; 2]], seed| verdict(pairs, &means, seed);
        assert!(verdict(&pairs(former, [0.5, 0.6, 1.0, 0.0]), 1).is_proven);
        let mut reasons = String::new();
        for (new, figure) in [
            ([0.97, 0.98, 1.0, 0.0], "%"),
            ([0.5, 1.2, 1.0, 0.0], " 19 %"),
            ([0.5, 0.6, 1.4, 0.0], " 39 %"),
        ] {
            let refused = verdict(&pairs(former, new), 1);
            assert!(!refused.is_proven && refused.why.contains(figure), "{}", refused.why);
            reasons += &format!("{}\n", refused.why);
        }
        crate::snapshot::check("session", "verdicts without a gain", &reasons);
    }

    #[test]
    fn changes_below_the_error_of_the_encoder_prove_nothing() {
        let means = Means { gear_ratio: 50.0, rated_a: 2.0 };
        let small = [3e-4, 1e-4, 0.5, 0.0];
        let refused = verdict(&pairs(small, small.map(|value| 0.5 * value)), &means, 1);
        assert!(!refused.is_proven && refused.why.contains(" 0.40 mrad"), "{}", refused.why);
        crate::snapshot::check("session", "changes below the error of the encoder", &refused.why);
    }

    #[test]
    fn oscillation_is_measured_against_the_former_set() {
        let scored = |swing_rad: f64, current_step_a: f64| Scored {
            scores: [1.0; 4],
            health: Health { swing_rad, current_step_a, worst_error_rad: 0.0 },
        };
        let calm = scored(0.001, 0.1);
        assert_eq!(oscillates(&calm, &scored(0.0018, 0.2)), None);
        assert!(oscillates(&calm, &scored(0.003, 0.1)).is_some_and(|why| why.contains("swings")));
        assert!(oscillates(&calm, &scored(0.001, 0.4)).is_some_and(|why| why.contains("rough")));
    }
}
