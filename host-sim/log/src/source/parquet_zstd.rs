//! Pages of a Parquet column that are compressed with zstd.
//!
//! The `parquet` crate decompresses zstd by a library in C, whose build takes longer than that of any other dependency. Here it
//! reads the pages as if they were not compressed, and `ruzstd`, which is pure Rust, decompresses them. polars and DuckDB write
//! zstd by default or on request.

use bytes::Bytes;
use parquet::basic::Compression;
use parquet::column::page::{Page, PageMetadata, PageReader};
use parquet::errors::{ParquetError, Result};
use parquet::file::metadata::ColumnChunkMetaData;
use parquet::file::serialized_reader::SerializedPageReader;
use ruzstd::decoding::StreamingDecoder;
use std::fs::File;
use std::io::Read;
use std::sync::Arc;

/// Maximum size of a page, bytes: its header has a signed integer of 32 bits.
const MAX_PAGE_BYTES: u64 = i32::MAX as u64;

/// The pages of one column chunk, in the order of the file.
pub(super) struct ZstdPages(SerializedPageReader<File>);

impl ZstdPages {
    /// Opens the pages of a column chunk of `file`, in a row group of `rows` rows.
    ///
    /// # Errors
    /// If the file cannot be opened again.
    pub(super) fn new(file: &File, chunk: &ColumnChunkMetaData, rows: usize) -> Result<Self> {
        let chunk =
            chunk.clone().into_builder().set_compression(Compression::UNCOMPRESSED).build()?;
        SerializedPageReader::new(Arc::new(file.try_clone()?), &chunk, rows, None).map(Self)
    }
}

impl PageReader for ZstdPages {
    fn get_next_page(&mut self) -> Result<Option<Page>> {
        let mut page = self.0.get_next_page()?;
        match &mut page {
            Some(Page::DataPage { buf, .. } | Page::DictionaryPage { buf, .. }) => {
                *buf = decompressed(buf, 0)?;
            }
            Some(Page::DataPageV2 {
                buf,
                def_levels_byte_len,
                rep_levels_byte_len,
                is_compressed: true,
                ..
            }) => {
                // The levels of a page of version 2 are never compressed.
                let levels = *def_levels_byte_len as usize + *rep_levels_byte_len as usize;
                *buf = decompressed(buf, levels)?;
            }
            _ => {}
        }
        Ok(page)
    }

    fn peek_next_page(&mut self) -> Result<Option<PageMetadata>> {
        self.0.peek_next_page()
    }

    fn skip_next_page(&mut self) -> Result<()> {
        self.0.skip_next_page()
    }
}

impl Iterator for ZstdPages {
    type Item = Result<Page>;

    fn next(&mut self) -> Option<Self::Item> {
        self.get_next_page().transpose()
    }
}

/// Returns the bytes of a page, of which the first `plain` are stored uncompressed.
fn decompressed(stored: &Bytes, plain: usize) -> Result<Bytes> {
    if plain > stored.len() {
        return Err(damaged("a page whose levels are longer than the page"));
    }
    let (mut content, mut frames) = (stored[..plain].to_vec(), &stored[plain..]);
    // A page without a value has no compressed part.
    while !frames.is_empty() {
        let no_zstd = |error: String| damaged(&format!("a page that is not zstd: {error}"));
        let decoder =
            StreamingDecoder::new(&mut frames).map_err(|error| no_zstd(error.to_string()))?;
        let read = decoder.take(MAX_PAGE_BYTES).read_to_end(&mut content);
        read.map_err(|error| no_zstd(error.to_string()))?;
    }
    Ok(content.into())
}

/// Returns the error of a damaged file.
pub(super) fn damaged(what: &str) -> ParquetError {
    ParquetError::General(what.into())
}
