"""Compiled kernels.

Once on a machine, in any folder that can be written to, with errors that say what to
do.
"""

import numpy as np
import pytest

from erc_contact.base import library as module
from erc_contact.base.exceptions import ErcContactError
from erc_contact.base.library import Library

pytestmark = pytest.mark.serial
HEADER = "double total(long long n, const double *x);\n"
SOURCE = """#include "kernels.h"
double total(long long n, const double *x) { return n ? x[n - 1] + total(n - 1, x) : 0; }
"""


@pytest.fixture
def folders(tmp_path, monkeypatch):
    """A folder with a kernel, and one for what is compiled."""
    sources, cache = tmp_path / "sources", tmp_path / "cache" / "forms"
    sources.mkdir()
    (sources / "kernels.h").write_text(HEADER)
    (sources / "total.c").write_text(SOURCE)
    monkeypatch.setattr(module, "get_options", lambda: {"cache_dir": cache})
    return sources, cache


def test_compiled_once(folders, monkeypatch):
    """A second process finds it; another source is compiled anew."""
    sources, cache = folders
    x = np.arange(5.0)
    assert Library(sources, 2)("total", len(x), x) == x.sum()
    compiled = list(cache.glob("*.so"))
    assert len(compiled) == 1
    with monkeypatch.context() as without:
        without.setattr(module, "_compile", lambda *_: pytest.fail("compiled again"))
        assert Library(sources, 2)("total", len(x), x) == x.sum()
    (sources / "total.c").write_text(SOURCE.replace("n - 1]", "n - 1] * 2"))
    assert Library(sources, 2)("total", len(x), x) == 2 * x.sum()


def test_no_folder_to_write_to(folders):
    sources, cache = folders
    cache.parent.touch()  # a file where the folder should be
    assert Library(sources, 2)("total", 2, np.ones(2)) == 2.0


def test_compiler_fails(folders):
    sources, cache = folders
    (sources / "total.c").write_text("not C")
    with pytest.raises(ErcContactError, match=r"(?s)The C compiler .* failed.*CC"):
        Library(sources, 2)
    assert not list(cache.glob("*.so"))


def test_wrong_arrays_are_refused(folders):
    total = Library(folders[0], 2)
    with pytest.raises(TypeError):
        total("total", 2, np.ones(2, dtype=np.float32))
    with pytest.raises(ValueError, match="contiguous"):
        total("total", 2, np.ones((2, 2))[:, 0])


def test_compiled_ahead(folders, monkeypatch):
    """Who calls a function waits for the thread that compiles it."""
    sources, cache = folders
    module.compile_ahead(sources, 2)
    with monkeypatch.context() as without:
        without.setattr(module, "Thread", lambda **_: pytest.fail("compiled again"))
        assert Library(sources, 2)("total", 2, np.ones(2)) == 2.0
        module.compile_ahead(sources, 2)
    assert len(list(cache.glob("*.so"))) == 1
