//! The help of every command: short, with its own options first, and with examples that its parser accepts.
#![cfg(feature = "cli")]

use clap::Command;

/// Most lines of a short help.
const MAX_LINES: usize = 40;

/// Calls a test with every command that has a help, and its path below `host-sim`.
fn each_command(test: &mut impl FnMut(&str, &mut Command)) {
    fn walk(path: &str, command: &mut Command, test: &mut impl FnMut(&str, &mut Command)) {
        // A command that this build lacks has no help.
        if command.is_disable_help_flag_set() {
            return;
        }
        test(path, command);
        for below in command.get_subcommands_mut().filter(|below| below.get_name() != "help") {
            let path = format!("{path} {}", below.get_name());
            walk(path.trim_start(), below, test);
        }
    }
    let mut all = host_sim::cli::command();
    all.build();
    walk("", &mut all, test);
}

/// Splits a line as a shell does, as far as examples need it: quotes, a redirection, and a comment at the end.
fn shell_words(line: &str) -> Vec<String> {
    let call = line.split(" # ").next().unwrap_or_default();
    let call = call.split(" > ").next().unwrap_or_default();
    let parts = call.split('\'').enumerate();
    let words = parts.flat_map(|(at, part)| match at % 2 {
        0 => part.split_whitespace().map(str::to_owned).collect(),
        _ => vec![part.to_owned()],
    });
    words.collect()
}

#[test]
fn short_help_of_every_command_has_at_most_forty_lines() {
    let mut count = 0;
    each_command(&mut |path, command| {
        let help = command.render_help().to_string();
        let lines = help.lines().count();
        assert!(lines <= MAX_LINES, "{path}: {lines} lines:\n{help}");
        count += 1;
    });
    assert!(count > 25, "{count} commands");
}

#[test]
fn help_of_every_command_begins_with_two_examples_that_its_parser_accepts() {
    each_command(&mut |path, command| {
        for help in [command.render_help(), command.render_long_help()] {
            let help = help.to_string();
            let mut lines = help.lines();
            assert_eq!(lines.next(), Some("Examples:"), "{path}");
            let examples: Vec<&str> = lines.take_while(|line| !line.trim().is_empty()).collect();
            assert_eq!(examples.len(), 2, "{path}:\n{help}");
            for example in examples {
                let words = shell_words(example);
                let named: Vec<&str> = words.iter().map(String::as_str).collect();
                let is_known = path.split_whitespace().all(|name| named.contains(&name));
                assert!(named[0] == "host-sim" && is_known, "{path}: {example}");
                let parsed = host_sim::cli::command().try_get_matches_from(&words);
                assert!(parsed.is_ok(), "{example}: {}", parsed.expect_err("an error"));
            }
        }
    });
}

#[test]
fn help_lists_own_options_before_shared_ones() {
    let shared =
        ["columns", "from", "where", "out", "json", "bus", "node-id", "rigid-body", "test"];
    each_command(&mut |path, command| {
        let options = command.get_arguments().filter(|argument| !argument.is_positional());
        let names: Vec<&str> = options.filter_map(clap::Arg::get_long).collect();
        let is_shared = |name: &&str| shared.contains(name);
        // `predict`, `fleet` and `sign` have an option `--out` of their own.
        let is_of_command = |name: &&&str| **name != "out" && **name != "json";
        let first_shared = names.iter().filter(is_of_command).position(is_shared);
        let after = names.iter().filter(is_of_command).skip(first_shared.unwrap_or(names.len()));
        let headed = |name: &str| {
            let found = command.get_arguments().find(|of| of.get_long() == Some(name));
            found.and_then(clap::Arg::get_help_heading).is_some()
                || ["help", "version"].contains(&name)
        };
        for name in after {
            assert!(headed(name), "{path}: --{name} stands among the shared options");
        }
    });
}

#[test]
fn help_of_predict_has_no_option_of_a_fit() {
    let all = host_sim::cli::command();
    let options = |name: &str| {
        let command = all.find_subcommand(name).expect("a command");
        let options = command.get_arguments().filter_map(clap::Arg::get_long);
        options.map(str::to_owned).collect::<Vec<_>>()
    };
    let predict = options("predict");
    for fit in ["test", "hold-out", "tail", "decimate", "rigid-body", "loss", "seed"] {
        assert!(options("identify").iter().any(|name| name == fit), "--{fit}");
        assert!(!predict.iter().any(|name| name == fit), "--{fit}");
    }
}

#[test]
fn help_of_simulate_lists_every_scenario() {
    let all = host_sim::cli::command();
    let mut simulate = all.find_subcommand("simulate").expect("a command").clone();
    let helps = [simulate.render_help(), simulate.render_long_help()].map(|help| help.to_string());
    let known = simulated_machines::SIMULATIONS.iter().map(|of| of.name);
    for scenario in known.chain(["damper", "joint-bench", "manipulator"]) {
        assert!(helps.iter().all(|help| help.contains(scenario)), "{scenario}");
    }
}
