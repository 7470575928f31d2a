# SPDX-License-Identifier: GPL-3.0-or-later
"""Builders of the sample scenes: one module a scene, the shared parts beside them."""
