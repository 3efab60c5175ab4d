//! The part of HTTP that the page needs: requests without a body, one for each connection.
//!
//! A thread serves a connection and ends with it. Browsers open several connections and keep them; a pool of threads lets
//! requests wait behind idle connections for minutes (`tiny_http` 0.12 did in a test).

use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Duration;

/// Most bytes of a request.
const LONGEST: usize = 1 << 14;

/// Connections at a time; further ones are closed. A browser opens six.
const MOST: usize = 64;

/// Time for a client to send its request, and to take up a part of the answer.
const PATIENCE: Duration = Duration::from_secs(30);

/// A request.
pub(super) struct Request {
    pub(super) method: String,
    /// path, and what follows it
    pub(super) target: String,
    headers: Vec<(String, String)>,
}

impl Request {
    /// The request in a head; `None` if it is not one of HTTP/1.
    fn parse(head: &str) -> Option<Request> {
        let mut lines = head.split("\r\n");
        let mut first = lines.next()?.split(' ');
        let (method, target, version) = (first.next()?, first.next()?, first.next()?);
        if !version.starts_with("HTTP/1.") || first.next().is_some() {
            return None;
        }
        let header = |line: &str| {
            let (name, value) = line.split_once(':')?;
            Some((name.to_ascii_lowercase(), value.trim().to_owned()))
        };
        let lines = lines.filter(|line| !line.is_empty());
        Some(Request {
            method: method.into(),
            target: target.into(),
            headers: lines.map(header).collect::<Option<_>>()?,
        })
    }

    /// Value of a header, by its name in small letters; empty if it is missing or there are several.
    pub(super) fn header(&self, name: &str) -> &str {
        let mut found = self.headers.iter().filter(|(n, _)| n == name);
        match (found.next(), found.next()) {
            (Some((_, value)), None) => value,
            _ => "",
        }
    }
}

/// An answer.
pub(super) struct Reply {
    pub(super) status: u16,
    pub(super) media_type: &'static str,
    pub(super) body: Vec<u8>,
    pub(super) headers: Vec<(&'static str, String)>,
}

impl Reply {
    fn send(&self, stream: &mut TcpStream) -> io::Result<()> {
        let reason = match self.status {
            200 => "OK",
            304 => "Not Modified",
            400 => "Bad Request",
            403 => "Forbidden",
            404 => "Not Found",
            405 => "Method Not Allowed",
            410 => "Gone",
            _ => "Internal Server Error",
        };
        let mut head = format!(
            "HTTP/1.1 {} {reason}\r\nContent-Type: {}\r\nContent-Length: {}\r\nConnection: close\r\n",
            self.status,
            self.media_type,
            self.body.len()
        );
        for (name, value) in &self.headers {
            head += &format!("{name}: {value}\r\n");
        }
        head += "\r\n";
        stream.write_all(head.as_bytes())?;
        stream.write_all(&self.body)?;
        stream.flush()
    }
}

/// Answers all requests, without end.
pub(super) fn serve(listener: &TcpListener, answer: impl Fn(Option<&Request>) -> Reply + Sync) {
    let active = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        for stream in listener.incoming() {
            let Ok(stream) = stream else {
                // a client that is gone, or too many open files, which takes a while to change
                std::thread::sleep(Duration::from_millis(10));
                continue;
            };
            if active.fetch_add(1, Ordering::Relaxed) >= MOST {
                active.fetch_sub(1, Ordering::Relaxed);
                continue;
            }
            let (active, answer) = (&active, &answer);
            scope.spawn(move || {
                // a client that goes away is no error of the server
                let _ = converse(stream, answer);
                active.fetch_sub(1, Ordering::Relaxed);
            });
        }
    });
}

fn converse(mut stream: TcpStream, answer: impl Fn(Option<&Request>) -> Reply) -> io::Result<()> {
    stream.set_read_timeout(Some(PATIENCE))?;
    stream.set_write_timeout(Some(PATIENCE))?;
    let request = head(&mut stream)?.and_then(|head| Request::parse(&head));
    answer(request.as_ref()).send(&mut stream)?;
    stream.shutdown(Shutdown::Write)?;
    // what is closed with unread input loses the answer
    stream.set_read_timeout(Some(Duration::from_secs(1)))?;
    io::copy(&mut stream.take(LONGEST as u64), &mut io::sink())?;
    Ok(())
}

/// What comes before the first empty line; `None` if it is too long or not UTF-8.
fn head(stream: &mut TcpStream) -> io::Result<Option<String>> {
    let mut bytes = Vec::new();
    let mut part = [0; 2048];
    loop {
        let end = bytes.windows(4).position(|w| w == b"\r\n\r\n");
        if let Some(end) = end {
            bytes.truncate(end);
            return Ok(String::from_utf8(bytes).ok());
        }
        if bytes.len() > LONGEST {
            return Ok(None);
        }
        match stream.read(&mut part)? {
            0 => return Err(io::ErrorKind::UnexpectedEof.into()),
            read => bytes.extend_from_slice(&part[..read]),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_are_parsed() {
        let request = Request::parse("GET /a?b HTTP/1.1\r\nHost:  me:1 \r\nX-Y: 1:2");
        let request = request.expect("a request");
        assert_eq!((&request.method[..], &request.target[..]), ("GET", "/a?b"));
        assert_eq!(
            (request.header("host"), request.header("x-y")),
            ("me:1", "1:2")
        );
        assert_eq!(request.header("cookie"), "");
        for head in [
            "",
            "GET /",
            "GET / HTTP/2",
            "GET / / HTTP/1.1",
            "GET / HTTP/1.1\r\nno header",
        ] {
            assert!(Request::parse(head).is_none(), "{head}");
        }
        // which of two is meant is not known
        let twice = Request::parse("GET / HTTP/1.1\r\nHost: a\r\nHost: b").expect("a request");
        assert_eq!(twice.header("host"), "");
    }
}
