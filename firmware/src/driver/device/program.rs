//! Program update over the bus (CiA 302-3): objects 1F50h, 1F51h, 1F56h, 1F57h, and 2040h.
//!
//! [`crate::update::session`] lists the commands. All of them are refused while the joint is armed, and the joint is not
//! armed meanwhile, nor during a trial. [`crate::update::trial`] has its times; [`BLOCKING_CODES`]
//! delay its confirmation. A trial without one ends by a restart, and the boot program returns to the previous image. Until
//! the confirmation, the previous image is not cleared, and a restart that the bus orders is marked as such.

use super::Device;
use crate::log::log;
use crate::node::dictionary::records::ProgramObject;
use crate::node::sdo::Abort;
use crate::supervisor::Code;
use crate::update::Program;
use crate::update::marks::{self, ImageState, SlotState};
use crate::update::session::{CLEAR, NO_UPDATES, RESTART, Session};
use crate::update::trial::{Times, Trial, Verdict};
use compensator_core::parameters::Text;
use compensator_core::text;
use embedded_storage::nor_flash::NorFlash;

/// Codes during which a trial is not confirmed: the self-test, the loop, memory, parameters, the bus.
pub const BLOCKING_CODES: [Code; 9] = [
    Code::SelfTestFailed,
    Code::StackOverflow,
    Code::Internal,
    Code::LoopOverrun,
    Code::AdcTimeout,
    Code::SystemBreak,
    Code::StoreDamaged,
    Code::ParametersRefused,
    Code::CanBusOff,
];

/// State of the running program, as object 2040h reports it. 3 is the boot program in recovery.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
enum RunningState {
    /// A debugger wrote it, or the board has no updates.
    #[default]
    Bare = 0,
    Trial = 1,
    Confirmed = 2,
}

/// State of the program update.
#[derive(Debug, Default)]
pub(crate) struct ProgramState {
    /// `None` on a board without a second slot.
    session: Option<Session>,
    running: RunningState,
    /// The running image, if it has a header.
    image: Option<ImageState>,
    trial: Trial,
}

impl ProgramState {
    pub(super) fn new<F: NorFlash>(flash: &mut F, program: Program, now_us: u64) -> Self {
        let image = match marks::state(flash, &program.running) {
            SlotState::Image(image) => Some(image),
            SlotState::Empty | SlotState::Bare => None,
        };
        let running = match &image {
            None => RunningState::Bare,
            Some(image) if image.is_confirmed => RunningState::Confirmed,
            Some(_) => RunningState::Trial,
        };
        Self {
            session: Some(Session::new(flash, program, now_us)),
            running,
            image,
            trial: Trial::begin(now_us),
        }
    }

    /// Returns true if the running program is not confirmed yet.
    pub(super) fn is_on_trial(&self) -> bool {
        self.running == RunningState::Trial
    }

    /// Returns true once the restart into a new program, or out of a failed trial, is due.
    pub(crate) fn is_restart_due(&self, now_us: u64) -> bool {
        self.session.as_ref().is_some_and(|session| session.is_restart_due(now_us))
    }

    /// Returns object 1F51h: 1 if the program runs, 0 while an update is in progress.
    pub(crate) fn control(&self) -> u32 {
        u32::from(!self.session.as_ref().is_some_and(Session::is_active))
    }

    /// Returns object 1F56h: CRC-32 of the running image and of the one in the other slot; 0 if unknown.
    #[inline(never)]
    pub(crate) fn crcs(&self) -> [u32; 2] {
        let other = self.session.as_ref().map_or(0, Session::other_crc);
        [self.image.map_or(0, |image| image.header.crc), other]
    }

    /// Returns object 1F57h.
    pub(crate) fn flash_status(&self) -> u32 {
        self.session.as_ref().map_or(NO_UPDATES, Session::flash_status)
    }

    /// Returns object 2040h.
    pub(crate) fn object(&self) -> ProgramObject {
        let update = self.session.as_ref().map(Session::object).unwrap_or_default();
        let header = self.image.map(|image| image.header);
        ProgramObject {
            version: header.map_or(0, |header| header.version.0),
            rollback_counter: header.map_or(0, |header| header.counter),
            state: self.running as u32,
            identity: header.map_or(0, |header| header.identity),
            ..update
        }
    }
}

impl<F: NorFlash> Device<F> {
    /// Returns why the joint cannot be armed, if a program update is the reason.
    #[inline(never)]
    pub(super) fn update_blocks_arming(&self) -> Option<Text> {
        if self.program.session.as_ref().is_some_and(Session::is_active) {
            Some(text!("a program update is in progress: finish it, or wait 10 s"))
        } else if self.program.running == RunningState::Trial {
            Some(text!("this program is on trial: wait for its confirmation, 2 s after the start"))
        } else {
            None
        }
    }

    /// Writes the next part of a package.
    pub(crate) fn write_program(&mut self, bytes: &[u8]) -> Result<(), Abort> {
        self.refuse_in_trial()?;
        let Some(session) = &mut self.program.session else { return Err(self.no_updates()) };
        let written = session.write(self.memory.store.flash_mut(), bytes, self.base.now_us);
        written.map_err(|error| self.base.refuse(error.abort(), error.text()))
    }

    /// Executes a command of object 1F51h.
    pub(crate) fn control_program(&mut self, command: u8) -> Result<(), Abort> {
        self.refuse_in_trial()?;
        if command == CLEAR && self.program.running == RunningState::Trial {
            // The other slot holds the only program that is known to work.
            let why = text!("this program is on trial: clear the other one after its confirmation");
            return Err(self.base.refuse(Abort::State, why));
        }
        if command == RESTART {
            self.note_ordered_restart();
        }
        let Some(session) = &mut self.program.session else { return Err(self.no_updates()) };
        let done = session.control(self.memory.store.flash_mut(), command, self.base.now_us);
        done.map_err(|error| self.base.refuse(error.abort(), error.text()))
    }

    /// Notes that the bus orders the restart that follows: it does not count as a failure of a trial. If the mark fails,
    /// it does.
    pub(crate) fn note_ordered_restart(&mut self) {
        if let ProgramState {
            session: Some(session),
            image: Some(image),
            running: RunningState::Trial,
            ..
        } = &self.program
        {
            let slot = session.program().running;
            let _ = marks::order_restart(self.memory.store.flash_mut(), &slot, image);
        }
    }

    fn no_updates(&mut self) -> Abort {
        self.base.refuse(Abort::Refused, text!("this board has no place for a second program"))
    }

    /// Verifies a package in parts, and confirms or ends a trial. Called once per tick.
    pub(super) fn tick_program(&mut self, now_us: u64) {
        let Some(session) = &mut self.program.session else { return };
        if let Err(error) = session.tick(self.memory.store.flash_mut(), now_us) {
            self.base.refuse(error.abort(), error.text());
        }
        if self.program.running == RunningState::Trial {
            self.tick_trial(now_us);
        }
    }

    fn tick_trial(&mut self, now_us: u64) {
        let causes = self.base.supervisor.causes();
        let is_blocked = BLOCKING_CODES.iter().any(|code| causes.contains(*code));
        match self.program.trial.step(&Times::DEFAULT, is_blocked, now_us) {
            Verdict::Runs => {}
            Verdict::Confirm => self.confirm_trial(),
            Verdict::End => {
                if let Some(session) = &mut self.program.session {
                    log!(error, "the trial of this program failed");
                    session.request_restart(now_us);
                }
            }
        }
    }

    /// Confirms the running image. The double word stalls the loop for 85 us; the bridge is open.
    fn confirm_trial(&mut self) {
        let ProgramState { session: Some(session), image: Some(image), running, .. } =
            &mut self.program
        else {
            return;
        };
        let slot = session.program().running;
        if marks::confirm(self.memory.store.flash_mut(), &slot, image).is_ok() {
            image.is_confirmed = true;
            *running = RunningState::Confirmed;
            log!(info, "this program is confirmed");
        }
    }
}
