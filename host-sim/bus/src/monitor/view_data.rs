//! The view of a joint at one time: plain data for a screen or a line of JSON.

use super::missing_frame::MissingFrame;
use super::quantity::Quantity;
use super::rates::PerSecond;
use crate::codes::ReportedState;
use serde::Serialize;
use serde_json::{Map, Value, json};

/// Extent of a view.
#[derive(Clone, Copy, Debug)]
pub struct Lens {
    /// Duration of the charts, s.
    pub window_s: f64,
    /// Columns of a chart.
    pub columns: usize,
    /// Number of the latest log events.
    pub events: usize,
}

/// The view of a quantity.
#[derive(Clone, Debug)]
pub struct Reading {
    /// The quantity.
    pub quantity: Quantity,
    /// Its unit.
    pub unit: &'static str,
    /// Latest value; `None` before the first one.
    pub value: Option<f32>,
    /// True if the joint reports the quantity as not measured.
    pub unmeasured: bool,
    /// The frame that the quantity waits for; `None` if it has new values.
    pub missing: Option<MissingFrame>,
    /// Age of the value, s.
    pub age_s: Option<f64>,
    /// True if the value is older than usual.
    pub stale: bool,
    /// Minimum and maximum since the last reset.
    pub range: Option<[f32; 2]>,
    /// Minimum and maximum of each column, the oldest first.
    pub columns: Vec<Option<[f32; 2]>>,
    /// Number of consecutive empty columns that are not a gap.
    pub bridged: usize,
}

/// The heartbeat of a joint.
#[derive(Clone, Copy, Debug)]
pub struct Heartbeat {
    /// Age of the last heartbeat, s; `None` before the first one.
    pub age_s: Option<f64>,
    /// Usual period, s.
    pub period_s: Option<f64>,
    /// True if the heartbeat is overdue.
    pub late: bool,
}

/// Faults and limits by name.
#[derive(Clone, Debug)]
pub struct Codes {
    /// Faults.
    pub faults: Vec<String>,
    /// Limits.
    pub limits: Vec<String>,
    /// True if read from the joint; otherwise known from emergencies only.
    pub read: bool,
    /// Number and name of the self-test that failed.
    pub failed_self_test: Option<String>,
}

/// Flags of the compensator.
#[derive(Clone, Debug)]
pub struct ActiveFlags {
    /// Names of the active ones.
    pub names: Vec<String>,
    /// Age of the last status, s.
    pub age_s: f64,
    /// True if the status is older than usual.
    pub is_stale: bool,
}

/// State of the residual watch.
#[derive(Clone, Copy, Debug)]
pub struct Band {
    /// True if the residual is inside the band of the model; `None` until the joint has slid for long enough.
    pub in_band: Option<bool>,
    /// Number of evaluated windows.
    pub windows: u32,
    /// Number of windows outside the band.
    pub windows_out: u32,
    /// Largest mean residual, in band widths.
    pub largest_in_bands: Option<f32>,
}

/// Friction levels that the joint learns.
#[derive(Clone, Copy, Debug)]
pub struct LearntLevels {
    /// Why it learns nothing at present, or `learning`; `None` for a number that this program does not know.
    pub state: Option<&'static str>,
    /// Gain on the levels.
    pub level: Option<f32>,
    /// Gain on the viscous friction.
    pub viscous: Option<f32>,
    /// Quantity that the learnt level follows, and the model does not use.
    pub follows: Option<&'static str>,
}

/// State of the network, for a joint that has one.
#[derive(Clone, Copy, Debug)]
pub struct Network {
    /// True if the last evaluation was outside the training range.
    pub outside: bool,
    /// Number of such evaluations.
    pub outside_count: u32,
    /// Applied share of the network's output, from 0 (constants of the law) to 1.
    pub share: Option<f32>,
}

/// SYNC errors since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SyncCounts {
    /// Lost SYNCs.
    pub lost: u64,
    /// Duplicated SYNCs.
    pub duplicate: u64,
    /// SYNCs that arrived after a later one.
    pub late: u64,
}

/// Kind of an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum EventKind {
    /// A fault.
    Fault,
    /// A warning.
    Warning,
    /// A recovery.
    Good,
    /// A note.
    Note,
}

/// An event of the log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Event {
    /// Bus time, ns.
    pub time_ns: u64,
    /// Kind of the event.
    pub kind: EventKind,
    /// Text.
    pub text: String,
}

/// The view of a joint.
#[derive(Clone, Debug)]
pub struct View {
    /// Node number.
    pub node: u8,
    /// Bus time, ns.
    pub time_ns: u64,
    /// Time since the start, s.
    pub elapsed_s: f64,
    /// Duration of the charts, s.
    pub window_s: f64,
    /// Age of the last frame of the joint, s; `None` before the first one.
    pub last_frame_age_s: Option<f64>,
    /// True if the joint sent frames before and is silent now.
    pub silent: bool,
    /// Network state.
    pub nmt: Option<&'static str>,
    /// Heartbeat.
    pub heartbeat: Heartbeat,
    /// State of the joint; `None` before it was read.
    pub state: Option<ReportedState>,
    /// Source of the inputs.
    pub source: Option<&'static str>,
    /// The joint accepts programs of the published test key; `None` before it was read.
    pub accepts_test_key: Option<bool>,
    /// Age of the read objects, s.
    pub objects_age_s: Option<f64>,
    /// True if the read objects are stale.
    pub objects_stale: bool,
    /// Faults and limits.
    pub codes: Codes,
    /// Flags of the compensator; `None` before the first status.
    pub flags: Option<ActiveFlags>,
    /// Residual watch.
    pub band: Option<Band>,
    /// Friction levels that the joint learns; `None` if it learns none.
    pub learnt: Option<LearntLevels>,
    /// Network; `None` without one, and before it was read.
    pub network: Option<Network>,
    /// The quantities, in the order of [`Quantity::ALL`].
    pub readings: [Reading; Quantity::ALL.len()],
    /// Traffic.
    pub rates: PerSecond,
    /// Bit rate for the bus load, bit/s.
    pub bit_rate: u32,
    /// SYNC errors.
    pub syncs: SyncCounts,
    /// Age of the last SYNC, s; `None` before the first one.
    pub sync_age_s: Option<f64>,
    /// Emergencies since the start.
    pub emergencies: u64,
    /// Error frames since the start.
    pub error_frames: u64,
    /// Log, the latest event last.
    pub events: Vec<Event>,
}

/// Converts a value; NaN and infinity become `null`, because JSON has no such numbers.
fn number(value: Option<f32>) -> Value {
    // With the digits of an f32, not of its f64.
    let shortest = value.filter(|value| value.is_finite()).map(|value| value.to_string());
    shortest.and_then(|text| text.parse::<f64>().ok()).map_or(Value::Null, |value| json!(value))
}

impl Reading {
    fn json(&self, range: Option<[f32; 2]>) -> Value {
        json!({
            "value": number(if self.unmeasured { None } else { self.value }),
            "min": number(range.map(|[least, _]| least)),
            "max": number(range.map(|[_, most]| most)),
            "age_s": self.age_s,
            "stale": self.stale,
            "missing_frame": self.missing.as_ref().map(|missing| json!({
                "name": missing.name,
                "identifier": missing.identifier,
                "command": missing.command,
            })),
        })
    }
}

impl LearntLevels {
    fn json(self) -> Value {
        json!({
            "state": self.state,
            "level_gain": number(self.level),
            "viscous_gain": number(self.viscous),
            "follows": self.follows,
        })
    }
}

impl View {
    /// Converts to JSON. `ranges` are the minimum and maximum of every quantity since the previous object.
    pub fn json(&self, bus: &str, ranges: &[Option<[f32; 2]>; Quantity::ALL.len()]) -> Value {
        let quantities = self.readings.iter().zip(ranges);
        let quantities: Map<String, Value> = quantities
            .map(|(reading, range)| (reading.quantity.key().to_owned(), reading.json(*range)))
            .collect();
        let event = |event: &Event| {
            let time_s = event.time_ns as f64 * 1e-9;
            json!({"time_s": time_s, "kind": event.kind, "text": event.text})
        };
        let mut document = json!({
            "schema": 1,
            "time_s": self.time_ns as f64 * 1e-9,
            "elapsed_s": self.elapsed_s,
            "bus": bus,
            "node": self.node,
            "last_frame_age_s": self.last_frame_age_s,
            "silent": self.silent,
            "nmt": self.nmt,
            "heartbeat_age_s": self.heartbeat.age_s,
            "heartbeat_late": self.heartbeat.late,
            "state": self.state.map(|state| state.name().to_lowercase()),
            "input_source": self.source,
            "accepts_test_key": self.accepts_test_key,
            "objects_age_s": self.objects_age_s,
            "objects_stale": self.objects_stale,
            "faults": self.codes.faults,
            "limits": self.codes.limits,
            "codes_read": self.codes.read,
            "flags": self.flags.as_ref().map(|flags| &flags.names),
            "flags_stale": self.flags.as_ref().map(|flags| flags.is_stale),
            "model_in_band": self.band.filter(|band| band.windows > 0).and_then(|band| band.in_band),
            "windows": self.band.map(|band| band.windows),
            "windows_out_of_band": self.band.map(|band| band.windows_out),
            "largest_in_bands": number(self.band.and_then(|band| band.largest_in_bands)),
            "network_present": self.network.is_some(),
            "network_outside": self.network.map(|network| network.outside),
            "network_outside_count": self.network.map(|network| network.outside_count),
            "network_share": number(self.network.and_then(|network| network.share)),
            "quantities": quantities,
            "samples_per_s": self.rates.samples,
            "answers_per_s": self.rates.answers,
            "frames_per_s": self.rates.frames,
            "bus_load": self.rates.load,
            "bit_rate": self.bit_rate,
            "sync_age_s": self.sync_age_s,
            "sync_lost": self.syncs.lost,
            "sync_duplicate": self.syncs.duplicate,
            "sync_late": self.syncs.late,
            "emergencies": self.emergencies,
            "error_frames": self.error_frames,
            "events": self.events.iter().map(event).collect::<Vec<_>>(),
        });
        document["failed_self_test"] = json!(self.codes.failed_self_test);
        document["adaptation"] = json!(self.learnt.map(LearntLevels::json));
        document
    }
}
