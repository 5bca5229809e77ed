"""Run part of a simulation in this process: what a test hands to another process, as a program.

    python -m fmu.continued UNIT ARCHIVE FOLDER FIRST COUNT [STATE]

Steps FIRST to FIRST + COUNT of a motion that only the step's number decides, beginning from the serialised state in the
file STATE where one is given. Writes the outputs behind each step to stdout (hexadecimal, a row a step) and the state
at the end to stderr (hexadecimal)."""

import math
import sys
from pathlib import Path

from fmu.binary import OK, Slave, of
from fmu.unpacked import Archive

H = 125e-6


def go_on(slave: Slave, first: int, count: int) -> list[list[float]]:
    """Outputs behind each step."""
    inputs, outputs = (list(of(slave.archive, each).values()) for each in ("input", "output"))
    rows = []
    for k in range(first, first + count):
        slave.set(inputs, [1e-3 * math.sin(0.05 * k + i) for i in range(len(inputs))])
        slave.slope(inputs, [0.4 * math.cos(0.05 * k + i) for i in range(len(inputs))])
        slave.step(k * H, H)
        rows.append(slave.get(outputs))
    return rows


def main(unit: str, archive: str, folder: str, first: str, count: str, state: str | None = None) -> None:
    slave = Slave(Archive(unit, Path(archive), Path(folder)))
    if state is None:
        slave.initialized()
    elif slave.restore(Path(state).read_bytes()) != OK:
        sys.exit(slave.last)
    for row in go_on(slave, int(first), int(count)):
        print(*(value.hex() for value in row))
    print(slave.state().hex(), file=sys.stderr)
    slave.free()


if __name__ == "__main__":
    main(*sys.argv[1:])
