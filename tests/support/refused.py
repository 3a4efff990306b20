"""How the tables of what is refused are checked: the class, the words that matter, one line."""

import pytest


def check_refused(call, kind, words):
    with pytest.raises(kind) as caught:
        call()
    said = str(caught.value)
    assert [word for word in words if word not in said] == []
    assert "\n" not in said
