//! Tests of the state machine.

use super::*;

const SHUTDOWN: u16 = 0x06;
const SWITCH_ON: u16 = 0x07;
const ENABLE: u16 = 0x0F;

fn on() -> Profile {
    Profile { mode: CST, ..Profile::default() }
}

fn enabled() -> Profile {
    let mut drive = on();
    for word in [SHUTDOWN, ENABLE] {
        let _ = drive.control(word, JointState::Safe);
    }
    drive
}

#[test]
fn controlword_sequence_passes_all_states_and_starts_with_shutdown() {
    let mut drive = on();
    assert_eq!(drive.state_bits(FaultState::None), 0x40);
    for stays in [ENABLE, SWITCH_ON, 0x00, 0x80] {
        assert_eq!(drive.control(stays, JointState::Safe), DriveRequest::None);
        assert_eq!(drive.state_bits(FaultState::None), 0x40, "{stays:#x}");
    }
    for (word, bits, request) in [
        (SHUTDOWN, 0x21, DriveRequest::None),
        (SWITCH_ON, 0x23, DriveRequest::None),
        (ENABLE, 0x27 | status::FOLLOWS_TARGET, DriveRequest::Arm),
    ] {
        assert_eq!(drive.control(word, JointState::Safe), request);
        assert_eq!(drive.state_bits(FaultState::None), bits);
    }
    // The same word again requests nothing.
    assert_eq!(drive.control(ENABLE, JointState::Armed), DriveRequest::None);
    let mut off = drive;
    assert_eq!(off.control(0x05, JointState::Armed), DriveRequest::Disarm, "disable voltage");
    assert_eq!(off.state_bits(FaultState::None), 0x40);
    // The other commands stop the joint first.
    for (word, cause, during, after) in [
        (SWITCH_ON, StopCause::DisableOperation, 0x27, 0x23),
        (SHUTDOWN, StopCause::Shutdown, 0x27, 0x21),
        (0x02, StopCause::QuickStop, 0x07, 0x40),
    ] {
        let mut drive = drive;
        assert_eq!(drive.control(word, JointState::Armed), DriveRequest::None, "{word:#x}");
        assert_eq!(drive.stop_cause(), Some(cause), "{word:#x}");
        assert_eq!(drive.state_bits(FaultState::None), during, "{word:#x}");
        let mut resumed = drive;
        assert_eq!(resumed.control(ENABLE, JointState::Armed), DriveRequest::None, "{word:#x}");
        assert_eq!(resumed.stop_cause(), None, "{word:#x}");
        drive.end_stop();
        assert_eq!(drive.state_bits(FaultState::None), after, "{word:#x}");
    }
}

#[test]
fn quick_stop_active_is_left_by_enable_operation_and_disable_voltage_only() {
    let mut drive = enabled();
    let _ = drive.control(0x02, JointState::Armed);
    for word in [SHUTDOWN, SWITCH_ON, 0x02, 0x0B] {
        assert_eq!(drive.control(word, JointState::Armed), DriveRequest::None);
        assert_eq!(drive.state_bits(FaultState::None), 0x07, "{word:#x}");
    }
    let mut off = drive;
    assert_eq!(off.control(0, JointState::Armed), DriveRequest::Disarm);
    assert_eq!(off.state_bits(FaultState::None), 0x40);
    assert_eq!(drive.control(ENABLE, JointState::Armed), DriveRequest::None);
    assert_eq!(drive.state_bits(FaultState::None), 0x27 | status::FOLLOWS_TARGET);
    // A fault during the ramp shows as "fault reaction active".
    assert_eq!(drive.state_bits(FaultState::Reacting), 0x0F);
}

#[test]
fn halt_bit_holds_an_enabled_drive() {
    let mut drive = enabled();
    let _ = drive.control(ENABLE | 0x100, JointState::Armed);
    assert_eq!(drive.stop_cause(), Some(StopCause::Halt));
    assert_eq!(drive.state_bits(FaultState::None), 0x27);
    let _ = drive.control(ENABLE, JointState::Armed);
    assert_eq!(drive.stop_cause(), None);
}

#[test]
fn refused_arming_stays_switched_on_and_can_be_repeated() {
    let mut drive = on();
    let _ = drive.control(SHUTDOWN, JointState::Safe);
    assert_eq!(drive.control(ENABLE, JointState::Safe), DriveRequest::Arm);
    drive.arm_refused();
    assert_eq!(drive.state_bits(FaultState::None), 0x23);
    assert_eq!(drive.control(ENABLE, JointState::Safe), DriveRequest::Arm);
}

#[test]
fn fault_reset_needs_an_edge_and_leads_to_switch_on_disabled() {
    let mut drive = enabled();
    assert_eq!(drive.state_bits(FaultState::Latched), 0x08);
    assert_eq!(drive.control(ENABLE, JointState::Fault), DriveRequest::None);
    assert_eq!(drive.control(0x80, JointState::Fault), DriveRequest::ClearFaults);
    assert_eq!(drive.control(0x80, JointState::Fault), DriveRequest::None, "no edge");
    // After the reset, an unchanged controlword does not restart the drive.
    assert_eq!(drive.control(ENABLE, JointState::Safe), DriveRequest::None);
    assert_eq!(drive.state_bits(FaultState::None), 0x40);
    // After the supervisor disarmed the joint, the drive is not enabled.
    let mut drive = enabled();
    drive.follow_joint(JointState::Safe);
    assert_eq!(drive.state_bits(FaultState::None), 0x40);
}

#[test]
fn homing_starts_on_an_edge_in_homing_mode_when_enabled() {
    const START: u16 = ENABLE | 0x10;
    let mut drive = Profile { mode: HOMING, ..Profile::default() };
    assert_eq!(drive.control(START, JointState::Safe), DriveRequest::None);
    for word in [SHUTDOWN, ENABLE] {
        let _ = drive.control(word, JointState::Safe);
    }
    assert_eq!(drive.state_bits(FaultState::None) | drive.homing_bits(true), 0x0427, "not begun");
    assert_eq!(drive.control(START, JointState::Armed), DriveRequest::Home);
    assert_eq!(drive.control(START, JointState::Armed), DriveRequest::None, "no edge");
    drive.homing = Homing::Attained;
    assert_eq!(drive.state_bits(FaultState::None) | drive.homing_bits(true), 0x1427);
    drive.homing = Homing::Failed;
    assert_eq!(drive.homing_bits(true), 0x2400);
    assert_eq!(drive.homing_bits(false), 0x2000);
    let mut other = enabled();
    assert_eq!(
        (other.control(START, JointState::Armed), other.homing_bits(true)),
        (DriveRequest::None, 0)
    );
}

#[test]
fn target_share_is_limited_by_maximum_torque() {
    let share = |target_permille, max_permille| {
        Profile { target_permille, max_permille, ..on() }.target_share()
    };
    assert_eq!(share(250, 1000), 0.25);
    assert_eq!(share(-250, 100), -0.1);
    assert_eq!((share(i16::MAX, u16::MAX), share(i16::MIN, u16::MAX)), (1.0, -1.0));
    assert_eq!(share(500, 0), 0.0);
}
