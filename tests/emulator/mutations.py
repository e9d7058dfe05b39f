"""Mutations of the images and of the boot program: each is a fault, most in the board's code, that a test on the emulator must find.

The image, that of the compact node and the boot program contain them all, built from a copy of the sources: a word in each selects the mutation that
acts. What a constant fixes at compile time is mutated where it is used. Each mutation runs the tests that must fail; without a
mutation, all of these must pass.
"""

import re
import shutil

import images

BOARD = "firmware/src/boards/stm32g474/"
# What boards with this chip family share.
FAMILY = "firmware/src/boards/stm32g4/"
# The board of the compact node.
ESC1 = "firmware/src/boards/b_g431b_esc1/"
BOOT = "firmware/src/bin/boot/"
SINE = "board::course::joint_with_image_follows_sine_of_velocity"
HANGING = "board::course::joint_with_hanging_loop_is_stopped_at_level_of_its_comparators"
START = "board::start::image_after_power_on_sends_boot_up_frame_with_open_bridge"
GATE_FAULT = "board::peripherals::fault_of_gate_driver_is_named_and_overcurrent_is_not"
KINDS = "scenarios::encoder_kinds::encoders_of_all_kinds_drive_and_keep_the_home"
FAULTS = "scenarios::encoder_faults::faults_of_all_encoders_stop_the_joint_or_are_reported"
COMPACT = "scenarios::compact::compact_node_on_its_board_drives_stops_and_keeps_its_set"
JOINT_SIDE = "scenarios::joint_encoder::encoder_of_the_joint_shows_play_and_its_faults_are_found"
DRY_SIDE = "board::dry_side::readings_of_dry_side_are_those_of_its_sensors"

# Name, file, an expression or statement of it, what replaces it, and the test that must fail.
MUTATIONS = [
    ("compare registers of phases a and b swapped", FAMILY + "power_stage.rs",
     "TIMER.ccr(channel).write(|w| w.set_ccr(compare.min(PWM_TOP)));",
     "TIMER.ccr([1, 0, 2][channel]).write(|w| w.set_ccr(compare.min(PWM_TOP)));", SINE),
    ("complementary outputs off", FAMILY + "power_stage.rs",
     "w.set_ccne(channel, true);", "w.set_ccne(channel, false);", SINE),
    ("PWM mode 2 for mode 1", FAMILY + "power_stage.rs", "vals::Ocm::PWM_MODE1", "vals::Ocm::PWM_MODE2", SINE),
    ("PWM aligned to the edge", FAMILY + "power_stage.rs", "vals::Cms::CENTER_ALIGNED1", "vals::Cms::EDGE_ALIGNED", SINE),
    ("alternate function 11 for the break", BOARD + "gate_driver.rs",
     "break_pin.set_as_af_unchecked(BREAK_FUNCTION, AfType::input(Pull::Up));",
     "break_pin.set_as_af_unchecked(11, AfType::input(Pull::Up));", GATE_FAULT),
    ("level of the break pin inverted", BOARD + "gate_driver.rs",
     "self.break_pin.is_low()", "self.break_pin.is_high()", GATE_FAULT),
    ("leak probe at the next channel", BOARD + "sampling.rs",
     "currents.leak.degrade_adc()", "unsafe { embassy_stm32::peripherals::PC2::steal() }.degrade_adc()", DRY_SIDE),
    ("level of safe torque off inverted", BOARD + "slow.rs",
     "self.torque_allowed.each_ref().map(Input::is_high)", "self.torque_allowed.each_ref().map(Input::is_low)", DRY_SIDE),
    ("temperatures swapped", BOARD + "slow.rs", "converters::read_results(pac::ADC3)",
     "{ let [first, second] = converters::read_results(pac::ADC3); [second, first] }",
     "board::peripherals::thermistors_are_those_of_bridge_and_motor"),
    ("sign of the currents", "firmware/src/boards/stm32g474.rs",
     "values.shunt_sign", "-values.shunt_sign", SINE),
    ("sign of the angle", FAMILY + "motor_stage.rs",
     "sample(counts, &self.shunts, angle)", "sample(counts, &self.shunts, angle.map(u32::wrapping_neg))", SINE),
    ("trigger at the other end of the PWM", FAMILY + "power_stage.rs",
     "TIMER.ccr(3).write(|w| w.set_ccr(PWM_TOP - 1));", "TIMER.ccr(3).write(|w| w.set_ccr(1));", SINE),
    ("SPI mode 0 for mode 1", BOARD + "encoder.rs", "config.mode = spi::MODE_1;", "config.mode = spi::MODE_0;", SINE),
    ("DMA of the encoder's answer half a period late", BOARD + "encoder.rs",
     "TIMER.cnt().write(|w| w.set_cnt(LEAD_CYCLES as u16));",
     "TIMER.cnt().write(|w| w.set_cnt(LEAD_CYCLES as u16 - 900));", SINE),
    ("bridge closed before the offsets are measured", FAMILY + "motor_stage.rs",
     "[OffsetFinder::default(); 2]", "{ stage.drive([0.5; 3]); [OffsetFinder::default(); 2] }", START),
    ("level of the comparators half too high", BOARD + "overcurrent.rs",
     "break_current_a(overcurrent_a, scales::BREAK_CEILING_A)", "1.5 * break_current_a(overcurrent_a, scales::BREAK_CEILING_A)",
     HANGING),
    ("watchdog not refreshed", FAMILY + "watchdog.rs",
     "pac::IWDG.kr().write(|w| w.set_key(pac::iwdg::vals::Key::RESET));", "{}", START),
    ("self-test of the comparators left out", FAMILY + "comparators.rs",
     "(is_above, is_below, breaks) == (!self.is_lower, self.is_lower, true)", "breaks",
     "board::start::comparator_without_its_shunt_is_found_before_the_first_pwm"),
    ("transmit elements in a FIFO", FAMILY + "can.rs", "TxBufferMode::Priority", "TxBufferMode::Fifo",
     "board::pdo_timing::process_data_keep_their_time_on_a_bus_with_full_load"),
    ("delay of the transceiver not compensated", FAMILY + "can.rs", "CONTROLLER.dbtp().modify(|w| w.set_tdc(true));", "{}",
     "board::peripherals::telemetry_at_5_mbit_is_sent_with_compensated_delay"),
    ("package received a page behind its place", "firmware/src/boards/stm32g474.rs", "Some(PROGRAM)",
     "Some(firmware::update::Program { other: firmware::update::Slot { start: PROGRAM.other.start + 2048, ..PROGRAM.other },"
     " ..PROGRAM })",
     "board::update::update_writes_the_package_from_the_begin_of_the_other_slot"),
    ("package sought a page behind its place by the boot program", BOOT + "program.rs",
     "select(&mut flash, &SLOTS, &requirement, last_run, is_plausible)",
     "select(&mut flash, &SLOTS.map(|slot| firmware::update::Slot { start: slot.start + 2048, ..slot }),"
     " &requirement, last_run, is_plausible)",
     "board::update::image_linked_for_the_other_slot_is_not_started"),
    ("reset by software is no failure for the boot program", BOOT + "program.rs", "flags.sftrstf()", "false",
     "board::update::trial_that_resets_itself_returns_to_the_old_image"),
    ("deadline of a trial forgotten", "firmware/src/driver/device/parameter_trial.rs",
     "self.base.now_us >= self.trial.deadline_us", "false",
     "scenarios::trials::trials_end_with_the_stored_set_unless_they_are_kept"),
    ("load that the brake held counted twice", "firmware/src/control/velocity_loop.rs",
     "self.integral_a -= offset_a - self.offset_a;", "{}",
     "scenarios::feed_forward::feed_forward_of_a_master_adds_once_and_decays"),
    ("torque of mode 4 without its ramp", "firmware/src/driver/motion/profile_modes.rs",
     "(self.profile_torque_target() - demand).max(-step).min(step)", "(self.profile_torque_target() - demand)",
     "scenarios::modes::profile_modes_ramp_and_change_without_a_jump"),
    ("edge of the touch probe a period early", "firmware/src/driver/device/touch_probe.rs",
     "later_s * report.velocity_rad_s", "(-later_s * report.velocity_rad_s)",
     "scenarios::touch_probe::touch_probe_stores_true_positions_of_edges"),
    ("input of the touch probe at the next pin", "firmware/src/boards/stm32g474.rs",
     "embassy_stm32::gpio::Input::new(wired.touch.input, Pull::Down)",
     "embassy_stm32::gpio::Input::new(unsafe { embassy_stm32::peripherals::PC13::steal() }, Pull::Down)",
     "scenarios::touch_probe::touch_probe_stores_true_positions_of_edges"),
    ("brake test without its bound of the way", "firmware/src/driver/motion/brake_test.rs",
     "way_rad.abs() > drive.brake_test_way as f32 * 1e-6", "(way_rad.abs() > 100.0)",
     "scenarios::brake_test::brake_is_tested_before_arming_and_on_request"),
    ("offset of a master forgotten in a halt", "firmware/src/driver/motion/velocity.rs",
     "self.velocity.control.absorb_feed_forward();", "{}",
     "scenarios::modes::profile_modes_ramp_and_change_without_a_jump"),
    ("change of the mode without the current before", "firmware/src/driver/motion/velocity.rs",
     "self.begin_loaded(if is_moving { velocity_rad_s } else { 0.0 }, current_a);",
     "{ self.begin_loaded(if is_moving { velocity_rad_s } else { 0.0 }, 0.0); }",
     "scenarios::modes::profile_modes_ramp_and_change_without_a_jump"),
    ("counts of an ABZ encoder not compared at its index", "firmware/src/sensors/quadrature.rs",
     "is_checked && lost <= INDEX_TOLERANCE_COUNTS", "is_checked", FAULTS),
    ("counter of one line for both", FAMILY + "counter.rs", "vals::Sms::ENCODER_MODE_3", "vals::Sms::ENCODER_MODE_1", KINDS),
    ("CRC of a BiSS frame not compared", "firmware/src/sensors/biss.rs", "crc(frame, self.steps) == self.residue", "true", FAULTS),
    ("home kept over a reset of an armed joint", "firmware/src/driver/device/kept_home.rs",
     "self.base.is_bridge_in_use() || !self.base.is_standing()", "false", KINDS),
    ("record of the home not marked at arming", "firmware/src/driver/device/stored_home.rs",
     "is_near && !is_outdated && !self.base.is_bridge_in_use()", "is_near && !is_outdated", KINDS),
    ("turns of a BiSS encoder not used for the home", "firmware/src/driver/home.rs",
     "(wrapped_turns(whole + part, set), turns_range(set))", "(part, 1.0)", KINDS),
    ("skipped sector of Hall sensors accepted", "firmware/src/sensors/hall.rs", "direction == 0", "false", FAULTS),
    ("rotor that turns while its encoder stands not reported", "firmware/src/driver/motor_watch.rs",
     "self.unseen.step(report, motor, expected_v)", "false", FAULTS),
    ("position kept after a turn that the encoder did not show", "firmware/src/joint_node/base.rs",
     "self.current_loop.lose_home();", "{}", FAULTS),
    ("Hall level of a period compared with the counts", "firmware/src/sensors/quadrature.rs",
     "is_confirmed && !self.follow_hall(sector)", "!self.follow_hall(sector)", FAULTS),
    ("Hall edges not compared with the counts before the index", "firmware/src/sensors/quadrature.rs",
     "outside <= SECTOR_UNITS / 2 + HALL_MARGIN_UNITS", "true", FAULTS),
    ("sides of the gear not compared", "firmware/src/driver/device/joint_encoder.rs",
     "drives && self.difference_rad.abs() > window_rad", "false", JOINT_SIDE),
    ("jump of the joint's encoder accepted", "firmware/src/driver/device/joint_encoder.rs",
     "self.jumps < MOST_JUMPS", "false", JOINT_SIDE),
    ("joint's encoder taken as of the time of the report", "firmware/src/driver/device/joint_encoder.rs",
     "LATCHED_AFTER_S * report.velocity_rad_s", "0.0", JOINT_SIDE),
    ("sign of the dead time's compensation", "firmware/src/control/dead_time.rs",
     "self.share * bus_v", "-self.share * bus_v", "scenarios::dead_time::dead_time_is_measured_and_compensated"),
    ("self-test of the compact node's comparators left out", ESC1 + "overcurrent.rs",
     "watch.sees_signal(watch.signal)", "true",
     "board::compact::compact_comparator_without_its_shunt_is_found_before_the_first_pwm"),
    ("level of the compact node's comparators half too high", ESC1 + "overcurrent.rs",
     "break_current_a(overcurrent_a, scales::BREAK_CEILING_A)", "1.5 * break_current_a(overcurrent_a, scales::BREAK_CEILING_A)",
     "board::compact::compact_comparators_after_start_have_level_of_the_set"),
    ("Hall sensors of the compact node at the next pins", ESC1 + "encoder.rs",
     "port.idr().read().0 >> first", "port.idr().read().0 >> (first + 1)", COMPACT),
    ("compensation of the compact node left out", "firmware/src/joint_node/base.rs",
     "self.compensation.share()", "0.0", COMPACT),
    ("set of the compact node not stored", "firmware/src/compact/requests.rs",
     "self.write_block(&block, &settings)", "{ let _ = (&block, &settings); Ok(()) }", COMPACT),
    ("commands of the compact node never too old", "firmware/src/compact/device.rs",
     "base.supervisor.observe(&observation, now_us);",
     "{ base.supervisor.record_command(now_us); base.supervisor.observe(&observation, now_us); }", COMPACT),
    ("bus voltage of the duties constant", "firmware/src/control/current_loop.rs",
     "self.bus_v = bus;", "self.bus_v = 48.0 + 0.0 * bus;",
     "scenarios::current_loop::current_loop_at_highest_bandwidth_keeps_its_limits"),
]

# The word that selects a mutation follows this one in a program.
MARK = 0x4D75_7461
SELECTOR = f"""
/// Selects a mutation of the tests: the number of the one that acts, from 0.
static MUTATION: [core::sync::atomic::AtomicU32; 2] =
    [core::sync::atomic::AtomicU32::new({MARK:#x}), core::sync::atomic::AtomicU32::new(u32::MAX)];

/// Returns true if the mutation of this number acts. Not inlined, because the code of the interrupt must fit into CCM.
#[inline(never)]
pub fn is_mutated(number: u32) -> bool {{
    let [_, selected] = core::hint::black_box(&MUTATION);
    selected.load(core::sync::atomic::Ordering::Relaxed) == number
}}
"""
# The selector in a program: that of its library.
SHARED_SELECTOR = "pub(crate) use firmware::boards::is_mutated;"
FOLDER = images.IMAGES_FOLDER / "mutations"
PROGRAMS = ["firmware", "boot", "firmware-esc1"]


def write_sources(workspace):
    """Writes a workspace with the mutated sources."""
    # Another path in the workspace than in this one: otherwise cargo would take the mutated program for the one that ships.
    folder = workspace / "mutated"
    shutil.rmtree(workspace, ignore_errors=True)
    for part in ("firmware", "compensator-core"):
        shutil.copytree(images.ROOT / part, folder / part, ignore=shutil.ignore_patterns("target"))
    shutil.copytree(images.ROOT / ".cargo", workspace / ".cargo")
    for name in ("Cargo.lock", "rust-toolchain.toml"):
        shutil.copy2(images.ROOT / name, workspace / name)
    shutil.copy2(images.ROOT / "memory.x", folder / "memory.x")
    manifest = re.sub(r"(?ms)^(default-)?members = \[.*?^\]\n", "", (images.ROOT / "Cargo.toml").read_text())
    manifest = manifest.replace("[workspace]\n", '[workspace]\nmembers = ["mutated/compensator-core", "mutated/firmware"]\n', 1)
    (workspace / "Cargo.toml").write_text(manifest.replace('path = "', 'path = "mutated/'))
    boards = folder / "firmware/src/boards.rs"
    boards.write_text(f"{boards.read_text()}\n{SHARED_SELECTOR}\n")
    # The library, and the boot program with files of the board, find the selector by the same path.
    library, boot = folder / "firmware/src/lib.rs", folder / BOOT / "main.rs"
    library.write_text(f"{library.read_text()}\n/// Mutations.\npub mod boards {{{SELECTOR}}}\n")
    boot.write_text(f"{boot.read_text()}\nmod boards {{ {SHARED_SELECTOR} }}\n")
    for number, (_, path, text, replacement, _) in enumerate(MUTATIONS):
        source = (folder / path).read_text()
        assert source.count(text) == 1, f"{path} does not have this text once: {text}"
        both = f"if crate::boards::is_mutated({number}) {{ {replacement} }} else {{ {text} }}"
        (folder / path).write_text(source.replace(text, both))


def build():
    """Builds the mutated images and boot program; returns their bytes, by name."""
    workspace = FOLDER / "workspace"
    write_sources(workspace)
    # In the same folder of artefacts, which has the libraries already. The copy has fewer packages than its lock.
    arguments = ["--offline", "-p", "firmware", "--target-dir", str(images.TARGET_FOLDER)]
    selection = images.selection(images.IMAGES["stm32g474"][2])
    built = images.cargo("build", *arguments, "--bin", "firmware", *selection, root=workspace)
    compact = images.selection(images.IMAGES["esc1"][2])
    built |= images.cargo("build", *arguments, "--bin", "firmware-esc1", *compact, root=workspace)
    built |= images.cargo("rustc", *arguments, "--bin", "boot", *selection, "--", "-C", "opt-level=z", root=workspace)
    return {name: built[name].read_bytes() for name in PROGRAMS}


def select(programs, number):
    """Writes the programs with the mutation of this number, or with none; returns the path of the image."""
    selector = MARK.to_bytes(4, "little") + b"\xFF" * 4
    word = b"\xFF" * 4 if number is None else number.to_bytes(4, "little")
    for name, program in programs.items():
        assert program.count(selector) == 1, f"{name} has no selector of the mutations"
        (FOLDER / name).write_bytes(program.replace(selector, selector[:4] + word))
    return FOLDER / "firmware"


def run(run_tests, built):
    """Runs the tests of each mutation, which must fail, and those of all without any, which must pass. `run_tests` runs tests on
    an image; `built` is the folder of the images that ship. Returns the numbers of mutations that were found, and were not."""
    programs = build()
    # Slot B has the image that ships.
    shutil.copy2(built / "firmware-b", FOLDER / "firmware-b")
    passed = failed = 0
    everything = sorted({test for *_, test in MUTATIONS})
    for number, name, tests in [(None, "none", everything), *((at, row[0], [row[-1]]) for at, row in enumerate(MUTATIONS))]:
        passes, failures, code = run_tests(select(programs, number), tests)
        is_run = passes + failures == len(tests)
        is_right = is_run and (failures > 0) == (number is not None) and (code == 0) == (failures == 0)
        print(f"  mutation: {name}: {failures} of {passes + failures} tests failed{'' if is_right else ', NOT AS EXPECTED'}")
        passed, failed = passed + is_right, failed + (not is_right)
        if number is None and not is_right:
            # Tests that fail without a mutation would find any.
            break
    return passed, failed
