//! The reference of the command line: the tables of `docs/commands.md`.

use clap::{Arg, Command};

/// The usage of every command below `program`, each under its heading.
pub(crate) fn markdown(program: &Command) -> String {
    let mut text = String::new();
    commands(program, program.get_name(), &mut text);
    text
}

fn commands(parent: &Command, name: &str, text: &mut String) {
    for command in parent.get_subcommands().filter(|command| command.get_name() != "help") {
        let name = format!("{name} {}", command.get_name());
        let about = command.get_about().map(ToString::to_string).unwrap_or_default();
        *text += &format!("\n### {name}\n\n{about}.\n");
        if command.get_arguments().next().is_some() {
            *text += "\n| argument | meaning |\n|---|---|\n";
        }
        let (positional, options): (Vec<&Arg>, Vec<&Arg>) =
            command.get_arguments().partition(|arg| arg.is_positional());
        for arg in positional.into_iter().chain(options) {
            *text += &format!("| `{}` | {} |\n", written(arg), meaning(arg));
        }
        commands(command, &name, text);
    }
}

/// An argument as it is written: `EXPERIMENT`, `--set KEY=VALUE`, `-r, --relation RELATION`.
fn written(arg: &Arg) -> String {
    let names = arg.get_value_names().unwrap_or_default().iter().map(ToString::to_string).collect::<Vec<_>>().join(" ");
    let value = if names.is_empty() { arg.get_id().to_string().to_uppercase() } else { names };
    let short = arg.get_short().map(|short| format!("-{short}"));
    let flags: Vec<String> = short.into_iter().chain(arg.get_long().map(|long| format!("--{long}"))).collect();
    match (flags.is_empty(), arg.get_action().takes_values()) {
        (true, _) => value,
        (false, true) => format!("{} {value}", flags.join(", ")),
        (false, false) => flags.join(", "),
    }
}

/// The help of an argument with its values and its default.
fn meaning(arg: &Arg) -> String {
    let help = arg.get_long_help().or(arg.get_help()).map(ToString::to_string).unwrap_or_default();
    let values: Vec<String> = arg.get_possible_values().iter().map(|value| format!("`{}`", value.get_name())).collect();
    let defaults: Vec<String> = arg.get_default_values().iter().map(|value| value.to_string_lossy().into()).collect();
    let mut text = help.replace('\n', " ").replace('|', "\\|");
    if !text.ends_with(['.', ']']) {
        text.push('.');
    }
    if arg.get_action().takes_values() && !values.is_empty() {
        text += &format!(" One of {}.", values.join(", "));
    }
    if arg.get_action().takes_values() && !defaults.is_empty() {
        text += &format!(" Default: {}.", defaults.join(" "));
    }
    text
}
