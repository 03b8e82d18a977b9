"""The private names of cflib that are used: a version without one of them is refused."""

import re
from pathlib import Path

import pytest

import crazyflie_link
from crazyflie_link.cflib_internals import PRIVATE_NAMES, check_private_names

SOURCES = Path(crazyflie_link.__path__[-1])


@pytest.mark.parametrize(
    "name",
    [
        "cflib.crazyflie.log:Log._no_such_table",
        "cflib.crtp.radiodriver:_NoSuchThread._sp",
        "cflib.crtp.radiodriver:RadioManager._no_such_list",
    ],
)
def test_a_name_that_is_gone_is_named_with_the_version_that_has_it(name):
    requirements = next(
        folder / "requirements.txt"
        for folder in SOURCES.resolve().parents
        if (folder / "requirements.txt").is_file()
    )
    (pin,) = re.findall(r"^cflib==.*$", requirements.read_text(encoding="utf-8"), re.MULTILINE)
    with pytest.raises(ImportError) as caught:
        check_private_names([*PRIVATE_NAMES, name])
    assert name.replace(":", ".") in str(caught.value)
    assert str(caught.value).endswith(pin)


def test_all_private_names_in_the_sources_are_listed():
    """Those of cflib's objects; this package's own begin with self or its own names."""
    listed = {name.rpartition(".")[2] for name in PRIVATE_NAMES}
    used = set()
    for file in SOURCES.glob("*.py"):
        text = file.read_text(encoding="utf-8")
        used |= set(re.findall(r"(?:RadioManager|radio|thread|driver|log)\.(_[a-z]\w*)", text))
    assert used
    assert used <= listed
