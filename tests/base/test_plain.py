"""Plain data: everything json.dumps refuses must come out as something it takes."""

import json

import numpy as np
import pytest

from icmj.base.numbers import plain


@pytest.mark.parametrize(("value", "expected"), [
    (np.float64(1.5), 1.5), (np.int32(3), 3), (np.bool_(True), True), (float("nan"), None), (np.inf, None),
    (1 - 2j, [1.0, -2.0]), (complex(np.nan, 1), [None, 1.0]), (np.array([[1.0, np.nan]]), [[1.0, None]]),
    ({"a": (1, None, "x")}, {"a": [1, None, "x"]}),
])  # fmt: skip
def test_values_become_plain(value, expected):
    assert plain(value) == expected
    json.dumps(plain(value), allow_nan=False)
