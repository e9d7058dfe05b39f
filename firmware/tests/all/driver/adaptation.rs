//! Adaptation of the friction levels (2044h): modes, orders, and what keeps them from acting.

use super::STATE_REFUSED;
use super::bench::Bench;
use super::parameter_trial::{RETURN, open, order as end_trial, save};
use compensator_core::adaptation::Frozen;
use firmware::driver::{Boot, LoopReport};
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::AdaptationObject;
use firmware::node_settings::InputSource;

const OUT_OF_RANGE: u32 = 0x0609_0030;
const OFF: u8 = 0;
const ON: u8 = 1;
const HOLD: u8 = 2;
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
        bench.driver.report(&LoopReport { residual_torque_nm: 0.0, ..LoopReport::default() });
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
    assert_eq!(mode(&mut bench, 3), Err(OUT_OF_RANGE));
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
    let before = bench.driver.set().clone();
    order(&mut bench, ADOPT).unwrap();
    assert_eq!(*bench.driver.set(), before, "gains of 1 change nothing");
    order(&mut bench, DISCARD).unwrap();
    assert_eq!(order(&mut bench, 3), Err(OUT_OF_RANGE));
    save(&mut bench).unwrap();
    let flash = bench.driver.into_flash();
    let mut bench = Bench::boot(InputSource::Sensors, flash, &Boot::default());
    bench.sent();
    assert_eq!(bench.number(index::ADAPTATION, AdaptationObject::MODE), u32::from(ON));
}
