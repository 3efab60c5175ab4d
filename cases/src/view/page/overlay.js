// Text and scales over the picture: colour bar, axes, length, title.

import { labelled, number, ticks, toShown, toValue, unitFor } from "./units.js";

const MARGIN = 16;

/** Draws all of it. `look` is what the scene was drawn with; `legend` names the values; sizes are in CSS pixels. */
export function overlay(canvas, ratio, look, legend, camera, scene) {
  const context = canvas.getContext("2d");
  const [width, height] = [canvas.width / ratio, canvas.height / ratio];
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  context.font = "12.5px system-ui, 'Segoe UI', Roboto, 'DejaVu Sans', sans-serif";
  context.lineWidth = 1;
  title(context, legend);
  if (legend.map) bar(context, width, height, look, legend);
  triad(context, height, camera, legend.text);
  if (!camera.perspective) length(context, height, camera, scene, legend.text);
}

function title(context, legend) {
  context.fillStyle = legend.text;
  context.textAlign = "left";
  context.textBaseline = "top";
  context.font = "600 14px system-ui, 'Segoe UI', Roboto, 'DejaVu Sans', sans-serif";
  context.fillText(legend.title, MARGIN, MARGIN - 2);
  context.font = "12.5px system-ui, 'Segoe UI', Roboto, 'DejaVu Sans', sans-serif";
  context.globalAlpha = 0.75;
  context.fillText(legend.below, MARGIN, MARGIN + 18);
  context.globalAlpha = 1;
}

function bar(context, width, height, look, legend) {
  const long = Math.min(Math.max(height - 150, 90), 340);
  const [x, y, wide] = [width - MARGIN - 92, (height - long) / 2 + 10, 14];
  const gradient = context.createLinearGradient(0, y + long, 0, y);
  const colours = legend.map;
  colours.forEach((c, i) => gradient.addColorStop(i / (colours.length - 1), `rgb(${c.join(",")})`));
  context.fillStyle = gradient;
  context.fillRect(x, y, wide, long);
  context.strokeStyle = legend.text;
  context.globalAlpha = 0.5;
  context.strokeRect(x - 0.5, y - 0.5, wide + 1, long + 1);
  context.globalAlpha = 1;
  const [low, high] = look.range;
  const known = unitFor(legend.unit, Math.max(Math.abs(low), Math.abs(high)), legend.shownUnit);
  context.fillStyle = legend.text;
  context.textAlign = "right";
  context.textBaseline = "bottom";
  context.fillText(labelled(legend.label, known.unit), width - MARGIN, y - 12);
  context.textAlign = "left";
  context.textBaseline = "middle";
  const place = (value) => y + long - (long * (value - low)) / (high - low);
  const near = (value) => [low, high].some((end) => Math.abs(place(end) - place(value)) < 13);
  const inner = ticks(toShown(low, known), toShown(high, known), 5).map((shown) => toValue(shown, known));
  for (const value of [low, high, ...inner.filter((v) => !near(v))]) {
    const at = Math.round(place(value)) + 0.5;
    context.strokeStyle = legend.text;
    context.beginPath();
    context.moveTo(x + wide, at);
    context.lineTo(x + wide + 5, at);
    context.stroke();
    context.fillText(number(toShown(value, known)), x + wide + 9, at);
  }
  for (const level of legend.levels) {
    if (level.value <= low || level.value >= high) continue;
    const at = Math.round(place(level.value)) + 0.5;
    context.strokeStyle = level.colour;
    context.lineWidth = 2;
    context.beginPath();
    context.moveTo(x, at);
    context.lineTo(x + wide, at);
    context.stroke();
    context.lineWidth = 1;
  }
}

function triad(context, height, camera, text) {
  const [right, up, back] = camera.axes();
  const [x, y, size] = [MARGIN + 34, height - MARGIN - 34, 30];
  const axes = ["x", "y", "z"].map((name, i) => ({
    name,
    to: [right[i] * size, -up[i] * size],
    depth: back[i],
    colour: ["#e5484d", "#30a46c", "#4c8dff"][i],
  }));
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.lineWidth = 2;
  for (const axis of axes.sort((a, b) => a.depth - b.depth)) {
    context.strokeStyle = axis.colour;
    context.beginPath();
    context.moveTo(x, y);
    context.lineTo(x + axis.to[0], y + axis.to[1]);
    context.stroke();
    if (Math.hypot(...axis.to) < 7) continue;
    context.fillStyle = text;
    context.fillText(axis.name, x + 1.3 * axis.to[0], y + 1.3 * axis.to[1]);
  }
  context.lineWidth = 1;
}

/** A bar of a round length; lengths are the same everywhere without perspective only. */
function length(context, height, camera, scene, text) {
  const pixel = (2 * camera.reach * scene.radius) / height;
  const rough = 130 * pixel;
  const power = 10 ** Math.floor(Math.log10(rough));
  const round = power * [5, 2, 1].find((s) => s * power <= rough);
  const { factor, unit } = unitFor("m", round);
  const [x, y, wide] = [MARGIN + 96, height - MARGIN - 8, round / pixel];
  context.strokeStyle = text;
  context.fillStyle = text;
  context.beginPath();
  context.moveTo(x + 0.5, y - 4);
  context.lineTo(x + 0.5, y + 0.5);
  context.lineTo(Math.round(x + wide) + 0.5, y + 0.5);
  context.lineTo(Math.round(x + wide) + 0.5, y - 4);
  context.stroke();
  context.textAlign = "center";
  context.textBaseline = "bottom";
  context.fillText(`${number(round * factor)} ${unit}`, x + wide / 2, y - 4);
}
