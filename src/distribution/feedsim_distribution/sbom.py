"""The lock file -> a bill of materials in CycloneDX 1.5 (JSON): what is in the artefacts, or beside them."""

import json
import re
import uuid
from typing import Any

from .project import PROJECT, table

_PINNED = re.compile(r"^([\w.-]+)==([^\s;\\]+)((?:[^\n]*\\\n[^\n]*)*)", re.MULTILINE)
_HEADERS = "FMI headers of the Modelica Association"


def describe() -> bytes:
    """The bill of this version; neither date nor machine is in it, and its serial number follows from its content."""
    project = table()
    reference = f"pkg:pypi/{project['name']}@{project['version']}"
    parts = _components()
    bill: dict[str, Any] = {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "metadata": {
            "component": {
                "type": "application",
                "bom-ref": reference,
                "name": project["name"],
                "version": project["version"],
                "purl": reference,
                "licenses": [{"expression": project["license"]}],
            }
        },
        "components": parts,
        "dependencies": [{"ref": reference, "dependsOn": [part["bom-ref"] for part in parts]}],
    }
    serial = uuid.uuid5(uuid.NAMESPACE_URL, json.dumps(bill, sort_keys=True))
    return (json.dumps({**bill, "serialNumber": f"urn:uuid:{serial}"}, indent=1) + "\n").encode()


def _components() -> list[dict[str, Any]]:
    """Headers in the C sources, the font of pictures, then the locked packages, which are installed beside feedsim."""
    result: list[dict[str, Any]] = [
        {
            "type": "library",
            "bom-ref": "fmi-headers@2.0.4",
            "name": _HEADERS,
            "version": "2.0.4",
            "scope": "required",
            "licenses": [{"license": {"id": "BSD-2-Clause"}}],
        },
        {
            "type": "data",
            "bom-ref": "dejavu-sans@2.37",
            "name": "DejaVu Sans (part)",
            "version": "2.37",
            "scope": "required",
            "licenses": [{"license": {"id": "Bitstream-Vera"}}],
        },
    ]
    lock = (PROJECT / "requirements.lock").read_text(encoding="utf-8")
    for name, version, hashes in _PINNED.findall(lock):
        reference = f"pkg:pypi/{name.lower()}@{version}"
        result.append(
            {
                "type": "library",
                "bom-ref": reference,
                "name": name,
                "version": version,
                "purl": reference,
                "scope": "optional",
                "properties": [
                    {"name": "feedsim:accepted-sha256", "value": digest}
                    for digest in re.findall(r"--hash=sha256:([0-9a-f]{64})", hashes)
                ],
            }
        )
    return result
