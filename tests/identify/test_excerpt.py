"""Parts of long records: those with which a fit knows the axis best, and nothing else of them is changed."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from feedsim.estimation.identify import Record, best_window, excerpt, total_time
from feedsim.estimation.identify.excerpt import MAX_EXCERPT_ROWS, MAX_EXCERPT_TIME
from feedsim.estimation.identify.record import Array

H = 4e-3
J, F_C, SIGMA_2, M_0 = 0.016, 1.5, 0.006, 0.3


def speed_of(seconds: float, seed: int) -> Array:
    """Speeds [rad/s] every H: slow strokes to one side, and in some minutes strokes to and fro at all speeds."""
    rng = np.random.default_rng(seed)
    count = round(seconds / H)
    result = np.zeros(count)
    lively = rng.random(round(seconds / 60) + 1) < 0.1
    k = 0
    while k < count:
        minute = int(k * H / 60)
        length = int(rng.uniform(0.4, 1.2) / H)
        top = 10 ** rng.uniform(0, 2) * rng.choice([-1, 1]) if lively[minute] else 2.0
        stroke = top * np.sin(np.pi * np.arange(length) / length) ** 2
        result[k : k + length] = stroke[: count - k]
        k += length + int(0.1 / H)
    return result


def record_of(speed: Array, name: str = "log.csv", begin: float = 0.0) -> Record:
    torque = J * np.gradient(speed, H) + F_C * np.sign(speed) + SIGMA_2 * speed + M_0
    return Record(name, begin + H * np.arange(len(speed)), torque, angle=H * np.cumsum(speed))


def spread(speed: Array, begin: float, end: float) -> float:
    """Logarithm of the volume of the confidence ellipsoid of inertia, friction and load by the rows of a window."""
    v = speed[round(begin / H) : round(end / H)]
    X = np.column_stack([np.gradient(v, H) / 100, np.sign(v), v / 10, np.ones(len(v))])[v != 0]
    values = np.linalg.svd(X, compute_uv=False)
    return -float(np.sum(np.log(np.maximum(values, 1e-9))))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_window_determines_the_axis_as_well_as_the_best_of_all(seed: int) -> None:
    """Least squares at every row, of every window of 30 s: of an hour, hardly one in a hundred is better."""
    speed = speed_of(3600, seed)
    record = record_of(speed)
    begin, end = best_window(record, 30.0)
    assert 25.0 < end - begin <= 30.0
    own = spread(speed, begin, end)
    others = np.array([spread(speed, at, at + end - begin) for at in np.arange(0.0, 3570.0, 15.0)])
    assert np.mean(others < own) <= 0.01
    assert own < np.median(others) - 3  # the usual window is nothing to be identified from


def test_an_excerpt_of_an_hour() -> None:
    speed = speed_of(3600, 1)
    record = record_of(speed)
    parts, said = excerpt([record])
    assert 0.8 * MAX_EXCERPT_TIME < total_time(parts) < MAX_EXCERPT_TIME + H
    lively = np.abs(speed) > 20
    used = np.concatenate([np.isin(record.time, part.time) for part in parts]).reshape(len(parts), -1).any(axis=0)
    assert lively[used].sum() > 0.9 * min(lively.sum(), lively[used].size)
    for part in parts:
        first = int(np.searchsorted(record.time, part.time[0]))
        assert np.array_equal(part.torque, record.torque[first : first + len(part)])
    # Neighbouring slices are one record, and every record has a name of its own.
    assert all(after.time[0] - before.time[-1] > 1.5 * H for before, after in pairwise(parts))
    assert len({part.name for part in parts}) == len(parts)
    assert [finding.code for finding in said] == ["record-excerpt"]
    assert str(said[0]).startswith("of 60 min of records 10 min are used")
    assert all(part.name in str(said[0]) for part in parts)


def test_short_records_stay_as_they_are() -> None:
    records = [record_of(speed_of(190, seed), f"{seed}.csv", 1000.0 * seed) for seed in (1, 2, 3)]
    parts, said = excerpt(records)
    assert all(part is record for part, record in zip(parts, records, strict=True))
    assert said == ()
    assert best_window(records[0], 300.0) == (records[0].time[0], records[0].time[-1])


def test_records_of_several_files_and_of_many_rows() -> None:
    """A short record that alone reverses is taken; rows count as well as time."""
    dull = record_of(np.full(round(3600 / H), 2.0), "dull.csv")
    rng = np.random.default_rng(1)
    lively = record_of(20 * np.sin(np.arange(round(50 / H)) * H * 6) * rng.uniform(0.9, 1.1), "lively.csv")
    parts, _ = excerpt([dull, lively])
    assert len(parts[-1]) == len(lively)
    fast = replace(dull, time=dull.time / 40)  # 10 kHz
    parts, _ = excerpt([fast, replace(fast, name="other.csv"), replace(fast, name="third.csv")], length=10.0)
    assert sum(map(len, parts)) <= MAX_EXCERPT_ROWS


def test_a_speed_alone_and_an_axis_at_rest() -> None:
    speed = speed_of(3600, 2)
    record = record_of(speed)
    alone = replace(record, angle=None, speed=speed)
    (begin, end), (other, _) = best_window(alone, 30.0), best_window(record, 30.0)
    assert begin == pytest.approx(other, abs=30.0)
    assert end - begin <= 30.0
    resting = record_of(np.zeros(round(3600 / H)))
    begin, end = best_window(resting, 30.0)
    assert 0.0 <= begin < end <= 3600.0
