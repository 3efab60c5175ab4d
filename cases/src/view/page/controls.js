// The settings beside the picture.

import { VIEWS } from "./camera.js";
import { number, unitFor } from "./units.js";

const SCALES = [0, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000];

function make(tag, properties = {}, ...children) {
  const element = Object.assign(document.createElement(tag), properties);
  element.append(...children);
  return element;
}

function select(options, value, changed) {
  const element = make("select");
  for (const [name, label] of options) element.append(make("option", { value: name, textContent: label }));
  element.value = value;
  element.addEventListener("change", () => changed(element.value));
  return element;
}

function row(name, ...inside) {
  return make("div", { className: "row" }, make("span", { className: "name", textContent: name }), ...inside);
}

function check(label, checked, changed) {
  const box = make("input", { type: "checkbox", checked });
  box.addEventListener("change", () => changed(box.checked));
  return { box, element: make("label", { className: "check" }, box, label) };
}

/**
 * The panel. It changes `state` and tells by `changed(what)`: `field`, `range`, `shape` (what is drawn of the bodies) or
 * `look`; `view` is called with the name of a direction. `facing` tells whether the part beyond a cut across an axis is to be
 * kept for its face to be seen.
 */
export class Controls {
  constructor(element, run, state, { changed, view, facing }) {
    Object.assign(this, { element, run, state, changed, view, facing });
    element.replaceChildren();
    this.#fields();
    this.#range();
    this.#bodies();
    this.#deformation();
    this.#clip();
    this.#camera();
  }

  #section(title, ...rows) {
    this.element.append(make("h2", { textContent: title }), ...rows);
  }

  /** All fields of all bodies, by name. */
  #allFields() {
    const all = new Map();
    for (const body of this.run.bodies) for (const field of body.fields) if (!all.has(field.name)) all.set(field.name, field);
    return all;
  }

  #fields() {
    const all = this.#allFields();
    const components = make("div");
    const offer = () => {
      const field = all.get(this.state.field);
      const several = field && field.scalars.length > 1;
      const options = several ? field.scalars.map((s) => [s.name, s.label]) : [];
      const chosen = select(options, this.state.scalar, (name) => {
        this.state.scalar = name;
        this.changed("field");
      });
      components.replaceChildren(...(several ? [row("Component", chosen)] : []));
    };
    this.field = select(
      [...[...all.values()].map((f) => [f.name, f.label]), ["", "none"]],
      this.state.field,
      (name) => {
        this.state.field = name;
        this.state.scalar = name;
        offer();
        this.changed("field");
      },
    );
    offer();
    this.smooth = check("Interpolate between points", this.state.smooth, (on) => {
      this.state.smooth = on;
      this.changed("shape");
    });
    this.lines = check("Solidus and liquidus as lines", this.state.lines, (on) => {
      this.state.lines = on;
      this.changed("look");
    });
    this.#section("Field", row("Field", this.field), components, this.smooth.element, this.lines.element);
  }

  #range() {
    const maps = [["auto", "automatic"], ...this.run.maps.map((m) => [m.name, m.name])];
    const map = select(maps, this.state.map, (name) => {
      this.state.map = name;
      this.changed("look");
    });
    this.mode = select(
      [
        ["run", "whole run"],
        ["now", "this time"],
        ["hand", "by hand"],
      ],
      this.state.range,
      (mode) => {
        this.state.range = mode;
        this.changed("range");
      },
    );
    this.ends = ["From", "To"].map((name, end) => {
      const input = make("input", { type: "text", inputMode: "decimal" });
      input.addEventListener("change", () => {
        const value = Number(input.value.replace(",", ".").replace("−", "-")) / this.shown.factor;
        if (input.value.trim() === "" || !Number.isFinite(value)) return this.showRange(this.state.shownRange, this.unit);
        this.state.hand = [...this.state.shownRange];
        this.state.hand[end] = value;
        this.state.range = this.mode.value = "hand";
        this.changed("range");
      });
      const unit = make("output");
      return { input, unit, row: row(name, input, unit) };
    });
    this.#section("Colours", row("Map", map), row("Range", this.mode), ...this.ends.map((e) => e.row));
  }

  /** Shows the range of the colours (SI), of a field with this unit. */
  showRange(range, { unit, shown_unit: shownUnit }) {
    this.unit = { unit, shown_unit: shownUnit };
    this.shown = unitFor(unit, Math.max(...range.map(Math.abs)), shownUnit);
    this.ends.forEach(({ input, unit: label }, end) => {
      if (document.activeElement !== input) input.value = number(range[end] * this.shown.factor, 5);
      label.textContent = this.shown.unit;
    });
  }

  #bodies() {
    const form = select(
      [
        ["auto", "automatic"],
        ["cells", "cells"],
        ["points", "points"],
      ],
      this.state.form,
      (name) => {
        this.state.form = name;
        this.changed("shape");
      },
    );
    const boxes = this.run.bodies.map((body) => {
      const label = `${body.label}, ${body.points.toLocaleString("en").replaceAll(",", " ")} points`;
      return check(label, !this.state.hidden.has(body.name), (on) => {
        this.state.hidden[on ? "delete" : "add"](body.name);
        this.changed("field");
      }).element;
    });
    this.#section("Bodies", ...boxes, row("Drawn as", form));
  }

  #deformation() {
    const deforms = this.run.bodies.some((body) => body.fields.some((f) => f.name === "displacement"));
    if (!deforms) return;
    const text = make("output");
    const slider = make("input", { type: "range", min: 0, max: SCALES.length - 1, step: 1 });
    slider.ariaLabel = "Deformation scale";
    const show = () => (text.textContent = `${number(this.state.scale)} ×`);
    slider.value = Math.max(SCALES.indexOf(this.state.scale), 0);
    slider.addEventListener("input", () => {
      this.state.scale = SCALES[slider.value];
      show();
      this.changed("look");
    });
    show();
    this.#section("Deformation", row("Enlarged", slider, text));
  }

  #clip() {
    const { clip } = this.state;
    const changed = () => this.changed("shape");
    this.clip = check("Cut the bodies", clip.on, (on) => {
      clip.on = on;
      clip.flip = this.facing(clip.axis);
      changed();
    });
    const axes = select(
      [
        ["0", "x"],
        ["1", "y"],
        ["2", "z"],
      ],
      String(clip.axis),
      (axis) => {
        clip.axis = Number(axis);
        clip.flip = this.facing(clip.axis);
        if (clip.on) changed();
        this.showClip();
      },
    );
    axes.className = "short";
    const flip = make("button", { textContent: "flip", title: "Other side (X)" });
    flip.addEventListener("click", () => {
      clip.flip = !clip.flip;
      if (clip.on) changed();
    });
    this.place = make("output");
    const slider = make("input", { type: "range", min: 0, max: 1, step: 0.002, value: clip.part });
    slider.ariaLabel = "Position of the cut";
    slider.addEventListener("input", () => {
      clip.part = Number(slider.value);
      clip.on = this.clip.box.checked = true;
      this.showClip();
      changed();
    });
    this.#section("Cut", this.clip.element, row("Across", axes, flip), row("At", slider, this.place));
  }

  /** Shows where the cut is. */
  showClip() {
    const { axis, part } = this.state.clip;
    const [low, high] = this.state.box;
    const { factor, unit } = unitFor("m", Math.max(...low.map(Math.abs), ...high.map(Math.abs)));
    const step = (high[axis] - low[axis]) / 1000;
    const place = step > 0 ? Math.round((low[axis] + part * 1000 * step) / step) * step : low[axis];
    this.place.textContent = `${number(place * factor, 3)} ${unit}`;
  }

  #camera() {
    const buttons = Object.keys(VIEWS).map((name) => {
      const button = make("button", { textContent: name });
      button.addEventListener("click", () => this.view(name));
      return button;
    });
    const fit = make("button", { textContent: "fit", title: "Whole scene (F)" });
    fit.addEventListener("click", () => this.view("fit"));
    this.perspective = check("Perspective", this.state.perspective, (on) => {
      this.state.perspective = on;
      this.changed("look");
    });
    this.#section("View", make("div", { className: "buttons" }, ...buttons, fit), this.perspective.element);
  }
}

const KEYS = [
  ["drag", "turn"],
  ["shift or right button", "move"],
  ["wheel, two fingers", "zoom"],
  ["point at a body", "values of the point"],
  ["space", "play, pause"],
  ["← →", "previous, next state"],
  ["Home, End", "first, last state"],
  ["1 … 7", "oblique, front, right, top, back, left, bottom"],
  ["F", "fit into the window"],
  ["C", "cut on, off"],
  ["X", "other side of the cut"],
  ["I", "interpolate, or one colour for each point"],
  ["P", "perspective on, off"],
  ["S", "picture"],
  ["R", "film"],
  ["D", "light, dark"],
  ["?", "this list"],
];

export function keyList(element) {
  const list = make("dl");
  for (const [key, what] of KEYS) list.append(make("dt", { textContent: key }), make("dd", { textContent: what }));
  element.replaceChildren(make("h2", { textContent: "Mouse and keys" }), list);
}
