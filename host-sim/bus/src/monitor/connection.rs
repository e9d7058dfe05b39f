//! The bus of a view on a terminal, which is reopened after it was closed.

use super::rows::Setting;
use super::view_data::EventKind;
use super::{RECEIVE_STEP_NS, Session};
use crate::bus::{Bus, BusError};
use std::time::{Duration, Instant};

/// Time between two attempts to reopen a closed bus.
const REOPEN_PERIOD: Duration = Duration::from_secs(2);

/// Reason why a closed bus is not opened again.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages describe the variants")]
pub enum ReopenError {
    #[error("the demo has ended; start monitor again")]
    DemoEnded,
    #[error("the bus was closed; the recording is kept; start monitor again")]
    RecordKept,
    #[error(transparent)]
    Bus(#[from] BusError),
}

/// The opened bus, or why it cannot be opened.
pub type Opened = Result<Box<dyn Bus>, ReopenError>;

/// The bus of a screen, which is reopened after it was closed.
pub struct Connection {
    bus: Option<Box<dyn Bus>>,
    /// Time of the last attempt to reopen the bus.
    tried: Instant,
    /// Time of the last step on the bus, on this PC's clock and in bus time, ns.
    last_step: (Instant, u64),
}

impl Connection {
    /// Connects the view of a session to its opened bus.
    pub fn new(bus: Box<dyn Bus>, session: &Session) -> Self {
        let now = Instant::now();
        Self { bus: Some(bus), tried: now, last_step: (now, session.now_ns) }
    }

    /// Runs a step of the session on the bus, or tries to reopen the bus. Returns how long to wait for a key.
    pub fn step(
        &mut self,
        session: &mut Session,
        setting: &mut Setting,
        open: &mut impl FnMut() -> Opened,
    ) -> Duration {
        setting.asks_later = session.sdo_poller.is_held(session.now_ns);
        let Some(bus) = &mut self.bus else {
            // Without a bus, this PC's clock advances the time, so that the values age.
            session.now_ns = self.last_step.1 + self.last_step.0.elapsed().as_nanos() as u64;
            session.joint.tick(session.now_ns);
            if self.tried.elapsed() >= REOPEN_PERIOD {
                self.tried = Instant::now();
                setting.gone = match open() {
                    Ok(opened) => {
                        self.bus = Some(opened);
                        session.joint.log(session.now_ns, EventKind::Good, "the bus is back");
                        session.sdo_poller.wake(session.now_ns);
                        None
                    }
                    Err(why) => Some(why.to_string()),
                };
            }
            return Duration::from_nanos(RECEIVE_STEP_NS);
        };
        match session.step(bus.as_mut()) {
            Ok(()) => self.last_step = (Instant::now(), session.now_ns),
            Err(error) => {
                let why = error.to_string();
                session.joint.log(session.now_ns, EventKind::Fault, why.clone());
                (setting.gone, self.bus, self.tried) = (Some(why), None, Instant::now());
            }
        }
        Duration::ZERO
    }
}
