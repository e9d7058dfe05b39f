//! Measures the speed of certificates of the stochastic extension, on all cores.
//!
//! At `alpha = delta = epsilon = 0.05` one set of permitted variances takes 72 sampled vectors on 1732 trials of 500 samples:
//! 124,704 simulations. The first table times these, each simulation to its end. The second table times the whole search for
//! the variances, for one speed class and for all three, at the paper's levels and at the strict ones. Joint and log are
//! simulated. Run it with `cargo run --release -p friction-grading --example certificate`.

use compensator_core::{LawKind, ParameterId as Id, Parameters, TermKind};
use friction_fit::{Track, tracks};
use joint_rig::simulated;
use rayon::prelude::*;
use simulated_machines::underwater_joint::{Recording, record};
use std::time::Instant;
use stochastic_extension::draw::{Draws, varied};
use stochastic_extension::ensemble::Ensemble;
use stochastic_extension::range::Ranges;
use stochastic_extension::trials::{Block, Trials};
use stochastic_extension::{Counts, Levels, Settings, certify};

const STRICT: Levels = Levels { alpha: 0.05, delta: 0.05, epsilon: 0.05, rho: 0.35 };

/// Number of repetitions in the first table, of which the fastest counts.
const REPETITIONS: usize = 3;

/// Twenty-seven thousand rows, the size of a typical log.
fn log() -> (Vec<Track>, Parameters<f64>) {
    let how = Recording { runs: 18, seconds: 15.0, rate_hz: 100.0, ..Recording::default() };
    let truth = record(7, how);
    let seal = truth.seal;
    let parameters = Parameters::new(LawKind::Lugre)
        .with(Id::CoulombTorque, seal.coulomb_nm + 0.5)
        .with(Id::StaticTorque, seal.static_nm + 0.5)
        .with(Id::StribeckVelocity, seal.stribeck_rad_s)
        .with(Id::BristleStiffness, seal.k0)
        .with(Id::BristleDamping, seal.k1)
        .with(Id::ViscousFriction, seal.k2)
        .with(Id::RadialForceCoulomb, seal.per_force)
        .with(Id::PressureCoulomb, seal.per_pressure);
    (tracks(&simulated::dataset(truth.log())), parameters)
}

/// Repeats the runs up to two million rows.
fn long(tracks: &[Track]) -> Vec<Track> {
    let times = 2_000_000 / tracks.iter().map(Track::len).sum::<usize>().max(1);
    let repeat = |track: &Track| Track {
        samples: track.samples.repeat(times),
        torque: track.torque.repeat(times),
        ..track.clone()
    };
    tracks.iter().map(repeat).collect()
}

/// Models to time: the plain law, the improved one, and some with terms.
fn models(plain: &Parameters<f64>) -> Vec<(&'static str, Parameters<f64>)> {
    let mut improved = plain.clone();
    improved.law = LawKind::ImprovedLugre;
    let with = |terms: &[TermKind]| {
        let mut parameters = plain.clone().with(Id::StribeckExponent, 1.5);
        parameters.set(Id::RippleSine, 0.1);
        for term in terms {
            assert!(parameters.add_term(*term), "room for {}", term.name());
        }
        parameters
    };
    vec![
        ("lugre", plain.clone()),
        ("improved-lugre", improved),
        ("lugre+pressure-coulomb", with(&[TermKind::PressureCoulomb])),
        (
            "lugre+pressure-coulomb+temperature-viscous+position-ripple",
            with(&[
                TermKind::PressureCoulomb,
                TermKind::TemperatureViscous,
                TermKind::PositionRipple,
            ]),
        ),
        ("lugre+stribeck-shape", with(&[TermKind::StribeckShape])),
    ]
}

fn main() {
    let (tracks, plain) = log();
    let all: Vec<&Track> = tracks.iter().collect();
    let free = LawKind::Lugre.parameters();
    let counts = STRICT.counts();
    let settings = Settings::default();
    println!("threads: {}", rayon::current_num_threads());
    println!("\nmodel | simulations | steps | seconds | steps/s");
    for (name, parameters) in models(&plain) {
        let (rows, resolution) = (settings.samples_per_run, settings.resolution);
        let trials = Trials::new(&parameters, &all, counts.trials, rows, resolution, 0);
        let rows = trials.blocks.iter().flat_map(Block::residuals);
        let ranges = Ranges::new(rows, counts.trials);
        let ensemble = Ensemble::new(&trials, &ranges, settings.monitoring_times);
        let draws = Draws::new(0, free, counts.sampled_vectors);
        let mut best = f64::INFINITY;
        for _ in 0..REPETITIONS {
            let begin = Instant::now();
            let sum: f64 = draws
                .vectors
                .par_iter()
                .map(|z| {
                    let logarithms: Vec<(Id, f64)> =
                        free.iter().zip(z).map(|(id, z)| (*id, 0.1 * z)).collect();
                    ensemble.violation(&varied(&parameters, &logarithms))
                })
                .sum();
            best = best.min(begin.elapsed().as_secs_f64());
            assert!(sum.is_finite());
        }
        let simulations = ensemble.simulations() / REPETITIONS;
        // The rows of a trial are a multiple of the monitoring times.
        let times = settings.monitoring_times;
        let steps = simulations * (trials.rows / times * times);
        assert_eq!(simulations, counts.simulations());
        println!("{name} | {simulations} | {steps} | {best:.3} | {:.3e}", steps as f64 / best);
    }
    println!("\nmodel | levels | n x m | classes | simulations | seconds");
    for (name, parameters) in models(&plain) {
        for (levels_name, levels) in [("paper", Levels::default()), ("strict", STRICT)] {
            for max_classes in [1, 3] {
                let settings = Settings { levels, max_classes, ..Settings::default() };
                let Counts { sampled_vectors, trials } = settings.counts();
                let begin = Instant::now();
                let certificate = certify(&parameters, free, &tracks, &settings);
                println!(
                    "{name} | {levels_name} | {sampled_vectors} x {trials} | {} | {} | {:.3}",
                    certificate.classes.len(),
                    certificate.simulations,
                    begin.elapsed().as_secs_f64()
                );
            }
        }
    }
    let long = long(&tracks);
    let rows: usize = long.iter().map(Track::len).sum();
    let begin = Instant::now();
    certify(&plain, free, &long, &settings);
    println!("\nlugre, paper's levels, {rows} rows: {:.3} s", begin.elapsed().as_secs_f64());
}
