//! Why an emulated board does not start.

use firmware::store::memory::MemoryError;
use joint_rig::RigError;
use std::path::PathBuf;
use unicorn_engine::uc_error;

/// Why an image cannot be read or executed.
#[derive(Debug, thiserror::Error)]
pub enum EmulatorError {
    /// The file of the image cannot be read.
    #[error("{}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: std::io::Error,
    },
    /// The file is no ELF file.
    #[error("{}: {source}", path.display())]
    Format {
        /// The file.
        path: PathBuf,
        /// The reason.
        source: object::Error,
    },
    /// A segment of the image is not in its file.
    #[error("{}: the segment at {address:#x} is beyond the end of the file", path.display())]
    Segment {
        /// The file.
        path: PathBuf,
        /// Load address of the segment.
        address: u32,
    },
    /// The image has no segment in flash.
    #[error("the image has no code")]
    NoCode,
    /// The emulator of the processor refuses its set-up.
    #[error("emulator: {0:?}")]
    Processor(uc_error),
    /// The parameter set of the start is rejected.
    #[error(transparent)]
    Set(RigError),
    /// The store cannot be read.
    #[error("flash: {0:?}")]
    Store(MemoryError),
    /// The stage has no sensors of a board.
    #[error("the image needs the sensors of the board")]
    NoSensors,
    /// The image has no place for the heat of the winding.
    #[error("the image keeps no heat")]
    NoHeatMemory,
    /// The image has no place for the text of a panic.
    #[error("the image has no panic note")]
    NoPanicNote,
    /// The image resets before its boot-up frame.
    #[error("the image resets during its start")]
    ResetAtStart,
    /// The image closes the bridge before its boot-up frame.
    #[error("the image closes the bridge during its start")]
    ClosedBridgeAtStart,
    /// The image sends no boot-up frame.
    #[error("no boot-up frame within {within_ms} ms, at {at:#x}")]
    NoBootUp {
        /// Time in which it must come, ms.
        within_ms: usize,
        /// Address of the next instruction.
        at: u32,
    },
}
