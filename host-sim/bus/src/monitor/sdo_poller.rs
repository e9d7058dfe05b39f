//! What the monitor asks a joint, without ever waiting for it.
//!
//! Twice a second the state, the faults and limits and what the watch over the model says are read, one
//! object after the other; a request (arm, disarm, clear faults) goes before all reading, and where it is
//! refused the joint's own words for it are fetched. Frames go in, frames come out, the time is passed in.
//!
//! An SDO server serves one client (CiA 301), and another program may be that client. So where a request
//! of somebody else is heard, nothing is read for a while; what the joint answers *them* is understood
//! as well. Who does not answer is asked ever less often, and a joint that is stopped not at all. A
//! monitor that only listens asks nothing, ever.

use canopen_rs::Address;
use canopen_rs::sdo::{
    decode_abort, decode_data_segment, decode_upload_initiate_segmented_response,
    encode_upload_request, encode_upload_segment_request,
};
use compensator_core::can::{Frame, Message, Node, cob_id};
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::NetworkState;
use std::collections::VecDeque;

/// Time between two rounds of reading, ns.
const ROUND_NS: u64 = 500_000_000;
/// Longest time between two, where nobody answers, ns.
const LONGEST_ROUND_NS: u64 = 16_000_000_000;
/// How long an answer is awaited, ns.
const ANSWER_NS: u64 = 300_000_000;
/// How long nothing is read where somebody else asks, ns; and where a trace says what it is.
const HOLD_NS: u64 = 1_000_000_000;
const TRACE_HOLD_NS: u64 = 20_000_000;
/// How long nothing is sent to a bus that takes nothing, ns.
const FULL_NS: u64 = 10_000_000_000;

/// What is read in a round.
pub const WATCHED: [Address; 12] = [
    Address::new(index::STATE, 2),
    Address::new(index::STATE, 3),
    Address::new(index::STATE, 4),
    Address::new(index::WATCH, 1),
    Address::new(index::WATCH, 2),
    Address::new(index::WATCH, 3),
    Address::new(index::WATCH, 5),
    Address::new(index::OPERATION, 1),
    Address::new(index::NETWORK, NetworkState::PRESENT),
    Address::new(index::NETWORK, NetworkState::OUTSIDE),
    Address::new(index::NETWORK, NetworkState::OUTSIDE_COUNT),
    Address::new(index::NETWORK, NetworkState::SHARE),
];

/// A request to a joint's state machine, with the number it has on the bus.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Request {
    /// Switch the bridge, or the compensation of a fed joint, off.
    Disarm = 0,
    /// Switch it on.
    Arm = 1,
    /// Forget the faults whose cause is gone.
    ClearFaults = 2,
}

impl Request {
    /// In words.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Disarm => "disarm",
            Self::Arm => "arm",
            Self::ClearFaults => "clear faults",
        }
    }
}

/// What came of asking.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SdoReply {
    /// An object has this value.
    Value(Address, u32),
    /// A request was taken.
    Done(Request),
    /// A request was refused: abort code of CiA 301, and the joint's own words, maybe none.
    Refused(Request, u32, String),
    /// A request was not answered.
    Unanswered(Request),
}

#[derive(Debug)]
enum Job {
    Read,
    Write(Request),
    /// Why it was refused: so much of the text has come, and how the next segment toggles.
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

/// Asks a joint.
#[derive(Debug)]
pub struct SdoPoller {
    node: Node,
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
    /// Asks this node, or only listens.
    pub fn new(node: Node, listen: bool) -> Self {
        Self {
            node,
            listen,
            round: VecDeque::new(),
            pending: None,
            requests: VecDeque::new(),
            follow_up: None,
            next_round_ns: 0,
            pace_ns: ROUND_NS,
            hold_until_ns: 0,
        }
    }

    /// Whether it asks nothing, ever.
    pub const fn only_listens(&self) -> bool {
        self.listen
    }

    /// Whether reading waits for another client.
    pub fn is_held(&self, now_ns: u64) -> bool {
        now_ns < self.hold_until_ns
    }

    /// Asks for this next; nothing where it only listens.
    pub fn request(&mut self, request: Request) {
        if self.listen {
            return;
        }
        // A joint that is to be disarmed is not armed first.
        if request == Request::Disarm {
            self.requests.clear();
        }
        self.requests.push_back(request);
    }

    /// The joint has shown up, or is in another state: it is asked soon.
    pub fn wake(&mut self, now_ns: u64) {
        self.pace_ns = ROUND_NS;
        self.next_round_ns = self.next_round_ns.min(now_ns);
    }

    /// The bus had no room for what was sent.
    pub fn bus_is_full(&mut self, now_ns: u64) {
        self.drop_round();
        self.pending = None;
        self.hold_until_ns = now_ns.saturating_add(FULL_NS);
    }

    fn drop_round(&mut self) {
        self.round.clear();
    }

    /// What is to be sent now; and what came of a request nobody answered.
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
                    Some(SdoReply::Refused(request, code, words(&text)))
                }
                Job::Read => {
                    self.drop_round();
                    self.pace_ns = (2 * self.pace_ns).min(LONGEST_ROUND_NS);
                    self.next_round_ns = now_ns + self.pace_ns;
                    None
                }
            };
        }
        let next = self.next(now_ns, serves);
        (
            next.and_then(|data| {
                Frame::new(cob_id::SDO_REQUEST + u16::from(self.node.number()), &data)
            }),
            reply,
        )
    }

    fn next(&mut self, now_ns: u64, serves: bool) -> Option<[u8; 8]> {
        if let Some(data) = self.follow_up.take() {
            return Some(data);
        }
        // A request does not wait for a value that is awaited.
        let reading = matches!(&self.pending, Some(Pending { job: Job::Read, .. }) | None);
        if reading && let Some(request) = self.requests.pop_front() {
            self.drop_round();
            let at = Address::new(index::STATE, 1);
            self.await_answer(at, Job::Write(request), now_ns);
            let [low, high] = at.index.to_le_bytes();
            // Expedited, one byte.
            return Some([0x2F, low, high, at.subindex, request as u8, 0, 0, 0]);
        }
        if self.pending.is_some() || self.is_held(now_ns) || !serves {
            return None;
        }
        if self.round.is_empty() && now_ns >= self.next_round_ns {
            self.round.extend(WATCHED);
            self.next_round_ns = now_ns + self.pace_ns;
        }
        let at = self.round.pop_front()?;
        self.await_answer(at, Job::Read, now_ns);
        Some(encode_upload_request(at))
    }

    fn await_answer(&mut self, at: Address, job: Job, now_ns: u64) {
        self.pending = Some(Pending { at, until_ns: now_ns + ANSWER_NS, job });
    }

    /// Takes in a frame that was on the bus, where it is of the joint's objects.
    pub fn take(&mut self, frame: &Frame, now_ns: u64) -> Option<SdoReply> {
        let number = u16::from(self.node.number());
        if frame.identifier() == cob_id::SDO_REQUEST + number {
            let of_trace = matches!(Message::parse(frame), Ok(Message::Entry(..)));
            let hold_ns = if of_trace { TRACE_HOLD_NS } else { HOLD_NS };
            self.hold_until_ns = self.hold_until_ns.max(now_ns + hold_ns);
            self.drop_round();
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
            self.pace_ns = ROUND_NS;
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
                    // What it led to is read at once.
                    self.next_round_ns = now_ns;
                    Some(SdoReply::Done(request))
                }
            },
            Some(Job::Reason { request, code, .. }) => {
                if let Some(text) = expedited(&answer) {
                    return Some(SdoReply::Refused(request, code, words(text)));
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
            // Whoever asked for it.
            Some(Job::Read) | None => {
                let value = expedited(&answer).filter(|_| WATCHED.contains(&at))?;
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
                    return Some(SdoReply::Refused(request, code, words(&text)));
                }
                let job = Job::Reason { request, code, text, toggle: Some(!toggle) };
                self.await_answer(at, job, now_ns);
                self.follow_up = Some(encode_upload_segment_request(!toggle));
                None
            }
            _ => Some(SdoReply::Refused(request, code, words(&text))),
        }
    }
}

/// The value in an answer that holds one, with or without its size.
fn expedited(answer: &[u8; 8]) -> Option<&[u8]> {
    if answer[0] & 0xE2 != 0x42 {
        return None;
    }
    let unused = if answer[0] & 1 != 0 { usize::from(answer[0] >> 2 & 3) } else { 0 };
    answer.get(4..8 - unused)
}

fn words(text: &[u8]) -> String {
    String::from_utf8_lossy(text).trim().to_owned()
}

#[cfg(test)]
mod tests;
