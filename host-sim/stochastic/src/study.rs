//! Computation of certificates: the parts that do not depend on the source of the residual.
//!
//! The measured residual gives the certificate. White noise of the sensor gives the reference certificate without
//! missing physics, on the same inputs, trials and draws for a calibration of the rule.

use super::certificate::{Certificate, Class, ExcludedParameter, MAX_CV};
use super::classes::{SpeedClass, speed_classes};
use super::draw::{Draws, certifiable, spread_at, varied};
use super::ensemble::Ensemble;
use super::range::Ranges;
use super::search::SpreadSearch;
use super::settings::Settings;
use super::trials::{Block, Trials};
use compensator_core::{ParameterId, Parameters};
use friction_fit::Track;
use rayon::prelude::*;

/// A model with the trials of each speed class.
pub struct CertificateStudy<'a> {
    parameters: Parameters<f64>,
    certified: Vec<ParameterId>,
    left_out: Vec<ExcludedParameter>,
    classes: Vec<(SpeedClass, Trials)>,
    draws: Draws,
    settings: &'a Settings,
}

impl<'a> CertificateStudy<'a> {
    /// Sorts the runs into classes and simulates the fitted model along them.
    pub fn new(
        parameters: &Parameters<f64>,
        free: &[ParameterId],
        tracks: &[Track],
        settings: &'a Settings,
    ) -> Self {
        let mut parameters = parameters.clone();
        // The declared speed limit would clip measured velocities.
        parameters.envelope.velocity_max_rad_s = f32::MAX;
        let (mut certified, mut left_out) = (Vec::new(), Vec::new());
        for id in free {
            match certifiable(&parameters, *id) {
                Ok(()) if !certified.contains(id) => certified.push(*id),
                Ok(()) => {}
                Err(why) => left_out.push(ExcludedParameter { parameter: *id, why }),
            }
        }
        let counts = settings.counts();
        let classes = speed_classes(tracks, settings.joint, settings.max_classes)
            .into_iter()
            .filter_map(|class| {
                let class_tracks: Vec<&Track> =
                    class.tracks.iter().filter_map(|index| tracks.get(*index)).collect();
                let trials = Trials::new(
                    &parameters,
                    &class_tracks,
                    counts.trials,
                    settings.samples_per_run,
                    settings.resolution,
                    settings.seed,
                );
                (!trials.trials.is_empty()).then_some((class, trials))
            })
            .collect();
        let draws = Draws::new(settings.seed, &certified, counts.sampled_vectors);
        Self { parameters, certified, left_out, classes, draws, settings }
    }

    /// Returns the trials of a class and the violation probability of the fitted model itself. If that exceeds `rho`, the range
    /// is centred on the fit.
    fn ensemble<'b>(&self, trials: &'b Trials, ranges: Ranges) -> (Ensemble<'b>, f64) {
        let times = self.settings.monitoring_times;
        let ensemble = Ensemble::new(trials, &ranges, times);
        let at_fit = ensemble.violation(&varied(&self.parameters, &[]));
        if at_fit <= self.settings.levels.rho {
            return (ensemble, at_fit);
        }
        (Ensemble::new(trials, &ranges.around_the_fit(), times), at_fit)
    }

    /// Searches for the largest permitted spreads of every class, with the range of the measured residuals.
    pub fn certify(&self) -> Certificate {
        let draws = self.settings.counts().trials;
        self.certify_within(|trials| {
            Ranges::new(trials.blocks.iter().flat_map(Block::residuals), draws)
        })
    }

    /// Searches for the largest permitted spreads of every class, with the range that `ranges` gives for its trials.
    pub fn certify_within(&self, ranges: impl Fn(&Trials) -> Ranges) -> Certificate {
        let ensemble = |trials| self.ensemble(trials, ranges(trials));
        let ensembles: Vec<(Ensemble, f64)> =
            self.classes.iter().map(|(_, trials)| ensemble(trials)).collect();
        let search = |class: usize| SpreadSearch {
            ensemble: &ensembles[class].0,
            parameters: &self.parameters,
            ids: &self.certified,
            draws: &self.draws,
            levels: self.settings.levels,
            max_spread: spread_at(MAX_CV),
        };
        let sides: Vec<(usize, ParameterId, f64)> = (0..ensembles.len())
            .flat_map(|class| self.certified.iter().map(move |id| (class, *id)))
            .flat_map(|(class, id)| [(class, id, -1.0), (class, id, 1.0)])
            .collect();
        let limits: Vec<f64> =
            sides.par_iter().map(|(class, id, sign)| search(*class).limit(*id, *sign)).collect();
        let count = self.certified.len();
        let classes = (0..ensembles.len())
            .map(|class| {
                let search = search(class);
                let sides = &limits[2 * class * count..2 * (class + 1) * count];
                let spreads: Vec<f64> =
                    sides.chunks_exact(2).map(|pair| search.spread(pair[0], pair[1])).collect();
                let share = search.share(&spreads);
                Class {
                    name: self.classes[class].0.name.clone(),
                    violations: search.violations(&spreads, share),
                    spreads,
                    share,
                    violation_at_fit: ensembles[class].1,
                }
            })
            .collect();
        let mut certificate = Certificate::assemble(
            classes,
            &self.certified,
            &self.parameters,
            self.settings,
            self.left_out.clone(),
        );
        certificate.simulations =
            ensembles.iter().map(|(ensemble, _)| ensemble.simulations()).sum();
        certificate
    }
}
