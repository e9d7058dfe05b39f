//! A joint driver on this PC: the firmware's background loop, with a [`Bus`] instead of a CAN controller.
//!
//! The code of the board answers all frames. There is no motor: the inputs come over the bus (replay), and the driver
//! reports its own sensors as missing. The flash is kept in a file, or in memory only.

use crate::bus::{Bus, BusError, Participant};
use compensator_core::can::NodeId;
use firmware::background::{Background, BoardState, TICK_US};
use firmware::driver::{Boot, Device, Driver, Identity};
use firmware::joint_node::{Equipment, Joint as _};
use firmware::loop_parts::StageTraits;
use firmware::node_settings::{InputSource, NodeSettings};
use firmware::store::memory::{MemoryFlash, PAGE_BYTES};
use firmware::supervisor::ResetCause;
use joint_trace::CanFrame;
use std::hash::{BuildHasher, RandomState};
use std::path::{Path, PathBuf};
use std::{fs, io};

/// Flash pages: two slots of two pages each.
const FLASH_PAGES: usize = 4;

/// Length of the file of a flash, bytes.
const FLASH_BYTES: usize = FLASH_PAGES * PAGE_BYTES;

/// Tick period of the driver, ns.
const TICK_NS: u64 = 1000 * TICK_US;

/// Error of a driver on this PC; its message is one line.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum JointError {
    /// The file of the flash cannot be read or written.
    #[error("{path}: {source}")]
    Flash { path: PathBuf, source: io::Error },
    /// The file has another length than a flash.
    #[error("{path}: {found} bytes, expected {FLASH_BYTES}: not the flash of a driver")]
    Length { path: PathBuf, found: usize },
    /// Error of the bus.
    #[error(transparent)]
    Bus(#[from] BusError),
}

/// A joint driver on this PC.
pub struct JointNode {
    background: Background<Device<MemoryFlash<FLASH_PAGES>>>,
    defaults: NodeSettings,
    file: Option<PathBuf>,
    /// Contents of the flash file.
    written: Vec<u8>,
    restarts: u32,
}

const IDENTITY: Identity =
    Identity { hardware: "PC, host-sim node", serial: 0, stage: StageTraits::NONE };

/// Returns the settings of a driver without stored ones: inputs from the bus, and this node number.
pub fn defaults(node: NodeId) -> NodeSettings {
    NodeSettings { node, source: InputSource::Bus, ..NodeSettings::default() }
}

/// Starts a driver and its background loop. The random numbers of the process are the secret of its challenges.
fn start_background(
    defaults: NodeSettings,
    flash: MemoryFlash<FLASH_PAGES>,
    boot: &Boot,
    now_us: u64,
) -> Background<Device<MemoryFlash<FLASH_PAGES>>> {
    let driver = Driver::boot(defaults, flash, IDENTITY, boot, now_us);
    let mut background = Background::new(driver, now_us);
    let [low, high] = [0u8, 1].map(|half| RandomState::new().hash_one(half).to_le_bytes());
    let seed = std::array::from_fn(|at| if at < 8 { low[at] } else { high[at - 8] });
    background.equip(Equipment { sends_fd: true, seed: Some(seed), scope: None });
    background
}

impl JointNode {
    /// Starts a driver with this node number. Its flash is kept in `file`, if given.
    ///
    /// # Errors
    /// Returns an error if the file cannot be read or does not have the size of a driver's flash.
    pub fn start(node: NodeId, file: Option<&Path>) -> Result<Self, JointError> {
        let mut flash = MemoryFlash::<FLASH_PAGES>::new();
        let mut written = image(&flash);
        if let Some(path) = file {
            match fs::read(path) {
                Ok(bytes) if bytes.len() == FLASH_BYTES => {
                    flash.restore(&bytes);
                    written = bytes;
                }
                Ok(bytes) => {
                    return Err(JointError::Length { path: path.into(), found: bytes.len() });
                }
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                Err(source) => return Err(JointError::Flash { path: path.into(), source }),
            }
        }
        let defaults = defaults(node);
        let background = start_background(defaults, flash, &Boot::default(), 0);
        Ok(Self { background, defaults, file: file.map(Into::into), written, restarts: 0 })
    }

    /// Returns the driver, for inspection.
    pub fn driver(&self) -> &Driver<MemoryFlash<FLASH_PAGES>> {
        self.background.node()
    }

    /// Returns the number of restarts over the bus.
    pub const fn restarts(&self) -> u32 {
        self.restarts
    }

    /// Runs on a bus until `is_over`, called after every frame and tick, returns true.
    ///
    /// # Errors
    /// Returns an error if the bus is closed or the flash file cannot be written.
    pub fn run(
        &mut self,
        bus: &mut dyn Bus,
        mut is_over: impl FnMut(&Self) -> bool,
    ) -> Result<(), JointError> {
        run_participant(self, bus, |node, ticked| {
            if ticked {
                node.save_flash()?;
            }
            Ok(is_over(node))
        })
    }

    /// Writes the flash to its file if it has changed.
    fn save_flash(&mut self) -> Result<(), JointError> {
        let Some(path) = &self.file else { return Ok(()) };
        let now = image(self.driver().joint.flash());
        if now != self.written {
            let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
            let replace = || {
                let mut file = tempfile::NamedTempFile::new_in(folder.unwrap_or(Path::new(".")))?;
                io::Write::write_all(&mut file, &now)?;
                file.persist(path).map_err(|error| error.error)
            };
            replace().map_err(|source| JointError::Flash { path: path.clone(), source })?;
            self.written = now;
        }
        Ok(())
    }

    fn restart_if_asked(&mut self, now_ns: u64) {
        if self.driver().is_reset_requested() {
            let boot = Boot { cause: ResetCause::Software, ..Boot::default() };
            let (flash, now_us) = (self.driver().joint.flash().clone(), now_ns / 1000);
            self.background = start_background(self.defaults, flash, &boot, now_us);
            self.restarts += 1;
        }
    }
}

/// Runs a participant on a bus, in bus time, until `is_over` returns true. `is_over` is called after every frame and tick;
/// its argument is true after a tick.
///
/// # Errors
/// Returns an error if the bus is closed, and the error of `is_over`.
pub fn run_participant<P: Participant>(
    node: &mut P,
    bus: &mut dyn Bus,
    mut is_over: impl FnMut(&mut P, bool) -> Result<bool, JointError>,
) -> Result<(), JointError> {
    let start_ns = bus.now_ns();
    let (mut now_ns, mut due_ns) = (start_ns, start_ns);
    loop {
        let ticks = now_ns >= due_ns;
        if ticks {
            node.tick(now_ns - start_ns);
            due_ns = now_ns + TICK_NS;
        }
        if is_over(node, ticks)? {
            return Ok(());
        }
        // All answers are sent before the next frame is read, so that they do not accumulate.
        while let Some(frame) = node.transmit() {
            send(bus, &frame)?;
        }
        // The time stamp of a frame is the time. The clock is read only if no frame came.
        now_ns = match bus.receive(due_ns)? {
            Some(received) => {
                let time_ns = received.time_ns.max(start_ns);
                node.receive(&received.frame, time_ns - start_ns);
                now_ns.max(time_ns)
            }
            None => bus.now_ns(),
        };
    }
}

/// Sends a frame. On a bus without CAN FD, telemetry is sent in the classic frames that it contains.
fn send(bus: &mut dyn Bus, frame: &CanFrame) -> Result<(), BusError> {
    match (bus.send(frame), frame.to_telemetry()) {
        (Err(BusError::Unsupported { .. }), Some(telemetry)) => {
            telemetry.frames().try_for_each(|frame| bus.send(&frame.into()))
        }
        (result, _) => result,
    }
}

fn image(flash: &MemoryFlash<FLASH_PAGES>) -> Vec<u8> {
    flash.image().flatten().copied().collect()
}

impl Participant for JointNode {
    fn receive(&mut self, frame: &CanFrame, now_ns: u64) {
        // The driver's CAN controller accepts classic data frames with 11-bit identifiers only.
        if let Some(frame) = frame.to_joint() {
            self.background.node_mut().receive(&frame, now_ns / 1000);
        }
        self.restart_if_asked(now_ns);
    }

    fn tick(&mut self, now_ns: u64) -> Option<u64> {
        self.background.tick(&BoardState::default(), None, now_ns / 1000);
        Some(now_ns + TICK_NS)
    }

    fn transmit(&mut self) -> Option<CanFrame> {
        let node = self.background.node_mut();
        if let Some(telemetry) = node.transmit_fd_if(|_| true) {
            return Some(telemetry.into());
        }
        node.transmit().map(CanFrame::from)
    }
}
