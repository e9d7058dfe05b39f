//! A live view of a joint, for continuous display beside a test stand.
//!
//! ```text
//! bus ─ frames, times ─► [joint_view] ─► View ─► [view] on a terminal, or a line of JSON a second
//!  ▲                          ▲
//!  └────── [sdo_poller] ──────┘   state, faults, residual watch: read twice a second from a joint that answers
//! ```
//!
//! [`joint_view`], [`sdo_poller`] and [`controls`] are pure: frames, keys and times in, data out. This module connects
//! them to a [`Bus`] and a terminal. It never waits for an answer, so the screen stays responsive if the joint is silent.
//! A closed bus is reopened as soon as it is available.

pub mod controls;
pub mod joint_view;
pub mod missing_frame;
pub mod quantity;
pub mod rates;
pub mod screen;
pub mod sdo_poller;
pub mod series;
pub mod view;
pub mod view_data;

use crate::bus::{Bus, BusError};
use compensator_core::can::NodeId;
use controls::{Action, Controls};
use joint_trace::CanFrame;
use joint_view::JointView;
use quantity::Quantity;
use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{self, Event as Input};
use screen::Keyboard;
use sdo_poller::SdoPoller;
use std::time::{Duration, Instant};
use view::Setting;
use view_data::{EventKind, Lens};

/// Duration of receiving frames before keys are read, ns.
const RECEIVE_STEP_NS: u64 = 20_000_000;
/// Time between two screen updates.
const REDRAW_PERIOD: Duration = Duration::from_millis(100);
/// Time between two lines of JSON, ns of bus time.
const JSON_PERIOD_NS: u64 = 1_000_000_000;
/// Time between two attempts to reopen a closed bus.
const REOPEN_PERIOD: Duration = Duration::from_secs(2);
/// Columns of a chart: two dots for each character of a wide terminal.
const CHART_COLUMNS: usize = 240;
/// Number of log lines that can be scrolled.
const MAX_LOG_LINES: usize = 500;

/// A monitoring session of one joint.
pub struct Session {
    joint: JointView,
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

    /// Sets the bit rate for the bus load, bit/s. The default is 1 Mbit/s.
    pub fn set_bit_rate(&mut self, bit_rate: u32) {
        self.joint.set_bit_rate(bit_rate);
    }

    /// Sets the name of the bus for the commands that have missing frames sent.
    pub fn set_bus(&mut self, name: &str) {
        self.joint.set_bus(name);
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
                let joints = received.frame.to_joint();
                if let Some(reply) =
                    joints.and_then(|frame| self.sdo_poller.receive(&frame, now_ns))
                {
                    self.joint.on_reply(reply, now_ns);
                }
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
                self.joint.sent(now_ns, &frame);
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

    fn elapsed_s(&self) -> f64 {
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
    mut print: impl FnMut(&str) -> Result<bool, String>,
) -> Result<(), String> {
    let mut due_ns = session.start_ns + JSON_PERIOD_NS;
    let mut events_printed = 0;
    while !is_over(session.elapsed_s()) {
        session.step(bus).map_err(|error| error.to_string())?;
        if session.now_ns < due_ns {
            continue;
        }
        // After a pause of the process, the missed lines are not printed.
        due_ns = due_ns.max(session.now_ns.saturating_sub(JSON_PERIOD_NS)) + JSON_PERIOD_NS;
        let events = (session.joint.event_count() - events_printed) as usize;
        events_printed = session.joint.event_count();
        let ranges: [_; Quantity::ALL.len()] = session.joint.take_line_ranges();
        let view = session.joint.view(session.now_ns, &Lens { window_s: 1.0, columns: 0, events });
        if !print(&(view.json(name, &ranges).to_string() + "\n"))? {
            break;
        }
    }
    Ok(())
}

/// Draws on a terminal until the key `q`, or until `is_over` returns true. The argument of `is_over` is the elapsed bus
/// time, s. `open` reopens a closed bus.
///
/// # Errors
/// Returns an error if the terminal cannot be drawn on.
pub fn run_screen(
    session: &mut Session,
    bus: Box<dyn Bus>,
    mut setting: Setting,
    terminal: &mut DefaultTerminal,
    mut open: impl FnMut() -> Result<Box<dyn Bus>, String>,
    mut is_over: impl FnMut(f64) -> bool,
) -> Result<(), String> {
    let mut controls = Controls::new(session.sdo_poller.only_listens());
    let mut connection = Connection::new(bus, session.now_ns);
    let mut drawn: Option<Instant> = None;
    let keyboard = Keyboard::open();
    while !is_over(session.elapsed_s()) {
        let wait = connection.step(session, &mut setting, &mut open);
        setting.asks_later = session.sdo_poller.is_held(session.now_ns);
        // Reading keys from a closed terminal would never return.
        if keyboard.has_gone_within(wait) {
            return Ok(());
        }
        let mut pressed = false;
        while event::poll(Duration::ZERO).map_err(|error| screen::failed(&error))? {
            pressed = true;
            let input = event::read().map_err(|error| screen::failed(&error))?;
            let Input::Key(key) = input else { continue };
            let action = controls.press(&key);
            if action == Some(Action::Quit) {
                return Ok(());
            }
            session.execute(action, &mut controls);
        }
        if pressed || drawn.is_none_or(|at| at.elapsed() >= REDRAW_PERIOD) {
            let view = session.joint.view(session.now_ns, &lens(&controls));
            controls.scroll = controls.scroll.min(view.events.len().saturating_sub(1));
            let draw = |frame: &mut ratatui::Frame| view::draw(frame, &view, &controls, &setting);
            if let Err(error) = terminal.draw(draw) {
                // The terminal was closed meanwhile.
                let is_closed = keyboard.has_gone_within(Duration::ZERO);
                return if is_closed { Ok(()) } else { Err(screen::failed(&error)) };
            }
            drawn = Some(Instant::now());
        }
    }
    Ok(())
}

/// The bus of a screen, which is reopened after it was closed.
struct Connection {
    bus: Option<Box<dyn Bus>>,
    /// Time of the last attempt to reopen the bus.
    tried: Instant,
    /// Time of the last step on the bus, on this PC's clock and in bus time, ns.
    last_step: (Instant, u64),
}

impl Connection {
    fn new(bus: Box<dyn Bus>, now_ns: u64) -> Self {
        let now = Instant::now();
        Self { bus: Some(bus), tried: now, last_step: (now, now_ns) }
    }

    /// Runs a step of the session on the bus, or tries to reopen the bus. Returns how long to wait for a key.
    fn step(
        &mut self,
        session: &mut Session,
        setting: &mut Setting,
        open: &mut impl FnMut() -> Result<Box<dyn Bus>, String>,
    ) -> Duration {
        let Some(bus) = &mut self.bus else {
            // Without a bus, this PC's clock advances the time, so that the values age.
            session.now_ns = self.last_step.1 + self.last_step.0.elapsed().as_nanos() as u64;
            session.joint.tick(session.now_ns);
            if self.tried.elapsed() >= REOPEN_PERIOD {
                self.reopen(session, setting, open);
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

    fn reopen(
        &mut self,
        session: &mut Session,
        setting: &mut Setting,
        open: &mut impl FnMut() -> Result<Box<dyn Bus>, String>,
    ) {
        match open() {
            Ok(opened) => {
                self.bus = Some(opened);
                setting.gone = None;
                session.joint.log(session.now_ns, EventKind::Good, "the bus is back");
                session.sdo_poller.wake(session.now_ns);
            }
            Err(why) => setting.gone = Some(why),
        }
        self.tried = Instant::now();
    }
}

impl Session {
    /// Executes the action of a key, except [`Action::Quit`].
    fn execute(&mut self, action: Option<Action>, controls: &mut Controls) {
        match action {
            Some(Action::Pause) => {
                controls.held = match controls.held.take() {
                    None => Some(self.joint.view(self.now_ns, &lens(controls))),
                    Some(_) => None,
                };
            }
            Some(Action::ResetRanges) => self.joint.reset_ranges(),
            Some(Action::Request(request)) => {
                self.joint.requested(request, self.now_ns);
                self.sdo_poller.request(request);
            }
            Some(Action::Quit | Action::Redraw) | None => {}
        }
    }
}

fn lens(controls: &Controls) -> Lens {
    Lens { window_s: controls.window_s(), columns: CHART_COLUMNS, events: MAX_LOG_LINES }
}
