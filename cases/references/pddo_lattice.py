"""Numbers of the peridynamic differential operator of second order on a square lattice: limits of steps, and the error
that it leaves in the cases `gao-5.5.2-couette-*`, `gao-5.5.3-poiseuille-*` and `gao-5.5.4-taylor-green-*`; the colour
gradient of `gao-7.s3-normals` and the published load of a fluid on a solid.

    g^r(xi) = w sum_q a^r_q p_q,   A a = b,   A = sum w p p^T V,   p = (x, y, x^2, y^2, x y)
    w = exp(-(2 |xi| / delta)^2),   b = diag(1, 1, 2, 2, 1)

Lengths are in spacings. Members at the edge of the horizon count with the fraction of their cell within it. The errors
of the channels are those of the rows of points across them, whose rates do not depend on the place along them: steady,
by a linear system; during the start, exact in time by eigenvectors.
"""

import numpy as np

from diffusion_series import couette

WIDTH, VISCOSITY, LID, FORCE = 1e-3, 1e-6, 2.5e-5, 2e-4  # m, m2/s, m/s, m/s2


class Operator:
    def __init__(self, horizon: float, has_partial_volumes: bool = True) -> None:
        reach = int(horizon) + 1
        grid = np.arange(-reach, reach + 1)
        x, y = (a.ravel().astype(float) for a in np.meshgrid(grid, grid, indexing="ij"))
        length = np.hypot(x, y)
        member = (length > 0.0) & (length <= horizon + 1e-9)
        self.x, self.y, length = x[member], y[member], length[member]
        volume = np.clip(horizon + 0.5 - length, 0.0, 1.0) if has_partial_volumes else np.ones(len(length))
        p = np.array([self.x, self.y, self.x**2, self.y**2, self.x * self.y])
        weight = np.exp(-((2.0 * length / horizon) ** 2)) * volume
        inverse = np.linalg.inv((weight * p) @ p.T) * np.array([1.0, 1.0, 2.0, 2.0, 1.0])
        self.first, self.second, xx, yy, _ = weight * (inverse.T @ p)
        self.laplacian = xx + yy

    def symbol(self, k: np.ndarray, m: np.ndarray) -> np.ndarray:
        """Of the negative Laplacian for waves along both axes."""
        waves = np.cos(np.multiply.outer(k, self.x)) * np.cos(np.multiply.outer(m, self.y))
        return (self.laplacian * (1.0 - waves)).sum(axis=-1)

    def gradient(self, k: np.ndarray, m: np.ndarray) -> np.ndarray:
        """Size of the gradient of plane waves of unit amplitude."""
        phase = np.multiply.outer(k, self.x) + np.multiply.outer(m, self.y)
        along = [(g * np.sin(phase)).sum(axis=-1) for g in (self.first, self.second)]
        return np.hypot(*along)

    def rows(self, points: int, is_mirrored: bool) -> tuple[np.ndarray, np.ndarray]:
        """Laplacian across a channel times the squared spacing: matrix, and what a top of unit velocity adds."""
        matrix, source = np.zeros((points, points)), np.zeros(points)
        for row in range(points):
            for offset, weight in zip(self.y.astype(int), self.laplacian, strict=True):
                other, matrix[row, row] = row + offset, matrix[row, row] - weight
                if 0 <= other < points:
                    matrix[row, other] += weight
                    continue
                if is_mirrored:
                    matrix[row, -1 - other if other < 0 else 2 * points - 1 - other] -= weight
                if other >= points:
                    source[row] += weight * (2.0 if is_mirrored else 1.0)
        return matrix, source


def steady_errors(points: int, is_mirrored: bool) -> tuple[float, float]:
    """Of Couette and Poiseuille flow: root of the sum of squares over that of the exact velocity."""
    matrix, source = Operator(3.015).rows(points, is_mirrored)
    y = (np.arange(points) + 0.5) / points
    errors = []
    for found, exact in (
        (np.linalg.solve(matrix, -source), y),
        (np.linalg.solve(matrix, -np.ones(points) / points**2), y * (1 - y) / 2),
    ):
        errors.append(float(np.linalg.norm(found - exact) / np.linalg.norm(exact)))
    return errors[0], errors[1]


def start_up_error(points: int, time: float) -> float:
    """Largest error of Couette flow with constant layers at a time (s), over the largest exact velocity."""
    matrix, source = Operator(3.015).rows(points, False)
    steady = np.linalg.solve(matrix, -source)
    rates, modes = np.linalg.eig(matrix)
    decay = np.exp(rates * VISCOSITY * time * (points / WIDTH) ** 2)
    found = LID * (steady - (modes @ (decay * np.linalg.solve(modes, steady))).real)
    exact = np.array([couette(y, time) for y in (np.arange(points) + 0.5) / points * WIDTH])
    return float(np.abs(found - exact).max() / np.abs(exact).max())


def vortices(points: int, step: float = 1e-5) -> tuple[float, float]:
    """Decay rate of the vortices over 8 pi^2, and the error of their velocity at a fiftieth, forward steps."""
    k = np.array(2.0 * np.pi / points)
    ratio = float(Operator(3.015).symbol(k, k)) * points**2 / (8.0 * np.pi**2)
    time = np.log(50.0) / (8.0 * np.pi**2)
    return ratio, 50.0 * (1.0 - ratio * 8.0 * np.pi**2 * step) ** (time / step) - 1.0


def kernel(r: np.ndarray) -> np.ndarray:
    """[Gao2020] eq. 6.29 with a smoothing length of 1.2 spacings."""
    cut = np.exp(-9.0)
    return np.maximum(np.exp(-((r / 1.2) ** 2)) - cut, 0.0) / (np.pi * 1.44 * (1.0 - 10.0 * cut))


def values() -> dict[str, float]:
    found = {}
    waves = np.linspace(0.0, np.pi, 181)
    for horizon, is_partial in ((3.0, True), (3.015, True), (3.015, False), (3.6, True), (3.6, False), (4.015, True)):
        operator, name = Operator(horizon, is_partial), f"horizon {horizon}{'' if is_partial else ', whole volumes'}"
        found[f"{name}: sum of the Laplacian"] = operator.laplacian.sum()
        k, m = np.meshgrid(waves, waves)
        found[f"{name}: largest rate of the Laplacian"] = operator.symbol(k, m).max()
        found[f"{name}: largest wave number"] = operator.gradient(k, m).max()
        if horizon in (3.015, 3.6) and not is_partial:
            for row in range(4):
                # the fluid lies behind a plane half a spacing before the first row of the solid
                change = np.where(operator.x < -row, -1.0, 0.0)
                found[f"{name}: colour gradient in row {row + 1}"] = (operator.first * change).sum()
    for points in (50, 100, 200, 400):
        of_couette, of_poiseuille = steady_errors(points, False)
        found[f"Couette, constant layers, {points} points: steady error"] = of_couette
        found[f"Poiseuille, constant layers, {points} points: steady error"] = of_poiseuille
    for points in (25, 50):
        found[f"Poiseuille, mirrored layers, {points} points: steady error"] = steady_errors(points, True)[1]
    for points in (50, 100):
        for time in (0.01, 0.05, 0.2, 0.6):
            found[f"Couette, constant layers, {points} points, {time} s: largest error"] = start_up_error(points, time)
    for points in (40, 50, 100):
        names = (f"vortices, {points} points: rate", f"vortices, {points} points: error at a fiftieth")
        found |= dict(zip(names, vortices(points), strict=True))
    x, y = np.meshgrid(np.arange(0.0, 10.0) + 0.5, np.arange(-10.0, 11.0))
    for row in range(3):
        found[f"published load in row {row + 1}, over the pressure"] = 2.0 * kernel(np.hypot(x + row + 0.5, y)).sum()
    found["published load at the interface, over the pressure"] = 2.0 * kernel(np.hypot(x, y)).sum()
    return {name: float(value) for name, value in found.items()}


if __name__ == "__main__":
    for label, number in values().items():
        print(f"{label}: {number:.6g}")
