//! Checks of a server's answer: it is the range that was asked for, of the file that was opened.

use std::io;
use std::ops::Range;

use ureq::Body;
use ureq::http::{HeaderMap, Response, StatusCode, header};

/// Longest file, bytes: 8 PiB. Sums of positions in shorter ones are exact.
const MOST_LENGTH: u64 = 1 << 53;

/// Which version of a file a server has, as its answers say.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Version {
    /// Length of the file, bytes.
    pub length: u64,
    tag: Option<String>,
    modified: Option<String>,
}

impl Version {
    pub fn of(headers: &HeaderMap, length: u64) -> Self {
        let of = |name| text(headers, name);
        Self { length, tag: of(header::ETAG), modified: of(header::LAST_MODIFIED) }
    }

    /// Whether an answer is of another version. A missing word tells nothing.
    fn differs(&self, other: &Self) -> bool {
        let differ = |one: &Option<String>, other: &Option<String>| one.is_some() && other.is_some() && one != other;
        self.length != other.length || differ(&self.tag, &other.tag) || differ(&self.modified, &other.modified)
    }
}

/// The text of a header; None if it is missing or not ASCII.
pub(super) fn text(headers: &HeaderMap, name: header::HeaderName) -> Option<String> {
    headers.get(name)?.to_str().ok().map(|text| text.trim().to_owned())
}

/// An error with this clause.
pub(super) fn error(what: impl Into<String>) -> io::Error {
    io::Error::other(what.into())
}

/// The clause for an answer that is an error.
pub(super) fn refusal(status: StatusCode) -> String {
    let reason = status.canonical_reason().unwrap_or("an unknown status");
    let advice = match status.as_u16() {
        401 | 403 => ": it may need a password or a signed address",
        _ => "",
    };
    format!("the server answers {} {reason}{advice}", status.as_u16())
}

/// Fails if the bytes of an answer are encoded, for example compressed: their positions would not
/// be those of the file.
pub(super) fn check_plain(headers: &HeaderMap) -> io::Result<()> {
    match text(headers, header::CONTENT_ENCODING).filter(|encoding| !encoding.eq_ignore_ascii_case("identity")) {
        Some(encoding) => {
            let shown: String = encoding.chars().filter(char::is_ascii_graphic).take(20).collect();
            Err(error(format!("the server sends it encoded as {shown}, although that was not asked for")))
        }
        None => Ok(()),
    }
}

/// The length of the body of an answer; None if it is not stated.
pub(super) fn body_length(headers: &HeaderMap) -> Option<u64> {
    text(headers, header::CONTENT_LENGTH)?.parse().ok()
}

/// Checks the answer to a request for the bytes `asked` of a file whose version may be `known`.
/// Returns the version and the range that the answer holds. The range is shorter than the one that
/// was asked for only at the end of a file whose length was not known.
pub(super) fn checked(
    answer: &Response<Body>,
    asked: &Range<u64>,
    known: Option<&Version>,
) -> io::Result<(Version, Range<u64>)> {
    let headers = answer.headers();
    check_plain(headers)?;
    let words = text(headers, header::CONTENT_RANGE).unwrap_or_default();
    let bytes = |range: &Range<u64>| format!("bytes {} to {}", range.start, range.end - 1);
    let Some((start, last, length)) = parsed(&words) else {
        return Err(error(format!(
            "the server does not say which bytes it sends, where {} were asked for",
            bytes(asked)
        )));
    };
    if length > MOST_LENGTH {
        return Err(error(format!("the server says that the file has {length} bytes, which no file has")));
    }
    let version = Version::of(headers, length);
    if known.is_some_and(|known| known.differs(&version)) {
        return Err(error("the file on the server changed while it was read: start again"));
    }
    let wanted = asked.start..asked.end.min(length);
    let sent = start..last.saturating_add(1);
    if start > last || sent != wanted {
        return Err(error(format!(
            "the server says that it sends bytes {start} to {last} of {length}, where {} were asked for",
            bytes(asked)
        )));
    }
    let (body, held) = (body_length(headers), wanted.end - wanted.start);
    if let Some(body) = body.filter(|body| *body != held) {
        return Err(error(format!("the server says that it sends {} in {body} bytes", bytes(&wanted))));
    }
    Ok((version, wanted))
}

/// The numbers of `bytes FIRST-LAST/LENGTH`.
fn parsed(words: &str) -> Option<(u64, u64, u64)> {
    let (unit, rest) = words.split_once(' ')?;
    let (range, length) = rest.trim().split_once('/')?;
    let (first, last) = range.split_once('-')?;
    let number = |text: &str| text.trim().parse::<u64>().ok();
    unit.eq_ignore_ascii_case("bytes").then_some((number(first)?, number(last)?, number(length)?))
}

/// Whether an answer says that a file is empty: no range of it can be sent.
pub(super) fn says_empty(headers: &HeaderMap) -> bool {
    text(headers, header::CONTENT_RANGE).is_some_and(|words| words.trim_end().ends_with("*/0"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn content_ranges_are_parsed() {
        assert_eq!(parsed("bytes 0-9/100"), Some((0, 9, 100)));
        assert_eq!(parsed("Bytes  5-5/6"), Some((5, 5, 6)));
        for words in ["", "bytes", "bytes 0-9", "bytes 0-9/*", "bytes */10", "lines 0-9/10", "bytes -1-9/10"] {
            assert_eq!(parsed(words), None, "{words}");
        }
    }
}
