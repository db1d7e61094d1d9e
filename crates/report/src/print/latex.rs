//! A report as LaTeX source for `article` with only `booktabs` and `graphicx`.

use std::fmt::Write;

use crate::{
    document::{Block, Cell, Document, Figure, Picture, Span, Table},
    print::unicode::harmless,
};

/// Maximum number of lines of a table on a page; longer tables are split.
const LINES: usize = 42;
/// Maximum number of characters in a line of a listing.
const SIGNS: usize = 96;

/// The LaTeX source, which refers to figures `figures/<id>.pdf` and pictures `<id>.jpg`.
pub(crate) fn latex(document: &Document) -> String {
    let mut out = String::from(PREAMBLE);
    // Writing to a string does not fail.
    let _ = write!(
        out,
        "\\title{{{}}}\n\\author{{Run \\texttt{{{}}}}}\n\\date{{}}\n\\begin{{document}}\n\\sloppy\n\\maketitle\n\
         \\begin{{center}}\\textit{{{}}}\\end{{center}}\n\n",
        escape(&document.title),
        breakable(&document.run),
        escape(&document.question),
    );
    for block in &document.front {
        out += &self::block(block);
    }
    out += "\\clearpage\n\\appendix\n";
    for section in &document.sections {
        let _ = write!(out, "\n\\section{{{}}}\n\n", escape(&section.title));
        for block in &section.blocks {
            out += &self::block(block);
        }
    }
    out + "\\end{document}\n"
}

const PREAMBLE: &str = r"% Made by seafix report. Compile with pdflatex, twice for the references.
\documentclass[a4paper,10pt]{article}
\usepackage{booktabs}
\usepackage{graphicx}
\addtolength{\hoffset}{-19mm}\addtolength{\textwidth}{49mm}
\addtolength{\voffset}{-20mm}\addtolength{\textheight}{40mm}
\setlength{\emergencystretch}{3em}\setlength{\abovecaptionskip}{6pt}\setlength{\belowcaptionskip}{6pt}
\newsavebox{\tablebox}
% A table as it is, or as narrow as the page where it is wider.
\newcommand{\fitted}[1]{\sbox{\tablebox}{#1}\ifdim\wd\tablebox>\textwidth\resizebox{\textwidth}{!}{\usebox{\tablebox}}\else\usebox{\tablebox}\fi}
";

fn block(block: &Block) -> String {
    match block {
        Block::Paragraph(text) => format!("{}\n\n", spans(text)),
        Block::Formula(text) => format!("\\begin{{center}}\n{}\n\\end{{center}}\n\n", spans(text)),
        Block::Terms(terms) => {
            let items = terms.iter().map(|(term, meaning)| format!("\\item[{}] {}\n", spans(term), spans(meaning)));
            format!("\\begin{{description}}\n{}\\end{{description}}\n\n", items.collect::<String>())
        }
        Block::Items(items) => {
            let items = items.iter().map(|item| format!("\\item {}\n", spans(item)));
            format!("\\begin{{itemize}}\n{}\\end{{itemize}}\n\n", items.collect::<String>())
        }
        Block::Table(table) => self::table(table),
        Block::Figure(figure) => self::figure(figure),
        Block::Picture(picture) => self::picture(picture),
        Block::Listing { title, text, .. } => listing(title, text),
    }
}

fn spans(text: &[Span]) -> String {
    text.iter()
        .map(|span| match span {
            Span::Plain(text) => escape(text),
            Span::Italic(text) => format!("\\textit{{{}}}", escape(text)),
            Span::Bold(text) => format!("\\textbf{{{}}}", escape(text)),
            Span::Code(text) => format!("\\texttt{{\\small {}}}", breakable(text)),
            Span::Sub(text) => format!("\\textsubscript{{{}}}", escape(text)),
            Span::Sup(text) => format!("\\textsuperscript{{{}}}", escape(text)),
            Span::Number(number) => escape(&number.text),
            Span::Best(number) => format!("\\textbf{{{}}}", escape(&number.text)),
        })
        .collect()
}

fn figure(figure: &Figure) -> String {
    let width = figure.drawing.size[0];
    format!(
        "\\begin{{figure}}[!htbp]\n\\centering\n\\includegraphics[width={width:.2}bp]{{figures/{}.pdf}}\n\\caption{{{}}}\n\\end{{figure}}\n\n",
        figure.id,
        spans(&figure.caption)
    )
}

fn picture(picture: &Picture) -> String {
    let width = if picture.size[0] < 1000 { "0.6\\textwidth" } else { "\\textwidth" };
    format!(
        "\\begin{{figure}}[!htbp]\n\\centering\n\\includegraphics[width={width}]{{{}.jpg}}\n\\caption{{{}}}\n\\end{{figure}}\n\n",
        picture.id,
        spans(&picture.caption)
    )
}

fn table(table: &Table) -> String {
    let prose = table.lines.iter().flat_map(|line| &line.cells).any(|cell| cell.prose);
    let lines = if prose { 12 } else { LINES };
    let mut out = String::new();
    for (part, lines) in table.lines.chunks(lines).enumerate() {
        let caption = if part == 0 { spans(&table.caption) } else { "(continued)".to_owned() };
        let again = if part == 0 { "" } else { "\\addtocounter{table}{-1}\n" };
        let _ = write!(out, "\\begin{{table}}[!htbp]\n\\centering\n{again}\\caption{{{caption}}}\n\\fitted{{\\small\n");
        let _ = writeln!(out, "\\begin{{tabular}}{{@{{}}{}@{{}}}}\n\\toprule", columns(table));
        for (row, heads) in table.heads.iter().enumerate() {
            if heads.iter().all(|head| head.text.is_empty()) {
                continue;
            }
            let (mut cells, mut rules, mut place) = (Vec::new(), String::new(), 1);
            for head in heads {
                if head.columns > 1 {
                    cells.push(format!("\\multicolumn{{{}}}{{c}}{{{}}}", head.columns, escape(&head.text)));
                    let _ = write!(rules, "\\cmidrule(lr){{{place}-{}}}", place + head.columns - 1);
                } else {
                    let side = if head.numbers { "r" } else { "l" };
                    cells.push(format!("\\multicolumn{{1}}{{{side}}}{{{}}}", escape(&head.text)));
                }
                place += head.columns;
            }
            let _ = writeln!(out, "{} \\\\{rules}", cells.join(" & "));
            if row + 1 == table.heads.len() {
                out += "\\midrule\n";
            }
        }
        for (index, line) in lines.iter().enumerate() {
            if line.rule && index > 0 {
                out += "\\addlinespace\n";
            }
            let cells: Vec<String> = line.cells.iter().map(cell).collect();
            let _ = writeln!(out, "{} \\\\", cells.join(" & "));
        }
        out += "\\bottomrule\n\\end{tabular}}\n\\end{table}\n\n";
    }
    out + "\\clearpage\n".repeat(usize::from(table.lines.len() > 4 * LINES)).as_str()
}

fn columns(table: &Table) -> String {
    let prose = |place: usize| table.lines.iter().any(|line| line.cells.get(place).is_some_and(|cell| cell.prose));
    let words: usize = (0..table.columns()).filter(|&place| !prose(place)).count();
    (0..table.columns())
        .map(|place| match (prose(place), table.numbers(place)) {
            (true, _) => format!("p{{{:.2}\\textwidth}}", if words > 1 { 0.64 } else { 0.74 }),
            (_, true) => "r".to_owned(),
            _ => "l".to_owned(),
        })
        .collect()
}

fn cell(cell: &Cell) -> String {
    let text = spans(&cell.text);
    if cell.prose { format!("{{\\raggedright {text}\\par}}") } else { text }
}

fn listing(title: &str, text: &str) -> String {
    let mut out = String::new();
    if !title.is_empty() {
        let _ = write!(out, "\\noindent\\texttt{{\\small {}}}\\nopagebreak\n\n", breakable(title));
    }
    out += "{\\footnotesize\\ttfamily\\parindent0pt\\raggedright\n";
    for line in text.lines() {
        let signs: Vec<char> = line.chars().collect();
        for piece in signs.chunks(SIGNS) {
            let piece: String = piece.iter().collect();
            let _ = writeln!(out, "{}\\par", escape(&piece).replace("  ", "~~"));
        }
        if signs.is_empty() {
            out += "\\strut\\par\n";
        }
    }
    out + "}\n\n"
}

/// A name with possible line breaks after its separators.
fn breakable(text: &str) -> String {
    let mut out = String::new();
    for c in text.chars() {
        out += &escape(&c.to_string());
        if matches!(c, '-' | '_' | '/' | '.' | '=' | ',') {
            out += "\\hspace{0pt}";
        }
    }
    out
}

/// A text with all special characters of LaTeX escaped.
pub(super) fn escape(text: &str) -> String {
    let mut out = String::new();
    for c in harmless(text).chars() {
        match c {
            '\\' => out += "\\textbackslash{}",
            '{' | '}' | '$' | '&' | '#' | '%' | '_' => {
                out.push('\\');
                out.push(c);
            }
            '^' => out += "\\textasciicircum{}",
            '~' => out += "\\textasciitilde{}",
            '<' => out += "\\ensuremath{<}",
            '>' => out += "\\ensuremath{>}",
            '|' => out += "\\ensuremath{|}",
            '"' => out += "\\textquotedbl{}",
            // An empty group prevents ligatures of hyphens and quotes.
            '-' => out += "-{}",
            '\'' => out += "'{}",
            '`' => out += "`{}",
            '\n' | '\t' => out.push(' '),
            ' '..='~' => out.push(c),
            c => out += symbol(c),
        }
    }
    // The encoding OT1 has no straight double quote.
    out.replace("\\textquotedbl{}", "''{}")
}

/// The LaTeX command for a character beyond ASCII that pdflatex's fonts contain; `?` for others.
fn symbol(c: char) -> &'static str {
    match c {
        '\u{a0}' | '\u{2009}' | '\u{202f}' => "~",
        '–' => "--",
        '—' => "---",
        '−' => "\\ensuremath{-}",
        '’' => "'",
        '‘' => "`",
        '“' => "``",
        '”' => "''",
        '…' => "\\ldots{}",
        '·' | '⋅' => "\\ensuremath{\\cdot}",
        '×' => "\\ensuremath{\\times}",
        '±' => "\\ensuremath{\\pm}",
        '°' => "\\ensuremath{^\\circ}",
        '²' => "\\ensuremath{^2}",
        '³' => "\\ensuremath{^3}",
        '½' => "\\ensuremath{\\frac12}",
        '‖' => "\\ensuremath{\\|}",
        '√' => "\\ensuremath{\\surd}",
        '∞' => "\\ensuremath{\\infty}",
        '≤' => "\\ensuremath{\\leq}",
        '≥' => "\\ensuremath{\\geq}",
        '≈' => "\\ensuremath{\\approx}",
        '→' => "\\ensuremath{\\rightarrow}",
        'Σ' => "\\ensuremath{\\Sigma}",
        'Δ' => "\\ensuremath{\\Delta}",
        'α' => "\\ensuremath{\\alpha}",
        'σ' => "\\ensuremath{\\sigma}",
        'φ' => "\\ensuremath{\\varphi}",
        'ρ' => "\\ensuremath{\\rho}",
        'ξ' => "\\ensuremath{\\xi}",
        'χ' => "\\ensuremath{\\chi}",
        'µ' | 'μ' => "\\ensuremath{\\mu}",
        'ä' => "\\\"a",
        'ö' => "\\\"o",
        'ü' => "\\\"u",
        'Ä' => "\\\"A",
        'Ö' => "\\\"O",
        'Ü' => "\\\"U",
        'ß' => "\\ss{}",
        'é' => "\\'e",
        'è' => "\\`e",
        'ê' => "\\^e",
        'ë' => "\\\"e",
        'á' => "\\'a",
        'à' => "\\`a",
        'â' => "\\^a",
        'ã' => "\\~a",
        'å' => "\\aa{}",
        'ç' => "\\c{c}",
        'í' => "\\'i",
        'ñ' => "\\~n",
        'ó' => "\\'o",
        'ô' => "\\^o",
        'ø' => "\\o{}",
        'ú' => "\\'u",
        'š' => "\\v{s}",
        'ž' => "\\v{z}",
        'č' => "\\v{c}",
        'ć' => "\\'c",
        'ł' => "\\l{}",
        _ => "?",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nothing_is_left_of_a_command() {
        assert_eq!(escape("\\input{a_b}%"), "\\textbackslash{}input\\{a\\_b\\}\\%");
        assert_eq!(escape("50 % ~^$#&"), "50 \\% \\textasciitilde{}\\textasciicircum{}\\$\\#\\&");
        assert_eq!(escape("σ ≤ 漢\u{1b}"), "\\ensuremath{\\sigma} \\ensuremath{\\leq} ??");
    }
}
