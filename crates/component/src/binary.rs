//! Binary formats that people give in place of text files.

/// The name of the format of `bytes` and what to give instead; `None` for text and for unknown bytes.
pub(crate) fn format(bytes: &[u8]) -> Option<(&'static str, &'static str)> {
    let found = match bytes {
        [b'P', b'K', 3 | 5 | 7, 4 | 6 | 8, ..] => {
            ("a zip archive or a spreadsheet", "unpack it, or save the sheet as CSV in UTF-8")
        }
        [0xD0, 0xCF, 0x11, 0xE0, ..] => ("an old spreadsheet or document (xls, doc)", "save the sheet as CSV in UTF-8"),
        [0x1F, 0x8B, ..] => ("a file compressed with gzip", "unpack it: `gunzip FILE`"),
        [0x28, 0xB5, 0x2F, 0xFD, ..] => ("a file compressed with zstd", "unpack it: `zstd -d FILE`"),
        [b'B', b'Z', b'h', ..] => ("a file compressed with bzip2", "unpack it: `bunzip2 FILE`"),
        [0xFD, b'7', b'z', b'X', b'Z', ..] => ("a file compressed with xz", "unpack it: `unxz FILE`"),
        [b'7', b'z', 0xBC, 0xAF, ..] => ("a 7z archive", "unpack it"),
        [0x93, b'N', b'U', b'M', b'P', b'Y', ..] => ("an array of NumPy", "write it as text: `numpy.savetxt`"),
        [0x89, b'H', b'D', b'F', ..] => ("an HDF5 file", "export the numbers as text"),
        [b'P', b'A', b'R', b'1', ..] => ("a Parquet table", "write it as CSV: `pandas.read_parquet(FILE).to_csv(…)`"),
        [0x80, 2..=5, ..] => ("a pickle of Python", "write its numbers as YAML, JSON or CSV"),
        _ if bytes.starts_with(b"MATLAB 5.0 MAT-file") => {
            ("a MAT-file", "export it as text: `jsonencode` or `writematrix`")
        }
        _ if bytes.starts_with(b"SQLite format 3") => ("an SQLite database", "export the numbers as text"),
        _ if bytes.starts_with(b"version https://git-lfs") => {
            ("a pointer of Git LFS, without the file", "fetch it: `git lfs pull`")
        }
        _ => return None,
    };
    Some(found)
}
