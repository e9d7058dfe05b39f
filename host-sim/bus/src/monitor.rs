//! A live view of a joint, for continuous display beside a test stand.
//!
//! ```text
//! bus ─ frames, times ─► [joint_view] ─► View ─► a view on a terminal, or a line of JSON a second
//!  ▲                          ▲
//!  └────── [sdo_poller] ──────┘   state, faults, residual watch: read twice a second from a joint that answers
//! ```
//!
//! [`joint_view`] and [`sdo_poller`] are pure: frames and times in, data out. This module connects them to a [`Bus`]. It
//! never waits for an answer, so a view stays responsive if the joint is silent. A closed bus is reopened as soon as it
//! is available. [`plain`] is a view on a terminal; the package `joint-monitor` has another, with charts and keys.

pub mod connection;
pub mod joint_view;
pub mod missing_frame;
pub mod plain;
pub mod quantity;
pub mod rates;
pub mod rows;
pub mod sdo_poller;
pub mod series;
#[cfg(test)]
mod test_joint;
pub mod view_data;

use crate::bus::{Bus, BusError};
use compensator_core::can::NodeId;
use joint_trace::CanFrame;
use joint_view::JointView;
use quantity::Quantity;
use sdo_poller::{Request, SdoPoller};
use std::io;
use view_data::{EventKind, Lens, View};

pub use connection::ReopenError;

/// Duration of receiving frames before keys are read, ns.
const RECEIVE_STEP_NS: u64 = 20_000_000;
/// Time between two lines of JSON, ns of bus time.
const JSON_PERIOD_NS: u64 = 1_000_000_000;

/// Error of a view; its message is one line.
#[derive(Debug, thiserror::Error)]
pub enum MonitorError {
    /// The bus failed.
    #[error(transparent)]
    Bus(#[from] BusError),
    /// A line was not written.
    #[error("standard output: {0}")]
    Output(#[source] io::Error),
    /// The terminal cannot be drawn on.
    #[error("terminal: {0}")]
    Terminal(#[source] io::Error),
}

/// A monitoring session of one joint.
pub struct Session {
    /// What the session has received.
    pub joint: JointView,
    sdo_poller: SdoPoller,
    start_ns: u64,
    /// Bus time at the last step, ns.
    now_ns: u64,
}

impl Session {
    /// Starts monitoring a node. With `listen`, the session sends nothing.
    pub fn new(node: NodeId, listen: bool, start_ns: u64) -> Self {
        let (joint, sdo_poller) = (JointView::new(node, start_ns), SdoPoller::new(node, listen));
        Self { joint, sdo_poller, start_ns, now_ns: start_ns }
    }

    /// Receives frames for 20 ms, and sends the pending requests.
    ///
    /// # Errors
    /// Returns an error if the bus is closed.
    pub fn step(&mut self, bus: &mut dyn Bus) -> Result<(), BusError> {
        let until_ns = bus.now_ns().saturating_add(RECEIVE_STEP_NS);
        loop {
            self.send_requests(bus)?;
            let received = bus.receive(until_ns)?;
            let now_ns = bus.now_ns();
            self.now_ns = now_ns;
            let waits = received.is_some();
            if let Some(received) = received {
                if self.joint.receive(&received) {
                    self.sdo_poller.wake(now_ns);
                }
                let frame = received.frame.to_joint();
                let reply = frame.and_then(|frame| self.sdo_poller.receive(&frame, now_ns));
                reply.into_iter().for_each(|reply| self.joint.on_reply(reply, now_ns));
            }
            // Ends even if frames arrive continuously.
            if now_ns >= until_ns {
                // Silence is checked only when no frame waits.
                if !waits {
                    self.joint.tick(now_ns);
                }
                return Ok(());
            }
        }
    }

    fn send_requests(&mut self, bus: &mut dyn Bus) -> Result<(), BusError> {
        let now_ns = bus.now_ns();
        let (frame, reply) = self.sdo_poller.poll(now_ns, self.joint.serves_objects());
        if let Some(reply) = reply {
            self.joint.on_reply(reply, now_ns);
        }
        let Some(frame) = frame.map(CanFrame::from) else { return Ok(()) };
        match bus.send(&frame) {
            Ok(()) => {
                self.joint.count(now_ns, &frame);
                Ok(())
            }
            // No node acknowledges. Receiving is still possible.
            Err(error @ BusError::Full { .. }) => {
                self.joint.log(now_ns, EventKind::Fault, error.to_string());
                self.sdo_poller.bus_is_full(now_ns);
                Ok(())
            }
            Err(error) => Err(error),
        }
    }

    /// Returns true if the session sends nothing.
    pub const fn only_listens(&self) -> bool {
        self.sdo_poller.only_listens()
    }

    /// Returns the joint as it is shown at the last step.
    pub fn view(&self, lens: &Lens) -> View {
        self.joint.view(self.now_ns, lens)
    }

    /// Sends a request of the user to the joint at the next step.
    pub fn request(&mut self, request: Request) {
        self.joint.log(self.now_ns, EventKind::Note, format!("{}: requested", request.name()));
        self.sdo_poller.request(request);
    }

    /// Returns the elapsed bus time, s.
    pub fn elapsed_s(&self) -> f64 {
        self.now_ns.saturating_sub(self.start_ns) as f64 * 1e-9
    }
}

/// Prints one line of JSON per second until `is_over` returns true or `print` returns false. The argument of `is_over` is
/// the elapsed bus time, s.
///
/// # Errors
/// Returns an error if the bus is closed, and the error of `print`.
pub fn run_lines(
    session: &mut Session,
    bus: &mut dyn Bus,
    name: &str,
    mut is_over: impl FnMut(f64) -> bool,
    mut print: impl FnMut(&str) -> io::Result<bool>,
) -> Result<(), MonitorError> {
    let mut due_ns = session.start_ns + JSON_PERIOD_NS;
    let mut events_printed = 0;
    while !is_over(session.elapsed_s()) {
        session.step(bus)?;
        if session.now_ns < due_ns {
            continue;
        }
        // After a pause of the process, the missed lines are not printed.
        due_ns = due_ns.max(session.now_ns.saturating_sub(JSON_PERIOD_NS)) + JSON_PERIOD_NS;
        let events = (session.joint.event_count - events_printed) as usize;
        events_printed = session.joint.event_count;
        let ranges: [_; Quantity::ALL.len()] = session.joint.take_line_ranges();
        let view = session.joint.view(session.now_ns, &Lens { window_s: 1.0, columns: 0, events });
        let line = view.json(name, &ranges).to_string() + "\n";
        if !print(&line).map_err(MonitorError::Output)? {
            break;
        }
    }
    Ok(())
}
