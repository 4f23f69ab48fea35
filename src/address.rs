//! Addresses of remote files, which are given in place of paths.

use std::borrow::Cow;
use std::path::{Path, PathBuf};

/// Whether `path` is an address: `http://` or `https://`, in lower or upper case.
pub(crate) fn is_remote(path: &Path) -> bool {
    of(path).is_some()
}

/// The text of the address that `path` is; None for a path of the system.
pub(crate) fn of(path: &Path) -> Option<&str> {
    let text = path.to_str()?;
    let (scheme, rest) = text.split_once("://")?;
    let known = ["http", "https"].iter().any(|known| known.eq_ignore_ascii_case(scheme));
    (known && !rest.is_empty()).then_some(text)
}

/// The path for messages, names and detection of formats.
///
/// An address loses its user, password, query and fragment: a query may be a signature that gives
/// access.
pub fn shown(path: &Path) -> Cow<'_, Path> {
    let Some((scheme, rest)) = of(path).and_then(|address| address.split_once("://")) else { return path.into() };
    let plain = rest.split(['?', '#']).next().unwrap_or_default();
    let (host, file) = plain.split_at(plain.find('/').unwrap_or(plain.len()));
    let host = host.rsplit('@').next().unwrap_or_default();
    PathBuf::from(format!("{scheme}://{host}{file}")).into()
}

/// The address that `reference` has in a file at the address `base`, as RFC 3986 resolves it.
///
/// The user and password of `base` hold for the same server only, and its query is left out.
pub(crate) fn resolved(base: &str, reference: &str) -> String {
    let reference = &encoded(reference)[..];
    if is_remote(Path::new(reference)) {
        return reference.to_owned();
    }
    let (scheme, rest) = base.split_once("://").unwrap_or(("http", base));
    if let Some(other) = reference.strip_prefix("//") {
        return format!("{scheme}://{other}");
    }
    let plain = rest.split(['?', '#']).next().unwrap_or_default();
    let (host, file) = plain.split_at(plain.find('/').unwrap_or(plain.len()));
    let (reference, query) = reference.split_at(reference.find(['?', '#']).unwrap_or(reference.len()));
    let folder = if reference.starts_with('/') { "" } else { file.rsplit_once('/').map_or("", |(folder, _)| folder) };
    let mut parts: Vec<&str> = Vec::new();
    for part in folder.split('/').chain(reference.split('/')) {
        match part {
            "" | "." => {}
            ".." => drop(parts.pop()),
            part => parts.push(part),
        }
    }
    format!("{scheme}://{host}/{}{query}", parts.join("/"))
}

/// A reference in which characters that no address has, such as spaces, are encoded. Encoded ones
/// stay as they are.
fn encoded(reference: &str) -> String {
    let is_plain = |byte: u8| byte.is_ascii_graphic() && !b"\"<>\\^`{|}".contains(&byte);
    let of = |byte: u8| if is_plain(byte) { char::from(byte).to_string() } else { format!("%{byte:02X}") };
    reference.bytes().map(of).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_are_told_from_paths() {
        for address in ["http://a/b.laz", "HTTPS://a", "https://u:p@a:80/b?c#d"] {
            assert!(is_remote(Path::new(address)), "{address}");
        }
        for path in ["", "-", "a.laz", "http://", "http:/a", "file:///a", "s3://a/b", "a/http://b"] {
            assert!(!is_remote(Path::new(path)), "{path}");
        }
    }

    #[test]
    fn references_are_encoded() {
        assert_eq!(resolved("https://host/a/b.vpc", "./tile 1é.laz?k=%20"), "https://host/a/tile%201%C3%A9.laz?k=%20");
        assert_eq!(resolved("https://host/a", "http://other/a b"), "http://other/a%20b");
    }

    #[test]
    fn secrets_are_not_shown() {
        for (given, is) in [
            ("https://me:secret@host:8080/a/b.laz?key=secret#secret", "https://host:8080/a/b.laz"),
            ("http://me:se@cret@host", "http://host"),
            ("http://host?secret@x/y", "http://host"),
            ("http://host/a@b.laz", "http://host/a@b.laz"),
            ("a?b@c.laz", "a?b@c.laz"),
        ] {
            assert_eq!(shown(Path::new(given)), Path::new(is));
        }
    }

    #[test]
    fn references_are_resolved() {
        let base = "https://me@host/a/b/index.vpc?key=1";
        for (reference, is) in [
            ("./c.laz", "https://me@host/a/b/c.laz"),
            ("c/d.laz?e=../f", "https://me@host/a/b/c/d.laz?e=../f"),
            ("../c.laz", "https://me@host/a/c.laz"),
            ("../../../c.laz", "https://me@host/c.laz"),
            ("/c.laz", "https://me@host/c.laz"),
            ("//other/c.laz", "https://other/c.laz"),
            ("http://other/c.laz", "http://other/c.laz"),
        ] {
            assert_eq!(resolved(base, reference), is);
        }
        assert_eq!(resolved("http://host", "c.laz"), "http://host/c.laz");
    }
}
