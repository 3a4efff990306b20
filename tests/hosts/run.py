"""Run the tests of one host in an environment of its own:
`python tests/hosts/run.py NAME` from the checkout.

Environments stay under build/hosts/NAME, so that a second run starts at once. A host that cannot be
installed is said and skipped: its package may not exist for this platform.
"""

import os
import re
import subprocess
import sys
import tomllib
import venv
from pathlib import Path

# its cells run where the host is
NOTEBOOK = "tests/test_notebooks.py::test_notebook_runs[07_other_simulators]"
PAGE = "tests/test_docs.py::test_a_section_runs_in_its_host[{}]"
KERNEL = ["nbclient", "nbformat", "ipykernel"]
EMBED = [
    "tests/hosts/test_mujoco.py",
    "tests/craft/test_embed.py",
    "tests/craft/test_embed_refused.py",
]

#: what the oldest packages that pyproject.toml allows have to hold;
#: some of them use what others have deprecated since
FLOORS = [
    *EMBED,
    "tests/fitting/test_fit.py",
    "tests/fitting/test_spec.py",
    "tests/fitting/test_bad_input.py",
    "tests/cli/test_manners.py",
    "tests/control/test_plant_use.py",
    "-W",
    "ignore::DeprecationWarning",
    # which no shell can pass on, and which their click does not catch
    "-m",
    "not slow",
    "-k",
    "not null_in_the_name",
]

#: goes with the package `worlds`, where that is taken out
MANY = [name for name in ("tests/worlds/test_mjx_worlds.py",) if Path(name).exists()]
MJX = ["tests/hosts/test_mjx.py", *MANY, "tests/hosts/test_mjx_extremes.py"]


def floors() -> list[str]:
    """The oldest release of every dependency, as pyproject.toml has them."""
    wanted = tomllib.loads(Path("pyproject.toml").read_text())["project"]["dependencies"]
    return [re.sub(">=", "==", each) + ".*" for each in wanted]


#: what must import, extra of beamchain, what else is installed, what is run
HOSTS = {
    "oldest": ("mujoco", "", floors(), FLOORS),
    "newest": ("mujoco", "", ["mujoco"], EMBED),
    "dm_control": (
        "dm_control.mjcf",
        "[dm-control]",
        [],
        ["tests/hosts/test_dm_control.py", "tests/hosts/test_mujoco.py", PAGE.format("dm_control")],
    ),
    "basilisk": (
        "Basilisk.simulation.mujoco",
        "[basilisk]",
        KERNEL,
        ["tests/hosts/test_basilisk.py", NOTEBOOK, PAGE.format("basilisk")],
    ),
    "nastran": (
        "pyyeti",
        "[nastran]",
        [],
        [
            "tests/hosts/test_pyyeti.py",
            "tests/hosts/test_pyyeti_superelements.py",
            "tests/structure/test_f06.py",
        ],
    ),
    "sections": (
        "sectionproperties.analysis",
        "[sections]",
        [],
        [
            "tests/hosts/test_sections.py",
            "tests/structure/test_section.py",
            PAGE.format("sections"),
        ],
    ),
    # a second program beside the tests' own finite elements
    "opensees": (
        "openseespy.opensees",
        "",
        ["openseespy"],
        ["tests/hosts/test_opensees.py"],
    ),
    "cluster": ("distributed", "", ["distributed"], [PAGE.format("cluster")]),
    # of mjx, what make test-full runs
    "worlds": ("mujoco.mjx", "[mjx]", [], MANY),
    "mjx": ("mujoco.mjx", "[mjx]", KERNEL, [*MJX, NOTEBOOK, PAGE.format("mjx")]),
    "warp": ("mujoco_warp", "[warp]", [], ["tests/hosts/test_warp.py", PAGE.format("warp")]),
    "newton": ("newton", "[newton]", [], ["tests/hosts/test_newton.py", PAGE.format("newton")]),
}

#: host: what writes files for it first, in an environment of its own, since it cannot share one:
#: what must import there, extra of beamchain, the script, which takes the folder of the files
WRITERS = {"newton": ("mujoco_usd_converter", "[usd]", "tests/hosts/write_usd.py")}

#: host: libraries that its package brings along and does not find by itself, in its environment
LIBRARIES = {"opensees": "lib/python*/site-packages/openseespylinux/lib"}


def main(name: str) -> int:
    if name not in HOSTS:
        sys.stderr.write(f"host {name!r} is unknown; choose from {', '.join(HOSTS)}.\n")
        return 2
    if not HOSTS[name][3]:
        sys.stdout.write(f"host {name}: there is nothing to run\n")
        return 0
    if name in WRITERS:
        module, extra, script = WRITERS[name]
        status = run(f"{name}_writer", module, extra, [], [script, f"build/hosts/{name}_files"])
        if status != 0:
            return 0 if status is None else status
    module, extra, wanted, tests = HOSTS[name]
    tested = ["-m", "pytest", "-rsP", "-p", "no:cacheprovider", *tests]
    return run(name, module, extra, wanted, tested) or 0


def run(name: str, module: str, extra: str, wanted: list[str], words: list[str]) -> int | None:
    """Exit status of `python WORDS` in the environment of this name, which is made if need be.

    None where pip cannot install it.
    """
    folder = Path("build/hosts") / name
    python = folder / "bin" / "python"
    ready = folder / "ready"
    asked = " ".join([extra, *wanted])
    if not ready.exists() or ready.read_text() != asked:
        venv.create(folder, with_pip=True, clear=True)
        pip = [str(python), "-m", "pip", "install", "--disable-pip-version-check"]
        done = subprocess.run(
            [*pip, "--editable", f".{extra}", "pytest>=8", "mpmath", *wanted],
            check=False,
            capture_output=True,
            text=True,
        )
        if done.returncode:
            said = (done.stderr.strip() or "pip failed").splitlines()[-1]
            sys.stdout.write(
                f"host {name}: skipped, pip could not install beamchain{extra} {' '.join(wanted)}: "
                f"{said}\n"
            )
            return None
        ready.write_text(asked)
    surroundings = dict(os.environ)
    if name in LIBRARIES:
        surroundings["LD_LIBRARY_PATH"] = str(next(folder.resolve().glob(LIBRARIES[name])))
    imports = [str(python), "-c", f"import {module}"]
    if subprocess.run(imports, check=False, env=surroundings).returncode:
        sys.stderr.write(
            f"host {name}: installed, but `import {module}` fails; its tests would be skipped "
            "unseen.\n"
        )
        return 1
    sys.stdout.write(f"host {name}:\n")
    sys.stdout.flush()
    return subprocess.run([str(python), *words], check=False, env=surroundings).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]) if len(sys.argv) == 2 else 2)
