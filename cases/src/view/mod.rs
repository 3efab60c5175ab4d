//! A log in the browser: `perimelt view`.
//!
//! A server on the loopback interface answers with the page, which is part of the program, and with numbers of the log:
//!
//! | address | answer |
//! |---|---|
//! | `/` and `/page/<file>` | the page |
//! | `/run.json` | case, bodies, fields, times, colours, units; whether the log grows (`describe.rs`) |
//! | `/series.json` | probes, reports, balances |
//! | `/melt-pool/<body>` | sizes of the melt pool of a body over time, from its clouds |
//! | `/points/<body>/<state>` | positions (m): at rest for a body with displacements, else current ones |
//! | `/field/<body>/<scalar>/<state>` | one number per point, named as by `perimelt plot`: `stress.xx` |
//! | `/vector/<body>/<field>/<state>` | three numbers per point |
//! | `/range/<body>/<scalar>` | smallest and largest finite value of all states; the state in which the size is largest |
//! | `/point/<body>/<number>/<state>` | all values of one point |
//! | `/history/<body>/<scalar>/<x,y,z>` | one number in all states, of the point at a place (m) at rest |
//! | `/sources.json` | places, directions and powers of the moving heat sources |
//! | `/log/<number>/...` | these answers for another log, counted from 0 |
//!
//! Arrays are `f32`, little-endian. States are counted from 0. Nothing but the log is read from the disk.
//!
//! **Who may ask.** The server listens on 127.0.0.1 only, and answers only requests that name it as their host: the page of
//! another site whose name was made to point to 127.0.0.1 gets nothing. Answers are not for other sites
//! (no CORS header), and the page loads nothing from elsewhere (content security policy). The server of `--live` is behind a gate
//! that lets viewers in (`gate.rs`).

mod answer;
mod browser;
mod describe;
#[cfg(any(feature = "live", test))]
mod gate;
mod http;
#[cfg(feature = "live")]
mod live;
mod page;
mod start;
mod store;

use std::io::{self, Write};
use std::net::{Ipv4Addr, SocketAddr, TcpListener};
use std::path::{Path, PathBuf};

use perimelt_core::log::LogError;

use crate::melt_pool::Travel;
use crate::terminal::tell;
use answer::Answer;
use store::Store;

/// What to show, and where.
#[derive(Clone, Debug, clap::Args)]
pub struct ViewArgs {
    /// log of a run, finished or under way, or a case, which is run
    pub log: PathBuf,
    /// another log or case, shown beside the first one at the same times, from the same side and with the same colours
    pub beside: Option<PathBuf>,
    /// temperatures in degrees Celsius
    #[arg(long)]
    pub celsius: bool,
    /// port on 127.0.0.1 [default: a free one]
    #[arg(long)]
    pub port: Option<u16>,
    /// also serve the messages of the log to Foxglove and other viewers of its protocol, on this port of 127.0.0.1
    #[arg(long, value_name = "PORT", num_args = 0..=1, require_equals = true, default_missing_value = "8765")]
    pub live: Option<u16>,
    /// print the address only, without opening a browser
    #[arg(long)]
    pub no_open: bool,
    /// axis along which the heat source travels, for the length of the melt pool
    #[arg(long, value_enum, default_value_t)]
    pub travel: Travel,
}

/// Why a log cannot be shown.
#[derive(Debug, thiserror::Error)]
pub enum ViewError {
    /// The run of the case cannot be started.
    #[error("cannot start the run: {0}")]
    Start(io::Error),
    /// The run of the case ended without a log.
    #[error("there is nothing to show: the run of {} has not begun", case.display())]
    NoRun {
        /// The case file.
        case: PathBuf,
    },
    /// The program has no part that serves other viewers.
    #[cfg(not(feature = "live"))]
    #[error(
        "this program cannot serve other viewers; build it with `cargo build --release --features live` for `--live`"
    )]
    NotLive,
    /// The log cannot be read.
    #[error(transparent)]
    Log(#[from] LogError),
    /// The port cannot be used.
    #[error(
        "cannot listen on 127.0.0.1:{port}: {source}; give another `--port`, or none for a free one"
    )]
    Port {
        /// The port; 0 for a free one.
        port: u16,
        /// Why not.
        source: io::Error,
    },
    /// The address cannot be printed.
    #[error(transparent)]
    Output(#[from] io::Error),
}

/// Serves a log until the program is ended.
///
/// # Errors
/// The log cannot be read, the run of the case does not begin, or a port cannot be used.
pub fn view(args: &ViewArgs, out: &mut impl Write) -> Result<(), ViewError> {
    #[cfg(not(feature = "live"))]
    if args.live.is_some() {
        return Err(ViewError::NotLive);
    }
    let mut stores = Vec::new();
    let mut paths = Vec::new();
    for shown in [Some(&args.log), args.beside.as_ref()]
        .into_iter()
        .flatten()
    {
        let path = match is_case(shown) {
            true => start::start(shown)?,
            false => shown.clone(),
        };
        stores.push(Store::open(&path)?);
        paths.push(path);
    }
    let names: Vec<String> = paths
        .iter()
        .map(|path| path.display().to_string())
        .collect();
    let port = args.port.unwrap_or(0);
    let unusable = |source| ViewError::Port { port, source };
    let listener =
        TcpListener::bind(SocketAddr::from((Ipv4Addr::LOCALHOST, port))).map_err(unusable)?;
    let port = listener.local_addr().map_err(unusable)?.port();
    let address = format!("http://127.0.0.1:{port}/");
    writeln!(
        out,
        "{address} shows {}; Ctrl-C ends it",
        names.join(" and ")
    )?;
    #[cfg(feature = "live")]
    if let Some(port) = args.live {
        writeln!(
            out,
            "{} serves it to other viewers",
            live::serve(&paths[0], port)?
        )?;
    }
    out.flush()?;
    if !args.no_open && !browser::open(&address) {
        tell("note: no browser could be opened; open the address in one");
    }
    let answer = Answer {
        stores,
        travel: args.travel,
        celsius: args.celsius,
        hosts: [format!("127.0.0.1:{port}"), format!("localhost:{port}")],
    };
    http::serve(&listener, |request| answer.to(request));
    Ok(())
}

fn is_case(path: &Path) -> bool {
    path.extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("toml"))
}
