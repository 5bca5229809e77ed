"""Python files, what is shipped with them and metadata -> a wheel, whose bytes depend on nothing else."""

import base64
import hashlib
import io
import zipfile
from collections.abc import Mapping
from pathlib import Path

from feedsim_packager import archive

from . import metadata
from .project import PROJECT, files, table
from .shipped import Shipped

PACKAGES = ("master/feedsim", "src/packager/feedsim_packager")
_EPOCH = (1980, 1, 1, 0, 0, 0)
_EXECUTABLE = (".so", ".dll", ".dylib")


def write(folder: Path, shipped: Shipped) -> str:
    """Write the wheel into `folder`; returns its name."""
    project = table()
    tags = f"py3-none-{shipped.platform}"
    stem = f"{project['name']}-{project['version']}"
    information = f"{stem}.dist-info"
    said = {
        f"{information}/METADATA": metadata.describe().encode(),
        f"{information}/WHEEL": metadata.wheel(shipped.platform).encode(),
        f"{information}/entry_points.txt": metadata.entry_points().encode(),
        **{f"{information}/licenses/{name}": (PROJECT / name).read_bytes() for name in project["license-files"]},
    }
    content = {**dict(sorted({**python(), **shipped.files}.items())), **said}
    record = f"{information}/RECORD"
    content[record] = _record(content, record)
    name = f"{stem}-{tags}.whl"
    archive.write(folder / name, _zip(content))
    return name


def python() -> dict[str, bytes]:
    """The files of the packages by their paths in the wheel."""
    result: dict[str, bytes] = {}
    for package in PACKAGES:
        above = (PROJECT / package).parent
        result |= {path.relative_to(above).as_posix(): path.read_bytes() for path in files(package)}
    return result


def _record(content: Mapping[str, bytes], record: str) -> bytes:
    lines = []
    for name, data in content.items():
        digest = base64.urlsafe_b64encode(hashlib.sha256(data).digest()).rstrip(b"=").decode()
        lines.append(f"{name},sha256={digest},{len(data)}\n")
    return "".join((*lines, f"{record},,\n")).encode()


def _zip(content: Mapping[str, bytes]) -> bytes:
    """In the order given: what a wheel says of itself comes last."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as made:
        for name, data in content.items():
            entry = zipfile.ZipInfo(name, _EPOCH)
            entry.create_system = 3  # Unix, on every machine
            entry.compress_type = zipfile.ZIP_STORED if name.endswith(".fmu") else zipfile.ZIP_DEFLATED
            entry.external_attr = (0o100755 if name.endswith(_EXECUTABLE) else 0o100644) << 16
            made.writestr(entry, data, compresslevel=9)
    return buffer.getvalue()
