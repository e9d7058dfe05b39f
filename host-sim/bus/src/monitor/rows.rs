//! The text of the monitor's views: rows of marked parts, which a view draws in its own way.
//!
//! Old values are dimmed and show their age everywhere, so that a silent joint does not look healthy.

use super::view_data::{Event, EventKind, Reading, View};
use crate::codes::ReportedState;

/// Settings of the screen.
#[derive(Clone, Debug, Default)]
pub struct Setting {
    /// Name of the bus.
    pub bus: String,
    /// True for a simulation in this process, whose time counts from its start. That of a real bus counts from the epoch.
    pub demo: bool,
    /// Reason for a closed bus; `None` if it is open.
    pub gone: Option<String>,
    /// True during a polling pause for another client.
    pub asks_later: bool,
}

/// Emphasis of a text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// None.
    Plain,
    /// A label, or an old value.
    Dim,
    /// A quantity's value, in the colour of its chart.
    Value,
    /// Important.
    Bold,
    /// As intended.
    Good,
    /// Armed.
    Armed,
    /// A limit, or something missing.
    Warning,
    /// A fault.
    Bad,
    /// A fault, inverted.
    Alarm,
    /// A note about the display itself.
    Banner,
}

/// A marked text.
#[derive(Clone, Debug)]
pub struct Part {
    /// The text.
    pub text: String,
    /// Its emphasis.
    pub mark: Mark,
}

/// A row of the display.
pub type Row = Vec<Part>;

/// Returns a marked text.
pub fn part(text: impl Into<String>, mark: Mark) -> Part {
    Part { text: text.into(), mark }
}

/// Returns the number of columns that a row takes.
pub fn width(row: &[Part]) -> usize {
    row.iter().map(|part| part.text.chars().count()).sum()
}

/// Returns at most `room` rows. The last one counts those that are left out.
pub fn limited(mut rows: Vec<Row>, room: usize) -> Vec<Row> {
    if rows.len() > room && room > 0 {
        let more = rows.len() - (room - 1);
        rows.truncate(room - 1);
        rows.push(vec![part(format!("... {more} more lines: enlarge"), Mark::Warning)]);
    }
    rows
}

/// Formats an age: `0.3 s`, `12 s`, `3 min`, `2 h`.
pub fn age(seconds: f64) -> String {
    match seconds {
        s if s < 9.95 => format!("{s:.1} s"),
        s if s < 120.0 => format!("{s:.0} s"),
        s if s < 7200.0 => format!("{:.0} min", s / 60.0),
        s => format!("{:.0} h", s / 3600.0),
    }
}

/// Formats a number with about four digits, in at most seven characters.
pub fn short(value: f32) -> String {
    match value.abs() {
        0.0 => "0.000".to_owned(),
        size if size < 5e-4 => format!("{value:.0e}"),
        size if size < 9.9995 => format!("{value:.3}"),
        size if size < 99.995 => format!("{value:.2}"),
        size if size < 9999.5 => format!("{value:.1}"),
        _ => format!("{value:.1e}"),
    }
}

/// Returns the row of the bus, the joint and its liveness.
pub fn header(view: &View, listen: bool, setting: &Setting, width: usize) -> Row {
    let mut row = vec![part(format!(" node {} on {} ", view.node, setting.bus), Mark::Bold)];
    row.push(match (&setting.gone, view.last_frame_age_s, view.silent) {
        (Some(_), ..) => part(" NO BUS ", Mark::Alarm),
        (None, None, _) => part(" no frame yet ", Mark::Banner),
        (None, Some(age_s), true) => part(format!(" SILENT for {} ", age(age_s)), Mark::Alarm),
        (None, Some(_), false) => part(" live ", Mark::Good),
    });
    if setting.demo {
        let long = " DEMO: a simulated joint in this process, no bus ";
        let text = if width >= 100 { long } else { " DEMO: simulated, no bus " };
        row.push(part(text, Mark::Banner));
    }
    if listen {
        row.push(part(" listening only ", Mark::Dim));
    }
    row
}

/// Formats the time of an event: time of day in UTC, or s from the start.
fn stamp(time_ns: u64, setting: &Setting) -> String {
    let seconds = time_ns / 1_000_000_000;
    let millis = time_ns / 1_000_000 % 1000;
    if setting.demo {
        return format!("{seconds:>5}.{millis:03}");
    }
    let of_day = seconds % 86_400;
    format!("{:02}:{:02}:{:02}.{millis:03}", of_day / 3600, of_day / 60 % 60, of_day % 60)
}

/// Returns the row of an event of the log.
pub fn event(event: &Event, setting: &Setting) -> Row {
    let mark = match event.kind {
        EventKind::Fault => Mark::Bad,
        EventKind::Warning => Mark::Warning,
        EventKind::Good => Mark::Good,
        EventKind::Note => Mark::Plain,
    };
    let time = part(format!(" {}  ", stamp(event.time_ns, setting)), Mark::Dim);
    vec![time, part(event.text.as_str(), mark)]
}

/// Returns the row of a quantity: name, value, unit, age if old, minimum and maximum.
pub fn reading(reading: &Reading, room: usize) -> Row {
    let is_old = reading.stale || reading.unmeasured;
    let mark = if is_old || reading.value.is_none() { Mark::Dim } else { Mark::Value };
    let name = format!("{:<8} ", reading.quantity.name());
    let value = reading.value.filter(|_| !reading.unmeasured).map_or("-".to_owned(), short);
    let mut row = vec![
        part(name, mark),
        part(format!("{value:>7} "), mark),
        part(format!("{:<5}", reading.unit), Mark::Dim),
    ];
    let used = width(&row);
    let missing = reading.missing.as_ref();
    let missing = missing.map(|frame| format!("no {} {:03X}h", frame.name, frame.identifier));
    if reading.unmeasured {
        row.push(part("  not measured", Mark::Dim));
    } else if let (None, Some(missing)) = (reading.value, &missing) {
        row.push(part(format!("  {missing}"), Mark::Warning));
    } else if reading.value.is_none() {
        row.push(part("  no value yet", Mark::Dim));
    } else if let (true, Some(age_s)) = (reading.stale, reading.age_s) {
        let old = format!("  {} OLD", age(age_s));
        let both = missing.map(|missing| format!("{old}: {missing}"));
        let both = both.filter(|both| used + both.len() <= room);
        row.push(part(both.unwrap_or(old), Mark::Warning));
    }
    if let Some([least, most]) = reading.range {
        let range = format!(" min {:>7} max {:>7}", short(least), short(most));
        let used = width(&row);
        if used + range.len() <= room {
            row.push(part(range, if is_old { Mark::Dim } else { Mark::Plain }));
        }
    }
    row
}

/// Width of the labels, in characters.
const LABEL_WIDTH: usize = 10;

/// Labelled rows.
struct Labelled {
    rows: Vec<Row>,
    width: usize,
}

impl Labelled {
    fn put(&mut self, label: &str, parts: Vec<Part>) {
        let mut row = vec![part(format!("{label:<LABEL_WIDTH$}"), Mark::Dim)];
        row.extend(parts);
        self.rows.push(row);
    }

    /// Appends names, wrapped over several rows.
    fn names(&mut self, label: &str, names: &[String], mark: Mark) {
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
            self.put(if place == 0 { label } else { "" }, vec![part(row, mark)]);
        }
    }
}

/// Returns the rows of the joint's state and traffic.
pub fn state_and_traffic(view: &View, listen: bool, setting: &Setting, width: usize) -> Vec<Row> {
    let mut rows = Labelled { rows: Vec::new(), width };
    state(&mut rows, view, listen, setting);
    model(&mut rows, view);
    learnt(&mut rows, view);
    network(&mut rows, view);
    traffic(&mut rows, view);
    rows.rows
}

fn state(rows: &mut Labelled, view: &View, listen: bool, setting: &Setting) {
    let mut state = match view.state {
        None if listen => vec![part("not read: listening", Mark::Dim)],
        None if setting.asks_later => vec![part("another client asks", Mark::Dim)],
        None => vec![part("not read yet", Mark::Dim)],
        Some(state) if view.objects_stale => vec![part(state.name(), Mark::Dim)],
        Some(ReportedState::Fault) => vec![part("FAULT", Mark::Alarm)],
        Some(ReportedState::Armed) => vec![part("ARMED", Mark::Armed)],
        Some(other) => vec![part(other.name(), Mark::Bold)],
    };
    if let (true, Some(age_s)) = (view.objects_stale, view.objects_age_s) {
        state.push(part(format!(" {} OLD", age(age_s)), Mark::Warning));
    } else if let Some(source) = view.source {
        state.push(part(format!(", inputs: {source}"), Mark::Dim));
    }
    if view.accepts_test_key == Some(true) {
        state.push(part(", test key", Mark::Warning));
    }
    rows.put("state", state);
    let known = view.codes.read || view.emergencies > 0;
    let old = view.objects_stale || view.silent;
    for (label, names, mark) in
        [("faults", &view.codes.faults, Mark::Bad), ("limits", &view.codes.limits, Mark::Warning)]
    {
        let mark = if old { Mark::Dim } else { mark };
        match (names.is_empty(), known) {
            (true, false) => rows.put(label, vec![part("none reported", Mark::Dim)]),
            (true, true) => {
                rows.put(label, vec![part("none", if old { Mark::Dim } else { Mark::Good })]);
            }
            (false, _) => rows.names(label, names, mark),
        }
    }
    if let Some(test) = &view.codes.failed_self_test {
        rows.put("self-test", vec![part(format!("failed: {test}"), Mark::Bad)]);
    }
    if !view.codes.read && known {
        rows.put("", vec![part("(from emergencies)", Mark::Dim)]);
    }
    let nmt_mark = match view.nmt {
        _ if view.silent || view.heartbeat.late => Mark::Dim,
        Some("operational") => Mark::Good,
        _ => Mark::Warning,
    };
    rows.put("network", vec![part(view.nmt.unwrap_or("no data yet"), nmt_mark)]);
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

fn model(rows: &mut Labelled, view: &View) {
    match &view.flags {
        None => rows.put("flags", vec![part("no data yet", Mark::Dim)]),
        Some(flags) if flags.is_stale => {
            rows.put("flags", vec![part(format!("{} OLD", age(flags.age_s)), Mark::Warning)]);
        }
        Some(flags) if flags.names.is_empty() => {
            rows.put("flags", vec![part("none", Mark::Good)]);
        }
        Some(flags) => {
            let words: Vec<String> = flags.names.iter().map(|name| flag_text(name)).collect();
            rows.names("flags", &words, Mark::Warning);
        }
    }
    let old = view.objects_stale;
    let parts = match &view.band {
        None => vec![part("not read", Mark::Dim)],
        Some(band) if band.windows == 0 => vec![part("no windows yet", Mark::Dim)],
        Some(band) => {
            let (word, mark) = match band.in_band {
                Some(true) => ("in band", Mark::Good),
                Some(false) => ("OUT OF BAND", Mark::Bad),
                None => ("not evaluated yet", Mark::Dim),
            };
            vec![part(word, if old { Mark::Dim } else { mark })]
        }
    };
    rows.put("model", parts);
    if let Some(band) = view.band.filter(|band| band.windows > 0) {
        let text = format!("{} of {} windows out", band.windows_out, band.windows);
        rows.put("", vec![part(text, Mark::Dim)]);
        if let Some(largest) = band.largest_in_bands {
            rows.put("", vec![part(format!("largest mean {largest:.2} bands"), Mark::Dim)]);
        }
    }
}

/// Appends the friction levels that the joint learns, if it learns any.
fn learnt(rows: &mut Labelled, view: &View) {
    let Some(learnt) = view.learnt else { return };
    let gain = |gain: Option<f32>| gain.map_or("?".to_owned(), |gain| format!("{gain:.2}"));
    let state = learnt.state.unwrap_or("unknown state");
    let mark = if view.objects_stale { Mark::Dim } else { Mark::Plain };
    let text = format!("level x{}, viscous x{}", gain(learnt.level), gain(learnt.viscous));
    rows.put("learnt", vec![part(text, mark)]);
    rows.put("", vec![part(state, Mark::Dim)]);
    if let Some(quantity) = learnt.follows {
        let text = format!("friction follows {quantity}: run tune");
        rows.put("", vec![part(text, Mark::Warning)]);
    }
}

/// Appends the state of the network, for a joint that has one.
fn network(rows: &mut Labelled, view: &View) {
    let Some(network) = view.network else { return };
    let (word, mark) =
        if network.outside { ("outside", Mark::Warning) } else { ("inside", Mark::Good) };
    let mark = if view.objects_stale { Mark::Dim } else { mark };
    let share = network.share.map_or("?".to_owned(), |share| format!("{:.0} %", 100.0 * share));
    let mut text = format!(", {share} applied");
    let count = format!(", {} x outside", network.outside_count);
    if LABEL_WIDTH + word.len() + text.len() + count.len() <= rows.width {
        text += &count;
    }
    // The label `network` is that of the CAN bus.
    rows.put("LSTM", vec![part(word, mark), part(text, Mark::Dim)]);
}

fn traffic(rows: &mut Labelled, view: &View) {
    let rates = &view.rates;
    match view.sync_age_s {
        None => rows.put("SYNC", vec![part("no data yet", Mark::Dim)]),
        Some(age_s) if age_s > 1.0 => {
            rows.put("SYNC", vec![part(format!("none for {}", age(age_s)), Mark::Warning)]);
        }
        Some(_) => {
            let mut parts = vec![part(format!("{:.0}/s", rates.samples), Mark::Plain)];
            let unanswered = rates.answers < 0.98 * rates.samples;
            let mark = if unanswered { Mark::Warning } else { Mark::Dim };
            parts.push(part(format!(", answers {:.0}/s", rates.answers), mark));
            rows.put("SYNC", parts);
        }
    }
    let counts = view.syncs;
    let errors = [(counts.lost, "lost"), (counts.duplicate, "twice"), (counts.late, "late")];
    let clean = errors.iter().all(|(count, _)| *count == 0);
    let texts = errors.map(|(count, what)| format!("{count} {what}"));
    rows.names("", &texts, if clean { Mark::Dim } else { Mark::Warning });
    let load = format!("{:.1} %", 100.0 * rates.load);
    let mark = if rates.load > 0.8 { Mark::Bad } else { Mark::Plain };
    let frames = match view.bit_rate {
        1_000_000 => format!(", {:.0} frames/s", rates.frames),
        other => format!(" of {} kbit/s, {:.0} frames/s", other / 1000, rates.frames),
    };
    rows.put("bus load", vec![part(load, mark), part(frames, Mark::Dim)]);
    if view.error_frames > 0 {
        let text = format!("{} since the start", view.error_frames);
        rows.put("errors", vec![part(text, Mark::Bad)]);
    }
    match (view.heartbeat.age_s, view.heartbeat.late) {
        (None, _) => rows.put("heartbeat", vec![part("no data yet", Mark::Dim)]),
        (Some(age_s), late) => {
            let mark = if late { Mark::Bad } else { Mark::Plain };
            let mut parts = vec![part(format!("{} ago", age(age_s)), mark)];
            if let Some(period_s) = view.heartbeat.period_s {
                parts.push(part(format!(", every {}", age(period_s)), Mark::Dim));
            }
            rows.put("heartbeat", parts);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_and_ages_fit_their_width() {
        for value in [0.0, -0.0, 1e-9, 4.9e-4, 9.9994, -9.9999, 99.999, -1234.5, 9999.6, -3e38f32] {
            assert!(short(value).len() <= 7, "{}", short(value));
        }
        assert_eq!(
            (age(0.04), age(9.97), age(300.0), age(9000.0)),
            ("0.0 s".into(), "10 s".into(), "5 min".into(), "2 h".into())
        );
    }
}
