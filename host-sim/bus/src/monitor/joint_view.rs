//! The state of a joint, from the frames on its bus.
//!
//! Frames and times in, a [`View`] out. This module reads no clock, bus or terminal. Every value has its time of
//! reception, so a view can show its age: a silent joint must not look like a joint at rest. The driver's own code
//! ([`SampleAssembler`]) checks the SYNCs. Emergencies report new faults and limits at once; objects report the earlier ones.

mod missing;

use super::quantity::Quantity;
use super::rates::{PerSecond, Rates};
use super::sdo_poller::{Request, SdoReply};
use super::series::Series;
use super::view_data::{
    Band, Codes, Event, EventKind, Heartbeat, LearntLevels, Lens, Network, Reading, SyncCounts,
    View,
};
use crate::bus::{BitRates, Received};
use canopen_rs::NmtState;
use canopen_rs::emcy::EmergencyMessage;
use canopen_rs::nmt::decode_heartbeat;
use compensator_core::adaptation::{FOLLOWED, Frozen};
use compensator_core::can::{
    Frame, JointKind, Message, NodeId, SampleAssembler, SyncFrame, SyncOutcome, TraceEntry,
};
use compensator_core::compensator::Flags;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::{
    AdaptationObject, NetworkObject, ProgramObject, StateObject,
};
use firmware::supervisor::{Code, SelfTest};
use firmware::update::PUBLISHED_KEY;
use joint_trace::CanFrame;
use std::collections::{BTreeMap, BTreeSet, VecDeque};

/// Maximum number of kept events.
const MAX_EVENTS: usize = 500;
/// Pause after which the SYNC counter restarts, ns, because losses in the pause cannot be counted.
const SYNC_PAUSE_NS: u64 = 1_000_000_000;
/// Time without a frame after which a joint counts as silent, ns, unless its heartbeat is slower.
const SILENCE_TIMEOUT_NS: u64 = 3_000_000_000;
/// Age after which objects are stale, ns: four polling rounds.
const OBJECTS_STALE_NS: u64 = 2_000_000_000;

/// Returns the age of a time, s.
fn age_s(at_ns: u64, now_ns: u64) -> f64 {
    now_ns.saturating_sub(at_ns) as f64 * 1e-9
}

/// Returns the learnt friction levels; `None` if the joint learns none.
fn learnt_levels(object: &impl Fn(u16, u8) -> Option<u32>) -> Option<LearntLevels> {
    object(index::ADAPTATION, AdaptationObject::MODE).filter(|mode| *mode != 0)?;
    let state = object(index::ADAPTATION, AdaptationObject::FROZEN)?;
    let follows = object(index::ADAPTATION, AdaptationObject::FOLLOWS).unwrap_or_default();
    Some(LearntLevels {
        state: Frozen::ALL.get(state as usize).map(|reason| reason.name()),
        level: object(index::LEARNT_GAINS, 1).map(f32::from_bits),
        viscous: object(index::LEARNT_GAINS, 2).map(f32::from_bits),
        follows: (follows as usize)
            .checked_sub(1)
            .and_then(|place| FOLLOWED.get(place))
            .map(|quantity| quantity.info().label),
    })
}

/// The state of a joint.
#[derive(Debug)]
pub struct JointView {
    node: NodeId,
    /// Name of the bus.
    bus: String,
    /// Identifiers of the missing frames that were logged.
    logged_missing: BTreeSet<u16>,
    start_ns: u64,
    inbox: SampleAssembler,
    kind: JointKind,
    series: [Series; Quantity::ALL.len()],
    rates: Rates,
    syncs: SyncCounts,
    last_sync_ns: Option<u64>,
    /// Start time, ns, and number of the losses in the current log line.
    losses: (u64, u64),
    nmt: Option<NmtState>,
    heartbeat_ns: Option<u64>,
    heartbeat_step_ns: Option<u64>,
    last_frame_ns: Option<u64>,
    silent: bool,
    flags: Option<(u64, Flags)>,
    /// Bus load at the set bit rate, relative to 1 Mbit/s.
    load_scale: f64,
    /// Polled object values with their times, by index and sub-index.
    objects: BTreeMap<(u16, u8), (u64, u32)>,
    /// Numbers of the active codes.
    codes: BTreeSet<u8>,
    emergencies: u64,
    error_frames: u64,
    events: VecDeque<Event>,
    event_count: u64,
}

impl JointView {
    /// Creates a view without data.
    pub fn new(node: NodeId, start_ns: u64) -> Self {
        Self {
            node,
            bus: "BUS".to_owned(),
            logged_missing: BTreeSet::new(),
            start_ns,
            inbox: SampleAssembler::new(node),
            kind: JointKind::default(),
            series: Default::default(),
            rates: Rates::new(start_ns),
            syncs: SyncCounts::default(),
            last_sync_ns: None,
            losses: (0, 0),
            nmt: None,
            heartbeat_ns: None,
            heartbeat_step_ns: None,
            last_frame_ns: None,
            silent: false,
            flags: None,
            load_scale: 1.0,
            objects: BTreeMap::new(),
            codes: BTreeSet::new(),
            emergencies: 0,
            error_frames: 0,
            events: VecDeque::new(),
            event_count: 0,
        }
    }

    /// Appends an event to the log.
    pub fn log(&mut self, time_ns: u64, kind: EventKind, text: impl Into<String>) {
        if self.events.len() == MAX_EVENTS {
            self.events.pop_front();
        }
        self.event_count += 1;
        self.events.push_back(Event { time_ns, kind, text: text.into() });
    }

    /// Processes a received frame. Returns true if the joint appeared or changed its state.
    pub fn receive(&mut self, received: &Received) -> bool {
        let Received { time_ns, ref frame } = *received;
        self.count(time_ns, frame);
        if matches!(frame, CanFrame::Error { .. }) {
            self.error_frames += 1;
            return false;
        }
        let mut has_news = false;
        for frame in frame.joint_frames() {
            has_news |= self.receive_joint_frame(&frame, time_ns);
        }
        has_news
    }

    fn receive_joint_frame(&mut self, frame: &Frame, time_ns: u64) -> bool {
        let number = u16::from(self.node.number());
        let identifier = frame.identifier();
        let is_joints = matches!(identifier.wrapping_sub(number), 0x080 | 0x180 | 0x280 | 0x380)
            || matches!(identifier.wrapping_sub(number), 0x580 | 0x700);
        let mut has_news = false;
        if is_joints {
            has_news = self.last_frame_ns.is_none() || self.silent;
            if self.silent {
                self.log(time_ns, EventKind::Good, "the joint sends again");
            }
            (self.last_frame_ns, self.silent) = (Some(time_ns), false);
        }
        if identifier == 0x700 + number {
            return self.heartbeat(frame, time_ns) || has_news;
        }
        if identifier == 0x080 + number {
            self.emergency(frame, time_ns);
            return true;
        }
        if let Ok(message) = Message::parse(frame) {
            self.message(&message, time_ns);
        }
        has_news
    }

    /// Counts a frame that the monitor sent, which is part of the bus load.
    pub fn sent(&mut self, time_ns: u64, frame: &CanFrame) {
        self.count(time_ns, frame);
    }

    fn count(&mut self, time_ns: u64, frame: &CanFrame) {
        let slot = self.rates.at(time_ns);
        slot.frames += 1;
        slot.wire_ns += BitRates::FASTEST.duration_ns(frame);
    }

    fn push(&mut self, quantity: Quantity, time_ns: u64, value: f32) {
        self.series[quantity as usize].push(time_ns, value);
    }

    fn message(&mut self, message: &Message, time_ns: u64) {
        if let Message::Sync(sync) = message {
            return self.sync(*sync, time_ns);
        }
        if message.node() != Some(self.node) {
            return;
        }
        if self.inbox.take(message) {
            self.log(time_ns, EventKind::Note, "a run begins");
        }
        match *message {
            Message::Motion(_, of) => self.push(Quantity::Velocity, time_ns, of.velocity_rad_s),
            Message::Answer(_, of) => {
                self.rates.at(time_ns).answers += 1;
                self.push(Quantity::Friction, time_ns, of.friction_torque_nm);
                self.push(Quantity::FeedForward, time_ns, of.feed_forward_current_a);
            }
            Message::Telemetry(_, of) => {
                self.push(Quantity::Current, time_ns, of.current_a);
                self.push(Quantity::Residual, time_ns, of.residual_torque_nm);
            }
            Message::Status(_, of) => self.flags = Some((time_ns, of.flags)),
            Message::Entry(_, TraceEntry::JointKind(kind)) => self.kind = kind,
            _ => {}
        }
    }

    fn sync(&mut self, sync: SyncFrame, time_ns: u64) {
        let paused = |last: u64| time_ns.saturating_sub(last) > SYNC_PAUSE_NS;
        if self.last_sync_ns.is_some_and(paused) {
            self.inbox = SampleAssembler::new(self.node);
        }
        self.last_sync_ns = Some(time_ns);
        match self.inbox.sync(sync) {
            SyncOutcome::Sample { lost } => {
                self.inbox.end_sample();
                self.rates.at(time_ns).samples += 1;
                if lost > 0 {
                    self.syncs.lost += u64::from(lost);
                    self.log_loss(lost, time_ns);
                }
            }
            SyncOutcome::Duplicate => self.syncs.duplicate += 1,
            SyncOutcome::Late => self.syncs.late += 1,
        }
    }

    /// Logs losses, one line per second, so that a bad cable does not displace all other events.
    fn log_loss(&mut self, lost: u8, time_ns: u64) {
        let line = |count: u64| format!("{count} SYNC{} lost", if count == 1 { "" } else { "s" });
        let (begun_ns, count) = self.losses;
        let continues = time_ns.saturating_sub(begun_ns) < SYNC_PAUSE_NS && count > 0;
        let was = line(count);
        if continues && let Some(event) = self.events.back_mut().filter(|event| event.text == was) {
            self.losses.1 += u64::from(lost);
            event.text = line(self.losses.1);
            return;
        }
        self.losses = (time_ns, u64::from(lost));
        self.log(time_ns, EventKind::Warning, line(u64::from(lost)));
    }

    fn heartbeat(&mut self, frame: &Frame, time_ns: u64) -> bool {
        let Ok(data) = <&[u8; 1]>::try_from(frame.data()) else { return false };
        let Ok(state) = decode_heartbeat(data) else { return false };
        if state == NmtState::Initialising {
            self.log(time_ns, EventKind::Warning, "the joint has started");
            // Codes and objects from before the start are not valid.
            (self.heartbeat_ns, self.heartbeat_step_ns) = (None, None);
            self.codes.clear();
            self.objects.clear();
        } else {
            let step_ns = self.heartbeat_ns.map(|before| time_ns.saturating_sub(before));
            // Smoothed, because an adapter may deliver several heartbeats at once.
            self.heartbeat_step_ns = match (self.heartbeat_step_ns, step_ns) {
                (Some(usual_ns), Some(step_ns)) => Some((3 * usual_ns + step_ns) / 4),
                (usual_ns, step_ns) => usual_ns.or(step_ns),
            };
        }
        self.heartbeat_ns = Some(time_ns);
        let is_new = self.nmt != Some(state);
        if is_new && state != NmtState::Initialising {
            self.log(time_ns, EventKind::Note, format!("network state {}", nmt_name(state)));
        }
        self.nmt = Some(state);
        is_new || state == NmtState::Initialising
    }

    fn emergency(&mut self, frame: &Frame, time_ns: u64) {
        let Ok(message) = EmergencyMessage::decode(frame.data()) else { return };
        self.emergencies += 1;
        let (code, number) = (message.error_code, message.vendor_specific[0]);
        let raised = code != 0;
        if raised {
            self.codes.insert(number);
        } else {
            self.codes.remove(&number);
        }
        let fault = number <= 32;
        let what = if fault { "fault" } else { "limit" };
        let name = code_name(number);
        let kind = match (raised, fault) {
            (true, true) => EventKind::Fault,
            (true, false) => EventKind::Warning,
            (false, _) => EventKind::Good,
        };
        let text = match (raised, Code::from_number(number)) {
            (true, Some(Code::SelfTestFailed)) => {
                let test = u32::from(message.vendor_specific[2]);
                let place = (index::STATE, StateObject::FAILED_SELF_TEST);
                self.objects.insert(place, (time_ns, test));
                format!("{what} {name} ({code:04X}h): test {}", self_test_name(test))
            }
            (true, Some(known)) => {
                format!("{what} {name} ({code:04X}h): {}", known.description().raised_by)
            }
            (true, None) => format!("{what} {name} ({code:04X}h)"),
            (false, _) => format!("{what} {name} is over"),
        };
        self.log(time_ns, kind, text);
    }

    /// Processes the reply to a request.
    pub fn on_reply(&mut self, reply: SdoReply, now_ns: u64) {
        match reply {
            SdoReply::Value(at, value) => self.object(at.index, at.subindex, value, now_ns),
            SdoReply::Done(request) => {
                self.log(now_ns, EventKind::Good, format!("{}: done", request.name()));
            }
            SdoReply::Refused(request, code, why) => {
                let why = if why.is_empty() { "no reason given" } else { why.as_str() };
                let text = format!("{}: refused ({code:08X}h): {why}", request.name());
                self.log(now_ns, EventKind::Fault, text);
            }
            SdoReply::Unanswered(request) => {
                let text = format!("{}: the joint does not answer", request.name());
                self.log(now_ns, EventKind::Fault, text);
            }
        }
    }

    fn object(&mut self, at_index: u16, place: u8, value: u32, now_ns: u64) {
        let before = self.objects.insert((at_index, place), (now_ns, value));
        match (at_index, place) {
            (index::STATE, 2) if before.is_some_and(|(_, before)| before != value) => {
                let kind = if value == 2 { EventKind::Fault } else { EventKind::Note };
                self.log(now_ns, kind, format!("state {}", state_name(value)));
            }
            (index::PROGRAM, ProgramObject::UPDATE_KEY)
                if value == PUBLISHED_KEY && before.is_none() =>
            {
                let text = "the joint accepts the published test key: anyone can install a program";
                self.log(now_ns, EventKind::Warning, text);
            }
            (index::STATE, 3) => self.replace_codes(1, value),
            (index::STATE, 4) => self.replace_codes(33, value),
            _ => {}
        }
    }

    fn replace_codes(&mut self, first: u8, bits: u32) {
        for bit in 0..32 {
            if bits >> bit & 1 != 0 {
                self.codes.insert(first + bit);
            } else {
                self.codes.remove(&(first + bit));
            }
        }
    }

    /// Checks whether the joint is silent.
    pub fn tick(&mut self, now_ns: u64) {
        let limit_ns = self.heartbeat_limit_ns().max(SILENCE_TIMEOUT_NS);
        let is_late = |last_ns: u64| now_ns.saturating_sub(last_ns) > limit_ns;
        if !self.silent && self.last_frame_ns.is_some_and(is_late) {
            self.silent = true;
            self.log(now_ns, EventKind::Fault, "the joint is silent");
        }
        self.log_missing(now_ns);
    }

    fn heartbeat_limit_ns(&self) -> u64 {
        self.heartbeat_step_ns.map_or(SILENCE_TIMEOUT_NS, |step_ns| step_ns.saturating_mul(5) / 2)
    }

    /// Returns true if the joint serves objects, that is, unless its network state is *stopped*.
    pub fn serves_objects(&self) -> bool {
        self.nmt != Some(NmtState::Stopped)
    }

    /// Resets the minimum and maximum of every quantity.
    pub fn reset_ranges(&mut self) {
        self.series.iter_mut().for_each(Series::reset_range);
    }

    /// Returns the minimum and maximum of every quantity since the last call.
    pub fn take_line_ranges(&mut self) -> [Option<[f32; 2]>; Quantity::ALL.len()] {
        self.series.each_mut().map(Series::take_line_range)
    }

    /// Sets the name of the bus for the commands that have missing frames sent.
    pub fn set_bus(&mut self, name: &str) {
        name.clone_into(&mut self.bus);
    }

    /// Sets the bit rate for the bus load, bit/s, above 0.
    pub fn set_bit_rate(&mut self, bit_rate: u32) {
        self.load_scale = f64::from(BitRates::FASTEST.nominal) / f64::from(bit_rate.max(1));
    }

    /// Returns the number of events logged so far.
    pub const fn event_count(&self) -> u64 {
        self.event_count
    }

    /// Returns the view at a time.
    pub fn view(&self, now_ns: u64, lens: &Lens) -> View {
        let object =
            |index: u16, place: u8| self.objects.get(&(index, place)).map(|(_, value)| *value);
        let age = |index: u16, place: u8| {
            self.objects.get(&(index, place)).map(|(at_ns, _)| age_s(*at_ns, now_ns))
        };
        let state_age_s = age(index::STATE, 2);
        let names = |from: u8, to: u8| {
            self.codes.iter().filter(|n| (from..=to).contains(n)).map(|n| code_name(*n)).collect()
        };
        let stale_s = OBJECTS_STALE_NS as f64 * 1e-9;
        View {
            node: self.node.number(),
            time_ns: now_ns,
            elapsed_s: age_s(self.start_ns, now_ns),
            window_s: lens.window_s,
            last_frame_age_s: self.last_frame_ns.map(|at_ns| age_s(at_ns, now_ns)),
            silent: self.silent,
            nmt: self.nmt.map(nmt_name),
            heartbeat: Heartbeat {
                age_s: self.heartbeat_ns.map(|at_ns| age_s(at_ns, now_ns)),
                period_s: self.heartbeat_step_ns.map(|step_ns| step_ns as f64 * 1e-9),
                late: (self.heartbeat_ns)
                    .is_some_and(|at_ns| now_ns.saturating_sub(at_ns) > self.heartbeat_limit_ns()),
            },
            state: object(index::STATE, 2).map(state_name),
            source: object(index::OPERATION, 1).map(|source| match source {
                0 => "its sensors",
                1 => "the bus",
                _ => "unknown",
            }),
            accepts_test_key: object(index::PROGRAM, ProgramObject::UPDATE_KEY)
                .map(|key| key == PUBLISHED_KEY),
            objects_age_s: state_age_s,
            objects_stale: state_age_s.is_some_and(|age_s| age_s > stale_s),
            codes: Codes {
                faults: names(1, 32),
                limits: names(33, 64),
                read: age(index::STATE, 3).is_some() && age(index::STATE, 4).is_some(),
                failed_self_test: object(index::STATE, StateObject::FAILED_SELF_TEST)
                    .filter(|number| *number != 0)
                    .map(self_test_name),
            },
            flags: self.flags.map(|(at_ns, flags)| {
                let stale = self.series[Quantity::Friction as usize].stale_ns();
                let age_s = age_s(at_ns, now_ns);
                (flag_names(flags), age_s, age_s > stale as f64 * 1e-9)
            }),
            band: object(index::WATCH, 1).map(|in_band| Band {
                in_band: in_band != 0,
                windows: object(index::WATCH, 2).unwrap_or(0),
                windows_out: object(index::WATCH, 3).unwrap_or(0),
                largest_in_bands: object(index::WATCH, 5).map(f32::from_bits),
            }),
            learnt: learnt_levels(&object),
            network: object(index::NETWORK, NetworkObject::PRESENT).filter(|has| *has != 0).map(
                |_| {
                    let number = |place| object(index::NETWORK, place);
                    Network {
                        outside: number(NetworkObject::OUTSIDE).is_some_and(|outside| outside != 0),
                        outside_count: number(NetworkObject::OUTSIDE_COUNT).unwrap_or(0),
                        share: number(NetworkObject::SHARE).map(f32::from_bits),
                    }
                },
            ),
            readings: Quantity::ALL.map(|quantity| self.reading(quantity, now_ns, lens)),
            rates: {
                let rates = self.rates.per_second(now_ns);
                PerSecond { load: rates.load * self.load_scale, ..rates }
            },
            bit_rate: (f64::from(BitRates::FASTEST.nominal) / self.load_scale).round() as u32,
            syncs: self.syncs,
            sync_age_s: self.last_sync_ns.map(|at_ns| age_s(at_ns, now_ns)),
            emergencies: self.emergencies,
            error_frames: self.error_frames,
            events: self.events.iter().rev().take(lens.events).rev().cloned().collect(),
        }
    }

    fn reading(&self, quantity: Quantity, now_ns: u64, lens: &Lens) -> Reading {
        let series = &self.series[quantity as usize];
        let window_ns = (lens.window_s * 1e9) as u64;
        let (columns, bridged) = series.columns(now_ns, window_ns, lens.columns);
        let age = series.last().map(|(at_ns, _)| now_ns.saturating_sub(at_ns));
        Reading {
            quantity,
            unit: quantity.unit(self.kind),
            value: series.last().map(|(_, value)| value),
            unmeasured: series.is_unmeasured(),
            missing: self.missing_frame(quantity, now_ns),
            age_s: age.map(|age_ns| age_ns as f64 * 1e-9),
            stale: age.is_some_and(|age_ns| age_ns > series.stale_ns()),
            range: series.range(),
            columns,
            bridged,
        }
    }

    /// Logs a request that is being sent.
    pub fn requested(&mut self, request: Request, now_ns: u64) {
        self.log(now_ns, EventKind::Note, format!("{}: requested", request.name()));
    }
}

/// Returns number and name of a self-test.
fn self_test_name(number: u32) -> String {
    match u8::try_from(number).ok().and_then(SelfTest::from_number) {
        Some(test) => test.to_string(),
        None => number.to_string(),
    }
}

/// Returns the name of a code, or its number if it is unknown.
fn code_name(number: u8) -> String {
    Code::from_number(number).map_or_else(|| format!("code-{number}"), |c| c.info().name.to_owned())
}

/// Returns the names of flags. Unknown flags of a newer driver are named by their bit.
fn flag_names(flags: Flags) -> Vec<String> {
    let known = flags.iter_names().map(|(name, _)| name.to_lowercase().replace('_', "-"));
    let rest = flags.bits() & !Flags::all().bits();
    let unknown = (0..32).filter(|bit| rest >> bit & 1 != 0).map(|bit| format!("flag-{bit}"));
    known.chain(unknown).collect()
}

/// Returns the name of a network state.
fn nmt_name(state: NmtState) -> &'static str {
    match state {
        NmtState::Initialising => "starting",
        NmtState::Stopped => "stopped",
        NmtState::Operational => "operational",
        NmtState::PreOperational => "pre-operational",
    }
}

/// Returns the name of a joint state.
fn state_name(value: u32) -> &'static str {
    match value {
        0 => "safe",
        1 => "armed",
        2 => "FAULT",
        _ => "unknown",
    }
}

#[cfg(test)]
mod tests;
