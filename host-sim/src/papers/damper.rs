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
mod cost;
mod earthquakes;
mod pages;
mod printed;
mod score;
mod simulated;
mod supplied;

use super::{Outcome, Paper, Request, Row, across};
use crate::report::Table;
use arm::{COULOMB_VISCOUS, LUGRE, NAMED, NAMED_WITH_TENSION, held_out};
use campaign::Campaign;
use printed::{SECOND_CAMPAIGN_LUGRE, of_test, spelled};
use score::Score;
use supplied::{Fed, options};

/// The paper of the rotary friction damper.
pub struct Damper;

/// The paper's tests, with the actuators' forces, 256 Hz.
const FIRST: &str = "damper-1-actuators.csv";

/// The second campaign.
const SECOND: &str = "damper-2.csv";

/// The earthquakes.
const QUAKES: &str = "damper-quakes.csv";

/// Tables of our own.
const CHARACTERISATION: &str = "Characterisation, held out by whole tests";
const SECOND_CAMPAIGN_TABLE: &str = "Second campaign, held out by whole tests";

/// How much is done.
struct Form {
    /// Into how many folds the tests are parted; `None` for each test by itself.
    folds: Option<usize>,
    /// Passes of training, first and second campaign.
    epochs: [usize; 2],
    /// Groups that say when to stop.
    groups: usize,
}

/// Every test by itself. By the passes it makes, some fifteen times the short form's processor time of 66 s, which
/// was measured; not measured itself.
const LONG: Form = Form { folds: None, epochs: [140, 70], groups: 3 };

/// Every third test together, and all passes made: a quarter of the time goes where nobody asks when to stop. On two
/// cores about a minute.
const SHORT: Form = Form { folds: Some(3), epochs: [120, 50], groups: 1 };

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

    fn preface(&self) -> &'static str {
        "After \"Deep Learning-based Friction Modeling of Dry Interfaces for Structural Dampers\". Measured by its authors where \
         their tests are public (half of the paper's, a second campaign, six earthquakes); what is not is marked simulated, and is of \
         our own damper, not theirs. In % stands RMSE over the range of a test: the paper does not define its measure, and this has the \
         size of its numbers."
    }

    fn run(&self, request: &Request) -> Result<Outcome, String> {
        let form = if request.quick { SHORT } else { LONG };
        let mut outcome = Outcome::default();
        match Campaign::read(&request.data, FIRST)? {
            Some(mut tests) => {
                tests.actuators_in_step();
                characterisation(request, &form, &tests, &mut outcome);
            }
            None => outcome.summary.push(left_out(request, FIRST)),
        }
        match Campaign::read(&request.data, SECOND)? {
            Some(tests) => {
                let quakes = Campaign::read(&request.data, QUAKES)?;
                second_campaign(request, &form, &tests, quakes, &mut outcome);
            }
            None => outcome.summary.push(left_out(request, SECOND)),
        }
        simulated::what_is_not_public(request, &mut outcome)?;
        outcome.summary.extend(cost::in_words());
        outcome.summary.push(pages::WHAT_IT_MAY_CLAIM.into());
        outcome.goals.extend(cost::goals());
        outcome.blocks.insert(0, pages::definitions());
        outcome.digest = digest(&outcome.rows);
        Ok(outcome)
    }
}

/// The paper's tables and what is beside them, a test or measure to a line, a model to a column.
fn digest(rows: &[Row]) -> Vec<Table> {
    let named = |table: &'static str| {
        across(table, rows, move |row| (row.table == table).then(|| (line(row), row.row.clone())))
    };
    let of_print = |row: &Row| {
        let is_printed = row.table == "2" || row.table == "3";
        is_printed.then(|| (line(row), format!("Table {}: {}", row.table, row.row)))
    };
    let tables = [
        across("The paper's tables 2 and 3, RMSE of range", rows, of_print),
        named(CHARACTERISATION),
        named(SECOND_CAMPAIGN_TABLE),
        named(earthquakes::TABLE),
        named(simulated::WIND),
    ];
    tables.into_iter().filter(|table| !table.rows.is_empty()).collect()
}

/// A measure with its unit, and whether it is simulated.
fn line(row: &Row) -> String {
    let unit = if row.unit.is_empty() { String::new() } else { format!(" ({})", row.unit) };
    format!("{}{unit}{}", row.column, if row.simulated { ", simulated" } else { "" })
}

fn left_out(request: &Request, file: &str) -> String {
    let path = request.data.join(file);
    format!("{} is not there: what it is needed for is left out.", path.display())
}

/// A model's name and how it did.
type Judged = (&'static str, Score);

fn characterisation(request: &Request, form: &Form, tests: &Campaign, outcome: &mut Outcome) {
    (request.progress)("LuGre fitted to each test");
    let each = LUGRE.fitted_to_each(tests);
    of_print(outcome, "2", "LuGre, fitted to each test", tests, &each, |(lugre, _)| lugre);
    let folds = tests.folds(form.folds);
    let bases = LUGRE.fits(tests, &folds, request.progress);
    let mut judged: Vec<Judged> = vec![(LUGRE.name, held_out(tests, &folds, &bases))];
    for arm in [COULOMB_VISCOUS, NAMED_WITH_TENSION] {
        let fits = arm.fits(tests, &folds, request.progress);
        judged.push((arm.name, held_out(tests, &folds, &fits)));
    }
    let training = options(request.seed, form.epochs[0], form.groups);
    for fed in [Fed::Tension, Fed::Motion, Fed::Actuators] {
        let score = fed.held_out(tests, &folds, &bases, &training, request.progress);
        judged.push((fed.name(), score));
    }
    let base = LUGRE.fit(&tests.tracks);
    let (_, seen) = Fed::Actuators.learnt_from_all(tests, &base, &training, request.progress);
    let name = "lugre-lstm (actuators' forces), all tests seen";
    of_print(outcome, "3", name, tests, &seen, |(_, lstm)| lstm);
    for (name, score) in &judged {
        held_out_rows(outcome, CHARACTERISATION, name, tests, score);
    }
    pages::characterisation(tests, &each, &seen, &judged, outcome);
}

fn second_campaign(
    request: &Request,
    form: &Form,
    tests: &Campaign,
    quakes: Option<Campaign>,
    outcome: &mut Outcome,
) {
    let folds = tests.folds(form.folds);
    let bases = LUGRE.fits(tests, &folds, request.progress);
    let mut judged: Vec<Judged> = vec![(LUGRE.name, held_out(tests, &folds, &bases))];
    for arm in [COULOMB_VISCOUS, NAMED] {
        let fits = arm.fits(tests, &folds, request.progress);
        judged.push((arm.name, held_out(tests, &folds, &fits)));
    }
    let training = options(request.seed, form.epochs[1], form.groups);
    let motion = Fed::Motion.held_out(tests, &folds, &bases, &training, request.progress);
    judged.push((Fed::Motion.name(), motion));
    let table = SECOND_CAMPAIGN_TABLE;
    for (name, score) in &judged {
        held_out_rows(outcome, table, name, tests, score);
    }
    let published = "published LuGre, its authors' predictions, in sample";
    let row = Row::measured(table, published, "pooled RMSE / std", "", SECOND_CAMPAIGN_LUGRE);
    outcome.rows.push(row);
    pages::second_campaign(tests, &judged, outcome);
    let Some(mut quakes) = quakes else {
        outcome.summary.push(left_out(request, QUAKES));
        return;
    };
    quakes.halved();
    let base = LUGRE.fit(&tests.tracks);
    let named = NAMED.fit(&tests.tracks);
    let (free, _) = Fed::Motion.learnt_from_all(tests, &base, &training, request.progress);
    let mut guarded = free.clone();
    guarded.watch_strokes(&tests.tracks);
    earthquakes::judge(&quakes, &named, &base, &free, &guarded, tests, outcome);
}

/// The rows of one of the paper's tables.
fn of_print(
    outcome: &mut Outcome,
    table: &str,
    name: &str,
    tests: &Campaign,
    score: &Score,
    which: fn((f64, f64)) -> f64,
) {
    for (test, of) in tests.names.iter().enumerate() {
        let row = Row::measured(table, name, &spelled(of), "%", score.percent_of_range(test));
        outcome.rows.push(match of_test(of) {
            Some(printed) => row.printed(which(printed)),
            None => row,
        });
    }
}

fn held_out_rows(outcome: &mut Outcome, table: &str, name: &str, tests: &Campaign, score: &Score) {
    let row = |column: &str, unit: &str, ours| Row::measured(table, name, column, unit, ours);
    outcome.rows.extend([
        row("mean over tests, of range", "%", score.mean_percent_of_range()),
        row("pooled RMSE", "N", score.pooled_rmse()),
        row("pooled RMSE / std", "", score.pooled_rmse() / tests.deviation()),
    ]);
    for (test, of) in tests.names.iter().enumerate() {
        outcome.rows.push(row(&spelled(of), "%", score.percent_of_range(test)));
    }
}
