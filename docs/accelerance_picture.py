"""Draw accelerance_xy.svg: the boom of the gallery beside as many equal links as its chain has."""

import numpy as np

import beamchain as bc
from beamchain.chain.baselines import equal_links
from beamchain.report.curves import response, span, undamped_accelerance

fit = bc.fit(bc.read_spec("seed_boom.toml"))
axes = fit.plot(port="xy")
links = equal_links(fit.beam, len(fit.chain.hinges), "classical", "xy").port("xy")
classical = response(undamped_accelerance(links), span(fit, "xy"))
label = f"equal links, {len(fit.chain.hinges)} hinges"
axes.plot(classical.omega, np.abs(classical.values), "--", color="0.5", label=label, zorder=1)
axes.legend(loc="lower left", ncols=2)
axes.figure.savefig("accelerance_xy.svg", metadata={"Date": None})
