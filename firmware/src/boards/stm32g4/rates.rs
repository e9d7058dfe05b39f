//! Frequencies and times that all boards with this family have.

use super::clocks::CORE_HZ;
use firmware::control::PERIOD_S;
use firmware::deadline::DeadlineLimits;
use firmware::node::bit_timing::{BIT_RATES_KBIT, BitTiming, DATA_BIT_RATES_KBIT};

/// Loop rate, Hz.
pub const LOOP_HZ: u32 = 20_000;
const _: () =
    assert!((LOOP_HZ as f32 * PERIOD_S - 1.0).abs() < 1e-6, "the loop rate must match PERIOD_S");
/// Counts of the PWM timer from bottom to top; it counts up and down in a period.
pub const PWM_TOP: u16 = (CORE_HZ / LOOP_HZ / 2) as u16;

/// Periods for which the compensation stays off after a late one: 0.1 s.
const HOLD_PERIODS: u32 = LOOP_HZ / 10;
/// Time limits of a period.
pub const LIMITS: DeadlineLimits = DeadlineLimits::for_period(CORE_HZ / LOOP_HZ, HOLD_PERIODS);

/// Reference of the converters, V.
pub const REFERENCE_V: f32 = 3.3;
/// Clock of the CAN controller, Hz. It must be a multiple of every supported bit rate.
pub const CAN_HZ: u32 = CORE_HZ;
const _: () = {
    let mut index = 0;
    while index < BIT_RATES_KBIT.len() {
        assert!(
            BitTiming::for_rate(CAN_HZ, BIT_RATES_KBIT[index] as u32 * 1000).is_some(),
            "every bit rate must have a timing"
        );
        index += 1;
    }
    index = 0;
    while index < DATA_BIT_RATES_KBIT.len() {
        let rate = DATA_BIT_RATES_KBIT[index] as u32 * 1000;
        let Some(timing) = BitTiming::for_rate(CAN_HZ, rate) else {
            panic!("every data bit rate must have a timing");
        };
        // Fields of DBTP.
        assert!(timing.prescaler <= 31 && timing.seg1 <= 31 && timing.seg2 <= 15);
        index += 1;
    }
};

/// Watchdog timeout, us. Erasing a page of flash takes 25 ms at most.
pub const WATCHDOG_US: u32 = 50_000;
