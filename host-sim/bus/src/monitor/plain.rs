//! The plain view: one screen of text, redrawn in place without a library for terminals.

use super::connection::{Connection, Opened};
use super::rows::{self, Mark, Row, Setting, part};
use super::view_data::{Lens, View};
use super::{MonitorError, Session};
use crate::bus::Bus;
use std::io::{ErrorKind, Write};
use std::time::{Duration, Instant};

/// Time between two screen updates.
const REDRAW_PERIOD: Duration = Duration::from_millis(250);
/// Number of the latest events of the log.
const LOG_LINES: usize = 5;

/// A terminal without a keyboard: its size, and whether it shows colours.
#[derive(Clone, Copy, Debug)]
pub struct Terminal {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// True if marks are shown as colours.
    pub colour: bool,
}

/// Draws a session on a terminal until `is_over` returns true. The argument of `is_over` is the elapsed bus time, s. `open`
/// reopens a closed bus. A closed terminal ends the view.
///
/// # Errors
/// Returns an error if the terminal cannot be written to.
pub fn run_plain(
    session: &mut Session,
    bus: Box<dyn Bus>,
    mut setting: Setting,
    out: &mut impl Write,
    terminal: impl Fn() -> Terminal,
    mut open: impl FnMut() -> Opened,
    mut is_over: impl FnMut(f64) -> bool,
) -> Result<(), MonitorError> {
    let listen = session.only_listens();
    let mut connection = Connection::new(bus, session);
    let mut drawn: Option<(Instant, usize)> = None;
    while !is_over(session.elapsed_s()) {
        std::thread::sleep(connection.step(session, &mut setting, &mut open));
        let rows_above = drawn.map_or(0, |(_, rows)| rows);
        if drawn.is_none_or(|(at, _)| at.elapsed() >= REDRAW_PERIOD) {
            let terminal = terminal();
            let lens = Lens { window_s: 1.0, columns: 0, events: LOG_LINES };
            let view = session.view(&lens);
            let rows = screen(&view, listen, &setting, &terminal);
            let text = text(&rows, rows_above, &terminal);
            match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
                Ok(()) => {}
                Err(error) if is_closed(&error) => return Ok(()),
                Err(error) => return Err(MonitorError::Terminal(error)),
            }
            drawn = Some((Instant::now(), rows.len()));
        }
    }
    Ok(())
}

/// Returns true if a write failed because the terminal was closed.
fn is_closed(error: &std::io::Error) -> bool {
    let closed = rustix::io::Errno::IO.raw_os_error();
    error.kind() == ErrorKind::BrokenPipe || error.raw_os_error() == Some(closed)
}

/// Returns the rows of the screen: bus and joint, values, state and traffic, the latest events, and the keys. Without room,
/// the events are left out first.
fn screen(view: &View, listen: bool, setting: &Setting, terminal: &Terminal) -> Vec<Row> {
    let width = terminal.width;
    let mut header = rows::header(view, listen, setting, width);
    header.push(part(format!(" on for {}", rows::age(view.elapsed_s)), Mark::Dim));
    let mut rows = vec![header];
    for reading in &view.readings {
        rows.push(rows::reading(reading, width));
        if let (None, Some(missing)) = (reading.value, &reading.missing) {
            rows.push(vec![part(format!("          {}", missing.command), Mark::Dim)]);
        }
    }
    rows.extend(rows::state_and_traffic(view, listen, setting, width));
    // The last row of the terminal is the cursor's.
    let room = terminal.height.saturating_sub(2).max(1);
    let mut rows = rows::limited(rows, room);
    let events = view.events.len().min(room - rows.len());
    rows.extend(
        view.events[view.events.len() - events..].iter().map(|event| rows::event(event, setting)),
    );
    rows.push(vec![match &setting.gone {
        Some(why) => part(format!(" {why}; trying again"), Mark::Bad),
        None => part(" Ctrl-C ends", Mark::Dim),
    }]);
    rows
}

/// Returns the text that draws the rows over the `above` rows drawn before.
fn text(rows: &[Row], above: usize, terminal: &Terminal) -> String {
    let mut text = if above > 0 { format!("\r\x1b[{above}A") } else { String::new() };
    for row in rows {
        let mut room = terminal.width;
        for part in row {
            let shown: String = part.text.chars().take(room).collect();
            room -= shown.chars().count();
            match code(part.mark).filter(|_| terminal.colour) {
                Some(code) => text += &format!("\x1b[{code}m{shown}\x1b[0m"),
                None => text += &shown,
            }
        }
        text += "\x1b[K\n";
    }
    text + "\x1b[J"
}

/// Returns the codes of a mark (ECMA-48, SGR).
fn code(mark: Mark) -> Option<&'static str> {
    Some(match mark {
        Mark::Plain => return None,
        Mark::Dim => "90",
        Mark::Value | Mark::Bold => "1",
        Mark::Good => "32",
        Mark::Armed => "1;32",
        Mark::Warning => "33",
        Mark::Bad => "1;31",
        Mark::Alarm => "1;7;31",
        Mark::Banner => "30;43",
    })
}

#[cfg(test)]
mod tests;
