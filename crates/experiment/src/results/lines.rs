//! The lines of a CSV table as text.

/// The cells of a line with their quotes.
fn raw_cells(line: &str) -> Vec<&str> {
    let (mut cells, mut start, mut quoted) = (Vec::new(), 0, false);
    for (place, letter) in line.char_indices() {
        match letter {
            '"' => quoted = !quoted,
            ',' if !quoted => {
                cells.push(&line[start..place]);
                start = place + 1;
            }
            _ => {}
        }
    }
    cells.push(&line[start..]);
    cells
}

/// The place of a column in a table with this head.
pub(crate) fn column(head: &str, name: &str) -> Option<usize> {
    raw_cells(head.trim_end()).iter().position(|cell| *cell == name)
}

/// A line without the cell at `column`.
pub(crate) fn without(line: &str, column: Option<usize>) -> String {
    let mut cells = raw_cells(line);
    if let Some(column) = column.filter(|column| *column < cells.len()) {
        cells.remove(column);
    }
    cells.join(",")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_in_quotes_is_one_cell() {
        assert_eq!(column("a,b,c\n", "c"), Some(2));
        assert_eq!(without("1,\"x, \"\"y\"\", z\",3", Some(1)), "1,3");
        assert_eq!(without("1,2", None), "1,2");
    }
}
