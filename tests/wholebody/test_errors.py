"""Strategy: a package that nobody has, asked for by the parts that need an extra."""

import pytest

from wholebody import errors
from wholebody.errors import InputError, require_extra
from wholebody.sim.pictures.render import check_output


def test_what_needs_an_extra_says_how_to_install_it():
    with pytest.raises(InputError, match=r"a plot needs the extra `plot`: pip install 'g1-wholebody\[plot\]'"):
        require_extra("plot", "no_such_package", "a plot")
    require_extra("plot", "numpy", "a plot")


def test_a_video_is_refused_without_its_extra_and_a_sheet_is_not(monkeypatch):
    monkeypatch.setattr(errors, "find_spec", lambda package: None)
    with pytest.raises(InputError, match=r"g1-wholebody\[video\]"):
        check_output("run.mp4")
    check_output("run.png")
