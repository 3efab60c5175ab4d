//! The part of HTTP that the page needs: requests without a body, one for each connection.
//!
//! A thread serves a connection and ends with it. Each request has a time limit as a whole, and when there are too many connections
//! idle ones are closed, the oldest first, so that slow clients do not block others.
//! Browsers open several connections and keep them; a pool of threads lets
//! requests wait behind idle connections for minutes (`tiny_http` 0.12 did in a test).

use std::io::{self, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Most bytes of a request.
const LONGEST: usize = 1 << 14;

/// Connections at a time. A browser opens six. A further one replaces the oldest idle one.
const MOST: usize = 64;

/// Time for a client to send its whole request. A browser takes milliseconds.
const ASKING: Duration = Duration::from_secs(10);

/// Time for a client to take up an answer, and more of it for each megabyte.
const TAKING: Duration = Duration::from_secs(30);

/// Time for what a client still sends after its request.
const LEAVING: Duration = Duration::from_secs(1);

/// A request.
pub(super) struct Request {
    pub(super) method: String,
    /// path, and what follows it
    pub(super) target: String,
    headers: Vec<(String, String)>,
}

impl Request {
    /// The request in a head; `None` if it is not one of HTTP/1.
    pub(super) fn parse(head: &str) -> Option<Request> {
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

    /// Number of headers of a name in lower case.
    #[cfg(any(feature = "live", test))]
    pub(super) fn count(&self, name: &str) -> usize {
        self.headers.iter().filter(|(n, _)| n == name).count()
    }

    /// Value of a header, by its name in lower case; empty if it is missing or there are several.
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
        let seconds = 1 + self.body.len() as u32 / (1 << 20);
        let deadline = Instant::now() + TAKING * seconds;
        for part in [head.as_bytes(), &self.body] {
            let mut rest = part;
            while !rest.is_empty() {
                stream.set_write_timeout(Some(left(deadline)?))?;
                match stream.write(rest)? {
                    0 => return Err(io::ErrorKind::WriteZero.into()),
                    written => rest = &rest[written..],
                }
            }
        }
        stream.flush()
    }
}

/// Time until a deadline; an error when it has passed.
fn left(deadline: Instant) -> io::Result<Duration> {
    let left = deadline.saturating_duration_since(Instant::now());
    if left.is_zero() {
        return Err(io::ErrorKind::TimedOut.into());
    }
    Ok(left)
}

/// The open connections, the oldest first.
#[derive(Default)]
struct Connections(Mutex<Vec<OpenConnection>>);

struct OpenConnection {
    number: u64,
    stream: TcpStream,
    /// Whether its answer is being computed; else it is idle.
    is_answered: bool,
}

impl Connections {
    fn change<T>(&self, change: impl FnOnce(&mut Vec<OpenConnection>) -> T) -> T {
        change(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Adds a connection, in place of the oldest idle one if there are too many; false if none is idle.
    fn admit(&self, number: u64, stream: &TcpStream) -> bool {
        let Ok(stream) = stream.try_clone() else {
            return false;
        };
        self.change(|open| {
            if open.len() >= MOST {
                let Some(oldest) = open.iter().position(|o| !o.is_answered) else {
                    return false;
                };
                let _ = open.remove(oldest).stream.shutdown(Shutdown::Both);
            }
            open.push(OpenConnection {
                number,
                stream,
                is_answered: false,
            });
            true
        })
    }

    fn set_answered(&self, number: u64, is_answered: bool) {
        self.change(|open| {
            let found = open.iter_mut().find(|o| o.number == number);
            found.into_iter().for_each(|o| o.is_answered = is_answered);
        });
    }

    fn close(&self, number: u64) {
        self.change(|open| open.retain(|o| o.number != number));
    }
}

/// Answers all requests, without end.
pub(super) fn serve(listener: &TcpListener, answer: impl Fn(Option<&Request>) -> Reply + Sync) {
    let connections = Connections::default();
    std::thread::scope(|scope| {
        for (number, stream) in (0..).zip(listener.incoming()) {
            let Ok(stream) = stream else {
                // a client that is gone, or too many open files, which takes a while to change
                std::thread::sleep(Duration::from_millis(10));
                continue;
            };
            if !connections.admit(number, &stream) {
                continue;
            }
            let (connections, answer) = (&connections, &answer);
            scope.spawn(move || {
                let answered = |request: Option<&Request>| {
                    connections.set_answered(number, true);
                    let reply = answer(request);
                    connections.set_answered(number, false);
                    reply
                };
                // a client that goes away is no error of the server
                let _ = converse(stream, answered);
                connections.close(number);
            });
        }
    });
}

fn converse(mut stream: TcpStream, answer: impl Fn(Option<&Request>) -> Reply) -> io::Result<()> {
    let asked = head(&mut stream, Instant::now() + ASKING)?;
    let request = asked.and_then(|(head, _)| Request::parse(&head));
    answer(request.as_ref()).send(&mut stream)?;
    stream.shutdown(Shutdown::Write)?;
    // what is closed with unread input loses the answer
    let deadline = Instant::now() + LEAVING;
    let mut part = [0; 2048];
    for _ in 0..LONGEST / part.len() {
        stream.set_read_timeout(Some(left(deadline)?))?;
        if stream.read(&mut part)? == 0 {
            break;
        }
    }
    Ok(())
}

/// The text before the first empty line, read until a deadline, and the bytes after it; `None` if it is too long or not UTF-8.
pub(super) fn head(
    stream: &mut TcpStream,
    deadline: Instant,
) -> io::Result<Option<(String, Vec<u8>)>> {
    let mut bytes = Vec::new();
    let mut part = [0; 2048];
    loop {
        let end = bytes.windows(4).position(|w| w == b"\r\n\r\n");
        if let Some(end) = end {
            let rest = bytes.split_off(end).split_off(4);
            return Ok(String::from_utf8(bytes).ok().map(|head| (head, rest)));
        }
        if bytes.len() > LONGEST {
            return Ok(None);
        }
        stream.set_read_timeout(Some(left(deadline)?))?;
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
    fn slow_connections_keep_nobody_away() {
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let address = listener.local_addr().expect("an address");
        std::thread::spawn(move || {
            serve(&listener, |_| Reply {
                status: 200,
                media_type: "text/plain",
                body: b"here".to_vec(),
                headers: Vec::new(),
            });
        });
        // more connections than are served at a time, none of which completes its request
        let slow: Vec<TcpStream> = (0..3 * MOST)
            .map(|_| {
                let mut stream = TcpStream::connect(address).expect("it listens");
                // a connection that was closed for another one takes no more
                let _ = stream.write_all(b"GET / HTTP/1.1\r\n");
                stream
            })
            .collect();
        let started = Instant::now();
        let mut client = TcpStream::connect(address).expect("it listens");
        client
            .write_all(b"GET / HTTP/1.1\r\n\r\n")
            .expect("it is served");
        let mut answer = String::new();
        client.read_to_string(&mut answer).expect("an answer");
        assert!(answer.ends_with("here"), "{answer}");
        assert!(started.elapsed() < ASKING / 2);
        drop(slow);
    }

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
