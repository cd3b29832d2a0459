"""Errors about models and meshes that the user can fix."""

from __future__ import annotations


class AssetError(Exception):
    """A mesh or a manifest cannot be used; the message is one line: which file, what is wrong, what to do."""
