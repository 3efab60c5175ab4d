// Settings in the address of the page, so that a link shows the same picture:
// `#field=stress.xx&time=2&view=top&cut=y0.5&scale=50&theme=light`.
//
// `view` is a direction by name, or `yaw,pitch,x,y,z,reach` of the camera; `cut` an axis, or `n` with two angles (degrees) and a
// comma each, then the part of the way through the bodies, and `f` for the other side; `range` is `auto`, `run`, `now` or two
// values in SI units; `ply` the number of a ply of laminates and `apart` the distance of plies over that in the laminate; `point` is a clicked point, `body:x,y,z` (m, at rest); `ruler` is `on`, or has the two places as computed and as drawn, m.

import { VIEWS } from "./camera.js";
import { MOST_PIXELS } from "./capture.js";
import { OBLIQUE } from "./plane.js";

const short = (x, digits = 6) => String(Number(x.toPrecision(digits)));
const numbers = (text) => text.split(",").map(Number);
const finite = (list, count) => list.length === count && list.every(Number.isFinite);

const CUT = /^(?:([xyz])|n(-?[\d.]+),(-?[\d.]+),)(\d*\.?\d+)(f?)$/;

/** On or off, with what holds if the address does not tell. */
const flag = (asked, name, otherwise) => (asked.has(name) ? asked.get(name) !== "no" : otherwise);

/** The settings of an address (what follows its `#`) for a run. */
export function settings(text, run) {
  const asked = new URLSearchParams(text);
  const fields = run.bodies.flatMap((body) => body.fields);
  const first = fields.find((f) => f.name === "temperature") ?? fields[0];
  const wanted = asked.get("field");
  const isNone = wanted === "none";
  const field = isNone ? null : (fields.find((f) => f.scalars.some((s) => s.name === wanted)) ?? first);
  const range = asked.get("range") ?? "auto";
  const hand = numbers(range);
  const isHand = finite(hand, 2) && hand[0] < hand[1];
  const cut = CUT.exec(asked.get("cut") ?? "");
  const axis = cut?.[1] ? "xyz".indexOf(cut[1]) : cut ? OBLIQUE : 1;
  const points = asked.getAll("point").map((text) => {
    const [, key, place] = /^(.*):(.*)$/.exec(text) ?? [];
    return { key, place: numbers(place ?? "") };
  });
  const isKnown = (key) => run.bodies.some((body) => body.key === key);
  const ruler = numbers(asked.get("ruler") ?? "");
  const picture = Math.round(Number(asked.get("picture")));
  return {
    field: field?.name ?? "",
    scalar: (field?.scalars.find((s) => s.name === wanted) ?? field?.scalars[0])?.name ?? "",
    map: run.maps.some((m) => m.name === asked.get("map")) ? asked.get("map") : "auto",
    range: isHand ? "hand" : ["run", "now"].includes(range) ? range : "auto",
    hand: isHand ? hand : [0, 1],
    shownRange: [0, 1],
    smooth: flag(asked, "smooth", true),
    lines: flag(asked, "lines", true),
    celsius: flag(asked, "celsius", run.celsius),
    form: ["cells", "points"].includes(asked.get("form")) ? asked.get("form") : "auto",
    edges: flag(asked, "edges", true),
    torch: flag(asked, "torch", true),
    hidden: new Set(asked.getAll("hide").filter(isKnown)),
    scale: Number.isFinite(Number(asked.get("scale") ?? 1)) ? Number(asked.get("scale") ?? 1) : 1,
    ply: Math.max(Math.round(Number(asked.get("ply"))) || 0, 0),
    apart: Math.max(Number(asked.get("apart")) || 1, 1),
    clip: {
      on: Boolean(cut),
      axis,
      azimuth: Number(cut?.[2] ?? 30),
      elevation: Number(cut?.[3] ?? 0),
      part: cut ? Math.min(Math.max(Number(cut[4]), 0), 1) : 0.5,
      // the side that is kept at first is the one whose face is seen from the front
      flip: (axis !== 2) !== Boolean(cut?.[5]),
    },
    perspective: flag(asked, "perspective", run.bodies.some((body) => body.dimension === 3)),
    points: points.filter((p) => isKnown(p.key) && finite(p.place, 3)),
    ruler: finite(ruler, 12) ? rulerOf(ruler) : asked.get("ruler") === "on" ? { from: null, to: null } : null,
    picture: picture >= 200 ? Math.min(picture, MOST_PIXELS) : 0,
  };
}

function rulerOf(n) {
  const end = (first) => ({ computed: n.slice(first, first + 3), drawn: n.slice(first + 3, first + 6) });
  return { from: end(0), to: end(6) };
}

/** The direction of an address; `null` if it has none. */
export function viewOf(text) {
  const view = new URLSearchParams(text).get("view");
  if (view === null || view in VIEWS || view === "torch") return view;
  const six = numbers(view);
  return finite(six, 6) ? six : null;
}

/** The time of an address, s; `null` if it has none. */
export function timeOf(text) {
  const time = new URLSearchParams(text).get("time");
  return time === null || !Number.isFinite(Number(time)) ? null : Number(time);
}

/** The address of what is shown; what is as usual is left out, and the time where it is `null`. */
export function address(state, run, { camera, time, theme }) {
  const parts = [];
  const add = (name, value) => parts.push(`${name}=${encodeURIComponent(value).replace(/%2C/g, ",").replace(/%3A/g, ":").replace(/%2F/g, "/")}`);
  const differs = (name, value, usual) => {
    if (value !== usual) add(name, typeof value === "boolean" ? (value ? "yes" : "no") : value);
  };
  add("field", state.scalar || "none");
  if (time !== null) add("time", short(time, 9));
  const { yaw, pitch, target, reach } = camera;
  add("view", [yaw, pitch, ...target, reach].map((x) => short(x, 5)).join(","));
  const { clip, ruler } = state;
  if (clip.on) {
    const across = clip.axis === OBLIQUE ? `n${clip.azimuth},${clip.elevation},` : "xyz"[clip.axis];
    add("cut", `${across}${short(clip.part)}${clip.flip === (clip.axis !== 2) ? "" : "f"}`);
  }
  differs("ply", state.ply, 0);
  differs("apart", state.apart, 1);
  differs("map", state.map, "auto");
  differs("range", state.range === "hand" ? state.hand.map((x) => short(x)).join(",") : state.range, "auto");
  differs("smooth", state.smooth, true);
  differs("lines", state.lines, true);
  differs("celsius", state.celsius, run.celsius);
  differs("form", state.form, "auto");
  differs("edges", state.edges, true);
  differs("torch", state.torch, true);
  for (const key of state.hidden) add("hide", key);
  differs("scale", state.scale, 1);
  differs("perspective", state.perspective, run.bodies.some((body) => body.dimension === 3));
  for (const { key, place } of state.points) add("point", `${key}:${place.map((x) => short(x, 7)).join(",")}`);
  if (ruler?.to) add("ruler", [ruler.from, ruler.to].flatMap((end) => [...end.computed, ...end.drawn]).map((x) => short(x)).join(","));
  differs("picture", state.picture, 0);
  add("theme", theme);
  return parts.join("&");
}
