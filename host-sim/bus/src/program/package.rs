//! Packages on the PC: an image and its signed header, and the file that holds those of a release.
//!
//! An image is linked for one slot of a joint. A file begins with [`FILE_MAGIC`], followed by one package per slot. Their
//! headers state the load addresses. The version and the board are the same in all. An image states its board and the
//! wiring in a section of its ELF file. The anti-rollback counter is the version.

use ed25519_dalek::{Signer, SigningKey};
use firmware::update::Board;
use firmware::update::package::{CRC, HASH_AT, HEADER_BYTES, Header, USED_BYTES, Version, emit};
use object::elf::PT_LOAD;
use object::read::elf::{ElfFile32, ProgramHeader};
use object::{Endianness, Object, ObjectSection};
use sha2::{Digest, Sha512};
use std::io;
use std::path::{Path, PathBuf};

/// First bytes of a file of packages.
pub const FILE_MAGIC: [u8; 8] = *b"JPACKS01";
/// First bytes of an ELF file.
const ELF_MAGIC: [u8; 4] = [0x7F, b'E', b'L', b'F'];
/// Section of an ELF file that states the board: its number and its wiring.
const BOARD_SECTION: &str = ".board_identity";
/// Longest gap between two parts of the code, bytes. What lies beyond a longer one is for a debugger.
const MAX_GAP_BYTES: usize = 64;
/// Alignment of the image's length, bytes: a double word.
const ALIGNMENT: usize = 8;

/// Error of a package or image; its message is one line.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum PackageError {
    /// It cannot be read.
    #[error("{path}: {source}")]
    Io { path: PathBuf, source: io::Error },
    /// The file holds no packages.
    #[error("{0}: no packages; host-sim sign makes a file of them from images")]
    NoPackage(PathBuf),
    /// The packages are not of one release.
    #[error("{0}: the packages differ in board, wiring or version, or are for the same slot")]
    Mixed(PathBuf),
    /// The package is damaged.
    #[error("{0}: a package differs from its hash or CRC; the file is damaged")]
    Damaged(PathBuf),
    /// The ELF file cannot be used.
    #[error("{path}: {source}")]
    Elf { path: PathBuf, source: ImageError },
}

/// Reason why an ELF file is no image.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages describe the variants")]
pub enum ImageError {
    #[error("no ELF file, as cargo builds an image")]
    NoElf,
    #[error(transparent)]
    Elf(#[from] object::read::Error),
    #[error("it does not state its board; expected an image of this firmware")]
    NoBoard,
    #[error("a part of it is missing")]
    PartMissing,
    #[error("no code")]
    NoCode,
}

/// Code of an image as it lies in flash.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Code {
    /// Load address.
    pub address: u32,
    /// Content.
    pub bytes: Vec<u8>,
    /// Board for which it was built.
    pub board: Board,
}

/// A package.
#[derive(Clone, Debug)]
pub struct Package {
    /// Its header.
    pub header: Header,
    /// All its bytes.
    pub bytes: Vec<u8>,
}

impl Package {
    /// Signs an image of this version.
    pub fn sign(image: &Code, version: Version, key: &SigningKey) -> Self {
        let Code { address, bytes: mut image, board } = image.clone();
        image.resize(image.len().next_multiple_of(ALIGNMENT).max(ALIGNMENT), 0);
        let header = Header {
            board: board.number,
            wiring: board.wiring,
            version,
            counter: version.0,
            length: image.len() as u32,
            crc: CRC.checksum(&image),
            address,
            identity: 0,
        };
        let signed = header.signed(&Sha512::digest(&image).into());
        let emitted = emit(&signed, &key.sign(&signed).to_bytes());
        let identity = CRC.checksum(&emitted[..USED_BYTES]);
        let bytes = [&emitted[..], &image].concat();
        Self { header: Header { identity, ..header }, bytes }
    }

    /// Parses the package at the start of these bytes; returns the rest. `None` if there is none, or it is damaged.
    fn parse(bytes: &[u8]) -> Option<(Self, &[u8])> {
        let header = Header::parse(bytes.first_chunk::<USED_BYTES>()?).ok()?;
        let (package, rest) = bytes.split_at_checked(header.package_bytes() as usize)?;
        let (head, image) = package.split_at_checked(HEADER_BYTES)?;
        let hash = head.get(HASH_AT..HASH_AT + 64)?;
        // Neither hash nor signature covers the end of the header.
        let is_padded = head.get(USED_BYTES..)?.iter().all(|byte| *byte == 0);
        let is_whole = is_padded
            && CRC.checksum(image) == header.crc
            && Sha512::digest(image).as_slice() == hash;
        is_whole.then(|| (Self { header, bytes: package.to_vec() }, rest))
    }
}

/// The packages of a release: one for each slot.
#[derive(Clone, Debug)]
pub struct Release {
    packages: Vec<Package>,
}

impl Release {
    /// Returns a release of these packages; `None` if there are none, they differ in board, wiring or version, or two are
    /// for the same slot.
    pub fn new(packages: Vec<Package>) -> Option<Self> {
        let first = packages.first()?.header;
        let stated =
            |header: &Header| (header.board, header.wiring, header.version, header.counter);
        let mut addresses: Vec<u32> = packages.iter().map(|part| part.header.address).collect();
        addresses.sort_unstable();
        addresses.dedup();
        let is_one = packages.iter().all(|part| stated(&part.header) == stated(&first));
        (is_one && addresses.len() == packages.len()).then_some(Self { packages })
    }

    /// Returns the packages, at least one.
    pub fn packages(&self) -> &[Package] {
        &self.packages
    }

    /// Returns the header of the first package, whose board, wiring and version are those of all.
    pub fn header(&self) -> &Header {
        &self.packages[0].header
    }

    /// Returns the package whose image is linked for this address.
    pub fn for_address(&self, address: u32) -> Option<&Package> {
        self.packages.iter().find(|part| part.header.address == address)
    }

    /// Returns true if one of the packages has this identity.
    pub fn contains(&self, identity: u32) -> bool {
        self.packages.iter().any(|part| part.header.identity == identity)
    }

    /// Returns the bytes of the file.
    pub fn to_bytes(&self) -> Vec<u8> {
        let parts = self.packages.iter().map(|part| part.bytes.as_slice());
        std::iter::once(&FILE_MAGIC[..]).chain(parts).collect::<Vec<_>>().concat()
    }

    /// Reads a file as [`Release::parse`] does.
    ///
    /// # Errors
    /// The file cannot be read, holds no packages, or is damaged.
    pub fn read(path: &Path) -> Result<Self, PackageError> {
        Self::parse(path, &read(path)?)
    }

    /// Parses the bytes of a file, and checks that its packages are complete. The boot program of the joint checks the
    /// signatures. The path is for the message of an error.
    ///
    /// # Errors
    /// The bytes hold no packages, or are damaged.
    pub fn parse(path: &Path, bytes: &[u8]) -> Result<Self, PackageError> {
        let Some(mut rest) = bytes.strip_prefix(&FILE_MAGIC) else {
            return Err(PackageError::NoPackage(path.to_owned()));
        };
        let mut packages = Vec::new();
        while !rest.is_empty() {
            let parsed = Package::parse(rest);
            let (package, left) = parsed.ok_or_else(|| PackageError::Damaged(path.to_owned()))?;
            packages.push(package);
            rest = left;
        }
        Self::new(packages).ok_or_else(|| PackageError::Mixed(path.to_owned()))
    }
}

/// Reads the code of an image, an ELF file, as it lies in flash.
///
/// # Errors
/// The file cannot be read, or its ELF structure cannot be used.
pub fn read_image(path: &Path) -> Result<Code, PackageError> {
    parse_image(path, &read(path)?)
}

/// Parses the code of an image, an ELF file. The path is for the message of an error.
///
/// # Errors
/// Its ELF structure cannot be used.
pub fn parse_image(path: &Path, data: &[u8]) -> Result<Code, PackageError> {
    code_of(data).map_err(|source| PackageError::Elf { path: path.to_owned(), source })
}

fn read(path: &Path) -> Result<Vec<u8>, PackageError> {
    std::fs::read(path).map_err(|source| PackageError::Io { path: path.to_owned(), source })
}

/// Returns the board that an ELF file states.
fn board_of(file: &ElfFile32<Endianness>) -> Option<Board> {
    let section = file.section_by_name(BOARD_SECTION)?.data().ok()?;
    let ([number, wiring], []) = section.as_chunks::<4>() else { return None };
    let [number, wiring] = [*number, *wiring].map(u32::from_le_bytes);
    Some(Board { number, wiring })
}

/// Returns the code of an ELF file: the longest run of its loaded parts.
fn code_of(data: &[u8]) -> Result<Code, ImageError> {
    if !data.starts_with(&ELF_MAGIC) {
        return Err(ImageError::NoElf);
    }
    let file = ElfFile32::<Endianness>::parse(data)?;
    let board = board_of(&file).ok_or(ImageError::NoBoard)?;
    let endian = file.endian();
    let mut parts = Vec::new();
    for segment in file.elf_program_headers() {
        if segment.p_type(endian) == PT_LOAD && segment.p_filesz(endian) > 0 {
            let bytes = segment.data(endian, data).map_err(|()| ImageError::PartMissing)?;
            parts.push((segment.p_paddr(endian), bytes));
        }
    }
    parts.sort_by_key(|(address, _)| *address);
    let mut runs: Vec<Code> = Vec::new();
    for (address, bytes) in parts {
        let end = runs.last().map(|run| run.address as usize + run.bytes.len());
        match (runs.last_mut(), end) {
            (Some(run), Some(end)) if (end..=end + MAX_GAP_BYTES).contains(&(address as usize)) => {
                run.bytes.resize((address - run.address) as usize, 0);
                run.bytes.extend(bytes);
            }
            _ => runs.push(Code { address, bytes: bytes.to_vec(), board }),
        }
    }
    runs.into_iter().max_by_key(|run| run.bytes.len()).ok_or(ImageError::NoCode)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message;
    use object::elf::{SHT_PROGBITS, SHT_STRTAB};

    const BOARD: Board = Board { number: 1, wiring: 2 };

    /// An ELF file of one part of 16 bytes, of which it states this length, and of the section of a board.
    fn elf(stated: u32) -> Vec<u8> {
        let mut file = b"\x7FELF\x01\x01\x01".to_vec();
        file.resize(16, 0);
        let halves = |file: &mut Vec<u8>, halves: &[u16]| {
            halves.iter().for_each(|half| file.extend(half.to_le_bytes()));
        };
        let words = |file: &mut Vec<u8>, words: &[u32]| {
            words.iter().for_each(|word| file.extend(word.to_le_bytes()));
        };
        halves(&mut file, &[2, 40]);
        let (board_at, sections_at, names_at, image_at) = (84, 92, 212, 240);
        let names = b"\0.board_identity\0.shstrtab\0\0";
        words(&mut file, &[1, 0x0800_0200, 52, sections_at, 0]);
        halves(&mut file, &[52, 32, 1, 40, 3, 2]);
        let place = [image_at, 0x0800_0400, 0x0800_0400];
        words(&mut file, &[PT_LOAD.0, place[0], place[1], place[2], stated, stated, 5, 4]);
        words(&mut file, &[BOARD.number, BOARD.wiring]);
        words(&mut file, &[0; 10]);
        words(&mut file, &[1, SHT_PROGBITS.0, 0, 0, board_at, 8, 0, 0, 4, 0]);
        words(&mut file, &[17, SHT_STRTAB.0, 0, 0, names_at, names.len() as u32, 0, 0, 1, 0]);
        file.extend(names);
        assert_eq!(file.len(), image_at as usize);
        file.extend(0..16);
        file
    }

    fn file() -> Vec<u8> {
        let code = parse_image(Path::new("firmware"), &elf(16)).unwrap();
        let package = Package::sign(&code, Version(2), &SigningKey::from_bytes(&[7; 32]));
        Release::new(vec![package]).unwrap().to_bytes()
    }

    #[test]
    fn image_whose_part_ends_beyond_the_file_is_refused() {
        let code = parse_image(Path::new("firmware"), &elf(16)).unwrap();
        assert_eq!((code.address, code.bytes), (0x0800_0400, (0..16).collect()));
        assert_eq!(code.board, BOARD);
        let error = parse_image(Path::new("firmware"), &elf(17)).unwrap_err();
        assert!(matches!(&error, PackageError::Elf { path, .. } if path.ends_with("firmware")));
        message::check("programs", "part of an image missing", &error.to_string(), &[]);
    }

    #[test]
    fn image_that_does_not_state_its_board_is_refused() {
        let mut unnamed = elf(16);
        let place = unnamed.windows(6).position(|part| part == b".board").expect("a name");
        unnamed[place] = b'_';
        let error = parse_image(Path::new("firmware"), &unnamed).unwrap_err();
        assert!(matches!(&error, PackageError::Elf { path, .. } if path.ends_with("firmware")));
        message::check("programs", "image without board", &error.to_string(), &["board"]);
    }

    #[test]
    fn package_takes_board_and_counter_from_image_and_version() {
        let header = *Release::parse(Path::new("joint.package"), &file()).unwrap().header();
        assert_eq!((header.board, header.wiring), (BOARD.number, BOARD.wiring));
        assert_eq!((header.version, header.counter), (Version(2), 2));
    }

    #[test]
    fn file_with_a_changed_byte_outside_the_signature_is_refused() {
        let path = Path::new("joint.package");
        let (whole, start) = (file(), FILE_MAGIC.len());
        assert_eq!(Release::parse(path, &whole).unwrap().to_bytes(), whole);
        // The CRC, the hash, the end of the header, which is not signed, and the image.
        for at in [24, HASH_AT, USED_BYTES, HEADER_BYTES - 1, HEADER_BYTES] {
            let mut changed = whole.clone();
            changed[start + at] ^= 1;
            let error = Release::parse(path, &changed).unwrap_err();
            assert!(matches!(error, PackageError::Damaged(_)), "{at}: {error}");
        }
    }
}
