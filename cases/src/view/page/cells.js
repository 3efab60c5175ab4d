// Bodies on a lattice are drawn by the faces of their cells that can be seen. Corners move with the mean displacement of
// the cells around them, so that a deformed body has no gaps; colours are those of cells, or means at the corners.

import { NO_VALUE } from "./shaders.js";

/** More faces than this are drawn as points. */
export const MOST_FACES = 1_500_000;

/** Cells without a point for each point, beyond which points are no lattice. */
const SPARSE = 64;

/** Neighbouring points that have moved further apart than this, in spacings, are no longer one body. */
const APART = 0.75;

const SIDES = [
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

/** Which cells a plane leaves, as limits of their numbers along each axis. */
export function kept(grid, clip) {
  const limits = [0, 1, 2].map((axis) => [0, grid.cells[axis] - 1]);
  if (clip) {
    const place = (clip.position - grid.low[clip.axis]) / grid.spacing;
    if (clip.flip) limits[clip.axis][0] = Math.max(Math.ceil(place), 0);
    else limits[clip.axis][1] = Math.min(Math.floor(place), grid.cells[clip.axis] - 1);
  }
  return limits;
}

/** The visible faces: the cell and the corners of each, and the cells around each corner. `null` if there are too many. */
export function faces(grid, clip, dimension) {
  const [nx, ny, nz] = grid.cells;
  const limits = kept(grid, clip);
  // plane bodies are seen from above
  const sides = dimension === 2 && nz === 1 ? [5] : [0, 1, 2, 3, 4, 5];
  const steps = [-1, 1, -nx, nx, -nx * ny, nx * ny];
  const visit = (found) => {
    for (let k = limits[2][0]; k <= limits[2][1]; k++) {
      for (let j = limits[1][0]; j <= limits[1][1]; j++) {
        for (let i = limits[0][0]; i <= limits[0][1]; i++) {
          const cell = i + nx * (j + ny * k);
          if (grid.pointOf[cell] < 0) continue;
          for (const side of sides) {
            const axis = side >> 1;
            const at = axis === 0 ? i : axis === 1 ? j : k;
            const edge = side & 1 ? at === limits[axis][1] : at === limits[axis][0];
            if (edge || grid.pointOf[cell + steps[side]] < 0) found(cell, side, i, j, k);
          }
        }
      }
    }
  };
  let count = 0;
  visit(() => count++);
  if (count > MOST_FACES) return null;

  const [mx, my, mz] = [nx + 1, ny + 1, nz + 1];
  const number = new Int32Array(mx * my * mz).fill(-1);
  const corner = new Uint32Array(4 * count);
  const point = new Uint32Array(4 * count);
  const rest = new Float32Array(12 * count);
  let corners = 0;
  const nodes = new Uint32Array(4 * count);
  let face = 0;
  visit((cell, side, i, j, k) => {
    for (let c = 0; c < 4; c++) {
      const [di, dj, dk] = CORNERS[side][c];
      const node = i + di + mx * (j + dj + my * (k + dk));
      if (number[node] < 0) {
        number[node] = corners;
        nodes[corners++] = node;
      }
      const vertex = 4 * face + c;
      corner[vertex] = number[node];
      point[vertex] = grid.pointOf[cell];
      rest[3 * vertex] = grid.low[0] + (i + di - 0.5) * grid.spacing;
      rest[3 * vertex + 1] = grid.low[1] + (j + dj - 0.5) * grid.spacing;
      rest[3 * vertex + 2] = grid.low[2] + (k + dk - 0.5) * grid.spacing;
    }
    face++;
  });

  // points around each corner
  const around = new Int32Array(8 * corners).fill(-1);
  for (let n = 0; n < corners; n++) {
    const node = nodes[n];
    const [i, j, k] = [node % mx, Math.floor(node / mx) % my, Math.floor(node / (mx * my))];
    let slot = 8 * n;
    for (let c = 0; c < 8; c++) {
      const [a, b, d] = [i - (c & 1), j - ((c >> 1) & 1), k - (c >> 2)];
      if (a < 0 || b < 0 || d < 0 || a >= nx || b >= ny || d >= nz) continue;
      const p = grid.pointOf[a + nx * (b + ny * d)];
      if (p >= 0) around[slot++] = p;
    }
  }
  const index = new Uint32Array(6 * count);
  for (let f = 0; f < count; f++) {
    const v = 4 * f;
    index.set([v, v + 1, v + 2, v, v + 2, v + 3], 6 * f);
  }
  return { count, corners, corner, point, rest, around, index };
}

/** A value for each vertex: that of its cell, or the mean of the finite values around its corner. */
export function vertexValues(mesh, values, smooth, out) {
  const { corner, point, around } = mesh;
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
  for (let v = 0; v < corner.length; v++) out[v] = means[corner[v]];
}

/** The displacement of each vertex times `unit`; whether neighbours have stayed together. */
export function vertexMotion(mesh, motion, spacing, unit, out) {
  const { corner, around } = mesh;
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
  for (let v = 0; v < corner.length; v++) {
    out[3 * v] = means[3 * corner[v]];
    out[3 * v + 1] = means[3 * corner[v] + 1];
    out[3 * v + 2] = means[3 * corner[v] + 2];
  }
  return together;
}

/** Points that can be seen of a body with hidden ones: those at its surface and at the cut. */
export function visiblePoints(grid, clip) {
  const [nx, ny] = grid.cells;
  const limits = kept(grid, clip);
  const found = [];
  const { cellOf, pointOf } = grid;
  for (let p = 0; p < grid.count; p++) {
    const cell = cellOf[p];
    const at = [cell % nx, Math.floor(cell / nx) % ny, Math.floor(cell / (nx * ny))];
    if (at.some((x, axis) => x < limits[axis][0] || x > limits[axis][1])) continue;
    const hidden = SIDES.every(([i, j, k], side) => {
      const axis = side >> 1;
      const edge = side & 1 ? at[axis] === limits[axis][1] : at[axis] === limits[axis][0];
      return !edge && pointOf[cell + i + nx * (j + ny * k)] >= 0;
    });
    if (!hidden) found.push(p);
  }
  return Uint32Array.from(found);
}
