//! The image of the compact node on the B-G431B-ESC1: its start, and what a sound course does not show.

use crate::common::compact_image;
use crate::scenarios::compact::{HALL, joint, power_up};
use crate::scenarios::rig::Joint;
use emulated_board::chip::wiring::{ESC1, Wiring};
use emulated_board::chip::{CORE_HZ, Chip};
use emulated_board::world::{Bridge, World};
use emulated_board::{BoardDriver, Machine, StopReason};
use firmware::supervisor::Code;
use joint_rig::{InterruptTiming, JointRig, stage_at_power_up};

/// A board at rest: 24 V, no current, 25 deg C.
#[derive(Default)]
struct Rest {
    was_driven: bool,
}

impl World for Rest {
    fn wiring(&self) -> &'static Wiring {
        &ESC1
    }
    fn advance(&mut self, _seconds: f64, bridge: Bridge) {
        self.was_driven |= bridge != Bridge::Open;
    }
    fn sample(&mut self, _is_low_side_on: [bool; 2]) {}
    fn analog(&mut self, converter: usize, channel: u32) -> u16 {
        match (converter, channel) {
            (2, 1) => 2867,
            (1, 5) => 1310,
            _ => 2553,
        }
    }
    fn shunts(&mut self) -> [u16; 3] {
        [160; 3]
    }
    fn encoder(&mut self, _word: u16, _seconds: f64) -> u16 {
        0xFFFF
    }
}

fn started() -> Machine<Rest> {
    Machine::new(compact_image(), Chip::new(Rest::default())).expect("a machine")
}

#[test]
fn compact_image_after_power_on_sends_boot_up_frame_with_open_bridge() {
    let mut machine = started();
    assert_eq!(machine.run(CORE_HZ / 10), StopReason::Time, "{:?}", machine.chip().last_fault);
    let (at, frame) = machine.chip().can.sent.front().expect("a boot-up frame");
    assert_eq!((frame.identifier(), frame.data()), (0x701, &[0][..]));
    println!(
        "measured: B-G431B-ESC1: boot-up frame after {:.1} ms",
        *at as f64 / CORE_HZ as f64 * 1e3
    );
    assert!(!machine.chip().world.was_driven);
}

#[test]
fn compact_watchdog_with_stopped_loop_resets_the_chip() {
    let mut machine = started();
    machine.run(CORE_HZ / 10);
    // The background refreshes it only while the loop counts its periods.
    machine.chip_mut().hold_loop_interrupt(CORE_HZ);
    assert_eq!(machine.run(CORE_HZ / 5), StopReason::Reset);
    assert!(machine.chip().is_watchdog_reset());
}

/// Starts a joint whose current loop trips at 15 A.
fn joint_at_15_a() -> (Joint, BoardDriver) {
    let mut joint = joint(HALL, 0.9);
    if let Some(set) = &mut joint.set {
        (set.motor.overcurrent_a, set.motor.current_limit_a) = (15.0, 12.0);
    }
    let start = power_up(&joint);
    let stage = stage_at_power_up(&start, joint.plant(), &joint.faults);
    let driver = BoardDriver::start_compact(compact_image(), &start, stage).expect("it starts");
    (joint, driver)
}

#[test]
fn compact_comparators_after_start_have_level_of_the_set() {
    let (_, mut driver) = joint_at_15_a();
    let chain = ESC1.overcurrent.chain.expect("they see the shunts");
    for [below, above] in driver.machine_mut().chip().break_levels {
        let out_a = -chain.current_a(above.expect("a level"));
        // 5 % and 2 A above `overcurrent_a`, out of the motor; a count is 0.47 A.
        assert!((17.2..=17.8).contains(&out_a) && below.is_none(), "{out_a} A");
    }
}

#[test]
fn compact_joint_with_hanging_loop_is_stopped_by_its_comparators() {
    let (joint, driver) = joint_at_15_a();
    let mut rig = JointRig::new(Box::new(driver), joint.faults);
    let at = rig.plant().position_rad();
    rig.arm(at).expect("it arms");
    for _ in 0..400 {
        let error = 5.0 - f64::from(rig.master_view().velocity_rad_s);
        rig.step_with_command((4.0 * error).clamp(-12.0, 12.0) as f32, 5.0);
    }
    assert!(rig.is_armed() && rig.plant().velocity_rad_s() > 3.5, "{:?}", rig.latched_faults());
    rig.stage_mut().take_extremes();
    // The timer keeps its last duties while the rotor turns. The watchdog would act after 50 ms.
    rig.stage_mut().interrupts.extend([InterruptTiming::Missed; 30 * 20]);
    (0..30).for_each(|_| rig.step_idle());
    assert!(rig.stage_mut().applied_duty().is_none() && !rig.is_reset(), "it is not stopped");
    let most = rig.stage_mut().take_extremes().current_a;
    println!("measured: B-G431B-ESC1: {most:.1} A where the comparators open the bridge");
    // The level is 17.8 A out of the motor, exact to 6 A. Twice of it may flow into one phase and out of both others. The rest
    // is the rise within the period until they act.
    assert!((12.0..52.0).contains(&most), "{most} A");
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
fn compact_comparator_without_its_shunt_is_found_before_the_first_pwm() {
    assert!(!fails_self_test(None));
    for number in [1, 2, 4] {
        assert!(fails_self_test(Some(number)), "comparator {number}");
    }
}
