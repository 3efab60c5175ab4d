"""Closed forms, series and small integrations behind the reference values of verification cases.

The formulas are on `docs/theory/closed_forms.md`, in the same order; names begin with the name of the case.

    python3 closed_forms.py

Prints all numbers in SI units; temperatures in K.
"""

from math import acos, cos, exp, inf, pi, radians, sin, sqrt

import numpy as np
from scipy.integrate import quad
from scipy.optimize import brentq, minimize_scalar
from scipy.special import erf, erfc, iv, k0, kv, kvp

STEFAN_BOLTZMANN = 5.670374419e-8  # W/(m2 K4)
ABSOLUTE_ZERO = 273.15


def resistances() -> dict[str, float]:
    """Walls of layers in series."""
    steel, copper, contact = 0.05 / 45, 0.1 / 390, 1 / 2000
    section = 0.02
    laminate = 700 / (0.01 / 1 + 0.01 / 100)
    powder = 200 / (0.005 / 0.5 + 0.005 / 20)

    def balance(t: float) -> float:
        return 1 / 0.1 * (900 - t) - 20 * (t - 300) - 0.8 * STEFAN_BOLTZMANN * (t**4 - 300**4)

    cold = brentq(balance, 300, 900, xtol=1e-12)
    found = {
        "interface-heat-perfect: power, W": -section * 200 / (steel + copper),
        "interface-heat-steady: power, W": -section * 200 / (steel + copper + contact),
        "surface-steady-wall: flux, W/m2": 300 / (0.1 / 1 + 1 / 20),
        "surface-steady-radiation: face": cold,
        "surface-steady-radiation: power, W": -10 * (900 - cold),
    }
    for x in (0.00525, 0.00975):
        found[f"laminate at {x} m"] = 300 + laminate * x / 1
    for x in (0.01025, 0.015):
        found[f"laminate at {x} m"] = 1000 - laminate * (0.02 - x) / 100
    for x in (0.00225, 0.00475):
        found[f"powder-bar at {x} m"] = 500 - powder * x / 0.5
    found["powder-bar at 0.00725 m"] = 300 + powder * (0.01 - 0.00725) / 20
    return found


def uniform_bodies() -> dict[str, float]:
    """Bodies of one temperature that exchange heat with their surroundings."""
    capacity, conductance = 8000 * 500 * 1e-6, 4e-4 / (1 / 750 + 0.0025 / 40)
    time, power = capacity / conductance, 1000.0

    def heated(start: float, duration: float) -> float:
        end = 300 + power / conductance
        return end + (start - end) * exp(-duration / time)

    def wait(start: float, end: float) -> float:
        return time * np.log((start - 300) / (end - 300))

    second = 2 + wait(heated(300, 2), 450)
    third = second + 2 + wait(heated(450, 2), 400)
    last = heated(400, 2)

    def radiating(duration: float, steps: int = 100000) -> float:
        t, step = 1500.0, duration / steps
        factor = 0.8 * STEFAN_BOLTZMANN * 6 / (8000 * 500 * 0.01)

        def rate(t: float) -> float:
            return -factor * (t**4 - 300**4)

        for _ in range(steps):
            a = rate(t)
            b = rate(t + 0.5 * step * a)
            c = rate(t + 0.5 * step * b)
            d = rate(t + step * c)
            t += step * (a + 2 * b + 2 * c + d) / 6
        return t

    return {
        "surface-round-bar: above the air": 500 * exp(-100 * 2 * 60 / (8900 * 400 * 0.01)),
        "surface-radiating-cube after 100 s": radiating(100),
        "surface-radiating-cube after 200 s": radiating(200),
        "interpass-wait: start of the second pass, s": second,
        "interpass-wait: start of the third pass, s": third,
        "interpass-wait: temperature at 50 s": 300 + (last - 300) * exp(-(50 - third - 2) / time),
    }


def cells_in_gas(step: float = 0.01) -> dict[str, float]:
    """A face of a cell of carbon/epoxy in hot gas: natural convection, black radiation, both."""
    gas, start, density, depth = 593.0, 293.0, 1620.0, 2.5e-3

    def constant(_: float) -> float:
        return 877.756

    def by_temperature(t: float) -> float:
        return float(np.interp(t, [273, 348, 373, 573], [803.916, 1080.816, 1357.84, 1729.634]))

    def convection(t: float) -> float:
        return 1.52 * abs(gas - t) ** (1 / 3) * (gas - t)

    def radiation(t: float) -> float:
        return STEFAN_BOLTZMANN * (gas**4 - t**4)

    def both(t: float) -> float:
        return convection(t) + radiation(t)

    found = {}
    cells = {
        "convection": (convection, constant),
        "radiation": (radiation, constant),
        "both": (both, constant),
        "both, c by temperature": (both, by_temperature),
    }
    for name, (flux, capacity) in cells.items():

        def rate(t: float, flux=flux, capacity=capacity) -> float:
            return flux(t) / (density * capacity(t) * depth)

        t = start
        for i in range(round(500 / step)):
            k1 = rate(t)
            k2 = rate(t + step / 2 * k1)
            k3 = rate(t + step / 2 * k2)
            k4 = rate(t + step * k3)
            t += step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
            time = (i + 1) * step
            if any(abs(time - at) < step / 2 for at in (50, 100, 500)):
                found[f"gao-8.s3-cell-in-gas, {name}, {time:.0f} s"] = t
    return found


def half_space(depth: float, time: float, conductivity: float, capacity: float, coefficient: float) -> float:
    """Fraction of the difference to the surroundings that a half space under convection has lost."""
    diffusivity = conductivity / capacity
    reach, h = 2 * sqrt(diffusivity * time), coefficient / conductivity
    shift = exp(h * depth + h**2 * diffusivity * time)
    return erfc(depth / reach) - shift * erfc(depth / reach + h * sqrt(diffusivity * time))


def cooled_half_spaces() -> dict[str, float]:
    """Spray, and the dry part of an edge."""
    data = (30.0, 7800.0 * 600, 20000.0)
    found = {f"surface-spray-quench, surface at {t} s": 1123 - 830 * half_space(0, t, *data) for t in (0.5, 1, 1.5, 2)}
    found["surface-spray-quench, 3 mm at 2 s"] = 1123 - 830 * half_space(0.003, 2, *data)
    for t in (1, 2):
        lost = quad(lambda s: 20000 * 830 * (1 - half_space(0, s, *data)), 0, t, epsrel=1e-11)[0]
        found[f"surface-spray-quench, heat lost in {t} s, J/m2"] = lost
        found[f"surface-spray-quench, mean at {t} s less the start"] = -lost / (7800 * 600 * 0.05)
    film = half_space(0.5 * 0.2 / 225, 0.3, 200.0, 2600.0 * 1000, 200.0)
    found["quench-2.5-edge, lifted off, 0.3 s"] = 833.15 - (833.15 - 323.15) * film
    return found


def plates(terms: int = 200) -> dict[str, float]:
    """Slices of a slab of the half thickness L that are cast at one temperature."""
    half, conductivity, capacity = 0.04, 30.0, 7500.0 * 700
    diffusivity, biot = conductivity / capacity, 500 * half / conductivity
    roots = [brentq(lambda b: b * np.sin(b) - biot * np.cos(b), n * pi, n * pi + pi / 2) for n in range(terms)]
    found = {}
    for y in (0.7995, 0.6995, 0.4995, 0.2995, 0.1995):
        age, under_jet = 40 - (y - 0.1) / 0.02, 40 - (y - 0.06) / 0.02
        for x in (0.0005, 0.0205, 0.0395):
            excess = sum(
                2
                * np.sin(b)
                / (b + np.sin(b) * np.cos(b))
                * np.cos(b * x / half)
                * np.exp(-(b**2) * diffusivity * age / half**2)
                for b in roots
            )
            found[f"casting-slab at ({x}, {y})"] = 300 + 1500 * excess
            n = np.arange(1, terms + 1)
            series = (
                (-1.0) ** n / n**2 * np.exp(-diffusivity * (n * pi / half) ** 2 * under_jet) * np.cos(n * pi * x / half)
            )
            shape = (3 * x**2 - half**2) / (6 * half**2) - 2 / pi**2 * series.sum()
            drop = 1e6 * (under_jet / (capacity * half) + half / conductivity * shape)
            found[f"casting-jet at ({x}, {y})"] = 1800 - drop
    return found | fire_slab(terms)


def fire_slab(terms: int) -> dict[str, float]:
    """Insulated face of a slab whose length, properties and coefficient are 1, in degC."""
    roots = [brentq(lambda b: b * np.sin(b) - np.cos(b), n * pi, n * pi + pi / 2) for n in range(terms)]

    def insulated_face(time: float) -> float:
        parts = (2 * np.sin(b) / (b + np.sin(b) * np.cos(b)) * np.exp(-(b**2) * 1e-3 * time) for b in roots)
        return 1000 * float(sum(parts))

    return {f"fire-slab at {time} s, degC": insulated_face(time) for time in (60, 300, 600, 900, 1200, 1500, 1800)}


def growing_rod() -> dict[str, float]:
    """A rod that grows by hot material: flux at an inlet, Lindstrom et al. (1967)."""
    speed, time = 1e-3, 20.0
    diffusivity = 20 / 4e6
    root = 2 * sqrt(diffusivity * time)
    found = {}
    for place in (-0.02, -0.01, -0.005, 0.0, 0.005, 0.01, 0.015):
        x = speed * time - place
        part = (
            0.5 * erfc((x - speed * time) / root)
            + sqrt(speed**2 * time / (pi * diffusivity)) * exp(-(((x - speed * time) / root) ** 2))
            - 0.5
            * (1 + speed * x / diffusivity + speed**2 * time / diffusivity)
            * exp(speed * x / diffusivity)
            * erfc((x + speed * time) / root)
        )
        found[f"deposit-rod at {place} m"] = 300 + 700 * part
    return found


def square_plate(terms: int = 200) -> dict[str, float]:
    """A square of which one side is hot."""
    side = 0.02

    def temperature(x: float, y: float) -> float:
        n = np.arange(1, 2 * terms, 2) * pi
        # sinh(n y) / sinh(n) without overflow
        ratio = np.exp(n * (y / side - 1)) * (1 - np.exp(-2 * n * y / side)) / (1 - np.exp(-2 * n))
        return ABSOLUTE_ZERO + 100 * float(np.sum(4 / n * np.sin(n * x / side) * ratio))

    along = {f"quench-2.2-plate at (0.01, {y})": temperature(0.01, y) for y in (0.002, 0.005, 0.01, 0.015, 0.018)}
    return along | {
        f"quench-2.2-plate at ({x}, 0.01)": temperature(x, 0.01) for x in (0.001, 0.002, 0.005, 0.015, 0.018)
    }


def moving_sources() -> dict[str, float]:
    """Rosenthal (1946), and Gaussian sources."""
    conductivity, capacity, speed, start = 40.0, 4e6, 0.008, 293.15
    diffusivity = conductivity / capacity
    hot, cold = 1073.15, 773.15
    thick, thin, sheet = 2000.0, 1500.0, 0.004

    def behind_on_plate(distance: float) -> float:
        images = np.sqrt(distance**2 + (2 * 0.01 * np.arange(-400, 401)) ** 2)
        parts = np.exp(-speed * (images - distance) / (2 * diffusivity)) / images
        return start + thick / (2 * pi * conductivity) * float(parts.sum())

    places = [brentq(lambda r, t=t: behind_on_plate(r) - t, 1e-4, 0.1, xtol=1e-13) for t in (hot, cold)]
    slope = (behind_on_plate(places[0] + 1e-7) - behind_on_plate(places[0] - 1e-7)) / 2e-7

    def beside(x: float) -> float:
        number = speed / (2 * diffusivity)
        return thin / (2 * pi * conductivity * sheet) * np.exp(-number * x) * k0(number * np.hypot(x, 0.0065))

    def gaussian(x: float, y: float) -> float:
        """Rise of the face under a Gaussian of 1.5 mm that is uniform to 2 mm; x from the centre along the motion."""
        return quad(lambda s: gaussian_kernel(s, x, y), 1e-9, 3, epsrel=1e-9, limit=400)[0]

    def gaussian_kernel(root: float, x: float, y: float) -> float:
        time = root**2
        wide = 0.0015**2 + 2 * diffusivity * time
        depth = erf(0.002 / (2 * sqrt(diffusivity) * root)) / 0.002
        footprint = np.exp(-((x + speed * time) ** 2 + y**2) / (2 * wide)) / (2 * pi * wide)
        return 2 * root * thick / capacity * footprint * depth

    def half_width(x: float) -> float:
        if start + gaussian(x, 0) < hot:
            return 0.0
        return brentq(lambda y: start + gaussian(x, y) - hot, 0, 0.01, xtol=1e-9)

    width = -minimize_scalar(lambda x: -2 * half_width(x), bounds=(-0.004, 0.0), options={"xatol": 1e-8}).fun

    def trail(x: float, y: float) -> float:
        wide = 0.05**2 + 0.025**2 / 12

        def passed(time: float) -> float:
            spread = wide + 2 * 1e-6 * time
            place = x - 0.1 * time - 0.2
            return np.exp(-(place**2 + (y - 0.5) ** 2) / (2 * spread)) / (2 * pi * spread)

        return 300 + 10 / 1000 * quad(passed, 0, 3, epsrel=1e-10)[0]

    return {
        "cooling-time-thick-plate: t8/5, s": thick
        / (2 * pi * conductivity * speed)
        * (1 / (cold - start) - 1 / (hot - start)),
        "cooling-time-thick-plate: rate at 800 °C, K/s": 2 * pi * conductivity * speed * (hot - start) ** 2 / thick,
        "cooling-time-thick-plate: largest width above 800 °C, m": width,
        "cooling-time-plate: t8/5, s": (places[1] - places[0]) / speed,
        "cooling-time-plate: rate at 800 °C, K/s": -slope * speed,
        "cooling-time-thin-plate: t8/5, s": (thin / speed) ** 2
        / (4 * pi * conductivity * capacity * sheet**2)
        * (1 / (cold - start) ** 2 - 1 / (hot - start) ** 2),
        "cooling-time-thin-plate: highest at 6.5 mm": start + max(beside(x) for x in np.linspace(-0.05, 0.005, 55001)),
        "source-on-moving-points at 0.3625 m": trail(0.3625, 0.5125),
        "source-on-moving-points at 0.2125 m": trail(0.2125, 0.5125),
        "source-on-moving-points at 0.1875 m": trail(0.1875, 0.5125),
    }


def moving_cylinder(peclet: float, terms: int = 60, angles: int = 20000) -> float:
    """Heat per length over k (T_b - T_0) of a cylinder at T_b that moves; `peclet` is v a / (2 alpha)."""
    theta = 2 * pi * np.arange(angles) / angles
    phi, slope = np.zeros(angles), np.zeros(angles)
    for n in range(terms):
        part = (1 if n == 0 else 2) * iv(n, peclet) * np.cos(n * theta)
        phi += part
        slope += part * peclet * kvp(n, peclet) / kv(n, peclet)
    gradient = np.exp(-peclet * np.cos(theta)) * (slope - peclet * np.cos(theta) * phi)
    return float(-2 * pi * gradient.mean())


def keyholes() -> dict[str, float]:
    """Cylinders at the boiling temperature."""
    fit = 2.1995 + 6.2962 - 0.4994 + 0.0461
    factor = moving_cylinder(1)
    return {
        "keyhole-moving-cylinder: factor": factor,
        "keyhole-moving-cylinder: factor, Lankalapalli's polynomial": fit,
        "keyhole-moving-cylinder: power of half, W": factor * 30 * 2700 * 2.5e-5 / 2,
    }


def welded_joint() -> dict[str, float]:
    """Part of a double ellipsoid that lies within half of a plate of 9 mm: `butt_weld`."""

    def within(distance: float, radius: float) -> float:
        return erf(sqrt(3) * distance / radius)

    depth = np.mean([within(0.009 - below, 0.003) for below in (0.006, 0.003, 0.0)])
    front, rear = 0.003, 0.006
    in_front = 2 * front / (front + rear) / 2

    def along(x: float) -> float:
        return in_front * within(0.06 - x, front) + (1 - in_front) * within(x, rear)

    length = quad(along, 0.006, 0.054)[0] / 0.048
    return {"butt_weld: part of the energy": 0.5 * float(depth) * length}


def bars() -> dict[str, float]:
    """Bars and strips."""
    modulus, strength, expansion = 200e9, 200e6, 1.2e-5
    strain = strength / modulus
    # a layer of 2 mm that shrinks by 200 K on 4 mm
    shrinkage, height, ratio = 200 * expansion, 0.006, 0.5
    curvature = (
        6 * shrinkage * (1 + ratio) ** 2 / (height * (3 * (1 + ratio) ** 2 + (1 + ratio) * (ratio**2 + 1 / ratio)))
    )
    mean = -shrinkage * 0.002 / height

    def on_strip(y: float) -> float:
        return modulus * (mean - curvature * (y - 0.003) + (shrinkage if y > 0.004 else 0.0))

    def elongation(celsius: float) -> float:
        return 1.2e-5 * celsius + 0.4e-8 * celsius**2 - 2.416e-4

    flag = 1.4e6 / (1 - 0.4**2) * 0.02**3 / 12
    return {
        "clamped-bar: stress, Pa": modulus * expansion * 130 - strength,
        "three-bar-residual-stress: middle, Pa": 2 / 3 * modulus * expansion * 190 - strength,
        "plastic-heat-bar: first rise": 0.9 * strength * (0.02 - strain) / (7850 * 500),
        "plastic-heat-bar: both": 0.9 * strength * (0.04 - 3 * strain) / (7850 * 500),
        "deposit-hot-layer: deflection, m": curvature * 0.015**2 / 2,
        "deposit-hot-layer: beam, Pa": on_strip(0.00225),
        "deposit-hot-layer: layer, Pa": on_strip(0.00525),
        "cut-bar: deflection, m": 2e-3 / 0.004 * 0.02**2 / 2,
        "cut-bar: stress before, Pa": modulus * 2e-3 * 0.00175 / 0.004,
        "elastic-flag: deflection, m": 1000 * 0.01 * 0.02 * 0.35**4 / (8 * flag),
        "expansion-preheated: elongation, m": 0.009 * (elongation(599.85) - elongation(199.85)),
        "slotted-bar-limit: force, N": 2 / sqrt(3) * 250e6 * 0.005,
        "strong-coupling-bar: temperature": -0.003 / 2,
    }


def satoh(start: float, plasticity: float, step: float = 1e-3) -> dict[float, float]:
    """Stress (Pa) every 50 K of a bar that is held at its ends and cooled from 1100 K; explicit in the temperature."""
    modulus = 180e9
    stress, plastic, previous, grown = 0.0, 0.0, 0.0, 0.0
    found = {}
    for number in range(1, round(800 / step) + 1):
        t = 1100 - number * step
        left = exp(-0.011 * (start - t)) if t < start else 1.0
        formed = 1 - left
        change = formed * (2 - formed) - grown
        plastic += plasticity * stress * change
        grown += change
        free = left * 2.3e-5 * (t - 1100) + formed * (1.4e-5 * (t - 1100)) + 0.002 * formed - previous
        stress = modulus * -(free + plastic)
        limit = left * (40e6 + 260e6 * (1100 - t) / 800) + formed * 900e6
        if abs(stress) > limit:
            excess = abs(stress) - limit
            plastic += excess / modulus * (1 if stress > 0 else -1)
            stress = limit * (1 if stress > 0 else -1)
        if number % round(50 / step) == 0:
            found[t] = stress
    return found


def fluids() -> dict[str, float]:
    """Layers, drag and added mass."""
    load, height, thin, thick = 500.0, 0.01, 0.5, 1.5
    # shear stress and velocity at the interface; the thick fluid lies below
    stress = load * height / 2 * (thick - thin) / (thick + thin)
    interface = (stress * height + load * height**2 / 2) / thick
    mass = 1000 * pi * 0.05**2 * (9 + 1) / (9 - 1)
    return {
        "interface-two-layers: thin fluid, m/s": interface + (stress * height / 2 - load * height**2 / 6) / thin,
        "interface-two-layers: thick fluid, m/s": (stress * height / 2 + load * height**2 / 3) / thick,
        "interface-drag-array: velocity, m/s": 1000 * 1 * 0.01**2 / 51.53 / (1 - 0.2),
        "interface-added-mass: mean force, N": 2 / pi * mass * (4 * pi) ** 2 * 1e-4,
        "interface-oil-on-water: pressure, Pa": 9.8 * (800 * 0.05 + 1000 * 0.04875),
        "interface-ale-sheared-layer: friction, N": -0.01 * 0.002 / 0.08 * 0.2,
        "heated-cylinder-re20: power, W": 2.4653 * 8.571428 * 10 * pi / 2,
        "heated-cylinder-re40: power, W": 3.2825 * 4.285714 * 10 * pi / 2,
        "gao-7.3-gate: pressure at 20 mm, Pa": 9.8 * 1000 * (0.106 - 0.02),
        "rigid-spring: velocity, m/s": 0.05 * pi * -sin(0.2 * pi),
    }


def drop_on_wall(angle: float, radius: float, layer: float, dimension: int, cylinder: float = inf) -> tuple[float, float]:
    """Content and height of the centroid of a drop whose arc has this radius, and whose fraction changes over a layer.

    Above a plane wall, or above the axis of a cylinder of the radius `cylinder` on whose top the drop lies.
    """
    curved = cylinder < inf
    centre = -radius * cos(angle)
    if curved:
        centre = sqrt(cylinder**2 + radius**2 - 2 * cylinder * radius * cos(angle))
    nearest = abs(cylinder - centre) if curved else max(0.0, -centre)
    start = 0.0 if curved and centre > cylinder else nearest
    end, parts = radius + 40 * layer, 4000
    step = (end - start) / parts
    content = moment = 0.0
    for part in range(parts):
        r = start + (part + 0.5) * step
        fraction = 1 / (1 + exp((r - radius) / layer))
        edge = (cylinder**2 - centre**2 - r**2) / (2 * centre * r) if curved else -centre / r
        half = acos(max(-1.0, min(1.0, edge)))
        if dimension == 2:
            area, lever = 2 * half * r, 2 * r * (centre * half + r * sin(half))
        else:
            area = 2 * pi * r**2 * (1 - cos(half))
            lever = centre * area + pi * r**3 * sin(half) ** 2
        content += fraction * area * step
        moment += fraction * lever * step
    return content, moment / content


def wetting() -> dict[str, float]:
    """Drops that wet a wall, with the content of half a circle of the radius 1 or half a sphere of 1.2."""
    found = {}
    for name, dimension, start, layer, angles in (
        ("two-fluids-wetting", 2, 1.0, 0.75 * 0.05, (30, 60, 90, 120)),
        ("two-fluids-wetting", 2, 1.0, 0.75 * 0.035, (150,)),
        ("two-fluids-wetting-sphere", 3, 1.2, 0.75 * 0.1, (60, 120)),
    ):
        content, _ = drop_on_wall(pi / 2, start, layer, dimension)
        for degrees in angles:
            angle = radians(degrees)
            radius = brentq(lambda r, a=angle: drop_on_wall(a, r, layer, dimension)[0] - content, 0.3, 20)
            found[f"{name}-{degrees}: height of the centre, m"] = drop_on_wall(angle, radius, layer, dimension)[1]
    layer, cylinder = 0.75 * 0.05, 1.5
    content, _ = drop_on_wall(pi / 2, 0.89, layer, 2, cylinder)
    for degrees in (60, 120):
        angle = radians(degrees)
        radius = brentq(lambda r, a=angle: drop_on_wall(a, r, layer, 2, cylinder)[0] - content, 0.3, 3)
        _, height = drop_on_wall(angle, radius, layer, 2, cylinder)
        found[f"two-fluids-wetting-cylinder-{degrees}: height of the centre, m"] = height
    return found


def saturation(temperature: float) -> float:
    """Saturation pressure (Pa) of the steel of the cases: boils at 3090 K, 7.41 MJ/kg, 54.7 g/mol."""
    return 101325 * exp(7.41e6 * 0.0547 / 8.314462618 * (1 / 3090 - 1 / temperature))


def evaporation(temperature: float) -> float:
    """Heat that evaporation takes, W/m2."""
    return 0.82 * saturation(temperature) * sqrt(0.0547 / (2 * pi * 8.314462618 * temperature)) * 7.41e6


def metal_and_gas() -> dict[str, float]:
    """A flat surface of 1 GW/m2 over 60 um of metal whose bottom has 2000 K, and a surface under a recoil that changes along it."""

    def conducted(temperature: float) -> float:
        return 30 * (temperature - 2000) / 60e-6

    surface = brentq(lambda t: evaporation(t) + conducted(t) - 1e9, 2000, 5000)
    columns = [(i + 0.5) * 1e-3 / 32 for i in range(32)]
    depth = [0.54 * saturation(1800 + 2e5 * x) / (7920 * 9.81) for x in columns]
    heights = [0.5 + (sum(depth) / 32 - d) / 7.5e-4 for d in depth]
    return {
        "metal-and-gas-evaporation: temperature of the surface, K": surface,
        "metal-and-gas-evaporation: power of evaporation, W": evaporation(surface) * 8e-6 * 2e-6,
        "metal-and-gas-evaporation: power through the bottom, W": -conducted(surface) * 8e-6 * 2e-6,
        "metal-and-gas-recoil: height at the cold side over that of the box": heights[0],
        "metal-and-gas-recoil: height at the hot side over that of the box": heights[-1],
        "metal-and-gas-recoil: difference of both": heights[0] - heights[-1],
    }


def values() -> dict[str, float]:
    """All numbers by name."""
    found: dict[str, float] = {}
    parts = (resistances, uniform_bodies, cells_in_gas, cooled_half_spaces, plates, growing_rod, square_plate, moving_sources, keyholes)
    for part in (*parts, welded_joint, bars, fluids, wetting, metal_and_gas):
        found |= part()
    for name, start, plasticity in (
        ("satoh-austenite", 290.0, 0.0),
        ("satoh-martensite", 673.0, 0.0),
        ("satoh-transformation-plasticity", 673.0, 1e-10),
    ):
        found |= {f"{name} at {t:.0f} K, Pa": stress for t, stress in satoh(start, plasticity).items()}
    return found


if __name__ == "__main__":
    for name, value in values().items():
        print(f"{name}: {value:.9g}")
