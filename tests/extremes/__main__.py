"""Run all cases and draw their map. Run:
make extremes (100 s on 2 cores; writes build/extremes)."""

import json
import os
import sys
from pathlib import Path

from extremes.cases import cases
from extremes.picture import extremes_map
from extremes.suite import run


def main(folder: Path) -> int:
    done = run(cases(), processes=os.cpu_count() or 1)
    found = done.as_dict()
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "extremes.png").write_bytes(extremes_map(done.rows))
    (folder / "extremes.json").write_text(json.dumps(found, indent=2), encoding="utf-8")
    print(", ".join(f"{key}: {found[key]}" for key in ("cases", "passed", "refused", "failed")))
    return 3 if found["failed"] else 0


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
