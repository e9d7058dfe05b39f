//! Examples of every command, which begin its help.

use clap::Command;

/// For each command its path below `host-sim` in brackets, which is empty for the program, and two calls. A call may end with a
/// shell comment.
const EXAMPLES: &str = include_str!("examples.txt");

/// Returns the calls of the command with this path.
fn examples_of(path: &str) -> Option<&'static str> {
    let mut blocks = EXAMPLES.split("\n\n").filter_map(|block| block.trim_end().split_once('\n'));
    blocks.find(|(name, _)| *name == format!("[{path}]")).map(|(_, calls)| calls)
}

/// Returns the command with its examples and those of its subcommands at the beginning of the help. `path` is the
/// command's path below `host-sim`.
pub fn with_examples(command: Command, path: &str) -> Command {
    let command = match examples_of(path) {
        Some(calls) => command.before_help(format!("Examples:\n  {}", calls.replace('\n', "\n  "))),
        None => command,
    };
    command.mut_subcommands(|below| {
        let name = below.get_name().to_owned();
        with_examples(below, format!("{path} {name}").trim_start())
    })
}
