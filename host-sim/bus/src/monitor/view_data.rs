//! What is to be seen of a joint at one time: plain data, for a screen or a line of JSON.

use super::rates::PerSecond;
use compensator_core::can::JointKind;
use serde_json::{Map, Value, json};

/// A quantity with a chart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Velocity of the joint.
    Velocity,
    /// Friction torque of the model.
    Friction,
    /// Current of the compensation.
    FeedForward,
    /// Current commanded in all.
    Current,
    /// Torque no part of the model explains.
    Residual,
}

impl Quantity {
    /// Every quantity, in the order of the charts.
    pub const ALL: [Self; 5] =
        [Self::Velocity, Self::Friction, Self::FeedForward, Self::Current, Self::Residual];

    /// Its name, short enough for a narrow screen.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Velocity => "velocity",
            Self::Friction => "friction",
            Self::FeedForward => "feed-fwd",
            Self::Current => "current",
            Self::Residual => "residual",
        }
    }

    /// Its unit for this kind of joint.
    pub const fn unit(self, kind: JointKind) -> &'static str {
        match (self, kind) {
            (Self::FeedForward | Self::Current, _) => "A",
            (Self::Velocity, JointKind::Revolute) => "rad/s",
            (Self::Velocity, JointKind::Prismatic) => "m/s",
            (_, JointKind::Revolute) => "Nm",
            (_, JointKind::Prismatic) => "N",
        }
    }

    const fn key(self) -> &'static str {
        match self {
            Self::Velocity => "velocity_rad_s",
            Self::Friction => "friction_torque_nm",
            Self::FeedForward => "feed_forward_current_a",
            Self::Current => "current_a",
            Self::Residual => "residual_torque_nm",
        }
    }
}

/// How much is to be seen.
#[derive(Clone, Copy, Debug)]
pub struct Lens {
    /// How far back charts go, s.
    pub window_s: f64,
    /// Columns of a chart.
    pub columns: usize,
    /// Lines of the log, the latest.
    pub events: usize,
}

/// A quantity as it is seen.
#[derive(Clone, Debug)]
pub struct Reading {
    /// Which.
    pub quantity: Quantity,
    /// In this unit.
    pub unit: &'static str,
    /// The latest value; `None` until one was heard.
    pub value: Option<f32>,
    /// The joint says that nobody measures it.
    pub unmeasured: bool,
    /// Age of the value, s.
    pub age_s: Option<f64>,
    /// It is older than values usually are.
    pub stale: bool,
    /// Least and most since they were last forgotten.
    pub range: Option<[f32; 2]>,
    /// Least and most by column, the oldest first.
    pub columns: Vec<Option<[f32; 2]>>,
    /// So many empty columns are no gap.
    pub bridged: usize,
}

/// The joint's sign of life.
#[derive(Clone, Copy, Debug)]
pub struct Heartbeat {
    /// Age of the last, s; `None` until one was heard.
    pub age_s: Option<f64>,
    /// Usual time between two, s.
    pub period_s: Option<f64>,
    /// It stays away.
    pub late: bool,
}

/// Faults and limits by name.
#[derive(Clone, Debug)]
pub struct Codes {
    /// Faults.
    pub faults: Vec<String>,
    /// Limits.
    pub limits: Vec<String>,
    /// They were read from the joint; else known from its emergencies alone.
    pub read: bool,
}

/// Whether the model keeps what its identification promised.
#[derive(Clone, Copy, Debug)]
pub struct Band {
    /// The residual is in the promised band.
    pub in_band: bool,
    /// Windows judged; 0 while there is nothing to judge yet.
    pub windows: u32,
    /// Windows outside.
    pub windows_out: u32,
    /// Largest mean, in bands.
    pub largest_in_bands: Option<f32>,
}

/// The network that supplies the law, of a joint that has one.
#[derive(Clone, Copy, Debug)]
pub struct Network {
    /// Its last evaluation lay outside of what it was trained on.
    pub outside: bool,
    /// So many did.
    pub outside_count: u32,
    /// How much of what it says is in force, 0 (the law's constants) to 1.
    pub share: Option<f32>,
}

/// SYNCs that did not come as they should, since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SyncCounts {
    /// Never came.
    pub lost: u64,
    /// Came twice.
    pub duplicate: u64,
    /// Came after a later one.
    pub late: u64,
}

/// What kind of event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EventKind {
    /// Something is wrong.
    Fault,
    /// Something is not as it should be.
    Warning,
    /// Something is right again.
    Good,
    /// Something happened.
    Note,
}

/// A line of the log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Event {
    /// When, ns of the bus's clock.
    pub time_ns: u64,
    /// What kind.
    pub kind: EventKind,
    /// What.
    pub text: String,
}

/// All that is to be seen.
#[derive(Clone, Debug)]
pub struct View {
    /// The joint's number.
    pub node: u8,
    /// What the clock of the bus says, ns.
    pub time_ns: u64,
    /// Time since the start, s.
    pub elapsed_s: f64,
    /// How far back charts go, s.
    pub window_s: f64,
    /// Age of the joint's last frame, s; `None` until one was heard.
    pub heard_age_s: Option<f64>,
    /// It was heard and is not any more.
    pub silent: bool,
    /// Network state.
    pub nmt: Option<&'static str>,
    /// Heartbeat.
    pub heartbeat: Heartbeat,
    /// State of the joint; `None` until it was read.
    pub state: Option<&'static str>,
    /// What feeds it.
    pub source: Option<&'static str>,
    /// Age of what was read, s.
    pub objects_age_s: Option<f64>,
    /// It is too old to be relied on.
    pub objects_stale: bool,
    /// Faults and limits.
    pub codes: Codes,
    /// Flags of the compensator by name, their age in s, and whether that is too old.
    pub flags: Option<(Vec<String>, f64, bool)>,
    /// The watch over the model.
    pub band: Option<Band>,
    /// The network; `None` without one, and until it was read.
    pub network: Option<Network>,
    /// The quantities, in the order of [`Quantity::ALL`].
    pub readings: [Reading; Quantity::ALL.len()],
    /// Traffic.
    pub rates: PerSecond,
    /// Bit rate the load is a share of, bit/s.
    pub bit_rate: u32,
    /// SYNCs that did not come as they should.
    pub syncs: SyncCounts,
    /// Age of the last SYNC, s; `None` until one was heard.
    pub sync_age_s: Option<f64>,
    /// Emergencies since the start.
    pub emergencies: u64,
    /// Error frames since the start.
    pub error_frames: u64,
    /// The log, the latest last.
    pub events: Vec<Event>,
}

/// `null` for what is no number, which JSON has no word for.
fn number(value: Option<f32>) -> Value {
    // To the digits an f32 has, not to those of its double.
    let shortest = value.filter(|value| value.is_finite()).map(|value| value.to_string());
    shortest.and_then(|text| text.parse::<f64>().ok()).map_or(Value::Null, |value| json!(value))
}

impl View {
    /// As JSON; `ranges` are least and most of every quantity since the object before. Events are those
    /// of the view.
    pub fn json(&self, bus: &str, ranges: &[Option<[f32; 2]>; Quantity::ALL.len()]) -> Value {
        let mut quantities = Map::new();
        for (reading, range) in self.readings.iter().zip(ranges) {
            let measured = if reading.unmeasured { None } else { reading.value };
            let quantity = json!({
                "value": number(measured),
                "min": number(range.map(|[least, _]| least)),
                "max": number(range.map(|[_, most]| most)),
                "age_s": reading.age_s,
                "stale": reading.stale,
            });
            quantities.insert(reading.quantity.key().to_owned(), quantity);
        }
        let events: Vec<Value> = self
            .events
            .iter()
            .map(|event| {
                let kind = match event.kind {
                    EventKind::Fault => "fault",
                    EventKind::Warning => "warning",
                    EventKind::Good => "good",
                    EventKind::Note => "note",
                };
                json!({"time_s": event.time_ns as f64 * 1e-9, "kind": kind, "text": event.text})
            })
            .collect();
        json!({
            "schema": 1,
            "time_s": self.time_ns as f64 * 1e-9,
            "elapsed_s": self.elapsed_s,
            "bus": bus,
            "node": self.node,
            "heard_age_s": self.heard_age_s,
            "silent": self.silent,
            "nmt": self.nmt,
            "heartbeat_age_s": self.heartbeat.age_s,
            "heartbeat_late": self.heartbeat.late,
            "state": self.state.map(str::to_lowercase),
            "fed_by": self.source,
            "objects_age_s": self.objects_age_s,
            "objects_stale": self.objects_stale,
            "faults": self.codes.faults,
            "limits": self.codes.limits,
            "codes_read": self.codes.read,
            "flags": self.flags.as_ref().map(|(names, ..)| names),
            "flags_stale": self.flags.as_ref().map(|(.., stale)| stale),
            "model_in_band": self.band.filter(|band| band.windows > 0).map(|band| band.in_band),
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
            "events": events,
        })
    }
}
