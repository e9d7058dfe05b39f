//! A bus master that moves a joint in cyclic synchronous position mode (CiA 402, mode 8) and records it at 1 kHz.
//!
//! ```text
//! every 5 ms   controlword, target position      receive PDO 1, mapped anew
//! every 1 ms   SYNC
//!        <---  velocity, position; torque; statusword, position error      after each SYNC
//! every 0.5 s  renewal of a trial, if one is open
//! ```
//! The mappings are not stored in the joint: they end with a reset of its communication, which [`Master::leave`] requests.
//! The bus defines the time, so that the same code moves a joint on a real bus and in virtual time.

mod error;

pub use error::MasterError;

use crate::motion::{Motion, MotionBuilder, MotionLimits, TARGET_PERIOD_S};
use crate::preflight::{FollowingWindow, InterpolationTime};
use crate::recording::{Recording, Row};
use canopen_rs::{Address, NmtCommand};
use compensator_core::can::{Frame, Message, NodeId, SyncFrame, cob_id};
use firmware::driver::profile::CSP;
use firmware::node::dictionary::index::{self, TRIAL};
use firmware::node::dictionary::records::TrialObject;
use joint_bus::bus::Bus;
use joint_bus::canopen::{Client, download_request};
use joint_bus::codes::{FIRST_FAULT, code_names};
use joint_trace::CanFrame;

/// Time between two SYNCs, ns.
const SYNC_PERIOD_NS: u64 = 1_000_000;
/// SYNCs from one target to the next.
const SYNCS_PER_TARGET: u64 = (TARGET_PERIOD_S * 1e3) as u64;
/// Time between two targets, ms.
pub const TARGET_TIME: InterpolationTime =
    InterpolationTime { period: SYNCS_PER_TARGET as u8, exponent: -3 };
/// Time without a report after which the joint counts as silent, ns. It is below the drive's own watchdog of 100 ms.
const SILENCE_NS: u64 = 60_000_000;
/// Longest time until the drive is enabled, ns: the bridge finds its offsets, and a holding brake opens in it.
const ENABLING_NS: u64 = 6_000_000_000;
/// SYNCs from one renewal of a trial to the next.
const SYNCS_PER_RENEWAL: u64 = 500;
/// Time to which a renewal sets the deadline of a trial, ms.
pub const TRIAL_DEADLINE_MS: u16 = 2000;

/// Time for which a joint that presses against a stop is allowed to, in SYNCs.
const PRESSING_SYNCS: u32 = 100;
/// Speed below which a joint stands, as a share of the largest speed of its motions.
const STANDING_SHARE: f64 = 0.02;
/// Bit of the statusword: the current or another value is limited.
const INTERNAL_LIMIT: u16 = 1 << 11;

/// Controlwords.
const SHUTDOWN: u16 = 0x06;
const SWITCH_ON: u16 = 0x07;
const ENABLE: u16 = 0x0F;

/// States in the statusword.
const STATE_MASK: u16 = 0x6F;
const ENABLED: u16 = 0x27;
const FAULT_MASK: u16 = 0x4F;
const FAULT: u16 = 0x08;
const FAULT_REACTION: u16 = 0x0F;

/// A master of one joint.
pub struct Master<B> {
    client: Client<B>,
    node: NodeId,
    limits: MotionLimits,
    is_interrupted: Box<dyn Fn() -> bool>,
    controlword: u16,
    /// Target of the last cycle, rad.
    target_rad: f64,
    syncs: u64,
    /// SYNCs since the first target of a motion.
    phase: u64,
    due_ns: u64,
    last: Row,
    reported_ns: u64,
    /// A trial is open on the drive.
    has_trial: bool,
    /// The drive was enabled, and not disabled since.
    is_operating: bool,
    /// Position error at which a motion is ended, rad.
    error_guard_rad: f64,
    /// SYNCs since which the joint stands with its current at the limit.
    pressing_syncs: u32,
}

impl<B: Bus> Master<B> {
    /// Creates a master. `is_interrupted` is asked every cycle.
    pub fn new(
        client: Client<B>,
        node: NodeId,
        limits: MotionLimits,
        is_interrupted: Box<dyn Fn() -> bool>,
    ) -> Self {
        let last = Row {
            radial_force_n: f64::NAN,
            pressure_diff_pa: f64::NAN,
            temperature_c: f64::NAN,
            ..Row::default()
        };
        Self {
            client,
            node,
            limits,
            is_interrupted,
            controlword: 0,
            target_rad: 0.0,
            syncs: 0,
            phase: 0,
            due_ns: 0,
            last,
            reported_ns: 0,
            has_trial: false,
            is_operating: false,
            error_guard_rad: f64::INFINITY,
            pressing_syncs: 0,
        }
    }

    /// Returns the client, for objects. The joint must be disarmed: no targets are sent meanwhile.
    pub fn client(&mut self) -> &mut Client<B> {
        &mut self.client
    }

    /// Returns the last report of the joint.
    pub fn last(&self) -> &Row {
        &self.last
    }

    /// Returns true if a trial is open, which is renewed while the joint moves.
    pub fn has_trial(&self) -> bool {
        self.has_trial
    }

    /// Sets whether a trial is open on the drive.
    pub(crate) fn set_trial(&mut self, has_trial: bool) {
        self.has_trial = has_trial;
    }

    /// Sets the position error, rad, at which a motion is ended and the drive disabled.
    pub fn set_error_guard(&mut self, error_rad: f64) {
        self.error_guard_rad = error_rad;
    }

    /// Sets the time between two targets (60C2h). The joint must be disarmed.
    ///
    /// # Errors
    /// The joint refuses it or does not answer.
    pub fn set_interpolation(&mut self, time: InterpolationTime) -> Result<(), MasterError> {
        self.write(index::INTERPOLATION_TIME, 1, &[time.period])?;
        self.write(index::INTERPOLATION_TIME, 2, &time.exponent.to_le_bytes())
    }

    /// Sets the largest following error (6065h) and its time (6066h). The joint must be disarmed.
    ///
    /// # Errors
    /// The joint refuses it or does not answer.
    pub fn set_following_window(&mut self, window: FollowingWindow) -> Result<(), MasterError> {
        self.write(index::FOLLOWING_WINDOW, 0, &window.error_micro_rad.to_le_bytes())?;
        self.write(index::FOLLOWING_TIME, 0, &window.time_ms.to_le_bytes())
    }

    /// Maps the PDOs and selects the mode. The joint must be disarmed.
    ///
    /// # Errors
    /// The joint refuses an object or does not answer.
    pub fn configure(&mut self) -> Result<(), MasterError> {
        let node = u32::from(self.node.number());
        let [controlword, target] = [0x6040_0010u32, 0x607A_0020];
        let [status, error] = [0x6041_0010u32, 0x60F4_0020];
        self.map(
            index::RECEIVE_DRIVE,
            u32::from(cob_id::RPDO_1) + node,
            &[controlword, target],
            255,
        )?;
        // The answer's identifier carries the state of the drive during the session.
        let free = u32::from(cob_id::TPDO_1) + node;
        self.write(index::TRANSMIT_ANSWER, 1, &(free | 1 << 31).to_le_bytes())?;
        self.map(index::TRANSMIT_DRIVE, free, &[status, error], 1)?;
        for every_sync in [index::TRANSMIT_MOTION, index::TRANSMIT_TORQUE] {
            self.write(every_sync, 2, &[1])?;
        }
        self.set_interpolation(TARGET_TIME)?;
        self.write(index::MODE, 0, &CSP.to_le_bytes())?;
        self.client.command(NmtCommand::StartRemoteNode)?;
        // Until the joint has reported itself once, its position is not known here.
        self.controlword = 0;
        self.resynchronise();
        for _ in 0..20 {
            self.cycle()?;
        }
        self.check_report()
    }

    fn map(
        &mut self,
        parameters: u16,
        identifier: u32,
        objects: &[u32],
        kind: u8,
    ) -> Result<(), MasterError> {
        // The mapping objects follow the parameters by 200h.
        let mapping = parameters + 0x200;
        self.write(parameters, 1, &(identifier | 1 << 31).to_le_bytes())?;
        self.write(mapping, 0, &[0])?;
        for (place, object) in (1u8..).zip(objects) {
            self.write(mapping, place, &object.to_le_bytes())?;
        }
        self.write(mapping, 0, &[objects.len() as u8])?;
        self.write(parameters, 2, &[kind])?;
        self.write(parameters, 1, &identifier.to_le_bytes())
    }

    /// Writes an object.
    ///
    /// # Errors
    /// The joint refuses it or does not answer.
    pub fn write(&mut self, at: u16, sub_index: u8, value: &[u8]) -> Result<(), MasterError> {
        Ok(self.client.write(Address::new(at, sub_index), value)?)
    }

    /// Enables the drive unless it is enabled. It then holds the position at which it was enabled.
    ///
    /// # Errors
    /// The drive does not arm, with its reason.
    pub fn enable(&mut self) -> Result<(), MasterError> {
        if self.is_operating && self.is_enabled() {
            return Ok(());
        }
        self.resynchronise();
        let until_ns = self.due_ns + ENABLING_NS;
        let mut steady = 0;
        while steady < 20 {
            if self.due_ns > until_ns {
                // It may still be arming, such as with a slow brake.
                self.disable()?;
                let refusal = self.client.read_refusal()?;
                // A drive that arms and stops at once has no refusal.
                let why = if refusal.is_empty() { self.stop_in_words() } else { refusal };
                return Err(MasterError::NotEnabled(why));
            }
            self.controlword = match self.last.status & STATE_MASK {
                0x21 => SWITCH_ON,
                0x23 | ENABLED => ENABLE,
                _ => SHUTDOWN,
            };
            self.target_rad = self.last.position_rad;
            self.cycle()?;
            steady = if self.is_enabled() { steady + 1 } else { 0 };
            if (self.is_interrupted)() {
                self.disable()?;
                return Err(MasterError::Interrupted);
            }
        }
        self.is_operating = true;
        Ok(())
    }

    fn is_enabled(&self) -> bool {
        self.last.status & STATE_MASK == ENABLED
    }

    /// Disables the drive with its reactions to "disable operation" and "shutdown", and waits until the bridge is not in use.
    ///
    /// # Errors
    /// The bus fails or the joint does not report.
    pub fn disable(&mut self) -> Result<(), MasterError> {
        self.is_operating = false;
        let until_ns = self.due_ns + ENABLING_NS;
        self.controlword = SWITCH_ON;
        for cycle in 0.. {
            self.cycle()?;
            if cycle > 40 {
                self.controlword = SHUTDOWN;
            }
            if cycle > 60 && !self.is_enabled() || self.due_ns > until_ns {
                break;
            }
        }
        self.controlword = 0;
        (0..10).try_for_each(|_| self.cycle().map(drop))
    }

    /// Disables the drive as [`Master::disable`] does, if it was enabled.
    ///
    /// # Errors
    /// As [`Master::disable`].
    pub fn disable_if_enabled(&mut self) -> Result<(), MasterError> {
        if self.is_operating { self.disable() } else { Ok(()) }
    }

    /// Moves from the present demand to a position, rad.
    ///
    /// # Errors
    /// As [`Master::play`].
    pub fn approach(&mut self, position_rad: f64, speed_rad_s: f64) -> Result<(), MasterError> {
        let way = position_rad - self.target_rad;
        let wide = MotionLimits { range_rad: way.abs(), ..self.limits };
        let stroke = MotionBuilder::new(wide).stroke(way, speed_rad_s).rest(0.3);
        let from = self.target_rad;
        let positions = stroke.positions().iter().map(|at| from + at).collect::<Vec<_>>();
        self.follow(&positions, |_| ())
    }

    /// Performs a motion around an origin, rad, where the joint must be, and records it.
    ///
    /// # Errors
    /// The drive stops for any reason, the joint is silent, the bus fails, or the caller interrupts. In the last case the
    /// joint has come to rest and is disabled.
    pub fn play(&mut self, motion: &Motion, origin_rad: f64) -> Result<Recording, MasterError> {
        let positions: Vec<f64> = motion.positions_rad.iter().map(|at| origin_rad + at).collect();
        let mut rows = Vec::with_capacity(positions.len() * SYNCS_PER_TARGET as usize);
        self.follow(&positions, |row| rows.push(*row))?;
        Ok(Recording { name: motion.name.clone(), rows })
    }

    fn follow(&mut self, positions: &[f64], mut take: impl FnMut(&Row)) -> Result<(), MasterError> {
        (self.phase, self.pressing_syncs) = (0, 0);
        for (step, position) in positions.iter().enumerate() {
            self.target_rad = *position;
            for _ in 0..SYNCS_PER_TARGET {
                if let Some(row) = self.cycle()? {
                    take(&row);
                }
                self.check_report()?;
                if !self.is_enabled() {
                    return Err(self.stopped());
                }
                if let Some(error) = self.guarded() {
                    self.disable()?;
                    return Err(error);
                }
            }
            if (self.is_interrupted)() {
                let before = step.checked_sub(1).and_then(|at| positions.get(at));
                self.come_to_rest(before.map_or(0.0, |at| (position - at) / TARGET_PERIOD_S))?;
                self.disable()?;
                return Err(MasterError::Interrupted);
            }
        }
        Ok(())
    }

    /// Returns why a motion is ended: its error, or a stop against which the joint presses.
    fn guarded(&mut self) -> Option<MasterError> {
        let Row { error_rad, velocity_rad_s, status, .. } = self.last;
        let is_standing = velocity_rad_s.abs() < STANDING_SHARE * self.limits.speed_rad_s;
        let is_pressing = is_standing && status & INTERNAL_LIMIT != 0;
        self.pressing_syncs = if is_pressing { self.pressing_syncs + 1 } else { 0 };
        let error_rad = error_rad.abs();
        let is_far = error_rad > self.error_guard_rad;
        if self.pressing_syncs > PRESSING_SYNCS || is_far && is_standing {
            return Some(MasterError::Stop(error_rad));
        }
        is_far.then_some(MasterError::ErrorGuard(error_rad))
    }

    /// Slows down from a demanded velocity, rad/s.
    fn come_to_rest(&mut self, mut velocity_rad_s: f64) -> Result<(), MasterError> {
        let step = self.limits.acceleration_rad_s2 * TARGET_PERIOD_S;
        while velocity_rad_s != 0.0 {
            velocity_rad_s -= velocity_rad_s.clamp(-step, step);
            self.target_rad += velocity_rad_s * TARGET_PERIOD_S;
            for _ in 0..SYNCS_PER_TARGET {
                self.cycle()?;
            }
        }
        Ok(())
    }

    fn stopped(&mut self) -> MasterError {
        self.controlword = 0;
        MasterError::Stopped(self.stop_in_words())
    }

    /// Returns the names of the faults, or else the state of the drive.
    fn stop_in_words(&mut self) -> String {
        let status = self.last.status;
        let faults = self.client.read_number(Address::new(index::STATE, 3));
        let names = faults.map(|bits| code_names(bits, FIRST_FAULT)).unwrap_or_default();
        let state = match status {
            status if status & FAULT_MASK == FAULT => "fault",
            status if status & FAULT_MASK == FAULT_REACTION => "fault reaction",
            _ => "disabled by another master, a limit or a reset",
        };
        if names.is_empty() { state.to_owned() } else { names.join(", ") }
    }

    fn check_report(&self) -> Result<(), MasterError> {
        if self.due_ns.saturating_sub(self.reported_ns) > SILENCE_NS {
            return Err(MasterError::Silent(self.node.number()));
        }
        Ok(())
    }

    /// Starts the cycles at the present bus time, after a time without them.
    fn resynchronise(&mut self) {
        let now_ns = self.client.bus().now_ns();
        (self.due_ns, self.reported_ns) = (now_ns, now_ns);
    }

    /// Runs one cycle of a millisecond. Returns the report of the joint in it.
    fn cycle(&mut self) -> Result<Option<Row>, MasterError> {
        if self.phase.is_multiple_of(SYNCS_PER_TARGET) {
            let micro_rad = (1e6 * self.target_rad).round() as i32;
            let mut data = [0; 6];
            data[..2].copy_from_slice(&self.controlword.to_le_bytes());
            data[2..].copy_from_slice(&micro_rad.to_le_bytes());
            self.send(cob_id::RPDO_1 + u16::from(self.node.number()), &data)?;
        }
        self.syncs += 1;
        self.phase += 1;
        if self.has_trial && self.syncs.is_multiple_of(SYNCS_PER_RENEWAL) {
            let deadline = Address::new(TRIAL, TrialObject::DEADLINE);
            let request = download_request(deadline, &TRIAL_DEADLINE_MS.to_le_bytes());
            self.send(cob_id::SDO_REQUEST + u16::from(self.node.number()), &request)?;
        }
        let sync = Message::Sync(SyncFrame::of(self.syncs as u32)).emit();
        self.client.bus().send(&CanFrame::from(sync))?;
        self.due_ns += SYNC_PERIOD_NS;
        let now_ns = self.client.bus().now_ns();
        if now_ns > self.due_ns + 20 * SYNC_PERIOD_NS {
            // The PC was delayed: missed cycles are not made up for, the drive holds its last target.
            self.due_ns = now_ns;
        }
        let mut row = None;
        while let Some(received) = self.client.bus().receive(self.due_ns)? {
            if let Some(frame) = received.frame.to_joint() {
                row = self.take(&frame, received.time_ns)?.or(row);
            }
        }
        Ok(row)
    }

    fn send(&mut self, identifier: u16, data: &[u8]) -> Result<(), MasterError> {
        let frame = Frame::new(identifier, data).expect("11 bits and at most eight bytes");
        Ok(self.client.bus().send(&CanFrame::from(frame))?)
    }

    /// Processes a frame. The frame with the state of the drive is the last one of a SYNC, and completes a row.
    fn take(&mut self, frame: &Frame, time_ns: u64) -> Result<Option<Row>, MasterError> {
        let node = u16::from(self.node.number());
        if frame.identifier() == cob_id::TPDO_1 + node {
            if let [s0, s1, e0, e1, e2, e3] = *frame.data() {
                self.last.status = u16::from_le_bytes([s0, s1]);
                self.last.error_rad = 1e-6 * f64::from(i32::from_le_bytes([e0, e1, e2, e3]));
                self.last.time_s = 1e-9 * time_ns as f64;
                self.reported_ns = time_ns;
                return Ok(Some(self.last));
            }
            return Ok(None);
        }
        if frame.identifier() == cob_id::SDO_ANSWER + node {
            if let [0x80, low, high, _, a, b, c, d] = *frame.data()
                && u16::from_le_bytes([low, high]) == TRIAL
            {
                return Err(MasterError::TrialEnded(u32::from_le_bytes([a, b, c, d])));
            }
            return Ok(None);
        }
        match Message::parse(frame) {
            Ok(Message::Motion(sender, motion)) if sender == self.node => {
                self.last.velocity_rad_s = f64::from(motion.velocity_rad_s);
                self.last.position_rad = f64::from(motion.position_rad);
            }
            Ok(Message::Torque(sender, torque)) if sender == self.node => {
                self.last.torque_nm = f64::from(torque.torque_nm);
            }
            Ok(Message::Seal(sender, seal)) if sender == self.node => {
                self.last.radial_force_n = f64::from(seal.radial_force_n);
                self.last.pressure_diff_pa = f64::from(seal.pressure_diff_pa);
            }
            Ok(Message::Surroundings(sender, around)) if sender == self.node => {
                self.last.temperature_c = f64::from(around.temperature_c);
            }
            _ => {}
        }
        Ok(None)
    }

    /// Returns the joint to its own process data: its communication restarts.
    ///
    /// # Errors
    /// The bus fails.
    pub fn leave(&mut self) -> Result<(), MasterError> {
        Ok(self.client.command(NmtCommand::ResetCommunication)?)
    }
}
