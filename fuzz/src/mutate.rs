//! Mutations of files.

/// A sequence of pseudo-random numbers (SplitMix64).
struct Dice(u64);

impl Dice {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut x = self.0;
        x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        x ^ (x >> 31)
    }

    /// A number below `end`; 0 for 0.
    fn below(&mut self, end: usize) -> usize {
        (self.next() % (end.max(1) as u64)) as usize
    }
}

/// Texts that readers of numbers, names and structures find hard.
const WORDS: [&str; 40] = [
    "inf",
    "-inf",
    "nan",
    "NaN",
    "1e308",
    "-1e308",
    "1e-308",
    "1e999",
    "0",
    "-0.0",
    "-1",
    "9223372036854775807",
    "18446744073709551615",
    "18446744073709551616",
    "1e9",
    "1000000000",
    "4294967296",
    "0.5",
    "1e-300",
    "null",
    "true",
    "[]",
    "{}",
    "[[",
    "]]",
    "\"",
    "'",
    "\n",
    "\n\n",
    ",",
    ";",
    "\t",
    "\u{feff}",
    "\u{0}",
    "é",
    "../x",
    "/etc/passwd",
    "&a [*a, *a]",
    "*a",
    "- - - -",
];

/// Numbers at the ends of their types.
const NUMBERS: [u64; 12] = [
    0,
    1,
    0x7F,
    0x80,
    0xFF,
    0x7FFF,
    0xFFFF,
    0x7FFF_FFFF,
    0xFFFF_FFFF,
    0x7FFF_FFFF_FFFF_FFFF,
    0xFFFF_FFFF_FFFF_FFFF,
    0x7FF0_0000_0000_0000,
];

/// A file of the corpus after one to eight changes that `seed` determines.
pub fn mutated(corpus: &[Vec<u8>], seed: u64) -> Vec<u8> {
    let mut dice = Dice(seed);
    let mut bytes = corpus[dice.below(corpus.len())].clone();
    // Mostly few changes: many are noticed at once.
    let changes = 1 + dice.below(8).min(dice.below(8));
    for _ in 0..changes {
        change(&mut bytes, corpus, &mut dice);
    }
    // Growth by repeated doubling says nothing about a parser.
    bytes.truncate(1 << 20);
    bytes
}

fn change(bytes: &mut Vec<u8>, corpus: &[Vec<u8>], dice: &mut Dice) {
    let at = dice.below(bytes.len());
    let length = dice.below(bytes.len() - at).min(1 + dice.below(64));
    let put = |bytes: &mut Vec<u8>, new: &[u8]| {
        let end = (at + new.len()).min(bytes.len());
        bytes[at..end].copy_from_slice(&new[..end - at]);
    };
    match dice.below(12) {
        0 if !bytes.is_empty() => bytes[at] ^= 1 << dice.below(8),
        1 if !bytes.is_empty() => bytes[at] = dice.next() as u8,
        2 => drop(bytes.drain(at..at + length)),
        3 => {
            let copy = bytes[at..at + length].to_vec();
            let to = dice.below(bytes.len());
            bytes.splice(to..to, copy);
        }
        4 => {
            let other = &corpus[dice.below(corpus.len())];
            let from = dice.below(other.len());
            let part = other[from..(from + 1 + dice.below(256)).min(other.len())].to_vec();
            bytes.splice(at..at + length, part);
        }
        5 => bytes.truncate(at),
        6 => put(bytes, &NUMBERS[dice.below(NUMBERS.len())].to_le_bytes()[..1 << dice.below(4)]),
        7 => put(bytes, &NUMBERS[dice.below(NUMBERS.len())].to_be_bytes()[8 - (1 << dice.below(4))..]),
        8 | 9 => word(bytes, at, dice),
        10 => lines(bytes, dice),
        _ => {
            let new = WORDS[dice.below(WORDS.len())].as_bytes();
            bytes.splice(at..at, new.iter().copied());
        }
    }
}

/// Replaces a word, which is mostly a number or a name.
fn word(bytes: &mut Vec<u8>, at: usize, dice: &mut Dice) {
    let inside = |byte: &u8| byte.is_ascii_alphanumeric() || b".-+_".contains(byte);
    let start = bytes[..at].iter().rposition(|byte| !inside(byte)).map_or(0, |place| place + 1);
    let end = bytes[at..].iter().position(|byte| !inside(byte)).map_or(bytes.len(), |length| at + length);
    let new = WORDS[dice.below(WORDS.len())].as_bytes();
    bytes.splice(start..end.max(start), new.iter().copied());
}

/// Removes, repeats or exchanges lines.
fn lines(bytes: &mut Vec<u8>, dice: &mut Dice) {
    let mut all: Vec<Vec<u8>> = bytes.split_inclusive(|byte| *byte == b'\n').map(<[u8]>::to_vec).collect();
    let (one, other) = (dice.below(all.len()), dice.below(all.len()));
    match dice.below(3) {
        0 if !all.is_empty() => drop(all.remove(one)),
        1 if !all.is_empty() => {
            let line = all[one].clone();
            all.insert(other, line);
        }
        _ if !all.is_empty() => all.swap(one, other),
        _ => {}
    }
    *bytes = all.concat();
}
