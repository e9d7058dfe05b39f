//! CAN logs.
//!
//! A log of another maker's drive is read by [`drive_trace`]: if a preset asks for it, or if the log has no samples of a
//! joint.
//!
//! [`joint_trace`] assembles frames into samples, and the samples are rows under the names of the contract. The row number of a sample is the line of its SYNC. Only the data
//! show which columns a joint measures, so the log is read twice: first for the columns, then for the rows. The
//! driver's answers are left out: they are computed, and a model must not be evaluated on another model's output.

mod can_file;
mod drive_trace;

use std::borrow::Cow;
use std::path::Path;

use super::format::{Input, LogFormat};
use crate::contract::{self, RUN, TIME};
use crate::dataset::LeftOutColumn;
use crate::error::{DataError, listed};
use crate::log_table::{LogTable, TableRows};
use crate::plan::Request;
use crate::preset::Preset;
use crate::setting::Setting;
use can_file::{CanFile, OtherLines};
use compensator_core::quantity::Quantity;
use drive_trace::DriveTrace;
use joint_trace::{JointOnBus, Summary, TextFormat, TraceSample};

/// The text formats of `candump`, with `-L` or its default view, and of the tools of Vector and PEAK.
pub(super) const FORMAT: LogFormat = LogFormat { matches: is_trace, read };

/// Returns true if a file that begins with `head` is a CAN log.
fn is_trace(head: &[u8]) -> bool {
    TextFormat::of(head).is_some()
}

/// A column of the table that a log is converted to.
#[derive(Clone, Copy, PartialEq, Eq)]
enum TraceColumn {
    Run,
    Time,
    Measured(Quantity),
    /// Position at the joint's side of the gear.
    JointPosition,
}

/// A sample as a row of that table.
struct TraceRow<'a> {
    sample: &'a TraceSample,
    time_s: f64,
    columns: &'a [TraceColumn],
}

impl TraceRow<'_> {
    fn number(&self, column: usize) -> Option<f64> {
        match self.columns.get(column)? {
            TraceColumn::Run => self.sample.run.map(f64::from),
            TraceColumn::Time => Some(self.time_s),
            TraceColumn::Measured(quantity) => Some(f64::from(self.sample.get(*quantity))),
            TraceColumn::JointPosition => Some(self.sample.joint_position_rad),
        }
    }

    fn text(&self, column: usize) -> Cow<'static, [u8]> {
        let text = match (self.columns.get(column), self.number(column), &self.sample.fault) {
            (Some(TraceColumn::Run), _, _) => {
                self.sample.run.map(|run| run.to_string()).unwrap_or_default()
            }
            (_, Some(value), Some(fault)) if value.is_nan() => fault.to_string(),
            (_, Some(value), None) if value.is_nan() => "no frame received".to_owned(),
            (_, value, _) => value.map(|value| value.to_string()).unwrap_or_default(),
        };
        Cow::Owned(text.into_bytes())
    }
}

/// Result of the first pass.
struct TraceOverview {
    summary: Summary,
    columns: Vec<TraceColumn>,
    /// Origin of the times, ns: the stamp of the first sample.
    origin_ns: u64,
    other_lines: OtherLines,
    /// True if the stamps are times since the frame before.
    adds_up_stamps: bool,
}

fn read(input: Input) -> Result<LogTable<'static>, DataError> {
    let Input { request, file, head, size } = input;
    let Request { path, options, progress, .. } = request;
    let mut file = CanFile::new(path, file, head);
    let first_half = |bytes| progress(bytes / 2);
    let asked = options.preset.filter(|preset| drive_trace::protocol(*preset).is_some());
    // A rate is that of the SYNC. The frames of other drives have no common one.
    let lacks_stamps = file.lines.lacks_stamps();
    if lacks_stamps && (options.rate_hz.is_none() || asked.is_some()) {
        return Err(DataError::file(
            path,
            "CAN frames without time stamps",
            format!(
                "a log of candump -l can0, or of candump -L can0 > can.log; for a joint with a constant period of the SYNC \
                 also {}",
                Setting::Rate.suggested("500Hz")
            ),
        ));
    }
    let max_share = options.max_bad_share;
    if let Some(preset) = asked {
        return match DriveTrace::find(&mut file, preset, max_share, &first_half)? {
            Some(trace) => trace.read(request),
            None => Err(no_drive(&mut file, preset)?),
        };
    }
    let overview = match scan(&mut file, max_share, &first_half) {
        Err(error @ (DataError::TooManyBad { .. } | DataError::Io { .. })) => return Err(error),
        Err(error) => {
            for preset in [Preset::ODrive, Preset::Moteus].into_iter().filter(|_| !lacks_stamps) {
                if let Some(trace) = DriveTrace::find(&mut file, preset, max_share, &first_half)? {
                    return trace.read(request);
                }
            }
            return Err(error);
        }
        overview => overview?,
    };
    let second_half = |bytes| progress((size + bytes) / 2);
    read_samples(request, &mut file, overview, &second_half)
}

/// Reads the samples of a log as rows.
fn read_samples(
    request: Request,
    file: &mut CanFile,
    overview: TraceOverview,
    progress: &dyn Fn(u64),
) -> Result<LogTable<'static>, DataError> {
    let (path, kind) = (request.path, overview.summary.kind);
    let name = |column: &TraceColumn| match column {
        TraceColumn::Run => RUN,
        TraceColumn::Time => TIME,
        TraceColumn::Measured(quantity) => quantity.name(kind),
        TraceColumn::JointPosition => contract::joint_position(kind),
    };
    let columns = &overview.columns;
    let names: Vec<String> = columns.iter().map(|column| name(column).to_owned()).collect();
    let mut table = TableRows::new(path, request.plan(names.into())?);
    file.each_sample(progress, |sample| {
        // Signed: the clock may have been set back. Dividing gives the nearest number to 0.001 for a millisecond;
        // multiplying by 1e-9 would not.
        let since_ns = i128::from(sample.time_ns) - i128::from(overview.origin_ns);
        let time_s = since_ns as f64 / 1e9;
        let row = TraceRow { sample, time_s, columns };
        table.add_row(sample.line, |at| row.number(at), |at| row.text(at));
    })?;
    let mut table = table.finish();
    add_notes(path, &overview, &mut table);
    table.bad_lines = overview.other_lines.malformed;
    Ok(table)
}

/// Adds notes on the log's frames that are not part of a row.
fn add_notes(path: &Path, overview: &TraceOverview, data: &mut LogTable) {
    let (file, summary) = (path.display(), &overview.summary);
    if summary.answers > 0 {
        for name in ["friction_torque_nm", "feed_forward_current_a", "flags"] {
            let why = "it is computed by the driver, not measured".into();
            data.left_out.push(LeftOutColumn { name: name.into(), why });
        }
    }
    if overview.adds_up_stamps {
        data.notes.push(format!(
            "{file}: the stamps are times since the frame before (candump -td) and are added up"
        ));
    }
    if summary.lost > 0 {
        let lost = summary.lost;
        data.notes
            .push(format!("{file}: {lost} samples are missing according to the SYNC counter"));
    }
    if summary.errors > 0 {
        data.notes.push(format!("{file}: {} error frames are ignored", summary.errors));
    }
    if overview.other_lines.count > 0 {
        let count = overview.other_lines.count;
        data.notes.push(format!("{file}: {count} lines are not CAN frames"));
    }
}

/// Reads the log once and finds its columns, its origin and its malformed lines.
fn scan(
    file: &mut CanFile,
    max_share: f64,
    progress: &dyn Fn(u64),
) -> Result<TraceOverview, DataError> {
    let mut is_measured = [false; Quantity::ALL.len()];
    let (mut has_runs, mut has_joint_position, mut origin_ns) = (false, false, None);
    let (summary, other_lines) = file.each_sample(progress, |sample| {
        for (is_measured, quantity) in is_measured.iter_mut().zip(Quantity::ALL) {
            *is_measured |= !sample.get(*quantity).is_nan();
        }
        has_runs |= sample.run.is_some();
        has_joint_position |= !sample.joint_position_rad.is_nan();
        origin_ns.get_or_insert(sample.time_ns);
    })?;
    let lines = summary.frames as usize + other_lines.malformed.count;
    other_lines.malformed.check(lines, max_share)?;
    let path = file.path;
    let wrong = |found: String, expected: &str| Err(DataError::file(path, found, expected));
    if !summary.others.is_empty() {
        let all = summary.joint.iter().chain(&summary.others);
        let all: Vec<String> = all.map(JointOnBus::to_string).collect();
        let found = format!("inputs of the joints {}", listed(&all));
        return wrong(found, "those of one joint: cut its frames and the SYNC out with grep");
    }
    let has = |quantity: Quantity| is_measured[quantity as usize];
    let complete = has(Quantity::Velocity) && has(Quantity::Torque);
    let Some(origin_ns) = origin_ns.filter(|_| complete) else {
        let found = format!("{} and no joint's velocity and torque", file.census()?);
        let expected = "Motion (480 + node), Torque (680 + node) and the SYNC (080) of joint.dbc";
        return wrong(found, expected);
    };
    let quantities = Quantity::ALL.iter().copied().filter(|of| has(*of)).map(TraceColumn::Measured);
    let run = has_runs.then_some(TraceColumn::Run);
    let joint_position = has_joint_position.then_some(TraceColumn::JointPosition);
    let columns = run.into_iter().chain([TraceColumn::Time]).chain(quantities);
    let columns = columns.chain(joint_position).collect();
    let adds_up_stamps = file.lines.adds_up_stamps();
    Ok(TraceOverview { summary, columns, origin_ns, other_lines, adds_up_stamps })
}

/// Returns the error of a log without the frames of the drive that a preset asks for.
fn no_drive(file: &mut CanFile, preset: Preset) -> Result<DataError, DataError> {
    let expected = match preset {
        Preset::ODrive => {
            "Get_Encoder_Estimates (009 + 20h node) and Get_Torques (01C) or Get_Iq (014) of CAN Simple"
        }
        _ => "replies with the registers 002 (velocity) and 003 (torque)",
    };
    let found = format!("{} and no velocity and torque of {}", file.census()?, preset.name());
    Ok(DataError::file(file.path, found, expected))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn is_trace_with_candump_line_returns_true() {
        for log in [
            "(1436509052.249713) vcan0 044#2A366C2BBA\n",
            "\n# a remark\n  (0.5) can0 123#R\n",
            "(1436509052.249713) vcan0 044#2A36",
            "(1436509052.249713) can0 rubbish\n",
        ] {
            assert!(is_trace(log.as_bytes()), "{log}");
        }
        for other in ["", "time_s,velocity_rad_s\n", "(a),b\n1,2\n", "(1,2)\n", "PAR1"] {
            assert!(!is_trace(other.as_bytes()), "{other}");
        }
    }
}
