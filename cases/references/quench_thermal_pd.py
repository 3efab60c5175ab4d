"""Steady conduction by bonds on small grids: errors of the cases `quench-2.1-*`, `quench-2.2-*` and `quench-2.3-*`.

    python3 quench_thermal_pd.py

A rod of 10 cm between 0 and 100 degrees, a square plate of 2 cm with one side at 100 and the others at 0, and the
plate with an insulated crack of `quench_thermal.py`. Horizon of three spacings, bonds by the mean of the factors of
both ends that restore the energy of the temperature x + y ([Aatitya2021] listing A.2; none in the rod), partial
volumes of the rule `half`. Layers behind the walls are `mirrored`, odd about the temperature of the wall, or
`constant`. Prints errors (K). Needs NumPy and SciPy."""

import numpy as np
from numpy.typing import NDArray
from quench_thermal import WALL, half_plate, hot_side
from scipy.sparse import coo_matrix, diags
from scipy.sparse.linalg import spsolve

Array = NDArray[np.float64]

HORIZON = 3  # spacings


def rod(points: int, layer: str) -> float:
    """Largest error, K."""
    reach = np.arange(1, HORIZON + 1)
    weight = np.where(reach < HORIZON, 1.0, 0.5) / reach
    matrix, supplied = np.zeros((points, points)), np.zeros(points)
    for own in range(points):
        for step, w in zip(np.concatenate([-reach, reach]), np.concatenate([weight, weight])):
            other, wall = own + step, 0.0
            matrix[own, own] -= w
            if 0 <= other < points:
                matrix[own, other] += w
                continue
            wall = WALL if other >= points else 0.0
            if layer == "mirrored":
                image = -1 - other if other < 0 else 2 * points - 1 - other
                matrix[own, image] -= w
                supplied[own] += 2 * w * wall
            else:
                supplied[own] += w * wall
    temperature = np.linalg.solve(matrix, -supplied)
    return float(np.abs(temperature - WALL * (np.arange(points) + 0.5) / points).max())


def plate(points: int, layer: str, walls: dict[str, float], crack: tuple[float, float] | None = None) -> Array:
    """Temperatures (row, column) of points on a square of side 1 with walls at temperatures.

    Sides without a wall are insulated, and so is a crack between two x at mid height.
    """
    margin, size = HORIZON, points + 2 * HORIZON
    row, column = (a.ravel() - margin for a in np.indices((size, size)))
    inside = (row >= 0) & (row < points) & (column >= 0) & (column < points)
    behind = {"left": column < 0, "right": column >= points, "bottom": row < 0, "top": row >= points}
    wall = np.full(size**2, np.nan)
    side = np.full(size**2, "", object)
    # behind corners the layers of top and bottom
    for name in ("left", "right", "bottom", "top"):
        side[behind[name]] = name
    for name, temperature in walls.items():
        wall[side == name] = temperature
    is_layer = ~inside & ~np.isnan(wall)
    present = inside | is_layer
    owns, others, weights, energies = [], [], [], []
    number = np.arange(size**2).reshape(size, size)
    for dy in range(-HORIZON, HORIZON + 1):
        for dx in range(-HORIZON, HORIZON + 1):
            distance = float(np.hypot(dx, dy))
            if distance == 0 or distance > HORIZON + 1e-9:
                continue
            rows, columns = np.arange(max(0, -dy), size - max(0, dy)), np.arange(max(0, -dx), size - max(0, dx))
            own = number[np.ix_(rows, columns)].ravel()
            other = own + dy * size + dx
            kept = present[own] & present[other]
            if crack is not None:
                y_own, y_other = row[own] + 0.5 - points / 2, row[other] + 0.5 - points / 2
                crosses = y_own * y_other < 0
                part = np.where(crosses, y_own / np.where(crosses, y_own - y_other, 1.0), 0.0)
                at = (column[own] + 0.5 + part * dx) / points
                kept &= ~(crosses & (at >= crack[0]) & (at <= crack[1]))
            volume = min(1.0, HORIZON + 0.5 - distance)
            owns.append(own[kept])
            others.append(other[kept])
            weights.append(np.full(int(kept.sum()), volume / distance))
            energies.append(np.full(int(kept.sum()), volume * (dx + dy) ** 2 / distance))
    own, other, weight = np.concatenate(owns), np.concatenate(others), np.concatenate(weights)
    energy = np.bincount(own, np.concatenate(energies), size**2) * 6 / (np.pi * HORIZON**3) / 4
    factor = np.where(inside & (energy > 0), 1 / np.maximum(energy, 1e-30), 1.0)
    weight = weight * 0.5 * (factor[own] + factor[other])
    matrix = coo_matrix((weight, (own, other)), (size**2, size**2)).tocsr()
    matrix = matrix - diags(np.asarray(matrix.sum(1)).ravel())
    layers = np.flatnonzero(is_layer)
    constant, image = np.zeros(size**2), np.arange(size**2)
    sign = np.ones(size**2)
    constant[layers] = wall[layers]
    if layer == "mirrored":
        at_row = np.where(row < 0, -1 - row, np.where(row >= points, 2 * points - 1 - row, row))
        at_column = np.where(column < 0, -1 - column, np.where(column >= points, 2 * points - 1 - column, column))
        at_row = np.where((side == "left") | (side == "right"), np.clip(row, 0, points - 1), at_row)
        at_column = np.where((side == "top") | (side == "bottom"), np.clip(column, 0, points - 1), at_column)
        image[layers] = ((at_row + margin) * size + at_column + margin)[layers]
        constant[layers] *= 2
        sign[layers] = -1.0
    else:
        sign[layers] = 0.0
    follow = coo_matrix((sign, (np.arange(size**2), image)), (size**2, size**2)).tocsr()
    points_inside = np.flatnonzero(inside)
    solved = spsolve((matrix[points_inside] @ follow)[:, points_inside].tocsc(), -(matrix[points_inside] @ constant))
    return solved.reshape(points, points)


def values() -> dict[str, float]:
    """Errors, K."""
    found = {}
    for layer in ("mirrored", "constant"):
        for points in (50, 100):
            found[f"rod, {layer}, {points} points: largest error"] = rod(points, layer)
        temperature = plate(41, layer, {"top": WALL, "bottom": 0.0, "left": 0.0, "right": 0.0})
        height = (np.arange(41) + 0.5) / 41
        exact = np.array([hot_side(0.5, float(y)) for y in height])
        away = np.abs(height - 0.5) < 0.4
        error = np.abs(temperature[:, 20] - exact)[away].max()
        found[f"hot side, {layer}, 41 points: error from 0.1 to 0.9 L"] = float(error)
    steady = half_plate(0.5, 1.0, 1.0)[1]
    for layer in ("mirrored", "constant"):
        for points in (10, 20, 40):
            temperature = plate(points, layer, {"top": WALL, "bottom": -WALL}, (0.2500001, 0.7499999))
            height = (np.arange(points // 2) + 0.5) / (points / 2)
            # the column right of the middle
            exact = np.array([WALL * steady(float(y)) for y in height])
            error = np.abs(temperature[points // 2 :, points // 2] - exact).mean()
            found[f"crack, {layer}, {points} points: mean error on the axis"] = float(error)
    return found


if __name__ == "__main__":
    for name, value in values().items():
        print(f"{name} {value:.5f}")
