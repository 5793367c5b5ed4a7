# SPDX-License-Identifier: GPL-3.0-or-later
"""Two stylised game characters of many pieces, made by code: Mia in a raincoat and Bruno the sailor."""
