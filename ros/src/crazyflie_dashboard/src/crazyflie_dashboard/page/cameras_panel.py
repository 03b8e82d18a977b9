"""The image of a camera."""

import base64

from nicegui import ui

from crazyflie_dashboard.page.session import Session
from crazyflie_dashboard.snapshot import Scene


class CamerasPanel:
    """The newest image of the topic that is chosen."""

    def __init__(self, session: Session):
        self._session = session
        self._topic = ui.select([], label="topic", on_change=self._watch, clearable=True)
        self._topic.props("dense outlined options-dense")
        self._image = ui.image().classes("camera")
        self._hint = ui.label().classes("hint")

    def refresh(self, scene: Scene) -> None:
        """Show the newest image."""
        if self._topic.options != list(scene.images):
            self._topic.set_options(list(scene.images))
        self._hint.text = "" if scene.images else "No node publishes images."
        image = self._session.dashboard.image(self._session.page) if self._topic.value else None
        self._image.set_visibility(image is not None)
        if image is not None:
            kind = "png" if image.startswith(b"\x89PNG") else "jpeg"
            source = f"data:image/{kind};base64,{base64.b64encode(image).decode()}"
            self._image.set_source(source)

    async def _watch(self) -> None:
        dashboard = self._session.dashboard
        await self._session.result(dashboard.watch_image(self._session.page, self._topic.value))
