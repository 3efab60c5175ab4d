// What is drawn: bodies as cells or as points, by WebGL 2.

import { faces, lattice, vertexMotion, vertexValues, visiblePoints } from "./cells.js";
import * as shaders from "./shaders.js";

/** Hidden points of larger bodies are left out. */
const MANY_POINTS = 200_000;

/** Far behind everything, in radii. */
const AWAY = 1e6;

/** What is known of a picked pixel: point and body, place as computed, place as drawn. */
const PICKED = 3;

function program(gl, vertex, fragment) {
  const made = gl.createProgram();
  for (const [type, text] of [
    [gl.VERTEX_SHADER, vertex],
    [gl.FRAGMENT_SHADER, fragment],
  ]) {
    const shader = gl.createShader(type);
    gl.shaderSource(shader, text);
    gl.compileShader(shader);
    gl.attachShader(made, shader);
    if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS) && !gl.isContextLost())
      throw new Error(`a shader does not compile: ${gl.getShaderInfoLog(shader)}`);
  }
  gl.linkProgram(made);
  const uniforms = new Map();
  const place = (name) => {
    if (!uniforms.has(name)) uniforms.set(name, gl.getUniformLocation(made, name));
    return uniforms.get(name);
  };
  return { made, place };
}

export class Scene {
  /** centre (m) and radius (m) of what is shown */
  centre = [0, 0, 0];
  radius = 1;
  bodies = new Map();

  constructor(canvas) {
    this.canvas = canvas;
    const gl = canvas.getContext("webgl2", { antialias: true, alpha: false, powerPreference: "high-performance" });
    if (!gl) throw new Error("this browser offers no WebGL 2");
    this.gl = gl;
    this.programs = {
      cells: program(gl, shaders.CELLS_VERTEX, shaders.CELLS_FRAGMENT),
      points: program(gl, shaders.POINTS_VERTEX, shaders.POINTS_FRAGMENT),
    };
    this.lines = program(gl, shaders.CELLS_VERTEX, shaders.LINES_FRAGMENT);
    this.picks = {
      cells: program(gl, shaders.CELLS_VERTEX, shaders.CELLS_PICK),
      points: program(gl, shaders.POINTS_VERTEX, shaders.POINTS_PICK),
    };
    this.map = gl.createTexture();
    gl.enable(gl.DEPTH_TEST);
  }

  /** Room for all of these boxes, m. */
  frame(boxes) {
    const low = [0, 1, 2].map((axis) => Math.min(...boxes.map((box) => box[0][axis])));
    const high = [0, 1, 2].map((axis) => Math.max(...boxes.map((box) => box[1][axis])));
    this.centre = low.map((x, axis) => (x + high[axis]) / 2);
    this.radius = Math.hypot(...low.map((x, axis) => high[axis] - x)) / 2 || 1;
    this.box = [low, high];
    for (const body of this.bodies.values()) body.stale = true;
  }

  /** Colours of the map, red, green, blue from 0 to 255, equidistant. */
  colours(points) {
    const gl = this.gl;
    const texels = new Uint8Array(256 * 4);
    for (let i = 0; i < 256; i++) {
      const place = (i / 255) * (points.length - 1);
      const first = Math.min(Math.floor(place), points.length - 2);
      for (let c = 0; c < 3; c++) {
        texels[4 * i + c] = points[first][c] + (place - first) * (points[first + 1][c] - points[first][c]);
      }
      texels[4 * i + 3] = 255;
    }
    gl.bindTexture(gl.TEXTURE_2D, this.map);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, 256, 1, 0, gl.RGBA, gl.UNSIGNED_BYTE, texels);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
  }

  /**
   * Shows a state of a body: `points` (positions at rest), and `values`, `motion` and `spacings` or nothing. `form` is
   * `auto`, `cells` or `points`.
   */
  set(info, { points, values, motion, spacings, form, smooth, clip }) {
    let body = this.bodies.get(info.key);
    if (!body) {
      body = { info, number: this.bodies.size + 1, vao: this.gl.createVertexArray(), buffers: {}, scattered: false };
      this.bodies.set(info.key, body);
    }
    const cut = clip ? `${clip.normal} ${clip.offset}` : "";
    if (body.points !== points || body.stale) {
      body.grid = info.has_spacings ? null : lattice(points, info.spacing);
      body.points = points;
      body.cut = null;
      body.stale = false;
    }
    const cells = form !== "points" && body.grid && !(form === "auto" && body.scattered);
    if (body.cut !== cut || body.wanted !== cells) {
      body.wanted = cells;
      body.cut = cut;
      body.mesh = cells ? faces(body.grid, clip, info.dimension) : null;
      this.#place(body, clip);
    }
    if (body.mesh && motion) {
      const unit = 1 / this.radius;
      body.moved ??= new Float32Array(0);
      if (body.moved.length !== 3 * body.mesh.point.length) body.moved = new Float32Array(3 * body.mesh.point.length);
      const together = vertexMotion(body.mesh, motion, info.spacing, unit, body.moved);
      if (!together && form === "auto") {
        body.scattered = true;
        return this.set(info, { points, values, motion, spacings, form, smooth, clip });
      }
    }
    this.#fill(body, values, motion, spacings, smooth);
  }

  hide(key, hidden) {
    const body = this.bodies.get(key);
    if (body) body.hidden = hidden;
  }

  /** Points or faces that are drawn. */
  drawn() {
    const shown = [...this.bodies.values()].filter((body) => !body.hidden);
    return shown.map(({ info, mesh, count }) => ({
      body: info.name,
      form: mesh ? "cells" : "points",
      count,
      edges: mesh ? mesh.edges.length / 2 : 0,
    }));
  }

  #attribute(body, slot, size, data, integer = false) {
    const gl = this.gl;
    gl.bindVertexArray(body.vao);
    const known = (body.buffers[slot] ??= { buffer: gl.createBuffer(), bytes: -1 });
    gl.bindBuffer(gl.ARRAY_BUFFER, known.buffer);
    if (known.bytes === data.byteLength) gl.bufferSubData(gl.ARRAY_BUFFER, 0, data);
    else gl.bufferData(gl.ARRAY_BUFFER, data, gl.DYNAMIC_DRAW);
    known.bytes = data.byteLength;
    gl.enableVertexAttribArray(slot);
    if (integer) gl.vertexAttribIPointer(slot, size, gl.UNSIGNED_INT, 0, 0);
    else gl.vertexAttribPointer(slot, size, gl.FLOAT, false, 0, 0);
  }

  #constant(body, slot, x, y = 0, z = 0) {
    this.gl.bindVertexArray(body.vao);
    this.gl.disableVertexAttribArray(slot);
    (body.constants ??= {})[slot] = [x, y, z];
  }

  /** Positions, which do not change from state to state. */
  #place(body, clip) {
    const gl = this.gl;
    const { mesh, points } = body;
    body.list = null;
    if (mesh) {
      this.#attribute(body, 0, 3, this.#scaled(mesh.rest, null));
      this.#attribute(body, 3, 1, mesh.point, true);
      body.buffers.index ??= { buffer: gl.createBuffer() };
      gl.bindVertexArray(body.vao);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, body.buffers.index.buffer);
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, mesh.index, gl.STATIC_DRAW);
      body.buffers.edges ??= { buffer: gl.createBuffer() };
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, body.buffers.edges.buffer);
      gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, mesh.edges, gl.STATIC_DRAW);
      body.count = mesh.count;
      return;
    }
    const count = points.length / 3;
    if (body.grid && !body.scattered && (clip || count > MANY_POINTS)) body.list = visiblePoints(body.grid, clip);
    const list = body.list ?? Uint32Array.from({ length: count }, (_, p) => p);
    this.#attribute(body, 0, 3, this.#scaled(points, body.list));
    this.#attribute(body, 3, 1, list, true);
    body.count = list.length;
  }

  #scaled(positions, list) {
    const [x, y, z] = this.centre;
    const count = list ? list.length : positions.length / 3;
    const out = new Float32Array(3 * count);
    for (let n = 0; n < count; n++) {
      const p = list ? list[n] : n;
      out[3 * n] = (positions[3 * p] - x) / this.radius;
      out[3 * n + 1] = (positions[3 * p + 1] - y) / this.radius;
      out[3 * n + 2] = (positions[3 * p + 2] - z) / this.radius;
      // a point without a place is out of sight
      if (Number.isNaN(out[3 * n])) out.fill(AWAY, 3 * n, 3 * n + 3);
    }
    return out;
  }

  /** What changes from state to state. */
  #fill(body, values, motion, spacings, smooth) {
    const { mesh, list } = body;
    const gather = (source, size, unit, missing) => {
      const count = list ? list.length : body.points.length / 3;
      const out = new Float32Array(size * count);
      for (let n = 0; n < out.length; n++) {
        const value = source[list ? size * list[Math.floor(n / size)] + (n % size) : n];
        out[n] = Number.isFinite(value) ? unit * value : missing;
      }
      return out;
    };
    if (!values) this.#constant(body, 2, shaders.NO_VALUE);
    else if (mesh) {
      if (body.shades?.length !== mesh.point.length) body.shades = new Float32Array(mesh.point.length);
      vertexValues(mesh, values, smooth, body.shades);
      this.#attribute(body, 2, 1, body.shades);
    } else this.#attribute(body, 2, 1, gather(values, 1, 1, shaders.NO_VALUE));
    if (!motion) this.#constant(body, 1, 0, 0, 0);
    else this.#attribute(body, 1, 3, mesh ? body.moved : gather(motion, 3, 1 / this.radius, 0));
    if (spacings && !mesh) this.#attribute(body, 4, 1, gather(spacings, 1, 1 / body.info.spacing, 1));
    else this.#constant(body, 4, 1);
  }

  /**
   * Draws. `look` has `matrices`, `range`, `scale` (of the displacements), `levels`, `clip`, `edges` (whether edges are drawn),
   * `ratio` (pixels for one of the window), and the colours `background`, `plain` (of what has no value) and `ink` (of edges).
   */
  draw(look) {
    const gl = this.gl;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.viewport(0, 0, this.canvas.width, this.canvas.height);
    gl.clearColor(...look.background, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.map);
    this.#bodies(this.programs, look, (set) => {
      gl.uniform1i(set("map"), 0);
      gl.uniform2f(set("range"), ...look.range);
      gl.uniform3f(set("plain"), ...look.plain);
      gl.uniform1f(set("ratio"), look.ratio);
      gl.uniform1fv(set("levels[0]"), [...look.levels, 0, 0, 0, 0].slice(0, 4));
      gl.uniform1i(set("level_count"), Math.min(look.levels.length, 4));
    });
    if (look.edges) this.#edges(look);
  }

  #bodies(programs, look, prepare) {
    const gl = this.gl;
    for (const body of this.bodies.values()) {
      if (body.hidden || !body.count) continue;
      const { made, place } = body.mesh ? programs.cells : programs.points;
      this.#use(made, place, body, look);
      gl.uniform1ui(place("body"), body.number);
      prepare(place);
      if (body.mesh) {
        gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, body.buffers.index.buffer);
        gl.drawElements(gl.TRIANGLES, body.mesh.index.length, gl.UNSIGNED_INT, 0);
      } else {
        gl.uniform1f(place("diameter"), (1.3 * body.info.spacing) / this.radius);
        gl.uniform1f(place("pixels"), this.canvas.height);
        gl.uniform4f(place("plane"), ...this.#plane(body.list ? null : look.clip));
        gl.drawArrays(gl.POINTS, 0, body.count);
      }
    }
  }

  #use(made, place, body, look) {
    const gl = this.gl;
    gl.useProgram(made);
    gl.bindVertexArray(body.vao);
    for (const [slot, value] of Object.entries(body.constants ?? {})) gl.vertexAttrib3f(Number(slot), ...value);
    gl.uniformMatrix4fv(place("view"), false, look.matrices.view);
    gl.uniformMatrix4fv(place("projection"), false, look.matrices.projection);
    gl.uniform1f(place("scale"), look.scale);
    gl.uniform2f(place("shift"), 0, 0);
    gl.uniform1f(place("nearer"), 0);
  }

  /** Lines of more than a pixel are drawn several times beside each other: WebGL has no wider ones. */
  #edges(look) {
    const gl = this.gl;
    const { made, place } = this.lines;
    const wide = Math.max(Math.round(look.ratio), 1);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    for (const body of this.bodies.values()) {
      if (body.hidden || !body.mesh?.edges.length) continue;
      this.#use(made, place, body, look);
      gl.uniform1f(place("nearer"), 4e-3);
      gl.uniform3f(place("ink"), ...look.ink);
      gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, body.buffers.edges.buffer);
      for (let n = 0; n < wide * wide; n++) {
        const at = (m) => 2 * m - wide + 1;
        gl.uniform2f(place("shift"), at(n % wide) / this.canvas.width, at(Math.floor(n / wide)) / this.canvas.height);
        gl.drawElements(gl.LINES, body.mesh.edges.length, gl.UNSIGNED_INT, 0);
      }
    }
    gl.disable(gl.BLEND);
  }

  #plane(clip) {
    if (!clip) return [0, 0, 0, -1];
    const along = clip.normal.reduce((sum, x, axis) => sum + x * this.centre[axis], 0);
    return [...clip.normal, (along - clip.offset) / this.radius];
  }

  /**
   * The body and the point that are drawn at a pixel, from the lower left corner, with the place of its surface as computed and as
   * drawn, m; `null` for the background.
   */
  pick(look, x, y) {
    const gl = this.gl;
    const { width, height } = this.canvas;
    if (!this.target || this.target.width !== width || this.target.height !== height) this.#target(width, height);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.target.frame);
    gl.viewport(0, 0, width, height);
    gl.enable(gl.SCISSOR_TEST);
    gl.scissor(x, y, 1, 1);
    for (let n = 0; n < PICKED; n++) gl.clearBufferuiv(gl.COLOR, n, new Uint32Array(4));
    gl.clearBufferfi(gl.DEPTH_STENCIL, 0, 1, 0);
    this.#bodies(this.picks, look, () => {});
    const found = new Uint32Array(4 * PICKED);
    for (let n = 0; n < PICKED; n++) {
      gl.readBuffer(gl.COLOR_ATTACHMENT0 + n);
      gl.readPixels(x, y, 1, 1, gl.RGBA_INTEGER, gl.UNSIGNED_INT, found, 4 * n);
    }
    gl.readBuffer(gl.COLOR_ATTACHMENT0);
    gl.disable(gl.SCISSOR_TEST);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    const body = [...this.bodies.values()].find((b) => b.number === found[1]);
    if (!body) return null;
    const place = new Float32Array(found.buffer);
    const metres = (first) => [0, 1, 2].map((axis) => this.centre[axis] + this.radius * place[first + axis]);
    return { body: body.info, point: found[0], computed: metres(4), drawn: metres(8) };
  }

  #target(width, height) {
    const gl = this.gl;
    if (this.target) {
      gl.deleteFramebuffer(this.target.frame);
      for (const buffer of [...this.target.colours, this.target.depth]) gl.deleteRenderbuffer(buffer);
    }
    const [frame, depth] = [gl.createFramebuffer(), gl.createRenderbuffer()];
    const colours = Array.from({ length: PICKED }, () => gl.createRenderbuffer());
    gl.bindFramebuffer(gl.FRAMEBUFFER, frame);
    colours.forEach((colour, n) => {
      gl.bindRenderbuffer(gl.RENDERBUFFER, colour);
      gl.renderbufferStorage(gl.RENDERBUFFER, gl.RGBA32UI, width, height);
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0 + n, gl.RENDERBUFFER, colour);
    });
    gl.bindRenderbuffer(gl.RENDERBUFFER, depth);
    gl.renderbufferStorage(gl.RENDERBUFFER, gl.DEPTH24_STENCIL8, width, height);
    gl.framebufferRenderbuffer(gl.FRAMEBUFFER, gl.DEPTH_STENCIL_ATTACHMENT, gl.RENDERBUFFER, depth);
    gl.drawBuffers(colours.map((_, n) => gl.COLOR_ATTACHMENT0 + n));
    this.target = { frame, colours, depth, width, height };
  }
}
