//! Trees of evidence: each adds to the log odds of a cause.
//!
//! A node asks whether a figure is below a limit, or whether the cause is one of some; a leaf is a part of the log odds. The fit
//! keeps each tree monotone: of two leaves below a figure's node, that of the larger figure is the larger one. The text of a tree
//! is its nodes in order, each before its two branches: `last<3.2 -0.1 cause=backlash,warm-up 0.05 0.3`.

use super::{CalibrationError, FIGURES};
use std::fmt;

/// A node of a tree.
#[derive(Clone, Debug, PartialEq)]
pub enum Node {
    /// A part of the log odds.
    Leaf(f64),
    /// Goes to the next node if the figure is below the limit, else to `other`.
    Figure {
        /// Index in [`FIGURES`].
        figure: usize,
        /// The limit.
        below: f64,
        /// Index of the other branch.
        other: usize,
    },
    /// Goes to the next node if the cause is among these, else to `other`.
    Cause {
        /// Names as of [`category`].
        among: Vec<String>,
        /// Index of the other branch.
        other: usize,
    },
}

/// A tree: its nodes, each before its branches.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tree(pub Vec<Node>);

/// Returns the name by which trees know a cause. A curve over the position is like a wave, one over a channel is not.
pub fn category<'a>(cause: &'a str, follows: &str) -> &'a str {
    match cause {
        "unknown" if follows.starts_with("position") => "unknown-position",
        cause => cause,
    }
}

impl Tree {
    /// Returns its part of the log odds of a cause.
    pub fn value(&self, category: &str, figures: &[f64]) -> f64 {
        let mut at = 0;
        loop {
            match self.0.get(at) {
                None => return 0.0,
                Some(Node::Leaf(value)) => return *value,
                Some(Node::Figure { figure, below, other }) => {
                    at = if figures[*figure] < *below { at + 1 } else { *other };
                }
                Some(Node::Cause { among, other }) => {
                    at = if among.iter().any(|name| name == category) { at + 1 } else { *other };
                }
            }
        }
    }

    /// Parses the text of a tree.
    ///
    /// # Errors
    /// [`CalibrationError::Tree`] with the word that is no node, or if a branch is missing.
    pub fn parse(text: &str) -> Result<Self, CalibrationError> {
        let mut tree = Self::default();
        let mut words = text.split_ascii_whitespace();
        tree.read(&mut words)?;
        match words.next() {
            Some(word) => Err(CalibrationError::Tree(word.into())),
            None => Ok(tree),
        }
    }

    fn read<'t>(
        &mut self,
        words: &mut impl Iterator<Item = &'t str>,
    ) -> Result<(), CalibrationError> {
        let wrong = |word: &str| CalibrationError::Tree(word.into());
        let word = words.next().ok_or_else(|| wrong("its end"))?;
        let at = self.0.len();
        if let Some(names) = word.strip_prefix("cause=") {
            let among = names.split(',').map(str::to_owned).collect();
            self.0.push(Node::Cause { among, other: 0 });
        } else if let Some((name, limit)) = word.split_once('<') {
            let figure = FIGURES.iter().position(|figure| figure.name == name);
            let (figure, below) = figure.zip(limit.parse().ok()).ok_or_else(|| wrong(word))?;
            self.0.push(Node::Figure { figure, below, other: 0 });
        } else {
            let value: f64 = word.parse().map_err(|_| wrong(word))?;
            self.0.push(Node::Leaf(value));
            return Ok(());
        }
        self.read(words)?;
        let next = self.0.len();
        if let Node::Figure { other, .. } | Node::Cause { other, .. } = &mut self.0[at] {
            *other = next;
        }
        self.read(words)
    }
}

impl fmt::Display for Tree {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (at, node) in self.0.iter().enumerate() {
            if at > 0 {
                f.write_str(" ")?;
            }
            match node {
                Node::Leaf(value) => write!(f, "{value:.4}")?,
                Node::Figure { figure, below, .. } => {
                    write!(f, "{}<{below:.4}", FIGURES[*figure].name)?;
                }
                Node::Cause { among, .. } => write!(f, "cause={}", among.join(","))?,
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str =
        "last<3.2000 -0.1000 cause=backlash,unknown-position alone<1.0000 0.0500 0.0600 0.3000";

    #[test]
    fn value_follows_the_branches() {
        let tree = Tree::parse(TEXT).unwrap();
        let at = |name: &str| FIGURES.iter().position(|figure| figure.name == name).unwrap();
        let value = |cause: &str, last: f64, alone: f64| {
            let mut figures = vec![0.0; FIGURES.len()];
            (figures[at("last")], figures[at("alone")]) = (last, alone);
            tree.value(category(cause, "position_rad"), &figures)
        };
        assert_eq!(value("backlash", 3.0, 0.0), -0.1);
        assert_eq!(value("backlash", 4.0, 0.0), 0.05);
        assert_eq!(value("unknown", 4.0, 2.0), 0.06);
        assert_eq!(value("warm-up", 4.0, 2.0), 0.3);
        assert_eq!(tree.to_string(), TEXT);
    }

    #[test]
    fn parse_of_wrong_text_names_the_word() {
        for (text, word) in [("lust<1 0 0", "lust<1"), ("last<1 0", "its end"), ("0.1 0.2", "0.2")]
        {
            assert_eq!(Tree::parse(text), Err(CalibrationError::Tree(word.into())), "{text}");
        }
    }
}
