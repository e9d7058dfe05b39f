//! The rival: a feed-forward by a table over speed, fitted to the same recordings.

use super::Stand;
use super::stand::performed;
use compensator_core::TermKind;
use firmware::parameter_set::ParameterSet;
use friction_fit::spec::Spec;
use friction_fit::{FitOptions, Rows, identify_robustly};
use joint_tuning::Session;
use joint_tuning::motion::{Motion, standard};
use joint_tuning::score::score;
use joint_tuning::trial_set::TunedSet;

/// Static laws over speed, as a table has them: the better one on held-out runs is used.
const LAWS: [&str; 2] = ["stribeck", "linear"];
/// Shares of the table's torque that are tried.
const SCALES: [f32; 3] = [1.0, 0.9, 0.7];
/// Pairs of blocks: rival and saved set.
const PAIRS: usize = 4;

/// Sets of the rival, with the saved set's loop gains.
pub struct Rival {
    candidates: Vec<TunedSet>,
    saved: TunedSet,
    motion: Motion,
}

impl Rival {
    /// Fits the table of a session that saved a set.
    ///
    /// # Errors
    /// Returns one line if no static law can be fitted.
    pub fn new(session: &Session) -> Result<Self, String> {
        let (Some(learnt), Some(set)) = (&session.learnt, &session.tried) else {
            return Err("the session learnt nothing".to_owned());
        };
        let saved = TunedSet { set: set.clone(), position_gain: session.position_gain };
        let rows = Rows { tracks: &learnt.input.train, decimate: learnt.input.decimate };
        let fits = LAWS.iter().filter_map(|law| {
            let spec = Spec::parse(law).ok()?.on(&[TermKind::UnmodelledInertia]);
            let base = spec.parameters().ok()?;
            let (test, loss) = (learnt.input.test_rows(), learnt.input.loss);
            Some(identify_robustly(loss, &spec, &base, rows, test, &FitOptions::default()))
        });
        let best = fits.min_by(|a, b| a.test.rmse.total_cmp(&b.test.rmse));
        let table = best.ok_or("no static law fits")?.for_driver();
        let candidates = SCALES.iter().filter_map(|scale| {
            let mut set: ParameterSet = set.clone();
            let mut model = table.parameters.convert::<f32>();
            model.terms.retain(|term| *term != TermKind::UnmodelledInertia);
            model.envelope = set.friction.model.envelope;
            set.friction.model = model;
            set.friction.compensator.scale = *scale;
            set.validate().is_ok().then_some(TunedSet { set, position_gain: saved.position_gain })
        });
        Ok(Self { candidates: candidates.collect(), saved, motion: standard(&super::LIMITS) })
    }

    /// Returns the errors of the rival over those of the saved set, in blocks that alternate: at reversals and RMS, by the
    /// true position and by that of the encoder.
    ///
    /// # Errors
    /// Returns one line if the joint stops.
    pub fn ratio(&self, stand: &Stand, session: &Session) -> Result<[[f64; 2]; 2], String> {
        let options = super::options(0, super::LIMITS);
        let perform = |tuned: &TunedSet| -> Result<[f64; 4], String> {
            let origin_rad = session.before.position_rad;
            let recording = performed(stand.client(), &options, origin_rad, tuned, &self.motion)
                .map_err(|error| error.to_string())?;
            let truth = stand.truth().scored(&recording).scores;
            let shown = score(&recording, 1.0).scores;
            Ok([
                truth.reversal_error_rad,
                truth.tracking_rms_rad,
                shown.reversal_error_rad,
                shown.tracking_rms_rad,
            ])
        };
        let mut screened = Vec::new();
        for tuned in &self.candidates {
            let [reversal, rms, ..] = perform(tuned)?;
            screened.push((reversal * rms, tuned));
        }
        let best = screened.iter().min_by(|a, b| a.0.total_cmp(&b.0));
        let Some((_, best)) = best else { return Ok([[f64::NAN; 2]; 2]) };
        let mut sums = [[0.0; 4]; 2];
        for pair in 0..PAIRS {
            let order = if pair % 2 == 0 { [0, 1] } else { [1, 0] };
            for contender in order {
                let tuned = if contender == 0 { best } else { &&self.saved };
                for (sum, error) in sums[contender].iter_mut().zip(perform(tuned)?) {
                    *sum += error;
                }
            }
        }
        let ratio = |place: usize| sums[0][place] / sums[1][place];
        Ok([[ratio(0), ratio(1)], [ratio(2), ratio(3)]])
    }
}
