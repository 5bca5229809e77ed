"""A result of each kind that is made in a moment, made when a test first asks for it."""

from __future__ import annotations

from pathlib import Path

from command_helpers import feedsim
from feedsim.analysis import evaluate
from feedsim.foundation.arguments import Call, call_context
from feedsim.jobs.identify import result_of
from feedsim.jobs.parameters import command_line
from identification_helpers import identified
from report_helpers import circle_run, positioning_run, write_run
from ssp_helpers import short_scenario

SCENARIOS = Path(__file__).resolve().parents[1] / "scenarios"
MACHINES = SCENARIOS / "machines"
# Kind -> the kinds that it is made of, and the command in their folder.
COMMANDS = {
    "frf": ((), f"frf {MACHINES / 'one_axis'} --no-measure --out frf"),
    "axes": ((), f"frf {MACHINES / 'test_centre'} --no-measure --set structure=null --out axes"),
    "run": ((), "run short.yaml --out run"),
    "machine": ((), f"machine show {MACHINES / 'one_axis'} --out machine"),
    "compare": (
        ("run", "stop"), "compare run/result.csv stop/result.csv --report compare/report.html --common --only *.x_a",
    ),
    "show": (("stop", "run"), "show stop run --out show"),
    "circles": (("circle", "recorded"), "show circle circle/result.csv --out circles"),
    "recorded": (("circle",), "circle circle/result.csv --axes X,Z --out recorded"),
    "compensate": (
        (), f"compensate {SCENARIOS / 'xz_circle.yaml'} --no-table --set motions.0.direction=counterclockwise "
        "--out compensate",
    ),
    "replay": (("logged",), f"replay logged/log.csv --machine {MACHINES / 'test_centre'} --axes Z --out replay"),
    "study": ((), "sweep study.yaml --workers 1 --out study"),
    "logged": ((), "run logged.yaml --out logged"),
}  # fmt: skip
KINDS = ("circle", "stop", "identify", *(kind for kind in COMMANDS if kind != "logged"))
LOGGED = f"""
name: log of Z
machine: {MACHINES / "test_centre"}
motions:
  - {{kind: dwell, duration: 0.1 s}}
  - {{kind: move, by: {{Z: 12 mm}}, feed: 6000 mm/min}}
  - {{kind: move, by: {{Z: -5 mm}}, feed: 600 mm/min}}
  - {{kind: dwell, duration: 0.1 s}}
recording: {{interval: 1 ms}}
logging: {{interval: 2 ms, axes: [Z], signals: [x_s, x_a, x_e, n_s, n_ffw, M_a]}}
"""
STUDY = """
name: feed and K_v
scenario: short.yaml
sampling: {method: grid}
parameters:
  feed: {key: motions.0.feed, values: [1000 mm/min, 2000 mm/min, 3000 mm/min]}
  K_v: {key: machine.axes.Z.drive.K_v, values: [3 (m/min)/mm, 4 (m/min)/mm]}
figures: [Z.peak_torque, Z.duration]
"""


class Kinds:
    """Folders of results by their kinds, below one folder."""

    def __init__(self, folder: Path, fmus: Path) -> None:
        self.folder, self._fmus = folder, fmus
        short_scenario(folder)
        (folder / "logged.yaml").write_text(LOGGED, encoding="utf-8")
        (folder / "study.yaml").write_text(STUDY, encoding="utf-8")

    def __getitem__(self, kind: str) -> Path:
        """The folder of a kind's result."""
        place = self.folder / kind
        if (place / "report.html").exists():
            return place
        if kind == "identify":
            with call_context(Call({}, command_line)):
                result_of(identified()).save(place)
        elif kind in ("circle", "stop"):
            run = circle_run() if kind == "circle" else positioning_run()
            with call_context(Call({"scenario": run.scenario}, command_line)):
                write_run(run, evaluate(run), place)
        else:
            needs, words = COMMANDS[kind]
            for each in needs:
                if each != kind:
                    self[each]
            place.mkdir(exist_ok=True)
            done = feedsim(*words.split(), fmus=self._fmus, cwd=self.folder)
            assert done.returncode == 0 or kind == "compare", (words, done.stderr)
        assert (place / "report.html").exists()
        return place

    def page(self, kind: str) -> Path:
        """The page of a kind's result."""
        return self[kind] / "report.html"
