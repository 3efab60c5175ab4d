// What is shown: loads the state of a time, chooses colours, draws. Each log has a panel of its own; all panels have the same time,
// direction, cut and colours.

import { Camera, VIEWS } from "./camera.js";
import { nearest, rowAt } from "./charts.js";
import { Refused } from "./data.js";
import { marks, projected } from "./marks.js";
import { overlay } from "./overlay.js";
import { normalOf, planeOf } from "./plane.js";
import { drawnApart } from "./plies.js";
import { Scene } from "./scene.js";
import { number, withUnit } from "./units.js";

/** Points times states up to which the range of the whole run is found without being asked for. */
export const QUICK = 4e7;

/** Fields that remain when a part has cooled: the range of the whole run would hide what remains. */
const RESIDUAL = /stress|strain|displacement|plastic|distortion/;

/** Room for the colour bar, pixels. */
const BAR = 130;

const ISOTHERM_COLOURS = ["#ffffff", "#6ee1ff"];

/** A log in a part of the window. */
function panel(element, log) {
  const [canvas, over] = ["gl", "overlay"].map((name) => {
    const made = document.createElement("canvas");
    made.className = name;
    element.append(made);
    return made;
  });
  return { element, canvas, over, log, scene: new Scene(canvas), sources: [] };
}

export class Viewer {
  /** inputs of the scenes by the key of a body */
  #inputs = new Map();
  /** places of the points of laminates, by body */
  #apart = new Map();
  #latest = 0;
  #scheduled = false;
  #runRange = null;
  #found = new WeakMap();
  /** times of states that are damaged */
  lost = new Set();
  index = 0;

  constructor(data, run, state, elements) {
    Object.assign(this, { data, run, state });
    this.panels = elements.map(panel);
    this.camera = new Camera();
    this.camera.perspective = state.perspective;
    this.update(run);
  }

  /** Takes up what has been logged since. */
  update(run) {
    this.run = run;
    this.times = [...new Set(run.bodies.flatMap((body) => body.times))].sort((a, b) => a - b);
    this.size = run.bodies.reduce((sum, body) => sum + body.points * body.times.length, 0);
  }

  /** Takes up the places of the heat sources. */
  async updateSources() {
    const ofPanel = async (panel) => (panel.sources = await this.data.sources(panel.log));
    await Promise.all(this.panels.map(ofPanel));
  }

  /** The heat sources of a panel at the time that is shown. */
  sources(panel) {
    return rowAt(panel.sources, this.time)?.sources ?? [];
  }

  get time() {
    return this.times[this.index] ?? 0;
  }

  /** Room for the bodies as they are at first and at last. */
  async frame() {
    const boxes = [];
    for (const body of this.run.bodies) {
      for (const state of new Set([0, body.times.length - 1])) {
        if (state < 0) continue;
        // a damaged state is no reason not to show the others
        const [points, motion] = await Promise.all([
          this.#points(body, state),
          this.#moves(body) ? this.data.vector(body, "displacement", state) : null,
        ]).catch(() => []);
        if (!points?.length) continue;
        boxes.push(box(points, body.spacing / 2));
        const moved = motion && points.map((x, n) => x + (motion.values[n] || 0));
        if (moved) boxes.push(box(moved, body.spacing / 2));
      }
    }
    for (const { scene } of this.panels) scene.frame(boxes.length ? boxes : [[[0, 0, 0], [1, 1, 1]]]);
    this.state.box = this.panels[0].scene.box;
  }

  /** Fits the scene into a window of another size, unless it has been moved. */
  resized() {
    if (this.fitted) this.look("fit");
    this.drawNow();
  }

  /** Directions by name, `fit`, or `torch`: from the side on which the heat source is. */
  look(name) {
    const { camera } = this;
    const { scene, canvas } = this.panels[0];
    if (name === "fit") {
      this.fitted = true;
      camera.target = [0, 0, 0];
      const [low, high] = scene.box;
      const half = low.map((x, axis) => (high[axis] - x) / 2 / scene.radius);
      const [right, up] = camera.axes();
      const across = (axis) => Math.abs(axis[0]) * half[0] + Math.abs(axis[1]) * half[1] + Math.abs(axis[2]) * half[2];
      const [width, height] = [canvas.clientWidth, Math.max(canvas.clientHeight, 1)];
      const room = Math.max(width - BAR, 0.3 * width) / height;
      camera.reach = 1.2 * Math.max(across(up), across(right) / room);
      camera.pan(-BAR / 2 / height, 0);
    } else if (name === "torch") {
      camera.look("oblique");
      const [source] = this.panels.flatMap((panel) => this.sources(panel));
      if (source) camera.towards(source, scene.box);
      this.look("fit");
    } else if (name in VIEWS) {
      camera.look(name);
      this.look("fit");
    }
    this.draw();
  }

  /** The scalar that is shown, as its field describes it. */
  get field() {
    const { field, scalar } = this.state;
    for (const body of this.run.bodies) {
      const found = body.fields.find((f) => f.name === field);
      const part = found?.scalars.find((s) => s.name === scalar);
      if (part) return { ...found, title: part.label ? `${found.label}, ${part.label}` : found.label };
    }
    return null;
  }

  /** Whether the field that is shown remains when a part has cooled. */
  get residual() {
    return RESIDUAL.test(this.state.field);
  }

  /** What the colours cover: `run`, `now` or `hand`. */
  get coverage() {
    if (this.state.range !== "auto") return this.state.range;
    return this.residual || this.size > QUICK ? "now" : "run";
  }

  #has(body, field = this.state.field) {
    return body.fields.some((f) => f.name === field);
  }

  #moves(body) {
    return body.fields.some((f) => f.name === "displacement" && f.components === 3);
  }

  #visible() {
    return this.run.bodies.filter((body) => !this.state.hidden.has(body.key) && body.times.length > 0);
  }

  /** Where the points of a body are drawn at rest. */
  async #points(body, state) {
    const points = (await this.data.points(body, state)).values;
    const { ply, apart } = this.state;
    if (!body.plies.length || (!ply && apart === 1)) return points;
    const known = this.#apart.get(body.key);
    if (known?.points === points && known.ply === ply && known.apart === apart) return known.drawn;
    const plyOf = (await this.data.field(body, "ply", state)).values;
    const drawn = drawnApart(points, plyOf, body.plies, { ply, apart });
    this.#apart.set(body.key, { points, ply, apart, drawn });
    return drawn;
  }

  /** What of a body is needed to draw it at a time. */
  async #load(body, time) {
    const { data } = this;
    const state = nearest(body.times, time);
    const [points, field, motion, spacings] = await Promise.all([
      this.#points(body, state),
      this.#has(body) ? data.field(body, this.state.scalar, state) : null,
      this.#moves(body) ? data.vector(body, "displacement", state) : null,
      body.has_spacings ? data.field(body, "spacing", state) : null,
    ]);
    return { state, points, field, values: field?.values, motion: motion?.values, spacings: spacings?.values };
  }

  /** Shows the state with this number; `false` if it cannot be read or a later call came first. */
  async show(index) {
    const mine = ++this.#latest;
    const time = this.times[index];
    if (time === undefined) return false;
    const bodies = this.#visible();
    let loaded;
    try {
      loaded = await Promise.all(bodies.map((body) => this.#load(body, time)));
    } catch (error) {
      if (error instanceof Refused && error.damaged) {
        this.lost.add(time);
        return false;
      }
      throw error;
    }
    if (mine !== this.#latest) return false;
    this.index = index;
    this.#inputs = new Map(bodies.map((body, n) => [body.key, loaded[n]]));
    this.shape();
    return true;
  }

  /** Loads a state that will be shown soon. */
  prepare(index) {
    const time = this.times[index];
    if (time !== undefined) for (const body of this.#visible()) this.#load(body, time).catch(() => {});
  }

  /** Gives the scenes what was loaded. */
  shape() {
    const { form, smooth, clip } = this.state;
    const plane = planeOf(clip, this.state.box);
    for (const { scene, log } of this.panels) {
      for (const body of this.run.bodies.filter((body) => body.log === log)) {
        const input = this.#inputs.get(body.key);
        scene.hide(body.key, !input);
        if (input) scene.set(body, { ...input, form, smooth, clip: plane });
      }
    }
    this.#colours();
    this.draw();
  }

  /** Bodies that are drawn as points though cells are asked for. */
  withoutCells() {
    if (this.state.form !== "cells") return [];
    return this.panels.flatMap(({ scene }) => scene.drawn().filter((d) => d.form === "points" && d.count).map((d) => d.body));
  }

  /** Finds the range of the whole run, if the colours cover it. */
  async surveyRun() {
    const { scalar } = this.state;
    if (this.coverage !== "run" || !this.field) return;
    const bodies = this.run.bodies.filter((body) => this.#has(body));
    const found = await Promise.all(bodies.map((body) => this.data.range(body, scalar)));
    if (scalar !== this.state.scalar) return;
    this.#runRange = { scalar, range: union(found.map((f) => f.range).filter(Boolean)) };
    this.#colours();
    this.draw();
  }

  /** Number of the state in which the size of a field is largest; `null` if it has no values. */
  async peak(field, scalar = field) {
    const bodies = this.run.bodies.filter((body) => this.#has(body, field));
    const found = await Promise.all(bodies.map((body) => this.data.range(body, scalar)));
    const peaks = found.map((f, n) => ({ ...f, body: bodies[n] })).filter((f) => f.range && f.peak !== null);
    if (!peaks.length) return null;
    const size = (f) => Math.max(...f.range.map(Math.abs));
    const peak = peaks.reduce((a, b) => (size(b) > size(a) ? b : a));
    return nearest(this.times, peak.body.times[peak.peak]);
  }

  /**
   * The state that a finished run is opened with: the hottest one, half way of the heat source where it would take long to find the
   * hottest, and the last one for fields that remain.
   */
  async opening() {
    const last = this.times.length - 1;
    if (this.residual) return last;
    if (this.size <= QUICK) {
      const { field, scalar } = this.state;
      const isHot = this.run.bodies.some((body) => this.#has(body, "temperature"));
      return (await (isHot ? this.peak("temperature") : this.peak(field, scalar))) ?? last;
    }
    const rows = this.panels[0].sources.filter((row) => row.sources.some((source) => source.on));
    return rows.length ? nearest(this.times, rows[rows.length >> 1].time) : last;
  }

  /** Range and map of the colours. */
  #colours() {
    const { state, coverage } = this;
    const now = union([...this.#inputs.values()].map((input) => input.field?.range).filter(Boolean));
    let range = now ?? [0, 1];
    if (coverage === "hand") range = state.hand;
    else if (coverage === "run" && this.#runRange?.scalar === state.scalar && this.#runRange.range)
      range = union([this.#runRange.range, now].filter(Boolean));
    let [low, high] = range;
    const size = Math.max(Math.abs(low), Math.abs(high));
    const both = low < 0 && high > 0 && Math.min(-low, high) > 0.02 * size;
    if (both && coverage !== "hand" && (state.map === "auto" || state.map === "blue-red")) [low, high] = [-size, size];
    // what only differs by rounding is constant
    if (coverage !== "hand" && !(high - low > 1e-9 * size)) high = low + (size || 1);
    const automatic = both ? "blue-red" : state.field === "temperature" ? "inferno" : "viridis";
    const name = state.map === "auto" ? automatic : state.map;
    const map = this.run.maps.find((m) => m.name === name) ?? this.run.maps[0];
    state.shownRange = [low, high];
    if (this.map !== map.colours) for (const { scene } of this.panels) scene.colours(map.colours);
    this.map = map.colours;
    if (this.field) this.onRange?.([low, high], this.field);
  }

  draw() {
    if (this.#scheduled) return;
    this.#scheduled = true;
    requestAnimationFrame(() => {
      this.#scheduled = false;
      this.drawNow();
    });
  }

  /** What the scene of a panel is drawn with; `ratio` is the number of pixels for one of the window. */
  #look({ canvas }, ratio) {
    const { state } = this;
    const isotherms = state.lines && state.scalar === "temperature" ? this.run.bodies.flatMap((b) => b.isotherms) : [];
    const levels = [...new Set(isotherms.map((i) => i.temperature))];
    return {
      matrices: this.camera.matrices(canvas.clientWidth / Math.max(canvas.clientHeight, 1)),
      range: state.shownRange ?? [0, 1],
      scale: state.scale,
      levels,
      clip: planeOf(state.clip, state.box),
      edges: state.edges,
      ratio,
      background: this.background,
      ink: this.ink,
      plain: this.field ? [0.5, 0.52, 0.55] : [0.62, 0.66, 0.72],
    };
  }

  /** Pixels of the screen for one of the window. */
  get ratio() {
    return Math.min(window.devicePixelRatio || 1, 2);
  }

  drawNow() {
    this.camera.perspective = this.state.perspective;
    for (const panel of this.panels) {
      const { canvas, over } = panel;
      const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((x) => Math.round(x * this.ratio));
      if (canvas.width !== width || canvas.height !== height) {
        [canvas.width, canvas.height] = [width, height];
        [over.width, over.height] = [width, height];
      }
      panel.scene.draw(this.#look(panel, this.ratio));
      this.write(panel, over, this.ratio);
    }
    this.onDraw?.();
  }

  /** Draws a part of the picture of a panel, `[left, top, width, height]` of `[width, height]` pixels, on its canvas. */
  drawPart(panel, part, whole, ratio) {
    const { canvas } = panel;
    [canvas.width, canvas.height] = part.slice(2);
    const look = this.#look(panel, ratio);
    look.matrices = { ...look.matrices, projection: this.camera.part(look.matrices.projection, part, whole) };
    panel.scene.draw(look);
  }

  /** Draws what is written over the picture of a panel. */
  write(panel, canvas, ratio) {
    const { state, camera } = this;
    const look = this.#look(panel, ratio);
    const field = this.field;
    const enlarged = this.#inputs.size && [...this.#inputs.values()].some((i) => i.motion) && state.scale !== 1;
    const { title, file } = this.run.logs[panel.log];
    const legend = {
      title: this.panels.length > 1 ? `${title} (${file})` : title,
      below: `t = ${withUnit(this.time, "s", "s", 5)}${enlarged ? `, displacements ${number(state.scale)} ×` : ""}`,
      text: this.text,
      map: field ? this.map : null,
      label: field?.title,
      unit: field?.unit,
      shownUnit: field?.shown_unit,
      levels: look.levels.map((value, n) => ({ value, colour: ISOTHERM_COLOURS[Math.min(n, 1)] })),
    };
    overlay(canvas, ratio, look, legend, camera, panel.scene);
    const place = projected(look.matrices, panel.scene, [canvas.width / ratio, canvas.height / ratio]);
    const shown = {
      torches: state.torch ? this.sources(panel) : [],
      points: state.points.map((p, n) => this.#marked(p, n, panel)).filter(Boolean),
      ruler: state.ruler,
      text: this.text,
    };
    marks(canvas, ratio, shown, place, panel.scene.radius);
  }

  /** Where a clicked point is drawn, if it belongs to a panel, is there at the time shown, and not cut away. */
  #marked({ key, place }, n, panel) {
    const body = this.run.bodies.find((b) => b.key === key);
    const input = this.#inputs.get(key);
    if (body?.log !== panel.log || !input) return null;
    const { points, motion } = input;
    const point = this.#nearest(points, place, body.spacing);
    const plane = planeOf(this.state.clip, this.state.box);
    const beyond = plane && plane.normal.reduce((sum, x, axis) => sum + x * place[axis], -plane.offset);
    if (point === null || beyond > 0) return null;
    const drawn = [0, 1, 2].map((axis) => points[3 * point + axis] + this.state.scale * (motion?.[3 * point + axis] || 0));
    return { place: drawn, colour: this.pointColours?.[n % this.pointColours.length] ?? "#fff" };
  }

  /** The point next to a place at rest within a spacing (m); the last answers for each array of points are kept. */
  #nearest(points, place, spacing) {
    if (!this.#found.has(points)) this.#found.set(points, new Map());
    const known = this.#found.get(points);
    const name = place.join();
    if (!known.has(name)) {
      let [nearest, least] = [null, spacing * spacing];
      for (let p = 0; p < points.length / 3; p++) {
        const squared = (points[3 * p] - place[0]) ** 2 + (points[3 * p + 1] - place[1]) ** 2 + (points[3 * p + 2] - place[2]) ** 2;
        if (squared <= least) [nearest, least] = [p, squared];
      }
      known.set(name, nearest);
    }
    return known.get(name);
  }

  /** Whether the part of a body beyond a cut shows its cut face to the viewer. */
  facing() {
    const normal = normalOf(this.state.clip);
    return this.camera.axes()[2].reduce((sum, x, axis) => sum + x * normal[axis], 0) < 0;
  }

  /** Milliseconds for a picture, and for another state that is in memory, as means over some. */
  durations() {
    const { gl } = this.panels[0].scene;
    const pixel = new Uint8Array(4);
    const mean = (count, act) => {
      act();
      const start = performance.now();
      for (let n = 0; n < count; n++) {
        act();
        gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
      }
      return (performance.now() - start) / count;
    };
    const picture = () => {
      this.camera.turn(0.01, 0);
      this.drawNow();
    };
    return { state_ms: mean(5, () => this.shape()), frame_ms: mean(20, picture) };
  }

  /** The point at a place in the window, in a panel, with what is known of it. */
  at(panel, x, y) {
    const { canvas, scene } = panel;
    const area = canvas.getBoundingClientRect();
    const ratio = canvas.width / area.width;
    const column = Math.floor((x - area.left) * ratio);
    const row = canvas.height - 1 - Math.floor((y - area.top) * ratio);
    const found = scene.pick(this.#look(panel, ratio), column, row);
    const input = found && this.#inputs.get(found.body.key);
    if (!input) return null;
    const { point } = found;
    const place = [0, 1, 2].map((axis) => input.points[3 * point + axis]);
    return { ...found, state: input.state, place, value: input.values?.[point] ?? null };
  }
}

function box(points, margin) {
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  for (let p = 0; p < points.length; p++) {
    const axis = p % 3;
    if (points[p] < low[axis]) low[axis] = points[p];
    if (points[p] > high[axis]) high[axis] = points[p];
  }
  return [low.map((x) => x - margin), high.map((x) => x + margin)];
}

function union(ranges) {
  if (!ranges.length) return null;
  return [Math.min(...ranges.map((r) => r[0])), Math.max(...ranges.map((r) => r[1]))];
}
