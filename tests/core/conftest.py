# SPDX-License-Identifier: GPL-3.0-or-later
"""What all tests of the core share."""

from __future__ import annotations

from hypothesis import settings

# The first example of a property may have to wait for its kernels to compile.
settings.register_profile("kernels", deadline=None)
settings.load_profile("kernels")
