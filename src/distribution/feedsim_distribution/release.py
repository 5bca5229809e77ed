"""Everything that is handed out of a version: ``python -m feedsim_distribution.release`` (make release).

The wheel, the source archive, the archives for other simulators in one file, the section of the
changelog, a bill of materials, the packages that a wheel needs with their hashes, and SHA-256 sums over all of them.
The same sources give the same bytes.
"""

import argparse
import hashlib
import re
import sys
import zipfile
from collections.abc import Iterator, Mapping
from pathlib import Path

from feedsim_packager import archive
from feedsim_packager.errors import InputError, PackagerError

from . import sbom, sdist, shipped, wheel
from .project import PROJECT, files, table

SUMS, LOCK = "SHA256SUMS", "requirements.lock"
_ABOUT = """# The feed drive units of feedsim {version}

FMI 2.0 co-simulation archives with binaries for Linux (x86-64, ARM 64 bit), Windows (x86-64) and macOS (Intel, Apple),
and with their sources. Each one is whole by itself: `documentation/index.html` inside has equations, variables, timing.
Their start values are those of a synthetic machine, which runs, but describes no machine you own.

| file | what it is |
|---|---|
{files}
| `references/UNIT` | to check an import with: inputs, parameters and results of each unit but the whole machine |
| `icons/UNIT.png` | the unit's picture |
| `ci/` | the same in your CI: a line each for a shell, GitHub Actions and GitLab, which is said in each file |
| `{sums}` | SHA-256 of every file here: `sha256sum --check {sums}` |

Through FMPy, with the wheel of this release, which compares; put your own importer in the place of `ci/simulate.py`:

    pip install fmpy feedsim-{version}-py3-none-any.whl
    python ci/simulate.py friction.fmu checked/references/friction checked/results/friction
    sh ci/compare.sh -- checked/results checked/references

An FMU is a program: to run it is to run its library with your rights. Licence: MIT (LICENSE).
"""


def write(folder: Path, archives: Path, site: Path) -> list[Path]:
    """Write all artefacts into `folder`; archives: for all platforms; site: folder of the documentation."""
    folder.mkdir(parents=True, exist_ok=True)
    version = str(table()["version"])
    notes = _notes(version)
    names = [wheel.write(folder, shipped.for_every_machine(shipped.zig(), archives, site)), sdist.write(folder)]
    made = {
        f"feedsim-fmus-{version}.zip": _units(archives, version),
        f"feedsim-{version}.cdx.json": sbom.describe(),
        f"feedsim-{version}-changes.md": notes.encode(),
        LOCK: (PROJECT / LOCK).read_bytes(),
    }
    for name, content in made.items():
        archive.write(folder / name, content)
    written = sorted(folder / name for name in (*names, *made))
    archive.write(folder / SUMS, _sums({path.name: path.read_bytes() for path in written}))
    return [*written, folder / SUMS]


def _units(archives: Path, version: str) -> bytes:
    """The archives, with what people want to see without opening one."""
    units = shipped.taken(archives)
    content: dict[str, bytes] = {"LICENSE": (PROJECT / "LICENSE").read_bytes()}
    content |= {path.relative_to(PROJECT).as_posix(): path.read_bytes() for path in files("ci")}
    lines = []
    for name, data in units.items():
        content[name] = data
        unit = name.removesuffix(".fmu")
        described = (PROJECT / "src" / f"{unit}_fmu" / "README.md").read_text(encoding="utf-8").splitlines()[0]
        lines.append(f"| `{name}` | {described.lstrip('# ')} |")
        content |= dict(_looked_at(archives / name, unit))
    content["README.md"] = _ABOUT.format(version=version, files="\n".join(lines), sums=SUMS).encode()
    return archive.pack(content | {SUMS: _sums(content)})


def _looked_at(path: Path, unit: str) -> Iterator[tuple[str, bytes]]:
    with zipfile.ZipFile(path) as opened:
        for name in opened.namelist():
            if name == "model.png":
                yield f"icons/{unit}.png", opened.read(name)
            elif name.startswith("extra/") and not name.endswith("/"):
                yield f"references/{unit}/{name.split('/', 2)[2]}", opened.read(name)


def _sums(files: Mapping[str, bytes]) -> bytes:
    return "".join(f"{hashlib.sha256(data).hexdigest()}  {name}\n" for name, data in sorted(files.items())).encode()


def _notes(version: str) -> str:
    """The changelog's section of a version, or, ahead of its release, what is unreleased."""
    text = (PROJECT / "CHANGELOG.md").read_text(encoding="utf-8")
    sections = {
        head: body for head, body in re.findall(r"^## \[([^\]]+)\][^\n]*\n(.*?)(?=^## \[|\Z)", text, re.M | re.S)
    }
    body = sections.get(version) or sections.get("Unreleased")
    if body is None:
        raise InputError(f"CHANGELOG.md: has no section [{version}] and none [Unreleased]")
    return f"# feedsim {version}\n\n{body.strip()}\n"


def main() -> int:
    parser = argparse.ArgumentParser(description="Write everything that is handed out of this version.")
    parser.add_argument("--archives", type=Path, required=True, help="folder of the archives for all platforms")
    parser.add_argument("--site", type=Path, required=True, help="folder of the documentation as a site")
    parser.add_argument("--out", type=Path, required=True, help="folder to write into")
    options = parser.parse_args()
    try:
        for path in write(options.out, options.archives, options.site):
            print(f"{path}: {path.stat().st_size / 1e6:.2f} MB")
    except PackagerError as error:
        print(f"error: {error}", file=sys.stderr)
        return error.exit_code
    return 0


if __name__ == "__main__":
    sys.exit(main())
