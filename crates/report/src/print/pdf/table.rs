//! Tables with columns as wide as their content, split over several pages if long.

use crate::{
    document::{Head, Line, Span, Table, bold},
    fonts::Font,
    print::pdf::{
        SMALL,
        paragraph::{self, Align, LEADING, Style, natural, set_at},
        sheet::{LEFT, Sheets, WIDTH},
    },
};

/// The gap between columns, in units of the font size.
const GAP: f64 = 1.1;

/// The layout of the columns.
struct Grid {
    size: f64,
    /// The left edge and the width of each column (pt).
    columns: Vec<[f64; 2]>,
    left: f64,
    right: f64,
}

/// The style of captions.
const CAPTION: Style = Style { size: SMALL, align: Align::Both, width: WIDTH, left: LEFT, font: Font::Regular };

/// The minimum height of a table on its first page (pt): caption, heads and first line.
pub(super) fn beginning(table: &Table) -> f64 {
    needs(&Grid::of(table), table, &caption(table, 0))
}

fn needs(grid: &Grid, table: &Table, caption: &[Span]) -> f64 {
    let caption_height = paragraph::lines(caption, CAPTION) as f64 * SMALL * LEADING;
    let first = table.lines.first().map_or(0.0, |line| grid.height(table, line));
    caption_height + 4.0 + grid.head_height(table) + first + 20.0
}

fn caption(table: &Table, number: usize) -> Vec<Span> {
    [bold(format!("Table {number}. "))].into_iter().chain(table.caption.iter().cloned()).collect()
}

/// Sets a table with its caption above it.
pub(super) fn set(sheets: &mut Sheets, table: &Table, number: usize) {
    let grid = Grid::of(table);
    let caption = caption(table, number);
    sheets.space(8.0);
    sheets.need(needs(&grid, table, &caption));
    paragraph::set(sheets, &caption, CAPTION);
    sheets.space(3.0);
    grid.heads(sheets, table);
    for (index, line) in table.lines.iter().enumerate() {
        let height = grid.height(table, line);
        if sheets.need(height + 4.0) {
            grid.heads(sheets, table);
        } else if line.rule && index > 0 {
            sheets.advance(1.5);
            sheets.rule([grid.left, grid.right], sheets.y(), 0.25);
            sheets.advance(1.5);
        }
        let top = sheets.y();
        grid.line(sheets, table, line, top);
        sheets.advance(height);
    }
    sheets.advance(3.0);
    sheets.rule([grid.left, grid.right], sheets.y(), 0.9);
    sheets.space(14.0);
}

impl Grid {
    /// The layout with natural widths.
    ///
    /// A table that is too wide gets a smaller font, then narrower columns of prose.
    fn of(table: &Table) -> Self {
        let mut size = SMALL;
        loop {
            let widths: Vec<f64> = (0..table.columns()).map(|place| needed(table, place, size)).collect();
            let gaps = GAP * size * widths.len().saturating_sub(1) as f64;
            let all: f64 = widths.iter().sum::<f64>() + gaps;
            let prose: Vec<bool> = (0..table.columns()).map(|place| prose(table, place)).collect();
            if all <= WIDTH || prose.contains(&true) || size <= 4.6 {
                return Self::arranged(table, size, widths, &prose, all);
            }
            size -= 0.2;
        }
    }

    fn arranged(table: &Table, size: f64, mut widths: Vec<f64>, prose: &[bool], all: f64) -> Self {
        let over = all - WIDTH;
        if over > 0.0 {
            let long: f64 = widths.iter().zip(prose).filter(|(_, prose)| **prose).map(|(width, _)| width).sum();
            // Columns of prose shrink first; if the table is still too wide, all columns shrink.
            let (of_prose, of_all) = if long > over + 60.0 { (1.0 - over / long, 1.0) } else { (1.0, WIDTH / all) };
            for (width, prose) in widths.iter_mut().zip(prose) {
                *width *= if *prose { of_prose * of_all } else { of_all };
            }
        }
        let gap = GAP * size;
        let total = widths.iter().sum::<f64>() + gap * widths.len().saturating_sub(1) as f64;
        let left = LEFT + (WIDTH - total).max(0.0) / 2.0;
        let mut x = left;
        let columns = widths.iter().map(|width| {
            let column = [x, *width];
            x += width + gap;
            column
        });
        let columns = columns.collect();
        debug_assert_eq!(widths.len(), table.columns());
        Self { size, columns, left, right: left + total }
    }

    /// The left edge and the width of `count` columns from column `place`.
    fn span(&self, place: usize, count: usize) -> [f64; 2] {
        let (Some(first), Some(last)) = (self.columns.get(place), self.columns.get(place + count.max(1) - 1)) else {
            return [self.left, 0.0];
        };
        [first[0], last[0] + last[1] - first[0]]
    }

    fn style(&self, [left, width]: [f64; 2], align: Align, font: Font) -> Style {
        Style { size: self.size, align, left, width, font }
    }

    /// The style of a cell with its position.
    fn of_cell(&self, table: &Table, place: usize) -> Style {
        let align = if table.numbers(place) { Align::Right } else { Align::Left };
        self.style(self.span(place, 1), align, Font::Regular)
    }

    fn height(&self, table: &Table, line: &Line) -> f64 {
        let mut max = 1;
        for (place, cell) in line.cells.iter().enumerate().filter(|(_, cell)| cell.prose) {
            max = max.max(paragraph::lines(&cell.text, self.of_cell(table, place)));
        }
        max as f64 * self.size * LEADING
    }

    fn line(&self, sheets: &mut Sheets, table: &Table, line: &Line, top: f64) {
        for (place, cell) in line.cells.iter().enumerate() {
            let style = self.of_cell(table, place);
            // Cells other than prose stay on one line, even if rounding makes them slightly too wide.
            let style = match (cell.prose, style.align) {
                (true, _) => style,
                (_, Align::Right) => Style { left: style.left - 40.0, width: style.width + 40.0, ..style },
                _ => Style { width: style.width + 40.0, ..style },
            };
            set_at(sheets, &cell.text, style, top);
        }
    }

    fn shown<'a>(&self, table: &'a Table) -> impl Iterator<Item = &'a Vec<Head>> {
        table.heads.iter().filter(|heads| heads.iter().any(|head| !head.text.is_empty()))
    }

    fn head_height(&self, table: &Table) -> f64 {
        self.shown(table).count() as f64 * self.size * (LEADING + 0.35) + 6.0
    }

    fn heads(&self, sheets: &mut Sheets, table: &Table) {
        sheets.advance(2.0);
        sheets.rule([self.left, self.right], sheets.y(), 0.9);
        sheets.advance(2.0);
        let mut any = false;
        for heads in self.shown(table) {
            any = true;
            let top = sheets.y();
            let mut place = 0;
            for head in heads {
                let span = self.span(place, head.columns);
                let text = [Span::Italic(head.text.clone())];
                let align = match (head.columns, head.numbers) {
                    (1, true) => Align::Right,
                    (1, false) => Align::Left,
                    _ => Align::Centre,
                };
                let style = self.style(span, align, Font::Italic);
                let style = match align {
                    Align::Right => Style { left: style.left - 40.0, width: style.width + 40.0, ..style },
                    Align::Left => Style { width: style.width + 40.0, ..style },
                    _ => style,
                };
                set_at(sheets, &text, style, top);
                if head.columns > 1 && !head.text.is_empty() {
                    let y = top - self.size * (LEADING + 0.12);
                    sheets.rule([span[0], span[0] + span[1]], y, 0.35);
                }
                place += head.columns;
            }
            sheets.advance(self.size * (LEADING + 0.35));
        }
        if any {
            sheets.rule([self.left, self.right], sheets.y(), 0.5);
        }
        sheets.advance(2.5);
    }
}

fn prose(table: &Table, place: usize) -> bool {
    table.lines.iter().any(|line| line.cells.get(place).is_some_and(|cell| cell.prose))
}

/// The width of the widest cell or head of one column (pt).
fn needed(table: &Table, place: usize, size: f64) -> f64 {
    let style = Style { size, align: Align::Left, left: 0.0, width: f64::INFINITY, font: Font::Regular };
    let head = table.heads.last().and_then(|heads| heads.get(place)).map_or("", |head| &head.text[..]);
    let mut max = natural(&[Span::Italic(head.to_owned())], style);
    for cell in table.lines.iter().filter_map(|line| line.cells.get(place)) {
        max = max.max(natural(&cell.text, style));
    }
    max + 0.01
}
