# SPDX-License-Identifier: GPL-3.0-or-later
"""The version, as in blender_manifest.toml (a test compares them)."""

VERSION = "0.1.0"
