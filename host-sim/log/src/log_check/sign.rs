//! A torque or velocity with inverted sign.
//!
//! In the contract, a positive torque drives positive velocity, so a joint with friction consumes power: the mean of
//! torque times velocity is positive. Inertia and gravity return what they take. If the joint delivers power on average,
//! one of the two columns has the wrong sign.
//!
//! A load may drive the joint too: a joint that only lowers it gives out most of the power. A load pushes the same way whichever
//! way the joint moves, and friction does not. So the torque is turned only if the log moves both ways and the torque is lower
//! forwards than backwards; else the sign is only reported.

use super::finding::{LogFinding, LogFindingKind};
use super::typed;
use crate::Dataset;
use compensator_core::quantity::Quantity;

/// Mean power relative to its mean magnitude, below which the sign is doubtful. Friction alone gives +0.9 and more; a
/// gear that a load drives backwards gives about 0.
const MAX_POWER_RATIO: f64 = -0.25;

/// The same, below which the torque is turned.
const TURNED_POWER_RATIO: f64 = -0.5;

/// Least share of the path in the rarer direction of a log that moves both ways.
const MIN_BACK_SHARE: f64 = 0.1;

/// Finds a torque that drives the motion, and turns its sign if `correct` is true.
pub fn sign(mut data: Dataset, correct: bool) -> (Dataset, Vec<LogFinding>) {
    let (mut power, mut size) = (0.0, 0.0);
    for run in &data.runs {
        for (torque, velocity) in run.torque.iter().zip(&run.velocity) {
            power += torque * velocity;
            size += (torque * velocity).abs();
        }
    }
    if size <= 0.0 || power / size >= MAX_POWER_RATIO {
        return (data, Vec::new());
    }
    let pairs = data.runs.iter().flat_map(|run| run.torque.iter().zip(&run.velocity));
    let is_friction = drives_both_ways(pairs.map(|(torque, velocity)| (*torque, *velocity)));
    // A magnitude, or a register with a sign bit, is no friction of the other sign.
    let torques = || data.runs.iter().flat_map(|run| &run.torque);
    let has_both_signs =
        torques().any(|torque| *torque > 0.0) && torques().any(|torque| *torque < 0.0);
    let corrected = correct && power / size < TURNED_POWER_RATIO && is_friction && has_both_signs;
    let (torque, velocity) =
        (Quantity::Torque.name(data.joint), Quantity::Velocity.name(data.joint));
    // The unit that was given stays: a current is no torque.
    let unit = data.given_unit(torque).unwrap_or(data.joint.torque_unit());
    let pair = match unit.strip_prefix('-') {
        Some(turned_back) => typed(&data, torque, turned_back),
        None => typed(&data, torque, &format!("-{unit}")),
    };
    let percent = format!("{:.0}", -100.0 * power / size);
    let in_words = if corrected {
        format!(
            "The sign of {torque} is reversed: it drives the motion ({percent} % of the power comes out of the joint), but \
             friction opposes it. The diagnosis uses the torque with the other sign; --columns {pair} reads it so."
        )
    } else {
        format!(
            "The sign of {torque} may be reversed: it drives the motion ({percent} % of the power comes out of the joint), \
             but friction opposes it. Nothing is changed; --columns {pair} turns it."
        )
    };
    let finding = LogFindingKind::SignSuspect
        .finding(&[torque, velocity], power / size, "of the power", in_words)
        .corrected(corrected);
    if corrected {
        data.runs.iter_mut().flat_map(|run| &mut run.torque).for_each(|torque| *torque = -*torque);
    }
    (data, vec![finding])
}

/// Returns true if pairs of torque and velocity move both ways, and the mean torque over the path is lower forwards than
/// backwards: friction of the wrong sign, and no load.
pub fn drives_both_ways(pairs: impl Iterator<Item = (f64, f64)>) -> bool {
    // Path and torque over it, forwards and backwards.
    let mut ways = [(0.0, 0.0); 2];
    for (torque, velocity) in pairs {
        let (path, over) = &mut ways[usize::from(velocity < 0.0)];
        *path += velocity.abs();
        *over += velocity.abs() * torque;
    }
    let [(ahead, over_ahead), (back, over_back)] = ways;
    ahead.min(back) > MIN_BACK_SHARE * (ahead + back) && over_ahead / ahead < over_back / back
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SourceColumn;

    /// A log of torque over velocity at one step.
    fn log(of: impl Fn(usize) -> (f64, f64)) -> Dataset {
        let names = ["time_s", "velocity_rad_s", "torque_nm"].map(String::from);
        let column = |at: usize| {
            (0..2000).map(|row| [0.01 * row as f64, of(row).0, of(row).1][at]).collect()
        };
        Dataset::from_columns(&names, [("a".to_owned(), (0..3).map(column).collect())]).unwrap()
    }

    #[test]
    fn sign_of_friction_that_drives_both_ways_is_turned() {
        let reversed = || {
            log(|row| {
                let velocity = (0.02 * row as f64).sin();
                (velocity, -1.5 * velocity.signum() - 0.2 * velocity)
            })
        };
        let (data, findings) = sign(reversed(), true);
        assert!(findings[0].corrected);
        assert_eq!(data.runs[0].torque[10], -reversed().runs[0].torque[10]);
        assert!(!sign(reversed(), false).1[0].corrected);
    }

    #[test]
    fn sign_keeps_the_unit_that_was_given() {
        for (given, typed) in [(Some("A"), ":-A"), (Some("-mNm"), ":mNm"), (None, ":-Nm")] {
            let mut reversed = log(|row| {
                let velocity = (0.02 * row as f64).sin();
                (velocity, -1.5 * velocity.signum())
            });
            let unit = given.map(str::to_owned);
            reversed.sources = vec![SourceColumn {
                name: "torque_nm".into(),
                header: "i".into(),
                unit,
                ..SourceColumn::default()
            }];
            let said = &sign(reversed, true).1[0].in_words;
            assert!(said.contains(&format!("torque_nm=i{typed} ")), "{said}");
        }
    }

    #[test]
    fn sign_of_a_load_that_is_lowered_is_reported_only() {
        // 4 Nm of friction are overcome by 10 Nm of load, one way.
        let lowered = || log(|row| (0.5 + 0.3 * (0.02 * row as f64).sin(), 4.0 - 10.0));
        let (data, findings) = sign(lowered(), true);
        assert!(findings.len() == 1 && !findings[0].corrected, "{findings:?}");
        assert_eq!(data.runs, lowered().runs);
        // Lowered for most of the path, with short lifts between: the load still pushes one way.
        let mostly = || {
            log(|row| {
                let velocity: f64 = if row % 100 < 85 { 0.6 } else { -0.6 };
                (velocity, 1.0 * velocity.signum() - 10.0)
            })
        };
        let (data, findings) = sign(mostly(), true);
        assert!(findings.iter().all(|finding| !finding.corrected), "{findings:?}");
        assert_eq!(data.runs, mostly().runs);
    }
}
