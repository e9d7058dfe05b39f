//! An update over the bus: checks, transfer with resume, restart, and the end of the trial.
//!
//! A transfer that fails goes on where the node stands: it states which package it is receiving and how much of it. If
//! another master cleared or changed it, the transfer begins again. Only a signed package that arrived completely can
//! replace the program, so nothing here protects the joint; it only saves time and reports reasons.

use super::package::{Package, Release};
use crate::bus::Bus;
use crate::canopen::{Client, SdoError};
use canopen_rs::Address;
use firmware::node::dictionary::index;
use firmware::node::dictionary::records::ProgramObject;
use firmware::update::PUBLISHED_KEY;
use firmware::update::package::Version;
use firmware::update::recovery::RECOVERY_STATE;
use firmware::update::session::OtherState;
use std::time::Duration;

const DATA: Address = Address::new(index::PROGRAM_DATA, 1);
const CONTROL: Address = Address::new(index::PROGRAM_CONTROL, 1);
const FLASH_STATUS: Address = Address::new(index::FLASH_STATUS, 1);
/// State of the joint: 1 is armed.
const JOINT_STATE: Address = Address::new(index::STATE, 2);
const ARMED: u32 = 1;

/// Commands of object 1F51h.
mod command {
    pub const PREPARE: u8 = 0;
    pub const START: u8 = 1;
    pub const CLEAR: u8 = 3;
}

/// Running states in object 2040h.
const TRIAL: u32 = 1;
const CONFIRMED: u32 = 2;

/// Attempts without progress after which a transfer ends.
const MAX_FAILURES: u32 = 10;
/// Number of times that a transfer begins again from the start.
const MAX_RESTARTS: u32 = 3;
/// Pause after a failed attempt, and between two questions.
const PAUSE: Duration = Duration::from_millis(50);
/// Longest verification in the node.
const VERIFY_TIMEOUT: Duration = Duration::from_secs(10);
/// Longest time from the restart to the end of the trial: check of the signature, 10 s of trial, and a second start.
const TRIAL_TIMEOUT: Duration = Duration::from_secs(30);
/// "Unknown command": a node without block transfer.
const UNKNOWN_COMMAND: u32 = 0x0504_0001;
/// "No such object."
const NO_OBJECT: u32 = 0x0602_0000;

/// Reasons of a refusal, by their number in object 1F57h.
const REFUSALS: [&str; 12] = [
    "no package",
    "the image differs from its CRC",
    "the signature is not of this board's key",
    "nothing was cleared before",
    "the flash reported an error",
    "the image is longer than the slot",
    "more bytes than the package has",
    "a package for another board",
    "it is older than the running program",
    "its image is linked for the slot of the running program",
    "the image differs from its SHA-512",
    "a package for a board with another wiring",
];
const CRC_REFUSAL: u32 = 2;

/// Error of an update; its message is one line.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum UpdateError {
    /// An object cannot be read or written.
    #[error(transparent)]
    Sdo(#[from] SdoError),
    /// The node has one program only.
    #[error("node {0}: this board has no place for a second program")]
    NoUpdates(u8),
    /// The package is for another board.
    #[error("the package is for board {}, but node {node} is board {}", board_name(*.package), board_name(*.found))]
    Board { package: u32, node: u8, found: u32 },
    /// The board of the node is wired otherwise.
    #[error(
        "the package is for a board with wiring {package:08x}, but that of node {node} is {found:08x}; expected images that were built for it"
    )]
    Wiring { package: u32, node: u8, found: u32 },
    /// The package is older than the running program; the node would refuse it.
    #[error(
        "version {package} is older than {running} on node {node}; sign the older program with a new version"
    )]
    Older { package: Version, node: u8, running: Version },
    /// The release has no image for the slot that the node receives into.
    #[error(
        "the file has no image for address {address:#010x}, where node {node} receives one; host-sim sign takes the images of both slots"
    )]
    Slot { node: u8, address: u32 },
    /// The joint is armed.
    #[error("node {0} is armed; disarm it first (host-sim params disarm)")]
    Armed(u8),
    /// A trial is running.
    #[error("node {0}: its program is on trial; try again in 10 s")]
    OnTrial(u8),
    /// The node refused the package.
    #[error("node {node} refused the package: {why}")]
    Refused { node: u8, why: &'static str },
    /// The transfer did not advance.
    #[error("the transfer to node {node} does not advance at {received} of {length} bytes: {why}")]
    Stuck { node: u8, received: u32, length: u32, why: String },
    /// Another master changed the transfer again and again.
    #[error("the transfer to node {0} was changed by another master each time; stop it")]
    Disturbed(u8),
    /// The old program runs again.
    #[error("node {node} returned to its old program: {why}")]
    Returned { node: u8, why: &'static str },
    /// The node is not seen again.
    #[error("node {0} does not answer after the restart")]
    Lost(u8),
}

/// Returns a board number as text.
pub fn board_name(board: u32) -> String {
    let bytes = board.to_be_bytes();
    if bytes.iter().all(u8::is_ascii_graphic) {
        bytes.iter().map(|byte| char::from(*byte)).collect()
    } else {
        format!("{board:08x}")
    }
}

/// What an update is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Bytes are transferred.
    Transfer,
    /// The node compares the CRC.
    Verification,
    /// The node restarts, checks the signature, and tries the program.
    Trial,
}

/// Result of an update.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Outcome {
    /// Version that ran before; `None` in recovery, or if a debugger wrote it.
    pub previous: Option<Version>,
    /// Version that runs now.
    pub version: Version,
    /// Length of the package, bytes.
    pub bytes: u32,
    /// Offset at which the transfer went on, bytes.
    pub resumed_at: u32,
    /// The program was there already.
    pub was_present: bool,
    /// Duration on the bus, ms.
    pub duration_ms: u64,
    /// The node accepts the published test key: anyone can sign a program for it.
    pub accepts_test_key: bool,
}

/// An update of one node.
pub struct Update<'a, B> {
    client: &'a mut Client<B>,
    node: u8,
    release: &'a Release,
    /// The package for the slot that the node does not run from.
    package: &'a Package,
}

impl<'a, B: Bus> Update<'a, B> {
    /// Returns an update of this node with this package.
    pub fn new(client: &'a mut Client<B>, node: u8, release: &'a Release) -> Self {
        let package = &release.packages()[0];
        Self { client, node, release, package }
    }

    /// Runs the update. `progress` receives the stage and the bytes that the node has confirmed.
    ///
    /// # Errors
    /// See [`UpdateError`]. The node keeps its program unless the result is `Ok`.
    pub fn run(mut self, progress: &mut dyn FnMut(Stage, u32)) -> Result<Outcome, UpdateError> {
        let start_ns = self.client.bus().now_ns();
        // The node may still await the rest of a transfer whose master ended, and takes the first question for a part of
        // it. It ends that transfer while the answer is awaited.
        let _ = self.entry(ProgramObject::STATE);
        let previous = self.check()?;
        let mut outcome = Outcome {
            previous,
            version: self.release.header().version,
            bytes: 0,
            resumed_at: 0,
            was_present: false,
            duration_ms: 0,
            accepts_test_key: self.entry(ProgramObject::UPDATE_KEY)? == PUBLISHED_KEY,
        };
        if self.release.contains(self.entry(ProgramObject::IDENTITY)?) {
            outcome.was_present = true;
            return Ok(outcome);
        }
        self.select_package()?;
        outcome.bytes = self.length();
        outcome.resumed_at = self.transfer(progress)?;
        progress(Stage::Trial, self.length());
        self.client.write(CONTROL, &[command::START])?;
        self.await_trial()?;
        outcome.duration_ms = (self.client.bus().now_ns() - start_ns) / 1_000_000;
        Ok(outcome)
    }

    /// Selects the package that is linked for the slot that the node receives into.
    fn select_package(&mut self) -> Result<(), UpdateError> {
        let (node, address) = (self.node, self.entry(ProgramObject::ACCEPTED_ADDRESS)?);
        let package = self.release.for_address(address);
        self.package = package.ok_or(UpdateError::Slot { node, address })?;
        Ok(())
    }

    fn length(&self) -> u32 {
        self.package.header.package_bytes()
    }

    fn entry(&mut self, sub_index: u8) -> Result<u32, SdoError> {
        self.client.read_number(Address::new(index::PROGRAM, sub_index))
    }

    /// Checks that the node may receive this package; returns its version.
    fn check(&mut self) -> Result<Option<Version>, UpdateError> {
        let (node, header) = (self.node, *self.release.header());
        let found = match self.entry(ProgramObject::BOARD) {
            Ok(0) | Err(SdoError::Refused { code: NO_OBJECT, .. }) => {
                return Err(UpdateError::NoUpdates(node));
            }
            found => found?,
        };
        if found != header.board {
            return Err(UpdateError::Board { package: header.board, node, found });
        }
        let found = self.entry(ProgramObject::WIRING)?;
        if found != header.wiring {
            return Err(UpdateError::Wiring { package: header.wiring, node, found });
        }
        let state = self.entry(ProgramObject::STATE)?;
        if state == TRIAL {
            return Err(UpdateError::OnTrial(node));
        }
        if state != RECOVERY_STATE && self.client.read_number(JOINT_STATE)? == ARMED {
            return Err(UpdateError::Armed(node));
        }
        let running = Version(self.entry(ProgramObject::VERSION)?);
        if header.counter < self.entry(ProgramObject::COUNTER)? {
            return Err(UpdateError::Older { package: header.version, node, running });
        }
        Ok((running.0 != 0).then_some(running))
    }

    /// Transfers the package until the node has verified it; returns the offset at which it began.
    fn transfer(&mut self, progress: &mut dyn FnMut(Stage, u32)) -> Result<u32, UpdateError> {
        let mut resumed_at = None;
        for _ in 0..=MAX_RESTARTS {
            let mut received = self.prepare()?;
            resumed_at.get_or_insert(received);
            if !self.send_rest(&mut received, progress)? {
                continue;
            }
            progress(Stage::Verification, received);
            match self.await_verification()? {
                None => return Ok(resumed_at.unwrap_or_default()),
                // Bytes of another master are in it.
                Some(CRC_REFUSAL) => {}
                Some(number) => {
                    let why = REFUSALS.get((number as usize).wrapping_sub(1)).copied();
                    let (node, why) = (self.node, why.unwrap_or("unknown reason"));
                    return Err(UpdateError::Refused { node, why });
                }
            }
        }
        Err(UpdateError::Disturbed(self.node))
    }

    /// Returns the number of bytes of this package that the node has. Begins a new transfer if it has none.
    fn prepare(&mut self) -> Result<u32, UpdateError> {
        if let Some(received) = self.standing()? {
            return Ok(received);
        }
        self.client.write(CONTROL, &[command::CLEAR])?;
        Ok(0)
    }

    /// Returns the number of bytes of this package that the node has; `None` if it receives another one or none.
    fn standing(&mut self) -> Result<Option<u32>, SdoError> {
        self.client.write(CONTROL, &[command::PREPARE])?;
        let is_same = self.entry(ProgramObject::RECEIVING)? == self.package.header.identity;
        if is_same { self.entry(ProgramObject::RECEIVED).map(Some) } else { Ok(None) }
    }

    /// Sends what the node does not have. Returns false if the transfer must begin again.
    fn send_rest(
        &mut self,
        received: &mut u32,
        progress: &mut dyn FnMut(Stage, u32),
    ) -> Result<bool, UpdateError> {
        let mut failures = 0;
        while *received < self.length() {
            let from = *received;
            let Err(error) = self.send_from(from, progress) else {
                *received = self.length();
                return Ok(true);
            };
            self.pause()?;
            let Ok(now) = self.standing() else {
                failures += 1;
                self.check_failures(failures, from, &error)?;
                continue;
            };
            let Some(now) = now else { return Ok(false) };
            if now < from {
                return Ok(false);
            }
            failures = if now > from { 0 } else { failures + 1 };
            self.check_failures(failures, now, &error)?;
            *received = now;
        }
        Ok(true)
    }

    fn check_failures(&self, count: u32, received: u32, why: &SdoError) -> Result<(), UpdateError> {
        if count < MAX_FAILURES {
            return Ok(());
        }
        let (node, length) = (self.node, self.length());
        Err(UpdateError::Stuck { node, received, length, why: why.to_string() })
    }

    fn send_from(
        &mut self,
        from: u32,
        progress: &mut dyn FnMut(Stage, u32),
    ) -> Result<(), SdoError> {
        let rest = self.package.bytes.get(from as usize..).unwrap_or_default();
        let sent = self.client.write_blocks(DATA, rest, |done| {
            progress(Stage::Transfer, from + done as u32);
        });
        match sent {
            Err(SdoError::Refused { code: UNKNOWN_COMMAND, .. }) if from == 0 => {
                self.client.write(DATA, rest)
            }
            sent => sent,
        }
    }

    /// Waits until the node has compared the CRC; returns the number of a refusal.
    fn await_verification(&mut self) -> Result<Option<u32>, UpdateError> {
        let until_ns = self.client.bus().now_ns() + VERIFY_TIMEOUT.as_nanos() as u64;
        loop {
            let status = self.client.read_number(FLASH_STATUS)?;
            if status & 1 == 0 {
                return Ok((status != 0).then_some(status >> 16));
            }
            if self.client.bus().now_ns() >= until_ns {
                return Err(UpdateError::Lost(self.node));
            }
            self.pause()?;
        }
    }

    /// Waits until the program is confirmed, or the old one runs again.
    fn await_trial(&mut self) -> Result<(), UpdateError> {
        let until_ns = self.client.bus().now_ns() + TRIAL_TIMEOUT.as_nanos() as u64;
        let wanted = self.package.header.identity;
        while self.client.bus().now_ns() < until_ns {
            self.pause()?;
            // During the restart there is no answer, or the old program still answers.
            let states =
                [ProgramObject::IDENTITY, ProgramObject::STATE, ProgramObject::OTHER_STATE]
                    .map(|entry| self.entry(entry));
            let [Ok(identity), Ok(state), Ok(other)] = states else { continue };
            if identity == wanted && state == CONFIRMED {
                return Ok(());
            }
            let why = if other == OtherState::NotSigned as u32 {
                "the signature of the package is not of its key"
            } else if other == OtherState::Failed as u32 {
                "the trial failed"
            } else {
                continue;
            };
            if identity != wanted {
                return Err(UpdateError::Returned { node: self.node, why });
            }
        }
        Err(UpdateError::Lost(self.node))
    }

    fn pause(&mut self) -> Result<(), SdoError> {
        Ok(self.client.bus().discard_within(PAUSE)?)
    }
}
