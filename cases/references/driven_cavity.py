"""Flow in a square cavity under a moving lid, without and with heat: reference numbers of the cases
`gao-5.5.5-cavity-*` (Re = 1, 100, 400) and `gao-5.6.4-mixed-*` (Gr = 100, Pr = 0.71, Re = 10, 100, 400).

Incompressible flow in units of the width and the speed of the lid; with heat the lid has the temperature 1, the
floor 0, and the sides are insulated:

    div(v v) = -grad p + lap v / Re + Gr / Re^2 T e_y,   div v = 0,   div(v T) = lap T / (Re Pr)

Finite volumes of second order on a staggered grid of N x N cells, Newton's method, extrapolated by Richardson's method
with the order 2 from N = 64, 128, with heat from N = 50, 100. The flow at t = 0.05 starts from rest (BDF2 with 100
steps, convection extrapolated in time, N = 32, 64). The numbers of the cases come from the same method with N up to
256 (200 with heat), and 48 at t = 0.05: they agree to 2e-4, at t = 0.05 to 1e-3. Needs SciPy; about a minute.
"""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.sparse import csr_matrix, diags, eye, kron
from scipy.sparse.linalg import splu

PRANDTL, GRASHOF = 0.71, 100.0
LINE = np.arange(1, 10) / 10.0
FINE = np.linspace(0.0, 1.0, 20001)


class Cavity:
    """Residual `L z + f + sum G [(A z) (B z)]` of the state z = (u, v, p, T); the fast index is that of y."""

    def __init__(self, cells: int, reynolds: float, has_heat: bool) -> None:
        n, m, h = cells, cells - 1, 1.0 / cells
        self.cells, self.reynolds, self.has_heat = cells, reynolds, has_heat
        # from centres to inner faces, and back with zero on the walls
        mean = diags([0.5, 0.5], [0, 1], (m, n))
        slope = diags([-1.0 / h, 1.0 / h], [0, 1], (m, n))
        mean_back, slope_back = mean.T, -slope.T
        faces, insulated = slope @ slope_back, slope_back @ slope
        held = insulated - diags(np.r_[2.0, np.zeros(n - 2), 2.0]) / h**2
        of_n, of_m = eye(n), eye(m)
        self.sizes = [m * n, n * m, n * n, n * n]
        starts = np.cumsum([0, *self.sizes])
        pick = [eye(starts[-1]).tocsr()[starts[k] : starts[k + 1]] for k in range(4)]
        put = [p.T for p in pick]
        u, v, p, t = pick
        grad_x, grad_y = kron(slope, of_n), kron(of_n, slope)
        div = kron(slope_back, of_n) @ u + kron(of_n, slope_back) @ v
        pin = csr_matrix(([1.0], ([0], [0])), (n * n, n * n))
        viscous_u = (kron(faces, of_n) + kron(of_m, held)) @ u / reynolds
        viscous_v = (kron(held, of_m) + kron(of_n, faces)) @ v / reynolds
        lift = (GRASHOF / reynolds**2 if has_heat else 0.0) * kron(of_n, mean) @ t
        conduction = (kron(insulated, of_n) + kron(of_n, held)) @ t / (reynolds * PRANDTL)
        self.linear = (
            put[0] @ (viscous_u - grad_x @ p)
            + put[1] @ (viscous_v - grad_y @ p + lift)
            + put[2] @ (div + pin @ p)
            + put[3] @ (conduction if has_heat else t)
        ).tocsr()
        top = np.r_[np.zeros(m), 2.0 / h**2]
        self.source = put[0] @ np.kron(np.ones(m), top) / reynolds
        if has_heat:
            self.source += put[3] @ np.kron(np.ones(n), top) / (reynolds * PRANDTL)
        u_corner, v_corner = kron(of_m, mean) @ u, kron(mean, of_m) @ v
        u_centre, v_centre = kron(mean_back, of_n) @ u, kron(of_n, mean_back) @ v
        self.products = [
            (-put[0] @ grad_x, u_centre, u_centre),
            (-put[0] @ kron(of_m, slope_back), u_corner, v_corner),
            (-put[1] @ grad_y, v_centre, v_centre),
            (-put[1] @ kron(slope_back, of_m), u_corner, v_corner),
        ]
        if has_heat:
            self.products += [
                (-put[3] @ kron(slope_back, of_n), u, kron(mean, of_n) @ t),
                (-put[3] @ kron(of_n, slope_back), v, kron(of_n, mean) @ t),
            ]
        self.inertia = diags(np.r_[np.ones(2 * m * n), np.zeros(2 * n * n)])

    def carried(self, z: np.ndarray) -> np.ndarray:
        return sum(g @ ((a @ z) * (b @ z)) for g, a, b in self.products)

    def steady(self, z: np.ndarray) -> np.ndarray:
        """Newton's method."""
        for _ in range(20):
            jacobian = self.linear.copy()
            for g, a, b in self.products:
                jacobian = jacobian + g @ (diags(b @ z) @ a + diags(a @ z) @ b)
            change = splu(jacobian.tocsc()).solve(self.linear @ z + self.source + self.carried(z))
            z = z - change
            if np.abs(change[: 2 * self.sizes[0]]).max() < 1e-10:
                return z
        raise RuntimeError("Newton's method does not converge")

    def start_up(self, end: float, steps: int) -> np.ndarray:
        """The flow at a time after the lid has started, by BDF2; the first step by backward Euler."""
        dt = end / steps
        before = now = np.zeros(sum(self.sizes))
        factors = {c: splu((c / dt * self.inertia - self.linear).tocsc()) for c in (1.0, 1.5)}
        for step in range(steps):
            if step == 0:
                known, factor = now / dt, factors[1.0]
            else:
                known, factor = (2.0 * now - 0.5 * before) / dt, factors[1.5]
            carried = 2.0 * self.carried(now) - self.carried(before)
            before, now = now, factor.solve(self.inertia @ known + self.source + carried)
        return now

    def measure(self, z: np.ndarray) -> dict[str, np.ndarray | float]:
        n, m = self.cells, self.cells - 1
        u, v, _, t = np.split(z, np.cumsum(self.sizes)[:-1])
        u, v, t = u.reshape(m, n), v.reshape(n, m), t.reshape(n, n)
        at = np.r_[0.0, (np.arange(n) + 0.5) / n, 1.0]
        middle = n // 2
        u_line = CubicSpline(at, np.r_[0.0, u[middle - 1], 1.0])
        v_line = CubicSpline(at, np.r_[0.0, v[:, middle - 1], 0.0])
        found = {"u": u_line(LINE), "v": v_line(LINE), "u(y = 0.95)": u_line(0.95), "v(x = 0.95)": v_line(0.95)}
        found |= {"u_min": u_line(FINE).min(), "v_max": v_line(FINE).max(), "v_min": v_line(FINE).min()}
        if self.has_heat:
            t_line = CubicSpline(at, np.r_[0.0, 0.5 * (t[middle - 1] + t[middle]), 1.0])
            found |= {
                "T": t_line(LINE),
                "Nu lid": (2.0 * n * (1.0 - t[:, -1])).mean(),
                "Nu floor": (2.0 * n * t[:, 0]).mean(),
            }
        return found


def extrapolated(coarse: dict, fine: dict) -> dict[str, np.ndarray]:
    return {key: np.asarray(fine[key] + (fine[key] - coarse[key]) / 3.0) for key in fine}


def solutions() -> dict[str, dict[str, np.ndarray]]:
    """Numbers by flow, without dimension; u and T on x = 0.5, v on y = 0.5 at 0.1, 0.2, ..., 0.9."""
    found = {}
    for has_heat, numbers in ((False, (1.0, 100.0, 400.0)), (True, (10.0, 100.0, 400.0))):
        grids = (64, 128) if not has_heat else (50, 100)
        state = {n: np.zeros(sum(Cavity(n, 1.0, has_heat).sizes)) for n in grids}
        for reynolds in numbers:
            results = []
            for n in grids:
                cavity = Cavity(n, reynolds, has_heat)
                state[n] = cavity.steady(state[n])
                results.append(cavity.measure(state[n]))
            found[f"{'heated lid, ' if has_heat else ''}Re = {reynolds:g}"] = extrapolated(*results)
    early = [Cavity(n, 1.0, False) for n in (32, 64)]
    found["Re = 1, t = 0.05"] = extrapolated(*(c.measure(c.start_up(0.05, 100)) for c in early))
    return found


def values() -> dict[str, float]:
    found = {}
    for flow, numbers in solutions().items():
        for key, value in numbers.items():
            for place, number in zip(LINE, np.atleast_1d(value), strict=False):
                found[f"{flow}: {key}" + (f" at {place:.1f}" if value.ndim else "")] = float(number)
    return found


if __name__ == "__main__":
    for label, number in values().items():
        print(f"{label}: {number:.5f}")
