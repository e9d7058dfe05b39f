//! The image: its loaded segments and its symbols.

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
    /// [`EmulatorError::Read`], [`EmulatorError::Format`] or [`EmulatorError::Segment`].
    pub fn read(path: &Path) -> Result<Self, EmulatorError> {
        let data = std::fs::read(path)
            .map_err(|source| EmulatorError::Read { path: path.to_owned(), source })?;
        let format = |source| EmulatorError::Format { path: path.to_owned(), source };
        let file = ElfFile32::<Endianness>::parse(&*data).map_err(format)?;
        let endian = file.endian();
        let mut image = Self { segments: Vec::new(), symbols: Vec::new(), labels: Vec::new() };
        for segment in file.elf_program_headers() {
            let address = segment.p_paddr(endian);
            if segment.p_type(endian) == PT_LOAD && segment.p_filesz(endian) > 0 {
                let beyond = |()| EmulatorError::Segment { path: path.to_owned(), address };
                let bytes = segment.data(endian, &*data).map_err(beyond)?.to_vec();
                image.segments.push(Segment { address, bytes });
            }
        }
        for symbol in file.symbols() {
            let (name, address) =
                (symbol.name().map_err(format)?.to_owned(), symbol.address() as u32);
            if symbol.size() == 0 {
                image.labels.push((name, address));
                continue;
            }
            let is_function = symbol.kind() == object::SymbolKind::Text;
            // The address of a function has the Thumb bit.
            let address = address & if is_function { !1 } else { !0 };
            image.symbols.push(Symbol { name, address, size: symbol.size() as u32, is_function });
        }
        image.symbols.sort_by_key(|symbol| symbol.address);
        Ok(image)
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
}
