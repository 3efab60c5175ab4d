//! Answers to requests.

use perimelt_core::log::{BodyInfo, CloudField, Log, LogError, LoggedCloud};
use serde_json::{Value, json};

use super::http::{Reply, Request};
use super::store::{Store, fingerprint, range_of};
use super::{describe, page};
use crate::component::{TENSOR, VECTOR};
use crate::melt_pool::Travel;
use crate::quantity::scalar::scalar;
use crate::unit::{pretty_name, pretty_unit};

/// Sent with every answer: the page loads nothing but its own files, and no other site gets an answer.
const ALWAYS: [(&str, &str); 5] = [
    (
        "Content-Security-Policy",
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; \
         img-src 'self' data: blob:; media-src blob:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    ),
    ("X-Content-Type-Options", "nosniff"),
    ("Cross-Origin-Resource-Policy", "same-origin"),
    ("Referrer-Policy", "no-referrer"),
    ("Cache-Control", "no-store"),
];

const TEXT: &str = "text/plain; charset=utf-8";
const JSON: &str = "application/json";
const BINARY: &str = "application/octet-stream";

/// Answers of the server.
pub(super) struct Answer {
    /// the logs, the first one first
    pub(super) stores: Vec<Store>,
    pub(super) travel: Travel,
    /// whether temperatures are shown in degrees Celsius at first
    pub(super) celsius: bool,
    /// what the header `Host` may be
    pub(super) hosts: [String; 2],
}

impl Reply {
    fn new(media_type: &'static str, body: impl Into<Vec<u8>>) -> Reply {
        Reply {
            status: 200,
            media_type,
            body: body.into(),
            headers: Vec::new(),
        }
    }

    fn json(value: &Value) -> Reply {
        Reply::new(JSON, value.to_string())
    }

    fn refusal(status: u16, why: impl Into<String>) -> Reply {
        Reply {
            status,
            ..Reply::new(TEXT, why.into() + "\n")
        }
    }

    fn with(mut self, header: &'static str, value: impl Into<String>) -> Reply {
        self.headers.push((header, value.into()));
        self
    }
}

impl From<LogError> for Reply {
    fn from(error: LogError) -> Reply {
        let status = match error {
            LogError::UnknownBody { .. } | LogError::NoSuchMessage { .. } => 404,
            // a damaged state is left out by the page
            LogError::Damaged { .. } => 410,
            _ => 500,
        };
        Reply::refusal(status, error.to_string())
    }
}

impl Answer {
    /// The answer to a request; `None` for what is no request.
    pub(super) fn to(&self, request: Option<&Request>) -> Reply {
        let mut reply = match request {
            None => Reply::refusal(400, "expected a request of HTTP/1.1"),
            Some(request) if !self.hosts.iter().any(|h| h == request.header("host")) => {
                Reply::refusal(403, format!("expected the host {}", self.hosts[0]))
            }
            Some(request) if request.method != "GET" => {
                Reply::refusal(405, "expected the method GET")
            }
            Some(request) => self
                .get(&request.target, request.header("if-none-match"))
                .unwrap_or_else(|refusal| refusal),
        };
        let always = ALWAYS
            .iter()
            .map(|(name, value)| (*name, (*value).to_owned()));
        reply.headers.extend(always);
        reply
    }

    fn get(&self, url: &str, known: &str) -> Result<Reply, Reply> {
        let path = url.split('?').next().unwrap_or_default();
        let parts: Option<Vec<String>> = path.split('/').skip(1).map(decoded).collect();
        let parts = parts.ok_or_else(|| Reply::refusal(400, "the address is not UTF-8"))?;
        let parts: Vec<&str> = parts.iter().map(String::as_str).collect();
        match parts[..] {
            [""] => Ok(file(page::index())),
            ["page", name] => page::find(name)
                .map(file)
                .ok_or_else(|| Reply::refusal(404, format!("the page has no file `{name}`"))),
            ["log", log, ref rest @ ..] => {
                let of_log = self.of_log(number(log)?, path, rest, known);
                of_log.unwrap_or_else(|| Err(nothing_at(path)))
            }
            ref rest => {
                let of_log = self.of_log(0, path, rest, known);
                of_log.unwrap_or_else(|| Err(nothing_at(path)))
            }
        }
    }

    /// The answer of a log; `None` if there is no log of this number.
    fn of_log(
        &self,
        log: usize,
        path: &str,
        parts: &[&str],
        known: &str,
    ) -> Option<Result<Reply, Reply>> {
        let of_log = LogAnswer {
            answer: self,
            store: self.stores.get(log)?,
        };
        Some(of_log.get(path, parts, known))
    }

    /// `/run.json` of a log, with what holds for all of them.
    fn run(&self, store: &Store) -> Result<Value, LogError> {
        let mut run = describe::run(store)?;
        run["logs"] = json!(self.stores.len());
        run["celsius"] = json!(self.celsius);
        Ok(run)
    }
}

/// Answers for one log.
struct LogAnswer<'a> {
    answer: &'a Answer,
    store: &'a Store,
}

impl LogAnswer<'_> {
    fn get(&self, path: &str, parts: &[&str], known: &str) -> Result<Reply, Reply> {
        match *parts {
            ["run.json"] => Ok(Reply::json(&self.answer.run(self.store)?)),
            ["series.json"] => Ok(Reply::json(&describe::series(&self.store.refreshed()))),
            ["sources.json"] => Ok(Reply::json(&describe::sources(&self.store.log()))),
            ["melt-pool", name] => {
                let log = self.store.log();
                let body = body(&log, name)?;
                let pools = describe::melt_pool(self.store, body, self.answer.travel)?;
                Ok(Reply::json(&pools))
            }
            ["points", body, state] => self.points(body, number(state)?, known),
            ["field", body, name, state] => self.field(body, name, number(state)?),
            ["vector", body, name, state] => self.vector(body, name, number(state)?),
            ["range", body, name] => self.range(body, name),
            ["point", body, point, state] => self.point(body, number(point)?, number(state)?),
            ["history", body, name, place] => self.history(body, name, place),
            _ => Err(nothing_at(path)),
        }
    }

    /// Positions with their fingerprint, or nothing if the page has them.
    fn points(&self, name: &str, state: usize, known: &str) -> Result<Reply, Reply> {
        let cloud = self.store.cloud(name, state)?;
        let log = self.store.log();
        let reference = self.store.reference(body(&log, name)?)?;
        let positions = reference.positions(&cloud);
        let tag = format!("\"{:016x}\"", fingerprint(&positions));
        if tag == known {
            return Ok(Reply {
                status: 304,
                ..Reply::new(BINARY, [])
            });
        }
        Ok(Reply::new(BINARY, packed(positions.as_flattened())).with("ETag", tag))
    }

    fn field(&self, body: &str, name: &str, state: usize) -> Result<Reply, Reply> {
        let cloud = self.store.cloud(body, state)?;
        let scalar = scalar(&cloud, name).ok_or_else(|| no_field(&cloud, body, name))?;
        let range = range_of(&scalar.values);
        Ok(Reply::new(BINARY, packed(&scalar.values)).with("X-Range", range_text(range)))
    }

    fn vector(&self, body: &str, name: &str, state: usize) -> Result<Reply, Reply> {
        let cloud = self.store.cloud(body, state)?;
        let mut fields = cloud.fields.iter();
        let field = fields
            .find(|field| field.name == name && field.components == 3)
            .ok_or_else(|| no_field(&cloud, body, name))?;
        Ok(Reply::new(BINARY, packed(&field.values)))
    }

    fn range(&self, name: &str, of: &str) -> Result<Reply, Reply> {
        let log = self.store.log();
        let outline = self.store.outline(&body(&log, name)?.name)?;
        if !outline.fields.is_empty() && scalar(&outline, of).is_none() {
            return Err(no_field(&outline, name, of));
        }
        Ok(Reply::json(&json!(self.store.range(name, of)?)))
    }

    /// All values of a point.
    fn point(&self, name: &str, point: usize, state: usize) -> Result<Reply, Reply> {
        let cloud = self.store.cloud(name, state)?;
        let Some(position) = cloud.positions.get(point) else {
            let count = cloud.positions.len();
            let why = format!("body `{name}` has {count} points at this time, counted from 0");
            return Err(Reply::refusal(404, why));
        };
        let alone = at_point(&cloud, point);
        let fields = cloud.fields.iter().map(|field| {
            let parts: &[&str] = match field.components {
                3 => &VECTOR,
                9 => &TENSOR,
                _ => &[""],
            };
            let first = point * field.components;
            let whole = scalar(&alone, &field.name).and_then(|s| s.values.first().copied());
            json!({
                "label": pretty_name(&field.name),
                "unit": field.unit,
                "shown_unit": pretty_unit(&field.unit),
                "value": whole,
                "parts": parts,
                "values": field.values[first..first + field.components],
            })
        });
        let fields: Vec<Value> = fields.collect();
        Ok(Reply::json(
            &json!({ "point": point, "position": position, "fields": fields }),
        ))
    }

    /// One number in all states that can be read, of the point nearest in the reference position to a place such as
    /// `0.01,0,-0.002` (m); `null` while there is none within a spacing. Bodies that grow number their points anew.
    fn history(&self, name: &str, of: &str, place: &str) -> Result<Reply, Reply> {
        let place = place_of(place)?;
        let log = self.store.log();
        let body = body(&log, name)?;
        let outline = self.store.outline(&body.name)?;
        if !outline.fields.is_empty() && scalar(&outline, of).is_none() {
            return Err(no_field(&outline, name, of));
        }
        let reference = self.store.reference(body)?;
        let (mut times, mut values) = (Vec::new(), Vec::new());
        for state in 0..log.times(&body.name).len() {
            let cloud = match log.cloud(&body.name, state) {
                Err(LogError::Damaged { .. }) => continue,
                cloud => cloud?,
            };
            let positions = reference.positions(&cloud);
            let point = nearest(positions.iter(), place, body.spacing);
            let value = point.and_then(|point| scalar(&at_point(&cloud, point), of));
            times.push(cloud.time);
            values.push(value.and_then(|s| s.values.first().copied()));
        }
        Ok(Reply::json(&json!({ "times": times, "values": values })))
    }
}

/// Number of the point next to a place (m), if there is one within a spacing (m).
fn nearest<'a>(
    positions: impl Iterator<Item = &'a [f64; 3]>,
    place: [f64; 3],
    spacing: f64,
) -> Option<usize> {
    let distance =
        |x: &[f64; 3]| -> f64 { x.iter().zip(place).map(|(x, p)| (x - p).powi(2)).sum() };
    let distances = positions.map(distance).enumerate();
    let (point, squared) = distances.min_by(|a, b| a.1.total_cmp(&b.1))?;
    (squared <= spacing * spacing).then_some(point)
}

/// Three numbers with commas between them.
fn place_of(text: &str) -> Result<[f64; 3], Reply> {
    let why = || Reply::refusal(404, format!("`{text}` is no place: expected x,y,z in m"));
    let numbers: Result<Vec<f64>, _> = text.split(',').map(str::parse).collect();
    let place: [f64; 3] = numbers
        .ok()
        .and_then(|numbers| numbers.try_into().ok())
        .ok_or_else(why)?;
    match place.iter().all(|x| x.is_finite()) {
        true => Ok(place),
        false => Err(why()),
    }
}

/// A point of a cloud by itself.
fn at_point(cloud: &LoggedCloud, point: usize) -> LoggedCloud {
    let of_point = |field: &CloudField| {
        let values = field.values.chunks_exact(field.components).nth(point);
        CloudField {
            name: field.name.clone(),
            unit: field.unit.clone(),
            components: field.components,
            values: values.map(<[f64]>::to_vec).unwrap_or_default(),
        }
    };
    LoggedCloud {
        time: cloud.time,
        positions: cloud.positions.get(point).copied().into_iter().collect(),
        fields: cloud.fields.iter().map(of_point).collect(),
    }
}

fn nothing_at(path: &str) -> Reply {
    Reply::refusal(404, format!("there is nothing at {path}"))
}

fn file(file: &'static page::File) -> Reply {
    Reply::new(file.media_type, file.text)
}

fn body<'l>(log: &'l Log, name: &str) -> Result<&'l BodyInfo, LogError> {
    let mut bodies = log.run().bodies.iter();
    bodies
        .find(|body| body.name == name)
        .ok_or_else(|| LogError::UnknownBody {
            body: name.into(),
            known: log.bodies().map(String::from).collect(),
        })
}

fn number(text: &str) -> Result<usize, Reply> {
    let why = || Reply::refusal(404, format!("`{text}` is no number of a state or a point"));
    text.parse().map_err(|_| why())
}

fn no_field(cloud: &LoggedCloud, body: &str, name: &str) -> Reply {
    let known: Vec<&str> = cloud.fields.iter().map(|f| f.name.as_str()).collect();
    let why = format!(
        "body `{body}` has no field `{name}` in the log; it has: {} (of vectors and tensors also components, such as \
         `displacement.x`)",
        known.join(", ")
    );
    Reply::refusal(404, why)
}

fn packed(values: &[f64]) -> Vec<u8> {
    values
        .iter()
        .flat_map(|value| (*value as f32).to_le_bytes())
        .collect()
}

/// `smallest largest`; empty if no value is finite.
fn range_text(range: Option<[f64; 2]>) -> String {
    range.map_or(String::new(), |[low, high]| format!("{low:e} {high:e}"))
}

/// A part of an address with its `%20` decoded; `None` if it is not UTF-8.
fn decoded(part: &str) -> Option<String> {
    let mut bytes = Vec::new();
    let mut rest = part.as_bytes();
    while let Some((&first, after)) = rest.split_first() {
        let code = after.first_chunk::<2>().and_then(|code| {
            let text = std::str::from_utf8(code).ok()?;
            u8::from_str_radix(text, 16).ok()
        });
        match code {
            Some(byte) if first == b'%' => {
                bytes.push(byte);
                rest = &after[2..];
            }
            _ => {
                bytes.push(first);
                rest = after;
            }
        }
    }
    String::from_utf8(bytes).ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_of_addresses_are_decoded() {
        assert_eq!(decoded("weld%20bead").as_deref(), Some("weld bead"));
        assert_eq!(decoded("%c3%bc").as_deref(), Some("ü"));
        assert_eq!(decoded("100%").as_deref(), Some("100%"));
        assert_eq!(decoded("%zz").as_deref(), Some("%zz"));
        assert_eq!(decoded("%ff"), None);
    }

    #[test]
    fn numbers_are_packed_as_little_endian_singles() {
        assert_eq!(packed(&[1.0]), [0, 0, 128, 63]);
        assert_eq!(range_text(Some([-1.5, 2.0])), "-1.5e0 2e0");
        assert_eq!(range_text(None), "");
    }
}
