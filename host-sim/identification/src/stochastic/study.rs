//! A certificate in the making: everything that does not depend on which residual is taken.
//!
//! The measured residual gives the certificate. White noise of the sensor's size in its place gives that of
//! a world with nothing hidden, on the same inputs, trials and draws ([`super::calibrate`]).

use super::certificate::{CV_MOST, Certificate, Class, LeftOut};
use super::classes::{SpeedClass, speed_classes};
use super::draw::{Draws, certifiable, spread_at, varied};
use super::ensemble::Ensemble;
use super::range::Ranges;
use super::search::Search;
use super::settings::Settings;
use super::trials::{Block, Trials};
use crate::fit::Track;
use compensator_core::{ParameterId, Parameters};
use rayon::prelude::*;

/// Whose residuals make the data's range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Residual {
    /// The log's.
    Measured,
    /// A sensor's white noise, where the model is the truth.
    NoiseAlone,
}

/// A model on the trials of each speed class.
pub(super) struct Study<'a> {
    parameters: Parameters<f64>,
    certified: Vec<ParameterId>,
    left_out: Vec<LeftOut>,
    classes: Vec<(SpeedClass, Trials)>,
    draws: Draws,
    settings: &'a Settings,
}

impl<'a> Study<'a> {
    /// Sorts the runs and steps the fitted model along them.
    pub fn new(
        parameters: &Parameters<f64>,
        free: &[ParameterId],
        tracks: &[Track],
        settings: &'a Settings,
    ) -> Self {
        let mut parameters = parameters.clone();
        // The declared speed limits the step; all that was measured is to be seen, as in a fit.
        parameters.envelope.velocity_max_rad_s = f32::MAX;
        let (mut certified, mut left_out) = (Vec::new(), Vec::new());
        for id in free {
            match certifiable(&parameters, *id) {
                Ok(()) if !certified.contains(id) => certified.push(*id),
                Ok(()) => {}
                Err(why) => left_out.push(LeftOut { parameter: *id, why }),
            }
        }
        let counts = settings.counts();
        let classes = speed_classes(tracks, settings.joint, settings.most_classes)
            .into_iter()
            .filter_map(|class| {
                let own: Vec<&Track> =
                    class.tracks.iter().filter_map(|index| tracks.get(*index)).collect();
                let trials = Trials::new(
                    &parameters,
                    &own,
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

    fn ranges(&self, trials: &Trials, residual: Residual) -> Ranges {
        let draws = self.settings.counts().trials;
        match residual {
            Residual::Measured => {
                let rows = trials.blocks.iter().flat_map(Block::residuals);
                Ranges::new(rows, draws)
            }
            Residual::NoiseAlone => Ranges::of_noise(noise(trials), draws),
        }
    }

    /// The trials of a class, and how often the fitted model itself is outside the data's range.
    /// Where that is more than allowed, the range is laid around the fit.
    fn ensemble<'b>(&self, trials: &'b Trials, residual: Residual) -> (Ensemble<'b>, f64) {
        let times = self.settings.monitoring_times;
        let ranges = self.ranges(trials, residual);
        let ensemble = Ensemble::new(trials, &ranges, times);
        let at_fit = ensemble.violation(&varied(&self.parameters, &[]));
        if at_fit <= self.settings.levels.rho {
            return (ensemble, at_fit);
        }
        (Ensemble::new(trials, &ranges.around_the_fit(), times), at_fit)
    }

    /// Searches the largest permitted spreads of every class.
    pub fn certify(&self, residual: Residual) -> Certificate {
        let ensembles: Vec<(Ensemble, f64)> =
            self.classes.iter().map(|(_, trials)| self.ensemble(trials, residual)).collect();
        let search = |class: usize| Search {
            ensemble: &ensembles[class].0,
            parameters: &self.parameters,
            ids: &self.certified,
            draws: &self.draws,
            levels: self.settings.levels,
            spread_most: spread_at(CV_MOST),
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
                let own = &limits[2 * class * count..2 * (class + 1) * count];
                let spreads: Vec<f64> =
                    own.chunks_exact(2).map(|pair| search.spread(pair[0], pair[1])).collect();
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

/// Noise of the torque, Nm, from its second differences: what a smooth torque would not have. The
/// median keeps breakaways and reversals out. As [`crate::fit::scales::Scales::noise`], of the blocks alone.
fn noise(trials: &Trials) -> f64 {
    let torques = || trials.blocks.iter().map(|block| block.torque.as_slice());
    let second = |w: &[f64]| (w[0] - 2.0 * w[1] + w[2]).abs();
    let mut differences: Vec<f64> =
        torques().flat_map(|torque| torque.windows(3).map(second)).collect();
    differences.sort_by(f64::total_cmp);
    let median = differences.get(differences.len() / 2).copied().unwrap_or_default();
    let rows = torques().map(<[f64]>::len).sum::<usize>().max(1) as f64;
    let squares: f64 = torques().flatten().map(|torque| torque * torque).sum();
    // A log without noise has its rounding.
    (median / (0.6745 * 6f64.sqrt())).max(1e-5 * (squares / rows).sqrt()).max(1e-12)
}
