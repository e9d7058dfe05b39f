//! Regressors of hysteresis that a base law may lack: Maxwell-slip elements.
//!
//! A LuGre law has one stiffness in presliding. The contact of a real seal yields in several steps
//! and remembers its reversals (generalised Maxwell slip). A fit without this memory leaves an error
//! after each reversal, and a delay or a low-pass of a channel describes part of it. The two differ:
//! a delay shifts the whole loop in time at all speeds, and hysteresis is a function of the travel.
//!
//! An element sticks over the travel `d` and then slips. Its state is `s' = v / d`, limited to the
//! range from -1 to 1, so it depends on the travel alone. The elements of a log have travels from the
//! resolution of its rows to half of its longest stroke, in equal ratios.

use super::candidate::{FitContext, Regressor, TrackRegressor};
use super::train_test::TrainTest;
use friction_fit::Track;

/// Number of elements.
const ELEMENTS: i32 = 7;

/// Shortest travel of an element, in travels of a row at the median speed. A shorter element slips
/// within a row, as the Coulomb level does.
const SHORTEST_ROWS: f64 = 1.0;

/// Longest travel of an element, as a share of the longest stroke. A longer element never slips in
/// both directions and acts as a spring.
const LONGEST_STROKE_SHARE: f64 = 0.25;

/// Returns the regressors of Maxwell-slip elements on this log; none for a log without motion.
pub fn columns(context: &FitContext) -> Vec<Regressor> {
    travels_rad(context.log).into_iter().map(|travel| Regressor::Track(element(travel))).collect()
}

/// Returns the column of an element that slips after this travel, rad; 1 if it slips forward.
fn element(travel_rad: f64) -> TrackRegressor {
    Box::new(move |track, _| states(track, travel_rad))
}

/// Returns the states of an element along a track.
fn states(track: &Track, travel_rad: f64) -> Vec<f64> {
    let mut state = 0.0f64;
    let steps = row_travels(track);
    steps
        .map(|step| {
            state = (state + step / travel_rad).clamp(-1.0, 1.0);
            state
        })
        .collect()
}

/// Returns the travel of each row since the row before, rad.
fn row_travels(track: &Track) -> impl Iterator<Item = f64> {
    track.samples.iter().enumerate().map(|(row, sample)| {
        let ratio = track.period_ratio.as_ref().map_or(1.0, |ratios| ratios[row]);
        sample.velocity_rad_s * track.period_s * ratio
    })
}

/// Returns the travels of the elements of a log, rad, in increasing order.
fn travels_rad(log: &TrainTest) -> Vec<f64> {
    let mut steps: Vec<f64> =
        log.train_tracks.iter().flat_map(row_travels).map(f64::abs).filter(|s| *s > 0.0).collect();
    if steps.is_empty() {
        return Vec::new();
    }
    let middle = steps.len() / 2;
    let shortest = SHORTEST_ROWS * *steps.select_nth_unstable_by(middle, f64::total_cmp).1;
    let stroke = log.train_tracks.iter().map(longest_stroke_rad).fold(0.0, f64::max);
    let longest = LONGEST_STROKE_SHARE * stroke;
    if shortest >= longest {
        return Vec::new();
    }
    let ratio = (longest / shortest).powf(1.0 / f64::from(ELEMENTS - 1));
    (0..ELEMENTS).map(|element| shortest * ratio.powi(element)).collect()
}

/// Returns the difference between the highest and the lowest angle of a track, rad.
fn longest_stroke_rad(track: &Track) -> f64 {
    let (mut at, mut low, mut high) = (0.0f64, 0.0f64, 0.0f64);
    for step in row_travels(track) {
        at += step;
        (low, high) = (low.min(at), high.max(at));
    }
    high - low
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::Sample;

    /// Returns a track of constant speed that reverses once.
    fn reversal() -> Track {
        let velocity = |row: usize| if row < 50 { 1.0 } else { -1.0 };
        let sample = |row| Sample { velocity_rad_s: velocity(row), ..Sample::default() };
        Track::even((0..100).map(sample).collect(), vec![0.0; 100], 0.01)
    }

    #[test]
    fn states_with_reversal_slip_after_twice_the_travel() {
        let states = states(&reversal(), 0.1);
        assert!((states[4] - 0.5).abs() < 1e-12);
        assert!((states[49] - 1.0).abs() < 1e-12);
        // From +1 to -1 after twice the travel: 20 rows of 0.01 rad.
        assert!(states[59].abs() < 1e-9 && (states[69] + 1.0).abs() < 1e-9);
    }

    #[test]
    fn longest_stroke_of_reversal_is_travel_in_one_direction() {
        assert!((longest_stroke_rad(&reversal()) - 0.5).abs() < 1e-9);
    }
}
