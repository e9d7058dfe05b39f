//! Formats that a build does not read because it lacks their feature. Their files are recognised and refused with the name of
//! the feature; as a table of text, they would give a hundred bad rows.

use super::format::{self, Input, LogFormat};
use crate::error::DataError;
use crate::log_table::LogTable;

/// Recordings of ROS 2 and Foxglove.
#[cfg(any(test, not(feature = "mcap")))]
pub(super) const MCAP: LogFormat = LogFormat {
    matches: format::is_mcap,
    read: |input| refuse(&input, "an MCAP recording", "mcap"),
};

/// Parquet files.
#[cfg(any(test, not(feature = "parquet")))]
pub(super) const PARQUET: LogFormat = LogFormat {
    matches: format::is_parquet,
    read: |input| refuse(&input, "a Parquet file", "parquet"),
};

/// Files and streams of Arrow IPC.
#[cfg(any(test, not(feature = "arrow")))]
pub(super) const ARROW: LogFormat = LogFormat {
    matches: format::is_arrow,
    read: |input| refuse(&input, "an Arrow or Feather file", "arrow"),
};

fn refuse(
    input: &Input,
    format: &'static str,
    feature: &'static str,
) -> Result<LogTable<'static>, DataError> {
    Err(DataError::LeftOut { file: input.request.path.into(), format, feature })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::message;
    use crate::options::ReadOptions;
    use crate::plan::{Purpose, Request};
    use std::path::Path;

    #[test]
    fn read_with_format_left_out_names_format_and_feature() {
        let stream = [0xff, 0xff, 0xff, 0xff, 0x10, 0, 0, 0, 0x10, 0, 0, 0];
        for (format, head, name, expected) in [
            (MCAP, &b"\x89MCAP0\r\n"[..], "MCAP", "mcap"),
            (PARQUET, b"PAR1\x15\x04", "Parquet", "parquet"),
            (ARROW, b"ARROW1\0\0", "Arrow", "arrow"),
            (ARROW, &stream, "Arrow", "arrow"),
        ] {
            assert!((format.matches)(head), "{expected}");
            let (options, file) = (ReadOptions::default(), tempfile::tempfile().expect("a file"));
            let path = Path::new("my.log");
            let (purpose, progress) = (Purpose::Data, &|_| {});
            let request = Request { path, options: &options, purpose, is_wide: false, progress };
            let input = Input { request, file, head, size: 8 };
            let Err(error) = (format.read)(input) else { panic!("read") };
            let DataError::LeftOut { file, format, feature } = &error else { panic!("{error}") };
            assert_eq!((&**file, *feature), (path, expected));
            assert!(format.contains(name), "{format}");
            message::check(
                "errors",
                "format left out",
                &error.to_string().replace(format, "FORMAT").replace(*feature, "FEATURE"),
                &["my.log"],
            );
        }
    }
}
