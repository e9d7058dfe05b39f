//! A joint driver on this PC: the firmware's own background loop, with a bus in place of a controller.
//!
//! Everything on the bus is answered by the code that runs on the board. What is missing is a motor: its
//! inputs come over the bus (replay), and asked for its own sensors it says that it has none. Its flash
//! is kept in a file, or in memory and forgotten.

use crate::bus::{Bus, BusError, Participant};
use compensator_core::can::Node;
use firmware::background::{Background, BoardState, TICK_US};
use firmware::driver::{Boot, Driver, Identity};
use firmware::node_settings::{NodeSettings, Source};
use firmware::store::memory::{MemoryFlash, PAGE};
use firmware::supervisor::ResetCause;
use joint_trace::CanFrame;
use std::path::{Path, PathBuf};
use std::{fs, io};

/// Pages of flash: two slots of two pages each.
const PAGES: usize = 4;

/// Time between two ticks of the driver, ns.
const TICK_NS: u64 = 1000 * TICK_US;

/// A joint driver on this PC.
pub struct JointNode {
    /// Gone only while it restarts.
    background: Option<Background<MemoryFlash<PAGES>>>,
    defaults: NodeSettings,
    file: Option<PathBuf>,
    /// The flash as it was last written to the file.
    written: Vec<u8>,
    restarts: u32,
}

const IDENTITY: Identity = Identity { hardware: "PC, host-sim node", serial: 0 };

/// What a driver on a PC is where nothing is stored: fed by the bus, with this number.
pub fn defaults(node: Node) -> NodeSettings {
    NodeSettings { node, source: Source::Bus, ..NodeSettings::default() }
}

impl JointNode {
    /// Starts a driver with this number; its flash is kept in the file, where one is given.
    ///
    /// # Errors
    /// A file that cannot be read, or that is no flash of a driver.
    pub fn start(node: Node, file: Option<&Path>) -> io::Result<Self> {
        let mut flash = MemoryFlash::<PAGES>::new();
        let mut written = image(&flash);
        if let Some(path) = file {
            match fs::read(path) {
                Ok(bytes) if bytes.len() == PAGES * PAGE => {
                    flash.restore(&bytes);
                    written = bytes;
                }
                Ok(bytes) => {
                    let (found, expected) = (bytes.len(), PAGES * PAGE);
                    let why = format!("{found} bytes, expected {expected}: no flash of a driver");
                    return Err(io::Error::new(io::ErrorKind::InvalidData, why));
                }
                Err(error) if error.kind() == io::ErrorKind::NotFound => {}
                Err(error) => return Err(error),
            }
        }
        let defaults = defaults(node);
        let driver = Driver::boot(defaults, flash, IDENTITY, &Boot::default(), 0);
        let background = Some(Background::new(driver, 0));
        let file = file.map(Path::to_path_buf);
        Ok(Self { background, defaults, file, written, restarts: 0 })
    }

    /// The driver, to look at.
    pub fn driver(&self) -> Option<&Driver<MemoryFlash<PAGES>>> {
        self.background.as_ref().map(Background::driver)
    }

    /// How often it was restarted over the bus.
    pub const fn restarts(&self) -> u32 {
        self.restarts
    }

    /// Runs on a bus until `is_over`, asked at every tick, says so.
    ///
    /// # Errors
    /// A bus that is gone, a file that cannot be written.
    pub fn run(
        &mut self,
        bus: &mut dyn Bus,
        mut is_over: impl FnMut(&Self) -> bool,
    ) -> Result<(), BusError> {
        live(self, bus, |node, ticked| {
            if ticked {
                node.keep().map_err(BusError::Record)?;
            }
            Ok(is_over(node))
        })
    }

    /// Writes the flash to its file, where it has changed.
    fn keep(&mut self) -> io::Result<()> {
        let (Some(path), Some(driver)) = (&self.file, self.driver()) else { return Ok(()) };
        let now = image(driver.flash());
        if now != self.written {
            let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
            let mut file = tempfile::NamedTempFile::new_in(folder.unwrap_or(Path::new(".")))?;
            io::Write::write_all(&mut file, &now)?;
            file.persist(path).map_err(|error| error.error)?;
            self.written = now;
        }
        Ok(())
    }

    fn restart_if_asked(&mut self, now_ns: u64) {
        if self.driver().is_some_and(Driver::reset_wanted)
            && let Some(background) = self.background.take()
        {
            let boot = Boot { cause: ResetCause::Software, ..Boot::default() };
            let (flash, now_us) = (background.into_flash(), now_ns / 1000);
            let driver = Driver::boot(self.defaults, flash, IDENTITY, &boot, now_us);
            self.background = Some(Background::new(driver, now_us));
            self.restarts += 1;
        }
    }
}

/// Lets a participant live on a bus, in the bus's time, until `is_over` says so: asked after every frame, and told whether a
/// tick was due.
///
/// # Errors
/// A bus that is gone, and what `is_over` gives.
pub fn live<P: Participant>(
    node: &mut P,
    bus: &mut dyn Bus,
    mut is_over: impl FnMut(&mut P, bool) -> Result<bool, BusError>,
) -> Result<(), BusError> {
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
        // What is sent is sent before the next frame is looked at, or answers would pile up.
        while let Some(frame) = node.transmit() {
            bus.send(&frame)?;
        }
        // A frame's stamp says what time it is: the clock is asked where nothing came.
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

fn image(flash: &MemoryFlash<PAGES>) -> Vec<u8> {
    flash.image().flatten().copied().collect()
}

impl Participant for JointNode {
    fn receive(&mut self, frame: &CanFrame, now_ns: u64) {
        // A driver's controller takes classic data frames of 11 bits and drops all else.
        if let (Some(frame), Some(background)) = (frame.to_joint(), &mut self.background) {
            background.receive(&frame, now_ns / 1000);
        }
        self.restart_if_asked(now_ns);
    }

    fn tick(&mut self, now_ns: u64) -> Option<u64> {
        if let Some(background) = &mut self.background {
            background.tick(&BoardState::default(), None, now_ns / 1000);
        }
        Some(now_ns + TICK_NS)
    }

    fn transmit(&mut self) -> Option<CanFrame> {
        self.background.as_mut()?.transmit().map(CanFrame::from)
    }
}
