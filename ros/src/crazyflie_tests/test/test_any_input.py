"""Whatever parameters and files hold: it is taken, or refused with the documented error."""

import importlib

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from pages import PACKAGE_PAGES
from test_parameter_tables import COMMENT

from crazyflie_demo import trajectory_file
from crazyflie_lqr.gain_file import GainFileError, load_matrix, load_vector
from crazyflie_utils.parameters.declaration import ParameterError

SCALARS = (
    st.none()
    | st.booleans()
    | st.integers(-(2**70), 2**70)
    | st.floats()
    | st.text(max_size=20)
    | st.sampled_from(["", "/", "//", "~", "nan", "1e400", "0x", "a b", "udp://", "radio://0/1/2M"])
)
VALUES = st.recursive(
    SCALARS,
    lambda inner: (
        st.lists(inner, max_size=5)
        | st.dictionaries(st.text(max_size=8) | st.integers(), inner, max_size=4)
    ),
    max_leaves=12,
)
"""Values that YAML, or another node, may put on the parameter server."""

LINES = st.lists(st.text(alphabet="0123456789.-+eE#,; \t\0naif\u0664", max_size=40), max_size=6)
CONTENTS = st.binary(max_size=200) | LINES.map(lambda lines: "\n".join(lines).encode())
"""Of a file."""

FEW = settings(max_examples=settings().max_examples // 2)
ON_FILES = settings(suppress_health_check=[HealthCheck.function_scoped_fixture])


def declared_classes():
    """Return every class of parameters that a README documents, as module:Class."""
    comments = [COMMENT.findall(page.read_text()) for page in PACKAGE_PAGES]
    return sorted({path for each in comments for path in " ".join(each).split() if ":" in path})


@pytest.mark.parametrize("path", declared_classes())
@FEW
@given(data=st.data())
def test_parameters(path, data):
    module, _, name = path.partition(":")
    declared = getattr(importlib.import_module(module), name)
    names = [each.name for each in declared.declarations()]
    given_values = data.draw(st.dictionaries(st.sampled_from(names), VALUES)) if names else {}

    def get(parameter):
        return given_values[parameter]

    try:
        loaded = declared.read(get)
    except ParameterError as error:
        assert str(error)
    else:
        assert isinstance(loaded, declared)


@ON_FILES
@given(content=CONTENTS)
def test_gain_files(tmp_path, content):
    path = tmp_path / "K.txt"
    path.write_bytes(content)
    for load in (lambda: load_matrix(str(path), 1, 2), lambda: load_vector(str(path), 2)):
        try:
            assert load().size == 2
        except GainFileError as error:
            assert str(path) in str(error)


@ON_FILES
@given(content=CONTENTS)
def test_trajectory_files(tmp_path, content):
    path = tmp_path / "trajectory.csv"
    path.write_bytes(content)
    try:
        assert trajectory_file.load(path)
    except trajectory_file.TrajectoryError as error:
        assert str(path) in str(error)
