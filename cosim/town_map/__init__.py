"""Drawings of towns on one page."""

from cosim.town_map.page import write_town_page

__all__ = ["write_town_page"]
