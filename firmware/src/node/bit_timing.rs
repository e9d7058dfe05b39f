//! The bits of CAN: where in a bit its level is sampled.
//!
//! A bit is a number of quanta: one to synchronise, `seg1` up to the sample point, `seg2` behind it. CiA 301 wants the
//! sample point at 87.5 %; a node that samples later than the others, or much earlier, is the one that sees errors on a
//! long line. Found here and not by the chip's library, which at 1 Mbit/s of 170 MHz gives 90 %.

/// Earliest and latest sample point, per mille of a bit.
pub const SAMPLE_POINT: (u32, u32) = (800, 875);

/// Bit rates a driver can have, kbit/s, as CiA 301 has them; 800 and those below 125 nobody uses here.
pub const RATES_KBIT: [u16; 4] = [1000, 500, 250, 125];

/// How a bit is made of quanta of the controller's clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitTiming {
    /// Cycles of the clock in a quantum, 1 to 512.
    pub prescaler: u16,
    /// Quanta up to the sample point, the synchronising one not among them.
    pub seg1: u8,
    /// Quanta behind it: also how far a bit may be stretched or shortened to follow the others.
    pub seg2: u8,
}

impl BitTiming {
    /// Most and fewest quanta in a bit: finer ones place the sample point better, and follow phase errors better.
    const QUANTA: (u32, u32) = (25, 8);

    /// Of a controller's clock and a bit rate; `None` where no whole number of quanta fits both.
    pub const fn of(clock_hz: u32, bits_per_s: u32) -> Option<Self> {
        let mut quanta = Self::QUANTA.0;
        while quanta >= Self::QUANTA.1 {
            let cycles = bits_per_s * quanta;
            // The latest point that is not too late.
            let before = quanta * SAMPLE_POINT.1 / 1000;
            let fits = cycles > 0 && clock_hz.is_multiple_of(cycles) && clock_hz / cycles <= 512;
            if fits && before * 1000 >= quanta * SAMPLE_POINT.0 {
                return Some(Self {
                    prescaler: (clock_hz / cycles) as u16,
                    seg1: (before - 1) as u8,
                    seg2: (quanta - before) as u8,
                });
            }
            quanta -= 1;
        }
        None
    }

    /// Where the level is sampled, per mille of a bit.
    pub const fn sample_point(&self) -> u32 {
        let before = 1 + self.seg1 as u32;
        before * 1000 / (before + self.seg2 as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_rate_is_exact_and_sampled_where_it_should_be() {
        for (clock_hz, rates) in [(170_000_000, &RATES_KBIT[..]), (80_000_000, &RATES_KBIT[..])] {
            for kbit in rates {
                let timing = BitTiming::of(clock_hz, u32::from(*kbit) * 1000).expect("fits");
                let quanta = 1 + u32::from(timing.seg1) + u32::from(timing.seg2);
                let rate = clock_hz / (u32::from(timing.prescaler) * quanta);
                assert_eq!(rate, u32::from(*kbit) * 1000);
                let (earliest, latest) = SAMPLE_POINT;
                assert!((earliest..=latest).contains(&timing.sample_point()), "{timing:?}");
                assert!((2..=16).contains(&timing.seg2), "{timing:?}");
            }
        }
        let one = BitTiming::of(170_000_000, 1_000_000).unwrap();
        assert_eq!(one, BitTiming { prescaler: 10, seg1: 13, seg2: 3 });
        assert_eq!(one.sample_point(), 823);
        assert_eq!(BitTiming::of(170_000_000, 3_333_333), None);
        assert_eq!(BitTiming::of(170_000_000, 0), None);
    }
}
