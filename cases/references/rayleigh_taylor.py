"""Growth of a wave between two viscous fluids, the heavy one above (Chandrasekhar (1961), section 94): rate, and the growing wave of the
case `two-fluids-rayleigh-taylor`.

With the wave number k, w = W(z) cos(k x), and q = sqrt(k^2 + n / nu) of each fluid,

    W = A1 e^(k z) + B1 e^(q1 z) below,   A2 e^(-k z) + B2 e^(-q2 z) above;

velocity and shear stress are continuous, and the normal stress jumps by weight and tension: the rate n is a root of the determinant.
"""

from math import pi, sqrt


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
    """Rows of the conditions on A1, B1, A2, B2, each over its largest entry."""
    (r1, r2), (m1, m2) = density, viscosity
    q1, q2 = sqrt(k * k + n * r1 / m1), sqrt(k * k + n * r2 / m2)

    def pressure(rho, mu, s):
        return (-rho * n * s + mu * (s**3 - k * k * s)) / k**2

    weight = ((r1 - r2) * gravity + tension * k * k) / n
    rows = [
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
    return [[x / max(map(abs, row)) for x in row] for row in rows]


def rate(*of):
    """The largest rate of growth."""

    def determinant(n):
        rows, product = eliminated(conditions(n, *of))
        for i, row in enumerate(rows):
            product *= row[i]
        return product

    k, (r1, r2), _, gravity, tension = of
    inviscid = sqrt((r2 - r1) / (r1 + r2) * gravity * k - tension * k**3 / (r1 + r2))
    rates = [1.2 * inviscid * i / 2000 for i in range(2, 2000)]
    for high, low in zip(rates[::-1], rates[-2::-1]):
        if determinant(high) * determinant(low) < 0:
            for _ in range(60):
                middle = 0.5 * (low + high)
                if determinant(low) * determinant(middle) <= 0:
                    high = middle
                else:
                    low = middle
            return 0.5 * (low + high)
    raise ValueError("no growing wave")


def wave(n, *of):
    """A1, B1, A2, B2 of the growing wave with W(0) = 1."""
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
    for nu, tension in ((0.01, 0.0), (0.01, 0.02), (0.003, 0.02)):
        fluids = (2 * pi, (1.0, 3.0), (nu, 3 * nu), 1.0, tension)
        n = rate(*fluids)
        print(f"nu {nu}, tension {tension}: {n:.4f} 1/s, wave {wave(n, *fluids)}")
