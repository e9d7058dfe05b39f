//! Tests of parameters: refused with a reason, committed in two steps, kept over a restart.

use super::STATE_REFUSED;
use super::bench::{Bench, Flash};
use compensator_core::{LawKind, ParameterId, record};
use firmware::control::MotorParameters;
use firmware::driver::Boot;
use firmware::loop_parts::StageTraits;
use firmware::node::dictionary::{Access, LOAD_SIGNATURE, OBJECTS, SAVE_SIGNATURE, index};
use firmware::node_settings::InputSource;
use firmware::parameter_set::ParameterSet;
use firmware::store::memory::TornStep;
use firmware::supervisor::Thresholds;

const SCALE: u8 = 1;

fn scale(bench: &mut Bench) -> f32 {
    f32::from_bits(bench.number(index::COMPENSATOR, SCALE))
}

fn write_scale(bench: &mut Bench, value: f32) -> Result<(), u32> {
    bench.write(index::COMPENSATOR, SCALE, &value.to_le_bytes())
}

fn commit(bench: &mut Bench) -> Result<(), u32> {
    let staged = bench.number(index::COMMIT, 2);
    bench.write(index::COMMIT, 3, &staged.to_le_bytes())
}

#[test]
fn every_object_can_be_read_or_returns_its_abort_code() {
    let mut bench = Bench::hil();
    for object in OBJECTS {
        for sub_index in 0..=object.highest_sub_index() {
            let entry = object.entry(sub_index).unwrap();
            let value = bench.read(object.index, sub_index);
            let is_list = object.index == index::ERROR_FIELD && sub_index > 0;
            match value {
                Ok(value) => {
                    assert_ne!(entry.access, Access::WriteOnly, "{entry:?}");
                    let length = entry.data.length();
                    assert!(length.is_none_or(|length| length == value.len()), "{entry:?}");
                }
                Err(0x0601_0001) => assert_eq!(entry.access, Access::WriteOnly, "{entry:?}"),
                // The list of errors is as long as there are errors.
                Err(0x0609_0011) => assert!(is_list, "{object:?} {sub_index}"),
                // There is no capture, and no trend.
                Err(0x0800_0020) => {
                    assert!([index::SCOPE, index::LEVEL_TREND].contains(&object.index));
                }
                Err(code) => panic!("{object:?} {sub_index}: {code:08x}"),
            }
        }
    }
    assert_eq!(bench.read(0x2FFF, 0), Err(0x0602_0000));
    assert_eq!(bench.read(index::STATE, 99), Err(0x0609_0011));
}

/// Excluded: change parameters of an armed joint.
#[test]
fn write_while_armed_or_out_of_range_is_refused_with_a_reason() {
    let mut bench = Bench::hil();
    bench.start();
    bench.write(index::STATE, 1, &[1]).unwrap();
    assert_eq!(write_scale(&mut bench, 0.5), Err(STATE_REFUSED));
    assert_eq!(bench.write(index::OPERATION, 1, &[0]), Err(STATE_REFUSED));
    assert_eq!(bench.write(index::STORE, 1, &SAVE_SIGNATURE.to_le_bytes()), Err(STATE_REFUSED));
    bench.write(index::STATE, 1, &[0]).unwrap();
    write_scale(&mut bench, 0.5).unwrap();
    // Too high, read only, too long, too short, unknown.
    assert_eq!(write_scale(&mut bench, 1.5), Err(0x0609_0030));
    bench.check_refusal("scale above its bound", &["scale = 1.5:", " 1:"]);
    assert_eq!(bench.write(index::DEVICE_TYPE, 0, &[0; 4]), Err(0x0601_0002));
    assert_eq!(bench.write(index::HEARTBEAT, 0, &[0; 4]), Err(0x0607_0012));
    assert_eq!(bench.write(index::COMPENSATOR, SCALE, &[0; 2]), Err(0x0607_0013));
    assert_eq!(bench.write(index::STORE, 1, &1u32.to_le_bytes()), Err(0x0800_0020));
    assert_eq!(scale(&mut bench), 0.5);
}

#[test]
fn staged_values_have_no_effect_before_their_commit() {
    let mut bench = Bench::hil();
    let active = bench.number(index::COMMIT, 1);
    write_scale(&mut bench, 0.5).unwrap();
    assert_eq!(bench.number(index::COMMIT, 1), active);
    assert_eq!(bench.write(index::COMMIT, 3, &active.to_le_bytes()), Err(0x0800_0020));
    let [meant, staged] = [active, bench.number(index::COMMIT, 2)].map(|crc| format!("{crc:08x}"));
    let reason = bench.text(index::REFUSAL);
    crate::message::require(&reason, &[&meant, &staged]);
    let reason = reason.replace(&meant, "MEANT").replace(&staged, "STAGED");
    crate::message::check("refusals", "commit of another set", &reason, &[]);
    bench.write(index::COMMIT, 4, &[1]).unwrap();
    assert_eq!(scale(&mut bench), 0.9);
    write_scale(&mut bench, 0.5).unwrap();
    commit(&mut bench).unwrap();
    assert_ne!(bench.number(index::COMMIT, 1), active);
    assert_eq!(bench.driver.joint.set().friction.compensator.scale, 0.5);
}

#[test]
fn record_that_is_committed_is_read_back() {
    let mut bench = Bench::hil();
    let mut set = ParameterSet::default();
    set.friction.model.law = LawKind::ImprovedLugre;
    set.friction.model.set(ParameterId::ViscousFriction, 0.3);
    set.motor.inertia_kg_m2 = 0.2;
    bench.write(index::COMMIT, 5, &record::emit(&set.friction)).unwrap();
    bench.write(index::COMMIT, 6, &set.emit_drive()).unwrap();
    bench.write(index::COMMIT, 3, &set.crc().to_le_bytes()).unwrap();
    assert_eq!(bench.driver.joint.set(), &set);
    assert_eq!(bench.read(index::COMMIT, 5).unwrap(), record::emit(&set.friction));
    let mut wrong = record::emit(&set.friction);
    wrong[100] ^= 4;
    assert_eq!(bench.write(index::COMMIT, 5, &wrong), Err(0x0609_0030));
    bench.check_refusal("damaged record", &["CRC"]);
}

fn restarted(bench: Bench) -> Bench {
    Bench::boot(InputSource::Bus, bench.driver.joint.into_flash(), &Boot::default())
}

#[test]
fn saved_parameters_survive_a_restart() {
    let mut bench = Bench::hil();
    write_scale(&mut bench, 0.5).unwrap();
    commit(&mut bench).unwrap();
    let mut bench = restarted(bench);
    assert_eq!(scale(&mut bench), 0.9);
    write_scale(&mut bench, 0.5).unwrap();
    commit(&mut bench).unwrap();
    bench.write(index::OPERATION, 6, &[9]).unwrap();
    bench.write(index::STORE, 1, &SAVE_SIGNATURE.to_le_bytes()).unwrap();
    let mut bench = restarted(bench);
    // The new node number is in use now.
    assert_eq!(bench.sent()[0].identifier(), 0x709);
    assert_eq!(bench.driver.joint.set().friction.compensator.scale, 0.5);
}

#[test]
fn number_type_that_the_driver_lacks_is_refused() {
    let mut bench = Bench::hil();
    let refused = |bench: &mut Bench, code: u8| {
        assert_eq!(bench.write(index::OPERATION, 2, &[code]), Err(0x0609_0030));
        bench.check_refusal("type of numbers", &["number:", "0 (f32)"]);
        assert_eq!(bench.number(index::OPERATION, 2), 0);
    };
    refused(&mut bench, 2);
    if cfg!(feature = "fixed") {
        bench.write(index::OPERATION, 2, &[1]).unwrap();
        bench.write(index::STORE, 1, &SAVE_SIGNATURE.to_le_bytes()).unwrap();
        assert_eq!(restarted(bench).number(index::OPERATION, 2), 1);
    } else {
        refused(&mut bench, 1);
    }
}

#[test]
fn restored_defaults_apply_from_the_next_start() {
    let mut bench = Bench::hil();
    write_scale(&mut bench, 0.5).unwrap();
    commit(&mut bench).unwrap();
    bench.write(index::STORE, 1, &SAVE_SIGNATURE.to_le_bytes()).unwrap();
    bench.write(index::RESTORE, 1, &LOAD_SIGNATURE.to_le_bytes()).unwrap();
    assert_eq!(scale(&mut bench), 0.5);
    let mut bench = restarted(bench);
    assert_eq!(scale(&mut bench), 0.9);
}

#[test]
fn power_cut_while_saving_keeps_one_complete_set() {
    let mut first = Bench::hil();
    write_scale(&mut first, 0.5).unwrap();
    commit(&mut first).unwrap();
    first.write(index::STORE, 1, &SAVE_SIGNATURE.to_le_bytes()).unwrap();
    let flash = first.driver.joint.into_flash();
    let mut scales = Vec::new();
    for step in 0.. {
        let mut cut: Flash = flash.clone();
        cut.cut_power(step, TornStep::Nothing);
        let mut bench = Bench::boot(InputSource::Bus, cut, &Boot::default());
        write_scale(&mut bench, 0.7).unwrap();
        commit(&mut bench).unwrap();
        let saved = bench.write(index::STORE, 1, &SAVE_SIGNATURE.to_le_bytes());
        let mut flash = bench.driver.joint.into_flash();
        let was_cut = !flash.has_power();
        assert_eq!(saved.is_err(), was_cut);
        flash.power_on();
        let mut bench = Bench::boot(InputSource::Bus, flash, &Boot::default());
        scales.push(scale(&mut bench));
        if !was_cut {
            break;
        }
    }
    // Every step of a save was cut, and the last save was complete.
    assert!(scales.len() > 50, "{}", scales.len());
    assert!(scales.iter().all(|scale| [0.5, 0.7].contains(scale)), "{scales:?}");
    assert_eq!((scales.first(), scales.last()), (Some(&0.5), Some(&0.7)));
}

#[test]
fn model_band_can_be_set() {
    let mut bench = Bench::hil();
    bench.write(index::WATCH_PARAMETERS, 1, &0.02f32.to_le_bytes()).unwrap();
    commit(&mut bench).unwrap();
    assert_eq!(bench.driver.joint.set().watch.band_nm, 0.02);
    bench.write(index::WATCH_PARAMETERS, 1, &(-1f32).to_le_bytes()).unwrap();
    assert!(commit(&mut bench).is_err());
    assert!(bench.text(index::REFUSAL).starts_with("band_nm = -1"));
}

#[test]
fn currents_beyond_what_the_board_measures_are_refused_with_their_bound() {
    let stage = StageTraits { encoder_age_s: 52e-6, current_max_a: 66.0, ..StageTraits::NONE };
    let place = |names: &[&str], name| {
        names.iter().position(|known| *known == name).expect("a parameter") as u8 + 1
    };
    let motor = |name| place(&MotorParameters::NAMES, name);
    let cases = [
        (
            vec![
                (index::MOTOR, motor("current_limit_a"), 1e4f32),
                (index::MOTOR, motor("overcurrent_a"), 1.2e4),
            ],
            &["current_limit_a = 10000:", " 60"][..],
        ),
        (vec![(index::MOTOR, motor("overcurrent_a"), 66.5)], &["overcurrent_a = 66.5:", " 66"]),
        (
            vec![(index::THRESHOLDS, place(&Thresholds::NAMES, "overcurrent_a"), 100.0)],
            &["overcurrent_a = 100:", " 66"],
        ),
        // The loop would refuse the sum of both delays.
        (vec![(index::MOTOR, motor("encoder_delay_s"), 1e-3)], &["encoder_delay_s"]),
    ];
    let mut reasons = String::new();
    for (values, parts) in cases {
        let mut bench = Bench::on_stage(stage);
        for (object, sub_index, value) in values {
            bench.write(object, sub_index, &value.to_le_bytes()).unwrap();
        }
        assert_eq!(commit(&mut bench), Err(0x0609_0030), "{parts:?}");
        let found = bench.text(index::REFUSAL);
        assert!(found.starts_with(parts[0]), "{found}");
        crate::message::require(&found, parts);
        reasons += &format!("{found}\n");
    }
    crate::message::check("refusals", "currents beyond the sensors", &reasons, &[]);
    let mut bench = Bench::on_stage(stage);
    bench.write(index::MOTOR, motor("overcurrent_a"), &66f32.to_le_bytes()).unwrap();
    bench.write(index::MOTOR, motor("current_limit_a"), &60f32.to_le_bytes()).unwrap();
    commit(&mut bench).unwrap();
}
