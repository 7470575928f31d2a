# SPDX-License-Identifier: GPL-3.0-or-later
"""The computation: scene arrays in, irradiance vector grid out. Never imports Blender."""

from .grid import IrradianceVectorGrid

__all__ = ["IrradianceVectorGrid"]
