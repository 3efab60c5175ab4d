"""Temperatures under moving sources without melting, for the cases `wang-7.5.3-*`, `wang-7.5.4.1-*`, `dual-goldak` and
`wang-7.5.5.1-*`.

    python3 moving_sources.py

Bodies with insulated surfaces start at 0; a source of 3.2 kW moves along x from x = 0 at the speed v. With the age u
of the heat,

    T(x, y, z, t) = 1 / C integral of q X(x - v (t - u), u) Y(y, u) Z(z, u) du from 0 to t,

each factor is the profile of the source along an axis, spread by conduction over the age; insulated faces are images.

- Point source ([Wang2025] eq. 7.27): a plate of 10 mm, 100 mm x 100 mm, with the power spread over a square of two
  spacings, as the four cells around a vertex receive it.
- Goldak's semi-ellipsoid ([Wang2025] eq. 7.9, with q_m = 6 sqrt(3) Q / (a b c pi^1.5)): a block of 100 x 100 x 10 mm.
- Gaussian on a plate ([Wang2025] eqs. 7.7, 7.8): an infinite plate that is heated through its thickness.

The integral over the age: Gauss-Legendre with 24 nodes on panels that grow by 1.35 from 1e-6 s (1e-5 s: point) on.
One image behind each edge, three behind top and bottom. Melt pools of the linear field by a root search. Prints
temperatures (K above the start) at positions in mm, and lengths (m). Needs NumPy and SciPy."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq, minimize_scalar
from scipy.special import erf, k0

Array = NDArray[np.float64]

NODES, WEIGHTS = np.polynomial.legendre.leggauss(24)
POWER, CONDUCTIVITY, DENSITY = 3200.0, 50.0, 7820.0  # W, W/(m K), kg/m3
WIDTH, THICKNESS = 0.1, 0.01  # m
# point source, Goldak and Gaussian: specific heat J/(kg K), speed m/s
POINT_HEAT, HEAT, SPEED, GAUSSIAN_SPEED = 460.0, 490.0, 0.005, 0.025
SPACING = 4e-4  # m
HALF_WIDTH, DEPTH, HALF_LENGTH = 1e-3, 1e-3, 5e-4  # m, of the ellipsoid
SIGMA = 7e-4  # m, of the Gaussian
SOLIDUS = 1385.0
MM = 1e-3


def over_age(integrand: Callable[[Array], Array], end: float, first: float) -> float:
    """Integral from 0 to the end, s, on panels that grow from the first one on, s."""
    edges = [0.0, first]
    while edges[-1] < end:
        edges.append(min(end, 1.35 * edges[-1]))
    low, high = np.array(edges[:-1])[:, None], np.array(edges[1:])[:, None]
    ages = 0.5 * (high - low) * NODES + 0.5 * (low + high)
    return float(np.sum(0.5 * (high - low) * WEIGHTS * integrand(ages)))


def bell(u: float | Array, variance: float, spread: Array) -> Array:
    """exp(-u^2 / (2 variance)), spread by conduction; spread = 2 a age, m2."""
    now = variance + spread
    return np.sqrt(variance / now) * np.exp(-u * u / (2 * now))


def box(u: float | Array, half: float, spread: Array) -> Array:
    """1 between -half and half, spread by conduction."""
    root = np.sqrt(2 * spread)
    return 0.5 * (erf((u + half) / root) - erf((u - half) / root))


def images(profile: Callable[[float | Array], Array], u: float, centre: float | Array, width: float) -> Array:
    """Sum over a source at the centre and its images behind the edges -width/2 and width/2."""
    total: Array = np.zeros(1)
    for m in (-1, 0, 1):
        total = total + profile(u - (2 * m * width + centre)) + profile(u - ((2 * m + 1) * width - centre))
    return total


def point(x: float, y: float, time: float = 4.0) -> float:
    """K, of the plate with the moving square of two spacings."""
    diffusivity = CONDUCTIVITY / DENSITY / POINT_HEAT

    def factors(age: Array) -> Array:
        spread, centre = 2 * diffusivity * age, SPEED * (time - age)
        profile: Callable[[float | Array], Array] = lambda u: box(u, SPACING, spread)  # noqa: E731
        return images(profile, x, centre, WIDTH) * images(profile, y, 0.0, WIDTH)

    density = POWER / (4 * SPACING**2 * THICKNESS)
    return density / (DENSITY * POINT_HEAT) * over_age(factors, time, 1e-5)


def rosenthal(x: float, time: float = 4.0) -> tuple[float, float]:
    """K on the path, of the quasi-steady thick and thin plate ([Wang2025] eq. 7.6; K0), for comparison."""
    diffusivity = CONDUCTIVITY / DENSITY / POINT_HEAT
    ahead = x - SPEED * time
    r, rate = abs(ahead), SPEED / (2 * diffusivity)
    thick = POWER / (2 * np.pi * CONDUCTIVITY * r) * np.exp(-rate * (ahead + r))
    thin = POWER / (2 * np.pi * CONDUCTIVITY * THICKNESS) * np.exp(-rate * ahead) * k0(rate * r)
    return float(thick), float(thin)


def goldak(x: float, y: float, depth: float, time: float = 4.0) -> float:
    """K, of the block with the moving semi-ellipsoid."""
    diffusivity = CONDUCTIVITY / DENSITY / HEAT
    along, across, below = HALF_LENGTH**2 / 6, HALF_WIDTH**2 / 6, DEPTH**2 / 6

    def factors(age: Array) -> Array:
        spread, centre = 2 * diffusivity * age, SPEED * (time - age)
        in_x = images(lambda u: bell(u, along, spread), x, centre, WIDTH)
        in_y = images(lambda u: bell(u, across, spread), y, 0.0, WIDTH)
        in_z = sum(bell(depth - 2 * m * THICKNESS, below, spread) for m in range(-3, 4))
        return in_x * in_y * in_z

    density = 6 * 3**0.5 * POWER / (HALF_WIDTH * DEPTH * HALF_LENGTH * np.pi**1.5)
    return density / (DENSITY * HEAT) * over_age(factors, time, 1e-6)


def gaussian(x: float, y: float, time: float = 0.08, effective_depth: float = THICKNESS) -> float:
    """K, of the infinite plate with the moving Gaussian, whose flux is spread over a depth (m)."""
    diffusivity = CONDUCTIVITY / DENSITY / HEAT

    def factors(age: Array) -> Array:
        spread, centre = 2 * diffusivity * age, GAUSSIAN_SPEED * (time - age)
        return bell(x - centre, SIGMA**2, spread) * bell(y, SIGMA**2, spread)

    density = POWER / (2 * np.pi * SIGMA**2) / effective_depth
    return density / (DENSITY * HEAT) * over_age(factors, time, 1e-6)


def melt_pool(isotherm: float = SOLIDUS) -> dict[str, float]:
    """Rear, front, width and depth (m) of the region above a temperature, in the linear field of the ellipsoid."""

    def largest(extent: Callable[[float], float]) -> float:
        options = {"xatol": 1e-7}
        found = minimize_scalar(lambda x: -extent(x), bounds=(15 * MM, 20 * MM), method="bounded", options=options)
        return float(-found.fun)

    def half_width(x: float) -> float:
        return float(brentq(lambda y: goldak(x, y, 0.0) - isotherm, 0.0, 10 * MM, xtol=1e-9))

    def depth(x: float) -> float:
        return float(brentq(lambda z: goldak(x, 0.0, z) - isotherm, 0.0, 9 * MM, xtol=1e-9))

    def on_path(x: float) -> float:
        return goldak(x, 0.0, 0.0) - isotherm

    return {
        "rear": float(brentq(on_path, 8 * MM, 18 * MM, xtol=1e-9)),
        "front": float(brentq(on_path, 20 * MM, 28 * MM, xtol=1e-9)),
        "width": 2 * largest(half_width),
        "depth": largest(depth),
    }


def values() -> dict[str, float]:
    """Temperatures, K above the start, and lengths of the melt pool, m."""
    found = {}
    for x in (-9.8, -5.0, 0.2, 5.0, 10.2, 15.0, 17.0, 18.2, 22.2, 23.0, 24.2, 25.0, 28.2, 30.2):
        found[f"point source, x = {x} mm, y = 0.2 mm"] = point(x * MM, 0.2 * MM)
    found["point source, mean"] = POWER * 4.0 / (DENSITY * POINT_HEAT * WIDTH**2 * THICKNESS)
    for x in (5.0, 7.0, 9.0, 11.0, 13.0, 15.0, 17.0, 18.2, 21.8, 22.2, 23.0, 25.0, 27.8, 30.2, 33.0, 35.0):
        found[f"ellipsoid, x = {x} mm, y = z = 0.2 mm"] = goldak(x * MM, 0.2 * MM, 0.2 * MM)
    for x in (0.2, 5.0, 10.2, 15.0, 18.2, 20.2, 22.2, 25.0, 25.8):
        two = [goldak(x * MM, 0.2 * MM, z * MM) for z in (4.6, 5.0)]
        found[f"ellipsoid, x = {x} mm, y = 0.2 mm, mean of z = 4.6 and 5 mm"] = 0.5 * sum(two)
    for name, length in melt_pool().items():
        found[f"ellipsoid, {name} of the melt pool, m"] = length
    found["ellipsoid, mean"] = POWER * 4.0 / (DENSITY * HEAT * WIDTH**2 * THICKNESS)
    on_axis = (-6, -5, -4, -3, -2, -1, -0.5, 0, 0.5, 1, 1.5, 1.52, 2, 2.5, 3, 3.5, 4, 5, 6)
    for x, y in [(x, 0) for x in on_axis] + [(1, y) for y in (0.5, 1, 2, 3)]:
        found[f"Gaussian over the thickness, x = {x} mm, y = {y} mm"] = gaussian(x * MM, y * MM)
    return found


if __name__ == "__main__":
    for name, value in values().items():
        print(f"{name} {value:.6g}")
    for x in (10.0, 15.0, 25.0, 30.0):
        thick, thin = rosenthal(x * MM)
        name = f"point source, x = {x} mm, y = 0"
        print(f"{name}: {point(x * MM, 0.0):.2f}, thick plate {thick:.2f}, thin plate {thin:.2f}")
