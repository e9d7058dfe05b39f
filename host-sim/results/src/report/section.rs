//! A section of a page: a title with texts, tables and charts below it, in the order in which they are added.

use super::{Block, Chart, Table};

/// A section; its blocks begin with the heading.
#[derive(Debug, Clone, PartialEq)]
pub struct Section(Vec<Block>);

impl Section {
    /// Creates a section without content.
    pub fn new(title: impl Into<String>) -> Self {
        Self(vec![Block::Heading(title.into())])
    }

    /// Adds a text.
    #[must_use]
    pub fn words(self, text: impl Into<String>) -> Self {
        self.with(Some(Block::Paragraph(text.into())))
    }

    /// Adds a list, unless it is empty.
    #[must_use]
    pub fn list(self, sentences: impl IntoIterator<Item = impl Into<String>>) -> Self {
        let sentences: Vec<String> = sentences.into_iter().map(Into::into).collect();
        self.with((!sentences.is_empty()).then_some(Block::List(sentences)))
    }

    /// Adds a table.
    #[must_use]
    pub fn table(self, table: Table) -> Self {
        self.with([Block::Table(table)])
    }

    /// Adds a table whose rows are read one by one.
    #[must_use]
    pub fn records(self, table: Table) -> Self {
        self.with([Block::Records(table)])
    }

    /// Adds a chart over the whole width.
    #[must_use]
    pub fn chart(self, chart: Chart) -> Self {
        self.with([Block::Chart(chart)])
    }

    /// Adds charts side by side; a single one has the whole width.
    #[must_use]
    pub fn charts(self, charts: Vec<Chart>) -> Self {
        self.with(Block::rows(charts))
    }

    /// Adds a collapsed part.
    #[must_use]
    pub fn details(
        self,
        summary: impl Into<String>,
        blocks: impl IntoIterator<Item = Block>,
    ) -> Self {
        self.with([Block::details(summary, blocks.into_iter().collect())])
    }

    /// Adds other blocks.
    #[must_use]
    pub fn with(mut self, blocks: impl IntoIterator<Item = Block>) -> Self {
        self.0.extend(blocks);
        self
    }
}

impl IntoIterator for Section {
    type Item = Block;
    type IntoIter = std::vec::IntoIter<Block>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.into_iter()
    }
}
