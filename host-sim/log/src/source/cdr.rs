//! ROS 2 messages in MCAP files: a definition as text, and data in CDR (Common Data Representation).
//!
//! ```text
//! std_msgs/Header header
//! string[] name
//! float64[] velocity
//! ================================================================================
//! MSG: std_msgs/Header
//! builtin_interfaces/Time stamp
//! string frame_id
//! ```
//!
//! The data begin with four bytes that state the byte order. After them, every number is aligned to its own size, and
//! texts and lists are preceded by their length. The decoder returns JSON, so that both encodings of MCAP are handled
//! alike. A list that is too long for a joint (an image) is skipped.

use serde_json::{Map, Value};
use std::collections::HashMap;

/// Maximum length of a list. Longer ones do not describe joints and are skipped.
const MAX_LIST_LENGTH: usize = 256;

/// Maximum nesting of definitions. Deeper nesting indicates a circular definition.
const MAX_DEPTH: usize = 16;

/// How many values a field holds.
#[derive(Clone, Copy, Debug)]
enum Count {
    One,
    Fixed(usize),
    Any,
}

#[derive(Clone, Debug)]
struct Field {
    kind: String,
    count: Count,
    name: String,
}

/// The definition of a message and of all messages nested in it.
#[derive(Clone, Debug, Default)]
pub(super) struct Definition {
    fields: Vec<Field>,
    others: HashMap<String, Vec<Field>>,
}

impl Definition {
    /// Parses a definition.
    pub fn parse(text: &str) -> Self {
        let mut definition = Self::default();
        let mut of: Option<String> = None;
        for line in text.lines() {
            let line = line.split('#').next().unwrap_or_default().trim();
            if let Some(name) = line.strip_prefix("MSG:") {
                of = Some(short(name.trim()));
            } else if let Some(field) = field(line) {
                match &of {
                    None => definition.fields.push(field),
                    Some(name) => definition.others.entry(name.clone()).or_default().push(field),
                }
            }
        }
        definition
    }

    /// Decodes a message. Returns `None` if the data do not match the definition.
    pub fn decode(&self, bytes: &[u8]) -> Option<Value> {
        let (head, rest) = bytes.split_at_checked(4)?;
        let mut bytes = Bytes { rest, at: 0, is_little: head[1] & 1 == 1 };
        self.message(&self.fields, &mut bytes, 0)
    }

    fn message(&self, fields: &[Field], bytes: &mut Bytes, depth: usize) -> Option<Value> {
        let mut object = Map::new();
        for field in fields {
            let count = match field.count {
                Count::One => {
                    object.insert(field.name.clone(), self.value(&field.kind, bytes, depth)?);
                    continue;
                }
                Count::Fixed(count) => count,
                Count::Any => bytes.length()?,
            };
            if count > MAX_LIST_LENGTH
                && let Some(size) = size(&field.kind)
            {
                bytes.align(size);
                bytes.take(count.checked_mul(size)?)?;
                continue;
            }
            // Each element takes at least one byte, so a greater length is invalid.
            if count > bytes.left() {
                return None;
            }
            let list: Option<Vec<Value>> =
                (0..count).map(|_| self.value(&field.kind, bytes, depth)).collect();
            object.insert(field.name.clone(), list?.into());
        }
        Some(object.into())
    }

    fn value(&self, kind: &str, bytes: &mut Bytes, depth: usize) -> Option<Value> {
        if let Some(size) = size(kind) {
            bytes.align(size);
            let raw = bytes.number(size)?;
            let bits = 64 - 8 * size as u32;
            let signed = (raw.cast_signed() << bits) >> bits;
            return Some(match kind {
                "float32" => f64::from(f32::from_bits(raw as u32)).into(),
                "float64" => f64::from_bits(raw).into(),
                "bool" => (raw != 0).into(),
                _ if kind.starts_with("int") => signed.into(),
                _ => raw.into(),
            });
        }
        if kind == "string" || kind.starts_with("string<=") {
            let length = bytes.length()?;
            let text = bytes.take(length)?;
            let text = text.strip_suffix(&[0]).unwrap_or(text);
            return Some(String::from_utf8_lossy(text).into());
        }
        let fields = self.others.get(&short(kind)).filter(|_| depth < MAX_DEPTH)?;
        self.message(fields, bytes, depth + 1)
    }
}

/// Returns the name without `/msg/`: `pkg/msg/Type` and `pkg/Type` are the same.
fn short(name: &str) -> String {
    name.replace("/msg/", "/")
}

/// Parses a line of a definition. Returns `None` for a constant, a separator or an empty line.
fn field(line: &str) -> Option<Field> {
    let mut words = line.split_whitespace();
    let (kind, name) = (words.next()?, words.next()?);
    if name.contains('=') || words.next().is_some_and(|word| word.starts_with('=')) {
        return None;
    }
    let (kind, count) = match kind.strip_suffix(']').and_then(|kind| kind.rsplit_once('[')) {
        Some((kind, count)) => (kind, count.parse().map_or(Count::Any, Count::Fixed)),
        None => (kind, Count::One),
    };
    Some(Field { kind: kind.into(), count, name: name.into() })
}

/// Returns the size of a number, bytes.
fn size(kind: &str) -> Option<usize> {
    Some(match kind {
        "bool" | "byte" | "char" | "int8" | "uint8" => 1,
        "int16" | "uint16" => 2,
        "int32" | "uint32" | "float32" => 4,
        "int64" | "uint64" | "float64" => 8,
        _ => return None,
    })
}

/// The data of a message and the read position.
struct Bytes<'a> {
    rest: &'a [u8],
    at: usize,
    is_little: bool,
}

impl<'a> Bytes<'a> {
    fn left(&self) -> usize {
        self.rest.len() - self.at
    }

    fn align(&mut self, size: usize) {
        self.at = self.at.next_multiple_of(size).min(self.rest.len());
    }

    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let taken = self.rest.get(self.at..self.at.checked_add(count)?)?;
        self.at += count;
        Some(taken)
    }

    fn number(&mut self, size: usize) -> Option<u64> {
        let is_little = self.is_little;
        let bytes = self.take(size)?;
        let joined = |sum: u64, byte: &u8| sum << 8 | u64::from(*byte);
        Some(if is_little {
            bytes.iter().rev().fold(0, joined)
        } else {
            bytes.iter().fold(0, joined)
        })
    }

    fn length(&mut self) -> Option<usize> {
        self.align(4);
        Some(self.number(4)? as usize)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    const STATE: &str = "# a joint's state\nstd_msgs/Header header\nuint8 KIND=3\nstring[] name\nfloat64[] velocity\n\
        int16[2] pair\n=====\nMSG: std_msgs/Header\nbuiltin_interfaces/Time stamp\nstring frame_id\n=====\n\
        MSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n";

    #[test]
    fn decode_with_valid_message_returns_its_fields() {
        let mut bytes = vec![0, 1, 0, 0];
        bytes.extend((-7i32).to_le_bytes());
        bytes.extend(500_000_000u32.to_le_bytes());
        bytes.extend([6, 0, 0, 0, b'a', b'b', b'c', b'd', b'e', 0]);
        bytes.extend([0; 2]); // to a multiple of 4
        bytes.extend([1, 0, 0, 0, 2, 0, 0, 0, b'q', 0]);
        bytes.extend([0; 2]);
        bytes.extend([2, 0, 0, 0]); // at 32; the numbers at 40
        bytes.extend([0; 4]);
        bytes.extend(1.5f64.to_le_bytes());
        bytes.extend((-2.0f64).to_le_bytes());
        bytes.extend((-3i16).to_le_bytes());
        bytes.extend(4i16.to_le_bytes());
        let definition = Definition::parse(STATE);
        let expected = json!({
            "header": {"stamp": {"sec": -7, "nanosec": 500_000_000}, "frame_id": "abcde"},
            "name": ["q"], "velocity": [1.5, -2.0], "pair": [-3, 4],
        });
        let at = |length: usize| definition.decode(&bytes[..length]);
        assert_eq!(at(bytes.len()), Some(expected));
        // A message that is cut anywhere is invalid.
        (0..bytes.len()).for_each(|length| assert_eq!(at(length), None, "{length}"));
    }

    #[test]
    fn decode_with_invalid_length_or_circular_definition_returns_none() {
        let definition = Definition::parse("float64[] x");
        assert_eq!(definition.decode(&[0, 1, 0, 0, 255, 255, 255, 255]), None);
        let circle = Definition::parse("a/B b\n===\nMSG: a/B\na/B b\n");
        assert_eq!(circle.decode(&[0, 1, 0, 0, 1, 2, 3, 4]), None);
        let image = Definition::parse("uint8[] data\nint32 after");
        let mut bytes = vec![0, 1, 0, 0, 0, 2, 0, 0];
        bytes.extend([9; 512]);
        bytes.extend(5i32.to_le_bytes());
        assert_eq!(image.decode(&bytes), Some(json!({"after": 5})));
    }
}
