"""Points as arrays with an axis for each direction."""

from __future__ import annotations

import numpy as np
import numpy.testing as npt
import pytest

import perimelt


def test_a_field_on_the_grid_has_an_axis_for_each_direction(rods: perimelt.Log) -> None:
    block = rods["block"]
    grid = block.grid
    assert grid.shape == (8, 4, 4)
    npt.assert_allclose(grid.x, 2.5e-3 * (np.arange(8) + 0.5), rtol=1e-6)
    x = grid.fill(block.reference_positions[:, 0])
    npt.assert_allclose(x, np.broadcast_to(grid.x[:, None, None], (8, 4, 4)), rtol=1e-6)
    assert grid.fill(block.field("stress")).shape == (8, 4, 4, 3, 3)
    # thermal strain of 1.5e-5 1/K times 200 K; displacements of 26 um in single precision
    displacement = grid.fill(block.field("displacement.y"))
    npt.assert_allclose(np.gradient(displacement, grid.y, axis=1), 3e-3, rtol=1e-5)


def test_a_rod_has_one_cell_across(rods: perimelt.Log) -> None:
    rod = rods["rod"]
    assert rod.grid.shape == (10, 1, 1)
    with pytest.raises(perimelt.PerimeltError, match="3 values for the 10 points"):
        rod.grid.fill([1, 2, 3])


def test_positions_and_grids_follow_a_body_that_grows(layers: perimelt.Log) -> None:
    part = layers["part"]
    counts = [state.points for state in part.states()]
    assert counts[0] == 240
    assert counts[-1] == 480
    assert np.abs(part.field("displacement")).max() > 0.5 * part.spacing
    for state in part.states():
        assert state.reference_positions.shape == state["displacement"].shape
        # the shape is that of the whole body at all times
        filled = state.grid.fill(state["temperature"])
        assert filled.shape == (10, 6, 8)
        assert np.isfinite(filled).sum() == state.points
        z = state.grid.fill(state.reference_positions[:, 2])
        expected = np.broadcast_to(state.grid.z[None, None, :], z.shape)
        npt.assert_allclose(z[np.isfinite(z)], expected[np.isfinite(z)], atol=1e-7)
    with pytest.raises(perimelt.PerimeltError, match=r"480 values for the 240 .*state\.grid"):
        part.grid.fill(part.field("temperature"))


def test_cells_without_a_point_are_empty() -> None:
    grid = perimelt.Grid(np.array([[0, 0, 0], [2, 0, 0], [2, 1, 0.0]]), 1.0)
    npt.assert_array_equal(grid.fill([1, 2, 3])[:, :, 0], [[1, np.nan], [np.nan] * 2, [2, 3]])
    npt.assert_array_equal(grid.fill([True] * 3, 0)[:, :, 0], [[1, 0], [0, 0], [1, 1]])


def test_points_off_a_grid_are_refused() -> None:
    with pytest.raises(perimelt.PerimeltError, match="one regular grid"):
        perimelt.Grid(np.array([[0, 0, 0], [1.2, 0, 0.0]]), 1.0)
    with pytest.raises(perimelt.PerimeltError, match="several points"):
        perimelt.Grid(np.array([[0, 0, 0], [0.01, 0, 0.0]]), 1.0)
