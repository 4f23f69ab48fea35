//! A small HTTP server on 127.0.0.1 that counts what it sends and can be told to misbehave.

#![allow(dead_code)]

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};
use std::time::Duration;

/// A request for a file.
#[derive(Clone, Debug)]
pub struct Asked {
    /// The path without the leading slash, and without the query.
    pub path: String,
    pub query: String,
    pub range: Option<Range<u64>>,
    pub authorization: Option<String>,
    /// How many requests for this path came before.
    pub number: usize,
}

/// How a request is answered.
#[derive(Clone, Debug)]
pub enum Manner {
    /// As it should be.
    Well,
    /// The whole file with status 200, whatever was asked for.
    Whole,
    /// As it should be, but nothing more after so many bytes of the body.
    Stall(u64),
    /// As it should be, but one byte at a time with pauses.
    Drip(Duration),
    /// The connection ends after so many bytes of the body.
    Die(u64),
    /// The connection ends without an answer.
    Hang,
    /// No answer at all, for a while.
    Silence,
    /// A status and its headers, without a body.
    Status(u16, Vec<(&'static str, String)>),
    /// As it should be, with other or more headers.
    Headers(Vec<(&'static str, String)>),
    /// As it should be, but with so many bytes more in the body and in Content-Length.
    Longer(u64),
}

/// The answer to a request.
#[derive(Clone, Debug)]
pub struct Sent {
    pub asked: Asked,
    pub bytes: u64,
}

type Manners = dyn Fn(&Asked) -> Manner + Send + Sync;

struct State {
    files: BTreeMap<String, Vec<u8>>,
    manners: Box<Manners>,
    log: Mutex<Vec<Sent>>,
    seen: Mutex<BTreeMap<String, usize>>,
    over: AtomicBool,
}

/// The server. It ends when it is dropped.
pub struct Server {
    at: SocketAddr,
    state: Arc<State>,
}

impl Server {
    /// Serves files as a server should.
    pub fn new(files: impl IntoIterator<Item = (String, Vec<u8>)>) -> Self {
        Self::with(files, |_| Manner::Well)
    }

    pub fn with(
        files: impl IntoIterator<Item = (String, Vec<u8>)>,
        manners: impl Fn(&Asked) -> Manner + Send + Sync + 'static,
    ) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let at = listener.local_addr().unwrap();
        let state = Arc::new(State {
            files: files.into_iter().collect(),
            manners: Box::new(manners),
            log: Mutex::default(),
            seen: Mutex::default(),
            over: AtomicBool::new(false),
        });
        let shared = state.clone();
        std::thread::spawn(move || {
            for stream in listener.incoming().map_while(Result::ok) {
                if shared.over.load(Ordering::Relaxed) {
                    return;
                }
                // Headers and body are two writes, the second of which would wait for the client.
                stream.set_nodelay(true).unwrap();
                let state = shared.clone();
                std::thread::spawn(move || while serve(&stream, &state).is_some() {});
            }
        });
        Self { at, state }
    }

    /// The address of a file.
    pub fn address(&self, name: &str) -> String {
        format!("http://{}/{name}", self.at)
    }

    /// The host and port.
    pub fn host(&self) -> String {
        self.at.to_string()
    }

    /// The answers so far; the record is emptied.
    pub fn sent(&self) -> Vec<Sent> {
        std::mem::take(&mut self.state.log.lock().unwrap())
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.state.over.store(true, Ordering::Relaxed);
        let _ = TcpStream::connect(self.at);
    }
}

/// The sum of the bytes of bodies.
pub fn bytes(sent: &[Sent]) -> u64 {
    sent.iter().map(|sent| sent.bytes).sum()
}

fn asked(stream: &TcpStream, state: &State) -> Option<Asked> {
    let mut reader = BufReader::new(stream);
    let mut line = String::new();
    reader.read_line(&mut line).ok()?;
    let target = line.split(' ').nth(1)?.trim_start_matches('/').to_owned();
    let (path, query) = target.split_once('?').unwrap_or((&target, ""));
    let (mut range, mut authorization) = (None, None);
    loop {
        let mut line = String::new();
        reader.read_line(&mut line).ok()?;
        let Some((name, value)) = line.trim().split_once(':') else { break };
        match name.to_ascii_lowercase().as_str() {
            "range" => {
                let (from, to) = value.trim().strip_prefix("bytes=")?.split_once('-')?;
                range = Some(from.parse().ok()?..to.parse::<u64>().ok()? + 1);
            }
            "authorization" => authorization = Some(value.trim().to_owned()),
            _ => {}
        }
    }
    let mut seen = state.seen.lock().unwrap();
    let number = seen.entry(path.to_owned()).or_default();
    *number += 1;
    Some(Asked { path: path.to_owned(), query: query.to_owned(), range, authorization, number: *number - 1 })
}

/// Answers one request. None ends the connection.
fn serve(stream: &TcpStream, state: &State) -> Option<()> {
    let asked = asked(stream, state)?;
    let mut manner = (state.manners)(&asked);
    let file = state.files.get(&asked.path);
    if file.is_none() && !matches!(manner, Manner::Status(..)) {
        manner = Manner::Status(404, Vec::new());
    }
    let none = Vec::new();
    let whole = file.unwrap_or(&none);
    let length = whole.len() as u64;
    let range = asked.range.clone().filter(|_| !matches!(manner, Manner::Whole));
    let within = range.clone().map_or(0..length, |range| range.start.min(length)..range.end.min(length));
    let mut headers: Vec<(&str, String)> = Vec::new();
    let mut status = 200;
    let mut body = whole[within.start as usize..within.end as usize].to_vec();
    if range.is_some() {
        status = 206;
        headers.push(("Content-Range", format!("bytes {}-{}/{length}", within.start, within.end.max(1) - 1)));
        if within.is_empty() {
            status = 416;
            headers = vec![("Content-Range", format!("bytes */{length}"))];
        }
    }
    match &manner {
        Manner::Status(other, more) => {
            (status, body, headers) = (*other, Vec::new(), more.clone());
        }
        Manner::Headers(others) => {
            headers.retain(|(name, _)| others.iter().all(|(other, _)| other != name));
            headers.extend(others.iter().filter(|(_, value)| !value.is_empty()).cloned());
        }
        Manner::Longer(more) => body.extend(vec![7; *more as usize]),
        Manner::Hang => return None,
        Manner::Silence => {
            state.log.lock().unwrap().push(Sent { asked, bytes: 0 });
            std::thread::sleep(Duration::from_secs(20));
            return None;
        }
        _ => {}
    }
    if !headers.iter().any(|(name, _)| *name == "Content-Length") {
        headers.push(("Content-Length", body.len().to_string()));
    }
    answer(stream, state, (asked, manner), (status, &headers, &body))
}

fn answer(
    mut stream: &TcpStream,
    state: &State,
    (asked, manner): (Asked, Manner),
    (status, headers, body): (u16, &[(&str, String)], &[u8]),
) -> Option<()> {
    let headers: String = headers.iter().map(|(name, value)| format!("{name}: {value}\r\n")).collect();
    stream.write_all(format!("HTTP/1.1 {status} X\r\n{headers}\r\n").as_bytes()).ok()?;
    let sent = match manner {
        Manner::Stall(bytes) | Manner::Die(bytes) => &body[..body.len().min(bytes as usize)],
        _ => body,
    };
    state.log.lock().unwrap().push(Sent { asked, bytes: sent.len() as u64 });
    if let Manner::Drip(pause) = manner {
        for byte in sent {
            stream.write_all(&[*byte]).ok()?;
            std::thread::sleep(pause);
        }
        return Some(());
    }
    stream.write_all(sent).ok()?;
    match manner {
        Manner::Stall(_) => {
            std::thread::sleep(Duration::from_secs(20));
            None
        }
        Manner::Die(_) => {
            let _ = stream.shutdown(std::net::Shutdown::Both);
            None
        }
        _ => Some(()),
    }
}
