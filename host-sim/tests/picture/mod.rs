//! The picture of a report's first screen in the README, as SVG.
//!
//! Made of the page itself, its title, facts and chart, and compared with the file in git, so that the picture cannot show
//! what the program does not. `UPDATE_TABLES=1 cargo test -p host-sim --test diagnosis_page picture` writes it anew.

use host_sim::report::{Block, Page};
use std::fmt::Write as _;
use std::path::Path;

/// The picture's width, and where its right half begins, pixels.
const WIDTH: usize = 920;
const MIDDLE: usize = 500;
const MARGIN: usize = 28;
/// Letters in a line of facts and of the caption. A letter of the fonts below is half its height on average, and hardly
/// a line is more than a tenth above that: at 16 and 13 pixels they end before the other half, and before the edge.
const FACT_LETTERS: usize = 50;
const CAPTION_LETTERS: usize = 56;
/// Okabe and Ito's first two, as the page has them.
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

/// A picture as it grows.
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

/// The first screen of a page.
pub fn svg(page: &Page) -> String {
    let Some(Block::Lead { facts, chart }) = page.blocks.first() else {
        panic!("a page of `diagnose` begins with its lead")
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

/// Compares a picture with the one in git, or writes it there.
pub fn compare(drawn: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/pictures/report.svg");
    if std::env::var_os("UPDATE_TABLES").is_some() {
        std::fs::write(&path, drawn).expect("written");
    }
    let known = std::fs::read_to_string(&path).expect("the picture is in git");
    assert!(known == drawn, "the report looks different: UPDATE_TABLES=1 draws its picture anew");
}
