# SPDX-License-Identifier: GPL-3.0-or-later
"""The command line's commands, one file each; imported only when their command is used."""
