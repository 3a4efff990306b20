"""What a page of the documentation holds that can be run."""

import re


def pieces(text: str) -> list[tuple[str, str]]:
    """Python blocks, `beamchain` command lines, and files (blocks headed by their name),
    in the order in which they stand."""
    text = re.sub(r" *\\\n\s*", " ", text)  # lines that go on
    found = [
        (m.start(), "python", m[1])
        for m in re.finditer(r"^```python\n(.*?)^```", text, re.S | re.M)
    ]
    outside = re.sub(
        r"^```(?:python|toml|json|xml)\n.*?^```",
        lambda m: "\n" * len(m[0]),
        text,
        flags=re.S | re.M,
    )
    lines = re.finditer(r"^(?: {4,6}|\$ )?(beamchain [^\n]*?)(?:\s+#[^\n]*)?$", outside, re.M)
    found += [(m.start(), "command", m[1]) for m in lines]
    files = re.finditer(
        r"^```(?:toml|xml)\n(?:# |<!-- )([\w.]+\.(?:toml|xml))(?: -->)?\n(.*?)^```",
        text,
        re.S | re.M,
    )
    found += [(m.start(), m[1], m[2]) for m in files]
    return [(kind, content) for _, kind, content in sorted(found)]
