//! Rolling charts: one line of numbers each, and a chart below it if there is room.

use super::{DIM, style};
use joint_bus::monitor::quantity::Quantity;
use joint_bus::monitor::rows::{self, Mark, short};
use joint_bus::monitor::view_data::{Reading, View};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::canvas::{Canvas, Line as Stroke, Points};
use ratatui::widgets::{Paragraph, Wrap};

/// Width of the axis labels, in characters.
const AXIS_WIDTH: u16 = 8;

fn color(quantity: Quantity) -> Color {
    match quantity {
        Quantity::Velocity => Color::Cyan,
        Quantity::Friction => Color::LightBlue,
        Quantity::FeedForward => Color::Magenta,
        Quantity::Current => Color::Green,
        Quantity::Residual => Color::Yellow,
    }
}

/// Draws all charts, stacked, as high as they fit.
pub fn draw(frame: &mut Frame, view: &View, area: Rect) {
    let count = view.readings.len() as u16;
    // With charts of at least two rows, there is room for a time axis.
    let has_axis = area.height > 3 * count && area.width > AXIS_WIDTH + 24;
    let [area, axis] =
        Layout::vertical([Constraint::Min(0), Constraint::Length(u16::from(has_axis))]).areas(area);
    time_axis(frame, view.window_s, axis);
    let (each, rest) = (area.height / count, area.height % count);
    let heights = (0..count).map(|place| Constraint::Length(each + u16::from(place < rest)));
    let places = Layout::vertical(heights).split(area);
    for (reading, place) in view.readings.iter().zip(places.iter()) {
        if place.height == 0 {
            continue;
        }
        let [head, body] =
            Layout::vertical([Constraint::Length(1), Constraint::Min(0)]).areas(*place);
        frame.render_widget(Paragraph::new(heading(reading, head.width)), head);
        draw_curve(frame, reading, body);
    }
}

/// Draws the time axis: both ends and the middle.
fn time_axis(frame: &mut Frame, window_s: f64, area: Rect) {
    let room = usize::from(area.width.saturating_sub(AXIS_WIDTH));
    let ago = |seconds: f64| match seconds {
        s if s >= 120.0 => format!("{} min", s / 60.0),
        s => format!("{s} s"),
    };
    let (first, half) = (format!("-{}", ago(window_s)), format!("-{}", ago(0.5 * window_s)));
    let left = (room / 2).saturating_sub(first.len() + half.len() / 2);
    let right = room.saturating_sub(first.len() + left + half.len());
    let axis = usize::from(AXIS_WIDTH);
    let line = format!("{:axis$}{first}{:left$}{half}{:>right$}", "", "", "now");
    frame.render_widget(Paragraph::new(Line::styled(line, DIM)), area);
}

/// Returns the numbers of a quantity, its value in the colour of its curve.
fn heading(reading: &Reading, width: u16) -> Line<'static> {
    let strong = Style::new().fg(color(reading.quantity)).add_modifier(Modifier::BOLD);
    let row = rows::reading(reading, usize::from(width)).into_iter();
    row.map(|part| match part.mark {
        Mark::Value => Span::styled(part.text, strong),
        mark => Span::styled(part.text, style(mark)),
    })
    .collect()
}

/// Returns the limits of a chart: round numbers that are never equal.
fn bounds(reading: &Reading) -> Option<[f64; 2]> {
    let shown = reading.columns.iter().flatten();
    let (least, most) = shown.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), column| {
        (least.min(f64::from(column[0])), most.max(f64::from(column[1])))
    });
    if least > most {
        return None;
    }
    let size = least.abs().max(most.abs());
    let span = (most - least).max(0.02 * size).max(1e-3);
    // Steps of 1, 2 or 5, so that small changes of the range keep the scale.
    let power = 10f64.powf((span / 4.0).log10().floor());
    let tick = [1.0, 2.0, 5.0, 10.0].map(|of| of * power);
    let tick = tick.into_iter().find(|tick| *tick >= span / 4.0).unwrap_or(span);
    let (low, high) = ((least / tick).floor() * tick, (most / tick).ceil() * tick);
    if high > low { Some([low, high]) } else { Some([low - tick, high + tick]) }
}

/// Draws the chart of a quantity. Older values are on the left; periods without values are empty.
fn draw_curve(frame: &mut Frame, reading: &Reading, area: Rect) {
    if area.height == 0 || area.width <= AXIS_WIDTH + 4 {
        return;
    }
    let Some([low, high]) = bounds(reading) else {
        if let Some(missing) = &reading.missing {
            let text = Line::styled(format!(" {}", missing.command), DIM);
            frame.render_widget(Paragraph::new(text).wrap(Wrap { trim: true }), area);
        }
        return;
    };
    let [axis, body] =
        Layout::horizontal([Constraint::Length(AXIS_WIDTH), Constraint::Min(0)]).areas(area);
    let top = Line::styled(format!("{:>7}", short(high as f32)), DIM);
    frame.render_widget(Paragraph::new(top), Rect { height: 1, ..axis });
    if axis.height > 1 {
        let place = Rect { y: axis.bottom() - 1, height: 1, ..axis };
        let bottom = Line::styled(format!("{:>7}", short(low as f32)), DIM);
        frame.render_widget(Paragraph::new(bottom), place);
    }
    let last = reading.columns.len().saturating_sub(1) as f64;
    let ink = if reading.stale { Color::DarkGray } else { color(reading.quantity) };
    let strokes = strokes(reading);
    let zero: Vec<(f64, f64)> = if low < 0.0 && 0.0 < high {
        (0..reading.columns.len()).step_by(8).map(|x| (x as f64, 0.0)).collect()
    } else {
        Vec::new()
    };
    let canvas = Canvas::default()
        .marker(Marker::Braille)
        .x_bounds([0.0, last.max(1.0)])
        .y_bounds([low, high])
        .paint(|context| {
            context.draw(&Points { coords: &zero, color: Color::DarkGray });
            context.layer();
            for [x1, y1, x2, y2] in &strokes {
                context.draw(&Stroke { x1: *x1, y1: *y1, x2: *x2, y2: *y2, color: ink });
            }
        });
    frame.render_widget(canvas, body);
}

/// Returns the lines of a chart: from minimum to maximum of each column, and to the previous column unless there is a gap.
fn strokes(reading: &Reading) -> Vec<[f64; 4]> {
    let mut strokes = Vec::with_capacity(2 * reading.columns.len());
    let mut before: Option<(usize, f64)> = None;
    let filled = reading.columns.iter().enumerate();
    for (at, [least, most]) in filled.filter_map(|(at, column)| Some((at, (*column)?))) {
        let (x, low, high) = (at as f64, f64::from(least), f64::from(most));
        strokes.push([x, low, x, high]);
        if let Some((earlier, y)) = before.filter(|(earlier, _)| at - earlier <= reading.bridged) {
            // To the nearest point of this column.
            strokes.push([earlier as f64, y, x, y.clamp(low, high)]);
        }
        before = Some((at, (low + high) / 2.0));
    }
    strokes
}
