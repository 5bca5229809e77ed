"""What is wrong in a structure file is refused with file, line, key, value and what is allowed."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from feedsim.foundation.errors import InputError
from feedsim.scenario.structure_checks import load_structure
from structure_helpers import one_axis_text


def refused(text: str, folder: Path) -> str:
    path = folder / "s.yaml"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        load_structure(path)
    return str(caught.value).replace(str(path), "s.yaml")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        # names
        ("[block.1, block.7], offset: [0 mm, -125 mm, 250 mm]", "[block.1, blok.7]",
         "nodes: body base has no node 'blok'; did you mean 'block'?"),
        ("[block.1, block.7], offset: [0 mm, -125 mm, 250 mm]", "block.9",
         "nodes: 'block.9': line block of body base has the nodes block.0 to block.8"),
        ("[block.1, block.7], offset: [0 mm, -125 mm, 250 mm]", "block.5..3",
         "nodes: 'block.5..3': line block of body base has"),
        ("[block.1, block.7], offset: [0 mm, -125 mm, 250 mm]", "[block.1, block.0..3]",
         "nodes: base.block.1 is listed twice"),
        ("[block.1, block.7], offset: [0 mm, -125 mm, 250 mm]", "'block[1]'",
         "nodes: 'block[1]' is no node of this body, such as top, post.3"),
        ("nodes: plate,", "nodes: plate.0,", "nodes: 'plate.0': plate is a single node of body table"),
        ("rail: base.block", "rail: base.blok",
         "rail: 'base.blok': blok is no line of nodes of body base; did you mean 'block'?"),
        ("rail: base.block", "rail: table.plate", "rail: 'table.plate': plate is a single node, no line of nodes"),
        ("rail: base.block", "rail: bas.block", "rail: there is no body 'bas'; did you mean 'base'?"),
        ("against: base.block.4", "against: base.block",
         "tool.against: 'base.block' is a line of 9 nodes; one of them is needed"),
        ("against: base.block.4", "against: base", "tool.against: 'base' is no place to hold on to"),
        ("against: base.block.4", "against: [rail base.block, base.block.1]",
         "tool.against: 'rail base.block' stands alone"),
        ("against: base.block.4", "against: [base.block.1, base.block.1]",
         "tool.against: base.block.1 is listed twice"),
        ("against: base.block.4", "against: [base.block.1, table.plate]", "nodes of a mean must move alike"),
        ("against: base.block.4", "against: []", "tool.against: an empty list"),
        ("  body: table\n  at: [0 mm, 100 mm", "  body: tabel\n  at: [0 mm, 100 mm",
         "tool.body: there is no body 'tabel'; did you mean 'table'?"),
        ("section: block}", "section: blok}", "there is no section 'blok'; did you mean 'block'?"),
        ("material: granite", "material: marble",
         "sections.block.material: there is no material 'marble'; allowed: granite, steel"),
        (", material: granite", "", "sections.block.material: missing; there are several materials: granite, steel"),
        ("moves_with: [X]", "moves_with: [x]",
         "bodies.table.moves_with.0: the machine has no axis 'x'; did you mean 'X'?"),
        ("moves_with: [X]", "moves_with: [X, X]", "bodies.table.moves_with.1: axis X is listed twice"),
        ("moves_with: [X]", "moves_with: []", "axes.X: no body moves with axis X"),
        ("  base:  ", "  b.ase: ", "'b.ase' is no name: a letter, then letters, digits and _"),
        # values
        ("E: 60 GPa", "E: 60 GN", "materials.granite.E: '60 GN': unknown unit 'GN'"),
        ("E: 60 GPa", "E: 60 N/m", "'60 N/m' is a stiffness; a modulus of elasticity is expected, for example 210 GPa"),
        ("rho: 2900 kg/m^3", "rho: 2900", "2900 has no unit; a density is expected, for example 7850 kg/m^3"),
        ("nu: 0.25", "nu: 0.7", "0.7 is outside the allowed range: more than -1, at most 0.5"),
        ("mass: 40 kg", "mass: 0 kg", "0 kg is outside the allowed range: more than 0 kg"),
        ("count: 9", "count: 1", "1 is outside the allowed range: at least 2"),
        ("[0 mm, 600 mm]", "[600 mm, 0 mm]",
         "axes.X.travel: travel from 0.6 m to 0 m; the first must be the lower end"),
        ("[0 mm, 600 mm]", "[0 deg, 360 deg]", "'0 deg' is an angle; a length is expected"),
        ("direction: X", "direction: x", "axes.X.direction: 'x'; a direction is expected: X, Y or Z of the frame"),
        ("direction: X", "direction: [0, 0, 0]", "axes.X.direction: [0, 0, 0] points nowhere"),
        ("direction: X", "direction: [0, 1 mm, 0]", "a direction takes plain numbers, for example [0, 0.6, 0.8]"),
        ("direction: X", "direction: [0, 1]", "axes.X.direction: a list; a direction is expected"),
        ("at: [0 mm, 100 mm, 0 mm]", "at: [0 mm, 100 mm]",
         "tool.at.2: the list is too short; three entries are needed"),
        ("at: [0 mm, 100 mm, 0 mm]", "at: [0 mm, 100 mm, 0 mm, 0 mm]", "tool.at: 4 entries; at most 3"),
        ("kind: rectangle, width: 600 mm, height: 250 mm,", "kind: box, width: 600 mm, height: 250 mm, wall: 125 mm,",
         "a wall of 0.125 m leaves no hole in 0.6 x 0.25 m"),
        ("kind: rectangle, width: 600 mm, height: 250 mm,", "kind: tube, diameter: 600 mm, wall: 0.3 m,",
         "a wall of 0.3 m leaves no hole in a tube of 0.6 m"),
        ("kind: rectangle, width: 600 mm, height: 250 mm,", "kind: disc, diameter: 600 mm,",
         "unknown kind 'disc'; allowed: box, rectangle, rod, tube, properties"),
        ("kind: rectangle, width: 600 mm,", "kind: rectangle, wide: 600 mm,", "unknown key; did you mean 'width'?"),
        # nodes and beams
        ("plate: {at: [0 mm, 0 mm, 0 mm]}", "plate: {}",
         "a node needs 'at', a line of nodes needs 'start', 'end' and 'count'"),
        (", count: 9", "", "a line of nodes needs 'start', 'end' and 'count'; 'count' is missing"),
        ("plate: {at: [0 mm, 0 mm, 0 mm]}", "plate: {at: [0 mm, 0 mm, 0 mm], count: 3}",
         "'at' makes this a single node and 'count' a line of nodes"),
        ("end: [700 mm, 0 mm, 0 mm]", "end: [-700 mm, 0 mm, 0 mm]",
         "start and end are the same point; a line of nodes has a length"),
        ("section: block}", "section: block, up: X}", "bodies.base.nodes.block.up: points along the beam itself"),
        (", section: block}", "}", "bodies.base.nodes.block: no beam reaches base.block.0"),
        ("inertia: [0.6 kg.m^2, 1.1 kg.m^2, 0.6 kg.m^2]", "inertia: [0.6 kg.m^2, 0 kg.m^2, 0.6 kg.m^2]",
         "bodies.table.nodes.plate: no beam reaches table.plate"),
        ("    mounts:", "    beams: [{section: block, through: [block.3, block.3]}]\n    mounts:",
         "beams.0.through.1: a beam from base.block.3 to base.block.3, which are the same node"),
        ("    mounts:", "    beams: [{section: block, through: [block.3]}]\n    mounts:",
         "beams.0.through: 1 entry; at least 2 needed"),
        ("    mounts:", "    beams: [{section: block, through: [block, block.2..4]}]\n    mounts:",
         "through.1: block has 9 nodes and block.2..4 has 3"),
        ("    mounts:", "    beams: [{section: block, through: [block.1, block.3], up: -X}]\n    mounts:",
         "beams.0.up: points along the beam itself"),
        # what must move and what must not
        ("screw: {body: base", "screw: {body: table",
         "axes.X.drive.screw.body: table moves with X; it must not move with X"),
        ("nut: {body: table", "nut: {body: base",
         "axes.X.drive.nut.body: base moves with no axis; it must move with X"),
        ("held_by: table.plate, axial", "held_by: base.block.2, axial",
         "axes.X.drive.nut.held_by: base moves with no axis; it must move with X"),
        ("held_by: base.block.1, axial", "held_by: table.plate, axial",
         "axes.X.drive.bearings.0.held_by: table moves with X; it must not"),
        ("stator: {node: base.block.1", "stator: {node: table.plate",
         "axes.X.drive.stator.node: table moves with X; it must not"),
        ("against: rail base.block", "against: table.plate",
         "axes.X.scale.against: table moves with X; it must not move with X"),
        ("moving: table.plate", "moving: base.block.1",
         "axes.X.scale.moving: base moves with no axis; it must move with X"),
        ("  held_by: table.plate\n", "  held_by: base.block.1\n",
         "tool.held_by: base moves with no axis, table moves with X; what holds a point must move"),
        ("    carriages: ", "    mounts: [{nodes: plate, stiffness: [1 N/um, 1 N/um, 1 N/um]}]\n    carriages: ",
         "bodies.table.mounts: table moves with X; a mount would hold it"),
        ("directions: [Y, Z]", "directions: [Y, X]",
         "directions.1: X is not square to X, along which axis X moves table past base"),
        ("directions: [Y, Z]", "directions: [[0.6, 0.8, 0]]", "directions.0: [0.6, 0.8, 0] is not square to X"),
        # the drive
        ("axial: 150 N/um, radial: 100", "radial: 100",
         "axes.X.drive.bearings: no bearing holds the screw along its axis"),
        ("end: [500 mm, 190 mm, 0 mm]", "end: [500 mm, 200 mm, 0 mm]",
         "axes.X.drive.screw: the screw runs along [0.99995, 0.0099995, 0], axis X along X"),
        ("end: [500 mm, 190 mm, 0 mm]", "end: [-500 mm, 190 mm, 0 mm]",
         "axes.X.drive.screw: start and end are the same point"),
        ("at: [0 mm, -30 mm, 0 mm]", "at: [0 mm, -20 mm, 0 mm]",
         "axes.X.drive.nut.at: the nut lies 0.01 m beside the screw"),
        ("at: [0 mm, -30 mm, 0 mm]", "at: [250 mm, -30 mm, 0 mm]",
         "with X at 0.6 m the nut is 0.05 m beyond the end of the screw"),
        ("at: [0 mm, -30 mm, 0 mm]", "at: [-250 mm, -30 mm, 0 mm]",
         "with X at 0 m the nut is 0.05 m beyond the start of the screw"),
        ("at: start, held_by", "at: begin, held_by",
         "axes.X.drive.bearings.0.at: 'begin' is not allowed here; allowed: start, end"),
        ("pitch: 10 mm", "pitch: 0 mm", "axes.X.drive.pitch: 0 mm is outside the allowed range: more than 0 m"),
        ("pitch: 10 mm", "pitsch: 10 mm", "axes.X.drive.pitch: missing; a length, for example pitch: 20 mm"),
        # the file
        ("kind: geometry", "kind: geometri", "kind: unknown kind 'geometri'; did you mean 'geometry'?"),
        ("kind: geometry\n", "", "kind: missing key 'kind'; allowed: geometry"),
        ("damping: {ratio: 2 %}", "damping: {ratio: 2 %}\ncutof: 1 kHz", "cutof: unknown key; did you mean 'cutoff'?"),
        ("damping: {ratio: 2 %}\n", "", "damping: missing"),
    ],
)  # fmt: skip
def test_faults(tmp_path: Path, old: str, new: str, message: str) -> None:
    text = one_axis_text()
    assert old in text
    found = refused(text.replace(old, new), tmp_path)
    assert message in found
    # Every fault has its line; what is missing is told at the place that lacks it.
    assert all(re.match(r"\s*s\.yaml:[0-9]+: |s\.yaml: [0-9]+ problems", line) for line in found.splitlines()), found


def test_all_faults_are_told_with_their_lines(tmp_path: Path) -> None:
    text = one_axis_text().replace("material: granite", "material: marble").replace("against: base", "against: bse")
    lines = text.splitlines()
    found = refused(text, tmp_path)
    assert found.startswith("s.yaml: 2 problems")
    for key in ("material: marble", "against: bse"):
        line = next(i for i, content in enumerate(lines, start=1) if key in content)
        assert f"s.yaml:{line}: " in found
