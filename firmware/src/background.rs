//! The background loop of a board: all work of a joint driver that is not done in the interrupt.
//!
//! It runs a [`JointNode`]: the whole [`Driver`], or the [compact node](crate::compact) of a smaller chip.
//!
//! ```text
//! sensors, report of the current loop -> Driver -> commands, parts -> the current loop
//!                                                         once a millisecond
//! received frames -> Driver -> frames to send            until the next millisecond
//! ```
//! A [`Board`] provides the hardware (frames, time, sensors, watchdog) and calls [`Background::round`] whenever
//! it wakes. All decisions that need no register are taken here. A caller with its own frames and time, such as
//! a simulated bus, calls [`Background::receive`], [`Background::tick`] and [`Background::transmit`] instead.
//! The current loop runs in an interrupt with higher priority; [`crate::loop_link`] connects the two.

mod joint_node;

pub use joint_node::JointNode;

use crate::access::Key;
use crate::control::PERIOD_S;
use crate::deadline::DeadlineLimits;
use crate::driver::{Boot, Driver, KeptHome, LoopReport};
use crate::loop_link::LoopLink;
use crate::loop_parts::LoopParts;
use crate::loop_task::LoopTask;
use crate::node_settings::BusSettings;
use crate::sensors::biss::{self, TURN_WORDS};
use crate::sensors::{LocalReadings, SensorParameters, enclosure};
use crate::start_values::StartValues;
use crate::supervisor::CanState;
use compensator_core::can::{FdTelemetry, Frame};
use embedded_storage::nor_flash::NorFlash;

/// Time between two ticks of the driver, us.
pub const TICK_US: u64 = 1000;

/// With an encoder at the joint's side, the reports must come in this time before the next tick, us: the tick and its commands
/// are done by then. Until they do, the ticks are shifted by it.
const TICK_SHIFT_US: u64 = 300;

/// State of a board and its surroundings.
#[derive(Clone, Copy, Debug)]
pub struct BoardState {
    /// Temperature of the bridge, deg C; `None` if it is not measured.
    pub bridge_temperature_c: Option<f32>,
    /// Temperature of the motor, deg C; `None` if it is not measured.
    pub motor_temperature_c: Option<f32>,
    /// The guard below the stack is intact.
    pub stack_intact: bool,
    /// The CAN controller lost received frames since the last query.
    pub receiver_overrun: bool,
    /// State of the CAN controller.
    pub can: CanState,
    /// Last readings of the board's own slow sensors.
    pub sensors: LocalReadings,
    /// Last readings of the dry side, and the channels of safe torque off.
    pub enclosure: enclosure::Readings,
    /// First words of the last frame of a BiSS encoder; `None` without one.
    pub biss: Option<[u16; TURN_WORDS]>,
    /// Levels of the Hall sensors, bits 0 to 2; 0 without sensors.
    pub hall: u8,
    /// Words of the encoder at the joint's side of the gear, latched when the last report came, or at this tick; `None` if
    /// there is no such encoder.
    pub joint_words: Option<[u16; biss::WORDS]>,
}

impl Default for BoardState {
    /// Nothing is measured and there are no faults.
    fn default() -> Self {
        Self {
            bridge_temperature_c: None,
            motor_temperature_c: None,
            stack_intact: true,
            receiver_overrun: false,
            can: CanState::Active,
            sensors: LocalReadings::default(),
            enclosure: enclosure::Readings::default(),
            biss: None,
            hall: 0,
            joint_words: None,
        }
    }
}

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

    /// Sends a frame of CAN FD; called only if there is room, and if the board allowed it ([`Driver::allow_fd`]).
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

    /// Sets the output of the holding brake, once per tick. With `None` the output is not driven, and the brake must be
    /// closed.
    fn set_holding_brake(&mut self, _output: Option<bool>) {}

    /// Keeps the rise of the winding above the stator, K, across a reset: once per tick. The next start passes it to the
    /// driver ([`Boot::winding_rise_k`]).
    fn keep_heat(&mut self, _rise_k: f32) {}

    /// Keeps the home across a reset: once per tick. The next start passes it to the driver ([`Boot::home`]).
    fn keep_home(&mut self, _home: Option<KeptHome>) {}

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
pub struct Background<N> {
    driver: N,
    due_us: u64,
}

impl<N: JointNode> Background<N> {
    /// Creates a loop whose first tick is due now.
    pub const fn new(driver: N, now_us: u64) -> Self {
        Self { driver, due_us: now_us }
    }

    /// Completes the start of a node that has loaded nothing: see [`Driver::load`].
    pub fn load(&mut self, boot: &Boot, now_us: u64) {
        self.driver.load(boot, now_us);
    }

    /// Runs all work that is due: the tick, then received frames until the next tick is due. A flood of frames delays a tick
    /// by one frame at most.
    pub fn round<B: Board>(&mut self, board: &mut B) -> RoundOutcome {
        self.tick_if_due(board);
        loop {
            // Send the answers before the next frame is processed, so that they do not accumulate.
            self.send(board);
            if self.driver.is_reset_requested() {
                break;
            }
            let Some(frame) = board.receive() else { return RoundOutcome::Sleep };
            let now_us = board.now_us();
            self.driver.receive(&frame, now_us);
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
        board.apply_sensors(&self.driver.set().sensors);
        board.accept_identifiers(&self.driver.receive_identifiers());
        let state = board.state(now_us);
        if self.tick(&state, board.current_loop(), now_us) {
            board.refresh_watchdog();
        }
        let end_us = board.now_us();
        if let Some(link) = board.current_loop() {
            link.end_tick(end_us);
        }
        board.set_holding_brake(self.driver.brake_output());
        if let Some(rise_k) = self.driver.winding_rise_k() {
            board.keep_heat(rise_k);
        }
        board.keep_home(self.driver.kept_home());
    }

    // Called in several places: not inlined, to reduce the size of the image.
    #[inline(never)]
    fn send(&mut self, board: &mut impl Board) {
        if let Some(frame) = self.driver.transmit_fd_if(|identifier| board.has_room_for(identifier))
        {
            board.send_fd(&frame);
        }
        while let Some(frame) = self.driver.transmit_if(|identifier| board.has_room_for(identifier))
        {
            board.send(&frame);
        }
    }

    /// Processes a received frame.
    pub fn receive(&mut self, frame: &Frame, now_us: u64) {
        self.driver.receive(frame, now_us);
    }

    /// Returns the next frame to send.
    pub fn transmit(&mut self) -> Option<Frame> {
        self.driver.transmit_if(|_| true)
    }

    /// Returns the frame of CAN FD that waits to be sent.
    pub fn transmit_fd(&mut self) -> Option<FdTelemetry> {
        self.driver.transmit_fd_if(|_| true)
    }

    /// Runs the work due every [`TICK_US`]. Returns true if the current loop reports, or if there is none.
    pub fn tick(
        &mut self,
        state: &BoardState,
        current_loop: Option<&mut LoopLink>,
        now_us: u64,
    ) -> bool {
        let Some(link) = current_loop else {
            self.report(state, &LoopReport::default());
            self.observe(state, now_us);
            return true;
        };
        self.driver.set_joint_words(state.joint_words);
        self.driver.take_hall(state.hall);
        link.reports(now_us, |report| self.report(state, &report));
        link.scope_rows(|row| self.driver.take_scope_row(row));
        self.observe(state, now_us);
        let mut commands = self.driver.loop_commands(now_us);
        state.sensors.apply_newer(&mut commands.covariates, now_us);
        self.driver.check_seal_sensors(&mut commands.covariates, now_us);
        commands.factors = self.driver.supply(&commands.covariates, now_us);
        link.send_commands(commands, self.driver.set());
        if let Some(gains) = self.driver.learnt_gains() {
            link.send_gains(gains);
        }
        link.is_alive(now_us)
    }

    // Not inlined, for the same reason as `send`.
    #[inline(never)]
    fn report(&mut self, state: &BoardState, report: &LoopReport) {
        self.driver.report(&LoopReport {
            bridge_temperature_c: state.bridge_temperature_c,
            motor_temperature_c: state.motor_temperature_c,
            stack_intact: state.stack_intact,
            ..*report
        });
    }

    fn observe(&mut self, state: &BoardState, now_us: u64) {
        self.driver.bus_state(state.receiver_overrun, state.can);
        self.driver.set_enclosure(state.enclosure);
        self.driver.take_biss(state.biss);
        self.driver.tick(now_us);
    }

    /// Returns the node. An image has no access to it: what a board reads at its start only is in
    /// [`Self::start_values`].
    #[cfg(not(target_os = "none"))]
    pub const fn driver(&self) -> &N {
        &self.driver
    }

    /// Returns the parameters of the start that the board reads.
    pub fn start_values(&self) -> &StartValues {
        self.driver.start_record().values()
    }

    /// Returns the settings of the bus at the start.
    pub fn bus_settings(&self) -> BusSettings {
        self.driver.start_record().bus()
    }

    /// Returns the task of the current loop with the set of the start. If the power stage cannot drive with this set, the task
    /// measures only, and the node is not armed.
    // Not inlined: its stack is free again during the rest of the start.
    #[inline(never)]
    pub fn loop_task(&mut self, limits: DeadlineLimits) -> LoopTask {
        let stage = self.driver.stage();
        let parts = LoopParts::build_or_measure_only(self.driver.set(), stage);
        if !parts.may_drive
            && let Err(refused) = LoopParts::build(self.driver.set(), stage, PERIOD_S)
        {
            self.driver.start_record_mut().set_refused(Some(refused));
        }
        LoopTask::new(parts, limits)
    }
}

impl<F: NorFlash> Background<Driver<F>> {
    /// States that the CAN controller sends frames of CAN FD.
    pub const fn allow_fd(&mut self) {
        self.driver.allow_fd();
    }

    /// Gives the scope its memory, values of 32 bits.
    pub fn set_scope_memory(&mut self, memory: &'static mut [f32]) {
        self.driver.set_scope_memory(memory);
    }

    /// Sets the secret of the access challenges: see [`Driver::seed_challenges`].
    pub fn seed_challenges(&mut self, seed: [u8; Key::LENGTH]) {
        self.driver.seed_challenges(seed);
    }

    /// Returns the flash, for the next start, or to close it before a restart.
    pub fn into_flash(self) -> F {
        self.driver.into_flash()
    }
}
