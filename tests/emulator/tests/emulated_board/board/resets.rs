//! What leads to a reset, and what it leaves: the watchdog of boot program and recovery, a hard fault, the guard of the stack,
//! and the heat of the winding.

use super::board_bus::{BoardBus, MILLISECOND, blank_board, started_image};
use super::start::{Constant, started};
use super::update::trial_beginning_with;
use crate::common::image;
use canopen_rs::{Address, NmtCommand};
use emulated_board::chip::clock::reset;
use emulated_board::chip::{CORE_HZ, Chip};
use emulated_board::machine::RAM;
use emulated_board::{HEAT_MEMORY, Machine, StopReason, kept_heat};
use firmware::node::dictionary::index;
use firmware::supervisor::Code;
use joint_bus::canopen::Client;

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

/// Returns the machine after a reset by software, which leaves its RAM.
fn after_reset(machine: &Machine<Constant>) -> Machine<Constant> {
    let mut chip = Chip::new(Constant::default());
    chip.clock.set_reset_flags(reset::SOFTWARE | reset::PIN);
    machine.restarted(chip, true).expect("a machine")
}

/// Registers of the memory protection: its use, and the address and attributes of its region.
const PROTECTION: [u32; 3] = [0xE000_ED94, 0xE000_ED9C, 0xE000_EDA0];

#[test]
fn stack_that_reaches_its_guard_resets_and_is_reported_after_the_restart() {
    let mut machine = started();
    machine.run(CORE_HZ / 10);
    let [control, address, attributes] = PROTECTION.map(|at| machine.chip().plain(at));
    let ram = RAM.0..RAM.0 + RAM.1;
    let statics = image().symbols.iter().filter(|symbol| ram.contains(&symbol.address));
    let statics_end = statics.map(|symbol| symbol.address + symbol.size).max().expect("statics");
    // The unit acts in all but fault handlers, and lets nothing access the region.
    assert_eq!((control, attributes & 1, attributes >> 24 & 7), (5, 1, 0));
    let (first, bytes) = (address & !0x1F, 2 << (attributes >> 1 & 0x1F));
    assert!(
        first >= statics_end && bytes >= 256 && first % bytes == 0,
        "{first:#x}, {bytes} bytes"
    );
    let used = machine.stack_used();
    assert!(first + bytes < ram.end - used, "{used} bytes of stack");
    // Nothing but the next interrupt uses the stack while the background sleeps.
    while !machine.is_asleep() {
        machine.run(CORE_HZ / 1_000_000);
    }
    // It needs 104 bytes.
    machine.set_stack_pointer(first + bytes + 64);
    assert_eq!(machine.run(CORE_HZ / 1000), StopReason::Reset);
    assert!(!machine.chip().is_watchdog_reset());
    let mut machine = after_reset(&machine);
    machine.run(CORE_HZ / 10);
    let sent = &machine.chip().can.sent;
    let number = Code::StackOverflow.number();
    let mut emergencies = sent.iter().filter(|(_, frame)| frame.identifier() == 0x081);
    assert!(emergencies.any(|(_, frame)| frame.data()[3] == number), "{sent:?}");
}

#[test]
fn heat_of_the_winding_survives_a_reset_and_is_assumed_without_one() {
    let kept = image().find(HEAT_MEMORY).expect("a static").address;
    let rise_k = |machine: &mut Machine<Constant>| {
        machine.run(CORE_HZ / 10);
        f32::from_bits(machine.word(kept))
    };
    // The winding cools by 0.3 % in 0.1 s. Hot is 140 deg C, with the stator at 25.
    let mut machine = started();
    let lost_k = rise_k(&mut machine);
    assert!((114.0..115.0).contains(&lost_k), "{lost_k} K");
    machine.write_memory(kept, &kept_heat(42.0));
    let mut restarted = after_reset(&machine);
    let kept_k = rise_k(&mut restarted);
    assert!((41.7..42.0).contains(&kept_k), "{kept_k} K");
    let mut damaged = kept_heat(42.0);
    damaged[6] ^= 1;
    machine.write_memory(kept, &damaged);
    let damaged_k = rise_k(&mut after_reset(&machine));
    assert!((114.0..115.0).contains(&damaged_k), "{damaged_k} K");
}

/// Returns the faults (2002h:3), and the text of the last panic.
fn faults(client: &mut Client<BoardBus>) -> (u32, String) {
    let faults = client.read_number(Address::new(index::STATE, 3)).expect("an answer");
    (faults, client.read_text(Address::new(index::LAST_PANIC, 0)).expect("a text"))
}

const fn bit(code: Code) -> u32 {
    1 << (code.number() - 1)
}

/// Clears the faults, and resets the node over its bus.
fn clear_and_reset(client: &mut Client<BoardBus>) {
    client.write(Address::new(index::STATE, 1), &[2]).expect("they are cleared");
    assert_eq!(faults(client).0, 0);
    client.command(NmtCommand::ResetNode).expect("a bus");
    client.bus().await_boot_up();
}

#[test]
fn hard_fault_is_reported_once_after_the_restart() {
    let mut client = started_image();
    // The image never causes one: it continues at an address without memory.
    client.bus().machine().jump(0x7000_0000);
    client.bus().await_boot_up();
    assert_eq!(client.bus().resets, 1);
    let (found, panic) = faults(&mut client);
    assert!(found & bit(Code::PanicBeforeReset) != 0 && panic.contains("hard fault"), "{panic}");
    clear_and_reset(&mut client);
    assert_eq!(faults(&mut client), (0, String::new()));
}

#[test]
fn overwritten_guard_of_the_stack_is_reported_until_the_next_but_one_start() {
    let mut client = started_image();
    let guard = image().label("_stack_end").expect("a label of the linker");
    client.bus().machine().write_memory(guard, &[0; 4]);
    client.bus().run(200 * MILLISECOND);
    assert_eq!(faults(&mut client).0, bit(Code::StackOverflow));
    // The cause is still there.
    client.write(Address::new(index::STATE, 1), &[2]).expect_err("it is present");
    client.command(NmtCommand::ResetNode).expect("a bus");
    client.bus().await_boot_up();
    assert_eq!(faults(&mut client).0, bit(Code::StackOverflow));
    clear_and_reset(&mut client);
    assert_eq!(faults(&mut client).0, 0);
}
