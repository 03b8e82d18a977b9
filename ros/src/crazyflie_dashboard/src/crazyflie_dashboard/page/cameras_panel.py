"""The image of a camera."""

from urllib.parse import quote

from nicegui import ui
from nicegui.elements.mixins.value_element import ValueElement

from crazyflie_dashboard.page.session import Session
from crazyflie_dashboard.snapshot import Scene


class Camera(ValueElement, component="camera.js"):  # type: ignore[call-arg]
    """The picture at an address of this server, which the browser fetches; none at an empty one."""

    VALUE_PROP = "address"


class CamerasPanel:
    """The newest image of the topic that is chosen."""

    def __init__(self, session: Session):
        self._session = session
        self._topic = ui.select([], label="topic", on_change=self._watch, clearable=True)
        self._topic.props("dense outlined options-dense")
        self._camera = Camera(value="")
        self._hint = ui.label().classes("hint")

    def refresh(self, scene: Scene) -> None:
        """Show the newest image, or the reason for its absence."""
        if self._topic.options != list(scene.images):
            self._topic.set_options(list(scene.images))
        page, topic = self._session.page, self._topic.value
        image = self._session.dashboard.image(page) if topic else None
        hint = "" if scene.images else "No node publishes images."
        self._hint.text = (
            f"The picture cannot be shown: {image}" if isinstance(image, str) else hint
        )
        self._camera.value = f"/camera?page={page}&topic={quote(topic)}" if topic and image else ""

    async def _watch(self) -> None:
        dashboard = self._session.dashboard
        await self._session.result(dashboard.watch_image(self._session.page, self._topic.value))
