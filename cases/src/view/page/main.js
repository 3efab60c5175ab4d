// The page: wires what is shown to buttons, keys, time and the log as it grows.

import { film, picture } from "./capture.js";
import { control } from "./camera.js";
import { Charts, nearest } from "./charts.js";
import { Controls, keyList } from "./controls.js";
import { Data } from "./data.js";
import { number, setRules, unitFor, withUnit } from "./units.js";
import { QUICK, Viewer } from "./viewer.js";

const SPEEDS = [1, 2, 5, 10, 20, 30];

/** Time between questions whether the log has grown, ms. */
const POLL = 2000;
const POLL_FINISHED = 10_000;

/** A log that has changed within this time belongs to a run under way, s. */
const RECENT = 60;

const $ = (id) => document.getElementById(id);
const data = new Data();
const errors = [];
let viewer, controls, charts, run;
let [playing, filming, following, touched] = [false, false, false, false];

function notice(text, seconds = 6) {
  const element = $("notice");
  element.textContent = text;
  element.hidden = false;
  clearTimeout(notice.timer);
  if (seconds) notice.timer = setTimeout(() => (element.hidden = true), 1000 * seconds);
}

function failed(error) {
  errors.push(error.message);
  notice(error.message, 0);
  report();
}

/** What the page does, for tests. */
function report(more = {}) {
  Object.assign(report.all, more);
  const shown = viewer && {
    drawn: viewer.scene.drawn(),
    range: viewer.state.shownRange,
    time: viewer.time,
    index: viewer.index,
    states: viewer.times.length,
    field: viewer.state.scalar,
    title: run.title,
    curves: document.querySelectorAll(".chart").length,
    live: $("badge").textContent,
  };
  $("status").textContent = JSON.stringify({ ...report.all, ...shown, errors });
}
report.all = { ready: false };

function theme(name) {
  document.documentElement.dataset.theme = name;
  $("theme").textContent = name === "dark" ? "Light" : "Dark";
  const style = getComputedStyle(document.documentElement);
  const hex = style.getPropertyValue("--stage").trim();
  if (viewer) {
    viewer.background = [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16) / 255);
    viewer.text = style.getPropertyValue("--text").trim();
    viewer.stage = hex;
    viewer.draw();
  }
  charts?.draw();
}

/** Settings of the address: `#field=stress.xx&time=2&view=top&cut=y0.5&scale=50&theme=light&form=points`. */
function settings() {
  const asked = new URLSearchParams(location.hash.slice(1));
  const fields = run.bodies.flatMap((body) => body.fields);
  const first = fields.find((f) => f.name === "temperature") ?? fields[0];
  const wanted = asked.get("field");
  const field = fields.find((f) => f.scalars.some((s) => s.name === wanted)) ?? first;
  const size = run.bodies.reduce((sum, body) => sum + body.points * body.times.length, 0);
  const cut = /^([xyz])([\d.]+)$/.exec(asked.get("cut") ?? "");
  return {
    asked,
    state: {
      field: field?.name ?? "",
      scalar: (field?.scalars.find((s) => s.name === wanted) ?? field?.scalars[0])?.name ?? "",
      map: "auto",
      range: size <= QUICK ? "run" : "now",
      hand: [0, 1],
      shownRange: [0, 1],
      smooth: asked.get("smooth") !== "no",
      lines: true,
      form: asked.get("form") ?? "auto",
      hidden: new Set(),
      scale: Number(asked.get("scale") ?? 1),
      clip: { on: Boolean(cut), axis: cut ? "xyz".indexOf(cut[1]) : 1, part: cut ? Number(cut[2]) : 0.5, flip: cut?.[1] !== "z" },
      perspective: run.bodies.some((body) => body.dimension === 3),
    },
  };
}

function header() {
  $("title").textContent = run.title;
  document.title = `${run.title} – Perimelt`;
  const end = run.end !== null && run.time < run.end ? ` of ${withUnit(run.end, "s")}` : "";
  const wall = run.wall_time ? `, computed in ${run.wall_time}` : "";
  $("subtitle").textContent = run.time === null ? run.file : `${run.file}: ${withUnit(run.time, "s", "s", 4)}${end}${wall}`;
  const badge = $("badge");
  const live = !run.finished && run.seconds_since_change !== null && run.seconds_since_change < RECENT;
  badge.className = run.ending || run.damaged ? "badge bad" : live ? "badge live" : "badge";
  badge.textContent = run.ending ? "damaged" : live ? "under way" : !run.finished ? "unfinished" : run.stopped ? "stopped early" : "complete";
  badge.title =
    run.ending ??
    (run.damaged ? `${run.damaged} damaged parts of the log are left out` : !run.finished ? "" : run.stopped ? "the run stopped before its end" : "the run has closed its log");
}

function timeline() {
  const slider = $("slider");
  slider.max = Math.max(viewer.times.length - 1, 0);
  slider.value = viewer.index;
  const last = viewer.times[viewer.times.length - 1] ?? 0;
  const { factor, unit } = unitFor("s", last);
  const digits = Math.max(4, Math.ceil(Math.log10(viewer.times.length || 1)) + 1);
  $("clock").textContent = `${number(viewer.time * factor, digits)} of ${number(last * factor, digits)} ${unit} (${
    viewer.index + 1
  }/${viewer.times.length})`;
  $("play").textContent = playing ? "❚❚" : "▶";
}

/** Shows a state; one that is damaged is left out in the direction of `step`. */
async function go(index, step = 1) {
  const last = viewer.times.length - 1;
  let wanted = Math.min(Math.max(index, 0), last);
  try {
    while (!(await viewer.show(wanted))) {
      // another state was asked for meanwhile
      if (!viewer.lost.has(viewer.times[wanted])) return false;
      notice(`the state at ${withUnit(viewer.times[wanted], "s")} is damaged and left out`);
      wanted += step;
      if (wanted < 0 || wanted > last) return false;
    }
  } catch (error) {
    playing = false;
    failed(error);
    return false;
  }
  following = viewer.index === last;
  timeline();
  charts.at(viewer.time);
  return true;
}

function toggle(on = !playing) {
  playing = on;
  touched = true;
  timeline();
  if (playing) play();
}

async function play() {
  if (viewer.index >= viewer.times.length - 1) await go(0);
  while (playing && viewer.index < viewer.times.length - 1) {
    const start = performance.now();
    const next = viewer.index + 1;
    viewer.prepare(next + 1);
    if (!(await go(next)) && viewer.index < next - 1) break;
    if (viewer.lost.has(viewer.times[next]) && viewer.index <= next) break;
    await new Promise((resolve) => setTimeout(resolve, Math.max(1000 / $("speed").value - (performance.now() - start), 0)));
  }
  playing = false;
  timeline();
}

function step(by) {
  touched = true;
  playing = false;
  go(viewer.index + by, by);
}

async function survey() {
  if (viewer.state.range !== "run" || !viewer.state.field) return null;
  const busy = setTimeout(() => {
    $("busy").textContent = "range of the whole run …";
    $("busy").hidden = false;
  }, 700);
  try {
    return await viewer.surveyRun();
  } catch (error) {
    failed(error);
    return null;
  } finally {
    clearTimeout(busy);
    $("busy").hidden = true;
  }
}

async function changed(what) {
  if (what === "field") await go(viewer.index);
  if (what === "field" || what === "range") await survey();
  viewer.shape();
}

function takePicture() {
  viewer.drawNow();
  picture([$("gl"), $("overlay")], viewer.stage, name());
}

const name = () => `${run.file.replace(/\.mcap$/, "")}-${viewer.state.scalar || "body"}-${withUnit(viewer.time, "s").replace(" ", "")}`;

async function takeFilm() {
  if (filming) {
    filming = false;
    return;
  }
  filming = true;
  playing = false;
  $("film").classList.add("on");
  $("film").textContent = "Stop";
  const show = async (index) => {
    viewer.prepare(index + 1);
    await go(index);
    viewer.drawNow();
  };
  try {
    await film({
      states: viewer.times.map((_, index) => index).filter((index) => !viewer.lost.has(viewer.times[index])),
      show,
      layers: [$("gl"), $("overlay")],
      background: () => viewer.stage,
      pause: 1000 / $("speed").value,
      stopped: () => !filming,
      name: name(),
    });
  } catch (error) {
    failed(error);
  }
  filming = false;
  $("film").classList.remove("on");
  $("film").textContent = "Film";
}

function hover() {
  const tip = $("tip");
  const canvas = $("gl");
  const dragging = control(canvas, viewer.camera, () => viewer.draw());
  let [last, timer, mine] = [0, 0, 0];
  const hide = () => {
    clearTimeout(timer);
    mine++;
    tip.hidden = true;
  };
  canvas.addEventListener("pointerleave", hide);
  canvas.addEventListener("pointerdown", () => {
    touched = true;
    hide();
  });
  canvas.addEventListener("dblclick", () => viewer.look("fit"));
  canvas.addEventListener("pointermove", (event) => {
    if (dragging() || playing || filming) return hide();
    if (performance.now() - last < 50) return;
    last = performance.now();
    const found = viewer.at(event.clientX, event.clientY);
    hide();
    if (!found) return;
    describe(tip, found, null);
    const area = canvas.getBoundingClientRect();
    const [x, y] = [event.clientX - area.left, event.clientY - area.top];
    const place = () => {
      tip.hidden = false;
      tip.style.left = `${x + 16 + tip.offsetWidth > area.width ? Math.max(x - tip.offsetWidth - 12, 0) : x + 16}px`;
      tip.style.top = `${Math.max(Math.min(y + 14, area.height - tip.offsetHeight - 8), 0)}px`;
    };
    place();
    const now = ++mine;
    timer = setTimeout(async () => {
      const all = await data.point(found.body.name, found.point, found.state).catch(() => null);
      if (!all || now !== mine) return;
      describe(tip, found, all);
      place();
    }, 220);
  });
}

/** Fills the table of a point. */
function describe(tip, found, all) {
  const { factor, unit } = unitFor("m", Math.max(...found.place.map(Math.abs)));
  const head = document.createElement("strong");
  head.textContent = `${found.body.label}, point ${found.point}`;
  const table = document.createElement("table");
  const add = (label, value) => {
    const row = table.insertRow();
    row.insertCell().textContent = label;
    row.insertCell().textContent = value;
  };
  add("at", `${found.place.map((x) => number(x * factor, 4)).join(", ")} ${unit}`);
  const field = viewer.field;
  if (field && found.value !== null) add(field.title, withUnit(found.value, field.unit, field.shown_unit, 5));
  for (const other of all?.fields ?? []) {
    if (other.value !== null && other.label !== field?.title) add(other.label, withUnit(other.value, other.unit, other.shown_unit));
  }
  tip.replaceChildren(head, table);
}

const views = ["oblique", "front", "right", "top", "back", "left", "bottom"];
const flip = (box) => box.click();
const keys = {
  " ": () => toggle(),
  ArrowLeft: () => step(-1),
  ArrowRight: () => step(1),
  Home: () => step(-viewer.times.length),
  End: () => step(viewer.times.length),
  f: () => viewer.look("fit"),
  c: () => flip(controls.clip.box),
  i: () => flip(controls.smooth.box),
  p: () => flip(controls.perspective.box),
  x: () => {
    viewer.state.clip.flip = !viewer.state.clip.flip;
    viewer.shape();
  },
  s: takePicture,
  r: takeFilm,
  d: () => theme(document.documentElement.dataset.theme === "dark" ? "light" : "dark"),
  "?": () => ($("keys").hidden = !$("keys").hidden),
  Escape: () => ($("keys").hidden = true),
};

function wire() {
  window.addEventListener("keydown", (event) => {
    const typing = event.target.matches?.('input[type="text"], select');
    if (typing || event.ctrlKey || event.metaKey || event.altKey) return;
    const action = keys[event.key] ?? keys[event.key.toLowerCase()];
    const view = views[Number(event.key) - 1];
    if (!action && !view) return;
    event.preventDefault();
    if (action) action();
    else viewer.look(view);
  });
  const click = { first: keys.Home, previous: keys.ArrowLeft, play: keys[" "], next: keys.ArrowRight, last: keys.End };
  Object.assign(click, { picture: takePicture, film: takeFilm, theme: keys.d, help: keys["?"], keys: keys["?"] });
  for (const [id, action] of Object.entries(click)) $(id).addEventListener("click", () => action());
  $("slider").addEventListener("input", () => {
    [touched, playing] = [true, false];
    go(Number($("slider").value));
  });
  for (const speed of SPEEDS) $("speed").append(new Option(`${speed}/s`, speed));
  $("speed").value = 10;
  // at once: a canvas of another size is empty
  new ResizeObserver(() => viewer.drawNow()).observe($("stage"));
  keyList($("keys"));
  hover();
}

/** Probes and reports, and melt pools where they take no long time. */
async function curves() {
  const melting = run.bodies.filter((b) => b.isotherms.length && b.times.length && b.points * b.times.length <= QUICK);
  const [series, ...pools] = await Promise.all([data.series(), ...melting.map((body) => data.meltPool(body.name))]);
  charts.show([...pools, ...series]);
  charts.at(viewer.time);
}

/** Whether a log has only grown since. */
function continues(before, now) {
  const same = before.started === now.started && before.bodies.length === now.bodies.length;
  return same && before.bodies.every((body, n) => body.times.every((time, i) => now.bodies[n].times[i] === time));
}

async function poll() {
  try {
    const now = await data.run();
    if (!continues(run, now)) return location.reload();
    const grown = now.time !== run.time || now.finished !== run.finished;
    run = now;
    header();
    if (grown) {
      const follow = following && !playing && !filming;
      viewer.update(run);
      timeline();
      if (follow) await go(viewer.times.length - 1);
      await Promise.all([curves(), survey()]);
    }
    if (poll.failed) $("notice").hidden = true;
    poll.failed = false;
  } catch (error) {
    if (!poll.failed) notice(error.message, 0);
    poll.failed = true;
  }
  setTimeout(poll, run.finished ? POLL_FINISHED : POLL);
}

async function start() {
  run = await data.run();
  setRules(run.units);
  const { asked, state } = settings();
  viewer = new Viewer(data, run, state, [$("gl"), $("overlay")]);
  const scheme = window.matchMedia("(prefers-color-scheme: light)").matches ? "light" : "dark";
  theme(asked.get("theme") ?? scheme);
  charts = new Charts($("charts"), run.lines, (time) => go(nearest(viewer.times, time)));
  header();
  await viewer.frame();
  controls = new Controls($("controls"), run, state, { changed, view: (name) => viewer.look(name), facing: (axis) => viewer.facing(axis) });
  controls.showClip();
  viewer.onRange = (range, field) => controls.showRange(range, field);
  viewer.onDraw = report;
  wire();
  viewer.look(asked.get("view") ?? (state.perspective ? "oblique" : "top"));
  const time = asked.get("time");
  await go(time === null ? viewer.times.length - 1 : nearest(viewer.times, Number(time)));
  if (!viewer.times.length) notice("no state is in the log yet", 0);
  const [peak] = await Promise.all([survey(), curves()]);
  // a finished run is shown when its field peaks, as `perimelt plot` does
  if (peak !== null && run.finished && time === null && !touched) await go(peak);
  if (asked.has("measure")) report(viewer.durations());
  viewer.drawNow();
  report({ ready: true });
  setTimeout(poll, POLL);
}

window.addEventListener("error", (event) => failed(event.error ?? new Error(event.message)));
window.addEventListener("unhandledrejection", (event) => failed(event.reason));
start().catch(failed);
