//! Results as one HTML file that a person wants to look at.
//!
//! A report is read by someone who was not there, perhaps years later and without a network. So
//! a [`Page`] becomes *one* file that holds everything: text, numbers, the data of its charts and
//! the script that draws them. The page forbids its browser every network request (a content
//! security policy), draws with Plotly.js (drag to zoom, double-click to go back), and prints.
//!
//! Nothing here knows of friction. A caller stacks [`Block`]s; every text may hold anything (a
//! run may be called `<script>`), every number may be NaN, and neither can break the page.
//! The way of a page: `page` (order of blocks) -> `table` and `chart` (their HTML) -> `figure`
//! (a chart in Plotly's terms, coloured by `palette`).
//! Long measurements go through [`thin_series`] or [`thin_scatter`] first.

mod chart;
mod drawing;
mod figure;
mod finder;
mod page;
mod palette;
mod table;
mod thin;

pub use chart::{Axis, Chart, Series, Style};
pub use finder::Finder;
pub use page::{Block, CHART_SCRIPT_FILE, Page, chart_script};
pub use table::{Best, Cell, Table};
pub use thin::{rounded, thin_scatter, thin_series};
