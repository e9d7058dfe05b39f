//! One colour for each name, the same in every chart of a page.
//!
//! A model must have the same colour in all charts, so colours are assigned to series *names*, in the order of their first
//! use. The style sheet defines the colours `s0` to `s6` for light and dark pages: those of Okabe and Ito, which remain
//! distinguishable with colour blindness. After seven names, the colours repeat with other dashes and markers. Measured data
//! are grey.

use std::collections::HashMap;

/// Number of colours in the style sheet.
const COLOURS: usize = 7;

/// Number of dashes in the style sheet.
const DASHES: usize = 3;

/// The assigned colours.
#[derive(Debug, Default)]
pub(super) struct Palette {
    index_of: HashMap<String, usize>,
}

impl Palette {
    /// Returns the classes of a name's colour and dash. The first call assigns them.
    pub fn classes(&mut self, name: &str) -> String {
        let next = self.index_of.len();
        let index = *self.index_of.entry(name.to_owned()).or_insert(next);
        format!("s{} d{}", index % COLOURS, index / COLOURS % DASHES)
    }

    /// Returns the class of measured data.
    pub fn muted() -> String {
        "muted".to_owned()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn classes_are_constant_per_name_and_repeated_colours_differ_in_dash() {
        let mut palette = Palette::default();
        let classes: Vec<String> = (0..9).map(|i| palette.classes(&format!("model {i}"))).collect();
        assert_eq!(palette.classes("model 3"), classes[3]);
        assert_eq!([&*classes[0], &*classes[7]], ["s0 d0", "s0 d1"]);
    }
}
