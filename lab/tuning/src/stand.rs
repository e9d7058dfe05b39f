//! A drawn joint on a bus, with the true position of its output beside it.

use super::{GradeError, LIMITS, Silent, options};
use canopen_rs::Address;
use firmware::node::dictionary::records::TrialObject;
use firmware::node::dictionary::{SAVE_SIGNATURE, index};
use firmware::parameter_set::ParameterSet;
use friction_results::tune::{TuneArm, TuneGain, TuneQuantity};
use joint_bus::bus::{Bus, BusError, Counters, Hub, Participant, Received};
use joint_bus::canopen::Client;
use joint_rig::MotorNode;
use joint_trace::CanFrame;
use joint_tuning::gain::gain;
use joint_tuning::motion::standard;
use joint_tuning::proof::pairs;
use joint_tuning::recording::Recording;
use joint_tuning::score::{Scored, score};
use joint_tuning::session::SessionError;
use joint_tuning::trial_set::{self, TunedSet};
use joint_tuning::{Master, Motion, Session, TuneOptions, tune};
use simulated_machines::joint_plant::DrawnJoint;
use std::cell::{Cell, RefCell};
use std::rc::Rc;

/// Age of what the library reports at the arrival of the frame, ms: the loop collects values each millisecond, the background
/// takes them a tick later, and the frame leaves at the tick after the SYNC.
const LIBRARY_REPORT_AGE_MS: f64 = 3.05;

/// Largest distance of the reported positions of a rigid joint from the true ones, rad: its encoder may be wrong by 0.02 rad
/// at the motor, and a report that is half a millisecond older adds more.
pub const LARGEST_DISTANCE_RAD: f64 = 2e-4;

/// The true position of the output, one value per millisecond of the bus.
#[derive(Clone, Debug)]
pub struct Truth {
    positions_rad: Vec<f64>,
    /// Age of the joint's reports at their arrival, ms.
    report_age_ms: f64,
}

impl Truth {
    /// Returns the true position at a bus time, ms; `None` beyond what was recorded.
    fn position_rad(&self, time_ms: f64) -> Option<f64> {
        let before = time_ms.max(0.0).floor();
        let [from, to] = [0, 1].map(|next| self.positions_rad.get(before as usize + next));
        Some(from? + (time_ms.max(0.0) - before) * (to? - from?))
    }

    /// Returns a recording with the true position in place of the measured one.
    pub fn corrected(&self, recording: &Recording) -> Recording {
        let mut corrected = recording.clone();
        for row in &mut corrected.rows {
            let demand = row.demand_rad();
            if let Some(position) = self.position_rad(1e3 * row.time_s - self.report_age_ms) {
                row.position_rad = position;
                row.error_rad = demand - position;
            }
        }
        corrected
    }

    /// Returns the distance of the reported positions from the true ones, RMS without the mean, rad. A wrong age adds the
    /// joint's way in the time by which it is wrong.
    pub fn distance_rad(&self, recording: &Recording) -> f64 {
        let corrected = self.corrected(recording).rows;
        let pairs = corrected.iter().zip(&recording.rows);
        let apart: Vec<f64> = pairs.map(|(a, b)| a.position_rad - b.position_rad).collect();
        let count = apart.len().max(1) as f64;
        let mean = apart.iter().sum::<f64>() / count;
        (apart.iter().map(|distance| (distance - mean).powi(2)).sum::<f64>() / count).sqrt()
    }

    /// Returns how well a recording follows its demand by the true position.
    pub fn scored(&self, recording: &Recording) -> Scored {
        score(&self.corrected(recording), 1.0)
    }

    /// Returns the true gains of the error at reversals and of the tracking error from one set to another, over the rounds of a
    /// trial.
    pub fn gains(
        &self,
        rounds: &[Vec<(TuneArm, &Recording)>],
        sets: [TuneArm; 2],
    ) -> [TuneGain; 2] {
        let scored = |(arm, recording): &(TuneArm, &Recording)| (*arm, self.scored(recording));
        let rounds: Vec<_> =
            rounds.iter().map(|round| round.iter().map(scored).collect()).collect();
        let pairs = pairs(&rounds, sets);
        [TuneQuantity::ReversalError, TuneQuantity::TrackingRms]
            .map(|quantity| gain(&pairs, quantity))
    }
}

/// Performs a motion around a position, rad, with a set in RAM, and records it. The joint is disarmed before and after.
///
/// # Errors
/// Returns one line if the set is refused or the joint stops.
pub(super) fn performed<B: Bus>(
    client: Client<B>,
    options: &TuneOptions,
    origin_rad: f64,
    tuned: &TunedSet,
    motion: &Motion,
) -> Result<Recording, SessionError> {
    let mut master = Master::new(client, options.node, options.limits, Box::new(|| false));
    master.configure()?;
    trial_set::write(&mut master, tuned)?;
    master.enable()?;
    master.approach(origin_rad, 0.3 * options.limits.speed_rad_s)?;
    let recording = master.play(motion, origin_rad)?;
    master.disable()?;
    master.leave()?;
    Ok(recording)
}

/// The joint as a participant of the bus, which the grader shares.
struct SharedJoint {
    node: Rc<RefCell<MotorNode>>,
    truth: Rc<RefCell<Truth>>,
}

impl Participant for SharedJoint {
    fn receive(&mut self, frame: &CanFrame, now_ns: u64) {
        self.node.borrow_mut().receive(frame, now_ns);
    }

    fn tick(&mut self, now_ns: u64) -> Option<u64> {
        let mut node = self.node.borrow_mut();
        let next = node.tick(now_ns);
        let at = (now_ns as f64 * 1e-6).round() as usize;
        self.truth.borrow_mut().positions_rad.resize(at + 1, node.plant().position_rad());
        next
    }

    fn transmit(&mut self) -> Option<CanFrame> {
        self.node.borrow_mut().transmit()
    }
}

/// A test stand with one joint.
pub struct Stand {
    hub: Hub,
    node: Rc<RefCell<MotorNode>>,
    truth: Rc<RefCell<Truth>>,
    /// Bus time at which the host is killed, ns.
    killed_ns: Rc<Cell<u64>>,
    /// What happens to the order that keeps and saves a set.
    order: Rc<Cell<OrderFault>>,
}

/// What happens to the order that keeps and saves a set.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum OrderFault {
    /// It reaches the joint.
    #[default]
    None,
    /// It does not, as if the flash were worn out.
    Lost,
    /// The host is killed before it.
    Killed,
}

impl Stand {
    /// Starts a joint with this set in its flash.
    ///
    /// # Errors
    /// Returns an error if the set is rejected.
    pub fn new(joint: &DrawnJoint, set: &ParameterSet) -> Result<Self, GradeError> {
        let node = MotorNode::drawn(joint, set)?;
        Ok(Self::with_node(node, LIBRARY_REPORT_AGE_MS))
    }

    /// Starts with a joint on another driver, such as an emulated board ([`MotorNode::drawn_on`]), whose reports have this age
    /// at their arrival, ms.
    pub fn with_node(node: MotorNode, report_age_ms: f64) -> Self {
        let hub = Hub::new();
        let node = Rc::new(RefCell::new(node));
        let truth = Truth { positions_rad: Vec::new(), report_age_ms };
        let truth = Rc::new(RefCell::new(truth));
        hub.attach(SharedJoint { node: node.clone(), truth: truth.clone() });
        let (killed_ns, order) = (Rc::new(Cell::new(u64::MAX)), Rc::default());
        Self { hub, node, truth, killed_ns, order }
    }

    /// Gives the joint another gain of its position loop (60FBh:1), and stores it.
    ///
    /// # Errors
    /// Returns an error if the joint refuses.
    pub fn set_position_gain(&self, gain: u32) -> Result<(), GradeError> {
        let mut client = self.client();
        client.write(Address::new(index::POSITION_LOOP, 1), &gain.to_le_bytes())?;
        client.write(Address::new(index::STORE, 1), &SAVE_SIGNATURE.to_le_bytes())?;
        Ok(())
    }

    /// Returns the bus.
    pub fn hub(&self) -> &Hub {
        &self.hub
    }

    /// Returns the joint.
    pub fn node(&self) -> &Rc<RefCell<MotorNode>> {
        &self.node
    }

    /// Returns the true positions so far.
    pub fn truth(&self) -> Truth {
        self.truth.borrow().clone()
    }

    /// Kills the host at a bus time, ns: it sends and receives nothing from then on.
    pub fn kill_host_at(&self, time_ns: u64) {
        self.killed_ns.set(time_ns);
    }

    /// Gives the order that keeps and saves a set a fault.
    pub fn set_order_fault(&self, fault: OrderFault) {
        self.order.set(fault);
    }

    /// Returns the CRC of the active set.
    ///
    /// # Errors
    /// Returns an error if the joint does not answer.
    pub fn active_crc(&self) -> Result<u32, GradeError> {
        Ok(self.client().read_number(Address::new(index::COMMIT, 1))?)
    }

    /// Returns the gain of the position loop that the joint uses (60FBh:1).
    ///
    /// # Errors
    /// As [`Stand::active_crc`].
    pub fn position_gain(&self) -> Result<u32, GradeError> {
        Ok(self.client().read_number(Address::new(index::POSITION_LOOP, 1))?)
    }

    /// Returns a client of the joint.
    pub fn client(&self) -> Client<HostPort> {
        let bus = HostPort {
            port: Box::new(self.hub.port()),
            killed_ns: self.killed_ns.clone(),
            order: self.order.clone(),
        };
        Client::new(bus, compensator_core::can::NodeId::FIRST)
    }

    /// Performs the standard motion with a set in RAM, at the stored position gain.
    ///
    /// # Errors
    /// Returns an error if the set is refused or the joint stops.
    pub fn performed(&self, set: &ParameterSet) -> Result<Recording, GradeError> {
        let tuned = TunedSet { set: set.clone(), position_gain: self.position_gain()? };
        let origin_rad = self.node.borrow().plant().position_rad();
        let motion = standard(&LIMITS);
        Ok(performed(self.client(), &options(0, LIMITS), origin_rad, &tuned, &motion)?)
    }

    /// Runs a session.
    ///
    /// # Errors
    /// Returns an error if the session is refused.
    pub fn tune(&self, options: &TuneOptions) -> Result<Session, GradeError> {
        Ok(tune(self.client(), options, Box::new(|| false), &mut Silent)?)
    }
}

/// The host's access to the bus, until it is killed.
pub struct HostPort {
    port: Box<dyn Bus>,
    killed_ns: Rc<Cell<u64>>,
    order: Rc<Cell<OrderFault>>,
}

impl HostPort {
    /// Returns true for the order that keeps and saves a set.
    fn is_order(frame: &CanFrame) -> bool {
        let [low, high] = trial_set::TRIAL.to_le_bytes();
        let wanted = [low, high, TrialObject::ORDER, trial_set::KEEP_AND_SAVE];
        frame.to_joint().is_some_and(|frame| {
            frame.identifier() & 0x780 == 0x600 && frame.data().get(1..5) == Some(&wanted[..])
        })
    }

    fn check(&self) -> Result<(), BusError> {
        if self.port.now_ns() < self.killed_ns.get() {
            return Ok(());
        }
        Err(BusError::Closed { name: "loop".into(), why: "the host was killed".into() })
    }
}

impl Bus for HostPort {
    fn send(&mut self, frame: &CanFrame) -> Result<(), BusError> {
        self.check()?;
        match self.order.get() {
            OrderFault::Lost if Self::is_order(frame) => Ok(()),
            OrderFault::Killed if Self::is_order(frame) => {
                self.killed_ns.set(self.port.now_ns());
                self.check()
            }
            _ => self.port.send(frame),
        }
    }

    fn receive(&mut self, until_ns: u64) -> Result<Option<Received>, BusError> {
        self.check()?;
        self.port.receive(until_ns.min(self.killed_ns.get()))
    }

    fn now_ns(&self) -> u64 {
        self.port.now_ns()
    }

    fn counters(&self) -> Counters {
        self.port.counters()
    }
}
