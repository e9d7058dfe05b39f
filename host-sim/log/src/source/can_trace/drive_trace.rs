//! CAN logs of other makers' drives.
//!
//! Each frame with a measured value becomes a row under the protocol's own signal names, and the tool's [`Preset`] gives
//! their meaning and unit. A row lacks the signals of other frames, and `close` merges them as in every log with channels
//! of their own. The row number is the line of the frame.

use std::collections::BTreeMap;

use super::can_file::{CanFile, OtherLines};
use crate::error::{BadRows, DataError};
use crate::joints::JOINT;
use crate::log_table::{LogTable, TableRows};
use crate::options::ReadOptions;
use crate::plan::Request;
use crate::preset::Preset;
use joint_trace::{DriveProtocol, DriveReading};

/// Minimum number of values of velocity and of torque that make a node a drive.
const MIN_VALUES: usize = 20;

/// Largest speed or torque of a log that is recognised without its preset, turns/s or Nm. Frames of another protocol that are
/// read as numbers exceed it.
const MAX_PLAUSIBLE: f32 = 1e4;

/// A value of a frame: line, time, values.
struct Stamped {
    line: u64,
    time_ns: u64,
    reading: DriveReading,
}

/// The readings of a log, in the order of its lines.
pub(super) struct DriveTrace {
    preset: Preset,
    readings: Vec<Stamped>,
    /// The drives with a velocity and a torque or current.
    nodes: Vec<u8>,
    /// Malformed lines, the first few in detail.
    bad: BadRows,
}

/// Number of values of a node.
#[derive(Default)]
struct NodeCount {
    velocity: usize,
    torque: usize,
    current: usize,
    is_plausible: bool,
}

/// Returns the protocol of a tool's CAN logs.
pub(super) fn protocol(preset: Preset) -> Option<DriveProtocol> {
    match preset {
        Preset::ODrive => Some(DriveProtocol::ODrive),
        Preset::Moteus => Some(DriveProtocol::Moteus),
        _ => None,
    }
}

impl DriveTrace {
    /// Reads the frames of a drive, if the log has enough of them.
    ///
    /// # Errors
    /// If the file cannot be read, or has too many malformed lines.
    pub fn find(
        file: &mut CanFile,
        preset: Preset,
        max_bad_share: f64,
        progress: &dyn Fn(u64),
    ) -> Result<Option<Self>, DataError> {
        let Some(protocol) = protocol(preset) else { return Ok(None) };
        let (mut readings, mut frames) = (Vec::new(), 0);
        let mut counts: BTreeMap<u8, NodeCount> = BTreeMap::new();
        let OtherLines { malformed: bad, .. } = file.each_frame(progress, |line, frame| {
            frames += 1;
            if let Some(reading) = protocol.read(&frame.frame) {
                let new = || NodeCount { is_plausible: true, ..NodeCount::default() };
                counts.entry(reading.node).or_insert_with(new).add(&reading);
                readings.push(Stamped { line, time_ns: frame.time_ns, reading });
            }
        })?;
        bad.check(frames + bad.count, max_bad_share)?;
        let nodes: Vec<u8> =
            counts.iter().filter(|(_, of)| of.is_complete()).map(|(node, _)| *node).collect();
        readings.retain(|of| {
            let count = &counts[&of.reading.node];
            // A current beside the torque has rows of its own only where the drive sends no torque.
            let is_spare = of.reading.current_a.is_some() && count.torque >= MIN_VALUES;
            count.is_complete() && !is_spare
        });
        Ok((!nodes.is_empty()).then_some(Self { preset, readings, nodes, bad }))
    }

    /// Returns the readings as a table.
    ///
    /// # Errors
    /// As a table with these columns.
    pub fn read(self, request: Request) -> Result<LogTable<'static>, DataError> {
        let columns = self.columns();
        let names: Vec<String> = columns.iter().map(|of| of.name(self.preset).to_owned()).collect();
        let options = &ReadOptions { preset: Some(self.preset), ..request.options.clone() };
        let plan = Request { options, ..request }.plan(names.into())?;
        let mut table = TableRows::new(request.path, plan);
        let origin_ns = self.readings.first().map_or(0, |first| first.time_ns);
        for Stamped { line, time_ns, reading } in &self.readings {
            // Signed, because a clock may have been set back.
            let time_s = (i128::from(*time_ns) - i128::from(origin_ns)) as f64 / 1e9;
            let number = |at: usize| match columns[at] {
                DriveColumn::Time => Some(time_s),
                column => column.value(reading).map(f64::from).filter(|value| !value.is_nan()),
            };
            table.add_numbers(*line, number);
        }
        Ok(LogTable { bad_lines: self.bad, ..table.finish() })
    }

    fn columns(&self) -> Vec<DriveColumn> {
        use DriveColumn as Is;
        let has = |column: &DriveColumn| match column {
            Is::Time => true,
            Is::Node => self.nodes.len() > 1,
            column => self.readings.iter().any(|of| column.value(&of.reading).is_some()),
        };
        let all = [Is::Time, Is::Node, Is::Position, Is::Velocity, Is::Torque, Is::Current];
        all.into_iter().filter(has).collect()
    }
}

impl NodeCount {
    fn add(&mut self, reading: &DriveReading) {
        let DriveReading { velocity_turns_s, torque_nm, current_a, .. } = *reading;
        self.velocity += usize::from(velocity_turns_s.is_some());
        self.torque += usize::from(torque_nm.is_some());
        self.current += usize::from(current_a.is_some());
        let values = [velocity_turns_s, torque_nm, current_a].into_iter().flatten();
        self.is_plausible &= values.into_iter().all(|value| {
            value.is_nan() || value.abs() <= MAX_PLAUSIBLE && (value == 0.0 || value.is_normal())
        });
    }

    fn is_complete(&self) -> bool {
        self.is_plausible
            && self.velocity >= MIN_VALUES
            && self.torque.max(self.current) >= MIN_VALUES
    }
}

/// A column of the table that a log is converted to.
#[derive(Clone, Copy, PartialEq, Eq)]
enum DriveColumn {
    Time,
    Node,
    Position,
    Velocity,
    Torque,
    Current,
}

impl DriveColumn {
    /// Returns the signal's name in the protocol's documentation.
    fn name(self, preset: Preset) -> &'static str {
        let is_odrive = preset == Preset::ODrive;
        let of = |odrive, moteus| if is_odrive { odrive } else { moteus };
        match self {
            Self::Time => "time",
            Self::Node => JOINT,
            Self::Position => of("Pos_Estimate", "POSITION"),
            Self::Velocity => of("Vel_Estimate", "VELOCITY"),
            Self::Torque => of("Torque_Estimate", "TORQUE"),
            Self::Current => "Iq_Measured",
        }
    }

    fn value(self, reading: &DriveReading) -> Option<f32> {
        match self {
            Self::Time => None,
            Self::Node => Some(f32::from(reading.node)),
            Self::Position => reading.position_turns,
            Self::Velocity => reading.velocity_turns_s,
            Self::Torque => reading.torque_nm,
            Self::Current => reading.current_a,
        }
    }
}
