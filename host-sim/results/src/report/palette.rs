//! One colour for each name, the same in every chart of a page.
//!
//! A model must have the same colour in all charts, so colours are assigned to series *names*, in the order of their first
//! use. They are the colours of Okabe and Ito, which remain distinguishable with colour blindness. Yellow is left out,
//! because thin yellow lines are invisible on white. After seven names, the colours repeat with other dashes and markers.
//! Measured data are grey.

use std::collections::HashMap;

use plotly::common::{DashType, MarkerSymbol};

/// The colours of Okabe and Ito without yellow, highest contrast on white first.
const COLOURS: [&str; 7] =
    ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000"];

/// Colour of measured data.
const GREY: &str = "#8C8C8C";

/// Colour, dash and marker of a series.
#[derive(Debug, Clone)]
pub(super) struct Look {
    pub colour: &'static str,
    pub dash: DashType,
    pub symbol: MarkerSymbol,
}

/// The assigned looks.
#[derive(Debug, Default)]
pub(super) struct Palette {
    index_of: HashMap<String, usize>,
}

impl Palette {
    /// Returns the look of a name. The first call assigns it.
    pub fn look(&mut self, name: &str) -> Look {
        let next = self.index_of.len();
        let index = *self.index_of.entry(name.to_owned()).or_insert(next);
        let (dash, symbol) = match index / COLOURS.len() % 3 {
            0 => (DashType::Solid, MarkerSymbol::Circle),
            1 => (DashType::Dash, MarkerSymbol::Square),
            _ => (DashType::Dot, MarkerSymbol::Diamond),
        };
        Look { colour: COLOURS[index % COLOURS.len()], dash, symbol }
    }

    /// Returns the look of measured data.
    pub fn muted() -> Look {
        Look { colour: GREY, dash: DashType::Solid, symbol: MarkerSymbol::Circle }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn look_is_constant_per_name_and_repeated_colours_differ_in_dash() {
        let mut palette = Palette::default();
        let looks: Vec<Look> = (0..9).map(|i| palette.look(&format!("model {i}"))).collect();
        assert_eq!(palette.look("model 3").colour, looks[3].colour);
        assert_eq!(looks[7].colour, looks[0].colour);
        assert!(matches!(looks[7].dash, DashType::Dash));
    }
}
