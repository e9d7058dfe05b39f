//! `lugre-lstm`: LuGre with levels and stiffness from a network, trained and evaluated on whole tests.
//!
//! Three choices of inputs claim different things. The preset *tension* is known beforehand and constant in a test. With it
//! the network can set levels and stiffness, but no gap. With the *motion* (tension, velocity, and the force of the law's
//! bristle) it can also remove the stiffness where a gap is crossed; this is a prediction. The *actuators'* forces are the
//! paper's inputs. They are consequences of the friction, so the network reads part of its answer from them. Such a model
//! estimates the force from two load cells; it does not predict it.

use super::campaign::{ACTUATORS, TENSION, TestCampaign};
use super::model::RESOLUTION;
use super::score::CampaignScore;
use crate::PaperError;
use compensator_core::Parameters;
use friction_fit::Track;
use friction_network::{
    NetworkInput, NetworkLaw, NetworkRun, TrainOptions, TrainingProgress, predict, train,
};
use rayon::prelude::*;

/// Inputs of a network.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NetworkInputs {
    /// The preset tension.
    Tension,
    /// Tension, velocity, and the force of the law's bristle.
    Motion,
    /// Both actuators' forces.
    Actuators,
}

impl NetworkInputs {
    /// Name of the model in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tension => "lugre-lstm (tension)",
            Self::Motion => "lugre-lstm (tension and motion)",
            Self::Actuators => "lugre-lstm (actuators' forces)",
        }
    }

    /// Trains a network on these tracks of the tests.
    fn train(
        self,
        base: &Parameters<f64>,
        tests: &TestCampaign,
        tracks: &[Track],
        options: &TrainOptions,
        progress: &(dyn Fn(TrainingProgress) + Sync),
    ) -> Result<TrainedNetwork, PaperError> {
        let column = |name| tests.covariate(name).map(NetworkInput::Covariate);
        Ok(match self {
            Self::Tension => {
                let inputs = [column(TENSION)?];
                TrainedNetwork::One(train_boxed(base, inputs, tracks, options, progress))
            }
            Self::Motion => {
                let inputs = [column(TENSION)?, NetworkInput::Velocity, NetworkInput::Held];
                TrainedNetwork::Three(train_boxed(base, inputs, tracks, options, progress))
            }
            Self::Actuators => {
                let [first, second] = ACTUATORS;
                let inputs = [column(first)?, column(second)?];
                TrainedNetwork::Two(train_boxed(base, inputs, tracks, options, progress))
            }
        })
    }

    /// Forces of all tests, each by a network trained without it. `bases` are the laws of the folds.
    ///
    /// # Errors
    /// Returns the name of an input that the tests do not have.
    pub fn held_out(
        self,
        tests: &TestCampaign,
        folds: &[Vec<usize>],
        bases: &[Parameters<f64>],
        options: &TrainOptions,
        done: &(dyn Fn(&str) + Sync),
    ) -> Result<CampaignScore, PaperError> {
        let by_fold: Vec<Vec<(usize, Vec<f64>)>> = folds
            .par_iter()
            .zip(bases)
            .map(|(fold, base)| {
                let seen = tests.tests_outside(fold);
                let network = self.train(base, tests, &seen, options, &|at| {
                    report_progress(self, at, options, done);
                })?;
                let run = |test: &usize| (*test, network.run(&tests.tracks[*test]).torque);
                Ok(fold.iter().map(run).collect())
            })
            .collect::<Result<_, PaperError>>()?;
        let mut force = vec![Vec::new(); tests.tracks.len()];
        for (test, simulated) in by_fold.into_iter().flatten() {
            force[test] = simulated;
        }
        Ok(CampaignScore::of(&tests.tracks, force))
    }

    /// Trains a network on all tests, and returns it with its forces.
    ///
    /// # Errors
    /// Returns the name of an input that the tests do not have.
    pub fn train_on_all(
        self,
        tests: &TestCampaign,
        base: &Parameters<f64>,
        options: &TrainOptions,
        done: &(dyn Fn(&str) + Sync),
    ) -> Result<(TrainedNetwork, CampaignScore), PaperError> {
        let network = self.train(base, tests, &tests.tracks, options, &|at| {
            report_progress(self, at, options, done);
        })?;
        let force = tests.tracks.iter().map(|track| network.run(track).torque).collect();
        let score = CampaignScore::of(&tests.tracks, force);
        Ok((network, score))
    }
}

/// A trained network, by its number of inputs.
#[derive(Clone)]
pub(super) enum TrainedNetwork {
    One(Box<NetworkLaw<1>>),
    Two(Box<NetworkLaw<2>>),
    Three(Box<NetworkLaw<3>>),
}

impl TrainedNetwork {
    /// Runs the law along a test.
    pub fn run(&self, track: &Track) -> NetworkRun {
        match self {
            Self::One(law) => predict(law, track),
            Self::Two(law) => predict(law, track),
            Self::Three(law) => predict(law, track),
        }
    }

    /// Marks strokes unlike those of these tests as outside the envelope.
    pub fn set_stroke_range(&mut self, tracks: &[Track]) {
        match self {
            Self::One(law) => law.set_stroke_range(tracks),
            Self::Two(law) => law.set_stroke_range(tracks),
            Self::Three(law) => law.set_stroke_range(tracks),
        }
    }
}

fn train_boxed<const INPUTS: usize>(
    base: &Parameters<f64>,
    inputs: [NetworkInput; INPUTS],
    tracks: &[Track],
    options: &TrainOptions,
    progress: &(dyn Fn(TrainingProgress) + Sync),
) -> Box<NetworkLaw<INPUTS>> {
    let trained = train(base, inputs, tracks, options, progress);
    Box::new(trained.expect("tests of finite numbers").law)
}

/// Training options of a campaign.
pub(super) fn options(seed: u64, epochs: usize, groups: usize) -> TrainOptions {
    let substeps = RESOLUTION.substeps;
    TrainOptions { seed, epochs, groups, substeps, ..TrainOptions::default() }
}

fn report_progress(
    inputs: NetworkInputs,
    at: TrainingProgress,
    options: &TrainOptions,
    done: &(dyn Fn(&str) + Sync),
) {
    const REPORT_INTERVAL_EPOCHS: usize = 10;
    if at.epoch.is_multiple_of(REPORT_INTERVAL_EPOCHS) {
        let (name, epochs) = (inputs.name(), options.epochs);
        done(&format!("{name}: pass {} of {epochs}, loss {:.4}", at.epoch, at.loss));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::LawKind;

    #[test]
    fn train_without_a_column_of_its_inputs_returns_its_name() {
        let tests = TestCampaign {
            names: Vec::new(),
            tracks: Vec::new(),
            covariates: vec![TENSION.into(), ACTUATORS[0].into()],
        };
        let trained = NetworkInputs::Actuators.train_on_all(
            &tests,
            &Parameters::new(LawKind::Lugre),
            &options(1, 1, 1),
            &|_| {},
        );
        let error = trained.map(|_| ()).expect_err("no second actuator");
        assert!(matches!(error, PaperError::NoCovariate("actuator2_force_n")), "{error}");
    }
}
