//! A report as PDF: typeset on A4 in one column of 170 mm, with embedded fonts.

mod file;
mod paragraph;
mod sheet;
mod table;

use file::File;
use paragraph::{Align, Style, set};
use sheet::{BOTTOM, LEFT, Sheets, WIDTH};

use crate::{
    document::{Block, Document, Figure, Picture, Span, bold, italic},
    figure::Drawing,
    fonts::Font,
};

/// The font sizes of body text and small text (pt).
const BODY: f64 = 10.0;
const SMALL: f64 = 8.6;

/// The complete PDF of a report.
pub(crate) fn pdf(document: &Document) -> Vec<u8> {
    let mut paper = Paper { sheets: Sheets::new(), sections: 0, tables: 0, figures: 0 };
    paper.title(document);
    document.front.iter().for_each(|block| paper.block(block));
    paper.sheets.next();
    set(&mut paper.sheets, &[bold("Appendix")], plain(14.0, Align::Left));
    for section in &document.sections {
        let below = section.blocks.first().map_or(0.0, |block| paper.beginning(block));
        paper.heading(&section.title, below);
        section.blocks.iter().for_each(|block| paper.block(block));
    }
    paper.sheets.number();
    File::write(paper.sheets, &document.title, sheet::PAGE)
}

/// A single figure as PDF, on a page of its size.
pub(crate) fn figure_pdf(drawing: &Drawing) -> Vec<u8> {
    let mut sheets = Sheets::of(drawing.size);
    sheets.draw(drawing, 0.0);
    File::write(sheets, "", drawing.size)
}

/// The style of text over the full width.
fn plain(size: f64, align: Align) -> Style {
    Style { size, align, width: WIDTH, left: LEFT, font: Font::Regular }
}

/// The width and height of a picture on the page (pt).
fn pictured(picture: &Picture) -> [f64; 2] {
    let width = if picture.size[0] < 1000 { 0.62 * WIDTH } else { WIDTH };
    [width, width * f64::from(picture.size[1]) / f64::from(picture.size[0].max(1))]
}

struct Paper {
    sheets: Sheets,
    sections: usize,
    tables: usize,
    figures: usize,
}

impl Paper {
    fn title(&mut self, document: &Document) {
        self.sheets.space(18.0);
        set(&mut self.sheets, &[bold(&document.title[..])], plain(17.0, Align::Centre));
        self.sheets.space(3.0);
        set(&mut self.sheets, &["Run ".into(), Span::Code(document.run.clone())], plain(BODY, Align::Centre));
        self.sheets.space(12.0);
        let inner = Style { width: WIDTH - 56.0, left: LEFT + 28.0, ..plain(9.4, Align::Both) };
        set(&mut self.sheets, &[italic(&document.question[..])], Style { align: Align::Centre, ..inner });
        self.sheets.space(5.0);
    }

    /// The heading of a section, kept on one page with the beginning of its first block.
    fn heading(&mut self, title: &str, below: f64) {
        self.sections += 1;
        self.sheets.space(14.0);
        self.sheets.need(30.0 + below.max(30.0));
        let text = [bold(format!("{}   {title}", self.sections))];
        set(&mut self.sheets, &text, plain(12.5, Align::Left));
        self.sheets.space(4.0);
    }

    fn block(&mut self, block: &Block) {
        match block {
            Block::Paragraph(text) => {
                set(&mut self.sheets, text, plain(BODY, Align::Both));
                self.sheets.space(5.0);
            }
            Block::Formula(text) => {
                self.sheets.space(2.0);
                set(&mut self.sheets, text, plain(BODY, Align::Centre));
                self.sheets.space(7.0);
            }
            Block::Terms(terms) => {
                for (term, meaning) in terms {
                    let mut text = term.clone();
                    text.push(" – ".into());
                    text.extend(meaning.iter().cloned());
                    let style = Style { left: LEFT + 12.0, width: WIDTH - 12.0, ..plain(BODY, Align::Both) };
                    paragraph::set_hanging(&mut self.sheets, &text, style, 12.0);
                    self.sheets.space(3.0);
                }
                self.sheets.space(3.0);
            }
            Block::Items(items) => {
                for item in items {
                    let mut text = vec![Span::from("•  ")];
                    text.extend(item.iter().cloned());
                    let style = Style { left: LEFT + 12.0, width: WIDTH - 12.0, ..plain(BODY, Align::Both) };
                    paragraph::set_hanging(&mut self.sheets, &text, style, 9.0);
                    self.sheets.space(2.0);
                }
                self.sheets.space(4.0);
            }
            Block::Table(table) => {
                self.tables += 1;
                table::set(&mut self.sheets, table, self.tables);
            }
            Block::Figure(figure) => self.figure(figure),
            Block::Picture(picture) => self.picture(picture),
            Block::Listing { title, text, .. } => self.listing(title, text),
        }
    }

    fn caption(&mut self, text: &[Span]) {
        self.figures += 1;
        let mut caption = vec![bold(format!("Figure {}. ", self.figures))];
        caption.extend(text.iter().cloned());
        self.sheets.space(5.0);
        set(&mut self.sheets, &caption, plain(SMALL, Align::Both));
        self.sheets.space(12.0);
    }

    /// The height of a caption below its figure (pt).
    fn caption_height(&self, text: &[Span]) -> f64 {
        10.0 + 1.25 * SMALL * paragraph::lines(text, plain(SMALL, Align::Both)) as f64
    }

    /// The minimum height of a block on its first page (pt).
    fn beginning(&self, block: &Block) -> f64 {
        match block {
            Block::Table(table) => 8.0 + table::beginning(table),
            Block::Figure(figure) => 6.0 + figure.drawing.size[1] + self.caption_height(&figure.caption),
            Block::Picture(picture) => 6.0 + pictured(picture)[1] + self.caption_height(&picture.caption),
            _ => 0.0,
        }
    }

    fn figure(&mut self, figure: &Figure) {
        let [width, height] = figure.drawing.size;
        self.sheets.space(6.0);
        self.sheets.need(height + self.caption_height(&figure.caption));
        self.sheets.draw(&figure.drawing, LEFT + (WIDTH - width) / 2.0);
        self.caption(&figure.caption);
    }

    fn picture(&mut self, picture: &Picture) {
        let [width, height] = pictured(picture);
        self.sheets.space(6.0);
        self.sheets.need(height + self.caption_height(&picture.caption));
        self.sheets.picture(&picture.jpeg, picture.size, [LEFT + (WIDTH - width) / 2.0, width, height]);
        self.caption(&picture.caption);
    }

    fn listing(&mut self, title: &str, text: &str) {
        if !title.is_empty() {
            self.sheets.need(40.0);
            set(&mut self.sheets, &[Span::Code(title.to_owned())], plain(BODY, Align::Left));
            self.sheets.space(2.0);
        }
        let size = 7.0;
        let signs = (WIDTH / Font::Mono.width("0", size)) as usize;
        for line in text.lines() {
            let letters: Vec<char> = line.chars().collect();
            let mut pieces: Vec<String> = letters.chunks(signs).map(|piece| piece.iter().collect()).collect();
            if pieces.is_empty() {
                pieces.push(String::new());
            }
            for piece in pieces {
                self.sheets.need(size * 1.22);
                self.sheets.advance(size * 1.22);
                let y = self.sheets.y();
                self.sheets.words(Font::Mono, size, [LEFT, y + 1.6], &piece);
            }
        }
        self.sheets.space(8.0);
        debug_assert!(self.sheets.y() >= BOTTOM - 20.0);
    }
}
