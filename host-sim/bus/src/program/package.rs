//! Packages on the PC: an image and its signed header.

use ed25519_dalek::{Signer, SigningKey};
use firmware::update::package::{CRC, HEADER_BYTES, Header, USED_BYTES, Version};
use object::Endianness;
use object::elf::PT_LOAD;
use object::read::elf::{ElfFile32, ProgramHeader};
use sha2::{Digest, Sha512};
use std::io;
use std::path::{Path, PathBuf};

/// First bytes of an ELF file.
const ELF_MAGIC: [u8; 4] = [0x7F, b'E', b'L', b'F'];
/// Longest gap between two parts of the code, bytes. What lies behind a longer one is for a debugger.
const MAX_GAP_BYTES: usize = 64;
/// Alignment of the image's length, bytes: a double word.
const ALIGNMENT: usize = 8;

/// Error of a package or image; its message is one line.
#[derive(Debug, thiserror::Error)]
pub enum PackageError {
    /// It cannot be read.
    #[error("{path}: {source}")]
    Io {
        /// The file.
        path: PathBuf,
        /// The error.
        source: io::Error,
    },
    /// The file is no package.
    #[error("{0}: no package; host-sim sign makes one from an image")]
    NoPackage(PathBuf),
    /// The package is damaged.
    #[error("{0}: the image differs from its hash; the file is damaged")]
    Damaged(PathBuf),
    /// The ELF file cannot be used.
    #[error("{path}: {why}")]
    Elf {
        /// The file.
        path: PathBuf,
        /// The reason.
        why: String,
    },
}

/// A package.
#[derive(Clone, Debug)]
pub struct Package {
    /// Its header.
    pub header: Header,
    /// All its bytes.
    pub bytes: Vec<u8>,
}

/// What the maker of a package states about its image.
#[derive(Clone, Copy, Debug)]
pub struct Statement {
    /// Number of the board type.
    pub board: u32,
    /// Version of the image.
    pub version: Version,
    /// Anti-rollback counter.
    pub counter: u32,
}

impl Package {
    /// Signs an image.
    pub fn sign(image: &[u8], statement: Statement, key: &SigningKey) -> Self {
        let mut image = image.to_vec();
        image.resize(image.len().next_multiple_of(ALIGNMENT).max(ALIGNMENT), 0);
        let Statement { board, version, counter } = statement;
        let mut header = Header {
            board,
            version,
            counter,
            length: image.len() as u32,
            crc: CRC.checksum(&image),
            hash: Sha512::digest(&image).into(),
            signature: [0; 64],
        };
        header.signature = key.sign(&header.signed()).to_bytes();
        let bytes = [&header.emit()[..], &image].concat();
        Self { header, bytes }
    }

    /// Reads a package, and checks that it is complete. The boot program checks the signature.
    ///
    /// # Errors
    /// The file cannot be read, is no package, or is damaged.
    pub fn read(path: &Path) -> Result<Self, PackageError> {
        let bytes = read(path)?;
        let head = bytes.first_chunk::<USED_BYTES>();
        let header = head.and_then(|head| Header::parse(head).ok());
        let header = header.ok_or_else(|| PackageError::NoPackage(path.to_owned()))?;
        let image = bytes.get(HEADER_BYTES..).unwrap_or_default();
        if bytes.len() != header.package_bytes() as usize
            || Sha512::digest(image).as_slice() != header.hash
        {
            return Err(PackageError::Damaged(path.to_owned()));
        }
        Ok(Self { header, bytes })
    }
}

/// Reads an image: the code of an ELF file as it lies in flash, or a binary file.
///
/// # Errors
/// The file cannot be read, or its ELF structure cannot be used.
pub fn read_image(path: &Path) -> Result<Vec<u8>, PackageError> {
    let data = read(path)?;
    if !data.starts_with(&ELF_MAGIC) {
        return Ok(data);
    }
    let failed = |why: String| PackageError::Elf { path: path.to_owned(), why };
    code_of(&data)
        .map_err(|error| failed(error.to_string()))?
        .ok_or_else(|| failed("no code".into()))
}

fn read(path: &Path) -> Result<Vec<u8>, PackageError> {
    std::fs::read(path).map_err(|source| PackageError::Io { path: path.to_owned(), source })
}

/// Returns the loaded parts of an ELF file up to the first long gap.
fn code_of(data: &[u8]) -> Result<Option<Vec<u8>>, object::Error> {
    let file = ElfFile32::<Endianness>::parse(data)?;
    let endian = file.endian();
    let mut parts = Vec::new();
    for segment in file.elf_program_headers() {
        if segment.p_type(endian) == PT_LOAD && segment.p_filesz(endian) > 0 {
            let bytes = segment.data(endian, data).unwrap_or_default();
            parts.push((segment.p_paddr(endian), bytes));
        }
    }
    parts.sort_by_key(|(address, _)| *address);
    let Some(&(first, _)) = parts.first() else { return Ok(None) };
    let mut code: Vec<u8> = Vec::new();
    for (address, bytes) in parts {
        let at = (address - first) as usize;
        if at < code.len() || at > code.len() + MAX_GAP_BYTES {
            break;
        }
        code.resize(at, 0);
        code.extend(bytes);
    }
    Ok(Some(code))
}
