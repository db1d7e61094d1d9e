//! The fonts of reports and figures: subsets of Liberation, metrically equal to Times, Helvetica and Courier.

use std::sync::LazyLock;

use ttf_parser::{Face, GlyphId};

/// A font face.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(crate) enum Font {
    Regular,
    Italic,
    Bold,
    Mono,
    Sans,
}

/// A loaded font face.
pub(crate) struct Loaded {
    pub(crate) name: &'static str,
    pub(crate) bytes: &'static [u8],
    pub(crate) face: Face<'static>,
    em: f64,
}

impl Font {
    pub(crate) const ALL: [Self; 5] = [Self::Regular, Self::Italic, Self::Bold, Self::Mono, Self::Sans];

    /// The loaded face.
    pub(crate) fn loaded(self) -> &'static Loaded {
        static FACES: LazyLock<[Loaded; 5]> = LazyLock::new(|| Font::ALL.map(load));
        &FACES[self as usize]
    }

    /// The advance of `text` at this size (pt).
    pub(crate) fn width(self, text: &str, size: f64) -> f64 {
        let font = self.loaded();
        text.chars().map(|c| font.advance(font.glyph(c))).sum::<f64>() * size
    }
}

fn load(font: Font) -> Loaded {
    let (name, bytes): (&str, &[u8]) = match font {
        Font::Regular => ("SeafixSerif-Regular", include_bytes!("../fonts/seafix-serif-regular.ttf")),
        Font::Italic => ("SeafixSerif-Italic", include_bytes!("../fonts/seafix-serif-italic.ttf")),
        Font::Bold => ("SeafixSerif-Bold", include_bytes!("../fonts/seafix-serif-bold.ttf")),
        Font::Mono => ("SeafixMono-Regular", include_bytes!("../fonts/seafix-mono-regular.ttf")),
        Font::Sans => ("SeafixSans-Regular", include_bytes!("../fonts/seafix-sans-regular.ttf")),
    };
    let face = Face::parse(bytes, 0).expect("the embedded fonts are valid");
    let em = f64::from(face.units_per_em());
    Loaded { name, bytes, face, em }
}

impl Loaded {
    /// The glyph of a character, or of a question mark if the font lacks it.
    pub(crate) fn glyph(&self, c: char) -> u16 {
        let glyph = |c| self.face.glyph_index(c).map(|glyph| glyph.0);
        glyph(c).or_else(|| glyph('?')).unwrap_or(0)
    }

    /// The advance of a glyph (em).
    pub(crate) fn advance(&self, glyph: u16) -> f64 {
        f64::from(self.face.glyph_hor_advance(GlyphId(glyph)).unwrap_or(0)) / self.em
    }

    /// A length in font units, converted to thousandths of an em.
    pub(crate) fn thousandths(&self, units: i16) -> f32 {
        (f64::from(units) * 1000.0 / self.em) as f32
    }
}

/// The advance of a text in a figure (pt).
pub(crate) fn width_of(text: &str, size: f64) -> f64 {
    Font::Sans.width(text, size)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_sign_that_reports_use_is_there() {
        for font in [Font::Regular, Font::Sans] {
            for c in "aZ0 –−×·±°²‖χσΔφξΣ√∞≤≥≈’“”…½é".chars() {
                assert!(font.loaded().face.glyph_index(c).is_some(), "{font:?} lacks {c}");
            }
        }
        assert!((width_of("0", 10.0) - 5.56).abs() < 0.01, "Helvetica's digits are 0.556 em wide");
    }
}
