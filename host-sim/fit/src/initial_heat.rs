//! Heat of a joint at the start of a track.
//!
//! A driver starts cold when it is switched on. In a log, earlier runs and the stretches before a gap have left heat in the
//! joint, part of which has been lost since. The dissipated energy is taken from the log (measured torque times
//! velocity, spread evenly over the stretch), so that tracks stay independent of each other:
//!
//! ```text
//! h = sum_j E_j / E0  exp(-since_j / T)  (1 - exp(-D_j / T)) T / D_j
//! ```
//!
//! `since` is the time from the end of a stretch, `D` its duration. Runs influence each other only if the log's clock
//! continues from one run to the next.

use super::track::{EarlierStretch, Track};
use compensator_core::{ParameterId as Id, Parameters, Real, TermKind};
use std::sync::Arc;

/// Time span and energy of a track, on the campaign's clock.
struct Stretch {
    begin_s: f64,
    end_s: f64,
    energy_j: f64,
}

fn stretch(track: &Track) -> Stretch {
    let begin_s = track.samples.first().map_or(0.0, |sample| sample.campaign_time_h * 3600.0);
    let end_s = track.samples.last().map_or(begin_s, |sample| sample.campaign_time_h * 3600.0);
    let rows = track.samples.iter().zip(&track.torque).enumerate();
    let energy_j: f64 = rows
        .map(|(row, (sample, torque))| {
            torque * sample.velocity_rad_s * track.period_s * track.period_ratio_of(row)
        })
        .sum();
    Stretch { begin_s, end_s, energy_j: energy_j.max(0.0) }
}

/// Records in every track the stretches before it. `tracks` must be all tracks of a log.
pub fn record_earlier_stretches<'a>(tracks: impl Iterator<Item = &'a mut Track>) {
    let mut tracks: Vec<&mut Track> = tracks.collect();
    let stretches: Vec<Stretch> = tracks.iter().map(|track| stretch(track)).collect();
    for (track, stretch) in tracks.iter_mut().zip(&stretches) {
        let before = stretches.iter().filter(|other| other.end_s <= stretch.begin_s);
        // Runs that all begin at 0, or overlap, have no common clock. Then some run lies neither before nor after
        // this one.
        let apart =
            |other: &Stretch| other.end_s <= stretch.begin_s || other.begin_s >= stretch.end_s;
        let common = stretches.iter().filter(|other| !apart(other)).count() == 1;
        let earlier = before.filter(|_| common).map(|other| EarlierStretch {
            energy_j: other.energy_j,
            length_s: other.end_s - other.begin_s,
            since_s: stretch.begin_s - other.end_s,
        });
        track.earlier_stretches = Arc::from_iter(earlier);
    }
}

/// Returns the heat at the start of a track, as a multiple of the term's energy; 0 for a model without warm-up.
pub fn initial_heat<T: Real<Setting = T>>(parameters: &Parameters<T>, track: &Track) -> T {
    let mut heat = T::zero();
    if !parameters.terms.contains(&TermKind::WarmUp) {
        return heat;
    }
    let (energy, cooling) = (parameters.get(Id::WarmUpEnergy), parameters.get(Id::WarmUpCooling));
    let one = T::one();
    for EarlierStretch { energy_j, length_s, since_s } in track.earlier_stretches.iter() {
        let since = (-(T::from_f64(*since_s) / cooling)).exp();
        let mut left = one;
        if *length_s > 0.0 {
            let lengths = T::from_f64(*length_s) / cooling;
            left = (one - (-lengths).exp()) / lengths;
        }
        heat = heat + T::from_f64(*energy_j) / energy * since * left;
    }
    heat
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::{LawKind, Sample};

    fn track(begin_s: f64) -> Track {
        let at = |row: usize| Sample {
            velocity_rad_s: 2.0,
            campaign_time_h: (begin_s + row as f64 * 0.01) / 3600.0,
            ..Sample::default()
        };
        Track::even((0..1001).map(at).collect(), vec![1.5; 1001], 0.01)
    }

    #[test]
    fn initial_heat_after_earlier_track_decays_with_time() {
        let mut tracks = [track(0.0), track(40.0)];
        record_earlier_stretches(tracks.iter_mut());
        assert!(tracks[0].earlier_stretches.is_empty());
        assert!((tracks[1].earlier_stretches[0].since_s - 30.0).abs() < 1e-6);
        let mut parameters = Parameters::<f64>::new(LawKind::Lugre)
            .with(Id::WarmUpEnergy, 30.0)
            .with(Id::WarmUpCooling, 60.0);
        assert_eq!(initial_heat(&parameters, &tracks[1]), 0.0);
        assert!(parameters.add_term(TermKind::WarmUp));
        // By hand, in steps of a millisecond: 3 W for 10 s, then 30 s of rest.
        let mut by_hand = 0.0;
        for step in 0..40_000 {
            let power = if step < 10_000 { 3.0 } else { 0.0 };
            by_hand += 1e-3 * (power / 30.0 - by_hand / 60.0);
        }
        let found = initial_heat(&parameters, &tracks[1]);
        assert!((found / by_hand - 1.0).abs() < 3e-3, "{found} {by_hand}");
    }

    #[test]
    fn record_earlier_stretches_without_common_clock_records_none() {
        let mut tracks = [track(0.0), track(0.0), track(0.0)];
        record_earlier_stretches(tracks.iter_mut());
        assert!(tracks.iter().all(|track| track.earlier_stretches.is_empty()));
    }
}
