//! One colour per name, the same in every chart of a page.
//!
//! A reader who has learnt that blue is LuGre must not learn it again two charts on. So colours
//! belong to series *names*, in the order the page first shows them. They are those of Okabe and
//! Ito, told apart with any of the common kinds of colour blindness; their yellow is left out,
//! since thin yellow lines vanish on white. After seven names the colours come again, with other
//! dashes and markers. Measured data is grey: the ground everything else is compared with.

use std::collections::HashMap;

use plotly::common::{DashType, MarkerSymbol};

/// Okabe and Ito's colours without yellow, those with the most contrast on white first.
const COLOURS: [&str; 7] =
    ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000"];

/// What measured data is drawn in.
const GREY: &str = "#8C8C8C";

/// How a series is told from the others.
#[derive(Debug, Clone)]
pub(super) struct Look {
    pub colour: &'static str,
    pub dash: DashType,
    pub symbol: MarkerSymbol,
}

/// The looks given out so far.
#[derive(Debug, Default)]
pub(super) struct Palette {
    index_of: HashMap<String, usize>,
}

impl Palette {
    /// The look of a name: a new one at first, the same ever after.
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

    /// The look of measured data.
    pub fn muted() -> Look {
        Look { colour: GREY, dash: DashType::Solid, symbol: MarkerSymbol::Circle }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_keeps_its_colour_and_repeats_differ_in_dash() {
        let mut palette = Palette::default();
        let looks: Vec<Look> = (0..9).map(|i| palette.look(&format!("model {i}"))).collect();
        assert_eq!(palette.look("model 3").colour, looks[3].colour);
        assert_eq!(looks[7].colour, looks[0].colour);
        assert!(matches!(looks[7].dash, DashType::Dash));
    }
}
