# SPDX-License-Identifier: GPL-3.0-or-later
"""Where photons come from: every emitter of a scene, picked in proportion to its power."""

from .photons import leave_darkness
from .prepare import Emission, prepare_emission

__all__ = ["Emission", "leave_darkness", "prepare_emission"]
