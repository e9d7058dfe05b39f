//! Test of the holding brake: the motor presses against the closed brake, before arming or on request (2030h:7 to :14).
//!
//! ```text
//! bridge drives -> ramp to +torque -> hold -> ramp to -torque -> hold -> ramp to 0 -> the brake holds
//! joint turns farther than 2030h:9, or the current does not reach the torque -> bridge opens, brake stays closed
//! ```
//! The friction of the joint holds, too, and a load adds to the torque in its direction and takes from it in the other. So the
//! test shows that brake and friction together hold the torque, in one direction with the load and in the other less it. The
//! compensation is off meanwhile, because its torque would help to turn the joint.
//!
//! There is no clock. A day is 2030h:10 hours of operation since the last test that the brake passed, and the first arming
//! after a start always tests.

use super::{Motion, Refused};
use crate::control::LoopFlags;
use crate::driver::angle::micro;
use crate::joint_node::JointBase;
use crate::node::sdo::Abort;
use compensator_core::refusal;
use compensator_core::text;

/// Time of a ramp from 0 to the torque, ms: slow against the current loop, so that a brake that slips is found at a torque
/// little above its own.
const RAMP_MS: u32 = 150;
/// Time after the last ramp in which the current ends, ms.
const END_MS: u32 = 20;
/// Longest time from arming to a bridge that drives, ms: wake-up of the gate driver, and offsets.
const WAKE_MS: u32 = 400;
/// Share of the torque's current that must flow.
const REACHED_SHARE: f32 = 0.9;
/// Microseconds of an hour.
const HOUR_US: u64 = 3_600_000_000;

/// Result of the last test, 2030h:12.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum BrakeTestResult {
    /// None since the start.
    #[default]
    None = 0,
    /// It runs.
    Running = 1,
    /// The brake held.
    Held = 2,
    /// The joint turned too far.
    Slipped = 3,
    /// The current did not reach the torque.
    NoTorque = 4,
    /// Disarmed, stopped or a fault.
    Interrupted = 5,
}

/// A test under way.
#[derive(Clone, Copy, Debug, Default)]
struct Run {
    /// A master requested it, and the joint is disarmed afterwards.
    is_requested: bool,
    /// Reports until the bridge drives, and since then.
    waited_ms: u32,
    elapsed_ms: u32,
    /// Position at the begin, rad from the arbitrary zero.
    from_rad: f32,
    /// Current, A.
    current_a: f32,
}

/// The test of the holding brake.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct BrakeTest {
    run: Option<Run>,
    result: BrakeTestResult,
    /// Largest way forwards and back, rad.
    ways_rad: [f32; 2],
    /// Time of the last test that the brake passed, us.
    held_us: Option<u64>,
}

impl BrakeTest {
    /// Returns true while a test runs.
    pub(crate) const fn is_running(&self) -> bool {
        self.run.is_some()
    }

    /// Returns the current of the test, A.
    pub(crate) fn current_a(&self) -> f32 {
        self.run.map_or(0.0, |run| run.current_a)
    }

    /// Returns true while a test runs that needs no targets.
    pub(crate) fn is_requested(&self) -> bool {
        self.run.is_some_and(|run| run.is_requested)
    }

    /// Returns true if the last test found a brake that does not hold, or could not press.
    pub(crate) const fn has_failed(&self) -> bool {
        matches!(self.result, BrakeTestResult::Slipped | BrakeTestResult::NoTorque)
    }
}

/// Returns the time of a ramp that began at `from_ms` as a share of its length.
fn ramp(elapsed_ms: u32, from_ms: u32, length_ms: u32) -> f32 {
    elapsed_ms.saturating_sub(from_ms).min(length_ms) as f32 / length_ms as f32
}

impl Motion {
    /// Returns true if arming tests the brake now.
    pub(crate) fn is_brake_test_due(&self, joint: &JointBase) -> bool {
        let drive = &joint.settings.drive;
        let interval_us = u64::from(drive.brake_test_interval_h) * HOUR_US;
        let is_old = interval_us > 0
            && self.brake_test.held_us.is_none_or(|at_us| joint.now_us - at_us >= interval_us);
        !joint.settings.is_in_hil()
            && drive.brake_output != 0
            && drive.brake_test_torque != 0
            && (is_old || self.brake_test.has_failed())
            && !self.is_torque_free_homing()
    }

    /// Starts a test of an armed joint.
    pub(crate) fn begin_brake_test(&mut self, is_requested: bool) {
        let run = Run { is_requested, ..Run::default() };
        self.brake_test.run = Some(run);
        self.brake_test.result = BrakeTestResult::Running;
        self.brake_test.ways_rad = [0.0; 2];
    }

    /// Runs a step of the test with a report.
    pub(crate) fn step_brake_test(&mut self, joint: &JointBase) {
        let Some(mut run) = self.brake_test.run else { return };
        let (report, drive) = (joint.report(), &joint.settings.drive);
        if report.loop_flags.contains(LoopFlags::BRIDGE_OFF) {
            run.waited_ms += 1;
            self.brake_test.run = Some(run);
            if run.waited_ms > WAKE_MS {
                self.end_brake_test(joint, BrakeTestResult::NoTorque);
            }
            return;
        }
        if run.elapsed_ms == 0 {
            run.from_rad = report.turned_rad;
        }
        run.elapsed_ms += 1;
        let way_rad = report.turned_rad - run.from_rad;
        let [forwards, back] = self.brake_test.ways_rad;
        self.brake_test.ways_rad = [forwards.max(way_rad), back.max(-way_rad)];
        let torque_a = f32::from(drive.brake_test_torque) * 1e-3 * joint.rated_current_a();
        let limit_a = self.profile.max_share() * joint.rated_current_a();
        let hold_ms = u32::from(drive.brake_test_ms);
        let down_ms = RAMP_MS + hold_ms;
        let up_ms = down_ms + 2 * RAMP_MS + hold_ms;
        let at_ms = run.elapsed_ms;
        let is_checked = at_ms == down_ms || at_ms == up_ms;
        let flows = report.current_a * run.current_a.signum() >= REACHED_SHARE * torque_a;
        let share = ramp(at_ms, 0, RAMP_MS) - 2.0 * ramp(at_ms, down_ms, 2 * RAMP_MS)
            + ramp(at_ms, up_ms, RAMP_MS);
        run.current_a = (share * torque_a).max(-limit_a).min(limit_a);
        self.brake_test.run = Some(run);
        if way_rad.abs() > drive.brake_test_way as f32 * 1e-6 {
            self.end_brake_test(joint, BrakeTestResult::Slipped);
        } else if is_checked && !flows {
            self.end_brake_test(joint, BrakeTestResult::NoTorque);
        } else if at_ms >= up_ms + RAMP_MS + END_MS {
            self.end_brake_test(joint, BrakeTestResult::Held);
        }
    }

    /// Ends the test. The bridge opens, unless the brake held and the joint was armed to drive.
    #[inline(never)]
    fn end_brake_test(&mut self, joint: &JointBase, result: BrakeTestResult) {
        let Some(run) = self.brake_test.run.take() else { return };
        self.brake_test.result = result;
        let [forwards, back] = self.brake_test.ways_rad;
        match result {
            BrakeTestResult::Slipped => {
                let why = refusal!(
                    "the holding brake slipped: the joint turned by {f32} rad against its test torque (2030h:7, :9)",
                    forwards.max(back)
                );
                self.orders.refusal = Some(Refused::new(Abort::State, why));
            }
            BrakeTestResult::NoTorque => {
                let why = text!("the current did not reach the torque of the brake test (2030h:7)");
                self.orders.refusal = Some(Refused::new(Abort::State, why));
            }
            _ => {}
        }
        if result == BrakeTestResult::Held {
            self.brake_test.held_us = Some(joint.now_us);
            if !run.is_requested {
                return self.begin_driving(joint);
            }
        } else {
            self.brake_test.held_us = None;
        }
        self.disarm();
    }

    /// Ends a test whose joint was disarmed, or stops.
    pub(crate) fn watch_brake_test(&mut self, joint: &JointBase) {
        let is_armed = joint.supervisor.is_armed();
        if self.brake_test.is_running() && (!is_armed || self.stopping.is_to_rest()) {
            self.end_brake_test(joint, BrakeTestResult::Interrupted);
        }
    }

    /// 2030h:12 to :14: result, and largest ways, 1e-6 rad.
    pub(crate) fn brake_test_words(&self) -> [u32; 3] {
        let [forwards, back] = self.brake_test.ways_rad.map(micro);
        [self.brake_test.result as u32, forwards as u32, back as u32]
    }
}
