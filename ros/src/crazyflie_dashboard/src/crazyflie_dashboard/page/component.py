"""Parts of the page that a component of this folder draws from one value."""

from typing import Any

from nicegui.element import Element


class ValueView(Element):
    """Shows a value; it is sent when it has changed."""

    prop: str  #: Name of the component's property.
    empty: Any = ()  #: Its value at first.

    def __init__(self) -> None:
        super().__init__()
        self._props[self.prop] = self.empty

    def show(self, value: Any) -> None:
        """Show this value."""
        if self._props[self.prop] != value:
            self._props[self.prop] = value
            self.update()


class Cards(ValueView, component="cards.js"):  # type: ignore[call-arg]
    """A card for each vehicle."""

    prop = "vehicles"


class Lines(ValueView, component="lines.js"):  # type: ignore[call-arg]
    """Lines: key, style, source, text, and remedy."""

    prop = "lines"

    def __init__(self, nothing: str) -> None:
        super().__init__()
        self._props["nothing"] = nothing


class Camera(ValueView, component="camera.js"):  # type: ignore[call-arg]
    """The picture at an address of this server, which the browser fetches; none at an empty one."""

    prop, empty = "address", ""
