//! Warm-up: friction falls as friction work heats the joint, and no temperature is logged.
//!
//! The heat is a state of the joint that no column shows. The model computes its source, the work
//! of friction. Two parameters enter nonlinearly: the energy `E0` that reduces friction, J, and the
//! time constant `T` of cooling, s. The candidates form a coarse grid of both, scaled with the
//! dissipation and the length of this log's runs. Each candidate is simulated separately.

use super::definition::{Cause, LEVELS, Remedy};
use crate::candidate::{Candidate, FitContext, InitialGuess, Regressor};
use crate::evidence::{Evidence, Plane, PlaneAxis, ResidualView, Spacing};
use crate::extended::Extended;
use crate::sensitivities::Exact;
use compensator_core::{ParameterId as Id, TermKind};
use friction_fit::Track;
use joint_log::number::significant;

/// Cooling times of the candidates, as multiples of the length of a run.
const COOLING: [f64; 3] = [0.5, 5.0, 100.0];

/// Energies of the candidates, as multiples of the heat that remains at the end of a run.
const ENERGIES: [f64; 2] = [0.5, 2.0];

/// Warm-up as a cause; see the module documentation.
pub struct WarmUp;

/// Returns the median length of the tracks, s, and their mean dissipation, W; `None` if one is not
/// positive.
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

/// Returns a candidate with this energy, J, and this cooling time, s.
fn candidate(context: &FitContext, energy_j: f64, cooling_s: f64) -> Candidate {
    let legal = |id: Id, value: f64| value.clamp(id.info().lower, id.info().upper);
    let energy = legal(Id::WarmUpEnergy, energy_j);
    let cooling = legal(Id::WarmUpCooling, cooling_s);
    let settings = vec![(Id::WarmUpEnergy, energy), (Id::WarmUpCooling, cooling)];
    let by = Exact { kind: TermKind::WarmUp, settings, derivative: Some(Id::WarmUpFall) };
    let columns = [context.log.velocity_name()];
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
        "friction falls as the joint is heated by friction"
    }

    fn meaning_of(&self, size: f64) -> &'static str {
        if size < 0.0 {
            "friction rises as the joint is heated by friction"
        } else {
            self.meaning()
        }
    }

    fn effect(&self) -> &'static str {
        "levels fall with the heat of friction work, which decays with time."
    }

    fn remedy(&self) -> Remedy {
        Remedy::Term(TermKind::WarmUp)
    }

    fn acts_on(&self) -> &'static [Id] {
        LEVELS
    }

    fn candidates(&self, context: &FitContext) -> Vec<Candidate> {
        // If every run starts at the same time, the heat at its start is unknown. A measured temperature is more reliable.
        if !context.log.has_campaign_clock() || context.log.varies("temperature_c") {
            return Vec::new();
        }
        let Some((length_s, power)) = typical(&context.log.train_tracks) else { return Vec::new() };
        let within_runs = COOLING.into_iter().flat_map(|cooling| {
            // Heat that remains at the end of a run of constant power.
            let held = power * length_s * cooling * (1.0 - (-1.0 / cooling).exp());
            ENERGIES.map(|share| (share * held, cooling * length_s))
        });
        within_runs.map(|(energy, cooling)| candidate(context, energy, cooling)).collect()
    }

    fn in_words(&self, size: &crate::Size, extended: &Extended) -> String {
        format!(
            "{}: by a share of {}, most of it within {} J, which decays with a time constant of {} s",
            self.meaning_of(size.value),
            size.in_words(),
            significant(extended.value(Id::WarmUpEnergy), 2),
            significant(extended.value(Id::WarmUpCooling), 2)
        )
    }

    fn evidence(&self, _: &[String], _: &Extended) -> Option<Evidence> {
        Plane::new(
            "Over the campaign",
            PlaneAxis::CampaignTime,
            ResidualView::Along,
            "Residual along the motion. The friction of a joint that warms up falls during work and recovers after a pause.",
        )
        .spaced(Spacing::Even)
        .into()
    }

    fn next_experiment(&self, _: &[String]) -> Option<String> {
        Some(
            "Repeat one run cold, directly after a long fast run, and after a pause of several minutes: the effect of heat is \
             reversible, that of run-in is not. If the joint has a temperature sensor, log it."
                .into(),
        )
    }
}
