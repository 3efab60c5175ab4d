"""Rubber gate under the pressure of water at rest, clamped above: reference numbers of the cases `gao-7.s2-*`, and the
scales of `gao-7.3-gate-*`.

The load is that on the gate at rest (dead load). Beams: Euler-Bernoulli, and inextensible with large rotations,

    EI theta'' = -Q cos(theta),   theta = 0 at the clamp,   theta' = 0 at the tip

with the angle theta and the transverse force Q, on 400 elements of second order. Peridynamics: the linearised
equations of the ordinary state-based model ([Gao2020] eqs. 2.10, 2.11b, 7.1) of 4 x 63 points and four clamped rows,
with a horizon of 3.6 spacings and whole volumes, solved directly; without and with the correction by the volume of the
families, `s_i = pi delta^2 / sum V`, whose mean multiplies the force of a bond and which multiplies the dilatation.
"""

import numpy as np

SPACING, ROWS, COLUMNS, CLAMPED = 1.25e-3, 63, 4, 4
LENGTH, THICKNESS, DEPTH = ROWS * SPACING, COLUMNS * SPACING, 0.14  # m
TIP = 0.079 - LENGTH  # m above the floor
WEIGHT = 9800.0  # N/m3
YOUNGS_MODULUS, POISSONS_RATIO = 12e6, 0.4
SHEAR = YOUNGS_MODULUS / (2.0 * (1.0 + POISSONS_RATIO))


def bending_stiffness(plane: str) -> float:
    """N m per metre of width."""
    modulus = YOUNGS_MODULUS if plane == "stress" else YOUNGS_MODULUS / (1.0 - POISSONS_RATIO**2)
    return modulus * THICKNESS**3 / 12.0


def load(s: np.ndarray, length: float) -> np.ndarray:
    """Pressure at a distance from the clamp, whose height is 0.079 m, Pa."""
    return WEIGHT * (DEPTH - 0.079 + s) * (s <= length)


def straight_beam(plane: str, length: float = LENGTH) -> float:
    """Deflection of the tip, m."""
    s = (np.arange(4000) + 0.5) / 4000 * length
    return float((load(s, length) * s**2 * (3.0 * length - s)).mean() * length / 6.0 / bending_stiffness(plane))


def bent_beam(plane: str, length: float, elements: int = 400) -> tuple[float, float]:
    """Displacements of the tip along x and y, m."""
    h = length / elements
    s = np.arange(elements + 1) * h
    shear = WEIGHT * ((DEPTH - 0.079) * (length - s) + (length**2 - s**2) / 2.0)
    factor = shear * h**2 / bending_stiffness(plane)
    matrix = np.diag(np.full(elements + 1, -2.0)) + np.eye(elements + 1, k=1) + np.eye(elements + 1, k=-1)
    matrix[0], matrix[-1, -2] = np.eye(elements + 1)[0], 2.0
    factor[0], theta = 0.0, np.zeros(elements + 1)
    for _ in range(30):
        rest = matrix @ theta + factor * np.cos(theta)
        theta -= np.linalg.solve(matrix - np.diag(factor * np.sin(theta)), rest)
    weights = np.r_[0.5, np.ones(elements - 1), 0.5] * h
    return float(weights @ np.sin(theta)), float(length - weights @ np.cos(theta))


def peridynamic_gate(plane: str, is_corrected: bool) -> float:
    """Mean displacement of the lowest row along x, m."""
    index = [(i, j) for j in range(ROWS + CLAMPED) for i in range(COLUMNS)]
    x = SPACING * (np.array(index, dtype=float) + 0.5)
    horizon, volume, number = 3.6 * SPACING, SPACING**2, len(index)
    side = 1.0 - POISSONS_RATIO if plane == "stress" else (1.0 + POISSONS_RATIO) * (1.0 - 2.0 * POISSONS_RATIO)
    a = (YOUNGS_MODULUS / (2.0 * side) - 2.0 * SHEAR) / 2.0
    b, d = 6.0 * SHEAR / (np.pi * horizon**4), 2.0 / (np.pi * horizon**3)
    xi = x[None, :, :] - x[:, None, :]
    length = np.linalg.norm(xi, axis=2)
    bonds = (length > 0.0) & (length < horizon)
    correction = np.pi * horizon**2 / (bonds.sum(axis=1) * volume) if is_corrected else np.ones(number)
    dilatation = np.zeros((number, 2 * number))
    stiffness = np.zeros((2 * number, 2 * number))
    for i, j in np.argwhere(bonds):
        e = xi[i, j] / length[i, j]
        dilatation[i, 2 * j : 2 * j + 2] += correction[i] * d * horizon * e / length[i, j] * volume
        dilatation[i, 2 * i : 2 * i + 2] -= correction[i] * d * horizon * e / length[i, j] * volume
    for i, j in np.argwhere(bonds):
        e, mean = xi[i, j] / length[i, j], 0.5 * (correction[i] + correction[j])
        force = 2.0 * horizon * a * d / length[i, j] * (dilatation[i] + dilatation[j])
        stretch = 4.0 * horizon * b * e / length[i, j]
        force[2 * j : 2 * j + 2] += stretch
        force[2 * i : 2 * i + 2] -= stretch
        stiffness[2 * i : 2 * i + 2] += mean * volume * np.outer(e, force)
    free = 2 * COLUMNS * ROWS
    pressure = np.zeros((number, 2))
    wet = [k for k, (i, j) in enumerate(index) if i == 0 and j < ROWS]
    pressure[wet, 0] = WEIGHT * (DEPTH - TIP - x[wet, 1]) / SPACING
    found = np.linalg.solve(stiffness[:free, :free], -pressure.ravel()[:free])
    return float(found[: 2 * COLUMNS : 2].mean())


def values() -> dict[str, float]:
    found = {}
    for plane in ("stress", "strain"):
        beam = straight_beam(plane)
        found[f"plane {plane}: Euler-Bernoulli beam of 63 rows, m"] = beam
        found[f"plane {plane}: Euler-Bernoulli beam of 0.079 m, m"] = straight_beam(plane, 0.079)
        for is_corrected in (False, True):
            name = f"plane {plane}: peridynamics {'with' if is_corrected else 'without'} correction"
            deflection = peridynamic_gate(plane, is_corrected)
            found |= {f"{name}, m": deflection, f"{name}, over the beam": deflection / beam}
        along, across = bent_beam(plane, 0.079)
        found |= {
            f"plane {plane}: beam with large rotation, x, m": along,
            f"plane {plane}: beam with large rotation, y, m": across,
        }
    found["force on the closed gate, N/m"] = WEIGHT * (DEPTH**2 - (DEPTH - 0.079) ** 2) / 2.0
    return found


if __name__ == "__main__":
    for label, number in values().items():
        print(f"{label}: {number:.5g}")
