"""feedsim example: scenarios and machines that come along, listed or copied."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path

from feedsim.cli.options import Command, Option, folder


def example(options: Namespace) -> None:
    """feedsim example."""
    from feedsim import examples

    there = examples.examples()
    if options.names or options.to:
        written = examples.copy(options.names or [entry.name for entry in there], options.to or Path())
        print("\n".join(map(str, written)) or "all there already")
        return
    kind = ""
    width = max(len(entry.name) for entry in there)
    for item in there:
        if item.kind != kind:
            kind = item.kind
            print(f"{kind}:")
        print(f"  {item.name:{width}}  {item.about}")
    print("\nfeedsim example NAME copies one into the working folder, with the files that it names")
    print("feedsim example --to scenarios copies all, to where the commands of the documentation have them")


COMMAND = Command(
    "example",
    "list the scenarios, studies and machines that come along, or copy some into your folder",
    example,
    (
        Option("names", "NAME", "what to copy, with the files that it names; without a name all are listed", nargs="*"),
        Option("--to", "DIR", "folder to copy into (default: the working folder); all, without a name", type=folder),
    ),
    description="List the scenarios, studies, machines and structures that come along, or copy some into a folder of "
    "yours to begin with. The machines are synthetic, but for emps and sinumerik_840d, which were measured. Nothing is "
    "overwritten.",
    epilog="example:\n  feedsim example xz_circle && feedsim run xz_circle.yaml",
    needs=(),
    job="example",
)
