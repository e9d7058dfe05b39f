//! Simulated replacements for tests that are not public: 0.05 and 0.1 Hz, and wind.
//!
//! The plant is a band brake with its own equations (`host-sim simulate damper`). Its results are marked as simulated. They
//! repeat the paper's protocol and state nothing about the authors' machine. The short form uses two of the tensions.

use super::campaign::TestCampaign;
use super::model::LUGRE;
use super::network::{NetworkInputs, TrainedNetwork, options};
use super::score::CampaignScore;
use super::{PaperOutcome, PaperRequest, PrintedTable, ResultRow, TABLE_2, TABLE_3};
use crate::PaperError;
use friction_fit::Track;
use friction_network::NetworkRun;
use joint_rig::simulated::dataset;
use paper_machines::SIMULATIONS;
use simulated_machines::Request as SimulationRequest;

/// Rows per evaluation of the network; the plant logs at 128 Hz.
const NETWORK_INTERVAL_ROWS: usize = 1;

/// Name of the table.
pub(super) const WIND: &str = "Wind, simulated";

/// Training epochs of the long and the short form.
const EPOCHS: [usize; 2] = [60, 20];

/// Frequencies that are not public, as suffixes of test names.
const SLOW_TEST_SUFFIXES: [&str; 2] = ["@0.05Hz", "@0.1Hz"];

/// Tensions of the short form, as prefixes of test names.
const SHORT_FORM_TENSIONS: [&str; 2] = ["25lb", "80lb"];

/// Simulates the tests that are not public and adds their rows.
pub(super) fn add_unpublished_tests(
    request: &PaperRequest,
    outcome: &mut PaperOutcome,
) -> Result<(), PaperError> {
    (request.progress)("simulating the damper");
    let plant =
        SIMULATIONS.iter().find(|plant| plant.name == "damper").ok_or(PaperError::NoDamper)?;
    let log = plant
        .simulate(&SimulationRequest { seed: request.seed, ..SimulationRequest::default() })
        .map_err(PaperError::source)?
        .log;
    let all = TestCampaign::of(&dataset(&log));
    let is_wind = |name: &str| name.starts_with("wind");
    let wanted = |name: &str| {
        !request.quick || SHORT_FORM_TENSIONS.iter().any(|tension| name.starts_with(tension))
    };
    let tests = select_tests(&all, |name| !is_wind(name) && wanted(name));
    let wind = select_tests(&all, is_wind);
    let slow =
        select_tests(&tests, |name| SLOW_TEST_SUFFIXES.iter().any(|end| name.ends_with(end)));
    let each = LUGRE.fitted_to_each(&slow);
    PrintedTable { row: ResultRow::simulated, ..TABLE_2 }.add(outcome, &slow, &each);
    let base = LUGRE.fit(&tests.tracks);
    let mut training = options(request.seed, EPOCHS[usize::from(request.quick)], 1);
    training.rows_per_evaluation = NETWORK_INTERVAL_ROWS;
    let (mut network, trained_on_all) =
        NetworkInputs::Actuators.train_on_all(&tests, &base, &training, request.progress)?;
    let by_slow = |name: &String| tests.names.iter().position(|known| known == name);
    let force = slow
        .names
        .iter()
        .filter_map(by_slow)
        .map(|test| trained_on_all.force[test].clone())
        .collect();
    let seen_slow = CampaignScore::of(&slow.tracks, force);
    PrintedTable { row: ResultRow::simulated, ..TABLE_3 }.add(outcome, &slow, &seen_slow);
    network.set_stroke_range(&tests.tracks);
    let under_wind = add_wind(outcome, &network, &wind, trained_on_all.pooled_rmse());
    outcome.summary.push(format!(
        "Simulated, because these tests are not public: at 0.05 and 0.1 Hz LuGre fitted to each test leaves {:.2} %, lugre-lstm \
         trained on all tests {:.2} %. {under_wind}",
        each.mean_percent_of_range(),
        seen_slow.mean_percent_of_range(),
    ));
    Ok(())
}

/// Adds the rows of the wind tests, and returns a sentence about them. `trained_rmse` is the error of the network in training.
fn add_wind(
    outcome: &mut PaperOutcome,
    network: &TrainedNetwork,
    wind: &TestCampaign,
    trained_rmse: f64,
) -> String {
    let runs: Vec<NetworkRun> = wind.tracks.iter().map(|track| network.run(track)).collect();
    let validated =
        CampaignScore::of(&wind.tracks, runs.iter().map(|run| run.torque.clone()).collect());
    for (test, (name, run)) in wind.names.iter().zip(&runs).enumerate() {
        let outside = run.is_outside.iter().filter(|outside| **outside).count() as f64
            / run.is_outside.len().max(1) as f64;
        let row = |column, ours| ResultRow::simulated(WIND, name, column, "%", ours);
        outcome.rows.push(row("RMSE of range", validated.percent_of_range(test)));
        outcome.rows.push(row("rows outside the envelope", 100.0 * outside));
    }
    let ratio = validated.pooled_rmse() / trained_rmse.max(f64::MIN_POSITIVE);
    let printed_ratio = PRINTED_WIND_PERCENT / PRINTED_TRAINING_PERCENT;
    let row = ResultRow::simulated(WIND, "all", "validation / training", "", ratio);
    outcome.rows.push(row.printed(printed_ratio));
    let flagged = runs.iter().filter(|run| run.outside_count > 0).count();
    format!(
        "Under wind its error is {ratio:.2} of that in training (the paper's: {printed_ratio:.2}), \
         and {flagged} of {} wind tests are flagged for leaving the envelope.",
        wind.names.len(),
    )
}

/// The paper's stated errors over its five wind tests and over its characterisation tests.
const PRINTED_WIND_PERCENT: f64 = 14.7;
const PRINTED_TRAINING_PERCENT: f64 = 2.8;

/// Returns the tests selected by name.
fn select_tests(all: &TestCampaign, wanted: impl Fn(&str) -> bool) -> TestCampaign {
    let chosen: Vec<usize> =
        (0..all.names.len()).filter(|test| wanted(&all.names[*test])).collect();
    let track = |test: &usize| -> Track { all.tracks[*test].clone() };
    TestCampaign {
        names: chosen.iter().map(|test| all.names[*test].clone()).collect(),
        tracks: chosen.iter().map(track).collect(),
        covariates: all.covariates.clone(),
    }
}
