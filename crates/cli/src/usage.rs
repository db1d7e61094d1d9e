//! Invalid command lines as one line, like every other fault.

use clap::{Error, error::ErrorKind};

/// Prints what is wrong with a command line and ends the program with 2; help and version are printed as they are.
pub(crate) fn usage_error(error: &Error) -> ! {
    match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand => {
            error.exit()
        }
        _ => {
            crate::terminal::notify(&one_line(&error.render().to_string()));
            std::process::exit(i32::from(crate::exit::USAGE))
        }
    }
}

/// The lines of clap's message before its usage, joined: the fault, its values, and its tips as remedy.
fn one_line(message: &str) -> String {
    let lines = message.lines().map(str::trim);
    let said = lines.take_while(|line| !line.starts_with("Usage:") && !line.starts_with("For more information"));
    let mut text = String::new();
    for line in said.filter(|line| !line.is_empty()) {
        match line.strip_prefix("tip: ") {
            Some(tip) => text += &format!("; {tip}"),
            None if text.is_empty() => text += line,
            None => text += &format!(" {line}"),
        }
    }
    format!("{text}; `--help` lists what is possible")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_and_tips_are_kept() {
        let missing = "error: the following required arguments were not provided:\n  --out <OUT>\n\nUsage: seafix x\n";
        assert_eq!(
            one_line(missing),
            "error: the following required arguments were not provided: --out <OUT>; `--help` lists what is possible"
        );
        let unknown =
            "error: unexpected argument '--ou' found\n\n  tip: a similar argument exists: '--out'\n\nUsage: x\n";
        assert_eq!(
            one_line(unknown),
            "error: unexpected argument '--ou' found; a similar argument exists: '--out'; `--help` lists what is possible"
        );
    }
}
