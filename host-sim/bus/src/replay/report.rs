//! The report of a replay: `replay.json` and a text of a few lines.

use super::Tally;
use super::plan::Plan;
use super::play::PlayResult;
use crate::bus::BitRates;
use serde::Serialize;
use std::fmt::Write;

/// Quantiles of times, us.
#[derive(Clone, Copy, Debug, Default, Serialize, PartialEq)]
pub struct Quantiles {
    /// Median.
    pub p50: f64,
    /// 99 % quantile.
    pub p99: f64,
    /// 99.9 % quantile.
    pub p999: f64,
    /// Maximum.
    pub max: f64,
}

impl Quantiles {
    /// Computes the quantiles of times in ns. Returns `None` for an empty slice.
    pub fn of(times_ns: &[u64]) -> Option<Self> {
        let mut sorted = times_ns.to_vec();
        sorted.sort_unstable();
        let last = sorted.len().checked_sub(1)?;
        // The smallest value that is not exceeded by at least this share of the values.
        let at = |share: f64| {
            let rank = (share * sorted.len() as f64).ceil() as usize;
            sorted[rank.saturating_sub(1).min(last)] as f64 * 1e-3
        };
        Some(Self { p50: at(0.5), p99: at(0.99), p999: at(0.999), max: at(1.0) })
    }
}

/// Report of a replay.
#[derive(Clone, Debug, Serialize)]
pub struct ReplayReport {
    /// Version of the file format.
    pub schema: u32,
    /// SHA-256 of the log.
    pub trace_sha256: String,
    /// What was replayed, and how.
    #[serde(flatten)]
    pub about: ReplayDescription,
    /// True if every sample was answered with the bits of the core.
    pub holds: bool,
    /// Counts of the answers.
    pub answers: Tally,
    /// SYNCs in the log. Fewer are sent if the driver stops answering.
    pub samples_in_log: u64,
    /// Sent frames.
    pub frames: u64,
    /// Duration, s of bus time.
    pub seconds: f64,
    /// Lateness of frames, us.
    pub lateness_us: Option<Quantiles>,
    /// Deviation of the time between SYNCs from the plan, us.
    pub jitter_us: Option<Quantiles>,
    /// Time from SYNC to status, us.
    pub round_trip_us: Option<Quantiles>,
    /// SYNCs sent less than a fifth of the planned time after the previous SYNC.
    pub bursts: u64,
    /// Duration, s of this PC's clock.
    pub elapsed_seconds: f64,
    /// Duration of the frames on a wire of that rate, s.
    pub wire_seconds: f64,
    /// Bus load; above 1 the frames do not fit. `None` at the maximum rate on a virtual clock, which stands still.
    pub bus_load: Option<f64>,
    /// Skipped lines: other nodes, damaged, CAN FD, remote, error, malformed.
    pub passed_over: [u64; 6],
}

/// What was replayed, and how.
#[derive(Clone, Debug, Serialize)]
pub struct ReplayDescription {
    /// The log.
    pub trace: String,
    /// The bus.
    pub bus: String,
    /// The node.
    pub node: u8,
    /// Number type: `f32` or `fixed`.
    pub number: &'static str,
    /// Clock of the measured times.
    pub clock: &'static str,
    /// True if the kernel granted priority, which affects the lateness.
    pub raised_priority: bool,
    /// Period of the driver, s.
    pub period_s: f32,
    /// Multiple of the recorded rate; `None` at the maximum rate.
    pub rate: Option<f64>,
    /// True if the bus time is virtual, so durations have no meaning.
    #[serde(skip)]
    pub is_virtual: bool,
    /// Bit rate of the bus, bit/s; above 0.
    pub bit_rate: u32,
}

impl ReplayReport {
    /// Creates the report of a replay.
    pub fn new(about: ReplayDescription, plan: &Plan, played: PlayResult) -> Self {
        let over = plan.skipped;
        let seconds = played.duration_ns as f64 * 1e-9;
        let at_fastest = f64::from(BitRates::FASTEST.nominal);
        let wire_seconds =
            played.wire_ns as f64 * 1e-9 * at_fastest / f64::from(about.bit_rate.max(1));
        let stands_still = about.is_virtual && about.rate.is_none();
        // On a virtual clock, every answer arrives at once.
        let measured = |times: &[u64]| Quantiles::of(times).filter(|_| !about.is_virtual);
        Self {
            schema: 1,
            trace_sha256: plan.sha256.clone(),
            holds: played.tally.holds(),
            samples_in_log: plan.samples,
            frames: played.frames,
            seconds,
            lateness_us: measured(&played.lateness_ns),
            jitter_us: measured(&played.jitter_ns),
            round_trip_us: measured(&played.round_trips_ns),
            bursts: played.bursts,
            elapsed_seconds: played.elapsed_ns as f64 * 1e-9,
            wire_seconds,
            bus_load: (seconds > 0.0 && !stands_still).then(|| wire_seconds / seconds),
            passed_over: [
                over.foreign,
                over.damaged,
                over.flexible,
                over.remote,
                over.error,
                over.bad_lines,
            ],
            answers: played.tally,
            about,
        }
    }

    /// Returns the report as a text of a few lines.
    pub fn text(&self) -> String {
        let mut text = String::new();
        self.write_answers(&mut text);
        self.write_traffic(&mut text);
        self.write_times(&mut text);
        let [foreign, damaged, flexible, remote, error, bad] = self.passed_over;
        if self.passed_over.iter().any(|count| *count > 0) {
            let _ = writeln!(
                text,
                "  skipped: {foreign} of other nodes, {damaged} damaged, {flexible} CAN FD, {remote} remote, {error} error, {bad} malformed lines"
            );
        }
        let _ = writeln!(text, "  trace sha256 {}", self.trace_sha256);
        text
    }

    /// Appends the verdict and the counts of the answers.
    fn write_answers(&self, text: &mut String) {
        let (tally, about) = (&self.answers, &self.about);
        let verdict = if self.holds { "holds" } else { "DOES NOT HOLD" };
        let _ = writeln!(
            text,
            "{verdict}: {} of {} samples equal bit for bit ({} on {}, node {}, {})",
            tally.equal, tally.samples, about.trace, about.bus, about.node, about.number
        );
        for shown in &tally.shown {
            let _ = writeln!(
                text,
                "  sample {}: {}: found {}, expected {}",
                shown.sample, shown.what, shown.found, shown.expected
            );
        }
        let _ = writeln!(
            text,
            "  mismatches {}, lost {}, duplicated {}, reordered {}, unexpected {}; telemetry equal {}",
            tally.mismatches,
            tally.lost,
            tally.duplicated,
            tally.reordered,
            tally.unexpected,
            tally.telemetry_equal
        );
        if tally.samples < self.samples_in_log {
            let _ = writeln!(
                text,
                "  the driver stopped answering: {} of {} samples were not sent",
                self.samples_in_log - tally.samples,
                self.samples_in_log
            );
        }
        if tally.recorded > 0 {
            let _ = writeln!(
                text,
                "  equal to the answers in the log: {} of {} (they differ if the joint had other parameters then)",
                tally.recorded_equal, tally.recorded
            );
        }
    }

    /// Appends the traffic, the duration and the bus load.
    fn write_traffic(&self, text: &mut String) {
        let about = &self.about;
        let rate = match about.rate {
            Some(rate) => format!("{rate}x"),
            None => "max".to_owned(),
        };
        let bus = format!("{} kbit/s", about.bit_rate / 1000);
        let load = match self.bus_load {
            Some(load) if load > 1.0 => {
                format!("{load:.1} times the capacity of a bus of {bus}")
            }
            Some(load) => format!("load of a bus of {bus} {:.1} %", 100.0 * load),
            None => format!("{:.3} s on a bus of {bus}, at least", self.wire_seconds),
        };
        let took = if self.bus_load.is_some() { self.seconds } else { self.elapsed_seconds };
        let _ = writeln!(
            text,
            "  {} frames in {took:.3} s ({rate}, clock: {}{}), {:.0} samples/s, {load}",
            self.frames,
            if self.bus_load.is_some() { about.clock } else { "this PC's" },
            if about.raised_priority { ", raised priority" } else { "" },
            if took > 0.0 { self.answers.samples as f64 / took } else { 0.0 },
        );
    }

    /// Appends the quantiles of lateness, jitter and round trip.
    fn write_times(&self, text: &mut String) {
        let rows = [
            ("lateness", self.lateness_us),
            ("jitter", self.jitter_us),
            ("round trip", self.round_trip_us),
        ];
        for (name, quantiles) in rows {
            if let Some(of) = quantiles {
                let _ = writeln!(
                    text,
                    "  {name}, us: p50 {:.1}, p99 {:.1}, p99.9 {:.1}, max {:.1}",
                    of.p50, of.p99, of.p999, of.max
                );
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_of_times_returns_values_that_occurred() {
        let times: Vec<u64> = (1..=1000).rev().map(|n| n * 1000).collect();
        let of = Quantiles::of(&times).unwrap();
        assert_eq!((of.p50, of.p99, of.p999, of.max), (500.0, 990.0, 999.0, 1000.0));
        assert_eq!(Quantiles::of(&[]), None);
        assert_eq!(Quantiles::of(&[7000]).unwrap().p999, 7.0);
    }
}
