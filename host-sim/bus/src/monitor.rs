//! A live view of a joint, for somebody who leaves it open beside the test stand.
//!
//! ```text
//! bus ─ frames, times ─► [joint_view] ─► View ─► [view] on a terminal, or a line of JSON a second
//!  ▲                          ▲
//!  └────── [sdo_poller] ──────┘   state, faults, watch: twice a second, and only of a joint that answers
//! ```
//!
//! [`joint_view`], [`sdo_poller`] and [`controls`] are pure: frames, keys and times in, data out. What is
//! here is the loop that ties them to a [`Bus`] and a terminal. It never waits for an answer: a joint that says
//! nothing leaves the screen alive, and a bus that goes is opened again when it is back.

pub mod controls;
pub mod joint_view;
pub mod rates;
pub mod screen;
pub mod sdo_poller;
pub mod series;
pub mod view;
pub mod view_data;

use crate::bus::{Bus, BusError};
use compensator_core::can::Node;
use controls::{Action, Controls};
use joint_trace::CanFrame;
use joint_view::JointView;
use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{self, Event as Input};
use screen::Keyboard;
use sdo_poller::SdoPoller;
use std::time::{Duration, Instant};
use view::Setting;
use view_data::{EventKind, Lens, Quantity};

/// How long frames are taken in before keys are looked at, ns.
const STEP_NS: u64 = 20_000_000;
/// Time between two pictures.
const PICTURE: Duration = Duration::from_millis(100);
/// Time between two lines of JSON, ns of the bus's clock.
const LINE_NS: u64 = 1_000_000_000;
/// Time between two tries to open a bus that has gone.
const TRY_AGAIN: Duration = Duration::from_secs(2);
/// Columns of a chart: two dots for each letter of a wide terminal.
const COLUMNS: usize = 240;
/// Lines of the log a screen can scroll through.
const LOG_LINES: usize = 500;

/// A joint that is watched.
pub struct Session {
    joint: JointView,
    sdo_poller: SdoPoller,
    start_ns: u64,
    /// The time the bus last had.
    now_ns: u64,
}

impl Session {
    /// Watches this node from this time on; asks it nothing where it is only to listen.
    pub fn new(node: Node, listen: bool, start_ns: u64) -> Self {
        let (joint, sdo_poller) = (JointView::new(node, start_ns), SdoPoller::new(node, listen));
        Self { joint, sdo_poller, start_ns, now_ns: start_ns }
    }

    /// The bit rate of the bus, bit/s, that its load is a share of; 1 Mbit/s unless it is given.
    pub fn set_bit_rate(&mut self, bit_rate: u32) {
        self.joint.set_bit_rate(bit_rate);
    }

    /// Takes in what comes within a moment, and asks what is to be asked.
    ///
    /// # Errors
    /// A bus that is gone.
    pub fn step(&mut self, bus: &mut dyn Bus) -> Result<(), BusError> {
        let until_ns = bus.now_ns().saturating_add(STEP_NS);
        loop {
            self.ask(bus)?;
            let received = bus.receive(until_ns)?;
            let now_ns = bus.now_ns();
            self.now_ns = now_ns;
            let waits = received.is_some();
            if let Some(received) = received {
                if self.joint.take(&received) {
                    self.sdo_poller.wake(now_ns);
                }
                let joints = received.frame.to_joint();
                if let Some(reply) = joints.and_then(|frame| self.sdo_poller.take(&frame, now_ns)) {
                    self.joint.on_reply(reply, now_ns);
                }
            }
            // Not for ever, where there is always another frame.
            if now_ns >= until_ns {
                // A joint is silent if nothing of it waits: not while there is more to be taken in.
                if !waits {
                    self.joint.tick(now_ns);
                }
                return Ok(());
            }
        }
    }

    fn ask(&mut self, bus: &mut dyn Bus) -> Result<(), BusError> {
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
            // Nobody acknowledges: to listen is still possible.
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

/// Prints a line of JSON a second until `is_over` (given the seconds that have passed on the bus) or
/// `print` says that it is over.
///
/// # Errors
/// A bus that is gone, and what `print` says.
pub fn run_lines(
    session: &mut Session,
    bus: &mut dyn Bus,
    name: &str,
    mut is_over: impl FnMut(f64) -> bool,
    mut print: impl FnMut(&str) -> Result<bool, String>,
) -> Result<(), String> {
    let mut due_ns = session.start_ns + LINE_NS;
    let mut events_printed = 0;
    while !is_over(session.elapsed_s()) {
        session.step(bus).map_err(|error| error.to_string())?;
        if session.now_ns < due_ns {
            continue;
        }
        // After a pause of the whole process, not one line for each second missed.
        due_ns = due_ns.max(session.now_ns.saturating_sub(LINE_NS)) + LINE_NS;
        let events = (session.joint.events_ever() - events_printed) as usize;
        events_printed = session.joint.events_ever();
        let ranges: [_; Quantity::ALL.len()] = session.joint.take_line_ranges();
        let view = session.joint.view(session.now_ns, &Lens { window_s: 1.0, columns: 0, events });
        if !print(&(view.json(name, &ranges).to_string() + "\n"))? {
            break;
        }
    }
    Ok(())
}

/// Draws on a terminal until `q`, or `is_over` (given the seconds that have passed) says so. `open` opens
/// the bus anew when it has gone.
///
/// # Errors
/// A terminal that cannot be drawn on.
pub fn run_screen(
    session: &mut Session,
    bus: Box<dyn Bus>,
    mut setting: Setting,
    terminal: &mut DefaultTerminal,
    mut open: impl FnMut() -> Result<Box<dyn Bus>, String>,
    mut is_over: impl FnMut(f64) -> bool,
) -> Result<(), String> {
    let mut controls = Controls::new(session.sdo_poller.only_listens());
    let mut bus = Some(bus);
    let mut tried = Instant::now();
    let mut drawn: Option<Instant> = None;
    let failed = |error: std::io::Error| screen::failed(&error);
    let mut begun = (Instant::now(), session.now_ns);
    let keyboard = Keyboard::open();
    while !is_over(session.elapsed_s()) {
        let mut wait = Duration::ZERO;
        match &mut bus {
            Some(open_bus) => match session.step(open_bus.as_mut()) {
                Ok(()) => begun = (Instant::now(), session.now_ns),
                Err(error) => {
                    let why = error.to_string();
                    session.joint.log(session.now_ns, EventKind::Fault, why.clone());
                    (setting.gone, bus, tried) = (Some(why), None, Instant::now());
                }
            },
            None => {
                wait = Duration::from_nanos(STEP_NS);
                // Time goes on without a bus, or what was last heard would never grow old.
                session.now_ns = begun.1 + begun.0.elapsed().as_nanos() as u64;
                session.joint.tick(session.now_ns);
                if tried.elapsed() >= TRY_AGAIN {
                    match open() {
                        Ok(opened) => {
                            bus = Some(opened);
                            setting.gone = None;
                            let text = "the bus is back";
                            session.joint.log(session.now_ns, EventKind::Good, text);
                            session.sdo_poller.wake(session.now_ns);
                        }
                        Err(why) => setting.gone = Some(why),
                    }
                    tried = Instant::now();
                }
            }
        }
        setting.asks_later = session.sdo_poller.is_held(session.now_ns);
        let mut pressed = false;
        // Who reads the keys would try for ever where there are none to come.
        if keyboard.has_gone_within(wait) {
            return Ok(());
        }
        while event::poll(Duration::ZERO).map_err(failed)? {
            pressed = true;
            let Input::Key(key) = event::read().map_err(failed)? else { continue };
            match controls.press(&key) {
                Some(Action::Quit) => return Ok(()),
                Some(Action::Pause) => {
                    let lens = lens(&controls);
                    let now_ns = session.now_ns;
                    controls.held = match controls.held.take() {
                        None => Some(session.joint.view(now_ns, &lens)),
                        Some(_) => None,
                    };
                }
                Some(Action::ForgetRanges) => session.joint.forget_ranges(),
                Some(Action::Request(request)) => {
                    session.joint.requested(request, session.now_ns);
                    session.sdo_poller.request(request);
                }
                Some(Action::Redraw) | None => {}
            }
        }
        if pressed || drawn.is_none_or(|at| at.elapsed() >= PICTURE) {
            let view = session.joint.view(session.now_ns, &lens(&controls));
            controls.scroll = controls.scroll.min(view.events.len().saturating_sub(1));
            let draw = |frame: &mut ratatui::Frame| view::draw(frame, &view, &controls, &setting);
            if let Err(error) = terminal.draw(draw) {
                // Gone between two looks.
                return if keyboard.has_gone_within(Duration::ZERO) {
                    Ok(())
                } else {
                    Err(failed(error))
                };
            }
            drawn = Some(Instant::now());
        }
    }
    Ok(())
}

fn lens(controls: &Controls) -> Lens {
    Lens { window_s: controls.window_s(), columns: COLUMNS, events: LOG_LINES }
}
