//! Formats of images that are recognised and not read, each with the command that converts a file.

/// The name of the format of `bytes` and the command that converts it; `None` for bytes of no known format.
pub(super) fn format(bytes: &[u8]) -> Option<(&'static str, &'static str)> {
    const MAGICK: &str = "convert it to PNG: `magick FILE FILE.png`";
    let found = match bytes {
        [b'R', b'I', b'F', b'F', _, _, _, _, b'W', b'E', b'B', b'P', ..] => {
            ("WebP", "convert it to PNG: `dwebp FILE.webp -o FILE.png`, or `magick FILE.webp FILE.png`")
        }
        // A file of the ISO base media format states its brand behind the box's length and `ftyp`.
        [_, _, _, _, b'f', b't', b'y', b'p', brand @ ..] => match brand.get(..4)? {
            b"avif" | b"avis" => {
                ("AVIF", "convert it to PNG: `avifdec FILE.avif FILE.png`, or `magick FILE.avif FILE.png`")
            }
            b"heic" | b"heix" | b"heim" | b"heis" | b"hevc" | b"hevx" | b"mif1" | b"msf1" => {
                ("HEIC", "convert it to PNG: `heif-convert FILE.heic FILE.png`, or `magick FILE.heic FILE.png`")
            }
            b"crx " => ("Canon's raw format", RAW),
            _ => ("a video", "extract its images: `ffmpeg -i FILE %06d.png`"),
        },
        [b'B', b'M', ..] if is_bitmap(bytes) => ("BMP", MAGICK),
        [b'G', b'I', b'F', b'8', ..] => ("GIF", "convert it to PNG: `magick FILE.gif FILE-%d.png`"),
        [0, 0, 0, 0x0C, b'j', b'P', b' ', b' ', ..] | [0xFF, 0x4F, 0xFF, 0x51, ..] => ("JPEG 2000", MAGICK),
        [0xFF, 0x0A, ..] | [0, 0, 0, 0x0C, b'J', b'X', b'L', b' ', ..] => {
            ("JPEG XL", "convert it to PNG: `djxl FILE.jxl FILE.png`")
        }
        [0x76, 0x2F, 0x31, 0x01, ..] => ("OpenEXR", MAGICK),
        [b'#', b'?', b'R', b'A', b'D', ..] | [b'#', b'?', b'R', b'G', b'B', b'E', ..] => ("Radiance HDR", MAGICK),
        [b'8', b'B', b'P', b'S', ..] => ("Photoshop's format", MAGICK),
        [b'F', b'U', b'J', b'I', ..] | [b'I', b'I', b'R', ..] | [b'I', b'I', b'U', ..] => {
            ("a raw format of a camera", RAW)
        }
        [b'%', b'P', b'D', b'F', ..] => ("PDF", MAGICK),
        [0x93, b'N', b'U', b'M', b'P', b'Y', ..] => {
            ("NumPy's array", "write images from it: `cv2.imwrite(\"FILE.png\", array)`")
        }
        [b'P', b'F' | b'f', b'\n' | b'\r' | b' ', ..] => {
            ("PFM, an image of real numbers", "scale it to 16 bits and write PNG")
        }
        _ if bytes.starts_with(b"version https://git-lfs") => {
            ("a pointer of Git LFS, without the image", "fetch the images: `git lfs pull`")
        }
        _ if bytes.trim_ascii_start().starts_with(b"<") => {
            ("a page of text in place of an image", "download the file again")
        }
        _ => return None,
    };
    Some(found)
}

/// The remedy for raw formats: linear samples of a mosaic, which only their own converters know.
const RAW: &str = "develop it: `dcraw_emu -T -6 FILE`, which writes TIFF with 16 bits";

/// Whether a header of BMP is plausible: its second field is the length of the file, its fourth an offset behind it.
fn is_bitmap(bytes: &[u8]) -> bool {
    let field = |at: usize| bytes.get(at..at + 4).map(|four| u32::from_le_bytes(four.try_into().expect("four bytes")));
    field(10).is_some_and(|begin| (26..4096).contains(&begin))
        && field(14).is_some_and(|size| (12..=124).contains(&size))
}
