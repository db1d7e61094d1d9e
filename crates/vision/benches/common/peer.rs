//! A peer: a Python interpreter with a peer's library, controlled through `peers.py`.

#![allow(clippy::print_stdout, reason = "a bench prints its results")]

use std::{
    io::{BufRead, BufReader, Write},
    path::Path,
    process::{Child, ChildStdin, ChildStdout, Command, Stdio},
};

use base64::{Engine, prelude::BASE64_STANDARD};
use seafix_vision::Image;
use serde_json::{Value, json};

/// The variable that names the interpreter with a recent OpenCV and scikit-image.
pub(crate) const OPENCV: &str = "SEAFIX_PEERS";
/// The variable that names the interpreter with opencv-contrib 3.4.2.
pub(crate) const SURF: &str = "SEAFIX_PEERS_SURF";

/// The malloc settings of glibc that keep large planes instead of returning them to the system.
///
/// Without them OpenCV's filters pay page faults for every image.
const MALLOC: [(&str, &str); 3] = [
    ("MALLOC_MMAP_THRESHOLD_", "1073741824"),
    ("MALLOC_TRIM_THRESHOLD_", "4294967296"),
    ("MALLOC_TOP_PAD_", "268435456"),
];

/// A running interpreter, which ends when its input is closed.
pub(crate) struct Peer {
    child: Child,
    requests: Option<ChildStdin>,
    answers: BufReader<ChildStdout>,
    /// The versions of its library and interpreter.
    pub(crate) version: String,
}

impl Peer {
    /// The interpreter that the environment variable names; `None`, with one printed line, if it is unavailable.
    pub(crate) fn from_env(variable: &str, skipped: &str) -> Option<Self> {
        match std::env::var(variable).map_err(|_| "not set".to_owned()).and_then(|python| Self::start(&python)) {
            Ok(peer) => Some(peer),
            Err(why) => {
                println!("skipped {skipped}: {variable}: {why}; see crates/vision/benches/README.md");
                None
            }
        }
    }

    fn start(python: &str) -> Result<Self, String> {
        let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("benches/peers.py");
        let mut command = Command::new(python);
        command.arg(script).envs(MALLOC).stdin(Stdio::piped()).stdout(Stdio::piped());
        let mut child = command.spawn().map_err(|error| format!("{python}: {error}"))?;
        let requests = child.stdin.take();
        let answers = BufReader::new(child.stdout.take().ok_or("no output")?);
        let mut peer = Self { child, requests, answers, version: String::new() };
        let versions = peer.try_ask(&json!({"do": "versions"}))?;
        let text = |key: &str| versions[key].as_str().unwrap_or("?").to_owned();
        peer.version = format!("OpenCV {}, CPython {}", text("opencv"), text("python"));
        Ok(peer)
    }

    fn try_ask(&mut self, request: &Value) -> Result<Value, String> {
        let mut requests = self.requests.as_ref().ok_or("closed")?;
        writeln!(requests, "{request}").map_err(|error| error.to_string())?;
        let mut line = String::new();
        self.answers.read_line(&mut line).map_err(|error| error.to_string())?;
        let answer: Value = serde_json::from_str(&line).map_err(|_| "it ended".to_owned())?;
        match answer["error"].as_str() {
            Some(error) => Err(error.to_owned()),
            None => Ok(answer),
        }
    }

    /// The peer's answer.
    ///
    /// # Panics
    /// If the peer reports an error.
    pub(crate) fn ask(&mut self, request: &Value) -> Value {
        self.try_ask(request).unwrap_or_else(|error| panic!("{}: {}; request {}", self.version, error, request["do"]))
    }

    /// Stores an image under a name in the peer, rounded to 8 bits.
    pub(crate) fn keep(&mut self, name: &str, image: &Image) {
        let array = array(&[image.height(), image.width()], "u1", &image.to_u8());
        self.ask(&json!({"do": "keep", "name": name, "array": array}));
    }

    /// Stores a table of numbers under a name in the peer.
    pub(crate) fn keep_table(&mut self, name: &str, rows: usize, values: &[f32]) {
        self.ask(&json!({"do": "keep", "name": name, "array": floats(&[rows, values.len() / rows], values)}));
    }

    /// A photograph of scikit-image's wheel.
    pub(crate) fn photograph(&mut self, name: &str) -> Image {
        self.image(&json!({"do": "photograph", "name": name}))
    }

    /// An image from a file.
    pub(crate) fn picture(&mut self, path: &str) -> Image {
        self.image(&json!({"do": "picture", "path": path}))
    }

    fn image(&mut self, request: &Value) -> Image {
        let answer = self.ask(request);
        let ([height, width], pixels) = (shape(&answer["image"]), bytes(&answer["image"]));
        let pixels = pixels.into_iter().map(f32::from).collect();
        Image::new(width, height, pixels).expect("width × height pixels")
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        self.requests = None;
        // The interpreter has nothing left to do, so its exit status does not matter.
        let _ = self.child.wait();
    }
}

fn array(shape: &[usize], kind: &str, bytes: &[u8]) -> Value {
    json!({"shape": shape, "type": kind, "data": BASE64_STANDARD.encode(bytes)})
}

/// An array of numbers in the format of `peers.py`.
pub(crate) fn floats(shape: &[usize], values: &[f32]) -> Value {
    array(shape, "f4", &values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<_>>())
}

/// The two dimensions of an array.
pub(crate) fn shape(array: &Value) -> [usize; 2] {
    [0, 1].map(|i| array["shape"][i].as_u64().unwrap_or(1) as usize)
}

/// Whether the elements are bytes.
pub(crate) fn is_bytes(array: &Value) -> bool {
    array["type"] == "u1"
}

/// The bytes of an array.
pub(crate) fn bytes(array: &Value) -> Vec<u8> {
    BASE64_STANDARD.decode(array["data"].as_str().unwrap_or_default()).expect("base64 from the peer")
}

/// The numbers of an array.
pub(crate) fn numbers(array: &Value) -> Vec<f32> {
    let word = |bytes: &[u8]| f32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]);
    bytes(array).chunks_exact(4).map(word).collect()
}
