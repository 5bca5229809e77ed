"""What a page takes: a control cycle in WebAssembly against the native unit, in turns; and from knob to pictures.

Both drive the same unit `machine` over the same circle, with the same rows recorded: the native one as `coupling.units:
one` in the native loop, the page in node, or in Chromium with --browser. Times of a processor, without starting.
"""

from __future__ import annotations

import json
import shutil
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from feedsim import scenario  # noqa: E402
from feedsim.report.live_page import html  # noqa: E402
from feedsim.report.live_page.content import content  # noqa: E402
from feedsim.report.live_page.html import computing_script  # noqa: E402
from feedsim.simulation import cosim, nc  # noqa: E402
from feedsim.simulation.judge import judge_run  # noqa: E402
from page_helpers import NODE  # noqa: E402

ROUNDS, TURNS = 15, 50
CIRCLE = ROOT / "scenarios" / "xz_circle.yaml"
# One answer per line of input: CPU time of a run [s], by the unit's calls alone.
SERVED = """
const lines = require("readline").createInterface({ input: process.stdin });
const data = JSON.parse(require("fs").readFileSync(process.argv[2]));
work_of(data).then(work => {
  const { machine } = data, { parameters } = applied(data, data.knobs.map(knob => knob.value));
  const rows = plan(machine, data.motions, null).rows, ratio = Math.round(machine.cycles.T_pos / machine.cycles.T_c);
  const reals = machine.signals.map(name => machine.references[name][0]);
  lines.on("line", async () => {
    const begun = process.cpuUsage();
    const { feeds, every, cycles: { T_c } } = machine;
    await work.unit.run({ parameters, feeds, rows, ratio, every, T_c, reals, flags: [] });
    const used = process.cpuUsage(begun);
    console.log((used.user + used.system) / 1e6);
  });
  console.log("ready");
});
"""


def main() -> None:
    given = scenario.load(CIRCLE, ["coupling.units=one"])
    program = nc.plan(given)
    data = content(given, program).data
    cycles = round(program.duration / given.machine.cycles.T_c)
    with tempfile.TemporaryDirectory() as scratch:
        native, page = against_native(given, program, data, Path(scratch))
        ratio = statistics.median(b / a for a, b in zip(native, page, strict=True))
        print(f"{cycles} control cycles, {ROUNDS} pairs, medians")
        print(f"native loop, one unit   {statistics.median(native) / cycles * 1e6:7.3f} us per cycle")
        print(
            f"WebAssembly in node     {statistics.median(page) / cycles * 1e6:7.3f} us per cycle, {ratio:.3f} of native"
        )
        if "--browser" in sys.argv:
            in_browser(given, program, Path(scratch))


def against_native(given: Any, program: Any, data: Any, folder: Path) -> tuple[list[float], list[float]]:
    """CPU times [s] of the runs, in turns; the first ones, in which both warm up, are left out."""
    assert NODE is not None
    (folder / "data.json").write_text(json.dumps(data))
    (folder / "served.js").write_text('"use strict";\n' + computing_script() + SERVED)
    server = subprocess.Popen(
        [NODE, "served.js", "data.json"], cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert server.stdin is not None
    assert server.stdout is not None
    server.stdout.readline()
    native, page = [], []
    for _ in range(ROUNDS + 3):
        native.append(judge_run(cosim.run(given, program=program, native=True)).wall_time)
        server.stdin.write("\n")
        server.stdin.flush()
        page.append(float(server.stdout.readline()))
    server.stdin.close()
    server.wait()
    return native[3:], page[3:]


def in_browser(given: Any, program: Any, folder: Path) -> None:
    """From a knob's turn to the pictures of the circle, in Chromium."""
    from playwright.sync_api import sync_playwright

    file = folder / "page.html"
    html.write(judge_run(cosim.run(given, program=program)), file)
    with sync_playwright() as api:
        chromium = shutil.which("chromium") or shutil.which("chromium-browser")
        browser = api.chromium.launch(executable_path=chromium, args=["--headless", "--no-sandbox", "--disable-gpu"])
        page = browser.new_page(viewport={"width": 1300, "height": 900})
        page.goto(file.as_uri())
        page.wait_for_selector("html[data-loops]", state="attached", timeout=60_000)
        # In the page: turn, wait for the mark of the pictures, and for the frame that shows them.
        turned = """async (slider, [turns]) => {
            const root = document.documentElement, taken = [];
            for (let k = 0; k < turns; k++) {
                await new Promise(done => setTimeout(done, 400));
                const begun = performance.now(), before = root.dataset.shown;
                slider.value = 180 + (k % 40);
                slider.dispatchEvent(new Event("input"));
                while (root.dataset.shown === before) await new Promise(done => requestAnimationFrame(done));
                await new Promise(done => requestAnimationFrame(done));
                taken.push(performance.now() - begun);
            }
            return taken;
        }"""
        slider = page.locator("#knobs input[type=range]").nth(2)
        taken = slider.evaluate(turned, [TURNS])
        print(f"knob to pictures        {statistics.median(taken):7.1f} ms, median of {TURNS} turns, {browser.version}")
        browser.close()


if __name__ == "__main__":
    begun = time.perf_counter()
    main()
    print(f"{time.perf_counter() - begun:.0f} s")
