//! The models that are held beside each other, and their fits.
//!
//! Each is the core's own law and terms, fitted by [`friction_identification::fit`]. A gap and an elastic travel can
//! stand for each other far from the optimum, so a fit starts from sizes a band brake can have, written here, and
//! never from a fit that has seen the test it is judged by.

use super::campaign::Campaign;
use super::score::Score;
use compensator_core::term::{LOOKUP_LEVELS, LOOKUP_TORQUES, LookupFormula};
use compensator_core::{ParameterId as Id, Parameters, Quantity};
use friction_identification::fit::{FitOptions, Resolution, Rows, Track, fit, predict};
use friction_identification::spec::Spec;
use rayon::prelude::*;

/// Two steps of the core in each row of 256 Hz: of the fits of damper-2 a finer one moves the held-out error by less
/// than 0.1 %.
pub(super) const RESOLUTION: Resolution = Resolution { substeps: 2, extrapolated: false };

/// Elastic travel from no force to the level a fit starts at, m: the bands' stretch.
const ELASTIC_TRAVEL_M: f64 = 3e-3;

/// Gap a fit starts at, m.
const GAP_M: f64 = 3e-3;

/// Simulations per parameter after which a fit ends.
const PATIENCE: usize = 12;

/// Where a step would lower the sum of squares by less than this share of one row's, a fit ends.
const ENOUGH: f64 = 0.1;

/// A model of the comparison.
#[derive(Clone, Copy, Debug)]
pub(super) struct Arm {
    /// What it is called in tables.
    pub name: &'static str,
    /// As `--model` has it.
    pub model: &'static str,
    /// Whether the level follows the preset tension.
    pub tension: bool,
}

/// Coulomb and viscous friction and an offset.
pub(super) const COULOMB_VISCOUS: Arm =
    Arm { name: "Coulomb + viscous", model: "linear+torque-offset", tension: false };

/// LuGre with the paper's asymmetric level (its eq. 4).
pub(super) const LUGRE: Arm = Arm { name: "LuGre", model: "lugre-asymmetric", tension: false };

/// LuGre with the causes that have names, for tests of several tensions.
pub(super) const NAMED_WITH_TENSION: Arm = Arm {
    name: "LuGre + backlash, tension, directions",
    model: "lugre+backlash+direction-asymmetry+unknown",
    tension: true,
};

/// The same where the tension is one.
pub(super) const NAMED: Arm = Arm {
    name: "LuGre + backlash, directions",
    model: "lugre-asymmetric+backlash",
    tension: false,
};

impl Arm {
    /// Fits the model to some tests.
    pub fn fit(&self, tracks: &[Track]) -> Parameters<f64> {
        let spec = Spec::parse(self.model).expect("a model of this file");
        let fits = self.starts(&spec, tracks).into_iter().map(|start| {
            let options = FitOptions {
                resolution: Some(RESOLUTION),
                starts: 1,
                fixed: LOOKUP_TORQUES.into_iter().chain(LOOKUP_LEVELS).collect(),
                patience: PATIENCE,
                enough: ENOUGH,
                start: Some(start.clone()),
                ..FitOptions::default()
            };
            let rows = Rows { tracks, decimate: 1 };
            let parameters = fit(&spec, &start, rows, &options).parameters();
            let rmse = predict(&parameters, rows, RESOLUTION).metrics.rmse;
            (rmse, parameters)
        });
        let best = fits.min_by(|(one, _), (other, _)| one.total_cmp(other));
        best.expect("a start").1
    }

    /// Where fits start: one point, or one for each way a gap can be crossed.
    fn starts(&self, spec: &Spec, tracks: &[Track]) -> Vec<Parameters<f64>> {
        let forces = || tracks.iter().flat_map(|track| &track.torque);
        let squares: f64 = forces().map(|force| force * force).sum();
        let level = 1.2 * (squares / forces().count().max(1) as f64).sqrt();
        let speeds = tracks.iter().flat_map(|track| &track.samples);
        let fastest = speeds.map(|sample| sample.velocity_rad_s.abs()).fold(0.0, f64::max);
        let mut start = spec.parameters().expect("few terms");
        for (id, value) in [
            (Id::CoulombTorque, level),
            (Id::StaticTorque, 1.1 * level),
            (Id::CoulombTorqueNegative, level),
            (Id::StaticTorqueNegative, 1.1 * level),
            (Id::StribeckVelocity, 0.2 * fastest),
            (Id::BristleStiffness, level / ELASTIC_TRAVEL_M),
            (Id::BristleDamping, 0.0),
            (Id::ViscousFriction, 0.0),
        ] {
            start.set(id, value);
        }
        if self.tension {
            let tensions = || tracks.iter().flat_map(|track| &track.samples).map(|s| s.auxiliary);
            let least = tensions().fold(f64::INFINITY, f64::min);
            let most = tensions().fold(f64::NEG_INFINITY, f64::max);
            let column = Quantity::Auxiliary.info().column.expect("a column of the table");
            for (id, value) in [
                (Id::LookupColumn, f64::from(column)),
                (Id::LookupLower, least),
                (Id::LookupUpper, most),
                (Id::LookupFormula, f64::from(LookupFormula::Saturating as u8)),
                (Id::LookupRise, 0.5),
                (Id::LookupScale, 0.3 * (most - least)),
            ] {
                start.set(id, value);
            }
        }
        if !self.model.contains("backlash") {
            return vec![start];
        }
        let with_gap = |unloaded: f64| {
            start.clone().with(Id::BacklashTravel, GAP_M).with(Id::BacklashUnloaded, unloaded)
        };
        vec![with_gap(0.0), with_gap(1.0)]
    }

    /// A fit for each fold, which has not seen it.
    pub fn fits(
        &self,
        tests: &Campaign,
        folds: &[Vec<usize>],
        done: &(dyn Fn(&str) + Sync),
    ) -> Vec<Parameters<f64>> {
        let fitted = |fold: &Vec<usize>| {
            let parameters = self.fit(&tests.others(fold));
            done(self.name);
            parameters
        };
        folds.par_iter().map(fitted).collect()
    }

    /// The forces of all tests, each simulated by a fit to that test alone: what the paper's Table 2 does.
    pub fn fitted_to_each(&self, tests: &Campaign) -> Score {
        let of = |track: &Track| simulated(&self.fit(std::slice::from_ref(track)), track);
        Score::of(&tests.tracks, tests.tracks.par_iter().map(of).collect())
    }
}

/// The forces of all tests, each simulated by the fit of its fold.
pub(super) fn held_out(tests: &Campaign, folds: &[Vec<usize>], fits: &[Parameters<f64>]) -> Score {
    let mut force = vec![Vec::new(); tests.tracks.len()];
    for (fold, parameters) in folds.iter().zip(fits) {
        for test in fold {
            force[*test] = simulated(parameters, &tests.tracks[*test]);
        }
    }
    Score::of(&tests.tracks, force)
}

/// The force of a model along a test, N.
pub(super) fn simulated(parameters: &Parameters<f64>, track: &Track) -> Vec<f64> {
    let rows = Rows { tracks: std::slice::from_ref(track), decimate: 1 };
    predict(parameters, rows, RESOLUTION).torque.swap_remove(0)
}
