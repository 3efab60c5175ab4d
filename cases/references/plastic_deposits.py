"""Residual stress of metal that is deposited or heated, by finite elements.

    python3 plastic_deposits.py [ramp|layers|columns|hot_layers|hot_spot|wall|weld] [element size in mm]

E = 200 GPa, nu = 0.3, yield stress 350 MPa, hardening modulus 1 GPa. Plane strain but for `wall` and `weld`. Half of a
base of 40 x 8 mm below a strip of 12 x 8 mm; the planes x = 0 and y = 0 are planes of symmetry. The strip shrinks by
1.5 % along all three axes:

- `ramp`: as a whole, in 15 steps;
- `layers`, `columns`: in layers of 1 mm, or in blocks of 2 x 1 mm whose order along x alternates from layer to layer.
  Each is born without stress on the deformed body and shrinks in 3 steps;
- `hot_layers`: layers of 1 mm are born every 6 s at the temperature of `layer_temperature`, without stress until they
  cool below 1300 K, and contract by the thermal expansion 1.4e-5/K, which ends at 1300 K, as does plastic strain;
- `hot_spot`: a free strip of 24 x 10 mm, of which one half is computed, under the temperature of `spot_temperature`, of
  the same metal;
- `wall`: half of a plate of 16 x 12 x 4 mm, held below up to x = 2 mm, with a wall of 12 x 4 x 6 mm in layers of 1 mm
  that shrink by 1.5 % in 2 steps each. Elements are twice as long along x;
- `weld`: a quarter of a sheet of 60 x 80 mm in plane stress under the temperature of `weld_temperature`, of the metal
  of `hot_layers`.

Squares or bricks with the mean dilatation of each element ([Hughes1980]; not in plane stress), radial return with its
consistent tangent, Newton's method. `hot_layers`, `hot_spot` and `weld` take the time steps of the case files: what metal
that cools has yielded depends on them to first order. Prints the hydrostatic stress and one component in MPa as means over boxes of 1 mm:
from below in the second column from the plane of symmetry, in the first, third and sixth for `hot_spot`, in the one in
the middle for `wall`; across the middle of the `weld`; and the displacements along the upper row of the base. Elements of 0.5 mm take
seconds, for `wall` and `weld` some minutes. Needs NumPy and SciPy.
"""

import sys
from collections.abc import Callable
from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_matrix
from scipy.sparse.linalg import splu

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

E, POISSONS_RATIO, YIELD, HARDENING = 200e9, 0.3, 350e6, 1e9  # Pa
SHEAR, BULK = E / 2 / (1 + POISSONS_RATIO), E / 3 / (1 - 2 * POISSONS_RATIO)
MM, BASE, SHRINKAGE = 1e-3, 8e-3, -0.015
SOFTEST, EXPANSION, COLD, INTERVAL = 1300.0, 1.4e-5, 293.0, 6.0  # K, 1/K, K, s
# strains xx, yy, zz, xy, yz, zx as components of the tensor: the trace, the deviator, how often products count each
NORMAL = np.array([1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
DEVIATOR = np.eye(6) - np.outer(NORMAL, NORMAL) / 3
COUNT = np.array([1.0, 1.0, 1.0, 2.0, 2.0, 2.0])
# places of the derivatives of two components in the strains
SHEARS = ((3, 0, 1), (4, 1, 2), (5, 2, 0))


class Body:
    """Squares or bricks of sides `h` where `solid` is true, and the state of the metal at their Gauss points."""

    def __init__(self, solid: Mask, h: float | Array) -> None:
        dimension = solid.ndim
        sides = np.full(dimension, h)
        corners = np.array(list(product((-1, 1), repeat=dimension)))
        elements = np.argwhere(solid)
        places, nodes = np.unique(
            (elements[:, None] + (corners + 1) // 2).reshape(-1, dimension), axis=0, return_inverse=True
        )
        self.nodes = nodes.reshape(len(elements), -1)
        self.position = places * sides
        self.center = (elements + 0.5) * sides
        self.weight = sides.prod() / len(corners)
        self.fixed = np.zeros(places.shape, bool)
        at = corners / np.sqrt(3.0)
        self.strain_of = with_mean_dilatation(strains(corners, at, sides))
        self.points = (self.center[:, None] + at * sides / 2).reshape(-1, dimension)
        self.freedoms = (dimension * self.nodes[:, :, None] + np.arange(dimension)).reshape(len(elements), -1)
        gauss = (len(elements), len(corners))
        self.displacement = np.zeros(places.size)
        self.born = np.ones(len(elements), bool)
        self.birth_strain = np.zeros((*gauss, 6))
        self.plastic = np.zeros((*gauss, 6))
        self.equivalent = np.zeros(gauss)
        self.yield_stress = np.full(gauss, YIELD)
        self.stress = np.zeros((*gauss, 6))

    def strain(self, displacement: Array) -> Array:
        """Strains at the Gauss points."""
        return np.einsum("gak,ek->ega", self.strain_of, displacement[self.freedoms])

    def respond(self, displacement: Array, prescribed: Array) -> tuple[Array, Array, Array]:
        """Stress, increment of the equivalent plastic strain and tangent at the Gauss points."""
        return self.law(self.strain(displacement) - mean_dilatation(prescribed) - self.birth_strain - self.plastic)

    def law(self, elastic: Array) -> tuple[Array, Array, Array]:
        """Stress, increment of the equivalent plastic strain and tangent at strains that are elastic without it."""
        trial = 2 * SHEAR * elastic @ DEVIATOR
        size = np.maximum(np.sqrt((trial**2) @ COUNT), 1e-300)
        excess = np.sqrt(1.5) * size - self.yield_stress - HARDENING * self.equivalent
        flow = np.maximum(excess, 0) / (3 * SHEAR + HARDENING)
        direction = trial / size[..., None]
        left = 1 - np.sqrt(1.5) * 2 * SHEAR * flow / size
        stress = left[..., None] * trial + BULK * (elastic @ NORMAL)[..., None] * NORMAL
        second = np.where(flow > 0, 1 / (1 + HARDENING / 3 / SHEAR) - (1 - left), 0)
        tangent = BULK * np.outer(NORMAL, NORMAL) + 2 * SHEAR * left[..., None, None] * DEVIATOR
        tangent -= 2 * SHEAR * second[..., None, None] * direction[..., :, None] * (direction * COUNT)[..., None, :]
        return stress, flow, tangent

    def force(self, stress: Array) -> Array:
        """Forces of the nodes, N/m."""
        weight = self.weight * self.born
        local = np.einsum("gak,ega,a,e->ek", self.strain_of, stress, COUNT, weight, optimize=True)
        return np.bincount(self.freedoms.ravel(), local.ravel(), len(self.displacement))

    def stiffness(self, tangent: Array) -> csr_matrix:
        """Tangent of the forces."""
        weight = self.weight * self.born
        operators = (self.strain_of, COUNT, tangent, self.strain_of, weight)
        local = np.einsum("gak,a,egab,gbl,e->ekl", *operators, optimize=True)
        rows = np.repeat(self.freedoms, self.freedoms.shape[1], axis=1).ravel()
        columns = np.tile(self.freedoms, self.freedoms.shape[1]).ravel()
        size = len(self.displacement)
        return csr_matrix((local.ravel(), (rows, columns)), shape=(size, size))

    def held(self) -> Mask:
        """Components that are fixed, and those of nodes without metal."""
        used = np.zeros(len(self.position), bool)
        used[self.nodes[self.born]] = True
        return (self.fixed | ~used[:, None]).ravel()

    def step(self, prescribed: Array) -> None:
        """Balances the forces under a prescribed strain, and takes up the plastic strain."""
        free = np.flatnonzero(~self.held())
        u = self.displacement.copy()
        for iteration in range(200):
            stress, flow, tangent = self.respond(u, prescribed)
            residual = -self.force(stress)[free]
            size = np.linalg.norm(residual)
            if iteration == 0:
                enough = max(1e-7 * size, 1e-3)
            if size <= enough:
                break
            matrix = self.stiffness(tangent)[free][:, free].tocsc()
            change = splu(matrix).solve(residual)
            work = residual @ change
            for length in (1.0, 0.5, 0.25, 0.125, 0.0625):
                tried = u.copy()
                tried[free] += length * change
                left = -self.force(self.respond(tried, prescribed)[0])[free]
                if np.linalg.norm(left) < (1 - 1e-3 * length) * size or abs(left @ change) < 0.9 * abs(work):
                    break
            u = tried
        else:
            raise RuntimeError("no equilibrium was found")
        self.displacement, self.stress = u, stress
        deviator = stress @ DEVIATOR
        size = np.maximum(np.sqrt(deviator**2 @ COUNT), 1e-300)
        self.plastic += np.sqrt(1.5) * (flow / size)[..., None] * deviator
        self.equivalent += flow

    def give_birth(self, new: Mask, prescribed: Array) -> None:
        """Adds the elements `new` without stress. Their nodes move as the nearest ones that are known."""
        known = np.zeros(len(self.position), bool)
        known[self.nodes[self.born]] = True
        self.born |= new
        waiting = np.zeros(len(self.position), bool)
        waiting[self.nodes[new]] = True
        u = self.displacement.reshape(self.position.shape)
        old = np.flatnonzero(known)
        # of two nodes at one distance the one below is taken
        nearness = np.ones(self.position.shape[1])
        nearness[-1] = 1.01
        for node in np.flatnonzero(waiting & ~known):
            distance = np.abs(self.position[old] - self.position[node]) @ nearness
            u[node] = u[old[distance.argmin()]]
        u[self.fixed] = 0
        # unborn metal took part in the evaluations, but has no state of its own
        self.birth_strain[new] = (self.strain(self.displacement) - mean_dilatation(prescribed))[new]
        self.plastic[new], self.equivalent[new] = 0, 0

    def relieve(self, fresh: Mask, hot: Mask) -> None:
        """Frees metal that has not cooled since its birth of stress, and hot metal of its deviator and hardening."""
        deviator = self.stress @ DEVIATOR / (2 * SHEAR)
        volume = (self.stress @ NORMAL)[..., None] / (9 * BULK) * NORMAL
        self.birth_strain[fresh] += (deviator + self.plastic + volume)[fresh]
        self.plastic[fresh] = 0
        hot = hot & ~fresh
        self.plastic[hot] += deviator[hot]
        self.equivalent[fresh | hot] = 0


class Sheet(Body):
    """Squares in plane stress; their dilatation is free."""

    def __init__(self, solid: Mask, h: float) -> None:
        super().__init__(solid, h)
        corners = np.array(list(product((-1, 1), repeat=2)))
        self.strain_of = strains(corners, corners / np.sqrt(3.0), np.full(2, h))
        self.thickening = np.zeros(self.equivalent.shape)

    def respond(self, displacement: Array, prescribed: Array) -> tuple[Array, Array, Array]:
        """Stress, increment of the equivalent plastic strain and tangent without stress across the sheet."""
        elastic = self.strain(displacement) - prescribed - self.birth_strain - self.plastic
        for _ in range(50):
            elastic[..., 2] = self.thickening - prescribed[..., 2] - self.birth_strain[..., 2] - self.plastic[..., 2]
            stress, flow, tangent = self.law(elastic)
            if np.abs(stress[..., 2]).max() < 1.0:
                break
            self.thickening = self.thickening - stress[..., 2] / tangent[..., 2, 2]
        across = tangent[..., :, 2, None] * tangent[..., None, 2, :] / tangent[..., 2, 2, None, None]
        return stress, flow, tangent - across


def strains(corners: Array, at: Array, sides: Array) -> Array:
    """Strains at places in an element by the displacements of its nodes: places x components x (node, axis)."""
    dimension = len(sides)
    functions = (1 + at[:, None] * corners) / 2
    result = np.zeros((len(at), 6, len(corners), dimension))
    slope = np.empty((len(at), len(corners), dimension))
    for axis in range(dimension):
        others = np.delete(functions, axis, axis=2).prod(2)
        slope[:, :, axis] = corners[:, axis] / sides[axis] * others
        result[:, axis, :, axis] = slope[:, :, axis]
    for component, a, b in SHEARS:
        if max(a, b) < dimension:
            result[:, component, :, a] = slope[:, :, b] / 2
            result[:, component, :, b] = slope[:, :, a] / 2
    return result.reshape(len(at), 6, -1)


def with_mean_dilatation(local: Array) -> Array:
    """Strains at the Gauss points of an element with the mean of their dilatation."""
    dilatation = np.einsum("a,gak->k", NORMAL, local) / len(local)
    return DEVIATOR @ local + NORMAL[:, None] * dilatation / 3


def mean_dilatation(strain: Array) -> Array:
    """Strains with the mean dilatation of each element."""
    return strain @ DEVIATOR + (strain @ NORMAL).mean(1)[:, None, None] / 3 * NORMAL


def strip(h: float) -> Body:
    """The half of the strip on its base."""
    solid = np.zeros((round(20e-3 / h), round(16e-3 / h)), bool)
    solid[:, : round(BASE / h)] = True
    solid[: round(6e-3 / h)] = True
    body = Body(solid, h)
    body.fixed[:] = body.position == 0
    return body


def isotropic(strain: Array, body: Body) -> Array:
    """The same strain along all axes, at the Gauss points."""
    return strain.reshape(body.equivalent.shape)[..., None] * NORMAL


def ramp(h: float) -> Body:
    """The strip shrinks as a whole."""
    body = strip(h)
    shrinks = body.points[:, 1] > BASE
    for step in range(1, 16):
        body.step(isotropic(SHRINKAGE * step / 15 * shrinks, body))
    return body


def stages(body: Body, by_columns: bool) -> NDArray[np.int64]:
    """The stage in which each element is born; that of the base is 0."""
    layer = np.floor((body.center[:, 1] - BASE) / MM + 1e-9).astype(int)
    if not by_columns:
        return np.maximum(layer + 1, 0)
    column = np.floor(body.center[:, 0] / (2 * MM)).astype(int)
    return np.where(layer >= 0, 3 * layer + np.where(layer % 2 == 0, column, 2 - column) + 1, 0)


def cold(h: float, by_columns: bool) -> Body:
    """The strip is deposited in parts, which shrink one after the other."""
    body = strip(h)
    deposit(body, stages(body, by_columns), steps=3)
    return body


def deposit(body: Body, stage: NDArray[np.int64], steps: int) -> None:
    """Adds the elements of each stage, which shrink then."""
    at_points = np.repeat(stage, body.equivalent.shape[1])
    body.born = stage == 0
    for now in range(1, stage.max() + 1):
        before = SHRINKAGE * ((at_points > 0) & (at_points < now))
        body.give_birth(stage == now, isotropic(before, body))
        for part in range(1, steps + 1):
            body.step(isotropic(before + SHRINKAGE * part / steps * (at_points == now), body))


def wall(h: float) -> Body:
    """The wall on its plate."""
    sides = np.array([2 * h, h, h])
    cells = np.rint(np.array([16e-3, 6e-3, 10e-3]) / sides).astype(int)
    center = (np.stack(np.indices(cells), axis=-1) + 0.5) * sides
    x, y, z = np.moveaxis(center, -1, 0)
    body = Body((z < 4e-3) | ((x > 2e-3) & (x < 14e-3) & (y < 2e-3)), sides)
    below = (body.position[:, 2] == 0) & (body.position[:, 0] < 2.001e-3)
    body.fixed[:] = below[:, None]
    body.fixed[:, 1] |= body.position[:, 1] == 0
    layer = np.floor((body.center[:, 2] - 4e-3) / MM + 1e-9).astype(int)
    deposit(body, np.maximum(layer + 1, 0), steps=2)
    return body


def layer_temperature(x: Array, time: float) -> Array:
    """Temperature around the layers that were deposited until now."""
    rise = np.zeros(len(x))
    for layer in range(8):
        since = time - layer * INTERVAL
        if since < -1e-12:
            continue
        away = (x[:, 1] - (8.5 + layer) * MM) / (2 * MM)
        across = np.where(x[:, 1] < BASE, np.exp(-((x[:, 0] / (8 * MM)) ** 2)), 1)
        rise += 1607 * np.exp(-since / 2) * np.exp(-(away**2) / (1 + since)) * across
    return np.minimum(COLD + rise, 1900)


def spot_temperature(x: Array, time: float) -> Array:
    """Temperature around a spot on the plane of symmetry, 10 mm above the other one, that is heated for 1 s."""
    square = (x[:, 0] ** 2 + (x[:, 1] - 10 * MM) ** 2) / (3 * MM) ** 2
    since = max(time - 1, 0.0)
    return COLD + 1700 * min(time, 1) / (1 + 3 * since) * np.exp(-square / (1 + 3 * since) - since / 2)


def weld_temperature(x: Array, time: float) -> Array:
    """Temperature around a weld of 60 mm on the plane of symmetry that is heated for 1 s."""
    since = max(time - 1, 0.0)
    beyond = np.maximum(x[:, 1] - 30 * MM, 0)
    square = (x[:, 0] ** 2 + beyond**2) / (4 * MM) ** 2
    return COLD + 1700 * min(time, 1) / np.sqrt(1 + 3 * since) * np.exp(-square / (1 + 3 * since) - since / 20)


class Heated:
    """A body under a temperature in time."""

    def __init__(self, body: Body, temperature: Callable[[Array, float], Array]) -> None:
        self.body, self.temperature = body, temperature
        self.fresh = np.zeros(body.equivalent.shape, bool)
        # thermal strain at the temperature at which points are without stress
        self.reference = np.zeros(len(body.points))

    def prescribed(self, time: float) -> Array:
        """Thermal strain, which ends where the metal is soft."""
        limited = np.minimum(self.temperature(self.body.points, time), SOFTEST)
        return isotropic(EXPANSION * (limited - COLD) - self.reference, self.body)

    def deposit(self, new: Mask, time: float) -> None:
        """Adds elements without stress."""
        self.reference[np.repeat(new, self.body.equivalent.shape[1])] = EXPANSION * (SOFTEST - COLD)
        self.body.give_birth(new, self.prescribed(time))
        self.fresh[new] = True

    def step(self, time: float) -> None:
        """Balances the forces at a time."""
        body = self.body
        temperature = self.temperature(body.points, time).reshape(body.equivalent.shape)
        body.yield_stress = np.interp(
            temperature, [293, 600, 900, 1200, 1300, 3000], [350e6, 300e6, 200e6, 50e6, 15e6, 10e6]
        )
        body.step(self.prescribed(time))
        hot = temperature >= SOFTEST
        self.fresh &= hot
        born = body.born[:, None]
        body.relieve(self.fresh & born, hot & born)


def times(*stages: tuple[float, float]) -> Array:
    """Ends of steps, s, by stages with an end and a step each."""
    ends = [0.0]
    for end, step in stages:
        ends += [*np.linspace(ends[-1], end, round((end - ends[-1]) / step) + 1)[1:]]
    return np.array(ends[1:])


def hot_layers(h: float) -> Body:
    """The strip is deposited in hot layers and cools."""
    body = strip(h)
    stage = stages(body, by_columns=False)
    body.born = stage == 0
    heated = Heated(body, layer_temperature)
    for now in range(1, stage.max() + 1):
        start = (now - 1) * INTERVAL
        heated.deposit(stage == now, start)
        for after in (0.0, *times((INTERVAL, 0.25))):
            heated.step(start + after)
    for after in times((24, 1), (74, 10)):
        heated.step(start + INTERVAL + after)
    return body


def hot_spot(h: float) -> Body:
    """A spot is heated and cools."""
    body = Body(np.ones((round(12e-3 / h), round(10e-3 / h)), bool), h)
    body.fixed[:, 0] = body.position[:, 0] == 0
    body.fixed[(body.position == 0).all(1)] = True
    heated = Heated(body, spot_temperature)
    for time in times((2, 0.05), (6, 0.25), (21, 1)):
        heated.step(time)
    return body


def weld(h: float) -> Body:
    """The sheet is welded along its middle, and cools."""
    sheet = Sheet(np.ones((round(30e-3 / h), round(40e-3 / h)), bool), h)
    sheet.fixed[:] = sheet.position == 0
    heated = Heated(sheet, weld_temperature)
    for time in times((1, 0.1), (5, 0.05), (21, 0.5), (101, 4), (201, 20)):
        heated.step(time)
    return sheet


class Job(NamedTuple):
    """A computation, and what is printed: the stress along `stress`, by boxes along `line` at places of the others, and the
    displacement of the boxes along x at height `row`."""

    compute: Callable[[float], Body]
    places: tuple[tuple[int, ...], ...]
    line: int
    stress: int
    row: int


def rows(body: Body, job: Job, place: tuple[int, ...]) -> tuple[Array, Array]:
    """Hydrostatic stress and stress along an axis in boxes of 1 mm at a place, MPa."""
    box = np.floor(body.center / MM + 1e-9).astype(int)
    mean = body.stress.mean(1) / 1e6
    inside = (np.delete(box, job.line, axis=1) == place).all(1)
    along = box[:, job.line]
    boxes = [inside & (along == number) for number in range(along[inside].max() + 1)]
    pressure, stress = (
        np.array([value[i].mean() for i in boxes]) for value in (mean @ NORMAL / 3, mean[:, job.stress])
    )
    return pressure, stress


def displacement(body: Body, job: Job) -> Array:
    """Mean displacements of boxes of 1 mm along x, um."""
    box = np.floor(body.center / MM + 1e-9).astype(int)
    inside = (box[:, -1] == job.row) & (box[:, 1:-1] == 0).all(1)
    moved = body.displacement.reshape(body.position.shape)[body.nodes].mean(1) * 1e6
    return np.array([moved[inside & (box[:, 0] == x)].mean(0) for x in np.unique(box[inside, 0])])


def alternation(body: Body) -> float:
    """A quarter of the second difference of the hydrostatic stress from box to box of 1 mm, root of the mean square, MPa."""
    box = np.floor(body.center / MM + 1e-9).astype(int)
    pressure = body.stress.mean(1) @ NORMAL / 3e6
    places, number = np.unique(box, axis=0, return_inverse=True)
    mean = np.bincount(number.ravel(), pressure) / np.bincount(number.ravel())
    value = dict(zip(map(tuple, places), mean, strict=True))
    steps = np.eye(box.shape[1], dtype=int)
    ends = (
        (place, value.get(tuple(place - step)), value.get(tuple(place + step))) for place in places for step in steps
    )
    found = [(a - 2 * value[tuple(x)] + b) / 4 for x, a, b in ends if a is not None and b is not None]
    return float(np.sqrt(np.mean(np.square(found))))


JOBS = {
    "ramp": Job(ramp, ((1,),), 1, 0, 7),
    "layers": Job(lambda h: cold(h, by_columns=False), ((1,),), 1, 0, 7),
    "columns": Job(lambda h: cold(h, by_columns=True), ((1,),), 1, 0, 7),
    "hot_layers": Job(hot_layers, ((1,),), 1, 0, 7),
    "hot_spot": Job(hot_spot, ((0,), (2,), (5,)), 1, 0, 9),
    "wall": Job(wall, ((8, 0),), 2, 2, 3),
    "weld": Job(weld, ((0,),), 0, 1, 39),
}


def main(name: str = "ramp", size: str = "0.5") -> None:
    """Prints the rows of a job."""
    job = JOBS[name]
    body = job.compute(float(size) * MM)
    of_elements = body.stress.mean(1) @ NORMAL / 3e6
    print(f"{name}, elements of {size} mm: hydrostatic stress {of_elements.min():.0f} to {of_elements.max():.0f} MPa")
    for place in job.places:
        pressure, stress = rows(body, job, place)
        at = f"along {'xyz'[job.line]} at {' and '.join(f'{box + 0.5} mm' for box in place)}"
        print(f"{at}, hydrostatic stress in MPa:", *(f"{value:.0f}" for value in pressure))
        print(f"{at}, stress {'xyz'[job.stress] * 2} in MPa:  ", *(f"{value:.0f}" for value in stress))
    for axis, moved in zip("xyz", displacement(body, job).T, strict=False):
        print(f"along x, displacement {axis} in um:", *(f"{value:.2f}" for value in moved))
    print(f"alternation of the hydrostatic stress from box to box in MPa: {alternation(body):.1f}")
    print(f"largest equivalent plastic strain: {body.equivalent.max():.5f}")


if __name__ == "__main__":
    main(*sys.argv[1:])
