//! The format of a checkpoint: a state as a head and parts, of which only what changed is appended.
//!
//! Layout, all numbers little-endian:
//!
//! | what | how |
//! | --- | --- |
//! | preamble | 8 bytes `SMCHKPT3`, run u64, start u32, CRC-32 of the 20 bytes before |
//! | records | each: kind u32, length u32 of its content, CRC-32 of kind, length and content, content |
//! | a part (kind 2) | key 3 × i32, then its bytes |
//! | a head (kind 1) | its bytes |
//!
//! The parts before a head are valid with it: a later part replaces the one of its key, a later head the one before. What was
//! cut off behind the last head, by a kill in the middle of writing, never was.

use std::collections::BTreeMap;
use std::io::{self, Write};

const MAGIC: &[u8; 8] = b"SMCHKPT3";
const PREAMBLE: usize = MAGIC.len() + 8 + 4 + 4;
const HEAD: u32 = 1;
const PART: u32 = 2;
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

/// Begins a checkpoint.
pub(crate) fn put_preamble(into: &mut impl Write, run: u64, start: u32) -> io::Result<()> {
    let mut bytes = [0; PREAMBLE];
    bytes[..8].copy_from_slice(MAGIC);
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
    let mut contents = Contents { start, head: &[], parts: BTreeMap::new(), damage: None };
    let (mut changed, mut has_head) = (BTreeMap::new(), false);
    loop {
        match take_record(&mut rest) {
            Ok(Some(Record::Part(key, part))) => drop(changed.insert(key, part)),
            Ok(Some(Record::Head(head))) => {
                (contents.head, has_head) = (head, true);
                contents.parts.append(&mut changed);
            }
            Ok(None) => break,
            Err(problem) => {
                contents.damage = Some(format!("at byte {}: {problem}", bytes.len() - rest.len()));
                break;
            }
        }
    }
    if has_head {
        Ok(contents)
    } else {
        Err(contents.damage.unwrap_or_else(|| format!("it ends after {} bytes, without a whole state", bytes.len())))
    }
}

fn take_preamble(bytes: &[u8], run: u64) -> Result<(u32, &[u8]), String> {
    let (head, rest) =
        bytes.split_first_chunk::<PREAMBLE>().ok_or_else(|| format!("{} bytes, expected at least {PREAMBLE}", bytes.len()))?;
    let number = |at: usize| u32::from_le_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]);
    if !head.starts_with(MAGIC) {
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
}

/// The next record; `None` where no whole one is left. What is refused is not taken.
fn take_record<'a>(rest: &mut &'a [u8]) -> Result<Option<Record<'a>>, String> {
    let Some((numbers, after)) = rest.split_first_chunk::<RECORD>() else { return Ok(None) };
    let [kind, length, expected] = [0, 4, 8].map(|at| u32::from_le_bytes([numbers[at], numbers[at + 1], numbers[at + 2], numbers[at + 3]]));
    let Some((content, after)) = after.split_at_checked(length as usize) else { return Ok(None) };
    let found = checksum(kind, length, &[content]);
    if found != expected {
        return Err(format!("checksum {found:08x}, expected {expected:08x}"));
    }
    let record = match (kind, content.split_first_chunk::<KEY>()) {
        (HEAD, _) => Record::Head(content),
        (PART, Some((key, part))) => {
            let number = |at: usize| i32::from_le_bytes([key[at], key[at + 1], key[at + 2], key[at + 3]]);
            Record::Part([number(0), number(4), number(8)], part)
        }
        _ => return Err(format!("a record of kind {kind} with {length} bytes, expected a head (1) or a part (2)")),
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
