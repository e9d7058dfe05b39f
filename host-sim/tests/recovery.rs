//! Simulated joints with known parameters: are they found, and are the standard errors right?
//!
//! The joints are drawn from Ding et al.'s ranges and simulated by [`simulated_machines`], which shares no code
//! with the core: own state, own integrator. A fit then has to find the parameters within two of its own
//! standard errors in 95 % of the cases (95.4 % if errors are right, which a hundred seeds can tell to a
//! percent or two). Too few would mean a bias or errors that are too small; too many,
//! errors that are too large: the test has limits on both sides.

use compensator_core::ParameterId as Id;
use friction_identification::fit::{FitOptions, Outcome, Rows, State, identify, tracks};
use friction_identification::spec::Spec;
use host_sim::simulated;
use rayon::prelude::*;
use simulated_machines::{Recording, Truth, record};
use std::ops::Range;

/// How many joints are drawn, and what is asked of their deviations in standard errors.
struct Asked {
    seeds: u64,
    /// Of each parameter's deviations, how many at least are below two.
    hits: usize,
    /// Root mean square of a parameter's.
    rms: Range<f64>,
    /// Of all deviations, the share below two, %.
    share: Range<f64>,
}

/// 95.4 of 100 are expected below two; fewer than 89 would happen once in 300. The parameters of one fit are
/// correlated: 900 deviations are worth some 300, and the share expected is known to 1.2 %.
const LONG: Asked = Asked { seeds: 100, hits: 89, rms: 0.75..1.25, share: 92.5..98.0 };

/// Of 25, fewer than 20 would happen once in 1000; the share is known to 2.4 %.
const SHORT: Asked = Asked { seeds: 25, hits: 20, rms: 0.6..1.4, share: 89.0..99.5 };

fn asked() -> Asked {
    if std::env::var_os("LONG_TESTS").is_some() { LONG } else { SHORT }
}

fn fit(truth: &Truth, model: &str) -> Outcome {
    let tracks = tracks(&simulated::dataset(&truth.log()));
    let rows = Rows { tracks: &tracks, decimate: 1 };
    let spec = Spec::parse(model).unwrap();
    let options = FitOptions { starts: 1, ..FitOptions::default() };
    identify(&spec, &spec.parameters().unwrap(), rows, rows, &options).unwrap()
}

fn true_value(truth: &Truth, id: Id) -> f64 {
    let seal = &truth.seal;
    match id {
        Id::CoulombTorque => seal.coulomb_nm,
        Id::StaticTorque => seal.static_nm,
        Id::StribeckVelocity => seal.stribeck_rad_s,
        Id::BristleStiffness => seal.k0,
        Id::BristleDamping => seal.k1,
        Id::ViscousFriction => seal.k2,
        Id::RadialForceCoulomb => seal.per_force,
        Id::PressureCoulomb => seal.per_pressure,
        Id::RadialForceRate => seal.eta3,
        other => panic!("{} is not in the plant", other.name()),
    }
}

/// Deviations in standard errors, by parameter, over some seeds.
fn deviations(model: &str, how: Recording, seeds: u64) -> Vec<(Id, Vec<f64>)> {
    let fits: Vec<(Truth, Outcome)> = (0..seeds)
        .into_par_iter()
        .map(|seed| {
            let truth = record(1000 + seed, how);
            let outcome = fit(&truth, model);
            (truth, outcome)
        })
        .collect();
    let fitted = fits[0].1.estimates.iter().filter(|estimate| estimate.std_error.is_some());
    let ids: Vec<Id> = fitted.map(|estimate| estimate.id).collect();
    let deviation = |(truth, outcome): &(Truth, Outcome), id: Id| {
        let estimate = outcome.estimates.iter().find(|estimate| estimate.id == id).unwrap();
        (estimate.value - true_value(truth, id)) / estimate.std_error.unwrap()
    };
    ids.into_iter().map(|id| (id, fits.iter().map(|fit| deviation(fit, id)).collect())).collect()
}

fn assert_covered(model: &str, how: Recording) {
    let asked = asked();
    let deviations = deviations(model, how, asked.seeds);
    let within = |all: &[f64]| all.iter().filter(|d| d.abs() <= 2.0).count();
    let (mut hits, mut total) = (0, 0);
    for (id, all) in &deviations {
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        let rms = (all.iter().map(|d| d * d).sum::<f64>() / all.len() as f64).sqrt();
        let hit = within(all);
        eprintln!("{model} {:24} {hit:3} of {} mean {mean:+.2} rms {rms:.2}", id.name(), all.len());
        assert!(hit >= asked.hits, "{}: only {hit} within two standard errors", id.name());
        assert!(asked.rms.contains(&rms), "{}: errors off by {rms:.2}", id.name());
        hits += hit;
        total += all.len();
    }
    let share = 100.0 * hits as f64 / total as f64;
    eprintln!("{model}: {share:.1} % of {total} within two standard errors");
    assert!(asked.share.contains(&share), "{share:.1} % within two standard errors");
}

#[test]
fn lugre_parameters_are_found_within_their_errors() {
    let how = Recording { runs: 4, seconds: 5.0, loaded: false, ..Recording::default() };
    assert_covered("lugre", how);
}

#[test]
fn improved_lugre_parameters_are_found_within_their_errors() {
    let how = Recording { runs: 8, seconds: 3.0, ..Recording::default() };
    assert_covered("improved-lugre", how);
}

#[test]
fn steady_sliding_leaves_the_bristles_undetermined_and_the_fit_says_so() {
    let how = Recording { steady: true, loaded: false, runs: 6, ..Recording::default() };
    let truth = record(7, how);
    // From the middle of each run, where sliding has long been steady.
    let mut data = simulated::dataset(&truth.log());
    for run in &mut data.runs {
        *run = run.slice(2000..run.len());
    }
    let tracks = tracks(&data);
    let rows = Rows { tracks: &tracks, decimate: 1 };
    let spec = Spec::parse("lugre").unwrap();
    let base = spec.parameters().unwrap();
    let outcome = identify(&spec, &base, rows, rows, &FitOptions::default()).unwrap();
    let state = |id| outcome.estimates.iter().find(|e| e.id == id).unwrap().state;
    for id in [Id::BristleStiffness, Id::BristleDamping, Id::StribeckVelocity, Id::StaticTorque] {
        assert_ne!(state(id), State::Determined, "{}", id.name());
    }
    for id in [Id::CoulombTorque, Id::ViscousFriction] {
        assert_eq!(state(id), State::Determined, "{}", id.name());
    }
    let said = outcome.verdicts.join("\n");
    assert!(said.contains("always fully slipping"), "{said}");
    assert!(said.contains("bristle_stiffness: "), "{said}");
}
