//! Causes that change what the bristles do: simulated with the driver's own terms.
//!
//! Backlash, a changing side load, the time at rest and the exponent of the Stribeck curve act inside the law, so that their
//! columns are simulated: the derivative of the torque by the term's parameter, or the whole difference that the term makes at
//! one setting of a grid. A column of the second kind has a positive size in a model, near one where the setting is right.

use super::{ColumnSource, Variant, form, is_usable};
use crate::contest::cause_key::CauseKey;
use crate::contest::detail::{Detail, SimulatedGap};
use crate::contest::rows::Rows;
use crate::sensitivities::{Exact, Sensitivities, exact};
use compensator_core::{ParameterId as Id, TermKind};
use friction_fit::Track;
use joint_log::Quantity;
use rayon::prelude::*;

/// Gaps, in presliding travels.
const GAPS: [f64; 6] = [0.5, 1.0, 2.0, 5.0, 12.0, 30.0];

/// Largest gap as a share of the swing of a run.
const LARGEST_GAP: f64 = 0.25;

/// Stiffness of further gaps, as a multiple of the law's: a law without a gap describes it by bristles that are too soft.
const STIFFER: f64 = 3.0;

/// Times at rest at which the static level has grown, s.
const DWELL_TIMES_S: [f64; 3] = [0.03, 0.3, 3.0];

/// A cause that is simulated, with one setting.
struct Simulated {
    cause: &'static str,
    follows: Vec<String>,
    detail: Detail,
    sign: f64,
    effect: Exact,
}

/// Returns the variants of simulated causes beside a law at a point of its parameters.
pub(crate) fn variants(
    rows: &Rows,
    tracks: &[Track],
    at: &Sensitivities,
    travel: f64,
) -> Vec<Variant> {
    let mut wanted = backlash(rows, at, travel);
    wanted.extend(dwell());
    wanted.extend(stribeck_shape());
    wanted.extend(radial_force_rate(rows));
    let made = wanted.into_par_iter().filter_map(|wanted| {
        let columns: Vec<Vec<f64>> = tracks
            .iter()
            .zip(&at.tracks)
            .map(|(track, along)| exact(at, track, along, &wanted.effect))
            .collect();
        let column = rows.along_tracks(tracks.iter().zip(columns.iter().map(Vec::as_slice)));
        is_usable(&column).then(|| Variant {
            key: CauseKey { cause: wanted.cause, columns: wanted.follows },
            detail: wanted.detail,
            source: ColumnSource::Simulated(column.into()),
            price: super::MIMIC,
            sign: wanted.sign,
        })
    });
    made.collect()
}

fn backlash(rows: &Rows, at: &Sensitivities, travel: f64) -> Vec<Simulated> {
    if !rows.has_position {
        return Vec::new();
    }
    let stiffness = at.parameters.get(Id::BristleStiffness);
    let gaps = GAPS.map(|gap| gap * travel);
    let gaps =
        gaps.into_iter().filter(|gap| *gap < LARGEST_GAP * rows.swing && *gap > rows.least_step);
    let mut wanted = Vec::new();
    for gap in gaps {
        for is_unloaded in [false, true] {
            for stiffness_ratio in [1.0, STIFFER] {
                let settings = vec![
                    (Id::BacklashTravel, gap),
                    (Id::BacklashUnloaded, f64::from(u8::from(is_unloaded))),
                    (Id::BristleStiffness, stiffness_ratio * stiffness),
                ];
                let found = SimulatedGap { gap, is_unloaded, stiffness_ratio };
                wanted.push(Simulated {
                    cause: "backlash",
                    follows: Vec::new(),
                    detail: Detail::SimulatedGap(found),
                    sign: 1.0,
                    effect: Exact { kind: TermKind::Backlash, settings, derivative: None },
                });
            }
        }
    }
    wanted
}

fn dwell() -> Vec<Simulated> {
    let wanted = |time_s: f64| Simulated {
        cause: "dwell-time-static",
        follows: Vec::new(),
        detail: form(format!("dwell time {time_s} s")),
        sign: 1.0,
        effect: Exact {
            kind: TermKind::DwellTimeStatic,
            settings: vec![(Id::DwellTime, time_s)],
            derivative: Some(Id::DwellGain),
        },
    };
    DWELL_TIMES_S.map(wanted).into()
}

/// An exponent of 2 is the law's own curve without a derivative, so the derivative is taken beside it.
fn stribeck_shape() -> Vec<Simulated> {
    let wanted = |(setting, derivative): (f64, Option<Id>)| Simulated {
        cause: "stribeck-shape",
        follows: Vec::new(),
        detail: form(format!("exponent from {setting}")),
        sign: 0.0,
        effect: Exact {
            kind: TermKind::StribeckShape,
            settings: vec![(Id::StribeckExponent, setting)],
            derivative,
        },
    };
    [(1.0, None), (2.001, Some(Id::StribeckExponent))].map(wanted).into()
}

fn radial_force_rate(rows: &Rows) -> Option<Simulated> {
    rows.quantity(Quantity::RadialForce)?;
    Some(Simulated {
        cause: "radial-force-rate",
        follows: vec!["radial_force_n".into()],
        detail: Detail::Only,
        sign: 0.0,
        effect: Exact {
            kind: TermKind::RadialForceRate,
            settings: Vec::new(),
            derivative: Some(Id::RadialForceRate),
        },
    })
}
