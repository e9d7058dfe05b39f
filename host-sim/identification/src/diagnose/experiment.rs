//! The experiment that settles most of the doubt about causes that are possible and not certain.
//!
//! An experiment that shows whether a cause of probability `p` is real moves its probability to 0 or to 1. The expected
//! change is `2 p (1 - p)`. The sum over the causes that an experiment shows ranks the experiments.

/// A standard experiment.
#[derive(Debug)]
pub struct Experiment {
    /// What to do, as a sentence without its end.
    pub instruction: &'static str,
    /// Causes that it shows or excludes.
    pub shows: &'static [&'static str],
}

/// Standard experiments.
pub const EXPERIMENTS: [Experiment; 10] = [
    Experiment {
        instruction: "Reverse slowly, at a tenth of the speed, with several amplitudes",
        shows: &["channel-delay", "backlash", "stribeck-shape"],
    },
    Experiment {
        instruction: "Change the pressure in steps while the joint moves at a constant speed",
        shows: &["pressure-coulomb"],
    },
    Experiment {
        instruction: "Change the side load between runs of the same motion, and within one of them",
        shows: &["radial-force-coulomb", "radial-force-rate"],
    },
    Experiment {
        instruction: "Repeat a motion with another load torque",
        shows: &["load-torque-coulomb", "gravity-imbalance"],
    },
    Experiment {
        instruction: "Let the joint rest for different times, from a second to minutes, before it breaks away",
        shows: &["dwell-time-static"],
    },
    Experiment {
        instruction: "Move at one constant speed over several turns in both directions, with the position logged",
        shows: &["position-ripple", "torque-ripple", "gravity-imbalance", "direction-asymmetry"],
    },
    Experiment {
        instruction: "Move at six constant speeds up to the highest, in both directions",
        shows: &["quadratic-drag", "torque-offset", "direction-asymmetry", "stribeck-shape"],
    },
    Experiment {
        instruction: "Repeat a motion with three accelerations at the same speeds",
        shows: &["unmodelled-inertia"],
    },
    Experiment {
        instruction: "Run the same motion cold and warm, with the temperature logged",
        shows: &["temperature-viscous", "temperature-coulomb", "warm-up"],
    },
    Experiment {
        instruction: "Repeat the first run at the end of the campaign, after a pause in which the joint cools",
        shows: &["time-drift", "warm-up"],
    },
];

/// Returns the experiment with the largest expected change of these probabilities, by cause; `None` if no experiment
/// shows any of the causes.
pub fn most_informative(causes: &[(&str, f64)]) -> Option<&'static Experiment> {
    let change = |experiment: &Experiment| -> f64 {
        let shown = causes.iter().filter(|(cause, _)| experiment.shows.contains(cause));
        shown.map(|(_, p)| 2.0 * p * (1.0 - p)).sum()
    };
    let best = EXPERIMENTS.iter().max_by(|a, b| change(a).total_cmp(&change(b)))?;
    (change(best) > 0.0).then_some(best)
}

#[cfg(test)]
mod tests {
    use super::super::cause::ALL;
    use super::*;

    #[test]
    fn most_informative_follows_the_most_uncertain_causes() {
        let best = most_informative(&[("pressure-coulomb", 0.5), ("warm-up", 0.02)]).unwrap();
        assert!(best.shows.contains(&"pressure-coulomb"));
        // Two causes of one experiment outweigh a more uncertain one of another.
        let best = most_informative(&[
            ("pressure-coulomb", 0.5),
            ("channel-delay", 0.3),
            ("backlash", 0.3),
        ]);
        assert!(best.unwrap().shows.contains(&"backlash"));
        assert!(most_informative(&[("unknown", 0.5)]).is_none());
        assert!(most_informative(&[]).is_none());
    }

    #[test]
    fn experiments_show_every_named_cause_of_the_catalogue() {
        let known: Vec<&str> = ALL.iter().filter(|c| c.is_named()).map(|c| c.name()).collect();
        for experiment in &EXPERIMENTS {
            assert!(experiment.shows.iter().all(|cause| known.contains(cause)), "{experiment:?}");
        }
        for cause in known {
            assert!(EXPERIMENTS.iter().any(|own| own.shows.contains(&cause)), "{cause}");
        }
    }
}
