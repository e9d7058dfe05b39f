//! The driver of a rig: the firmware's library in this process, or another implementation of [`RigDriver`].
//!
//! `tests/emulator` implements it with the shipped image on an emulated board, so that the same scenarios run on both.

use crate::{BoardSensors, PERIODS_PER_MS, PowerUp, RigError, Stage};
use compensator_core::can::Frame;
use firmware::access::AccessSettings;
use firmware::background::{Background, BoardState, TICK_US};
use firmware::control::{PERIOD_S, PowerStage};
use firmware::deadline::DeadlineLimits;
use firmware::driver::{Boot, Identity};
use firmware::joint_node::{Equipment, Joint, JointNode};
use firmware::loop_link::{LoopLink, LoopPort, LoopQueues};
use firmware::loop_parts::{LoopParts, StageTraits};
use firmware::loop_task::LoopTask;
use firmware::node_settings::{NodeSettings, emit_block};
use firmware::sensors::biss;
use firmware::store::Store;
use firmware::store::memory::MemoryFlash;
use firmware::supervisor::{Code, CodeSet, ResetCause, Supervisor};
use joint_trace::CanFrame;
use std::collections::VecDeque;

/// Timeout of the board's watchdog, ms.
pub const WATCHDOG_TIMEOUT_MS: u32 = 50;

/// Capacity of the board's receive queue, in frames.
const RECEIVE_QUEUE_FRAMES: usize = 64;

/// A driver connected to a simulated joint.
pub trait RigDriver {
    /// The power stage with the plant.
    fn stage(&self) -> &Stage;

    /// The power stage, for measurements and faults.
    fn stage_mut(&mut self) -> &mut Stage;

    /// Delivers a frame.
    fn receive(&mut self, frame: &Frame);

    /// Runs 1 ms. `sync` arrives at its start. Frames from the driver go to `sent`.
    fn step(&mut self, state: &BoardState, sync: Option<Frame>, sent: &mut dyn FnMut(CanFrame));

    /// Stalls the background loop for this time, ms; the interrupt continues.
    fn stall_background(&mut self, milliseconds: u32);

    /// Returns true after a reset, by the watchdog or as the network requested. The driver then stays inactive.
    fn is_reset(&self) -> bool;

    /// Resets the processor from outside, as its reset pin does. The driver then stays inactive.
    fn reset(&mut self);

    /// Cuts the power of the processor: RAM loses its content. The driver then stays inactive.
    fn cut_power(&mut self);

    /// Runs 1 ms, in which a driver that was reset starts again from its flash. The joint is as the reset left it.
    ///
    /// # Errors
    /// Returns one line if the driver cannot be restarted.
    fn restart(&mut self) -> Result<(), RigError>;

    /// Returns true if the joint is armed.
    fn is_armed(&mut self) -> bool;

    /// Returns the latched faults.
    fn faults(&mut self) -> CodeSet;

    /// Returns the limits that are active.
    fn limits(&mut self) -> CodeSet;
}

/// Returns the codes whose bits are set in this word; `base` is the number of the code of bit 0.
pub fn codes_from_bits(word: u32, base: u32) -> CodeSet {
    let mut set = CodeSet::EMPTY;
    for &code in Code::ALL {
        let bit = u32::from(code.number()).checked_sub(base);
        if bit.is_some_and(|bit| bit < 32 && word >> bit & 1 == 1) {
            set.insert(code);
        }
    }
    set
}

/// Returns the content of the parameter store for a start.
///
/// # Errors
/// Returns one line if the set is rejected.
pub fn stored_flash<const PAGES: usize>(
    start: &PowerUp,
    traits: StageTraits,
) -> Result<MemoryFlash<PAGES>, RigError> {
    let mut store = Store::open(MemoryFlash::<PAGES>::new());
    if let Some(set) = start.set {
        LoopParts::build(set, traits, PERIOD_S)?;
        let commissioned = if start.commissioned { set.wiring_crc() } else { 0 };
        // The scenarios test the control, not the access: a frame in between would shift them in time.
        let access = AccessSettings { is_locked: false, ..AccessSettings::default() };
        let settings =
            NodeSettings { commissioned, access, drive: start.drive, ..NodeSettings::default() };
        let block = emit_block(&settings, set);
        store.save(&block, &settings.identity()).map_err(RigError::Flash)?;
    }
    Ok(store.into_flash())
}

/// Flash of the drivers in this process.
pub type RigFlash = MemoryFlash<4>;

/// The firmware's library as driver: background loop, queues and interrupt in this process. It keeps the queues and the
/// memory of the scope of each start as long as a board would: for ever.
pub struct LibraryDriver<J> {
    background: Background<J>,
    task: LoopTask,
    port: LoopPort<'static>,
    link: LoopLink<'static>,
    stage: Stage,
    identity: Identity,
    now_us: u64,
    /// Remaining time of a stall of the background loop, ms, and the frames received during it.
    stalled_ms: u32,
    deferred_frames: VecDeque<Frame>,
    /// Words of the encoder at the joint's side, latched when the last report came.
    joint_words: Option<[u16; biss::WORDS]>,
    /// Time since the watchdog was serviced, ms.
    watchdog_unserviced_ms: u32,
    /// Cause of a reset after which the driver has not started again.
    reset: Option<ResetCause>,
}

/// Values that the scope holds, as on the STM32G474 board.
const SCOPE_VALUES: usize = 6144;

/// Limits of the interrupt's time.
const LIMITS: DeadlineLimits = DeadlineLimits::for_period(super::PERIOD_CYCLES, 2000);

/// Returns the background loop of a node that starts now from this flash.
fn start_node<J: Joint<Flash = RigFlash>>(
    flash: RigFlash,
    identity: Identity,
    boot: &Boot,
    now_us: u64,
) -> Background<J> {
    let node = JointNode::boot(NodeSettings::default(), flash, identity, boot, now_us);
    let mut background = Background::new(node, now_us);
    let scope = Box::leak(Box::new([0.0; SCOPE_VALUES]));
    background.equip(Equipment { sends_fd: true, scope: Some(scope), seed: None });
    background
}

/// Returns both ends of the queues between interrupt and background of a start.
fn connected(traits: StageTraits, now_us: u64) -> (LoopPort<'static>, LoopLink<'static>) {
    Box::leak(Box::new(LoopQueues::new())).split(traits, now_us)
}

impl<J: Joint<Flash = RigFlash>> LibraryDriver<J> {
    /// Starts a driver on this stage.
    ///
    /// # Errors
    /// Returns one line if the set is rejected.
    pub fn start(start: &PowerUp, traits: StageTraits, stage: Stage) -> Result<Self, RigError> {
        let flash = stored_flash(start, traits)?;
        let identity = Identity { hardware: "simulated joint", serial: 1, stage: traits };
        let mut background: Background<J> = start_node(flash, identity, &start.boot, 0);
        let (port, link) = connected(traits, 0);
        let task = background.loop_task(LIMITS);
        let mut driver = Self {
            background,
            task,
            port,
            link,
            stage,
            identity,
            now_us: 0,
            stalled_ms: 0,
            deferred_frames: VecDeque::new(),
            joint_words: None,
            watchdog_unserviced_ms: 0,
            reset: None,
        };
        // The interrupt must run first: the background needs a completed conversion.
        driver.run_current_loop();
        Ok(driver)
    }

    fn supervisor(&mut self) -> &Supervisor {
        &self.background.node_mut().joint.base().supervisor
    }

    fn run_current_loop(&mut self) {
        for _ in 0..PERIODS_PER_MS {
            if self.is_reset() {
                // The reset also resets the timer, whose outputs return to their idle level.
                self.stage.off();
            } else if let Some(delay) = self.stage.next_interrupt() {
                let at = self.stage.cycles();
                let now = at.wrapping_add(200 + delay);
                self.task.interrupt(&mut self.stage, &mut self.port, at, now);
                if self.joint_words.is_none() && self.link.has_report() {
                    self.joint_words = self.stage.output_words();
                }
            }
            self.stage.step_period();
        }
    }
}

impl<J: Joint<Flash = RigFlash>> RigDriver for LibraryDriver<J> {
    fn stage(&self) -> &Stage {
        &self.stage
    }

    fn stage_mut(&mut self) -> &mut Stage {
        &mut self.stage
    }

    /// Delivers a frame to the background, or queues it during a stall and behind the frames of the stall.
    fn receive(&mut self, frame: &Frame) {
        let is_free = self.stalled_ms == 0 && self.deferred_frames.is_empty();
        if is_free && !self.is_reset() {
            self.background.node_mut().receive(frame, self.now_us);
        } else if self.deferred_frames.len() < RECEIVE_QUEUE_FRAMES {
            self.deferred_frames.push_back(*frame);
        }
    }

    fn step(&mut self, state: &BoardState, sync: Option<Frame>, sent: &mut dyn FnMut(CanFrame)) {
        self.now_us += TICK_US;
        if self.stalled_ms == 0 && !self.is_reset() {
            while let Some(frame) = self.deferred_frames.pop_front() {
                self.background.node_mut().receive(&frame, self.now_us);
            }
            let state = BoardState {
                hall: self.stage.hall_levels(),
                biss: self.stage.board.as_ref().and_then(BoardSensors::biss_words),
                joint_words: self.joint_words.take().or_else(|| self.stage.output_words()),
                ..*state
            };
            if self.background.tick(&state, Some(&mut self.link), self.now_us) {
                self.watchdog_unserviced_ms = 0;
            }
            if self.background.node().is_reset_requested() {
                self.reset = Some(ResetCause::Software);
            }
        }
        // Without its firmware, the processor does not drive the output.
        let output = self.background.node().joint.board_output().brake.filter(|_| !self.is_reset());
        self.stage.plant.energise_brake(output == Some(true));
        if let Some(sync) = sync {
            self.receive(&sync);
        }
        if self.stalled_ms == 0 {
            let node = self.background.node_mut();
            node.transmit_fd_if(|_| true).map(CanFrame::from).into_iter().for_each(&mut *sent);
            while let Some(frame) = node.transmit() {
                sent(frame.into());
            }
        }
        self.stalled_ms = self.stalled_ms.saturating_sub(1);
        self.watchdog_unserviced_ms += 1;
        if self.watchdog_unserviced_ms > WATCHDOG_TIMEOUT_MS && !self.is_reset() {
            self.reset = Some(ResetCause::Watchdog);
        }
        self.run_current_loop();
    }

    fn stall_background(&mut self, milliseconds: u32) {
        self.stalled_ms = milliseconds;
    }

    fn is_reset(&self) -> bool {
        self.reset.is_some()
    }

    fn reset(&mut self) {
        self.reset = Some(ResetCause::Pin);
    }

    fn cut_power(&mut self) {
        self.reset = Some(ResetCause::PowerOn);
    }

    fn restart(&mut self) -> Result<(), RigError> {
        self.now_us += TICK_US;
        let previous = &self.background.node().joint;
        let output = previous.board_output();
        let cause = self.reset.take().unwrap_or(ResetCause::PowerOn);
        let has_memory = cause != ResetCause::PowerOn;
        let boot = Boot {
            cause,
            winding_rise_k: output.winding_rise_k.filter(|_| has_memory),
            home: output.home.filter(|_| has_memory),
            ..Boot::default()
        };
        let flash = previous.flash().clone();
        self.background = start_node(flash, self.identity, &boot, self.now_us);
        (self.port, self.link) = connected(self.identity.stage, self.now_us);
        self.task = self.background.loop_task(LIMITS);
        if let Some(board) = &mut self.stage.board {
            board.restart_encoder(self.background.start_values());
        }
        self.deferred_frames.clear();
        (self.stalled_ms, self.watchdog_unserviced_ms) = (0, 0);
        self.run_current_loop();
        Ok(())
    }

    fn is_armed(&mut self) -> bool {
        !self.is_reset() && self.background.node_mut().joint.base().is_armed()
    }

    fn faults(&mut self) -> CodeSet {
        self.supervisor().faults()
    }

    fn limits(&mut self) -> CodeSet {
        self.supervisor().limits()
    }
}
