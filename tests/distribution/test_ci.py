"""What integrators put into their CI, in the shell that it runs there: planted faults fail, each as what it is."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import pytest
import yaml

from feedsim_distribution import backend, shipped

ROOT = Path(__file__).resolve().parents[2]
CI = ROOT / "ci"
SHELL = shutil.which("sh")

pytestmark = pytest.mark.skipif(SHELL is None or os.name == "nt", reason="runs the shell of a CI")


@pytest.fixture
def job(tmp_path: Path) -> Path:
    """A job's folder: references, results that agree."""
    for folder in ("references", "results"):
        (tmp_path / folder).mkdir()
        for name in ("one", "two"):
            (tmp_path / folder / f"{name}.csv").write_text("time [s],x [m],y [m]\n0,1.0,1.0\n1,2.0,1.0\n2,3.0,1.0\n")
    return tmp_path


def different(job: Path) -> None:
    (job / "results" / "one.csv").write_text("time [s],x [m],y [m]\n0,1.0,1.0\n1,2.2,1.0\n2,3.0,1.0\n")


def missing(job: Path) -> None:
    (job / "results" / "two.csv").unlink()


def script(job: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    return steps('sh "$CI_FOLDER/compare.sh" "$RESULTS" "$REFERENCES" $OPTIONS', job, variables, ("sh", "-euc"))


def github(job: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    """The action's step: its environment from its inputs, its shell as the runner starts it."""
    action: dict[str, Any] = yaml.safe_load((CI / "action.yml").read_text())
    (step,) = action["runs"]["steps"]
    assert step["shell"] == "bash"
    inputs = {name: variables.get(name.upper(), given.get("default", "")) for name, given in action["inputs"].items()}
    assert all("default" in given or given.get("required") for given in action["inputs"].values())

    def filled(text: str) -> str:
        text = text.replace("${{ github.action_path }}", str(CI))
        return re.sub(r"\$\{\{ inputs\.(\w+) \}\}", lambda found: inputs[found[1]], text)

    environment = {name: filled(text) for name, text in step["env"].items()}
    assert not [text for text in (*environment.values(), step["run"]) if "${{" in text]
    return steps(step["run"], job, environment, ("bash", "--noprofile", "--norc", "-eo", "pipefail", "-c"))


def gitlab(job: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    template = yaml.safe_load((CI / "gitlab.yml").read_text())[".feedsim-compare"]
    assert template["artifacts"]["reports"]["junit"] in template["artifacts"]["paths"]
    environment = template["variables"] | variables | {"FEEDSIM_CI": str(CI)}
    return steps("\n".join(template["script"]), job, environment, ("bash", "-eo", "pipefail", "-c"))


def steps(text: str, job: Path, variables: dict[str, str], shell: tuple[str, ...]) -> subprocess.CompletedProcess[str]:
    here = {"PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}", "CI_FOLDER": str(CI)}
    given = {"RESULTS": "results", "REFERENCES": "references", "OPTIONS": ""} | variables
    return subprocess.run(
        [*shell, text], cwd=job, env=os.environ | here | given, capture_output=True, text=True, check=False
    )


def told(job: Path) -> tuple[int, int]:
    """Failures and errors of the JUnit file."""
    cases = list(ET.parse(job / "feedsim.xml").iter("testcase"))
    assert cases
    return sum(case.find("failure") is not None for case in cases), sum(
        case.find("error") is not None for case in cases
    )


WAYS = [script, github, gitlab]


@pytest.mark.parametrize("way", WAYS)
def test_agreement_passes(way: Any, job: Path) -> None:
    done = way(job, RESULTS="results", REFERENCES="references")
    assert done.returncode == 0, done.stderr
    assert told(job) == (0, 0)


@pytest.mark.parametrize("way", WAYS)
def test_a_planted_difference_is_a_failure_and_a_missing_result_an_error(way: Any, job: Path) -> None:
    different(job)
    assert way(job, RESULTS="results", REFERENCES="references").returncode == 1
    assert told(job) == (1, 0)
    missing(job)
    assert way(job, RESULTS="results", REFERENCES="references").returncode == 2
    failures, errors = told(job)
    assert (failures, errors) == (1, 1)


@pytest.mark.parametrize("way", WAYS)
def test_options_reach_the_command(way: Any, job: Path) -> None:
    different(job)
    done = way(job, RESULTS="results", REFERENCES="references", OPTIONS="--tol x=0.5")
    assert done.returncode == 0, done.stdout + done.stderr


def test_without_feedsim_it_says_what_to_set(job: Path) -> None:
    done = subprocess.run(
        ["/bin/sh", str(CI / "compare.sh"), "results", "references"],
        cwd=job, env={"PATH": "/usr/bin:/bin"}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert "FEEDSIM names the wheel to install" in done.stderr


def test_what_cannot_be_installed_is_no_success(job: Path) -> None:
    done = script(job, FEEDSIM="./no-such.whl", PIP_NO_INDEX="1", PYTHON=sys.executable)
    assert done.returncode == 2


def test_a_wheel_that_is_named_is_installed(fmus: Path, job: Path) -> None:
    """The packages that it needs are borrowed: the job of a CI has an index, a test has none."""
    (job / "dist").mkdir()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(shipped, "zig", lambda: tuple(backend.toolchain.find_compiler()))
        name = backend.build_wheel(str(job / "dist"), {"platform": "any", "archives": str(fmus)})
    borrowed = os.pathsep.join(path for path in sys.path if path.endswith("site-packages"))
    done = script(
        job, FEEDSIM=f"./dist/{name}", PIP_NO_INDEX="1", PIP_NO_DEPS="1", PYTHONPATH=borrowed, PYTHON=sys.executable
    )
    assert done.returncode == 0, done.stderr
    assert told(job) == (0, 0)
