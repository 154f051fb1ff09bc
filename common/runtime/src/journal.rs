//! The format of a checkpoint: a state as a head and parts, of which only what changed is appended.
//!
//! Layout, all numbers little-endian:
//!
//! | what | how |
//! | --- | --- |
//! | preamble | 8 bytes `SMCHKPT3` or `SMSTATE3`, run u64, start u32, CRC-32 of the 20 bytes before |
//! | records | each: kind u32, length u32 of its content, CRC-32 of kind, length and content, content |
//! | a part (kind 2) | key 3 × i32, then its bytes |
//! | a head (kind 1) | its bytes |
//! | a numbered head (kind 3), in `SMSTATE3` | number u64, then its bytes |
//!
//! The parts before a head are valid with it: a later part replaces the one of its key, a later head the one before. What was
//! cut off behind the last head, by a kill in the middle of writing, never was.
//!
//! A small state without parts, `SMSTATE3`, is two numbered heads of one length, of which the one with the higher number counts and the other one is
//! overwritten next. A new file for each state, of which a driver has ten in a second, would be written to the disk each time.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, Write};
use std::os::unix::fs::FileExt;

const MAGIC: &[u8; 8] = b"SMCHKPT3";
const OVERWRITTEN: &[u8; 8] = b"SMSTATE3";
const PREAMBLE: usize = MAGIC.len() + 8 + 4 + 4;
const HEAD: u32 = 1;
const PART: u32 = 2;
const NUMBERED: u32 = 3;
/// Bytes of a record before its content.
const RECORD: usize = 12;
const KEY: usize = size_of::<PartKey>();

/// What names a part of a state, among all of it: the process says what the numbers mean.
pub type PartKey = [i32; 3];

/// What a checkpoint holds.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Contents<'a> {
    /// The number of the start in which it was begun.
    pub(crate) start: u32,
    pub(crate) head: &'a [u8],
    pub(crate) parts: BTreeMap<PartKey, &'a [u8]>,
    /// What is wrong behind the last head that counts, if it is more than that the end is missing.
    pub(crate) damage: Option<String>,
}

/// Begins a checkpoint that is appended to.
pub(crate) fn put_preamble(into: &mut impl Write, run: u64, start: u32) -> io::Result<()> {
    put_preamble_of(MAGIC, into, run, start)
}

/// Begins a checkpoint of numbered heads.
pub(crate) fn put_overwritten_preamble(into: &mut impl Write, run: u64, start: u32) -> io::Result<()> {
    put_preamble_of(OVERWRITTEN, into, run, start)
}

fn put_preamble_of(magic: &[u8; 8], into: &mut impl Write, run: u64, start: u32) -> io::Result<()> {
    let mut bytes = [0; PREAMBLE];
    bytes[..8].copy_from_slice(magic);
    bytes[8..16].copy_from_slice(&run.to_le_bytes());
    bytes[16..20].copy_from_slice(&start.to_le_bytes());
    let checksum = crc32fast::hash(&bytes[..20]);
    bytes[20..].copy_from_slice(&checksum.to_le_bytes());
    into.write_all(&bytes)
}

/// Appends a head: what was put before it counts from now on.
pub(crate) fn put_head(into: &mut impl Write, head: &[u8]) -> io::Result<()> {
    put_record(into, HEAD, &[], head)
}

/// A head that replaces the numbered ones with lower numbers, wherever they are.
pub(crate) fn numbered_head(number: u64, head: &[u8]) -> io::Result<Vec<u8>> {
    let mut record = Vec::with_capacity(RECORD + size_of::<u64>() + head.len());
    put_record(&mut record, NUMBERED, &number.to_le_bytes(), head)?;
    Ok(record)
}

/// Where the numbered head with this number is, with records of this length.
pub(crate) fn place_of(number: u64, length: u64) -> u64 {
    PREAMBLE as u64 + number % 2 * length
}

/// Whether a checkpoint has numbered heads, which are overwritten in place.
pub(crate) fn is_overwritten(file: &File) -> io::Result<bool> {
    let mut magic = [0; OVERWRITTEN.len()];
    match file.read_exact_at(&mut magic, 0) {
        Err(error) if error.kind() == io::ErrorKind::UnexpectedEof => Ok(false),
        read => read.map(|()| magic == *OVERWRITTEN),
    }
}

/// Appends a part.
pub(crate) fn put_part(into: &mut impl Write, key: PartKey, bytes: &[u8]) -> io::Result<()> {
    put_record(into, PART, key.map(i32::to_le_bytes).as_flattened(), bytes)
}

fn put_record(into: &mut impl Write, kind: u32, key: &[u8], bytes: &[u8]) -> io::Result<()> {
    let length = u32::try_from(key.len() + bytes.len()).map_err(|_| io::Error::other("4 GiB of state in one record"))?;
    into.write_all(&kind.to_le_bytes())?;
    into.write_all(&length.to_le_bytes())?;
    into.write_all(&checksum(kind, length, &[key, bytes]).to_le_bytes())?;
    into.write_all(key)?;
    into.write_all(bytes)
}

fn checksum(kind: u32, length: u32, content: &[&[u8]]) -> u32 {
    let mut hasher = crc32fast::Hasher::new();
    hasher.update(&kind.to_le_bytes());
    hasher.update(&length.to_le_bytes());
    content.iter().for_each(|bytes| hasher.update(bytes));
    hasher.finalize()
}

/// What a checkpoint of this run holds; or what is wrong with it as one.
pub(crate) fn read(bytes: &[u8], run: u64) -> Result<Contents<'_>, String> {
    let (start, mut rest) = take_preamble(bytes, run)?;
    let is_overwritten = bytes.starts_with(OVERWRITTEN);
    let mut contents = Contents { start, head: &[], parts: BTreeMap::new(), damage: None };
    let (mut changed, mut has_head) = (BTreeMap::new(), false);
    let mut numbered: Option<u64> = None;
    loop {
        let at = bytes.len() - rest.len();
        match take_record(&mut rest, is_overwritten) {
            Ok(Some(Record::Numbered(number, head))) => {
                if numbered.is_none_or(|before| before < number) {
                    (contents.head, has_head, numbered) = (head, true, Some(number));
                }
            }
            Ok(Some(Record::Part(key, part))) => drop(changed.insert(key, part)),
            Ok(Some(Record::Head(head))) => {
                (contents.head, has_head) = (head, true);
                contents.parts.append(&mut changed);
            }
            Ok(None) => break,
            Err(problem) => {
                contents.damage = Some(format!("at byte {at}: {problem}"));
                if bytes.len() - rest.len() == at {
                    break;
                }
            }
        }
    }
    if has_head {
        Ok(contents)
    } else {
        Err(contents.damage.unwrap_or_else(|| format!("it ends after {} bytes, without a whole state", bytes.len())))
    }
}

/// How much of a checkpoint counts, bytes: up to the end of its last head; `None` where it has none. Only the numbers before each record are
/// read: a file that a process appends to is intact up to where it is written.
pub(crate) fn length_with_head(file: &File) -> io::Result<Option<u64>> {
    let end = file.metadata()?.len();
    let (mut at, mut found) = (PREAMBLE as u64, None);
    while at + RECORD as u64 <= end {
        let mut numbers = [0; RECORD];
        file.read_exact_at(&mut numbers, at)?;
        let [kind, length] = [0, 4].map(|at| u32::from_le_bytes([numbers[at], numbers[at + 1], numbers[at + 2], numbers[at + 3]]));
        at += RECORD as u64 + u64::from(length);
        match kind {
            HEAD if at <= end => found = Some(at),
            PART => {}
            _ => break,
        }
    }
    Ok(found)
}

fn take_preamble(bytes: &[u8], run: u64) -> Result<(u32, &[u8]), String> {
    let (head, rest) =
        bytes.split_first_chunk::<PREAMBLE>().ok_or_else(|| format!("{} bytes, expected at least {PREAMBLE}", bytes.len()))?;
    let number = |at: usize| u32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]);
    if ![MAGIC, OVERWRITTEN].iter().any(|magic| head.starts_with(*magic)) {
        return Err(format!("it begins with {:?}, expected {:?}", head[..8].escape_ascii().to_string(), MAGIC.escape_ascii().to_string()));
    }
    let (found, expected) = (crc32fast::hash(&head[..20]), number(20));
    if found != expected {
        return Err(format!("checksum {found:08x} of the first bytes, expected {expected:08x}"));
    }
    let its_run = u64::from(number(8)) | u64::from(number(12)) << 32;
    if its_run != run {
        return Err(format!("run {its_run:016x}, expected {run:016x}"));
    }
    Ok((number(16), rest))
}

enum Record<'a> {
    Head(&'a [u8]),
    Part(PartKey, &'a [u8]),
    Numbered(u64, &'a [u8]),
}

/// The next record; `None` where no whole one is left. What is refused is not taken, except a numbered head, beside which the other one may
/// be intact.
fn take_record<'a>(rest: &mut &'a [u8], is_overwritten: bool) -> Result<Option<Record<'a>>, String> {
    let Some((numbers, after)) = rest.split_first_chunk::<RECORD>() else { return Ok(None) };
    let [kind, length, expected] = [0, 4, 8].map(|at| u32::from_le_bytes([numbers[at], numbers[at + 1], numbers[at + 2], numbers[at + 3]]));
    let Some((content, after)) = after.split_at_checked(length as usize) else { return Ok(None) };
    let found = checksum(kind, length, &[content]);
    if found != expected {
        if is_overwritten {
            *rest = after;
        }
        return Err(format!("checksum {found:08x}, expected {expected:08x}"));
    }
    let record = match (kind, content.split_first_chunk::<KEY>(), content.split_first_chunk()) {
        (HEAD, ..) if !is_overwritten => Record::Head(content),
        (PART, Some((key, part)), _) if !is_overwritten => {
            let number = |at: usize| i32::from_le_bytes([key[at], key[at + 1], key[at + 2], key[at + 3]]);
            Record::Part([number(0), number(4), number(8)], part)
        }
        (NUMBERED, _, Some((number, head))) if is_overwritten => Record::Numbered(u64::from_le_bytes(*number), head),
        _ => return Err(format!("a record of kind {kind} with {length} bytes, expected a head (1), a part (2) or a numbered head (3)")),
    };
    *rest = after;
    Ok(Some(record))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const RUN: u64 = 0x0123_4567_89ab_cdef;

    /// What was kept at one time: the head, and the parts that had changed.
    type Step = (Vec<u8>, BTreeMap<PartKey, Vec<u8>>);

    fn steps() -> impl Strategy<Value = Vec<Step>> {
        let key = (0..2i32, -2..2i32, prop_oneof![Just(i32::MIN), 0..2i32]).prop_map(|(a, b, c)| [a, b, c]);
        let bytes = proptest::collection::vec(any::<u8>(), 0..12);
        proptest::collection::vec((bytes.clone(), proptest::collection::btree_map(key, bytes, 0..4)), 1..5)
    }

    /// The checkpoint of these steps, where each of them ends, and the state after each.
    fn written(steps: &[Step]) -> (Vec<u8>, Vec<(usize, Step)>) {
        let (mut bytes, mut ends) = (Vec::new(), Vec::new());
        put_preamble(&mut bytes, RUN, 3).expect("memory");
        let mut state = Step::default();
        for (head, changed) in steps {
            changed.iter().for_each(|(key, part)| put_part(&mut bytes, *key, part).expect("memory"));
            put_head(&mut bytes, head).expect("memory");
            state.0.clone_from(head);
            state.1.extend(changed.iter().map(|(key, part)| (*key, part.clone())));
            ends.push((bytes.len(), state.clone()));
        }
        (bytes, ends)
    }

    fn state(contents: &Contents<'_>) -> Step {
        (contents.head.to_vec(), contents.parts.iter().map(|(key, part)| (*key, part.to_vec())).collect())
    }

    proptest! {
        #[test]
        fn wherever_it_is_cut_it_holds_what_was_whole_before(steps in steps()) {
            let (bytes, ends) = written(&steps);
            for end in 0..=bytes.len() {
                let expected = ends.iter().rev().find(|(at, _)| *at <= end).map(|(_, state)| state);
                let file = tempfile::tempfile().expect("a file");
                file.write_all_at(&bytes[..end], 0).expect("written");
                let expected_length = ends.iter().rev().find(|(at, _)| *at <= end).map(|(at, _)| *at as u64);
                prop_assert_eq!(length_with_head(&file).expect("readable"), expected_length);
                match read(&bytes[..end], RUN) {
                    Ok(contents) => {
                        prop_assert_eq!(Some(&state(&contents)), expected);
                        prop_assert_eq!((contents.start, contents.damage), (3, None));
                    }
                    Err(_) => prop_assert_eq!(expected, None),
                }
            }
        }

        #[test]
        fn a_damaged_one_is_refused_or_holds_what_was_whole_before(steps in steps(), bit in 0..8u8) {
            let (bytes, ends) = written(&steps);
            for at in 0..bytes.len() {
                let mut damaged = bytes.clone();
                damaged[at] ^= 1 << bit;
                let expected = ends.iter().rev().find(|(end, _)| *end <= at).map(|(_, state)| state);
                let found = read(&damaged, RUN).ok().as_ref().map(state);
                prop_assert_eq!(found.as_ref(), expected, "byte {}", at);
            }
        }

        #[test]
        fn a_numbered_head_survives_what_happens_to_the_other(heads in proptest::collection::vec(any::<[u8; 9]>(), 1..5), to in any::<u8>()) {
            let mut bytes = Vec::new();
            put_overwritten_preamble(&mut bytes, RUN, 3).expect("memory");
            for (number, head) in (0..).zip(&heads) {
                let before = bytes.clone();
                let record = numbered_head(number, head).expect("memory");
                let at = place_of(number, record.len() as u64) as usize;
                // A kill cuts the write off anywhere, and a power cut leaves anything in its place.
                for written in 0..=record.len() {
                    bytes.clone_from(&before);
                    bytes.resize(bytes.len().max(at + written), 0);
                    bytes[at..at + written].copy_from_slice(&record[..written]);
                    let found = read(&bytes, RUN).ok().map(|contents| contents.head);
                    let last = number.checked_sub(1).map(|last| heads[last as usize].as_slice());
                    // What is cut off may be as it was.
                    let is_new = written > 0 && found == Some(head.as_slice());
                    prop_assert!(is_new || written < record.len() && found == last, "{} of {}", written, record.len());
                }
                let mut damaged = bytes.clone();
                damaged[at + RECORD..at + record.len()].fill(to);
                let contents = read(&damaged, RUN);
                prop_assert_eq!(contents.ok().map(|it| it.head), number.checked_sub(1).map(|before| heads[before as usize].as_slice()));
            }
        }

        #[test]
        fn anything_is_read_or_refused(bytes in proptest::collection::vec(any::<u8>(), 0..200)) {
            let mut whole = Vec::new();
            put_preamble(&mut whole, RUN, 0).expect("memory");
            whole.extend(&bytes);
            prop_assert!(read(&whole, RUN).is_err());
            prop_assert!(read(&bytes, RUN).is_err());
        }
    }

    #[test]
    fn what_is_wrong_is_named() {
        let (bytes, ends) = written(&[(b"one".to_vec(), BTreeMap::new()), (b"two".to_vec(), BTreeMap::new())]);
        let reason = |bytes: &[u8], run| read(bytes, run).expect_err("refused");
        assert_eq!(reason(&bytes[..10], RUN), "10 bytes, expected at least 24");
        assert_eq!(reason(&bytes[..30], RUN), "it ends after 30 bytes, without a whole state");
        assert!(reason(&bytes, RUN + 1).contains("run 0123456789abcdef, expected 0123456789abcdf0"));
        assert!(reason(b"SMCHKPT2 and 24 bytes of an older version", RUN).contains("begins with \"SMCHKPT2\""));
        let mut damaged = bytes.clone();
        damaged[ends[0].0 + RECORD] ^= 1;
        let damage = read(&damaged, RUN).expect("the first state").damage.expect("damage");
        assert!(damage.starts_with(&format!("at byte {}: checksum", ends[0].0)), "{damage}");
        let mut foreign = bytes[..PREAMBLE].to_vec();
        put_record(&mut foreign, 7, &[], b"what").expect("memory");
        assert!(reason(&foreign, RUN).contains("a record of kind 7 with 4 bytes"));
    }
}
