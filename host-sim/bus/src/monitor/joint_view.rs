//! The state of a joint, from the frames on its bus.
//!
//! Frames and times in, a [`View`](super::view_data::View) out. This module reads no clock, bus or terminal. Every value has its time of
//! reception, so a view can show its age: a silent joint must not look like a joint at rest. The driver's own code
//! ([`SampleAssembler`]) checks the SYNCs. Emergencies report new faults and limits at once; objects report the earlier ones.

mod view;

use super::quantity::Quantity;
use super::rates::Rates;
use super::sdo_poller::{FAILED_SELF_TEST, FAULTS, LIMITS, STATE, SdoReply, UPDATE_KEY};
use super::series::{Series, Timed};
use super::view_data::{Event, EventKind, SyncCounts};
use crate::bus::{BitRates, Received};
use crate::codes::{FIRST_FAULT, FIRST_LIMIT, ReportedState, code_name};
use canopen_rs::emcy::EmergencyMessage;
use canopen_rs::nmt::decode_heartbeat;
use canopen_rs::{Address, NmtState};
use compensator_core::can::{
    Frame, JointKind, Message, NodeId, SampleAssembler, SyncFrame, SyncOutcome, TraceEntry,
};
use compensator_core::compensator::Flags;
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
    /// The number of losses in the current log line, since its start.
    losses: Timed<u64>,
    nmt: Option<NmtState>,
    heartbeat_ns: Option<u64>,
    heartbeat_step_ns: Option<u64>,
    last_frame_ns: Option<u64>,
    silent: bool,
    flags: Option<Timed<Flags>>,
    /// Bus load at the set bit rate, relative to 1 Mbit/s.
    load_scale: f64,
    /// Polled object values with their times, by index and sub-index.
    objects: BTreeMap<(u16, u8), Timed<u32>>,
    /// Numbers of the active codes.
    codes: BTreeSet<u8>,
    emergencies: u64,
    error_frames: u64,
    events: VecDeque<Event>,
    /// Number of events logged so far.
    pub(super) event_count: u64,
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
            losses: Timed { time_ns: 0, value: 0 },
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

    /// Counts a frame of any node, the monitor included, which is part of the bus load.
    pub fn count(&mut self, time_ns: u64, frame: &CanFrame) {
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
            Message::Status(_, of) => self.flags = Some(Timed { time_ns, value: of.flags }),
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
                    self.log_loss(lost.into(), time_ns);
                }
            }
            SyncOutcome::Duplicate => self.syncs.duplicate += 1,
            SyncOutcome::Late => self.syncs.late += 1,
        }
    }

    /// Logs losses, one line per second, so that a bad cable does not displace all other events.
    fn log_loss(&mut self, lost: u64, time_ns: u64) {
        let line = |count: u64| format!("{count} SYNC{} lost", if count == 1 { "" } else { "s" });
        let Timed { time_ns: begun_ns, value: count } = self.losses;
        let continues = time_ns.saturating_sub(begun_ns) < SYNC_PAUSE_NS && count > 0;
        let was = line(count);
        if continues && let Some(event) = self.events.back_mut().filter(|event| event.text == was) {
            self.losses.value += lost;
            event.text = line(self.losses.value);
            return;
        }
        self.losses = Timed { time_ns, value: lost };
        self.log(time_ns, EventKind::Warning, line(lost));
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
        let fault = number < FIRST_LIMIT;
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
                let place = (FAILED_SELF_TEST.index, FAILED_SELF_TEST.subindex);
                self.objects.insert(place, Timed { time_ns, value: test });
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
            SdoReply::Value(at, value) => self.object(at, value, now_ns),
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

    fn object(&mut self, at: Address, value: u32, now_ns: u64) {
        let now = Timed { time_ns: now_ns, value };
        let before = self.objects.insert((at.index, at.subindex), now);
        match at {
            STATE if before.is_some_and(|before| before.value != value) => {
                let state = ReportedState::from_number(value);
                let is_fault = state == ReportedState::Fault;
                let kind = if is_fault { EventKind::Fault } else { EventKind::Note };
                self.log(now_ns, kind, format!("state {}", state.name()));
            }
            UPDATE_KEY if value == PUBLISHED_KEY && before.is_none() => {
                let text = "the joint accepts the published test key: anyone can install a program";
                self.log(now_ns, EventKind::Warning, text);
            }
            FAULTS => self.replace_codes(FIRST_FAULT, value),
            LIMITS => self.replace_codes(FIRST_LIMIT, value),
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

    /// Sets the name of the bus for the commands that have missing frames sent, and its bit rate, bit/s, above 0.
    pub fn set_bus(&mut self, name: &str, bit_rate: u32) {
        name.clone_into(&mut self.bus);
        self.load_scale = f64::from(BitRates::FASTEST.nominal) / f64::from(bit_rate.max(1));
    }
}

/// Returns number and name of a self-test.
fn self_test_name(number: u32) -> String {
    match u8::try_from(number).ok().and_then(SelfTest::from_number) {
        Some(test) => test.to_string(),
        None => number.to_string(),
    }
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

#[cfg(test)]
mod tests;
