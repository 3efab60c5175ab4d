"""Natural convection of air in a square cavity, Pr = 0.71: reference numbers of the cases `gao-5.6.3-convection-*`.

Steady Boussinesq equations for the stream function and the temperature, in units of the width and the thermal
diffusivity, hot (1) at x = 0, cold (0) at x = 1, insulated at y = 0 and y = 1:

    Pr lap lap psi = psi_y lap psi_x - psi_x lap psi_y + Ra Pr T_x,     psi_y T_x - psi_x T_y = lap T

Chebyshev collocation with N = 40 in each direction. The conditions psi = psi_n = 0 are built into the basis, the
insulated walls are eliminated. Newton's method, from the solution at the next smaller Rayleigh number. Dense matrices
of 3042 unknowns: about half a minute and 300 MB. N = 24 to 36 give the same digits up to Ra = 1e5.
"""

import numpy as np

ORDER = 40
PRANDTL = 0.71


def chebyshev(order: int) -> tuple[np.ndarray, np.ndarray]:
    """Nodes from 1 to -1 and the matrix of the first derivative."""
    x = np.cos(np.pi * np.arange(order + 1) / order)
    c = np.ones(order + 1)
    c[[0, -1]] = 2.0
    c *= (-1.0) ** np.arange(order + 1)
    dx = x[:, None] - x[None, :] + np.eye(order + 1)
    d = np.outer(c, 1.0 / c) / dx
    return x, d - np.diag(d.sum(axis=1))


class Cavity:
    """Operators on the inner nodes; the row index of a field is that of x, the column index that of y."""

    def __init__(self, order: int) -> None:
        x, d = chebyshev(order)
        self.order, self.x = order, x
        # derivatives for a width of one
        first, second = 2.0 * d, 4.0 * d @ d
        third, fourth = 2.0 * d @ second, second @ second
        inner = slice(1, order)
        edge = np.diag(1.0 - x**2)
        scale = np.zeros((order + 1, order - 1))
        scale[inner] = np.diag(1.0 / (1.0 - x[inner] ** 2))
        at = np.diag(x)
        # of (1 - x^2) q with q = 0 at the ends; the factors 2 and 4 are those of the width
        self.clamped = [
            scale * (1.0 - x**2)[:, None],
            (edge @ first - 4.0 * at) @ scale,
            (edge @ second - 8.0 * at @ first - 8.0 * np.eye(order + 1)) @ scale,
            (edge @ third - 12.0 * at @ second - 24.0 * first) @ scale,
            (edge @ fourth - 16.0 * at @ third - 48.0 * second) @ scale,
        ]
        # inner values to all values: zero at the ends, or without slope there
        self.fixed = np.eye(order + 1)[:, inner]
        ends = [0, order]
        self.insulated = np.eye(order + 1)[:, inner]
        self.insulated[ends] = -np.linalg.solve(first[np.ix_(ends, ends)], first[ends, inner])
        self.first, self.second = first, second

        psi = [m[inner] for m in self.clamped]
        in_x = [(m @ self.fixed)[inner] for m in (np.eye(order + 1), first, second)]
        in_y = [(m @ self.insulated)[inner] for m in (np.eye(order + 1), first, second)]
        kron = np.kron
        self.psi_x, self.psi_y = kron(psi[1], psi[0]), kron(psi[0], psi[1])
        self.lap_x = kron(psi[3], psi[0]) + kron(psi[1], psi[2])
        self.lap_y = kron(psi[2], psi[1]) + kron(psi[0], psi[3])
        self.biharmonic = kron(psi[4], psi[0]) + 2.0 * kron(psi[2], psi[2]) + kron(psi[0], psi[4])
        self.t_x, self.t_y = kron(in_x[1], in_y[0]), kron(in_x[0], in_y[1])
        self.t_lap = kron(in_x[2], in_y[0]) + kron(in_x[0], in_y[2])

    def solve(self, rayleigh: float, start: np.ndarray) -> np.ndarray:
        """Stream function and temperature less that of conduction, 1 - x, by Newton's method."""
        state, half = start.copy(), start.size // 2
        for _ in range(30):
            psi, t = state[:half], state[half:]
            px, py, lx, ly = self.psi_x @ psi, self.psi_y @ psi, self.lap_x @ psi, self.lap_y @ psi
            tx, ty = self.t_x @ t - 1.0, self.t_y @ t
            buoyancy = rayleigh * PRANDTL
            rest = np.r_[
                PRANDTL * self.biharmonic @ psi - (py * lx - px * ly) - buoyancy * tx,
                self.t_lap @ t - (py * tx - px * ty),
            ]
            stream = (
                PRANDTL * self.biharmonic
                - (lx[:, None] * self.psi_y + py[:, None] * self.lap_x)
                + (ly[:, None] * self.psi_x + px[:, None] * self.lap_y)
            )
            heat = self.t_lap - py[:, None] * self.t_x + px[:, None] * self.t_y
            carried = -(tx[:, None] * self.psi_y - ty[:, None] * self.psi_x)
            change = np.linalg.solve(np.block([[stream, -buoyancy * self.t_x], [carried, heat]]), rest)
            state -= change
            if np.abs(change).max() < 1e-9 * np.abs(state).max():
                return state
        raise RuntimeError("Newton's method does not converge")

    def measure(self, state: np.ndarray, name: str) -> dict[str, float]:
        """Numbers of the tables; positions in units of the width from the hot wall and the floor."""
        n, fine = self.order, np.linspace(0.0, 1.0, 20001)
        psi, theta = state.reshape(2, n - 1, n - 1)
        t = 1.0 - (1.0 + self.x[:, None]) / 2.0 + self.fixed @ theta @ self.insulated.T
        u = self.clamped[0] @ psi @ self.clamped[1].T
        v = -self.clamped[1] @ psi @ self.clamped[0].T
        flux = -(self.first @ t)[-1]

        def along(values: np.ndarray, at: np.ndarray) -> np.ndarray:
            coefficients = np.polynomial.chebyshev.chebfit(self.x, values, n)
            return np.polynomial.chebyshev.chebval(2.0 * at - 1.0, coefficients)

        middle = n // 2
        u_line, v_line, nu = along(u[middle], fine), along(v[:, middle], fine), along(flux, fine)
        points, wall = np.array([0.1, 0.25]), np.array([0.75, 0.9])
        found = {"u_max": u_line.max(), "y of u_max": fine[u_line.argmax()], "v_max": v_line.max()}
        found |= {"x of v_max": fine[v_line.argmax()], "Nu": (nu[1:] + nu[:-1]).mean() / 2.0, "Nu_max": nu.max()}
        found |= {"Nu_min": nu.min(), "psi at the centre": abs(psi[middle - 1, middle - 1])}
        for at, value in zip(wall, along(u[middle], wall), strict=True):
            found[f"u(0.5, {at})"] = value
        for at, speed, warmth in zip(points, along(v[:, middle], points), along(t[:, middle], points), strict=True):
            found |= {f"v({at}, 0.5)": speed, f"T({at}, 0.5)": warmth}
        return {f"{name}: {key}": float(value) for key, value in found.items()}


def values() -> dict[str, float]:
    """Numbers without dimension, for each Rayleigh number."""
    cavity = Cavity(ORDER)
    state, found = np.zeros(2 * (ORDER - 1) ** 2), {}
    for name, rayleigh in (("Ra = 1e3", 1e3), ("Ra = 1e4", 1e4), ("Ra = 1e5", 1e5), ("", 3e5), ("Ra = 1e6", 1e6)):
        state = cavity.solve(rayleigh, state)
        if name:
            found |= cavity.measure(state, name)
    return found


if __name__ == "__main__":
    for label, number in values().items():
        print(f"{label}: {number:.6g}")
