"""Outputs at the tool are computed when somebody reads them: nobody must be able to tell."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from plant_unit import AXES, INPUTS, OUTPUTS, POSE, H, random_inputs, single_mode, write_modes

from fmi_helpers import Archive, Floats, Instance

LATE = tuple(f"{point}.x_{axis}" for point in ("tool", "tcp") for axis in AXES)
ALL = (*OUTPUTS, *LATE)
STEPS = 40


@pytest.fixture(scope="module")
def archive(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Archive:
    return Archive.unpack(fmus / "plant.fmu", tmp_path_factory.mktemp("plant"))


def advance(plant: Instance, values: Floats, watch: Sequence[str] = ()) -> None:
    """Steps of H through the rows of `values`; `watch` is read behind each."""
    for row in values:
        plant.step(H, dict(zip(INPUTS, row, strict=True)), dict(zip(INPUTS, 100 * row, strict=True)))
        if watch:
            plant.gets(watch)


def test_read_in_every_step_or_at_the_end(archive: Archive) -> None:
    values = random_inputs(STEPS, seed=1)
    with archive.instance() as always, archive.instance() as rarely, archive.instance() as one_by_one:
        advance(always, values, ALL)
        advance(rarely, values, OUTPUTS[:6])
        advance(one_by_one, values)
        found = always.gets(ALL)
        assert np.ptp(found[-3:]) > 0
        np.testing.assert_array_equal(rarely.gets(ALL), found)
        np.testing.assert_array_equal([one_by_one.get(name) for name in reversed(ALL)], found[::-1])
        # tool point = tool displacement plus start position, to the last bit
        np.testing.assert_array_equal(rarely.gets(LATE[3:]), rarely.gets(LATE[:3]) + [POSE[axis] for axis in AXES])


def test_saved_states_are_complete(archive: Archive) -> None:
    values = random_inputs(STEPS, seed=2)
    with archive.instance() as reading, archive.instance() as silent, archive.instance() as other:
        advance(reading, values, LATE)
        advance(silent, values)
        content = silent.serialized()
        assert content == reading.serialized()
        other.restore_serialized(content, silent.time)
        np.testing.assert_array_equal(other.gets(LATE), reading.gets(LATE))


def test_states_before_and_after_unread_steps(archive: Archive) -> None:
    values = random_inputs(STEPS, seed=3)
    with archive.instance() as plant, archive.instance() as straight:
        advance(straight, values[:10], LATE)
        tenth = straight.gets(ALL)
        advance(plant, values[:10])
        kept = plant.state()  # nobody has read yet
        advance(plant, values[10:])
        plant.restore(kept)  # what the steps in between left unread is of no concern
        np.testing.assert_array_equal(plant.gets(ALL), tenth)
        advance(plant, values[10:])
        advance(straight, values[10:])
        np.testing.assert_array_equal(plant.gets(LATE), straight.gets(LATE))
        plant.fmu.freeFMUState(kept[0])


def test_reset_and_terminated(archive: Archive) -> None:
    values = random_inputs(STEPS, seed=4)
    with archive.instance() as plant, archive.instance() as straight:
        start = straight.gets(LATE)
        advance(straight, values, LATE)
        advance(plant, values)
        plant.fmu.terminate()
        np.testing.assert_array_equal(plant.gets(LATE), straight.gets(LATE))
        advance(straight, values)
        straight.fmu.reset()
        straight.start({})
        np.testing.assert_array_equal(straight.gets(LATE), start)


def test_after_a_failed_step_they_are_those_of_the_last_good_one(archive: Archive) -> None:
    values = random_inputs(STEPS, seed=5)
    with archive.instance() as plant, archive.instance() as straight:
        advance(straight, values, LATE)
        advance(plant, values)
        with pytest.raises(Exception, match="fmi2DoStep"):
            plant.step(H, {"X.M_a": 1.7e308, "X.M_fr": -1.7e308})
        np.testing.assert_array_equal(plant.gets(LATE), straight.gets(LATE))


def test_overflow_at_the_tool_alone_is_an_error_where_it_is_read(archive: Archive, tmp_path: Path) -> None:
    shapes = [1.0, 1.0, 1.0, 1e-3, 1e-3, 1e-3, 1e250, 1e250, 1e250]
    table = write_modes(tmp_path / "modes.csv", [[0, 20.0, 0.02, *shapes]])
    with archive.instance({"modes_file": str(table)}) as plant:
        plant.step(H, {"X.M_a": 1e100})
        assert np.isfinite(plant.gets(["X.n_a", "X.x_a"])).all()
        for _ in range(2):
            with pytest.raises(Exception, match="fmi2GetReal"):
                plant.gets(["X.x_a", "tool.x_Y"])
        assert "output 'tool.x_X' is not finite: inf" in plant.texts(3)
        with pytest.raises(Exception, match="fmi2GetFMUstate"):
            plant.state()
        plant.step(H)
        assert np.isfinite(plant.gets(["X.n_a", "X.x_a"])).all()


def test_one_mode_in_closed_form(archive: Archive, tmp_path: Path) -> None:
    """All displacements of a single mode are in the ratio of its shape, read late or not."""
    with archive.instance({"modes_file": str(single_mode(tmp_path / "modes.csv", 0.02))}) as plant:
        advance(plant, random_inputs(STEPS, seed=6))
        scales = plant.gets([f"{axis}.x_a" for axis in AXES]) - [POSE[axis] for axis in AXES]
        # 0.02/0.013 and so on; x_a holds the displacement beside 0.1 to 0.8 m, rounded to 1e-16 m
        np.testing.assert_allclose(
            plant.gets(LATE[:3]), scales[2] / 0.013 * np.array([0.02, -0.05, 0.001]), atol=1e-16 * 0.05 / 0.013 * 2
        )
