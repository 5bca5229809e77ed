"""Which tests take turns in CI: slow ones that few changes can break, a quarter of them for a commit.

`make test` runs them all. With the environment variable FEEDSIM_TURN, a whole number, one group of files runs and the
others are left out; `.ci/run` takes the number from the commit, so that the same commit has the same verdict. Whoever
changes what a file tests runs the file itself, which leaves nothing out.
"""

from __future__ import annotations

import os

# Files below tests/, the groups of about the same length.
GROUPS = (
    (
        "test_newcomer.py",
        "fmu/test_hosts.py", "fmu/test_repack.py",
        "distribution/test_made_for_release.py",
        "importers/test_alone.py", "importers/test_whole.py",
        "live_page/test_page_numbers.py",
        "physics/test_coupled.py",
        "reference/test_monolithic.py",
        "sweep/test_engine.py",
        "fuzz/test_readers.py",
    ),
    (
        "foreign/test_faulty_units.py",
        "benchmarks/test_identification_study.py", "benchmarks/test_peers.py",
        "cli/test_writers.py",
        "distribution/test_ci.py",
        "fmu/test_check_your_import.py",
        "physics/test_output_error.py",
        "sweep/test_engine_cluster.py", "sweep/test_engine_runs.py",
        "test_extras.py",
    ),
    (
        "importers/test_wired.py",
        "fmu/test_source_fmus.py",
        "fuzz/test_unit_calls.py",
        "identify/test_stribeck.py",
        "physics/test_identified_axis.py", "physics/test_pose_grid.py",
        "reference/test_sensitivity.py",
        "replay/test_elastic.py", "replay/test_poor_records.py",
        "report/test_ten_questions.py",
        "tune/test_tune_drive_draws.py",
        "front/test_notebooks.py",
        "cli/test_surroundings.py",
    ),
    (
        "distribution/test_installed.py",
        "fmu/test_archive_sources.py", "fmu/test_every_call.py",
        "importers/test_validators.py",
        "report/test_machine_pictures.py", "report/test_zoom.py",
        "ssp/test_ssp_untrusted.py",
        "cosim/test_long_runs.py",
        "identify/test_open_loop.py",
        "physics/test_motion_noise.py",
        "test_site.py",
        "uncertainty/test_bands.py",
    ),
)  # fmt: skip


def turn() -> int | None:
    """The number whose group runs; None: all run. ValueError: FEEDSIM_TURN is no whole number."""
    given = os.environ.get("FEEDSIM_TURN", "")
    return int(given) if given else None


def left_out(number: int | None) -> frozenset[str]:
    """Files below tests/ that do not run at this turn."""
    if number is None:
        return frozenset()
    return frozenset(file for k, group in enumerate(GROUPS) if k != number % len(GROUPS) for file in group)
