// Marks in the picture: heat sources, clicked points, the ruler.

import { number, unitFor } from "./units.js";

const TORCH = "#f08c3a";

/** Length of a torch in the picture, in radii of the scene. */
const LENGTH = 0.22;

/** The place in the window of a place (m) in the scene. */
export function projected({ view, projection }, scene, [width, height]) {
  const times = (m, [x, y, z, w]) => [0, 1, 2, 3].map((r) => m[r] * x + m[4 + r] * y + m[8 + r] * z + m[12 + r] * w);
  return (place) => {
    const at = place.map((x, axis) => (x - scene.centre[axis]) / scene.radius);
    const [x, y, , w] = times(projection, times(view, [...at, 1]));
    return [(0.5 + (0.5 * x) / w) * width, (0.5 - (0.5 * y) / w) * height];
  };
}

/** Draws them; `place` is that of `projected`, `radius` (m) that of the scene. */
export function marks(canvas, ratio, { torches, points, ruler, text }, place, radius) {
  const context = canvas.getContext("2d");
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  for (const source of torches) torch(context, source, place, radius);
  for (const point of points) dot(context, place(point.place), point.colour);
  if (ruler?.from) measure(context, ruler, place, text);
}

/** A cone whose tip is where the source is, hollow while it is off. */
function torch(context, { position, beam, power }, place, radius) {
  const tail = position.map((x, axis) => x - LENGTH * radius * beam[axis]);
  const [tip, end] = [place(position), place(tail)];
  const along = [end[0] - tip[0], end[1] - tip[1]];
  const wide = 11;
  context.beginPath();
  const long = Math.hypot(...along);
  if (long < wide) {
    // seen along the beam
    context.arc(...tip, wide, 0, 2 * Math.PI);
  } else {
    const [x, y] = [(-wide * along[1]) / long, (wide * along[0]) / long];
    const shoulder = Math.min(26, long) / long;
    const neck = [tip[0] + shoulder * along[0], tip[1] + shoulder * along[1]];
    context.moveTo(...tip);
    context.lineTo(neck[0] + 0.6 * x, neck[1] + 0.6 * y);
    context.lineTo(end[0] + 0.6 * x, end[1] + 0.6 * y);
    context.lineTo(end[0] - 0.6 * x, end[1] - 0.6 * y);
    context.lineTo(neck[0] - 0.6 * x, neck[1] - 0.6 * y);
    context.closePath();
  }
  context.lineWidth = 2;
  context.lineJoin = "round";
  context.strokeStyle = power > 0 ? "#000000a0" : TORCH;
  context.fillStyle = TORCH;
  context.globalAlpha = power > 0 ? 0.85 : 0.9;
  if (power > 0) context.fill();
  context.stroke();
  context.globalAlpha = 1;
}

function dot(context, [x, y], colour) {
  context.beginPath();
  context.arc(x, y, 5, 0, 2 * Math.PI);
  context.fillStyle = colour;
  context.fill();
  context.lineWidth = 2;
  context.strokeStyle = "#ffffff";
  context.stroke();
}

/** Distance of two places and its parts along x, y and z, as text. */
export function distanceText(from, to) {
  const parts = to.map((x, axis) => x - from[axis]);
  const long = Math.hypot(...parts);
  const { factor, unit } = unitFor("m", long);
  // what is below a thousandth of the distance is the rounding of single precision
  const part = (x) => number(Math.abs(x) < 1e-3 * long ? 0 : x * factor, 3);
  return `${number(long * factor, 4)} ${unit} (x ${part(parts[0])}, y ${part(parts[1])}, z ${part(parts[2])})`;
}

function measure(context, { from, to }, place) {
  const ends = [from, to].filter(Boolean).map((end) => place(end.drawn));
  const line = (width, colour) => {
    context.lineWidth = width;
    context.strokeStyle = colour;
    context.beginPath();
    if (ends.length === 2) {
      context.moveTo(...ends[0]);
      context.lineTo(...ends[1]);
    }
    for (const [x, y] of ends) {
      context.moveTo(x + 4, y);
      context.arc(x, y, 4, 0, 2 * Math.PI);
    }
    context.stroke();
  };
  line(4, "#000000b0");
  line(2, "#ffffff");
  if (ends.length < 2) return;
  const said = distanceText(from.computed, to.computed);
  const [x, y] = [0, 1].map((axis) => (ends[0][axis] + ends[1][axis]) / 2);
  context.font = "600 13px system-ui, 'Segoe UI', Roboto, 'DejaVu Sans', sans-serif";
  context.textAlign = "center";
  context.textBaseline = "middle";
  const wide = context.measureText(said).width + 14;
  context.fillStyle = "#000000c0";
  context.fillRect(x - wide / 2, y - 28, wide, 21);
  context.fillStyle = "#ffffff";
  context.fillText(said, x, y - 17);
}
