"""Settings in YAML files: what is read, and how messages name file and line."""

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from crazyflie_utils.parameters import yaml_file
from crazyflie_utils.parameters.declaration import ParameterError, Parameters, group, parameter
from crazyflie_utils.parameters.types import BOOLEAN, POSITION, POSITIVE, TEXT


class NoiseParameters(Parameters):
    """A group."""

    deviation: float = parameter(POSITIVE, "standard deviation", default=0.01)


class BoxParameters(Parameters):
    """A box."""

    center: tuple[float, float, float] = parameter(POSITION, "middle")
    size: float = parameter(POSITIVE, "edge", default=1.0)
    is_solid: bool = parameter(BOOLEAN, "whether it is", default=True, name="solid")
    colour: str | None = parameter(TEXT, "of its sides", default=None)
    noise: NoiseParameters = group(NoiseParameters, "noise")

    def complaints(self):
        """See `Parameters.complaints`."""
        if self.center[2] < self.size / 2:
            yield f"a box of {self.size:g} m at height {self.center[2]:g} is in the ground"


TEXT_OF_LAB = """\
boxes:
  table:
    center: [1, 2, 0.5]
    solid: false
  chair:
    center: [0.5, 2, 3.0]
    noise:
      deviation: 0.5
list: [1, two]
"""


@pytest.fixture
def load(tmp_path):
    def load(text):
        path = tmp_path / "lab.yaml"
        path.write_text(text)
        return yaml_file.load(path)

    return load


def complaints_of(load, text, read=lambda lab: lab["boxes"]["table"].read(BoxParameters)):
    with pytest.raises(ParameterError) as caught:
        read(load(text))
    return [text.partition("lab.yaml")[2] for text in caught.value.complaints]


def test_reads_entries(load):
    lab = load(TEXT_OF_LAB)
    boxes = lab["boxes"].entries()
    table = boxes["table"].read(BoxParameters)
    assert table == BoxParameters(
        center=(1.0, 2.0, 0.5),
        size=1.0,
        is_solid=False,
        colour=None,
        noise=NoiseParameters(deviation=0.01),
    )
    assert boxes["chair"].read(BoxParameters).noise.deviation == 0.5
    assert [entry.line for entry in boxes.values()] == [3, 6]
    assert [entry.value for entry in lab["list"].elements()] == [1, "two"]
    assert "boxes" in lab
    assert "tables" not in lab


def test_each_wrong_value_is_named_with_its_line(load):
    text = """\
boxes:
  table:
    size: -1
    noise:
      deviation: much
      bias: 0
    wheels: 4
"""
    assert complaints_of(load, text) == [
        ":6: boxes/table/noise/bias is not known; expected one of center, colour, noise/deviation, "
        "size, solid",
        ":7: boxes/table/wheels is not known; expected one of center, colour, noise/deviation, "
        "size, solid",
        ":3) is not set; expected a list of 3, each entry a finite number (m)",
        ":3) is -1; expected a finite number > 0",
        ":5) is 'much'; expected a finite number > 0",
    ]


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("1e-3", 0.001),
        ("38E-1", 3.8),
        ("1e3", 1000.0),
        (".5", 0.5),
        ("1.", 1.0),
        ("+2.5", 2.5),
        ("0x07", 7),
        ("007", 7),
        ("010", 10),
        ("08", 8),
        ("-010", -10),
        ("'1e-3'", "1e-3"),
        ("1_000", "1_000"),
        ("1:30", "1:30"),
        ("0x", "0x"),
        ("e3", "e3"),
        ("E7E7E7E701", "E7E7E7E701"),
    ],
)
def test_numbers_are_read_as_everywhere(load, text, number):
    value = load(f"size: {text}\n")["size"].value
    assert (value, type(value)) == (number, type(number))


def test_infinity_and_nan_are_refused_as_numbers(load):
    for text in (".inf", "-.inf", ".nan", "nan", "inf"):
        (found,) = complaints_of(
            load, f"size: {text}\n", lambda file: file["size"].checked(POSITIVE)
        )
        assert found.endswith("; expected a finite number > 0")


MERGED = """\
defaults: &box
  size: 0.5
  noise: {deviation: 0.5}
colours:
  red: &red {colour: red, solid: false}
  white: &white {colour: white, size: 9}
boxes:
  table: &table
    <<: *box
    center: [1, 2, 1]
  chair:
    size: 2e-1
    <<: [*red, *white, *table]
"""


class ColourParameters(Parameters):
    """Without the keys of the templates."""

    frame: str = parameter(TEXT, "fixed frame", default="world")


def test_an_entry_merges_others(load):
    lab = load(MERGED)
    table, chair = lab["boxes"]["table"], lab["boxes"]["chair"]
    assert table.value == {"size": 0.5, "noise": {"deviation": 0.5}, "center": [1, 2, 1]}
    assert table.read(BoxParameters).noise.deviation == 0.5
    read = chair.read(BoxParameters)
    # Its own keys have precedence, then those of the first of the list.
    assert (read.size, read.colour, read.is_solid) == (0.2, "red", False)
    assert read.center == (1.0, 2.0, 1.0)
    # Reading the value has changed nothing.
    assert chair.value["size"] == 0.2
    assert [*chair.entries()].count("size") == 1


def test_what_is_wrong_in_a_merged_entry_is_named_with_its_own_line(load):
    assert complaints_of(load, MERGED.replace("size: 0.5", "size: -1"))[0].startswith(":2) is -1")


def test_templates_are_no_unknown_keys(load):
    assert load(MERGED).read(ColourParameters, ("boxes",)).frame == "world"
    text = MERGED.replace("[*red, *white, *table]", "[*red, *table]")
    assert complaints_of(load, text, lambda lab: lab.read(ColourParameters, ("boxes",))) == [
        ":5: colours is not known; expected one of boxes, frame"
    ]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("a: &a {b: 1}\nc:\n  <<: 3\n", ":3: is not a mapping; << expects one, or a list"),
        ("a: &a {b: 1}\nc:\n  <<: [*a, [1]]\n", ":3: is not a mapping; << expects one, or a list"),
        ("a: &a {b: 1}\nc:\n  <<: *a\n  <<: *a\n", ":3: has << twice in a mapping"),
        ("a: &a {b: 1, b: 2}\nc: {<<: *a}\n", ":1: c/b occurs twice, first in line 1"),
        ("c: &c\n  <<: *c\n", ":2: has the alias *c within the node"),
        ("c: {<<: *no}\n", ":1: is not valid YAML: found undefined alias"),
    ],
)
def test_what_cannot_be_merged_is_named(load, text, complaint):
    (found,) = complaints_of(load, text, lambda file: file["c"].entries())
    assert found.startswith(complaint)


def test_merged_entries_count_as_values(load):
    text = "a0: &a0 {x: 1, y: 2}\n" + "".join(
        f"a{k}: &a{k} {{b{k}: {{<<: *a{k - 1}}}, c{k}: {{<<: *a{k - 1}}}}}\n" for k in range(1, 30)
    )
    (found,) = complaints_of(load, text)
    assert "has too many values" in found


def test_keys_that_somebody_else_reads(load):
    table = load("center: [0, 0, 1]\nwheels: 4\n")
    assert table.read(BoxParameters, extra_keys=("wheels",)).center == (0.0, 0.0, 1.0)


def test_what_does_not_fit_together_is_named_with_its_line(load):
    text = "boxes:\n  table:\n    center: [0, 0, 0]\n"
    assert complaints_of(load, text) == [
        ":3: boxes/table: a box of 1 m at height 0 is in the ground"
    ]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("boxes: 3\n", ":1: boxes is 3; expected a mapping"),
        ("# nothing\n", ": is empty; expected a mapping"),
        ("[1, 2]\n", ":1: the file is [1, 2]; expected a mapping"),
        ("a: 1\nboxes: {}\n", ":2: boxes has no table; it has nothing"),
        ("a: 1\n", ":1: the file has no boxes; it has a"),
        ("boxes:\n  table: {}\n  table: {}\n", ":3: boxes/table occurs twice, first in line 2"),
        ("boxes:\n  3: {}\n", ":2: boxes has the key 3; expected a string"),
        (
            "boxes: {\n",
            ":2: is not valid YAML: expected the node content, but found '<stream end>'",
        ),
        ("boxes: !!python/name:os.system\n", ":1: boxes cannot be read"),
    ],
)
def test_files_that_hold_something_else(load, text, complaint):
    assert complaints_of(load, text)[0].startswith(complaint)


def test_a_list_is_expected(load):
    assert complaints_of(load, "list: 3\n", lambda lab: lab["list"].elements()) == [
        ":1: list is 3; expected a list"
    ]


def test_a_file_that_cannot_be_read(tmp_path):
    with pytest.raises(ParameterError, match=r"none\.yaml: cannot be read: No such file"):
        yaml_file.load(tmp_path / "none.yaml")
    (tmp_path / "latin.yaml").write_bytes(b"name: Stra\xdfe\n")
    with pytest.raises(ParameterError, match=r"latin\.yaml:1: is not text in UTF-8"):
        yaml_file.load(tmp_path / "latin.yaml")
    with pytest.raises(ParameterError, match=r"cannot be read: embedded null byte"):
        yaml_file.load("lab\0.yaml")
    with pytest.raises(ParameterError, match=r"cannot be read: File name too long") as caught:
        yaml_file.load("a" * 200_000)
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize(
    ("content", "complaint"),
    [
        (b"a: 1\nname: Stra\xdfe\n", ":2: is not text in UTF-8"),
        (b"\xef\xbb\xbfa: 1\n\nname: \xff\n", ":3: is not text in UTF-8"),
        (b"a: 1\nb: 2\nc: \0\n", ":3: has a NUL"),
        (b"a: 1\nb: \x07\n", ":2: is not valid YAML: it has the character U+0007"),
        (b"a: " + b"x" * 2_000_000, ": is too long; expected at most 1000000 bytes"),
    ],
)
def test_bytes_that_are_no_settings_are_told_with_their_line(tmp_path, content, complaint):
    path = tmp_path / "lab.yaml"
    path.write_bytes(content)
    with pytest.raises(ParameterError) as caught:
        yaml_file.load(path)
    assert str(caught.value).startswith(f"{path}{complaint}")


def test_a_byte_order_mark_does_not_matter(tmp_path):
    path = tmp_path / "lab.yaml"
    path.write_bytes(b"\xef\xbb\xbfsize: 1\n")
    assert yaml_file.load(path)["size"].value == 1


TEN_TIMES = "a0: &a0 [1, 2]\n" + "".join(
    f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * 10)}]\n" for k in range(1, 30)
)


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("a: 1\nb: " + "[" * 20_000, ":2: is nested too deeply; expected at most 50 levels"),
        ("a: " + "[" * 20_000 + "]" * 20_000, ":1: is nested too deep"),
        ("{a: " * 20_000, ":1: is nested too deep"),
        ("- " * 20_000 + "1", ":1: is nested too deep"),
        ("a: [" + "1," * 60_000 + "]", ":1: has too many values; expected at most 50000"),
        (TEN_TIMES, ":6: has too many values"),
        ("a: 1\nb: &b {c: [*b]}\n", ":2: has the alias *b within the node to which it refers"),
        ("a: *" + "x" * 200_000, ":1: is not valid YAML: found undefined alias"),
    ],
    ids=map(str, range(8)),
)
def test_what_no_settings_are_like_is_refused_at_once(load, text, complaint, monkeypatch):
    composed = []
    compose_scalar = yaml.SafeLoader.compose_scalar_node

    def count(self, anchor):
        composed.append(anchor)
        return compose_scalar(self, anchor)

    monkeypatch.setattr(yaml.SafeLoader, "compose_scalar_node", count)
    (found,) = complaints_of(load, text)
    assert found.startswith(complaint)
    assert len(found) < 400
    assert len(composed) <= 50_001


@pytest.mark.parametrize(
    "text",
    [
        "boxes: {table: {size: " + "x" * 200_000 + "}}\n",
        "boxes: {table: {? " + "x" * 200_000 + "\n : 1}}\n",
        "boxes: {? " + "x" * 200_000 + "\n : {size: 1}}\n",
        "boxes: {table: {size: 0x" + "f" * 200_000 + "}}\n",
        "boxes: {table: [" + "1, " * 20_000 + "]}\n",
        "boxes: {table: {size: ! " + "x" * 200_000 + "}}\n",
        "boxes: {table: {size: !" + "x" * 200_000 + " 1}}\n",
        "boxes: {table: {center: [0, 0, {a: [" + "1, " * 20_000 + "]}]}}\n",
    ],
    ids=map(str, range(8)),
)
def test_what_is_long_is_shortened_in_messages(load, text):
    def read(lab):
        for entry in lab["boxes"].entries().values():
            entry.read(BoxParameters)
        lab["boxes"]["chair"]

    assert max(map(len, complaints_of(load, text, read))) < 600


@pytest.mark.parametrize(
    "text", ["!!bool x", "!!timestamp x", '!!int ""', "!!float x", "!!binary é", "!!set [1]"]
)
def test_a_text_that_does_not_fit_its_tag_is_told(load, text):
    found = complaints_of(load, f"boxes: {{table: {{size: {text}}}}}\n")
    assert any("cannot be read" in each for each in found)


@given(st.text())
def test_any_text_is_read_or_refused(tmp_path_factory, text):
    path = tmp_path_factory.mktemp("any") / "lab.yaml"
    path.write_text(text, encoding="utf-8", errors="surrogatepass")
    try:
        for entry in yaml_file.load(path).entries().values():
            entry.read(BoxParameters)
    except ParameterError as error:
        assert str(path) in str(error)
