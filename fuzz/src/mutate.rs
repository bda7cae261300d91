//! The mutator: one to eight edits of a file of the corpus, all drawn from one seed.
//!
//! | edit | what it does |
//! |---|---|
//! | bit, byte | turned, overwritten |
//! | number | 1, 2, 4 or 8 bytes become 0, −1, the largest of their kind, the file's length, or nearly one of these |
//! | word | one of the format's words, or a number that breaks parsers, goes in or over what was there |
//! | cut, copy, repeat | a range goes, goes elsewhere, comes many times |
//! | end | the rest of the file goes |
//! | graft | a range of another file of the corpus comes in |

/// Longest input, bytes.
const LONGEST: usize = 1 << 18;
/// Numbers and marks that parsers stumble over.
const HOSTILE: [&str; 24] = [
    "1e999",
    "-1e999",
    "nan",
    "inf",
    "-1",
    "0",
    "1e-320",
    "9223372036854775808",
    "-9223372036854775809",
    "4294967296",
    "1000000000",
    "0x10",
    "1,5",
    "\u{feff}",
    "\0",
    "\"",
    "'",
    "\n",
    "\r\n",
    "\u{202e}",
    "é",
    "💩",
    "00000000000000000000000000000000001",
    "0.00000000000000000000000000000000000000001",
];

/// SplitMix64 (Steele, Lea & Flood 2014).
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn new(seed: u64) -> Self {
        Self(seed)
    }

    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let z = (self.0 ^ self.0 >> 30).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        let z = (z ^ z >> 27).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ z >> 31
    }

    /// Below `end`; 0 if that is 0.
    fn below(&mut self, end: usize) -> usize {
        (self.next() % end.max(1) as u64) as usize
    }

    /// A range of at most `longest` within `length`.
    fn range(&mut self, length: usize, longest: usize) -> std::ops::Range<usize> {
        let start = self.below(length + 1);
        start..start + self.below(longest.min(length - start) + 1)
    }

    fn pick<'a, T>(&mut self, all: &'a [T]) -> Option<&'a T> {
        all.get(self.below(all.len()))
    }
}

/// Makes damaged files.
pub(crate) struct Mutator {
    /// Words of the format.
    pub(crate) words: &'static [&'static str],
}

impl Mutator {
    pub(crate) fn mutate(&self, corpus: &[Vec<u8>], random: &mut Random) -> Vec<u8> {
        let mut bytes = random.pick(corpus).cloned().unwrap_or_default();
        for _ in 0..1 + random.below(8) {
            self.edit(&mut bytes, corpus, random);
            bytes.truncate(LONGEST);
        }
        bytes
    }

    fn edit(&self, bytes: &mut Vec<u8>, corpus: &[Vec<u8>], random: &mut Random) {
        let length = bytes.len();
        match random.below(12) {
            0 | 1 => {
                let (at, bit) = (random.below(length), random.below(8));
                if let Some(byte) = bytes.get_mut(at) {
                    *byte ^= 1 << bit;
                }
            }
            2 => {
                let (at, value) = (random.below(length), random.next() as u8);
                if let Some(byte) = bytes.get_mut(at) {
                    *byte = value;
                }
            }
            3 | 4 => number(bytes, random),
            5..=7 => {
                let word = if random.below(2) == 0 || self.words.is_empty() {
                    random.pick(&HOSTILE)
                } else {
                    random.pick(self.words)
                };
                let over = if random.below(2) == 0 { 0 } else { 12 };
                let range = random.range(length, over);
                bytes.splice(range, word.copied().unwrap_or_default().bytes());
            }
            8 => drop(bytes.drain(random.range(length, 64))),
            9 => {
                let piece = bytes[random.range(length, 256)].to_vec();
                let times = if random.below(4) == 0 {
                    1 + random.below(200)
                } else {
                    1
                };
                let at = random.below(length + 1);
                bytes.splice(at..at, piece.repeat(times));
            }
            10 => {
                if random.below(4) == 0 {
                    bytes.truncate(random.below(length));
                }
            }
            _ => {
                if let Some(other) = random.pick(corpus) {
                    let piece = other[random.range(other.len(), 512)].to_vec();
                    bytes.splice(random.range(length, 256), piece);
                }
            }
        }
    }
}

/// Overwrites a few bytes with a number that a header might claim.
fn number(bytes: &mut [u8], random: &mut Random) {
    let width = 1 << random.below(4);
    let at = random.below(bytes.len().saturating_sub(width) + 1);
    let near = random.below(5) as u64;
    let value = match random.below(7) {
        0 => 0,
        1 => u64::MAX,
        2 => u64::MAX >> 1 >> (64 - 8 * width),
        3 => bytes.len() as u64,
        4 => 1 << random.below(64),
        5 => random.next(),
        _ => near,
    };
    let value = value.wrapping_add(near).wrapping_sub(2).to_le_bytes();
    if let Some(place) = bytes.get_mut(at..at + width) {
        place.copy_from_slice(&value[..width]);
        if random.below(4) == 0 {
            place.reverse();
        }
    }
}
