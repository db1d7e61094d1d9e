//! The data structure of a report, independent of its printed form.

pub(crate) mod span;
mod table;

pub(crate) use span::{Span, Text, bold, code, italic, plain_text, sub, sup, text};
pub(crate) use table::{Cell, Head, Line, Table};

use crate::{answer::Answer, figure::Drawing};

/// A report.
#[derive(Debug)]
pub(crate) struct Document {
    pub(crate) title: String,
    /// The name of the run.
    pub(crate) run: String,
    pub(crate) question: String,
    /// The blocks of the first page: answer, main figure, small table, conclusion and limits.
    pub(crate) front: Vec<Block>,
    /// The sections of the appendix.
    pub(crate) sections: Vec<Section>,
    /// The written answer, which the page records; `None` for a generated one.
    pub(crate) answer: Option<Answer>,
}

/// A numbered section.
#[derive(Debug)]
pub(crate) struct Section {
    pub(crate) title: String,
    pub(crate) blocks: Vec<Block>,
}

/// A block of a section.
#[derive(Debug)]
pub(crate) enum Block {
    Paragraph(Text),
    /// A displayed formula.
    Formula(Text),
    /// Terms with their definitions.
    Terms(Vec<(Text, Text)>),
    Items(Vec<Text>),
    Table(Table),
    Figure(Figure),
    Picture(Picture),
    /// Preformatted text; `folded` hides it until it is opened.
    Listing {
        title: String,
        text: String,
        folded: bool,
    },
}

/// A figure with its plotted numbers.
#[derive(Debug)]
pub(crate) struct Figure {
    /// The stem of its file names.
    pub(crate) id: String,
    pub(crate) caption: Text,
    pub(crate) drawing: Drawing,
    /// The plotted numbers.
    pub(crate) data: Table,
}

/// The two images of a frame, side by side, with marks.
#[derive(Debug)]
pub(crate) struct Picture {
    /// The stem of its file name.
    pub(crate) id: String,
    pub(crate) caption: Text,
    /// The alternative text.
    pub(crate) alternative: String,
    pub(crate) jpeg: Vec<u8>,
    /// The width and height (px).
    pub(crate) size: [u32; 2],
}

impl Document {
    /// All tables in order, including the data of figures.
    pub(crate) fn tables(&self) -> impl Iterator<Item = &Table> {
        self.blocks().filter_map(|block| match block {
            Block::Table(table) => Some(table),
            Block::Figure(figure) => Some(&figure.data),
            _ => None,
        })
    }

    /// All figures.
    pub(crate) fn figures(&self) -> impl Iterator<Item = &Figure> {
        self.blocks().filter_map(|block| match block {
            Block::Figure(figure) => Some(figure),
            _ => None,
        })
    }

    /// All pictures.
    pub(crate) fn pictures(&self) -> impl Iterator<Item = &Picture> {
        self.blocks().filter_map(|block| match block {
            Block::Picture(picture) => Some(picture),
            _ => None,
        })
    }

    fn blocks(&self) -> impl Iterator<Item = &Block> {
        self.front.iter().chain(self.sections.iter().flat_map(|section| &section.blocks))
    }
}

impl Section {
    pub(crate) fn new(title: &str) -> Self {
        Self { title: title.to_owned(), blocks: Vec::new() }
    }

    pub(crate) fn add(&mut self, block: Block) {
        self.blocks.push(block);
    }

    pub(crate) fn say(&mut self, text: Text) {
        self.blocks.push(Block::Paragraph(text));
    }

    /// The section with further blocks.
    pub(crate) fn with(mut self, blocks: impl IntoIterator<Item = Block>) -> Self {
        self.blocks.extend(blocks);
        self
    }
}
