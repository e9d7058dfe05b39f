//! The decision about a new set: a gain is proven, or the former set returns. Each part must gain by itself: a friction model
//! without a gain over the new loop gains alone is not handed over.

use crate::gain::gains;
use crate::score::Scored;
use firmware::control::ENCODER_ERROR_RAD;
use friction_results::tune::{TuneArm, TuneGain, TuneParts, TuneQuantity};

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
    /// The set that is proven to be better, and worse in nothing; `None` for the former one.
    pub proven: Option<TuneArm>,
    /// Why the new set, or its friction model, is not handed over, as a sentence; empty if it is.
    pub why: String,
    /// The gains; empty if the trial was not completed.
    pub gains: Vec<TuneGain>,
    /// What each part of the new set contributes.
    pub parts: TuneParts,
}

impl Verdict {
    /// Returns the decision for the former set, without a completed trial.
    pub fn returned(why: &str) -> Self {
        Self { proven: None, why: why.to_owned(), gains: Vec::new(), parts: TuneParts::default() }
    }

    /// Returns the gain of the tracking error; 0 without a completed trial.
    pub fn tracking_gain(&self) -> f64 {
        let found = self.gains.iter().find(|gain| gain.quantity == TuneQuantity::TrackingRms);
        found.map_or(0.0, |found| found.gain)
    }
}

/// Returns the mean logarithm of both errors relative to those of the former set: negative is better.
pub fn cost(former: &Scored, new: &Scored) -> f64 {
    let ratio = |quantity: TuneQuantity| {
        let [new, former] = [new, former].map(|scored| scored.scores.of(quantity));
        (new / former.max(1e-9)).max(1e-6).ln()
    };
    0.5 * (ratio(TuneQuantity::ReversalError) + ratio(TuneQuantity::TrackingRms))
}

/// Returns why a block oscillates, compared with one of the former set.
pub fn oscillates(former: &Scored, new: &Scored) -> Option<String> {
    let (old, tried) = (&former.health, &new.health);
    let swing = (SWING_RATIO * old.swing_rad).max(SMALL_SWING_RAD);
    if tried.swing_rad > swing {
        return Some(format!(
            "the joint swings by {:.4} rad at rest with the new set, and by {:.4} rad with the former one",
            tried.swing_rad, old.swing_rad
        ));
    }
    let step = (CURRENT_STEP_RATIO * old.current_step_a).max(SMALL_CURRENT_STEP_A);
    (tried.current_step_a > step).then(|| {
        format!(
            "the current is rough with the new set: {:.3} A from millisecond to millisecond, {:.3} A with the former one",
            tried.current_step_a, old.current_step_a
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

/// A round of the trial: a block with each set.
pub type Round = Vec<(TuneArm, Scored)>;

/// Returns the blocks of two sets as pairs, a round each; none if a set was not tried.
pub fn pairs(rounds: &[Round], sets: [TuneArm; 2]) -> Vec<[Scored; 2]> {
    let block = |round: &Round, arm: TuneArm| {
        round.iter().find(|(tried, _)| *tried == arm).map(|(_, scored)| *scored)
    };
    let pair = |round: &Round| Some([block(round, sets[0])?, block(round, sets[1])?]);
    rounds.iter().filter_map(pair).collect()
}

/// Decides from the rounds of a trial.
pub fn verdict(rounds: &[Round], means: &Means) -> Verdict {
    use TuneArm::{Former, New, NewLoop};
    let compared = |sets| {
        let pairs = pairs(rounds, sets);
        (!pairs.is_empty()).then(|| judge(&pairs, means))
    };
    let decided =
        |proven: Option<TuneArm>, why: String, gains, parts| Verdict { proven, why, gains, parts };
    match (compared([Former, New]), compared([Former, NewLoop]), compared([NewLoop, New])) {
        (Some(all), Some(of_loop), Some(of_model)) => {
            let parts =
                TuneParts { loop_gains: of_loop.gains.clone(), friction_model: of_model.gains };
            if all.why.is_empty() && of_model.why.is_empty() {
                return decided(Some(New), String::new(), all.gains, parts);
            }
            let why = if of_model.why.is_empty() { all.why } else { of_model.why };
            if of_loop.why.is_empty() {
                return decided(Some(NewLoop), why, of_loop.gains, parts);
            }
            decided(None, why, all.gains, parts)
        }
        (Some(all), ..) => {
            let parts = TuneParts { friction_model: all.gains.clone(), ..TuneParts::default() };
            decided(all.why.is_empty().then_some(New), all.why, all.gains, parts)
        }
        (None, Some(of_loop), _) => {
            let parts = TuneParts { loop_gains: of_loop.gains.clone(), ..TuneParts::default() };
            decided(of_loop.why.is_empty().then_some(NewLoop), of_loop.why, of_loop.gains, parts)
        }
        (None, None, _) => Verdict::returned("the trial has no complete round"),
    }
}

/// The comparison of two sets.
struct Judgement {
    gains: Vec<TuneGain>,
    /// Why no gain is proven, as a sentence; empty if one is, and nothing is worse.
    why: String,
}

/// Compares two sets from pairs of blocks.
fn judge(pairs: &[[Scored; 2]], means: &Means) -> Judgement {
    let gains = gains(pairs);
    let of = |quantity: TuneQuantity| gains.iter().find(|gain| gain.quantity == quantity);
    let errors = [TuneQuantity::ReversalError, TuneQuantity::TrackingRms];
    let resolution_rad = means.resolution_rad();
    let is_visible = |gain: &&TuneGain| (gain.before - gain.after).abs() > resolution_rad;
    let worse = errors
        .iter()
        .filter_map(|error| of(*error))
        .filter(is_visible)
        .find(|gain| gain.ci95[1] < WORSE);
    let current = of(TuneQuantity::CurrentRms).filter(|gain| {
        gain.ci95[1] < -MAX_CURRENT_INCREASE && gain.after > CONTINUOUS_SHARE * means.rated_a
    });
    let stuck =
        of(TuneQuantity::StuckTime).filter(|gain| gain.ci95[1] < WORSE && gain.after > 0.05);
    let why = if let Some(gain) = worse.or(current).or(stuck) {
        format!(
            "the {} is worse by {:.0} % (95 % interval {:.0} to {:.0} %)",
            gain.quantity.in_words(),
            -100.0 * gain.gain,
            -100.0 * gain.ci95[1],
            -100.0 * gain.ci95[0]
        )
    } else if errors
        .iter()
        .filter_map(|error| of(*error))
        .filter(is_visible)
        .any(|gain| gain.ci95[0] > MIN_GAIN)
    {
        String::new()
    } else if !errors.iter().filter_map(|error| of(*error)).any(|gain| is_visible(&gain)) {
        format!(
            "both errors change by less than {:.2} mrad, which the encoder may be wrong by: no gain can be proven",
            1e3 * resolution_rad
        )
    } else {
        let best = errors
            .iter()
            .filter_map(|error| of(*error))
            .fold(f64::NEG_INFINITY, |a, b| a.max(b.ci95[0]));
        format!(
            "no gain is proven: of the two errors, the larger lower bound of the gain is {:.0} %, and {:.0} % is required",
            100.0 * best,
            100.0 * MIN_GAIN
        )
    };
    Judgement { gains, why }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::score::Health;

    const MEANS: Means = Means { gear_ratio: 50.0, rated_a: 2.0 };
    const FORMER: [f64; 4] = [1.0, 1.0, 1.0, 0.0];

    /// Rounds in which each set has these scores, with some noise.
    fn rounds(sets: &[(TuneArm, [f64; 4])]) -> Vec<Round> {
        let scored = |scores: [f64; 4], share: f64| Scored {
            scores: scores.map(|value| value * share).into(),
            health: Health::default(),
        };
        let round = |share: f64| {
            let block = |(at, (arm, scores)): (usize, &(TuneArm, [f64; 4]))| {
                (*arm, scored(*scores, if at % 2 == 0 { share } else { 2.0 - share }))
            };
            sets.iter().enumerate().map(block).collect()
        };
        [1.0, 1.01, 0.995, 1.005].map(round).to_vec()
    }

    fn of_new(former: [f64; 4], new: [f64; 4]) -> Verdict {
        verdict(&rounds(&[(TuneArm::Former, former), (TuneArm::New, new)]), &MEANS)
    }

    #[test]
    fn verdict_needs_a_gain_and_nothing_worse() {
        assert_eq!(of_new(FORMER, [0.5, 0.6, 1.0, 0.0]).proven, Some(TuneArm::New));
        let mut reasons = String::new();
        for (new, figure) in [
            ([0.97, 0.98, 1.0, 0.0], "%"),
            ([0.5, 1.2, 1.0, 0.0], " 19 %"),
            ([0.5, 0.6, 1.4, 0.0], " 39 %"),
        ] {
            let refused = of_new(FORMER, new);
            assert!(refused.proven.is_none() && refused.why.contains(figure), "{}", refused.why);
            reasons += &format!("{}\n", refused.why);
        }
        crate::snapshot::check("session", "verdicts without a gain", &reasons);
    }

    #[test]
    fn verdict_hands_over_the_parts_that_gain() {
        let of = |of_loop: f64, new: f64| {
            let scores = |value: f64| [value, value, 1.0, 0.0];
            let sets = [
                (TuneArm::Former, FORMER),
                (TuneArm::NewLoop, scores(of_loop)),
                (TuneArm::New, scores(new)),
            ];
            verdict(&rounds(&sets), &MEANS)
        };
        let both = of(0.1, 0.05);
        assert_eq!((both.proven, both.why.as_str()), (Some(TuneArm::New), ""));
        let [of_loop, of_model] = [&both.parts.loop_gains[0], &both.parts.friction_model[0]];
        assert!((of_loop.gain - 0.9).abs() < 0.02 && (of_model.gain - 0.5).abs() < 0.02);
        assert!((both.gains[0].gain - 0.95).abs() < 0.01);
        for new in [0.1, 0.2] {
            let without_model = of(0.1, new);
            assert_eq!(without_model.proven, Some(TuneArm::NewLoop), "{new}");
            assert!(!without_model.why.is_empty());
            assert!((without_model.gains[0].gain - 0.9).abs() < 0.02, "of what is handed over");
        }
        assert_eq!(of(1.3, 0.5).proven, Some(TuneArm::New), "the model makes up for the loop");
        // Neither part is proven by itself.
        assert_eq!(of(0.97, 0.94).proven, None);
    }

    #[test]
    fn changes_below_the_error_of_the_encoder_prove_nothing() {
        let small = [3e-4, 1e-4, 0.5, 0.0];
        let refused = of_new(small, small.map(|value| 0.5 * value));
        assert!(refused.proven.is_none() && refused.why.contains(" 0.40 mrad"), "{}", refused.why);
        crate::snapshot::check("session", "changes below the error of the encoder", &refused.why);
    }

    #[test]
    fn oscillation_is_measured_against_the_former_set() {
        let scored = |swing_rad: f64, current_step_a: f64| Scored {
            scores: [1.0; 4].into(),
            health: Health { swing_rad, current_step_a, worst_error_rad: 0.0 },
        };
        let calm = scored(0.001, 0.1);
        assert_eq!(oscillates(&calm, &scored(0.0018, 0.2)), None);
        assert!(oscillates(&calm, &scored(0.003, 0.1)).is_some_and(|why| why.contains("swings")));
        assert!(oscillates(&calm, &scored(0.001, 0.4)).is_some_and(|why| why.contains("rough")));
    }
}
