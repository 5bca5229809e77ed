"""What a release holds, and that it is the same when it is made again."""

from __future__ import annotations

import hashlib
import io
import json
import re
import zipfile
from pathlib import Path

import pytest

from feedsim.foundation.installation import library_name
from feedsim_distribution import backend, metadata, release, shipped
from feedsim_distribution.project import table
from feedsim_packager import checkout, targets, toolchain
from feedsim_packager.errors import InputError
from feedsim_packager.targets import host_target

ROOT = Path(__file__).resolve().parents[2]
HERE = host_target().folder
VERSION = str(table()["version"])


@pytest.fixture(scope="module")
def made(fmus: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """By this machine's compiler, with libraries for this platform alone; zig makes those of the others."""
    if HERE not in shipped.PLATFORMS:
        pytest.skip(f"the wheel has no libraries for {HERE}")
    folder = tmp_path_factory.mktemp("release")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(shipped, "zig", toolchain.find_compiler)
        patch.setattr(shipped, "zig_for_pages", lambda: None)  # this machine's, if it has one
        patch.setattr(shipped, "PLATFORMS", (HERE,))
        site = folder / "site"  # what a build of the pages leaves, in small
        (site / "how-to").mkdir(parents=True)
        for name in ("index.html", "how-to/page.html", ".buildinfo"):
            (site / name).write_text(f"<p>{name}</p>")
        for name in ("first", "second"):
            release.write(folder / name, fmus, site)
    return folder


def sums_of(text: str) -> dict[str, str]:
    return {line[66:]: line[:64] for line in text.splitlines()}


@pytest.mark.extensive
def test_the_same_again(made: Path) -> None:
    first = {path.name: path.read_bytes() for path in (made / "first").iterdir()}
    assert first == {path.name: path.read_bytes() for path in (made / "second").iterdir()}
    assert len(first) == 7
    assert first["requirements.lock"] == (ROOT / "requirements.lock").read_bytes()


@pytest.mark.extensive
def test_wheels_hold_the_documentation(made: Path) -> None:
    for path in (made / "first").glob("*.whl"):
        with zipfile.ZipFile(path) as opened:
            pages = [name for name in opened.namelist() if name.startswith("feedsim/shipped/site/")]
        assert pages == ["feedsim/shipped/site/how-to/page.html", "feedsim/shipped/site/index.html"]


@pytest.mark.extensive
def test_sums_are_of_every_file(made: Path) -> None:
    folder = made / "first"
    sums = sums_of((folder / "SHA256SUMS").read_text())
    assert set(sums) == {path.name for path in folder.iterdir()} - {"SHA256SUMS"}
    assert all(hashlib.sha256((folder / name).read_bytes()).hexdigest() == digest for name, digest in sums.items())


@pytest.mark.extensive
def test_units_come_with_references_icons_and_sums(made: Path, fmus: Path) -> None:
    with zipfile.ZipFile(made / "first" / f"feedsim-fmus-{VERSION}.zip") as opened:
        files = {name: opened.read(name) for name in opened.namelist()}
    for unit in ("plant", "controller", "friction", "friction_gms", "setpoint"):
        assert files[f"{unit}.fmu"] == (fmus / f"{unit}.fmu").read_bytes()
        assert files[f"icons/{unit}.png"].startswith(b"\x89PNG")
        assert [name for name in files if name.startswith(f"references/{unit}/") and name.endswith(".csv")]
        assert f"| `{unit}.fmu` |" in files["README.md"].decode()
        with zipfile.ZipFile(io.BytesIO(files[f"{unit}.fmu"])) as archive:
            assert "modelDescription.xml" in archive.namelist()
    for path in (ROOT / "ci").iterdir():
        assert files[f"ci/{path.name}"] == path.read_bytes()
    sums = sums_of(files["SHA256SUMS"].decode())
    assert set(sums) == set(files) - {"SHA256SUMS"}
    assert all(hashlib.sha256(files[name]).hexdigest() == digest for name, digest in sums.items())


@pytest.mark.extensive
def test_the_wheel_is_for_every_platform_and_has_its_libraries(made: Path) -> None:
    (path,) = (made / "first").glob("*.whl")
    assert path.name == f"feedsim-{VERSION}-py3-none-any.whl"
    with zipfile.ZipFile(path) as opened:
        libraries = {name.rpartition("/")[2] for name in opened.namelist() if "/shipped/fmus/" in name}
        assert {library_name(name) for name in ("exchange", "planner")} <= libraries
        assert "Root-Is-Purelib: true" in opened.read(f"feedsim-{VERSION}.dist-info/WHEEL").decode()


def test_libraries_of_all_platforms_lie_side_by_side() -> None:
    endings = [targets.ALL[name].ending for name in shipped.PLATFORMS]
    assert endings == [".so", "-aarch64.so", ".dll", ".dylib"]
    assert library_name("exchange") == f"exchange{host_target().ending}"


@pytest.mark.extensive
def test_bill_of_materials_has_what_is_locked(made: Path) -> None:
    bill = json.loads((made / "first" / f"feedsim-{VERSION}.cdx.json").read_text())
    assert (bill["bomFormat"], bill["specVersion"]) == ("CycloneDX", "1.5")
    assert re.fullmatch(r"urn:uuid:[0-9a-f]{8}(-[0-9a-f]{4}){3}-[0-9a-f]{12}", bill["serialNumber"])
    lines = (ROOT / "requirements.lock").read_text().splitlines()
    locked = {line.split("==")[0] for line in lines if "==" in line and not line.startswith((" ", "#"))}
    held = {part["name"]: part for part in bill["components"]}
    assert set(held) - {"FMI headers of the Modelica Association", "DejaVu Sans (part)"} == locked
    digests = [each["value"] for each in held["numpy"]["properties"]]
    assert digests
    assert all(f"--hash=sha256:{digest}" in "".join(lines) for digest in digests)


@pytest.mark.extensive
def test_changes_are_those_of_the_changelog(made: Path) -> None:
    notes = (made / "first" / f"feedsim-{VERSION}-changes.md").read_text()
    head, changes = notes.split("\n\n", 1)
    assert head == f"# feedsim {VERSION}"
    assert "### " in changes  # kinds of changes, behind a sentence on the version where it has one
    assert changes.strip() in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert "\n## [" not in notes


def test_archives_that_are_missing_are_told(tmp_path: Path) -> None:
    (tmp_path / "plant.fmu").write_bytes(b"")
    with pytest.raises(
        InputError,
        match=r"has no controller\.fmu, friction\.fmu, friction_gms\.fmu, machine\.fmu, setpoint\.fmu; make fmus-all",
    ):
        shipped.for_every_machine(("cc",), tmp_path)
    with pytest.raises(InputError, match="platform win64: no wheel is made for it; there is any, for all platforms"):
        backend.build_wheel(str(tmp_path), {"platform": "win64"})


def test_the_page_of_an_index_has_no_link_that_leads_nowhere() -> None:
    """Beside it lies none of the files that the README links to."""
    target = re.compile(r"\]\((?!\w+:)")
    page = metadata.describe()
    assert target.search((ROOT / "README.md").read_text(encoding="utf-8"))
    assert not target.search(page)
    assert "](" not in page.replace("](https://", "")
    assert "synthetic; three axes" in page  # words stay
    addressed = table() | {"urls": {"Repository": "https://repository.example/feedsim/"}}
    page = metadata.readable_anywhere((ROOT / "README.md").read_text(encoding="utf-8"), addressed)
    assert not target.search(page)
    assert f"(https://repository.example/feedsim/blob/v{VERSION}/docs/python.md)" in page
    assert f"](https://repository.example/feedsim/raw/v{VERSION}/docs/images/contour-XZ.png)" in page


def test_an_index_learns_whose_and_what_for_it_is() -> None:
    lines = metadata.describe().partition("\n\n")[0].splitlines()
    assert "Author: The feedsim authors" in lines
    assert any(line.startswith("Keywords: machine tool,feed drive,friction") for line in lines)
    assert {"Classifier: Programming Language :: Python :: 3.11", "Classifier: Typing :: Typed"} <= set(lines)
    assert not [line for line in lines if line.startswith("Classifier: License")]  # the licence has its own field
    assert "License-Expression: MIT AND Bitstream-Vera" in lines  # the latter: the font of pictures
    named = [line.partition(": ")[2] for line in lines if line.startswith("License-File: ")]
    assert named == ["LICENSE", "master/feedsim/report/fonts/LICENSE"]
    assert all((ROOT / name).is_file() for name in named)
    assert not [line for line in lines if "example" in line or "OWNER" in line]


def test_every_unit_is_in_the_readme() -> None:
    page = (ROOT / "README.md").read_text(encoding="utf-8")
    for folder in checkout.unit_folders():
        assert f"\n| `{folder.name.removesuffix('_fmu')}.fmu` |" in page
