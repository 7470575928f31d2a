# SPDX-License-Identifier: GPL-3.0-or-later
"""What a bake simplified, left out or wondered about: said once, by name, never silently."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

Kind = Literal["simplified", "left out", "warning"]


@dataclass(frozen=True, order=True)
class Notice:
    """One thing that the user should know about one named object, material, light or image.

    Parameters
    ----------
    kind
        "simplified": taken into account, but not as Cycles would; "left out": not taken into
        account at all; "warning": suspicious, for instance triangles without area.
    subject
        The type and name of the datablock, e.g. ``material 'Gold'``.
    message
        What was done, and if there is one, the cure. One line, no final full stop.
    """

    kind: Kind
    subject: str
    message: str

    def __str__(self) -> str:
        """Return ``kind: subject: message``."""
        return f"{self.kind}: {self.subject}: {self.message}"


def merge(notices: Iterable[Notice]) -> tuple[Notice, ...]:
    """Return the notices without repetitions, in the order in which they first came."""
    return tuple(dict.fromkeys(notices))


def counted(number: int, what: str) -> str:
    """Return "1 object" or "2,000 objects" for what is an "object"."""
    return f"1 {what}" if number == 1 else f"{number:,} {what}s"


def headline(notices: Iterable[Notice]) -> str:
    """Return one line of counts, e.g. ``3 simplified, 1 left out``; empty without notices."""
    counts = Counter(notice.kind for notice in notices)
    return ", ".join(
        f"{counts[kind]} {kind}{'s' if kind == 'warning' and counts[kind] > 1 else ''}"
        for kind in ("simplified", "left out", "warning")
        if counts[kind]
    )
