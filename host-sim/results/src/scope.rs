//! Result files of `scope`: the captured signals as a table, a page with zoomable charts, and a summary.
//!
//! Signals with names of a log's columns have those names, so that the table is a log: `diagnose scope.parquet`.
//! Several captures are several runs, because nothing is known of the time between them.

use crate::files::pretty;
use crate::page::words::counted;
use crate::report::{Answers, Axis, Benefit, Block, Cell, Chart, Page, Series, Table};
use crate::table_file::{TableColumn, TableFile, TableFormat};
use crate::{Files, ResultError};
use joint_log::number::figure;
use serde::Serialize;
use serde_json::json;

/// File with the rows.
pub const ROWS_FILE: &str = "scope.parquet";

/// One capture.
#[derive(Clone, Debug, PartialEq)]
pub struct ScopeCapture {
    /// Values of each signal; all of the same length.
    pub columns: Vec<Vec<f64>>,
    /// Row of the trigger.
    pub trigger_row: usize,
}

/// Captures with the same settings.
#[derive(Clone, Debug, PartialEq)]
pub struct ScopeResult {
    /// Names of the signals, which end in their units: `current_a`.
    pub signals: Vec<String>,
    /// Time from one row to the next, s.
    pub period_s: f64,
    /// What triggered: `now`, `fault`, `velocity_rad_s>0.1`.
    pub trigger: String,
    /// The joint: bus and node.
    pub joint: String,
    /// The captures, at least one.
    pub captures: Vec<ScopeCapture>,
}

/// Statistics of a signal over all captures.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct SignalSummary {
    /// Name of the signal.
    pub signal: String,
    /// Smallest value.
    pub min: f64,
    /// Mean.
    pub mean: f64,
    /// Largest value.
    pub max: f64,
    /// Root mean square.
    pub rms: f64,
}

impl ScopeResult {
    fn rows(&self) -> usize {
        self.captures.iter().map(|capture| capture.columns.first().map_or(0, Vec::len)).sum()
    }

    /// Returns the statistics of each signal. Values that are not finite are left out.
    pub fn summary(&self) -> Vec<SignalSummary> {
        let of_signal = |(place, name): (usize, &String)| {
            let values = self.captures.iter().filter_map(|capture| capture.columns.get(place));
            let values: Vec<f64> = values.flatten().copied().filter(|v| v.is_finite()).collect();
            let mean = |of: &dyn Fn(f64) -> f64| {
                values.iter().map(|value| of(*value)).sum::<f64>() / values.len() as f64
            };
            SignalSummary {
                signal: name.clone(),
                min: values.iter().copied().fold(f64::NAN, f64::min),
                mean: mean(&|value| value),
                max: values.iter().copied().fold(f64::NAN, f64::max),
                rms: mean(&|value| value * value).sqrt(),
            }
        };
        self.signals.iter().enumerate().map(of_signal).collect()
    }

    /// Returns all files. The document has settings and statistics.
    ///
    /// # Errors
    /// One line, if a file cannot be written in its format.
    pub fn files(&self) -> Result<Files, ResultError> {
        let trigger_rows = self.captures.iter().map(|capture| capture.trigger_row);
        let document = json!({
            "schema": 1,
            "joint": self.joint,
            "trigger": self.trigger,
            "period_s": self.period_s,
            "captures": self.captures.len(),
            "rows": self.rows(),
            "trigger_rows": trigger_rows.collect::<Vec<_>>(),
            "signals": self.summary(),
        });
        let table = self.table().emit(TableFormat::Parquet)?;
        let page = self.page().render().into_bytes();
        Ok(Files {
            document: ("scope.json", pretty(&document)?),
            others: vec![(ROWS_FILE, table), ("scope.html", page)],
        })
    }

    fn times(&self, capture: &ScopeCapture) -> Vec<f64> {
        let rows = capture.columns.first().map_or(0, Vec::len);
        (0..rows).map(|row| (row as f64 - capture.trigger_row as f64) * self.period_s).collect()
    }

    fn table(&self) -> TableFile {
        let mut table = TableFile::new(self.rows());
        if self.captures.len() > 1 {
            let runs = self.captures.iter().enumerate();
            let runs =
                runs.flat_map(|(at, capture)| vec![at as f64 + 1.0; self.times(capture).len()]);
            table.push("run", TableColumn::Numbers(runs.collect()));
        }
        let times = self.captures.iter().flat_map(|capture| self.times(capture));
        table.push("time_s", TableColumn::Numbers(times.collect()));
        for (place, name) in self.signals.iter().enumerate() {
            let values = self.captures.iter().filter_map(|capture| capture.columns.get(place));
            table.push(name, TableColumn::Numbers(values.flatten().copied().collect()));
        }
        table
    }

    /// Returns one line: the joint, the captures, their rows and rate, and the trigger. The rate is the one that was used,
    /// because only whole multiples of the loop's period exist.
    pub fn headline(&self) -> String {
        let rate = format!("{:.0}", 1.0 / self.period_s);
        let rows = self.captures.first().map_or(0, |first| self.times(first).len());
        format!(
            "{}: {} of {rows} rows at {rate} Hz, trigger: {}",
            self.joint,
            counted(self.captures.len(), "capture"),
            self.trigger
        )
    }

    fn page(&self) -> Page {
        let mut page = Page::new("Scope of the current loop", self.headline());
        page.push(Block::Paragraph("Time counts from the trigger.".to_owned()));
        let mut units: Vec<&str> = Vec::new();
        for unit in self.signals.iter().map(|name| unit(name)) {
            if !units.contains(&unit) {
                units.push(unit);
            }
        }
        page.add(units.iter().map(|unit| self.chart(unit).into()));
        page.push(Block::Table(self.statistics()));
        page.answering(self.answers())
    }

    fn answers(&self) -> Answers {
        Answers {
            what: format!(
                "{} of the joint's current loop, row by row around the trigger.",
                counted(self.signals.len(), "signal")
            ),
            certainty: format!(
                "Each row is one value of the loop, {:.3} ms after the row before it.",
                1e3 * self.period_s
            ),
            benefit: Benefit::Purpose(
                "It shows what happens between two rows of a log: noise, ripple, saturation, and what led to a fault."
                    .into(),
            ),
            next: "Drag in a chart to zoom. With velocity and torque, diagnose the rows: `host-sim diagnose scope.parquet`"
                .into(),
        }
    }

    /// Returns the chart of all signals with a unit.
    fn chart(&self, of: &str) -> Chart {
        let names = self.signals.iter().enumerate().filter(|(_, name)| unit(name) == of);
        let names: Vec<(usize, &String)> = names.collect();
        let mut series = Vec::new();
        for (number, capture) in self.captures.iter().enumerate() {
            let times: Vec<f64> = self.times(capture).iter().map(|time| 1e3 * time).collect();
            for (place, name) in &names {
                let Some(values) = capture.columns.get(*place) else { continue };
                let label = match self.captures.len() {
                    1 => (*name).clone(),
                    _ => format!("{name}, capture {}", number + 1),
                };
                series.push(Series::line(label, times.clone(), values.clone()));
            }
        }
        let title: Vec<&str> = names.iter().map(|(_, name)| name.as_str()).collect();
        Chart {
            title: title.join(", "),
            caption: format!("{} over the time from the trigger.", title.join(", ")),
            x: Axis::new("time from the trigger (ms)"),
            y: Axis::new(format!("value ({})", unit_in_words(of))),
            series,
        }
    }

    fn statistics(&self) -> Table {
        let rows = self.summary().into_iter().map(|of| {
            let mut row = vec![Cell::from(of.signal.clone())];
            row.extend([of.min, of.mean, of.max, of.rms].map(|value| Cell::from(figure(value))));
            row
        });
        Table::new("Statistics of the signals over all captures", "signal|min|mean|max|RMS", rows)
    }
}

/// Returns the unit at the end of a signal's name.
fn unit(name: &str) -> &str {
    ["rad_s", "rad", "nm", "a", "v"]
        .into_iter()
        .find(|unit| name.strip_suffix(unit).is_some_and(|rest| rest.ends_with('_')))
        .unwrap_or("")
}

fn unit_in_words(unit: &str) -> &str {
    match unit {
        "rad_s" => "rad/s",
        "nm" => "Nm",
        "a" => "A",
        "v" => "V",
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn result(captures: usize) -> ScopeResult {
        let capture = ScopeCapture {
            columns: vec![vec![1.0, -1.0, 3.0], vec![0.5, f64::NAN, 0.5]],
            trigger_row: 1,
        };
        ScopeResult {
            signals: vec!["current_a".to_owned(), "velocity_rad_s".to_owned()],
            period_s: 5e-5,
            trigger: "now".to_owned(),
            joint: "loop, node 1".to_owned(),
            captures: vec![capture; captures],
        }
    }

    #[test]
    fn table_counts_time_from_the_trigger_and_numbers_captures() {
        let csv = |captures| {
            let bytes = result(captures).table().emit(TableFormat::Csv).expect("numbers");
            String::from_utf8(bytes).expect("text")
        };
        assert_eq!(
            csv(1),
            "time_s,current_a,velocity_rad_s\n-5e-5,1.0,0.5\n0.0,-1.0,\n5e-5,3.0,0.5\n"
        );
        assert!(csv(2).starts_with("run,time_s,current_a,velocity_rad_s\n1.0,-5e-5,1.0,0.5\n"));
        assert!(csv(2).ends_with("2.0,5e-5,3.0,0.5\n"));
    }

    #[test]
    fn summary_leaves_out_what_is_not_measured() {
        let [current, velocity] = result(1).summary().try_into().expect("two signals");
        assert_eq!((current.min, current.max, current.mean), (-1.0, 3.0, 1.0));
        assert!((current.rms - (11.0f64 / 3.0).sqrt()).abs() < 1e-12);
        assert_eq!((velocity.mean, velocity.rms), (0.5, 0.5));
    }

    #[test]
    fn page_has_a_chart_for_each_unit() {
        let page = result(2).page();
        let charts: Vec<&str> = page
            .blocks
            .iter()
            .filter_map(|block| {
                if let Block::Chart(chart) = block { Some(chart.y.label.as_str()) } else { None }
            })
            .collect();
        assert_eq!(charts, ["value (A)", "value (rad/s)"]);
        let files = result(1).files().expect("files");
        assert_eq!(files.others.len(), 2);
    }
}
