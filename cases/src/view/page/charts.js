// Curves over time: probes, melt pools, reports, balances.

import { number, ticks, toShown, toValue, unitFor, withUnit } from "./units.js";

const [LEFT, RIGHT, TOP, BOTTOM] = [50, 8, 20, 22];

/** A group that is open at first if it has at most this many charts. */
const FEW = 3;

export class Charts {
  #panels = [];
  #groups = new Map();

  /** `chosen` is called with a time (s) that was clicked. */
  constructor(element, lines, chosen) {
    this.element = element;
    // colours for a white background, and lighter ones for a dark one
    const css = (part) => lines.map((c) => `rgb(${c.map((x) => Math.round(x + part * (255 - x))).join(",")})`);
    this.palettes = { light: css(0), dark: css(0.3) };
    this.chosen = chosen;
    new ResizeObserver(() => this.draw()).observe(element);
  }

  /** Colours of the curves. */
  get lines() {
    return this.palettes[document.documentElement.dataset.theme] ?? this.palettes.dark;
  }

  /**
   * Shows these series; what is open stays open. Columns may have times of their own. Series of one name, of several logs, share
   * their charts; those of other logs than the first one are dashed.
   */
  show(all) {
    const merged = new Map();
    for (const { kind, name, isotherm, times, columns, log = 0, file } of all) {
      const key = kind + name;
      if (!merged.has(key)) merged.set(key, { key, kind, name, isotherm, columns: [] });
      const own = columns.map((c) => ({ times, ...c, log, label: log ? `${c.label} (${file})` : c.label }));
      merged.get(key).columns.push(...own.filter((c) => c.times.length > 0));
    }
    const wanted = [...merged.values()].filter((series) => series.columns.length > 0);
    const names = wanted.map((s) => s.key).join("\n");
    if (names !== this.names) {
      this.names = names;
      const open = new Map([...this.#groups].map(([key, group]) => [key, group.details.open]));
      this.#groups.clear();
      this.element.replaceChildren();
      if (!wanted.length) this.#empty();
      for (const series of wanted) this.#group(series, open.get(series.key));
    }
    this.#panels = [];
    for (const series of wanted) this.#fill(series);
    this.draw();
  }

  #empty() {
    const none = document.createElement("p");
    none.className = "none";
    none.textContent =
      "No probe, report or balance is in the log. [[probes]] in the case file adds curves here, and so does a click on a body.";
    this.element.append(none);
  }

  #group(series, open) {
    const details = document.createElement("details");
    const summary = document.createElement("summary");
    summary.textContent = series.name;
    if (series.isotherm) {
      const bound = document.createElement("span");
      bound.textContent = ` above ${series.isotherm.name}, ${withUnit(series.isotherm.temperature, "K", "K", 5)}`;
      summary.append(bound);
    }
    const inside = document.createElement("div");
    details.append(summary, inside);
    details.open = open ?? ["pool", "probe", "point"].includes(series.kind);
    details.addEventListener("toggle", () => this.draw());
    this.element.append(details);
    this.#groups.set(series.key, { details, inside });
  }

  /** One panel for each unit; of balances the errors only. */
  #fill(series) {
    const { details, inside } = this.#groups.get(series.key);
    const columns = series.columns.filter((c) => series.kind !== "balance" || c.name.includes("error"));
    const units = [...new Set(columns.map((c) => c.unit))];
    if (inside.children.length !== units.length) {
      inside.replaceChildren(...units.map(() => this.#panel()));
      if (series.kind === "probe" && this.#panels.length >= 2 * FEW) details.open = false;
    }
    units.forEach((unit, i) => {
      const lines = columns.filter((c) => c.unit === unit);
      this.#panels.push({ element: inside.children[i], details, lines, unit });
    });
  }

  #panel() {
    const panel = document.createElement("div");
    panel.className = "chart";
    const canvas = document.createElement("canvas");
    const legend = document.createElement("div");
    legend.className = "legend";
    panel.append(canvas, legend);
    canvas.addEventListener("click", (event) => {
      const axis = panel.axis;
      if (axis) this.chosen(axis.low + ((event.offsetX - LEFT) / axis.wide) * (axis.high - axis.low));
    });
    return panel;
  }

  /** Moves the cursor to a time, s. */
  at(time) {
    this.time = time;
    this.draw();
  }

  draw() {
    for (const panel of this.#panels) if (panel.details.open) this.#draw(panel);
  }

  #draw({ element, lines, unit }) {
    const [canvas, legend] = element.children;
    const ratio = window.devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    if (!width) return;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    const context = canvas.getContext("2d");
    context.scale(ratio, ratio);
    const style = getComputedStyle(document.documentElement);
    const [dim, grid, accent] = ["--dim", "--line", "--accent"].map((name) => style.getPropertyValue(name));

    let [low, high] = limits(lines);
    const size = Math.max(Math.abs(low), Math.abs(high));
    const shown = unitFor(unit, size, lines[0].shown_unit);
    if (!(high - low > 1e-9 * size)) [low, high] = [low - (size || 1) * 0.05, high + (size || 1) * 0.05];
    const begin = Math.min(...lines.map((line) => line.times[0]));
    const last = Math.max(...lines.map((line) => line.times[line.times.length - 1]));
    const end = last > begin ? last : begin + 1;
    const time = unitFor("s", Math.max(Math.abs(begin), Math.abs(end)));
    const [wide, tall] = [width - LEFT - RIGHT, height - TOP - BOTTOM];
    element.axis = { low: begin, high: end, wide };
    const x = (t) => LEFT + (wide * (t - begin)) / (end - begin);
    const y = (v) => TOP + tall - (tall * (v - low)) / (high - low);

    context.font = "11px system-ui, 'Segoe UI', Roboto, 'DejaVu Sans', sans-serif";
    context.fillStyle = dim;
    context.strokeStyle = grid;
    context.textAlign = "right";
    context.textBaseline = "middle";
    for (const tick of ticks(toShown(low, shown), toShown(high, shown), 4)) {
      const at = Math.round(y(toValue(tick, shown))) + 0.5;
      line(context, LEFT, at, LEFT + wide, at);
      context.fillText(number(tick), LEFT - 5, at);
    }
    context.textAlign = "center";
    context.textBaseline = "top";
    for (const tick of ticks(begin * time.factor, end * time.factor, 4)) {
      const at = Math.round(x(tick / time.factor)) + 0.5;
      line(context, at, TOP, at, TOP + tall);
      if (at < width - 36) context.fillText(number(tick), at, TOP + tall + 5);
    }
    context.textAlign = "right";
    context.fillText(time.unit, width - 4, TOP + tall + 5);

    context.textAlign = "left";
    context.textBaseline = "top";
    context.fillText(shown.unit, 2, 2);

    lines.forEach((column, n) => {
      context.strokeStyle = this.lines[n % this.lines.length];
      context.lineWidth = 1.6;
      context.setLineDash(column.log ? [5, 3] : []);
      curve(context, column.times, column.values, x, y, wide);
    });
    context.setLineDash([]);
    context.lineWidth = 1;
    if (this.time !== undefined) {
      context.strokeStyle = accent;
      const at = Math.round(x(Math.min(Math.max(this.time, begin), end))) + 0.5;
      line(context, at, TOP, at, TOP + tall);
    }
    legend.replaceChildren(...lines.map((column, n) => this.#entry(column, n, shown)));
  }

  /** The name of a curve and its value at the time that is shown. */
  #entry(column, n, shown) {
    const entry = document.createElement("span");
    const mark = document.createElement("i");
    mark.style.background = this.lines[n % this.lines.length];
    const value = document.createElement("b");
    const { times } = column;
    const at = column.values[nearest(times, this.time ?? times[times.length - 1])];
    value.textContent = at === null ? "–" : `${number(toShown(at, shown))} ${shown.unit}`;
    entry.append(mark, `${column.label} `, value);
    return entry;
  }
}

/** The state at or before a time, in rows with times. */
export function rowAt(rows, time) {
  let [low, high] = [-1, rows.length];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (rows[middle].time <= time) low = middle;
    else high = middle;
  }
  return rows[low] ?? null;
}

/** Number of the time next to one. */
export function nearest(times, time) {
  let [low, high] = [0, times.length - 1];
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (times[middle] <= time) low = middle;
    else high = middle;
  }
  return Math.abs(times[high] - time) < Math.abs(times[low] - time) ? high : low;
}

function limits(lines) {
  let [low, high] = [Infinity, -Infinity];
  for (const { values } of lines) {
    for (const value of values) {
      if (value === null) continue;
      if (value < low) low = value;
      if (value > high) high = value;
    }
  }
  if (!(low <= high)) return [0, 1];
  // from zero where it is near
  if (low > 0 && low < 0.35 * high) return [0, high];
  if (high < 0 && high > 0.35 * low) return [low, 0];
  return [low, high];
}

function line(context, x0, y0, x1, y1) {
  context.beginPath();
  context.moveTo(x0, y0);
  context.lineTo(x1, y1);
  context.stroke();
}

/** A curve with gaps where there is no value; of several values on one pixel the extremes are drawn. */
function curve(context, times, values, x, y, wide) {
  context.beginPath();
  const step = Math.max(Math.floor(times.length / (4 * wide)), 1);
  let drawing = false;
  for (let n = 0; n < times.length; n += step) {
    let [low, high] = [null, null];
    for (let m = n; m < Math.min(n + step, times.length); m++) {
      const value = values[m];
      if (value === null) continue;
      if (low === null || value < low) low = value;
      if (high === null || value > high) high = value;
    }
    if (low === null) {
      drawing = false;
      continue;
    }
    for (const value of low === high ? [low] : [low, high]) {
      if (drawing) context.lineTo(x(times[n]), y(value));
      else context.moveTo(x(times[n]), y(value));
      drawing = true;
    }
  }
  context.stroke();
}

