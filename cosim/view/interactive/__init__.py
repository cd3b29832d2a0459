"""The page to look around in: points, boxes and images of one drive or two, as a file or served."""

from cosim.view.interactive.drives import ShownDrives, show_drives
from cosim.view.interactive.export import write_interactive
from cosim.view.interactive.server import ViewServer

__all__ = ["ShownDrives", "ViewServer", "show_drives", "write_interactive"]
