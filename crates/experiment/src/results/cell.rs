//! The cells of a CSV table (RFC 4180).

use std::fmt::Write;

use seafix_log::quantities::Value;

/// Appends a cell; an unknown value is empty.
pub(super) fn write_cell(text: &mut String, cell: &Value) {
    // Writing to a string does not fail.
    let _ = match cell {
        Value::Text(word) => {
            quote(text, word);
            Ok(())
        }
        Value::Integer(Some(number)) => write!(text, "{number}"),
        // A real number has all its digits; a very small one has an exponent instead of many zeros.
        Value::Real(Some(x)) if *x != 0.0 && x.abs() < 1e-5 => write!(text, "{x:e}"),
        Value::Real(Some(x)) => write!(text, "{x}"),
        Value::Flag(Some(flag)) => write!(text, "{flag}"),
        _ => Ok(()),
    };
}

/// A CSV field, quoted if necessary. A spreadsheet does not read it as a formula.
pub(super) fn quote(text: &mut String, word: &str) {
    let formula = word.starts_with(['=', '+', '-', '@', '\t', '\r']);
    if formula || word.contains([',', '"', '\n', '\r']) {
        text.push('"');
        text.push_str(if formula { "'" } else { "" });
        text.push_str(&word.replace('"', "\"\""));
        text.push('"');
    } else {
        text.push_str(word);
    }
}
