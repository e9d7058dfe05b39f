//! Rates of the bus traffic over the last second.
//!
//! Events are counted in slots of a tenth of a second. A rate is that of the last ten complete slots, or of all complete
//! slots since the start.

use std::collections::VecDeque;

/// Length of a slot, ns.
const SLOT_NS: u64 = 100_000_000;
/// Number of slots of a rate.
const RATE_SLOTS: u64 = 10;

/// Counts of a slot.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Count {
    /// New SYNCs.
    pub samples: u64,
    /// Answers of the joint.
    pub answers: u64,
    /// All frames.
    pub frames: u64,
    /// Their duration on the wire, ns.
    pub wire_ns: u64,
}

/// Rates per second.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PerSecond {
    /// New SYNCs, 1/s.
    pub samples: f64,
    /// Answers of the joint, 1/s.
    pub answers: f64,
    /// All frames, 1/s.
    pub frames: f64,
    /// Bus load, 0 to 1.
    pub load: f64,
}

/// Counter of the last second.
#[derive(Clone, Debug)]
pub struct Rates {
    slots: VecDeque<(u64, Count)>,
    first: u64,
}

impl Rates {
    /// Starts counting at a time.
    pub fn new(start_ns: u64) -> Self {
        Self { slots: VecDeque::new(), first: start_ns / SLOT_NS }
    }

    /// Returns the slot of a time.
    pub fn at(&mut self, time_ns: u64) -> &mut Count {
        let number = time_ns / SLOT_NS;
        if self.slots.back().is_none_or(|(last, _)| *last < number) {
            self.slots.push_back((number, Count::default()));
            while self.slots.len() > RATE_SLOTS as usize + 1 {
                self.slots.pop_front();
            }
        }
        // Not empty: a slot was just added.
        let last = self.slots.len() - 1;
        &mut self.slots[last].1
    }

    /// Returns the rates of the second before a time.
    pub fn per_second(&self, now_ns: u64) -> PerSecond {
        let end = now_ns / SLOT_NS;
        let begin = end.saturating_sub(RATE_SLOTS).max(self.first);
        if end <= begin {
            return PerSecond::default();
        }
        let mut sum = Count::default();
        for (_, of) in self.slots.iter().filter(|(number, _)| (begin..end).contains(number)) {
            sum.samples += of.samples;
            sum.answers += of.answers;
            sum.frames += of.frames;
            sum.wire_ns += of.wire_ns;
        }
        // Ten slots are one second, so whole numbers stay exact.
        let rate = |count: u64| (count * RATE_SLOTS) as f64 / (end - begin) as f64;
        PerSecond {
            samples: rate(sum.samples),
            answers: rate(sum.answers),
            frames: rate(sum.frames),
            load: rate(sum.wire_ns) * 1e-9,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: u64 = 1_000_000;

    #[test]
    fn per_second_returns_rates_of_the_last_second() {
        let mut rates = Rates::new(5000 * MS);
        assert_eq!(rates.per_second(5050 * MS), PerSecond::default());
        for at in 5000..8000u64 {
            let slot = rates.at(at * MS);
            slot.samples += 1;
            slot.wire_ns += MS / 4;
            if at == 5300 {
                assert_eq!(rates.per_second(at * MS).samples, 1000.0);
            }
        }
        let rate = rates.per_second(7999 * MS);
        assert!((rate.samples - 1000.0).abs() < 1e-9 && (rate.load - 0.25).abs() < 1e-9);
        assert!((rates.per_second(8500 * MS).samples - 500.0).abs() < 1e-9);
        assert_eq!(rates.per_second(9500 * MS), PerSecond::default());
    }
}
