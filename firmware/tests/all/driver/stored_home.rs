//! The home in flash: when a driver writes and marks its record, and what the next start makes of it.

use super::bench::{Bench, Flash, NODE, frame};
use super::parameter_trial::save;
use super::trial_isolation::{BankFlash, PAGE, with_banks};
use crate::update::bench::package;
use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use firmware::background::BoardState;
use firmware::driver::{Boot, Home, LoopReport};
use firmware::joint_node::Joint as _;
use firmware::loop_parts::StageTraits;
use firmware::node::dictionary::index;
use firmware::node_settings::{InputSource, NodeSettings, emit_block};
use firmware::parameter_set::ParameterSet;
use firmware::sensors::biss::TURN_WORDS;
use firmware::store::Store;
use firmware::store::memory::MemoryError;
use firmware::update::Slot;
use firmware::update::marks::{self, SlotState};
use firmware::update::package::HEADER_BYTES;
use std::cell::Cell;
use std::f32::consts::TAU;
use std::rc::Rc;

const CST: u8 = 10;
const TURN: f32 = (1u64 << 32) as f32;
/// Angle of the encoder at the position of [`POSITION_RAD`].
const ENCODER: u32 = 4_000_000_000;
const POSITION_RAD: f32 = 1.0;
const REST_MS: u64 = 1100;
const ARMED_OR_MOVED: &str =
    "the home is lost: the joint was armed or moved when the previous run ended";

/// Flash that refuses to program when it is worn.
#[derive(Default)]
struct WornFlash {
    flash: Flash,
    is_worn: Rc<Cell<bool>>,
}

impl ErrorType for WornFlash {
    type Error = MemoryError;
}

impl ReadNorFlash for WornFlash {
    const READ_SIZE: usize = Flash::READ_SIZE;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), MemoryError> {
        self.flash.read(offset, bytes)
    }

    fn capacity(&self) -> usize {
        self.flash.capacity()
    }
}

impl NorFlash for WornFlash {
    const WRITE_SIZE: usize = Flash::WRITE_SIZE;
    const ERASE_SIZE: usize = Flash::ERASE_SIZE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), MemoryError> {
        self.flash.erase(from, to)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), MemoryError> {
        if self.is_worn.get() {
            return Err(MemoryError::ProgrammedTwice);
        }
        self.flash.write(offset, bytes)
    }
}

fn start<F: NorFlash>(flash: F) -> Bench<F> {
    let mut bench =
        Bench::boot_on(StageTraits::NONE, InputSource::Sensors, flash, &Boot::default());
    bench.start();
    bench.commission();
    bench.write(index::MODE, 0, &[CST]).unwrap();
    bench
}

/// Reports a joint whose motor has turned by this share of a turn since [`POSITION_RAD`].
fn pass<F: NorFlash>(bench: &mut Bench<F>, milliseconds: u64, turns: f32, velocity_rad_s: f32) {
    pass_at(48.0, bench, milliseconds, [turns, velocity_rad_s]);
}

/// The same at this voltage of the bus.
fn pass_at<F: NorFlash>(
    bus_v: f32,
    bench: &mut Bench<F>,
    milliseconds: u64,
    [turns, velocity_rad_s]: [f32; 2],
) {
    let gear = bench.driver.joint.set().motor.gear_ratio;
    for _ in 0..milliseconds {
        bench.driver.joint.report(&LoopReport {
            bus_voltage_v: Some(bus_v),
            phase_currents_a: Some([0.0; 3]),
            velocity_rad_s,
            position_rad: POSITION_RAD + turns * TAU / gear,
            rotor_angle: ENCODER.wrapping_add((turns.fract() * TURN) as i64 as u32),
            ..LoopReport::default()
        });
        if bench.driver.joint.is_armed() {
            control(bench, 0x0F);
        }
        bench.pass_ms(1);
        bench.sent();
    }
}

fn control<F: NorFlash>(bench: &mut Bench<F>, controlword: u8) {
    bench.driver.receive(&frame(0x201, &[controlword, 0, 0, 0]), bench.now_us);
}

fn arm<F: NorFlash>(bench: &mut Bench<F>) {
    for word in [0x06, 0x07, 0x0F] {
        control(bench, word);
    }
    assert!(bench.driver.joint.is_armed());
}

/// Returns a homed joint at rest with a stored set, and a record.
fn at_rest() -> Bench {
    let mut bench = start(Flash::new());
    save(&mut bench).unwrap();
    let steps = bench.driver.joint.flash().steps();
    pass(&mut bench, REST_MS, 0.0, 0.0);
    assert_eq!(bench.driver.joint.flash().steps(), steps + 2, "one record");
    bench
}

/// Cuts the power, and starts with a motor that has turned by this share of a turn. Returns the restored home and 2028h.
fn home_after_power_cut<F: NorFlash>(bench: Bench<F>, turns: f32) -> (Option<Home>, String) {
    let flash = bench.driver.joint.into_flash();
    let bench = Bench::boot_on(StageTraits::NONE, InputSource::Sensors, flash, &Boot::default());
    home_after_start(bench, turns)
}

/// The same for a bench that has just started.
fn home_after_start<F: NorFlash>(mut bench: Bench<F>, turns: f32) -> (Option<Home>, String) {
    bench.start();
    let rotor_angle = ENCODER.wrapping_add((turns * TURN) as i64 as u32);
    for _ in 0..10 {
        let position_rad = f32::NAN;
        bench.driver.joint.report(&LoopReport {
            rotor_angle,
            position_rad,
            ..LoopReport::default()
        });
        bench.pass_ms(1);
    }
    let home = bench.driver.joint.loop_commands(bench.now_us).home;
    let reason = bench.text(index::REFUSAL);
    ((home.number != 0).then_some(home), reason)
}

#[test]
fn home_after_a_power_cut_at_rest_is_the_nearest_position_or_lost() {
    for (turns, is_known) in
        [(0.0, true), (0.3, true), (-0.39, true), (0.45, false), (-0.45, false)]
    {
        let (home, reason) = home_after_power_cut(at_rest(), turns);
        let expected_rad = POSITION_RAD + turns * TAU / 51.0;
        let is_right = home.is_some_and(|home| (home.position_rad - expected_rad).abs() < 1e-6);
        assert_eq!(is_right, is_known, "{turns}: {home:?}, {reason}");
        assert_eq!(home.is_some(), is_known);
        assert_eq!(reason.contains("0.4"), !is_known, "{turns}: {reason}");
        if !is_known {
            crate::message::check("refusals", "motor turned without power", &reason, &["0.4"]);
        }
    }
}

#[test]
fn home_of_an_armed_joint_is_lost_from_the_tick_of_arming_on() {
    let mut bench = at_rest();
    let steps = bench.driver.joint.flash().steps();
    arm(&mut bench);
    assert_eq!(bench.driver.joint.flash().steps(), steps, "arming does not wait for the flash");
    bench.pass_ms(1);
    assert!(bench.driver.joint.is_armed() && bench.driver.joint.loop_commands(bench.now_us).bridge);
    assert_eq!(bench.driver.joint.flash().steps(), steps + 1, "the mark");
    pass(&mut bench, 3000, 0.0, 0.0);
    assert_eq!(bench.driver.joint.flash().steps(), steps + 1, "an armed joint writes nothing");
    let (home, reason) = home_after_power_cut(bench, 0.0);
    assert_eq!((home, reason.as_str()), (None, ARMED_OR_MOVED));
}

#[test]
fn home_of_an_armed_joint_is_recorded_while_its_supply_fails_if_its_brake_holds_it() {
    for (brake_output, velocity_rad_s, is_known) in
        [(1, 0.0, true), (1, 0.5, false), (0, 0.0, false)]
    {
        let mut bench = at_rest();
        bench.write(index::HOLDING_BRAKE, 1, &[brake_output]).unwrap();
        arm(&mut bench);
        pass(&mut bench, 100, 7.2, velocity_rad_s);
        assert!(bench.driver.joint.is_armed());
        // Below the level of the undervoltage fault: the bridge opens after 2 ms, and the board runs for another 30.
        pass_at(20.0, &mut bench, 30, [7.2, velocity_rad_s]);
        assert!(!bench.driver.joint.is_armed());
        let (home, reason) = home_after_power_cut(bench, 0.5);
        assert_eq!(home.is_some(), is_known, "{brake_output} {velocity_rad_s}: {reason}");
        let turned = home.map_or(7.5, |home| (home.position_rad - POSITION_RAD) * 51.0 / TAU);
        assert!((turned - 7.5).abs() < 1e-3, "{turned}");
    }
}

#[test]
fn home_of_a_disarmed_joint_has_a_record_again_after_a_rest() {
    let mut bench = at_rest();
    arm(&mut bench);
    pass(&mut bench, 100, 7.2, 1.0);
    control(&mut bench, 0x06);
    pass(&mut bench, REST_MS - 300, 7.2, 0.0);
    let steps = bench.driver.joint.flash().steps();
    pass(&mut bench, 400, 7.2, 0.0);
    assert!(!bench.driver.joint.is_armed());
    assert_eq!(bench.driver.joint.flash().steps(), steps + 2);
    let (home, reason) = home_after_power_cut(bench, 0.2);
    let off_rad = home.expect(&reason).position_rad - POSITION_RAD - 7.2 * TAU / 51.0;
    assert!(off_rad.abs() < 1e-5, "{off_rad}");
}

#[test]
fn joint_turned_by_hand_is_lost_until_it_rests_and_needs_one_record() {
    let mut bench = at_rest();
    let steps = bench.driver.joint.flash().steps();
    pass(&mut bench, 100, 0.04, 0.0);
    assert_eq!(bench.driver.joint.flash().steps(), steps, "the record is near enough");
    for turn in 0..100 {
        pass(&mut bench, 10, turn as f32 + 0.25, 0.5);
    }
    assert_eq!(bench.driver.joint.flash().steps(), steps + 1, "no write in each turn");
    let flash = bench.driver.joint.flash().clone();
    let moved = start(flash);
    assert_eq!(home_after_power_cut(moved, 0.0).0, None);
    pass(&mut bench, REST_MS + 600_000, 99.25, 0.0);
    assert_eq!(bench.driver.joint.flash().steps(), steps + 3, "no write at rest");
    let (home, reason) = home_after_power_cut(bench, 0.25);
    let off_rad = home.expect(&reason).position_rad - POSITION_RAD - 99.25 * TAU / 51.0;
    assert!(off_rad.abs() < 1e-4, "{off_rad}");
}

#[test]
fn homing_replaces_the_record() {
    let mut bench = at_rest();
    let steps = bench.driver.joint.flash().steps();
    bench.write(index::STATE, 6, &POSITION_RAD.to_le_bytes()).unwrap();
    pass(&mut bench, 1, 0.0, 0.0);
    assert_eq!(bench.driver.joint.flash().steps(), steps + 1, "the former record is marked");
    pass(&mut bench, REST_MS, 0.0, 0.0);
    assert_eq!(bench.driver.joint.flash().steps(), steps + 3);
}

#[test]
fn joint_moved_by_waves_writes_few_records() {
    let mut bench = at_rest();
    let steps = bench.driver.joint.flash().steps();
    for wave in 0..200 {
        pass(&mut bench, 3000, if wave % 2 == 0 { 0.25 } else { 0.0 }, 0.0);
    }
    let written = bench.driver.joint.flash().steps() - steps;
    // In ten minutes: the remaining 23 records, the set that is saved again once, and a mark each.
    let page_steps = 3072 / 8;
    assert!((23..23 * 3 + page_steps).contains(&written), "{written}");
    let before = bench.driver.joint.flash().steps();
    for wave in 0..40 {
        pass(&mut bench, 3000, if wave % 2 == 0 { 0.25 } else { 0.0 }, 0.0);
    }
    assert_eq!(bench.driver.joint.flash().steps(), before, "nothing until another one is allowed");
}

#[test]
fn flash_that_cannot_mark_the_record_keeps_the_joint_disarmed() {
    let is_worn = Rc::new(Cell::new(false));
    let mut bench = start(WornFlash { flash: Flash::new(), is_worn: is_worn.clone() });
    save(&mut bench).unwrap();
    pass(&mut bench, REST_MS, 0.0, 0.0);
    is_worn.set(true);
    arm(&mut bench);
    bench.pass_ms(1);
    assert!(
        !bench.driver.joint.is_armed() && !bench.driver.joint.loop_commands(bench.now_us).bridge
    );
    bench.check_refusal("home that cannot be marked", &[]);
    assert!(home_after_power_cut(bench, 0.0).0.is_some(), "it has not moved");
}

#[test]
fn joint_without_a_stored_set_or_a_home_writes_nothing() {
    let mut bench = start(Flash::new());
    pass(&mut bench, 10_000, 0.0, 0.0);
    assert_eq!(bench.driver.joint.flash().steps(), 0);
    let (home, reason) = home_after_power_cut(bench, 0.0);
    assert_eq!((home, reason.as_str()), (None, ""));
}

const TURN_BITS: u32 = 12;

/// Returns flash with the set of a joint that has a BiSS encoder of 18 bits and 4096 turns.
fn biss_flash() -> Flash {
    let mut set = ParameterSet::default();
    set.sensors.encoder_kind = 5.0;
    set.sensors.biss_turn_bits = TURN_BITS as f32;
    let source = InputSource::Sensors;
    let settings = NodeSettings { node: NODE, source, ..NodeSettings::default() };
    let mut store = Store::open(Flash::new());
    store.save(&emit_block(&settings, &set), &settings.identity()).unwrap();
    store.into_flash()
}

/// Returns the first words of a frame of this encoder, and its angle.
fn biss(turns: f64) -> ([u16; TURN_WORDS], u32) {
    let position =
        (turns * f64::from(1 << 18)).round() as i64 as u64 & ((1 << (18 + TURN_BITS)) - 1);
    // Idle, busy, start and CDS; error and warning follow the position.
    let line = (0b1_1010 << (18 + TURN_BITS) | position) << 7 | 0b110_0000;
    ([28, 14, 0].map(|shift| (line >> shift & 0x3FFF) as u16), (position << 14) as u32)
}

/// Reports a joint at rest at this position, rad, whose encoder has turned this far.
fn rest_with_biss(bench: &mut Bench, milliseconds: u64, position_rad: f32, turns: f64) {
    let (words, encoder) = biss(turns);
    for _ in 0..milliseconds {
        bench.driver.joint.report(&LoopReport {
            position_rad,
            turned_rad: if position_rad.is_nan() { 0.0 } else { position_rad },
            rotor_angle: encoder,
            ..LoopReport::default()
        });
        bench
            .driver
            .joint
            .take_board_state(&BoardState { biss: Some(words), ..BoardState::default() });
        bench.pass_ms(1);
    }
}

#[test]
fn turns_of_the_encoder_give_the_home_after_any_motion_within_their_range() {
    for (turned, is_known) in [(0.0, true), (3.45, true), (-700.6, true), (1900.0, false)] {
        let mut bench = start(biss_flash());
        rest_with_biss(&mut bench, REST_MS, POSITION_RAD, 4090.9);
        let mut bench = start(bench.driver.joint.into_flash());
        rest_with_biss(&mut bench, 50, f32::NAN, 4090.9 + turned);
        let home = bench.driver.joint.loop_commands(bench.now_us).home;
        assert_eq!(home.number != 0, is_known, "{turned}");
        if is_known {
            let off_rad = home.position_rad - POSITION_RAD - turned as f32 * TAU / 51.0;
            assert!(off_rad.abs() < 1e-4, "{turned}: {off_rad}");
        } else {
            bench.check_refusal("turns beyond the range of the encoder", &["0.4"]);
        }
    }
}

#[test]
fn turns_that_contradict_the_motion_keep_no_home() {
    let mut bench = start(biss_flash());
    rest_with_biss(&mut bench, REST_MS, POSITION_RAD, 7.25);
    // The joint has moved by a turn of the motor, and the count of turns by two.
    let steps = bench.driver.joint.flash().steps();
    rest_with_biss(&mut bench, REST_MS, POSITION_RAD + TAU / 51.0, 9.25);
    bench.check_refusal("turns that contradict the motion", &[]);
    assert_eq!(bench.driver.joint.flash().steps(), steps + 1, "the mark");
    let mut bench = start(bench.driver.joint.into_flash());
    rest_with_biss(&mut bench, 50, f32::NAN, 9.25);
    assert_eq!(bench.driver.joint.loop_commands(bench.now_us).home.number, 0);
}

#[test]
fn program_on_trial_does_not_use_the_record_of_the_home() {
    for is_confirmed in [true, false] {
        let mut bench = with_banks(BankFlash::new(), 0);
        bench.start();
        bench.commission();
        bench.write(index::MODE, 0, &[CST]).unwrap();
        save(&mut bench).unwrap();
        pass(&mut bench, REST_MS, 0.0, 0.0);
        let mut flash = bench.driver.joint.into_flash();
        // An image that was received and started once; the one before it may have moved the joint since the record.
        let slot = Slot { start: 0, marks: 3 * PAGE };
        let image = package(2, 1);
        flash.erase(0, PAGE).unwrap();
        flash.write(0, &image.bytes[..HEADER_BYTES]).unwrap();
        marks::receive(&mut flash, &slot, &image.header, 1).unwrap();
        let SlotState::Image(state) = marks::state(&mut flash, &slot) else { panic!("no image") };
        marks::begin_trial(&mut flash, &slot, &state).unwrap();
        if is_confirmed {
            marks::confirm(&mut flash, &slot, &state).unwrap();
        }
        let (home, reason) = home_after_start(with_banks(flash, 0), 0.0);
        assert_eq!(home.is_some(), is_confirmed, "{home:?}, {reason}");
    }
}
