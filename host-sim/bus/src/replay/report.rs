//! What a replay showed: `replay.json`, and the same in a few lines.

use super::Tally;
use super::plan::Plan;
use super::play::{Played, Rate};
use crate::bus::BitRates;
use serde::Serialize;
use std::fmt::Write;

/// Quantiles of times, us.
#[derive(Clone, Copy, Debug, Default, Serialize, PartialEq)]
pub struct Quantiles {
    /// Half are below.
    pub p50: f64,
    /// 99 % are below.
    pub p99: f64,
    /// 99.9 % are below.
    pub p999: f64,
    /// The largest.
    pub max: f64,
}

impl Quantiles {
    /// Of times in ns; `None` where there are none.
    pub fn of(times_ns: &[u64]) -> Option<Self> {
        let mut sorted = times_ns.to_vec();
        sorted.sort_unstable();
        let last = sorted.len().checked_sub(1)?;
        // The smallest value at least that share of the values is not above.
        let at = |share: f64| {
            let rank = (share * sorted.len() as f64).ceil() as usize;
            sorted[rank.saturating_sub(1).min(last)] as f64 * 1e-3
        };
        Some(Self { p50: at(0.5), p99: at(0.99), p999: at(0.999), max: at(1.0) })
    }
}

/// What a replay showed.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Version of this file.
    pub schema: u32,
    /// The log.
    pub trace: String,
    /// SHA-256 of it.
    pub trace_sha256: String,
    /// The bus.
    pub bus: String,
    /// The node.
    pub node: u8,
    /// The number it computes with: `f32` or `fixed`.
    pub number: &'static str,
    /// Times as fast as recorded; absent as fast as the driver answers.
    pub rate: Option<f64>,
    /// What times are measured with.
    pub clock: &'static str,
    /// Whether the kernel gave the replay priority, which lateness depends on.
    pub raised_priority: bool,
    /// Time from SYNC to SYNC the driver was built for, s.
    pub period_s: f32,
    /// Whether every sample was answered with the core's bits.
    pub holds: bool,
    /// What came of the answers.
    pub answers: Tally,
    /// SYNCs in the log; more than were sent where the driver fell silent.
    pub samples_in_log: u64,
    /// Frames sent.
    pub frames: u64,
    /// How long it took, s of the bus's clock.
    pub seconds: f64,
    /// How late frames were sent, us.
    pub lateness_us: Option<Quantiles>,
    /// How far steps from SYNC to SYNC were from the plan's, us.
    pub jitter_us: Option<Quantiles>,
    /// From SYNC to status, us.
    pub round_trip_us: Option<Quantiles>,
    /// SYNCs sent within a fifth of the planned step after the one before.
    pub bursts: u64,
    /// How long it took, s of this PC's clock.
    pub elapsed_seconds: f64,
    /// Bit rate of the bus, bit/s.
    pub bit_rate: u32,
    /// Time the frames take on a wire of that rate, s.
    pub wire_seconds: f64,
    /// Share of the time they take; above 1 they would not fit. None as fast as the driver answers on a virtual
    /// clock, where no time passes.
    pub bus_load: Option<f64>,
    /// Lines of the log passed over: other nodes', damaged, CAN FD, remote, error, no log at all.
    pub passed_over: [u64; 6],
}

/// What a report says besides what was measured.
pub struct About<'a> {
    /// The log.
    pub trace: &'a str,
    /// The bus.
    pub bus: &'a str,
    /// The node.
    pub node: u8,
    /// The number it computes with.
    pub number: &'static str,
    /// What times are measured with.
    pub clock: &'static str,
    /// Whether the kernel gave the replay priority.
    pub raised_priority: bool,
    /// Time from SYNC to SYNC, s.
    pub period_s: f32,
    /// How fast it was played.
    pub rate: Rate,
    /// Whether the bus's clock is virtual: it tells nothing of how long anything takes.
    pub is_virtual: bool,
    /// Bit rate of the bus, bit/s; above 0.
    pub bit_rate: u32,
}

impl Report {
    /// A report of a plan played.
    pub fn new(about: &About, plan: &Plan, played: Played) -> Self {
        let over = plan.passed_over;
        let seconds = played.duration_ns as f64 * 1e-9;
        let at_fastest = f64::from(BitRates::FASTEST.nominal);
        let wire_seconds =
            played.wire_ns as f64 * 1e-9 * at_fastest / f64::from(about.bit_rate.max(1));
        let stands_still = about.is_virtual && about.rate == Rate::Max;
        // On a virtual clock every answer comes at once.
        let measured = |times: &[u64]| Quantiles::of(times).filter(|_| !about.is_virtual);
        Self {
            schema: 1,
            trace: about.trace.to_owned(),
            trace_sha256: plan.sha256.clone(),
            bus: about.bus.to_owned(),
            node: about.node,
            number: about.number,
            rate: match about.rate {
                Rate::Times(times) => Some(times),
                Rate::Max => None,
            },
            clock: about.clock,
            raised_priority: about.raised_priority,
            period_s: about.period_s,
            holds: played.tally.holds(),
            samples_in_log: plan.samples,
            frames: played.frames,
            seconds,
            lateness_us: measured(&played.lateness_ns),
            jitter_us: measured(&played.jitter_ns),
            round_trip_us: measured(&played.round_trips_ns),
            bursts: played.bursts,
            elapsed_seconds: played.elapsed_ns as f64 * 1e-9,
            bit_rate: about.bit_rate,
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
        }
    }

    /// The report in a few lines.
    pub fn text(&self) -> String {
        let tally = &self.answers;
        let mut text = String::new();
        let verdict = if self.holds { "holds" } else { "DOES NOT HOLD" };
        let _ = writeln!(
            text,
            "{verdict}: {} of {} samples equal bit for bit ({} on {}, node {}, {})",
            tally.equal, tally.samples, self.trace, self.bus, self.node, self.number
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
            "  mismatches {}, lost {}, twice {}, late {}, unexpected {}; telemetry equal {}",
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
                "  the driver fell silent: {} of {} samples were not sent",
                self.samples_in_log - tally.samples,
                self.samples_in_log
            );
        }
        if tally.recorded > 0 {
            let _ = writeln!(
                text,
                "  equal to the answers in the log: {} of {} (others, if the joint had other parameters then)",
                tally.recorded_equal, tally.recorded
            );
        }
        let rate = match self.rate {
            Some(rate) => format!("{rate}x"),
            None => "max".to_owned(),
        };
        let bus = format!("{} kbit/s", self.bit_rate / 1000);
        let load = match self.bus_load {
            Some(load) if load > 1.0 => {
                format!("{load:.1} times what a bus of {bus} carries")
            }
            Some(load) => format!("load of a bus of {bus} {:.1} %", 100.0 * load),
            None => format!("{:.3} s on a bus of {bus}, at least", self.wire_seconds),
        };
        let took = if self.bus_load.is_some() { self.seconds } else { self.elapsed_seconds };
        let _ = writeln!(
            text,
            "  {} frames in {took:.3} s ({rate}, clock: {}{}), {:.0} samples/s, {load}",
            self.frames,
            if self.bus_load.is_some() { self.clock } else { "this PC's" },
            if self.raised_priority { ", raised priority" } else { "" },
            if took > 0.0 { tally.samples as f64 / took } else { 0.0 },
        );
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
        let [foreign, damaged, flexible, remote, error, bad] = self.passed_over;
        if self.passed_over.iter().any(|count| *count > 0) {
            let _ = writeln!(
                text,
                "  passed over: {foreign} of others, {damaged} damaged, {flexible} CAN FD, {remote} remote, {error} error, {bad} bad lines"
            );
        }
        let _ = writeln!(text, "  trace sha256 {}", self.trace_sha256);
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_values_that_occurred() {
        let times: Vec<u64> = (1..=1000).rev().map(|n| n * 1000).collect();
        let of = Quantiles::of(&times).unwrap();
        assert_eq!((of.p50, of.p99, of.p999, of.max), (500.0, 990.0, 999.0, 1000.0));
        assert_eq!(Quantiles::of(&[]), None);
        assert_eq!(Quantiles::of(&[7000]).unwrap().p999, 7.0);
    }
}
