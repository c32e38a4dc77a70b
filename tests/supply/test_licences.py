"""Every package that an installation brings may be used by a program under MIT, and those that aqualog asks for are listed.

What these bring along changes with their releases, without a change here: the licence of what is installed is looked at,
the list is that of the day it was written.
"""

import re

import pytest

from tests.supply.licences import BEGIN, BINDING, FREE, LIST, asked, packages

LISTED = dict(
    re.findall(r"^\| (\S+) \| (.*?) \| \w* \|$", LIST.read_text(encoding="utf-8").split(BEGIN)[1], re.MULTILINE)
)


@pytest.mark.parametrize(("name", "told"), [(n, told) for n, (told, _) in sorted(packages().items())])
def test_licence_is_free(name, told):
    assert FREE.search(told), f"{name}: {told!r}"
    assert not BINDING.search(told), f"{name}: {told!r}"


@pytest.mark.parametrize("name", asked())
def test_what_is_asked_for_is_listed(name):
    assert name in LISTED, "python -m tests.supply.licences writes the list anew"


@pytest.mark.parametrize(("name", "told"), sorted(LISTED.items()))
def test_what_is_listed_is_free(name, told):
    assert FREE.search(told), f"{name}: {told!r}"
    assert not BINDING.search(told), f"{name}: {told!r}"


@pytest.mark.parametrize(
    "told", ["GPL-3.0-only", "GNU General Public License v3 (GPLv3)", "AGPL-3.0", "Proprietary", ""]
)
def test_binding_licences_are_seen(told):
    assert BINDING.search(told) or not FREE.search(told)
