//! Formats a text for a terminal: wraps lines between words and adds colour.
//!
//! The beginning of a line selects its colour: `1.` is a sentence of the result, `-` a remark, `log:` a problem of the
//! log, `written:` the list of files. Lines of tables stay unchanged.

const BOLD: &str = "\x1b[1m";
const DIM: &str = "\x1b[2m";
const YELLOW: &str = "\x1b[33m";
const CYAN: &str = "\x1b[36m";
const RESET: &str = "\x1b[0m";

/// Returns the text wrapped to `width` columns, with colour codes if `colour` is set.
pub fn format_for_terminal(text: &str, width: usize, colour: bool) -> String {
    let mut whole = String::with_capacity(text.len() + 256);
    let mut lines = text.lines().peekable();
    while let Some(line) = lines.next() {
        let style = if colour { line_style(line) } else { "" };
        let indent = hanging_indent(line, lines.peek().copied());
        for (place, part) in wrap(line, width, indent).iter().enumerate() {
            if place > 0 {
                whole.push_str(&" ".repeat(indent));
            }
            match style {
                "" => whole.push_str(part),
                style => whole.extend([style, part.as_str(), RESET]),
            }
            whole.push('\n');
        }
    }
    whole
}

/// Returns true if the line is a numbered sentence.
fn is_numbered(line: &str) -> bool {
    line.split_once(". ")
        .is_some_and(|(number, _)| !number.is_empty() && number.bytes().all(|b| b.is_ascii_digit()))
}

/// Returns the colour code of a line, or an empty text for the default colour.
fn line_style(line: &str) -> &'static str {
    match line {
        line if line.starts_with("log:") || line.trim_start().starts_with("- ") => YELLOW,
        line if line.starts_with("written:") => DIM,
        line if is_numbered(line) && !line.starts_with("1.") => "",
        line if is_numbered(line) => BOLD,
        line if line.contains(['═', '─']) => DIM,
        line if line.ends_with(':') => CYAN,
        _ => "",
    }
}

/// Beginnings of lines whose other parts are indented below the text that follows.
const LABELS: [&str; 3] = ["log: ", "written: ", "note: "];

/// Returns the indent of the second and following parts of a wrapped line, in columns. `next` is the line that follows: a
/// line with details below it is indented as these are.
fn hanging_indent(line: &str, next: Option<&str>) -> usize {
    let blanks = |line: &str| line.len() - line.trim_start().len();
    let label = LABELS.iter().find(|label| line.starts_with(*label));
    let bullet = if is_numbered(line) {
        line.find(". ").map_or(0, |at| at + 2)
    } else if line.trim_start().starts_with("- ") {
        2
    } else if line.starts_with('[') {
        line.find("] ").map_or(0, |at| at + 2)
    } else {
        label.map_or(0, |label| label.len())
    };
    let of_details = next.map_or(0, blanks);
    blanks(line) + if bullet > 0 { bullet } else { of_details.saturating_sub(blanks(line)) }
}

/// Units that stay on the line of their number.
const UNITS: [&str; 10] = ["%", "Nm", "N", "Nm/Pa", "rad/s", "m/s", "rad", "s", "Hz", "A"];

/// Splits a line into words. A number and its unit are one word.
fn words(line: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    for word in line.split(' ').filter(|word| !word.is_empty()) {
        let unit = word.trim_end_matches(|letter: char| ",;:.)".contains(letter));
        let is_number = |word: &&mut String| word.ends_with(|last: char| last.is_ascii_digit());
        match words.last_mut().filter(is_number) {
            Some(number) if UNITS.contains(&unit) => *number += &format!(" {word}"),
            _ => words.push(word.to_owned()),
        }
    }
    words
}

/// Splits a line at blanks into parts of at most `width` columns, of which those after the first are indented; a single
/// longer word stays whole. Table rows are not split.
fn wrap(line: &str, width: usize, indent: usize) -> Vec<String> {
    let is_table = line.contains(['═', '─']) || line.trim_start().contains("   ");
    if line.chars().count() <= width || is_table {
        return vec![line.to_owned()];
    }
    let mut parts = vec![String::new()];
    let blanks = line.len() - line.trim_start().len();
    parts[0].push_str(&line[..blanks]);
    for word in words(line) {
        let at = parts.len() - 1;
        let room = if at == 0 { width } else { width.saturating_sub(indent) };
        let is_empty = parts[at].trim_start().is_empty();
        let is_too_long =
            parts[at].chars().count() + usize::from(!is_empty) + word.chars().count() > room;
        if is_too_long && !is_empty {
            parts.push(word);
        } else {
            if !is_empty {
                parts[at].push(' ');
            }
            parts[at].push_str(&word);
        }
    }
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "log: velocity-noise: the velocity is noisy by 0.028 rad/s, which was taken out before anything was fitted\n\
        1. On rows it has not seen, lugre is 0.0880 Nm RMS away from the logged torque, and 0.0853 Nm would be noise.\n\
        - stribeck_velocity: at its bound: the edge of its legal range, and so on until the line is full\n\
        written: out/report.html\n";

    #[test]
    fn format_for_terminal_keeps_every_word_within_the_width() {
        for width in [40, 80, 120] {
            let formatted = format_for_terminal(TEXT, width, false);
            assert!(formatted.lines().all(|line| line.chars().count() <= width), "{formatted}");
            let words = |text: &str| text.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
            assert_eq!(words(&formatted), words(TEXT));
        }
        let narrow = format_for_terminal(TEXT, 60, false);
        assert!(narrow.contains("\n   the logged"), "{narrow}");
        let row =
            " lugre            0.3410     16.3 %      15.9 %     0.1602     -219690     1.1 s ";
        assert_eq!(format_for_terminal(row, 60, true), format!("{row}\n"));
    }

    #[test]
    fn format_for_terminal_keeps_number_with_unit_and_indents_details() {
        let text = "the error falls by 0.47 % (95 % interval 0.2 to 1.2 %) of 3.1\u{a0}Nm, so it is\n  noise\n";
        for width in 20..60 {
            let formatted = format_for_terminal(text, width, false);
            let lines: Vec<&str> = formatted.lines().collect();
            assert!(lines.iter().all(|line| !line.trim_start().starts_with('%')), "{formatted}");
            assert!(formatted.contains("3.1\u{a0}Nm"), "{formatted}");
            assert!(lines[1..].iter().all(|line| line.starts_with("  ")), "{formatted}");
        }
        let files = format_for_terminal("written: out/one.html, out/two.json", 22, false);
        assert_eq!(files, "written: out/one.html,\n         out/two.json\n");
    }

    #[test]
    fn format_for_terminal_with_colour_marks_each_line() {
        let coloured = format_for_terminal(TEXT, 80, true);
        assert!(
            coloured.starts_with(YELLOW) && coloured.contains(&format!("{BOLD}1. ")),
            "{coloured}"
        );
        assert_eq!(coloured.matches(RESET).count(), coloured.lines().count());
    }
}
