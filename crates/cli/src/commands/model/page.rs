//! A page of pictures: proposals for marks, or the best views of a model's points.

use base64::{Engine, engine::general_purpose::STANDARD};
use seafix_data::{Picture, dataset::grey};
use seafix_log::encode_png;

/// A feature on the page.
pub(super) struct Entry<'a> {
    pub(super) id: &'a str,
    /// The lines below the name.
    pub(super) lines: Vec<String>,
    pub(super) pictures: Vec<&'a Picture>,
}

/// Enlargement of the pictures.
const ZOOM: f64 = 2.5;
/// Half length of a mark's cross (px of the image), with a gap around the feature.
const CROSS: f64 = 9.0;
/// The gap of the cross (px of the image).
const GAP: f64 = 3.0;
/// The error bars are enlarged, since they are hundredths of a pixel: three standard deviations, twenty times.
pub(super) const BAR: f64 = 60.0;

const STYLE: &str = "body{font:14px/1.4 system-ui,sans-serif;margin:1.5em;color:#222;background:#fff}\
figure{display:inline-block;vertical-align:top;margin:0 1em 1.5em 0}figcaption{font-size:12px;white-space:pre-line}\
h2{font-size:15px;margin:.2em 0}svg{display:inline-block;margin-right:4px;background:#000}";

/// The page as HTML without scripts or references to other files.
///
/// # Errors
/// A picture that cannot be encoded.
pub(super) fn page(title: &str, introduction: &str, entries: &[Entry<'_>]) -> Result<String, String> {
    let mut text = format!(
        "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\"><title>{0}</title><style>{STYLE}</style>\n<h1>{0}</h1>\n\
         <p>{1}</p>\n",
        escaped(title),
        escaped(introduction)
    );
    for entry in entries {
        text += &format!("<figure><h2>{}</h2>\n", escaped(entry.id));
        for picture in &entry.pictures {
            text += &drawing(picture)?;
        }
        text += &format!("<figcaption>{}</figcaption></figure>\n", escaped(&entry.lines.join("\n")));
    }
    Ok(text + "</html>\n")
}

/// A picture with a cross at the feature, and error bars where it has an uncertainty.
fn drawing(picture: &Picture) -> Result<String, String> {
    let bytes = encode_png(&grey(&picture.image))?;
    let (width, height) = (picture.image.width() as f64, picture.image.height() as f64);
    // The centre of the first pixel is at 0, 0.
    let (u, v) = (picture.place.u + 0.5, picture.place.v + 0.5);
    let line = |x1: f64, y1: f64, x2: f64, y2: f64, colour: &str| {
        format!("<path d=\"M{x1:.2} {y1:.2}L{x2:.2} {y2:.2}\" stroke=\"{colour}\" stroke-width=\".7\"/>")
    };
    let mut marks = String::new();
    for (du, dv) in [(1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0)] {
        marks += &line(u + GAP * du, v + GAP * dv, u + CROSS * du, v + CROSS * dv, "#ff3b30");
    }
    let [along, down] = picture.sigma.map(|sigma| BAR * sigma);
    if along > 0.0 || down > 0.0 {
        marks += &line(u - along, v, u + along, v, "#34c759");
        marks += &line(u, v - down, u, v + down, "#34c759");
    }
    Ok(format!(
        "<svg width=\"{:.0}\" height=\"{:.0}\" viewBox=\"0 0 {width} {height}\"><title>{} ns</title><image width=\"{width}\" \
         height=\"{height}\" href=\"data:image/png;base64,{}\"/>{marks}</svg>\n",
        width * ZOOM,
        height * ZOOM,
        picture.stamp_ns,
        STANDARD.encode(bytes)
    ))
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_page_has_no_reference_to_another_file_and_escapes_names() {
        let image = seafix_vision::Image::new(4, 3, vec![9.0; 12]).unwrap();
        let place = seafix_geometry::Pixel { u: 1.0, v: 2.0 };
        let picture = Picture { stamp_ns: 7, image, place, sigma: [0.01, 0.02] };
        let entry = Entry { id: "<P1>", lines: vec!["σ 0.4 mm".to_owned()], pictures: vec![&picture] };
        let text = page("valve", "views", &[entry]).unwrap();
        assert!(text.contains("&lt;P1&gt;") && text.contains("data:image/png;base64,") && text.contains("#34c759"));
        assert!(!text.contains("src=") && !text.contains("http"));
    }
}
