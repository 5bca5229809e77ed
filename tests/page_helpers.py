"""Pages in node: their scripts, driven by a few lines, with a page's own data."""

from __future__ import annotations

import json
import shutil
import subprocess
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from feedsim.foundation.errors import Finding
from feedsim.report.live_page.html import computing_script

NODE = shutil.which("node")
MAIN = """
const [file, asked] = process.argv.slice(2, 4).map(name => JSON.parse(require("fs").readFileSync(name, "utf8")));
const plain = value => Array.from(value);
work_of(file).then(async work => {
  const found = [];
  for (const { state, axis, keep } of asked) {
    try {
      const run = await work.run(state), trace = {};
      for (const name of keep || []) trace[name] = plain(run.trace[name]);
      const loop = axis ? await work.bode(state, axis) : null;
      found.push({ figures: run.figures, warnings: run.warnings, trace, loop, segments: run.segments,
                   rows: keep ? plain(run.rows) : [] });
    } catch (error) { found.push({ problem: String(error.message || error) }); }
  }
  const lost = value => typeof value === "number" && !Number.isFinite(value);
  const text = JSON.stringify(found, (key, value) => lost(value) ? String(value) : value);
  require("fs").writeFileSync(process.argv[4], text);
});
"""


def answers(data: dict[str, Any], asked: list[dict[str, Any]], folder: Path) -> list[dict[str, Any]]:
    """What the page's worker computes for states of its knobs: figures, warnings, columns to `keep`, `axis`'s loop."""
    assert NODE is not None
    (folder / "data.json").write_text(json.dumps(data))
    (folder / "asked.json").write_text(json.dumps(asked))
    (folder / "main.js").write_text('"use strict";\n' + computing_script() + MAIN)
    command = [NODE, "main.js", "data.json", "asked.json", "found.json"]
    done = subprocess.run(command, cwd=folder, capture_output=True, encoding="utf-8", check=False)
    assert done.returncode == 0, done.stderr
    found: list[dict[str, Any]] = json.loads((folder / "found.json").read_text())
    return found


def without_loops(warnings: Iterable[Finding]) -> list[str]:
    """What a run warns of and a page does, too: a page does not judge loops, it has a frequency response."""
    return sorted(finding.text for finding in warnings if finding.code not in ("loop-unstable", "loop-margins-thin"))
