"""What integrators put into their CI, in the shell that it runs there: planted faults fail, each as what it is."""

from __future__ import annotations

import hashlib
import json
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


def broken(job: Path) -> None:
    (job / "results" / "two.csv").write_bytes(b"\x00\xff no table")


def script(job: Path, **variables: str) -> subprocess.CompletedProcess[str]:
    return steps('sh "$CI_FOLDER/compare.sh" $OPTIONS -- "$RESULTS" "$REFERENCES"', job, variables, ("sh", "-euc"))


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
    """Failures and errors of the JUnit file: as its cases are, and as its head counts them, which CIs show."""
    root = ET.parse(job / "feedsim.xml").getroot()
    cases = list(root.iter("testcase"))
    assert cases
    counted = tuple(sum(case.find(what) is not None for case in cases) for what in ("failure", "error"))
    assert counted == (int(root.attrib["failures"]), int(root.attrib["errors"]))
    return counted[0], counted[1]


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
    assert told(job) == (1, 1)


@pytest.mark.parametrize("way", WAYS)
def test_a_result_that_cannot_be_read_is_an_error(way: Any, job: Path) -> None:
    broken(job)
    assert way(job, RESULTS="results", REFERENCES="references").returncode == 2
    assert told(job) == (0, 1)


@pytest.mark.parametrize("way", WAYS)
def test_options_reach_the_command(way: Any, job: Path) -> None:
    different(job)
    done = way(job, RESULTS="results", REFERENCES="references", OPTIONS="--tol x=0.5")
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("name", ["--report=x", "-r", "--quiet"])
@pytest.mark.parametrize("way", WAYS)
def test_a_name_is_no_option(way: Any, name: str, job: Path) -> None:
    """Of a folder of results, whoever has named it."""
    (job / "results").rename(job / name)
    done = way(job, RESULTS=name, REFERENCES="references")
    assert done.returncode == 0, done.stdout + done.stderr
    assert told(job) == (0, 0)
    assert {path.name for path in job.iterdir()} == {name, "references", "feedsim.xml"}


def test_one_image_is_pinned_everywhere() -> None:
    template = yaml.safe_load((CI / "gitlab.yml").read_text())[".feedsim-compare"]
    (line,) = re.findall(r"^FROM (.*)$", (CI / "Containerfile").read_text(), re.M)
    assert template["image"] == line
    assert re.fullmatch(r"python:3\.12-slim@sha256:[0-9a-f]{64}", line)


def test_packages_of_a_comparison_are_those_of_the_lock() -> None:
    """The same versions with the same hashes as everywhere else, and none that a comparison does not need."""
    whole, part = (
        {block.partition(" \\")[0]: block for block in re.split(r"\n(?=\w)", path.read_text())}
        for path in (ROOT / "requirements.lock", CI / "requirements.lock")
    )
    hashes = re.compile(r"--hash=sha256:[0-9a-f]{64}")
    assert "numpy" in str(part)
    for name, block in part.items():
        assert hashes.findall(block) == hashes.findall(whole[name]), name
        assert hashes.findall(block)
    assert not {"scipy", "fmpy", "matplotlib"} & {name.partition("==")[0] for name in part}


def test_without_feedsim_it_says_what_to_set(job: Path) -> None:
    done = subprocess.run(
        ["/bin/sh", str(CI / "compare.sh"), "results", "references"],
        cwd=job, env={"PATH": "/usr/bin:/bin"}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 2
    assert "FEEDSIM names the wheel to install" in done.stderr


@pytest.mark.extensive
def test_what_cannot_be_installed_is_no_success(job: Path) -> None:
    done = script(job, FEEDSIM="./no-such.whl", PIP_NO_INDEX="1", PYTHON=sys.executable)
    assert done.returncode == 2


# The packages that a wheel needs are borrowed: the job of a CI has an index, a test has none.
BORROWED = {
    "PIP_NO_INDEX": "1",
    "PIP_NO_DEPS": "1",
    "PYTHONPATH": os.pathsep.join(path for path in sys.path if path.endswith("site-packages")),
}


@pytest.fixture(scope="module")
def wheel(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Without native libraries: no compiler for another platform is needed."""
    folder = tmp_path_factory.mktemp("dist")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(shipped, "zig", lambda: tuple(backend.toolchain.find_compiler()))
        patch.setattr(shipped, "zig_for_pages", lambda: None)  # this machine's, if it has one
        patch.setattr(shipped, "PLATFORMS", ())
        return folder / backend.build_wheel(str(folder), {"platform": "any", "archives": str(fmus)})


@pytest.mark.extensive
@pytest.mark.parametrize("way", WAYS[1:])
def test_a_wheel_that_is_named_is_installed(way: Any, wheel: Path, job: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where no feedsim is on the search path."""
    for name, value in (BORROWED | {"PYTHON": sys.executable}).items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(sys, "executable", str(job / "nowhere" / "python"))
    different(job)
    done = way(job, RESULTS="results", REFERENCES="references", FEEDSIM=str(wheel), OPTIONS="--quiet")
    assert done.returncode == 1, done.stderr
    assert told(job) == (1, 0)


@pytest.mark.extensive
@pytest.mark.parametrize("way", WAYS)
def test_a_wheel_is_held_to_its_sum(way: Any, wheel: Path, job: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in (BORROWED | {"PYTHON": sys.executable}).items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(sys, "executable", str(job / "nowhere" / "python"))
    shutil.copy(wheel, job)
    sums = hashlib.sha256(wheel.read_bytes()).hexdigest(), "0" * 64
    for digest, code in zip(sums, (0, 2), strict=True):
        given = {"FEEDSIM": wheel.name, "FEEDSIM_SHA256": digest, "SHA256": digest, "OPTIONS": "--quiet"}
        assert way(job, RESULTS="results", REFERENCES="references", **given).returncode == code


@pytest.mark.extensive
def test_the_job_of_the_documents(wheel: Path, job: Path, fmus: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its steps in their order: what a runner's own actions bring is there, what is run is run by bash."""
    text = (ROOT / "docs" / "comparing.md").read_text("utf-8")
    (block,) = (each for each in re.findall(r"^```yaml\n(.*?)^```", text, re.M | re.S) if "runs-on:" in each)
    work = yaml.safe_load(block)["jobs"]["compare"]["steps"]
    shutil.copytree(CI, job / "ci")
    shutil.copytree(fmus, job / "fmus")
    for folder in ("references", "results"):
        shutil.rmtree(job / folder)
    used = []
    for step in work:
        if "run" in step:
            if step["run"] == "pip install fmpy":
                continue
            assert steps(step["run"], job, {}, ("bash", "-e", "-c")).returncode == 0
        used.append(step.get("uses", "run"))
        if used[-1] == "./ci":
            given = {name.upper(): value for name, value in step["with"].items() if name != "feedsim"}
            assert github(job, **given).returncode == 0
            assert told(job) == (0, 0)
            changed = next((job / "results" / "friction").rglob("stick_ref.csv"))
            rows = changed.read_text().splitlines()
            at = len(rows) // 2
            time, first, *others = rows[at].split(",")
            rows[at] = ",".join([time, str(float(first) + 1.0), *others])
            changed.write_text("\n".join(rows))
            assert github(job, **given).returncode == 1
            assert told(job) == (1, 0)
    assert used == ["actions/checkout@v4", "actions/setup-python@v5", "run", "./ci", "actions/upload-artifact@v4"]


@pytest.mark.extensive
def test_a_container_runs_feedsim(wheel: Path, job: Path) -> None:
    """Its instructions in their order, by hand: files copied, the shell's lines run, the entry point with arguments.

    Below a folder in place of the container's root, in an environment in place of its image.
    """
    text = (CI / "Containerfile").read_text().replace("\\\n", "")
    root, home = job / "root", job / "image"
    subprocess.run([sys.executable, "-m", "venv", str(home)], check=True)
    kept = {name: value for name, value in os.environ.items() if name != "CC"}
    environment = kept | BORROWED | {"PATH": f"{home / 'bin'}{os.pathsep}/usr/bin{os.pathsep}/bin"}
    given, folder, done = {"WHEEL": wheel.name}, root, []

    def inside(text: str) -> str:
        """Paths of the container, arguments filled in."""
        filled = re.sub(r"\$\{(\w+)\}", lambda found: given[found[1]], text)
        return re.sub(r"(?<![\w.\]])/(?=wheels|work)", f"{root}/", filled)

    for line in text.splitlines():
        instruction, _, rest = line.partition(" ")
        done.append(instruction)
        if instruction == "ARG":
            assert rest in given
        elif instruction == "COPY":
            *sources, place = inside(rest).split()
            Path(place).mkdir(parents=True)
            for source in sources:
                shutil.copy(ROOT / source if source == "requirements.lock" else wheel.parent / source, place)
        elif instruction == "RUN":
            subprocess.run(["/bin/sh", "-c", inside(rest)], env=environment, check=True, cwd=folder)
        elif instruction == "WORKDIR":
            folder = Path(inside(rest))
            folder.mkdir(parents=True, exist_ok=True)
        elif instruction == "ENTRYPOINT":
            command = [*json.loads(rest), "compare", str(job / "results"), str(job / "references")]
            assert subprocess.run(command, env=environment, cwd=folder, check=False).returncode == 0
        else:
            assert instruction in ("FROM", "#")
    assert [each for each in done if each != "#"] == ["FROM", "ARG", "COPY", "RUN", "WORKDIR", "ENTRYPOINT"]
    assert not (root / "wheels").exists()
