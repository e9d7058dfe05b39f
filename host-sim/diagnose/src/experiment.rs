//! The experiment that settles most of the doubt about causes that are possible and not certain.
//!
//! An experiment that shows whether a cause of probability `p` is real moves its probability to 0 or to 1. The expected
//! change is `2 p (1 - p)`. The sum over the causes that an experiment shows ranks the experiments.

use compensator_core::Quantity;

/// A standard experiment.
#[derive(Debug)]
pub struct Experiment {
    /// What to do, as a sentence without its end.
    pub instruction: &'static str,
    /// Causes that it shows or excludes.
    pub shows: &'static [&'static str],
    /// Quantity that it changes and logs. A joint whose log does not have it may have no sensor for it.
    pub needs: Option<Quantity>,
}

/// Standard experiments.
pub const EXPERIMENTS: [Experiment; 12] = [
    Experiment {
        instruction: "Reverse slowly, at a tenth of the speed, with several amplitudes",
        shows: &["channel-delay", "backlash", "stribeck-shape"],
        needs: None,
    },
    Experiment {
        instruction: "Change the pressure in steps while the joint moves at a constant speed",
        shows: &["pressure-coulomb"],
        needs: Some(Quantity::Pressure),
    },
    Experiment {
        instruction: "Change the side load between runs of the same motion, and within one of them",
        shows: &["radial-force-coulomb", "radial-force-rate"],
        needs: Some(Quantity::RadialForce),
    },
    Experiment {
        instruction: "Repeat a motion with another load torque",
        shows: &["load-torque-coulomb", "gravity-imbalance"],
        needs: Some(Quantity::LoadTorque),
    },
    Experiment {
        instruction: "Let the joint rest for different times, from a second to minutes, before it breaks away",
        shows: &["dwell-time-static"],
        needs: None,
    },
    Experiment {
        instruction: "Move at one constant speed over several turns, or over the whole stroke, in both directions, with the position logged",
        shows: &["position-ripple", "torque-ripple", "gravity-imbalance", "direction-asymmetry"],
        needs: None,
    },
    Experiment {
        instruction: "Move at six constant speeds up to the highest, in both directions",
        shows: &[
            "quadratic-drag",
            "torque-offset",
            "direction-asymmetry",
            "stribeck-shape",
            // A wave of the motion grows with the square of the speed, one of the torque does not.
            "encoder-error",
        ],
        needs: None,
    },
    Experiment {
        instruction: "Repeat a motion with three accelerations at the same speeds",
        shows: &["unmodelled-inertia"],
        needs: None,
    },
    Experiment {
        instruction: "Move the other joints, one at a time, while this one repeats a motion",
        shows: &["joint-coupling"],
        needs: None,
    },
    Experiment {
        instruction: "Repeat a motion with two other payloads, with the payload logged",
        shows: &["payload"],
        needs: None,
    },
    Experiment {
        instruction: "Run the same motion cold and warm, with the temperature logged",
        shows: &["temperature-viscous", "temperature-coulomb", "warm-up"],
        needs: Some(Quantity::Temperature),
    },
    Experiment {
        instruction: "Repeat the first run at the end of the campaign, after a pause in which the joint cools",
        shows: &["time-drift", "warm-up"],
        needs: None,
    },
];

/// Returns the experiment with the largest expected change of these probabilities, by cause, among those whose quantity is
/// in the log; `None` if none of these shows any of the causes.
pub fn most_informative(
    causes: &[(&str, f64)],
    is_logged: impl Fn(Quantity) -> bool,
) -> Option<&'static Experiment> {
    let change = |experiment: &Experiment| -> f64 {
        let shown = causes.iter().filter(|(cause, _)| experiment.shows.contains(cause));
        shown.map(|(_, p)| 2.0 * p * (1.0 - p)).sum()
    };
    let possible = EXPERIMENTS.iter().filter(|experiment| experiment.needs.is_none_or(&is_logged));
    let best = possible.max_by(|a, b| change(a).total_cmp(&change(b)))?;
    (change(best) > 0.0).then_some(best)
}

#[cfg(test)]
mod tests {
    use super::super::cause::ALL;
    use super::*;

    #[test]
    fn most_informative_follows_the_most_uncertain_causes() {
        let all = |_| true;
        let best = most_informative(&[("pressure-coulomb", 0.5), ("warm-up", 0.02)], all).unwrap();
        assert!(best.shows.contains(&"pressure-coulomb"));
        // Two causes of one experiment outweigh a more uncertain one of another.
        let causes = [("pressure-coulomb", 0.5), ("channel-delay", 0.3), ("backlash", 0.3)];
        assert!(most_informative(&causes, all).unwrap().shows.contains(&"backlash"));
        assert!(most_informative(&[("unknown", 0.5)], all).is_none());
        assert!(most_informative(&[], all).is_none());
    }

    #[test]
    fn most_informative_without_temperature_column_asks_for_no_temperature() {
        let causes = [("warm-up", 0.5), ("temperature-viscous", 0.1)];
        let is_logged = |quantity| quantity != Quantity::Temperature;
        let best = most_informative(&causes, is_logged).unwrap();
        assert!(!best.instruction.contains("temperature") && best.shows.contains(&"warm-up"));
        let best = most_informative(&causes, |_| true).unwrap();
        assert_eq!(best.needs, Some(Quantity::Temperature));
        // The only experiment for this cause needs a column that the log does not have.
        assert!(most_informative(&[("pressure-coulomb", 0.5)], |_| false).is_none());
    }

    #[test]
    fn experiments_show_every_named_cause_of_the_catalogue() {
        let known: Vec<&str> = ALL.iter().filter(|c| c.is_named()).map(|c| c.name()).collect();
        for experiment in &EXPERIMENTS {
            assert!(experiment.shows.iter().all(|cause| known.contains(cause)), "{experiment:?}");
        }
        for cause in known {
            assert!(
                EXPERIMENTS.iter().any(|experiment| experiment.shows.contains(&cause)),
                "{cause}"
            );
        }
    }
}
