"""Numbers of one name agree on every kind of page: in tiles, in tables and in summary.json.

Kinds that take long are looked at where other tests make them (agreement_helpers).
"""

from __future__ import annotations

import pytest

from agreement_helpers import assert_numbers_agree, contradictions, number
from kinds_helpers import KINDS, Kinds


@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "compare"])  # which has no summary.json
def test_no_number_contradicts_another_of_its_name(kind: str, kinds: Kinds) -> None:
    assert_numbers_agree(kinds[kind])


def test_a_contradiction_is_found() -> None:
    figures = {"figures": {"XZ.G": {"value": 8.19, "unit": "um", "meaning": "m"}}}
    row = '<td><code>XZ.G</code></td><td class="number">{}</td><td>µm</td>'
    assert contradictions(row.format("8.190"), figures) == ([], 1)
    assert contradictions(row.format("8.2"), figures) == ([], 1)
    (wrong,), pairs = contradictions(row.format("8.21"), figures)
    assert wrong.startswith("XZ.G: table 8.21")
    assert pairs == 1
    tile = '<div class="key" title="m"><b>9.1 <small>µm</small></b><span>G</span>'
    assert contradictions(tile, figures)[0] == ["m: tile 9.1, summary.json 8.19"]
    assert number("−1.5×10⁻³") == pytest.approx((-1.5e-3, 0.51e-4))
