// Bodies on a lattice are drawn by the faces of their cells that can be seen, and by a plane that cuts the cells. Vertices are
// corners of cells, or places between two corners where the plane cuts an edge. Corners move with the mean displacement of the
// cells around them, so that a deformed body has no gaps; colours are those of cells, or means at the corners.

import { featureEdge } from "./edges.js";
import { NO_VALUE } from "./shaders.js";

/** More faces than this are drawn as points. */
export const MOST_FACES = 1_500_000;

/** Cells without a point for each point, beyond which points are no lattice. */
const SPARSE = 64;

/** Neighbouring points that have moved further apart than this, in spacings, are no longer one body. */
const APART = 0.75;

/** A plane that is this close to the faces of cells, in spacings, lies on them. */
const ON_FACES = 1e-3;

/** Whether a corner at this distance (spacings) from a plane is left; one that lies on the plane is not. */
const isLeft = (distance) => distance < -1e-4;

/** Where a plane cuts an edge between corners at these distances, as part of the way. */
const crossing = (from, to) => Math.min(Math.max(from / (from - to), 0), 1);

/** Sides of a cell; the opposite of a side has its number with the last bit changed. */
export const SIDES = [
  [-1, 0, 0],
  [1, 0, 0],
  [0, -1, 0],
  [0, 1, 0],
  [0, 0, -1],
  [0, 0, 1],
];

// corners of each side, counter-clockwise seen from outside
const CORNERS = [
  [[0, 0, 0], [0, 0, 1], [0, 1, 1], [0, 1, 0]],
  [[1, 0, 0], [1, 1, 0], [1, 1, 1], [1, 0, 1]],
  [[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]],
  [[0, 1, 0], [0, 1, 1], [1, 1, 1], [1, 1, 0]],
  [[0, 0, 0], [0, 1, 0], [1, 1, 0], [1, 0, 0]],
  [[0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]],
];

/** The side of the cell that lies beyond the edge from corner `c` to the next one of a side. */
const BEYOND = CORNERS.map((corners, side) =>
  corners.map((from, c) => {
    const to = corners[(c + 1) % 4];
    const axis = [0, 1, 2].find((a) => a !== side >> 1 && from[a] === to[a]);
    return 2 * axis + from[axis];
  }),
);

/** Edges of a cell between two of its corners. */
const CELL_EDGES = [0, 1, 2].flatMap((axis) =>
  [[0, 0], [0, 1], [1, 0], [1, 1]].map(([p, q]) => {
    const end = (at) => [0, 1, 2].map((a) => (a === axis ? at : a === (axis + 1) % 3 ? p : q));
    return [end(0), end(1)];
  }),
);

/** Sorts points into the cells of a lattice; `null` if they do not form one. */
export function lattice(positions, spacing) {
  const count = positions.length / 3;
  const low = [Infinity, Infinity, Infinity];
  const high = [-Infinity, -Infinity, -Infinity];
  for (let p = 0; p < positions.length; p++) {
    const axis = p % 3;
    if (positions[p] < low[axis]) low[axis] = positions[p];
    if (positions[p] > high[axis]) high[axis] = positions[p];
  }
  const cells = [0, 1, 2].map((axis) => Math.round((high[axis] - low[axis]) / spacing) + 1);
  const total = cells[0] * cells[1] * cells[2];
  if (!(count > 0) || !(total <= SPARSE * count + (1 << 20)) || total > 1 << 28) return null;
  const [nx, ny] = cells;
  const pointOf = new Int32Array(total).fill(-1);
  const cellOf = new Uint32Array(count);
  // single precision of positions far from the origin
  const slack = 0.05 + (1e-6 * Math.max(...high.map(Math.abs), ...low.map(Math.abs))) / spacing;
  for (let p = 0; p < count; p++) {
    const at = [0, 0, 0];
    for (let axis = 0; axis < 3; axis++) {
      const place = (positions[3 * p + axis] - low[axis]) / spacing;
      at[axis] = Math.round(place);
      if (!(Math.abs(place - at[axis]) < slack)) return null;
    }
    const cell = at[0] + nx * (at[1] + ny * at[2]);
    if (pointOf[cell] >= 0) return null;
    pointOf[cell] = p;
    cellOf[p] = cell;
  }
  return { low, spacing, cells, pointOf, cellOf, count };
}

/**
 * A plane in the numbers of the cells: `at(i, j, k)` is the distance, in spacings, by which a place lies on the side that is cut
 * away. Without a plane nothing is cut away.
 */
function distances(grid, plane) {
  if (!plane) return { at: () => -Infinity, half: 0 };
  const [a, b, c] = plane.normal;
  const { low, spacing } = grid;
  const start = (a * low[0] + b * low[1] + c * low[2] - plane.offset) / spacing;
  return { at: (i, j, k) => start + a * i + b * j + c * k, half: 0.5 * (Math.abs(a) + Math.abs(b) + Math.abs(c)) };
}

/** Which cells there are: `there(i, j, k)`; the plane cuts those in two whose distance from it is below `limit`. */
function cellsOf(grid, plane) {
  const [nx, ny, nz] = grid.cells;
  const { at, half } = distances(grid, plane);
  const limit = half - ON_FACES;
  const there = (i, j, k) => {
    if (i < 0 || j < 0 || k < 0 || i >= nx || j >= ny || k >= nz) return false;
    return grid.pointOf[i + nx * (j + ny * k)] >= 0 && at(i, j, k) < limit;
  };
  return { there, at, limit };
}

/** An array of numbers that grows. */
class Growing {
  constructor(Type) {
    this.array = new Type(1 << 12);
    this.length = 0;
  }

  push(number) {
    if (this.length === this.array.length) {
      const larger = new this.array.constructor(2 * this.length);
      larger.set(this.array);
      this.array = larger;
    }
    this.array[this.length++] = number;
  }

  done() {
    return this.array.slice(0, this.length);
  }
}

/** A mesh that is being made. Vertices are `[from, to, part]`: `part` of the way from one corner to another. */
class Mesh {
  constructor(grid) {
    const [nx, ny, nz] = grid.cells;
    this.grid = grid;
    this.size = [nx + 1, ny + 1, nz + 1];
    this.numbers = new Int32Array(this.size[0] * this.size[1] * this.size[2]).fill(-1);
    this.nodes = new Growing(Uint32Array);
    this.from = new Growing(Uint32Array);
    this.to = new Growing(Uint32Array);
    this.part = new Growing(Float32Array);
    this.point = new Growing(Uint32Array);
    this.rest = new Growing(Float32Array);
    this.index = new Growing(Uint32Array);
    this.edges = new Growing(Uint32Array);
    this.count = 0;
  }

  #corner([i, j, k]) {
    const node = i + this.size[0] * (j + this.size[1] * k);
    if (this.numbers[node] < 0) {
      this.numbers[node] = this.nodes.length;
      this.nodes.push(node);
    }
    return this.numbers[node];
  }

  /** Adds a polygon of a point; the number of its first vertex. */
  polygon(point, vertices) {
    const first = this.from.length;
    const { low, spacing } = this.grid;
    for (const [from, to, part] of vertices) {
      this.from.push(this.#corner(from));
      this.to.push(this.#corner(to));
      this.part.push(part);
      this.point.push(point);
      for (let axis = 0; axis < 3; axis++) {
        this.rest.push(low[axis] + (from[axis] + part * (to[axis] - from[axis]) - 0.5) * spacing);
      }
    }
    for (let n = 2; n < vertices.length; n++) {
      this.index.push(first);
      this.index.push(first + n - 1);
      this.index.push(first + n);
    }
    this.count++;
    return first;
  }

  line(a, b) {
    this.edges.push(a);
    this.edges.push(b);
  }

  done() {
    const { grid, size } = this;
    const [nx, ny, nz] = grid.cells;
    const corners = this.nodes.length;
    // points around each corner
    const around = new Int32Array(8 * corners).fill(-1);
    for (let n = 0; n < corners; n++) {
      const node = this.nodes.array[n];
      const [i, j, k] = [node % size[0], Math.floor(node / size[0]) % size[1], Math.floor(node / (size[0] * size[1]))];
      let slot = 8 * n;
      for (let c = 0; c < 8; c++) {
        const [a, b, d] = [i - (c & 1), j - ((c >> 1) & 1), k - (c >> 2)];
        if (a < 0 || b < 0 || d < 0 || a >= nx || b >= ny || d >= nz) continue;
        const p = grid.pointOf[a + nx * (b + ny * d)];
        if (p >= 0) around[slot++] = p;
      }
    }
    const arrays = ["from", "to", "part", "point", "rest", "index", "edges"].map((name) => [name, this[name].done()]);
    return { count: this.count, corners, around, ...Object.fromEntries(arrays) };
  }
}

/**
 * What a plane leaves of a side with these corners, whose distances from the plane are given: vertices, the numbers of those at
 * the ends of what is left of each of the four edges, and at the ends of the cut.
 */
function clipped(corners, distance) {
  const [vertices, sides, cut] = [[], [], []];
  for (let c = 0; c < 4; c++) {
    const [a, b] = [c, (c + 1) % 4];
    const [inside, next] = [isLeft(distance[a]), isLeft(distance[b])];
    const first = vertices.length;
    if (inside) vertices.push([corners[a], corners[a], 0]);
    if (inside !== next) {
      cut.push(vertices.length);
      vertices.push([corners[a], corners[b], crossing(distance[a], distance[b])]);
    }
    // the part of this edge that is left; the next vertex is that of the next corner
    sides.push(inside || next ? [inside ? first : vertices.length - 1, next ? vertices.length : vertices.length - 1] : null);
  }
  return { vertices, sides, cut };
}

const SIDES_OF_WHOLE = [[0, 1], [1, 2], [2, 3], [3, 0]];

/** A side that is not cut. */
function whole(corners) {
  return { vertices: corners.map((corner) => [corner, corner, 0]), sides: SIDES_OF_WHOLE, cut: [] };
}

/** The face at which the plane cuts a cell, as vertices in order around it. */
function capOf([i, j, k], at, normal) {
  const found = [];
  for (const [p, q] of CELL_EDGES) {
    const place = ([a, b, c]) => [i + a, j + b, k + c];
    const [from, to] = [place(p), place(q)];
    const [d, e] = [from, to].map(([a, b, c]) => at(a - 0.5, b - 0.5, c - 0.5));
    if (isLeft(d) !== isLeft(e)) found.push([from, to, crossing(d, e)]);
  }
  const where = ([from, to, part]) => from.map((x, axis) => x + part * (to[axis] - x));
  const middle = [0, 1, 2].map((axis) => found.reduce((sum, v) => sum + where(v)[axis], 0) / found.length);
  const least = normal.map(Math.abs).indexOf(Math.min(...normal.map(Math.abs)));
  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const u = cross(normal, [0, 1, 2].map((axis) => (axis === least ? 1 : 0)));
  const v = cross(normal, u);
  const angle = (vertex) => {
    const away = where(vertex).map((x, axis) => x - middle[axis]);
    const along = (d) => away[0] * d[0] + away[1] * d[1] + away[2] * d[2];
    return Math.atan2(along(v), along(u));
  };
  return found.map((vertex) => [angle(vertex), vertex]).sort((a, b) => a[0] - b[0]).map(([, vertex]) => vertex);
}

/**
 * The faces that can be seen of what a plane leaves, and the lines along the edges of the body; `null` if there are too many
 * faces. `plane` has a unit `normal` towards what is cut away, and an `offset` (m) along it.
 */
export function faces(grid, plane, dimension) {
  const [nx, ny, nz] = grid.cells;
  const { pointOf } = grid;
  const { there, at, limit } = cellsOf(grid, plane);
  // plane bodies are seen from above
  const sides = dimension === 2 && nz === 1 ? [5] : [0, 1, 2, 3, 4, 5];
  const mesh = new Mesh(grid);
  const addSide = (i, j, k, side, isCut) => {
    const point = pointOf[i + nx * (j + ny * k)];
    const corners = CORNERS[side].map((corner) => [i + corner[0], j + corner[1], k + corner[2]]);
    const left = isCut ? clipped(corners, corners.map((c) => at(c[0] - 0.5, c[1] - 0.5, c[2] - 0.5))) : whole(corners);
    if (left.vertices.length < 3) return;
    const first = mesh.polygon(point, left.vertices);
    const line = (ends) => mesh.line(first + ends[0], first + (ends[1] % left.vertices.length));
    left.sides.forEach((ends, c) => {
      if (ends && featureEdge(there, [i, j, k], side, BEYOND[side][c], sides.length === 1)) line(ends);
    });
    if (left.cut.length === 2) line(left.cut);
  };
  const far = Math.min(limit - 1, -limit);
  for (let k = 0; k < nz; k++) {
    for (let j = 0; j < ny; j++) {
      for (let i = 0; i < nx; i++) {
        const cell = i + nx * (j + ny * k);
        if (pointOf[cell] < 0) continue;
        const distance = plane ? at(i, j, k) : -Infinity;
        if (distance >= limit) continue;
        // most cells are far from the plane and inside of the body
        const isFar = distance < far && i > 0 && j > 0 && k > 0 && i < nx - 1 && j < ny - 1 && k < nz - 1;
        const isInside =
          isFar &&
          pointOf[cell - 1] >= 0 &&
          pointOf[cell + 1] >= 0 &&
          pointOf[cell - nx] >= 0 &&
          pointOf[cell + nx] >= 0 &&
          pointOf[cell - nx * ny] >= 0 &&
          pointOf[cell + nx * ny] >= 0;
        if (isInside) continue;
        const isCut = Math.abs(distance) < limit;
        for (const side of sides) {
          const [a, b, c] = SIDES[side];
          if (!there(i + a, j + b, k + c)) addSide(i, j, k, side, isCut);
        }
        if (isCut && sides.length > 1) {
          const cap = capOf([i, j, k], at, plane.normal);
          if (cap.length > 2) mesh.polygon(pointOf[cell], cap);
        }
        if (mesh.count > MOST_FACES) return null;
      }
    }
  }
  return mesh.done();
}

/** A value for each vertex: that of its cell, or the mean of the finite values around its corner. */
export function vertexValues(mesh, values, smooth, out) {
  const { from, to, part, point, around } = mesh;
  if (!smooth) {
    for (let v = 0; v < point.length; v++) {
      const value = values[point[v]];
      out[v] = Number.isFinite(value) ? value : NO_VALUE;
    }
    return;
  }
  const means = new Float32Array(mesh.corners);
  for (let n = 0; n < mesh.corners; n++) {
    let [sum, count] = [0, 0];
    for (let slot = 8 * n; slot < 8 * n + 8 && around[slot] >= 0; slot++) {
      const value = values[around[slot]];
      if (Number.isFinite(value)) {
        sum += value;
        count++;
      }
    }
    means[n] = count > 0 ? sum / count : NO_VALUE;
  }
  for (let v = 0; v < from.length; v++) {
    const [a, b] = [means[from[v]], means[to[v]]];
    out[v] = a > 1e38 ? b : b > 1e38 ? a : a + part[v] * (b - a);
  }
}

/** The displacement of each vertex times `unit`; whether neighbours have stayed together. */
export function vertexMotion(mesh, motion, spacing, unit, out) {
  const { from, to, part, around } = mesh;
  const means = new Float32Array(3 * mesh.corners);
  let together = true;
  for (let n = 0; n < mesh.corners; n++) {
    for (let axis = 0; axis < 3; axis++) {
      let [sum, count, low, high] = [0, 0, Infinity, -Infinity];
      for (let slot = 8 * n; slot < 8 * n + 8 && around[slot] >= 0; slot++) {
        const value = motion[3 * around[slot] + axis];
        sum += value;
        count++;
        if (value < low) low = value;
        if (value > high) high = value;
      }
      means[3 * n + axis] = (unit * sum) / count;
      if (!(high - low <= APART * spacing)) together = false;
    }
  }
  for (let v = 0; v < from.length; v++) {
    for (let axis = 0; axis < 3; axis++) {
      const [a, b] = [means[3 * from[v] + axis], means[3 * to[v] + axis]];
      out[3 * v + axis] = a + part[v] * (b - a);
    }
  }
  return together;
}

/** Points that can be seen of a body with hidden ones: those at its surface and at the cut. */
export function visiblePoints(grid, plane) {
  const [nx, ny] = grid.cells;
  const { at } = distances(grid, plane);
  const { there } = cellsOf(grid, null);
  const kept = (i, j, k) => there(i, j, k) && at(i, j, k) <= 0;
  const found = [];
  const { cellOf } = grid;
  for (let p = 0; p < grid.count; p++) {
    const cell = cellOf[p];
    const [i, j, k] = [cell % nx, Math.floor(cell / nx) % ny, Math.floor(cell / (nx * ny))];
    if (kept(i, j, k) && !SIDES.every(([a, b, c]) => kept(i + a, j + b, k + c))) found.push(p);
  }
  return Uint32Array.from(found);
}
