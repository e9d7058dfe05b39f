//! The update as a master sees it (CiA 302-3): commands, data and status, for the driver and for the boot program.
//!
//! ```text
//! 1F51h:1 = 0   prepare: go on with a package that a loss of power interrupted, if there is one
//! 1F51h:1 = 3   clear: begin a new package
//! 1F50h:1       the package, in one or more transfers; each continues the one before
//! 1F57h:1       wait until the verification has ended
//! 1F51h:1 = 1   start the new program: a restart, and a trial
//! 1F51h:1 = 2   restart
//! ```

use super::Program;
use super::marks::{self, ImageState, SlotState};
use super::receiver::{Receiver, Refusal};
use crate::node::dictionary::records::ProgramObject;
use crate::node::sdo::Abort;
use compensator_core::parameters::Text;
use compensator_core::text;
use embedded_storage::nor_flash::NorFlash;

/// Time after the last access until a transfer counts as left, us.
pub const SESSION_US: u64 = 10_000_000;
/// Time between the request to start a program and the restart, us: the answer is sent.
const RESTART_DELAY_US: u64 = 5_000;

/// Error in 1F57h (CiA 302-3) that is none of the numbered ones.
const OTHER_ERROR: u32 = 63;
/// Object 1F57h of a board without updates.
pub const NO_UPDATES: u32 = OTHER_ERROR << 1;

/// Command to go on with a package that a loss of power interrupted.
const PREPARE: u8 = 0;
/// Command to start the received program.
const START: u8 = 1;
/// Command to restart.
pub const RESTART: u8 = 2;
/// Command to begin a new package.
pub const CLEAR: u8 = 3;

/// Reason why a request is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RequestError {
    /// The package is refused.
    Package(Refusal),
    /// The package is not complete or not accepted, so it cannot be started.
    NotReady,
    /// There is no such command.
    Command(u8),
}

impl RequestError {
    /// Returns its abort code.
    #[inline(never)]
    pub const fn abort(self) -> Abort {
        match self {
            Self::NotReady | Self::Package(Refusal::NotCleared) => Abort::State,
            Self::Package(Refusal::Flash) => Abort::Hardware,
            Self::Package(Refusal::TooLong(_) | Refusal::Excess) => Abort::TooLong,
            Self::Command(_) | Self::Package(_) => Abort::Value,
        }
    }

    /// Returns the reason as a text.
    pub const fn text(self) -> Text {
        match self {
            Self::Package(refusal) => refusal.text(),
            Self::NotReady => text!("the package is not complete or not accepted (1F57h)"),
            Self::Command(_) => {
                text!("program control: must be 0 prepare, 1 start, 2 reset or 3 clear")
            }
        }
    }
}

/// State of the image that does not run, as object 2040h reports it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum OtherState {
    /// There is none.
    Empty = 0,
    /// It waits for its first start.
    Waiting = 1,
    /// Its signature is not of this board's key.
    NotSigned = 2,
    /// Its trial failed.
    Failed = 3,
    /// It was confirmed.
    Confirmed = 4,
}

/// State of an update.
#[derive(Debug)]
pub struct Session {
    receiver: Receiver,
    /// The image in the other slot.
    other: Option<ImageState>,
    /// Identity of the package that is received; 0 if unknown.
    receiving: u32,
    accessed_us: u64,
    now_us: u64,
    restart_us: Option<u64>,
    update_key: u32,
}

impl Session {
    /// Returns a session without a transfer.
    pub fn new<F: NorFlash>(flash: &mut F, program: Program, now_us: u64) -> Self {
        let mut session = Self {
            receiver: Receiver::new(program),
            other: None,
            receiving: 0,
            accessed_us: 0,
            now_us,
            restart_us: None,
            update_key: program.update_key(flash),
        };
        session.read_other(flash);
        session
    }

    fn read_other<F: NorFlash>(&mut self, flash: &mut F) {
        self.other = match marks::state(flash, &self.receiver.program().other) {
            SlotState::Image(image) => Some(image),
            SlotState::Empty | SlotState::Bare => None,
        };
    }

    /// Returns the board's description.
    pub const fn program(&self) -> &Program {
        self.receiver.program()
    }

    /// Requests a restart at this time, us.
    pub fn request_restart(&mut self, at_us: u64) {
        self.restart_us.get_or_insert(at_us);
    }

    /// Returns true once a requested restart is due.
    pub fn is_restart_due(&self, now_us: u64) -> bool {
        self.restart_us.is_some_and(|due_us| now_us >= due_us)
    }

    /// Returns true while a package is received or verified, or a restart is due soon. A transfer without access for
    /// [`SESSION_US`] counts as left.
    #[inline(never)]
    pub const fn is_active(&self) -> bool {
        let is_left = self.now_us.saturating_sub(self.accessed_us) >= SESSION_US;
        self.restart_us.is_some() || self.receiver.is_busy() && !is_left
    }

    /// Writes the next part of a package (1F50h).
    ///
    /// # Errors
    /// Returns why the package is refused.
    pub fn write<F: NorFlash>(
        &mut self,
        flash: &mut F,
        bytes: &[u8],
        now_us: u64,
    ) -> Result<(), RequestError> {
        (self.now_us, self.accessed_us) = (now_us, now_us);
        self.receiver.write(flash, bytes).map_err(RequestError::Package)
    }

    /// Executes a command (1F51h).
    ///
    /// # Errors
    /// Returns why it is refused.
    pub fn control<F: NorFlash>(
        &mut self,
        flash: &mut F,
        command: u8,
        now_us: u64,
    ) -> Result<(), RequestError> {
        (self.now_us, self.accessed_us) = (now_us, now_us);
        match command {
            PREPARE => {
                let resumed = self.receiver.resume(flash);
                self.receiving = resumed.map_or(0, |header| header.identity);
                Ok(())
            }
            START if self.receiver.is_ready() => {
                self.request_restart(now_us + RESTART_DELAY_US);
                Ok(())
            }
            // The running program is started already.
            START if !self.receiver.is_busy() && self.receiver.refusal().is_none() => Ok(()),
            START => Err(RequestError::NotReady),
            RESTART => {
                self.request_restart(now_us + RESTART_DELAY_US);
                Ok(())
            }
            CLEAR => {
                (self.receiving, self.other) = (0, None);
                self.receiver.clear(flash).map_err(RequestError::Package)
            }
            _ => Err(RequestError::Command(command)),
        }
    }

    /// Does a part of the verification. Call it once per millisecond.
    ///
    /// # Errors
    /// Returns once why the package is refused.
    pub fn tick<F: NorFlash>(&mut self, flash: &mut F, now_us: u64) -> Result<(), RequestError> {
        self.now_us = now_us;
        if !self.receiver.is_verifying() {
            return Ok(());
        }
        self.accessed_us = now_us;
        self.receiver.step(flash);
        if self.receiver.is_ready() {
            self.read_other(flash);
        }
        self.receiver.refusal().map_or(Ok(()), |refusal| Err(RequestError::Package(refusal)))
    }

    /// Returns the CRC-32 of the image in the other slot; 0 if there is none.
    pub fn other_crc(&self) -> u32 {
        self.other.map_or(0, |image| image.header.crc)
    }

    /// Returns the entries of object 2040h about board and update; those of the running program are 0.
    #[inline(never)]
    pub fn object(&self) -> ProgramObject {
        let program = self.receiver.program();
        let other_state = match &self.other {
            None => OtherState::Empty,
            Some(ImageState { is_rejected: true, trials: 0, .. }) => OtherState::NotSigned,
            Some(ImageState { is_rejected: true, .. }) => OtherState::Failed,
            Some(ImageState { is_confirmed: true, .. }) => OtherState::Confirmed,
            Some(_) => OtherState::Waiting,
        };
        ProgramObject {
            board: program.board.number,
            other_version: self.other.map_or(0, |image| image.header.version.0),
            other_state: other_state as u32,
            receiving: self.receiving,
            received_bytes: self.receiver.received(),
            accepted_address: program.image_address(&program.other),
            wiring: program.board.wiring,
            update_key: self.update_key,
            ..ProgramObject::default()
        }
    }

    /// Returns object 1F57h: bit 0 in progress, bits 1 to 7 the error, and from bit 16 the number of the refusal.
    pub const fn flash_status(&self) -> u32 {
        if self.receiver.is_verifying() {
            return 1;
        }
        let Some(refusal) = self.receiver.refusal() else { return 0 };
        let (error, number) = match refusal {
            Refusal::NoPackage => (2, 1),
            Refusal::Crc => (3, 2),
            Refusal::NotCleared => (4, 4),
            Refusal::Flash => (5, 5),
            Refusal::TooLong(_) => (6, 6),
            Refusal::Excess => (6, 7),
            Refusal::Board(_) => (OTHER_ERROR, 8),
            Refusal::Counter(..) => (OTHER_ERROR, 9),
            Refusal::Address(_) => (OTHER_ERROR, 10),
            Refusal::Hash => (3, 11),
            Refusal::Wiring(_) => (OTHER_ERROR, 12),
        };
        error << 1 | number << 16
    }
}
