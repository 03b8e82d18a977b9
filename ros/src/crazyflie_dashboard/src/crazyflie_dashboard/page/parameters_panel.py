"""Live parameters of nodes, and firmware parameters of vehicles."""

import asyncio

from nicegui import ui
from nicegui.elements.mixins.value_element import ValueElement

from crazyflie_dashboard.live_parameters import range_of
from crazyflie_dashboard.page.session import Session
from crazyflie_dashboard.page_data import ParameterInfo
from crazyflie_dashboard.snapshot import Scene
from crazyflie_utils.refusal import RefusalError

MAX_ROWS = 30  #: Number of parameters that are shown at once; a search finds the others.


class ParametersPanel:
    """Parameters of one node or vehicle, each with unit, range and help."""

    def __init__(self, session: Session):
        self._session = session
        self._parameters: tuple[ParameterInfo, ...] = ()
        with ui.element("div").classes("tools"):
            self._owner = ui.select([], label="node or vehicle", on_change=self._ask)
            self._owner.props("dense outlined options-dense").classes("number")
            self._search = ui.input("search", on_change=self._build)
            self._search.props("dense outlined clearable debounce=300").classes("number search")
        self._count = ui.label(
            "Choose a node or a vehicle to see the parameters that can be changed while it runs. "
            "Enter sends a typed value."
        ).classes("hint")
        self._rows = ui.element("div").classes("parameters")

    def refresh(self, scene: Scene) -> None:
        """Show which nodes and vehicles have parameters."""
        owners = list(self._session.dashboard.parameter_owners())
        if self._owner.options != owners:
            self._owner.set_options(owners)

    async def _ask(self) -> None:
        self._count.text = "asking…"
        self._parameters = ()
        if self._owner.value:
            future = self._session.dashboard.parameters(self._owner.value)
            self._parameters = await self._session.result(future) or ()
        self._build()

    def _build(self) -> None:
        part = (self._search.value or "").lower()
        found = [each for each in self._parameters if part in f"{each.name} {each.help}".lower()]
        self._count.text = f"{len(found)} of {len(self._parameters)} parameters"
        if len(found) > MAX_ROWS:
            self._count.text += f"; the first {MAX_ROWS} are shown: search for others"
        self._rows.clear()
        with self._rows:
            for parameter in found[:MAX_ROWS]:
                ParameterRow(self._session, parameter)


class ParameterRow:
    """One parameter; the value that came back, or the reason of a refusal, is below it."""

    def __init__(self, session: Session, parameter: ParameterInfo):
        self._session, self._parameter = session, parameter
        row = ui.element("div").classes("parameter")
        row.props["data-name"] = parameter.name
        with row:
            with ui.element("div").classes("about"):
                ui.label(parameter.name).classes("name")
                ui.label(description(parameter)).classes("hint")
                self._answer = ui.label().classes("answer")
            self._field = self._build_field()

    def _build_field(self) -> ValueElement:
        parameter = self._parameter
        field: ValueElement
        if parameter.kind == "bool":
            field = ui.switch(value=bool(parameter.value), on_change=self._set)
        elif parameter.choices:
            field = ui.select(list(parameter.choices), value=parameter.value, on_change=self._set)
            field.props("dense outlined options-dense")
        else:
            field = ui.input(value=_text(parameter.value), suffix=parameter.unit or None)
            field.props("dense outlined").on("keydown.enter", self._set)
        return field

    async def _set(self) -> None:
        text = _text(self._field.value)
        if text == _text(self._parameter.value):
            return
        future = self._session.dashboard.set_parameter(self._session.page, self._parameter, text)
        try:
            self._parameter = await asyncio.wrap_future(future)
        except RefusalError as error:
            self._tell(str(error), "bad")
            return
        self._tell(f"is {_text(self._parameter.value)} now", "good")
        is_text = self._parameter.kind != "bool" and not self._parameter.choices
        self._field.set_value(_text(self._parameter.value) if is_text else self._parameter.value)

    def _tell(self, text: str, look: str) -> None:
        self._answer.text = text
        self._answer.classes(remove="good bad", add=look)


def description(parameter: ParameterInfo) -> str:
    """Return unit, range and help of a parameter as one text."""
    parts = (parameter.kind, parameter.unit, range_of(parameter), parameter.help)
    return " · ".join(part for part in parts if part)


def _text(value: object) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)
