//! CAN bit timing: where in a bit its level is sampled.
//!
//! A bit consists of time quanta: one to synchronise, `seg1` up to the sample point, `seg2` after it. CiA
//! 301 recommends a sample point at 87.5 %. A node that samples later than the others, or much earlier, is
//! the first to see errors on a long line. The chip's library is not used, because it places the sample
//! point at 90 % for 1 Mbit/s of a 170 MHz clock.

/// Legal range of the sample point, per mille of a bit.
pub const SAMPLE_POINT_RANGE_PERMILLE: (u32, u32) = (800, 875);

/// Supported bit rates, kbit/s: those of CiA 301 from 125 on, without 800.
pub const BIT_RATES_KBIT: [u16; 4] = [1000, 500, 250, 125];

/// Supported bit rates of the data of CAN FD frames, kbit/s: those of a 170 MHz clock in common use.
pub const DATA_BIT_RATES_KBIT: [u16; 3] = [1000, 2000, 5000];
/// Default of them.
pub const DEFAULT_DATA_BIT_RATE_KBIT: u16 = 2000;

/// Division of a bit into quanta of the controller's clock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitTiming {
    /// Clock cycles per quantum, 1 to 512.
    pub prescaler: u16,
    /// Quanta up to the sample point, without the synchronising one.
    pub seg1: u8,
    /// Quanta after the sample point; also the maximum resynchronisation jump.
    pub seg2: u8,
}

impl BitTiming {
    /// Maximum and minimum quanta per bit. More quanta place the sample point better and follow phase
    /// errors better.
    const MAX_MIN_QUANTA: (u32, u32) = (25, 8);

    /// Returns the timing for a controller clock and a bit rate; `None` if no whole number of quanta fits
    /// both.
    pub const fn for_rate(clock_hz: u32, bits_per_s: u32) -> Option<Self> {
        let mut quanta = Self::MAX_MIN_QUANTA.0;
        while quanta >= Self::MAX_MIN_QUANTA.1 {
            let cycles = bits_per_s * quanta;
            // The latest sample point in range.
            let before = quanta * SAMPLE_POINT_RANGE_PERMILLE.1 / 1000;
            let fits = cycles > 0 && clock_hz.is_multiple_of(cycles) && clock_hz / cycles <= 512;
            if fits && before * 1000 >= quanta * SAMPLE_POINT_RANGE_PERMILLE.0 {
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
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Returns the sample point, per mille of a bit.
    fn sample_point(timing: BitTiming) -> u32 {
        let before = 1 + u32::from(timing.seg1);
        before * 1000 / (before + u32::from(timing.seg2))
    }

    #[test]
    fn timing_of_every_bit_rate_is_exact_and_in_range() {
        for (clock_hz, rates) in
            [(170_000_000, &BIT_RATES_KBIT[..]), (80_000_000, &BIT_RATES_KBIT[..])]
        {
            for kbit in rates {
                let timing = BitTiming::for_rate(clock_hz, u32::from(*kbit) * 1000).expect("fits");
                let quanta = 1 + u32::from(timing.seg1) + u32::from(timing.seg2);
                let rate = clock_hz / (u32::from(timing.prescaler) * quanta);
                assert_eq!(rate, u32::from(*kbit) * 1000);
                let (earliest, latest) = SAMPLE_POINT_RANGE_PERMILLE;
                assert!((earliest..=latest).contains(&sample_point(timing)), "{timing:?}");
                assert!((2..=16).contains(&timing.seg2), "{timing:?}");
            }
        }
        let one = BitTiming::for_rate(170_000_000, 1_000_000).unwrap();
        assert_eq!(one, BitTiming { prescaler: 10, seg1: 13, seg2: 3 });
        assert_eq!(sample_point(one), 823);
        assert_eq!(BitTiming::for_rate(170_000_000, 3_333_333), None);
        assert_eq!(BitTiming::for_rate(170_000_000, 0), None);
    }
}
