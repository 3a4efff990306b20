"""Initial models for an identification: poles of the free craft by several methods from the same
logs, errors and time.

The log is of the independent simulation with 40 modes: 120 s at 20 Hz, random torque steps, gyro
noise 1e-6 to 1e-4 rad/s. The truth: the poles of its first two modes about the axis. Compared are
the search of `identification.identify` (before its likelihood is refined), N4SID of nfoursid, the
eigensystem realisation of pyMOR on a deconvolved impulse response, and the LSCF of sdypy-EMA on a
frequency response, of all whose poles the nearest counts. What is not installed is left out: pip
install nfoursid pymor sdypy-EMA Run: python tests/benchmarks/initial_models.py
"""

import sys
import time
import warnings
from pathlib import Path

import numpy as np
from scipy.linalg import lstsq, toeplitz
from scipy.signal import csd, welch

sys.path.insert(0, str(Path(__file__).parent.parent / "support"))
sys.path.insert(0, str(Path(__file__).parent.parent / "identification"))

from beamchain.identification.channels import time_channels
from beamchain.identification.hub import bare
from beamchain.identification.initial_model import initial_model
from beamchain.identification.logs import read_logs
from flight_log import Gyro, Hub, motion, record, steps_at, wings

HUB = Hub()
STEP = 0.05
PAIR = wings(5.0, 1.0, 200.0, 350.0, 50.0, 0.05)
TIME = np.arange(0.0, 120.0, STEP)
TORQUE = steps_at(TIME, 1.0, 3.0)
LAGS = 900  # samples of the impulse response


def ours(log):
    known = bare(HUB.xml, "mount")
    data = time_channels(read_logs(log, None, [])[0], known, ("x", "y", "z"), None)
    guess = data.outputs @ np.linalg.solve(known.mass[3:, 3:], data.inputs.T)
    return initial_model(data.pieces, guess, data.scale, 2).raw.poles


def n4sid(log):
    import pandas as pd
    from nfoursid.nfoursid import NFourSID

    frame = pd.DataFrame({"u": log["torque_z"], "y": log["rate_z"]})
    method = NFourSID(frame, output_columns=["y"], input_columns=["u"], num_block_rows=60)
    method.subspace_identification()
    system, _ = method.system_identification(rank=7)
    return np.log(np.linalg.eigvals(system.a).astype(complex)) / STEP


def realisation(log):
    from pymor.core.logger import set_log_levels
    from pymor.reductors.era import ERAReductor

    set_log_levels({"pymor": "ERROR"})
    inputs = toeplitz(log["torque_z"], np.zeros(LAGS))
    turn = np.append(np.diff(log["rate_z"]), 0.0)  # whose response to an impulse dies out
    markov = lstsq(inputs[LAGS:], turn[LAGS:])[0]
    model = ERAReductor(markov.reshape(-1, 1, 1), sampling_time=STEP, force_stability=False).reduce(
        r=7
    )
    return np.log(np.asarray(model.poles()).astype(complex)) / STEP


def lscf(log):
    from sdypy import EMA

    rate = np.gradient(log["rate_z"], STEP)
    torque = log["torque_z"]
    given = {"fs": 1.0 / STEP, "nperseg": 1024, "noverlap": 512}
    f, across = csd(torque, rate, **given)
    response = across / welch(torque, **given)[1]
    model = EMA.Model(
        response[None, :],
        f,
        lower=0.1,
        upper=9.0,
        pol_order_high=20,
        frf_type="accelerance",
        driving_point=0,
    )
    model.get_poles(show_progress=False)
    return np.concatenate([np.ravel(some) for some in model.all_poles])


def main():
    poles = np.linalg.eigvals(motion(HUB, PAIR)[0])
    moved = np.flatnonzero(PAIR.participation[5])[:2]
    one = PAIR.kept(np.flatnonzero(PAIR.participation[5]))
    about = np.linalg.eigvals(motion(HUB, one)[0])
    true = np.sort(np.unique(np.round(np.abs(about[np.abs(about) > 0.1]), 9)))[: moved.size]
    assert all(np.min(np.abs(np.abs(poles) - w)) < 1e-6 * w for w in true)
    print("relative error of the first two frequencies of the free craft, and time")
    for noise in (1e-6, 1e-5, 1e-4):
        log = record(HUB, PAIR, TIME, {"z": TORQUE}, Gyro(noise))
        log = {name: np.asarray(values) for name, values in log.items()}
        for name, method in (
            ("beamchain's search", ours),
            ("nfoursid, N4SID", n4sid),
            ("pyMOR, ERA", realisation),
            ("sdypy-EMA, LSCF", lscf),
        ):
            begin = time.perf_counter()
            try:
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore")
                    found = np.abs(method(log))
            except ImportError as error:
                print(f"  {name}: left out ({error})")
                continue
            off = [float(np.nanmin(np.abs(found / w - 1.0))) for w in true]
            print(
                f"  noise {noise:.0e}, {name:20} {off[0]:.1e} {off[1]:.1e}  "
                f"{time.perf_counter() - begin:6.2f} s"
            )


if __name__ == "__main__":
    main()
