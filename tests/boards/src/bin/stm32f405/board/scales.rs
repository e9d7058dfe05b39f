//! Frequencies and timer scales of this board.

use firmware::control::PERIOD_S;
use firmware::deadline::DeadlineLimits;

/// Timer frequency in the emulator, Hz. On the chip it is 84 MHz, twice APB1.
pub const TIMER_HZ: u32 = 1_000_000_000;
/// Frequency of core and SysTick, Hz.
pub const CORE_HZ: u32 = 168_000_000;
/// Loop rate, Hz.
pub const LOOP_HZ: u32 = 20_000;
const _: () =
    assert!((LOOP_HZ as f32 * PERIOD_S - 1.0).abs() < 1e-6, "the loop rate must match PERIOD_S");
/// Counts of the PWM timer from bottom to top; it counts the core's clock up and down.
pub const PWM_TOP: u16 = (CORE_HZ / LOOP_HZ / 2) as u16;
/// Time limits of a period, in timer counts. After a late period the compensation stays off for 0.1 s.
pub const LIMITS: DeadlineLimits = DeadlineLimits::for_period(TIMER_HZ / LOOP_HZ, LOOP_HZ / 10);
