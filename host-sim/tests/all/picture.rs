//! The picture of a report's first screen for the README, as SVG.
//!
//! It is generated from the title, answers, facts and charts of the page and compared with the file in git, so that the picture
//! always matches the program. `UPDATE_TABLES=1 cargo test -p host-sim --test all picture` regenerates it.

use friction_results::report::{Block, Chart, Page, Series};
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
/// Height of the chart over time with its legend, pixels.
const CURVES_HEIGHT: usize = 170;
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

impl Picture {
    fn title(&mut self, y: usize, title: &str) {
        self.text((MIDDLE, y), "font-size=\"15\" font-weight=\"bold\" fill=\"#222\"", title);
    }

    /// Writes the caption of a chart from `y` on. Returns the end.
    fn caption(&mut self, chart: &Chart, mut y: usize) -> usize {
        for line in lines(&chart.caption, CAPTION_LETTERS) {
            self.text((MIDDLE, y), "font-size=\"13\" fill=\"#555\"", &line);
            y += 19;
        }
        y
    }

    /// Draws the curves of a chart below `top`, with the ends of both axes and the names of the curves.
    fn curves(&mut self, chart: &Chart, top: usize) {
        let (left, wide) = (MIDDLE + 60, WIDTH - MARGIN - MIDDLE - 60);
        let ends = |values: &dyn Fn(&Series) -> Vec<f64>| {
            let all = chart.series.iter().flat_map(values);
            all.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], v| [low.min(v), high.max(v)])
        };
        let error = |series: &Series| series.error.clone().unwrap_or(vec![0.0; series.y.len()]);
        let reach = |series: &Series| {
            let both = |(y, error): (&f64, f64)| [y - error, y + error];
            series.y.iter().zip(error(series)).flat_map(both).collect()
        };
        let (x, y) = (ends(&|series| series.x.clone()), ends(&reach));
        let place = |value: f64, [low, high]: [f64; 2]| (value - low) / (high - low);
        let small = "font-size=\"13\" fill=\"#222\"";
        let mut colours = COLOURS.iter();
        for (series, column) in chart.series.iter().zip(0..) {
            let colour = if series.muted { "#8C8C8C" } else { colours.next().expect("two models") };
            let across = |value: f64| left as f64 + place(value, x) * wide as f64;
            let down = |value: f64| {
                (top + 20) as f64 + (1.0 - place(value, y)) * (CURVES_HEIGHT - 20) as f64
            };
            for ((x, y), error) in series.x.iter().zip(&series.y).zip(error(series)) {
                if error > 0.0 {
                    let (x, high, low) = (across(*x), down(y + error), down(y - error));
                    let _ = writeln!(
                        self.0,
                        "<path d=\"M{x:.0} {high:.0}V{low:.0}\" stroke=\"{colour}\"/>"
                    );
                }
            }
            let points = series.x.iter().zip(&series.y);
            let points = points.map(|(x, y)| format!("{:.0},{:.0}", across(*x), down(*y)));
            let points: Vec<String> = points.collect();
            let _ = writeln!(
                self.0,
                "<polyline points=\"{}\" fill=\"none\" stroke=\"{colour}\" stroke-width=\"2\"/>",
                points.join(" ")
            );
            let name = left + 100 * column;
            self.bar((name, top + 3), (22, 4), colour);
            self.text((name + 28, top + 10), small, &series.name);
        }
        let bottom = top + CURVES_HEIGHT;
        self.bar((left - 1, top + 20), (1, CURVES_HEIGHT - 20), "#444");
        self.bar((left - 1, bottom), (wide + 1, 1), "#444");
        let at_end = format!("{small} text-anchor=\"end\"");
        for (value, down) in [(y[1], top + 30), (y[0], bottom)] {
            self.text((left - 8, down), &at_end, &format!("{value:.2}"));
        }
        self.text((left, bottom + 17), small, &format!("{:.2}", x[0]));
        self.text((left + 60, bottom + 17), small, &chart.x.label);
        self.text((left + wide, bottom + 17), &at_end, &format!("{:.2}", x[1]));
    }
}

/// Returns the picture of a page's first screen.
pub fn svg(page: &Page) -> String {
    let Some(Block::Lead { facts, charts }) = page.blocks.first() else {
        panic!("a page of `diagnose` starts with its lead block")
    };
    let [over_time, chart] = charts.as_slice() else {
        panic!("the lead block has the torque over time and the errors before and after")
    };
    let mut picture = Picture(String::new());
    picture.text((MARGIN, 52), "font-size=\"26\" font-weight=\"bold\" fill=\"#222\"", &page.title);
    picture.text((MARGIN, 78), "font-size=\"14\" fill=\"#555\"", &page.subtitle);
    picture.bar((MARGIN, 94), (WIDTH - 2 * MARGIN, 2), "#222");

    let mut left = 126;
    let answers = page.answers.as_ref().expect("a page of `diagnose` has answers");
    let facts = facts.iter().map(|(name, text)| (name.as_str(), text.as_str()));
    for (name, text) in answers.each().into_iter().chain(facts) {
        picture.text((MARGIN, left), "font-size=\"13\" fill=\"#555\"", name);
        // A command between backticks has a line of its own.
        for part in text.split('`').map(str::trim).filter(|part| !part.is_empty()) {
            for line in lines(part, FACT_LETTERS) {
                left += 21;
                picture.text((MARGIN, left), "font-size=\"16\" fill=\"#222\"", &line);
            }
        }
        left += 30;
    }

    let mut right = 128;
    picture.title(right, &over_time.title);
    picture.curves(over_time, right + 16);
    right = picture.caption(over_time, right + 16 + CURVES_HEIGHT + 42) + 24;

    picture.title(right, &chart.title);
    let bars: Vec<_> =
        chart.series.iter().zip(COLOURS).map(|(s, c)| (&s.name, s.x[0], c)).collect();
    let longest = bars.iter().map(|(_, value, _)| *value).fold(0.0, f64::max);
    let (zero, room) = (MIDDLE + 60, WIDTH - MARGIN - MIDDLE - 60 - 80);
    right += 20;
    let top = right - 4;
    for (name, value, colour) in &bars {
        let long = (room as f64 * value / longest).round() as usize;
        let style = "font-size=\"13\" fill=\"#222\"";
        picture.text((zero - 8, right + 24), &format!("{style} text-anchor=\"end\""), name);
        picture.bar((zero, right), (long, 36), colour);
        picture.text((zero + long + 8, right + 24), style, &format!("{value:.4}"));
        right += 44;
    }
    picture.bar((zero - 1, top), (1, right - top), "#444");
    picture.text((zero, right + 16), "font-size=\"13\" fill=\"#222\"", &chart.x.label);
    right = picture.caption(chart, right + 46);

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
