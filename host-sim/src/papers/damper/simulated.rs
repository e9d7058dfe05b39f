//! What is not public, on a simulated damper: tests at 0.05 and 0.1 Hz, and under wind.
//!
//! The plant is a band brake of its own equations (`host-sim simulate damper`), and its numbers are simulated and marked so:
//! they repeat the paper's protocol and say nothing of the authors' machine. The short form takes two of its tensions.

use super::arm::LUGRE;
use super::campaign::Campaign;
use super::printed::{of_test, spelled};
use super::score::Score;
use super::supplied::{Fed, options};
use super::{Outcome, Request, Row};
use crate::simulated::dataset;
use friction_identification::fit::Track;
use simulated_machines::{Request as Ask, SIMULATIONS};

/// Rows from one evaluation of the network to the next: the plant logs 128 a second.
const EVERY: usize = 1;

/// Its table.
pub(super) const WIND: &str = "Wind, simulated";

/// Passes of training, in the long form and the short one.
const EPOCHS: [usize; 2] = [60, 20];

/// Frequencies that are not public, as the tests' names end.
const SLOW: [&str; 2] = ["@0.05Hz", "@0.1Hz"];

/// Tensions of the short form, as the tests' names begin.
const SHORT: [&str; 2] = ["25lb", "80lb"];

/// Simulates what the public data lack and adds its rows.
pub(super) fn what_is_not_public(request: &Request, outcome: &mut Outcome) -> Result<(), String> {
    (request.progress)("simulating the damper");
    let plant = SIMULATIONS.iter().find(|plant| plant.name() == "damper").ok_or("no damper")?;
    let log = plant.simulate(&Ask { seed: request.seed, ..Ask::default() })?.log;
    let all = Campaign::of(&dataset(&log));
    let is_wind = |name: &str| name.starts_with("wind");
    let wanted =
        |name: &str| !request.quick || SHORT.iter().any(|tension| name.starts_with(tension));
    let tests = some(&all, |name| !is_wind(name) && wanted(name));
    let wind = some(&all, is_wind);
    let slow = some(&tests, |name| SLOW.iter().any(|end| name.ends_with(end)));
    let each = LUGRE.fitted_to_each(&slow);
    rows(outcome, "2", "LuGre, fitted to each test", &slow, &each, |(lugre, _)| lugre);
    let base = LUGRE.fit(&tests.tracks);
    let mut training = options(request.seed, EPOCHS[usize::from(request.quick)], 1);
    training.every = EVERY;
    let (mut learnt, seen) =
        Fed::Actuators.learnt_from_all(&tests, &base, &training, request.progress);
    let name = "lugre-lstm (actuators' forces), all tests seen";
    let by_slow = |name: &String| tests.names.iter().position(|own| own == name);
    let force =
        slow.names.iter().filter_map(by_slow).map(|test| seen.force[test].clone()).collect();
    let seen_slow = Score::of(&slow.tracks, force);
    rows(outcome, "3", name, &slow, &seen_slow, |(_, lstm)| lstm);
    learnt.watch_strokes(&tests.tracks);
    let runs: Vec<_> = wind.tracks.iter().map(|track| learnt.run(track)).collect();
    let validated = Score::of(&wind.tracks, runs.iter().map(|run| run.torque.clone()).collect());
    let outside = |run: &friction_identification::network::Run| {
        run.is_outside.iter().filter(|outside| **outside).count() as f64
            / run.is_outside.len().max(1) as f64
    };
    let table = WIND;
    for (test, of) in wind.names.iter().enumerate() {
        let row = |column, ours| Row::simulated(table, of, column, "%", ours);
        outcome.rows.push(row("RMSE of range", validated.percent_of_range(test)));
        outcome.rows.push(row("rows outside the envelope", 100.0 * outside(&runs[test])));
    }
    let ratio = validated.pooled_rmse() / seen.pooled_rmse().max(f64::MIN_POSITIVE);
    let printed_ratio = PRINTED_WIND_PERCENT / PRINTED_TRAINING_PERCENT;
    let row = Row::simulated(table, "all", "validation / training", "", ratio);
    outcome.rows.push(row.printed(printed_ratio));
    let flagged = runs.iter().filter(|run| run.outside_count > 0).count();
    outcome.summary.push(format!(
        "Simulated, as their tests are not public: at 0.05 and 0.1 Hz LuGre fitted to each test leaves {:.2} %, lugre-lstm \
         that has seen all {:.2} %. Under wind its error is {ratio:.2} of that in training (the paper's: {printed_ratio:.2}), \
         and {flagged} of {} wind tests are flagged for leaving the envelope.",
        each.mean_percent_of_range(),
        seen_slow.mean_percent_of_range(),
        wind.names.len(),
    ));
    Ok(())
}

/// The paper's error over its five wind tests, and over its characterisation tests, as it states them.
const PRINTED_WIND_PERCENT: f64 = 14.7;
const PRINTED_TRAINING_PERCENT: f64 = 2.8;

/// The tests whose names are wanted.
fn some(all: &Campaign, wanted: impl Fn(&str) -> bool) -> Campaign {
    let chosen: Vec<usize> =
        (0..all.names.len()).filter(|test| wanted(&all.names[*test])).collect();
    let track = |test: &usize| -> Track { all.tracks[*test].clone() };
    Campaign {
        names: chosen.iter().map(|test| all.names[*test].clone()).collect(),
        tracks: chosen.iter().map(track).collect(),
        covariates: all.covariates.clone(),
    }
}

fn rows(
    outcome: &mut Outcome,
    table: &str,
    name: &str,
    tests: &Campaign,
    score: &Score,
    which: fn((f64, f64)) -> f64,
) {
    for (test, of) in tests.names.iter().enumerate() {
        let row = Row::simulated(table, name, &spelled(of), "%", score.percent_of_range(test));
        outcome.rows.push(match of_test(of) {
            Some(printed) => row.printed(which(printed)),
            None => row,
        });
    }
}
