"""Interactive page with points, boxes and images of one or two drives, as a file or from a local server."""

from cosim.view.interactive.drives import ShownDrives, show_drives
from cosim.view.interactive.export import write_interactive
from cosim.view.interactive.server import ViewServer

__all__ = ["ShownDrives", "ViewServer", "show_drives", "write_interactive"]
