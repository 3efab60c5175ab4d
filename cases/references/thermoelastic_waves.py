"""Plane thermoelastic waves in a steel plate, and constants that belong to them.

Reference of the cases `gao-3.5.2-*` (Gao (2020), section 3.5.2) and of the checks at 7 us of
`gao-3.6.2a-cracked-plate` (section 3.6.2), and of `gao-4.3.3.1-lamina-waves` (section 4.3.3.1). Until waves from the free edges arrive, the axis of the plate is in uniaxial
strain, and conduction is negligible in microseconds: the pressure P(t) on the left edge travels with the adiabatic
speed c = sqrt(M (1 + eps) / rho), M = E / (1 - nu^2),

    T = T0 beta / (rho c_v M (1 + eps)) P(tau),   u = integral of P from 0 to tau / (rho c),   tau = t - x / c.

    python3 thermoelastic_waves.py

Bond-based plates have a Poisson's ratio of 1/3; a bar has free sides, M = E and beta = E alpha.

Prints temperatures (K) and displacements (m) at distances from the loaded edge, the coupling coefficient and critical
stretches of the fracture cases.
"""

from math import cos, pi, sin, sqrt

YOUNGS_MODULUS, POISSONS_RATIO, EXPANSION = 200e9, 0.17, 11.5e-6  # Pa, 1, 1/K
DENSITY, SPECIFIC_HEAT, TEMPERATURE = 7870.0, 472.0, 285.0  # kg/m3, J/(kg K), K


def constants(stiffness: float, thermal_modulus: float) -> tuple[float, float, float]:
    """Coupling coefficient, adiabatic wave speed (m/s) and temperature change by pressure (K/Pa)."""
    coupling = thermal_modulus**2 * TEMPERATURE / (DENSITY * SPECIFIC_HEAT * stiffness)
    heating = TEMPERATURE * thermal_modulus / (DENSITY * SPECIFIC_HEAT * stiffness * (1 + coupling))
    return coupling, sqrt(stiffness * (1 + coupling) / DENSITY), heating


def plate(ratio: float) -> tuple[float, float, float]:
    """The constants in plane stress without strain along the edge, for Poisson's ratio."""
    return constants(YOUNGS_MODULUS / (1 - ratio**2), YOUNGS_MODULUS * EXPANSION / (1 - ratio))


PLATE = plate(POISSONS_RATIO)
COUPLING, SPEED, HEATING = PLATE
BOND_BASED = plate(1 / 3)
BAR = constants(YOUNGS_MODULUS, YOUNGS_MODULUS * EXPANSION)

# plies of graphite/epoxy, strained along and across their fibres: Gao (2020), section 4.3.3
PLY_DENSITY, PLY_SPECIFIC_HEAT = 1620.0, 1092.728  # kg/m3, J/(kg K)


def ply(axis: int) -> tuple[float, float, float]:
    """The constants of a ply strained along one axis: along its fibres (0) or across them (1)."""
    along, across, ratio, expansion = 181e9, 10.3e9, 0.28, (0.02e-6, 22.5e-6)
    whole = 1 - ratio**2 * across / along
    stiffness = (along / whole, across / whole)
    coupled = ratio * stiffness[1]
    modulus = stiffness[axis] * expansion[axis] + coupled * expansion[1 - axis]
    capacity = PLY_DENSITY * PLY_SPECIFIC_HEAT
    coupling = modulus**2 * TEMPERATURE / (capacity * stiffness[axis])
    heating = TEMPERATURE * modulus / (capacity * stiffness[axis] * (1 + coupling))
    return coupling, sqrt(stiffness[axis] * (1 + coupling) / PLY_DENSITY), heating


# loads: pressure (Pa) and its integral over time (Pa s)
LOADS = {
    "parabolic": (lambda t: -1e20 * t**2, lambda t: -1e20 * t**3 / 3),
    "sine": (lambda t: 1e9 * sin(pi / 2 * 1e6 * t), lambda t: 1e9 * (1 - cos(pi / 2 * 1e6 * t)) / (pi / 2 * 1e6)),
    "fast sine": (lambda t: 1e10 * sin(pi * 1e6 * t), lambda t: 1e10 * (1 - cos(pi * 1e6 * t)) / (pi * 1e6)),
    "linear": (lambda t: -1e14 * t, lambda t: -1e14 * t**2 / 2),
}


def wave(
    load: str, distance: float, time: float, body: tuple[float, float, float] = PLATE, density: float = DENSITY
) -> tuple[float, float]:
    """Temperature change (K) and displacement (m) at a distance from the loaded edge (m)."""
    _, speed, heating = body
    pressure, integral = LOADS[load]
    delay = max(time - distance / speed, 0.0)
    return heating * pressure(delay), integral(delay) / (density * speed)


def critical_stretch(youngs_modulus: float, ratio: float, energy: float, horizon: float) -> float:
    """Of an ordinary state-based solid under plane stress: Gao (2020), eq. 2.13."""
    shear = youngs_modulus / (2 * (1 + ratio))
    bulk = youngs_modulus / (2 * (1 - ratio))
    return sqrt(energy / ((6 * shear / pi + 16 / (9 * pi**2) * (bulk - 2 * shear)) * horizon))


def values() -> dict[str, float]:
    """All numbers by name."""
    found = {
        "coupling coefficient": COUPLING,
        "wave speed, m/s": SPEED,
        "heating, K/Pa": HEATING,
        "amplitude of the sine, K": HEATING * 1e9,
        "largest displacement of the sine, m": 2e9 / (pi / 2 * 1e6) / (DENSITY * SPEED),
        "temperature change of uniaxial stress of 0.8 GPa, K": -TEMPERATURE
        * EXPANSION
        * 8e8
        / (DENSITY * SPECIFIC_HEAT),
        "critical stretch, steel, horizon 3.015 x 0.2 mm": critical_stretch(200e9, 0.17, 42320, 3.015 * 0.2e-3),
        "critical stretch, maraging steel, 3.015 x 0.5 mm": critical_stretch(190e9, 0.3, 2.213e4, 3.015 * 0.5e-3),
        "critical stretch, rubber with 90.71 J/m2, 3.015 x 0.5 mm": critical_stretch(
            2.9e6, 0.45, 90.71, 3.015 * 0.5e-3
        ),
    }
    for distance in range(0, 40, 5):
        found[f"parabolic at {distance} mm, 8 us: T, K"], found[f"parabolic at {distance} mm, 8 us: u, m"] = wave(
            "parabolic", 1e-3 * distance, 8e-6
        )
    for name, body in (("bond-based", BOND_BASED), ("bar", BAR)):
        for distance in range(5, 35, 5):
            temperature, displacement = wave("parabolic", 1e-3 * distance, 8e-6, body)
            found[f"{name}, parabolic at {distance} mm, 8 us: T, K"] = temperature
            found[f"{name}, parabolic at {distance} mm, 8 us: u, m"] = displacement
    for quarter in range(1, 9):
        # crests and zeros of the sine behind the front, m
        distance = quarter * SPEED * 1e-6
        name = f"sine at {1e3 * distance:.4f} mm, 8 us"
        found[f"{name}: T, K"], found[f"{name}: u, m"] = wave("sine", distance, 8e-6)
    for distance in (5, 10, 15, 20, 30, 40):
        for name, load, axis, time in (("along", "fast sine", 0, 4e-6), ("across", "linear", 1, 8e-6)):
            temperature, displacement = wave(load, 1e-3 * distance, time, ply(axis), PLY_DENSITY)
            found[f"ply {name} fibres, {load} at {distance} mm: T, K"] = temperature
            found[f"ply {name} fibres, {load} at {distance} mm: u, m"] = displacement
    found["linear at 10 mm, 7 us: T, K"], found["linear at 10 mm, 7 us: u, m"] = wave("linear", 0.01, 7e-6)
    return found


if __name__ == "__main__":
    for name, value in values().items():
        print(f"{name}: {value:.6g}")
