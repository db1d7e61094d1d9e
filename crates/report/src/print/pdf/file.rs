//! The PDF file: page tree, fonts and pictures.

use std::collections::BTreeMap;

use miniz_oxide::deflate::compress_to_vec_zlib;
use pdf_writer::{
    Chunk, Filter, Finish, Name, Pdf, Rect, Ref, Str, TextStr,
    types::{CidFontType, FontFlags, SystemInfo, UnicodeCmap},
};
use subsetter::{Profile, subset};

use crate::{fonts::Font, print::pdf::sheet::Sheets};

/// The compression level of streams, from 0 (none) to 10 (best).
const LEVEL: u8 = 8;

/// A PDF file under construction, with the next object number.
pub(super) struct File {
    pdf: Pdf,
    next: i32,
}

impl File {
    /// The PDF file of these pages, each of this size. It has no dates or random identifiers: equal pages, equal bytes.
    pub(super) fn write(sheets: Sheets, title: &str, size: [f64; 2]) -> Vec<u8> {
        let mut file = Self { pdf: Pdf::new(), next: 1 };
        let (catalog, tree, info) = (file.id(), file.id(), file.id());
        let fonts: Vec<(Font, Ref)> =
            sheets.glyphs.iter().map(|(font, glyphs)| (*font, file.font(*font, glyphs))).collect();
        let pictures: Vec<Ref> = sheets.pictures.iter().map(|(jpeg, size)| file.picture(jpeg, *size)).collect();
        let mut pages = Vec::new();
        for (content, shown) in sheets.pages.into_iter().zip(&sheets.shown) {
            let (page, stream) = (file.id(), file.id());
            pages.push(page);
            let bytes = compress_to_vec_zlib(content.finish().as_slice(), LEVEL);
            file.pdf.stream(stream, &bytes).filter(Filter::FlateDecode);
            let mut writer = file.pdf.page(page);
            writer.parent(tree).contents(stream).media_box(Rect::new(0.0, 0.0, size[0] as f32, size[1] as f32));
            let mut resources = writer.resources();
            let mut dict = resources.fonts();
            for (font, id) in &fonts {
                dict.pair(Name(format!("F{}", *font as usize).as_bytes()), id);
            }
            dict.finish();
            let mut dict = resources.x_objects();
            for &index in shown {
                dict.pair(Name(format!("P{index}").as_bytes()), pictures[index]);
            }
        }
        file.pdf.pages(tree).count(pages.len() as i32).kids(pages);
        file.pdf.catalog(catalog).pages(tree).lang(TextStr("en"));
        let mut about = file.pdf.document_info(info);
        about.producer(TextStr(concat!("seafix-report ", env!("CARGO_PKG_VERSION"))));
        if !title.is_empty() {
            about.title(TextStr(title));
        }
        about.finish();
        file.pdf.finish()
    }

    fn id(&mut self) -> Ref {
        self.next += 1;
        Ref::new(self.next - 1)
    }

    fn picture(&mut self, jpeg: &[u8], size: [u32; 2]) -> Ref {
        let id = self.id();
        let mut image = self.pdf.image_xobject(id, jpeg);
        image.filter(Filter::DctDecode);
        image.width(size[0] as i32).height(size[1] as i32).bits_per_component(8);
        image.color_space().device_rgb();
        id
    }

    /// Embeds the used glyphs under their original numbers, with a map to Unicode for search and copying.
    fn font(&mut self, font: Font, glyphs: &BTreeMap<u16, char>) -> Ref {
        let loaded = font.loaded();
        let numbers: Vec<u16> = std::iter::once(0).chain(glyphs.keys().copied()).collect();
        let bytes = subset(loaded.bytes, 0, Profile::pdf(&numbers)).unwrap_or_else(|_| loaded.bytes.to_vec());
        let [outer, inner, descriptor, stream, meaning] = std::array::from_fn(|_| self.id());
        let name = format!("SEAFIX+{}", loaded.name);
        let name = Name(name.as_bytes());
        let identity = SystemInfo { registry: Str(b"Adobe"), ordering: Str(b"Identity"), supplement: 0 };

        let mut writer = self.pdf.type0_font(outer);
        writer.base_font(name).encoding_predefined(Name(b"Identity-H")).descendant_font(inner).to_unicode(meaning);
        writer.finish();

        let mut writer = self.pdf.cid_font(inner);
        writer.subtype(CidFontType::Type2).base_font(name).system_info(identity).font_descriptor(descriptor);
        writer.default_width(0.0).cid_to_gid_map_predefined(Name(b"Identity"));
        let mut widths = writer.widths();
        for &glyph in &numbers {
            let width = (loaded.advance(glyph) * 1e5).round() / 100.0;
            widths.consecutive(glyph, [width as f32]);
        }
        widths.finish();
        writer.finish();

        let face = &loaded.face;
        let bounds = face.global_bounding_box();
        let italic = if font == Font::Italic { FontFlags::ITALIC } else { FontFlags::empty() };
        let bounds = [bounds.x_min, bounds.y_min, bounds.x_max, bounds.y_max].map(|edge| loaded.thousandths(edge));
        let mut writer = self.pdf.font_descriptor(descriptor);
        writer.name(name).flags(FontFlags::SYMBOLIC | italic).font_file2(stream);
        writer.bbox(Rect::new(bounds[0], bounds[1], bounds[2], bounds[3]));
        writer.italic_angle(if font == Font::Italic { -15.5 } else { 0.0 }).stem_v(80.0);
        writer.ascent(loaded.thousandths(face.ascender())).descent(loaded.thousandths(face.descender()));
        writer.cap_height(loaded.thousandths(face.capital_height().unwrap_or(face.ascender())));
        writer.finish();

        let packed = compress_to_vec_zlib(&bytes, LEVEL);
        let mut writer = self.pdf.stream(stream, &packed);
        writer.filter(Filter::FlateDecode).pair(Name(b"Length1"), bytes.len() as i32);
        writer.finish();

        let mut cmap = UnicodeCmap::<u16>::new(Name(b"Seafix"), identity);
        glyphs.iter().for_each(|(glyph, c)| cmap.pair(*glyph, *c));
        let packed = compress_to_vec_zlib(cmap.finish().as_slice(), LEVEL);
        Chunk::cmap(&mut self.pdf, meaning, &packed).filter(Filter::FlateDecode);
        outer
    }
}
