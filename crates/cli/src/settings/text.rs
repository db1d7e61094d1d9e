//! Settings as commented TOML.

use seafix_component::{Form, Setting};

/// The width of a comment (characters).
const WIDTH: usize = 100;

/// The settings with their defaults as TOML, each below its sentence, unit and range.
pub(crate) fn text(settings: &[Setting]) -> String {
    settings.iter().map(one).collect()
}

fn one(setting: &Setting) -> String {
    let Setting { key, doc, form, default, .. } = setting;
    let mut text = format!("\n{}", comment(doc));
    if let Form::Words(words) = form {
        text += &words.iter().map(|(word, meaning)| comment(&format!("  {word}: {meaning}"))).collect::<String>();
    }
    if !matches!(form, Form::Words(_) | Form::Table(_)) {
        text += &comment(&limits(setting));
    }
    text + &match (form, default) {
        (Form::Table(_), _) => format!("# [{key}]\n"),
        (_, Some(value)) if !key.contains("[]") => format!("{key} = {}\n", inline(value)),
        (_, Some(value)) => format!("# {key} = {}\n", inline(value)),
        (_, None) => format!("# {key} = …\n"),
    }
}

/// The unit and the range of a setting.
pub(super) fn limits(setting: &Setting) -> String {
    let unit = match setting.unit {
        Some(unit) if !["", "1"].contains(&unit) => format!("Unit: {unit}. "),
        _ => String::new(),
    };
    format!("{unit}Range: {}.", setting.range.words)
}

/// A default in one line; a component without settings is its name.
pub(super) fn inline(value: &toml::Value) -> String {
    match value {
        toml::Value::Table(table) if table.len() == 1 => match table.get("name") {
            Some(name) => name.to_string(),
            None => value.to_string(),
        },
        value => value.to_string(),
    }
}

/// The lines of a comment.
fn comment(text: &str) -> String {
    let mut lines = vec![String::new()];
    let indent = &text[..text.len() - text.trim_start().len()];
    for word in text.split_whitespace() {
        let last = lines.last_mut().expect("one line at least");
        if last.is_empty() || last.chars().count() + word.chars().count() < WIDTH {
            *last += &format!("{}{word}", if last.is_empty() { indent } else { " " });
        } else {
            lines.push(format!("{indent}{word}"));
        }
    }
    lines.iter().map(|line| format!("# {line}\n")).collect()
}
