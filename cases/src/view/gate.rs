//! Filter of connections to `--live`: viewers are admitted, pages of other sites are not.
//!
//! A browser lets every page open a WebSocket to every address, and names the site of the page in the header `Origin`. The server
//! of the protocol does not check it. It listens on a random address of the loopback network; the address that users give to
//! viewers leads here, where the head of each connection is checked and then forwarded with all that follows.

use std::io::{self, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use super::http::{Request, head};

/// Origins of viewers.
const VIEWERS: [&str; 3] = [
    "https://app.foxglove.dev",
    "https://studio.foxglove.dev",
    // the desktop program of Foxglove
    "file://",
];

/// Connections at a time.
const MOST: usize = 32;

/// A random address for the server behind, out of the 16 million of the loopback network where the system has them.
pub(super) fn hidden_address() -> String {
    use std::hash::{BuildHasher, RandomState};
    let random = RandomState::new().hash_one(0);
    let [a, b, c, ..] = random.to_le_bytes();
    let address = format!("127.{a}.{b}.{}", c.clamp(2, 253));
    match TcpListener::bind((address.as_str(), 0)) {
        Ok(_) => address,
        Err(_) => "127.0.0.1".into(),
    }
}

/// Whether the head of a connection is that of a viewer: it names this computer as its host, and comes from a program or a page of
/// a viewer.
fn is_viewer(head: &str, port: u16) -> bool {
    let Some(request) = Request::parse(head) else {
        return false;
    };
    let host = request.header("host");
    let is_here = ["127.0.0.1", "localhost"]
        .iter()
        .any(|name| host == format!("{name}:{port}"));
    let origins = request.count("origin");
    let is_known = VIEWERS.contains(&request.header("origin"));
    is_here && (origins == 0 || is_known)
}

/// Passes the connections of viewers on to the server at `behind`, on threads of their own.
pub(super) fn serve(listener: TcpListener, behind: SocketAddr) -> io::Result<()> {
    let port = listener.local_addr()?.port();
    let active = Arc::new(AtomicUsize::new(0));
    std::thread::Builder::new()
        .name("live".into())
        .spawn(move || {
            for stream in listener.incoming() {
                let Ok(stream) = stream else {
                    std::thread::sleep(Duration::from_millis(10));
                    continue;
                };
                if active.load(Ordering::Relaxed) >= MOST {
                    continue;
                }
                active.fetch_add(1, Ordering::Relaxed);
                let active = active.clone();
                std::thread::spawn(move || {
                    // a viewer that goes away is no error
                    let _ = pass(stream, port, behind);
                    active.fetch_sub(1, Ordering::Relaxed);
                });
            }
        })?;
    Ok(())
}

fn pass(mut viewer: TcpStream, port: u16, behind: SocketAddr) -> io::Result<()> {
    let deadline = Instant::now() + Duration::from_secs(10);
    let asked = head(&mut viewer, deadline)?;
    let Some((head, rest)) = asked.filter(|(head, _)| is_viewer(head, port)) else {
        let refusal = "HTTP/1.1 403 Forbidden\r\nConnection: close\r\nContent-Length: 0\r\n\r\n";
        return viewer.write_all(refusal.as_bytes());
    };
    viewer.set_read_timeout(None)?;
    let mut server = TcpStream::connect(behind)?;
    server.write_all(format!("{head}\r\n\r\n").as_bytes())?;
    server.write_all(&rest)?;
    let (mut from_server, mut to_viewer) = (server.try_clone()?, viewer.try_clone()?);
    let back = std::thread::spawn(move || {
        let _ = copy(&mut from_server, &mut to_viewer);
    });
    let _ = copy(&mut viewer, &mut server);
    let _ = back.join();
    Ok(())
}

/// Forwards bytes and their end.
fn copy(from: &mut TcpStream, to: &mut TcpStream) -> io::Result<()> {
    let mut part = vec![0; 1 << 16];
    let mut pass = || -> io::Result<()> {
        loop {
            match from.read(&mut part)? {
                0 => return Ok(()),
                read => to.write_all(&part[..read])?,
            }
        }
    };
    let passed = pass();
    let _ = match passed {
        Ok(()) => to.shutdown(Shutdown::Write),
        Err(_) => from
            .shutdown(Shutdown::Both)
            .and(to.shutdown(Shutdown::Both)),
    };
    passed
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ask(port: u16, headers: &str) -> String {
        let mut stream = TcpStream::connect(("127.0.0.1", port)).expect("it listens");
        let head = format!("GET / HTTP/1.1\r\n{headers}\r\n\r\nmore");
        stream.write_all(head.as_bytes()).expect("taken");
        stream.shutdown(Shutdown::Write).expect("open");
        let mut answer = String::new();
        stream.read_to_string(&mut answer).expect("text");
        answer
    }

    #[test]
    fn pages_of_other_sites_are_refused() {
        // the server behind returns what it gets
        let echo = TcpListener::bind((hidden_address(), 0)).expect("an address");
        let behind = echo.local_addr().expect("an address");
        std::thread::spawn(move || {
            for stream in echo.incoming().flatten() {
                std::thread::spawn(move || {
                    let mut stream = stream;
                    let mut part = [0; 1024];
                    while let Ok(read @ 1..) = stream.read(&mut part) {
                        let _ = stream.write_all(&part[..read]);
                    }
                });
            }
        });
        let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
        let port = listener.local_addr().expect("an address").port();
        serve(listener, behind).expect("served");
        let here = format!("Host: localhost:{port}");
        for (headers, is_passed) in [
            (here.clone(), true),
            (format!("{here}\r\nOrigin: https://app.foxglove.dev"), true),
            (format!("{here}\r\nOrigin: https://evil.example"), false),
            (format!("{here}\r\nOrigin: null"), false),
            (format!("{here}\r\nOrigin: "), false),
            (
                format!("{here}\r\nOrigin: file://\r\nOrigin: https://evil.example"),
                false,
            ),
            ("Host: evil.example".into(), false),
            ("X: y".into(), false),
        ] {
            let answer = ask(port, &headers);
            if is_passed {
                assert!(answer.starts_with("GET / ") && answer.ends_with("\r\n\r\nmore"));
            } else {
                assert!(answer.starts_with("HTTP/1.1 403 "), "{headers}: {answer}");
            }
        }
    }
}
