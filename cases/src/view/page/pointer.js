// What the pointer does over the picture: turns it, tells of the point below it, picks points and the ends of the ruler.

import { control } from "./camera.js";
import { placeText, withUnit } from "./units.js";

/** A pointer that has moved further than this turns the picture, pixels. */
const STILL = 4;

/** Fills the table of a point. */
function describe(tip, found, all, field) {
  const head = document.createElement("strong");
  head.textContent = `${found.body.label}, point ${found.point}`;
  const table = document.createElement("table");
  const add = (label, value) => {
    const row = table.insertRow();
    row.insertCell().textContent = label;
    row.insertCell().textContent = value;
  };
  add("at", placeText(found.place));
  if (field && found.value !== null) add(field.title, withUnit(found.value, field.unit, field.shown_unit, 5));
  for (const other of all?.fields ?? []) {
    if (other.value !== null && other.label !== field?.title) add(other.label, withUnit(other.value, other.unit, other.shown_unit));
  }
  tip.replaceChildren(head, table);
}

/** Wires a panel of the viewer. `busy()` tells that no values are to be shown, `touched()` is called when the user acts, and
 * `picked(found)` with what was clicked. */
export function pointer(viewer, panel, tip, { data, busy, touched, picked }) {
  const { canvas } = panel;
  const dragging = control(canvas, viewer.camera, () => {
    viewer.fitted = false;
    viewer.draw();
  });
  let [last, timer, mine, down] = [0, 0, 0, null];
  const hide = () => {
    clearTimeout(timer);
    mine++;
    tip.hidden = true;
  };
  canvas.addEventListener("pointerleave", hide);
  canvas.addEventListener("pointerdown", (event) => {
    down = event.button === 0 ? [event.clientX, event.clientY] : null;
    touched();
    hide();
  });
  canvas.addEventListener("pointerup", (event) => {
    const still = down && Math.hypot(event.clientX - down[0], event.clientY - down[1]) < STILL;
    down = null;
    if (still) picked(viewer.at(panel, event.clientX, event.clientY));
    viewer.onMoved?.();
  });
  canvas.addEventListener("wheel", () => viewer.onMoved?.());
  canvas.addEventListener("pointermove", (event) => {
    if (dragging() || busy()) return hide();
    if (performance.now() - last < 50) return;
    last = performance.now();
    const found = viewer.at(panel, event.clientX, event.clientY);
    hide();
    if (!found) return;
    describe(tip, found, null, viewer.field);
    const area = tip.parentElement.getBoundingClientRect();
    const [x, y] = [event.clientX - area.left, event.clientY - area.top];
    const place = () => {
      tip.hidden = false;
      tip.style.left = `${x + 16 + tip.offsetWidth > area.width ? Math.max(x - tip.offsetWidth - 12, 0) : x + 16}px`;
      tip.style.top = `${Math.max(Math.min(y + 14, area.height - tip.offsetHeight - 8), 0)}px`;
    };
    place();
    const now = ++mine;
    timer = setTimeout(async () => {
      const all = await data.point(found.body, found.point, found.state).catch(() => null);
      if (!all || now !== mine) return;
      describe(tip, found, all, viewer.field);
      place();
    }, 220);
  });
}
