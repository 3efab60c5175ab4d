// Plies of laminates: drawn apart from each other, or one alone.

/** Places of points whose plies are `apart` times as far from each other; only those of one `ply` (from 1), or all for 0: others have none. */
export function drawnApart(points, plyOf, plies, { ply, apart }) {
  const centre = (plies[0].middle + plies[plies.length - 1].middle) / 2;
  const shift = plies.map(({ middle }) => (apart - 1) * (middle - centre));
  return points.map((x, n) => {
    const own = Math.round(plyOf[Math.floor(n / 3)]);
    if (ply && own !== ply) return NaN;
    return n % 3 === 2 ? x + (shift[own - 1] ?? 0) : x;
  });
}

/** The largest number of plies of a body. */
export function most(bodies) {
  return Math.max(0, ...bodies.map((body) => body.plies.length));
}
