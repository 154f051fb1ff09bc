//! Processor time and memory of a process, as `/proc` tells them.

/// What a process has used.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Usage {
    /// Processor time, in clock ticks.
    pub(crate) ticks: u64,
    /// Resident memory, in pages.
    pub(crate) pages: u64,
}

impl Usage {
    /// Reads the texts of `/proc/<pid>/stat` (fields 14 and 15, utime and stime) and `/proc/<pid>/statm` (field 2), see proc(5).
    pub(crate) fn read(stat: &str, statm: &str) -> Option<Self> {
        // The program's name stands in brackets and may hold anything; field 3 follows the last bracket.
        let mut fields = stat.get(stat.rfind(')')? + 1..)?.split_ascii_whitespace().skip(14 - 3);
        let utime: u64 = fields.next()?.parse().ok()?;
        let stime: u64 = fields.next()?.parse().ok()?;
        Some(Self { ticks: utime + stime, pages: statm.split_ascii_whitespace().nth(1)?.parse().ok()? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STAT: &str = "4242 (still) map) S 1 4242 4242 0 -1 4194560 1234 0 5 0 310 25 0 0 20 0 3 0 88 1000 200 18446744073709551615";

    #[test]
    fn the_fields_of_the_manual() {
        assert_eq!(Usage::read(STAT, "1000 345 200 1 0 100 0\n"), Some(Usage { ticks: 335, pages: 345 }));
    }

    #[test]
    fn anything_shorter_is_nothing() {
        for end in 0..STAT.find(" 0 0 20").unwrap() - 2 {
            assert_eq!(Usage::read(&STAT[..end], "1000 345"), None, "{}", &STAT[..end]);
        }
        assert_eq!(Usage::read(STAT, "1000"), None);
    }
}
