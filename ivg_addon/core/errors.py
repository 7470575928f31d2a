# SPDX-License-Identifier: GPL-3.0-or-later
"""What can go wrong, as types.

Every message is one line that names the thing that is wrong and what would cure it: it is shown
unchanged in Blender's status bar and on the command line's standard error.
"""


class IvgError(Exception):
    """Base of every error that this project raises on purpose."""


class SceneError(IvgError):
    """The scene cannot be baked as it is: no light, no geometry, a camera that is missing."""


class SettingsError(IvgError):
    """A setting is out of range or contradicts another: empty bounds, a resolution of zero."""


class GridFileError(IvgError):
    """A grid's file or datablock is missing, truncated, changed, foreign, from a newer version, or not writable."""


class MemoryLimitError(IvgError):
    """What is asked for would not fit into memory; the message says how much it would need."""


class DependencyError(IvgError):
    """A library that the computation needs (embreex, numba) does not load on this machine."""


class Cancelled(IvgError):
    """The user asked to stop; nothing was changed."""
