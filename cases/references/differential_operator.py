"""Constants and accuracy of the peridynamic differential operator on square lattices and irregular points.

Numbers of the tests in `core/src/pddo/tests.rs` and of `docs/theory/differential_operator.md`: derivatives of
f = x^2 + 2 y^3 at (1, 1) (Gao (2020), Table 1), interpolation of f from irregular points (section 2.2.2.2), and for the
second-order operator the sum S dx^2 of the Laplacian and the largest wave number of the gradient times dx.

    python3 differential_operator.py
"""

import numpy as np


def weights(xi: np.ndarray, spacing: float, horizon: float, partial: bool = True) -> np.ndarray:
    """Gaussian influence times partial volumes; zero beyond the horizon."""
    length = np.hypot(*xi)
    inside = (length <= horizon * (1 + 1e-12)) & (length > 1e-9 * spacing)
    volume = np.clip((horizon - length) / spacing + 0.5, 0.5, 1.0) if partial else 1.0
    return inside * volume * np.exp(-((2 * length / horizon) ** 2))


def functions(xi: np.ndarray, w: np.ndarray, scale: float) -> np.ndarray:
    """Weights of all bonds in the derivatives x, y, xx, xy, yy."""
    x, y = xi / scale
    monomials = np.array([x, y, x * x, x * y, y * y])
    moments = (w * monomials) @ monomials.T
    factor = np.array([1, 1, 2, 1, 2]) / scale ** np.array([1, 1, 2, 2, 2])
    return factor[:, None] * np.linalg.solve(moments, w * monomials)


def lattice(reach: int, spacing: float) -> np.ndarray:
    """Bonds of a complete family."""
    steps = np.arange(-reach, reach + 1) * spacing
    return np.array([a.ravel() for a in np.meshgrid(steps, steps)])


def field(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """f of section 2.2.2."""
    return x**2 + 2 * y**3


def at_centre(spacing: float, partial: bool = True) -> np.ndarray:
    """Derivatives of f at (1, 1) on a lattice, horizon of 3.015 spacings."""
    xi = lattice(4, spacing)
    g = functions(xi, weights(xi, spacing, 3.015 * spacing, partial), 3.015 * spacing)
    return g @ (field(1 + xi[0], 1 + xi[1]) - field(np.float64(1), np.float64(1)))


def constants(horizon: float, partial: bool) -> tuple[float, float]:
    """S and the largest wave number for a spacing of one."""
    xi = lattice(5, 1.0)
    g = functions(xi, weights(xi, 1.0, horizon, partial), horizon)
    numbers = np.pi * np.arange(1, 257) / 256
    directions = np.array([[1, 0], [np.sqrt(0.5), np.sqrt(0.5)]])
    response = [abs(np.sin(np.outer(numbers, d @ xi)) @ (d @ g[:2])).max() for d in directions]
    return float((g[2] + g[4]).sum()), float(max(response))


def interpolation(points: int, deviation: float, seed: int) -> float:
    """Relative error of f on a grid from irregular points by the mean of their Taylor series."""
    spacing = 2 / (points - 1)
    steps = np.linspace(0, 2, points)
    grid = np.array([a.ravel() for a in np.meshgrid(steps, steps)])
    old = grid + np.random.default_rng(seed).normal(0, deviation * spacing, grid.shape)
    horizon = 3.015 * spacing
    value, derivatives = field(*old), np.empty((5, old.shape[1]))
    for i in range(old.shape[1]):
        xi = old - old[:, [i]]
        near = np.hypot(*xi) <= horizon
        w = weights(xi[:, near], spacing, horizon)
        derivatives[:, i] = functions(xi[:, near], w, horizon) @ (value[near] - value[i])
    found = np.empty(grid.shape[1])
    for i in range(grid.shape[1]):
        xi = grid[:, [i]] - old
        near = np.hypot(*xi) <= horizon
        x, y = xi[:, near]
        series = np.array([x, y, x * x / 2, x * y, y * y / 2])
        found[i] = np.mean(value[near] + (derivatives[:, near] * series).sum(0))
    exact = field(*grid)
    return float(np.sqrt(((found - exact) ** 2).sum() / (exact**2).sum()))


def values() -> dict[str, float]:
    """All numbers by name."""
    found = {
        "f_y at (1, 1), dx = 0.1": at_centre(0.1)[1],
        "f_y at (1, 1), dx = 0.05": at_centre(0.05)[1],
        "f_y at (1, 1), dx = 0.1, whole volumes": at_centre(0.1, partial=False)[1],
    }
    for horizon, partial in ((3.0, True), (3.015, True), (3.015, False), (3.6, True), (4.015, True)):
        name = f"{horizon} spacings, {'partial' if partial else 'whole'} volumes"
        found[f"S dx^2, {name}"], found[f"largest wave number, {name}"] = constants(horizon, partial)
    for points in (21, 41, 51):
        found[f"error of interpolation, {points} x {points}"] = interpolation(points, 0.1, 1)
    return {name: float(value) for name, value in found.items()}


if __name__ == "__main__":
    for name, value in values().items():
        print(f"{name}: {value:.6g}")
