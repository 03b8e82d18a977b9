"""Tables of parameters, from declarations."""

from crazyflie_utils.parameters.declaration import Parameters, group, parameter
from crazyflie_utils.parameters.tables import table, with_tables
from crazyflie_utils.parameters.types import BOOLEAN, TOPIC, Integer, Number, Text


class AxisParameters(Parameters):
    """Gains of an axis."""

    kp: float = parameter(Number(minimum=0.0), "gain", live=True)


class SomeParameters(Parameters):
    """One of each."""

    x: float = parameter(Number("m"), "where", name="init/x")
    y: float = parameter(Number("m"), "where", name="init/y")
    mode: str = parameter(Text(("LQR", "MERGE")), "who decides", default="LQR")
    count: int = parameter(Integer(0, 7), "how many", default=3)
    is_on: bool = parameter(BOOLEAN, "a|b", default=False)
    topic: str | None = parameter(TOPIC, "optional", default=None, name="topics/a")
    axis: AxisParameters = group(AxisParameters, "PIDs/X")


TABLE = r"""| parameter | type, unit | default | range | |
|---|---|---|---|---|
| `init/x`, `init/y` | float, m | required |  | where |
| `mode` | string | `LQR` | `LQR`, `MERGE` | who decides |
| `count` | int | `3` | 0 to 7 | how many |
| `is_on` | bool | false |  | a\|b |
| `topics/a` | string | none |  | optional |
| `PIDs/X/kp` | float | required | >= 0 | gain *(live)* |
"""


def test_table():
    assert table(SomeParameters) == TABLE


def test_tables_of_a_page_are_made_again():
    comment = f"<!-- parameters: {__name__}:SomeParameters -->\n"
    page = f"# A node\n\n{comment}\n| old | table |\n|---|---|\n\nText.\n"
    made = with_tables(page)
    assert made == f"# A node\n\n{comment}\n{TABLE}\nText.\n"
    assert with_tables(made) == made


def test_classes_share_a_table_and_alike_parameters_a_row():
    assert "| `kp`, `PIDs/X/kp` | float |" in table(AxisParameters, SomeParameters)


def test_a_page_without_a_table_gets_one():
    comment = f"<!-- parameters: {__name__}:AxisParameters -->\n"
    assert with_tables(f"{comment}\nText.\n").startswith(f"{comment}\n| parameter |")
    assert with_tables(f"{comment}\nText.\n").endswith("|\n\nText.\n")
