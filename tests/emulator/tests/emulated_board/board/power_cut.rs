//! Power cuts while the image saves its parameters (1010h:1): it starts with the old or the new set, whole.
//!
//! One run of the image saves a set; the emulated flash records what it holds if the power is cut during or after each
//! of its operations. The image is started again on these contents: on all of them with `LONG_TESTS`, otherwise on a
//! few: during the first erase, around the first double words, in between, and around the commit, which is last.

use super::course::set;
use crate::common::image;
use canopen_rs::Address;
use compensator_core::can::NodeId;
use emulated_board::chip::flash::StoreContent;
use emulated_board::{BoardDriver, EmulatorError};
use firmware::node::dictionary::index;
use firmware::parameter_set::ParameterSet;
use joint_bus::canopen::Client;
use joint_bus::parameters::write_set;
use joint_rig::{JointRig, PowerUp, RigBus, RigFaults, Stage, stage_at_power_up};
use simulated_machines::joint_plant::{JointPlant, Load, Parameters};

/// Sub-index of the CRC of the active set in the object of the commit.
const ACTIVE_CRC: u8 = 1;

fn start(set: &ParameterSet) -> (PowerUp<'_>, Stage) {
    let start = PowerUp { set: Some(set), commissioned: true, board: true, ..PowerUp::default() };
    let plant = JointPlant::with_phase(&Parameters::default(), Load::Free, [0.7, 2.1], 5);
    (start, stage_at_power_up(&start, plant, &RigFaults::default()))
}

/// Lets the image save another set over the present one; returns the contents that cuts leave.
fn save(old: &ParameterSet, new: &ParameterSet) -> Vec<StoreContent> {
    let (start, stage) = start(old);
    let mut driver = BoardDriver::start(image(), &start, stage).expect("the image starts");
    let cuts = driver.record_cuts();
    let mut rig = JointRig::new(Box::new(driver), RigFaults::default());
    let mut client = Client::new(RigBus::new(&mut rig), NodeId::FIRST);
    write_set(&mut client, new).expect("a set that is accepted");
    assert!(cuts.borrow().is_empty(), "a commit writes no flash");
    client.write(Address::new(index::STORE, 1), b"save").expect("a save");
    drop(client);
    (0..20).for_each(|_| rig.step_idle());
    cuts.take()
}

/// Starts the image on this content and returns the CRC of the set that it uses.
fn crc_after(content: &StoreContent, old: &ParameterSet) -> Result<u32, EmulatorError> {
    let (start, stage) = start(old);
    let driver = BoardDriver::start_with_store(image(), &start, content, stage)?;
    let mut rig = JointRig::new(Box::new(driver), RigFaults::default());
    Ok(rig.read_object(index::COMMIT, ACTIVE_CRC).expect("an answer"))
}

#[test]
fn save_with_power_cut_leaves_old_or_new_set() {
    let old = set();
    let mut new = set();
    new.motor.current_limit_a = 20.0;
    new.friction.compensator.scale = 0.5;
    let cuts = save(&old, &new);
    let all = cuts.len();
    println!("measured: {} flash operations of a save", all / 2);
    assert!(all > 100, "{all}");
    // The set counts with its commit. The copy of the identity follows, six double words with two contents each.
    let (last, commit) = (all - 1, all - 13);
    let chosen: Vec<usize> = if std::env::var_os("LONG_TESTS").is_some() {
        (0..all).collect()
    } else {
        vec![0, 4, 5, all / 3, 2 * all / 3, commit - 1, commit, commit + 1, last]
    };
    let mut kept = [0, 0];
    let expected = chosen.iter().filter(|at| **at >= commit).count();
    for at in chosen {
        let crc = crc_after(&cuts[at], &old).unwrap_or_else(|error| panic!("cut {at}: {error}"));
        assert!([old.crc(), new.crc()].contains(&crc), "cut {at} of {all}: {crc:08x}");
        kept[usize::from(crc == new.crc())] += 1;
    }
    println!("measured: {} starts with the old set, {} with the new", kept[0], kept[1]);
    assert_eq!(kept[1], expected);
}
