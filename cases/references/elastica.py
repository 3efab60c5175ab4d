"""Cantilever under a force P at its end that keeps its direction, of any rotation (elastica).

    EI theta'' = -P cos(theta),  theta(0) = 0,  theta'(L) = 0,      x' = cos(theta),  y' = sin(theta)

by Runge-Kutta steps and bisection for the curvature at the clamp. Lengths are over L; Mattiasson (1981), Int. J. Numer. Methods Eng.
17, 145-153, tables the same numbers from elliptic integrals.
"""

from math import cos, sin


def bent(load, curvature, steps=20000, part=1.0):
    """The beam with a curvature at the clamp after a part of its length: rotation, curvature and position."""

    def rate(state):
        theta, kappa, _, _ = state
        return (kappa, -load * cos(theta), cos(theta), sin(theta))

    def moved(state, by, size):
        return tuple(s + size * r for s, r in zip(state, by))

    state, h = (0.0, curvature, 0.0, 0.0), part / steps
    for _ in range(steps):
        a = rate(state)
        b = rate(moved(state, a, 0.5 * h))
        c = rate(moved(state, b, 0.5 * h))
        d = rate(moved(state, c, h))
        state = tuple(
            s + h / 6.0 * (p + 2.0 * q + 2.0 * r + t)
            for s, p, q, r, t in zip(state, a, b, c, d)
        )
    return state


def displacement(load, part=1.0):
    """Shortening and deflection over L after a part of the length, under `load = P L^2 / EI`."""
    low, high = 0.0, load
    while high - low > 1e-12:
        middle = 0.5 * (low + high)
        if bent(load, middle, 2000)[1] > 0.0:
            high = middle
        else:
            low = middle
    _, _, x, y = bent(load, 0.5 * (low + high), part=part)
    return part - x, y


if __name__ == "__main__":
    for part in (1.0, 0.99):
        for load in (1.0, 2.0, 5.0, 10.0):
            shortening, deflection = displacement(load, part)
            print(f"s = {part} L, P L^2 / EI = {load:4.1f}: u = {shortening:.5f} L, w = {deflection:.5f} L")
