//! Frames that a joint's view waits for.

use super::{JointView, SILENCE_TIMEOUT_NS};
use crate::monitor::missing_frame::{MissingFrame, Traffic};
use crate::monitor::quantity::Quantity;
use crate::monitor::view_data::EventKind;
use canopen_rs::NmtState;
use firmware::node::dictionary::index;
use std::collections::BTreeMap;

impl JointView {
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
        let last_ns = series.last().map_or(self.start_ns, |(at_ns, _)| at_ns);
        if series.is_unmeasured() || !is_old(last_ns) {
            return None;
        }
        let source = self.objects.get(&(index::OPERATION, 1));
        let traffic = Traffic {
            node: self.node,
            bus: &self.bus,
            is_silent: self.silent || self.last_frame_ns.is_none(),
            has_sync: self.last_sync_ns.is_some_and(|at_ns| !is_old(at_ns)),
            is_operational: self.nmt.is_none_or(|state| state == NmtState::Operational),
            is_hil: source.map(|(_, source)| *source == 1),
        };
        Some(MissingFrame::of(quantity, &traffic))
    }
}
