"""Orthotropic solids by their compliance [Jones1999], chapter 2: a ply off its axis, and a block with any axes.

Prints the numbers of the cases `lam-off-axis` and `orthotropic-*`, which docs/theory/mechanics.md explains.
"""

import math

import numpy as np

PLY = dict(e=[181e9, 10.3e9, 8e9], nu12=0.28, nu13=0.2, nu23=0.4, g12=7.17e9, g13=6e9, g23=3e9)


def off_axis(angle, e1=181e9, e2=10.3e9, nu12=0.28, g12=7.17e9):
    """E_x (Pa), contraction and shear angle over the strain along x, of a ply whose fibres run at an angle (degrees)."""
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    mixed = 1 / g12 - 2 * nu12 / e1
    xx = c**4 / e1 + mixed * c**2 * s**2 + s**4 / e2
    xy = (1 / e1 + 1 / e2 - 1 / g12) * c**2 * s**2 - nu12 / e1 * (c**4 + s**4)
    xs = (2 / e1 - mixed) * c**3 * s - (2 / e2 - mixed) * c * s**3
    return 1 / xx, -xy / xx, xs / xx


def turned(rotation):
    """Matrix of the rotation vector (rad), by Rodrigues' formula."""
    angle = np.linalg.norm(rotation)
    x, y, z = np.array(rotation) / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross


def strain(stress, rotation, ply=PLY):
    """Strain of a stress (Pa), both 3 x 3 in the axes of space."""
    r = turned(rotation)
    s = r.T @ np.array(stress) @ r
    e1, e2, e3 = ply["e"]
    s12, s13, s23 = -ply["nu12"] / e1, -ply["nu13"] / e1, -ply["nu23"] / e2
    normal = np.array([[1 / e1, s12, s13], [s12, 1 / e2, s23], [s13, s23, 1 / e3]]) @ np.diag(s)
    own = np.diag(normal)
    for (a, b), g in {(0, 1): ply["g12"], (0, 2): ply["g13"], (1, 2): ply["g23"]}.items():
        own[a, b] = own[b, a] = s[a, b] / (2 * g)
    return r @ own @ r.T


def values():
    """By name, SI units."""
    found = {}
    for angle in (10, 30, 45, 60):
        e, contraction, shear = off_axis(angle)
        # strains under 10 MPa; displacements over 6 mm, and half of the shear angle over 6 mm
        found |= {
            f"{angle} degrees: E_x": e,
            f"{angle} degrees: elongation": 1e7 / e * 6e-3,
            f"{angle} degrees: contraction": -contraction * 1e7 / e * 6e-3,
            f"{angle} degrees: shear": 0.5 * shear * 1e7 / e * 6e-3,
        }
    pulled = strain([[1e8, 0, 0], [0, 0, 0], [0, 0, 0]], [0.6, -0.4, 0.9])
    for a in range(3):
        for b in range(3):
            found[f"block under 100 MPa along x: strain {'xyz'[a]}{'xyz'[b]}"] = pulled[a][b]
    found["block: stress"] = 1e8
    return found


if __name__ == "__main__":
    for name, value in values().items():
        print(f"{name}: {value:.9e}")
