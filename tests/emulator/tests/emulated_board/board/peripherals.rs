//! What the image sets up that a sound course does not show: faults and sensors by their names, priorities, delays.

use super::bus::exchange;
use super::course::{rig, set};
use super::start::{Constant, started};
use crate::common::image;
use embedded_storage::nor_flash::ReadNorFlash;
use emulated_board::Machine;
use emulated_board::chip::flash::StoreContent;
use emulated_board::chip::{CORE_HZ, Chip};
use emulated_board::nvic::FIRST_INTERRUPT;
use firmware::access::AccessSettings;
use firmware::node_settings::{NodeSettings, emit_block};
use firmware::parameter_set::ParameterSet;
use firmware::store::Store;
use firmware::store::memory::MemoryFlash;
use firmware::supervisor::Code;
use std::collections::BTreeSet;

/// Interrupts that the image takes, with their priorities (RM0440, table 97): the loop's and the receiver's. A lower number is
/// more urgent.
const INTERRUPTS: [(usize, i32); 2] = [(18, 0x10), (21, 0x80)];

#[test]
fn interrupts_of_the_image_have_their_priorities() {
    let mut machine = started();
    machine.run(CORE_HZ / 10);
    machine.records_runs = true;
    exchange(&mut machine, 0x601, &[0x40, 0x00, 0x10, 0, 0, 0, 0, 0], 100);
    let taken: BTreeSet<usize> = machine.take_runs().iter().map(|run| run.exception).collect();
    let nvic = &machine.chip().nvic;
    let found: Vec<_> = taken
        .into_iter()
        .map(|exception| (exception - FIRST_INTERRUPT, nvic.priority_of(exception)))
        .collect();
    assert_eq!(found, INTERRUPTS);
}

#[test]
fn fault_of_gate_driver_is_named_and_overcurrent_is_not() {
    let mut joint = rig(&set()).expect("the image starts");
    let at = joint.plant().position_rad();
    joint.arm(at).expect("it arms");
    joint.stage_mut().gate_fault = true;
    (0..5).for_each(|_| joint.step_with_command(0.5, 0.0));
    let faults = joint.latched_faults();
    assert!(faults.contains(Code::GateDriverFault), "{faults:?}");
    assert!(!faults.contains(Code::Overcurrent), "{faults:?}");
}

#[test]
fn thermistors_are_those_of_bridge_and_motor() {
    for (is_bridge, expected, other) in [
        (true, Code::BridgeOvertemperature, Code::MotorOvertemperature),
        (false, Code::MotorOvertemperature, Code::BridgeOvertemperature),
    ] {
        let mut joint = rig(&set()).expect("the image starts");
        let state = joint.board_state_mut();
        let hot = if is_bridge {
            &mut state.bridge_temperature_c
        } else {
            &mut state.motor_temperature_c
        };
        *hot = Some(160.0);
        (0..1100).for_each(|_| joint.step_idle());
        let faults = joint.latched_faults();
        assert!(faults.contains(expected) && !faults.contains(other), "{faults:?}");
    }
}

/// Returns the store of a joint with these settings and the default set.
fn store(settings: &NodeSettings) -> StoreContent {
    let mut store = Store::open(MemoryFlash::<4>::new());
    store
        .save(&emit_block(settings, &ParameterSet::default()), &settings.identity())
        .expect("saved");
    let mut flash = store.into_flash();
    let mut bytes = vec![0; flash.capacity()];
    flash.read(0, &mut bytes).expect("read");
    StoreContent { bytes, torn: Vec::new() }
}

#[test]
fn telemetry_at_5_mbit_is_sent_with_compensated_delay() {
    let settings = NodeSettings {
        data_bit_rate_kbit: 5000,
        fd_telemetry: true,
        access: AccessSettings { is_locked: false, ..AccessSettings::default() },
        ..NodeSettings::default()
    };
    let mut chip = Chip::new(Constant::default());
    chip.flash.set_store(&store(&settings));
    let mut machine = Machine::new(image(), chip).expect("a machine");
    machine.run(CORE_HZ / 10);
    assert_eq!(machine.chip().can.data_bit_rate(), Some(5_000_000));
    exchange(&mut machine, 0, &[1, 1], 3);
    exchange(&mut machine, 0x080, &[1], 3);
    let can = &machine.chip().can;
    assert_eq!((can.sent_fd.len(), can.bus_offs), (1, 0));
}
