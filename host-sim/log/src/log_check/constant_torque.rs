//! Torques that hold no information: one value throughout, or one in each run while the motion of the run changes.

use super::header;
use crate::number::figure;
use crate::setting::Setting;
use crate::statistics::extent as range;
use crate::{DataError, Dataset, Run};
use compensator_core::quantity::Quantity;

/// Maximum range of a constant torque, as a share of its largest magnitude. A file rounds to more than six digits.
const MAX_RANGE_SHARE: f64 = 1e-6;

/// Minimum change of the velocity in a run, as a share of the largest speed of the log, that a torque must follow.
const MIN_VELOCITY_CHANGE: f64 = 0.1;

fn is_constant([least, most]: [f64; 2]) -> bool {
    most - least <= MAX_RANGE_SHARE * least.abs().max(most.abs())
}

/// Refuses a log whose torque holds no information.
pub fn constant_torque(data: &Dataset) -> Option<DataError> {
    let torques = |run: &Run| range(run.torque.iter().copied());
    let all = range(data.runs.iter().flat_map(|run| run.torque.iter().copied()));
    let (name, column) =
        (Quantity::Torque.name(data.joint), header(data, Quantity::Torque.name(data.joint)));
    let found = if is_constant(all) {
        let value = figure(all[0]);
        format!("{value} {} in all {} rows of {column}", data.joint.torque_unit(), data.rows)
    } else if data.runs.iter().all(|run| is_constant(torques(run))) && changes_in_runs(data) {
        format!("one value in each run of {column}, while the velocity of the runs changes")
    } else {
        return None;
    };
    let other = torque_column(data).unwrap_or_else(|| "NAME".into());
    let pair = Setting::Columns.suggested(format!("{name}={other}"));
    Some(DataError::file(
        data.first_file(),
        found,
        format!(
            "a torque that changes with the motion: check that its channel was logged, or {pair} if another \
             column holds it"
        ),
    ))
}

/// Returns true if the velocity changes in most runs, so that their rows are not the means of steady motions.
fn changes_in_runs(data: &Dataset) -> bool {
    let [least, most] = range(data.runs.iter().flat_map(|run| run.velocity.iter().copied()));
    let change = MIN_VELOCITY_CHANGE * least.abs().max(most.abs());
    let changes = |run: &&Run| {
        let [least, most] = range(run.velocity.iter().copied());
        most - least > change
    };
    2 * data.runs.iter().filter(changes).count() > data.runs.len()
}

/// Returns the only other column that is a torque by its name and varies.
fn torque_column(data: &Dataset) -> Option<String> {
    let words = ["torque", "tau", "effort", "moment", "force", "current"];
    let is_torque = |name: &str| {
        let name = name.to_lowercase();
        name.split(|c: char| !c.is_alphabetic()).any(|word| words.contains(&word))
    };
    let varies = |at: usize| {
        !is_constant(range(data.runs.iter().flat_map(|run| run.extra[at].iter().copied())))
    };
    let mut likely =
        data.covariates.iter().enumerate().filter(|(at, name)| is_torque(name) && varies(*at));
    let (_, name) = likely.next()?;
    likely.next().is_none().then(|| name.clone())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn log(
        torque: impl Fn(usize, usize) -> f64,
        velocity: impl Fn(usize, usize) -> f64,
    ) -> Dataset {
        let names = ["time_s", "velocity_rad_s", "torque_nm", "tau_2"].map(str::to_owned);
        let runs = (0..3).map(|run| {
            let of = |f: &dyn Fn(usize) -> f64| (0..50).map(f).collect::<Vec<f64>>();
            let columns = vec![
                of(&|row| row as f64),
                of(&|row| velocity(run, row)),
                of(&|row| torque(run, row)),
                of(&|row| row as f64),
            ];
            (run.to_string(), columns)
        });
        Dataset::from_columns(&names, runs).expect("columns")
    }

    fn sine(run: usize, row: usize) -> f64 {
        (1 + run) as f64 * (0.3 * row as f64).sin()
    }

    #[test]
    fn constant_torque_with_one_value_names_other_column() {
        let error = constant_torque(&log(|_, _| 1.253, sine)).expect("a refusal").to_string();
        let parts = ["1.253 Nm", "150 rows", "torque_nm", "columns torque_nm=tau_2 "];
        crate::message::check("checks", "constant torque", &error, &parts);
        let rounded = |_, row: usize| 1.253 + 1e-9 * row as f64;
        assert!(constant_torque(&log(rounded, sine)).is_some());
        assert!(constant_torque(&log(|_, _| 0.0, sine)).is_some());
    }

    #[test]
    fn constant_torque_with_one_value_in_each_run_depends_on_motion() {
        let by_run = |run: usize, _| run as f64;
        assert!(constant_torque(&log(by_run, sine)).is_some());
        // Means of steady motions.
        assert!(constant_torque(&log(by_run, |run, _| run as f64)).is_none());
    }

    #[test]
    fn constant_torque_with_any_change_returns_none() {
        assert!(constant_torque(&log(|_, row| f64::from(u8::from(row == 7)), sine)).is_none());
        assert!(constant_torque(&log(|run, row| sine(run, row).signum(), sine)).is_none());
    }
}
