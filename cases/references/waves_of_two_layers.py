"""Waves between two viscous fluids (Chandrasekhar (1961), section 94): the rate at which they grow or decay and oscillate, and the waves with
which the cases `two-fluids-rayleigh-taylor`, `two-fluids-capillary-wave` and `two-fluids-internal-wave` begin.

With the wave number k, w = W(z) cos(k x) e^(n t), and q = sqrt(k^2 + n / nu) of each fluid,

    W = A1 e^(k z) + B1 e^(q1 z) below,   A2 e^(-k z) + B2 e^(-q2 z) above;

velocity and shear stress are continuous, and the normal stress jumps by weight and tension: the rate n, complex where the wave oscillates, is a
root of the determinant.
"""

from cmath import sqrt
from math import pi


def eliminated(rows):
    """Upper triangular rows by Gauss with pivots, and the sign of the exchanges."""
    rows, sign, count = [r[:] for r in rows], 1.0, len(rows)
    for i in range(count):
        pivot = max(range(i, count), key=lambda r: abs(rows[r][i]))
        if pivot != i:
            rows[i], rows[pivot], sign = rows[pivot], rows[i], -sign
        for r in range(i + 1, count):
            factor = rows[r][i] / rows[i][i]
            rows[r] = [a - factor * b for a, b in zip(rows[r], rows[i])]
    return rows, sign


def conditions(n, k, density, viscosity, gravity, tension):
    """Rows of the conditions on A1, B1, A2, B2."""
    (r1, r2), (m1, m2) = density, viscosity
    q1, q2 = sqrt(k * k + n * r1 / m1), sqrt(k * k + n * r2 / m2)

    def pressure(rho, mu, s):
        return (-rho * n * s + mu * (s**3 - k * k * s)) / k**2

    weight = ((r1 - r2) * gravity + tension * k * k) / n
    return [
        [1.0, 1.0, -1.0, -1.0],
        [k, q1, k, q2],
        [2 * m1 * k * k, m1 * (q1 * q1 + k * k), -2 * m2 * k * k, -m2 * (q2 * q2 + k * k)],
        [
            pressure(r1, m1, k) - 2 * m1 * k - weight,
            pressure(r1, m1, q1) - 2 * m1 * q1 - weight,
            -pressure(r2, m2, -k) - 2 * m2 * k,
            -pressure(r2, m2, -q2) - 2 * m2 * q2,
        ],
    ]


def inviscid_rate(k, density, _, gravity, tension):
    r1, r2 = density
    return sqrt((r2 - r1) / (r1 + r2) * gravity * k - tension * k**3 / (r1 + r2))


def rate(*of):
    """The rate next to that of fluids without viscosity, by secants."""

    def determinant(n):
        rows, product = eliminated(conditions(n, *of))
        for i, row in enumerate(rows):
            product *= row[i]
        return product

    k, density, viscosity, _, _ = of
    decay = 2 * k * k * sum(viscosity) / sum(density)
    before, now = inviscid_rate(*of), inviscid_rate(*of) - decay
    at_before = determinant(before)
    for _ in range(100):
        at_now = determinant(now)
        step = at_now * (now - before) / (at_now - at_before)
        before, at_before, now = now, at_now, now - step
        if abs(step) < 1e-13 * abs(now):
            return now
    raise ValueError("no wave")


def wave(n, *of):
    """A1, B1, A2, B2 of the wave with W(0) = 1."""
    # A1 = 1, and the others from the first three conditions
    rows = [[row[1], row[2], row[3], -row[0]] for row in conditions(n, *of)[:3]]
    rows, _ = eliminated(rows)
    found = [0.0] * 3
    for i in (2, 1, 0):
        rest = sum(rows[i][j] * found[j] for j in range(i + 1, 3))
        found[i] = (rows[i][3] - rest) / rows[i][i]
    b1, a2, b2 = found
    return [x / (1.0 + b1) for x in (1.0, b1, a2, b2)]


if __name__ == "__main__":
    for density, viscosity, gravity, tension in (
        ((1.0, 3.0), (0.01, 0.03), 1.0, 0.0),
        ((1.0, 3.0), (0.01, 0.03), 1.0, 0.02),
        ((1.0, 3.0), (0.003, 0.009), 1.0, 0.02),
        ((1.0, 1.0), (0.02, 0.02), 0.0, 0.2),
        ((3.0, 1.0), (0.03, 0.01), 1.0, 0.0),
    ):
        fluids = (2 * pi, density, viscosity, gravity, tension)
        n = rate(*fluids)
        q = [sqrt(4 * pi * pi + n * r / m) for r, m in zip(density, viscosity)]
        print(f"densities {density}, viscosities {viscosity}, gravity {gravity}, tension {tension}:")
        print(f"    {n:.4f} 1/s (inviscid {inviscid_rate(*fluids):.4f}), q {q}, wave {wave(n, *fluids)}")
