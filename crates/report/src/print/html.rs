//! A report as one self-contained HTML page: inline style, drawings and pictures, no scripts, no external resources.

use base64::{Engine, engine::general_purpose::STANDARD};
use maud::{DOCTYPE, Markup, PreEscaped, html as markup};

use crate::{
    document::{Block, Cell, Document, Figure, Picture, Span, Table},
    fonts::Font,
    forms::Forms,
    number::Number,
    print::{svg, unicode},
};

/// The name of the meta element that records the forms of a report.
pub(crate) const FORMS: &str = "seafix-forms";
/// The name of the meta element that records a written answer with its queries.
pub(crate) const ANSWER: &str = "seafix-answer";
/// The name of the meta elements that record the claims of a written answer.
pub(crate) const CLAIM: &str = "seafix-claim";

/// The complete page.
///
/// A small page names fonts of the same widths instead of embedding the font of its figures. The page records the forms
/// of the report, so that verification can detect a missing form. Names from the logs are escaped by the macro, or by
/// [`svg::escape`].
pub(crate) fn html(document: &Document, forms: Forms) -> String {
    let page = markup! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                meta name="generator" content={ "seafix-report " (env!("CARGO_PKG_VERSION")) };
                meta name=(FORMS) content=(forms.words());
                @if let Some(answer) = &document.answer {
                    meta name=(ANSWER) content=(answer.text());
                    @for claim in answer.claims() { meta name=(CLAIM) content=(claim); }
                }
                // An empty icon, because browsers otherwise request one from the server.
                link rel="icon" href="data:,";
                title { (plain(&document.title)) }
                style { (PreEscaped(include_str!("style.css"))) (PreEscaped(font(!forms.small))) (PreEscaped(svg::style())) }
            }
            body {
                header {
                    h1 { (plain(&document.title)) }
                    p.run { "Run " code { (plain(&document.run)) } }
                }
                main {
                    section.front {
                        p.question { (plain(&document.question)) }
                        @for block in &document.front { (self::block(block)) }
                    }
                    p.appendix { "Appendix" }
                    @for section in &document.sections {
                        h2 { (section.title) }
                        @for block in &section.blocks { (self::block(block)) }
                    }
                }
                footer { "Made by seafix-report " (env!("CARGO_PKG_VERSION")) " from the logs alone. Hover over a number to see its key; " code { "seafix report --verify" } " computes it again." }
            }
        }
    };
    page.into_string()
}

/// The style with the font of the figures, embedded or by name.
///
/// An embedded font gives text the measured width everywhere; a small page has names of fonts with the same widths.
fn font(embedded: bool) -> String {
    if !embedded {
        return "svg{font-family:\"Liberation Sans\",Arimo,Helvetica,Arial,sans-serif}".to_owned();
    }
    let face = STANDARD.encode(Font::Sans.loaded().bytes);
    format!(
        "@font-face{{font-family:\"Seafix Sans\";src:url(data:font/ttf;base64,{face}) format(\"truetype\")}}svg{{font-family:\"Seafix Sans\",sans-serif}}"
    )
}

fn block(block: &Block) -> Markup {
    markup! {
        @match block {
            Block::Paragraph(text) => { p { (spans(text)) } }
            Block::Formula(text) => { p.formula { (spans(text)) } }
            Block::Terms(terms) => { dl { @for (term, meaning) in terms { dt { (spans(term)) } dd { (spans(meaning)) } } } }
            Block::Items(items) => { ul { @for item in items { li { (spans(item)) } } } }
            Block::Table(table) => { (self::table(table)) }
            Block::Figure(figure) => { (self::figure(figure)) }
            Block::Picture(picture) => { (self::picture(picture)) }
            Block::Listing { title, text, folded } => {
                @if *folded {
                    details { summary { (plain(title)) } pre { (plain(text)) } }
                } @else {
                    @if !title.is_empty() { p { (plain(title)) } }
                    pre { (plain(text)) }
                }
            }
        }
    }
}

fn spans(text: &[Span]) -> Markup {
    markup! {
        @for span in text {
            @match span {
                Span::Plain(text) => { (plain(text)) }
                Span::Italic(text) => { i { (plain(text)) } }
                Span::Bold(text) => { b { (plain(text)) } }
                Span::Code(text) => { code { (plain(text)) } }
                Span::Sub(text) => { sub { (plain(text)) } }
                Span::Sup(text) => { sup { (plain(text)) } }
                Span::Number(number) => { (self::number(number)) }
                Span::Best(number) => { b { (self::number(number)) } }
            }
        }
    }
}

/// A number with its key as the tooltip.
fn number(number: &Number) -> Markup {
    let value = number.value.map_or_else(String::new, |value| value.to_string());
    markup! { data value=(value) title=(number.key.to_string()) { (number.text) } }
}

/// A text without invisible characters.
fn plain(text: &str) -> String {
    unicode::harmless(text)
}

fn table(table: &Table) -> Markup {
    let wide = wide(table);
    markup! {
        figure.table.wide[wide] id=(table.id) {
            figcaption { (spans(&table.caption)) }
            div.scroll {
                table {
                    @if table.heads.iter().flatten().any(|head| !head.text.is_empty()) {
                        thead {
                            @for (row, heads) in table.heads.iter().enumerate() {
                                tr {
                                    @for head in heads {
                                        @if head.columns > 1 {
                                            th.group colspan=(head.columns) { span { (plain(&head.text)) } }
                                        } @else {
                                            th.n[head.numbers] { (plain(&head.text)) }
                                        }
                                    }
                                    @if row + 1 < table.heads.len() && heads.is_empty() { th {} }
                                }
                            }
                        }
                    }
                    tbody {
                        @for line in &table.lines {
                            tr.break[line.rule] { (cells(table, &line.cells)) }
                        }
                    }
                }
            }
        }
    }
}

/// Whether a table is wider than the text.
fn wide(table: &Table) -> bool {
    table.columns() > 7
}

fn cells(table: &Table, cells: &[Cell]) -> Markup {
    // On a narrow screen every line of a wide table becomes a block, with the column name above each cell.
    let names = if wide(table) { table.names() } else { Vec::new() };
    markup! {
        @for (place, cell) in cells.iter().enumerate() {
            @let numbers = table.numbers(place);
            td.n[numbers].minor[cell.minor].text[cell.prose].word[!numbers && !cell.prose] data-of=[names.get(place)] {
                (spans(&cell.text))
            }
        }
    }
}

fn figure(figure: &Figure) -> Markup {
    let page = figure.drawing.size[0] > 300.0;
    markup! {
        figure.plot.page[page] id=(figure.id) {
            (PreEscaped(svg::inline(&figure.drawing, if figure.drawing.narrow.is_some() { "broad" } else { "" })))
            @if let Some(narrow) = &figure.drawing.narrow { (PreEscaped(svg::inline(narrow, "narrow"))) }
            figcaption { (spans(&figure.caption)) }
        }
    }
}

fn picture(picture: &Picture) -> Markup {
    let small = picture.size[0] < 1000;
    markup! {
        figure.image.wide[!small] id=(picture.id) {
            img src={ "data:image/jpeg;base64," (STANDARD.encode(&picture.jpeg)) } width=(picture.size[0]) height=(picture.size[1]) alt=(plain(&picture.alternative));
            figcaption { (spans(&picture.caption)) }
        }
    }
}
