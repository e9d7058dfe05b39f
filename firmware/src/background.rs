//! The background loop of a board: all work of a joint driver that is not done in the interrupt.
//!
//! It runs a [`JointNode`]: the whole [driver](crate::driver), or the [compact node](crate::compact) of a smaller chip.
//!
//! ```text
//! sensors, report of the current loop -> Driver -> commands, parts -> the current loop
//!                                                         once a millisecond
//! received frames -> Driver -> frames to send            until the next millisecond
//! ```
//! A [`Board`] provides the hardware (frames, time, sensors, watchdog) and calls [`Background::round`] whenever
//! it wakes. All decisions that need no register are taken here. A caller with its own frames and time, such as
//! a simulated bus, calls [`Background::tick`] and the node instead.
//! The current loop runs in an interrupt with higher priority; [`crate::loop_link`] connects the two.

pub use crate::joint_node::BoardState;

use crate::deadline::DeadlineLimits;
use crate::driver::LoopReport;
use crate::joint_node::{BoardOutput, Boot, Equipment, Joint, JointBase, JointNode};
use crate::loop_link::LoopLink;
use crate::loop_parts::LoopParts;
use crate::loop_task::LoopTask;
use crate::node_settings::BusSettings;
use crate::sensors::SensorParameters;
use crate::start_values::StartValues;
use compensator_core::can::{FdTelemetry, Frame};

/// Time between two ticks of the driver, us.
pub const TICK_US: u64 = 1000;

/// With an encoder at the joint's side, the reports must come in this time before the next tick, us: the tick and its commands
/// are done by then. Until they do, the ticks are shifted by it.
const TICK_SHIFT_US: u64 = 300;

/// Interface of a board to its background loop.
pub trait Board {
    /// Maximum time to send the last frames before a restart, us.
    const RESTART_FLUSH_US: u64;

    /// Returns the time since the start, us; it never decreases.
    fn now_us(&mut self) -> u64;

    /// Returns the next received frame, if any.
    fn receive(&mut self) -> Option<Frame>;

    /// Returns true if a frame with this identifier can be queued for sending.
    ///
    /// A frame that waits for a loaded bus must not keep back one with a higher priority, nor be overtaken by one with
    /// the same identifier.
    fn has_room_for(&mut self, identifier: u16) -> bool;

    /// Sends a frame; called only if there is room.
    fn send(&mut self, frame: &Frame);

    /// Sends a frame of CAN FD; called only if there is room, and if the board allowed it ([`Equipment::sends_fd`]).
    fn send_fd(&mut self, _frame: &FdTelemetry) {}

    /// Returns true if every frame passed to [`Board::send`] has been sent.
    fn is_idle(&mut self) -> bool;

    /// Applies the constants of the sensors: once per tick, before [`Board::state`].
    fn apply_sensors(&mut self, _sensors: &SensorParameters) {}

    /// Lets the CAN controller accept these identifiers (0 for none) besides those with the node number of the
    /// start: once per tick. A master may have moved a receive PDO, or changed the node number by LSS.
    fn accept_identifiers(&mut self, _identifiers: &[u16; 7]) {}

    /// Reads sensors, controller and stack: once per tick.
    fn state(&mut self, now_us: u64) -> BoardState;

    /// Returns the link to the current loop; `None` for a board without a bridge.
    fn current_loop(&mut self) -> Option<&mut LoopLink<'static>> {
        None
    }

    /// Starts to read the encoder at the joint's side of the gear if a report of the current loop has come since the last
    /// tick, so that both are of the same time. Called whenever the board wakes. Returns true if it has started now.
    fn read_joint_encoder(&mut self) -> bool {
        false
    }

    /// Drives the holding brake, and keeps what the next start needs: once per tick.
    fn apply(&mut self, _output: &BoardOutput) {}

    /// Refreshes the watchdog: once per tick, while the current loop reports.
    fn refresh_watchdog(&mut self) {}
}

/// Action of a board after a round.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[must_use]
pub enum RoundOutcome {
    /// Sleep until the next event.
    Sleep,
    /// Run the next round at once: frames may be waiting.
    Continue,
    /// Restart: the network requested it, and the last frames are sent.
    Restart,
}

/// State of the background loop: the node, and the time of its next tick.
#[derive(Debug)]
pub struct Background<J> {
    node: JointNode<J>,
    due_us: u64,
}

impl<J: Joint> Background<J> {
    /// Creates a loop whose first tick is due now.
    pub const fn new(node: JointNode<J>, now_us: u64) -> Self {
        Self { node, due_us: now_us }
    }

    /// Completes the start of a node that has loaded nothing: see [`JointNode::load`].
    pub fn load(&mut self, boot: &Boot, now_us: u64) {
        self.node.load(boot, now_us);
    }

    /// Gives the joint what the board has.
    pub fn equip(&mut self, equipment: Equipment) {
        self.node.joint.equip(equipment);
    }

    /// Runs all work that is due: the tick, then received frames until the next tick is due. A flood of frames delays a tick
    /// by one frame at most.
    pub fn round<B: Board>(&mut self, board: &mut B) -> RoundOutcome {
        self.tick_if_due(board);
        loop {
            // Send the answers before the next frame is processed, so that they do not accumulate.
            self.send(board);
            if self.node.is_reset_requested() {
                break;
            }
            let Some(frame) = board.receive() else { return RoundOutcome::Sleep };
            let now_us = board.now_us();
            self.node.receive(&frame, now_us);
            // After the frame, so that a round processes one even if its tick took too long.
            if board.now_us() >= self.due_us {
                return RoundOutcome::Continue;
            }
        }
        let until_us = board.now_us() + B::RESTART_FLUSH_US;
        while !board.is_idle() && board.now_us() < until_us {
            self.send(board);
        }
        RoundOutcome::Restart
    }

    fn tick_if_due(&mut self, board: &mut impl Board) {
        let now_us = board.now_us();
        let has_read = board.read_joint_encoder();
        if now_us < self.due_us {
            if has_read && self.due_us - now_us > TICK_SHIFT_US {
                // The report came during the tick, or its commands delayed it. With other times it does not.
                self.due_us += TICK_SHIFT_US;
            }
            return;
        }
        self.due_us += TICK_US;
        if self.due_us <= now_us {
            // Missed ticks are skipped.
            self.due_us = now_us + TICK_US;
        }
        board.apply_sensors(&self.node.joint.base().set().sensors);
        board.accept_identifiers(&self.node.receive_identifiers());
        let state = board.state(now_us);
        if self.tick(&state, board.current_loop(), now_us) {
            board.refresh_watchdog();
        }
        let end_us = board.now_us();
        if let Some(link) = board.current_loop() {
            link.end_tick(end_us);
        }
        board.apply(&self.node.joint.board_output());
    }

    // Called in several places: not inlined, to reduce the size of the image.
    #[inline(never)]
    fn send(&mut self, board: &mut impl Board) {
        if let Some(frame) = self.node.transmit_fd_if(|identifier| board.has_room_for(identifier)) {
            board.send_fd(&frame);
        }
        while let Some(frame) = self.node.transmit_if(|identifier| board.has_room_for(identifier)) {
            board.send(&frame);
        }
    }

    /// Runs the work due every [`TICK_US`]. Returns true if the current loop reports, or if there is none.
    pub fn tick(
        &mut self,
        state: &BoardState,
        current_loop: Option<&mut LoopLink>,
        now_us: u64,
    ) -> bool {
        self.node.joint.take_board_state(state);
        let Some(link) = current_loop else {
            self.report(state, &LoopReport::default());
            self.node.tick(now_us);
            return true;
        };
        link.reports(now_us, |report| self.report(state, &report));
        link.scope_rows(|row| self.node.joint.take_scope_row(row));
        self.node.tick(now_us);
        let output = self.node.joint.loop_output(&state.sensors, now_us);
        link.send(&output, self.node.joint.base().set());
        link.is_alive(now_us)
    }

    // Not inlined, for the same reason as `send`.
    #[inline(never)]
    fn report(&mut self, state: &BoardState, report: &LoopReport) {
        self.node.joint.report(&LoopReport {
            bridge_temperature_c: state.bridge_temperature_c,
            motor_temperature_c: state.motor_temperature_c,
            stack_intact: state.stack_intact,
            ..*report
        });
    }

    /// Returns the node, on a PC. An image has no access to it: what a board reads at its start only is in
    /// [`Self::start_values`].
    #[cfg(not(target_os = "none"))]
    pub const fn node(&self) -> &JointNode<J> {
        &self.node
    }

    /// Returns the node, on a PC: for frames without a board, and for its flash after a restart.
    #[cfg(not(target_os = "none"))]
    pub const fn node_mut(&mut self) -> &mut JointNode<J> {
        &mut self.node
    }

    /// Returns the node by value, on a PC: for its flash after a restart.
    #[cfg(not(target_os = "none"))]
    pub fn into_node(self) -> JointNode<J> {
        self.node
    }

    /// Returns the parameters of the start that the board reads.
    pub fn start_values(&mut self) -> &StartValues {
        self.node.joint.base().start.values()
    }

    /// Returns the settings of the bus at the start.
    pub fn bus_settings(&mut self) -> BusSettings {
        self.node.joint.base().start.bus()
    }

    /// Returns the task of the current loop with the set of the start. If the power stage cannot drive with this set, the task
    /// measures only, and the node is not armed.
    ///
    /// # Panics
    /// If the default set cannot be built either, which the tests rule out.
    // Not inlined: its stack is free again during the rest of the start.
    #[inline(never)]
    pub fn loop_task(&mut self, limits: DeadlineLimits) -> LoopTask {
        let JointBase { staging, identity, start, .. } = self.node.joint.base();
        let mut refused = None;
        let built =
            LoopParts::build_or_measure_only(staging.active(), identity.stage, &mut refused);
        start.set_refused(refused);
        match built {
            Ok(parts) => LoopTask::new(parts, limits),
            Err(refused) => panic!("default parameters: {refused}"),
        }
    }
}
