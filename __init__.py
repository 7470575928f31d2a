# SPDX-License-Identifier: GPL-3.0-or-later
"""Irradiance Vector Grid: indirect light, precomputed into a 3D grid, as a Blender extension.

Blender imports this package and calls `register` and `unregister`. Nothing is imported before
that, and nothing that compiles before a bake starts.
"""


def register() -> None:
    """Add the properties, panels, operators and the command line to Blender."""
    from . import operators
    from .ivg_addon.blender import registration

    registration.register()
    try:
        operators.register()
    except Exception:
        registration.unregister()
        raise


def unregister() -> None:
    """Stop a running job and take everything away that `register` added."""
    from . import operators
    from .ivg_addon.blender import registration

    registration.stop_jobs()
    operators.unregister()
    registration.unregister()
