//! The messages of a log for viewers that speak the WebSocket protocol of Foxglove: `perimelt view --live`.
//!
//! Every viewer gets the newest state when it subscribes, then each message as the run writes it. Messages are those of
//! the log, byte by byte; checkpoints are left out. The clock of the viewer is the simulated time.

use std::collections::BTreeMap;
use std::net::{Ipv4Addr, TcpListener};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use foxglove::websocket::{Capability, ChannelView, Client, ServerListener};
use foxglove::{ChannelId, Context, FoxgloveError, PartialMetadata, RawChannel, Schema};
use foxglove::{SinkId, WebSocketServerHandle};
use perimelt_core::log::{Channel, Follow, Log, LogError, RawMessage};

use super::{ViewError, gate};
use crate::terminal::tell;

/// Polling interval for the file.
const INTERVAL: Duration = Duration::from_millis(100);

/// Messages queued for a slow viewer; older ones are dropped.
const BACKLOG: usize = 256;

/// A channel and its newest message.
struct Published {
    channel: Arc<RawChannel>,
    time: PartialMetadata,
    data: Vec<u8>,
}

/// Subscriptions that have not been answered with the newest message.
#[derive(Default)]
struct Subscriptions(Mutex<Vec<(ChannelId, Option<SinkId>)>>);

impl Subscriptions {
    fn take(&self) -> Vec<(ChannelId, Option<SinkId>)> {
        std::mem::take(&mut *self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl ServerListener for Subscriptions {
    fn on_subscribe(&self, client: Client, channel: ChannelView) {
        let mut new = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        new.push((channel.id(), client.sink_id()));
    }
}

/// The served data.
struct Live {
    path: PathBuf,
    follow: Follow,
    context: Arc<Context>,
    server: WebSocketServerHandle,
    subscriptions: Arc<Subscriptions>,
    /// by topic
    published: BTreeMap<String, Published>,
}

/// Serves the messages of a log on a port of 127.0.0.1, on a thread of its own; returns the address.
///
/// # Errors
/// The log cannot be read, or the port cannot be used.
pub(super) fn serve(path: &Path, port: u16) -> Result<String, ViewError> {
    let unusable = |error: FoxgloveError| ViewError::Port {
        port,
        source: std::io::Error::other(error),
    };
    let unused = |source| ViewError::Port { port, source };
    let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port)).map_err(unused)?;
    let shown = listener.local_addr().map_err(unused)?.port();
    let behind = gate::hidden_address();
    let context = Context::new();
    let subscriptions = Arc::new(Subscriptions::default());
    let server = context
        .websocket_server()
        .name("Perimelt")
        .bind(&behind, 0)
        .capabilities([Capability::Time])
        .message_backlog_size(BACKLOG)
        .listener(subscriptions.clone())
        .start_blocking()
        .map_err(unusable)?;
    let address = format!("ws://127.0.0.1:{shown}");
    let behind = format!("{behind}:{}", server.port());
    let behind = behind
        .parse()
        .map_err(|e| unused(std::io::Error::other(e)))?;
    gate::serve(listener, behind).map_err(unused)?;
    let mut live = Live {
        path: path.into(),
        follow: Log::open(path)?.follow(),
        context,
        server,
        subscriptions,
        published: BTreeMap::new(),
    };
    thread::spawn(move || {
        loop {
            match live.update() {
                Ok(()) => thread::sleep(INTERVAL),
                Err(error) => return tell(&format!("note: `--live` has ended: {error}")),
            }
        }
    });
    Ok(address)
}

impl Live {
    /// Publishes the newest messages to new subscribers, then what is new in the log.
    fn update(&mut self) -> Result<(), LogError> {
        // a run that has just been started has no log yet that can be read
        if self.follow.is_replaced()
            && let Ok(log) = Log::open(&self.path)
        {
            self.follow = log.follow();
            for published in std::mem::take(&mut self.published).into_values() {
                published.channel.close();
            }
            self.server.clear_session(None);
        }
        let subscribed = self.subscriptions.take();
        for Published {
            channel,
            time,
            data,
        } in self.published.values()
        {
            for (_, sink) in subscribed.iter().filter(|(id, _)| *id == channel.id()) {
                channel.log_with_meta_to_sink(data, *time, *sink);
                self.server
                    .broadcast_time(time.log_time.unwrap_or_default());
            }
        }
        self.follow.visit(|message| {
            publish(&self.context, &mut self.published, &message);
            self.server.broadcast_time(message.log_time);
        })
    }
}

fn publish(
    context: &Arc<Context>,
    published: &mut BTreeMap<String, Published>,
    message: &RawMessage,
) {
    let Channel {
        topic,
        encoding,
        schema,
    } = message.channel;
    let channel = match published.get(topic) {
        Some(before) => before.channel.clone(),
        None => {
            let schema = Schema::new(&schema.name, &schema.encoding, schema.data.clone());
            let channel = context.channel_builder(topic);
            let channel = channel.message_encoding(encoding).schema(schema);
            // fails only without an encoding
            match channel.build_raw() {
                Ok(channel) => channel,
                Err(_) => return,
            }
        }
    };
    let newest = Published {
        channel,
        time: PartialMetadata::with_log_time(message.log_time),
        data: message.data.to_vec(),
    };
    newest.channel.log_with_meta(&newest.data, newest.time);
    published.insert(topic.clone(), newest);
}
