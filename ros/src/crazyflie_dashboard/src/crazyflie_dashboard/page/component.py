"""A part of the page that a component of this folder draws from one list."""

from typing import Any

from nicegui.element import Element


class ListView(Element):
    """Shows a list; it is sent when it has changed."""

    prop: str  #: Name of the component's property.

    def __init__(self) -> None:
        super().__init__()
        self._props[self.prop] = []

    def show(self, items: list[Any]) -> None:
        """Show these items."""
        if self._props[self.prop] != items:
            self._props[self.prop] = items
            self.update()


class Cards(ListView, component="cards.js"):  # type: ignore[call-arg]
    """A card for each vehicle."""

    prop = "vehicles"


class Lines(ListView, component="lines.js"):  # type: ignore[call-arg]
    """Lines: key, style, source, text, and remedy."""

    prop = "lines"

    def __init__(self, nothing: str) -> None:
        super().__init__()
        self._props["nothing"] = nothing


class Camera(Element, component="camera.js"):  # type: ignore[call-arg]
    """The newest picture of a camera, which the browser fetches by itself."""

    def __init__(self) -> None:
        super().__init__()
        self._props["address"] = ""

    def show(self, address: str) -> None:
        """Show the picture at an address of this server; nothing if the address is empty."""
        if self._props["address"] != address:
            self._props["address"] = address
            self.update()
