"""Building blocks of HTML report pages: document, style, tables, meters, bars, legends, buttons and phrases."""

from cosim.report.html import document
from cosim.report.parts import button, facts, figure, legend, meter, notes_section, section, signed, table
from cosim.report.stacked_bar import Piece, stacked_bar
from cosim.report.write import write_page

__all__ = [
    "Piece",
    "button",
    "document",
    "facts",
    "figure",
    "legend",
    "meter",
    "notes_section",
    "section",
    "signed",
    "stacked_bar",
    "table",
    "write_page",
]
