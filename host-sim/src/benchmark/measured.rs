//! Both contestants on measured logs whose answer is known.
//!
//! The logs lie beside the project, not in it (`../shared/data`, or where `MEASURED_DATA` says). What is known of each, and
//! from whom, is in their README; here is what an answer is held against. A log can hold more than one effect: each of
//! them may be named first.

use super::ask;
use super::contest::{self, timed};
use super::regression::regression;
use friction_identification::data::{Dataset, ReadOptions, read};
use friction_identification::diagnose::Question;
use friction_identification::spec::parse_rigid_body;
use std::path::{Path, PathBuf};

/// A log, the options it wants, and what is known to be in it.
#[derive(Clone, Copy, Debug)]
pub struct MeasuredLog {
    /// Its file.
    pub file: &'static str,
    columns: &'static [(&'static str, &'static str)],
    rigid_body: &'static str,
    skip: usize,
    decimate: usize,
    /// Causes that may be named first; none where only `none` would be wrong.
    pub known: &'static [&'static str],
}

const LOG: MeasuredLog =
    MeasuredLog { file: "", columns: &[], rigid_body: "", skip: 0, decimate: 1, known: &[] };

const EMPS: MeasuredLog = MeasuredLog {
    columns: &[
        ("time_s", "t_s"),
        ("position_m", "q_m"),
        ("force_n", "motor_force_N"),
        ("velocity_m_s", "vel_m_per_s"),
        ("acceleration_m_s2", "acc_m_per_s2"),
    ],
    rigid_body: "inertia,offset",
    skip: 49,
    decimate: 10,
    known: &["direction-asymmetry"],
    ..LOG
};

const ROBOT: MeasuredLog = MeasuredLog { rigid_body: "inertia,load,offset", ..LOG };

/// A ripple, whether it scales the level or adds: which of the two is known of the cogging motor alone.
const RIPPLES: &[&str] = &["torque-ripple", "position-ripple"];

/// Every log, with what its README says is in it.
pub const LOGS: &[MeasuredLog] = &[
    MeasuredLog { file: "seal-oring.csv", known: &["pressure-coulomb"], ..LOG },
    MeasuredLog { file: "seal-kdn.csv", known: &["pressure-coulomb"], ..LOG },
    MeasuredLog { file: "emps-train.csv", ..EMPS },
    MeasuredLog { file: "emps-pulses.csv", ..EMPS },
    MeasuredLog { file: "worm-drive.csv", known: &["direction-asymmetry"], ..LOG },
    MeasuredLog {
        file: "servo-pendulum.csv",
        columns: &[("torque_nm", "drive_voltage_v")],
        rigid_body: "load,offset",
        known: &["load-torque-coulomb"],
        ..LOG
    },
    MeasuredLog {
        file: "bldc-cogging.csv",
        rigid_body: "inertia,offset",
        known: &["torque-ripple"],
        ..LOG
    },
    MeasuredLog { file: "screw-antibacklash.csv", rigid_body: "offset", known: RIPPLES, ..LOG },
    // The level over the preset tension, a column of no cause's own, is what `unknown` can say of it.
    MeasuredLog { file: "damper-1-actuators.csv", known: &["backlash", "unknown"], ..LOG },
    MeasuredLog { file: "damper-1.csv", known: &["backlash", "unknown"], ..LOG },
    MeasuredLog { file: "damper-2.csv", known: &["backlash", "direction-asymmetry"], ..LOG },
    MeasuredLog { file: "damper-quakes.csv", known: &["backlash", "direction-asymmetry"], ..LOG },
    MeasuredLog { file: "robot-axis1.csv", known: RIPPLES, ..ROBOT },
    MeasuredLog { file: "robot-axis2.csv", ..ROBOT },
    MeasuredLog {
        file: "robot-axis3.csv",
        known: &["direction-asymmetry", "torque-ripple", "position-ripple"],
        ..ROBOT
    },
];

/// What a contestant said of a measured log.
#[derive(Clone, Debug)]
pub struct MeasuredAnswer {
    /// The causes named, with the columns they follow where they follow some.
    pub named: Vec<String>,
    /// The first.
    pub first: &'static str,
    /// Share of the held-out error that is gone.
    pub gain: f64,
    /// Processor time, s.
    pub seconds: f64,
    /// What else was heard, a line.
    pub heard: String,
}

impl MeasuredLog {
    /// Whether a first name is one of those known to be there.
    pub fn is_right(&self, first: &str) -> bool {
        if self.known.is_empty() { first != "none" } else { self.known.contains(&first) }
    }

    /// What is known, for a table.
    pub fn known(&self) -> String {
        if self.known.is_empty() { "not `none`".into() } else { self.known.join(" or ") }
    }

    /// The log and what is asked of it; nothing where the file is not there.
    ///
    /// # Errors
    /// One line, if the log cannot be read.
    pub fn read(&self, folder: &Path) -> Result<Option<(Dataset, Question)>, String> {
        let path = folder.join(self.file);
        if !path.is_file() {
            return Ok(None);
        }
        let failed = |why: String| format!("{}: {why}", self.file);
        let pair = |(ours, theirs): &(&str, &str)| ((*ours).to_owned(), (*theirs).to_owned());
        let options = ReadOptions {
            columns: self.columns.iter().map(pair).collect(),
            skip: self.skip,
            ..ReadOptions::default()
        };
        let data = read(&[path], &options, &|_, _| {}).map_err(|e| failed(e.to_string()))?;
        let rigid_body = parse_rigid_body(self.rigid_body).map_err(|e| failed(e.to_string()))?;
        Ok(Some((data, Question { decimate: self.decimate, rigid_body, ..Question::default() })))
    }

    /// The answers of the diagnosis, where asked, and the rival; nothing where the file is not there.
    ///
    /// # Errors
    /// One line, if the log cannot be read, split or diagnosed.
    pub fn contest(
        &self,
        folder: &Path,
        rival_only: bool,
    ) -> Result<Option<(usize, Option<MeasuredAnswer>, MeasuredAnswer)>, String> {
        let Some((data, question)) = self.read(folder)? else { return Ok(None) };
        let failed = |why: String| format!("{}: {why}", self.file);
        let parts: Vec<&str> = self.rigid_body.split(',').filter(|p| !p.is_empty()).collect();
        let (found, seconds) = timed(|| regression(&data, &parts))?;
        let rival = MeasuredAnswer {
            first: found.named.first().copied().unwrap_or("none"),
            named: found.named.iter().map(|name| (*name).to_owned()).collect(),
            gain: found.gain,
            seconds,
            heard: found.words(),
        };
        if rival_only {
            return Ok(Some((data.rows, None, rival)));
        }
        let rows = data.rows;
        let (answer, seconds) = timed(|| ask(data, &question))?;
        let (found, _) = answer.map_err(failed)?;
        let named = found.findings.iter().map(|finding| {
            let order =
                finding.order.map_or(String::new(), |(order, _)| format!(" order {order:.1}"));
            format!("{}({}){order}", finding.cause.name(), finding.columns.join(","))
        });
        let ours = MeasuredAnswer {
            first: found.cause(),
            named: named.collect(),
            gain: found.gain.value,
            seconds,
            heard: contest::heard(&found),
        };
        Ok(Some((rows, Some(ours), rival)))
    }
}

/// Where measured logs are, if anywhere.
pub fn folder() -> Option<PathBuf> {
    let beside = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data");
    let folder = std::env::var_os("MEASURED_DATA").map_or_else(beside, PathBuf::from);
    folder.is_dir().then_some(folder)
}
