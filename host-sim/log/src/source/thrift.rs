//! Structures in Thrift's compact protocol, as far as headers of Parquet pages need them.
//!
//! A structure is a list of fields with ascending numbers, ended by a zero byte. A field's first byte holds the step of its
//! number and its type. Integers are zigzag varints. Texts, lists and maps are skipped, because no page needs them.

/// Levels of structures in structures. A page header has two; the bound keeps damaged bytes from exhausting the stack.
const MAX_DEPTH: u32 = 8;

/// The fields of a structure by their number.
#[derive(Debug, Clone, Default)]
pub(super) struct Fields(Vec<(i16, Value)>);

#[derive(Debug, Clone)]
enum Value {
    Boolean(bool),
    Integer(i64),
    Structure(Fields),
}

impl Fields {
    fn value(&self, field: i16) -> Option<&Value> {
        self.0.iter().find(|(number, _)| *number == field).map(|(_, value)| value)
    }

    /// Returns an integer field.
    pub(super) fn integer(&self, field: i16) -> Option<i64> {
        if let Some(Value::Integer(value)) = self.value(field) { Some(*value) } else { None }
    }

    /// Returns a boolean field.
    pub(super) fn boolean(&self, field: i16) -> Option<bool> {
        if let Some(Value::Boolean(value)) = self.value(field) { Some(*value) } else { None }
    }

    /// Returns the fields of a field that is a structure.
    pub(super) fn fields(&self, field: i16) -> Option<&Self> {
        if let Some(Value::Structure(fields)) = self.value(field) { Some(fields) } else { None }
    }
}

/// Parses the structure at the start of `bytes`. Returns it and its length in bytes, or `None` if the bytes end before it
/// does or are not such a structure.
pub(super) fn parse_struct(bytes: &[u8]) -> Option<(Fields, usize)> {
    let mut parser = Parser { bytes, at: 0 };
    let fields = parser.structure(0)?;
    Some((fields, parser.at))
}

struct Parser<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl Parser<'_> {
    fn byte(&mut self) -> Option<u8> {
        let byte = *self.bytes.get(self.at)?;
        self.at += 1;
        Some(byte)
    }

    fn skip(&mut self, length: usize) -> Option<()> {
        self.at = self.at.checked_add(length).filter(|at| *at <= self.bytes.len())?;
        Some(())
    }

    fn varint(&mut self) -> Option<u64> {
        let mut value = 0;
        for shift in (0..64).step_by(7) {
            let byte = self.byte()?;
            value |= u64::from(byte & 0x7f) << shift;
            if byte < 0x80 {
                return Some(value);
            }
        }
        None
    }

    fn integer(&mut self) -> Option<i64> {
        let value = self.varint()?;
        Some((value >> 1).cast_signed() ^ -(value & 1).cast_signed())
    }

    fn structure(&mut self, depth: u32) -> Option<Fields> {
        let mut fields = Fields::default();
        let mut number = 0_i16;
        loop {
            let head = self.byte()?;
            if head == 0 {
                return Some(fields);
            }
            number = match head >> 4 {
                0 => i16::try_from(self.integer()?).ok()?,
                step => number.checked_add(i16::from(step))?,
            };
            if let Some(value) = self.value(head & 0x0f, depth)? {
                fields.0.push((number, value));
            }
        }
    }

    /// Reads a value of a type. The inner `None` is a value that no page needs.
    fn value(&mut self, kind: u8, depth: u32) -> Option<Option<Value>> {
        Some(match kind {
            1 => Some(Value::Boolean(true)),
            2 => Some(Value::Boolean(false)),
            3 => self.byte().map(|_| None)?,
            4..=6 => Some(Value::Integer(self.integer()?)),
            7 => self.skip(8).map(|()| None)?,
            8 => {
                let length = usize::try_from(self.varint()?).ok()?;
                self.skip(length).map(|()| None)?
            }
            12 if depth < MAX_DEPTH => Some(Value::Structure(self.structure(depth + 1)?)),
            // No page header holds a list, a set or a map.
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::parse_struct;

    #[test]
    fn structure_with_nested_fields_returns_them_by_number() {
        // 1: 3 (i32), 2: -1 (i32), 5: {1: 300, 7: true, 8: false, 9: text "ab"}.
        let bytes =
            [0x15, 6, 0x15, 1, 0x3c, 0x15, 0xd8, 0x04, 0x61, 0x12, 0x18, 2, b'a', b'b', 0, 0];
        let (fields, length) = parse_struct(&bytes).unwrap();
        assert_eq!(length, bytes.len());
        assert_eq!((fields.integer(1), fields.integer(2)), (Some(3), Some(-1)));
        let inner = fields.fields(5).unwrap();
        assert_eq!(inner.integer(1), Some(300));
        assert_eq!((inner.boolean(7), inner.boolean(8)), (Some(true), Some(false)));
        assert_eq!((inner.integer(9), inner.integer(2)), (None, None));
    }

    #[test]
    fn structure_cut_at_any_byte_is_refused() {
        let bytes =
            [0x15, 6, 0x15, 1, 0x3c, 0x15, 0xd8, 0x04, 0x61, 0x12, 0x18, 2, b'a', b'b', 0, 0];
        for length in 0..bytes.len() {
            assert!(parse_struct(&bytes[..length]).is_none(), "{length} bytes");
        }
    }

    #[test]
    fn structure_in_itself_without_end_is_refused() {
        assert!(parse_struct(&[0x1c; 100_000]).is_none());
    }
}
