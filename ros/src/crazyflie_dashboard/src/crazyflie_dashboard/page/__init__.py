"""The web page. Only it imports NiceGUI."""

from crazyflie_dashboard.page.server import Page

__all__ = ["Page"]
