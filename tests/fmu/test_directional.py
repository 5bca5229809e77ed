"""Directional derivatives in initialisation mode, against differences of the outputs themselves."""

import zlib

import numpy as np
import pytest
from fmpy.fmi2 import FMU2Slave

from fmu.unpacked import Archive, initialize, instantiate


def _references(archive: Archive, causality: str) -> dict[str, int]:
    return {
        name: int(each.attrib["valueReference"])
        for name, each in archive.variables().items()
        if each.attrib["causality"] == causality and each[0].tag == "Real"
    }


def _partials(slave: FMU2Slave, outputs: list[int], known: int) -> np.ndarray:
    return np.array(slave.getDirectionalDerivative(outputs, [known], [1.0]))


def test_they_are_those_of_the_initial_values(archive: Archive) -> None:
    inputs, outputs = _references(archive, "input"), _references(archive, "output")
    known, unknown = list(inputs.values()), list(outputs.values())
    rng = np.random.default_rng(zlib.crc32(archive.unit.encode()))
    slave = instantiate(archive)
    try:
        initialize(slave, archive)
        point = rng.uniform(-1.0, 1.0, len(known))
        reacting = set()
        for column, name in enumerate(inputs):
            seen = []
            for shift in (0.5, -0.5):
                moved = point.copy()
                moved[column] += shift
                slave.setReal(known, list(moved))
                seen.append(np.array(slave.getReal(unknown)))
            slave.setReal(known, list(point))
            quotient = seen[0] - seen[1]
            # All initial values are linear in the inputs: the quotient is exact but for rounding.
            np.testing.assert_allclose(_partials(slave, unknown, inputs[name]), quotient, rtol=1e-12, atol=1e-14)
            reacting |= {(output, name) for output, moves in zip(outputs, quotient != 0, strict=True) if moves}
        expected = {
            "controller": {("x_e", "x_s"), ("x_e", "x_a"), ("x_m", "x_a")},
            "friction": {("M_fr", "n_fr")},
            "friction_gms": {("M_fr", "n_fr")},
            "plant": set(),
            "setpoint": set(),
            "machine": {(f"{axis}.{x_e}", f"{axis}.x_s") for axis in "XYZ" for x_e in ("x_e", "x_e_min", "x_e_max")},
        }
        assert reacting == expected[archive.unit]
        both = slave.getDirectionalDerivative(unknown, known, list(point))
        each = sum(weight * _partials(slave, unknown, one) for weight, one in zip(point, known, strict=True))
        np.testing.assert_allclose(both, each, rtol=1e-12, atol=1e-14)

        # Once initialised, what the controller shows belongs to its sample instants, but for the measured position.
        slave.exitInitializationMode()
        later = {
            (output, name)
            for name in inputs
            for output, value in zip(outputs, _partials(slave, unknown, inputs[name]), strict=True)
            if value
        }
        assert later == {"controller": {("x_m", "x_a")}, "machine": set()}.get(archive.unit, later)
    finally:
        slave.freeInstance()


@pytest.mark.parametrize("second", ["0123456789abcdef", "ffffffffffffffff"])
def test_a_guid_of_other_resources_is_refused(archive: Archive, second: str) -> None:
    with pytest.raises(Exception, match="instantiate"):
        instantiate(archive, guid=f"{archive.guid[:17]}{second}")
