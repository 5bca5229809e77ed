"""A page in Chromium: knobs by keyboard, states, lessons, any width, no complaint, nothing asked for."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from feedsim import cli
from page_browsers import WAIT, Opened, data_of, number_of

SCENARIOS = Path(__file__).resolve().parents[2] / "scenarios"


@pytest.mark.extensive
def test_knobs_by_keyboard_undo_keep_and_take_away(browser: Any, files: dict[str, Path]) -> None:
    with Opened(browser, files["z_positioning"]) as opened:
        page = opened.page
        opened.settled()
        first = opened.figures()
        page.locator("#keep").click()
        slider = page.get_by_role("slider", name="axis Z, F_C: Coulomb friction torque, slider")
        slider.focus()
        before, asked = opened.count("loops"), opened.count("asked")
        for _ in range(5):
            page.keyboard.press("ArrowRight")
        page.keyboard.press("Tab")
        opened.until(f"document.documentElement.dataset.asked !== '{asked}'")
        opened.settled()
        assert opened.count("loops") > before
        assert opened.figures() != first
        assert page.locator("#figures thead th").all_inner_texts() == ["figure", "now", "kept", "as written"]
        assert page.locator("#stop-Z .legend button", has_text="kept").count() == 1
        assert "F_C" in page.url
        page.locator("#set").click()
        line = page.locator("#taken").input_value()
        assert line.startswith('--set "machine.axes.Z.friction.F_C=')
        assert line.endswith(' N.m"')
        page.locator("#yaml").click()
        assert page.locator("#taken").input_value().startswith("set:\n  machine.axes.Z.friction.F_C: ")
        while page.locator("#undo").is_enabled():
            page.locator("#undo").click()
        opened.settled()
        assert opened.figures() == first
        field = page.get_by_role("spinbutton", name="axis Z, T_n: speed controller integral-action time")
        field.fill("9")
        field.press("Enter")
        opened.settled()
        assert opened.figures() != first
        page.locator("#reset").click()
        opened.settled()
        assert opened.figures() == first
        assert opened.said == []


def test_what_a_run_refuses_is_said_and_nothing_freezes(browser: Any, files: dict[str, Path]) -> None:
    with Opened(browser, files["xz_circle"]) as opened:
        opened.settled()
        field = opened.page.get_by_role("spinbutton", name="motion 0: circle, feed: programmed speed along the path")
        field.fill("31000")
        field.press("Enter")
        opened.page.wait_for_selector("#problem:not([hidden])", timeout=1e3 * WAIT)
        assert "allowed at most" in opened.page.locator("#problem").inner_text()
        field.fill("3000")
        field.press("Enter")
        opened.settled()
        assert opened.page.locator("#problem").is_hidden()
        assert opened.said == []


LESSONS = {
    "xz_circle": {
        "Servo mismatch": {"machine.axes.Z.drive.K_v": 200 / 3},
        "quadrant glitch": {"machine.axes.Z.friction.F_C": 0.5, "machine.axes.Z.friction.F_S": 0.7},
        "Compensation, and too much": {"machine.axes.Z.drive.backlash_compensation.value": 0.0},
        "Margin against glitch": {"machine.axes.Z.drive.K_v": 110.0, "machine.axes.Z.drive.T_n": 0.008},
    },
    "z_positioning": {"Overshoot": {"machine.axes.Z.drive.T_sym": 0.003528}},
}


@pytest.mark.extensive
@pytest.mark.parametrize("name", LESSONS)
def test_lessons_begin_unsolved_and_can_be_solved(browser: Any, files: dict[str, Path], name: str) -> None:
    knobs = data_of(files[name])["knobs"]
    with Opened(browser, files[name]) as opened:
        page = opened.page
        opened.settled()
        assert page.locator("#lessons button").count() == len(LESSONS[name])
        page.locator("#lessons-part summary").press("Enter")
        for title, answer in LESSONS[name].items():
            page.locator("#lessons button", has_text=title).click()
            opened.settled()
            assert "✓" not in page.locator("#lesson-state").inner_text(), title
            assert page.locator(".knob.pointed").count() >= 1
            for key, value in answer.items():
                k = next(k for k, knob in enumerate(knobs) if knob["key"] == key)
                field = page.locator(f"#value-{k}")
                field.fill(repr(value * knobs[k]["factor"]))
                field.press("Enter")
            opened.settled()
            assert "✓" in page.locator("#lesson-state").inner_text(), (
                title,
                page.locator("#lesson-state").inner_text(),
            )
            page.locator("#lesson-end").click()
        assert opened.said == []


def test_without_scripts_the_scenario_is_shown_as_written(browser: Any, files: dict[str, Path]) -> None:
    with Opened(browser, files["xz_circle"], java_script_enabled=False) as opened:
        assert opened.page.locator("#contour-XZ svg.plot").is_visible()
        assert opened.page.locator("#figures tbody tr").count() > 10
        assert opened.page.locator("#knobs").is_hidden()
        # Nothing stands beside the picture then: it has the width of the page.
        assert opened.page.locator("#contour-XZ").bounding_box()["width"] > 700


@pytest.mark.extensive
@pytest.mark.parametrize("width", [360, 800, 1600])
def test_it_fits_at_any_width(browser: Any, files: dict[str, Path], width: int) -> None:
    with Opened(browser, files["xz_circle"], width=width) as opened:
        opened.settled()
        wide = opened.page.locator("body").evaluate("body => document.documentElement.scrollWidth")
        assert wide <= width
        unnamed = "nodes => nodes.filter(node => !(node.getAttribute('aria-label') || node.textContent.trim())).length"
        assert opened.page.locator("#page button, #page input, #page select").evaluate_all(unnamed) == 0


# Of every text in sight: its colour against that of the nearest ground, after WCAG 2.1, 1.4.3 (3 where letters are
# large), where it is too little. Controls that are off are exempt.
CONTRAST = """() => {
    const numbers = text => text.match(/[\\d.]+/g).map(Number), through = /rgba\\(.*, 0\\)|transparent/;
    const linear = c => c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4, shares = [0.2126, 0.7152, 0.0722];
    const light = colour => shares.reduce((sum, share, k) => sum + share * linear(numbers(colour)[k] / 255), 0);
    const found = [];
    for (const node of document.querySelectorAll("#page *")) {
        const own = [...node.childNodes].some(each => each.nodeType === 3 && each.textContent.trim());
        const seen = node.checkVisibility({ opacityProperty: true }) && !node.disabled && !node.closest("option");
        if (!own || !seen) continue;
        let ground = node;
        const behind = () => getComputedStyle(ground).backgroundColor;
        while (ground.parentElement && through.test(behind())) ground = ground.parentElement;
        const below = light(behind()), style = getComputedStyle(node);
        const text = light(node instanceof SVGElement ? style.fill : style.color), size = parseFloat(style.fontSize);
        const ratio = (Math.max(text, below) + 0.05) / (Math.min(text, below) + 0.05);
        const large = size >= 24 || (size >= 18.6 && Number(style.fontWeight) >= 700);
        if (ratio < (large ? 3 : 4.5)) found.push([node.tagName, node.textContent.slice(0, 40), ratio]);
    }
    return found;
}"""
MOVING = """() => [...document.querySelectorAll("#page *")]
    .filter(node => parseFloat(getComputedStyle(node).transitionDuration) > 0).length"""


@pytest.mark.extensive
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_contrast_is_enough_and_motion_is_reduced_where_asked(
    browser: Any, files: dict[str, Path], scheme: str
) -> None:
    with Opened(browser, files["xz_circle"], color_scheme=scheme, reduced_motion="reduce") as opened:
        opened.settled()
        opened.page.locator("#more").click()
        opened.page.locator("section[id^=why-] summary").click()
        assert opened.page.evaluate(CONTRAST) == []
        opened.page.locator("#lessons-part summary").click()
        opened.page.locator("#lessons button").first.click()
        opened.settled()
        assert opened.page.evaluate(CONTRAST) == []
        assert opened.page.locator("#figures tr.more").first.is_visible()
        assert opened.page.evaluate(MOVING) == 0
        opened.page.locator("#lesson").evaluate("node => { node.style.color = 'rgb(120, 130, 140)'; }")
        assert opened.page.evaluate(CONTRAST) != [], "a grey that is hard to read is found"


def test_a_glitch_has_one_height_on_a_page(browser: Any, files: dict[str, Path]) -> None:
    """In its tile and at its mark; also after a knob was turned. Causes are those of the scenario as written."""
    with Opened(browser, files["xz_circle"]) as opened:
        opened.settled()
        for address in ("", "#machine.axes.Z.friction.F_C=1.2", "#machine.axes.Z.drive.K_v=55"):
            if address:
                opened.turn_to(address)
            assert opened.page.locator("section[id^=why-]").is_visible() == (not address)
            marks = opened.page.locator("#contour-XZ text").all_text_contents()
            for axis in "XZ":
                tile = opened.page.locator(f"#keys [data-figure='XZ.glitch_{axis}'] b").inner_text()
                own = [float(mark.split()[1]) for mark in marks if mark.startswith(axis) and "µm" in mark]
                assert own
                assert f"{max(own):.2f}" == f"{number_of(tile):.2f}"


def test_the_signals_are_saved_as_they_are(browser: Any, files: dict[str, Path], tmp_path: Path) -> None:
    with Opened(browser, files["z_positioning"]) as opened:
        opened.settled()
        with opened.page.expect_download() as waiting:
            opened.page.locator("#csv").click()
        waiting.value.save_as(tmp_path / "page.csv")
        assert (tmp_path / "page.csv").read_text() == opened.csv()
        assert opened.csv().startswith("time,")


def test_tiles_say_what_is_and_what_was(browser: Any, files: dict[str, Path]) -> None:
    with Opened(browser, files["z_positioning"]) as opened:
        opened.settled()
        tiles = opened.page.locator("#keys .key")
        assert tiles.count() == 3
        first = tiles.all_inner_texts()
        assert all(text.split("\n")[0] in text.split("as written ")[1] for text in first)
        opened.turn_to("#machine.axes.Z.drive.T_sym=0.003")
        now = tiles.all_inner_texts()
        assert [text.split("as written")[1] for text in now] == [text.split("as written")[1] for text in first]
        assert now[0] != first[0]
        assert opened.page.locator("#keys .key.changed").count() >= 1


@pytest.mark.usefixtures("files")  # no module, no page
def test_text_of_the_user_is_text(browser: Any, tmp_path: Path) -> None:
    out = tmp_path / "x.html"
    hostile = "<img src=x onerror=alert(1)></script><script>alert(2)</script>{data}"
    command = ["page", str(SCENARIOS / "one_axis.yaml"), "--set", f"name={hostile!r}", "--out", str(out)]
    assert cli.main(command) == 0
    with Opened(browser, out) as opened:
        opened.settled()
        assert opened.page.locator("h1").inner_text() == hostile
        assert opened.said == []
