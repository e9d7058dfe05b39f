//! The receiving side of an update: it writes a package to the other slot and checks what arrived.
//!
//! [`Receiver::clear`] erases the marks of that slot, so it holds no image until the package is complete. A page is erased
//! when the page before it begins. The header is checked as soon as it is complete. Once all bytes have arrived,
//! [`Receiver::step`] reads the image back in small parts and compares its CRC and SHA-512; then it writes the mark. The
//! signature of the hash is checked by the boot program, before the first start.
//!
//! A transfer that stops can go on at [`Receiver::received`]. After a loss of power this number comes from the flash: the
//! start of the page before the first blank one, which is then erased and written again. If that is wrong, as after a torn
//! erase, the CRC differs, and the transfer begins again.

use super::flash::{is_blank, read_chunks};
use super::marks::{self, SlotState};
use super::package::{HASH_AT, HEADER_BYTES, Header, USED_BYTES, continue_crc};
use super::{Program, Slot, UNIT_BYTES};
use compensator_core::parameters::Text;
use compensator_core::text;
use embedded_storage::nor_flash::NorFlash;
use sha2::{Digest, Sha512};

/// Bytes of the image that one step reads back: two blocks of SHA-512.
const STEP_BYTES: u32 = 256;
const UNIT: usize = UNIT_BYTES as usize;

/// Reason why a package was not accepted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Refusal {
    /// The bytes have no header of a package.
    NoPackage,
    /// The package is for this board type.
    Board(u32),
    /// The package is for the board with this wiring.
    Wiring(u32),
    /// Its image is linked for this address, which is not that of the slot.
    Address(u32),
    /// Its counter, and the smallest one that is accepted.
    Counter(u32, u32),
    /// The image has this length, more than the slot.
    TooLong(u32),
    /// More bytes than the package has.
    Excess,
    /// Nothing was cleared before the first byte.
    NotCleared,
    /// The CRC of the image differs: bytes were changed, or come from two packages.
    Crc,
    /// The SHA-512 of the image differs: image and header are not of one package.
    Hash,
    /// The flash reported an error.
    Flash,
}

impl Refusal {
    /// Returns the reason as a text.
    pub const fn text(self) -> Text {
        match self {
            Self::NoPackage => text!("no package of this firmware"),
            Self::Board(_) => text!("a package for another board"),
            Self::Wiring(_) => text!("a package for a board with another wiring"),
            Self::Address(_) => text!("an image for the slot that runs"),
            Self::Counter(..) => text!("older than the program that runs"),
            Self::TooLong(_) => text!("an image longer than the slot"),
            Self::Excess => text!("more bytes than the package has"),
            Self::NotCleared => text!("clear the program first (1F51h:1 = 3)"),
            Self::Crc => text!("the image differs from its CRC"),
            Self::Hash => text!("the image differs from its SHA-512"),
            Self::Flash => text!("the flash reported an error"),
        }
    }
}

/// Progress of an update.
#[derive(Clone, Debug)]
enum Stage {
    Idle,
    Receiving,
    Verifying { at: u32, crc: u32 },
    Ready,
    Refused(Refusal),
}

/// The receiver.
#[derive(Clone, Debug)]
pub struct Receiver {
    program: Program,
    stage: Stage,
    /// Bytes received, including those that wait for a whole double word.
    received: u32,
    pending: [u8; UNIT],
    /// Offset after the last erased page.
    erased_until: u32,
    /// Length of the package, once its header is known.
    length: Option<u32>,
    /// SHA-512 of the image as far as it is verified.
    hash: Option<Sha512>,
}

impl Receiver {
    /// Returns a receiver without a transfer.
    pub const fn new(program: Program) -> Self {
        Self {
            program,
            stage: Stage::Idle,
            received: 0,
            pending: [0xFF; UNIT],
            erased_until: 0,
            length: None,
            hash: None,
        }
    }

    /// Returns the board's description.
    pub const fn program(&self) -> &Program {
        &self.program
    }

    /// Returns the number of bytes received of the present package.
    pub const fn received(&self) -> u32 {
        self.received
    }

    /// Returns true while bytes are expected or verified.
    pub const fn is_busy(&self) -> bool {
        self.is_receiving() || self.is_verifying()
    }

    /// Returns true while bytes are expected.
    pub const fn is_receiving(&self) -> bool {
        matches!(self.stage, Stage::Receiving)
    }

    /// Returns true while the package is verified.
    pub const fn is_verifying(&self) -> bool {
        matches!(self.stage, Stage::Verifying { .. })
    }

    /// Returns true if a verified image waits for its start.
    pub const fn is_ready(&self) -> bool {
        matches!(self.stage, Stage::Ready)
    }

    /// Returns why the last package was refused.
    pub const fn refusal(&self) -> Option<Refusal> {
        match self.stage {
            Stage::Refused(refusal) => Some(refusal),
            _ => None,
        }
    }

    /// Begins a new package: what the other slot held is no image any more.
    ///
    /// # Errors
    /// The flash reported an error.
    pub fn clear<F: NorFlash>(&mut self, flash: &mut F) -> Result<(), Refusal> {
        *self = Self::new(self.program);
        let slot = self.program.other;
        let page = slot.marks_page(F::ERASE_SIZE as u32);
        flash.erase(page.start, page.end).map_err(|_| self.refuse(Refusal::Flash))?;
        // The header, too: without it, nothing can be resumed.
        let header = slot.start..slot.start + F::ERASE_SIZE as u32;
        flash.erase(header.start, header.end).map_err(|_| self.refuse(Refusal::Flash))?;
        self.erased_until = header.end;
        self.stage = Stage::Receiving;
        Ok(())
    }

    /// Goes on with a package that a loss of power interrupted; returns its header. `None` if there is no such package.
    pub fn resume<F: NorFlash>(&mut self, flash: &mut F) -> Option<Header> {
        let slot = self.program.other;
        if !matches!(self.stage, Stage::Idle | Stage::Receiving)
            || marks::state(flash, &slot) != SlotState::Empty
        {
            return None;
        }
        let header = marks::header(flash, &slot)?;
        if matches!(self.stage, Stage::Receiving) {
            return Some(header);
        }
        self.check(flash, &header).ok()?;
        // The marks may be half-erased.
        let page = slot.marks_page(F::ERASE_SIZE as u32);
        flash.erase(page.start, page.end).ok()?;
        // The page behind the last one that was begun is blank; what follows is of an earlier image.
        let mut last = slot.start;
        for at in (slot.start..slot.start + header.package_bytes()).step_by(F::ERASE_SIZE) {
            if is_blank(flash, at, F::ERASE_SIZE as u32) {
                break;
            }
            last = at;
        }
        if last == slot.start {
            return None;
        }
        self.received = last - slot.start;
        self.erased_until = last;
        self.length = Some(header.package_bytes());
        self.stage = Stage::Receiving;
        Some(header)
    }

    /// Writes the next bytes of the package.
    ///
    /// # Errors
    /// Returns why the package is refused; a new one begins with [`Receiver::clear`].
    pub fn write<F: NorFlash>(&mut self, flash: &mut F, bytes: &[u8]) -> Result<(), Refusal> {
        if !self.is_receiving() {
            let why = self.refusal().unwrap_or(Refusal::NotCleared);
            return Err(why);
        }
        let start = self.program.other.start;
        let mut bytes = bytes;
        while let Some(&byte) = bytes.first() {
            let is_beyond = self.length.is_some_and(|length| self.received >= length)
                || self.received >= self.program.other.package_bytes();
            if is_beyond {
                return Err(self.refuse(Refusal::Excess));
            }
            if self.received.is_multiple_of(UNIT_BYTES) && bytes.len() >= UNIT {
                // Whole double words up to the end of the page, or of the header.
                let whole = self.write_units(flash, bytes)?;
                bytes = bytes.get(whole..).unwrap_or_default();
            } else {
                let place = (self.received % UNIT_BYTES) as usize;
                if let Some(to) = self.pending.get_mut(place) {
                    *to = byte;
                }
                self.received += 1;
                bytes = bytes.get(1..).unwrap_or_default();
                if self.received.is_multiple_of(UNIT_BYTES) {
                    let unit = self.pending;
                    self.program_at(flash, start + self.received - UNIT_BYTES, &unit)?;
                }
            }
            self.check_header(flash)?;
        }
        self.begin_verification();
        Ok(())
    }

    /// Writes whole double words, at most to the end of a page; returns their length.
    fn write_units<F: NorFlash>(&mut self, flash: &mut F, bytes: &[u8]) -> Result<usize, Refusal> {
        let page = F::ERASE_SIZE as u32;
        let limit =
            self.length.unwrap_or(HEADER_BYTES as u32).min(self.program.other.package_bytes());
        let room = (page - self.received % page).min(limit.saturating_sub(self.received)) as usize;
        let whole = (bytes.len().min(room) / UNIT * UNIT).max(UNIT).min(bytes.len());
        let Some(part) = bytes.get(..whole) else { return Ok(0) };
        let at = self.program.other.start + self.received;
        self.program_at(flash, at, part)?;
        self.received += whole as u32;
        Ok(whole)
    }

    /// Programs double words of one page. This page and the next one are erased before, so that [`Receiver::resume`] finds
    /// the end.
    fn program_at<F: NorFlash>(
        &mut self,
        flash: &mut F,
        at: u32,
        units: &[u8],
    ) -> Result<(), Refusal> {
        let page = F::ERASE_SIZE as u32;
        let ahead = (at / page * page + 2 * page).min(self.program.other.marks);
        while self.erased_until < ahead {
            let (from, to) = (self.erased_until, self.erased_until + page);
            flash.erase(from, to).map_err(|_| self.refuse(Refusal::Flash))?;
            self.erased_until = to;
        }
        flash.write(at, units).map_err(|_| self.refuse(Refusal::Flash))
    }

    /// Checks the header once it is complete.
    fn check_header<F: NorFlash>(&mut self, flash: &mut F) -> Result<(), Refusal> {
        if self.length.is_some() || self.received < HEADER_BYTES as u32 {
            return Ok(());
        }
        let mut bytes = [0; USED_BYTES];
        let slot = self.program.other;
        flash.read(slot.start, &mut bytes).map_err(|_| self.refuse(Refusal::Flash))?;
        let header = Header::parse(&bytes).map_err(|_| self.refuse(Refusal::NoPackage))?;
        self.check(flash, &header).map_err(|refusal| self.refuse(refusal))?;
        self.length = Some(header.package_bytes());
        Ok(())
    }

    fn check<F: NorFlash>(&self, flash: &mut F, header: &Header) -> Result<(), Refusal> {
        if header.board != self.program.board.number {
            return Err(Refusal::Board(header.board));
        }
        if !self.program.board.fits(header) {
            return Err(Refusal::Wiring(header.wiring));
        }
        if header.address != self.program.image_address(&self.program.other) {
            return Err(Refusal::Address(header.address));
        }
        let least = least_counter(flash, &self.program.running);
        if header.counter < least {
            return Err(Refusal::Counter(header.counter, least));
        }
        if header.package_bytes() > self.program.other.package_bytes() {
            return Err(Refusal::TooLong(header.length));
        }
        Ok(())
    }

    fn begin_verification(&mut self) {
        if self.length.is_some_and(|length| self.received >= length) {
            let at = self.program.other.start + HEADER_BYTES as u32;
            self.stage = Stage::Verifying { at, crc: 0 };
            self.hash = Some(Sha512::new());
        }
    }

    /// Does a part of the verification, less than a millisecond. Call it once per tick while [`Receiver::is_verifying`].
    pub fn step<F: NorFlash>(&mut self, flash: &mut F) {
        let slot = self.program.other;
        let (Stage::Verifying { at, crc }, Some(hash)) = (&mut self.stage, &mut self.hash) else {
            return;
        };
        let Some(header) = marks::header(flash, &slot) else {
            return self.stage = Stage::Refused(Refusal::NoPackage);
        };
        let end = slot.start + header.package_bytes();
        let until = end.min(*at + STEP_BYTES);
        let is_read = read_chunks(flash, *at..until, |chunk| {
            *crc = continue_crc(*crc, chunk);
            hash.update(chunk);
        });
        if !is_read {
            return self.stage = Stage::Refused(Refusal::Crc);
        }
        *at = until;
        if until < end {
            return;
        }
        self.stage = if *crc == header.crc {
            self.accept(flash, &header).map_or_else(Stage::Refused, |()| Stage::Ready)
        } else {
            Stage::Refused(Refusal::Crc)
        };
    }

    /// Checks hash and header, and writes the mark.
    fn accept<F: NorFlash>(&mut self, flash: &mut F, header: &Header) -> Result<(), Refusal> {
        let mut expected = [0; 64];
        let at = self.program.other.start + HASH_AT as u32;
        flash.read(at, &mut expected).map_err(|_| Refusal::Flash)?;
        if self.hash.take().is_none_or(|hash| hash.finalize().as_slice() != expected) {
            return Err(Refusal::Hash);
        }
        self.check(flash, header)?;
        let running = marks::state(flash, &self.program.running);
        let sequence = marks::next_sequence([running, SlotState::Empty]);
        marks::receive(flash, &self.program.other, header, sequence).map_err(|_| Refusal::Flash)
    }

    fn refuse(&mut self, refusal: Refusal) -> Refusal {
        self.stage = Stage::Refused(refusal);
        refusal
    }
}

/// Returns the smallest counter that is accepted: that of the running image.
fn least_counter<F: NorFlash>(flash: &mut F, running: &Slot) -> u32 {
    match marks::state(flash, running) {
        SlotState::Image(image) => image.header.counter,
        SlotState::Empty | SlotState::Bare => 0,
    }
}
