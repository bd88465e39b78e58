"""Pictures of the parts of a domain."""

import numpy as np
import pytest
from domains import COMM

import namedmesh as nm


@pytest.mark.broad
@pytest.mark.parametrize("dim", [2, 3])
def test_the_picture_names_all_parts(dim, shared_tmp_path):
    pytest.importorskip("matplotlib")
    a = (nm.rectangle if dim == 2 else nm.box)((0.0,) * dim, (1.0,) * dim, cells=(2,) * dim)
    where = {"pad": nm.where(**{"xyz"[dim - 1]: 1.0, "x": (None, 0.5)})}
    path = shared_tmp_path / "parts.png"
    axes = nm.draw_parts(a.named(where), path)
    if COMM.rank > 0:
        assert axes is None
        return
    names = {text.get_text() for panel in np.ravel(axes) for text in panel.texts}
    assert {"pad", "top", "bottom", "left", "right"} <= names
    assert path.stat().st_size > 5000
    if dim == 3:
        labels = [text.get_text() for text in axes[0].figure.legends[0].texts]
        assert set(labels) == {"left", "right", "front", "back", "bottom", "top", "pad"}


def test_the_picture_is_of_a_domain_alone():
    with pytest.raises(nm.InputError, match="3 is no domain"):
        nm.draw_parts(3)
    box = nm.box((0.0,) * 3, (1.0,) * 3, cells=(1, 1, 1))
    with pytest.raises(nm.InputError, match="in 3D makes a figure of its own"):
        nm.draw_parts(box, ax=object())
