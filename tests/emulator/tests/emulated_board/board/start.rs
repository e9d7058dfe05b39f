//! Start of the image, with constant inputs.

use crate::common::image;
use emulated_board::chip::random::Random;
use emulated_board::chip::{CORE_HZ, Chip};
use emulated_board::cycles::FlashAccess;
use emulated_board::world::{Bridge, World};
use emulated_board::{Machine, StopReason};
use firmware::supervisor::Code;

/// A board at rest: 48 V, no current, and an encoder that shows one angle.
#[derive(Default)]
pub struct Constant {
    was_driven: bool,
}

impl World for Constant {
    fn advance(&mut self, _seconds: f64, bridge: Bridge) {
        self.was_driven |= bridge != Bridge::Open;
    }
    fn sample(&mut self, _is_low_side_on: [bool; 2]) {}
    fn analog(&mut self, converter: usize, channel: u32) -> u16 {
        if (converter, channel) == (1, 6) { 2758 } else { 2048 }
    }
    fn encoder(&mut self, _word: u16, _seconds: f64) -> u16 {
        0x0A05
    }
}

pub fn started() -> Machine<Constant> {
    started_with(Random::default())
}

/// Starts the image on a chip with these random numbers.
pub fn started_with(random: Random) -> Machine<Constant> {
    let mut chip = Chip::new(Constant::default());
    chip.random = random;
    Machine::new(image(), chip).expect("a machine")
}

#[test]
fn image_after_power_on_sends_boot_up_frame_with_open_bridge() {
    let mut machine = started();
    assert_eq!(machine.run(CORE_HZ / 10), StopReason::Time, "{:?}", machine.chip().last_fault);
    let (at, frame) = machine.chip().can.sent.front().expect("a boot-up frame");
    assert_eq!((frame.identifier(), frame.data()), (0x701, &[0][..]));
    println!("measured: boot-up frame after {:.1} ms", *at as f64 / CORE_HZ as f64 * 1e3);
    assert!(!machine.chip().world.was_driven);
}

/// Returns true if a board reports at its start that its self-test failed.
fn fails_self_test(unwired_comparator: Option<u32>) -> bool {
    let mut machine = started();
    machine.chip_mut().unwired_comparator = unwired_comparator;
    machine.run(CORE_HZ / 10);
    assert!(!machine.chip().world.was_driven);
    let number = Code::SelfTestFailed.number();
    let sent = &machine.chip().can.sent;
    sent.iter().any(|(_, frame)| frame.identifier() == 0x081 && frame.data()[3] == number)
}

#[test]
fn comparator_without_its_shunt_is_found_before_the_first_pwm() {
    assert!(!fails_self_test(None));
    for number in [1, 2, 3, 5, 6, 7] {
        assert!(fails_self_test(Some(number)), "comparator {number}");
    }
}

#[test]
fn flash_after_start_has_prefetch_and_both_caches() {
    let mut machine = started();
    machine.run(CORE_HZ / 50);
    let expected =
        FlashAccess { wait_states: 4, prefetch: true, code_cache: true, data_cache: true };
    assert_eq!(machine.chip().flash_access, expected);
}

#[test]
fn watchdog_with_stopped_loop_resets_the_chip() {
    let mut machine = started();
    machine.run(CORE_HZ / 10);
    let before = machine.chip().watchdog.refreshes;
    machine.run(CORE_HZ / 10);
    let refreshes = machine.chip().watchdog.refreshes - before;
    assert!((90..=110).contains(&refreshes), "{refreshes} in 100 ms");
    // The background refreshes it only while the loop counts its periods.
    machine.chip_mut().hold_loop_interrupt(CORE_HZ);
    assert_eq!(machine.run(CORE_HZ / 5), StopReason::Reset);
    assert!(machine.chip().is_watchdog_reset());
}

#[test]
fn comparators_after_start_have_levels_of_default_parameters() {
    let mut machine = started();
    machine.run(CORE_HZ / 10);
    // Shunts of 1 mohm, amplified by 20, on 12 bits of 3.3 V; 5 % and 2 A above `overcurrent_a`, 40 A by default, but at
    // most 44 A.
    let amperes = |counts: u16| (f64::from(counts) - 2048.0) * 3.3 / (4096.0 * 0.02);
    for (signal, share) in machine.chip().break_levels.into_iter().zip([1.0, 1.0, 0.5]) {
        let [below, above] = signal.map(|level| level.map(amperes).expect("a level") / share);
        assert!((43.0..=44.0).contains(&above) && (43.0..=44.0).contains(&-below), "{signal:?}");
    }
}
