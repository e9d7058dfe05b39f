//! Adaptation of the friction levels (2044h): modes, orders, and what keeps them from acting.

use super::STATE_REFUSED;
use super::bench::{Bench, NODE};
use super::parameter_trial::{RETURN, open, order as end_trial, save};
use compensator_core::adaptation::Frozen;
use compensator_core::can::{CommandFrame, Message};
use compensator_core::{Flags, ParameterId};
use firmware::control::LoopFlags;
use firmware::driver::{Boot, LoopReport, NumberedGains};
use firmware::joint_node::Joint as _;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::AdaptationObject;
use firmware::node_settings::InputSource;

const OUT_OF_RANGE: u32 = 0x0609_0030;
const OFF: u8 = 0;
const ON: u8 = 1;
const HOLD: u8 = 2;
const ON_IN_EVERY_MODE: u8 = 3;
const ADOPT: u8 = 1;
const DISCARD: u8 = 2;

fn mode(bench: &mut Bench, mode: u8) -> Result<(), u32> {
    bench.write(index::ADAPTATION, AdaptationObject::MODE, &[mode])
}

fn order(bench: &mut Bench, order: u8) -> Result<(), u32> {
    bench.write(index::ADAPTATION, AdaptationObject::ORDER, &[order])
}

fn state(bench: &mut Bench) -> u32 {
    for _ in 0..20 {
        bench.driver.joint.report(&LoopReport { residual_torque_nm: 0.0, ..LoopReport::default() });
        bench.pass_ms(1);
    }
    bench.number(index::ADAPTATION, AdaptationObject::FROZEN)
}

#[test]
fn adaptation_reports_why_it_learns_nothing() {
    let mut bench = Bench::on_sensors();
    assert_eq!(state(&mut bench), Frozen::Off as u32);
    mode(&mut bench, ON).unwrap();
    assert_eq!(state(&mut bench), Frozen::NotArmed as u32);
    mode(&mut bench, HOLD).unwrap();
    assert_eq!(state(&mut bench), Frozen::Hold as u32);
    assert_eq!(mode(&mut bench, 4), Err(OUT_OF_RANGE));
    for place in 1..=10 {
        assert_eq!(bench.number(index::LEARNT_GAINS, place), 1f32.to_bits());
    }
}

#[test]
fn adaptation_on_trial_is_on_hold_and_returns_with_the_settings() {
    let mut bench = Bench::on_sensors();
    mode(&mut bench, ON).unwrap();
    save(&mut bench).unwrap();
    open(&mut bench, 60_000).unwrap();
    assert_eq!(state(&mut bench), Frozen::Hold as u32, "a trial compares sets");
    assert_eq!(order(&mut bench, ADOPT), Err(STATE_REFUSED));
    mode(&mut bench, OFF).unwrap();
    end_trial(&mut bench, RETURN).unwrap();
    bench.pass_ms(5);
    assert_eq!(bench.number(index::ADAPTATION, AdaptationObject::MODE), u32::from(ON));
}

#[test]
fn adaptation_mode_is_kept_by_a_save_and_orders_need_what_was_learnt() {
    let mut bench = Bench::on_sensors();
    assert_eq!(order(&mut bench, ADOPT), Err(STATE_REFUSED), "it is off");
    mode(&mut bench, ON).unwrap();
    let before = bench.driver.joint.set().clone();
    order(&mut bench, ADOPT).unwrap();
    assert_eq!(*bench.driver.joint.set(), before, "gains of 1 change nothing");
    order(&mut bench, DISCARD).unwrap();
    assert_eq!(order(&mut bench, 3), Err(OUT_OF_RANGE));
    save(&mut bench).unwrap();
    let flash = bench.driver.joint.into_flash();
    let mut bench = Bench::boot(InputSource::Sensors, flash, &Boot::default());
    bench.sent();
    assert_eq!(bench.number(index::ADAPTATION, AdaptationObject::MODE), u32::from(ON));
}

/// Reports of a joint that slides back and forth with this torque against its motion, under Command frames, for a time in s.
fn slide(bench: &mut Bench, torque_nm: f32, seconds: usize) {
    slide_with(bench, torque_nm, 1000 * seconds, LoopFlags::empty(), Flags::empty());
}

/// The same for a time in ms, with these flags.
fn slide_with(
    bench: &mut Bench,
    torque_nm: f32,
    milliseconds: usize,
    loop_flags: LoopFlags,
    flags: Flags,
) {
    for ms in 0..milliseconds {
        let direction = if ms % 1000 < 500 { 1.0 } else { -1.0 };
        bench.give(Message::Command(NODE, CommandFrame::new(1.0, 0.0, ms as u8)));
        if ms == 20 && !bench.driver.joint.is_armed() {
            bench.write(index::STATE, 1, &[1]).unwrap();
        }
        bench.driver.joint.report(&LoopReport {
            bus_voltage_v: Some(48.0),
            phase_currents_a: Some([0.0; 3]),
            velocity_rad_s: direction,
            residual_torque_nm: torque_nm * direction,
            loop_flags,
            flags,
            ..LoopReport::default()
        });
        bench.pass_ms(1);
        bench.sent();
    }
}

#[test]
fn gains_above_the_set_apply_in_torque_modes_on_request_only() {
    let mut bench = Bench::on_sensors();
    bench.write(index::COMPENSATOR, 1, &0.8f32.to_le_bytes()).unwrap();
    let staged = bench.number(index::COMMIT, 2);
    bench.write(index::COMMIT, 3, &staged.to_le_bytes()).unwrap();
    bench.commission();
    bench.start();
    mode(&mut bench, ON_IN_EVERY_MODE).unwrap();
    let coulomb_nm = bench.driver.joint.set().friction.model.get(ParameterId::CoulombTorque);
    slide(&mut bench, 1.6 * coulomb_nm, 40);
    let learnt = f32::from_bits(bench.number(index::LEARNT_GAINS, 1));
    let NumberedGains { number, gains } = bench.driver.joint.learnt();
    assert!(learnt > 1.2 && gains.level == learnt, "{learnt} {gains:?}");
    // What limits the torque hides the friction.
    let (none, no_flags) = (LoopFlags::empty(), Flags::empty());
    for (loop_flags, flags, reason) in [
        (none, no_flags, Frozen::None),
        (LoopFlags::CURRENT_LIMITED, no_flags, Frozen::Saturated),
        (LoopFlags::VOLTAGE_LIMITED, no_flags, Frozen::Saturated),
        (LoopFlags::BRAKING_LIMITED, no_flags, Frozen::Saturated),
        (none, Flags::TORQUE_LIMITED, Frozen::Saturated),
        (none, Flags::VELOCITY_INVALID, Frozen::Inputs),
    ] {
        slide_with(&mut bench, 1.6 * coulomb_nm, 4000, none, no_flags);
        slide_with(&mut bench, 1.6 * coulomb_nm, 400, loop_flags, flags);
        let frozen = bench.number(index::ADAPTATION, AdaptationObject::FROZEN);
        assert_eq!(frozen, reason as u32, "{loop_flags:?} {flags:?}");
    }
    let learnt = f32::from_bits(bench.number(index::LEARNT_GAINS, 1));
    mode(&mut bench, ON).unwrap();
    let bounded = bench.driver.joint.learnt();
    assert_eq!(bounded.gains.level, 1.0, "what is in use");
    assert_ne!(bounded.number, number, "the loop receives them");
    assert!(f32::from_bits(bench.number(index::LEARNT_GAINS, 1)) > 1.2, "what is learnt stays");
    bench.write(index::STATE, 1, &[0]).unwrap();
    bench.write(index::MODE, 0, &[9]).unwrap();
    assert_eq!(bench.driver.joint.learnt().gains.level, learnt, "its own loop holds the speed");
    bench.write(index::MODE, 0, &[10]).unwrap();
    assert_eq!(bench.driver.joint.learnt().gains.level, 1.0);
    // What was learnt belongs to the set that it was learnt with.
    bench.write(index::MODE, 0, &[9]).unwrap();
    bench.write(index::COMPENSATOR, 1, &0.7f32.to_le_bytes()).unwrap();
    let staged = bench.number(index::COMMIT, 2);
    bench.write(index::COMMIT, 3, &staged.to_le_bytes()).unwrap();
    assert_eq!(bench.driver.joint.learnt().gains.level, 1.0);
}
