// The plane that cuts the bodies.

/** Number of the setting for a plane that lies across no axis. */
export const OBLIQUE = 3;

const RADIANS = Math.PI / 180;

/** The unit vector across the plane of a cut: along an axis, or by two angles (degrees): from x around z, and above x and y. */
export function normalOf({ axis, azimuth, elevation }) {
  if (axis !== OBLIQUE) return [0, 1, 2].map((a) => (a === axis ? 1 : 0));
  const [a, e] = [azimuth * RADIANS, elevation * RADIANS];
  return [Math.cos(a) * Math.cos(e), Math.sin(a) * Math.cos(e), Math.sin(e)];
}

/** The smallest and the largest place of a box along a direction, m. */
export function extent([low, high], normal) {
  const ends = [low, high].map(() => 0);
  for (let axis = 0; axis < 3; axis++) {
    const [a, b] = [normal[axis] * low[axis], normal[axis] * high[axis]];
    ends[0] += Math.min(a, b);
    ends[1] += Math.max(a, b);
  }
  return ends;
}

/** Where a cut is, m along its normal from the origin; at 0 along a normal of an axis is x, y or z itself. */
export function placeOf(clip, box) {
  const [low, high] = extent(box, normalOf(clip));
  return low + clip.part * (high - low);
}

/** The plane of a cut: its normal points to what is cut away, which lies beyond `offset` (m); `null` for none. */
export function planeOf(clip, box) {
  if (!clip.on || !box) return null;
  const sign = clip.flip ? -1 : 1;
  return { normal: normalOf(clip).map((x) => sign * x), offset: sign * placeOf(clip, box) };
}
