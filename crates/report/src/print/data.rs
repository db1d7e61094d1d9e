//! Tables as CSV and JSON, for further computation.

use serde_json::{Value, json};

use crate::{
    document::{Cell, Span, Table, plain_text},
    print::unicode::harmless,
};

/// A table as CSV, one line for every line of the table.
///
/// A number has all its digits and no unit.
pub(crate) fn csv(table: &Table) -> String {
    let mut out = line(table.names().iter().map(String::as_str));
    // An empty first cell repeats the one above.
    let mut above = String::new();
    for row in &table.lines {
        let mut cells: Vec<String> = Vec::new();
        for (place, cell) in row.cells.iter().enumerate() {
            let mut own = printed(cell);
            if place == 0 {
                if own.is_empty() {
                    own.clone_from(&above);
                }
                above.clone_from(&own);
            }
            cells.push(own);
        }
        out += &line(cells.iter().map(String::as_str));
    }
    out
}

/// A single number with all its digits; other cells as printed.
fn printed(cell: &Cell) -> String {
    match &cell.text[..] {
        [span] => match span.number() {
            Some(number) => number.value.map_or_else(String::new, |value| value.to_string()),
            None => cell.plain(),
        },
        // Several numbers are printed as text, with an ASCII minus.
        spans if spans.iter().any(|span| span.number().is_some()) => cell.plain().replace('\u{2212}', "-"),
        _ => cell.plain(),
    }
}

fn line<'a>(fields: impl Iterator<Item = &'a str>) -> String {
    fields.map(field).collect::<Vec<_>>().join(",") + "\n"
}

/// A CSV field, quoted if necessary.
///
/// It is guarded so that spreadsheets do not interpret a name as a formula.
pub(crate) fn field(text: &str) -> String {
    let text = harmless(text);
    let number = text.parse::<f64>().is_ok();
    let formula = !number && text.starts_with(['=', '+', '-', '@', '\t', '\r']);
    let text = if formula { format!("'{text}") } else { text };
    if formula || text.contains([',', '"', '\n', '\r']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text }
}

/// A table as JSON with keys: `{id, caption, columns, rows: [[{text, value, key} | text, …], …]}`.
pub(crate) fn json(table: &Table) -> String {
    let rows: Vec<Value> = table.lines.iter().map(|row| row.cells.iter().map(cell).collect()).collect();
    let value = json!({
        "id": table.id,
        "caption": plain_text(&table.caption),
        "columns": table.names(),
        "rows": rows,
    });
    serde_json::to_string_pretty(&value).expect("text and numbers are JSON") + "\n"
}

fn cell(cell: &Cell) -> Value {
    match &cell.text[..] {
        [span @ (Span::Number(number) | Span::Best(number))] => json!({
            "text": number.text,
            "value": number.value.filter(|value| value.is_finite()),
            "best": matches!(span, Span::Best(_)),
            "key": number.key.to_string(),
        }),
        text => Value::String(plain_text(text)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_name_becomes_a_formula() {
        assert_eq!(field("=cmd|'/c calc'!A1"), "\"'=cmd|'/c calc'!A1\"");
        assert_eq!(field("-3.5"), "-3.5");
        assert_eq!(field("-x"), "\"'-x\"");
        assert_eq!(field("a,\"b\""), "\"a,\"\"b\"\"\"");
        assert_eq!(field("\u{1b}[31mred"), "\u{fffd}[31mred");
    }
}
