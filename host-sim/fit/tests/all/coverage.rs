//! How often the 95 % interval of a parameter holds the truth, on simulated clean joints with drawn parameters, noise, rates
//! and motions.
//!
//! The joints are integrated apart from the core ([`world`]), and their logs are checked, split and fitted as by `identify`. A
//! parameter counts where it is "determined". Every run fits the first few worlds, `LONG_TESTS=1` all, and writes the shares to
//! `target/figures/coverage.tsv`.

mod world;

use super::message;
use compensator_core::{LawKind, ParameterId as Id};
use friction_fit::spec::Spec;
use friction_fit::{FitOptions, Outcome, Rows, State, campaign_start, identify, tracks_since};
use joint_log::log_check::{Corrections, check};
use joint_log::{SplitRule, split};
use rayon::prelude::*;
use std::path::Path;
use world::{Joint, World};

/// Worlds of the long form.
const WORLDS: u64 = 200;

/// Worlds that every run fits.
const SHORT_WORLDS: u64 = 24;

/// Half of the width of a 95 % interval, standard errors.
const INTERVAL: f64 = 1.96;

/// Limits of the share of the intervals that hold the truth, for each parameter over all worlds.
const LIMITS: (f64, f64) = (0.90, 0.98);

/// The same over all parameters of the first few worlds.
const SHORT_LIMITS: (f64, f64) = (0.88, 0.99);

/// Minimum share of the worlds that determine a parameter. The motions are drawn so that they do.
const MIN_DETERMINED: f64 = 0.9;

/// Fits LuGre to the log of a world as `identify` does.
fn fitted(world: &World) -> Outcome {
    let data = check(world.data.clone(), Corrections::default()).data;
    let parts = split(&data, &SplitRule::default(), 0).expect("runs to hold out");
    let start = campaign_start(&data);
    let [train, test] =
        [&parts.train, &parts.test].map(|parts| tracks_since(&data.select(parts), None, start));
    let rows = |tracks| Rows { tracks, decimate: 1 };
    let spec = Spec::law(LawKind::Lugre);
    let base = spec.parameters().expect("parameters");
    let options = FitOptions { passive: true, ..FitOptions::default() };
    identify(&spec, &base, rows(&train), rows(&test), &options)
}

/// Errors of a fit in standard errors, for each parameter of LuGre; `None` where it is not determined.
type Errors = Vec<Option<f64>>;

fn errors(joint: &Joint, outcome: &Outcome) -> Errors {
    let error = |id: &Id| {
        let found = outcome.estimates.iter().find(|estimate| estimate.id == *id)?;
        let is_determined = found.state == State::Determined;
        is_determined.then(|| (found.value - joint.value(*id)) / found.std_error.expect("free"))
    };
    LawKind::Lugre.parameters().iter().map(error).collect()
}

/// Number of worlds that determine a parameter, and of those whose interval holds the truth.
fn counts(worlds: &[Errors], parameter: usize) -> (usize, usize) {
    let determined = worlds.iter().filter_map(|errors| errors[parameter]);
    let held = determined.clone().filter(|error| error.abs() < INTERVAL).count();
    (determined.count(), held)
}

/// Returns the block of a table for the first `count` worlds.
fn block(worlds: &[Errors]) -> String {
    let mut text = format!(
        "# 95 % intervals of LuGre's parameters over {} simulated clean joints\n\
         parameter\tdetermined\thold the truth\tshare, %\tmean error, standard errors\tRMS error, standard errors\n",
        worlds.len()
    );
    for (at, id) in LawKind::Lugre.parameters().iter().enumerate() {
        let (determined, held) = counts(worlds, at);
        let all: Vec<f64> = worlds.iter().filter_map(|errors| errors[at]).collect();
        let count = determined.max(1) as f64;
        let mean = all.iter().sum::<f64>() / count;
        let rms = (all.iter().map(|error| error * error).sum::<f64>() / count).sqrt();
        let share = 100.0 * held as f64 / count;
        text += &format!("{}\t{determined}\t{held}\t{share:.1}\t{mean:.2}\t{rms:.2}\n", id.name());
    }
    text
}

#[test]
fn intervals_of_determined_parameters_hold_the_truth() {
    let is_long = std::env::var_os("LONG_TESTS").is_some();
    let count = if is_long { WORLDS } else { SHORT_WORLDS };
    let worlds: Vec<Errors> = (0..count)
        .into_par_iter()
        .map(|seed| {
            let world = World::draw(seed);
            errors(&world.joint, &fitted(&world))
        })
        .collect();
    let table = block(&worlds);
    println!("{table}");
    let figures = Path::new(env!("CARGO_TARGET_TMPDIR")).with_file_name("figures");
    std::fs::create_dir_all(&figures).expect("a folder for the figures");
    std::fs::write(figures.join("coverage.tsv"), &table).expect("the table can be written");

    let parameters = LawKind::Lugre.parameters();
    let (mut determined, mut held) = (0, 0);
    for (at, id) in parameters.iter().enumerate() {
        let of_parameter = counts(&worlds, at);
        assert!(
            of_parameter.0 as f64 >= MIN_DETERMINED * count as f64,
            "{}: {} determined",
            id.name(),
            of_parameter.0
        );
        let share = of_parameter.1 as f64 / of_parameter.0 as f64;
        let is_inside = (LIMITS.0..=LIMITS.1).contains(&share);
        assert!(!is_long || is_inside, "{}: {share} of the intervals", id.name());
        (determined, held) = (determined + of_parameter.0, held + of_parameter.1);
    }
    let share = held as f64 / determined as f64;
    assert!((SHORT_LIMITS.0..=SHORT_LIMITS.1).contains(&share), "{share} of all intervals");
}

#[test]
fn identify_with_active_joint_reports_the_truth_and_a_passive_form() {
    // So much bristle damping can give out energy, as in most published sets.
    let joint = Joint {
        coulomb: 4.0,
        static_torque: 5.0,
        stribeck_velocity: 0.08,
        stiffness: 6000.0,
        damping: 60.0,
        viscous: 0.8,
    };
    let outcome = fitted(&World::of(joint, 1.0, 500.0, 0.02, 1));
    for (id, error) in LawKind::Lugre.parameters().iter().zip(errors(&joint, &outcome)) {
        let error = error.unwrap_or_else(|| panic!("{} is not determined", id.name()));
        assert!(error.abs() < 4.0, "{}: {error} standard errors", id.name());
    }
    assert!(outcome.parameters.choices.allow_active);

    let form = outcome.driver_form.as_ref().expect("a passive form");
    assert_eq!(form.parameters.convert::<f32>().validate(), Ok(()));
    assert!(!form.parameters.choices.allow_active);
    assert!(form.test.rmse > 1.05 * outcome.test.rmse, "{} {}", form.test.rmse, outcome.test.rmse);
    let state = |id: Id| {
        form.estimates.iter().find(|estimate| estimate.id == id).expect("a parameter").state
    };
    assert_eq!(state(Id::StribeckVelocity), State::NotDetermined, "the form moves it");
    let cost = outcome.verdicts.iter().find(|note| note.contains("only dissipates energy"));
    let cost = cost.expect("a verdict with the cost");
    message::check("fits", "cost of a passive law", cost, &["held-out", "training"]);
}

#[test]
fn identify_with_passive_joint_reports_no_other_form() {
    let joint = Joint {
        coulomb: 4.0,
        static_torque: 5.0,
        stribeck_velocity: 0.08,
        stiffness: 6000.0,
        damping: 1.5,
        viscous: 0.8,
    };
    let outcome = fitted(&World::of(joint, 1.0, 500.0, 0.02, 1));
    assert!(outcome.driver_form.is_none() && !outcome.parameters.choices.allow_active);
    assert!(
        !outcome.verdicts.iter().any(|note| note.contains("passive")),
        "{:?}",
        outcome.verdicts
    );
}
