//! A paper as data: what it says, apart from how it is printed.

mod span;
mod table;

pub(crate) use span::{Span, Text, bold, code, italic, plain_text, sub, sup, text};
pub(crate) use table::{Cell, Head, Line, Table};

use crate::figure::Drawing;

/// The whole paper.
#[derive(Debug)]
pub(crate) struct Document {
    pub(crate) title: String,
    /// The run's name.
    pub(crate) run: String,
    pub(crate) question: String,
    /// The question's answer in numbers.
    pub(crate) summary: Vec<Text>,
    pub(crate) sections: Vec<Section>,
}

/// One numbered part.
#[derive(Debug)]
pub(crate) struct Section {
    pub(crate) title: String,
    pub(crate) blocks: Vec<Block>,
}

/// One piece of a section.
#[derive(Debug)]
pub(crate) enum Block {
    Paragraph(Text),
    /// A formula by itself.
    Formula(Text),
    /// Terms and what they mean.
    Terms(Vec<(Text, Text)>),
    Items(Vec<Text>),
    Table(Table),
    Figure(Figure),
    Picture(Picture),
    /// Text as it is; `folded` where few will read it.
    Listing {
        title: String,
        text: String,
        folded: bool,
    },
}

/// A drawn figure, with the numbers it shows.
#[derive(Debug)]
pub(crate) struct Figure {
    /// The name of its files.
    pub(crate) id: String,
    pub(crate) caption: Text,
    pub(crate) drawing: Drawing,
    /// Every plotted number.
    pub(crate) data: Table,
}

/// Both images of a frame with marks.
#[derive(Debug)]
pub(crate) struct Picture {
    /// The name of its file.
    pub(crate) id: String,
    pub(crate) caption: Text,
    /// What those who cannot see it are told.
    pub(crate) alternative: String,
    pub(crate) jpeg: Vec<u8>,
    /// Columns and rows.
    pub(crate) size: [u32; 2],
}

impl Document {
    /// All tables, those behind the figures included, in order.
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
        self.sections.iter().flat_map(|section| &section.blocks)
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

    /// The same with further blocks.
    pub(crate) fn with(mut self, blocks: impl IntoIterator<Item = Block>) -> Self {
        self.blocks.extend(blocks);
        self
    }
}
