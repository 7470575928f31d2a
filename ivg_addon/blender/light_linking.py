# SPDX-License-Identifier: GPL-3.0-or-later
"""Light and shadow linking, as Cycles has it: which objects a light lights, and which stop its light.

What shadow rays do not see stops no light.

An object belongs to a collection's choice if the collection includes it, or includes nothing, and does not exclude
it. What is said of a child collection counts for all in it, whatever is said further inside.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np

from ..core.light_rules import MOST_GROUPS, LightRules
from ..core.report import Notice


@dataclass(frozen=True)
class _Choice:
    """The objects that a collection chooses, by name."""

    included: frozenset[str] = frozenset()
    excluded: frozenset[str] = frozenset()

    @classmethod
    def of(cls, collection: bpy.types.Collection | None) -> _Choice:
        named: dict[str, set[str]] = {"INCLUDE": set(), "EXCLUDE": set()}
        if collection is not None:
            for child, state in zip(collection.children, collection.collection_children, strict=True):
                named[state.light_linking.link_state].update(item.name for item in child.all_objects)
            for item, state in zip(collection.objects, collection.collection_objects, strict=True):
                named[state.light_linking.link_state].add(item.name)
        return cls(frozenset(named["INCLUDE"]), frozenset(named["EXCLUDE"]))

    def has(self, name: str | None) -> bool:
        """Tell whether an object is chosen; None is one that the collection does not name."""
        return (not self.included or name in self.included) and name not in self.excluded


@dataclass(frozen=True)
class _Group:
    """What lights of one group light, and what stops them; without shadows nothing does."""

    receivers: _Choice = _Choice()
    blockers: _Choice | None = _Choice()


class LinkingReader:
    """Groups the lights of a scene by what they may light."""

    def __init__(self) -> None:
        self._groups: dict[_Group, int] = {_Group(): 0}
        self._choices: dict[str, _Choice] = {}
        self._notices: list[Notice] = []

    @property
    def notices(self) -> tuple[Notice, ...]:
        """Return what could not be taken over."""
        return tuple(self._notices)

    def group(self, shown: bpy.types.Object, shadows: bool = True) -> int:
        """Return the group of an object's light.

        Parameters
        ----------
        shadows
            False where the light's own shadows are switched off.
        """
        linking = shown.light_linking
        blockers = self._choice(linking.blocker_collection)
        group = _Group(self._choice(linking.receiver_collection), blockers if shadows else None)
        if group not in self._groups:
            if len(self._groups) == MOST_GROUPS:
                subject = f"{'light' if shown.type == 'LIGHT' else 'object'} '{shown.name}'"
                message = (
                    f"lights everything: Cycles knows {MOST_GROUPS - 1} ways of light linking, and so many came first"
                )
                self._notices.append(Notice("simplified", subject, message))
                return 0
            self._groups[group] = len(self._groups)
        return self._groups[group]

    def rules(
        self, objects: Sequence[str], shadow_visible: Sequence[bool], depsgraph: bpy.types.Depsgraph
    ) -> LightRules | None:
        """Return what each object may receive and stop; None where every light lights, and stops at, everything.

        Parameters
        ----------
        objects
            Names, as in `scene.Scene.objects`.
        shadow_visible
            Whether shadow rays see each of them.
        depsgraph
            Where the objects that shine are looked up.
        """
        linked = {
            item.name: self.group(item)
            for item in depsgraph.ids
            if isinstance(item, bpy.types.Object) and item.type != "LIGHT" and _is_linked(item)
        }
        if len(self._groups) == 1 and all(shadow_visible):
            return None
        receives, blocks = np.zeros(len(objects), np.uint64), np.zeros(len(objects), np.uint64)
        for group, bit in self._groups.items():
            mask = np.uint64(1 << bit)
            receives[[group.receivers.has(name) for name in objects]] |= mask
            if group.blockers is not None:
                blocks[[group.blockers.has(name) for name in objects]] |= mask
        blocks[~np.array(shadow_visible, dtype=np.bool_)] = 0
        return LightRules(
            object_group=np.array([linked.get(name, 0) for name in objects], dtype=np.int32),
            receives=receives,
            blocks=blocks,
            lights_others=np.array([group.receivers.has(None) for group in self._groups]),
        )

    def _choice(self, collection: bpy.types.Collection | None) -> _Choice:
        name = "" if collection is None else str(collection.name_full)
        if name not in self._choices:
            self._choices[name] = _Choice.of(collection)
        return self._choices[name]


def _is_linked(shown: bpy.types.Object) -> bool:
    linking = shown.light_linking
    return bool(linking.receiver_collection or linking.blocker_collection)
