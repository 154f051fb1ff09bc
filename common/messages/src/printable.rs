//! Text from outside, made safe for a terminal.

use std::borrow::Cow;

/// The text with every character escaped that would act on a terminal or forge a line, such as `\n` or `\u{1b}`.
///
/// Names and messages come from files, devices and foreign programs. An escape sequence among them could retitle or repaint the
/// terminal that shows them, a line break could add a line that looks like the program's own.
///
/// ```
/// assert_eq!(stillmap_messages::printable("pioneer-1"), "pioneer-1");
/// assert_eq!(stillmap_messages::printable("\u{1b}[31mred\nline"), "\\u{1b}[31mred\\nline");
/// ```
#[must_use]
pub fn printable(text: &str) -> Cow<'_, str> {
    if !text.chars().any(acts) {
        return Cow::Borrowed(text);
    }
    let mut escaped = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if acts(c) {
            escaped.extend(c.escape_default());
        } else {
            escaped.push(c);
        }
    }
    Cow::Owned(escaped)
}

/// Control characters (C0 except the tab, DEL, C1), line separators, and the marks that reorder text of two directions (UAX 9).
fn acts(c: char) -> bool {
    (c.is_control() && c != '\t')
        || matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{feff}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plain_text_stays_as_it_is() {
        for text in ["", "drive.mcap", "12 µs × 3 „Flur“", "tab\tulated", "日本", "a\\b \"c\""] {
            assert!(matches!(printable(text), Cow::Borrowed(same) if same == text), "{text:?}");
        }
    }

    #[test]
    fn control_characters_are_escaped() {
        for (text, expected) in [
            ("\u{1b}]0;title\u{7}", "\\u{1b}]0;title\\u{7}"),
            ("a\r\nb", "a\\r\\nb"),
            ("\u{9b}2J", "\\u{9b}2J"),
            ("\u{7f}", "\\u{7f}"),
            ("fine\u{202e}txt.exe", "fine\\u{202e}txt.exe"),
            ("\u{2028}", "\\u{2028}"),
        ] {
            assert_eq!(printable(text), expected);
        }
    }
}
