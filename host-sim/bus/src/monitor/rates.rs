//! How much there was on the bus in the second that has passed.
//!
//! Counted in slots of a tenth of a second; a rate is that of the last ten whole ones, or of as many as
//! there have been since the start.

use std::collections::VecDeque;

/// Length of a slot, ns.
const SLOT_NS: u64 = 100_000_000;
/// Slots in a rate.
const SLOTS: u64 = 10;

/// What is counted.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Count {
    /// New SYNCs.
    pub samples: u64,
    /// Answers of the joint.
    pub answers: u64,
    /// Frames of anybody.
    pub frames: u64,
    /// Time they take on the wire, ns.
    pub wire_ns: u64,
}

/// What there was per second.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PerSecond {
    /// New SYNCs, 1/s.
    pub samples: f64,
    /// Answers of the joint, 1/s.
    pub answers: f64,
    /// Frames of anybody, 1/s.
    pub frames: f64,
    /// Share of the time in which the wire was in use, 0 to 1.
    pub load: f64,
}

/// Counts of the last second.
#[derive(Clone, Debug)]
pub struct Rates {
    slots: VecDeque<(u64, Count)>,
    first: u64,
}

impl Rates {
    /// Counts from this time on.
    pub fn new(start_ns: u64) -> Self {
        Self { slots: VecDeque::new(), first: start_ns / SLOT_NS }
    }

    /// The slot of this time, to count in.
    pub fn at(&mut self, time_ns: u64) -> &mut Count {
        let number = time_ns / SLOT_NS;
        if self.slots.back().is_none_or(|(last, _)| *last < number) {
            self.slots.push_back((number, Count::default()));
            while self.slots.len() > SLOTS as usize + 1 {
                self.slots.pop_front();
            }
        }
        // There is one: it has just been put there.
        let last = self.slots.len() - 1;
        &mut self.slots[last].1
    }

    /// What there was in the second before this time.
    pub fn per_second(&self, now_ns: u64) -> PerSecond {
        let end = now_ns / SLOT_NS;
        let begin = end.saturating_sub(SLOTS).max(self.first);
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
        // Ten slots are a second; whole numbers stay exact.
        let rate = |count: u64| (count * SLOTS) as f64 / (end - begin) as f64;
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
    fn a_rate_is_that_of_the_last_second() {
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
