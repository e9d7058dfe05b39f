//! Friction falls with the heat it leaves, where no temperature is logged.
//!
//! The heat is a state of the joint that no column shows; what fills it, the work of the friction, the model
//! knows itself. How much of it counts (`E0`) and how soon it is lost (`T`) is not linear: a coarse grid of both,
//! from what this log's motion dissipates and how long it goes on, each simulated for itself.

use super::definition::{Cause, LEVELS, Remedy};
use crate::diagnose::candidate::{Beside, Candidate, InitialGuess, Regressor};
use crate::diagnose::evidence::{Evidence, Over, Plane, Seen, Spacing};
use crate::diagnose::extended::Extended;
use crate::diagnose::sensitivities::Exact;
use crate::fit::Track;
use crate::number::significant;
use compensator_core::{ParameterId as Id, TermKind};

/// Times of cooling that are tried, over the length of a run.
const COOLING: [f64; 3] = [0.5, 5.0, 100.0];

/// Energies that are tried, over what is held of the work of a run after so long a time.
const ENERGIES: [f64; 2] = [0.5, 2.0];

/// Heat that stays is a change over the campaign, which no rest brings back: to be named beside that one. It is lost in so
/// many campaigns.
const HELD_OVER_CAMPAIGNS: f64 = 10.0;

/// See the module.
pub struct WarmUp;

/// Length, s, and mean dissipation, W, of the run in the middle of all by length.
fn typical(tracks: &[Track]) -> Option<(f64, f64)> {
    let length = |track: &Track| {
        let ratios = track.period_ratio.as_ref();
        let rows = ratios.map_or(track.len() as f64, |ratios| ratios.iter().sum());
        rows * track.period_s
    };
    let mut lengths: Vec<f64> = tracks.iter().map(length).collect();
    lengths.sort_by(f64::total_cmp);
    let middle = *lengths.get(lengths.len() / 2)?;
    let rows: usize = tracks.iter().map(Track::len).sum();
    let power = |track: &Track| -> f64 {
        let both = track.samples.iter().zip(&track.torque);
        both.map(|(sample, torque)| sample.velocity_rad_s * torque).sum()
    };
    let mean = tracks.iter().map(power).sum::<f64>() / rows.max(1) as f64;
    (mean > 0.0 && middle > 0.0).then_some((middle, mean))
}

/// One that takes this energy, J, and loses it in this time, s.
fn candidate(beside: &Beside, energy_j: f64, cooling_s: f64) -> Candidate {
    let legal = |id: Id, value: f64| value.clamp(id.info().lower, id.info().upper);
    let energy = legal(Id::WarmUpEnergy, energy_j);
    let cooling = legal(Id::WarmUpCooling, cooling_s);
    let settings = vec![(Id::WarmUpEnergy, energy), (Id::WarmUpCooling, cooling)];
    let by = Exact { kind: TermKind::WarmUp, settings, derivative: Some(Id::WarmUpFall) };
    let columns = [beside.log.velocity_name()];
    Candidate::new(TermKind::WarmUp, &columns, vec![Regressor::Exact(by)]).starting_at(&[
        (Id::WarmUpFall, InitialGuess::Times(0, 1.0)),
        (Id::WarmUpEnergy, InitialGuess::At(energy)),
        (Id::WarmUpCooling, InitialGuess::At(cooling)),
    ])
}

impl Cause for WarmUp {
    fn name(&self) -> &'static str {
        "warm-up"
    }

    fn meaning(&self) -> &'static str {
        "friction falls with the heat that rubbing leaves"
    }

    fn effect(&self) -> &'static str {
        "levels fall with the work of friction, which is lost again with time."
    }

    fn remedy(&self) -> Remedy {
        Remedy::Term(TermKind::WarmUp)
    }

    fn acts_on(&self) -> &'static [Id] {
        LEVELS
    }

    fn is_nonlinear(&self) -> bool {
        true
    }

    fn is_imitated(&self) -> bool {
        true
    }

    fn candidates(&self, beside: &Beside) -> Vec<Candidate> {
        // Where every run begins at the same time nobody knows how warm it began.
        if !beside.log.has_campaign_clock() {
            return Vec::new();
        }
        let Some((length_s, power)) = typical(&beside.log.train_tracks) else { return Vec::new() };
        let tracks = &beside.log.train_tracks;
        let rubbing_s: f64 = tracks.iter().map(|track| track.len() as f64 * track.period_s).sum();
        let within_runs = COOLING.into_iter().flat_map(|cooling| {
            // What is held in the end of a steady power over one run.
            let held = power * length_s * cooling * (1.0 - (-1.0 / cooling).exp());
            ENERGIES.map(|share| (share * held, cooling * length_s))
        });
        let of_campaign = ENERGIES.map(|share| {
            (share * power * rubbing_s, HELD_OVER_CAMPAIGNS * beside.log.campaign_s())
        });
        // A temperature that was measured knows better.
        let is_told = beside.log.varies("temperature_c");
        let own = within_runs.map(|(energy, cooling)| {
            let candidate = candidate(beside, energy, cooling);
            if is_told { candidate.as_rival() } else { candidate }
        });
        own.chain(
            of_campaign.map(|(energy, cooling)| candidate(beside, energy, cooling).as_rival()),
        )
        .collect()
    }

    fn in_words(&self, size: &crate::diagnose::Size, extended: &Extended) -> String {
        format!(
            "{}: by a share of {}, most of it within {} J, which is lost again in {} s",
            self.meaning(),
            size.in_words(),
            significant(extended.value(Id::WarmUpEnergy), 2),
            significant(extended.value(Id::WarmUpCooling), 2)
        )
    }

    fn evidence(&self, _: &[String], _: &Extended) -> Option<Evidence> {
        Plane::new(
            "Over the campaign",
            Over::CampaignTime,
            Seen::Along,
            "Residual along the motion. A joint that warms up rubs less and less while it works, and as before              after a rest.",
        )
        .spaced(Spacing::Even)
        .into()
    }

    fn next_experiment(&self, _: &[String]) -> Option<String> {
        Some(
            "Log a temperature near the seal; or repeat one run cold, at once after a long fast run, and once more after              a rest of several minutes: heat comes back down, run-in does not."
                .into(),
        )
    }
}
