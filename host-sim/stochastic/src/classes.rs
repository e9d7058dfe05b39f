//! Speed classes: runs of similar speed are certified together (Ding et al., Table II and III).
//!
//! The paper used 35, 70 and 100 rpm. A log does not contain set speeds. Its runs are therefore sorted by their typical
//! speed and divided at the largest gaps with a ratio of at least `MIN_CLASS_SPEED_RATIO`. A log that sweeps all speeds in
//! every run forms a single class.

use friction_fit::Track;
use joint_log::JointKind;
use joint_log::number::significant;
use joint_log::statistics::median;
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// Minimum ratio of neighbouring speeds in different classes. The ratio of the paper's 70 and 100 rpm is 1.43.
const MIN_CLASS_SPEED_RATIO: f64 = 1.2;

/// Maximum number of samples for estimating a run's speed.
const MAX_SPEED_SAMPLES: usize = 2000;

/// Speed below which a joint counts as at rest, as a share of its largest speed.
const MAX_REST_SPEED_RATIO: f64 = 0.05;

/// Runs of similar speed.
#[derive(Clone, Debug, PartialEq)]
pub struct SpeedClass {
    /// Name, such as `35 rpm` or `0.12 m/s`.
    pub name: String,
    /// Median of the runs' typical speeds, rad/s or m/s.
    pub speed: f64,
    /// Indices of the tracks.
    pub tracks: Vec<usize>,
}

/// Returns the median speed of a run in motion, rad/s, from its tracks.
fn typical_speed(tracks: &[Track], of_run: &[usize]) -> f64 {
    let run_tracks = || of_run.iter().filter_map(|index| tracks.get(*index));
    let stride = (run_tracks().map(Track::len).sum::<usize>() / MAX_SPEED_SAMPLES).max(1);
    let mut speeds: Vec<f64> = run_tracks()
        .flat_map(|track| track.samples.iter().step_by(stride))
        .map(|sample| sample.velocity_rad_s.abs())
        .collect();
    let fastest = speeds.iter().copied().fold(0.0, f64::max);
    speeds.retain(|speed| *speed > MAX_REST_SPEED_RATIO * fastest);
    median(&mut speeds).unwrap_or(0.0)
}

fn name(speed: f64, joint: JointKind) -> String {
    match joint {
        JointKind::Revolute => format!("{} rpm", significant(speed * 60.0 / TAU, 2)),
        JointKind::Prismatic => format!("{} m/s", significant(speed, 2)),
    }
}

/// Sorts runs into at most `most` classes, slowest first.
pub fn speed_classes(tracks: &[Track], joint: JointKind, most: usize) -> Vec<SpeedClass> {
    let mut runs: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (index, track) in tracks.iter().enumerate() {
        runs.entry(track.run).or_default().push(index);
    }
    let mut speeds: Vec<(f64, Vec<usize>)> =
        runs.into_values().map(|of_run| (typical_speed(tracks, &of_run), of_run)).collect();
    speeds.sort_by(|a, b| a.0.total_cmp(&b.0));
    let ratio = |at: usize| speeds[at].0 / speeds[at - 1].0.max(f64::MIN_POSITIVE);
    let mut gaps: Vec<usize> =
        (1..speeds.len()).filter(|at| ratio(*at) >= MIN_CLASS_SPEED_RATIO).collect();
    gaps.sort_by(|a, b| ratio(*b).total_cmp(&ratio(*a)));
    gaps.truncate(most.max(1) - 1);
    gaps.sort_unstable();
    let ends = gaps.iter().copied().chain([speeds.len()]);
    let begins = [0].into_iter().chain(gaps.iter().copied());
    begins
        .zip(ends)
        .filter(|(begin, end)| begin < end)
        .map(|(begin, end)| {
            let members = &speeds[begin..end];
            let speed = members[members.len() / 2].0;
            let mut indices: Vec<usize> =
                members.iter().flat_map(|(_, of_run)| of_run).copied().collect();
            indices.sort_unstable();
            SpeedClass { name: name(speed, joint), speed, tracks: indices }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use compensator_core::Sample;

    fn track(run: usize, speed: f64) -> Track {
        let sample = |row: usize| Sample {
            velocity_rad_s: if row < 20 { 0.0 } else { -speed },
            ..Sample::default()
        };
        let samples = (0..100).map(sample).collect();
        Track { run, ..Track::even(samples, vec![0.0; 100], 0.01) }
    }

    #[test]
    fn speed_classes_of_three_speeds_have_names() {
        let rpm = |rpm: f64| rpm * TAU / 60.0;
        let tracks: Vec<Track> = [100.0, 35.0, 70.0, 34.0, 71.0, 101.0, 35.0]
            .iter()
            .enumerate()
            .map(|(run, speed)| track(run, rpm(*speed)))
            .collect();
        let classes = speed_classes(&tracks, JointKind::Revolute, 3);
        let names: Vec<&str> = classes.iter().map(|class| class.name.as_str()).collect();
        assert_eq!(names, ["35 rpm", "71 rpm", "101 rpm"]);
        assert_eq!(classes[0].tracks, [1, 3, 6]);
    }

    #[test]
    fn speed_classes_are_limited_and_merge_equal_speeds() {
        let tracks: Vec<Track> = (0..8).map(|run| track(run, 2f64.powi(run as i32))).collect();
        assert_eq!(speed_classes(&tracks, JointKind::Revolute, 3).len(), 3);
        let tracks: Vec<Track> = (0..8).map(|run| track(run, 0.12)).collect();
        let classes = speed_classes(&tracks, JointKind::Prismatic, 3);
        assert_eq!(classes.len(), 1);
        assert_eq!(classes[0].name, "0.12 m/s");
        assert!(speed_classes(&[], JointKind::Revolute, 3).is_empty());
    }

    #[test]
    fn speed_classes_keep_segments_of_run_together() {
        let tracks = [track(0, 1.0), track(1, 5.0), track(0, 1.1)];
        let classes = speed_classes(&tracks, JointKind::Revolute, 3);
        assert_eq!(classes[0].tracks, [0, 2]);
    }
}
