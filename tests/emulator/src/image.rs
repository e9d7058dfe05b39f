//! The image: its loaded segments, its symbols, and patches for mutations.

use crate::chip::flash::Content;
use crate::error::EmulatorError;
use object::elf::PT_LOAD;
use object::read::elf::{ElfFile32, ProgramHeader};
use object::{Endianness, Object, ObjectSymbol};
use std::path::Path;

/// A contiguous part of the image.
#[derive(Clone, Debug)]
pub struct Segment {
    /// Load address.
    pub address: u32,
    /// Content.
    pub bytes: Vec<u8>,
}

/// A function or a static.
#[derive(Clone, Debug)]
pub struct Symbol {
    /// Mangled name.
    pub name: String,
    /// Address without the Thumb bit.
    pub address: u32,
    /// Size, bytes.
    pub size: u32,
    /// True for a function.
    pub is_function: bool,
}

/// An image for the chip.
#[derive(Clone, Debug)]
pub struct Image {
    /// Segments in flash.
    pub segments: Vec<Segment>,
    /// Symbols in ascending order of their addresses.
    pub symbols: Vec<Symbol>,
    /// Names without a size, as those that a linker script defines, with their addresses.
    pub labels: Vec<(String, u32)>,
}

impl Image {
    /// Reads an ELF file.
    ///
    /// # Errors
    /// [`EmulatorError::Read`] or [`EmulatorError::Format`].
    pub fn read(path: &Path) -> Result<Self, EmulatorError> {
        let data = std::fs::read(path)
            .map_err(|source| EmulatorError::Read { path: path.to_owned(), source })?;
        Self::parse(&data).map_err(|source| EmulatorError::Format { path: path.to_owned(), source })
    }

    fn parse(data: &[u8]) -> Result<Self, object::Error> {
        let file = ElfFile32::<Endianness>::parse(data)?;
        let endian = file.endian();
        let mut segments = Vec::new();
        for segment in file.elf_program_headers() {
            if segment.p_type(endian) == PT_LOAD && segment.p_filesz(endian) > 0 {
                let bytes = segment.data(endian, data).unwrap_or_default().to_vec();
                segments.push(Segment { address: segment.p_paddr(endian), bytes });
            }
        }
        let mut symbols: Vec<Symbol> = file
            .symbols()
            .filter(|symbol| symbol.size() > 0)
            .filter_map(|symbol| {
                let is_function = symbol.kind() == object::SymbolKind::Text;
                Some(Symbol {
                    name: symbol.name().ok()?.to_owned(),
                    // The address of a function has the Thumb bit.
                    address: symbol.address() as u32 & if is_function { !1 } else { !0 },
                    size: symbol.size() as u32,
                    is_function,
                })
            })
            .collect();
        symbols.sort_by_key(|symbol| symbol.address);
        let labels = file.symbols().filter(|symbol| symbol.size() == 0);
        let labels = labels
            .filter_map(|label| Some((label.name().ok()?.to_owned(), label.address() as u32)))
            .collect();
        Ok(Self { segments, symbols, labels })
    }

    /// Writes the image to a flash, as a debugger does.
    pub fn load(&self, flash: &mut Content) {
        self.segments.iter().for_each(|segment| flash.load(segment.address, &segment.bytes));
    }

    /// Returns the first symbol whose name contains this text.
    pub fn find(&self, part: &str) -> Option<&Symbol> {
        self.symbols.iter().find(|symbol| symbol.name.contains(part))
    }

    /// Returns the address of a label.
    pub fn label(&self, name: &str) -> Option<u32> {
        self.labels.iter().find(|(known, _)| known == name).map(|(_, address)| *address)
    }

    /// Returns the function at an address.
    pub fn function_at(&self, address: u32) -> Option<&Symbol> {
        let after = self.symbols.partition_point(|symbol| symbol.address <= address);
        self.symbols[..after]
            .iter()
            .rev()
            .take(8)
            .find(|symbol| symbol.is_function && address < symbol.address + symbol.size)
    }

    /// Returns the bytes at a load address.
    pub fn bytes_mut(&mut self, address: u32, length: usize) -> Option<&mut [u8]> {
        self.segments.iter_mut().find_map(|segment| {
            let at = address.checked_sub(segment.address)? as usize;
            segment.bytes.get_mut(at..at + length)
        })
    }
}
