//! `lugre-lstm`: LuGre supplied by a network, trained and judged on whole tests.
//!
//! Three ways to feed it, because they claim different things. The preset *tension* is known beforehand and does not
//! change in a test: the network can set levels and stiffness, and no gap. With the *motion* (tension, velocity, and the
//! force the law itself holds) it can make the stiffness vanish where a gap is crossed: a prediction. The *actuators'*
//! forces are the paper's inputs, and consequences of the friction: a network fed by them reads part of the answer. It
//! may be called an estimator of the force from two load cells, not a prediction of it.

use super::arm::RESOLUTION;
use super::campaign::Campaign;
use super::score::Score;
use compensator_core::Parameters;
use friction_identification::fit::Track;
use friction_identification::network::{
    Input, Progress, Run, Supplied, TrainOptions, predict, train,
};
use rayon::prelude::*;

/// What a network is fed with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fed {
    /// The preset tension.
    Tension,
    /// Tension, velocity, and the force the law holds.
    Motion,
    /// Both actuators' forces.
    Actuators,
}

impl Fed {
    /// What the model is called in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tension => "lugre-lstm (tension)",
            Self::Motion => "lugre-lstm (tension and motion)",
            Self::Actuators => "lugre-lstm (actuators' forces)",
        }
    }

    /// Trains a network on some tests; `covariate` gives a column's place.
    fn learn(
        self,
        base: &Parameters<f64>,
        tracks: &[Track],
        places: &Places,
        options: &TrainOptions,
        progress: &(dyn Fn(Progress) + Sync),
    ) -> Learnt {
        let Places { tension, actuators } = *places;
        match self {
            Self::Tension => Learnt::One(trained(base, [tension], tracks, options, progress)),
            Self::Motion => {
                let inputs = [tension, Input::Velocity, Input::Held];
                Learnt::Three(trained(base, inputs, tracks, options, progress))
            }
            Self::Actuators => Learnt::Two(trained(base, actuators, tracks, options, progress)),
        }
    }

    /// The forces of all tests, each by a network that has not seen it. `bases` are the laws of the folds.
    pub fn held_out(
        self,
        tests: &Campaign,
        folds: &[Vec<usize>],
        bases: &[Parameters<f64>],
        options: &TrainOptions,
        done: &(dyn Fn(&str) + Sync),
    ) -> Score {
        let places = Places::of(tests);
        let by_fold: Vec<Vec<(usize, Vec<f64>)>> = folds
            .par_iter()
            .zip(bases)
            .map(|(fold, base)| {
                let learnt = self.learn(base, &tests.others(fold), &places, options, &|at| {
                    say(self, at, options, done);
                });
                fold.iter().map(|test| (*test, learnt.run(&tests.tracks[*test]).torque)).collect()
            })
            .collect();
        let mut force = vec![Vec::new(); tests.tracks.len()];
        for (test, simulated) in by_fold.into_iter().flatten() {
            force[test] = simulated;
        }
        Score::of(&tests.tracks, force)
    }

    /// A network that has seen all tests, and their forces by it.
    pub fn learnt_from_all(
        self,
        tests: &Campaign,
        base: &Parameters<f64>,
        options: &TrainOptions,
        done: &(dyn Fn(&str) + Sync),
    ) -> (Learnt, Score) {
        let places = Places::of(tests);
        let learnt = self.learn(base, &tests.tracks, &places, options, &|at| {
            say(self, at, options, done);
        });
        let force = tests.tracks.iter().map(|track| learnt.run(track).torque).collect();
        let score = Score::of(&tests.tracks, force);
        (learnt, score)
    }
}

/// Which columns are what.
#[derive(Clone, Copy)]
struct Places {
    tension: Input,
    actuators: [Input; 2],
}

impl Places {
    fn of(tests: &Campaign) -> Self {
        let of = |name: &str| {
            let place = tests.covariates.iter().position(|covariate| covariate == name);
            Input::Covariate(place.unwrap_or(0))
        };
        Self {
            tension: of(super::campaign::TENSION),
            actuators: super::campaign::ACTUATORS.map(of),
        }
    }
}

/// A trained network, by how many inputs it has.
#[derive(Clone)]
pub(super) enum Learnt {
    One(Box<Supplied<1>>),
    Two(Box<Supplied<2>>),
    Three(Box<Supplied<3>>),
}

impl Learnt {
    /// The law along a test.
    pub fn run(&self, track: &Track) -> Run {
        match self {
            Self::One(supplied) => predict(supplied, track),
            Self::Two(supplied) => predict(supplied, track),
            Self::Three(supplied) => predict(supplied, track),
        }
    }

    /// From here on strokes unlike those of these tests count as outside.
    pub fn watch_strokes(&mut self, tracks: &[Track]) {
        match self {
            Self::One(supplied) => supplied.watch_strokes(tracks),
            Self::Two(supplied) => supplied.watch_strokes(tracks),
            Self::Three(supplied) => supplied.watch_strokes(tracks),
        }
    }
}

fn trained<const INPUTS: usize>(
    base: &Parameters<f64>,
    inputs: [Input; INPUTS],
    tracks: &[Track],
    options: &TrainOptions,
    progress: &(dyn Fn(Progress) + Sync),
) -> Box<Supplied<INPUTS>> {
    Box::new(train(base, inputs, tracks, options, progress).supplied)
}

/// Training of a campaign: passes in the long or the short form.
pub(super) fn options(seed: u64, epochs: usize, groups: usize) -> TrainOptions {
    let substeps = RESOLUTION.substeps;
    TrainOptions { seed, epochs, groups, substeps, ..TrainOptions::default() }
}

fn say(fed: Fed, at: Progress, options: &TrainOptions, done: &(dyn Fn(&str) + Sync)) {
    const EVERY: usize = 10;
    if at.epoch.is_multiple_of(EVERY) {
        let (name, epochs) = (fed.name(), options.epochs);
        done(&format!("{name}: pass {} of {epochs}, loss {:.4}", at.epoch, at.loss));
    }
}
