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
    for line in text.lines() {
        let style = if colour { line_style(line) } else { "" };
        for (place, part) in wrap(line, width).iter().enumerate() {
            if place > 0 {
                whole.push_str(&" ".repeat(hanging_indent(line)));
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

/// Returns true if the line starts with `with` after its leading blanks.
fn starts_with_text(line: &str, with: &str) -> bool {
    line.trim_start().starts_with(with)
}

/// Returns true if the line is a numbered sentence.
fn is_numbered(line: &str) -> bool {
    line.split_once(". ")
        .is_some_and(|(number, _)| !number.is_empty() && number.bytes().all(|b| b.is_ascii_digit()))
}

/// Returns the colour code of a line, or an empty text for the default colour.
fn line_style(line: &str) -> &'static str {
    match line {
        line if line.starts_with("log:") || starts_with_text(line, "- ") => YELLOW,
        line if line.starts_with("written:") => DIM,
        line if is_numbered(line) && !line.starts_with("1.") => "",
        line if is_numbered(line) => BOLD,
        line if line.contains(['═', '─']) => DIM,
        line if line.ends_with(':') => CYAN,
        _ => "",
    }
}

/// Returns the indent of the second and following parts of a wrapped line, in columns.
fn hanging_indent(line: &str) -> usize {
    let blanks = line.len() - line.trim_start().len();
    let bullet = if is_numbered(line) {
        line.find(". ").map_or(0, |at| at + 2)
    } else if starts_with_text(line, "- ") {
        2
    } else {
        0
    };
    blanks + bullet
}

/// Splits a line at blanks into parts of at most `width` columns; a single longer word stays whole. Table rows are not
/// split.
fn wrap(line: &str, width: usize) -> Vec<String> {
    let is_table = line.contains(['═', '─']) || line.trim_start().contains("   ");
    if line.chars().count() <= width || is_table {
        return vec![line.to_owned()];
    }
    let (indent, mut parts) = (hanging_indent(line), vec![String::new()]);
    let blanks = line.len() - line.trim_start().len();
    parts[0].push_str(&line[..blanks]);
    for word in line.split_whitespace() {
        let at = parts.len() - 1;
        let room = if at == 0 { width } else { width.saturating_sub(indent) };
        let is_empty = parts[at].trim_start().is_empty();
        let is_too_long =
            parts[at].chars().count() + usize::from(!is_empty) + word.chars().count() > room;
        if is_too_long && !is_empty {
            parts.push(word.to_owned());
        } else {
            if !is_empty {
                parts[at].push(' ');
            }
            parts[at].push_str(word);
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
    fn format_for_terminal_with_colour_marks_each_line() {
        let coloured = format_for_terminal(TEXT, 80, true);
        assert!(
            coloured.starts_with(YELLOW) && coloured.contains(&format!("{BOLD}1. ")),
            "{coloured}"
        );
        assert_eq!(coloured.matches(RESET).count(), coloured.lines().count());
    }
}
