"""The web page. Only it imports NiceGUI."""

from crazyflie_dashboard.page.server import Page, open_page

__all__ = ["Page", "open_page"]
