"""What was computed at a grid of frequencies, kept while more is asked of the same grid."""

from __future__ import annotations

from collections.abc import Callable, Hashable

from feedsim.linear.plant import Complexes

# Points of a grid; the fewer at which crossings are searched are asked for once.
LEAST = 500


class Kept:
    """The last results at grids, by what they are of."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._found: dict[tuple[Hashable, bytes], Complexes] = {}

    def __call__(self, of: Hashable, s: Complexes, compute: Callable[[Complexes], Complexes]) -> Complexes:
        """What ``compute`` gives at s (F,), read-only where it is kept."""
        if len(s) < LEAST:
            return compute(s)
        key = (of, s.tobytes())
        found = self._found.pop(key, None)
        if found is None:
            found = compute(s)
            found.flags.writeable = False
        self._found[key] = found  # the last one used stands last
        if len(self._found) > self._most:
            del self._found[next(iter(self._found))]
        return found
