//! Draws a [`View`] on a terminal of any size.
//!
//! ```text
//! bus, node, liveness                                     header
//! charts: name, value, unit, min, max | state, faults, limits, flags, model, traffic
//! log: emergencies, state changes, requests
//! keys                                                    footer
//! ```
//!
//! Old values are dimmed and show their age everywhere, so that a silent joint does not look healthy. On a small terminal,
//! charts are omitted first, then the log. State and values stay.

mod chart;

use super::controls::Controls;
use joint_bus::monitor::rows::{self, Mark, Row, Setting, age, part};
use joint_bus::monitor::view_data::View;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Clear, Paragraph, Wrap};

const DIM: Style = Style::new().fg(Color::DarkGray);
const BAD: Style = Style::new().fg(Color::Red).add_modifier(Modifier::BOLD);
const WARN: Style = Style::new().fg(Color::Yellow);
const GOOD: Style = Style::new().fg(Color::Green);
const BANNER: Style = Style::new().fg(Color::Black).bg(Color::Yellow);

/// Draws the complete screen.
pub fn draw(frame: &mut Frame, live: &View, controls: &Controls, setting: &Setting) {
    let area = frame.area();
    if area.is_empty() {
        return;
    }
    let view = controls.held.as_ref().unwrap_or(live);
    let log_height = match area.height {
        0..=17 => 0,
        height => (height / 5).clamp(4, 12),
    };
    let rows = [
        Constraint::Length(1),
        Constraint::Min(0),
        Constraint::Length(log_height),
        Constraint::Length(u16::from(area.height > 2)),
    ];
    let [top, middle, log, bottom] = Layout::vertical(rows).areas(area);
    frame.render_widget(header(live, controls, setting, top.width), top);
    let beside = if middle.width >= 70 { (middle.width * 3 / 8).clamp(33, 52) } else { 0 };
    if beside > 0 {
        let columns = [Constraint::Min(0), Constraint::Length(beside)];
        let [left, right] = Layout::horizontal(columns).spacing(1).areas(middle);
        chart::draw(frame, view, left);
        draw_state(frame, view, controls, setting, right);
    } else {
        // Stacked: values without charts, then as much of the state as fits.
        let values = middle.height.min(5);
        let [above, below] =
            Layout::vertical([Constraint::Length(values), Constraint::Min(0)]).areas(middle);
        chart::draw(frame, view, above);
        draw_state(frame, view, controls, setting, below);
    }
    draw_log(frame, view, controls, setting, log);
    frame.render_widget(footer(controls, setting, bottom.width), bottom);
    if controls.help {
        draw_help(frame, area);
    }
    if controls.confirm {
        draw_confirm(frame, area, live);
    }
}

/// Returns the style of a mark. Only the chart of a quantity knows the colour of its values.
fn style(mark: Mark) -> Style {
    match mark {
        Mark::Plain | Mark::Value => Style::new(),
        Mark::Dim => DIM,
        Mark::Bold => Style::new().add_modifier(Modifier::BOLD),
        Mark::Good => GOOD,
        Mark::Armed => GOOD.add_modifier(Modifier::BOLD),
        Mark::Warning => WARN,
        Mark::Bad => BAD,
        Mark::Alarm => BAD.add_modifier(Modifier::REVERSED),
        Mark::Banner => BANNER,
    }
}

/// Converts a row to a line of the terminal.
fn line(row: Row) -> Line<'static> {
    row.into_iter().map(|part| Span::styled(part.text, style(part.mark))).collect()
}

fn header(view: &View, controls: &Controls, setting: &Setting, width: u16) -> Paragraph<'static> {
    let mut row = rows::header(view, controls.listen, setting, usize::from(width));
    if let Some(held) = &controls.held {
        let since_s = view.elapsed_s - held.elapsed_s;
        row.insert(1, part(format!(" PAUSED {} ago ", age(since_s)), Mark::Banner));
    }
    let window = format!(" window {:.0} s, on for {}", controls.window_s(), age(view.elapsed_s));
    row.push(part(window, Mark::Dim));
    Paragraph::new(line(row))
}

/// Draws the state of the joint and its bus. Rows without room are counted.
fn draw_state(frame: &mut Frame, view: &View, controls: &Controls, setting: &Setting, area: Rect) {
    let rows = rows::state_and_traffic(view, controls.listen, setting, usize::from(area.width));
    let rows = rows::limited(rows, usize::from(area.height));
    frame.render_widget(Paragraph::new(rows.into_iter().map(line).collect::<Vec<_>>()), area);
}

fn footer(controls: &Controls, setting: &Setting, width: u16) -> Paragraph<'static> {
    if let Some(why) = &setting.gone {
        return Paragraph::new(Line::styled(format!(" {why}; trying again"), BAD));
    }
    if let Some(hint) = controls.hint {
        return Paragraph::new(Line::styled(format!(" {hint}"), WARN));
    }
    let (orders, reset) = match (controls.listen, width >= 90) {
        (true, _) => ("", "reset min/max"),
        (false, true) => ("  d disarm  a arm  c clear faults", "reset min/max"),
        (false, false) => ("  d disarm  a arm  c clear", "reset"),
    };
    let text = format!(" q quit  space pause  +/- window  r {reset}{orders}  ? help");
    Paragraph::new(Line::styled(text, DIM))
}

fn draw_log(frame: &mut Frame, view: &View, controls: &Controls, setting: &Setting, area: Rect) {
    if area.height == 0 {
        return;
    }
    let unit = if setting.demo { "s" } else { "UTC" };
    let back = controls.scroll.min(view.events.len().saturating_sub(1));
    let scrolled = if back > 0 { format!(", {back} lines back (End)") } else { String::new() };
    let count = view.emergencies;
    let plural = if count == 1 { "y" } else { "ies" };
    let title = format!("{count} emergenc{plural}; log, {unit}{scrolled}");
    let block = Block::new()
        .borders(ratatui::widgets::Borders::TOP)
        .border_style(DIM)
        .title(Line::from(format!(" {title} ")));
    let room = usize::from(area.height.saturating_sub(1));
    let end = view.events.len() - back;
    let shown = &view.events[end.saturating_sub(room)..end];
    let lines: Vec<Line> = if view.events.is_empty() {
        vec![Line::styled(" no events yet", DIM)]
    } else {
        shown.iter().map(|event| line(rows::event(event, setting))).collect()
    };
    frame.render_widget(Paragraph::new(lines).block(block), area);
}

/// Returns a centred area, limited to the available room.
fn middle(area: Rect, width: u16, height: u16) -> Rect {
    let (width, height) = (width.min(area.width), height.min(area.height));
    let (x, y) = (area.x + (area.width - width) / 2, area.y + (area.height - height) / 2);
    Rect { x, y, width, height }
}

const HELP: [&str; 11] = [
    "q, Ctrl-C     quit",
    "space         freeze the display; data is still recorded",
    "+ -           longer or shorter charts, 1 s to 10 min",
    "r             reset min and max",
    "d             disarm the joint, at once",
    "a             arm it, after confirmation",
    "c             clear faults whose cause is removed",
    "up, down, PgUp, PgDn, End   scroll the log",
    "",
    "Grey values are old; their age is shown. Min and max count from r.",
    "Bus load is for 1 Mbit/s, or --bit-rate. ? or Esc closes this.",
];

fn draw_help(frame: &mut Frame, area: Rect) {
    let place = middle(area, 68, HELP.len() as u16 + 2);
    let lines: Vec<Line> = HELP.iter().map(|line| Line::from(format!(" {line}"))).collect();
    frame.render_widget(Clear, place);
    frame.render_widget(Paragraph::new(lines).block(Block::bordered().title(" keys ")), place);
}

fn draw_confirm(frame: &mut Frame, area: Rect, view: &View) {
    let place = middle(area, 56, 5);
    let what = match view.source {
        Some("the bus") => "Its inputs come from the bus; it drives no motor.",
        Some(_) => "It drives a motor: keep clear of the joint.",
        None => "It may drive a motor: keep clear of the joint.",
    };
    let text = vec![
        Line::styled(format!(" Arm joint {}?", view.node), BAD),
        Line::from(format!(" {what}")),
        Line::from(" y arms it, any other key does not."),
    ];
    let block = Block::bordered().border_style(BAD);
    frame.render_widget(Clear, place);
    frame.render_widget(Paragraph::new(text).wrap(Wrap { trim: false }).block(block), place);
}

#[cfg(test)]
mod tests;
