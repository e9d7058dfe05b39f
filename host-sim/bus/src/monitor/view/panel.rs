//! The panel with the state of the joint and its bus.

use super::{BAD, DIM, GOOD, Setting, WARN, age};
use crate::monitor::controls::Controls;
use crate::monitor::view_data::View;
use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::{Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

/// Width of the labels, in characters.
const LABEL_WIDTH: usize = 10;

/// Labelled lines.
struct Lines {
    lines: Vec<Line<'static>>,
    width: usize,
}

impl Lines {
    fn put(&mut self, label: &str, parts: Vec<Span<'static>>) {
        let mut spans = vec![Span::styled(format!("{label:<LABEL_WIDTH$}"), DIM)];
        spans.extend(parts);
        self.lines.push(Line::from(spans));
    }

    /// Appends names, wrapped over several lines.
    fn names(&mut self, label: &str, names: &[String], style: Style) {
        let room = self.width.saturating_sub(LABEL_WIDTH).max(8);
        let mut rows: Vec<String> = vec![String::new()];
        for (place, name) in names.iter().enumerate() {
            let comma = if place + 1 < names.len() { "," } else { "" };
            let last = rows.last().map_or(0, String::len);
            if last > 0 && last + 1 + name.len() + comma.len() > room {
                rows.push(String::new());
            }
            if let Some(row) = rows.last_mut() {
                let blank = if row.is_empty() { "" } else { " " };
                *row += &format!("{blank}{name}{comma}");
            }
        }
        for (place, row) in rows.into_iter().enumerate() {
            self.put(if place == 0 { label } else { "" }, vec![Span::styled(row, style)]);
        }
    }
}

/// Draws the panel.
pub fn draw(frame: &mut Frame, view: &View, controls: &Controls, setting: &Setting, area: Rect) {
    if area.is_empty() {
        return;
    }
    let mut lines = Lines { lines: Vec::new(), width: usize::from(area.width) };
    state(&mut lines, view, controls, setting);
    model(&mut lines, view);
    network(&mut lines, view);
    traffic(&mut lines, view);
    // Lines without room are counted.
    let room = usize::from(area.height);
    if lines.lines.len() > room && room > 0 {
        let more = lines.lines.len() - (room - 1);
        lines.lines.truncate(room - 1);
        lines.lines.push(Line::styled(format!("... {more} more lines: enlarge"), WARN));
    }
    frame.render_widget(Paragraph::new(lines.lines), area);
}

fn state(lines: &mut Lines, view: &View, controls: &Controls, setting: &Setting) {
    let bold = Style::new().add_modifier(Modifier::BOLD);
    let mut state = match view.state {
        None if controls.listen => vec![Span::styled("not read: listening", DIM)],
        None if setting.asks_later => vec![Span::styled("another client asks", DIM)],
        None => vec![Span::styled("not read yet", DIM)],
        Some(_) if view.objects_stale => vec![Span::styled(view.state.unwrap_or_default(), DIM)],
        Some("FAULT") => vec![Span::styled("FAULT", BAD.add_modifier(Modifier::REVERSED))],
        Some("armed") => vec![Span::styled("ARMED", GOOD.add_modifier(Modifier::BOLD))],
        Some(other) => vec![Span::styled(other, bold)],
    };
    if let (true, Some(age_s)) = (view.objects_stale, view.objects_age_s) {
        state.push(Span::styled(format!(" {} OLD", age(age_s)), WARN));
    } else if let Some(source) = view.source {
        state.push(Span::styled(format!(", inputs: {source}"), DIM));
    }
    lines.put("state", state);
    let known = view.codes.read || view.emergencies > 0;
    let old = view.objects_stale || view.silent;
    for (label, names, style) in
        [("faults", &view.codes.faults, BAD), ("limits", &view.codes.limits, WARN)]
    {
        let style = if old { DIM } else { style };
        match (names.is_empty(), known) {
            (true, false) => lines.put(label, vec![Span::styled("none reported", DIM)]),
            (true, true) => {
                lines.put(label, vec![Span::styled("none", if old { DIM } else { GOOD })]);
            }
            (false, _) => lines.names(label, names, style),
        }
    }
    if !view.codes.read && known {
        lines.put("", vec![Span::styled("(from emergencies)", DIM)]);
    }
    let nmt_style = match view.nmt {
        _ if view.silent || view.heartbeat.late => DIM,
        Some("operational") => GOOD,
        _ => WARN,
    };
    lines.put("network", vec![Span::styled(view.nmt.unwrap_or("no data yet"), nmt_style)]);
}

/// Returns the text of a compensator flag.
fn flag_text(name: &str) -> String {
    let spaced = |stem: &str| stem.replace('-', " ");
    match name {
        "disabled" => "compensator off".to_owned(),
        "reference-invalid" => "no reference velocity".to_owned(),
        "model-not-finite" => "model result not finite".to_owned(),
        "command-invalid" => "command not finite".to_owned(),
        _ => {
            let endings =
                [("-invalid", "not usable"), ("-stale", "too old"), ("-limited", "at its limit")];
            let found =
                endings.iter().find_map(|(end, words)| Some((name.strip_suffix(end)?, *words)));
            found.map_or_else(|| spaced(name), |(stem, words)| format!("{} {words}", spaced(stem)))
        }
    }
}

fn model(lines: &mut Lines, view: &View) {
    match &view.flags {
        None => lines.put("flags", vec![Span::styled("no data yet", DIM)]),
        Some((_, age_s, true)) => {
            lines.put("flags", vec![Span::styled(format!("{} OLD", age(*age_s)), WARN)]);
        }
        Some((names, ..)) if names.is_empty() => {
            lines.put("flags", vec![Span::styled("none", GOOD)]);
        }
        Some((names, ..)) => {
            let words: Vec<String> = names.iter().map(|name| flag_text(name)).collect();
            lines.names("flags", &words, WARN);
        }
    }
    let old = view.objects_stale;
    let parts = match &view.band {
        None => vec![Span::styled("not read", DIM)],
        Some(band) if band.windows == 0 => vec![Span::styled("no windows yet", DIM)],
        Some(band) => {
            let (word, style) = if band.in_band { ("in band", GOOD) } else { ("OUT OF BAND", BAD) };
            vec![Span::styled(word, if old { DIM } else { style })]
        }
    };
    lines.put("model", parts);
    if let Some(band) = view.band.filter(|band| band.windows > 0) {
        let text = format!("{} of {} windows out", band.windows_out, band.windows);
        lines.put("", vec![Span::styled(text, DIM)]);
        if let Some(largest) = band.largest_in_bands {
            lines.put("", vec![Span::styled(format!("largest mean {largest:.2} bands"), DIM)]);
        }
    }
}

/// Appends the state of the network, for a joint that has one.
fn network(lines: &mut Lines, view: &View) {
    let Some(network) = view.network else { return };
    let (word, style) = if network.outside { ("outside", WARN) } else { ("inside", GOOD) };
    let style = if view.objects_stale { DIM } else { style };
    let share = network.share.map_or("?".to_owned(), |share| format!("{:.0} %", 100.0 * share));
    let mut text = format!(", {share} applied");
    let count = format!(", {} x outside", network.outside_count);
    if LABEL_WIDTH + word.len() + text.len() + count.len() <= lines.width {
        text += &count;
    }
    // The label `network` is that of the CAN bus.
    lines.put("LSTM", vec![Span::styled(word, style), Span::styled(text, DIM)]);
}

fn traffic(lines: &mut Lines, view: &View) {
    let rates = &view.rates;
    match view.sync_age_s {
        None => lines.put("SYNC", vec![Span::styled("no data yet", DIM)]),
        Some(age_s) if age_s > 1.0 => {
            lines.put("SYNC", vec![Span::styled(format!("none for {}", age(age_s)), WARN)]);
        }
        Some(_) => {
            let mut parts = vec![Span::raw(format!("{:.0}/s", rates.samples))];
            let unanswered = rates.answers < 0.98 * rates.samples;
            let style = if unanswered { WARN } else { DIM };
            parts.push(Span::styled(format!(", answers {:.0}/s", rates.answers), style));
            lines.put("SYNC", parts);
        }
    }
    let counts = view.syncs;
    let errors = [(counts.lost, "lost"), (counts.duplicate, "twice"), (counts.late, "late")];
    let clean = errors.iter().all(|(count, _)| *count == 0);
    let texts = errors.map(|(count, what)| format!("{count} {what}"));
    lines.names("", &texts, if clean { DIM } else { WARN });
    let load = format!("{:.1} %", 100.0 * rates.load);
    let style = if rates.load > 0.8 { BAD } else { Style::new() };
    let frames = match view.bit_rate {
        1_000_000 => format!(", {:.0} frames/s", rates.frames),
        other => format!(" of {} kbit/s, {:.0} frames/s", other / 1000, rates.frames),
    };
    lines.put("bus load", vec![Span::styled(load, style), Span::styled(frames, DIM)]);
    if view.error_frames > 0 {
        let text = format!("{} since the start", view.error_frames);
        lines.put("errors", vec![Span::styled(text, BAD)]);
    }
    match (view.heartbeat.age_s, view.heartbeat.late) {
        (None, _) => lines.put("heartbeat", vec![Span::styled("no data yet", DIM)]),
        (Some(age_s), late) => {
            let style = if late { BAD } else { Style::new() };
            let mut parts = vec![Span::styled(format!("{} ago", age(age_s)), style)];
            if let Some(period_s) = view.heartbeat.period_s {
                parts.push(Span::styled(format!(", every {}", age(period_s)), DIM));
            }
            lines.put("heartbeat", parts);
        }
    }
}
