//! Polling of a joint's objects without waiting.
//!
//! Twice a second, the poller reads the state, the faults and limits, and the residual watch, one object after the other.
//! A request (arm, disarm, clear faults) has priority. If it is refused, the poller reads the joint's reason. Frames go
//! in, frames come out, and the time is an argument.
//!
//! An SDO server serves one client (CiA 301), which may be another program. So the poller pauses after a request of
//! another client, and evaluates the answers to that client too. A joint that does not answer is polled less often, and a
//! stopped joint not at all. A monitor that only listens sends nothing.

use crate::canopen::{download_request, expedited, reason_in_words};
use canopen_rs::Address;
use canopen_rs::sdo::{
    decode_abort, decode_data_segment, decode_upload_initiate_segmented_response,
    encode_upload_request, encode_upload_segment_request,
};
use compensator_core::can::{Frame, Message, NodeId, cob_id};
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::{
    AdaptationObject, NetworkObject, OperationObject, ProgramObject, StateObject,
};
use std::collections::VecDeque;

/// Time between two polling rounds, ns.
const POLL_PERIOD_NS: u64 = 500_000_000;
/// Maximum time between two polling rounds of a joint that does not answer, ns.
const MAX_POLL_PERIOD_NS: u64 = 16_000_000_000;
/// Time limit for an answer, ns.
const ANSWER_TIMEOUT_NS: u64 = 300_000_000;
/// Polling pause after a request of another client, ns.
const OTHER_CLIENT_PAUSE_NS: u64 = 1_000_000_000;
/// Polling pause after an entry of a replayed trace, ns.
const TRACE_PAUSE_NS: u64 = 20_000_000;
/// Sending pause after a full bus, ns.
const FULL_BUS_PAUSE_NS: u64 = 10_000_000_000;

/// State of the joint, with its active faults and limits as bits.
pub(super) const STATE: Address = Address::new(index::STATE, 2);
pub(super) const FAULTS: Address = Address::new(index::STATE, 3);
pub(super) const LIMITS: Address = Address::new(index::STATE, 4);
pub(super) const FAILED_SELF_TEST: Address =
    Address::new(index::STATE, StateObject::FAILED_SELF_TEST);
/// The residual watch.
pub(super) const IN_BAND: Address = Address::new(index::WATCH, 1);
pub(super) const WINDOWS: Address = Address::new(index::WATCH, 2);
pub(super) const WINDOWS_OUT_OF_BAND: Address = Address::new(index::WATCH, 3);
pub(super) const LARGEST_IN_BANDS: Address = Address::new(index::WATCH, 5);
/// Source of the inputs, and the key whose programs the joint accepts.
pub(super) const SOURCE: Address = Address::new(index::OPERATION, OperationObject::SOURCE);
pub(super) const UPDATE_KEY: Address = Address::new(index::PROGRAM, ProgramObject::UPDATE_KEY);

/// Objects read in a polling round.
pub const POLLED_OBJECTS: [Address; 19] = [
    STATE,
    FAULTS,
    LIMITS,
    FAILED_SELF_TEST,
    IN_BAND,
    WINDOWS,
    WINDOWS_OUT_OF_BAND,
    LARGEST_IN_BANDS,
    SOURCE,
    Address::new(index::NETWORK, NetworkObject::PRESENT),
    Address::new(index::NETWORK, NetworkObject::OUTSIDE),
    Address::new(index::NETWORK, NetworkObject::OUTSIDE_COUNT),
    Address::new(index::NETWORK, NetworkObject::SHARE),
    UPDATE_KEY,
    Address::new(index::ADAPTATION, AdaptationObject::MODE),
    Address::new(index::ADAPTATION, AdaptationObject::FROZEN),
    Address::new(index::ADAPTATION, AdaptationObject::FOLLOWS),
    Address::new(index::LEARNT_GAINS, 1),
    Address::new(index::LEARNT_GAINS, 2),
];

/// A request to a joint's state machine, with the number it has on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Switch the bridge off; for a HIL joint, the compensation.
    Disarm = 0,
    /// Switch it on.
    Arm = 1,
    /// Clear the faults whose cause is removed.
    ClearFaults = 2,
}

impl Request {
    /// Returns the name of the request.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Disarm => "disarm",
            Self::Arm => "arm",
            Self::ClearFaults => "clear faults",
        }
    }
}

/// Result of a request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SdoReply {
    /// The value of an object.
    Value(Address, u32),
    /// A request was accepted.
    Done(Request),
    /// A request was refused: abort code of CiA 301, and the reason of the joint, which may be empty.
    Refused(Request, u32, String),
    /// A request was not answered.
    Unanswered(Request),
}

#[derive(Debug)]
enum Job {
    Read,
    Write(Request),
    /// The reason of a refusal: the received part, and the toggle bit of the next segment.
    Reason {
        request: Request,
        code: u32,
        text: Vec<u8>,
        toggle: Option<bool>,
    },
}

#[derive(Debug)]
struct Pending {
    at: Address,
    until_ns: u64,
    job: Job,
}

/// Polls the objects of a joint.
#[derive(Debug)]
pub struct SdoPoller {
    node: NodeId,
    listen: bool,
    round: VecDeque<Address>,
    pending: Option<Pending>,
    requests: VecDeque<Request>,
    follow_up: Option<[u8; 8]>,
    next_round_ns: u64,
    pace_ns: u64,
    hold_until_ns: u64,
}

impl SdoPoller {
    /// Creates a poller of a node. With `listen`, it sends nothing.
    pub fn new(node: NodeId, listen: bool) -> Self {
        Self {
            node,
            listen,
            round: VecDeque::new(),
            pending: None,
            requests: VecDeque::new(),
            follow_up: None,
            next_round_ns: 0,
            pace_ns: POLL_PERIOD_NS,
            hold_until_ns: 0,
        }
    }

    /// Returns true if it never sends.
    pub const fn only_listens(&self) -> bool {
        self.listen
    }

    /// Returns true during a pause for another client.
    pub fn is_held(&self, now_ns: u64) -> bool {
        now_ns < self.hold_until_ns
    }

    /// Queues a request. Does nothing if the poller only listens.
    pub fn request(&mut self, request: Request) {
        if self.listen {
            return;
        }
        // A request to disarm cancels a pending request to arm.
        if request == Request::Disarm {
            self.requests.clear();
        }
        self.requests.push_back(request);
    }

    /// Polls soon, because the joint appeared or changed its state.
    pub fn wake(&mut self, now_ns: u64) {
        self.pace_ns = POLL_PERIOD_NS;
        self.next_round_ns = self.next_round_ns.min(now_ns);
    }

    /// Pauses sending, because the bus had no room.
    pub fn bus_is_full(&mut self, now_ns: u64) {
        self.round.clear();
        self.pending = None;
        self.hold_until_ns = now_ns.saturating_add(FULL_BUS_PAUSE_NS);
    }

    /// Returns the frame to send now, and the result of a request without an answer.
    pub fn poll(&mut self, now_ns: u64, serves: bool) -> (Option<Frame>, Option<SdoReply>) {
        if self.listen {
            return (None, None);
        }
        let mut reply = None;
        if self.pending.as_ref().is_some_and(|pending| now_ns >= pending.until_ns)
            && let Some(pending) = self.pending.take()
        {
            self.follow_up = None;
            reply = match pending.job {
                Job::Write(request) => Some(SdoReply::Unanswered(request)),
                Job::Reason { request, code, text, .. } => {
                    Some(SdoReply::Refused(request, code, reason_in_words(&text)))
                }
                Job::Read => {
                    self.round.clear();
                    self.pace_ns = (2 * self.pace_ns).min(MAX_POLL_PERIOD_NS);
                    self.next_round_ns = now_ns + self.pace_ns;
                    None
                }
            };
        }
        let identifier = cob_id::SDO_REQUEST + u16::from(self.node.number());
        let frame = self.next(now_ns, serves).and_then(|data| Frame::new(identifier, &data));
        (frame, reply)
    }

    fn next(&mut self, now_ns: u64, serves: bool) -> Option<[u8; 8]> {
        if let Some(data) = self.follow_up.take() {
            return Some(data);
        }
        // A request does not wait for the answer to a poll.
        let reading = matches!(&self.pending, Some(Pending { job: Job::Read, .. }) | None);
        if reading && let Some(request) = self.requests.pop_front() {
            self.round.clear();
            let at = Address::new(index::STATE, StateObject::REQUEST);
            self.await_answer(at, Job::Write(request), now_ns);
            return Some(download_request(at, &[request as u8]));
        }
        if self.pending.is_some() || self.is_held(now_ns) || !serves {
            return None;
        }
        if self.round.is_empty() && now_ns >= self.next_round_ns {
            self.round.extend(POLLED_OBJECTS);
            self.next_round_ns = now_ns + self.pace_ns;
        }
        let at = self.round.pop_front()?;
        self.await_answer(at, Job::Read, now_ns);
        Some(encode_upload_request(at))
    }

    fn await_answer(&mut self, at: Address, job: Job, now_ns: u64) {
        self.pending = Some(Pending { at, until_ns: now_ns + ANSWER_TIMEOUT_NS, job });
    }

    /// Processes a frame on the bus that belongs to the joint's objects.
    pub fn receive(&mut self, frame: &Frame, now_ns: u64) -> Option<SdoReply> {
        let number = u16::from(self.node.number());
        if frame.identifier() == cob_id::SDO_REQUEST + number {
            let of_trace = matches!(Message::parse(frame), Ok(Message::Entry(..)));
            let hold_ns = if of_trace { TRACE_PAUSE_NS } else { OTHER_CLIENT_PAUSE_NS };
            self.hold_until_ns = self.hold_until_ns.max(now_ns + hold_ns);
            self.round.clear();
            return None;
        }
        if frame.identifier() != cob_id::SDO_ANSWER + number {
            return None;
        }
        let answer: [u8; 8] = frame.data().try_into().ok()?;
        if let Some(Pending { job: Job::Reason { toggle: Some(_), .. }, .. }) = &self.pending {
            return self.segment(&answer, now_ns);
        }
        let at = Address::new(u16::from_le_bytes([answer[1], answer[2]]), answer[3]);
        let ours = self.pending.take_if(|pending| pending.at == at);
        if ours.is_some() {
            self.pace_ns = POLL_PERIOD_NS;
        }
        match ours.map(|pending| pending.job) {
            Some(Job::Write(request)) => match decode_abort(&answer) {
                Ok((_, code)) => {
                    let at = Address::new(index::REFUSAL, 0);
                    let job = Job::Reason { request, code, text: Vec::new(), toggle: None };
                    self.await_answer(at, job, now_ns);
                    self.follow_up = Some(encode_upload_request(at));
                    None
                }
                Err(_) => {
                    // The result is read at once.
                    self.next_round_ns = now_ns;
                    Some(SdoReply::Done(request))
                }
            },
            Some(Job::Reason { request, code, .. }) => {
                if let Some(text) = expedited(&answer) {
                    return Some(SdoReply::Refused(request, code, reason_in_words(text)));
                }
                if decode_upload_initiate_segmented_response(&answer).is_err() {
                    return Some(SdoReply::Refused(request, code, String::new()));
                }
                let text = Vec::new();
                let job = Job::Reason { request, code, text, toggle: Some(false) };
                self.await_answer(at, job, now_ns);
                self.follow_up = Some(encode_upload_segment_request(false));
                None
            }
            // The answer may belong to another client.
            Some(Job::Read) | None => {
                let value = expedited(&answer).filter(|_| POLLED_OBJECTS.contains(&at))?;
                let mut word = [0; 4];
                word.iter_mut().zip(value).for_each(|(to, from)| *to = *from);
                Some(SdoReply::Value(at, u32::from_le_bytes(word)))
            }
        }
    }

    fn segment(&mut self, answer: &[u8; 8], now_ns: u64) -> Option<SdoReply> {
        let Pending { at, job, .. } = self.pending.take()?;
        let Job::Reason { request, code, mut text, toggle: Some(toggle) } = job else {
            return None;
        };
        match decode_data_segment(answer) {
            Ok(segment) if segment.toggle == toggle => {
                text.extend_from_slice(segment.data);
                if segment.last || text.len() > 1024 {
                    return Some(SdoReply::Refused(request, code, reason_in_words(&text)));
                }
                let job = Job::Reason { request, code, text, toggle: Some(!toggle) };
                self.await_answer(at, job, now_ns);
                self.follow_up = Some(encode_upload_segment_request(!toggle));
                None
            }
            _ => Some(SdoReply::Refused(request, code, reason_in_words(&text))),
        }
    }
}

#[cfg(test)]
mod tests;
