//! Damages files at random: their bytes, the tokens and values of their JSON, and their headers.

use std::ops::Range;

use super::files::Parts;
use testbed::testing::support::Rng;

/// Numbers that a file should not hold at most places.
const NUMBERS: [&str; 24] = [
    "0",
    "-0",
    "-1",
    "1",
    "2",
    "3",
    "4",
    "7",
    "16",
    "255",
    "256",
    "65535",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "18446744073709551615",
    "18446744073709551616",
    "1e38",
    "1e39",
    "-1e39",
    "1e999",
    "1e-40",
    "0.5",
    "5126",
];

/// Strings that break what reads them without care.
const STRINGS: [&str; 22] = [
    "",
    "\u{e9}",
    "\\ud800",
    "\\u0000",
    "_",
    "POSITION",
    "COLOR_",
    "TEXCOORD_99999999999",
    "JOINTS_\u{e9}",
    "data:",
    "data:;base64,",
    "data:;base64,AAAA",
    "data:;base64,A",
    "../small.bin",
    "%2e%2e/a",
    "%",
    "/etc/passwd",
    "weights",
    "orthographic",
    "directional",
    "CUBICSPLINE",
    "\\\"\\\\",
];

/// Values that take the place of any other.
const VALUES: [&str; 10] =
    ["null", "true", "false", "[]", "{}", "[[]]", "[0]", "{\"a\":0}", "[0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0,0]", "\"\""];

fn pick<'a, T: ?Sized>(rng: &mut Rng, list: &[&'a T]) -> &'a T {
    list[rng.below(list.len())]
}

/// A damaged file: one of `files` after one to five mutations, half of the time after one. Bytes of
/// the others are spliced in.
pub fn mutant(files: &[Parts], rng: &mut Rng) -> Vec<u8> {
    let mut file = files[rng.below(files.len())].clone();
    let mut of_bytes = 0;
    for _ in 0..1 + rng.bits().trailing_ones().min(4) {
        match rng.below(8) {
            0 => of_bytes += 1,
            1 => damage(&mut file.bin, files, rng),
            _ => mutate_json(&mut file.json, rng),
        }
    }
    let mut bytes = file.to_bytes();
    (0..of_bytes).for_each(|_| damage(&mut bytes, files, rng));
    bytes
}

/// Changes bytes anywhere, headers included.
fn damage(bytes: &mut Vec<u8>, files: &[Parts], rng: &mut Rng) {
    if bytes.is_empty() {
        return;
    }
    let at = rng.below(bytes.len());
    match rng.below(7) {
        0 => bytes[at] ^= 1 << rng.below(8),
        1 => bytes[at] = rng.bits() as u8,
        2 => bytes.truncate(at),
        3 => {
            let end = (at + 1 + rng.below(64)).min(bytes.len());
            drop(bytes.drain(at..end));
        }
        4 => {
            // Lengths in headers, or four bytes anywhere.
            let at = if rng.below(2) == 0 { 4 * rng.below(5) } else { at };
            let number = [0, 1, 11, 12, 19, 20, bytes.len() as u32, 0x7fff_ffff, u32::MAX - 3, u32::MAX][rng.below(10)];
            if let Some(place) = bytes.get_mut(at..at + 4) {
                place.copy_from_slice(&number.to_le_bytes());
            }
        }
        5 => {
            let from = range(bytes.len(), rng);
            let part = bytes[from].to_vec();
            bytes.splice(at..at, part);
        }
        _ => {
            let other = files[rng.below(files.len())].to_bytes();
            let from = range(other.len(), rng);
            let end = (at + from.len()).min(bytes.len());
            bytes.splice(at..end, other[from].iter().copied());
        }
    }
}

/// A random range of up to 256 bytes.
fn range(length: usize, rng: &mut Rng) -> Range<usize> {
    if length == 0 {
        return 0..0;
    }
    let start = rng.below(length);
    start..(start + 1 + rng.below(256)).min(length)
}

/// Changes one token or value of a JSON text. A text that earlier mutations broke stays as it is or
/// breaks more.
fn mutate_json(json: &mut Vec<u8>, rng: &mut Rng) {
    let tokens = tokens(json);
    if tokens.is_empty() {
        return;
    }
    let of_kind = |matches: fn(u8) -> bool| -> Vec<usize> {
        (0..tokens.len()).filter(|token| matches(json[tokens[*token].start])).collect()
    };
    let is_number = |byte: u8| byte == b'-' || byte.is_ascii_digit();
    let any = rng.below(tokens.len());
    let (at, text): (Range<usize>, Vec<u8>) = match rng.below(10) {
        // A number, by an extreme or by another number of the file.
        0..=3 => {
            let numbers = of_kind(is_number);
            if numbers.is_empty() {
                return;
            }
            let at = tokens[numbers[rng.below(numbers.len())]].clone();
            if rng.below(3) == 0 {
                let other = tokens[numbers[rng.below(numbers.len())]].clone();
                (at, json[other].to_vec())
            } else {
                (at, pick(rng, &NUMBERS).as_bytes().to_vec())
            }
        }
        // A string or a name, in the same way.
        4 | 5 => {
            let strings = of_kind(|byte| byte == b'"');
            if strings.is_empty() {
                return;
            }
            let at = tokens[strings[rng.below(strings.len())]].clone();
            if rng.below(3) > 0 {
                let other = tokens[strings[rng.below(strings.len())]].clone();
                (at, json[other].to_vec())
            } else {
                (at, format!("\"{}\"", pick(rng, &STRINGS)).into_bytes())
            }
        }
        // A whole value, by another one of the file, by a list of itself, or by a fixed one.
        6 | 7 => {
            let at = value(json, &tokens, any);
            let text = match rng.below(4) {
                0 => pick(rng, &VALUES).as_bytes().to_vec(),
                1 => [b"[", &json[at.clone()], b"]"].concat(),
                _ => {
                    let other = rng.below(tokens.len());
                    json[value(json, &tokens, other)].to_vec()
                }
            };
            (at, text)
        }
        // A value once more, or not at all, with one of the commas beside it.
        8 => {
            let at = value(json, &tokens, any);
            if rng.below(2) == 0 {
                let text = [&json[at.clone()], b",", &json[at.clone()]].concat();
                (at, text)
            } else {
                let name = any.checked_sub(2).filter(|name| json[tokens[*name].start] == b'"');
                let start = name
                    .filter(|name| json[tokens[name + 1].start] == b':')
                    .map_or(at.start, |name| tokens[name].start);
                let end = if json.get(at.end) == Some(&b',') { at.end + 1 } else { at.end };
                (start..end, Vec::new())
            }
        }
        // Any token by any other.
        _ => (tokens[any].clone(), json[tokens[rng.below(tokens.len())].clone()].to_vec()),
    };
    // Texts that double with each mutation would be slow, and find nothing more.
    if json.len() + text.len() < 1 << 17 {
        json.splice(at, text);
    }
}

/// The places of the tokens: strings with their quotes, brackets, colons and commas, and words
/// without them.
fn tokens(json: &[u8]) -> Vec<Range<usize>> {
    let mut tokens = Vec::new();
    let mut at = 0;
    while at < json.len() {
        let rest = &json[at + 1..];
        let length = match json[at] {
            b'"' => {
                let mut escaped = false;
                let end = rest.iter().position(|&byte| {
                    let is_end = byte == b'"' && !escaped;
                    escaped = byte == b'\\' && !escaped;
                    is_end
                });
                end.map_or(json.len() - at, |end| end + 2)
            }
            b'{' | b'}' | b'[' | b']' | b':' | b',' => 1,
            byte if byte.is_ascii_whitespace() => {
                at += 1;
                continue;
            }
            _ => {
                let is_end = |byte: &u8| b"{}[]:,\"".contains(byte) || byte.is_ascii_whitespace();
                1 + rest.iter().position(is_end).unwrap_or(rest.len())
            }
        };
        tokens.push(at..at + length);
        at += length;
    }
    tokens
}

/// The place of the value that begins with a token: up to the bracket that closes it, or the token
/// alone.
fn value(json: &[u8], tokens: &[Range<usize>], first: usize) -> Range<usize> {
    let mut depth = 0;
    for token in &tokens[first..] {
        match json[token.start] {
            b'{' | b'[' => depth += 1,
            b'}' | b']' => depth -= 1,
            _ => {}
        }
        if depth <= 0 {
            return tokens[first].start..token.end;
        }
    }
    tokens[first].clone()
}
