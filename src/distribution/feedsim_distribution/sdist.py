"""Sources -> the source archive, from which pip builds the same wheel as from a checkout."""

import gzip
import io
import tarfile
from pathlib import Path

from feedsim_packager import archive, checkout

from . import metadata
from .project import PROJECT, files, table
from .shipped import SCENARIOS
from .wheel import PACKAGES

_PAGES = ("pyproject.toml", "README.md", "LICENSE", "CHANGELOG.md", "SECURITY.md")


def write(folder: Path) -> str:
    """Write the source archive into `folder`; returns its name."""
    project = table()
    stem = f"{project['name']}-{project['version']}"
    units = [path.name.removesuffix("_fmu") for path in checkout.unit_folders()]
    references = [f"tests/reference/{name}" for name in ("integrators.md", *units)]  # parts of the archives
    sources = files(*_PAGES, PACKAGES[0], "src", SCENARIOS, *references)
    content = {path.relative_to(PROJECT).as_posix(): path.read_bytes() for path in sources}
    content["PKG-INFO"] = metadata.describe().encode()
    packed = io.BytesIO()
    with tarfile.open(fileobj=packed, mode="w", format=tarfile.PAX_FORMAT) as made:
        for name, data in sorted(content.items()):
            entry = tarfile.TarInfo(f"{stem}/{name}")
            entry.size, entry.mode = len(data), 0o644
            made.addfile(entry, io.BytesIO(data))
    name = f"{stem}.tar.gz"
    archive.write(folder / name, gzip.compress(packed.getvalue(), mtime=0))
    return name
