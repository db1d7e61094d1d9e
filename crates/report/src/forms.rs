//! The forms of a report.

/// The selected forms of a report; figures and tables are always written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Forms {
    /// The page `report.html`.
    pub html: bool,
    /// The LaTeX source `report.tex`.
    pub latex: bool,
    /// The PDF `report.pdf`.
    pub pdf: bool,
    /// A small report for a repository.
    ///
    /// It has a page with small pictures, the main figure, and tables as CSV only.
    pub small: bool,
}

impl Forms {
    /// All forms in full size.
    pub const ALL: Self = Self { html: true, latex: true, pdf: true, small: false };
    /// The small report for a repository.
    pub const SMALL: Self = Self { html: true, latex: false, pdf: false, small: true };

    /// The words by which a page records its forms.
    pub(crate) fn words(self) -> String {
        let words = [(self.html, "html"), (self.latex, "latex"), (self.pdf, "pdf"), (self.small, "small")];
        words.iter().filter(|(is, _)| *is).map(|(_, word)| *word).collect::<Vec<_>>().join(" ")
    }

    /// The forms that a page records.
    pub(crate) fn of_words(text: &str) -> Self {
        let has = |word: &str| text.split(' ').any(|one| one == word);
        Self { html: has("html"), latex: has("latex"), pdf: has("pdf"), small: has("small") }
    }
}
