"""What moves in a mode: the share of its kinetic energy per body, and how the body moves, in words."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from feedsim.structure.assembly import Assembly, Floats, Integers

AXIS_LETTERS = "XYZ"
# Bodies are named up to this number and down to this share.
MAX_NAMED_BODIES, WORTH_NAMING = 3, 0.1
# A body moves as one where a rigid motion explains this part of its kinetic energy. The half wave of a screw between
# its bearings, which is bending, comes to 8/pi^2 = 0.81.
AS_ONE = 0.85
# Of translation and rotation the lesser is named as well from this part of their energy on.
AS_WELL = 0.1
# A body turns about its own axis where its rotary inertia, not its width, holds this part of the rotation's energy.
OWN_INERTIA_SHARE = 0.5
# "bed B1[3] ux": the body is what stands before the index or the direction.
LABEL = re.compile(r"(\[[^]]*\])?(\s+[ur][xyz])?\s*$")


@dataclass(frozen=True)
class Share:
    """A body's part in a mode: share of the kinetic energy [1], and words such as "rocking about X" (or none)."""

    body: str
    energy: float
    words: str


@dataclass(frozen=True)
class Motion:
    """The bodies of a mode, the largest share first."""

    shares: tuple[Share, ...]

    def __str__(self) -> str:
        """Such as "bed 71 % (rocking about X), column 20 % (moving along Z)"."""
        named = [share for share in self.shares[:MAX_NAMED_BODIES] if share.energy >= WORTH_NAMING] or self.shares[:1]
        return ", ".join(
            f"{share.body} {100 * share.energy:.0f} %" + (f" ({share.words})" if share.words else "") for share in named
        )


@dataclass(frozen=True, eq=False)
class _Body:
    """Degrees of freedom of a body (n,), their directions 0..5 or -1, their node's position (n, 3) [m] where known."""

    name: str
    dofs: Integers
    directions: Integers
    positions: Floats | None


def what_moves(assembly: Assembly, shapes: Floats) -> tuple[Motion, ...]:
    """One motion per column of shapes (N, n).

    Bodies are those of the geometry; where none is known, groups of labels ("bed B1" of "bed B1[3] ux").
    """
    energy = shapes * (assembly.mass @ shapes)
    total = energy.sum(axis=0)
    energy = energy / np.where(total > 0, total, 1)
    weights = assembly.mass.diagonal()
    bodies = _bodies(assembly)
    shares = np.array([energy[body.dofs].sum(axis=0) for body in bodies])
    words = [_words(body, weights[body.dofs], shapes[body.dofs]) for body in bodies]
    motions = []
    for mode in range(shapes.shape[1]):
        order = np.argsort(-shares[:, mode], kind="stable")
        motions.append(
            Motion(tuple(Share(bodies[i].name, float(shares[i, mode]), words[i][mode]) for i in order.tolist()))
        )
    return tuple(motions)


def _bodies(assembly: Assembly) -> list[_Body]:
    size = len(assembly.labels)
    names: list[str] = [""] * size
    directions = np.full(size, -1, dtype=np.int64)
    positions = None
    geometry = assembly.geometry
    if geometry is not None:
        positions = np.full((size, 3), np.nan)
        node, direction = np.nonzero(geometry.dofs >= 0)
        dofs = geometry.dofs[node, direction]
        directions[dofs] = direction
        positions[dofs] = geometry.nodes[node]
        for dof, of in zip(dofs.tolist(), node.tolist(), strict=True):
            names[dof] = geometry.bodies[of]
    for dof, name in enumerate(names):
        names[dof] = name or LABEL.sub("", assembly.labels[dof]) or assembly.labels[dof]
    members: dict[str, list[int]] = {}
    for dof, name in enumerate(names):
        members.setdefault(name, []).append(dof)
    bodies = []
    for name, dofs_of in members.items():
        index = np.array(dofs_of, dtype=np.int64)
        where = None if positions is None or np.isnan(positions[index]).any() else positions[index]
        bodies.append(_Body(name, index, directions[index], where))
    return bodies


def _words(body: _Body, weights: Floats, shapes: Floats) -> list[str]:
    """How a body moves in each of the modes (n dofs of the body, modes)."""
    if body.positions is None or not np.any(weights > 0):
        return [""] * shapes.shape[1]
    arms, rigid = _rigid_motions(body, weights)
    weighted = rigid.T * weights
    gram = weighted @ rigid
    # A rotor has no translations, a mass point no rotations: the least motion that explains the shape.
    motion = np.linalg.pinv(gram, rcond=1e-10, hermitian=True) @ (weighted @ shapes)
    parts = motion * (gram @ motion)
    whole = np.einsum("i,ij->j", weights, shapes**2)
    by_direction = np.array([weights[body.directions == d] @ shapes[body.directions == d] ** 2 for d in range(6)])
    words = []
    for mode in range(shapes.shape[1]):
        energy = parts[:, mode]
        if energy.sum() < AS_ONE * whole[mode]:
            strongest = int(np.argmax(by_direction[:, mode]))
            how = "deforming along" if strongest < 3 else "twisting about"
            words.append(f"{how} {AXIS_LETTERS[strongest % 3]}")
            continue
        spin = float(weights[body.directions >= 3].sum() * (motion[3:, mode] @ motion[3:, mode]))
        turning = "turning" if spin > OWN_INERTIA_SHARE * energy[3:].sum() else "rocking"
        named = [f"moving along {_strongest(energy[:3])}", f"{turning} about {_strongest(energy[3:])}"]
        shares = [energy[:3].sum() / energy.sum(), energy[3:].sum() / energy.sum()]
        if _turns(energy, motion[:3, mode], np.cross(motion[3:, mode], arms)):
            named, shares = named[::-1], shares[::-1]
        words.append(" and ".join(named if shares[1] >= AS_WELL else named[:1]))
    return words


def _strongest(energy: Floats) -> str:
    return AXIS_LETTERS[int(np.argmax(energy))]


def _turns(parts: Floats, translation: Floats, by_rotation: Floats) -> bool:
    """Whether a body's rigid motion is a rotation: the axis it turns about passes within the body's reach.

    Then some of its points move further by the rotation than its centre of mass moves.
    """
    reach = float(np.max(np.linalg.norm(by_rotation, axis=1)))
    return reach > float(np.linalg.norm(translation)) or bool(parts[3:].sum() > parts[:3].sum())


def _rigid_motions(body: _Body, weights: Floats) -> tuple[Floats, Floats]:
    """Arms (n, 3) from the centre of mass to the nodes of the degrees of freedom; their rigid motions (n, 6)."""
    assert body.positions is not None
    along = np.where(body.directions < 3, weights, 0.0)
    if not along.any():
        along = np.ones_like(weights)
    arms = body.positions - along @ body.positions / along.sum()
    rigid = np.zeros((len(weights), 6))
    for d in range(3):
        moves, turns = body.directions == d, body.directions == 3 + d
        rigid[moves, d] = 1
        rigid[turns, 3 + d] = 1
        # u = t + w x r
        rigid[moves, 3 + (d + 1) % 3] = arms[moves, (d + 2) % 3]
        rigid[moves, 3 + (d + 2) % 3] = -arms[moves, (d + 1) % 3]
    return arms, rigid
