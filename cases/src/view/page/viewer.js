// What is shown: loads the state of a time, chooses colours, draws.

import { Camera, VIEWS } from "./camera.js";
import { nearest } from "./charts.js";
import { Refused } from "./data.js";
import { overlay } from "./overlay.js";
import { Scene } from "./scene.js";
import { number, withUnit } from "./units.js";

/** Points times states up to which the range of the whole run is found without being asked for. */
export const QUICK = 4e7;

const ISOTHERM_COLOURS = ["#ffffff", "#6ee1ff"];

export class Viewer {
  /** inputs of the scene by body */
  #inputs = new Map();
  #latest = 0;
  #scheduled = false;
  #runRange = null;
  /** times of states that are damaged */
  lost = new Set();
  index = 0;

  constructor(data, run, state, canvases) {
    Object.assign(this, { data, run, state });
    [this.canvas, this.over] = canvases;
    this.scene = new Scene(this.canvas);
    this.camera = new Camera();
    this.camera.perspective = state.perspective;
    this.update(run);
  }

  /** Takes up what has been logged since. */
  update(run) {
    this.run = run;
    this.times = [...new Set(run.bodies.flatMap((body) => body.times))].sort((a, b) => a - b);
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
          this.data.points(body.name, state),
          this.#moves(body) ? this.data.vector(body.name, "displacement", state) : null,
        ]).catch(() => []);
        if (!points?.values.length) continue;
        boxes.push(box(points.values, body.spacing / 2));
        const moved = motion && points.values.map((x, n) => x + (motion.values[n] || 0));
        if (moved) boxes.push(box(moved, body.spacing / 2));
      }
    }
    this.scene.frame(boxes.length ? boxes : [[[0, 0, 0], [1, 1, 1]]]);
    this.state.box = this.scene.box;
  }

  /** Directions by name, or `fit`. */
  look(name) {
    const { camera, scene } = this;
    if (name === "fit") {
      camera.target = [0, 0, 0];
      const [low, high] = scene.box;
      const half = low.map((x, axis) => (high[axis] - x) / 2 / scene.radius);
      const [right, up] = camera.axes();
      const across = (axis) => Math.abs(axis[0]) * half[0] + Math.abs(axis[1]) * half[1] + Math.abs(axis[2]) * half[2];
      const aspect = this.canvas.clientWidth / Math.max(this.canvas.clientHeight, 1);
      // room for the colour bar
      camera.reach = 1.12 * Math.max(across(up), across(right) / Math.max(aspect - 0.4, 0.3 * aspect));
      camera.pan(-0.06, 0);
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

  #has(body) {
    return body.fields.some((f) => f.name === this.state.field);
  }

  #moves(body) {
    return body.fields.some((f) => f.name === "displacement" && f.components === 3);
  }

  #visible() {
    return this.run.bodies.filter((body) => !this.state.hidden.has(body.name) && body.times.length > 0);
  }

  /** What of a body is needed to draw it at a time. */
  async #load(body, time) {
    const { data } = this;
    const state = nearest(body.times, time);
    const [points, field, motion, spacings] = await Promise.all([
      data.points(body.name, state),
      this.#has(body) ? data.field(body.name, this.state.scalar, state) : null,
      this.#moves(body) ? data.vector(body.name, "displacement", state) : null,
      body.has_spacings ? data.field(body.name, "spacing", state) : null,
    ]);
    return { state, points: points.values, field, values: field?.values, motion: motion?.values, spacings: spacings?.values };
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
    this.#inputs = new Map(bodies.map((body, n) => [body.name, loaded[n]]));
    this.shape();
    return true;
  }

  /** Loads a state that will be shown soon. */
  prepare(index) {
    const time = this.times[index];
    if (time !== undefined) for (const body of this.#visible()) this.#load(body, time).catch(() => {});
  }

  /** The plane that cuts the bodies, m; `null` for none. */
  #clip() {
    const { on, axis, part, flip } = this.state.clip;
    if (!on || !this.state.box) return null;
    const [low, high] = this.state.box;
    return { axis, flip, position: low[axis] + part * (high[axis] - low[axis]) };
  }

  /** Gives the scene what was loaded. */
  shape() {
    const { form, smooth } = this.state;
    for (const body of this.run.bodies) {
      const input = this.#inputs.get(body.name);
      this.scene.hide(body.name, !input);
      if (input) this.scene.set(body, { ...input, form, smooth, clip: this.#clip() });
    }
    this.#colours();
    this.draw();
  }

  /** Finds the range of the whole run; the number of the time at which the size peaks. */
  async surveyRun() {
    const { scalar } = this.state;
    const bodies = this.run.bodies.filter((body) => this.#has(body));
    const found = await Promise.all(bodies.map((body) => this.data.range(body.name, scalar)));
    if (scalar !== this.state.scalar) return null;
    const ranges = found.map((f) => f.range).filter(Boolean);
    this.#runRange = { scalar, range: union(ranges) };
    this.#colours();
    this.draw();
    const size = (f) => Math.max(...f.range.map(Math.abs));
    const peaks = found.map((f, n) => ({ ...f, body: bodies[n] })).filter((f) => f.range && f.peak !== null);
    if (!peaks.length) return null;
    const peak = peaks.reduce((a, b) => (size(b) > size(a) ? b : a));
    return nearest(this.times, peak.body.times[peak.peak]);
  }

  /** Range and map of the colours. */
  #colours() {
    const { state } = this;
    const now = union([...this.#inputs.values()].map((input) => input.field?.range).filter(Boolean));
    let range = now ?? [0, 1];
    if (state.range === "hand") range = state.hand;
    else if (state.range === "run" && this.#runRange?.scalar === state.scalar && this.#runRange.range)
      range = union([this.#runRange.range, now].filter(Boolean));
    let [low, high] = range;
    const size = Math.max(Math.abs(low), Math.abs(high));
    const both = low < 0 && high > 0 && Math.min(-low, high) > 0.02 * size;
    if (both && state.range !== "hand" && (state.map === "auto" || state.map === "blue-red")) [low, high] = [-size, size];
    // what only differs by rounding is constant
    if (state.range !== "hand" && !(high - low > 1e-9 * size)) high = low + (size || 1);
    const automatic = both ? "blue-red" : state.field === "temperature" ? "inferno" : "viridis";
    const name = state.map === "auto" ? automatic : state.map;
    const map = this.run.maps.find((m) => m.name === name) ?? this.run.maps[0];
    state.shownRange = [low, high];
    if (this.map !== map.colours) this.scene.colours(map.colours);
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

  /** What the scene is drawn with. */
  #look() {
    const { canvas, state } = this;
    const isotherms = state.lines && state.scalar === "temperature" ? this.run.bodies.flatMap((b) => b.isotherms) : [];
    const levels = [...new Set(isotherms.map((i) => i.temperature))];
    return {
      matrices: this.camera.matrices(canvas.width / Math.max(canvas.height, 1)),
      range: state.shownRange ?? [0, 1],
      scale: state.scale,
      levels,
      clip: this.#clip(),
      background: this.background,
      plain: this.field ? [0.5, 0.52, 0.55] : [0.62, 0.66, 0.72],
    };
  }

  drawNow() {
    const { canvas, over, scene, camera, state } = this;
    const ratio = Math.min(window.devicePixelRatio || 1, 2);
    const [width, height] = [Math.round(canvas.clientWidth * ratio), Math.round(canvas.clientHeight * ratio)];
    if (canvas.width !== width || canvas.height !== height) {
      [canvas.width, canvas.height] = [width, height];
      [over.width, over.height] = [width, height];
    }
    camera.perspective = state.perspective;
    const look = this.#look();
    scene.draw(look);
    const field = this.field;
    const shown = number(state.scale);
    const enlarged = this.#inputs.size && [...this.#inputs.values()].some((i) => i.motion) && state.scale !== 1;
    overlay(
      over,
      ratio,
      look,
      {
        title: this.run.title,
        below: `t = ${withUnit(this.time, "s", "s", 5)}${enlarged ? `, displacements ${shown} ×` : ""}`,
        text: this.text,
        map: field ? this.map : null,
        label: field?.title,
        unit: field?.unit,
        shownUnit: field?.shown_unit,
        levels: look.levels.map((value, n) => ({ value, colour: ISOTHERM_COLOURS[Math.min(n, 1)] })),
      },
      camera,
      scene,
    );
    this.onDraw?.();
  }

  /** Whether the part of a body beyond a cut across this axis shows its cut face to the viewer. */
  facing(axis) {
    return this.camera.axes()[2][axis] < 0;
  }

  /** Milliseconds for a picture, and for another state that is in memory, as means over some. */
  durations() {
    const { gl } = this.scene;
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

  /** The point at a place in the window, with what is known of it. */
  at(x, y) {
    const area = this.canvas.getBoundingClientRect();
    const ratio = this.canvas.width / area.width;
    const column = Math.floor((x - area.left) * ratio);
    const row = this.canvas.height - 1 - Math.floor((y - area.top) * ratio);
    const found = this.scene.pick(this.#look(), column, row);
    const input = found && this.#inputs.get(found.body.name);
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
