//! Causes of the time: rest ages contacts, a campaign runs a joint in, and friction work heats it.

use super::{Cause, LEVELS, Remedy};
use crate::candidate::{Candidate, FitContext, InitialGuess, Regressor, row};
use crate::evidence::{Plane, PlaneAxis, ResidualView, Spacing};
use crate::extended::{Extended, Size};
use crate::sensitivities::Exact;
use compensator_core::{ParameterId as Id, TermKind};
use friction_fit::Track;
use joint_log::number::significant;
use joint_log::statistics::quantile_by_count;

/// Contact ageing: the breakaway torque grows with the time at rest.
pub(super) const DWELL_TIME_STATIC: Cause = Cause {
    meaning: "the breakaway torque grows with the time at rest",
    effect: "the static level grows with the time at rest.",
    acts_on: LEVELS,
    least_size: |_| Some(0.0),
    candidates: |context| {
        if !context.spec.law.has_bristles() {
            return Vec::new();
        }
        let (kind, columns) = (TermKind::DwellTimeStatic, [context.log.velocity_name()]);
        [0.03, 0.3, 3.0]
            .map(|dwell_time| {
                let settings = vec![(Id::DwellTime, dwell_time)];
                let by = Exact { kind, settings, derivative: Some(Id::DwellGain) };
                Candidate::single(kind, &columns, Regressor::Exact(by))
                    .starting_at(&[
                        (Id::DwellTime, InitialGuess::At(dwell_time)),
                        (Id::DwellGain, InitialGuess::first_times(1.0)),
                    ])
                    .keeping(&[Id::DwellTravel])
            })
            .into()
    },
    evidence: |_, extended| {
        let travel = extended.value(Id::DwellTravel);
        Plane::new(
            "Just after breaking away",
            PlaneAxis::RestBefore(travel),
            ResidualView::Along,
            format!(
                "Rows within {} {} after the joint has left rest. If contacts age, the resistance grows with the time at rest.",
                significant(travel, 2),
                extended.joint().position_unit()
            ),
        )
        .spaced(Spacing::Logarithmic)
        .into()
    },
    ..Cause::new("dwell-time-static", Remedy::Term(TermKind::DwellTimeStatic))
};

/// Friction changes over the campaign by run-in or wear.
pub(super) const TIME_DRIFT: Cause = Cause {
    meaning: "friction changes over the campaign (run-in or wear)",
    meaning_of: |size| {
        Some(match size < 0.0 {
            true => "friction falls over the campaign (run-in)",
            false => "friction rises over the campaign (wear)",
        })
    },
    effect: "levels change over the campaign: run-in and wear.",
    acts_on: LEVELS,
    candidates: drifts,
    size: Some(change_over_campaign),
    evidence: |_, _| {
        Plane::new(
            "Friction over the campaign",
            PlaneAxis::CampaignTime,
            ResidualView::Along,
            "One point for each run, or stretch of a single one. Where friction runs in or wears, they drift over the campaign.",
        )
        .spaced(Spacing::Runs)
        .into()
    },
    ..Cause::new("time-drift", Remedy::Term(TermKind::TimeDrift))
};

/// Returns a linear drift, and exponential ones over shares of the campaign.
fn drifts(context: &FitContext) -> Vec<Candidate> {
    if !context.log.has_campaign_clock() {
        return Vec::new();
    }
    let candidate = |by| Candidate::single(TermKind::TimeDrift, &["time_s"], by);
    let linear = candidate(row(|r| r.level * r.sample.campaign_time_h))
        .starting_at(&[
            (Id::DriftRate, InitialGuess::first_times(1.0 / 3600.0)),
            (Id::DriftAmplitude, InitialGuess::At(0.0)),
        ])
        .keeping(&[Id::DriftAmplitude, Id::DriftTime]);
    let campaign_h = context.log.campaign_s() / 3600.0;
    let exponential = |share: f64| {
        let time_h = share * campaign_h;
        candidate(row(move |r| r.level * (-r.sample.campaign_time_h / time_h).exp()))
            .starting_at(&[
                (Id::DriftTime, InitialGuess::At((time_h * 3600.0).max(1.0))),
                (Id::DriftAmplitude, InitialGuess::first_times(1.0)),
                (Id::DriftRate, InitialGuess::At(0.0)),
            ])
            .keeping(&[Id::DriftRate])
    };
    [linear].into_iter().chain([0.1, 0.3].map(exponential)).collect()
}

/// Returns the relative change of the level from the beginning of the campaign to its end.
fn change_over_campaign(extended: &Extended) -> Size {
    let amplitude = extended.value(Id::DriftAmplitude);
    let (time, rate) = (extended.value(Id::DriftTime), extended.value(Id::DriftRate));
    let end = extended.log.campaign_s();
    let at = |t: f64, a: f64, r: f64| 1.0 + a * (-t / time).exp() + r * t;
    let change = |a: f64, r: f64| at(end, a, r) / at(0.0, a, r) - 1.0;
    let value = change(amplitude, rate);
    let by_amplitude = change(amplitude + extended.error(Id::DriftAmplitude), rate) - value;
    let by_rate = change(amplitude, rate + extended.error(Id::DriftRate)) - value;
    Size::new(value, by_amplitude.hypot(by_rate), "1")
}

/// Friction falls as friction work heats the joint, and no temperature is logged.
///
/// The heat is a state of the joint that no column shows. The model computes its source, the work of friction. Two parameters enter
/// nonlinearly: the energy `E0` that reduces friction, J, and the time constant `T` of cooling, s. The candidates form a coarse grid
/// of both, scaled with the dissipation and the length of this log's runs. Each candidate is simulated separately.
pub(super) const WARM_UP: Cause = Cause {
    meaning: "friction falls as the joint is heated by friction",
    meaning_of: |size| (size < 0.0).then_some("friction rises as the joint is heated by friction"),
    effect: "levels fall with the heat of friction work, which decays with time.",
    acts_on: LEVELS,
    candidates: heats,
    words: |meaning, size, extended| {
        format!(
            "{meaning}: by a share of {}, most of it within {} J, which decays with a time constant of {} s",
            size.in_words(),
            significant(extended.value(Id::WarmUpEnergy), 2),
            significant(extended.value(Id::WarmUpCooling), 2)
        )
    },
    evidence: |_, _| {
        Plane::new(
            "Over the campaign",
            PlaneAxis::CampaignTime,
            ResidualView::Along,
            "Residual along the motion. The friction of a joint that warms up falls during work and recovers after a pause.",
        )
        .into()
    },
    next_experiment: |_| {
        Some(
            "Repeat one run cold, directly after a long fast run, and after a pause of several minutes: the effect of heat is \
             reversible, that of run-in is not. If the joint has a temperature sensor, log it."
                .into(),
        )
    },
    ..Cause::new("warm-up", Remedy::Term(TermKind::WarmUp))
};

/// Cooling times of the candidates, as multiples of the length of a run.
const COOLING: [f64; 3] = [0.5, 5.0, 100.0];

/// Energies of the candidates, as multiples of the heat that remains at the end of a run.
const ENERGIES: [f64; 2] = [0.5, 2.0];

/// Returns the candidates of heat within runs.
fn heats(context: &FitContext) -> Vec<Candidate> {
    // If every run starts at the same time, the heat at its start is unknown. A measured temperature is more reliable.
    if !context.log.has_campaign_clock() || context.log.varies("temperature_c") {
        return Vec::new();
    }
    let Some(run) = TypicalRun::of(&context.log.train_tracks) else { return Vec::new() };
    let of_cooling = |cooling: f64| {
        // Heat that remains at the end of a run of constant power.
        let held_j = run.power_w * run.length_s * cooling * (1.0 - (-1.0 / cooling).exp());
        ENERGIES.map(|share| heat(context, share * held_j, cooling * run.length_s))
    };
    COOLING.into_iter().flat_map(of_cooling).collect()
}

/// What the runs of a log have in common.
struct TypicalRun {
    /// Median length of the tracks.
    length_s: f64,
    /// Mean dissipation.
    power_w: f64,
}

impl TypicalRun {
    /// Returns what tracks have in common; `None` if a figure is not positive.
    fn of(tracks: &[Track]) -> Option<Self> {
        let length = |track: &Track| {
            let ratios = track.period_ratio.as_ref();
            let rows = ratios.map_or(track.len() as f64, |ratios| ratios.iter().sum());
            rows * track.period_s
        };
        let length_s = quantile_by_count(tracks.iter().map(length).collect(), 0.5)?;
        let rows: usize = tracks.iter().map(Track::len).sum();
        let power = |track: &Track| -> f64 {
            let both = track.samples.iter().zip(&track.torque);
            both.map(|(sample, torque)| sample.velocity_rad_s * torque).sum()
        };
        let power_w = tracks.iter().map(power).sum::<f64>() / rows.max(1) as f64;
        (power_w > 0.0 && length_s > 0.0).then_some(Self { length_s, power_w })
    }
}

/// Returns a candidate with this energy, J, and this cooling time, s.
fn heat(context: &FitContext, energy_j: f64, cooling_s: f64) -> Candidate {
    let legal = |id: Id, value: f64| value.clamp(id.info().lower, id.info().upper);
    let energy = legal(Id::WarmUpEnergy, energy_j);
    let cooling = legal(Id::WarmUpCooling, cooling_s);
    let settings = vec![(Id::WarmUpEnergy, energy), (Id::WarmUpCooling, cooling)];
    let by = Exact { kind: TermKind::WarmUp, settings, derivative: Some(Id::WarmUpFall) };
    let columns = [context.log.velocity_name()];
    Candidate::single(TermKind::WarmUp, &columns, Regressor::Exact(by)).starting_at(&[
        (Id::WarmUpFall, InitialGuess::first_times(1.0)),
        (Id::WarmUpEnergy, InitialGuess::At(energy)),
        (Id::WarmUpCooling, InitialGuess::At(cooling)),
    ])
}
