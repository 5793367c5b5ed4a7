# SPDX-License-Identifier: GPL-3.0-or-later
"""The operators, a file for each step of the workflow."""

from . import carry, compare, fix, match, outfit, partner, pick, pieces, remedies, settings, show

CLASSES = (
    *match.CLASSES,
    *fix.CLASSES,
    *pieces.CLASSES,
    *pick.CLASSES,
    *partner.CLASSES,
    *carry.CLASSES,
    *compare.CLASSES,
    *outfit.CLASSES,
    *show.CLASSES,
    *remedies.CLASSES,
    *settings.CLASSES,
)
