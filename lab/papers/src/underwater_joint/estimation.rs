//! Errors of each model on held-out runs (Fig. 4 and 6), and the paper's tables of CV.
//!
//! The error is that of the paper. For each of the eight kinds the mean measured curve over its repeats, both directions
//! together, is compared with the mean estimated curve. The error is their mean difference over the mean friction, without
//! the start, averaged over the kinds of a speed.

use super::arms::DriverArm;
use super::measures::Spread;
use compensator_core::ParameterId;
use friction_fit::{Outcome, Rows, Track, predict, tracks};
use joint_log::Dataset;
use paper_machines::bench::KINDS;
use rayon::prelude::*;
use stochastic_extension::{Certificate, Settings};

/// The paper's speeds, rpm.
pub const SPEEDS_RPM: [f64; 3] = [35.0, 70.0, 100.0];

/// First evaluated row: 0.1 s, the first monitoring point of Fig. 2.
const FIRST_EVALUATED_ROW: usize = 25;

/// Number of groups of repeats; their scatter is the spread.
const REPEAT_GROUPS: usize = 4;

/// Mean curves of a kind, as in Fig. 4: measured and estimated friction, Nm.
#[derive(Clone, Debug, Default)]
pub struct Curves {
    /// Speed, rpm.
    pub rpm: f64,
    /// Mean measured friction.
    pub measured: Vec<f64>,
    /// Mean estimated friction.
    pub estimated: Vec<f64>,
}

impl Curves {
    fn error_percent(&self) -> f64 {
        let rows = || self.measured.iter().zip(&self.estimated).skip(FIRST_EVALUATED_ROW);
        let off: f64 = rows().map(|(is, model)| (is - model).abs()).sum();
        100.0 * off / rows().map(|(is, _)| is.abs()).sum::<f64>()
    }
}

/// Returns one arm's errors at the three speeds, %.
pub fn errors(arm: &Outcome, held_out: &Dataset) -> [Spread; 3] {
    let tracks = tracks(held_out);
    let all = curves(arm, held_out, &tracks, |_| true);
    let groups: Vec<Vec<Curves>> = (0..REPEAT_GROUPS)
        .map(|group| curves(arm, held_out, &tracks, |repeat| repeat / 2 % REPEAT_GROUPS == group))
        .collect();
    SPEEDS_RPM.map(|rpm| {
        let at = |curves: &[Curves]| {
            let at_speed = curves.iter().filter(|of| of.rpm == rpm && !of.measured.is_empty());
            let errors: Vec<f64> = at_speed.map(Curves::error_percent).collect();
            Spread::of(&errors).mean
        };
        let scatter: Vec<f64> =
            groups.iter().map(|group| at(group)).filter(|error| error.is_finite()).collect();
        Spread { mean: at(&all), deviation: Spread::of(&scatter).deviation }
    })
}

/// Returns the index of the kind of a run in [`KINDS`].
///
/// # Panics
/// Panics if the run is none of the eight kinds.
fn kind_of(name: &str) -> usize {
    let number = name.strip_prefix('k').and_then(|rest| rest.split('.').next()?.parse().ok());
    let kind = number.filter(|number| (1..=KINDS.len()).contains(number));
    kind.unwrap_or_else(|| panic!("run {name}: expected k1.N to k{}.N", KINDS.len())) - 1
}

/// Returns the mean curves of all kinds over the selected repeats.
pub fn curves(
    arm: &Outcome,
    data: &Dataset,
    tracks: &[Track],
    counts: impl Fn(usize) -> bool,
) -> Vec<Curves> {
    let predicted = predict(&arm.parameters, Rows { tracks, decimate: 1 }, arm.resolution);
    let mut all: Vec<Curves> =
        KINDS.iter().map(|kind| Curves { rpm: kind.rpm, ..Curves::default() }).collect();
    let mut runs = [0usize; KINDS.len()];
    let mut seen = [0usize; KINDS.len()];
    for (track, torque) in tracks.iter().zip(&predicted.torque) {
        let kind = kind_of(&data.runs[track.run].name);
        let repeat = seen[kind];
        seen[kind] += 1;
        if !counts(repeat) {
            continue;
        }
        let way = track.samples.last().map_or(1.0, |sample| sample.velocity_rad_s.signum());
        let sums = &mut all[kind];
        sums.measured.resize(track.torque.len(), 0.0);
        sums.estimated.resize(track.torque.len(), 0.0);
        runs[kind] += 1;
        for (row, (is, model)) in track.torque.iter().zip(torque).enumerate() {
            sums.measured[row] += way * is;
            sums.estimated[row] += way * model;
        }
    }
    for (curves, runs) in all.iter_mut().zip(runs) {
        let share = 1.0 / runs.max(1) as f64;
        curves.measured.iter_mut().chain(&mut curves.estimated).for_each(|value| *value *= share);
    }
    all
}

/// Computes the paper's certificate of an arm's model on the eight kinds (eq. 2-8, Table III).
pub fn certificate(arm: &DriverArm, data: &Dataset, seed: u64) -> Option<Certificate> {
    let fit = arm.fit.as_ref()?;
    let free: Vec<ParameterId> =
        fit.estimates.iter().filter(|e| e.std_error.is_some()).map(|e| e.id).collect();
    let settings = Settings { seed, resolution: fit.resolution, ..Settings::default() };
    Some(stochastic_extension::certify(&fit.parameters, &free, &tracks(data), &settings))
}

/// Computes the certificates of several arms.
pub fn certificates(arms: &[&DriverArm], data: &Dataset, seed: u64) -> Vec<Option<Certificate>> {
    arms.par_iter().map(|arm| certificate(arm, data, seed)).collect()
}
