"""Units of another maker that crash, hang or end the process: the run says which unit, in what and when, keeps its
rows, and leaves nothing behind."""

from __future__ import annotations

import json
import os
import pickle
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
import pytest

from command_helpers import PATIENCE, feedsim, feedsim_process
from feedsim import scenario
from feedsim.files.trace import Trace, read_csv
from feedsim.foundation.errors import SimulationError
from feedsim.report import run as report
from feedsim.simulation import cosim
from feedsim.simulation.cosim import worker
from feedsim.simulation.judge import judge_run
from foreign import acme

pytestmark = pytest.mark.skipif(not worker.WORKERS_AVAILABLE, reason="this system has no worker process")
ROOT = Path(__file__).resolve().parents[2]
AT = 0.05  # s, when the unit fails
# Kinds of faulty.c, in its order.
KINDS = (
    "none", "crash", "abort", "stack", "exit 0", "exit 1", "loop", "sleep",
    "discard", "error", "fatal", "pending", "status 99", "speaks and fails", "not a number",
    "closes low", "closes all", "scribbles low", "scribbles all", "lowers limits", "forks",
    "rounds up", "flushes", "logs NULL", "logs bytes", "logs without end", "logs often", "logs oddly",
    "terminate crashes", "terminate fails", "terminate hangs", "freeing crashes", "freeing exits",
)  # fmt: skip
# Fault -> what is said of it, and whether rows are there by then.
FAULTS = {
    "crash": ("was ended by SIGSEGV", True),
    "abort": ("was ended by SIGABRT", True),
    "stack": ("was ended by SIGSEGV", True),
    "exit 0": ("ended the process by itself, with exit status 0", True),
    "exit 1": ("ended the process by itself, with exit status 1", True),
    "loop": ("does not come back within 1 s; it has been ended", True),
    "sleep": ("does not come back within 1 s; it has been ended", True),
    "loading": ("was ended by SIGSEGV", False),
    "instantiating": ("was ended by SIGSEGV", False),
}
# What ends the run, and what is said of it.
ENDING = {
    "discard": "step of 0.001 s failed: no message (status discard)",
    "error": "step of 0.001 s failed: no message (status error)",
    "fatal": "step of 0.001 s failed: no message (status fatal)",
    "pending": "step of 0.001 s failed: no message (status pending)",
    "status 99": "(status 99, which FMI has not)",
    "speaks and fails": "step of 0.001 s failed: no message (its last was: the oil is cold) (status error)",
    "not a number": "unit friction_X (friction of X), t = 0.051 s: gives M_fr = nan, which is not finite; unit plant",
    "closes all": "descriptors",
    "scribbles all": "has written into descriptors that are not its own",
}
# What leaves the result as it is, and what the run says of it.
HARMLESS = {
    "closes low": "",
    "scribbles low": "",
    "forks": "",
    "rounds up": "friction_X: it changes how its process computes",
    "flushes": "friction_X: it changes how its process computes",
    "logs NULL": "friction_X: a warning without a message",
    "logs bytes": "friction_X: caf\ufffd",
    "logs without end": "friction_X: yyyy",
    "logs often": "friction_X: more warnings, which are not shown",
    "logs oddly": "",
    "terminate crashes": "unit friction_X: fmi2Terminate was ended by SIGSEGV",
    "terminate fails": "friction_X: fmi2Terminate, after the last step, failed: no message (status error)",
    "terminate hangs": "unit friction_X: fmi2Terminate does not come back within 1 s",
    "freeing crashes": "unit friction_X: fmi2FreeInstance was ended by SIGSEGV",
    "freeing exits": "unit friction_X: fmi2FreeInstance ended the process by itself, with exit status 0",
}
# Kind -> which calls FMI 2.0 allows behind it (section 4.2.4 of FMI 2.0.4).
LAST_CALLS = {
    "none": ["fmi2Terminate", "fmi2FreeInstance"],
    "discard": ["fmi2Terminate", "fmi2FreeInstance"],
    "error": ["fmi2FreeInstance"],
    "fatal": [],
    "pending": [],
}
ROWS = acme.numbered(
    acme.Variable("Speed", "input", None, "0"),
    acme.Variable("Torque", "output", None),
    acme.Variable("Coulomb", "parameter", None, "0.01"),
    acme.Variable("Viscous", "parameter", None, "1e-5"),
    acme.Variable("At", "parameter", None, "1e9"),
    acme.Variable("Kind", "parameter", None, "0"),
)
PLAN = """
name: a faulty unit
machine: {machine}
motions:
  - {{kind: move, by: {{X: 10 mm}}, feed: 3000 mm/min}}
  - {{kind: dwell, duration: 200 ms}}
recording: {{interval: 1 ms, variables: [X.x_a, X.M_fr]}}
coupling: {{call_limit: 1 s}}
set:
  machine.axes.X.friction: {friction}
"""


@pytest.fixture(scope="module")
def compiled(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], bytes]:
    folder, known = tmp_path_factory.mktemp("faulty"), dict[str, bytes]()

    def library(fault: str) -> bytes:
        macro = f"FAULT={fault.upper()}" if fault not in KINDS else "FAULT=0"
        if macro not in known:
            known[macro] = acme.compiled(folder, "faulty", macro)
        return known[macro]

    return library


def write_plan(folder: Path, fault: str, compiled: Callable[[str], bytes]) -> scenario.Scenario:
    acme.archive(folder / "faulty.fmu", "friction", compiled(fault), ROWS)
    parameters = {"At": AT, "Kind": KINDS.index(fault) if fault in KINDS else 0}
    friction = {"fmu": "faulty.fmu", **acme.MAPPED_FRICTION, "parameters": parameters}
    text = PLAN.format(machine=ROOT / "scenarios" / "machines" / "emps", friction=json.dumps(friction))
    (folder / "s.yaml").write_text(text, encoding="utf-8")
    return scenario.load(folder / "s.yaml")


@pytest.fixture
def place(compiled: Callable[[str], bytes], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Path]:
    """A scenario whose friction has a fault, in a folder with a folder for temporary files of its own."""

    def made(fault: str) -> Path:
        write_plan(tmp_path, fault, compiled)
        (tmp_path / "temporary").mkdir()
        monkeypatch.setenv("TMPDIR", str(tmp_path / "temporary"))
        monkeypatch.setattr(tempfile, "tempdir", None)
        return tmp_path

    return made


def nothing_left(folder: Path) -> None:
    """Of the worker, or what it has unpacked. The archives that this process keeps open are its own."""
    worker._end_all()
    (own,) = (folder / "temporary").iterdir()
    assert not [path for path in own.glob("feedsim-*") if not (path / "modelDescription.xml").is_file()]


@pytest.mark.parametrize("native", [True, False], ids=["native", "Python"])
@pytest.mark.parametrize("fault", FAULTS)
def test_a_run_says_who_and_when(fault: str, native: bool, place: Callable[[str], Path], fmus: Path) -> None:
    folder, (how, rows) = place(fault), FAULTS[fault]
    plan = scenario.load(folder / "s.yaml")
    partial = report.growing_result(folder)
    with pytest.raises(SimulationError) as raised, partial:
        cosim.run(plan, fmus=fmus, native=native, sink=partial)
    said = str(raised.value)
    assert how in said
    if rows:
        assert said.startswith(f"unit friction_X, t = {AT:.9g} s: step of 0.001 s "), said
        kept = read_csv(folder / "result.partial.csv")
        assert 0.8 * AT < kept.time[-1] <= AT
    else:
        assert "faulty.fmu" in said
        assert not (folder / "result.partial.csv").exists()
    nothing_left(folder)


@pytest.mark.extensive
@pytest.mark.parametrize("fault", FAULTS)
def test_commands_end_with_3(fault: str, place: Callable[[str], Path], fmus: Path) -> None:
    """A scenario, and the same as an SSP file."""
    folder, (how, rows) = place(fault), FAULTS[fault]
    assert feedsim("export", "s.yaml", "--out", "s.ssp", fmus=fmus, cwd=folder).returncode == 0
    before = {*(folder / "temporary").iterdir()}  # of this process, which keeps archives unpacked
    for subject in ("s.yaml", "s.ssp"):
        done = feedsim_process("run", subject, "--out", "out", fmus=fmus, cwd=folder)
        assert done.returncode == 3, done.stderr
        assert how in done.stderr
        assert {path.name for path in (folder / "out").glob("*")} == ({"result.partial.csv"} if rows else set())
        assert {*(folder / "temporary").iterdir()} == before


@pytest.fixture(scope="module")
def undisturbed(compiled: Callable[[str], bytes], tmp_path_factory: pytest.TempPathFactory, fmus: Path) -> Trace:
    folder = tmp_path_factory.mktemp("undisturbed")
    return cosim.run(write_plan(folder, "none", compiled), fmus=fmus).trace


@pytest.mark.extensive
@pytest.mark.parametrize(
    ("fault", "native"), [*((fault, True) for fault in ENDING), ("pending", False), ("not a number", False)]
)
def test_a_run_ends_with_the_unit_that_ends_it(
    fault: str, native: bool, place: Callable[[str], Path], fmus: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    folder = place(fault)
    worker._end_all()  # the next one writes its errors to where they are caught
    with pytest.raises(SimulationError) as raised:
        cosim.run(scenario.load(folder / "s.yaml"), fmus=fmus, native=native)
    assert ENDING[fault] in str(raised.value)
    nothing_left(folder)
    assert "Traceback" not in capfd.readouterr().err


@pytest.mark.extensive
@pytest.mark.parametrize("fault", HARMLESS)
def test_a_run_goes_on_and_says_what_it_met(
    fault: str, place: Callable[[str], Path], fmus: Path, undisturbed: Trace, capfd: pytest.CaptureFixture[str]
) -> None:
    """The result is that of the healthy unit, to the last bit."""
    folder = place(fault)
    worker._end_all()
    done = cosim.run(scenario.load(folder / "s.yaml"), fmus=fmus)
    assert all(np.array_equal(done.trace[name], undisturbed[name]) for name in undisturbed)
    assert HARMLESS[fault] in "\n".join(map(str, done.notes))
    assert len("\n".join(map(str, done.notes))) < 20_000
    nothing_left(folder)
    assert "Traceback" not in capfd.readouterr().err


@pytest.mark.extensive
@pytest.mark.parametrize("fault", ["lowers limits", "closes all", "forks", "fatal", "terminate crashes"])
def test_the_next_run_knows_nothing_of_it(
    fault: str, place: Callable[[str], Path], fmus: Path, undisturbed: Trace, compiled: Callable[[str], bytes]
) -> None:
    folder, said = place(fault), ""
    try:
        cosim.run(scenario.load(folder / "s.yaml"), fmus=fmus)
    except SimulationError as error:
        said = str(error)
    # A process without memory may have enough to end its run.
    lowered = "lacks memory or descriptors: RLIMIT_AS, RLIMIT_NOFILE, RLIMIT_FSIZE of it was lowered"
    assert not said or ENDING.get(fault, lowered) in said
    done = cosim.run(write_plan(folder, "none", compiled), fmus=fmus)
    assert all(np.array_equal(done.trace[name], undisturbed[name]) for name in undisturbed)


@pytest.mark.parametrize("fault", ["rounds up", "flushes"])
def test_the_python_loop_computes_as_before_too(
    fault: str, place: Callable[[str], Path], fmus: Path, undisturbed: Trace
) -> None:
    done = cosim.run(scenario.load(place(fault) / "s.yaml"), fmus=fmus, native=False)
    assert all(np.array_equal(done.trace[name], undisturbed[name]) for name in undisturbed)
    assert HARMLESS[fault] in "\n".join(map(str, done.notes))


@pytest.mark.parametrize("fault", LAST_CALLS)
def test_the_last_calls_are_those_that_fmi_allows(
    fault: str, place: Callable[[str], Path], fmus: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = place(fault)
    worker._end_all()
    monkeypatch.setenv("CALLS", str(tmp_path / "calls"))
    with suppress(SimulationError):
        cosim.run(scenario.load(folder / "s.yaml"), fmus=fmus)
    worker._end_all()
    noted = (tmp_path / "calls").read_text().split() if (tmp_path / "calls").exists() else []
    assert noted == LAST_CALLS[fault]


def test_a_crash_at_the_end_leaves_command_and_study_their_result(place: Callable[[str], Path], fmus: Path) -> None:
    folder = place("terminate crashes")
    done = feedsim("run", "s.yaml", "--out", "out", fmus=fmus, cwd=folder)
    assert done.returncode == 0, done.stderr
    assert f"warning: {HARMLESS['terminate crashes']}" in done.stderr
    assert len(read_csv(folder / "out" / "result.csv").time) > 100


def test_measured_responses_have_the_limit_of_the_scenario(place: Callable[[str], Path], fmus: Path) -> None:
    folder = place("sleep")
    words = ["--friction", "--realisations", "1", "--offset-speed", "5 rad/s", "--band", "2Hz..100Hz"]
    done = feedsim("frf", "s.yaml", *words, "--out", "out", fmus=fmus, cwd=folder)
    assert done.returncode == 3, done.stderr
    assert FAULTS["sleep"][0] in done.stderr


@pytest.mark.extensive
@pytest.mark.parametrize("fault", FAULTS)
def test_a_study_goes_on(fault: str, place: Callable[[str], Path], fmus: Path) -> None:
    """The run that fails is a row with its message; the others are made, where the unit can be loaded at all."""
    folder = place(fault)
    (folder / "study.yaml").write_text(
        "name: st\nscenario: s.yaml\nsampling: {method: grid}\nfigures: [X.overshoot]\n"
        "parameters: {at: {key: machine.axes.X.friction.parameters.At, values: [1000, 0.05, 2000]}}\n"
    )
    text = (folder / "s.yaml").read_text().replace("set:", "evaluate: [{kind: positioning, axis: X}]\nset:")
    (folder / "s.yaml").write_text(text)
    done = feedsim("sweep", "study.yaml", "--workers", "1", "--out", "out", "--quiet", fmus=fmus, cwd=folder)
    how, begins = FAULTS[fault]
    assert done.returncode == (0 if begins else 3), done.stderr
    table = (folder / "out" / "table.csv").read_text()
    assert table.count(how.split(";")[0]) == (1 if begins else 3)
    assert ("unit friction_X, t = 0.05 s" if begins else "faulty.fmu") in table


# A process that executes another maker's unit itself: FMPy's logger is then that unit's for all others, too.
HERE = """
import pickle, sys
from feedsim import scenario
from feedsim.simulation import cosim
from feedsim.simulation.cosim import worker
from feedsim.simulation.judge import judge_run
worker.WORKERS_AVAILABLE = False
run = judge_run(cosim.run(scenario.load(sys.argv[1], [sys.argv[2]])))
with open(sys.argv[3], "wb") as file:
    pickle.dump((run.trace, run.warnings), file)
"""


def test_healthy_units_give_the_same_bits_here_and_in_a_worker(place: Callable[[str], Path], fmus: Path) -> None:
    folder, healthy = place("crash"), "machine.axes.X.friction.parameters.At=1000"
    watched = judge_run(cosim.run(scenario.load(folder / "s.yaml", [healthy]), fmus=fmus))
    environment = {**os.environ, "FEEDSIM_FMUS": str(fmus), "PYTHONPATH": str(ROOT / "master")}
    command = [sys.executable, "-c", HERE, str(folder / "s.yaml"), healthy, str(folder / "here.pickle")]
    subprocess.run(command, env=environment, check=True)
    trace, warnings = pickle.loads((folder / "here.pickle").read_bytes())
    assert list(watched.trace) == list(trace)
    assert all((watched.trace[name] == trace[name]).all() for name in trace)
    assert watched.warnings == warnings


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_hanging_unit_is_left_at_once(number: signal.Signals, place: Callable[[str], Path], fmus: Path) -> None:
    """By Ctrl-C and by a plain kill: rows are kept, and no process stays."""
    folder = place("loop")
    words = [sys.executable, "-c", "from feedsim.cli import entry; entry()", "run", "s.yaml", "--out", "out",
             "--set", "coupling.call_limit=600 s"]  # fmt: skip
    environment = {**os.environ, "FEEDSIM_FMUS": str(fmus), "PYTHONPATH": str(ROOT / "master")}
    process = subprocess.Popen(words, cwd=folder, env=environment, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL)
    kept = folder / "out" / "result.partial.csv"
    until = time.monotonic() + PATIENCE
    while not (kept.is_file() and len(kept.read_text().splitlines()) > 40) and time.monotonic() < until:
        time.sleep(0.05)
    process.send_signal(number)
    _, said = process.communicate(timeout=PATIENCE)
    assert process.returncode == (130 if number == signal.SIGINT else 143)
    assert b"are kept in" in said
    assert {path.name for path in (folder / "out").iterdir()} == {"result.partial.csv"}
    assert not list((folder / "temporary").iterdir())
    listed = subprocess.run(["ps", "-eo", "args"], capture_output=True, text=True).stdout
    assert f"{folder}/temporary" not in listed
