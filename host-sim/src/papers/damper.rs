//! *Deep Learning-based Friction Modeling of Dry Interfaces for Structural Dampers*, on its authors' measurements.
//!
//! The paper augments LuGre with two LSTMs for a banded rotary friction damper of 40 kN. Twelve of its 24
//! characterisation tests are public, and so are a second campaign and six earthquake motions: all is judged on
//! measured data, held out by whole tests. Beside the network stand the causes that have names: at each
//! reversal a gap in the bands is crossed, the level follows the preset tension, and one direction grips harder.
//!
//! NRMSE is not defined in the paper. Its numbers have the size of RMSE over the range of the test, so tables 2 and
//! 3 are in that; the second campaign is in RMSE over the standard deviation of all its rows.

mod arm;
mod campaign;
mod printed;
mod score;

use super::{Outcome, Paper, Request, Row};
use arm::{Arm, COULOMB_VISCOUS, LUGRE, NAMED, NAMED_WITH_TENSION};
use campaign::Campaign;
use printed::{of_test, spelled};
use score::Score;

/// The paper of the rotary friction damper.
pub struct Damper;

/// The paper's tests, with the actuators' forces, 256 Hz.
const FIRST: &str = "damper-1-actuators.csv";

/// The second campaign.
const SECOND: &str = "damper-2.csv";

/// So many folds in the short form: every third test is held out together.
const FOLDS_IN_SHORT: usize = 3;

impl Paper for Damper {
    fn name(&self) -> &'static str {
        "damper"
    }

    fn about(&self) -> &'static str {
        "a rotary friction damper: LuGre, named causes, and a network, on its authors' measurements"
    }

    fn title(&self) -> &'static str {
        "The friction damper, measured"
    }

    fn run(&self, request: &Request) -> Result<Outcome, String> {
        let mut outcome = Outcome::default();
        let folds = request.quick.then_some(FOLDS_IN_SHORT);
        match Campaign::read(&request.data, FIRST)? {
            Some(tests) => characterisation(request, &tests, folds, &mut outcome),
            None => outcome.summary.push(left_out(request, FIRST)),
        }
        match Campaign::read(&request.data, SECOND)? {
            Some(tests) => second_campaign(request, &tests, folds, &mut outcome),
            None => outcome.summary.push(left_out(request, SECOND)),
        }
        Ok(outcome)
    }
}

fn left_out(request: &Request, file: &str) -> String {
    format!(
        "{} is not there: what it is needed for is left out.",
        request.data.join(file).display()
    )
}

fn characterisation(
    request: &Request,
    tests: &Campaign,
    folds: Option<usize>,
    outcome: &mut Outcome,
) {
    (request.progress)("LuGre fitted to each test");
    let each = LUGRE.fitted_to_each(tests);
    for (test, name) in tests.names.iter().enumerate() {
        let row = Row::measured(
            "2",
            "LuGre, fitted to each test",
            &spelled(name),
            "%",
            each.percent_of_range(test),
        );
        outcome.rows.push(match of_test(name) {
            Some((printed, _)) => row.printed(printed),
            None => row,
        });
    }
    let folds = tests.folds(folds);
    for arm in [COULOMB_VISCOUS, LUGRE, NAMED_WITH_TENSION] {
        let score = arm.held_out(tests, &folds, request.progress);
        held_out_rows("Characterisation, held out", &arm, tests, &score, outcome);
    }
}

fn second_campaign(
    request: &Request,
    tests: &Campaign,
    folds: Option<usize>,
    outcome: &mut Outcome,
) {
    let folds = tests.folds(folds);
    for arm in [COULOMB_VISCOUS, LUGRE, NAMED] {
        let score = arm.held_out(tests, &folds, request.progress);
        held_out_rows("Second campaign, held out", &arm, tests, &score, outcome);
    }
}

fn held_out_rows(table: &str, arm: &Arm, tests: &Campaign, score: &Score, outcome: &mut Outcome) {
    let deviation = tests.deviation();
    let row = |column: &str, unit: &str, ours| Row::measured(table, arm.name, column, unit, ours);
    outcome.rows.extend([
        row("mean over tests, of range", "%", score.mean_percent_of_range()),
        row("pooled RMSE", "N", score.pooled_rmse()),
        row("pooled RMSE / std", "", score.pooled_rmse() / deviation),
    ]);
    for (test, name) in tests.names.iter().enumerate() {
        outcome.rows.push(row(&spelled(name), "%", score.percent_of_range(test)));
    }
}
