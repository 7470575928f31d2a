# SPDX-License-Identifier: GPL-3.0-or-later
"""One file per user action: each translates its inputs, calls one function, reports the result."""


def register() -> None:
    """Add the operators to Blender."""
    import bpy

    done = []
    try:
        for cls in _classes():
            bpy.utils.register_class(cls)
            done.append(cls)
    except Exception:
        for cls in reversed(done):
            bpy.utils.unregister_class(cls)
        raise


def unregister() -> None:
    """Take the operators away."""
    import bpy

    for cls in reversed(_classes()):
        bpy.utils.unregister_class(cls)


def _classes() -> list[type]:
    """Return every operator."""
    from .bake import IVG_OT_bake
    from .bounds_add import IVG_OT_bounds_add
    from .cancel import IVG_OT_cancel
    from .check import IVG_OT_check
    from .clear import IVG_OT_clear
    from .compare import IVG_OT_compare
    from .copy_summary import IVG_OT_copy_summary
    from .direct_only import IVG_OT_direct_only
    from .direct_only_end import IVG_OT_direct_only_end
    from .dismiss_error import IVG_OT_dismiss_error
    from .export_vdb import IVG_OT_export_vdb
    from .grid_remove import IVG_OT_grid_remove
    from .inspection_mesh import IVG_OT_inspection_mesh
    from .materials_add import IVG_OT_materials_add
    from .materials_remove import IVG_OT_materials_remove
    from .modifier_add import IVG_OT_modifier_add
    from .modifier_remove import IVG_OT_modifier_remove
    from .restore import IVG_OT_restore

    return [
        IVG_OT_bake,
        IVG_OT_bounds_add,
        IVG_OT_cancel,
        IVG_OT_check,
        IVG_OT_clear,
        IVG_OT_compare,
        IVG_OT_copy_summary,
        IVG_OT_direct_only,
        IVG_OT_direct_only_end,
        IVG_OT_dismiss_error,
        IVG_OT_export_vdb,
        IVG_OT_grid_remove,
        IVG_OT_inspection_mesh,
        IVG_OT_materials_add,
        IVG_OT_materials_remove,
        IVG_OT_modifier_add,
        IVG_OT_modifier_remove,
        IVG_OT_restore,
    ]
