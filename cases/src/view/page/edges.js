// Which edges between faces of cells are edges of the body. Curved and inclined surfaces are stairs of cells; the edges of their
// steps are not drawn.

import { SIDES } from "./cells.js";

/** Cells across a face within which a step of the other kind makes an edge that of a stair. */
const STEP = 2;

const CONVEX = 1;
const CONCAVE = -1;

function moved([i, j, k], side) {
  const [a, b, c] = SIDES[side];
  return [i + a, j + b, k + c];
}

/** How the surface goes on beyond the edge of a face towards the side `beyond`: 0 if it is flat. */
function kindOf(there, cell, side, beyond) {
  const [to, up] = [SIDES[beyond], SIDES[side]];
  const [i, j, k] = [cell[0] + to[0], cell[1] + to[1], cell[2] + to[2]];
  if (there(i + up[0], j + up[1], k + up[2])) return CONCAVE;
  return there(i, j, k) ? 0 : CONVEX;
}

/** Whether no edge of the other kind follows on a face, away from its edge. */
function isClear(there, cell, side, away, kind) {
  let at = cell;
  for (let step = 0; step < STEP; step++) {
    const next = kindOf(there, at, side, away);
    if (next !== 0) return next === kind;
    at = moved(at, away);
  }
  return true;
}

/**
 * Whether the edge of a face towards the side `beyond` is one of the body: no edge of a step, whose faces end at an edge of the
 * other kind. Both faces have the edge; it belongs to that with the smaller number of its side, or to the only one that is
 * drawn. `there(i, j, k)` tells whether there is a cell.
 */
export function featureEdge(there, cell, side, beyond, alone) {
  const kind = kindOf(there, cell, side, beyond);
  if (kind === 0) return false;
  // the other face: its cell, its side, and the direction on it away from the edge
  const other =
    kind === CONVEX ? [cell, beyond, side ^ 1] : [moved(moved(cell, beyond), side), beyond ^ 1, side];
  if (!alone && side > other[1]) return false;
  return isClear(there, cell, side, beyond ^ 1, kind) && isClear(there, ...other, kind);
}
