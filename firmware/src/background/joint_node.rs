//! What the background loop calls of a joint on its bus.

use crate::control::Covariates;
use crate::driver::{Boot, Driver, KeptHome, LoopCommands, LoopReport};
use crate::loop_parts::StageTraits;
use crate::parameter_set::ParameterSet;
use crate::scope::ScopeRow;
use crate::sensors::biss::{self, TURN_WORDS};
use crate::sensors::enclosure;
use crate::start_values::StartRecord;
use crate::supervisor::CanState;
use compensator_core::adaptation::Gains;
use compensator_core::can::{FdTelemetry, Frame};
use compensator_core::network::Factors;
use embedded_storage::nor_flash::NorFlash;

/// A joint on its bus. What a node without a part does not need has an empty default.
pub trait JointNode {
    /// Loads settings and parameters, and reports how the previous run ended.
    fn load(&mut self, boot: &Boot, now_us: u64);

    /// Processes a received frame.
    fn receive(&mut self, frame: &Frame, now_us: u64);

    /// Returns the next frame to send of those whose identifier the controller can take now.
    fn transmit_if(&mut self, can_send: impl FnMut(u16) -> bool) -> Option<Frame>;

    /// Returns the frame of CAN FD that waits, if the controller can take its identifier now.
    fn transmit_fd_if(&mut self, _can_send: impl FnOnce(u16) -> bool) -> Option<FdTelemetry> {
        None
    }

    /// Returns true if the network requested a restart and the joint has stopped.
    fn is_reset_requested(&self) -> bool;

    /// Returns the identifiers that the controller must accept besides those of the start; 0 for none.
    fn receive_identifiers(&self) -> [u16; 7];

    /// Returns the parameters in use.
    fn set(&self) -> &ParameterSet;

    /// Returns what the node keeps of its start.
    fn start_record(&self) -> &StartRecord;

    /// Returns the same, to be changed.
    fn start_record_mut(&mut self) -> &mut StartRecord;

    /// Returns the properties of the power stage.
    fn stage(&self) -> StageTraits;

    /// Sets the state of the CAN controller, and whether received frames were lost.
    fn bus_state(&mut self, receiver_overrun: bool, can: CanState);

    /// Sets the last readings of the dry side, before a tick.
    fn set_enclosure(&mut self, _readings: enclosure::Readings) {}

    /// Sets the first words of the last frame of a BiSS encoder, before a tick.
    fn take_biss(&mut self, _words: Option<[u16; TURN_WORDS]>) {}

    /// Sets the levels of Hall sensors, before the reports of a tick.
    fn take_hall(&mut self, _levels: u8) {}

    /// Sets the words of the encoder at the joint's side of the gear, before the reports.
    fn set_joint_words(&mut self, _words: Option<[u16; biss::WORDS]>) {}

    /// Processes a report of the current loop.
    fn report(&mut self, report: &LoopReport);

    /// Takes a row of the scope from the current loop.
    fn take_scope_row(&mut self, _row: &ScopeRow) {}

    /// Runs the periodic work.
    fn tick(&mut self, now_us: u64);

    /// Returns the commands for the current loop.
    fn loop_commands(&self, now_us: u64) -> LoopCommands;

    /// Checks that the sensors of side load and pressure still change. The reading of a stuck sensor ages.
    fn check_seal_sensors(&mut self, covariates: &mut Covariates, now_us: u64);

    /// Returns the factors of a network for the law, if there is one.
    fn supply(&mut self, _covariates: &Covariates, _now_us: u64) -> Option<Factors<f32>> {
        None
    }

    /// Returns the gains that the adaptation has learnt, and their number.
    fn learnt_gains(&self) -> Option<(u32, Gains<f32>)> {
        None
    }

    /// Returns the level of the holding brake's output; `None` if it is not driven.
    fn brake_output(&self) -> Option<bool> {
        None
    }

    /// Returns the rise of the winding above the stator by its model, K; `None` if it is not known.
    fn winding_rise_k(&self) -> Option<f32>;

    /// Returns the home that a board keeps across a reset.
    fn kept_home(&self) -> Option<KeptHome> {
        None
    }
}

impl<F: NorFlash> JointNode for Driver<F> {
    fn load(&mut self, boot: &Boot, now_us: u64) {
        Self::load(self, boot, now_us);
    }

    fn receive(&mut self, frame: &Frame, now_us: u64) {
        Self::receive(self, frame, now_us);
    }

    fn transmit_if(&mut self, can_send: impl FnMut(u16) -> bool) -> Option<Frame> {
        Self::transmit_if(self, can_send)
    }

    fn transmit_fd_if(&mut self, can_send: impl FnOnce(u16) -> bool) -> Option<FdTelemetry> {
        Self::transmit_fd_if(self, can_send)
    }

    fn is_reset_requested(&self) -> bool {
        Self::is_reset_requested(self)
    }

    fn receive_identifiers(&self) -> [u16; 7] {
        Self::receive_identifiers(self)
    }

    fn set(&self) -> &ParameterSet {
        Self::set(self)
    }

    fn start_record(&self) -> &StartRecord {
        Self::start_record(self)
    }

    fn start_record_mut(&mut self) -> &mut StartRecord {
        Self::start_record_mut(self)
    }

    fn stage(&self) -> StageTraits {
        Self::stage(self)
    }

    fn bus_state(&mut self, receiver_overrun: bool, can: CanState) {
        Self::bus_state(self, receiver_overrun, can);
    }

    fn set_enclosure(&mut self, readings: enclosure::Readings) {
        Self::set_enclosure(self, readings);
    }

    fn take_biss(&mut self, words: Option<[u16; TURN_WORDS]>) {
        Self::take_biss(self, words);
    }

    fn take_hall(&mut self, levels: u8) {
        Self::take_hall(self, levels);
    }

    fn set_joint_words(&mut self, words: Option<[u16; biss::WORDS]>) {
        Self::set_joint_words(self, words);
    }

    fn report(&mut self, report: &LoopReport) {
        Self::report(self, report);
    }

    fn take_scope_row(&mut self, row: &ScopeRow) {
        Self::take_scope_row(self, row);
    }

    fn tick(&mut self, now_us: u64) {
        Self::tick(self, now_us);
    }

    fn loop_commands(&self, now_us: u64) -> LoopCommands {
        Self::loop_commands(self, now_us)
    }

    fn check_seal_sensors(&mut self, covariates: &mut Covariates, now_us: u64) {
        Self::check_seal_sensors(self, covariates, now_us);
    }

    fn supply(&mut self, covariates: &Covariates, now_us: u64) -> Option<Factors<f32>> {
        Self::supply(self, covariates, now_us)
    }

    fn learnt_gains(&self) -> Option<(u32, Gains<f32>)> {
        Some(Self::learnt_gains(self))
    }

    fn brake_output(&self) -> Option<bool> {
        Self::brake_output(self)
    }

    fn winding_rise_k(&self) -> Option<f32> {
        Self::winding_rise_k(self)
    }

    fn kept_home(&self) -> Option<KeptHome> {
        Self::kept_home(self)
    }
}
