//! A fault in the middle of a session: afterwards the joint is safe and has its former set.

use super::{GradeError, LIMITS, SECONDS, Stand, StartStand, joint, options};
use joint_rig::{EncoderFault, JointEvent, service};

/// What happens in the middle of a session.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The bus cable is pulled.
    Cable,
    /// The processor is reset.
    Reset,
    /// The encoder fails.
    Sensor,
    /// The host's process is killed.
    Kill,
}

impl Fault {
    /// All faults.
    pub const ALL: [Self; 4] = [Self::Cable, Self::Reset, Self::Sensor, Self::Kill];

    /// Returns the name.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Cable => "cable",
            Self::Reset => "reset",
            Self::Sensor => "sensor",
            Self::Kill => "kill",
        }
    }
}

/// What is left after a fault.
#[derive(Clone, Debug)]
pub struct FaultGrade {
    /// Seed of the joint.
    pub seed: u64,
    /// The fault.
    pub fault: Fault,
    /// Its time on the bus, s.
    pub at_s: f64,
    /// The session noticed it: it did not save.
    pub is_noticed: bool,
    /// The joint rests and its bridge is not in use.
    pub is_safe: bool,
    /// The active set is the former one.
    pub is_former: bool,
    /// The session's reason.
    pub why: String,
}

/// Time after a fault until which the joint must be safe, ns: the deadline of the trial, the ramp, and a restart.
const SETTLING_NS: u64 = 6_000_000_000;
/// Time from a restored cable until the joint is asked, ns.
const RECONNECTION_NS: u64 = 200_000_000;
/// Speed below which a joint rests, rad/s.
const RESTING_RAD_S: f64 = 0.01;

/// Runs a session with a fault at a share of its time, and examines the joint afterwards.
///
/// # Errors
/// Returns an error if the joint does not start or does not answer afterwards.
pub fn grade_fault(seed: u64, fault: Fault, share: f64) -> Result<FaultGrade, GradeError> {
    grade_fault_on(seed, fault, share, Stand::new)
}

/// Runs a session with a fault as [`grade_fault`] does, on the stand that `start` makes for the joint with its set.
///
/// # Errors
/// As [`grade_fault`].
pub fn grade_fault_on(
    seed: u64,
    fault: Fault,
    share: f64,
    start: StartStand,
) -> Result<FaultGrade, GradeError> {
    let joint = joint(seed, None)?;
    let set = service::starting_set(&joint);
    let stand = start(&joint, &set)?;
    let at_ns = (share * SECONDS * 1e9) as u64;
    match fault {
        Fault::Cable => stand.node().borrow_mut().schedule(at_ns, JointEvent::CableCut),
        Fault::Reset => stand.node().borrow_mut().schedule(at_ns, JointEvent::ProcessorReset),
        Fault::Sensor => {
            stand.node().borrow_mut().schedule(at_ns, JointEvent::Encoder(EncoderFault::High));
        }
        Fault::Kill => stand.kill_host_at(at_ns),
    }
    let session = stand.tune(&options(seed, LIMITS));
    let hub = stand.hub();
    let settled_ns = hub.now_ns().max(at_ns) + SETTLING_NS;
    hub.run_until(settled_ns)?;
    stand.kill_host_at(u64::MAX);
    stand.node().borrow_mut().schedule(settled_ns, JointEvent::CableRestored);
    hub.run_until(settled_ns + RECONNECTION_NS)?;
    let is_resting = stand.node().borrow().plant().velocity_rad_s().abs() < RESTING_RAD_S;
    let is_disarmed = !stand.node().borrow_mut().rig().is_armed();
    let (crc, gain) = (stand.active_crc()?, stand.position_gain()?);
    let (is_noticed, why) = match &session {
        Ok(session) => (!session.is_saved(), format!("{:?}", session.report.outcome)),
        Err(error) => (true, error.to_string()),
    };
    Ok(FaultGrade {
        seed,
        fault,
        at_s: at_ns as f64 * 1e-9,
        is_noticed,
        is_safe: is_resting && is_disarmed,
        is_former: crc == set.crc() && gain == service::drive_settings(&joint).position_gain,
        why,
    })
}
