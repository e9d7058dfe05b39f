//! The picture of the monitor in the book: the screen of the joint of these tests, as SVG.
//!
//! Drawn by the code that draws the terminal, and compared with the file in git, so the picture cannot show what the
//! program does not. `UPDATE_TABLES=1 cargo test -p joint-monitor picture` writes it anew.

use super::*;
use ratatui::buffer::Cell;
use std::fmt::Write as _;
use std::path::Path;

/// A letter's width and height, pixels; dots of Braille, three quarters of a letter apart, join to curves at these.
const LETTER: (u16, u16) = (8, 17);
const MARGIN: u16 = 12;

/// A colour of the terminal on a dark ground.
fn colour(of: Color) -> &'static str {
    match of {
        Color::Black => "#16181d",
        Color::Red => "#ff6b6b",
        Color::Green => "#6fd08c",
        Color::Yellow => "#e5c07b",
        Color::Cyan => "#56b6c2",
        Color::Blue => "#61afef",
        Color::Magenta => "#c678dd",
        Color::DarkGray => "#7f8794",
        _ => "#d7dae0",
    }
}

/// Its letter and its ground.
fn colours(cell: &Cell) -> (&'static str, Option<&'static str>) {
    let ground = (cell.bg != Color::Reset).then(|| colour(cell.bg));
    if cell.modifier.contains(Modifier::REVERSED) {
        return (ground.unwrap_or(colour(Color::Black)), Some(colour(cell.fg)));
    }
    (colour(cell.fg), ground)
}

fn svg(buffer: &Buffer) -> String {
    let (columns, rows) = (buffer.area.width, buffer.area.height);
    let (width, height) = (columns * LETTER.0 + 2 * MARGIN, rows * LETTER.1 + 2 * MARGIN);
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" width=\"{width}\" height=\"{height}\" \
         font-family=\"DejaVu Sans Mono, Menlo, Consolas, monospace\" font-size=\"13\">\n\
         <rect width=\"{width}\" height=\"{height}\" rx=\"6\" fill=\"{}\"/>\n",
        colour(Color::Black)
    );
    for (row, cells) in (0u16..).zip(buffer.content.chunks(usize::from(columns))) {
        let (top, mut column) = (MARGIN + row * LETTER.1, 0u16);
        for same in cells.chunk_by(|a, b| colours(a) == colours(b) && a.modifier == b.modifier) {
            let (left, count) = (MARGIN + column * LETTER.0, same.len() as u16);
            column += count;
            let (letter, ground) = colours(&same[0]);
            let wide = count * LETTER.0;
            if let Some(ground) = ground {
                let tall = LETTER.1;
                let _ = writeln!(
                    text,
                    "<rect x=\"{left}\" y=\"{top}\" width=\"{wide}\" height=\"{tall}\" fill=\"{ground}\"/>"
                );
            }
            let bold = same[0].modifier.contains(Modifier::BOLD);
            let weight = if bold { " font-weight=\"bold\"" } else { "" };
            let mut from = left;
            // Word by word: readers of SVG differ in what they make of blanks.
            for word in same.chunk_by(|a, b| (a.symbol() == " ") == (b.symbol() == " ")) {
                let (at, wide) = (from, word.len() as u16 * LETTER.0);
                from += wide;
                if word[0].symbol() == " " {
                    continue;
                }
                let letters: String = word.iter().map(|cell| cell.symbol()).collect();
                let letters =
                    letters.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
                // The length holds the columns together whatever font the reader has.
                let _ = writeln!(
                    text,
                    "<text x=\"{at}\" y=\"{}\" textLength=\"{wide}\" lengthAdjust=\"spacingAndGlyphs\" fill=\"{letter}\"{weight}>{letters}</text>",
                    top + 13
                );
            }
        }
    }
    text + "</svg>\n"
}

#[test]
fn the_picture_in_the_readme_is_what_is_drawn() {
    let view = seen(&model(), 4999);
    let drawn = svg(&drawn(&view, &Controls::new(false), &setting(), (110, 34)));
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/src/pictures/monitor.svg");
    if std::env::var_os("UPDATE_TABLES").is_some() {
        std::fs::create_dir_all(path.parent().expect("a folder")).expect("made");
        std::fs::write(&path, &drawn).expect("written");
    }
    let known = std::fs::read_to_string(&path).expect("the picture is in git");
    assert!(known == drawn, "the monitor looks different: UPDATE_TABLES=1 draws its picture anew");
}
