//! Files that are compressed with Zstandard as a unit, as rosbag2's `--compression-mode file` and `zstd` write them.
//!
//! A recording is read in any order, a compressed file in one order only. Such a file is therefore unpacked into a
//! temporary file without a name, which ends with the program however that ends. Memory holds one block of the decoder.

use std::{
    fs::File,
    io::{self, BufReader, BufWriter, ErrorKind, Read, Seek as _, SeekFrom, Write as _},
    path::Path,
};

use zstd::stream::read::Decoder;

use crate::{chunk::limit, error::LogError};

/// The first bytes of a frame of Zstandard.
const FRAME: [u8; 4] = [0x28, 0xB5, 0x2F, 0xFD];

/// The maximum size of an unpacked file of `size` bytes.
///
/// Pixels of 8 bits have at least half a bit of noise, so images shrink to a sixteenth at most. The constant, that of
/// [`limit`], admits small files of repeated messages.
fn unpacked_limit(size: u64) -> u64 {
    size.saturating_mul(16).saturating_add(32 << 20)
}

/// An opened file with the bytes of an MCAP file.
#[derive(Debug)]
pub(crate) struct Unpacked {
    /// The file itself, or the temporary one; at its start.
    pub(crate) file: File,
    /// The size of `file` (bytes).
    pub(crate) size: u64,
    /// Whether `file` is a temporary one.
    pub(crate) temporary: bool,
    /// The cause why the end of a compressed file could not be unpacked.
    pub(crate) lost: Option<String>,
}

impl Unpacked {
    /// Opens the file at `path` and unpacks it if it is compressed.
    ///
    /// # Errors
    /// [`LogError`] when it cannot be read, when the temporary file cannot be written, and when it exceeds the limit.
    pub(crate) fn open(path: &Path) -> Result<Self, LogError> {
        let io = |doing, remedy| move |source| LogError::Io { doing, path: path.to_owned(), source, remedy };
        let read = io("read", "is the name right?");
        let mut file = File::open(path).map_err(read)?;
        let size = file.metadata().map_err(read)?.len();
        let mut start = Vec::new();
        Read::by_ref(&mut file).take(FRAME.len() as u64).read_to_end(&mut start).map_err(read)?;
        file.seek(SeekFrom::Start(0)).map_err(read)?;
        if start != FRAME {
            return Ok(Self { file, size, temporary: false, lost: None });
        }
        let unpack = io("unpack", "the folder for temporary files (TMPDIR) needs space for the whole recording");
        let mut output = BufWriter::new(tempfile::tempfile().map_err(unpack)?);
        let mut decoder = Decoder::new(BufReader::new(file)).map_err(read)?;
        let (mut block, mut size_out, allowed) = (vec![0; 1 << 17], 0, unpacked_limit(size));
        let lost = loop {
            let count = match decoder.read(&mut block) {
                Ok(0) => break None,
                Ok(count) => count,
                Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                // What was unpacked until here is as good as a file that was cut off.
                Err(error) => break Some(format!("zstd: {error}, behind {size_out} unpacked bytes")),
            };
            size_out += count as u64;
            if size_out > allowed {
                let what = format!(
                    "its {size} bytes unpack to more than {allowed}; if that is right, `zstd -d` it and give the .mcap file"
                );
                return Err(LogError::TooLarge { path: path.to_owned(), what });
            }
            output.write_all(&block[..count]).map_err(unpack)?;
        };
        let mut file = output.into_inner().map_err(io::IntoInnerError::into_error).map_err(unpack)?;
        file.seek(SeekFrom::Start(0)).map_err(unpack)?;
        Ok(Self { file, size: size_out, temporary: true, lost })
    }
}

/// The content of a message of a recording of `size` bytes: rosbag2's `--compression-mode message` compresses each.
///
/// CDR begins with a zero byte, so that the first bytes tell both apart.
///
/// # Errors
/// The cause, for a damaged message or one that exceeds the limit.
pub(crate) fn unpacked_message(bytes: Vec<u8>, size: u64) -> Result<Vec<u8>, String> {
    if !bytes.starts_with(&FRAME) {
        return Ok(bytes);
    }
    let allowed = limit(size);
    let mut content = Vec::new();
    let decoder = Decoder::new(&bytes[..]).map_err(|error| error.to_string())?;
    decoder.take(allowed as u64 + 1).read_to_end(&mut content).map_err(|error| format!("zstd: {error}"))?;
    if content.len() > allowed {
        Err(format!("a message that unpacks to more than {allowed} bytes"))
    } else {
        Ok(content)
    }
}
