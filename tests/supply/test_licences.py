"""Every package that an installation brings is listed, and may be used by a program under MIT."""

import re

import pytest

from tests.supply.licences import BEGIN, BINDING, FREE, LIST, packages

LISTED = dict(
    re.findall(r"^\| (\S+) \| (.*?) \| \w* \|$", LIST.read_text(encoding="utf-8").split(BEGIN)[1], re.MULTILINE)
)


@pytest.mark.parametrize(("name", "told"), [(n, told) for n, (told, _) in sorted(packages().items())])
def test_licence_is_listed_and_free(name, told):
    assert name in LISTED, "python -m tests.supply.licences writes the list anew"
    assert FREE.search(told), f"{name}: {told!r}"
    assert not BINDING.search(told), f"{name}: {told!r}"


@pytest.mark.parametrize(
    "told", ["GPL-3.0-only", "GNU General Public License v3 (GPLv3)", "AGPL-3.0", "Proprietary", ""]
)
def test_binding_licences_are_seen(told):
    assert BINDING.search(told) or not FREE.search(told)
