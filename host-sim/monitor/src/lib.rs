//! The paged view of a joint: charts, log and keys on the terminal's alternate screen.
//!
//! ```text
//! keyboard ─ keys ─► controls ─ actions ─► joint_bus::monitor::Session ─ View ─► view ─► terminal
//! ```
//!
//! [`joint_bus::monitor`] receives the frames and keeps the state of the joint. Its plain view needs no library for terminals;
//! this one draws with ratatui.

mod controls;
pub mod screen;
mod view;

#[cfg(test)]
#[path = "../../../tests/snapshot.rs"]
mod snapshot;
/// The joint of the tests of the plain view.
#[cfg(test)]
#[path = "../../bus/src/monitor/test_joint.rs"]
mod test_joint;

use controls::{Action, Controls};
use joint_bus::bus::Bus;
use joint_bus::monitor::connection::{Connection, Opened};
use joint_bus::monitor::rows::Setting;
use joint_bus::monitor::view_data::Lens;
use joint_bus::monitor::{MonitorError, Session};
#[cfg(test)]
use joint_bus::{
    bus,
    monitor::{joint_view, rows, view_data},
};
use ratatui::DefaultTerminal;
use ratatui::crossterm::event::{self, Event as Input};
use screen::Keyboard;
use std::time::{Duration, Instant};

/// Time between two screen updates.
const REDRAW_PERIOD: Duration = Duration::from_millis(100);
/// Columns of a chart: two dots for each character of a wide terminal.
const CHART_COLUMNS: usize = 240;
/// Number of log lines that can be scrolled.
const MAX_LOG_LINES: usize = 500;

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
    mut open: impl FnMut() -> Opened,
    mut is_over: impl FnMut(f64) -> bool,
) -> Result<(), MonitorError> {
    let mut controls = Controls::new(session.only_listens());
    let mut connection = Connection::new(bus, session);
    let mut drawn: Option<Instant> = None;
    let keyboard = Keyboard::open();
    while !is_over(session.elapsed_s()) {
        let wait = connection.step(session, &mut setting, &mut open);
        // Reading keys from a closed terminal would never return.
        if keyboard.has_gone_within(wait) {
            return Ok(());
        }
        let mut pressed = false;
        while event::poll(Duration::ZERO).map_err(MonitorError::Terminal)? {
            pressed = true;
            let input = event::read().map_err(MonitorError::Terminal)?;
            let Input::Key(key) = input else { continue };
            let action = controls.press(&key);
            if action == Some(Action::Quit) {
                return Ok(());
            }
            execute(session, action, &mut controls);
        }
        if pressed || drawn.is_none_or(|at| at.elapsed() >= REDRAW_PERIOD) {
            let view = session.view(&lens(&controls));
            controls.scroll = controls.scroll.min(view.events.len().saturating_sub(1));
            let draw = |frame: &mut ratatui::Frame| view::draw(frame, &view, &controls, &setting);
            if let Err(error) = terminal.draw(draw) {
                // The terminal was closed meanwhile.
                let is_closed = keyboard.has_gone_within(Duration::ZERO);
                return if is_closed { Ok(()) } else { Err(MonitorError::Terminal(error)) };
            }
            drawn = Some(Instant::now());
        }
    }
    Ok(())
}

/// Executes the action of a key, except [`Action::Quit`].
fn execute(session: &mut Session, action: Option<Action>, controls: &mut Controls) {
    match action {
        Some(Action::Pause) => {
            controls.held = match controls.held.take() {
                None => Some(session.view(&lens(controls))),
                Some(_) => None,
            };
        }
        Some(Action::ResetRanges) => session.joint.reset_ranges(),
        Some(Action::Request(request)) => session.request(request),
        Some(Action::Quit | Action::Redraw) | None => {}
    }
}

fn lens(controls: &Controls) -> Lens {
    Lens { window_s: controls.window_s(), columns: CHART_COLUMNS, events: MAX_LOG_LINES }
}
