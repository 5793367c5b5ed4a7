# SPDX-License-Identifier: GPL-3.0-or-later
"""Clothes of one character on another: what is worn, read, fitted, and put into the scene."""
