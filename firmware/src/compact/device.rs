//! State of a compact node behind its objects, and its periodic work.

use crate::driver::{LoopOutput, LoopReport};
use crate::joint_node::sample_frames::SYNC_ORDER;
use crate::joint_node::{BoardOutput, BoardState, Boot, Identity, Joint, JointBase};
use crate::node::{Emergency, Network, NmtAction};
use crate::node_settings::{InputSource, NodeSettings};
use crate::sensors::LocalReadings;
use crate::store::Store;
use crate::supervisor::Supervisor;
use compensator_core::can::{Frame, NodeId, SampleAssembler, SyncFrame, cob_id};
use embedded_storage::nor_flash::NorFlash;

/// Number of frames at a SYNC.
const SYNC_FRAMES: usize = SYNC_ORDER.len();

/// All parts of a compact node except its network state and its object server.
#[derive(Debug)]
pub struct Device<F> {
    pub(super) base: JointBase,
    /// Kind of the joint in a trace.
    pub(super) joint_kind: u32,
    pub(super) samples: SampleAssembler,
    /// Counter of the last SYNC, in the ring of those that have one.
    pub(super) sync_counter: u8,
    /// Each frame of a sample is sent at every n-th SYNC; 0: as by default.
    pub(super) sync_types: [u8; SYNC_FRAMES],
    /// SYNCs since each frame was sent.
    pub(super) syncs: [u8; SYNC_FRAMES],
    pub(super) store: Store<F>,
}

impl<F: NorFlash> Device<F> {
    /// Returns the supervisor.
    pub const fn supervisor(&self) -> &Supervisor {
        &self.base.supervisor
    }

    /// Returns to the defaults of the communication.
    pub(super) fn restart_communication(&mut self) {
        self.samples = SampleAssembler::new(self.base.settings.node);
        self.sync_types = [0; SYNC_FRAMES];
        self.syncs = [0; SYNC_FRAMES];
    }
}

impl<F: NorFlash> Joint for Device<F> {
    type Flash = F;

    fn with_defaults(settings: NodeSettings, flash: F, identity: Identity, now_us: u64) -> Self {
        const NAME: &str = "friction-compensated joint, compact";
        Self {
            base: JointBase::new(NAME, settings, identity, now_us),
            joint_kind: 0,
            samples: SampleAssembler::new(settings.node),
            sync_counter: SyncFrame::LAST,
            sync_types: [0; SYNC_FRAMES],
            syncs: [0; SYNC_FRAMES],
            store: Store::open(flash),
        }
    }

    #[inline(never)]
    fn load(&mut self, boot: &Boot) {
        let loaded = self.base.load_block(&mut self.store);
        if let Some(settings) = loaded.settings {
            // A set of the whole driver may have been that of a joint in HIL, which this node does not have.
            self.base.settings = NodeSettings { source: InputSource::Sensors, ..settings };
        }
        self.base.start(boot, self.store.health(), loaded.parameters);
        self.restart_communication();
    }

    fn flash(&self) -> &F {
        self.store.flash()
    }

    fn base(&mut self) -> &mut JointBase {
        &mut self.base
    }

    fn take_frame(&mut self, frame: &Frame, network: &Network, now_us: u64) -> Option<NmtAction> {
        self.base.now_us = now_us;
        self.take_process_frame(frame, network.node(), network.is_operational());
        None
    }

    fn receive_identifiers(&self, node: NodeId) -> [u16; 6] {
        // The filters of the start accept everything with its node number, which another one needs too.
        let node = u16::from(node.number());
        let [a, b, c] = [cob_id::RPDO_2, cob_id::RPDO_3, cob_id::RPDO_4].map(|base| base + node);
        [a, b, c, 0, 0, 0]
    }

    fn stop(&mut self, command: Option<NmtAction>, _now_us: u64) {
        self.base.supervisor.disarm();
        if command == Some(NmtAction::ResetCommunication) {
            self.restart_communication();
        }
    }

    fn take_board_state(&mut self, state: &BoardState) {
        self.base.take_board_state(state);
    }

    fn report(&mut self, report: &LoopReport) {
        let drives = self.base.supervisor.is_bridge_allowed();
        if !self.base.take_report(report, drives) {
            return;
        }
        let JointBase { supervisor, staging, compensation, watch, .. } = &mut self.base;
        let is_compensated = supervisor.is_compensation_allowed();
        compensation.step(report, staging.active(), is_compensated, Some(0.0));
        supervisor.record_overruns(report.overruns_in_a_row);
        if let Some(watch) = watch {
            let is_valid = report.residual_torque_nm.is_finite();
            watch.step(report.residual_torque_nm, report.velocity_rad_s, is_valid);
        }
    }

    fn tick(&mut self, network: &Network, now_us: u64) -> bool {
        let base = &mut self.base;
        base.now_us = now_us;
        let awaited = base.settings.awaited_heartbeat;
        let mut observation = base.observation(network.is_heartbeat_missing(awaited, now_us));
        base.observe_report(&mut observation);
        observation.position_missing = base.supervisor.thresholds().position_required != 0
            && base.report().position_rad.is_nan();
        base.supervisor.observe(&observation, now_us);
        base.current_loop.mark_report_seen();
        false
    }

    fn loop_output(&mut self, sensors: &LocalReadings, now_us: u64) -> LoopOutput {
        let mut commands = self.base.loop_commands(now_us);
        sensors.apply_newer(&mut commands.covariates, now_us);
        self.base.seal_sensors.check(&mut commands.covariates, now_us);
        LoopOutput { commands, gains: None }
    }

    fn board_output(&self) -> BoardOutput {
        let winding_rise_k = self.base.motor.watch.rise_k();
        BoardOutput { winding_rise_k, ..BoardOutput::default() }
    }

    fn next_emergency(&mut self) -> Option<Emergency> {
        self.base.next_emergency(0)
    }
}
