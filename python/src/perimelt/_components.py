"""Components of vectors and tensors, and scalars computed from them.

The names are those of `perimelt plot --field` and of probes: `displacement.magnitude`,
`stress.von_mises`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt

from ._cloud import TENSOR, VECTOR

Array = npt.NDArray[np.floating[Any]]


def magnitude(vectors: Array) -> Array:
    """Length of vectors, shape (..., 3)."""
    length: Array = np.linalg.norm(vectors, axis=-1)
    return length


def hydrostatic(stress: Array) -> Array:
    """Third of the trace of tensors, shape (..., 3, 3)."""
    trace: Array = np.trace(stress, axis1=-2, axis2=-1)
    return trace / 3


def von_mises(stress: Array) -> Array:
    """Equivalent stress `sqrt(3/2 s:s)` with the deviator s, of tensors of shape (..., 3, 3)."""
    deviator = stress - hydrostatic(stress)[..., None, None] * np.eye(3, dtype=stress.dtype)
    contraction: Array = np.einsum("...ij,...ij->...", deviator, deviator)
    equivalent: Array = np.sqrt(1.5 * contraction)
    return equivalent


def principal(stress: Array) -> Array:
    """Principal values of symmetric tensors of shape (..., 3, 3), the largest first."""
    values: Array = np.linalg.eigvalsh(stress)
    return values[..., ::-1]


def _entry(*index: int) -> Callable[[Array], Array]:
    def entry(values: Array) -> Array:
        return np.ascontiguousarray(values.T[index[::-1]])

    return entry


def _principal(rank: int) -> Callable[[Array], Array]:
    return lambda stress: np.ascontiguousarray(principal(stress)[..., rank])


_OF_VECTOR: dict[str, Callable[[Array], Array]] = {
    **{name: _entry(axis) for axis, name in enumerate(VECTOR)},
    "magnitude": magnitude,
}
_OF_TENSOR: dict[str, Callable[[Array], Array]] = {
    # row and column of the name
    **{name: _entry(VECTOR.index(name[0]), VECTOR.index(name[1])) for name in TENSOR},
    "von_mises": von_mises,
    "hydrostatic": hydrostatic,
    **{f"principal_{rank + 1}": _principal(rank) for rank in range(3)},
}


def of_components(components: int) -> dict[str, Callable[[Array], Array]]:
    """The scalars of a field with this number of components, by name."""
    return {3: _OF_VECTOR, 9: _OF_TENSOR}.get(components, {})
