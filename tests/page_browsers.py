"""Pages in real browsers: Chromium by playwright, Firefox by its own remote protocol, which needs no driver."""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pytest

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
FIREFOX = shutil.which("firefox-esr") or shutil.which("firefox")
FLAGS = [
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-component-update",
    "--disable-sync", "--no-first-run",
]  # fmt: skip
WAIT = 120.0  # s: a busy machine computes a second's work slowly
# Figures of the table as now shown; and whether the newest state is shown, judged and has its frequency response.
FIGURES = (
    "[...document.querySelectorAll('#figures tbody tr')]"
    ".map(row => [row.cells[0].textContent, row.cells[1].textContent])"
)
SETTLED = "(({ asked, loops }) => Boolean(asked) && asked === loops)(document.documentElement.dataset)"

SAVED = """() => {
    const make = URL.createObjectURL, click = HTMLAnchorElement.prototype.click;
    let saved = null;
    URL.createObjectURL = blob => { saved = blob; return "blob:"; };
    HTMLAnchorElement.prototype.click = () => {};
    try { document.getElementById("csv").click(); }
    finally { URL.createObjectURL = make; HTMLAnchorElement.prototype.click = click; }
    return saved.text();
}"""


@contextmanager
def chromium() -> Iterator[Any]:
    """Chromium without a window; a test that needs it is left out where there is none."""
    api = pytest.importorskip("playwright.sync_api", reason="playwright is not installed (requirements-dev.lock)")
    if CHROMIUM is None:
        pytest.skip("no Chromium on this machine (Debian: apt install chromium)")
    with api.sync_playwright() as started:
        try:
            found = started.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        except api.Error as error:
            pytest.skip(f"Chromium does not start here: {str(error).splitlines()[0]}")
        open_context = found.new_context

        def new_context(**given: Any) -> Any:
            context = open_context(**given)
            context.set_default_timeout(1e3 * WAIT)
            return context

        found.new_context, found.new_page = new_context, lambda **given: new_context(**given).new_page()
        yield found
        found.close()


def drawn(page: Any) -> None:
    """Wait until the page has drawn what it does in a frame or when it is idle, however long a busy machine takes."""
    page.evaluate(
        """async () => {
          for (let k = 0; k < 3; k++) {
            await new Promise(done => requestAnimationFrame(done));
            await new Promise(done => (window.requestIdleCallback || setTimeout)(done));
          }
        }"""
    )


class Opened:
    """A page in Chromium; `said` on its console, `asked` for."""

    def __init__(self, browser: Any, file: Path, width: int = 1300, address: str = "", **context: Any) -> None:
        self.context = browser.new_context(viewport={"width": width, "height": 900}, accept_downloads=True, **context)
        self.page = self.context.new_page()
        self.said: list[str] = []
        self.asked: list[str] = []
        self.page.on("console", lambda message: self.said.append(message.text))
        self.page.on("pageerror", lambda error: self.said.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.goto(file.as_uri() + address)

    def __enter__(self) -> Opened:
        return self

    def __exit__(self, *_: object) -> None:
        self.context.close()

    def count(self, what: str = "shown") -> int:
        return int(self.page.locator("html").get_attribute(f"data-{what}") or 0)

    def settled(self) -> None:
        """Until pictures, figures, warnings and frequency response are those of the newest state."""
        self.until(SETTLED)

    def until(self, holds: str) -> None:
        """Until the expression is true in the page."""
        # wait_for_function() evaluates text in the page, which the page's policy forbids.
        for _ in range(int(WAIT / 0.05)):
            if self.page.evaluate(holds):
                return
            self.page.wait_for_timeout(50)
        raise RuntimeError(f"not within {WAIT:g} s: {holds}")

    def turn_to(self, address: str) -> None:
        """Another state of the knobs, by the address that a link has; until all of it is shown."""
        before = self.count("asked")
        self.page.evaluate("address => { location.hash = address; }", address)
        self.until(f"document.documentElement.dataset.asked !== '{before}'")
        self.settled()

    def figures(self) -> dict[str, str]:
        return dict(self.page.evaluate(FIGURES))

    def csv(self) -> str:
        """What the page saves as CSV, without a download: Chromium sets no limit to how long one waits for that."""
        return str(self.page.evaluate(SAVED))

    def trace(self, columns: list[str]) -> dict[str, np.ndarray[Any, Any]]:
        head, *rows = self.csv().splitlines()
        names = head.split(",")
        values = np.loadtxt(rows, delimiter=",", usecols=[names.index(column) for column in columns], ndmin=2)
        return dict(zip(columns, values.T, strict=True))


class Firefox:
    """Firefox without a window, by the Marionette protocol: commands as JSON, each with its length ahead."""

    def __init__(self, folder: Path) -> None:
        assert FIREFOX is not None
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "user.js").write_text('user_pref("marionette.port", 0);\n')
        command = [
            FIREFOX,
            "--headless",
            "--marionette",
            "--no-remote",
            "--remote-allow-system-access",
            "--profile",
            str(folder),
        ]
        environment = {**os.environ, "HOME": str(folder), "MOZ_DISABLE_CONTENT_SANDBOX": "1"}
        quiet = subprocess.DEVNULL
        self._process = subprocess.Popen(command, stdout=quiet, stderr=quiet, env=environment)
        self._number, self._read = 0, b""
        self._socket = socket.create_connection(("127.0.0.1", self._port(folder / "MarionetteActivePort")), WAIT)
        self._answer()
        self.call("WebDriver:NewSession")

    def _port(self, file: Path) -> int:
        for _ in range(int(WAIT / 0.2)):
            if self._process.poll() is not None:
                raise RuntimeError(f"{FIREFOX} ended with status {self._process.returncode}")
            if file.is_file() and (text := file.read_text().strip()):
                return int(text)
            time.sleep(0.2)
        raise RuntimeError(f"{FIREFOX} does not answer")

    def _answer(self) -> Any:
        while b":" not in self._read:
            self._read += self._received()
        size, _, rest = self._read.partition(b":")
        while len(rest) < int(size):
            rest += self._received()
        self._read = rest[int(size) :]
        return json.loads(rest[: int(size)])

    def _received(self) -> bytes:
        if not (some := self._socket.recv(1 << 20)):
            raise RuntimeError(f"{FIREFOX} has closed the connection")
        return some

    def call(self, name: str, **values: Any) -> Any:
        self._number += 1
        text = json.dumps([0, self._number, name, values]).encode()
        self._socket.sendall(str(len(text)).encode() + b":" + text)
        _, _, error, found = self._answer()
        if error:
            raise RuntimeError(error["message"])
        return found

    def run(self, script: str, *values: Any) -> Any:
        """What an expression is in the page."""
        return self.call("WebDriver:ExecuteScript", script=f"return {script};", args=list(values))["value"]

    def open(self, file: Path, address: str = "") -> None:
        self.call("WebDriver:Navigate", url="about:blank")
        self.call("WebDriver:Navigate", url=file.as_uri() + address)
        self.settled()

    def settled(self) -> None:
        for _ in range(int(WAIT / 0.1)):
            if self.run(SETTLED):
                return
            time.sleep(0.1)
        raise RuntimeError("the page does not come to an end")

    def complaints(self) -> list[str]:
        """What stands on the console of the browser about the page."""
        self.call("Marionette:SetContext", value="chrome")
        try:
            found: list[str] = self.run(
                "Services.console.getMessageArray().filter(m => m instanceof Ci.nsIScriptError && /^(file|blob):/.test("
                "m.sourceName)).map(m => m.errorMessage)"
            )
            return found
        finally:
            self.call("Marionette:SetContext", value="content")

    def close(self) -> None:
        try:
            self.call("Marionette:Quit", flags=["eForceQuit"])
            self._process.wait(20)
        except (OSError, RuntimeError, subprocess.TimeoutExpired):
            self._process.kill()
        self._socket.close()


def address_of(data: dict[str, Any], state: list[Any]) -> str:
    """As a link has it."""
    pairs = (f"{quote(knob['key'])}={quote(str(value))}" for knob, value in zip(data["knobs"], state, strict=True))
    return "#" + "&".join(pairs)


def data_of(file: Path) -> dict[str, Any]:
    import re

    text = file.read_text(encoding="utf-8")
    found = re.search(r'<script type="application/json" id="feedsim-page">(.*?)</script>', text, re.DOTALL)
    assert found
    data: dict[str, Any] = json.loads(found[1])
    return data


def number_of(text: str) -> float:
    """Of a figure as shown."""
    return float(
        text.replace("−", "-").split()[0].replace("×10", "e").translate(str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789"))
    )
