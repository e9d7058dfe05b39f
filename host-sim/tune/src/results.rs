//! The files of a session.

use crate::driver_file;
use crate::learn::Learnt;
use crate::recording::{Recording, Row};
use crate::session::Session;
use friction_results::diagnosis::DiagnosedLog;
use friction_results::tune::TuneRun;
use friction_results::{Files, ResultError, pretty};
use joint_log::JointKind;

/// Returns the files of a session: `tune.html`, `tune.json`, `runs.parquet`, `diagnosis.json`, the set as the joint was in
/// `before.toml` and as it is now in `params.toml`. A set that was not proven is in no file.
///
/// # Errors
/// One line, if a file cannot be written in its format.
pub fn files(session: &Session) -> Result<Files, ResultError> {
    let emit = |set| driver_file::emit(set, JointKind::Revolute);
    let mut texts = vec![("before.toml", emit(&session.before.set))];
    let saved = session.tried.as_ref().filter(|_| session.is_saved());
    texts.push(("params.toml", emit(saved.unwrap_or(&session.before.set))));
    let mut page = None;
    if let Some(learnt) = &session.learnt {
        let Learnt { found, stochastic, input } = learnt;
        let diagnosed = DiagnosedLog { found, stochastic, input };
        texts.push(("diagnosis.json", pretty(&diagnosed.document()?)?));
        page = Some(diagnosed.page());
    }
    session.report.files(&runs(session), page, texts)
}

/// Returns the recorded rows of a session.
pub fn runs(session: &Session) -> Vec<TuneRun> {
    let nm_per_a = f64::from(session.before.set.friction.compensator.torque_constant_nm_per_a);
    let recordings = session.recordings.iter().enumerate();
    recordings.map(|(at, (recording, _))| run(at + 1, recording, nm_per_a)).collect()
}

fn run(number: usize, recording: &Recording, nm_per_a: f64) -> TuneRun {
    let column = |name: &str, value: &dyn Fn(&Row) -> f64| {
        (name.to_owned(), recording.rows.iter().map(value).collect())
    };
    TuneRun {
        name: format!("{number} {}", recording.name),
        columns: vec![
            column("time_s", &|row| row.time_s),
            column("velocity_rad_s", &|row| row.velocity_rad_s),
            column("torque_nm", &|row| row.torque_nm),
            column("position_rad", &|row| row.position_rad),
            column("radial_force_n", &|row| row.radial_force_n),
            column("pressure_diff_pa", &|row| row.pressure_diff_pa),
            column("temperature_c", &|row| row.temperature_c),
            column("demand_rad", &Row::demand_rad),
            column("current_a", &|row| row.torque_nm / nm_per_a),
        ],
    }
}
