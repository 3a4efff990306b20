"""Files of the chains that an exact one is compared with: equal links, the 2008 paper's three."""

from beamchain import Beam, Hub
from beamchain.chain import baselines
from beamchain.chain.build import with_real_polar
from beamchain.chain.chain import Chain
from beamchain.mjcf import write


def equal_file(beam: Beam, count: int, recipe: str, name: str = "appendage") -> str:
    """MJCF of equal links that bend in the plane xy."""
    return rival_file(baselines.equal_links(beam, count, recipe), name)


def paper_file(beam: Beam) -> str:
    """MJCF of the paper's three links with the beam's first two free frequencies."""
    first, second = (float(w) for w in beam.port("xy", 4).free_frequencies[:2])
    k, c = baselines.seed_parameters(float(beam.rigid_mass()[0, 0]), beam.length, first, second)
    return rival_file(baselines.seed_chain(beam, k, c))


def rival_file(chain: Chain, name: str = "appendage") -> str:
    """MJCF of a chain without a fit."""
    return write.document_text(write.appendage_document(with_real_polar(chain), name))


def rival_scene(chain: Chain, hub: Hub) -> str:
    """MJCF of a chain on a free-flying hub."""
    appendage = write.appendage_document(with_real_polar(chain), "appendage")
    return write.document_text(
        write.scene_document(
            appendage,
            "appendage",
            mass=hub.mass,
            inertia=hub.inertia_matrix(),
            offset=hub.offset,
            timestep=0.01,
            integrator="implicitfast",
        )
    )
