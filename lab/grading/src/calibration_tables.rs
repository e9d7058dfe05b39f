//! The tables of the calibrations, in TOML, as the diagnosis reads them.

use friction_diagnose::contest_calibration::ContestCalibration;
use friction_diagnose::two_positions::{Calibration, FIGURES};

/// Returns the table of the contest's calibration.
pub fn of_contest(calibration: &ContestCalibration) -> String {
    let steps: Vec<String> =
        calibration.steps.iter().map(|(odds, p)| format!("[{odds:.4}, {p:.4}]")).collect();
    let trees: String = calibration.trees.iter().map(|tree| format!("    \"{tree}\",\n")).collect();
    format!(
        "# Weighs the evidence for a cause. Made by\n#   cargo run --release -p friction-grading --example calibrate_contest\n\n\
         name = \"{}\"\nsteps = [{}]\nstart = {:.4}\ntrees = [\n{trees}]\n",
        calibration.name,
        steps.join(", "),
        calibration.start
    )
}

/// Returns the table of the calibration of play.
pub fn of_play(calibration: &Calibration) -> String {
    let weights = FIGURES.iter().zip(calibration.weights);
    let weights: String = weights.map(|(name, w)| format!("{name} = {w:.4}\n")).collect();
    format!(
        "# Weighs the evidence for play in the difference of two positions. Made by\n#   cargo run --release -p \
         friction-grading --example two_positions -- --calibrate\n\nname = \"{}\"\nstart = {:.4}\n{weights}",
        calibration.name, calibration.start
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use friction_diagnose::contest_calibration::Tree;

    #[test]
    fn contest_calibration_of_emitted_table_is_the_same() {
        let calibration = ContestCalibration {
            name: "test".into(),
            start: -1.5,
            trees: ["last<1.0000 -0.2500 0.5000", "0.1250"]
                .map(|text| Tree::parse(text).expect("the text of a tree"))
                .into(),
            steps: vec![(-2.0, 0.125), (1.5, 0.875)],
        };
        assert_eq!(ContestCalibration::parse(&of_contest(&calibration)), Ok(calibration));
    }

    #[test]
    fn play_calibration_of_emitted_table_is_the_same() {
        let weights = [0.5; FIGURES.len()];
        let calibration = Calibration { name: "test".into(), start: -1.5, weights };
        assert_eq!(Calibration::parse(&of_play(&calibration)), Some(calibration));
    }
}
