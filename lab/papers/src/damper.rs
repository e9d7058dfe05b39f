//! *Deep Learning-based Friction Modeling of Dry Interfaces for Structural Dampers*, on its authors' measurements.
//!
//! The paper augments LuGre with two LSTMs for a banded rotary friction damper of 40 kN. Twelve of its 24 characterisation
//! tests are public, as are a second campaign and six earthquake motions. All models are evaluated on measured data, with
//! whole tests held out. LuGre with named causes is compared with the network. The causes are a gap in the bands that is
//! crossed at each reversal, a level that follows the preset tension, and a direction with higher friction.
//!
//! The paper does not define its NRMSE. Its values have the size of RMSE divided by the range of the test, so tables 2 and 3
//! use that. The second campaign uses RMSE divided by the standard deviation of all rows.

mod campaign;
mod cost;
mod earthquakes;
mod model;
mod network;
mod pages;
mod printed;
mod score;
mod simulated;

use super::{Paper, PaperError, PaperOutcome, PaperRequest, ResultRow, pivot_table};
use campaign::TestCampaign;
use friction_results::report::Table;
use model::{COULOMB_VISCOUS, LUGRE, NAMED, NAMED_WITH_TENSION, held_out};
use network::{NetworkInputs, options};
use printed::{SECOND_CAMPAIGN_LUGRE, format_test_name, printed_values};
use score::CampaignScore;

/// The paper of the rotary friction damper.
pub struct Damper;

/// Log of the paper's tests with the actuators' forces, 256 Hz.
const FIRST_CAMPAIGN_FILE: &str = "damper-1-actuators.csv";

/// Log of the second campaign.
const SECOND_CAMPAIGN_FILE: &str = "damper-2.csv";

/// Log of the earthquakes.
const EARTHQUAKES_FILE: &str = "damper-quakes.csv";

/// Names of tables that the paper does not have.
const CHARACTERISATION: &str = "Characterisation, held out by whole tests";
const SECOND_CAMPAIGN_TABLE: &str = "Second campaign, held out by whole tests";

/// Extent of the computation.
struct DamperExtent {
    /// Number of folds of the tests; `None` for one fold per test.
    folds: Option<usize>,
    /// Training epochs for the first and the second campaign.
    epochs: [usize; 2],
    /// Groups of tests for early stopping.
    groups: usize,
}

/// One fold per test.
const LONG_FORM: DamperExtent = DamperExtent { folds: None, epochs: [140, 70], groups: 3 };

/// Three folds, and all epochs: training without early stopping takes a quarter of the time.
const SHORT_FORM: DamperExtent = DamperExtent { folds: Some(3), epochs: [120, 50], groups: 1 };

impl Paper for Damper {
    fn name(&self) -> &'static str {
        "damper"
    }

    fn about(&self) -> &'static str {
        "a rotary friction damper: LuGre, named causes, and a network, on its authors' measurements"
    }

    fn usual_minutes(&self, quick: bool) -> f64 {
        if quick { 1.0 } else { 10.0 }
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

    fn run(&self, request: &PaperRequest) -> Result<PaperOutcome, PaperError> {
        let form = if request.quick { SHORT_FORM } else { LONG_FORM };
        let mut outcome = PaperOutcome::default();
        match TestCampaign::read(&request.data, FIRST_CAMPAIGN_FILE)? {
            Some(mut tests) => {
                tests.remove_actuator_delay();
                characterisation(request, &form, &tests, &mut outcome)?;
            }
            None => outcome.summary.push(missing_file_sentence(request, FIRST_CAMPAIGN_FILE)),
        }
        match TestCampaign::read(&request.data, SECOND_CAMPAIGN_FILE)? {
            Some(tests) => {
                let quakes = TestCampaign::read(&request.data, EARTHQUAKES_FILE)?;
                second_campaign(request, &form, &tests, quakes, &mut outcome)?;
            }
            None => outcome.summary.push(missing_file_sentence(request, SECOND_CAMPAIGN_FILE)),
        }
        simulated::add_unpublished_tests(request, &mut outcome)?;
        outcome.summary.extend(cost::cost_sentence());
        outcome.summary.push(pages::NETWORK_CLAIMS.into());
        outcome.goals.extend(cost::goals());
        outcome.blocks.insert(0, pages::definitions());
        outcome.digest = digest(&outcome.rows);
        Ok(outcome)
    }
}

/// Selected tables, with one line for each test or measure and one column for each model.
fn digest(rows: &[ResultRow]) -> Vec<Table> {
    let named = |table: &'static str| {
        pivot_table(table, rows, move |row| {
            (row.table == table).then(|| (row_label(row), row.row.clone()))
        })
    };
    let of_print = |row: &ResultRow| {
        let is_printed = row.table == "2" || row.table == "3";
        is_printed.then(|| (row_label(row), format!("Table {}: {}", row.table, row.row)))
    };
    let tables = [
        pivot_table("The paper's tables 2 and 3, RMSE of range", rows, of_print),
        named(CHARACTERISATION),
        named(SECOND_CAMPAIGN_TABLE),
        named(earthquakes::TABLE),
        named(simulated::WIND),
    ];
    tables.into_iter().filter(|table| !table.rows.is_empty()).collect()
}

/// Returns a row's measure with its unit, marked if simulated.
fn row_label(row: &ResultRow) -> String {
    let unit = if row.unit.is_empty() { String::new() } else { format!(" ({})", row.unit) };
    format!("{}{unit}{}", row.column, if row.simulated { ", simulated" } else { "" })
}

fn missing_file_sentence(request: &PaperRequest, file: &str) -> String {
    let path = request.data.join(file);
    format!("{} does not exist; the results that need it are left out.", path.display())
}

/// A model's name and its score.
type NamedScore = (&'static str, CampaignScore);

fn characterisation(
    request: &PaperRequest,
    form: &DamperExtent,
    tests: &TestCampaign,
    outcome: &mut PaperOutcome,
) -> Result<(), PaperError> {
    (request.progress)("LuGre fitted to each test");
    let each = LUGRE.fitted_to_each(tests);
    TABLE_2.add(outcome, tests, &each);
    let folds = tests.folds(form.folds);
    let bases = LUGRE.fits(tests, &folds, request.progress);
    let mut scores: Vec<NamedScore> = vec![(LUGRE.name, held_out(tests, &folds, &bases))];
    for arm in [COULOMB_VISCOUS, NAMED_WITH_TENSION] {
        let fits = arm.fits(tests, &folds, request.progress);
        scores.push((arm.name, held_out(tests, &folds, &fits)));
    }
    let training = options(request.seed, form.epochs[0], form.groups);
    for inputs in [NetworkInputs::Tension, NetworkInputs::Motion, NetworkInputs::Actuators] {
        let score = inputs.held_out(tests, &folds, &bases, &training, request.progress)?;
        scores.push((inputs.name(), score));
    }
    let base = LUGRE.fit(&tests.tracks);
    let (_, trained_on_all) =
        NetworkInputs::Actuators.train_on_all(tests, &base, &training, request.progress)?;
    TABLE_3.add(outcome, tests, &trained_on_all);
    for (name, score) in &scores {
        add_held_out_rows(outcome, CHARACTERISATION, name, tests, score);
    }
    pages::characterisation(tests, &each, &trained_on_all, &scores, outcome);
    Ok(())
}

fn second_campaign(
    request: &PaperRequest,
    form: &DamperExtent,
    tests: &TestCampaign,
    quakes: Option<TestCampaign>,
    outcome: &mut PaperOutcome,
) -> Result<(), PaperError> {
    let folds = tests.folds(form.folds);
    let bases = LUGRE.fits(tests, &folds, request.progress);
    let mut scores: Vec<NamedScore> = vec![(LUGRE.name, held_out(tests, &folds, &bases))];
    for arm in [COULOMB_VISCOUS, NAMED] {
        let fits = arm.fits(tests, &folds, request.progress);
        scores.push((arm.name, held_out(tests, &folds, &fits)));
    }
    let training = options(request.seed, form.epochs[1], form.groups);
    let motion =
        NetworkInputs::Motion.held_out(tests, &folds, &bases, &training, request.progress)?;
    scores.push((NetworkInputs::Motion.name(), motion));
    let table = SECOND_CAMPAIGN_TABLE;
    for (name, score) in &scores {
        add_held_out_rows(outcome, table, name, tests, score);
    }
    let published = "published LuGre, its authors' predictions, in sample";
    let row = ResultRow::measured(table, published, "pooled RMSE / std", "", SECOND_CAMPAIGN_LUGRE);
    outcome.rows.push(row);
    pages::second_campaign(tests, &scores, outcome);
    let Some(mut quakes) = quakes else {
        outcome.summary.push(missing_file_sentence(request, EARTHQUAKES_FILE));
        return Ok(());
    };
    quakes.halve_sample_rate();
    let base = LUGRE.fit(&tests.tracks);
    let named = NAMED.fit(&tests.tracks);
    let (free, _) =
        NetworkInputs::Motion.train_on_all(tests, &base, &training, request.progress)?;
    let mut guarded = free.clone();
    guarded.set_stroke_range(&tests.tracks);
    let models =
        earthquakes::EvaluatedModels { named: &named, base: &base, free: &free, guarded: &guarded };
    earthquakes::evaluate(&quakes, &models, tests, outcome);
    Ok(())
}

/// One of the paper's tables of tests, repeated.
struct PrintedTable {
    /// Number of the table.
    number: &'static str,
    /// Our model.
    model: &'static str,
    /// Which of the printed values of a test the table has.
    printed: fn((f64, f64)) -> f64,
    /// [`ResultRow::measured`] or [`ResultRow::simulated`].
    row: fn(&str, &str, &str, &str, f64) -> ResultRow,
}

const TABLE_2: PrintedTable = PrintedTable {
    number: "2",
    model: "LuGre, fitted to each test",
    printed: |(lugre, _)| lugre,
    row: ResultRow::measured,
};

const TABLE_3: PrintedTable = PrintedTable {
    number: "3",
    model: "lugre-lstm (actuators' forces), all tests seen",
    printed: |(_, lstm)| lstm,
    row: ResultRow::measured,
};

impl PrintedTable {
    /// Adds the rows of these tests.
    fn add(&self, outcome: &mut PaperOutcome, tests: &TestCampaign, score: &CampaignScore) {
        for (test, name) in tests.names.iter().enumerate() {
            let percent = score.percent_of_range(test);
            let row = (self.row)(self.number, self.model, &format_test_name(name), "%", percent);
            let printed = printed_values(name).map(self.printed);
            outcome.rows.push(ResultRow { printed, ..row });
        }
    }
}

fn add_held_out_rows(
    outcome: &mut PaperOutcome,
    table: &str,
    name: &str,
    tests: &TestCampaign,
    score: &CampaignScore,
) {
    let row = |column: &str, unit: &str, ours| ResultRow::measured(table, name, column, unit, ours);
    outcome.rows.extend([
        row("mean over tests, of range", "%", score.mean_percent_of_range()),
        row("pooled RMSE", "N", score.pooled_rmse()),
        row("pooled RMSE / std", "", score.pooled_rmse() / tests.deviation()),
    ]);
    for (test, of) in tests.names.iter().enumerate() {
        outcome.rows.push(row(&format_test_name(of), "%", score.percent_of_range(test)));
    }
}
