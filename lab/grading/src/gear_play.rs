//! Play between two encoders on drawn joints: what the diagnosis finds of it, and the calibration of its probability.
//!
//! A joint has play, or another error of its difference of positions that is large ([`GearFault`]). Half of the joints have play.

use crate::GradingError;
use friction_diagnose::two_positions::{Calibration, FIGURES, TwoPositions};
use joint_log::Dataset;
use joint_log::log_check::{self, Corrections};
use rayon::prelude::*;
use unkind_worlds::two_sided_joint::{GearFault, TwoSidedJoint, draw};

/// A drawn joint with what was found.
pub struct PlayCase {
    /// What the joint has.
    pub fault: GearFault,
    /// Seed of the joint.
    pub seed: u64,
    /// The joint.
    pub joint: TwoSidedJoint,
    /// What the diagnosis finds; `None` if the log does not determine it.
    pub found: Option<TwoPositions>,
}

/// Returns the log of a joint, read and corrected as a measured one.
///
/// # Errors
/// Returns an error if the columns are no log.
pub fn log(joint: &TwoSidedJoint, seed: u64) -> Result<log_check::CheckedLog, GradingError> {
    let names: Vec<String> = joint.columns().into_iter().map(str::to_owned).collect();
    let runs = joint.record(seed).into_iter().map(|mut run| {
        run.columns.truncate(names.len());
        (run.name, run.columns)
    });
    let data = Dataset::from_columns(&names, runs)?;
    Ok(log_check::check(data, Corrections::default()))
}

/// Draws joints and evaluates them: as many with play as with all other faults together.
///
/// # Errors
/// As [`log`].
pub fn cases(first_seed: u64, joints: usize) -> Result<Vec<PlayCase>, GradingError> {
    let others = GearFault::ALL.len() - 1;
    let drawn = (0..joints).map(|at| {
        let fault = if at % 2 == 0 { GearFault::Play } else { GearFault::ALL[1 + at / 2 % others] };
        (fault, first_seed + at as u64)
    });
    let drawn: Vec<(GearFault, u64)> = drawn.collect();
    let case = |(fault, seed): &(GearFault, u64)| {
        let joint = draw(*fault, *seed);
        let found = TwoPositions::of(&log(&joint, *seed)?.data).and_then(Result::ok);
        Ok(PlayCase { fault: *fault, seed: *seed, joint, found })
    };
    drawn.par_iter().map(case).collect()
}

/// Share of the joints that have play, for which the probability is calibrated. Every gear winds up, and of few can it be told from
/// play at all, so a wrong name costs more than a missed one.
const PRIOR: f64 = 0.1;

/// Penalty of the squared weights, in cases.
const PENALTY: f64 = 0.5;

/// Steps of the descent.
const STEPS: usize = 40_000;

/// Fits the weights of the figures: a logistic regression with weights of at least 0, by projected descent.
pub fn fit(cases: &[PlayCase]) -> Calibration {
    let is_play = |case: &PlayCase| case.fault == GearFault::Play;
    let with_play = cases.iter().filter(|case| is_play(case)).count().max(1) as f64;
    let others = (cases.len() as f64 - with_play).max(1.0);
    let weight = |play: bool| if play { PRIOR / with_play } else { (1.0 - PRIOR) / others };
    let figures_of_cases: Vec<([f64; FIGURES.len()], bool)> = cases
        .iter()
        .filter_map(|case| {
            let found = case.found.as_ref().filter(|found| found.play.value > 0.0)?;
            Some((found.figures, is_play(case)))
        })
        .collect();
    let mean: Vec<f64> = (0..FIGURES.len())
        .map(|at| {
            figures_of_cases.iter().map(|(figures, _)| figures[at]).sum::<f64>()
                / figures_of_cases.len().max(1) as f64
        })
        .collect();
    let (mut start, mut weights) = (0.0, [0.0; FIGURES.len()]);
    for _ in 0..STEPS {
        let (mut of_start, mut of_weights) = (0.0, [0.0; FIGURES.len()]);
        for (figures, play) in &figures_of_cases {
            let centred = |at: usize| figures[at] - mean[at];
            let sum: f64 = (0..FIGURES.len()).map(|at| weights[at] * centred(at)).sum();
            let target = f64::from(u8::from(*play));
            let error = weight(*play) * (target - 1.0 / (1.0 + f64::exp(-start - sum)));
            of_start += error;
            (0..FIGURES.len()).for_each(|at| of_weights[at] += error * centred(at));
        }
        start += of_start;
        for (weight, slope) in weights.iter_mut().zip(of_weights) {
            *weight = (*weight + 0.3 * (slope - PENALTY * *weight / cases.len() as f64)).max(0.0);
        }
    }
    let shift: f64 = weights.iter().zip(&mean).map(|(weight, mean)| weight * mean).sum();
    Calibration { name: format!("{} simulated joints", cases.len()), start: start - shift, weights }
}

/// A finding within this share of the true play counts as right in its size.
pub const TOLERANCE: f64 = 0.3;

impl PlayCase {
    /// Returns what was found if it is named.
    pub fn named(&self) -> Option<&TwoPositions> {
        self.found.as_ref().filter(|found| found.is_named())
    }

    /// Returns the torsion under the friction of the load at both reversals, rad.
    pub fn torsion_rad(&self) -> f64 {
        2.0 * self.joint.frictions[1].coulomb_nm / self.joint.gear.stiffness_nm_per_rad
    }
}

/// Returns the table of graded joints.
pub fn table(seed: u64, cases: &[PlayCase]) -> String {
    let mut text = format!(
        "Simulated: {} joints of seed base {seed}, by `cargo run --release -p friction-grading --example two_positions -- \
         --joints {} --seed {seed} --update`.\n\njoint\tjoints\tnamed backlash\tnot determined\n",
        cases.len(),
        cases.len()
    );
    for fault in GearFault::ALL {
        let of_fault: Vec<&PlayCase> = cases.iter().filter(|case| case.fault == fault).collect();
        let named = of_fault.iter().filter(|case| case.named().is_some()).count();
        let none = of_fault.iter().filter(|case| case.found.is_none()).count();
        text += &format!("{}\t{}\t{named}\t{none}\n", fault.name(), of_fault.len());
    }
    let play: Vec<&PlayCase> = cases.iter().filter(|case| case.fault == GearFault::Play).collect();
    type Ratio = (&'static str, fn(&PlayCase) -> f64, [f64; 5]);
    const RATIOS: [Ratio; 4] = [
        ("play / mrad", |case| 1e3 * case.joint.gear.play_rad, [0.2, 0.5, 1.0, 2.0, 5.0]),
        (
            "play / torsion",
            |case| case.joint.gear.play_rad / case.torsion_rad(),
            [0.0, 0.5, 1.0, 2.0, 5.0],
        ),
        (
            "play / encoder step",
            |case| case.joint.gear.play_rad / case.joint.encoder.step_rad,
            [0.0, 3.0, 10.0, 30.0, 100.0],
        ),
        (
            "play / eccentricity",
            |case| case.joint.gear.play_rad / case.joint.encoder.eccentricity.size,
            [0.0, 1.0, 3.0, 10.0, 30.0],
        ),
    ];
    for (what, ratio, edges) in RATIOS {
        text += &format!(
            "\n{what}\tjoints\tfound\tsize within {:.0} %\tin the interval\n",
            100.0 * TOLERANCE
        );
        for (at, low) in edges.iter().enumerate() {
            let high = edges.get(at + 1).copied();
            let is_in = |case: &&&PlayCase| {
                ratio(case) >= *low && high.is_none_or(|high| ratio(case) < high)
            };
            let in_range: Vec<&PlayCase> = play.iter().filter(is_in).copied().collect();
            let range =
                high.map_or_else(|| format!("{low} and more"), |high| format!("{low} to {high}"));
            text += &format!("{range}\t{}\n", counts(&in_range));
        }
    }
    text
}

/// Returns how many joints with play there are, are found, have the right size, and have it in the interval.
fn counts(cases: &[&PlayCase]) -> String {
    let named: Vec<(f64, &TwoPositions)> =
        cases.iter().filter_map(|case| Some((case.joint.gear.play_rad, case.named()?))).collect();
    let is_right =
        |(play, found): &&(f64, &TwoPositions)| (found.play.value / play - 1.0).abs() <= TOLERANCE;
    let is_inside = |(play, found): &&(f64, &TwoPositions)| {
        let [low, high] = found.play.ci95();
        (low..=high).contains(play)
    };
    let (right, inside) =
        (named.iter().filter(is_right).count(), named.iter().filter(is_inside).count());
    format!("{}\t{}\t{right}\t{inside}", cases.len(), named.len())
}
