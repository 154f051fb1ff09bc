//! Standard error, for people: nothing that happens to it ends or delays a run.
//!
//! A terminal may close, stop taking output (Ctrl-S, a pipe that no process reads) or be a file on a full disk. Log lines and the
//! progress bar are therefore queued and written by a thread of their own. What cannot be written is dropped; where the queue was
//! full, a line tells how much is missing.

use indicatif::{MultiProgress, ProgressDrawTarget, TermLike};
use std::collections::VecDeque;
use std::ffi::OsString;
use std::io::{self, IsTerminal, Write};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Duration;

/// Most bytes that wait to be written: more than a terminal shows, less than anyone misses of the memory.
const MOST_WAITING: usize = 256 * 1024;
/// Redraws of the bar per second: as many as its steady tick makes.
const REDRAWS_PER_S: u8 = 5;
/// How long a result or the end of the command waits for the lines before it, when the terminal takes nothing.
const PATIENCE: Duration = Duration::from_secs(1);
/// Size of a terminal that does not tell its own, columns and rows.
const USUAL_SIZE: (u16, u16) = (80, 24);

/// Whether escape sequences suit standard error, and whether colours do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Abilities {
    /// A line can be drawn anew in its place.
    pub(crate) draws: bool,
    /// Text may be coloured.
    pub(crate) colours: bool,
}

impl Abilities {
    /// Those of standard error.
    pub(crate) fn of_stderr() -> Self {
        Self::of(io::stderr().is_terminal(), |name| std::env::var_os(name))
    }

    /// A terminal of the type `dumb`, or of none, understands no escape sequence (terminfo); `NO_COLOR`, if not empty, asks for no
    /// colours (no-color.org).
    fn of(is_terminal: bool, variable: impl Fn(&str) -> Option<OsString>) -> Self {
        let draws = is_terminal && variable("TERM").is_some_and(|term| !term.is_empty() && term != "dumb");
        Self { draws, colours: draws && variable("NO_COLOR").is_none_or(|value| value.is_empty()) }
    }
}

/// Progress bars above which log lines appear.
pub(crate) fn bars() -> MultiProgress {
    let target = match Abilities::of_stderr().draws {
        true => ProgressDrawTarget::term_like_with_hz(Box::new(screen().clone()), REDRAWS_PER_S),
        false => ProgressDrawTarget::hidden(),
    };
    MultiProgress::with_draw_target(target)
}

/// The queue of standard error.
pub(crate) fn screen() -> &'static Screen {
    static SCREEN: OnceLock<Screen> = OnceLock::new();
    SCREEN.get_or_init(|| Screen::new(io::stderr()))
}

/// Waits until what was said is written, or cannot be for a while.
pub(crate) fn flush() {
    screen().flush(PATIENCE);
}

/// A queue of output and the thread that writes it.
#[derive(Debug, Clone)]
pub(crate) struct Screen {
    queue: Arc<Queue>,
}

#[derive(Debug, Default)]
struct Queue {
    waiting: Mutex<Waiting>,
    changed: Condvar,
}

#[derive(Debug, Default)]
struct Waiting {
    pieces: VecDeque<Vec<u8>>,
    bytes: usize,
    /// A piece has been taken and is being written.
    is_writing: bool,
    /// Pieces for which there was no room since the last that there was room for.
    dropped: u64,
}

impl Screen {
    fn new(writer: impl Write + Send + 'static) -> Self {
        let screen = Self { queue: Arc::default() };
        let queue = Arc::clone(&screen.queue);
        // Without the thread the queue fills and the lines are lost, which is better than no run.
        let _ = std::thread::Builder::new().name("stderr".to_owned()).spawn(move || queue.write_to(writer));
        screen
    }

    /// Queues a piece of output, or drops it where too much waits already; never waits.
    pub(crate) fn push(&self, piece: &[u8]) {
        let mut waiting = self.queue.lock();
        if waiting.bytes + piece.len() > MOST_WAITING {
            waiting.dropped += 1;
            return;
        }
        if waiting.dropped > 0 {
            let note = format!("{} lines are missing here: this output was not read\n", waiting.dropped);
            waiting.dropped = 0;
            waiting.add(note.into_bytes());
        }
        waiting.add(piece.to_vec());
        self.queue.changed.notify_all();
    }

    /// Waits until everything queued has been written or dropped, at most for so long.
    pub(crate) fn flush(&self, patience: Duration) {
        let has_work = |waiting: &mut Waiting| !waiting.pieces.is_empty() || waiting.is_writing;
        // Whether it came to that makes no difference to the caller.
        drop(self.queue.changed.wait_timeout_while(self.queue.lock(), patience, has_work));
    }
}

impl Waiting {
    fn add(&mut self, piece: Vec<u8>) {
        self.bytes += piece.len();
        self.pieces.push_back(piece);
    }
}

impl Queue {
    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Writes what is queued, for as long as the command runs. A piece that cannot be written is dropped: a full disk may have room
    /// for the next.
    fn write_to(&self, mut writer: impl Write) {
        loop {
            let piece = {
                let idle = |waiting: &mut Waiting| waiting.pieces.is_empty();
                let mut waiting = self.changed.wait_while(self.lock(), idle).unwrap_or_else(PoisonError::into_inner);
                let piece = waiting.pieces.pop_front().unwrap_or_default();
                waiting.bytes -= piece.len();
                waiting.is_writing = true;
                piece
            };
            let _ = writer.write_all(&piece).and_then(|()| writer.flush());
            self.lock().is_writing = false;
            self.changed.notify_all();
        }
    }
}

impl Write for Screen {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.push(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// Control sequences of ECMA-48. indicatif panics where a terminal fails; this one does not.
impl TermLike for Screen {
    fn width(&self) -> u16 {
        size().0
    }

    fn height(&self) -> u16 {
        size().1
    }

    fn move_cursor_up(&self, n: usize) -> io::Result<()> {
        self.moved(n, 'A')
    }

    fn move_cursor_down(&self, n: usize) -> io::Result<()> {
        self.moved(n, 'B')
    }

    fn move_cursor_right(&self, n: usize) -> io::Result<()> {
        self.moved(n, 'C')
    }

    fn move_cursor_left(&self, n: usize) -> io::Result<()> {
        self.moved(n, 'D')
    }

    fn write_line(&self, text: &str) -> io::Result<()> {
        self.write_str(&format!("{text}\n"))
    }

    fn write_str(&self, text: &str) -> io::Result<()> {
        self.push(text.as_bytes());
        Ok(())
    }

    fn clear_line(&self) -> io::Result<()> {
        self.write_str("\r\x1b[2K")
    }

    fn flush(&self) -> io::Result<()> {
        Ok(())
    }
}

impl Screen {
    fn moved(&self, n: usize, direction: char) -> io::Result<()> {
        if n > 0 { self.write_str(&format!("\x1b[{n}{direction}")) } else { Ok(()) }
    }
}

/// Columns and rows of standard error.
fn size() -> (u16, u16) {
    match rustix::termios::tcgetwinsize(io::stderr()) {
        Ok(size) if size.ws_col > 0 && size.ws_row > 0 => (size.ws_col, size.ws_row),
        Ok(_) | Err(_) => USUAL_SIZE,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use indicatif::ProgressBar;
    use std::sync::mpsc::{Receiver, channel};

    /// A terminal that has gone.
    struct Gone;

    impl Write for Gone {
        fn write(&mut self, _: &[u8]) -> io::Result<usize> {
            Err(io::Error::from_raw_os_error(5))
        }

        fn flush(&mut self) -> io::Result<()> {
            Err(io::Error::from_raw_os_error(5))
        }
    }

    /// A terminal that takes nothing until it is let go.
    struct Stopped {
        let_go: Receiver<()>,
        written: Arc<Mutex<Vec<u8>>>,
    }

    impl Write for Stopped {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let _ = self.let_go.recv();
            self.written.lock().unwrap().extend_from_slice(bytes);
            Ok(bytes.len())
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    const LONG: Duration = Duration::from_secs(60);

    #[test]
    fn a_bar_on_a_terminal_that_has_gone_does_not_panic() {
        let screen = Screen::new(Gone);
        let bars = MultiProgress::with_draw_target(ProgressDrawTarget::term_like_with_hz(Box::new(screen.clone()), 255));
        let bar = bars.add(ProgressBar::new(10));
        for position in 0..10 {
            bar.set_position(position);
            bar.tick();
            bars.suspend(|| screen.push(b"a line\n"));
        }
        bar.finish_and_clear();
        screen.flush(LONG);
    }

    #[test]
    fn a_terminal_that_takes_nothing_stops_nothing() {
        let (let_go, waits) = channel();
        let written = Arc::new(Mutex::new(Vec::new()));
        let screen = Screen::new(Stopped { let_go: waits, written: Arc::clone(&written) });
        let line = vec![b'x'; 1024];
        for _ in 0..2 * MOST_WAITING / line.len() {
            screen.push(&line);
        }
        drop(let_go);
        screen.flush(LONG);
        screen.push(b"the last line\n");
        screen.flush(LONG);
        let written = String::from_utf8(written.lock().unwrap().clone()).unwrap();
        assert!(written.len() < MOST_WAITING + 4096, "{} bytes", written.len());
        let told = written.trim_start_matches('x');
        let (count, rest) = told.split_once(' ').unwrap();
        assert!((200..=256).contains(&count.parse::<u32>().unwrap()), "{told}");
        assert_eq!(rest, "lines are missing here: this output was not read\nthe last line\n");
    }

    #[test]
    fn no_color_and_dumb_terminals_are_respected() {
        let of = |term: Option<&str>, no_color: Option<&str>| {
            let abilities = Abilities::of(true, |name| match name {
                "TERM" => term.map(OsString::from),
                "NO_COLOR" => no_color.map(OsString::from),
                _ => None,
            });
            (abilities.draws, abilities.colours)
        };
        assert_eq!(of(Some("xterm-256color"), None), (true, true));
        assert_eq!(of(Some("xterm"), Some("")), (true, true));
        assert_eq!(of(Some("xterm"), Some("1")), (true, false));
        assert_eq!(of(Some("dumb"), None), (false, false));
        assert_eq!(of(None, None), (false, false));
        assert!(!Abilities::of(false, |_| Some("xterm".into())).draws);
    }
}
