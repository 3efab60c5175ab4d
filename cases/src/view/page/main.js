// The page: wires what is shown to buttons, keys, time and the log as it grows.

import { address, settings, timeOf, viewOf } from "./address.js";
import { film, painted, picture } from "./capture.js";
import { Charts, nearest } from "./charts.js";
import { Controls, keyList } from "./controls.js";
import { Data } from "./data.js";
import { distanceText } from "./marks.js";
import { pointer } from "./pointer.js";
import { number, placeText, setCelsius, setRules, toShown, unitFor, withUnit } from "./units.js";
import { QUICK, Viewer } from "./viewer.js";

const SPEEDS = [1, 2, 5, 10, 20, 30];

/** Time between questions whether the log has grown, ms. */
const POLL = 2000;
const POLL_FINISHED = 10_000;

/** A log that has changed within this time belongs to a run under way, s. */
const RECENT = 60;

/** Most points with a curve. */
const MOST_POINTS = 6;

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
  const { field, state } = viewer ?? {};
  const unit = field && unitFor(field.unit, Math.max(...state.shownRange.map(Math.abs)), field.shown_unit);
  const shown = viewer && {
    window: [viewer.panels[0].canvas.clientWidth, viewer.panels[0].canvas.clientHeight],
    radius: viewer.panels[0].scene.radius,
    box: state.box,
    drawn: viewer.panels.flatMap((panel) => panel.scene.drawn()),
    points: state.points,
    range: state.shownRange,
    bar: unit && { range: state.shownRange.map((x) => toShown(x, unit)), unit: unit.unit },
    coverage: viewer.coverage,
    camera: { ...viewer.camera },
    torches: state.torch ? viewer.panels.map((panel) => viewer.sources(panel)) : [],
    ruler: state.ruler?.to ? distanceText(state.ruler.from.computed, state.ruler.to.computed) : null,
    address: here(),
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
    viewer.ink = name === "dark" ? [0.8, 0.83, 0.87] : [0.4, 0.42, 0.45];
    viewer.stage = hex;
    viewer.draw();
  }
  if (viewer && charts) viewer.pointColours = charts.lines;
  charts?.draw();
}

/** Whether the newest state of a run under way is shown, and the next ones will be. */
const follows = () => following && run.logs.some((log) => ending(log)[0] === "under way");

/** What the address of the present picture has after its `#`. */
function here() {
  const time = follows() ? null : viewer.time;
  return address(viewer.state, run, { camera: viewer.camera, time, theme: document.documentElement.dataset.theme });
}

/** Writes the settings into the address, once they have been at rest. */
function remember() {
  clearTimeout(remember.timer);
  remember.timer = setTimeout(() => {
    if (!report.all.ready || playing || filming) return;
    history.replaceState(null, "", `#${here()}`);
  }, 300);
}

/** How a run ended, and what tells so. */
function ending(run) {
  if (run.ending) return ["damaged", run.ending, "bad"];
  const lost = run.damaged ? `${run.damaged} damaged parts of the log are left out` : "";
  const live = !run.finished && run.seconds_since_change !== null && run.seconds_since_change < RECENT;
  if (live) return ["under way", lost, lost ? "bad" : "live"];
  const ends = run.end === null ? "the end of its case" : withUnit(run.end, "s");
  if (run.stopped) return ["stopped", lost || `the run was stopped before ${ends}; \`perimelt resume\` continues it`, "bad"];
  if (run.finished) return ["complete", lost || `the run has reached ${ends}`, lost ? "bad" : ""];
  return ["unfinished", lost || "the run has not closed its log: it was killed, or it waits", lost ? "bad" : ""];
}

function header() {
  const { logs } = run;
  $("title").textContent = [...new Set(logs.map((log) => log.title))].join(" | ");
  document.title = `${$("title").textContent} – Perimelt`;
  const summary = (log) => {
    const end = log.end !== null && log.time < log.end ? ` of ${withUnit(log.end, "s")}` : "";
    const wall = log.wall_time ? `, computed in ${log.wall_time}` : "";
    return log.time === null ? log.file : `${log.file}: ${withUnit(log.time, "s", "s", 4)}${end}${wall}`;
  };
  $("subtitle").textContent = logs.map(summary).join(" | ");
  const endings = logs.map(ending);
  const badge = $("badge");
  badge.className = `badge ${["bad", "live"].find((kind) => endings.some((e) => e[2] === kind)) ?? ""}`;
  badge.textContent = [...new Set(endings.map((e) => e[0]))].join(" | ");
  badge.title = endings.map((e) => e[1]).join(" | ");
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
  remember();
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
  const busy = setTimeout(() => {
    $("busy").textContent = "range of the whole run …";
    $("busy").hidden = false;
  }, 700);
  try {
    await viewer.surveyRun();
  } catch (error) {
    failed(error);
  } finally {
    clearTimeout(busy);
    $("busy").hidden = true;
  }
}

async function changed(what) {
  if (what === "plies") {
    await viewer.frame();
    viewer.resized();
  }
  if (what === "field" || what === "plies") await go(viewer.index);
  if (what === "field" || what === "range") await survey();
  if (what === "field") await curves();
  if (what === "units") units();
  $("stage").classList.toggle("measuring", Boolean(viewer.state.ruler));
  viewer.shape();
  const without = viewer.withoutCells();
  if (without.length && what === "shape") {
    notice(`${without.join(", ")}: drawn as points, which are on no lattice, or have too many faces`);
  }
  remember();
}

/** Shows temperatures in the unit that is chosen. */
function units() {
  setCelsius(viewer.state.celsius);
  if (viewer.field) controls.showRange(viewer.state.shownRange, viewer.field);
  charts.draw();
}

const pictureWidth = () => viewer.state.picture || Math.round($("stage").clientWidth * viewer.ratio);

function takePicture() {
  picture(viewer, pictureWidth(), name());
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
      viewer,
      width: pictureWidth(),
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

/** Takes up what was clicked: an end of the ruler, or a point whose curve is shown, or no longer. */
async function picked(found) {
  const { state } = viewer;
  if (!found) return;
  if (state.ruler) {
    const end = { computed: found.computed, drawn: found.drawn };
    state.ruler = state.ruler.from && !state.ruler.to ? { ...state.ruler, to: end } : { from: end, to: null };
  } else {
    // the same place of bodies of one name in all logs
    for (const body of run.bodies.filter((b) => b.name === found.body.name)) {
      const isOther = (p) => p.key !== body.key || Math.hypot(...p.place.map((x, axis) => x - found.place[axis])) > 0.1 * body.spacing;
      const others = state.points.filter(isOther);
      if (others.length === state.points.length) others.push({ key: body.key, place: found.place });
      state.points = others.slice(-MOST_POINTS);
    }
    viewer.draw();
    await curves();
  }
  viewer.draw();
  remember();
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
  t: () => viewer.look("torch"),
  e: () => flip(controls.edges.box),
  u: () => flip(controls.celsius.box),
  m: () => flip(controls.ruler.box),
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
    remember();
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
  new ResizeObserver(() => viewer.resized()).observe($("stage"));
  keyList($("keys"));
  for (const panel of viewer.panels) {
    pointer(viewer, panel, $("tip"), {
      data,
      busy: () => playing || filming,
      touched: () => (touched = true),
      picked,
    });
    panel.canvas.addEventListener("dblclick", () => viewer.look("fit"));
  }
  viewer.onMoved = remember;
  // another link in the same window
  window.addEventListener("hashchange", () => location.reload());
}

/** The field that is shown over time, at the points that were clicked. */
async function clicked() {
  const { field, state } = viewer;
  if (!field || !state.points.length) return [];
  const curve = async ({ key, place }) => {
    const body = run.bodies.find((b) => b.key === key);
    const history = await data.history(body, state.scalar, place).catch(() => null);
    const { unit, shown_unit: shownUnit } = field;
    return history && { ...history, label: `${body.label} at ${placeText(place)}`, unit, shown_unit: shownUnit };
  };
  const columns = (await Promise.all(state.points.map(curve))).filter(Boolean);
  return [{ name: `${field.title} of clicked points`, kind: "point", times: [], columns }];
}

/** Clicked points, probes and reports, and melt pools where they take no long time. */
async function curves() {
  const { logs } = run;
  const melting = run.bodies.filter((b) => b.isotherms.length && b.times.length && b.points * b.times.length <= QUICK);
  const ofLog = (log) => (series) => ({ ...series, log, file: logs[log].file });
  const pool = async (body) => ofLog(body.log)(await data.meltPool(body));
  const series = async (log) => (await data.series(log)).map(ofLog(log));
  const [points, ...all] = await Promise.all([clicked(), ...melting.map(pool), ...logs.map((_, log) => series(log))]);
  charts.show([...points, ...all.flat()]);
  charts.at(viewer.time);
}

/** Whether a log has only grown since. */
function continues(before, now) {
  const same = before.logs.every((log, n) => log.started === now.logs[n].started) && before.bodies.length === now.bodies.length;
  return same && before.bodies.every((body, n) => body.times.every((time, i) => now.bodies[n].times[i] === time));
}

async function poll() {
  try {
    const now = await data.runs();
    if (!continues(run, now)) return location.reload();
    const grown = now.logs.some((log, n) => log.time !== run.logs[n].time || log.finished !== run.logs[n].finished);
    run = now;
    header();
    if (grown) {
      const follow = following && !playing && !filming;
      viewer.update(run);
      await viewer.updateSources();
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
  setTimeout(poll, run.logs.every((log) => log.finished) ? POLL_FINISHED : POLL);
}

/** A part of the window for each log. */
function panels(count) {
  const [first] = $("stage").getElementsByClassName("panel");
  const others = Array.from({ length: count - 1 }, () => first.cloneNode());
  first.after(...others);
  return [first, ...others];
}

async function start() {
  const asked = location.hash.slice(1);
  run = await data.runs();
  setRules(run.units);
  const state = settings(asked, run);
  setCelsius(state.celsius);
  viewer = new Viewer(data, run, state, panels(run.logs.length));
  const scheme = window.matchMedia("(prefers-color-scheme: light)").matches ? "light" : "dark";
  const wanted = new URLSearchParams(asked);
  theme(["light", "dark"].includes(wanted.get("theme")) ? wanted.get("theme") : scheme);
  charts = new Charts($("charts"), run.lines, (time) => go(nearest(viewer.times, time)));
  viewer.pointColours = charts.lines;
  header();
  await Promise.all([viewer.frame(), viewer.updateSources()]);
  controls = new Controls($("controls"), run, state, { changed, view: look, facing: () => viewer.facing() });
  controls.showClip();
  viewer.onRange = (range, field) => controls.showRange(range, field);
  viewer.onDraw = report;
  wire();
  const [view, time, last] = [viewOf(asked), timeOf(asked), viewer.times.length - 1];
  viewer.look(state.perspective ? "oblique" : "top");
  await go(time === null ? last : nearest(viewer.times, time));
  if (last < 0) notice("no state is in the log yet", 0);
  await Promise.all([survey(), curves()]);
  // a run under way is followed
  const live = run.logs.some((log) => ending(log)[0] === "under way");
  if (time === null && !live && !touched) await go(await viewer.opening());
  if (Array.isArray(view)) {
    viewer.camera.set(view);
    viewer.fitted = false;
  } else if (view !== null) viewer.look(view);
  else if (state.perspective && !touched) viewer.look("torch");
  if (wanted.has("measure")) report(viewer.durations());
  if (wanted.has("take")) {
    const taken = painted(viewer, pictureWidth());
    report({ taken: { width: taken.width, height: taken.height, bytes: taken.toDataURL("image/png").length } });
  }
  for (const place of wanted.getAll("click")) await click(place);
  viewer.drawNow();
  report({ ready: true });
  setTimeout(poll, POLL);
}

/** A click at a place of the first panel, given by parts of its width and height: for tests. */
async function click(place) {
  const [panel] = viewer.panels;
  const box = panel.canvas.getBoundingClientRect();
  const [u, v] = place.split(",").map(Number);
  await picked(viewer.at(panel, box.left + u * box.width, box.top + v * box.height));
}

function look(name) {
  viewer.look(name);
  remember();
}

window.addEventListener("error", (event) => failed(event.error ?? new Error(event.message)));
window.addEventListener("unhandledrejection", (event) => failed(event.reason));
start().catch(failed);
