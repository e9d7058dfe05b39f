//! The picture of a report's first screen for the README, as SVG.
//!
//! It is generated from the title, facts and chart of the page and compared with the file in git, so that the picture
//! always matches the program. `UPDATE_TABLES=1 cargo test -p host-sim --test all picture` regenerates it.

use friction_results::report::{Block, Page};
use std::fmt::Write as _;
use std::path::Path;

/// Width of the picture, pixels.
const WIDTH: usize = 920;
/// Left edge of the right half, pixels.
const MIDDLE: usize = 500;
/// Margin, pixels.
const MARGIN: usize = 28;
/// Letters in a line of facts, at a font size of 16 pixels. The average width of a letter is half the font size, so a line
/// ends before the right half.
const FACT_LETTERS: usize = 50;
/// Letters in a line of the caption, at a font size of 13 pixels.
const CAPTION_LETTERS: usize = 56;
/// The first two colours of Okabe and Ito, as in the page.
const COLOURS: [&str; 2] = ["#0072B2", "#D55E00"];

fn lines(text: &str, letters: usize) -> Vec<String> {
    let mut lines = vec![String::new()];
    for word in text.split(' ') {
        let last = lines.last_mut().expect("there is one");
        if !last.is_empty() && last.chars().count() + 1 + word.chars().count() > letters {
            lines.push(word.to_owned());
        } else {
            let space = if last.is_empty() { "" } else { " " };
            let _ = write!(last, "{space}{word}");
        }
    }
    lines
}

/// The SVG elements of the picture.
struct Picture(String);

impl Picture {
    fn text(&mut self, at: (usize, usize), style: &str, text: &str) {
        let text = text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
        let _ = writeln!(self.0, "<text x=\"{}\" y=\"{}\" {style}>{text}</text>", at.0, at.1);
    }

    fn bar(&mut self, from: (usize, usize), size: (usize, usize), colour: &str) {
        let ((x, y), (wide, high)) = (from, size);
        let _ = writeln!(
            self.0,
            "<rect x=\"{x}\" y=\"{y}\" width=\"{wide}\" height=\"{high}\" fill=\"{colour}\"/>"
        );
    }
}

/// Returns the picture of a page's first screen.
pub fn svg(page: &Page) -> String {
    let Some(Block::Lead { facts, chart }) = page.blocks.first() else {
        panic!("a page of `diagnose` starts with its lead block")
    };
    let mut picture = Picture(String::new());
    picture.text((MARGIN, 52), "font-size=\"26\" font-weight=\"bold\" fill=\"#222\"", &page.title);
    picture.text((MARGIN, 78), "font-size=\"14\" fill=\"#555\"", &page.subtitle);
    picture.bar((MARGIN, 94), (WIDTH - 2 * MARGIN, 2), "#222");

    let mut left = 126;
    for (name, text) in facts {
        picture.text((MARGIN, left), "font-size=\"13\" fill=\"#555\"", name);
        for line in lines(text, FACT_LETTERS) {
            left += 21;
            picture.text((MARGIN, left), "font-size=\"16\" fill=\"#222\"", &line);
        }
        left += 30;
    }

    picture.text(
        (MIDDLE, 128),
        "font-size=\"15\" font-weight=\"bold\" fill=\"#222\"",
        &chart.title,
    );
    let bars: Vec<_> =
        chart.series.iter().zip(COLOURS).map(|(s, c)| (&s.name, s.x[0], c)).collect();
    let longest = bars.iter().map(|(_, value, _)| *value).fold(0.0, f64::max);
    let (zero, room, mut right) = (MIDDLE + 60, WIDTH - MARGIN - MIDDLE - 60 - 80, 148);
    for (name, value, colour) in &bars {
        let long = (room as f64 * value / longest).round() as usize;
        let style = "font-size=\"13\" fill=\"#222\"";
        picture.text((zero - 8, right + 24), &format!("{style} text-anchor=\"end\""), name);
        picture.bar((zero, right), (long, 36), colour);
        picture.text((zero + long + 8, right + 24), style, &format!("{value:.4}"));
        right += 44;
    }
    picture.bar((zero - 1, 144), (1, right - 144), "#444");
    picture.text((zero, right + 16), "font-size=\"13\" fill=\"#222\"", &chart.x.label);
    right += 46;
    for line in lines(&chart.caption, CAPTION_LETTERS) {
        picture.text((MIDDLE, right), "font-size=\"13\" fill=\"#555\"", &line);
        right += 19;
    }

    let height = left.max(right) + 4;
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {WIDTH} {height}\" width=\"{WIDTH}\" height=\"{height}\" \
         font-family=\"system-ui, 'Segoe UI', Roboto, Helvetica, Arial, sans-serif\">\n\
         <rect width=\"{WIDTH}\" height=\"{height}\" rx=\"6\" fill=\"#ffffff\" stroke=\"#cccccc\"/>\n{}</svg>\n",
        picture.0
    )
}

/// Compares a picture with the one in git. With `UPDATE_TABLES`, writes it first.
pub fn compare(drawn: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/src/pictures/report.svg");
    if std::env::var_os("UPDATE_TABLES").is_some() {
        std::fs::write(&path, drawn).expect("written");
    }
    let known = std::fs::read_to_string(&path).expect("the picture is in git");
    assert!(known == drawn, "the report looks different: UPDATE_TABLES=1 regenerates its picture");
}
