"""Series for channels that start to flow, a plate that is heated at its edges and a slab that is heated at one side:
reference numbers of the cases `gao-5.5.2-couette-*`, `gao-5.5.3-poiseuille-*`, `gao-5.6.2-heat-conduction-*` and
`wang-8.5.4-conduction-*`.

    Couette      v = v0 [y/W + sum_n 2/(n pi) (-1)^n sin(n pi y/W) exp(-nu n^2 pi^2 t/W^2)]
    slab         T = T1 [y/H + sum_n 2/(n pi) (-1)^n sin(n pi y/H) exp(-alpha n^2 pi^2 t/H^2)]
    Poiseuille   v = F/(2 nu) y (W - y) - sum_{n odd} 4 F W^2/(nu pi^3 n^3) sin(n pi y/W) exp(-nu n^2 pi^2 t/W^2)
    plate        T = T_b [1 - f(x) f(y)],   f(s) = sum_{n odd} 4/(n pi) sin(n pi s/L) exp(-alpha n^2 pi^2 t/L^2)

400 terms each.
"""

import numpy as np

WIDTH, VISCOSITY = 1e-3, 1e-6  # m, m2/s
LID, FORCE = 2.5e-5, 2e-4  # m/s, m/s2
EDGE, EDGE_TEMPERATURE = 0.1, 10.0  # m, K
DIFFUSIVITY = 8.3075 / (1620.0 * 1092.728)  # m2/s
SLAB, SLAB_TEMPERATURE = 5.76e-3, 1.152  # m, K
SLAB_DIFFUSIVITY = 1.2e-6 / (250.0 * 0.5e-4)  # m2/s
TERMS = np.arange(1, 401)
PLACES = ((0.05, 0.05), (0.025, 0.05), (0.025, 0.025), (0.01, 0.05), (0.01, 0.01), (0.005, 0.05))


def one_sided(part: float, time: float) -> float:
    """Share of the value of the far side at a part of the width; time in units of the squared width over diffusivity."""
    n = TERMS
    decay = np.exp(-((n * np.pi) ** 2) * time)
    waves = 2.0 / (n * np.pi) * (-1.0) ** n * np.sin(n * np.pi * part) * decay
    return part + waves.sum()


def couette(y: float, t: float) -> float:
    """Velocity (m/s) at a height (m) and a time (s)."""
    return LID * one_sided(y / WIDTH, VISCOSITY * t / WIDTH**2)


def slab(y: float, t: float) -> float:
    """Temperature (K) above the cold side at a height (m) and a time (s)."""
    return SLAB_TEMPERATURE * one_sided(y / SLAB, SLAB_DIFFUSIVITY * t / SLAB**2)


def poiseuille(y: float, t: float) -> float:
    """Velocity (m/s) at a height (m) and a time (s)."""
    n = TERMS[::2]
    decay = np.exp(-VISCOSITY * (n * np.pi / WIDTH) ** 2 * t)
    waves = 4.0 * FORCE * WIDTH**2 / (VISCOSITY * np.pi**3 * n**3.0) * np.sin(n * np.pi * y / WIDTH) * decay
    return FORCE / (2.0 * VISCOSITY) * y * (WIDTH - y) - waves.sum()


def plate(x: float, y: float, t: float) -> float:
    """Temperature (K) at a place (m) and a time (s)."""
    n = TERMS[::2]

    def profile(s: float) -> float:
        decay = np.exp(-DIFFUSIVITY * (n * np.pi / EDGE) ** 2 * t)
        return (4.0 / (n * np.pi) * np.sin(n * np.pi * s / EDGE) * decay).sum()

    return EDGE_TEMPERATURE * (1.0 - profile(x) * profile(y))


def values() -> dict[str, float]:
    found = {}
    for t in (0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.6):
        for part in (0.1, 0.25, 0.5, 0.75, 0.9):
            found[f"Couette flow, {t} s, y = {part} W, m/s"] = float(couette(part * WIDTH, t))
        for part in (0.1, 0.25, 0.5):
            found[f"Poiseuille flow, {t} s, y = {part} W, m/s"] = float(poiseuille(part * WIDTH, t))
    for t in (5.0, 10.0, 20.0, 40.0):
        for x, y in PLACES:
            found[f"plate, {t:g} s, ({x}, {y}) m, K"] = float(plate(x, y, t))
    for part in (0.25, 0.5, 0.75):
        found[f"slab, 0.1 s, y = {part} H, K"] = float(slab(part * SLAB, 0.1))
    return found


if __name__ == "__main__":
    for label, number in values().items():
        print(f"{label}: {number:.6g}")
