//! What a count and a tick mean on this board.

use firmware::control::PERIOD_S;
use firmware::deadline::Limits;

/// Counts of the timers in a second: what the emulator gives them. The chip's own would be 84 MHz, twice APB1's.
pub const TIMER_HZ: u32 = 1_000_000_000;
/// The core, and SysTick.
pub const CORE_HZ: u32 = 168_000_000;
/// Loop rate, Hz.
pub const LOOP_HZ: u32 = 20_000;
const _: () = assert!((LOOP_HZ as f32 * PERIOD_S - 1.0).abs() < 1e-6, "one period everywhere");
/// Counts of the bridge's timer from the bottom to the top, of the core's clock up and down.
pub const PWM_TOP: u16 = (CORE_HZ / LOOP_HZ / 2) as u16;
/// What a period may take, in counts; the compensation stays dropped for 0.1 s after a late one.
pub const LIMITS: Limits = Limits::of_period(TIMER_HZ / LOOP_HZ, LOOP_HZ / 10);
