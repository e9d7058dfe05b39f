//! What leads to a reset, and what it leaves: the watchdog of boot program and recovery.

use super::board_bus::{BoardBus, MILLISECOND, blank_board};
use super::update::trial_beginning_with;
use emulated_board::StopReason;
use emulated_board::chip::CORE_HZ;

/// Longest time until the watchdog resets a boot program that hangs, s.
const TIMEOUT_S: u64 = 9;
/// Frequency of the internal oscillator, on which the boot program chooses an image, Hz.
const BOOT_HZ: f64 = 16e6;

/// Stops the code, as an endless loop does, and requires the reset by the watchdog.
fn assert_hang_is_reset(mut bus: BoardBus, what: &str) {
    let machine = bus.machine();
    machine.stall_thread(10 * TIMEOUT_S * CORE_HZ);
    assert_eq!(machine.run(TIMEOUT_S * CORE_HZ), StopReason::Reset, "{what}");
    assert!(machine.chip().is_watchdog_reset(), "{what}");
}

#[test]
fn boot_program_that_hangs_is_reset_by_its_watchdog() {
    let mut bus = BoardBus::power_up(trial_beginning_with(&[]));
    bus.run(10 * MILLISECOND);
    assert_hang_is_reset(bus, "during the check of a signature");
    // The check itself takes less.
    let mut bus = BoardBus::power_up(trial_beginning_with(&[]));
    bus.await_boot_up();
    assert_eq!(bus.resets, 0);
    let seconds = bus.machine().now() as f64 / BOOT_HZ;
    println!(
        "measured: start with the check of a signature {seconds:.1} s on the internal oscillator"
    );
    assert!(seconds < 0.5 * TIMEOUT_S as f64, "{seconds} s");
}

#[test]
fn recovery_that_hangs_is_reset_by_its_watchdog() {
    let mut bus = BoardBus::power_up(blank_board());
    bus.await_boot_up();
    let before = bus.machine().chip().watchdog.refreshes;
    bus.run(20 * MILLISECOND);
    let refreshes = bus.machine().chip().watchdog.refreshes - before;
    assert!((15..=25).contains(&refreshes), "{refreshes} in 20 ms");
    assert_hang_is_reset(bus, "recovery");
}
