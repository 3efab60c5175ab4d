// The settings beside the picture.

import { VIEWS } from "./camera.js";
import { WIDTHS } from "./capture.js";
import { OBLIQUE, extent, normalOf, placeOf } from "./plane.js";
import { most } from "./plies.js";
import { number, toShown, toValue, unitFor } from "./units.js";

const SCALES = [0, 1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10000];
/** Distances of plies over those in the laminate. */
const APART = [1, 2, 5, 10, 20, 50, 100];

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
 * The panel. It changes `state` and tells by `changed(what)`: `field`, `range`, `units`, `shape` (what is drawn of the bodies) or
 * `look`; `view` is called with the name of a direction. `facing` tells whether the part beyond a cut is to be kept for its face
 * to be seen.
 */
export class Controls {
  constructor(element, run, state, { changed, view, facing }) {
    Object.assign(this, { element, run, state, changed, view, facing });
    element.replaceChildren();
    this.#fields();
    this.#range();
    this.#bodies();
    this.#plies();
    this.#deformation();
    this.#clip();
    this.#camera();
    this.#marks();
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
    this.celsius = check("Temperatures in °C", this.state.celsius, (on) => {
      this.state.celsius = on;
      this.changed("units");
    });
    const boxes = [this.smooth, this.lines, this.celsius].map((c) => c.element);
    this.#section("Field", row("Field", this.field), components, ...boxes);
  }

  #range() {
    const maps = [["auto", "automatic"], ...this.run.maps.map((m) => [m.name, m.name])];
    const map = select(maps, this.state.map, (name) => {
      this.state.map = name;
      this.changed("look");
    });
    this.mode = select(
      [
        ["auto", "automatic"],
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
        const value = toValue(Number(input.value.replace(",", ".").replace("−", "-")), this.shown);
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
      if (document.activeElement !== input) input.value = number(toShown(range[end], this.shown), 5);
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
      return check(label, !this.state.hidden.has(body.key), (on) => {
        this.state.hidden[on ? "delete" : "add"](body.key);
        this.changed("field");
      }).element;
    });
    this.edges = check("Edges", this.state.edges, (on) => {
      this.state.edges = on;
      this.changed("look");
    });
    this.#section("Bodies", ...boxes, row("Drawn as", form), this.edges.element);
  }

  /** A slider over the values of a factor of the state, with its text; `what` changes. */
  #factor(label, key, values, what) {
    const text = make("output");
    const slider = make("input", { type: "range", min: 0, max: values.length - 1, step: 1 });
    slider.ariaLabel = label;
    const show = () => (text.textContent = `${number(this.state[key])} ×`);
    slider.value = Math.max(values.indexOf(this.state[key]), 0);
    slider.addEventListener("input", () => {
      this.state[key] = values[slider.value];
      show();
      this.changed(what);
    });
    show();
    return [slider, text];
  }

  /** Plies of laminates, where there are any. */
  #plies() {
    const count = most(this.run.bodies);
    if (!count) return;
    const [{ plies }] = this.run.bodies.filter((body) => body.plies.length === count);
    const names = plies.map(({ angle }, n) => [String(n + 1), `${n + 1}: ${number(angle)}°`]);
    const choice = select([["0", "all"], ...names], String(this.state.ply), (ply) => {
      this.state.ply = Number(ply);
      this.changed("plies");
    });
    const apart = this.#factor("Distance of the plies", "apart", APART, "plies");
    this.#section("Plies", row("Ply", choice), row("Apart", ...apart));
  }

  #deformation() {
    const deforms = this.run.bodies.some((body) => body.fields.some((f) => f.name === "displacement"));
    if (!deforms) return;
    this.#section("Deformation", row("Enlarged", ...this.#factor("Deformation scale", "scale", SCALES, "look")));
  }

  #clip() {
    const { clip } = this.state;
    const moved = () => {
      this.showClip();
      if (clip.on) this.changed("shape");
    };
    this.clip = check("Cut the bodies", clip.on, (on) => {
      clip.on = on;
      clip.flip = this.facing();
      this.changed("shape");
    });
    const axes = select(
      [
        ["0", "x"],
        ["1", "y"],
        ["2", "z"],
        [String(OBLIQUE), "oblique"],
      ],
      String(clip.axis),
      (axis) => {
        clip.axis = Number(axis);
        clip.flip = this.facing();
        moved();
      },
    );
    axes.className = "short";
    const flip = make("button", { textContent: "flip", title: "Other side (X)" });
    flip.addEventListener("click", () => {
      clip.flip = !clip.flip;
      moved();
    });
    const slider = (label, key, min, max, step) => {
      const input = make("input", { type: "range", min, max, step, value: clip[key] });
      input.ariaLabel = label;
      const text = make("output");
      input.addEventListener("input", () => {
        clip[key] = Number(input.value);
        clip.on = this.clip.box.checked = true;
        moved();
      });
      return { text, input };
    };
    const place = slider("Position of the cut", "part", 0, 1, 0.002);
    const angles = [
      slider("Angle of the cut around z", "azimuth", -180, 180, 1),
      slider("Angle of the cut above the horizon", "elevation", -90, 90, 1),
    ];
    const rows = ["Around z", "Upwards"].map((name, n) => row(name, angles[n].input, angles[n].text));
    this.cut = { place, angles, rows };
    this.#section("Cut", this.clip.element, row("Across", axes, flip), ...rows, row("At", place.input, place.text));
  }

  /** Shows where the cut is. */
  showClip() {
    const { clip, box } = this.state;
    const { place, angles, rows } = this.cut;
    for (const row of rows) row.hidden = clip.axis !== OBLIQUE;
    [clip.azimuth, clip.elevation].forEach((angle, n) => (angles[n].text.textContent = `${angle}°`));
    const [low, high] = extent(box, normalOf(clip));
    const { factor, unit } = unitFor("m", Math.max(Math.abs(low), Math.abs(high)));
    const step = (high - low) / 1000;
    const at = placeOf(clip, box);
    place.text.textContent = `${number((step > 0 ? Math.round(at / step) * step : low) * factor, 3)} ${unit}`;
  }

  #camera() {
    const buttons = Object.keys(VIEWS).map((name) => {
      const button = make("button", { textContent: name });
      button.addEventListener("click", () => this.view(name));
      return button;
    });
    const more = [
      ["torch", "From the side of the heat source (T)"],
      ["fit", "Whole scene (F)"],
    ].map(([name, title]) => {
      const button = make("button", { textContent: name, title });
      button.addEventListener("click", () => this.view(name));
      return button;
    });
    this.perspective = check("Perspective", this.state.perspective, (on) => {
      this.state.perspective = on;
      this.changed("look");
    });
    const widths = [...new Set([0, ...WIDTHS, this.state.picture])].sort((a, b) => a - b);
    const picture = select(
      widths.map((width) => [String(width), width ? `${width} px wide` : "as window"]),
      String(this.state.picture),
      (width) => {
        this.state.picture = Number(width);
        this.changed("look");
      },
    );
    const where = make("div", { className: "buttons" }, ...buttons, ...more);
    this.#section("View", where, this.perspective.element, row("Picture", picture));
  }

  #marks() {
    this.torch = check("Heat source", this.state.torch, (on) => {
      this.state.torch = on;
      this.changed("look");
    });
    this.ruler = check("Ruler: click two places", Boolean(this.state.ruler), (on) => {
      this.state.ruler = on ? { from: null, to: null } : null;
      this.changed("look");
    });
    this.#section("Marks", this.torch.element, this.ruler.element);
  }
}

const KEYS = [
  ["drag", "turn"],
  ["shift or right button", "move"],
  ["wheel, two fingers", "zoom"],
  ["point at a body", "values of the point"],
  ["click on a body", "curve of the point; once more: without"],
  ["space", "play, pause"],
  ["← →", "previous, next state"],
  ["Home, End", "first, last state"],
  ["1 … 7", "oblique, front, right, top, back, left, bottom"],
  ["F", "fit into the window"],
  ["T", "from the side of the heat source"],
  ["C", "cut on, off"],
  ["X", "other side of the cut"],
  ["I", "interpolate, or one colour for each point"],
  ["P", "perspective on, off"],
  ["E", "edges on, off"],
  ["U", "°C or K"],
  ["M", "ruler on, off"],
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
