//! Reading of text files.

use std::{io::Read, path::Path};

use crate::{binary, fault::Fault};

/// The text of a file of at most 64 MiB: UTF-8, with an optional byte order mark and LF, CRLF or CR line ends.
///
/// # Errors
/// A file that is missing, too large, or not UTF-8.
pub fn read_text(path: &Path) -> Result<String, Fault> {
    read_long_text(path, 64 << 20)
}

/// The text of a file of at most `limit` bytes.
///
/// It serves files that programs write and that grow with a run.
///
/// # Errors
/// As [`read_text`].
pub fn read_long_text(path: &Path, limit: u64) -> Result<String, Fault> {
    let unreadable = |error: std::io::Error| {
        Fault::new(format!("cannot read ({error})"), path).remedy("check the path and its permissions")
    };
    let mut bytes = Vec::new();
    // The size is limited while reading: a device file reports no size and may have no end.
    let file = std::fs::File::open(path).map_err(unreadable)?;
    file.take(limit + 1).read_to_end(&mut bytes).map_err(unreadable)?;
    if bytes.len() as u64 > limit {
        return Err(Fault::new("text file too large", path)
            .value(format!("more than {limit} bytes"))
            .remedy(format!("at most {limit} bytes are read")));
    }
    let text = decoded(bytes, path)?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    // Old Macintosh programs end lines with CR alone; beside LF it is no line end.
    Ok(if text.contains('\n') { text.replace("\r\n", "\n") } else { text.replace('\r', "\n") })
}

/// The text of bytes in UTF-8, or in UTF-16 with the byte order mark that spreadsheets write.
fn decoded(bytes: Vec<u8>, path: &Path) -> Result<String, Fault> {
    if let Some((format, remedy)) = binary::format(&bytes) {
        return Err(Fault::new("not a text file", path).value(format).remedy(remedy));
    }
    let word: fn([u8; 2]) -> u16 = match bytes[..] {
        [0xFF, 0xFE, ..] => u16::from_le_bytes,
        [0xFE, 0xFF, ..] => u16::from_be_bytes,
        _ => {
            return String::from_utf8(bytes).map_err(|error| {
                let at = error.utf8_error().valid_up_to();
                // COLMAP's binary models have no signature.
                let is_model = path.extension().is_some_and(|end| end == "bin");
                let remedy = match is_model {
                    true => "a model of COLMAP is converted by `colmap model_converter --output_type TXT`",
                    false => "save the file as UTF-8",
                };
                Fault::new("not UTF-8", path).value(format!("byte {at}")).remedy(remedy)
            });
        }
    };
    let words = bytes.chunks_exact(2).map(|pair| word([pair[0], pair[1]]));
    let text: Option<String> = char::decode_utf16(words).map(Result::ok).collect();
    text.filter(|_| bytes.len().is_multiple_of(2)).ok_or_else(|| {
        Fault::new("not UTF-16", path).value(format!("{} bytes", bytes.len())).remedy("save the file as UTF-8")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_end_with_lf_crlf_or_cr() {
        let folder = tempfile::tempdir().unwrap();
        let read = |text: &str| {
            let file = folder.path().join("a.txt");
            std::fs::write(&file, text).unwrap();
            read_text(&file).unwrap()
        };
        for text in ["a\nb\n", "a\r\nb\r\n", "a\rb\r"] {
            assert_eq!(read(text), "a\nb\n", "{text:?}");
        }
        assert_eq!(read("a\rb\n"), "a\rb\n");
    }

    /// Fails if a spreadsheet is only "not UTF-8".
    #[test]
    fn binary_formats_state_what_to_give_instead() {
        let said = |bytes: &[u8]| decoded(bytes.to_vec(), Path::new("a.csv")).unwrap_err().to_string();
        let sheet = said(b"PK\x03\x04\x14\0\x06\0");
        assert_eq!(
            sheet,
            "not a text file in a.csv: a zip archive or a spreadsheet; unpack it, or save the sheet as CSV in UTF-8"
        );
        assert!(said(b"\x93NUMPY\x01\0").contains("numpy.savetxt"));
        assert!(said(b"MATLAB 5.0 MAT-file, Platform: GLNXA64").contains("a MAT-file"));
        assert!(said(b"version https://git-lfs.github.com/spec/v1\n").contains("git lfs pull"));
        assert!(said(b"\xE4,b\n").starts_with("not UTF-8"));
        let model = decoded(b"\x02\0\0\0\0\0\0\0\xFF".to_vec(), Path::new("images.bin")).unwrap_err().to_string();
        assert!(model.contains("colmap model_converter --output_type TXT"), "{model}");
    }

    #[test]
    fn text_of_a_spreadsheet_is_read_in_utf_16() {
        let words: Vec<u16> = "\u{feff}id;größe\r\n".encode_utf16().collect();
        for bytes in [
            words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>(),
            words.iter().flat_map(|word| word.to_be_bytes()).collect(),
        ] {
            let file = Path::new("a.csv");
            assert_eq!(decoded(bytes.clone(), file).unwrap(), "\u{feff}id;größe\r\n");
            assert!(
                decoded(bytes[..bytes.len() - 1].to_vec(), file).unwrap_err().to_string().starts_with("not UTF-16")
            );
        }
    }
}
