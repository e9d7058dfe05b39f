//! The compared models and their fits.
//!
//! Each model is the core's own law with terms, fitted by [`friction_fit`]. Far from the optimum a gap and
//! an elastic travel can replace each other. A fit therefore starts from typical sizes of a band brake, given below. It
//! does not start from a fit that has used the held-out test.

use super::campaign::TestCampaign;
use super::score::CampaignScore;
use compensator_core::term::{LOOKUP_LEVELS, LOOKUP_TORQUES, LookupFormula};
use compensator_core::{ParameterId as Id, Parameters, Quantity};
use friction_fit::spec::Spec;
use friction_fit::{FitOptions, Resolution, Rows, Track, fit, predict};
use rayon::prelude::*;

/// Two core steps per row of 256 Hz. A finer step changes the held-out error of damper-2 by less than 0.1 %.
pub(super) const RESOLUTION: Resolution = Resolution { substeps: 2, extrapolated: false };

/// Initial elastic travel from zero force to the friction level, m: the stretch of the bands.
const ELASTIC_TRAVEL_M: f64 = 3e-3;

/// Initial gap of a fit, m.
const GAP_M: f64 = 3e-3;

/// Maximum number of simulations per parameter in a fit.
const MAX_SIMULATIONS_PER_PARAMETER: usize = 12;

/// A fit ends if a step reduces the sum of squares by less than this share of one row's.
const MIN_REDUCTION_ROWS: f64 = 0.1;

/// A compared model.
#[derive(Clone, Copy, Debug)]
pub(super) struct DamperModel {
    /// Name in tables.
    pub name: &'static str,
    /// Value of `--model`.
    pub model: &'static str,
    /// The friction level follows the preset tension.
    pub tension: bool,
}

/// Coulomb and viscous friction with an offset.
pub(super) const COULOMB_VISCOUS: DamperModel =
    DamperModel { name: "Coulomb + viscous", model: "linear+torque-offset", tension: false };

/// LuGre with the paper's asymmetric level (its eq. 4).
pub(super) const LUGRE: DamperModel =
    DamperModel { name: "LuGre", model: "lugre-asymmetric", tension: false };

/// LuGre with named causes, for tests at several tensions.
pub(super) const NAMED_WITH_TENSION: DamperModel = DamperModel {
    name: "LuGre + backlash, tension, directions",
    model: "lugre+backlash+direction-asymmetry+unknown",
    tension: true,
};

/// LuGre with named causes, for tests at one tension.
pub(super) const NAMED: DamperModel = DamperModel {
    name: "LuGre + backlash, directions",
    model: "lugre-asymmetric+backlash",
    tension: false,
};

impl DamperModel {
    /// Fits the model to these tests.
    pub fn fit(&self, tracks: &[Track]) -> Parameters<f64> {
        let spec = Spec::parse(self.model).expect("a model of this file");
        let fits = self.starts(&spec, tracks).into_iter().map(|start| {
            let options = FitOptions {
                resolution: Some(RESOLUTION),
                starts: 1,
                fixed: LOOKUP_TORQUES.into_iter().chain(LOOKUP_LEVELS).collect(),
                patience: MAX_SIMULATIONS_PER_PARAMETER,
                tolerance: MIN_REDUCTION_ROWS,
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

    /// Starting points: one, or with backlash one for each way of crossing the gap.
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

    /// Fits the model once per fold, to the tests outside the fold.
    pub fn fits(
        &self,
        tests: &TestCampaign,
        folds: &[Vec<usize>],
        done: &(dyn Fn(&str) + Sync),
    ) -> Vec<Parameters<f64>> {
        let fitted = |fold: &Vec<usize>| {
            let parameters = self.fit(&tests.tests_outside(fold));
            done(self.name);
            parameters
        };
        folds.par_iter().map(fitted).collect()
    }

    /// Forces of all tests, each by a fit to that test alone, as in the paper's Table 2.
    pub fn fitted_to_each(&self, tests: &TestCampaign) -> CampaignScore {
        let of = |track: &Track| simulated(&self.fit(std::slice::from_ref(track)), track);
        CampaignScore::of(&tests.tracks, tests.tracks.par_iter().map(of).collect())
    }
}

/// Forces of all tests, each by the fit of its fold.
pub(super) fn held_out(
    tests: &TestCampaign,
    folds: &[Vec<usize>],
    fits: &[Parameters<f64>],
) -> CampaignScore {
    let mut force = vec![Vec::new(); tests.tracks.len()];
    for (fold, parameters) in folds.iter().zip(fits) {
        for test in fold {
            force[*test] = simulated(parameters, &tests.tracks[*test]);
        }
    }
    CampaignScore::of(&tests.tracks, force)
}

/// Returns the force of a model along a test, N.
pub(super) fn simulated(parameters: &Parameters<f64>, track: &Track) -> Vec<f64> {
    let rows = Rows { tracks: std::slice::from_ref(track), decimate: 1 };
    predict(parameters, rows, RESOLUTION).torque.swap_remove(0)
}
