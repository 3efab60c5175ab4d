"""Melting of tin and a thermocapillary cavity: reference numbers of the cases `melting-tin-*` and `thermocapillary-cavity`.

Finite volumes on a staggered (MAC) grid with projection, forward in time with Adams-Bashforth for momentum:

    python melt_flow.py tin 100        # liquid fraction and front, at 200, 400, ..., 1000 s
    python melt_flow.py cavity 64      # Nusselt number and velocities of the steady state

Tin: a square of 0.1 m at the melting point, hot on the left. A cell flows where more than half of it is liquid; velocities between
others vanish. Third-order upwind-biased fluxes (QUICK) of momentum and temperature. Cavity: unit square, `u_y = -Re T_x` on top,
central fluxes. Grids of 50, 80 and 100 cells give for tin a liquid fraction of 0.3147, 0.3181 and 0.3189 at 1000 s; grids of 32, 64
and 128 for the cavity a Nusselt number of 1.9437, 1.9305 and 1.9264. The finest grids take hours.
"""

import sys

import numpy as np


def shifted(f: np.ndarray, axis: int, by: int) -> np.ndarray:
    """`f[i + by]`, with the last value repeated at the ends."""
    index = np.clip(np.arange(f.shape[axis]) + by, 0, f.shape[axis] - 1)
    return np.take(f, index, axis)


def between(f: np.ndarray, axis: int, speed: np.ndarray, upwind: bool) -> np.ndarray:
    """Values of a padded field between entries 1 | 2, 2 | 3, ...: two entries of padding on each side."""
    n = f.shape[axis]
    a, b, c, d = (np.take(f, np.arange(k, n - 3 + k), axis) for k in range(4))
    if not upwind:
        return 0.5 * (b + c)
    return np.where(speed > 0, (3 * c + 6 * b - a) / 8, (3 * b + 6 * c - d) / 8)


class Flow:
    """Velocities u at the faces across x, (n + 1) x n, and w at those across y, n x (n + 1); pressure and fluid cells n x n."""

    def __init__(self, n: int, size: float, viscosity: float, upwind: bool) -> None:
        self.n, self.h, self.nu, self.upwind = n, size / n, viscosity, upwind
        self.u, self.w, self.p = np.zeros((n + 1, n)), np.zeros((n, n + 1)), np.zeros((n, n))
        self.fluid = np.ones((n, n), bool)
        self.last = None
        # value of u above the top from the last row
        self.above = lambda u: -u[:, -1]

    def open_faces(self) -> tuple[np.ndarray, np.ndarray]:
        """Faces between two fluid cells."""
        u, w = np.zeros(self.u.shape, bool), np.zeros(self.w.shape, bool)
        u[1:-1] = self.fluid[1:] & self.fluid[:-1]
        w[:, 1:-1] = self.fluid[:, 1:] & self.fluid[:, :-1]
        return u, w

    def rates(self, lift: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rates of u and w by convection, viscosity and lift (of w), at inner faces."""
        above = self.above(self.u)
        first = self.rate_of(self.u, self.w, (-self.u[:, 0], above))
        second = self.rate_of(self.w.T, self.u.T, (-self.w[0], -self.w[-1])).T
        second[:, 1:-1] += lift
        return first, second

    def rate_of(self, u: np.ndarray, w: np.ndarray, ends: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
        """Rate of the velocity along the first axis; `ends`: its values beyond the ends of the second axis."""
        h, zero = self.h, np.zeros((1, u.shape[1]))
        along = 0.5 * (u[1:] + u[:-1])
        padded = np.vstack([zero, u, zero])
        f = along * between(padded, 0, along, self.upwind)
        low, high = (end[:, None] for end in ends)
        across = 0.5 * (w[1:] + w[:-1])
        padded = np.hstack([low, low, u, high, high])[1:-1]
        g = across * between(padded, 1, across, self.upwind)
        # a neighbour that does not flow stands for a wall halfway
        moves = self.moves[0] if u.shape == self.u.shape and u is self.u else self.moves[1].T
        beside = np.hstack([low, u, high])
        wall = np.hstack([np.ones((len(u), 1), bool), moves, np.ones((len(u), 1), bool)])
        down = np.where(wall[:, :-2], beside[:, :-2], -u)
        up = np.where(wall[:, 2:], beside[:, 2:], -u)
        rate = np.zeros_like(u)
        viscous = (u[2:] + u[:-2] + down[1:-1] + up[1:-1] - 4 * u[1:-1]) / h**2
        rate[1:-1] = -(f[1:] - f[:-1] + g[:, 1:] - g[:, :-1]) / h + self.nu * viscous
        return rate

    def advance(self, dt: float, lift: np.ndarray) -> None:
        self.moves = self.open_faces()
        for v, moves in zip((self.u, self.w), self.moves):
            v[~moves] = 0.0
        now = self.rates(lift)
        last = self.last or now
        self.last = now
        for v, new, old, moves in zip((self.u, self.w), now, last, self.moves):
            v += dt * np.where(moves, 1.5 * new - 0.5 * old, 0.0)
        self.project(dt)

    def divergence(self) -> np.ndarray:
        return np.diff(self.u, axis=0) + np.diff(self.w, axis=1)

    def gradient(self, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        x, y = np.zeros(self.u.shape), np.zeros(self.w.shape)
        x[1:-1], y[:, 1:-1] = np.diff(p, axis=0), np.diff(p, axis=1)
        return x * self.moves[0], y * self.moves[1]

    def project(self, dt: float) -> None:
        """Conjugate gradients for the pressure, from the last one."""

        def apply(p: np.ndarray) -> np.ndarray:
            x, y = self.gradient(p)
            return -(np.diff(x, axis=0) + np.diff(y, axis=1))

        rhs = np.where(self.fluid, -self.divergence() * self.h / dt, 0.0)
        r = rhs - apply(self.p)
        d, rr, limit = r.copy(), np.vdot(r, r), 1e-10 * np.vdot(rhs, rhs) + 1e-30
        for _ in range(3000):
            if rr <= limit:
                break
            q = apply(d)
            step = rr / np.vdot(d, q)
            self.p += step * d
            r -= step * q
            rr, before = np.vdot(r, r), rr
            d = r + rr / before * d
        x, y = self.gradient(self.p)
        self.u -= dt / self.h * x
        self.w -= dt / self.h * y

    def carried(self, t: np.ndarray, walls: tuple[float, float] | None) -> np.ndarray:
        """Divergence of the flux of a temperature; `walls`: those at x = 0 and on the other side, else their cells count."""
        padded = np.vstack([t[:1], t[:1], t, t[-1:], t[-1:]])
        x = self.u * between(padded, 0, self.u, self.upwind)
        padded = np.hstack([t[:, :1], t[:, :1], t, t[:, -1:], t[:, -1:]])
        y = self.w * between(padded, 1, self.w, self.upwind)
        return (np.diff(x, axis=0) + np.diff(y, axis=1)) / self.h


def conducted(t: np.ndarray, h: float, hot: float, cold: float) -> np.ndarray:
    """Laplacian between walls at two temperatures and two insulated ones."""
    padded = np.vstack([2 * hot - t[:1], t, 2 * cold - t[-1:]])
    sides = np.hstack([t[:, :1], t, t[:, -1:]])
    return (padded[2:] + padded[:-2] + sides[:, 2:] + sides[:, :-2] - 4 * t) / h**2


def tin(n: int, end: float = 1000.0) -> None:
    k, rho, c, latent, melting, hot = 60.0, 7500.0, 200.0, 6e4, 505.0, 508.0
    flow = Flow(n, 0.1, 6e-3 / rho, upwind=True)
    h, heat = flow.h, np.zeros((n, n))
    dt = min(0.2 * h * h / max(flow.nu, k / (rho * c)), 0.3 * h / 0.03)
    time, out = 0.0, 200.0
    while time < end - 1e-9:
        excess = np.where(heat < 0, heat, np.maximum(heat - rho * latent, 0.0)) / (rho * c)
        liquid = np.clip(heat / (rho * latent), 0, 1)
        flow.fluid = liquid > 0.5
        lift = 10 * 2.67e-4 * 0.5 * (excess[:, 1:] + excess[:, :-1])
        flow.advance(dt, lift)
        heat += dt * (k * conducted(excess, h, hot - melting, 0.0) - rho * c * flow.carried(excess, None))
        time += dt
        if time >= out - 1e-9:
            out += 200.0
            liquid = np.clip(heat / (rho * latent), 0, 1)
            front = liquid.sum(axis=0) * h
            print(f"{time:.1f} s: liquid {liquid.mean():.5f}, front {front[0]:.4f} (bottom), {front[n // 2]:.4f}, {front[-1]:.4f} m (top)")


def cavity(n: int, reynolds: float = 1000.0, prandtl: float = 1.0) -> None:
    flow = Flow(n, 1.0, 1.0, upwind=False)
    h = flow.h
    t = np.repeat(1 - (np.arange(n) + 0.5)[:, None] / n, n, axis=1)
    dt = min(0.1 * h * h / max(1.0, 1 / prandtl), 0.5 * h / (0.2 * reynolds))

    def above(u: np.ndarray) -> np.ndarray:
        slope = np.zeros(n + 1)
        slope[1:-1] = np.diff(t[:, -1]) / h
        return u[:, -1] - h * reynolds * slope

    flow.above = above
    last, steps = 0.0, 0
    while True:
        flow.advance(dt, np.zeros((n, n - 1)))
        t += dt * (conducted(t, h, 1.0, 0.0) / prandtl - flow.carried(t, None))
        steps += 1
        if steps % 2000 == 0:
            psi = np.abs(np.cumsum(flow.u, axis=1)).max() * h
            nusselt = 2 * (1 - t[0]).sum()
            print(f"{steps * dt:.3f}: Nusselt number {nusselt:.4f}, psi {psi:.4f}, lowest u on x = 1/2 {flow.u[n // 2].min():.4f}")
            if abs(psi - last) < 1e-7 * psi:
                return
            last = psi


if __name__ == "__main__":
    {"tin": tin, "cavity": cavity}[sys.argv[1]](int(sys.argv[2]))
