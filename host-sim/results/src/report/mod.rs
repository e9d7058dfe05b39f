//! Results as one HTML file that a person wants to look at.
//!
//! A report is read by someone who was not there, perhaps years later and without a network. So
//! a [`Page`] becomes *one* file that holds everything: text, numbers and charts as SVG. The page forbids its browser every
//! network request (a content security policy), is complete without scripts, and prints. A small script shows values under
//! the pointer, zooms and hides series.
//!
//! Nothing here knows of friction. A caller stacks [`Block`]s; every text may hold anything (a
//! run may be called `<script>`), every number may be NaN, and neither can break the page.
//! Structure: `page` (`answers` on top, then the blocks of each `section`) -> `table` and `drawing` (HTML of a table and of a chart) -> `marks` (series as SVG on
//! the axes of `scale`, coloured by `palette`).
//! Long measurements go through [`thin_series`] or [`thin_scatter`] first.

mod answers;
mod chart;
mod drawing;
mod finder;
mod fragment;
mod marks;
mod page;
mod palette;
mod scale;
mod section;
mod table;
mod thin;
mod tile;

pub use answers::{Answers, Benefit};
pub use chart::{Axis, Chart, Series, Style};
pub use finder::Finder;
pub use page::{Block, Page};
pub use section::Section;
pub use table::{Cell, Table};
pub use thin::{rounded, thin_scatter, thin_series};
pub use tile::{Tile, Tone};
