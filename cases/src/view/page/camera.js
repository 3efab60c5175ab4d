// The camera turns around a target; z points up. Mouse, touch and wheel move it.

const LIMIT = Math.PI / 2;

/** Distance from the middle, in half extents of a box, from which on a source is nearer to one side. */
const NEAR = 0.3;

export const VIEWS = {
  oblique: [-0.6, 0.55],
  front: [0, 0],
  right: [Math.PI / 2, 0],
  top: [0, LIMIT],
  back: [Math.PI, 0],
  left: [-Math.PI / 2, 0],
  bottom: [0, -LIMIT],
};

export class Camera {
  /** angles around z and above the horizon */
  yaw = VIEWS.oblique[0];
  pitch = VIEWS.oblique[1];
  target = [0, 0, 0];
  /** half the height of what is seen at the target, units of the scene */
  reach = 1.15;
  perspective = true;

  /** Sets angles, target and reach. */
  set([yaw, pitch, x, y, z, reach]) {
    Object.assign(this, { yaw, pitch, target: [x, y, z], reach });
  }

  look(name) {
    [this.yaw, this.pitch] = VIEWS[name];
  }

  /** Directions to the right, up, and towards the viewer. */
  axes() {
    const [cy, sy, cp, sp] = [Math.cos(this.yaw), Math.sin(this.yaw), Math.cos(this.pitch), Math.sin(this.pitch)];
    return [
      [cy, sy, 0],
      [-sy * sp, cy * sp, cp],
      [sy * cp, -cy * cp, sp],
    ];
  }

  /** View and projection, column by column, for a picture with this ratio of width to height. */
  matrices(aspect) {
    const [right, up, back] = this.axes();
    const distance = this.perspective ? this.reach / Math.tan(0.3) : 10 + this.reach;
    const eye = this.target.map((x, i) => x + distance * back[i]);
    const dot = (a) => -(a[0] * eye[0] + a[1] * eye[1] + a[2] * eye[2]);
    const view = new Float32Array([
      right[0], up[0], back[0], 0,
      right[1], up[1], back[1], 0,
      right[2], up[2], back[2], 0,
      dot(right), dot(up), dot(back), 1,
    ]);
    // deformed bodies may extend beyond the radius of the scene
    const span = 4 + Math.hypot(...this.target);
    const far = distance + span;
    // what is nearer is left out: depths would be too coarse for edges in front of faces
    const near = this.perspective ? Math.max(distance - span, 0.05 * distance) : distance - span;
    const projection = new Float32Array(16);
    if (this.perspective) {
      const f = 1 / Math.tan(0.3);
      projection.set([f / aspect, 0, 0, 0, 0, f, 0, 0, 0, 0, (far + near) / (near - far), -1]);
      projection[14] = (2 * far * near) / (near - far);
    } else {
      projection[0] = 1 / (this.reach * aspect);
      projection[5] = 1 / this.reach;
      projection[10] = 2 / (near - far);
      projection[14] = (far + near) / (near - far);
      projection[15] = 1;
    }
    return { view, projection };
  }

  /** A projection onto a part of the picture only: `[left, top, width, height]` of `[width, height]` pixels. */
  part(projection, [left, top, wide, tall], [width, height]) {
    const [sx, sy] = [width / wide, height / tall];
    const [cx, cy] = [(2 * left + wide) / width - 1, 1 - (2 * top + tall) / height];
    const made = Float32Array.from(projection);
    for (let column = 0; column < 4; column++) {
      const w = projection[4 * column + 3];
      made[4 * column] = sx * (projection[4 * column] - cx * w);
      made[4 * column + 1] = sy * (projection[4 * column + 1] - cy * w);
    }
    return made;
  }

  /**
   * Looks from the side on which a heat source is: against its beam, and from that side of the box (m) to which the source is
   * nearer. Of a half model, that is its plane of symmetry.
   */
  towards({ position, beam }, [low, high]) {
    const from = beam.map((x) => -x);
    // from -1 to 1 across the box
    const off = position.map((x, axis) => {
      const half = (high[axis] - low[axis]) / 2;
      return half > 0 ? (x - low[axis]) / half - 1 : 0;
    });
    const [yaw, pitch] = VIEWS.oblique;
    const level = Math.hypot(from[0], from[1]);
    if (level > 0.8) {
      // a beam from a side
      this.yaw = Math.atan2(from[0], -from[1]) + yaw;
      this.pitch = off[2] < -NEAR ? -pitch : pitch;
      return;
    }
    this.pitch = from[2] < 0 ? -pitch : pitch;
    const across = level > 0.2 ? from[1] : off[1];
    this.yaw = across > NEAR ? Math.PI - yaw : yaw;
  }

  /** Moves the picture by parts of its height. */
  pan(dx, dy) {
    const [right, up] = this.axes();
    const size = 2 * this.reach;
    this.target = this.target.map((x, i) => x - size * (dx * right[i] - dy * up[i]));
  }

  turn(dx, dy) {
    this.yaw -= 4 * dx;
    this.pitch = Math.min(Math.max(this.pitch + 4 * dy, -LIMIT), LIMIT);
  }

  /** Zooms; the place `(x, y)`, in parts of the height from the middle, stays where it is. */
  zoom(factor, x = 0, y = 0) {
    const reach = Math.min(Math.max(this.reach * factor, 1e-3), 20);
    const ratio = reach / this.reach;
    this.pan(x * (ratio - 1), y * (ratio - 1));
    this.reach = reach;
  }
}

/** Lets the pointer and the wheel move a camera; `changed` is called after each movement. */
export function control(element, camera, changed) {
  const pointers = new Map();
  const height = () => element.clientHeight || 1;
  element.addEventListener("pointerdown", (event) => {
    element.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, [event.clientX, event.clientY]);
  });
  const release = (event) => pointers.delete(event.pointerId);
  element.addEventListener("pointerup", release);
  element.addEventListener("pointercancel", release);
  element.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    const now = [event.clientX, event.clientY];
    const dx = (now[0] - before[0]) / height();
    const dy = (now[1] - before[1]) / height();
    if (pointers.size === 2) {
      const other = [...pointers].find(([id]) => id !== event.pointerId)[1];
      const apart = (p) => Math.hypot(p[0] - other[0], p[1] - other[1]) || 1;
      camera.zoom(apart(before) / apart(now));
      camera.pan(dx / 2, dy / 2);
    } else if (event.shiftKey || event.ctrlKey || event.buttons & 6) {
      camera.pan(dx, dy);
    } else {
      camera.turn(dx, dy);
    }
    pointers.set(event.pointerId, now);
    changed();
  });
  element.addEventListener(
    "wheel",
    (event) => {
      event.preventDefault();
      const box = element.getBoundingClientRect();
      const x = (event.clientX - box.left - box.width / 2) / box.height;
      const y = (event.clientY - box.top - box.height / 2) / box.height;
      const lines = event.deltaMode === 1 ? 16 * event.deltaY : event.deltaY;
      camera.zoom(Math.exp(Math.min(Math.max(lines, -200), 200) * 0.0015), x, y);
      changed();
    },
    { passive: false },
  );
  element.addEventListener("contextmenu", (event) => event.preventDefault());
  return () => pointers.size > 0;
}
