# SPDX-License-Identifier: GPL-3.0-or-later
"""What a light may do: which objects it lights, and which of them stop it.

Lights with the same receivers and blockers form a group; group 0 is that of lights without restrictions of their own:
they light everything, and are stopped by all that casts shadows. What a group may do with an object is one bit, so that
thousands of lights and objects cost little.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

Int32 = NDArray[np.int32]
UInt64 = NDArray[np.uint64]

MOST_GROUPS = 64
"""Groups that fit in a mask; Cycles has as many."""


@dataclass(frozen=True)
class LightRules:
    """The restrictions of groups of lights; `Lights.group` tells which group a light belongs to.

    Parameters
    ----------
    object_group : (objects,) int32
        Group of each object's emission.
    receives, blocks : (objects,) uint64
        Bit g tells whether lights of group g light the object, and whether it stops their light.
    lights_others : (groups,) bool
        Whether a group lights an object that no collection of it names: what a grid is looked up for.
    """

    object_group: Int32
    receives: UInt64
    blocks: UInt64
    lights_others: NDArray[np.bool_] = field(default_factory=lambda: np.ones(1, dtype=np.bool_))

    @property
    def restrict_all(self) -> bool:
        """Whether some object casts no shadow, so that even lights of group 0 do not stop at everything."""
        return bool((~self.blocks & np.uint64(1)).any())
