"""Identified modes against an independent simulation with 40 modes,
and against the least variance that its logs allow."""

import numpy as np
import pytest
from scipy.stats import binom, chi2

import beamchain as bc
from beamchain import identification
from flight_log import (
    Gyro,
    Hub,
    as_seen,
    boom,
    chirp,
    cramer_rao,
    doublet,
    noise,
    record,
    response,
    seen,
    slew,
    steps_at,
    wings,
    without,
)
from judge import judge, of_record, said
from modes_file import write_prior

# without noise and with as many modes as there are: what least squares in double precision leaves
EXACT = 1e-8
# damping is diagonal in the modes with the port held, not quite in those with free translation
DAMPED = 1e-4
# each side of a 99.9 % interval: a correct program fails such a test once in a thousand seeds
TAIL = 5e-4
BOUND = 0.15  # a standard deviation against the least one, relative: stated in the documentation
COVERED = 0.95

HUB = Hub()
TURNED = np.linalg.qr(np.array([[1.0, 0.3, -0.2], [0.1, 1.0, 0.5], [0.4, -0.3, 1.0]]))[0]
TURNED[2] *= np.sign(np.linalg.det(TURNED))
# about z 1.99, 12.5, 34.9 rad/s; y 2.63, 16.5; x 9.93, 29.8
PAIR = wings(5.0, 1.0, 200.0, 350.0, 50.0, 0.05)
ABOUT_Z = np.flatnonzero(PAIR.participation[5])
TWO = PAIR.kept(ABOUT_Z[:2])
TIME = np.arange(0.0, 120.0, 0.05)
TORQUE = steps_at(TIME, 1.0, 3.0)
FINE = Gyro(1e-5, 2e-4)


def log_about_z(elastic=PAIR, gyro=FINE, seed=0, time=TIME, torque=None, **more):
    torque = steps_at(time, 1.0, 3.0) if torque is None else torque
    return record(HUB, elastic, time, {"z": torque}, gyro, seed, **more)


def relative(found, truth):
    return float(np.max(np.abs(np.asarray(found) / np.asarray(truth) - 1.0)))


# -- without noise ---------------------------------------------------------------------------------
@pytest.mark.parametrize("prior", [None, 1.2], ids=["no prior", "a prior 20 % off"])
@pytest.mark.slow
def test_without_noise_two_modes_are_found_exactly(prior, tmp_path):
    path = None if prior is None else write_prior(tmp_path, TWO, frequency=prior, participation=0.8)
    found = identification.identify(log_about_z(TWO, Gyro()), HUB.xml, "mount", modes=2, prior=path)
    record_ = of_record(found)
    assert relative(record_.frequency, TWO.frequency) < EXACT
    assert relative(record_.damping, TWO.damping) < EXACT
    assert relative(np.abs(record_.participation[5]), np.abs(TWO.participation[5])) < EXACT
    assert relative(seen(HUB, record_)[0][2, 2], HUB.inertia[2, 2] + TWO.rigid[5, 5]) < EXACT


@pytest.mark.slow
def test_without_noise_three_axes_of_turned_wings_are_found_exactly():
    hub = Hub(axes=TURNED)
    four = PAIR.kept(4)
    torques = {axis: steps_at(TIME, 1.0, 3.0, seed) for seed, axis in enumerate("xyz")}
    found = identification.identify(record(hub, four, TIME, torques), hub.xml, "mount", modes=4)
    record_ = of_record(found)
    assert relative(record_.frequency, four.frequency) < EXACT
    assert relative(record_.damping, four.damping) < EXACT
    signs = np.sign((record_.participation * four.participation).sum(axis=0))
    assert (
        np.abs(record_.participation * signs - four.participation).max()
        < EXACT * np.abs(four.participation).max()
    )


@pytest.mark.slow
def test_without_noise_the_response_of_a_boom_is_that_of_the_log():
    """Without a prior, rows of force are left out:
    then the modes are those with free translation."""
    hub = Hub(port=np.array([0.5, 0.1, -0.2]), axes=TURNED)
    four = boom(8.0, 1.2, 500.0, 900.0, 60.0, 0.05).kept(4)
    torques = {axis: steps_at(TIME, 1.0, 3.0, seed) for seed, axis in enumerate("xyz")}
    found = identification.identify(record(hub, four, TIME, torques), hub.xml, "mount", modes=4)
    omega = np.geomspace(0.1, 20.0, 300)
    true = response(hub, four, omega)
    modelled = response(hub, of_record(found), omega)
    assert np.abs(modelled - true).max() < DAMPED * np.abs(true).max()
    assert relative(as_seen(hub, of_record(found))[0], as_seen(hub, four)[0]) < DAMPED
    assert any("translation" in sentence for sentence in said(found))


# -- noise -----------------------------------------------------------------------------------------
def draws(count):
    """Deviations and stated standard deviations `(count, 3, n)` of frequency, damping, row."""
    deviations, stated = [], []
    truth = np.array([TWO.frequency, TWO.damping, np.abs(TWO.participation[5])])
    for seed in range(count):
        found = identification.identify(log_about_z(seed=seed, elastic=TWO), HUB.xml, "mount")
        assert len(found.modes) == 2
        got = [[m.frequency, m.damping, abs(m.participation[5])] for m in found.modes]
        std = [[m.frequency_std, m.damping_std, m.participation_std[5]] for m in found.modes]
        deviations.append(np.transpose(got) - truth)
        stated.append(np.transpose(std))
    return np.array(deviations), np.array(stated)


def agrees_with_theory(deviations, stated):
    count = len(deviations)
    bound = cramer_rao(HUB, TWO, TIME, {"z": steps_at(TIME, 1.0, 3.0)}, FINE.noise)
    inside = (np.abs(deviations) <= 1.96 * stated).sum(axis=0)
    assert inside.min() >= binom.ppf(TAIL / 6.0, count, COVERED), inside
    assert inside.max() <= count  # with few draws, all may be inside
    assert np.abs(stated.mean(axis=0) / bound - 1.0).max() < BOUND, stated.mean(axis=0) / bound
    spread = (deviations**2).sum(axis=0) / bound**2
    assert spread.min() > chi2.ppf(TAIL / 6.0, count)
    assert spread.max() < chi2.isf(TAIL / 6.0, count)


@pytest.mark.slow
def test_intervals_hold_the_truth_and_are_as_narrow_as_the_log_allows():
    """The order is found."""
    agrees_with_theory(*draws(40))


@pytest.mark.slow
def test_the_held_out_piece_is_predicted_to_the_noise():
    log = log_about_z()
    found = identification.identify(log, HUB.xml, "mount", modes=3)
    least = FINE.noise / np.std(log["rate_z"][-TIME.size // 5 :])
    assert 0.9 * least < found.held_out["rate_z"] < 1.2 * least
    assert min(found.whiteness.values()) > 1e-4


@pytest.mark.parametrize("gap", [(93.6, 96.0), (0.7, 90.0)])
@pytest.mark.slow
def test_gaps_leave_a_part_to_hold_out_and_a_sensor_that_fails_in_it_is_noticed(gap):
    """The free motion after a gap is from few samples: what is predicted is above the noise."""
    log = without(log_about_z(), gap)
    last = slice(-(len(log["time"]) // 5), None)
    least = FINE.noise / np.std(log["rate_z"][last])
    found = identification.identify(log, HUB.xml, "mount", modes=3)
    assert 0.9 * least < found.held_out["rate_z"] < 3.0 * least
    assert any(mode.determined for mode in found.modes)
    log["rate_z"][last] = FINE.read(np.zeros(len(log["time"]) // 5))
    dead = identification.identify(log, HUB.xml, "mount", modes=3)
    assert dead.held_out["rate_z"] > 1.0
    assert not any(mode.determined for mode in dead.modes)
    assert any("predicts nothing" in sentence for sentence in dead.undetermined)


def test_noise_alone_has_no_modes():
    with pytest.raises(bc.InputError, match="no flexible mode"):
        identification.identify(log_about_z(PAIR.kept(0), Gyro(1e-4)), HUB.xml, "mount")


# -- harder logs -----------------------------------------------------------------------------------
@pytest.mark.slow
@pytest.mark.parametrize(("apart", "modes"), [(0.01, None), (0.02, 2), (0.04, None)])
def test_two_close_modes_are_two_or_lie_within_the_stated_resolution(apart, modes):
    """The least variance says from where on two can be told:
    at 1 % not even their rows are known to 20 %."""
    pair = doublet(PAIR, "z", 2.0, apart)
    time = np.arange(0.0, 300.0, 0.1)
    torque = steps_at(time, 1.0, 3.0)
    found = identification.identify(
        log_about_z(pair, time=time, torque=torque), HUB.xml, "mount", modes=modes
    )
    verdict = judge(found, pair, [2], [0, 1])
    assert verdict.verdict in ("right", "undetermined"), verdict
    two = len([m for m in found.modes if abs(m.frequency - 2.0) < 0.2]) == 2
    least = cramer_rao(HUB, pair.kept(ABOUT_Z[:2]), time, {"z": torque}, FINE.noise)[0]
    if 2.0 * apart > 10.0 * np.hypot(*least):
        assert two
    if not two:
        assert found.modes[0].resolution > 2.0 * apart


@pytest.mark.parametrize("ratio", [0.0005, 0.05])
@pytest.mark.slow
def test_damping_is_right_from_slight_to_high(ratio):
    pair = PAIR.damped(ratio)
    found = identification.identify(log_about_z(pair), HUB.xml, "mount")
    verdict = judge(found, pair, [2], [0])
    assert verdict.verdict != "wrong", verdict
    first = found.modes[0]
    assert first.determined
    assert first.damping_std < 0.1 * ratio


@pytest.mark.slow
def test_a_mode_above_half_the_sample_rate_is_not_taken_for_a_slow_one():
    time = np.arange(0.0, 300.0, 0.4)  # half the rate is 7.85 rad/s; 12.46 rad/s folds to 3.2 rad/s
    found = identification.identify(
        log_about_z(time=time, torque=steps_at(time, 1.0, 4.0)), HUB.xml, "mount"
    )
    verdict = judge(found, PAIR, [2], [0])
    assert verdict.verdict in ("right", "undetermined"), verdict


@pytest.mark.slow
def test_several_logs_count_together():
    time = np.arange(0.0, 60.0, 0.05)
    logs = [
        log_about_z(time=time, seed=1, torque=chirp(time, 1.0, 0.05, 3.0)),
        log_about_z(time=time, seed=2, torque=slew(time, 2.0)),
        log_about_z(time=time, seed=3, torque=noise(time, 1.0, 5)),
    ]
    alone = identification.identify(logs[0], HUB.xml, "mount", modes=2)
    found = identification.identify(logs, HUB.xml, "mount", modes=2)
    assert judge(found, PAIR, [2], [0, 1]).verdict != "wrong"
    assert found.modes[0].frequency_std < alone.modes[0].frequency_std


@pytest.mark.slow
def test_saturated_samples_are_left_out_and_said():
    log = log_about_z(gyro=Gyro(1e-5, 2e-4, limit=0.012))
    assert np.mean(np.abs(log["rate_z"]) >= 0.012) > 0.02
    found = identification.identify(log, HUB.xml, "mount")
    assert any("saturat" in sentence for sentence in said(found))
    verdict = judge(found, PAIR, [2], [0])
    assert verdict.verdict != "wrong", verdict


# -- what the log does not say ---------------------------------------------------------------------
@pytest.mark.slow
def test_rows_of_other_axes_are_undetermined_without_a_prior():
    found = identification.identify(log_about_z(), HUB.xml, "mount", modes=2)
    for mode in found.modes:
        assert np.isnan(mode.participation_std[[0, 1, 2, 3, 4]]).all()
        assert np.isfinite(mode.participation_std[5])
    assert found.undetermined


@pytest.mark.slow
def test_rows_of_other_axes_come_from_the_prior(tmp_path):
    """A boom pushes as it turns: with the shape of its modes known,
    the clamped frequency follows from rotation alone."""
    hub = Hub(port=np.array([0.5, 0.0, 0.0]))
    elastic = boom(8.0, 1.2, 500.0, 900.0, 60.0, 0.05)
    about_z = np.flatnonzero(elastic.participation[5])
    log = record(hub, elastic, TIME, {"z": steps_at(TIME, 1.0, 3.0)}, FINE)
    path = write_prior(tmp_path, elastic.kept(about_z[:2]), frequency=0.8)
    found = identification.identify(log, hub.xml, "mount", prior=path)
    verdict = judge(found, elastic, [2], [0, 1], hub)
    assert verdict.verdict != "wrong", verdict
    first, true = found.modes[0], about_z[0]
    size = abs(elastic.participation[1, true])
    assert abs(abs(first.participation[1]) - size) < 0.05 * size
    assert abs(first.frequency - elastic.frequency[true]) < max(
        4.0 * first.frequency_std, 1e-3 * first.frequency
    )


@pytest.mark.slow
def test_a_wrong_prior_does_not_win_over_the_log(tmp_path):
    path = write_prior(tmp_path, TWO, frequency=4.0)
    found = identification.identify(log_about_z(), HUB.xml, "mount", prior=path)
    verdict = judge(found, PAIR, [2], [0])
    assert verdict.verdict != "wrong", verdict


@pytest.mark.parametrize("torque", [0.0, 0.7], ids=["none", "constant"])
def test_no_excitation_is_refused(torque):
    log = log_about_z(torque=np.full(TIME.size, torque))
    with pytest.raises(bc.InputError, match="torque"):
        identification.identify(log, HUB.xml, "mount")


def test_degrees_are_noticed():
    log = log_about_z()
    log["rate_z"] = np.degrees(log["rate_z"])
    with pytest.raises(bc.InputError, match="rad/s"):
        identification.identify(log, HUB.xml, "mount")


@pytest.mark.slow
def test_torques_that_cannot_be_told_apart_are_named():
    both = {"y": TORQUE, "z": -2.0 * TORQUE}
    found = identification.identify(record(HUB, PAIR.kept(4), TIME, both, FINE), HUB.xml, "mount")
    assert any("torque_y and torque_z are proportional" in warning for warning in found.warnings)
    apart = {"y": TORQUE, "z": steps_at(TIME, 1.0, 3.0, 7)}
    found = identification.identify(record(HUB, PAIR.kept(4), TIME, apart, FINE), HUB.xml, "mount")
    assert not any("proportional" in warning for warning in found.warnings)


def test_swapped_columns_are_noticed():
    torques = {"y": steps_at(TIME, 1.0, 3.0, 1), "z": steps_at(TIME, 1.0, 3.0, 2)}
    log = record(HUB, PAIR, TIME, torques, FINE)
    log["rate_y"], log["rate_z"] = log["rate_z"], log["rate_y"]
    with pytest.raises(bc.InputError):
        identification.identify(log, HUB.xml, "mount")


def test_a_response_before_its_torque_is_noticed():
    log = log_about_z()
    log["rate_z"] = -log["rate_z"]
    with pytest.raises(bc.InputError):
        identification.identify(log, HUB.xml, "mount")


# -- onwards ---------------------------------------------------------------------------------------
@pytest.mark.slow
def test_the_written_modes_make_a_chain_and_variants(tmp_path):
    # of a pair of wings one chain cannot hold the mass
    one_side = boom(8.0, 1.2, 500.0, 900.0, 60.0, 0.05)
    pushing = one_side.kept(np.flatnonzero(one_side.participation[5])[:2])
    prior = write_prior(tmp_path, pushing)
    found = identification.identify(log_about_z(pushing), HUB.xml, "mount", modes=2, prior=prior)
    found.write(tmp_path / "modes.toml")
    (tmp_path / "wings.toml").write_text('name = "wings"\n[imported]\nfile = "modes.toml"\n')
    fit = bc.fit(bc.read_spec(tmp_path / "wings.toml"))
    achieved = sorted(mode.achieved_rad_s for mode in fit.modes)
    assert relative(achieved, [m.frequency for m in found.modes]) < EXACT
    swept = bc.sweep(HUB.xml, 2, mounts={"mount": tmp_path / "wings.toml"}, seed=1)
    assert swept is not None
