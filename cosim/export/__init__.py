"""A drive in the layouts and formats of others."""

from cosim.export.formats import FORMATS, export

__all__ = ["FORMATS", "export"]
