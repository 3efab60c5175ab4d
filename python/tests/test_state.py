"""Times, components, and what is computed from a log."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.testing as npt
import pytest

import perimelt


def test_times_are_matched_to_logged_ones(weld: perimelt.Log) -> None:
    body = weld.body()
    assert body.state().number == 5
    assert body.state(0.2).number == 2
    # a time printed with fewer digits
    assert body.state(0.20003).number == 2
    assert body.state(number=-2).number == 4
    assert body.state(0.24, nearest=True).number == 2
    with pytest.raises(perimelt.NoStateError, match=r"at 0\.24 s.* 0\.2 and 0\.3 s.*nearest=True"):
        body.state(0.24)
    with pytest.raises(perimelt.NoStateError, match=r"logged times are 0 to 0\.5 s"):
        body.state(0.6, nearest=True)
    with pytest.raises(perimelt.NoStateError, match="no state 6"):
        body.state(number=6)
    with pytest.raises(perimelt.NoStateError, match="not both"):
        body.state(0.2, number=2)
    with pytest.raises(perimelt.NoStateError, match="no state at nan"):
        body.state(float("nan"))


def test_states_are_chosen_by_time(weld: perimelt.Log) -> None:
    body = weld.body()
    assert [state.number for state in body.states(0.15, 0.4)] == [2, 3, 4]
    assert [state.number for state in body.states(every=2)] == [0, 2, 4]


def test_a_state_is_a_mapping(weld: perimelt.Log) -> None:
    state = weld.body().state()
    expected = ["temperature", "liquid_fraction", "displacement", "stress", "conjugate_stress"]
    assert list(state) == expected
    assert len(state) == 5
    assert "stress" in state
    assert state["temperature"].shape == (512,)
    assert state["displacement"].shape == state.positions.shape == (512, 3)
    assert state["stress"].shape == (512, 3, 3)
    assert state["stress"].flags.c_contiguous
    # its own array: a change is not one of the log
    state["temperature"][:] = 0
    assert state["temperature"].min() > 0


def test_mistakes_are_told_with_the_names_there_are(weld: perimelt.Log) -> None:
    body = weld.body()
    with pytest.raises(perimelt.UnknownNameError, match="did you mean `temperature`"):
        body.field("temprature")
    with pytest.raises(perimelt.UnknownNameError, match=r"`enthalpy`.*`log\.fields`"):
        body.field("enthalpy")
    with pytest.raises(perimelt.UnknownNameError, match=r"component of `stress` `q`.*von_mises"):
        body.field("stress.q")
    with pytest.raises(KeyError):
        body.state()["no"]
    with pytest.raises(perimelt.UnknownNameError):
        body.unit("no")


def test_invariants_of_stress_are_those_of_the_probes(weld: perimelt.Log) -> None:
    found = weld.body().compute(
        von_mises=lambda state: state["stress.von_mises"].max(),
        lowest=lambda state: state["stress.principal_3"].min(),
    )
    expected = weld.probes
    # the probe sees the same doubles
    probe = expected["equivalent stress", "stress.von_mises"]
    npt.assert_allclose(found["von_mises"], probe, rtol=1e-12)
    probe = expected["principal stress", "stress.principal_3"]
    npt.assert_allclose(found["lowest"], probe, rtol=1e-9)
    assert found["von_mises"].iloc[-1] > 1e7


def test_tensors_become_their_textbook_numbers() -> None:
    # tension of 7 along x and y halfway between them, with a pressure of 2
    stress = np.array([[[1.5, 3.5, 0], [3.5, 1.5, 0], [0, 0, -2.0]]])
    npt.assert_allclose(perimelt.von_mises(stress), [7], rtol=1e-14)
    npt.assert_allclose(perimelt.hydrostatic(stress), [1 / 3], rtol=1e-14)
    npt.assert_allclose(perimelt.principal(stress), [[5, -2, -2]], rtol=1e-14)
    npt.assert_allclose(perimelt.magnitude(np.array([[3.0, 0, -4]])), [5])


WALL = """
[bodies.wall]
shape.box = { min = [0, 0, -0.001], max = [0.006, 0.002, 0.002] }
spacing = 0.001
material = "steel"
initial.temperature = 300
regions.above.box = { min = [0, 0, 0], max = [0.006, 0.002, 0.002] }

[materials.steel]
density = 7800
specific_heat = 500
conductivity = 5

[[physics]]
type = "thermal"

[[couplers]]
type = "deposit"
region = "above"
temperature = 1000
layers = { height = 0.001, interval = 1 }

[time]
end = 3

[log]
interval = 0.1
"""


def test_a_history_is_the_probe_at_that_point(weld: perimelt.Log) -> None:
    body = weld.body()
    position = [0.0085, 0.0065, 0.0035]
    history = body.history("temperature", position)
    assert history.attrs["point"] == body.nearest(position)
    npt.assert_allclose(history.attrs["position"], position)
    assert history.attrs["units"] == {"time": "s", "temperature": "K"}
    probe = weld.probes["beside", "temperature"]
    npt.assert_array_equal(history.index, probe.index)
    # at a point the linear interpolation of the probe is the value, up to rounding
    npt.assert_allclose(history["temperature"], probe, rtol=1e-12)


def test_a_history_begins_when_its_point_is_added(tmp_path: Path) -> None:
    case = tmp_path / "wall.toml"
    case.write_text(WALL)
    with perimelt.run(case, out=tmp_path / "wall.mcap", quiet=True) as log:
        body = log.body()
        first, last = body.state(number=0), body.state()
        assert first.points < last.points
        assert len(first.reference_positions) == first.points
        above, below = [0.0035, 0.0005, 0.0015], [0.0035, 0.0005, -0.0005]
        npt.assert_allclose(last.reference_positions[last.nearest(above)], above, atol=1e-8)
        history = body.history("temperature", above)
        assert 0 < history.index[0] <= 1.1
        assert history.index[-1] == 3
        assert history["temperature"].iloc[0] > 800
        assert list(body.history("temperature", below).index) == list(body.times)


def test_a_history_of_a_vector_has_its_components(weld: perimelt.Log) -> None:
    body = weld.body()
    history = body.history("displacement", 511)
    assert list(history.columns) == ["displacement.x", "displacement.y", "displacement.z"]
    npt.assert_array_equal(history.iloc[-1], body.field("displacement")[511])
    npt.assert_array_equal(body.history("displacement", -1), history)
    assert body.history("stress", 0).shape == (6, 9)
    with pytest.raises(perimelt.PerimeltError, match="no point 512"):
        body.history("stress", 512)
    with pytest.raises(perimelt.PerimeltError, match="three numbers"):
        body.nearest([0, 1])


def test_defined_fields_are_read_like_logged_ones(weld: perimelt.Log) -> None:
    body = weld.body()
    body.define("superheat", lambda state: state["temperature"] - 1750, unit="K")
    body.define("molten", lambda state: state["superheat"] > 0)
    body.define("doubled", lambda state: 2 * state["displacement"], unit="m")
    temperature = body.field("temperature", 0.3)
    npt.assert_array_equal(body.field("superheat", 0.3), temperature - 1750)
    npt.assert_array_equal(body.field("molten", 0.3), temperature > 1750)
    npt.assert_array_equal(body.field("doubled.z"), 2 * body.field("displacement.z"))
    assert body.fields["superheat"] == perimelt.Field("superheat", "K", 1)
    assert body.fields["doubled"].components == 3
    assert body.unit("doubled.z") == "m"
    history = body.history("superheat", 7)
    npt.assert_array_equal(
        history["superheat"], body.history("temperature", 7)["temperature"] - 1750
    )


def test_a_field_that_cannot_be_computed_is_not_defined(weld: perimelt.Log) -> None:
    body = weld.body()
    with pytest.raises(perimelt.PerimeltError, match=r"shape \(3,\).* 512 points"):
        body.define("short", lambda state: state["temperature"][:3])
    with pytest.raises(perimelt.PerimeltError, match="not numbers"):
        body.define("text", lambda state: ["a"] * state.points)
    with pytest.raises(perimelt.UnknownNameError, match="`temprature`"):
        body.define("typo", lambda state: state["temprature"])
    with pytest.raises(perimelt.PerimeltError, match="`temperature` is a logged field"):
        body.define("temperature", lambda state: state["temperature"] - 273.15)
    assert body.defined == {}


def test_computed_probes_are_those_of_the_program(weld: perimelt.Log) -> None:
    body = weld.body()
    found = body.compute(
        stored=lambda state: (
            # enthalpy of the block above its start: 7800 * 500 J/(m³ K) and the latent heat
            (
                3.9e6 * (state["temperature"] - 300).sum()
                + 7800 * 2.6e5 * state["liquid_fraction"].sum()
            )
            * body.spacing**3
        ),
        units={"stored": "J"},
    )
    balance = weld.balance
    expected = balance["thermal.heat.stored"] - balance["thermal.heat.initial"]
    npt.assert_allclose(found["stored"], expected, rtol=1e-10, atol=1e-9)
    assert found.attrs["units"]["stored"] == "J"
    with pytest.raises(perimelt.PerimeltError, match=r"shape \(512,\), expected one number"):
        body.compute(field=lambda state: state["temperature"])
