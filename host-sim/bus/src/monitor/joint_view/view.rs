//! What the monitor shows of a joint at one time, from what [`JointView`] received, and the frames that it waits for.

use super::{JointView, SILENCE_TIMEOUT_NS, nmt_name, self_test_name};
use crate::bus::BitRates;
use crate::codes::{FIRST_FAULT, FIRST_LIMIT, ReportedState, code_name};
use crate::monitor::missing_frame::{MissingFrame, Traffic};
use crate::monitor::quantity::Quantity;
use crate::monitor::rates::PerSecond;
use crate::monitor::sdo_poller::{
    FAILED_SELF_TEST, FAULTS, IN_BAND, LARGEST_IN_BANDS, LIMITS, SOURCE, STATE, UPDATE_KEY,
    WINDOWS, WINDOWS_OUT_OF_BAND,
};
use crate::monitor::series::Timed;
use crate::monitor::view_data::{
    ActiveFlags, Band, Codes, EventKind, Heartbeat, LearntLevels, Lens, Network, Reading, View,
};
use canopen_rs::{Address, NmtState};
use compensator_core::adaptation::{FOLLOWED, Frozen};
use compensator_core::compensator::Flags;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::{AdaptationObject, NetworkObject};
use firmware::node_settings::InputSource;
use firmware::update::PUBLISHED_KEY;
use std::collections::BTreeMap;

/// Age after which objects are stale, s: four polling rounds.
const OBJECTS_STALE_S: f64 = 2.0;

/// Returns the age of a time, s.
fn age_s(at_ns: u64, now_ns: u64) -> f64 {
    now_ns.saturating_sub(at_ns) as f64 * 1e-9
}

impl JointView {
    /// Returns the view at a time.
    pub fn view(&self, now_ns: u64, lens: &Lens) -> View {
        let state_age_s = self.polled(STATE).map(|state| age_s(state.time_ns, now_ns));
        let rates = self.rates.per_second(now_ns);
        View {
            node: self.node.number(),
            time_ns: now_ns,
            elapsed_s: age_s(self.start_ns, now_ns),
            window_s: lens.window_s,
            last_frame_age_s: self.last_frame_ns.map(|at_ns| age_s(at_ns, now_ns)),
            silent: self.silent,
            nmt: self.nmt.map(nmt_name),
            heartbeat: self.heartbeat_at(now_ns),
            state: self.value(STATE).map(ReportedState::from_number),
            source: self.value(SOURCE).map(|source| match InputSource::from_code(source as u8) {
                Some(InputSource::Sensors) => "its sensors",
                Some(InputSource::Bus) => "the bus",
                None => "unknown",
            }),
            accepts_test_key: self.value(UPDATE_KEY).map(|key| key == PUBLISHED_KEY),
            objects_age_s: state_age_s,
            objects_stale: state_age_s.is_some_and(|age_s| age_s > OBJECTS_STALE_S),
            codes: self.codes(),
            flags: self.active_flags(now_ns),
            band: self.band(),
            learnt: self.learnt_levels(),
            network: self.network(),
            readings: Quantity::ALL.map(|quantity| self.reading(quantity, now_ns, lens)),
            rates: PerSecond { load: rates.load * self.load_scale, ..rates },
            bit_rate: (f64::from(BitRates::FASTEST.nominal) / self.load_scale).round() as u32,
            syncs: self.syncs,
            sync_age_s: self.last_sync_ns.map(|at_ns| age_s(at_ns, now_ns)),
            emergencies: self.emergencies,
            error_frames: self.error_frames,
            events: self.events.iter().rev().take(lens.events).rev().cloned().collect(),
        }
    }

    /// Returns the value of an object; `None` before it was read.
    fn polled(&self, at: Address) -> Option<Timed<u32>> {
        self.objects.get(&(at.index, at.subindex)).copied()
    }

    fn value(&self, at: Address) -> Option<u32> {
        self.polled(at).map(|of| of.value)
    }

    fn heartbeat_at(&self, now_ns: u64) -> Heartbeat {
        let is_late = |at_ns| now_ns.saturating_sub(at_ns) > self.heartbeat_limit_ns();
        Heartbeat {
            age_s: self.heartbeat_ns.map(|at_ns| age_s(at_ns, now_ns)),
            period_s: self.heartbeat_step_ns.map(|step_ns| step_ns as f64 * 1e-9),
            late: self.heartbeat_ns.is_some_and(is_late),
        }
    }

    fn codes(&self) -> Codes {
        let failed = self.value(FAILED_SELF_TEST).filter(|number| *number != 0);
        Codes {
            faults: self.codes.range(FIRST_FAULT..FIRST_LIMIT).map(|n| code_name(*n)).collect(),
            limits: self.codes.range(FIRST_LIMIT..).map(|n| code_name(*n)).collect(),
            read: self.value(FAULTS).is_some() && self.value(LIMITS).is_some(),
            failed_self_test: failed.map(self_test_name),
        }
    }

    fn active_flags(&self, now_ns: u64) -> Option<ActiveFlags> {
        let Timed { time_ns, value: flags } = self.flags?;
        let stale_ns = self.series[Quantity::Friction as usize].stale_ns();
        let age_s = age_s(time_ns, now_ns);
        let is_stale = age_s > stale_ns as f64 * 1e-9;
        Some(ActiveFlags { names: flag_names(flags), age_s, is_stale })
    }

    /// Returns the state of the residual watch; `None` until all of its objects are read.
    fn band(&self) -> Option<Band> {
        Some(Band {
            in_band: match self.value(IN_BAND)? {
                0 => Some(false),
                1 => Some(true),
                _ => None,
            },
            windows: self.value(WINDOWS)?,
            windows_out: self.value(WINDOWS_OUT_OF_BAND)?,
            largest_in_bands: self.value(LARGEST_IN_BANDS).map(f32::from_bits),
        })
    }

    /// Returns the learnt friction levels; `None` if the joint learns none.
    fn learnt_levels(&self) -> Option<LearntLevels> {
        let object = |place| self.value(Address::new(index::ADAPTATION, place));
        let gain = |place| self.value(Address::new(index::LEARNT_GAINS, place));
        object(AdaptationObject::MODE).filter(|mode| *mode != 0)?;
        let state = object(AdaptationObject::FROZEN)?;
        // Counted from 1; 0 is none.
        let followed = object(AdaptationObject::FOLLOWS)
            .and_then(|number| FOLLOWED.get((number as usize).checked_sub(1)?));
        Some(LearntLevels {
            state: Frozen::ALL.get(state as usize).map(|reason| reason.name()),
            level: gain(1).map(f32::from_bits),
            viscous: gain(2).map(f32::from_bits),
            follows: followed.map(|quantity| quantity.info().label),
        })
    }

    /// Returns the state of the network; `None` without one, and until it is read.
    fn network(&self) -> Option<Network> {
        let object = |place| self.value(Address::new(index::NETWORK, place));
        object(NetworkObject::PRESENT).filter(|is_present| *is_present != 0)?;
        Some(Network {
            outside: object(NetworkObject::OUTSIDE)? != 0,
            outside_count: object(NetworkObject::OUTSIDE_COUNT)?,
            share: object(NetworkObject::SHARE).map(f32::from_bits),
        })
    }

    fn reading(&self, quantity: Quantity, now_ns: u64, lens: &Lens) -> Reading {
        let series = &self.series[quantity as usize];
        let window_ns = (lens.window_s * 1e9) as u64;
        let (columns, bridged) = series.columns(now_ns, window_ns, lens.columns);
        let age_ns = series.last.map(|last| now_ns.saturating_sub(last.time_ns));
        Reading {
            quantity,
            unit: quantity.unit(self.kind),
            value: series.last.map(|last| last.value),
            unmeasured: series.is_unmeasured,
            missing: self.missing_frame(quantity, now_ns),
            age_s: age_ns.map(|age_ns| age_ns as f64 * 1e-9),
            stale: age_ns.is_some_and(|age_ns| age_ns > series.stale_ns()),
            range: series.range,
            columns,
            bridged,
        }
    }

    /// Logs frames that have become missing, with the quantities that wait for them.
    pub(super) fn log_missing(&mut self, now_ns: u64) {
        let mut waiting: BTreeMap<u16, (MissingFrame, Vec<&str>)> = BTreeMap::new();
        for quantity in Quantity::ALL {
            if let Some(frame) = self.missing_frame(quantity, now_ns) {
                let entry = waiting.entry(frame.identifier).or_insert((frame, Vec::new()));
                entry.1.push(quantity.name());
            }
        }
        self.logged_missing.retain(|identifier| waiting.contains_key(identifier));
        for (identifier, (frame, quantities)) in waiting {
            if self.logged_missing.insert(identifier) {
                let names = quantities.join(", ");
                let text = format!("no {} ({identifier:03X}h): no {names}", frame.name);
                self.log(now_ns, EventKind::Warning, text);
                self.log(now_ns, EventKind::Note, format!("to have it sent: {}", frame.command));
            }
        }
    }

    /// Returns the frame that a quantity without new values waits for; `None` if it has values, if it is not measured, and
    /// until a heartbeat is due.
    pub(super) fn missing_frame(&self, quantity: Quantity, now_ns: u64) -> Option<MissingFrame> {
        let is_old = |at_ns: u64| now_ns.saturating_sub(at_ns) > SILENCE_TIMEOUT_NS;
        let series = &self.series[quantity as usize];
        let last_ns = series.last.map_or(self.start_ns, |last| last.time_ns);
        if series.is_unmeasured || !is_old(last_ns) {
            return None;
        }
        let traffic = Traffic {
            node: self.node,
            bus: &self.bus,
            is_silent: self.silent || self.last_frame_ns.is_none(),
            has_sync: self.last_sync_ns.is_some_and(|at_ns| !is_old(at_ns)),
            is_operational: self.nmt.is_none_or(|state| state == NmtState::Operational),
            is_hil: self.value(SOURCE).map(|source| source == InputSource::Bus as u32),
        };
        Some(MissingFrame::of(quantity, &traffic))
    }
}

/// Returns the names of flags. Unknown flags of a newer driver are named by their bit.
fn flag_names(flags: Flags) -> Vec<String> {
    let known = flags.iter_names().map(|(name, _)| name.to_lowercase().replace('_', "-"));
    let rest = flags.bits() & !Flags::all().bits();
    let unknown = (0..32).filter(|bit| rest >> bit & 1 != 0).map(|bit| format!("flag-{bit}"));
    known.chain(unknown).collect()
}
