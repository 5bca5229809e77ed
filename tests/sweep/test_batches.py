"""Batches: every task comes to one outcome, whatever dies; worth their handing over, and short at the end."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest

from feedsim.design.sweep.design import Outcome, Task
from feedsim.design.sweep.engine import AIM, BATCHES_PER_WORKER, DEATHS, Batch, Batches


def outcomes(batch: Batch, seconds: float, count: int | None = None) -> list[Outcome]:
    return [Outcome(task.run, {}, None, seconds) for task in batch.tasks[:count]]


def test_a_batch_takes_about_as_long_as_meant() -> None:
    batches = Batches(Task(i) for i in range(100_000))
    first = batches.next(2)
    assert first is not None
    assert len(first.tasks) == 1  # nothing is known of how long a run takes
    batches.done(first, outcomes(first, 0.005))
    second = batches.next(2)
    assert second is not None
    assert len(second.tasks) == round(AIM / 0.005)


def test_tasks_are_read_as_they_are_needed() -> None:
    read = 0

    def endless() -> Iterator[Task]:
        nonlocal read
        while True:
            yield Task(read)
            read += 1

    batches = Batches(endless())
    for _ in range(50):
        batch = batches.next(2)
        assert batch is not None
        batches.done(batch, outcomes(batch, 0.01))
    assert read < 50 * AIM / 0.01 + 10 * 2 * AIM / 0.01


def test_workers_have_one_to_do_and_one_ahead() -> None:
    batches = Batches(Task(i) for i in range(1000))
    given = [batches.next(3) for _ in range(20)]
    assert sum(batch is not None for batch in given) == 3 * BATCHES_PER_WORKER


def test_batches_get_small_towards_the_end() -> None:
    batches = Batches(Task(i) for i in range(200))
    sizes = []
    while (batch := batches.next(2)) is not None:
        sizes.append(len(batch.tasks))
        batches.done(batch, outcomes(batch, 0.005))
    assert sum(sizes) == 200
    assert sizes[-1] == 1
    assert sorted(sizes[1:], reverse=True) == sizes[1:]


def test_what_a_batch_has_not_reached_comes_first_next_time() -> None:
    batches = Batches(Task(i) for i in range(100))
    first = batches.next(1)
    assert first is not None
    batches.done(first, outcomes(first, 0.05))
    second = batches.next(1)
    assert second is not None
    batches.done(second, outcomes(second, 0.5, 3))
    third = batches.next(1)
    assert third is not None
    assert third.tasks[0] == second.tasks[3]


@pytest.mark.parametrize("seed", range(20))
def test_each_task_comes_to_one_outcome(seed: int) -> None:
    """A crowd of workers that die, that run out of memory, and that hand back half, as the dice fall."""
    dice = np.random.default_rng(seed)
    count, deadly = 300, set(dice.choice(300, 4, replace=False).tolist())
    batches = Batches(Task(i) for i in range(count))
    flying: list[Batch] = []
    found: list[Outcome] = []
    while True:
        while (batch := batches.next(3)) is not None:
            flying.append(batch)
        assert batches.count_batches_out == len(flying)
        if not flying:
            break
        batch = flying.pop(int(dice.integers(len(flying))))
        runs = [task.run for task in batch.tasks]
        if deadly.intersection(runs):
            found += batches.record_death(batch, 1, "its worker process died")
            if flying and dice.random() < 0.7:  # it had waited at the same worker
                found += batches.record_death(flying.pop(0), 1, "its worker process died")
        elif dice.random() < 0.3:
            done = outcomes(batch, 0.02, int(dice.integers(len(runs))) + 1)
            found += done
            batches.done(batch, done)
        else:
            found += (done := outcomes(batch, 0.02))
            batches.done(batch, done)
    assert sorted(outcome.run for outcome in found) == list(range(count))
    assert {outcome.run for outcome in found if outcome.error} == deadly
    assert {outcome.error for outcome in found if outcome.error} == {
        f"given up: its worker process died, {DEATHS} times"
    }


def test_what_a_worker_refuses_is_handed_over_anew_as_it_was() -> None:
    batches = Batches(Task(run) for run in range(3))
    first = batches.next(1)
    assert first is not None
    batches.refused(first)
    again = batches.next(1)
    assert again is not None
    assert again.tasks == first.tasks
    batches.record_death(again, 1, "its worker died")
    suspect = batches.next(1)
    assert suspect is not None
    assert suspect.suspect
    batches.refused(suspect)
    again = batches.next(1)
    assert again is not None
    assert (again.tasks, again.suspect) == (suspect.tasks, True)
    batches.done(again, [Outcome(again.tasks[0].run, {})])
    while (batch := batches.next(1)) is not None:
        assert batches.waiting or batches.count_batches_out
        batches.done(batch, [Outcome(task.run, {}) for task in batch.tasks])
    assert not batches.waiting
