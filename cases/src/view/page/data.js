// What the server knows of the log. Arrays are kept, the least recently used are dropped.

/** Bytes of arrays that are kept. */
const KEPT = 512 << 20;

/** An answer that is not what was asked for; `damaged` for a state that cannot be read. */
export class Refused extends Error {
  constructor(status, text) {
    super(text);
    this.damaged = status === 410;
  }
}

async function ask(path, headers = {}) {
  const response = await fetch(path, { headers, cache: "no-store" }).catch(() => {
    throw new Error("the program does not answer; is `perimelt view` still running?");
  });
  if (response.ok || response.status === 304) return response;
  throw new Refused(response.status, (await response.text()).trim());
}

const json = async (path) => (await ask(path)).json();
const root = (log) => (log ? `/log/${log}` : "");
/** Where something of a body is. */
const address = (body, what, ...parts) => `${root(body.log)}/${[what, body.name, ...parts].map(encodeURIComponent).join("/")}`;

function joined(runs) {
  const ofLog = (run, log) => (body) => ({
    ...body,
    log,
    key: log ? `${log}/${body.name}` : body.name,
    label: runs.length > 1 ? `${body.label} (${run.file})` : body.label,
  });
  return { ...runs[0], logs: runs, bodies: runs.flatMap((run, log) => run.bodies.map(ofLog(run, log))) };
}

export class Data {
  #kept = new Map();
  #bytes = 0;
  /** the last positions of each body, with their tag */
  #points = new Map();

  /** The runs of all logs as one: bodies have the `log` that they belong to, and a `key` of their own. */
  async runs() {
    const first = await json("/run.json");
    const others = Array.from({ length: first.logs - 1 }, (_, n) => json(`${root(n + 1)}/run.json`));
    return joined([first, ...(await Promise.all(others))]);
  }

  series = (log) => json(`${root(log)}/series.json`);
  sources = (log) => json(`${root(log)}/sources.json`);
  meltPool = (body) => json(address(body, "melt-pool"));
  range = (body, scalar) => json(address(body, "range", scalar));
  point = (body, point, state) => json(address(body, "point", point, state));
  history = (body, scalar, place) => json(address(body, "history", scalar, place.join(",")));

  /** Positions at rest, m; the same object as long as they do not change. */
  async points(body, state) {
    return this.#keep(address(body, "points", state), async (path) => {
      const known = this.#points.get(body.key);
      const response = await ask(path, known ? { "If-None-Match": known.tag } : {});
      if (response.status === 304) return known;
      const values = new Float32Array(await response.arrayBuffer());
      const points = { tag: response.headers.get("ETag"), values };
      this.#points.set(body.key, points);
      return points;
    });
  }

  /** One number per point, with its range. */
  field(body, scalar, state) {
    return this.#keep(address(body, "field", scalar, state), async (path) => {
      const response = await ask(path);
      const range = (response.headers.get("X-Range") || "").split(" ").filter(Boolean).map(Number);
      const values = new Float32Array(await response.arrayBuffer());
      return { values, range: range.length === 2 ? range : null };
    });
  }

  /** Three numbers per point. */
  vector(body, field, state) {
    return this.#keep(address(body, "vector", field, state), async (path) => {
      return { values: new Float32Array(await (await ask(path)).arrayBuffer()) };
    });
  }

  #keep(path, load) {
    const known = this.#kept.get(path);
    if (known) {
      // the order of the map is that of the last use
      this.#kept.delete(path);
      this.#kept.set(path, known);
      return known.promise;
    }
    const entry = { bytes: 0, array: null, promise: null };
    entry.promise = load(path).then(
      (found) => {
        // positions that do not change are counted once
        const counted = [...this.#kept.values()].some((other) => other.array === found.values);
        if (this.#kept.get(path) === entry) {
          entry.array = found.values;
          entry.bytes = counted ? 0 : found.values.byteLength;
          this.#bytes += entry.bytes;
          this.#shrink();
        }
        return found;
      },
      (error) => {
        this.#kept.delete(path);
        throw error;
      },
    );
    this.#kept.set(path, entry);
    return entry.promise;
  }

  #shrink() {
    for (const [path, entry] of this.#kept) {
      if (this.#bytes <= KEPT || this.#kept.size <= 4) return;
      this.#kept.delete(path);
      this.#bytes -= entry.bytes;
    }
  }
}
