//! A result as a terminal shows it: lines broken between words, and colour where it helps.
//!
//! What a line is, its beginning tells: `1.` a sentence of an answer, `-` a thing to beware of, `log:` what is wrong
//! with the log, `written:` where the files are. Lines of tables and pictures stay as they are.

const BOLD: &str = "\x1b[1m";
const DIM: &str = "\x1b[2m";
const YELLOW: &str = "\x1b[33m";
const CYAN: &str = "\x1b[36m";
const PLAIN: &str = "\x1b[0m";

/// The text for a terminal so many columns wide.
pub fn laid_out(text: &str, width: usize, colour: bool) -> String {
    let mut whole = String::with_capacity(text.len() + 256);
    for line in text.lines() {
        let paint = if colour { paint(line) } else { "" };
        for (place, part) in broken(line, width).iter().enumerate() {
            if place > 0 {
                whole.push_str(&" ".repeat(hanging(line)));
            }
            match paint {
                "" => whole.push_str(part),
                paint => whole.extend([paint, part.as_str(), PLAIN]),
            }
            whole.push('\n');
        }
    }
    whole
}

/// How a line begins, without its blanks.
fn begins(line: &str, with: &str) -> bool {
    line.trim_start().starts_with(with)
}

/// Whether it is a numbered sentence.
fn is_numbered(line: &str) -> bool {
    line.split_once(". ")
        .is_some_and(|(number, _)| !number.is_empty() && number.bytes().all(|b| b.is_ascii_digit()))
}

fn paint(line: &str) -> &'static str {
    match line {
        line if line.starts_with("log:") || begins(line, "- ") => YELLOW,
        line if line.starts_with("written:") => DIM,
        line if is_numbered(line) && !line.starts_with("1.") => "",
        line if is_numbered(line) => BOLD,
        line if line.contains(['═', '─']) => DIM,
        line if line.ends_with(':') => CYAN,
        _ => "",
    }
}

/// How far the parts after the first are set in.
fn hanging(line: &str) -> usize {
    let blanks = line.len() - line.trim_start().len();
    let bullet = if is_numbered(line) {
        line.find(". ").map_or(0, |at| at + 2)
    } else if begins(line, "- ") {
        2
    } else {
        0
    };
    blanks + bullet
}

/// A line in parts of this many columns at most, broken at blanks; one word may be longer. Rows of tables, which
/// are as wide as they are, stay whole.
fn broken(line: &str, width: usize) -> Vec<String> {
    let is_table = line.contains(['═', '─']) || line.trim_start().contains("   ");
    if line.chars().count() <= width || is_table {
        return vec![line.to_owned()];
    }
    let (inset, mut parts) = (hanging(line), vec![String::new()]);
    let blanks = line.len() - line.trim_start().len();
    parts[0].push_str(&line[..blanks]);
    for word in line.split_whitespace() {
        let at = parts.len() - 1;
        let room = if at == 0 { width } else { width.saturating_sub(inset) };
        let own = parts[at].trim_start().is_empty();
        let long = parts[at].chars().count() + usize::from(!own) + word.chars().count() > room;
        if long && !own {
            parts.push(word.to_owned());
        } else {
            if !own {
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
    fn no_line_is_wider_than_the_terminal_and_no_word_is_lost() {
        for width in [40, 80, 120] {
            let laid_out = laid_out(TEXT, width, false);
            assert!(laid_out.lines().all(|line| line.chars().count() <= width), "{laid_out}");
            let words = |text: &str| text.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
            assert_eq!(words(&laid_out), words(TEXT));
        }
        assert!(
            laid_out(TEXT, 60, false).contains("\n   the logged"),
            "{}",
            laid_out(TEXT, 60, false)
        );
        let row =
            " lugre            0.3410     16.3 %      15.9 %     0.1602     -219690     1.1 s ";
        assert_eq!(laid_out(row, 60, true), format!("{row}\n"));
    }

    #[test]
    fn colour_says_what_a_line_is() {
        let painted = laid_out(TEXT, 80, true);
        assert!(
            painted.starts_with(YELLOW) && painted.contains(&format!("{BOLD}1. ")),
            "{painted}"
        );
        assert_eq!(painted.matches(PLAIN).count(), painted.lines().count());
    }
}
