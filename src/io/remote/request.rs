//! One range of bytes of a file on a server.

use std::io::{self, Read};
use std::ops::Range;
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use ureq::http::{HeaderMap, Response, StatusCode, Uri, header};
use ureq::tls::{Certificate, PemItem, RootCerts, TlsConfig, parse_pem};
use ureq::{Agent, Body, Proxy};

use super::answer::{self, Version, body_length, check_plain, checked, error, refusal, says_empty};
use super::{CONNECTIONS, Patience};
use crate::address;
use crate::io::input::MOST_COPIED;

/// Number of times that a range is asked for if connections are lost or the server is busy.
const TRIES: u32 = 4;

/// The pause behind the first failure, as a part of the longest stall: 0.25 s of 30 s. Each further
/// one is four times as long.
const FIRST_PAUSE: u32 = 120;

/// Most redirects of a request.
const REDIRECTS: u32 = 10;

/// Slowest server that is waited for, bytes per second, counted over an answer. It ends an answer
/// of single bytes, none of which stalls.
const SLOWEST: f64 = 4096.0;

/// A file on a server, and how long it is waited for.
#[derive(Debug)]
pub(super) struct Server {
    agent: Agent,
    address: String,
    patience: Patience,
}

/// The answer to the first request.
pub(super) enum First {
    /// The first bytes.
    Part(Vec<u8>, Version),
    /// All bytes, and their number if it is stated: the server does not send ranges.
    Whole(Box<dyn Read>, Option<u64>),
}

/// Why a request failed.
enum Failure {
    /// The connection was lost, or the server is busy; it may say how long to wait.
    Passing(io::Error, Option<Duration>),
    Final(io::Error),
}

impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Self {
        Self::Final(error)
    }
}

impl Server {
    pub fn new(address: &str, patience: Patience) -> io::Result<Self> {
        Ok(Self { agent: agent(Kind::of(address), patience)?, address: address.to_owned(), patience })
    }

    /// Asks for the first `most` bytes.
    pub fn first(&self, most: u64) -> io::Result<First> {
        let asked = 0..most;
        self.trying(|server| {
            // The whole file may come.
            let answer = server.answer(&asked, server.longest(MOST_COPIED))?;
            match answer.status() {
                StatusCode::PARTIAL_CONTENT => {
                    let (version, range) = checked(&answer, &asked, None)?;
                    let mut bytes = Vec::new();
                    server.receive(answer, range.end - range.start, &mut bytes)?;
                    Ok(First::Part(bytes, version))
                }
                StatusCode::OK => {
                    check_plain(answer.headers())?;
                    let length = body_length(answer.headers());
                    Ok(First::Whole(Box::new(server.body(answer)), length))
                }
                StatusCode::RANGE_NOT_SATISFIABLE if says_empty(answer.headers()) => {
                    Ok(First::Part(Vec::new(), Version::of(answer.headers(), 0)))
                }
                status => Err(server.refused(status, answer.headers())),
            }
        })
    }

    /// Receives the bytes `range` of a file of this version, which has them.
    pub fn fetch(&self, range: Range<u64>, version: &Version) -> io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        bytes.try_reserve_exact((range.end - range.start) as usize).map_err(|_| io::ErrorKind::OutOfMemory)?;
        self.trying(|server| {
            // The bytes that arrived before a connection was lost are kept.
            let rest = range.start + bytes.len() as u64..range.end;
            let answer = server.answer(&rest, server.longest(rest.end - rest.start))?;
            match answer.status() {
                StatusCode::PARTIAL_CONTENT => {
                    checked(&answer, &rest, Some(version))?;
                    server.receive(answer, rest.end - rest.start, &mut bytes)
                }
                StatusCode::OK => Err(Failure::Final(error(format!(
                    "the server sends the whole file, where bytes {} to {} were asked for",
                    rest.start,
                    rest.end - 1
                )))),
                StatusCode::RANGE_NOT_SATISFIABLE => {
                    Err(Failure::Final(error("the file on the server changed while it was read: start again")))
                }
                status => Err(server.refused(status, answer.headers())),
            }
        })?;
        Ok(bytes)
    }

    /// Repeats `attempt` while its failures are passing, within the longest stall.
    fn trying<T>(&self, mut attempt: impl FnMut(&Self) -> Result<T, Failure>) -> io::Result<T> {
        let start = Instant::now();
        let mut pause = self.patience.stall / FIRST_PAUSE;
        for tries in 1.. {
            let (failed, asked) = match attempt(self) {
                Ok(done) => return Ok(done),
                Err(Failure::Final(error)) => return Err(error),
                Err(Failure::Passing(error, asked)) => (error, asked),
            };
            let wait = asked.unwrap_or(pause);
            if tries == TRIES || start.elapsed().saturating_add(wait) >= self.patience.stall {
                let times = if tries > 1 { format!(", {tries} times") } else { String::new() };
                return Err(io::Error::new(failed.kind(), format!("{failed}{times}")));
            }
            std::thread::sleep(wait);
            pause *= 4;
        }
        Err(error("the server was not asked"))
    }

    /// Sends a request for these bytes, and returns the answer when its headers are there. The
    /// bodies of redirects are not read, as they may have no end.
    fn answer(&self, range: &Range<u64>, longest: Duration) -> Result<Response<Body>, Failure> {
        let words = format!("bytes={}-{}", range.start, range.end - 1);
        let mut address = self.address.clone();
        for _ in 0..=REDIRECTS {
            let request = self.agent.get(&address).header(header::RANGE, &words);
            let request = request.config().timeout_global(Some(longest)).build();
            let answer = request.call().map_err(|failed| sorted(failed, self.patience))?;
            let place = match answer.status().as_u16() {
                301 | 302 | 303 | 307 | 308 => answer::text(answer.headers(), header::LOCATION),
                _ => return Ok(answer),
            };
            let place = place.ok_or_else(|| error("the server redirects to nowhere"))?;
            address = address::resolved(&address, &place);
        }
        Err(Failure::Final(error("the server redirects in a circle")))
    }

    /// The longest time for an answer of this many bytes.
    fn longest(&self, size: u64) -> Duration {
        let Patience { connect, stall } = self.patience;
        connect.saturating_add(stall).saturating_add(Duration::from_secs_f64(size as f64 / SLOWEST))
    }

    /// Appends the body of an answer, which has this many bytes.
    fn receive(&self, answer: Response<Body>, size: u64, into: &mut Vec<u8>) -> Result<(), Failure> {
        let before = into.len();
        let read = self.body(answer).take(size + 1).read_to_end(into);
        let received = (into.len() - before) as u64;
        if received > size {
            into.truncate(before);
            return Err(Failure::Final(error(format!("the server sends more than the {size} bytes that it promises"))));
        }
        let ended = || error(format!("the server ended the connection after {received} of {size} bytes"));
        match read {
            // All bytes may be there although the connection was lost behind them.
            Ok(_) if received == size => Ok(()),
            Err(failed) if received == size && lost(failed.kind()) => Ok(()),
            Ok(_) => Err(Failure::Passing(ended(), None)),
            Err(failed) if lost(failed.kind()) => Err(Failure::Passing(ended(), None)),
            Err(failed) => Err(Failure::Final(failed)),
        }
    }

    /// The body of an answer. Its errors have the clauses of this module.
    fn body(&self, answer: Response<Body>) -> Paced {
        let body = Box::new(answer.into_body().into_reader());
        Paced { body, patience: self.patience, start: Instant::now(), received: 0 }
    }

    fn refused(&self, status: StatusCode, headers: &HeaderMap) -> Failure {
        let refused = error(refusal(status));
        let asked = answer::text(headers, header::RETRY_AFTER).and_then(|seconds| seconds.parse().ok());
        match status.as_u16() {
            408 | 425 | 429 | 500.. => Failure::Passing(refused, asked.map(Duration::from_secs)),
            _ => Failure::Final(refused),
        }
    }
}

/// A kind of addresses that share a client.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Kind {
    /// Connections are encrypted, and no redirect may give that up.
    is_encrypted: bool,
    /// The server is this machine, so no proxy is asked.
    is_here: bool,
}

impl Kind {
    fn of(address: &str) -> Self {
        let is_encrypted = address.get(..6).is_some_and(|scheme| scheme.eq_ignore_ascii_case("https:"));
        let parsed = address.parse::<Uri>().ok();
        let host = parsed.as_ref().and_then(Uri::host).unwrap_or_default();
        Self { is_encrypted, is_here: ["127.0.0.1", "localhost", "[::1]"].contains(&host) }
    }
}

/// The clients that were made, with what they are for. Connections stay open in a client, and files
/// of one server share them.
static AGENTS: Mutex<Vec<(Kind, Patience, Agent)>> = Mutex::new(Vec::new());

/// The client for addresses of this kind.
fn agent(kind: Kind, patience: Patience) -> io::Result<Agent> {
    let mut agents = AGENTS.lock().unwrap_or_else(PoisonError::into_inner);
    let known = agents.iter().find(|(own, limits, _)| (*own, *limits) == (kind, patience));
    if let Some((.., agent)) = known {
        return Ok(agent.clone());
    }
    // An address without encryption may redirect to one with it.
    let roots = root_certs()?;
    let config = Agent::config_builder()
        .tls_config(TlsConfig::builder().root_certs(roots).build())
        .http_status_as_error(false)
        .https_only(kind.is_encrypted)
        .max_redirects(0)
        .max_redirects_will_error(false)
        .proxy(Proxy::try_from_env().filter(|_| !kind.is_here))
        .user_agent(concat!("epsplat/", env!("CARGO_PKG_VERSION")))
        .accept_encoding("identity")
        .max_idle_connections(4 * CONNECTIONS)
        .max_idle_connections_per_host(CONNECTIONS)
        .timeout_resolve(Some(patience.connect))
        .timeout_connect(Some(patience.connect))
        .timeout_recv_response(Some(patience.stall))
        .timeout_per_read(Some(patience.stall))
        .timeout_per_write(Some(patience.stall));
    let agent: Agent = config.build().into();
    agents.push((kind, patience, agent.clone()));
    Ok(agent)
}

/// The certificates that servers are checked against: those of the file that the environment
/// variable `SSL_CERT_FILE` names, as OpenSSL and curl read it, else Mozilla's.
fn root_certs() -> io::Result<RootCerts> {
    let Some(path) = std::env::var_os("SSL_CERT_FILE").filter(|path| !path.is_empty()) else {
        return Ok(RootCerts::WebPki);
    };
    let pem = std::fs::read(path).map_err(|failed| error(format!("SSL_CERT_FILE cannot be read: {failed}")))?;
    let certs: Vec<Certificate<'static>> = parse_pem(&pem)
        .filter_map(|item| match item {
            Ok(PemItem::Certificate(cert)) => Some(cert),
            _ => None,
        })
        .collect();
    match certs.is_empty() {
        true => Err(error("SSL_CERT_FILE names a file without certificates")),
        false => Ok(RootCerts::new_with_certs(&certs)),
    }
}

/// Sorts the failures of the client.
fn sorted(failed: ureq::Error, patience: Patience) -> Failure {
    use ureq::Timeout;
    let seconds = |time: Duration| {
        let seconds = time.as_secs_f64();
        if seconds == 1.0 { "1 second".to_owned() } else { format!("{seconds} seconds") }
    };
    let late = |what: String| Failure::Final(io::Error::new(io::ErrorKind::TimedOut, what));
    match failed {
        ureq::Error::Timeout(Timeout::Resolve | Timeout::Connect) => {
            late(format!("there is no connection to the server within {}", seconds(patience.connect)))
        }
        ureq::Error::Timeout(Timeout::Global) => late("the server sends too slowly".into()),
        ureq::Error::Timeout(_) => late(format!("the server sent nothing for {}", seconds(patience.stall))),
        ureq::Error::HostNotFound => Failure::Final(error("its server is not known: check the address")),
        ureq::Error::TooManyRedirects => Failure::Final(error("the server redirects in a circle")),
        ureq::Error::BadUri(_) | ureq::Error::Http(_) => Failure::Final(error("the address is invalid")),
        ureq::Error::RequireHttpsOnly(_) => {
            Failure::Final(error("the server redirects to an address without encryption: name that one"))
        }
        ureq::Error::Io(failed) => match failed.kind() {
            io::ErrorKind::ConnectionRefused => {
                Failure::Final(error("the server refuses the connection: check the address and its port"))
            }
            io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock => {
                late(format!("the server sent nothing for {}", seconds(patience.stall)))
            }
            kind if lost(kind) => Failure::Passing(error("the server ended the connection"), None),
            // As such come the faults of certificates.
            io::ErrorKind::InvalidData => Failure::Final(error(format!(
                "its encryption is not accepted, {failed}: SSL_CERT_FILE may name a file of certificates"
            ))),
            _ => Failure::Final(error(failed.to_string())),
        },
        ureq::Error::Protocol(_) => {
            Failure::Passing(error("the server does not speak HTTP, or ended the answer"), None)
        }
        ureq::Error::ConnectionFailed => Failure::Passing(error("there is no connection to the server"), None),
        ureq::Error::Tls(_) | ureq::Error::Rustls(_) => {
            Failure::Final(error("the server's certificate or encryption is not accepted"))
        }
        _ => Failure::Final(error("the request failed")),
    }
}

/// Whether an error means that a connection was lost.
fn lost(kind: io::ErrorKind) -> bool {
    use io::ErrorKind::{BrokenPipe, ConnectionAborted, ConnectionReset, NotConnected, UnexpectedEof};
    matches!(kind, BrokenPipe | ConnectionAborted | ConnectionReset | NotConnected | UnexpectedEof)
}

/// The body of an answer, from a server that is fast enough.
struct Paced {
    body: Box<dyn Read>,
    patience: Patience,
    start: Instant,
    received: u64,
}

impl Read for Paced {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let count = self.body.read(out).map_err(|failed| match sorted(failed.into(), self.patience) {
            Failure::Passing(error, _) => io::Error::new(io::ErrorKind::ConnectionReset, error.to_string()),
            Failure::Final(error) => error,
        })?;
        self.received += count as u64;
        let longest = self.patience.stall + Duration::from_secs_f64(self.received as f64 / SLOWEST);
        if count > 0 && self.start.elapsed() > longest {
            return Err(io::Error::new(io::ErrorKind::TimedOut, "the server sends too slowly"));
        }
        Ok(count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_have_kinds() {
        for (address, is_encrypted, is_here) in [
            ("http://127.0.0.1:80/a", false, true),
            ("HTTPS://me:secret@localhost/a?b", true, true),
            ("http://[::1]:8080/a", false, true),
            ("https://example.org/127.0.0.1", true, false),
            ("http://127.0.0.1.example.org/", false, false),
        ] {
            assert!(Kind::of(address) == Kind { is_encrypted, is_here }, "{address}");
        }
    }
}
