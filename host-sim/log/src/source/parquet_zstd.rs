//! Pages of a Parquet column that are compressed with zstd.
//!
//! The `parquet` crate decompresses zstd by a library in C, whose build takes longer than that of any other dependency. Here
//! `ruzstd` decompresses the pages instead, which is pure Rust. polars and DuckDB write zstd by default or on request.
//!
//! A column chunk is a sequence of pages: a header in Thrift's compact protocol, then the compressed bytes. The header
//! states both sizes, so memory holds one page at a time. The formats are those of the Apache Parquet specification
//! (`parquet.thrift`, structure `PageHeader`) and of Thrift's `thrift-compact-protocol.md`.

use std::fs::File;

use bytes::Bytes;
use parquet::basic::{Encoding, PageType};
use parquet::column::page::{Page, PageMetadata, PageReader};
use parquet::errors::{ParquetError, Result};
use parquet::file::metadata::ColumnChunkMetaData;
use parquet::file::reader::ChunkReader;
use ruzstd::decoding::FrameDecoder;

use super::thrift::{Fields, parse_struct};

/// Bytes in which most headers fit. Statistics of long texts make a header larger; the window then grows.
const HEADER_WINDOW: u64 = 1024;

/// A page's header, as far as its content needs it.
#[derive(Debug, Clone)]
struct Header {
    kind: PageType,
    fields: Fields,
    uncompressed: usize,
    compressed: usize,
}

/// The pages of one column chunk, in the order of the file.
pub(super) struct ZstdPages {
    file: File,
    /// Offset of the next page's header in the file, bytes.
    at: u64,
    end: u64,
    decoder: FrameDecoder,
}

impl ZstdPages {
    /// Opens the pages of a column chunk of `file`.
    ///
    /// # Errors
    /// If the chunk's bounds are not inside the file, or the file cannot be opened again.
    pub(super) fn new(file: &File, chunk: &ColumnChunkMetaData) -> Result<Self> {
        let (at, length) = chunk.byte_range();
        let end =
            at.checked_add(length).filter(|end| *end <= parquet::file::reader::Length::len(file));
        let end = end.ok_or_else(|| damaged("a column that ends behind the file"))?;
        Ok(Self { file: file.try_clone()?, at, end, decoder: FrameDecoder::new() })
    }

    /// Returns the header of the next page and its length in bytes, or `None` at the end of the chunk.
    fn header(&self) -> Result<Option<(Header, u64)>> {
        let left = self.end - self.at;
        if left == 0 {
            return Ok(None);
        }
        let mut window = HEADER_WINDOW.min(left);
        loop {
            let bytes = self.file.get_bytes(self.at, size(window)?)?;
            match parse_struct(&bytes) {
                Some((fields, length)) => {
                    return Ok(Some((self.checked(fields, left - length as u64)?, length as u64)));
                }
                None if window == left => return Err(damaged("a page without a header")),
                None => window = (window * 8).min(left),
            }
        }
    }

    fn checked(&self, fields: Fields, left: u64) -> Result<Header> {
        let kind = match fields.integer(1) {
            Some(0) => PageType::DATA_PAGE,
            Some(1) => PageType::INDEX_PAGE,
            Some(2) => PageType::DICTIONARY_PAGE,
            Some(3) => PageType::DATA_PAGE_V2,
            _ => return Err(damaged("a page of an unknown type")),
        };
        let (uncompressed, compressed) = (fields.size(2), fields.size(3));
        let (Some(uncompressed), Some(compressed)) = (uncompressed, compressed) else {
            return Err(damaged("a page without a size"));
        };
        if compressed as u64 > left {
            return Err(damaged("a page that ends behind its column"));
        }
        Ok(Header { kind, fields, uncompressed, compressed })
    }

    /// Returns the page's bytes, of which the first `plain` are stored uncompressed.
    fn decompress(&mut self, stored: &Bytes, plain: usize, uncompressed: usize) -> Result<Bytes> {
        if plain > stored.len() || plain > uncompressed {
            return Err(damaged("a page whose levels are longer than the page"));
        }
        let mut content = vec![0; uncompressed];
        content[..plain].copy_from_slice(&stored[..plain]);
        // A page without a value has no compressed part.
        if uncompressed > plain {
            let written = self
                .decoder
                .decode_all(&stored[plain..], &mut content[plain..])
                .map_err(|error| damaged(&format!("a page that is not zstd: {error}")))?;
            if written != uncompressed - plain {
                return Err(damaged("a page of another size than its header states"));
            }
        }
        Ok(content.into())
    }

    fn page(&mut self, header: &Header, stored: &Bytes) -> Result<Option<Page>> {
        Ok(Some(match header.kind {
            PageType::DATA_PAGE => {
                let about = header.fields.structure(5)?;
                Page::DataPage {
                    buf: self.decompress(stored, 0, header.uncompressed)?,
                    num_values: about.count(1)?,
                    encoding: encoding(about, 2)?,
                    def_level_encoding: encoding(about, 3)?,
                    rep_level_encoding: encoding(about, 4)?,
                    statistics: None,
                }
            }
            PageType::DATA_PAGE_V2 => {
                let about = header.fields.structure(8)?;
                let (definitions, repetitions) = (about.count(5)?, about.count(6)?);
                // The levels of a page of version 2 are never compressed.
                let levels = definitions as usize + repetitions as usize;
                let buf = if about.boolean(7).unwrap_or(true) {
                    self.decompress(stored, levels, header.uncompressed)?
                } else {
                    stored.clone()
                };
                Page::DataPageV2 {
                    buf,
                    num_values: about.count(1)?,
                    encoding: encoding(about, 4)?,
                    num_nulls: about.count(2)?,
                    num_rows: about.count(3)?,
                    def_levels_byte_len: definitions,
                    rep_levels_byte_len: repetitions,
                    is_compressed: false,
                    statistics: None,
                }
            }
            PageType::DICTIONARY_PAGE => {
                let about = header.fields.structure(7)?;
                Page::DictionaryPage {
                    buf: self.decompress(stored, 0, header.uncompressed)?,
                    num_values: about.count(1)?,
                    encoding: encoding(about, 2)?,
                    is_sorted: about.boolean(3).unwrap_or(false),
                }
            }
            PageType::INDEX_PAGE => return Ok(None),
        }))
    }
}

impl PageReader for ZstdPages {
    fn get_next_page(&mut self) -> Result<Option<Page>> {
        while let Some((header, length)) = self.header()? {
            let stored = self.file.get_bytes(self.at + length, header.compressed)?;
            self.at += length + header.compressed as u64;
            if let Some(page) = self.page(&header, &stored)? {
                return Ok(Some(page));
            }
        }
        Ok(None)
    }

    fn peek_next_page(&mut self) -> Result<Option<PageMetadata>> {
        let Some((header, _)) = self.header()? else { return Ok(None) };
        let is_dict = header.kind == PageType::DICTIONARY_PAGE;
        let about = match header.kind {
            PageType::DATA_PAGE => Some(header.fields.structure(5)?),
            PageType::DATA_PAGE_V2 => Some(header.fields.structure(8)?),
            _ => None,
        };
        let num_levels = about.map(|about| about.count(1)).transpose()?.map(|count| count as usize);
        let rows =
            about.filter(|_| header.kind == PageType::DATA_PAGE_V2).map(|about| about.count(3));
        let num_rows = rows.transpose()?.map(|count| count as usize);
        Ok(Some(PageMetadata { num_rows, num_levels, is_dict }))
    }

    fn skip_next_page(&mut self) -> Result<()> {
        if let Some((header, length)) = self.header()? {
            self.at += length + header.compressed as u64;
        }
        Ok(())
    }
}

impl Iterator for ZstdPages {
    type Item = Result<Page>;

    fn next(&mut self) -> Option<Self::Item> {
        self.get_next_page().transpose()
    }
}

impl Fields {
    fn size(&self, field: i16) -> Option<usize> {
        self.integer(field).and_then(|value| usize::try_from(value).ok())
    }

    fn count(&self, field: i16) -> Result<u32> {
        let count = self.integer(field).and_then(|value| u32::try_from(value).ok());
        count.ok_or_else(|| damaged("a page without a count"))
    }

    fn structure(&self, field: i16) -> Result<&Self> {
        self.fields(field).ok_or_else(|| damaged("a page without the header of its type"))
    }
}

fn encoding(about: &Fields, field: i16) -> Result<Encoding> {
    Ok(match about.integer(field) {
        Some(0) => Encoding::PLAIN,
        Some(2) => Encoding::PLAIN_DICTIONARY,
        Some(3) => Encoding::RLE,
        #[expect(deprecated, reason = "old files have levels of this encoding")]
        Some(4) => Encoding::BIT_PACKED,
        Some(5) => Encoding::DELTA_BINARY_PACKED,
        Some(6) => Encoding::DELTA_LENGTH_BYTE_ARRAY,
        Some(7) => Encoding::DELTA_BYTE_ARRAY,
        Some(8) => Encoding::RLE_DICTIONARY,
        Some(9) => Encoding::BYTE_STREAM_SPLIT,
        _ => return Err(damaged("a page of an unknown encoding")),
    })
}

fn size(bytes: u64) -> Result<usize> {
    usize::try_from(bytes).map_err(|_| damaged("a page larger than the memory"))
}

fn damaged(what: &str) -> ParquetError {
    ParquetError::General(what.into())
}
